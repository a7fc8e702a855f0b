//! What was submitted: `cluster/submission.json` in the folder of a sweep. A later call of the same command reads it and follows the
//! jobs that are there, rather than submit others.

use super::{EngineError, EngineWork, FOLDER};
use crate::SweepError;
use crate::plan::SweepPlan;
use proto::bounds::DESCRIPTION_BYTES;
use proto::digest::hex;
use record::RecordError;
use record::bounded::read_file;
use record::lock::ResultLock;
use serde::{Deserialize, Serialize};
use sha2::{Digest as _, Sha256};
use std::io::{ErrorKind, Write as _};
use std::path::Path;

const FILE: &str = "submission.json";

/// The jobs of a sweep.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Submission {
    /// Name of the engine.
    pub(super) engine: String,
    /// Number of shards of the sweep.
    pub(super) shards: u32,
    /// Digest of what identifies the trials of the sweep.
    pub(super) trials: String,
    /// The jobs, in the order in which they were submitted.
    pub(super) jobs: Vec<SubmittedJob>,
}

/// A job that was submitted.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct SubmittedJob {
    /// Its number.
    pub(super) id: String,
    /// The shards that its tasks run.
    pub(super) shards: Vec<u32>,
}

impl Submission {
    /// That of this work: the one before, if it is of the same trials in the same shards, or an empty one.
    pub(super) fn of(work: &EngineWork<'_>, before: Option<Self>) -> Self {
        let engine = work.engine().name().to_owned();
        let (shards, trials) = (work.n_shards, digest(work.plan));
        match before {
            Some(before) if before.is_of(&engine, shards, &trials) => before,
            _ => Self { engine, shards, trials, jobs: Vec::new() },
        }
    }

    fn is_of(&self, engine: &str, shards: u32, trials: &str) -> bool {
        (self.engine.as_str(), self.shards, self.trials.as_str()) == (engine, shards, trials)
    }

    /// Reads it, if there is one.
    pub(super) fn read(folder: &Path) -> Result<Option<Self>, EngineError> {
        let path = folder.join(FILE);
        let wrong = |problem: String| EngineError::Submission { path: path.clone(), problem };
        match read_file(&DESCRIPTION_BYTES, &path) {
            Ok(bytes) => {
                serde_json::from_slice(&bytes).map(Some).map_err(|error| wrong(error.to_string()))
            }
            Err(error) if error.kind() == ErrorKind::NotFound => Ok(None),
            Err(error) => Err(wrong(error.to_string())),
        }
    }

    /// Writes it as a whole.
    pub(super) fn write(&self, folder: &Path) -> Result<(), RecordError> {
        write_whole(&folder.join(FILE), record::pretty(self).as_bytes())
    }

    pub(super) fn add(&mut self, id: String, shards: &[u32]) {
        self.jobs.push(SubmittedJob { id, shards: shards.to_vec() });
    }

    /// The numbers of all jobs.
    pub(super) fn ids(&self) -> Vec<String> {
        self.jobs.iter().map(|job| job.id.clone()).collect()
    }

    /// The latest job that runs this shard.
    pub(super) fn job_of(&self, shard: u32) -> Option<&str> {
        let latest = self.jobs.iter().rev().find(|job| job.shards.contains(&shard))?;
        Some(&latest.id)
    }

    /// `job 12 is`, `jobs 12, 13 are`: with the verb for one or for several.
    pub(super) fn job_words(&self, one: &str, several: &str) -> String {
        job_words(&self.ids(), one, several)
    }
}

/// `job 12 is`, `jobs 12, 13 are`: with the verb for one or for several.
pub(super) fn job_words(jobs: &[String], one: &str, several: &str) -> String {
    match jobs {
        [job] => format!("job {job} {one}"),
        jobs => format!("jobs {} {several}", jobs.join(", ")),
    }
}

/// The digest of what identifies the trials of a sweep, in order.
fn digest(plan: &SweepPlan) -> String {
    let mut hash = Sha256::new();
    for trial in plan.trials() {
        hash.update(plan.key(trial));
        hash.update(b"\n");
    }
    hex(&hash.finalize())[..32].to_owned()
}

/// Makes this program the only one that submits jobs of a sweep.
///
/// # Errors
///
/// Another one does.
pub(super) fn lock(dir: &Path) -> Result<ResultLock, SweepError> {
    let parent = dir.parent().filter(|parent| !parent.as_os_str().is_empty());
    let name = dir.file_name().unwrap_or_default().to_string_lossy();
    let lock = ResultLock::take(parent.unwrap_or(Path::new(".")), &format!("{name}.{FOLDER}"));
    Ok(lock.map_err(|error| match error {
        RecordError::Locked { holder, .. } => {
            RecordError::Locked { path: dir.join(FOLDER), holder }
        }
        error => error,
    })?)
}

/// Writes a file under another name first.
pub(super) fn write_whole(path: &Path, content: &[u8]) -> Result<(), RecordError> {
    let failed = |source| RecordError::Write { path: path.to_owned(), source };
    let mut draft = system::Draft::beside(path).map_err(failed)?;
    draft.write_all(content).map_err(failed)?;
    draft.replace(path).map_err(failed)
}
