//! What has been run so far: one line per trial, written when it is done, read again when the sweep goes on.
//!
//! A line is written in one piece and brought to the disk before the next; what a program that was killed has left of its
//! last line is no line, and is cut off. Each line ends with a checksum of what is before it. A line that cannot be read, or
//! was changed, is moved to a file of its own, and its trial is run again.

use super::JOURNAL_FILE;
use metrics::figures::FiguresByName;
use proto::bounds::JOURNAL_BYTES;
use proto::digest::hex;
use record::RecordError;
use record::bounded::read_file;
use record::lock::ResultLock;
use serde::{Deserialize, Serialize};
use sha2::{Digest as _, Sha256};
use std::collections::{BTreeMap, BTreeSet};
use std::io::{BufWriter, Write as _};
use std::path::{Path, PathBuf};
use system::File;

/// What came of a trial.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct TrialRow {
    /// What identifies the trial.
    pub(crate) key: String,
    /// Fingerprint of the code of the program that ran it.
    pub(crate) program: String,
    /// `complete`, `not-formed` or `failed`.
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

    /// Whether it failed, twice: there are no figures.
    pub(super) fn has_failed(&self) -> bool {
        self.status == FAILED
    }

    /// Whether another run of the same trial had the same result, whatever program ran it and how long it took.
    pub(super) fn has_same_result(&self, other: &Self) -> bool {
        let result = |row: &Self| {
            (row.key.clone(), row.status.clone(), row.reason.clone(), row.digest.clone())
        };
        result(self) == result(other) && self.values == other.values
    }
}

/// The status of a trial that failed.
pub(super) const FAILED: &str = "failed";

/// The file, and the lock of the folder that it is in.
pub(crate) struct Journal {
    path: PathBuf,
    file: File,
    _lock: ResultLock,
}

/// What a journal holds.
#[derive(Debug, Default)]
pub(crate) struct JournalContent {
    /// The rows by key; of several with the same the last.
    pub(crate) rows: BTreeMap<String, TrialRow>,
    /// What the user should know about it, a sentence each.
    pub(crate) warnings: Vec<String>,
}

/// Why it cannot be kept.
#[derive(Debug, thiserror::Error)]
pub enum JournalError {
    /// Another program writes the folder, or it cannot be locked.
    #[error(transparent)]
    Lock(#[from] RecordError),
    /// The file cannot be read or written.
    #[error("{}: {source}", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// What the system says.
        source: std::io::Error,
    },
}

/// A line of the journal.
enum Line {
    Row(TrialRow),
    /// Without a checksum, as earlier versions wrote them.
    Unchecked(TrialRow),
    Damaged(String),
}

/// What stands before and after the checksum of a line.
const SUM: (&str, &str) = (",\"checksum\":\"", "\"}");
/// Hexadecimal digits of a checksum.
const SUM_DIGITS: usize = 16;

fn checksum(text: &[u8]) -> String {
    hex(&Sha256::digest(text))[..SUM_DIGITS].to_owned()
}

/// A row as its line, without the newline.
fn written(row: &TrialRow) -> Result<String, serde_json::Error> {
    let mut text = serde_json::to_string(row)?;
    let sum = checksum(text.as_bytes());
    text.pop();
    Ok(format!("{text}{}{sum}{}", SUM.0, SUM.1))
}

fn read(line: &[u8]) -> Line {
    let Ok(text) = std::str::from_utf8(line) else {
        return Line::Damaged("it is no text".to_owned());
    };
    let parsed = |text: &str, line: fn(TrialRow) -> Line| match serde_json::from_str(text) {
        Ok(row) => line(row),
        Err(error) => Line::Damaged(error.to_string()),
    };
    let Some((row, sum)) = text.strip_suffix(SUM.1).and_then(|text| text.rsplit_once(SUM.0)) else {
        return parsed(text, Line::Unchecked);
    };
    let row = format!("{row}}}");
    if checksum(row.as_bytes()) == sum {
        parsed(&row, Line::Row)
    } else {
        Line::Damaged("its checksum is not that of its content".to_owned())
    }
}

/// The lines of a journal that was read.
#[derive(Default)]
struct Lines<'a> {
    /// Lines with their rows.
    good: Vec<(&'a [u8], TrialRow)>,
    /// Lines that cannot be used: their number, from 1, the line, and why.
    damaged: Vec<(usize, &'a [u8], String)>,
    /// Number of good lines without a checksum, of earlier versions.
    n_unchecked: usize,
}

/// Length of the whole lines of a journal (bytes): without the line that was being written when a program was killed.
fn whole_length(bytes: &[u8]) -> usize {
    bytes.iter().rposition(|&byte| byte == b'\n').map_or(0, |newline| newline + 1)
}

/// Reads whole lines.
fn lines(bytes: &[u8]) -> Lines<'_> {
    let found: Vec<(usize, &[u8], Line)> = (1..)
        .zip(bytes.split(|&byte| byte == b'\n'))
        .filter(|(_, line)| !line.is_empty())
        .map(|(number, line)| (number, line, read(line)))
        .collect();
    // A program that gives its lines checksums gives them to all.
    let with_checksums: BTreeSet<String> = found
        .iter()
        .filter_map(|(_, _, line)| match line {
            Line::Row(row) => Some(row.program.clone()),
            Line::Unchecked(_) | Line::Damaged(_) => None,
        })
        .collect();
    let mut lines = Lines::default();
    for (number, line, found) in found {
        match found {
            Line::Row(row) => lines.good.push((line, row)),
            Line::Unchecked(row) if with_checksums.contains(&row.program) => {
                lines.damaged.push((number, line, "its checksum is missing".to_owned()));
            }
            Line::Unchecked(row) => {
                lines.n_unchecked += 1;
                lines.good.push((line, row));
            }
            Line::Damaged(reason) => {
                lines.damaged.push((number, line, format!("is damaged ({reason})")));
            }
        }
    }
    lines
}

/// That lines have no checksum; none: all have one.
fn unchecked(path: &Path, n: usize) -> Option<String> {
    (n != 0).then(|| {
        format!(
            "{}: lines without a checksum, of an earlier version of this program: {n}; they are used unchecked, --restart runs \
             their trials again",
            path.display()
        )
    })
}

/// Reads the journal of a shard without changing it: all its rows, and what the user should know, a sentence each. A damaged
/// line counts as missing.
///
/// # Errors
///
/// The file cannot be read.
pub(super) fn read_rows(path: &Path) -> Result<(Vec<TrialRow>, Vec<String>), JournalError> {
    let bytes = read_file(&JOURNAL_BYTES, path)
        .map_err(|source| JournalError::File { path: path.to_owned(), source })?;
    let Lines { good, damaged, n_unchecked } = lines(&bytes[..whole_length(&bytes)]);
    let warnings = damaged.iter().map(|(number, _, problem)| {
        format!("{}:{number}: {problem}; its trial counts as missing", path.display())
    });
    let warnings = warnings.chain(unchecked(path, n_unchecked)).collect();
    Ok((good.into_iter().map(|(_, row)| row).collect(), warnings))
}

impl Journal {
    /// Locks the folder of the sweep, `dir`, and opens the journal of this name in it, or begins one. `anew`: what it holds is
    /// forgotten. The journal of a shard, which has another name than that of the whole sweep, locks itself alone.
    ///
    /// # Errors
    ///
    /// See [`JournalError`].
    pub(crate) fn open(
        dir: &Path,
        name: &str,
        anew: bool,
    ) -> Result<(Self, JournalContent), JournalError> {
        let path = dir.join(name);
        let lock = lock(dir, name)?;
        let failed = |source| JournalError::File { path: path.clone(), source };
        let mut file = File::append(&path).map_err(failed)?;
        if anew {
            file.set_len(0).map_err(failed)?;
        }
        let bytes = JOURNAL_BYTES.read(&mut file).map_err(failed)?;
        let whole = whole_length(&bytes);
        file.set_len(whole as u64).map_err(failed)?;
        let Lines { good, damaged, n_unchecked } = lines(&bytes[..whole]);
        let damaged_file = name.replace(".jsonl", ".damaged");
        let mut content = JournalContent::default();
        for (number, _, problem) in &damaged {
            content.warnings.push(format!(
                "{}:{number}: {problem}; its trial is run again, the line is in {damaged_file}",
                path.display(),
            ));
        }
        content.warnings.extend(unchecked(&path, n_unchecked));
        if !damaged.is_empty() {
            set_apart(&dir.join(damaged_file), damaged.iter().map(|(_, line, _)| *line))
                .map_err(failed)?;
            // The journal without them, whole at any moment.
            let draft = dir.join(format!(".{name}"));
            let lines = good.iter().flat_map(|(line, _)| [line, &b"\n"[..]].concat());
            let lines: Vec<u8> = lines.collect();
            let replaced = system::write(&draft, lines)
                .and_then(|()| system::sync(&draft))
                .and_then(|()| system::rename(&draft, &path))
                .and_then(|()| File::append(&path));
            file = replaced.map_err(failed)?;
        }
        content.rows = good.into_iter().map(|(_, row)| (row.key.clone(), row)).collect();
        Ok((Self { path: path.clone(), file, _lock: lock }, content))
    }

    /// Adds a row.
    ///
    /// # Errors
    ///
    /// The disk is full, or the like.
    pub(crate) fn add(&mut self, row: &TrialRow) -> Result<(), JournalError> {
        let failed = |source| JournalError::File { path: self.path.clone(), source };
        let line = written(row).map_err(|error| failed(error.into()))?;
        self.file.write_all(format!("{line}\n").as_bytes()).map_err(failed)?;
        self.file.sync_data().map_err(failed)
    }

    /// Adds many rows, and brings them to the disk together.
    ///
    /// # Errors
    ///
    /// The disk is full, or the like.
    pub(super) fn add_all<'a>(
        &mut self,
        rows: impl Iterator<Item = &'a TrialRow>,
    ) -> Result<(), JournalError> {
        let failed = |source| JournalError::File { path: self.path.clone(), source };
        let mut file = BufWriter::new(&mut self.file);
        for row in rows {
            let line = written(row).map_err(|error| failed(error.into()))?;
            writeln!(file, "{line}").map_err(failed)?;
        }
        file.flush().map_err(failed)?;
        drop(file);
        self.file.sync_data().map_err(failed)
    }
}

/// Locks a journal. The lock lies beside the folder of the sweep, `dir`, so that it stays where it is if the folder is copied.
fn lock(dir: &Path, name: &str) -> Result<ResultLock, RecordError> {
    let parent = dir.parent().filter(|parent| !parent.as_os_str().is_empty());
    let parent = parent.unwrap_or(Path::new("."));
    let folder = dir.file_name().unwrap_or_default().to_string_lossy();
    if name == JOURNAL_FILE {
        return ResultLock::take(parent, &folder);
    }
    ResultLock::take(parent, &format!("{folder}.{name}")).map_err(|error| match error {
        RecordError::Locked { holder, .. } => RecordError::Locked { path: dir.join(name), holder },
        error => error,
    })
}

/// What came of the trials in a piece of a journal that begins with a line: the key of each, and whether it failed. With the length
/// of its whole lines (bytes). Lines that cannot be read are passed over.
pub(super) fn outcomes(bytes: &[u8]) -> (Vec<(String, bool)>, usize) {
    let whole = whole_length(bytes);
    let rows = bytes[..whole].split(|&byte| byte == b'\n').filter_map(|line| match read(line) {
        Line::Row(row) | Line::Unchecked(row) => Some((row.has_failed(), row.key)),
        Line::Damaged(_) => None,
    });
    (rows.map(|(has_failed, key)| (key, has_failed)).collect(), whole)
}

/// The keys of trials in a journal that need not be run again, without a look at who writes it; none where it cannot be read.
pub(super) fn keys(path: &Path) -> BTreeSet<String> {
    let bytes = read_file(&JOURNAL_BYTES, path).unwrap_or_default();
    let rows = bytes.split(|&byte| byte == b'\n').filter_map(|line| match read(line) {
        Line::Row(row) | Line::Unchecked(row) if !row.has_failed() => Some(row.key),
        _ => None,
    });
    rows.collect()
}

/// Adds lines of a journal that cannot be read to a file beside it.
fn set_apart<'a>(path: &Path, lines: impl Iterator<Item = &'a [u8]>) -> std::io::Result<()> {
    let mut file = File::append(path)?;
    for line in lines {
        file.write_all(&[line, &b"\n"[..]].concat())?;
    }
    file.sync_all()
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
        let open = |anew| Journal::open(folder.path(), "trials.jsonl", anew);
        let (mut journal, content) = open(false).unwrap();
        assert!(content.rows.is_empty());
        let mut ends = vec![0];
        for key in ["a", "b", "c"] {
            journal.add(&row(key)).unwrap();
            ends.push(std::fs::metadata(&path).unwrap().len());
        }
        drop(journal);
        let whole = std::fs::read(&path).unwrap();
        for length in 0..=whole.len() {
            std::fs::write(&path, &whole[..length]).unwrap();
            let (mut journal, content) = open(false).unwrap();
            let n = ends.iter().filter(|&&end| 0 < end && end <= length as u64).count();
            assert_eq!(content.rows.len(), n, "{length} bytes");
            assert!(content.rows.iter().all(|(key, found)| *found == row(key)));
            journal.add(&row("d")).unwrap();
            drop(journal);
            let (_, content) = open(false).unwrap();
            assert_eq!(content.rows.len(), n + 1, "{length} bytes");
        }
    }

    #[test]
    fn two_do_not_write_at_once() {
        let folder = tempfile::tempdir().unwrap();
        let open = || Journal::open(folder.path(), "trials.jsonl", false);
        let journal = open().unwrap();
        let Err(error) = open() else { panic!("it is locked") };
        let process = format!("is being written by process {} on host ", std::process::id());
        assert!(error.to_string().contains(&process), "{error}");
        drop(journal);
        assert!(open().is_ok());
    }

    #[test]
    fn journals_of_shards_are_locked_one_by_one() {
        let folder = tempfile::tempdir().unwrap();
        let dir = folder.path().join("s");
        std::fs::create_dir(&dir).unwrap();
        let open = |name: &str| Journal::open(&dir, name, false);
        let journals = ["trials-1-of-2.jsonl", "trials-2-of-2.jsonl", "trials.jsonl"];
        let held: Vec<_> = journals.map(|name| open(name).unwrap()).into();
        let Err(error) = open("trials-2-of-2.jsonl") else { panic!("it is locked") };
        let locked = format!("{} is being written by process", dir.join(journals[1]).display());
        assert!(error.to_string().contains(&locked), "{error}");
        drop(held);
        assert!(open("trials-2-of-2.jsonl").is_ok());
    }

    #[test]
    fn an_edited_line_costs_its_trial_alone() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("trials.jsonl");
        let open = |anew| Journal::open(folder.path(), "trials.jsonl", anew).unwrap();
        let (mut journal, _) = open(false);
        for key in ["a", "b", "c", "d"] {
            journal.add(&row(key)).unwrap();
        }
        drop(journal);
        let text = std::fs::read_to_string(&path).unwrap();
        let mut lines: Vec<String> = text.lines().map(str::to_owned).collect();
        assert!(lines[1].contains("0.30000000000000004"), "{}", lines[1]);
        lines[1] = lines[1].replace("0.30000000000000004", "0.40000000000000004");
        lines[2] = "{\"key\": 3}".to_owned();
        std::fs::write(&path, lines.join("\n") + "\n").unwrap();
        let (mut journal, content) = open(false);
        assert_eq!(content.rows.keys().collect::<Vec<_>>(), ["a", "d"]);
        assert!(content.warnings[0].contains("trials.jsonl:2: is damaged (its checksum is not"));
        assert!(content.warnings[1].contains("trials.jsonl:3: is damaged (invalid type"));
        journal.add(&row("b")).unwrap();
        drop(journal);
        // The journal holds good lines alone, so that the next one has nothing to say.
        let (_, content) = open(false);
        assert_eq!(content.rows.keys().collect::<Vec<_>>(), ["a", "b", "d"]);
        assert!(content.warnings.is_empty(), "{:?}", content.warnings);
        let apart = std::fs::read_to_string(folder.path().join("trials.damaged")).unwrap();
        assert_eq!(apart.lines().collect::<Vec<_>>(), lines[1..3]);
        assert!(open(true).1.rows.is_empty());
    }

    #[test]
    fn every_changed_byte_of_a_line_is_found() {
        let line = written(&row("a")).unwrap().into_bytes();
        assert!(matches!(read(&line), Line::Row(found) if found == row("a")));
        for place in 0..line.len() {
            let mut line = line.clone();
            line[place] ^= 1;
            assert!(matches!(read(&line), Line::Damaged(_)), "byte {place}");
        }
    }

    #[test]
    fn a_line_that_has_lost_its_checksum_is_run_again() {
        let folder = tempfile::tempdir().unwrap();
        let lost = serde_json::to_string(&row("a")).unwrap();
        let whole = written(&row("b")).unwrap();
        std::fs::write(folder.path().join("trials.jsonl"), format!("{lost}\n{whole}\n")).unwrap();
        let (_, content) = Journal::open(folder.path(), "trials.jsonl", false).unwrap();
        assert_eq!(content.rows.keys().collect::<Vec<_>>(), ["b"]);
        assert!(
            content.warnings[0].contains("trials.jsonl:1: its checksum is missing"),
            "{:?}",
            content.warnings
        );
    }

    #[test]
    fn lines_without_a_checksum_are_read_and_named() {
        let folder = tempfile::tempdir().unwrap();
        let old = serde_json::to_string(&row("a")).unwrap();
        std::fs::write(folder.path().join("trials.jsonl"), format!("{old}\n")).unwrap();
        let (_, content) = Journal::open(folder.path(), "trials.jsonl", false).unwrap();
        assert_eq!(content.rows["a"], row("a"));
        assert!(
            content.warnings[0]
                .contains("lines without a checksum, of an earlier version of this program: 1;"),
            "{:?}",
            content.warnings
        );
    }
}
