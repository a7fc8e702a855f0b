//! Shards: disjoint parts of the trials of a sweep, which may run on several machines. Each shard has a journal of its own in the
//! folder of the sweep, and [`merge`](super::merge()) makes one table of all journals.
//!
//! No trial depends on the result of another one: the file alone determines all trials, and therefore all shards.

use super::JOURNAL_FILE;
use super::plan::{SweepPlan, SweepTrial};
use experiment::sweep::MOST_TRIALS;
use std::collections::BTreeMap;
use std::fmt;
use std::fs;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::str::FromStr;

/// One of `count` shards of a sweep, written `index/count`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Shard {
    /// Number of the shard, from 1 to `count`.
    index: u32,
    /// Number of shards of the sweep.
    count: u32,
}

/// Why a shard cannot be run, or why shards cannot be merged.
#[derive(Debug, thiserror::Error)]
pub enum ShardError {
    /// There are more shards than trials.
    #[error("--shard {shard}: the sweep has only {n_trials} trials; use at most {n_trials} shards")]
    TooMany {
        /// The shard that was asked for.
        shard: Shard,
        /// Number of trials of the sweep.
        n_trials: usize,
    },
    /// The folder holds journals of different numbers of shards.
    #[error(
        "{}: the sweep was split into different numbers of shards, which overlap: {journals}. Use one number of shards; \
         remove the other journals, or choose another folder with --out",
        dir.display()
    )]
    Overlapping {
        /// The folder of the sweep.
        dir: PathBuf,
        /// The numbers of shards, each with a journal, as text.
        journals: String,
    },
    /// A sweep without `--shard` was started in a folder that holds shards.
    #[error(
        "{} holds shards of a sweep. Run the other shards with --shard and merge them with --merge, or choose another folder \
         with --out",
        .0.display()
    )]
    Unmerged(PathBuf),
    /// The journal of a shard has trials of another sweep.
    #[error(
        "{}: {n_foreign} of its {n} trials are not trials of this sweep; the shard was run with another file or other options. \
         Use those, or remove the journal",
        path.display()
    )]
    AnotherSweep {
        /// The journal.
        path: PathBuf,
        /// Number of trials in the journal that this sweep does not have.
        n_foreign: usize,
        /// Number of trials in the journal.
        n: usize,
    },
    /// There is nothing to merge.
    #[error("{} holds no shards. Run {command} --shard i/n for each i from 1 to n first", dir.display())]
    NoShards {
        /// The folder of the sweep.
        dir: PathBuf,
        /// The command of the sweep, without `--shard`.
        command: String,
    },
    /// Trials or recordings are missing; what is missing, and the commands that run it.
    #[error("{0}")]
    Missing(String),
    /// Two journals, or two lines of one journal, disagree about a trial.
    #[error(
        "trial {trial} has different results in {} and {}. Remove the journal that is wrong, and run its shard again",
        a.display(),
        b.display()
    )]
    Conflict {
        /// Name of the trial.
        trial: String,
        /// A journal that has the trial.
        a: PathBuf,
        /// A journal that has it with another result; may be the same.
        b: PathBuf,
    },
    /// The folder of the sweep cannot be listed.
    #[error("{}: {source}", dir.display())]
    Folder {
        /// The folder.
        dir: PathBuf,
        /// What the system says.
        source: std::io::Error,
    },
}

impl ShardError {
    /// 2: the request was wrong; 1: the work failed.
    pub(super) fn exit_status(&self) -> u8 {
        if matches!(self, Self::Folder { .. }) { 1 } else { 2 }
    }
}

impl fmt::Display for Shard {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}/{}", self.index, self.count)
    }
}

impl FromStr for Shard {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        text.split_once('/').and_then(|(index, count)| Self::parse(index, count)).ok_or_else(|| {
            format!(
                "must be i/n, shard i of n, with whole numbers 1 ≤ i ≤ n ≤ {MOST_TRIALS}, as in 2/3"
            )
        })
    }
}

impl Shard {
    fn parse(index: &str, count: &str) -> Option<Self> {
        // `parse` would also take a sign.
        let number = |text: &str| {
            text.bytes().all(|byte| byte.is_ascii_digit()).then(|| text.parse::<u32>().ok())?
        };
        let (index, count) = (number(index)?, number(count)?);
        let is_valid = 1 <= index && index <= count && i64::from(count) <= MOST_TRIALS;
        is_valid.then_some(Self { index, count })
    }

    /// Number of the shard, from 1.
    pub(super) fn index(self) -> u32 {
        self.index
    }

    /// Number of shards of the sweep.
    pub(super) fn count(self) -> u32 {
        self.count
    }

    /// Name of its journal in the folder of the sweep.
    pub(super) fn journal_name(self) -> String {
        format!("trials-{}-of-{}.jsonl", self.index, self.count)
    }

    /// The shard whose journal has this name.
    fn from_journal_name(name: &str) -> Option<Self> {
        let (index, count) =
            name.strip_prefix("trials-")?.strip_suffix(".jsonl")?.split_once("-of-")?;
        Self::parse(index, count).filter(|shard| shard.journal_name() == name)
    }

    /// Its trials, in the order of the table.
    ///
    /// # Errors
    ///
    /// There are more shards than trials.
    pub(super) fn trials(self, plan: &SweepPlan) -> Result<Vec<SweepTrial>, ShardError> {
        let n_trials = plan.n_trials();
        if n_trials < self.count as usize {
            return Err(ShardError::TooMany { shard: self, n_trials });
        }
        let owners = owners(plan, self.count);
        Ok(owners.into_iter().filter(|(_, owner)| *owner == self).map(|(trial, _)| trial).collect())
    }
}

/// The shard of every trial. Shards take turns over the trials, the longest trial first, so that all take about as long.
pub(super) fn owners(plan: &SweepPlan, count: u32) -> BTreeMap<SweepTrial, Shard> {
    let mut trials: Vec<SweepTrial> = plan.trials().collect();
    // Stable: of equally long trials the first of the table comes first.
    trials.sort_by(|&a, &b| plan.effort(b).total_cmp(&plan.effort(a)));
    let turns = (1..=count).cycle().map(|index| Shard { index, count });
    trials.into_iter().zip(turns).collect()
}

/// The shards that have a journal in the folder of a sweep, in order; none if there is no such folder.
///
/// # Errors
///
/// The folder cannot be listed, or its shards are of different numbers.
pub(super) fn shards_in(dir: &Path) -> Result<Vec<Shard>, ShardError> {
    let failed = |source| ShardError::Folder { dir: dir.to_owned(), source };
    let entries = match fs::read_dir(dir) {
        Err(error) if error.kind() == ErrorKind::NotFound => return Ok(Vec::new()),
        entries => entries.map_err(failed)?,
    };
    let mut shards = Vec::new();
    for entry in entries {
        let name = entry.map_err(failed)?.file_name();
        shards.extend(name.to_str().and_then(Shard::from_journal_name));
    }
    shards.sort_unstable();
    let examples: BTreeMap<u32, Shard> =
        shards.iter().rev().map(|shard| (shard.count, *shard)).collect();
    if 1 < examples.len() {
        return Err(overlapping(dir, examples.values()));
    }
    Ok(shards)
}

/// Refuses to run a shard in a folder that holds shards of another number.
///
/// # Errors
///
/// It does, or the folder cannot be listed.
pub(super) fn check_count(dir: &Path, shard: Shard) -> Result<(), ShardError> {
    let other = shards_in(dir)?.into_iter().find(|other| other.count != shard.count);
    other.map_or(Ok(()), |other| Err(overlapping(dir, [&other, &shard].into_iter())))
}

fn overlapping<'a>(dir: &Path, shards: impl Iterator<Item = &'a Shard>) -> ShardError {
    let journals: Vec<String> =
        shards.map(|shard| format!("{} ({})", shard.count, shard.journal_name())).collect();
    ShardError::Overlapping { dir: dir.to_owned(), journals: journals.join(", ") }
}

/// Whether a folder holds something, but neither a journal of a sweep nor what an engine leaves before there is one.
///
/// # Errors
///
/// See [`shards_in`].
pub(super) fn is_foreign(dir: &Path) -> Result<bool, ShardError> {
    // In this order: the journal is the first file that a sweep makes.
    let is_of_engine = |entry: &fs::DirEntry| entry.file_name() == super::engine::FOLDER;
    let holds_something = fs::read_dir(dir).map_or_else(
        |_| dir.exists(),
        |mut entries| {
            entries.any(|entry| entry.is_err() || entry.is_ok_and(|entry| !is_of_engine(&entry)))
        },
    );
    let has_no_journal = !dir.join(JOURNAL_FILE).exists();
    Ok(holds_something && has_no_journal && (!dir.is_dir() || shards_in(dir)?.is_empty()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_shard_is_one_of_n() {
        for (text, shard) in
            [("1/1", Shard { index: 1, count: 1 }), ("2/3", Shard { index: 2, count: 3 })]
        {
            assert_eq!(text.parse(), Ok(shard));
            assert_eq!(shard.to_string(), text);
            assert_eq!(Shard::from_journal_name(&shard.journal_name()), Some(shard));
        }
        for text in ["0/3", "4/3", "a/b", "1", "1/", "/3", "+1/3", "1/3/3", "1/1000001", "", "-1/3"]
        {
            let error = text.parse::<Shard>().unwrap_err();
            assert!(error.contains("1 ≤ i ≤ n ≤ 1000000"), "{text}: {error}");
        }
        for name in ["trials.jsonl", "trials-4-of-3.jsonl", "trials-01-of-3.jsonl", "trials-1-of-3"]
        {
            assert_eq!(Shard::from_journal_name(name), None, "{name}");
        }
    }
}
