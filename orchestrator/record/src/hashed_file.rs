//! A file that knows its own size and SHA-256 when it is whole.

use super::RecordError;
use proto::digest::hex;
use sha2::{Digest as _, Sha256};
use std::io::{BufWriter, Read as _, Write};
use std::path::{Path, PathBuf};
use system::File;

/// Bytes of a part of a file, which has a SHA-256 of its own so that whoever reads a part need not read the whole file to check it.
pub(crate) const PART_BYTES: u64 = 1 << 20;

/// Size and SHA-256 of a file.
#[derive(Clone, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub struct Fingerprint {
    /// Bytes.
    pub bytes: u64,
    /// Lower-case hexadecimal.
    pub sha256: String,
    /// The SHA-256 of each mebibyte (2²⁰ bytes), the last one shorter; empty for a file of at most one, and in results of earlier
    /// versions.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub mebibytes: Vec<String>,
}

impl Fingerprint {
    /// That of a file with this content.
    pub fn hash(content: &[u8]) -> Self {
        let mut hash = PartwiseHash::default();
        hash.update(content);
        hash.finish()
    }

    /// The SHA-256 of each part of [`PART_BYTES`], the last one shorter. A file of at most one is its only part.
    pub(crate) fn parts(&self) -> &[String] {
        if self.mebibytes.is_empty() { std::slice::from_ref(&self.sha256) } else { &self.mebibytes }
    }

    /// Whether another file has the same content.
    #[must_use]
    pub fn is_same_content(&self, other: &Self) -> bool {
        self.bytes == other.bytes && self.sha256 == other.sha256
    }
}

/// The fingerprint of what came so far.
#[derive(Default)]
struct PartwiseHash {
    whole: Sha256,
    part: Sha256,
    parts: Vec<String>,
    n_bytes: u64,
}

impl PartwiseHash {
    fn update(&mut self, mut bytes: &[u8]) {
        self.whole.update(bytes);
        while !bytes.is_empty() {
            let room = PART_BYTES - self.n_bytes % PART_BYTES;
            let (now, later) = bytes.split_at(bytes.len().min(room as usize));
            self.part.update(now);
            self.n_bytes += now.len() as u64;
            if self.n_bytes.is_multiple_of(PART_BYTES) {
                self.parts.push(hex(&self.part.finalize_reset()));
            }
            bytes = later;
        }
    }

    fn finish(mut self) -> Fingerprint {
        if !self.n_bytes.is_multiple_of(PART_BYTES) {
            self.parts.push(hex(&self.part.finalize()));
        }
        if self.parts.len() < 2 {
            self.parts.clear();
        }
        let sha256 = hex(&self.whole.finalize());
        Fingerprint { bytes: self.n_bytes, sha256, mebibytes: self.parts }
    }
}

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
        self.hash.n_bytes
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

/// The fingerprint of a file that stands on disk.
///
/// # Errors
///
/// It cannot be read.
pub fn fingerprint(path: &Path) -> std::io::Result<Fingerprint> {
    let mut file = std::fs::File::open(path)?;
    let mut hash = PartwiseHash::default();
    let mut block = vec![0; 1 << 16];
    loop {
        let n = file.read(&mut block)?;
        if n == 0 {
            return Ok(hash.finish());
        }
        hash.update(&block[..n]);
    }
}
