//! `run.mcap`: the messages exchanged, as they were, with their descriptors.
//!
//! Nothing in the file depends on when, where or by which version it was written: times are simulated, compression runs
//! in one thread, and transport-dependent fields are cleared before a message comes here.

use super::RecordError;
use super::hashed_file::{Fingerprint, WholeFile};
use mcap::records::MessageHeader;
use mcap::write::NoSeek;
use mcap::{Compression, WriteOptions, Writer};
use prost::Message;
use std::collections::BTreeMap;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// A stream of messages of one type within the log.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Topic {
    RobotConfigureRequest,
    RobotConfigureResponse,
    NetConfigureRequest,
    NetConfigureResponse,
    NetCommand,
    RobotStep,
    NetStep,
    Barrier,
}

impl Topic {
    /// All of them, in the order of their channels.
    pub(crate) const ALL: [Self; 8] = [
        Self::RobotConfigureRequest,
        Self::RobotConfigureResponse,
        Self::NetConfigureRequest,
        Self::NetConfigureResponse,
        Self::NetCommand,
        Self::RobotStep,
        Self::NetStep,
        Self::Barrier,
    ];

    /// Name of the topic, and of the message type without its package.
    pub(crate) fn names(self) -> (&'static str, &'static str) {
        match self {
            Self::RobotConfigureRequest => {
                ("/robotsim/configure/request", "RobotSimServiceConfigureRequest")
            }
            Self::RobotConfigureResponse => {
                ("/robotsim/configure/response", "RobotSimServiceConfigureResponse")
            }
            Self::NetConfigureRequest => {
                ("/netsim/configure/request", "NetSimServiceConfigureRequest")
            }
            Self::NetConfigureResponse => {
                ("/netsim/configure/response", "NetSimServiceConfigureResponse")
            }
            Self::NetCommand => ("/netsim/command", "NetSimServiceCommandRequest"),
            Self::RobotStep => ("/robotsim/step", "RobotSimServiceStepResponse"),
            Self::NetStep => ("/netsim/step", "NetSimServiceStepResponse"),
            Self::Barrier => ("/barrier", "RobotSimServiceBarrierResponse"),
        }
    }

    /// The topic of that name.
    pub(crate) fn named(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|topic| topic.names().0 == name)
    }
}

/// A message as it was recorded: its topic, as an index into [`Topic::ALL`], and its bytes.
pub(crate) type StoredMessage = (u8, Vec<u8>);

/// The log being written.
pub(crate) struct MessageLog {
    path: PathBuf,
    writer: Writer<NoSeek<SharedFile>>,
    file: SharedFile,
    channels: BTreeMap<Topic, u16>,
    buffer: Vec<u8>,
    /// For checkpoints: the messages that the file may not hold yet, by step.
    latest: Option<Vec<(u64, Vec<StoredMessage>)>>,
}

/// The file, which the writer fills and a checkpoint makes sure of.
#[derive(Clone)]
struct SharedFile(Arc<Mutex<WholeFile>>);

impl SharedFile {
    fn lock(&self) -> MutexGuard<'_, WholeFile> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Write for SharedFile {
    fn write(&mut self, buf: &[u8]) -> std::io::Result<usize> {
        self.lock().write(buf)
    }

    fn flush(&mut self) -> std::io::Result<()> {
        self.lock().flush()
    }
}

impl MessageLog {
    /// Begins the log, with all schemas and channels and a few words about the run. If it `keeps_latest` messages, a checkpoint can
    /// be written at any time.
    pub(crate) fn create(
        path: &Path,
        about: BTreeMap<String, String>,
        keeps_latest: bool,
    ) -> Result<Self, RecordError> {
        let file = SharedFile(Arc::new(Mutex::new(WholeFile::create(path.to_owned())?)));
        let failed = |source| failed(path, source);
        let mut writer = WriteOptions::new()
            .compression(Some(Compression::Zstd))
            .compression_level(1)
            .compression_threads(0)
            .profile("murmuration")
            .library("murmuration")
            .disable_seeking(true)
            .create(NoSeek::new(file.clone()))
            .map_err(failed)?;
        writer
            .write_metadata(&mcap::records::Metadata {
                name: "experiment".to_owned(),
                metadata: about,
            })
            .map_err(failed)?;
        let descriptors = descriptors();
        let mut channels = BTreeMap::new();
        for topic in Topic::ALL {
            let (name, message) = topic.names();
            let schema = writer
                .add_schema(&format!("cosim.v1.{message}"), "protobuf", &descriptors)
                .map_err(failed)?;
            let channel =
                writer.add_channel(schema, name, "protobuf", &BTreeMap::new()).map_err(failed)?;
            channels.insert(topic, channel);
        }
        let latest = keeps_latest.then(Vec::new);
        Ok(Self { path: path.to_owned(), writer, file, channels, buffer: Vec::new(), latest })
    }

    /// Adds a message. `step` becomes its sequence number.
    pub(crate) fn write(
        &mut self,
        topic: Topic,
        step: u64,
        time_ns: u64,
        message: &impl Message,
    ) -> Result<(), RecordError> {
        self.buffer.clear();
        message.encode(&mut self.buffer).expect("a vector grows as needed");
        let header = MessageHeader {
            channel_id: self.channels[&topic],
            // Sequence numbers have 32 bits; later ones start again, which the format allows.
            sequence: step as u32,
            log_time: time_ns,
            publish_time: time_ns,
        };
        let n_bytes = self.latest.as_ref().map(|_| self.file.lock().n_bytes());
        self.writer
            .write_to_known_channel(&header, &self.buffer)
            .map_err(|source| failed(&self.path, source))?;
        if let Some(latest) = &mut self.latest {
            if n_bytes != Some(self.file.lock().n_bytes()) {
                // A chunk was written, with all messages before this one. A step is stored as a whole, or not at all.
                latest.retain(|(number, _)| *number == step);
            }
            if latest.last().is_none_or(|(number, _)| *number != step) {
                latest.push((step, Vec::new()));
            }
            if let Some((_, messages)) = latest.last_mut() {
                messages.push((topic as u8, self.buffer.clone()));
            }
        }
        Ok(())
    }

    /// Makes sure that whole chunks are on the disk. Returns the messages that may not be among them, by step.
    pub(crate) fn sync(&mut self) -> Result<Vec<(u64, Vec<StoredMessage>)>, RecordError> {
        self.file.lock().sync()?;
        Ok(self.latest.clone().unwrap_or_default())
    }

    /// Ends the log.
    pub(crate) fn finish(mut self) -> Result<Fingerprint, RecordError> {
        self.writer.finish().map_err(|source| failed(&self.path, source))?;
        drop(self.writer);
        let file = Arc::into_inner(self.file.0).expect("the writer, which shared it, is gone");
        file.into_inner().unwrap_or_else(PoisonError::into_inner).finish()
    }
}

fn failed(path: &Path, source: mcap::McapError) -> RecordError {
    match source {
        mcap::McapError::Io(source) => RecordError::Write { path: path.to_owned(), source },
        source => RecordError::Log { path: path.to_owned(), source: Box::new(source) },
    }
}

/// The descriptors without comments, which readers of a recording have no use for.
fn descriptors() -> Vec<u8> {
    let mut set = prost_types::FileDescriptorSet::decode(proto_messages::FILE_DESCRIPTOR_SET)
        .expect("the descriptors were compiled into the program");
    for file in &mut set.file {
        file.source_code_info = None;
    }
    set.encode_to_vec()
}
