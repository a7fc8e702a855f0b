//! An MCAP file being written. Compression runs in one thread, so that the same messages make the same bytes anywhere.

use super::RecordError;
use super::hashed_file::WholeFile;
use input::fingerprint::Fingerprint;
use mcap::records::{MessageHeader, Metadata};
use mcap::write::NoSeek;
use mcap::{Compression, WriteOptions, Writer};
use std::collections::BTreeMap;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// The file.
pub(crate) struct McapFile {
    path: PathBuf,
    writer: Writer<NoSeek<SharedFile>>,
    file: SharedFile,
}

/// What the writer fills and a checkpoint makes sure of.
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

impl McapFile {
    /// Begins a file, with a few words about the run.
    pub(crate) fn create(
        path: &Path,
        about: BTreeMap<String, String>,
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
        let metadata = Metadata { name: "experiment".to_owned(), metadata: about };
        writer.write_metadata(&metadata).map_err(failed)?;
        Ok(Self { path: path.to_owned(), writer, file })
    }

    /// Adds a channel.
    ///
    /// * `encoding`: of its messages.
    /// * `schema`: its name, its encoding, and what it says.
    pub(crate) fn add_channel(
        &mut self,
        topic: &str,
        encoding: &str,
        (name, schema_encoding, schema): (&str, &str, &[u8]),
    ) -> Result<u16, RecordError> {
        let schema = self
            .writer
            .add_schema(name, schema_encoding, schema)
            .map_err(|source| failed(&self.path, source))?;
        self.writer
            .add_channel(schema, topic, encoding, &BTreeMap::new())
            .map_err(|source| failed(&self.path, source))
    }

    /// Adds a message. `step` becomes its sequence number.
    pub(crate) fn write(
        &mut self,
        channel: u16,
        step: u64,
        time_ns: u64,
        message: &[u8],
    ) -> Result<(), RecordError> {
        let header = MessageHeader {
            channel_id: channel,
            // Sequence numbers have 32 bits; later ones start again, which the format allows.
            sequence: step as u32,
            log_time: time_ns,
            publish_time: time_ns,
        };
        self.writer
            .write_to_known_channel(&header, message)
            .map_err(|source| failed(&self.path, source))
    }

    /// How much was written so far (bytes), whether it is on the disk or not.
    pub(crate) fn n_bytes(&self) -> u64 {
        self.file.lock().n_bytes()
    }

    /// Makes sure that whole chunks are on the disk.
    pub(crate) fn sync(&self) -> Result<(), RecordError> {
        self.file.lock().sync().map(|_| ())
    }

    /// Ends the file.
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
