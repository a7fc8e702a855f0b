//! The folder of a run that was killed: what of it can be read, step by step.

use super::checkpoint::{self, Checkpoint, CheckpointError};
use super::pcap::{self, CapturePart};
use super::read::{ReadError, RunReader};
use super::writer::LOG_FILE;
use super::{RecordError, StepRecord, values};
use proto::exchange::Configured;
use std::path::{Path, PathBuf};

/// An unfinished record, read from its beginning.
pub struct Leftover {
    dir: PathBuf,
    checkpoint: Option<Checkpoint>,
    reader: Option<RunReader>,
    /// The reader is of the messages that the checkpoint stored.
    is_stored: bool,
    n_agents: usize,
    n_steps: u64,
}

/// Why an unfinished record cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum LeftoverError {
    /// There is nothing in it.
    #[error("{} holds no run that can be read: {reason}", path.display())]
    Empty {
        /// The folder.
        path: PathBuf,
        /// Why not.
        reason: String,
    },
    /// Its checkpoint cannot be used.
    #[error(transparent)]
    Checkpoint(#[from] CheckpointError),
}

impl Leftover {
    /// Opens the folder of an unfinished run.
    ///
    /// # Errors
    ///
    /// A checkpoint that is damaged.
    pub fn open(dir: &Path) -> Result<Self, LeftoverError> {
        let checkpoint = Checkpoint::read(dir)?;
        let mut this = Self {
            dir: dir.to_owned(),
            checkpoint,
            reader: None,
            is_stored: false,
            n_agents: 0,
            n_steps: 0,
        };
        // What is not readable to its end is read as far as it goes.
        this.reader = RunReader::open(dir).ok();
        Ok(this)
    }

    /// Its latest checkpoint.
    #[must_use]
    pub fn checkpoint(&self) -> Option<&Checkpoint> {
        self.checkpoint.as_ref()
    }

    /// How both sides were configured. Called first.
    ///
    /// # Errors
    ///
    /// The record does not reach that far.
    pub fn configured(&mut self) -> Result<Configured, LeftoverError> {
        if self.reader.as_ref().is_none_or(|reader| reader.configured().is_none()) {
            self.turn_to_checkpoint(None).map_err(|reason| self.empty(reason))?;
        }
        let recorded = self.reader.as_ref().and_then(RunReader::configured).cloned();
        let Some(recorded) = recorded else {
            return Err(self.empty("the configuration of both sides was not recorded".to_owned()));
        };
        self.n_agents = recorded.robot_request.agent_count as usize;
        values::configured(recorded).map_err(|invalid| self.empty(invalid.to_string()))
    }

    /// The next step that is whole; `None` after the last.
    pub fn next_step(&mut self) -> Option<StepRecord> {
        loop {
            let read = self.reader.as_mut()?.next_step();
            let step = read.ok().flatten().and_then(|step| values::step(step, self.n_agents).ok());
            match step {
                Some(step) if step.step == self.n_steps + 1 => {
                    self.n_steps = step.step;
                    return Some(step);
                }
                _ if self.is_stored => return None,
                // The file ends here: the checkpoint may know more.
                _ => self.turn_to_checkpoint(Some(self.n_steps)).ok()?,
            }
        }
    }

    /// How much of the radio's traffic belongs to the steps up to `time_ns`, if it was recorded.
    ///
    /// # Errors
    ///
    /// The file cannot be read.
    pub fn capture(&self, time_ns: u64) -> Result<Option<CapturePart>, RecordError> {
        let path = self.dir.join(pcap::FILE);
        if !path.exists() {
            return Ok(None);
        }
        let n_bytes = match &self.checkpoint {
            Some(checkpoint) if checkpoint.time_ns == time_ns => checkpoint.capture_bytes,
            _ => pcap::length_until(&path, time_ns)
                .map_err(|source| RecordError::Read { path: path.clone(), source })?,
        };
        Ok(Some(CapturePart { path, n_bytes }))
    }

    /// What is wrong with a record that does not reach the step of its checkpoint.
    #[must_use]
    pub fn ends_before(&self, step: u64) -> LeftoverError {
        let n_steps = self.n_steps;
        self.empty(format!("it ends after step {n_steps}, and its checkpoint is of step {step}"))
    }

    /// Reads on from the messages of steps after `step` that the checkpoint stored.
    fn turn_to_checkpoint(&mut self, step: Option<u64>) -> Result<(), String> {
        let Some(checkpoint) = &self.checkpoint else {
            return Err(format!("{LOG_FILE} holds none, and there is no {}", checkpoint::FILE));
        };
        self.is_stored = true;
        let messages = checkpoint.messages_after(step);
        let reader: Result<RunReader, ReadError> =
            RunReader::stored(self.dir.join(LOG_FILE), messages);
        self.reader = Some(reader.map_err(|error| error.to_string())?);
        Ok(())
    }

    fn empty(&self, reason: String) -> LeftoverError {
        LeftoverError::Empty { path: self.dir.clone(), reason }
    }
}
