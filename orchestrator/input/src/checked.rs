//! A file each mebibyte of which is checked before anything in it is read.

use crate::fingerprint::{Fingerprint, PART_BYTES, fingerprint};
use crate::result::PROVENANCE_FILE;
use parquet::errors::ParquetError;
use parquet::file::reader::{ChunkReader, Length};
use proto::digest::hex;
use sha2::{Digest as _, Sha256};
use std::fs::File;
use std::io::{self, BufReader, Read, Seek, SeekFrom};
use std::os::unix::fs::FileExt as _;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Which bytes of a file are not those that were written.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{place}, by {PROVENANCE_FILE}; give --unverified to read the file as it is")]
pub struct Changed {
    place: String,
}

impl Changed {
    /// Bytes of a file, the last one excluded.
    fn bytes(from: u64, to: u64) -> Self {
        Self {
            place: format!("bytes {from} to {} are not what the run wrote", to.saturating_sub(1)),
        }
    }

    /// A mebibyte of a file.
    fn part(index: u64, length: u64) -> Self {
        Self::bytes(index * PART_BYTES, ((index + 1) * PART_BYTES).min(length))
    }

    /// Where a file differs from the one that was written; `None`: nowhere.
    pub(crate) fn between(found: &Fingerprint, expected: &Fingerprint) -> Option<Self> {
        if found.bytes != expected.bytes {
            return Some(Self::length(found.bytes, expected.bytes));
        }
        if found.is_same_content(expected) {
            return None;
        }
        let mut parts = found.parts().iter().zip(expected.parts());
        let index = parts.position(|(found, expected)| found != expected);
        // Results of earlier versions list whole files alone.
        let is_by_part = found.parts().len() == expected.parts().len();
        Some(match index {
            Some(index) if is_by_part => Self::part(index as u64, found.bytes),
            _ => Self::bytes(0, found.bytes),
        })
    }

    fn length(found: u64, expected: u64) -> Self {
        Self { place: format!("has {found} bytes, but the run wrote {expected}") }
    }

    /// What an error of reading a [`CheckedFile`] says about the file, if that was changed.
    #[must_use]
    pub fn of(error: &io::Error) -> Option<&Self> {
        error.get_ref()?.downcast_ref()
    }
}

/// The mebibytes of a file.
#[derive(Debug)]
struct Parts {
    /// The SHA-256 of each.
    digests: Vec<String>,
    checked: Vec<AtomicBool>,
}

/// A file each mebibyte of which is checked before anything in it is read.
///
/// Errors of reading that are a [`Changed`] say that it was changed.
#[derive(Clone, Debug)]
pub struct CheckedFile {
    file: Arc<File>,
    length: u64,
    position: u64,
    /// None: nothing is checked any more.
    parts: Option<Arc<Parts>>,
}

impl CheckedFile {
    /// A file of which nothing is checked.
    ///
    /// # Errors
    ///
    /// It cannot be opened.
    pub fn unchecked(path: &Path) -> io::Result<Self> {
        let file = File::open(path)?;
        let length = file.metadata()?.len();
        Ok(Self { file: Arc::new(file), length, position: 0, parts: None })
    }

    /// A file that is checked against what was written.
    ///
    /// # Errors
    ///
    /// It cannot be opened; or it has another length, or another content as a whole where nothing is known of its parts: a [`Changed`].
    pub(crate) fn open(path: &Path, expected: &Fingerprint) -> io::Result<Self> {
        let mut file = Self::unchecked(path)?;
        if file.length != expected.bytes {
            return Err(io::Error::other(Changed::length(file.length, expected.bytes)));
        }
        let digests = expected.parts();
        if digests.len() as u64 == file.length.div_ceil(PART_BYTES).max(1) {
            let checked = digests.iter().map(|_| AtomicBool::new(false)).collect();
            file.parts = Some(Arc::new(Parts { digests: digests.to_vec(), checked }));
        } else if let Some(changed) = Changed::between(&fingerprint(path)?, expected) {
            return Err(io::Error::other(changed));
        }
        Ok(file)
    }

    /// The SHA-256 of the whole file.
    ///
    /// # Errors
    ///
    /// It cannot be read, or was changed: a [`Changed`].
    pub fn sha256(&self) -> io::Result<String> {
        let mut file = self.clone();
        file.position = 0;
        let mut hash = Sha256::new();
        let mut block = vec![0; 1 << 16];
        loop {
            match file.read(&mut block)? {
                0 => return Ok(hex(&hash.finalize())),
                n => hash.update(&block[..n]),
            }
        }
    }

    /// Checks what `position` lies in, unless that was done before. Returns how far it reaches.
    fn check_here(&self) -> io::Result<u64> {
        let index = self.position / PART_BYTES;
        let end = ((index + 1) * PART_BYTES).min(self.length);
        let Some(parts) = &self.parts else { return Ok(self.length) };
        if !parts.checked[index as usize].load(Ordering::Relaxed) {
            let mut part = vec![0; (end - index * PART_BYTES) as usize];
            self.file.read_exact_at(&mut part, index * PART_BYTES)?;
            if hex(&Sha256::digest(&part)) != parts.digests[index as usize] {
                return Err(io::Error::other(Changed::part(index, self.length)));
            }
            parts.checked[index as usize].store(true, Ordering::Relaxed);
        }
        Ok(end)
    }
}

impl Read for CheckedFile {
    fn read(&mut self, buf: &mut [u8]) -> io::Result<usize> {
        if self.length <= self.position {
            return Ok(0);
        }
        let room = self.check_here()? - self.position;
        let most = buf.len().min(usize::try_from(room).unwrap_or(usize::MAX));
        let n = self.file.read_at(&mut buf[..most], self.position)?;
        self.position += n as u64;
        Ok(n)
    }
}

impl Seek for CheckedFile {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        let moved = match to {
            SeekFrom::Start(position) => Some(position),
            SeekFrom::End(by) => self.length.checked_add_signed(by),
            SeekFrom::Current(by) => self.position.checked_add_signed(by),
        };
        self.position = moved.ok_or(io::ErrorKind::InvalidInput)?;
        Ok(self.position)
    }
}

impl Length for CheckedFile {
    fn len(&self) -> u64 {
        self.length
    }
}

impl ChunkReader for CheckedFile {
    type T = BufReader<Self>;

    fn get_read(&self, start: u64) -> Result<Self::T, ParquetError> {
        let mut file = self.clone();
        file.seek(SeekFrom::Start(start))?;
        Ok(BufReader::new(file))
    }

    fn get_bytes(&self, start: u64, length: usize) -> Result<bytes::Bytes, ParquetError> {
        let mut buffer = vec![0; length];
        let mut file = self.clone();
        file.seek(SeekFrom::Start(start))?;
        file.read_exact(&mut buffer)?;
        Ok(buffer.into())
    }
}
