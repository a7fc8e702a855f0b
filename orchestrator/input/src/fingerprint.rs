//! The SHA-256 of a file, and of each mebibyte of it.

use proto::digest::hex;
use sha2::{Digest as _, Sha256};
use std::io::Read as _;
use std::path::Path;

/// Bytes of a part of a file, which has a SHA-256 of its own so that a part can be checked by itself.
pub const PART_BYTES: u64 = 1 << 20;

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
    #[must_use]
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
#[derive(Clone, Debug, Default)]
pub struct PartwiseHash {
    whole: Sha256,
    part: Sha256,
    parts: Vec<String>,
    n_bytes: u64,
}

impl PartwiseHash {
    /// Adds what comes next.
    pub fn update(&mut self, mut bytes: &[u8]) {
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

    /// The number of bytes so far.
    #[must_use]
    pub fn n_bytes(&self) -> u64 {
        self.n_bytes
    }

    /// The fingerprint of all that came.
    #[must_use]
    pub fn finish(mut self) -> Fingerprint {
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
