//! How far the shards of a sweep are, read from their journals while other machines write them.

use crate::SweepError;
use crate::journal::{self, JournalError};
use crate::plan::SweepPlan;
use crate::shard::{self, Shard};
use proto::bounds::JOURNAL_BYTES;
use std::collections::{BTreeMap, BTreeSet};
use std::fs::File;
use std::io::{self, ErrorKind, Seek as _, SeekFrom};
use std::path::{Path, PathBuf};

/// How far all shards are.
pub(super) struct Progress {
    shards: BTreeMap<u32, ShardProgress>,
}

/// How far a shard is.
struct ShardProgress {
    path: PathBuf,
    /// What was read of its journal (bytes).
    offset: u64,
    /// Its trials.
    keys: BTreeSet<String>,
    /// Those of its trials that have a row without failure.
    finished: BTreeSet<String>,
    /// Those whose rows all say that they failed.
    failed: BTreeSet<String>,
    /// It has failed trials from before and is run again for them.
    has_retries: bool,
    /// Its task has ended since.
    is_settled: bool,
}

impl Progress {
    /// Reads the journals that are there.
    pub(super) fn read(plan: &SweepPlan, dir: &Path, n_shards: u32) -> Result<Self, SweepError> {
        let mut keys: BTreeMap<Shard, BTreeSet<String>> = BTreeMap::new();
        for (trial, shard) in shard::owners(plan, n_shards) {
            keys.entry(shard).or_default().insert(plan.key(trial));
        }
        let shards = keys.into_iter().map(|(shard, keys)| {
            let of_shard = ShardProgress {
                path: dir.join(shard.journal_name()),
                offset: 0,
                keys,
                finished: BTreeSet::new(),
                failed: BTreeSet::new(),
                has_retries: false,
                is_settled: false,
            };
            (shard.index(), of_shard)
        });
        let mut progress = Self { shards: shards.collect() };
        progress.update()?;
        for shard in progress.shards.values_mut() {
            shard.has_retries = !shard.failed.is_empty();
        }
        Ok(progress)
    }

    /// Reads what has been added to the journals.
    pub(super) fn update(&mut self) -> Result<(), SweepError> {
        for shard in self.shards.values_mut() {
            let path = shard.path.clone();
            let failed = |source| JournalError::File { path, source };
            match File::open(&shard.path) {
                Ok(file) => shard.read(file).map_err(failed)?,
                Err(error) if error.kind() == ErrorKind::NotFound => {}
                Err(error) => return Err(failed(error).into()),
            }
        }
        Ok(())
    }

    /// Trials that have a row.
    pub(super) fn n_done(&self) -> u64 {
        self.shards.values().map(|shard| (shard.finished.len() + shard.failed.len()) as u64).sum()
    }

    /// The shards that are not done, in order.
    pub(super) fn to_run(&self) -> Vec<u32> {
        self.shards.iter().filter(|(_, shard)| !shard.is_done()).map(|(index, _)| *index).collect()
    }

    /// Whether a shard needs no task any more.
    pub(super) fn is_done(&self, shard: u32) -> bool {
        self.shards.get(&shard).is_none_or(ShardProgress::is_done)
    }

    /// The task of a shard has ended by itself: what failed in it has had its second chance.
    pub(super) fn settle(&mut self, shard: u32) {
        if let Some(shard) = self.shards.get_mut(&shard) {
            shard.is_settled = true;
        }
    }
}

impl ShardProgress {
    fn is_done(&self) -> bool {
        self.finished.len() + self.failed.len() == self.keys.len()
            && (!self.has_retries || self.failed.is_empty() || self.is_settled)
    }

    fn read(&mut self, mut file: File) -> io::Result<()> {
        if file.metadata()?.len() < self.offset {
            // It was begun anew, or rid of damaged lines.
            self.offset = 0;
            self.finished.clear();
            self.failed.clear();
        }
        file.seek(SeekFrom::Start(self.offset))?;
        let bytes = JOURNAL_BYTES.read(file)?;
        let (outcomes, length) = journal::outcomes(&bytes);
        for (key, has_failed) in outcomes {
            if !self.keys.contains(&key) {
                continue;
            }
            if !has_failed {
                self.failed.remove(&key);
                self.finished.insert(key);
            } else if !self.finished.contains(&key) {
                self.failed.insert(key);
            }
        }
        self.offset += length as u64;
        Ok(())
    }
}
