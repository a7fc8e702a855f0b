//! Sweeps: many experiments that differ as `[sweep]` states. They run on all cores in simulators that are reused, and end in one
//! table.
//!
//! `OUT/<name>/trials.jsonl` holds a line for each finished trial, so a sweep resumes even after a crash. The table, the summary
//! and the report are made from those lines once all trials are finished. A shard runs some of the trials and has a journal of
//! its own; [`merge()`] makes the table from the journals of all shards. [`engine`] has the shards run by a batch system.
//!
//! | module | content |
//! |---|---|
//! | `plan` | the settings and seeds that an experiment file states; `design` draws the settings |
//! | `metric_names` | the names in `sweep.metrics` |
//! | `worker` | runs trials, each in simulators that are reused |
//! | `journal` | the lines of finished trials, which survive a kill at any moment |
//! | `shard`, `merge` | parts of a sweep on several machines, and one table of all |
//! | [`engine`] | batch systems that run the shards, one file each |
//! | `table`, `results` | the table and the summary; `statistics` and `setting_figures` of each setting |
//! | `report` | the page |
//! | `dry_run` | what the trials would take |
//! | [`compare_runs`] | what changed from one run, or one sweep, to another |

pub mod compare_runs;
mod design;
mod dry_run;
pub mod engine;
mod figures;
mod journal;
mod merge;
mod metric_names;
mod plan;
mod report;
mod results;
mod setting_figures;
mod shard;
mod statistics;
mod sweep_summary;
mod table;
pub mod verify;
mod worker;

/// What people call keys and figures.
pub mod names {
    pub use crate::report::names::{Catalogue, Name};
}

pub use dry_run::dry_run;
use engine::EngineError;
pub use journal::JournalError;
pub use merge::{MergeReport, merge};
pub use shard::{Shard, ShardError};
pub use sweep_summary::{
    Interval, IntervalKind, MetricSpread, SCHEMA as SUMMARY_SCHEMA, SweepSummary,
};

use experiment::{Acts, Capability, Overrides};
use journal::{Journal, JournalContent, TrialRow};
use plan::{Machines, SweepPlan, SweepTrial};
use proto::config::Refusal;
use record::RecordError;
use results::FinishedSweep;
use run::disk_space;
use run::{RunError, StartOptions};
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, channel};
use std::time::{Duration, Instant};
use terminal::ProgressDisplay;
use worker::{Said, TrialQueue};

/// Fingerprint of the code that decides the results of a trial: the same for every build of the same sources (build.rs).
const PROGRAM: &str = env!("CODE_OF_RESULTS");

/// What to sweep and where to put it.
#[derive(Clone, Debug)]
pub struct SweepOptions {
    /// The experiment file, with a `[sweep]`.
    pub config: PathBuf,
    /// What the command line puts over it.
    pub overrides: Overrides,
    /// Folder of results; the sweep gets a folder of its name in it.
    pub out: PathBuf,
    /// How simulators are started.
    pub start: StartOptions,
    /// Trials at the same time; `None`: enough to keep all cores busy.
    pub jobs: Option<usize>,
    /// Forget the trials that are done.
    pub restart: bool,
    /// How long a program waits for another one that writes the same journal, if need be.
    pub lock_wait: Duration,
    /// Arguments of the command that runs this sweep, without `--shard`, `--merge` and the like, each quoted for a shell.
    pub arguments: Vec<String>,
}

impl SweepOptions {
    /// The command that runs this sweep, without `--shard`, `--merge` and the like. Messages add these to it.
    #[must_use]
    pub fn command(&self) -> String {
        format!("{} {}", experiment::program_name(), self.arguments.join(" "))
    }
}

/// Why a sweep did not come to its end.
#[derive(Debug, thiserror::Error)]
pub enum SweepError {
    /// The file cannot be run. Nothing was started.
    #[error(transparent)]
    Refused(#[from] Refusal),
    /// Trials cannot run at the same time in simulators that run elsewhere.
    #[error("--jobs {jobs}: the simulator at {url} runs one trial at a time")]
    Jobs {
        /// How many were asked for.
        jobs: usize,
        /// Where it runs.
        url: String,
    },
    /// The results do not fit where they are to go. No trial was started.
    #[error("{0}")]
    Space(String),
    /// The folder holds something else.
    #[error("{} exists and is not the folder of a sweep; choose another folder with --out, or another experiment.name", .0.display())]
    Foreign(PathBuf),
    /// A shard cannot be run, or shards cannot be merged.
    #[error(transparent)]
    Shard(#[from] ShardError),
    /// A batch system did not run all shards.
    #[error(transparent)]
    Engine(#[from] EngineError),
    /// The journal cannot be kept.
    #[error(transparent)]
    Journal(#[from] JournalError),
    /// Results cannot be written.
    #[error(transparent)]
    Record(#[from] RecordError),
    /// A trial cannot be run, and no other could.
    #[error("{trial}: {error}")]
    Run {
        /// Which.
        trial: String,
        /// Why.
        error: Box<RunError>,
    },
    /// Someone stopped it.
    #[error("stopped by {signal} after {done} of {n} trials; run the same command again to resume")]
    Interrupted {
        /// The signal.
        signal: &'static str,
        /// Trials done.
        done: usize,
        /// Trials in all.
        n: usize,
    },
}

impl SweepError {
    /// 2: the request was wrong; 1: the work failed.
    #[must_use]
    pub fn exit_status(&self) -> u8 {
        match self {
            Self::Refused(_) | Self::Foreign(_) | Self::Space(_) | Self::Jobs { .. } => 2,
            Self::Journal(JournalError::Lock(RecordError::Locked { .. })) => 2,
            Self::Record(RecordError::Locked { .. }) => 2,
            Self::Shard(error) => error.exit_status(),
            Self::Engine(error) => error.exit_status(),
            Self::Run { error, .. } => error.exit_status(),
            Self::Journal(_) | Self::Record(_) | Self::Interrupted { .. } => 1,
        }
    }
}

/// A sweep that came to its end.
#[derive(Debug)]
pub struct SweepReport {
    /// The folder.
    pub dir: PathBuf,
    /// What is in its `summary.json`.
    pub summary: SweepSummary,
    /// For people: the settings and their most important figures.
    pub text: String,
    /// Trials in all.
    pub n_trials: usize,
    /// Trials that were done before.
    pub n_before: usize,
    /// Trials that failed, twice each, and why. They are rows without figures.
    pub failed: Vec<(String, String)>,
    /// How often a pair of simulators was started.
    pub n_starts: u64,
    /// Real time (s).
    pub wall_s: f64,
}

/// The table of a sweep.
pub const TABLE_FILE: &str = "trials.parquet";
/// The lines that the table is made of.
const JOURNAL_FILE: &str = "trials.jsonl";

/// Whether a file says that it is a sweep.
#[must_use]
pub fn is_sweep(path: &Path) -> bool {
    experiment::text_of(path)
        .ok()
        .and_then(|text| proto::config::parse(&text).ok())
        .is_some_and(|tree| tree.get(experiment::sweep::KEY).is_some())
}

/// A sweep that was checked without running it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Checked {
    /// How many settings it has.
    pub settings: usize,
    /// How many trials.
    pub trials: usize,
    /// What the file asks for outside of its own folder.
    pub capabilities: Vec<Capability>,
    /// What to mind.
    pub warnings: Vec<String>,
}

/// Checks a sweep without running it.
///
/// # Errors
///
/// Every problem of the file.
pub fn check(path: &Path, overrides: &Overrides) -> Result<Checked, Refusal> {
    let plan = plan::load(path, &overrides.acting(Acts::Nothing), Machines::Cluster)?;
    let (settings, trials) = (plan.settings.len(), plan.n_trials());
    Ok(Checked { settings, trials, capabilities: plan.capabilities, warnings: plan.warnings })
}

/// Runs a sweep, or what is left of it.
///
/// # Errors
///
/// See [`SweepError`].
pub fn sweep(options: &SweepOptions) -> Result<SweepReport, SweepError> {
    let begun = Instant::now();
    let plan = plan::load(&options.config, &options.overrides, Machines::This)?;
    let FinishedTrials { dir, rows, n_before, jobs, work } = run_trials(options, &plan, None)?;
    let wall_s = begun.elapsed().as_secs_f64();
    let (n_now, n_starts) = (rows.len() - n_before, work.n_starts);
    let done = FinishedSweep { plan: &plan, rows: &rows, jobs, n_now, n_starts, wall_s };
    let (summary, text) = results::write(&dir, &done)?;
    let (n_trials, failed) = (plan.n_trials(), work.failed);
    let ended = format!("{n_trials} trials, {} of them failed, {n_now} run now", failed.len());
    options.start.run_log.end(&ended);
    Ok(SweepReport { dir, summary, text, n_trials, n_before, failed, n_starts, wall_s })
}

/// A shard that came to its end.
#[derive(Debug)]
pub struct ShardReport {
    /// Name of the sweep.
    pub name: String,
    /// The journal of the shard.
    pub journal: PathBuf,
    /// Trials of the shard.
    pub n_trials: usize,
    /// Trials of the whole sweep.
    pub n_of_sweep: usize,
    /// Trials of the shard that were done before.
    pub n_before: usize,
    /// Trials that failed, twice each, and why.
    pub failed: Vec<(String, String)>,
    /// How often a pair of simulators was started.
    pub n_starts: u64,
    /// Real time (s).
    pub wall_s: f64,
}

/// Runs those trials of one shard that have no row in its journal yet. Writes no table.
///
/// # Errors
///
/// See [`SweepError`].
pub fn run_shard(options: &SweepOptions, shard: Shard) -> Result<ShardReport, SweepError> {
    let begun = Instant::now();
    let plan = plan::load(&options.config, &options.overrides, Machines::This)?;
    let FinishedTrials { dir, rows, n_before, work, .. } = run_trials(options, &plan, Some(shard))?;
    let (n_trials, failed) = (rows.len(), work.failed);
    let n_now = n_trials - n_before;
    options.start.run_log.end(&format!(
        "shard {shard}: {n_trials} trials, {} of them failed, {n_now} run now",
        failed.len()
    ));
    Ok(ShardReport {
        journal: dir.join(shard.journal_name()),
        n_trials,
        n_of_sweep: plan.n_trials(),
        n_before,
        failed,
        n_starts: work.n_starts,
        wall_s: begun.elapsed().as_secs_f64(),
        name: plan.name,
    })
}

/// Trials that are all done: those of a sweep, or of a shard.
struct FinishedTrials {
    dir: PathBuf,
    rows: BTreeMap<SweepTrial, TrialRow>,
    n_before: usize,
    jobs: usize,
    work: WorkSummary,
}

/// Runs the trials of a sweep, or of one shard of it, that are not in its journal.
fn run_trials(
    options: &SweepOptions,
    plan: &SweepPlan,
    shard: Option<Shard>,
) -> Result<FinishedTrials, SweepError> {
    let jobs = jobs(options, plan)?;
    let (trials, journal_name) = selected(plan, shard)?;
    terminal::warn_all(&plan.warnings);
    if let Some(first) = trials.first()
        && let Some(profile) = plan.plan(*first)?.profile
    {
        terminal::note(format!("{}: {profile}", plan.trial_name(*first)));
    }
    let dir = options.out.join(&plan.name);
    check_folder(&dir, shard)?;
    system::create_dir_all(&dir)
        .map_err(|source| RecordError::Create { path: dir.clone(), source })?;
    let (mut journal, known) = open_journal(options, &dir, &journal_name)?;
    let log = &options.start.run_log;
    match shard {
        None => {
            results::write_config(&dir, plan)?;
            results::remove_partial_runs(&dir, |_| true)?;
        }
        Some(_) => {
            merge::check_journal(plan, &dir.join(&journal_name), &known.rows)?;
            // Other shards may be running.
            let own: BTreeSet<String> = trials.iter().map(|&t| plan.trial_name(t)).collect();
            results::remove_partial_runs(&dir, |name| own.contains(name))?;
        }
    }
    log.open(&dir)?;
    let part = shard.map(|shard| format!("shard {shard} of a ")).unwrap_or_default();
    log.add(
        "orchestrator",
        &format!("{part}sweep of {} trials, {jobs} at a time", plan.n_trials()),
    );
    terminal::warn_all(&known.warnings);
    let mut rows: BTreeMap<SweepTrial, TrialRow> = BTreeMap::new();
    for &trial in &trials {
        // One that failed is tried again.
        if let Some(row) = known.rows.get(&plan.key(trial)).filter(|row| !row.has_failed())
            && (!plan.keeps(trial) || results::is_kept(&dir, plan, trial, row))
        {
            rows.insert(trial, row.clone());
        }
    }
    let n_before = rows.len();
    let n_other = rows.values().filter(|row| row.program != PROGRAM).count();
    if n_other != 0 {
        terminal::warn(format!(
            "{n_other} trials were run by a program with other code; --restart runs them again"
        ));
    }
    let left: Vec<SweepTrial> =
        trials.iter().copied().filter(|trial| !rows.contains_key(trial)).collect();
    disk_space::fits(least_bytes(plan, &left)?, &options.out).map_err(SweepError::Space)?;
    let queue = TrialQueue::new(plan, left.into_iter());
    let mut account = WorkSummary::default();
    if !queue.is_empty() {
        let work = Work { plan, dir: &dir, start: &options.start };
        account = std::thread::scope(|scope| {
            let (said, inbox) = channel();
            for _ in 0..jobs.min(queue.len()) {
                let said = said.clone();
                let (work, queue) = (&work, &queue);
                scope.spawn(move || worker::work(work, queue, &said));
            }
            drop(said);
            collect(plan, trials.len(), &queue, &inbox, &mut journal, &mut rows)
        })?;
    }
    if let Some(signal) = account.interrupted {
        log.end(&format!("stopped by {signal} after {} trials", rows.len()));
        return Err(SweepError::Interrupted { signal, done: rows.len(), n: trials.len() });
    }
    Ok(FinishedTrials { dir, rows, n_before, jobs, work: account })
}

/// How often a journal that another program holds is tried again.
const LOCK_EVERY: Duration = Duration::from_secs(1);

/// Opens a journal, once no other program holds it, if that is soon enough.
fn open_journal(
    options: &SweepOptions,
    dir: &Path,
    name: &str,
) -> Result<(Journal, JournalContent), JournalError> {
    let begun = Instant::now();
    loop {
        match Journal::open(dir, name, options.restart) {
            Err(JournalError::Lock(RecordError::Locked { .. }))
                if begun.elapsed() < options.lock_wait =>
            {
                std::thread::sleep(LOCK_EVERY);
            }
            opened => return opened,
        }
    }
}

/// The trials of a sweep, or of one shard of it, and the name of their journal.
fn selected(
    plan: &SweepPlan,
    shard: Option<Shard>,
) -> Result<(Vec<SweepTrial>, String), ShardError> {
    match shard {
        Some(shard) => Ok((shard.trials(plan)?, shard.journal_name())),
        None => Ok((plan.trials().collect(), JOURNAL_FILE.to_owned())),
    }
}

/// Refuses a folder that holds something else, or shards that were split otherwise or were not merged.
fn check_folder(dir: &Path, shard: Option<Shard>) -> Result<(), SweepError> {
    if shard::is_foreign(dir)? {
        return Err(SweepError::Foreign(dir.to_owned()));
    }
    match shard {
        Some(shard) => shard::check_count(dir, shard)?,
        None if !dir.join(JOURNAL_FILE).exists() && !shard::shards_in(dir)?.is_empty() => {
            return Err(ShardError::Unmerged(dir.to_owned()).into());
        }
        None => {}
    }
    Ok(())
}

/// The least that trials take on the disk.
fn least_bytes(plan: &SweepPlan, trials: &[SweepTrial]) -> Result<u64, Refusal> {
    // Trials of a setting differ in their seeds alone.
    let mut by_setting: BTreeMap<usize, u64> = BTreeMap::new();
    let mut least = 0u64;
    for trial in trials.iter().filter(|&&trial| plan.keeps(trial)) {
        let of_setting = match by_setting.get(&trial.setting) {
            Some(of_setting) => *of_setting,
            None => disk_space::least_bytes(&plan.plan(*trial)?),
        };
        by_setting.insert(trial.setting, of_setting);
        least = least.saturating_add(of_setting);
    }
    Ok(least)
}

/// What all workers share.
struct Work<'a> {
    plan: &'a SweepPlan,
    dir: &'a Path,
    start: &'a StartOptions,
}

/// How the work went.
#[derive(Default)]
struct WorkSummary {
    failed: Vec<(String, String)>,
    interrupted: Option<&'static str>,
    n_starts: u64,
}

/// Takes what the workers say until they are gone.
fn collect(
    plan: &SweepPlan,
    n_trials: usize,
    queue: &TrialQueue,
    inbox: &Receiver<Said>,
    journal: &mut Journal,
    rows: &mut BTreeMap<SweepTrial, TrialRow>,
) -> Result<WorkSummary, SweepError> {
    let mut progress = ProgressDisplay::new(n_trials as u64);
    let n_before = rows.len();
    let mut account = WorkSummary::default();
    let mut result = Ok(());
    for said in inbox {
        match said {
            Said::Done(trial, row) => {
                if let (true, Some(reason)) = (row.has_failed(), &row.reason) {
                    let name = plan.trial_name(trial);
                    // The same failure of many trials is reported once; the results have them all.
                    let first_line = reason.lines().next().unwrap_or_default();
                    if !account.failed.iter().any(|(_, earlier)| earlier == reason) {
                        terminal::warn(format!("trial {name} failed twice: {first_line}"));
                    }
                    account.failed.push((name, reason.clone()));
                }
                if let Err(error) = journal.add(&row) {
                    queue.close();
                    result = Err(error.into());
                    continue;
                }
                rows.insert(trial, *row);
                let done = rows.len();
                let n_now = done - n_before;
                progress.trials(done as u64, n_trials as u64, n_now as u64);
            }
            Said::Fatal(trial, error) => {
                queue.close();
                // The first says why; those that follow end for the same reason.
                if result.is_ok() {
                    result = Err(SweepError::Run { trial: plan.trial_name(trial), error });
                }
            }
            Said::Interrupted(signal) => {
                queue.close();
                account.interrupted = Some(signal);
            }
            Said::Ended { n_starts } => account.n_starts += n_starts,
        }
    }
    progress.finish();
    account.failed.sort();
    result.map(|()| account)
}

/// Trials at the same time.
fn jobs(options: &SweepOptions, plan: &SweepPlan) -> Result<usize, SweepError> {
    match (&plan.elsewhere, options.jobs) {
        (Some(url), Some(jobs)) if 1 < jobs => Err(SweepError::Jobs { jobs, url: url.clone() }),
        (Some(_), _) => Ok(1),
        (None, Some(jobs)) => Ok(jobs),
        // In each trial one of its three processes works at a time.
        (None, None) => Ok(proto_host::cores()),
    }
}
