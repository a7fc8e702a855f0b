//! What can go wrong while recording.

use super::lock::LockHolder;
use super::read::mcap_in_words;
use input::table::in_words;
use parquet::errors::ParquetError;
use std::io::{Error, ErrorKind};
use std::path::PathBuf;

/// Why a run could not be recorded. Every variant names the path it is about; all end the recording.
#[derive(Debug, thiserror::Error)]
pub enum RecordError {
    /// The name of the run cannot be that of a directory everywhere.
    #[error(
        "experiment.name: must be 1 to 100 of the characters A-Z a-z 0-9 . _ -, not starting with a point, got {name:?}"
    )]
    Name {
        /// The name given.
        name: String,
    },
    /// Something that no run left stands where the result is to go.
    #[error("{} exists and is not the result of an earlier run, so it is not replaced; move it away, or choose another \
             experiment.name or --out", path.display())]
    Foreign {
        /// What stands there.
        path: PathBuf,
    },
    /// A symbolic link stands where the result is to go: the folder of a run is put there in one piece, which a link cannot take.
    #[error("{} is a symbolic link, which a result cannot replace; remove it, or give --out the folder that it leads into", path.display())]
    Link {
        /// The link.
        path: PathBuf,
    },
    /// The earlier result could not be moved away for the new one.
    #[error("{} could not be replaced at the end: {reason}; choose another experiment.name or --out", path.display())]
    Immovable {
        /// The earlier result.
        path: PathBuf,
        /// Why not.
        reason: &'static str,
    },
    /// A file that is no longer needed could not be removed.
    #[error("cannot remove {}: {source}", path.display())]
    Remove {
        /// The file.
        path: PathBuf,
        /// What the system says.
        source: std::io::Error,
    },
    /// Another program writes the result.
    #[error("{} is being written by {holder}; wait for it, or choose another experiment.name or --out", path.display())]
    Locked {
        /// The result.
        path: PathBuf,
        /// Who writes it.
        holder: Box<LockHolder>,
    },
    /// Another program took the lock over while this one stood still. The record stands whole under its temporary name.
    #[error(
        "this program stood still for so long that another one took over the lock of {}; the record stays in {}",
        target.display(),
        partial.display()
    )]
    LockLost {
        /// Where the record was to go.
        target: PathBuf,
        /// Where the record stands.
        partial: PathBuf,
    },
    /// A directory or file could not be made. Likely no permission, or the disk is full.
    #[error("cannot create {}: {source}", path.display())]
    Create {
        /// What was to be made.
        path: PathBuf,
        /// What the system says.
        source: std::io::Error,
    },
    /// A run that began anew after a failure came to something else.
    #[error(
        "step {step} differs from the one recorded before the failure, so the run cannot go on: a simulator without \
             snapshots is not deterministic"
    )]
    NotRepeated {
        /// The step.
        step: u64,
    },
    /// What an earlier attempt at the run left cannot be read.
    #[error("cannot read {}: {source}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// What the system says.
        source: std::io::Error,
    },
    /// Writing failed. Likely the disk is full.
    #[error("cannot write {}: {source}", path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// What the system says.
        source: std::io::Error,
    },
    /// The message log failed, most likely for the reason that writing a file fails.
    #[error("cannot write {}: {}", path.display(), mcap_in_words(source))]
    Log {
        /// The file.
        path: PathBuf,
        /// What the writer says.
        source: Box<mcap::McapError>,
    },
    /// A table failed, most likely for the reason that writing a file fails.
    #[error("cannot write {}: {}", path.display(), in_words(source))]
    Table {
        /// The file.
        path: PathBuf,
        /// What the writer says.
        source: ParquetError,
    },
    /// Steps came before the configuration, twice, or not one after the other. A bug in the caller.
    #[error("step {got} cannot be recorded: step {expected} is next")]
    Order {
        /// The step given.
        got: u64,
        /// The step expected; 0 for the configuration.
        expected: u64,
    },
    /// The finished directory could not be put in its place. The record stands whole under its temporary name.
    #[error("cannot rename {} to {}: {source}", from.display(), to.display())]
    Rename {
        /// Where the record stands.
        from: PathBuf,
        /// Where it was to go.
        to: PathBuf,
        /// What the system says.
        source: std::io::Error,
    },
    /// Recording had failed before; that call reported it.
    #[error("the recording in {} ends early: {reason}", path.display())]
    Stopped {
        /// The directory it wrote to.
        path: PathBuf,
        /// What had gone wrong.
        reason: String,
    },
    /// The writer ended without saying why: it panicked. A bug.
    #[error("the writer of {} ended unexpectedly", path.display())]
    Lost {
        /// The directory it wrote to.
        path: PathBuf,
    },
}

impl RecordError {
    /// Whether there is no space left on the disk.
    #[must_use]
    pub fn is_of_full_disk(&self) -> bool {
        let source = match self {
            Self::Create { source, .. }
            | Self::Write { source, .. }
            | Self::Rename { source, .. } => Some(source),
            Self::Log { source, .. } => match &**source {
                mcap::McapError::Io(source) => Some(source),
                _ => None,
            },
            Self::Table { source: ParquetError::External(source), .. } => source.downcast_ref(),
            _ => None,
        };
        source.is_some_and(|source: &Error| source.kind() == ErrorKind::StorageFull)
    }
}
