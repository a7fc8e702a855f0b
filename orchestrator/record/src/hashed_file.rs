//! A file that knows its own size and SHA-256 when it is whole.

use super::RecordError;
use input::fingerprint::{Fingerprint, PartwiseHash};
use std::io::{BufWriter, Write};
use std::path::PathBuf;
use system::File;

/// A file being written.
pub(crate) struct WholeFile {
    path: PathBuf,
    file: BufWriter<File>,
    hash: PartwiseHash,
}

impl WholeFile {
    /// Makes a new file.
    pub(crate) fn create(path: PathBuf) -> Result<Self, RecordError> {
        match File::create_new(&path) {
            Ok(file) => Ok(Self {
                path,
                file: BufWriter::with_capacity(1 << 18, file),
                hash: PartwiseHash::default(),
            }),
            Err(source) => Err(RecordError::Create { path, source }),
        }
    }

    /// Makes sure that what was written so far is on the disk. Returns how much that is (bytes).
    pub(crate) fn sync(&mut self) -> Result<u64, RecordError> {
        let synced = self.file.flush().and_then(|()| self.file.get_ref().sync_data());
        synced.map_err(|source| RecordError::Write { path: self.path.clone(), source })?;
        Ok(self.n_bytes())
    }

    /// How much was written so far (bytes), whether it is on the disk or not.
    pub(crate) fn n_bytes(&self) -> u64 {
        self.hash.n_bytes()
    }

    /// Writes out what is buffered.
    pub(crate) fn finish(mut self) -> Result<Fingerprint, RecordError> {
        self.file.flush().map_err(|source| RecordError::Write { path: self.path, source })?;
        Ok(self.hash.finish())
    }
}

impl Write for WholeFile {
    fn write(&mut self, buf: &[u8]) -> std::io::Result<usize> {
        let n = self.file.write(buf)?;
        self.hash.update(&buf[..n]);
        Ok(n)
    }

    fn flush(&mut self) -> std::io::Result<()> {
        self.file.flush()
    }
}
