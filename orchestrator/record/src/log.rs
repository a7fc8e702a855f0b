//! `run.mcap`: the messages exchanged, as they were, with their descriptors.
//!
//! Nothing in the file depends on when, where or by which version it was written: times are simulated, and transport-dependent
//! fields are cleared before a message comes here.

use super::RecordError;
use super::descriptors::descriptors_of;
use super::hashed_file::Fingerprint;
use super::mcap_file::McapFile;
use prost::Message;
use std::collections::BTreeMap;
use std::path::Path;

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
    file: McapFile,
    channels: BTreeMap<Topic, u16>,
    buffer: Vec<u8>,
    /// For checkpoints: the messages that the file may not hold yet, by step.
    latest: Option<Vec<(u64, Vec<StoredMessage>)>>,
}

impl MessageLog {
    /// Begins the log, with all schemas and channels and a few words about the run. If it `keeps_latest` messages, a checkpoint can
    /// be written at any time.
    pub(crate) fn create(
        path: &Path,
        about: BTreeMap<String, String>,
        keeps_latest: bool,
    ) -> Result<Self, RecordError> {
        let mut file = McapFile::create(path, about)?;
        let mut channels = BTreeMap::new();
        for topic in Topic::ALL {
            let (name, message) = topic.names();
            let message = format!("cosim.v1.{message}");
            let descriptors = descriptors_of(proto_messages::FILE_DESCRIPTOR_SET, &message);
            let schema = (&*message, "protobuf", &*descriptors);
            channels.insert(topic, file.add_channel(name, "protobuf", schema)?);
        }
        let latest = keeps_latest.then(Vec::new);
        Ok(Self { file, channels, buffer: Vec::new(), latest })
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
        let n_bytes = self.latest.as_ref().map(|_| self.file.n_bytes());
        self.file.write(self.channels[&topic], step, time_ns, &self.buffer)?;
        if let Some(latest) = &mut self.latest {
            if n_bytes != Some(self.file.n_bytes()) {
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
        self.file.sync()?;
        Ok(self.latest.clone().unwrap_or_default())
    }

    /// Ends the log.
    pub(crate) fn finish(self) -> Result<Fingerprint, RecordError> {
        self.file.finish()
    }
}
