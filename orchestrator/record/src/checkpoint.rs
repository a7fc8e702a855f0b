//! `checkpoint` in the folder of a run that is not finished: both sides' states after a step, and what of the record up to that
//! step is not in its files yet.
//!
//! The file is replaced as a whole. It begins with a magic number and the SHA-256 of what follows, a [`Checkpoint`] in postcard.

use super::RecordError;
use super::bounded::read_file;
use super::log::{StoredMessage, Topic};
use bytes::Bytes;
use proto::bounds::CHECKPOINT_BYTES;
use proto::digest;
use serde::{Deserialize, Serialize};
use std::io::Write as _;
use std::path::Path;
use system::File;

/// Both sides' states after a step, and where the record stood.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Checkpoint {
    /// The version that wrote it.
    pub version: String,
    /// The latest step, from 1.
    pub step: u64,
    /// The time reached (ns).
    pub time_ns: u64,
    /// The robots' state; `None`: they keep no snapshots.
    pub robots: Option<Bytes>,
    /// The network's state; `None`: it keeps no snapshots.
    pub network: Option<Bytes>,
    /// Where sides run that were not started here: robots, network.
    pub urls: [Option<String>; 2],
    /// Bytes of `radio.pcap` up to here.
    pub(crate) capture_bytes: u64,
    /// The latest messages, by step: what `run.mcap` may not hold yet.
    pub(crate) latest: Vec<(u64, Vec<StoredMessage>)>,
}

/// Why there is no checkpoint to go on from.
#[derive(Debug, thiserror::Error)]
pub enum CheckpointError {
    /// The file cannot be read.
    #[error("cannot read {path}: {source}")]
    Read {
        /// The file.
        path: String,
        /// What the system says.
        source: std::io::Error,
    },
    /// The file is not a checkpoint, or not a whole one.
    #[error("{path}: {reason}")]
    Damaged {
        /// The file.
        path: String,
        /// What is wrong with it.
        reason: String,
    },
}

/// What every checkpoint begins with; the last byte is the format.
const MAGIC: [u8; 8] = *b"murmchk\x01";
/// The file.
pub const FILE: &str = "checkpoint";
/// The file while it is being written.
pub(crate) const UNFINISHED: &str = "checkpoint.new";

/// File descriptors that are kept for the next checkpoint: it is written even if the program can open no more files.
#[derive(Debug)]
pub(crate) struct Reserve(Vec<std::fs::File>);

impl Reserve {
    /// A checkpoint needs one at a time; the others are for what opens a file at the same moment.
    const DESCRIPTORS: usize = 4;

    /// Keeps them, or as many as there are.
    pub(crate) fn keep() -> Self {
        Self((0..Self::DESCRIPTORS).map_while(|_| std::fs::File::open("/dev/null").ok()).collect())
    }
}

impl Checkpoint {
    /// Replaces the checkpoint in `dir`. The reserve is used, and kept anew.
    pub(crate) fn write(&self, dir: &Path, reserve: &mut Reserve) -> Result<(), RecordError> {
        reserve.0.clear();
        let written = self.write_in(dir);
        *reserve = Reserve::keep();
        written
    }

    fn write_in(&self, dir: &Path) -> Result<(), RecordError> {
        let content = postcard::to_stdvec(self).expect("plain data in memory");
        let path = dir.join(UNFINISHED);
        let write = || -> std::io::Result<()> {
            let mut file = File::create(&path)?;
            file.write_all(&MAGIC)?;
            file.write_all(&digest::of_bytes(&content))?;
            file.write_all(&content)?;
            file.sync_all()
        };
        write().map_err(|source| RecordError::Write { path: path.clone(), source })?;
        let to = dir.join(FILE);
        system::point("checkpoint written");
        system::rename(&path, &to).map_err(|source| RecordError::Rename { from: path, to, source })
    }

    /// The checkpoint in `dir`; `None`: there is none.
    ///
    /// # Errors
    ///
    /// It cannot be read, or is damaged.
    pub fn read(dir: &Path) -> Result<Option<Self>, CheckpointError> {
        let path = dir.join(FILE);
        let shown = path.display().to_string();
        let content = match read_file(&CHECKPOINT_BYTES, &path) {
            Ok(content) => content,
            Err(source) if source.kind() == std::io::ErrorKind::NotFound => return Ok(None),
            Err(source) => return Err(CheckpointError::Read { path: shown, source }),
        };
        let damaged = |reason: &str| {
            Err(CheckpointError::Damaged { path: shown.clone(), reason: reason.to_owned() })
        };
        let Some(rest) = content.strip_prefix(&MAGIC) else {
            return damaged("is not a checkpoint of this version of the program");
        };
        match rest.split_at_checked(32) {
            Some((checksum, rest)) if checksum == digest::of_bytes(rest) => {
                match postcard::from_bytes(rest) {
                    Ok(checkpoint) => Ok(Some(checkpoint)),
                    Err(error) => damaged(&error.to_string()),
                }
            }
            _ => damaged("is damaged: its checksum is wrong"),
        }
    }

    /// The messages of steps after `step`, and all of them if `step` is none.
    pub(crate) fn messages_after(&self, step: Option<u64>) -> Vec<(Topic, Vec<u8>)> {
        self.latest
            .iter()
            .filter(|(number, _)| step.is_none_or(|step| step < *number))
            .flat_map(|(_, messages)| messages)
            .filter_map(|(topic, data)| Some((*Topic::ALL.get(usize::from(*topic))?, data.clone())))
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_checkpoint_is_stored_with_the_reserve_which_is_kept_anew() {
        let dir = tempfile::tempdir().unwrap();
        let checkpoint = Checkpoint {
            version: "1".to_owned(),
            step: 3,
            time_ns: 4,
            robots: None,
            network: Some(Bytes::from_static(b"state")),
            urls: [None, None],
            capture_bytes: 0,
            latest: Vec::new(),
        };
        let mut reserve = Reserve::keep();
        assert_eq!(reserve.0.len(), Reserve::DESCRIPTORS);
        checkpoint.write(dir.path(), &mut reserve).unwrap();
        assert_eq!(reserve.0.len(), Reserve::DESCRIPTORS);
        assert_eq!(Checkpoint::read(dir.path()).unwrap(), Some(checkpoint));
    }
}
