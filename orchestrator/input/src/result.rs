//! A result that is read again: what its files hold is believed only where it is what the run wrote.
//!
//! `provenance.json` has the SHA-256 of every file, and of each mebibyte of larger ones. [`ResultFolder`] is the one way to the files of
//! a result: it checks a small file as a whole, and of a table or a recording each mebibyte before anything in it is used, so that
//! reading a part of a long recording costs a part of the time.

use crate::Reading;
use crate::checked::{Changed, CheckedFile};
use crate::fingerprint::Fingerprint;
use crate::table::{Table, in_words};
use parquet::errors::ParquetError;
use proto::bounds::{Bound, DESCRIPTION_BYTES};
use serde::Deserialize;
use std::collections::BTreeMap;
use std::ffi::OsStr;
use std::fs::File;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// The file that says what the others held when they were written.
pub const PROVENANCE_FILE: &str = "provenance.json";

/// Whether files are believed as they are found.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Trust {
    /// Only if they are what `provenance.json` says.
    #[default]
    Checked,
    /// Yes: the user said so.
    Unchecked,
}

/// The folder of a result.
#[derive(Clone, Debug)]
pub struct ResultFolder {
    dir: PathBuf,
    reading: Reading,
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
    pub fn open(dir: &Path, reading: impl Into<Reading>) -> Result<Self, ResultError> {
        let reading = reading.into();
        let files = match reading.trust {
            Trust::Unchecked => None,
            Trust::Checked => Some(Arc::new(listed(dir)?)),
        };
        Ok(Self { dir: dir.to_owned(), reading, files })
    }

    /// The folder of a run that this program is writing, or whose files are believed as they are.
    #[must_use]
    pub fn unchecked(dir: &Path) -> Self {
        Self { dir: dir.to_owned(), reading: Trust::Unchecked.into(), files: None }
    }

    /// The result that a file belongs to, and the file's name in it: its folder has a `provenance.json` that lists it. `None`: the file
    /// belongs to no result, or is to be believed.
    ///
    /// # Errors
    ///
    /// A Parquet file stands beside a `provenance.json` that does not list it: the tables of a result are such files.
    pub fn holding(
        path: &Path,
        reading: impl Into<Reading>,
    ) -> Result<Option<(Self, String)>, ResultError> {
        let reading = reading.into();
        if reading.trust == Trust::Unchecked {
            return Ok(None);
        }
        // A link is in a result if it stands there, or leads there.
        for path in [Some(path.to_owned()), path.canonicalize().ok()].into_iter().flatten() {
            let name = path.file_name().and_then(OsStr::to_str);
            let (Some(dir), Some(name)) = (path.parent(), name) else { continue };
            let dir = if dir.as_os_str().is_empty() { Path::new(".") } else { dir };
            if !path.exists() || !dir.join(PROVENANCE_FILE).exists() {
                continue;
            }
            let is_table = name.ends_with(".parquet");
            match Self::open(dir, reading) {
                Ok(folder) if is_table || folder.lists(name) => {
                    return Ok(Some((folder, name.to_owned())));
                }
                Err(error) if is_table => return Err(error),
                _ => {}
            }
        }
        Ok(None)
    }

    fn lists(&self, name: &str) -> bool {
        self.files.as_ref().is_some_and(|files| files.contains_key(name))
    }

    /// How its files are read.
    #[must_use]
    pub fn reading(&self) -> Reading {
        self.reading
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
        let content = File::open(&path)
            .and_then(|file| bound.read(file))
            .map_err(|source| ResultError::Read { path: path.clone(), source })?;
        let expected = self.expected(name)?;
        match expected.and_then(|it| Changed::between(&Fingerprint::hash(&content), it)) {
            Some(changed) => Err(ResultError::Changed { path, changed }),
            None => Ok(content),
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

    /// A table.
    ///
    /// # Errors
    ///
    /// What is read at first was changed, is no Parquet, or takes more memory than there is. What is read later is checked then.
    pub fn table(&self, name: &str) -> Result<Table, ResultError> {
        Table::open(self.dir.join(name), self.file(name)?, self.reading.budget)
    }

    /// A file of any size.
    ///
    /// # Errors
    ///
    /// It cannot be opened, or is not as long as it was.
    pub fn file(&self, name: &str) -> Result<CheckedFile, ResultError> {
        let path = self.dir.join(name);
        let file = match self.expected(name)? {
            Some(expected) => CheckedFile::open(&path, expected),
            None => CheckedFile::unchecked(&path),
        };
        file.map_err(|source| ResultError::of_reading(&path, source))
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

    /// Checks a whole file.
    ///
    /// # Errors
    ///
    /// It was changed or cannot be read.
    pub fn check(&self, name: &str) -> Result<(), ResultError> {
        io::copy(&mut self.file(name)?, &mut io::sink())
            .map_err(|source| ResultError::of_reading(&self.dir.join(name), source))?;
        Ok(())
    }
}

impl ResultError {
    /// Why a file cannot be read: it was changed, or what the system says.
    #[must_use]
    pub fn of_reading(path: &Path, source: io::Error) -> Self {
        let path = path.to_owned();
        match Changed::of(&source) {
            Some(changed) => Self::Changed { path, changed: changed.clone() },
            None => Self::Read { path, source },
        }
    }

    /// Why a table cannot be read.
    #[must_use]
    pub fn of_table(path: &Path, error: ParquetError) -> Self {
        let error = match error {
            ParquetError::External(inner) => match inner.downcast::<io::Error>() {
                Ok(source) => return Self::of_reading(path, *source),
                Err(inner) => ParquetError::External(inner),
            },
            error => error,
        };
        Self::Format { path: path.to_owned(), message: in_words(&error) }
    }
}

/// The files that a result lists.
fn listed(dir: &Path) -> Result<BTreeMap<String, Fingerprint>, ResultError> {
    let path = dir.join(PROVENANCE_FILE);
    let unknown = |reason: String| ResultError::Unknown { path: dir.to_owned(), reason };
    let text = File::open(&path)
        .and_then(|file| DESCRIPTION_BYTES.read(file))
        .map_err(|error| unknown(format!("its {PROVENANCE_FILE} cannot be read ({error})")))?;
    let Listed { files } = serde_json::from_slice(&text)
        .map_err(|error| unknown(format!("its {PROVENANCE_FILE} is damaged ({error})")))?;
    files.ok_or_else(|| {
        unknown(format!("its {PROVENANCE_FILE} lists no files, as in sweeps of earlier versions"))
    })
}
