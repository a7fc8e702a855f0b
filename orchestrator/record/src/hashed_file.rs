//! A file that knows its own size and SHA-256 when it is whole.

use super::RecordError;
use proto::digest::hex;
use sha2::{Digest as _, Sha256};
use std::fs::File;
use std::io::{BufReader, BufWriter, Read as _, Write};
use std::path::{Path, PathBuf};

/// Size and SHA-256 of a file.
#[derive(Clone, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub struct Fingerprint {
    /// Bytes.
    pub bytes: u64,
    /// Lower-case hexadecimal.
    pub sha256: String,
}

impl Fingerprint {
    /// That of a file with this content.
    pub fn hash(content: &[u8]) -> Self {
        Self { bytes: content.len() as u64, sha256: hex(&Sha256::digest(content)) }
    }
}

/// A file being written.
pub(crate) struct WholeFile {
    path: PathBuf,
    file: BufWriter<File>,
    hash: Sha256,
    n_bytes: u64,
}

impl WholeFile {
    /// Makes a new file.
    pub(crate) fn create(path: PathBuf) -> Result<Self, RecordError> {
        match File::create_new(&path) {
            Ok(file) => Ok(Self {
                path,
                file: BufWriter::with_capacity(1 << 18, file),
                hash: Sha256::new(),
                n_bytes: 0,
            }),
            Err(source) => Err(RecordError::Create { path, source }),
        }
    }

    /// Makes sure that what was written so far is on the disk. Returns how much that is (bytes).
    pub(crate) fn sync(&mut self) -> Result<u64, RecordError> {
        let synced = self.file.flush().and_then(|()| self.file.get_ref().sync_data());
        synced.map_err(|source| RecordError::Write { path: self.path.clone(), source })?;
        Ok(self.n_bytes)
    }

    /// How much was written so far (bytes), whether it is on the disk or not.
    pub(crate) fn n_bytes(&self) -> u64 {
        self.n_bytes
    }

    /// Writes out what is buffered.
    pub(crate) fn finish(mut self) -> Result<Fingerprint, RecordError> {
        self.file.flush().map_err(|source| RecordError::Write { path: self.path, source })?;
        Ok(Fingerprint { bytes: self.n_bytes, sha256: hex(&self.hash.finalize()) })
    }
}

impl Write for WholeFile {
    fn write(&mut self, buf: &[u8]) -> std::io::Result<usize> {
        let n = self.file.write(buf)?;
        self.hash.update(&buf[..n]);
        self.n_bytes += n as u64;
        Ok(n)
    }

    fn flush(&mut self) -> std::io::Result<()> {
        self.file.flush()
    }
}

/// The fingerprint of a file that stands on disk.
///
/// # Errors
///
/// It cannot be read.
pub fn fingerprint(path: &Path) -> std::io::Result<Fingerprint> {
    let mut file = BufReader::new(File::open(path)?);
    let mut hash = Sha256::new();
    let mut n_bytes = 0;
    let mut block = vec![0; 1 << 16];
    loop {
        let n = file.read(&mut block)?;
        if n == 0 {
            return Ok(Fingerprint { bytes: n_bytes, sha256: hex(&hash.finalize()) });
        }
        hash.update(&block[..n]);
        n_bytes += n as u64;
    }
}
