//! What has been run so far: one line per trial, written when it is done, read again when the sweep goes on.
//!
//! A line is written in one piece and brought to the disk before the next; what a program that was killed has left of its
//! last line is no line, and is cut off.

use metrics::figures::FiguresByName;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::fs::{File, OpenOptions, TryLockError};
use std::io::{Read as _, Seek as _, SeekFrom, Write as _};
use std::path::{Path, PathBuf};

/// What came of a trial.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct TrialRow {
    /// What identifies the trial.
    pub(crate) key: String,
    /// Digest of the program that ran it.
    pub(crate) program: String,
    /// `complete` or `not-formed`.
    pub(crate) status: String,
    /// Why not complete.
    pub(crate) reason: Option<String>,
    /// Digest of the last step.
    pub(crate) digest: Option<String>,
    /// Real time (s).
    pub(crate) wall_s: f64,
    /// Its figures, each a number, true, false or null.
    pub(crate) values: FiguresByName,
}

impl TrialRow {
    /// Whether the network formed, so that its figures are of an experiment that took place.
    pub(super) fn has_formed(&self) -> bool {
        self.reason.is_none()
    }
}

/// The file.
pub(crate) struct Journal {
    path: PathBuf,
    file: File,
}

/// Why it cannot be kept.
#[derive(Debug, thiserror::Error)]
pub enum JournalError {
    /// Another sweep writes it.
    #[error("{} is locked: another sweep is running in this folder; wait for it, or choose another --out", .0.display())]
    Busy(PathBuf),
    /// The file cannot be read or written.
    #[error("{}: {source}", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// What the system says.
        source: std::io::Error,
    },
    /// A line is not one that a sweep writes.
    #[error("{}:{line}: not a valid entry of a sweep's journal ({reason}); use --restart to run all trials again", path.display())]
    Damaged {
        /// The file.
        path: PathBuf,
        /// The line, from 1.
        line: usize,
        /// What is wrong with it.
        reason: String,
    },
}

impl Journal {
    /// Opens the journal, or begins one, and returns the rows that it holds by key; of several the last. `anew`: what it
    /// holds is forgotten.
    ///
    /// # Errors
    ///
    /// See [`JournalError`].
    pub(crate) fn open(
        path: &Path,
        anew: bool,
    ) -> Result<(Self, BTreeMap<String, TrialRow>), JournalError> {
        let failed = |source| JournalError::File { path: path.to_owned(), source };
        let mut file = OpenOptions::new()
            .read(true)
            .write(true)
            .create(true)
            .truncate(false)
            .open(path)
            .map_err(failed)?;
        match file.try_lock() {
            Ok(()) => {}
            Err(TryLockError::WouldBlock) => return Err(JournalError::Busy(path.to_owned())),
            Err(TryLockError::Error(source)) => return Err(failed(source)),
        }
        let mut bytes = Vec::new();
        if !anew {
            file.read_to_end(&mut bytes).map_err(failed)?;
        }
        let whole = bytes.iter().rposition(|&byte| byte == b'\n').map_or(0, |newline| newline + 1);
        file.set_len(whole as u64).map_err(failed)?;
        file.seek(SeekFrom::Start(whole as u64)).map_err(failed)?;
        let mut rows = BTreeMap::new();
        for (index, line) in bytes[..whole].split(|&byte| byte == b'\n').enumerate() {
            if line.is_empty() {
                continue;
            }
            let row: TrialRow =
                serde_json::from_slice(line).map_err(|error| JournalError::Damaged {
                    path: path.to_owned(),
                    line: index + 1,
                    reason: error.to_string(),
                })?;
            rows.insert(row.key.clone(), row);
        }
        Ok((Self { path: path.to_owned(), file }, rows))
    }

    /// Adds a row.
    ///
    /// # Errors
    ///
    /// The disk is full, or the like.
    pub(crate) fn add(&mut self, row: &TrialRow) -> Result<(), JournalError> {
        let failed = |source| JournalError::File { path: self.path.clone(), source };
        let mut line = serde_json::to_vec(row).map_err(|error| failed(error.into()))?;
        line.push(b'\n');
        self.file.write_all(&line).map_err(failed)?;
        self.file.sync_data().map_err(failed)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use metrics::figures::FigureValue;

    fn row(key: &str) -> TrialRow {
        let number = FigureValue::Number(0.1 + 0.2);
        let values = FiguresByName::from([("x".to_owned(), Some(number))]);
        TrialRow {
            key: key.to_owned(),
            program: "p".to_owned(),
            status: "complete".to_owned(),
            reason: None,
            digest: None,
            wall_s: 0.5,
            values,
        }
    }

    #[test]
    fn whatever_is_cut_off_costs_the_last_line_alone() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("trials.jsonl");
        let (mut journal, rows) = Journal::open(&path, false).unwrap();
        assert!(rows.is_empty());
        let mut ends = vec![0];
        for key in ["a", "b", "c"] {
            journal.add(&row(key)).unwrap();
            ends.push(std::fs::metadata(&path).unwrap().len());
        }
        drop(journal);
        let whole = std::fs::read(&path).unwrap();
        for length in 0..=whole.len() {
            std::fs::write(&path, &whole[..length]).unwrap();
            let (mut journal, rows) = Journal::open(&path, false).unwrap();
            let n = ends.iter().filter(|&&end| 0 < end && end <= length as u64).count();
            assert_eq!(rows.len(), n, "{length} bytes");
            assert!(rows.iter().all(|(key, found)| *found == row(key)));
            journal.add(&row("d")).unwrap();
            drop(journal);
            let (_, rows) = Journal::open(&path, false).unwrap();
            assert_eq!(rows.len(), n + 1, "{length} bytes");
        }
    }

    #[test]
    fn two_do_not_write_at_once_and_a_damaged_line_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("trials.jsonl");
        let (mut journal, _) = Journal::open(&path, false).unwrap();
        journal.add(&row("a")).unwrap();
        assert!(matches!(Journal::open(&path, false), Err(JournalError::Busy(_))));
        drop(journal);
        let mut text = std::fs::read_to_string(&path).unwrap();
        text.push_str("{\"key\": 3}\n");
        std::fs::write(&path, text).unwrap();
        let error = Journal::open(&path, false).map(|_| ()).unwrap_err().to_string();
        assert!(
            error.contains("trials.jsonl:2: not a valid entry of a sweep's journal"),
            "{error}"
        );
        assert!(Journal::open(&path, true).unwrap().1.is_empty());
    }
}
