//! A result that is read again: what its files hold is believed only where it is what the run wrote.
//!
//! `provenance.json` has the SHA-256 of every file, and of each mebibyte of larger ones. [`ResultFolder`] is the one way to the files of
//! a result: it checks a small file as a whole, and of a table or a recording each mebibyte before anything in it is used, so that
//! reading a part of a long recording costs a part of the time.

use super::bounded::read_file;
use super::hashed_file::{Fingerprint, PART_BYTES, fingerprint};
use super::random_access::Recording;
use super::read::{ReadError, RunReader};
use super::run_summary::RunSummary;
use super::writer::LOG_FILE;
use parquet::errors::ParquetError;
use parquet::file::reader::{ChunkReader, Length, SerializedFileReader};
use proto::bounds::{Bound, DESCRIPTION_BYTES};
use proto::digest::hex;
use serde::Deserialize;
use sha2::{Digest as _, Sha256};
use std::collections::BTreeMap;
use std::fs::File;
use std::io::{self, BufReader, Read, Seek, SeekFrom};
use std::os::unix::fs::FileExt as _;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// The file that says what the others held when they were written.
pub const PROVENANCE_FILE: &str = "provenance.json";

/// Whether files are believed as they are found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Trust {
    /// Only if they are what `provenance.json` says.
    Checked,
    /// Yes: the user said so.
    Unchecked,
}

/// The folder of a result.
#[derive(Clone, Debug)]
pub struct ResultFolder {
    dir: PathBuf,
    /// What the files held; none where nothing is checked.
    files: Option<Arc<BTreeMap<String, Fingerprint>>>,
}

/// Why a file of a result is not believed, or cannot be read.
#[derive(Debug, thiserror::Error)]
pub enum ResultError {
    /// A file was changed after it was written, or damaged.
    #[error("{}: {changed}", path.display())]
    Changed {
        /// The file.
        path: PathBuf,
        /// Where.
        changed: Changed,
    },
    /// There is nothing to check a file against.
    #[error("{}: {reason}, so it cannot be checked; see `verify`, or give --unverified to read it as it is", path.display())]
    Unknown {
        /// The file.
        path: PathBuf,
        /// What is missing.
        reason: String,
    },
    /// A file cannot be read.
    #[error("{}: {source}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// What the system says.
        source: io::Error,
    },
    /// A file is not what its name says.
    #[error("{}: {message}", path.display())]
    Format {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        message: String,
    },
}

/// Which bytes of a file are not those that were written.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{place}, by {PROVENANCE_FILE}; give --unverified to read the file as it is")]
pub struct Changed {
    place: String,
}

impl Changed {
    /// The whole file.
    fn whole() -> Self {
        Self { place: "its content is not what the run wrote".to_owned() }
    }

    /// A mebibyte of it.
    fn part(index: u64, length: u64) -> Self {
        let (from, to) = (index * PART_BYTES, ((index + 1) * PART_BYTES).min(length));
        Self {
            place: format!("bytes {from} to {} are not what the run wrote", to.saturating_sub(1)),
        }
    }
}

/// What `provenance.json` says of the other files.
#[derive(Deserialize)]
struct Listed {
    files: Option<BTreeMap<String, Fingerprint>>,
}

impl ResultFolder {
    /// Opens the folder of a run or a sweep.
    ///
    /// # Errors
    ///
    /// Its `provenance.json` is missing or no list of files, and files are to be checked.
    pub fn open(dir: &Path, trust: Trust) -> Result<Self, ResultError> {
        match trust {
            Trust::Unchecked => Ok(Self::unchecked(dir)),
            Trust::Checked => Ok(Self { dir: dir.to_owned(), files: Some(Arc::new(listed(dir)?)) }),
        }
    }

    /// The folder of a run that this program is writing, or whose files are believed as they are.
    #[must_use]
    pub fn unchecked(dir: &Path) -> Self {
        Self { dir: dir.to_owned(), files: None }
    }

    /// The folder.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.dir
    }

    /// Whether there is such a file.
    #[must_use]
    pub fn has(&self, name: &str) -> bool {
        self.dir.join(name).exists()
    }

    /// What the file should hold; none where nothing is checked.
    fn expected(&self, name: &str) -> Result<Option<&Fingerprint>, ResultError> {
        let Some(files) = &self.files else { return Ok(None) };
        files.get(name).map(Some).ok_or_else(|| ResultError::Unknown {
            path: self.dir.join(name),
            reason: format!("{PROVENANCE_FILE} does not list it"),
        })
    }

    /// A small file as a whole.
    ///
    /// # Errors
    ///
    /// It was changed, or cannot be read up to `bound`.
    pub fn bytes(&self, bound: &Bound, name: &str) -> Result<Vec<u8>, ResultError> {
        let path = self.dir.join(name);
        let content = read_file(bound, &path)
            .map_err(|source| ResultError::Read { path: path.clone(), source })?;
        match self.expected(name)? {
            Some(expected) if !expected.is_same_content(&Fingerprint::hash(&content)) => {
                Err(ResultError::Changed { path, changed: Changed::whole() })
            }
            _ => Ok(content),
        }
    }

    /// A small file of text.
    ///
    /// # Errors
    ///
    /// See [`ResultFolder::bytes`]; and it is not UTF-8.
    pub fn text(&self, bound: &Bound, name: &str) -> Result<String, ResultError> {
        String::from_utf8(self.bytes(bound, name)?).map_err(|error| ResultError::Format {
            path: self.dir.join(name),
            message: error.to_string(),
        })
    }

    /// The summary of a run.
    ///
    /// # Errors
    ///
    /// See [`ResultFolder::bytes`]; and it is not that of a run.
    pub fn summary(&self) -> Result<RunSummary, ResultError> {
        let text = self.bytes(&DESCRIPTION_BYTES, RunSummary::FILE)?;
        serde_json::from_slice(&text).map_err(|error| ResultError::Format {
            path: self.dir.join(RunSummary::FILE),
            message: error.to_string(),
        })
    }

    /// A table.
    ///
    /// # Errors
    ///
    /// What is read at first was changed, or is no Parquet. What is read later is checked then.
    pub fn table(&self, name: &str) -> Result<SerializedFileReader<CheckedFile>, ResultError> {
        SerializedFileReader::new(self.file(name)?).map_err(|error| ResultError::Format {
            path: self.dir.join(name),
            message: error.to_string(),
        })
    }

    /// The recording, for reading any span of it.
    ///
    /// # Errors
    ///
    /// See [`Recording`].
    pub fn recording(&self) -> Result<Recording, ReadError> {
        Recording::open(self.dir.join(LOG_FILE), self.log()?)
    }

    /// The recording, for reading it step by step.
    ///
    /// # Errors
    ///
    /// See [`RunReader`].
    pub fn steps(&self) -> Result<RunReader, ReadError> {
        RunReader::of_file(self.dir.join(LOG_FILE), self.log()?)
    }

    fn log(&self) -> Result<CheckedFile, ReadError> {
        self.file(LOG_FILE).map_err(|error| match error {
            ResultError::Read { path, source } => ReadError::Open { path, source },
            error => ReadError::Unbelieved { source: Box::new(error) },
        })
    }

    /// A file of any size.
    ///
    /// # Errors
    ///
    /// It cannot be opened, or is not as long as it was.
    fn file(&self, name: &str) -> Result<CheckedFile, ResultError> {
        let path = self.dir.join(name);
        let failed = |source| ResultError::Read { path: path.clone(), source };
        let mut file = File::open(&path).and_then(CheckedFile::unchecked).map_err(failed)?;
        let Some(expected) = self.expected(name)? else { return Ok(file) };
        let changed = |changed| ResultError::Changed { path: path.clone(), changed };
        if file.length != expected.bytes {
            let place = format!("has {} bytes, but the run wrote {}", file.length, expected.bytes);
            return Err(changed(Changed { place }));
        }
        let digests = expected.parts();
        if digests.len() as u64 == file.length.div_ceil(PART_BYTES).max(1) {
            let checked = digests.iter().map(|_| AtomicBool::new(false)).collect();
            file.parts = Some(Arc::new(Parts { digests: digests.to_vec(), checked }));
        } else if !expected.is_same_content(&fingerprint(&path).map_err(failed)?) {
            // Results of earlier versions list whole files alone.
            return Err(changed(Changed::whole()));
        }
        Ok(file)
    }

    /// Checks every file that is listed.
    ///
    /// # Errors
    ///
    /// The first that was changed or cannot be read.
    pub fn check_all(&self) -> Result<(), ResultError> {
        for name in self.files.iter().flat_map(|files| files.keys()) {
            self.check(name)?;
        }
        Ok(())
    }

    /// Checks the whole recording.
    ///
    /// # Errors
    ///
    /// It was changed or cannot be read.
    pub fn check_recording(&self) -> Result<(), ResultError> {
        self.check(LOG_FILE)
    }

    fn check(&self, name: &str) -> Result<(), ResultError> {
        let path = self.dir.join(name);
        io::copy(&mut self.file(name)?, &mut io::sink()).map_err(|source| {
            match source.get_ref().and_then(|inner| inner.downcast_ref::<Changed>()) {
                Some(changed) => {
                    ResultError::Changed { path: path.clone(), changed: changed.clone() }
                }
                None => ResultError::Read { path: path.clone(), source },
            }
        })?;
        Ok(())
    }
}

/// The files that a result lists.
fn listed(dir: &Path) -> Result<BTreeMap<String, Fingerprint>, ResultError> {
    let path = dir.join(PROVENANCE_FILE);
    let unknown = |reason: String| ResultError::Unknown { path: dir.to_owned(), reason };
    let text = read_file(&DESCRIPTION_BYTES, &path)
        .map_err(|error| unknown(format!("its {PROVENANCE_FILE} cannot be read ({error})")))?;
    let Listed { files } = serde_json::from_slice(&text)
        .map_err(|error| unknown(format!("its {PROVENANCE_FILE} is damaged ({error})")))?;
    files.ok_or_else(|| {
        unknown(format!("its {PROVENANCE_FILE} lists no files, as in sweeps of earlier versions"))
    })
}

/// The mebibytes of a file.
#[derive(Debug)]
struct Parts {
    /// The SHA-256 of each.
    digests: Vec<String>,
    checked: Vec<AtomicBool>,
}

/// A file each mebibyte of which is checked before anything in it is read.
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
    pub(crate) fn unchecked(file: File) -> io::Result<Self> {
        let length = file.metadata()?.len();
        Ok(Self { file: Arc::new(file), length, position: 0, parts: None })
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
