//! What a run leaves: its configuration, messages, tables, summary, provenance and report. `docs/outputs.md` is the data
//! dictionary.
//!
//! [`Recorder`] takes what the sides replied, as values, and hands it to a thread that writes, so that the disk does not hold up the
//! coupling until it is several steps behind. Files grow in `OUT/.<name>.partial-<pid>/`; when all are whole the directory
//! becomes `OUT/<name>/`, or `OUT/<name>-2/` where it may not replace the result that stands there. [`result`] (of the crate `input`) opens a record again, [`verify()`] checks one.
//!
//! The same configuration and seed leave the same messages, tables and summary, byte for byte. What depends on when, where
//! and how a run was made is in `provenance.json` alone.

pub mod bounded;
pub mod checkpoint;
mod descriptors;
mod directory;
mod ending;
mod error;
pub mod formed;
mod hashed_file;
pub mod leftover;
pub mod lock;
mod log;
mod mcap_file;
mod measurer;
pub mod metric;
mod pcap;
pub mod periods;
pub mod random_access;
pub mod read;
pub mod run_log;
pub mod run_summary;
mod scene;
mod summary;
pub mod table;
mod tables;
mod task_warnings;
pub mod values;
pub mod verify;
mod writer;

pub use error::RecordError;
pub use input::fingerprint::fingerprint;
pub use input::result;
pub use measurer::Measurer;
pub use pcap::CapturePart;
pub use table::{ColumnKind, ColumnShape, TableShape};
pub use tables::TABLES;
pub use verify::verify;

pub use directory::{
    KeptReason, KeptResult, ReplacePolicy, Reservation, SCHEMA_PREFIX, Tagged, forget_progress,
};
pub use summary::TRUTH_BASELINE;
pub use tables::is_column_of_motes;

use directory::{Directory, Published};
use experiment::{OutputConfig, Start};
use input::fingerprint::Fingerprint;
use metrics::Measures;
use proto::config::Choice;
use proto::digest::Digest;
use proto::exchange::{Configured, NetworkStep, RobotsStep};
use proto::types::{Coupling, MoteCommand, NetRecord};
use run_summary::RunSummary;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value, json};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::thread::JoinHandle;
use writer::{Event, RunWriter, Written};
pub use writer::{LOG_FILE, States};

/// What a finished run hands to whoever makes its report.
#[derive(Clone, Copy, Debug)]
pub struct FinishedRun<'a> {
    /// What was known before the run.
    pub header: &'a RunHeader,
    /// Its `summary.json`.
    pub summary: &'a RunSummary,
    /// Its measures; `None` of a run that was never configured.
    pub measures: Option<&'a Measures>,
    /// Its `provenance.json`.
    pub provenance: &'a Value,
    /// The folder of its files, which may still have its temporary name.
    pub dir: &'a Path,
}

/// What is known of a run before it begins.
#[derive(Clone, Debug)]
pub struct RunHeader {
    /// Name of the experiment, and of the directory that it leaves.
    pub name: String,
    /// Seed of every draw.
    pub seed: u64,
    /// Capacity, at least 1.
    pub agent_count: u32,
    /// Nominal control period (ns).
    pub step_ns: u64,
    /// Who takes turns how.
    pub coupling: Coupling,
    /// The whole effective configuration, such that running it again gives the same run.
    pub config_toml: String,
    /// Words to show with the results: `knowledge = truth` marks the truth baseline.
    pub labels: BTreeMap<String, String>,
    /// What to leave.
    pub output: OutputConfig,
    /// When the robots start.
    pub start: Start,
    /// What the network keeps for the record.
    pub records: Vec<NetRecord>,
    /// Name and unit of each statistic of a mote.
    pub statistics: Vec<(String, String)>,
    /// What should be checked before the results are trusted, a sentence each.
    pub warnings: Vec<String>,
    /// [`Recorder::checkpoint`] may be called.
    pub keeps_checkpoints: bool,
}

/// A step that both sides have answered and agree on. The replies are shared with whoever took the step.
#[derive(Clone, Debug)]
pub struct StepRecord {
    /// The step, from 1.
    pub step: u64,
    /// The time reached (ns).
    pub time_ns: u64,
    /// The robots' reply.
    pub robots: Arc<RobotsStep>,
    /// The network's reply.
    pub network: Arc<NetworkStep>,
    /// Orders to the network that took effect in the step, beside those in its reply.
    pub commands: Vec<MoteCommand>,
    /// The digest agreed on.
    pub digest: Digest,
}

/// How a run ended.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Ending {
    /// Whether it ran to its end.
    pub status: Status,
    /// Why not, if it did not.
    pub reason: Option<String>,
    /// The robots waited for a network that did not form in time, and never started.
    pub never_formed: bool,
}

impl Ending {
    /// It ran to its end.
    #[must_use]
    pub fn complete() -> Self {
        Self { status: Status::Complete, reason: None, never_formed: false }
    }

    /// It did not, and why.
    #[must_use]
    pub fn early(status: Status, reason: String) -> Self {
        Self { status, reason: Some(reason), never_formed: false }
    }
}

/// Whether a run ran to its end.
#[derive(Choice, Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Status {
    /// It did.
    Complete,
    /// Something went wrong.
    Failed,
    /// Someone stopped it.
    Interrupted,
}

/// What a run has left.
#[derive(Clone, Debug)]
pub struct Finished {
    /// The directory.
    pub dir: PathBuf,
    /// What is in its `summary.json`.
    pub summary: RunSummary,
    /// Its report, if one was asked for.
    pub report: Option<PathBuf>,
    /// The earlier result that was not replaced: `dir` is then a folder next to it.
    pub kept: Option<KeptResult>,
    /// What could not be done once the result had its name, a sentence each: the result is whole.
    pub warnings: Vec<String>,
}

/// Records a run.
///
/// Dropped without [`Recorder::finish`], it leaves whole files under the temporary name, without a summary.
#[derive(Debug)]
pub struct Recorder {
    header: RunHeader,
    directory: Option<Directory>,
    events: Option<SyncSender<Event>>,
    /// Steps not handed over yet.
    waiting: Vec<StepRecord>,
    n_steps: u64,
    thread: Option<JoinHandle<Result<Written, RecordError>>>,
    failure: Option<String>,
}

impl Recorder {
    /// As [`Recorder::create_in`], in a place of `out` that is reserved for it, with a result that replaces one of the same
    /// experiment alone.
    ///
    /// # Errors
    ///
    /// As [`Reservation::new`] and [`Recorder::create_in`].
    pub fn create(out: &Path, header: RunHeader) -> Result<Self, RecordError> {
        let reservation = Reservation::new(out, &header.name)?;
        Self::create_in(reservation, ReplacePolicy::SameExperiment, header)
    }

    /// Makes the directory under its temporary name and begins all files, so that whatever stands in the way is found
    /// before anything runs. The place stays locked until the result stands there, or the recorder is dropped.
    ///
    /// # Errors
    ///
    /// No permission, no space.
    pub fn create_in(
        reservation: Reservation,
        policy: ReplacePolicy,
        header: RunHeader,
    ) -> Result<Self, RecordError> {
        let directory = Directory::create(reservation, policy)?;
        directory.write("config.toml", header.config_toml.as_bytes())?;
        let writer = RunWriter::create(directory.path(), &header)?;
        let (events, inbox) = sync_channel(MAX_BEHIND);
        let thread = std::thread::Builder::new()
            .name("recorder".to_owned())
            .spawn(move || record(writer, &inbox))
            .map_err(|source| RecordError::Create { path: directory.path().to_owned(), source })?;
        Ok(Self {
            header,
            directory: Some(directory),
            events: Some(events),
            waiting: Vec::new(),
            n_steps: 0,
            thread: Some(thread),
            failure: None,
        })
    }

    /// Records how both sides were configured: once, before any step.
    ///
    /// # Errors
    ///
    /// What went wrong with this or anything recorded before.
    pub fn configured(&mut self, configured: Configured) -> Result<(), RecordError> {
        self.send(Event::Configured(Box::new(configured)))
    }

    /// Records a step. Waits if the disk is several steps behind.
    ///
    /// # Errors
    ///
    /// What went wrong with this or anything recorded before.
    pub fn step(&mut self, record: StepRecord) -> Result<(), RecordError> {
        self.n_steps = record.step;
        self.waiting.push(record);
        let agents = (self.header.agent_count as usize).saturating_mul(self.waiting.len());
        if agents < AGENTS_PER_HANDOVER { Ok(()) } else { self.hand_over() }
    }

    /// Stores both sides' states after the latest step in the folder, so that the run can go on from here after a failure. What is
    /// stored is removed when the record is finished.
    ///
    /// # Errors
    ///
    /// What went wrong with this or anything recorded before.
    pub fn checkpoint(&mut self, states: States) -> Result<(), RecordError> {
        self.hand_over()?;
        self.send(Event::Checkpoint(Box::new(states)))
    }

    /// Records the radio's traffic of steps that are recorded again and come without it. Called before any of them.
    ///
    /// # Errors
    ///
    /// What went wrong with this or anything recorded before.
    pub fn capture(&mut self, part: CapturePart) -> Result<(), RecordError> {
        self.send(Event::Capture(part))
    }

    /// Hands the steps that wait to the thread. Each time wakes it, which costs as much as a step of few robots: these go
    /// many at a time.
    fn hand_over(&mut self) -> Result<(), RecordError> {
        match std::mem::take(&mut self.waiting) {
            steps if steps.is_empty() => Ok(()),
            steps => self.send(Event::Steps(steps)),
        }
    }

    /// Adds a warning to the summary and the report.
    pub fn warn(&mut self, warning: impl Into<String>) {
        self.header.warnings.push(warning.into());
    }

    /// Makes all files whole, adds summary, provenance and report, and gives the directory its name.
    ///
    /// `provenance` is what depends on when, where and how the run was made: versions, hosts, URLs, threads, wall times.
    /// `page` makes the report, if the run leaves one.
    ///
    /// # Errors
    ///
    /// What went wrong with this or anything recorded before. What could be written then stands under the temporary name.
    pub fn finish(
        mut self,
        ending: &Ending,
        provenance: Value,
        page: impl FnOnce(&FinishedRun<'_>) -> String,
    ) -> Result<Finished, RecordError> {
        self.hand_over()?;
        // First: whatever fails from here on, the rest can be repeated from the recording.
        if let Some(directory) = &self.directory {
            ending.store(directory, self.n_steps)?;
        }
        let written = self.join()?;
        let Some(directory) = self.directory.take() else {
            unreachable!("only this function takes it, and it consumes the recorder")
        };
        system::point("files whole");
        let summary = summary::of_run(&self.header, ending, &written);
        let mut files: Map<String, Value> = Map::new();
        let mut add = |name: &str, content: &[u8]| -> Result<(), RecordError> {
            directory.write(name, content)?;
            files.insert(name.to_owned(), json!(Fingerprint::hash(content)));
            Ok(())
        };
        add("summary.json", pretty(&summary).as_bytes())?;
        if self.header.output.report {
            let contents = FinishedRun {
                header: &self.header,
                summary: &summary,
                measures: written.measures.as_ref(),
                provenance: &provenance,
                dir: directory.path(),
            };
            add(REPORT_FILE, page(&contents).as_bytes())?;
        }
        files.insert(
            "config.toml".to_owned(),
            json!(Fingerprint::hash(self.header.config_toml.as_bytes())),
        );
        for (file, _, fingerprint) in &written.files {
            files.insert((*file).to_owned(), json!(fingerprint));
        }
        let mut provenance = match provenance {
            Value::Object(provenance) => provenance,
            Value::Null => Map::new(),
            other => Map::from_iter([("note".to_owned(), other)]),
        };
        provenance.insert("files".to_owned(), Value::Object(files));
        directory.write("provenance.json", pretty(&provenance).as_bytes())?;
        let Published { dir, kept, warnings } = directory.publish(&summary)?;
        let report = self.header.output.report.then(|| dir.join(REPORT_FILE));
        Ok(Finished { dir, summary, report, kept, warnings })
    }

    fn send(&mut self, event: Event) -> Result<(), RecordError> {
        let sent = self.events.as_ref().is_some_and(|events| events.send(event).is_ok());
        if sent {
            return Ok(());
        }
        // The thread has given up: it says why.
        let error = self.join().err().unwrap_or_else(|| RecordError::Lost { path: self.path() });
        self.failure.get_or_insert_with(|| error.to_string());
        Err(error)
    }

    /// Lets the thread finish and takes what it leaves. A second time there is nothing to take.
    fn join(&mut self) -> Result<Written, RecordError> {
        self.events = None;
        match self.thread.take().map(JoinHandle::join) {
            Some(Ok(written)) => written,
            Some(Err(_)) => Err(RecordError::Lost { path: self.path() }),
            None => {
                let reason = self.failure.clone().unwrap_or_default();
                Err(RecordError::Stopped { path: self.path(), reason })
            }
        }
    }

    /// The directory under its temporary name.
    #[must_use]
    pub fn path(&self) -> PathBuf {
        self.directory.as_ref().map(|directory| directory.path().to_owned()).unwrap_or_default()
    }
}

impl Drop for Recorder {
    fn drop(&mut self) {
        // So that the files are whole when the program ends. There is nobody left to tell what went wrong.
        let _ = self.hand_over();
        let _ = self.join();
    }
}

/// The thread: records until nothing more comes, then makes the files whole.
fn record(mut writer: RunWriter, inbox: &Receiver<Event>) -> Result<Written, RecordError> {
    for event in inbox {
        writer.handle(event)?;
    }
    writer.finish()
}

/// JSON with a line for each value, as answers and summaries are written.
///
/// # Panics
///
/// If a map of the value has keys that are not text.
#[must_use]
pub fn pretty(value: &impl Serialize) -> String {
    let json = serde_json::to_value(value).expect("keys are texts, and nothing else fails");
    format!("{json:#}\n")
}

/// So many steps times agents are handed over together.
const AGENTS_PER_HANDOVER: usize = 512;
/// How often steps may be handed over before the coupling waits for the disk.
const MAX_BEHIND: usize = 8;
/// The report.
const REPORT_FILE: &str = "report.html";

#[cfg(test)]
mod tests;
