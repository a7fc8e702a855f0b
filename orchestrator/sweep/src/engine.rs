//! Engines: batch systems that run the shards of a sweep on the machines of a cluster.
//!
//! An engine is one file and one entry of `BUILT_IN`. It writes a job script whose tasks each run one shard, and submits it.
//! Nothing here decides which machine runs what. All tasks and this program share the folder of the sweep: progress is read from
//! the journals of the shards, and the table is made by [`merge`](super::merge()).

mod command;
mod follow;
mod hyperqueue;
mod progress;
mod script;
mod slurm;
mod stop;
mod submission;

pub use script::quoted;

use super::merge::{self, MergeReport};
use super::plan::{self, Machines, SweepPlan};
use super::shard;
use super::{SweepError, SweepOptions, check_folder};
use command::CommandError;
use experiment::Acts;
use record::RecordError;
use script::ShardScript;
use std::path::{Path, PathBuf};
use stop::StopSignal;
use submission::Submission;

/// The engines, in the order in which `--help` lists them.
const BUILT_IN: [&dyn Engine; 2] = [&slurm::Slurm, &hyperqueue::HyperQueue];

/// Folder within that of a sweep which holds what an engine leaves: the script, the jobs that were submitted, logs of tasks.
pub(super) const FOLDER: &str = "cluster";

/// Default of the most shards: more tasks start sooner on a busy cluster and cost less when one is lost, but each starts its own
/// simulators, and clusters bound the size of a job array (Slurm: 1000 unless configured otherwise).
const MOST_SHARDS: usize = 100;

/// A batch system.
pub(crate) trait Engine: Sync {
    /// Its name as a value of `--engine`.
    fn name(&self) -> &'static str;

    /// Its name for people.
    fn title(&self) -> &'static str;

    /// The job script that runs shards, one per task of an array.
    fn script(&self, job: &ShardScript<'_>) -> String;

    /// Submits a script. Returns the number of the job.
    ///
    /// # Errors
    ///
    /// The engine's program is missing, fails or does not end.
    fn submit(&self, script: &Path) -> Result<String, CommandError>;

    /// The command that cancels jobs, for people.
    fn cancel_command(&self, jobs: &[String]) -> String;

    /// The command that waits until a job has ended, for people; for engines that cannot be followed.
    fn wait_command(&self, job: &str) -> String;

    /// Where its tasks can be looked up; `None`: the jobs are submitted and not followed.
    fn queue(&self) -> Option<&dyn Queue>;

    /// How often a shard that was lost is submitted again.
    fn max_resubmissions(&self, plan: &SweepPlan) -> u32;
}

/// Where tasks can be looked up.
pub(crate) trait Queue {
    /// What the engine knows of tasks. `wanted`: job and shard of each; others may be in the answer. One that is missing there is not
    /// known any more. `stop`: gives up early once it is set.
    ///
    /// # Errors
    ///
    /// The engine does not answer, or answers something else.
    fn tasks(&self, wanted: &[(String, u32)], stop: &StopSignal)
    -> Result<Vec<Task>, CommandError>;
}

/// What an engine knows of a task.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Task {
    /// Number of the job.
    pub(crate) job: String,
    /// The shard that it runs.
    pub(crate) shard: u32,
    /// What it is doing.
    pub(crate) state: TaskState,
    /// What the engine says about it, in its own words: state, reason, machine.
    pub(crate) words: String,
}

/// What a task is doing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum TaskState {
    /// It waits to be started, or to be started again.
    Pending,
    /// It runs, or is about to end.
    Running,
    /// Its shard ended by itself, with exit status 0 or another one.
    Ended {
        /// The exit status is 0.
        is_success: bool,
    },
    /// Someone cancelled it.
    Cancelled,
    /// It was lost before its shard ended: a failed node, a time limit, too little memory, a signal.
    Lost,
}

/// How the shards of a sweep are run.
#[derive(Clone, Copy)]
pub struct EngineOptions {
    engine: &'static dyn Engine,
    /// Number of shards; `None`: as many as were submitted before, or one per trial, at most [`MOST_SHARDS`].
    shards: Option<u32>,
    /// Threads per simulator.
    threads: u16,
}

impl std::fmt::Debug for EngineOptions {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "EngineOptions({}, {:?})", self.engine.name(), self.shards)
    }
}

impl EngineOptions {
    /// The engine of this name, if there is one.
    pub fn new(name: &str, shards: Option<u32>, threads: u16) -> Option<Self> {
        let engine = BUILT_IN.into_iter().find(|engine| engine.name() == name)?;
        Some(Self { engine, shards, threads })
    }
}

/// The names of all engines.
pub fn names() -> impl Iterator<Item = &'static str> {
    BUILT_IN.into_iter().map(Engine::name)
}

/// Why the shards of a sweep could not be run by an engine.
#[derive(Debug, thiserror::Error)]
pub enum EngineError {
    /// Nothing was submitted.
    #[error("{title}: nothing was submitted: {error}")]
    Submit {
        /// The engine.
        title: &'static str,
        /// Why.
        error: CommandError,
    },
    /// There are more shards than trials.
    #[error(
        "--shards {shards}: the sweep has only {n_trials} trials; use at most {n_trials} shards"
    )]
    TooMany {
        /// What was asked for.
        shards: u32,
        /// Number of trials of the sweep.
        n_trials: usize,
    },
    /// The sweep was begun with another number of shards.
    #[error(
        "--shards {shards}: {} holds this sweep in {before} shards; use --shards {before}, or choose another folder with --out",
        dir.display()
    )]
    Shards {
        /// What was asked for.
        shards: u32,
        /// What it was begun with.
        before: u32,
        /// The folder of the sweep.
        dir: PathBuf,
    },
    /// A simulator at a URL serves one shard at a time.
    #[error("the simulator at {url} runs one trial at a time; use --shards 1, or no URL")]
    Elsewhere {
        /// Where it runs.
        url: String,
    },
    /// Jobs of another sweep run in this folder.
    #[error(
        "{}: {title} {jobs} in progress, of another file or other options. Cancel with: {cancel} — or choose another folder with \
         --out",
        dir.display()
    )]
    AnotherSweep {
        /// The folder of the sweep.
        dir: PathBuf,
        /// The engine.
        title: &'static str,
        /// The jobs.
        jobs: String,
        /// The command that cancels them.
        cancel: String,
    },
    /// Someone cancelled tasks.
    #[error(
        "{title}: the tasks of {shards} were cancelled, after {done} of {n} trials. Other tasks go on. Run the same command again to \
         submit these shards again"
    )]
    Cancelled {
        /// The engine.
        title: &'static str,
        /// The shards.
        shards: String,
        /// Trials done.
        done: u64,
        /// Trials in all.
        n: u64,
    },
    /// A shard was lost too often.
    #[error(
        "{title}: shard {shard} was lost {} after {done} of {n} trials, the last time because: {reason}. Other tasks go on. Run the \
         same command again to submit it again{log}",
        times(*n_lost)
    )]
    Lost {
        /// The engine.
        title: &'static str,
        /// The shard, as i/n.
        shard: String,
        /// How often it was lost.
        n_lost: u32,
        /// Why the last time.
        reason: String,
        /// Trials done.
        done: u64,
        /// Trials in all.
        n: u64,
        /// Where its log is, and how that ends, if there is one.
        log: String,
    },
    /// The engine does not answer any more.
    #[error(
        "{title} has not answered for {minutes} min: {error}. The jobs go on. Run the same command again to follow them"
    )]
    Silent {
        /// The engine.
        title: &'static str,
        /// For how long (min).
        minutes: u64,
        /// What the last call said.
        error: CommandError,
    },
    /// Someone stopped this program.
    #[error(
        "stopped by {signal} after {done} of {n} trials. {title} {jobs} in progress and not affected. Run the same command again to \
         follow; cancel with: {cancel}"
    )]
    Interrupted {
        /// The signal.
        signal: &'static str,
        /// Trials done.
        done: u64,
        /// Trials in all.
        n: u64,
        /// The engine.
        title: &'static str,
        /// The jobs, with their verb.
        jobs: String,
        /// The command that cancels them.
        cancel: String,
    },
    /// The record of what was submitted cannot be used.
    #[error("{}: {problem}. Remove it once none of its jobs runs any more", path.display())]
    Submission {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        problem: String,
    },
    /// A thread cannot be started, or the folder in which this program runs is gone.
    #[error(transparent)]
    System(#[from] std::io::Error),
}

fn times(n: u32) -> String {
    if n == 1 { "once".to_owned() } else { format!("{n} times") }
}

impl EngineError {
    /// 2: the request was wrong; 1: the work failed.
    pub(super) fn exit_status(&self) -> u8 {
        match self {
            Self::TooMany { .. }
            | Self::Shards { .. }
            | Self::Elsewhere { .. }
            | Self::AnotherSweep { .. }
            | Self::Submit { error: CommandError::Missing { .. }, .. } => 2,
            Self::Submit { .. }
            | Self::Cancelled { .. }
            | Self::Lost { .. }
            | Self::Silent { .. }
            | Self::Interrupted { .. }
            | Self::Submission { .. }
            | Self::System(_) => 1,
        }
    }
}

/// What came of a sweep that an engine runs.
#[derive(Debug)]
pub enum EngineReport {
    /// All shards are finished and merged.
    Merged(Box<MergeReport>),
    /// The shards were submitted and are not followed; what to do next, for people.
    Submitted(String),
}

/// The job script that [`run()`] would submit. Leaves nothing.
///
/// # Errors
///
/// The sweep cannot be run.
pub fn emit(options: &SweepOptions, of_engine: EngineOptions) -> Result<String, SweepError> {
    let plan =
        plan::load(&options.config, &options.overrides.acting(Acts::Reads), Machines::Cluster)?;
    let dir = options.out.join(&plan.name);
    let n_shards = n_shards(&plan, &dir, of_engine.shards, None)?;
    let work = EngineWork { options, of_engine, plan: &plan, dir: &dir, n_shards };
    work.script(&(1..=n_shards).collect::<Vec<_>>())
}

/// Submits the shards of a sweep that are not finished, follows them if the engine allows, and merges all of them.
///
/// # Errors
///
/// See [`EngineError`] and [`SweepError`].
pub fn run(options: &SweepOptions, of_engine: EngineOptions) -> Result<EngineReport, SweepError> {
    let plan = plan::load(&options.config, &options.overrides, Machines::Cluster)?;
    terminal::warn_all(&plan.warnings);
    let dir = options.out.join(&plan.name);
    if shard::is_foreign(&dir)? {
        return Err(SweepError::Foreign(dir));
    }
    let folder = dir.join(FOLDER);
    let before = Submission::read(&folder)?;
    let n_shards = n_shards(&plan, &dir, of_engine.shards, before.as_ref())?;
    system::create_dir_all(&folder)
        .map_err(|source| RecordError::Create { path: folder.clone(), source })?;
    let _lock = submission::lock(&dir)?;
    let work = EngineWork { options, of_engine, plan: &plan, dir: &dir, n_shards };
    match of_engine.engine.queue() {
        Some(queue) => {
            follow::follow(&work, queue, before)?;
            Ok(EngineReport::Merged(Box::new(merge::merge(options)?)))
        }
        None => work.submit_only(before),
    }
}

/// The number of shards of a sweep, at most one per trial.
fn n_shards(
    plan: &SweepPlan,
    dir: &Path,
    asked: Option<u32>,
    before: Option<&Submission>,
) -> Result<u32, SweepError> {
    let n_trials = plan.n_trials();
    let of_journals = shard::shards_in(dir)?.first().map(|shard| shard.count());
    let before = of_journals.or(before.map(|before| before.shards));
    if of_journals.is_none() {
        // Refuses the journal of a sweep that was run as a whole.
        check_folder(dir, None)?;
    }
    let n_shards = match (asked, before) {
        (Some(shards), Some(before)) if shards != before => {
            return Err(EngineError::Shards { shards, before, dir: dir.to_owned() }.into());
        }
        (Some(shards), _) | (None, Some(shards)) => shards,
        (None, None) => n_trials.min(MOST_SHARDS) as u32,
    };
    if n_trials < n_shards as usize {
        return Err(EngineError::TooMany { shards: n_shards, n_trials }.into());
    }
    match &plan.elsewhere {
        Some(url) if 1 < n_shards => Err(EngineError::Elsewhere { url: url.clone() }.into()),
        _ => Ok(n_shards),
    }
}

/// What is run by which engine.
struct EngineWork<'a> {
    options: &'a SweepOptions,
    of_engine: EngineOptions,
    plan: &'a SweepPlan,
    /// The folder of the sweep.
    dir: &'a Path,
    n_shards: u32,
}

impl EngineWork<'_> {
    fn engine(&self) -> &'static dyn Engine {
        self.of_engine.engine
    }

    fn folder(&self) -> PathBuf {
        self.dir.join(FOLDER)
    }

    /// The script that runs these shards.
    fn script(&self, shards: &[u32]) -> Result<String, SweepError> {
        let working_folder = std::env::current_dir().map_err(EngineError::System)?;
        Ok(self.engine().script(&ShardScript {
            engine: self.engine().name(),
            plan: self.plan,
            shards,
            n_shards: self.n_shards,
            working_folder: &working_folder,
            log_folder: &self.folder(),
            executable: &self.options.start.executable,
            arguments: &self.options.arguments,
            jobs: self.options.jobs,
            threads: self.of_engine.threads,
        }))
    }

    /// Writes the script that runs these shards, and submits it. Returns the number of the job.
    fn submit(&self, shards: &[u32]) -> Result<Result<String, CommandError>, SweepError> {
        let path = self.folder().join(format!("{}.sh", self.engine().name()));
        let path = std::path::absolute(path).map_err(EngineError::System)?;
        let script = self.script(shards)?;
        submission::write_whole(&path, script.as_bytes())?;
        Ok(self.engine().submit(&path))
    }

    /// Submits shards that are not finished, for an engine whose tasks cannot be looked up.
    fn submit_only(&self, before: Option<Submission>) -> Result<EngineReport, SweepError> {
        let engine = self.engine();
        let title = engine.title();
        let progress = progress::Progress::read(self.plan, self.dir, self.n_shards)?;
        let shards = progress.to_run();
        let command = self.options.command();
        let merge = format!("{command} --merge");
        if shards.is_empty() {
            return Ok(EngineReport::Submitted(format!("all shards are finished; run {merge}")));
        }
        if let Some(before) = &before {
            terminal::warn(format!(
                "{title} {} submitted before; a shard that still runs keeps its journal, and its second task waits, then fails",
                before.job_words("was", "were")
            ));
        }
        let job = self.submit(&shards)?.map_err(|error| EngineError::Submit { title, error })?;
        let mut submission = Submission::of(self, before);
        submission.add(job.clone(), &shards);
        submission.write(&self.folder())?;
        Ok(EngineReport::Submitted(format!(
            "{title} job {job}: {} of {} submitted. This program does not follow {title} jobs.\n\
             to wait, run {}; to cancel, run {}\nonce all shards are finished, run {merge}",
            shards.len(),
            numbers::format::count_of(u64::from(self.n_shards), "shard"),
            engine.wait_command(&job),
            engine.cancel_command(std::slice::from_ref(&job)),
        )))
    }
}
