//! One experiment, from file to results.

mod attempt;
mod course;
pub mod disk_space;
pub mod dry_run;
pub mod interrupt;
mod milestones;
mod polled;
mod provenance;
mod recover;
pub mod run_answer;
mod start;
mod trial;
mod warm_start;

pub use polled::{Work, on_runtime, serve_network, serve_robots};
pub use recover::{Reproduction, ResumeOptions, recover, reproduce, resume};
pub use start::{Processes, StartOptions, Started, start};
pub use trial::{Sides, TrialPlan, TrialResult};
pub use warm_start::{FormedFile, FormedFiles};

use attempt::{Attempt, Begun, Origin};
use course::carry_out;
use drive::peer::SideError;
use drive::{Failure, ProgressObserver, Taken, Wanted};
use experiment::{Overrides, program_name};
use interrupt::Interrupt;
use proto::config::Refusal;
use proto::exchange::Configured;
use record::checkpoint;
use record::leftover::LeftoverError;
use record::result::ResultError;
use record::{
    Ending, Finished, KeptReason, LOG_FILE, RecordError, ReplacePolicy, Reservation, Status,
    StepRecord,
};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use view::live::{LiveFeed, LiveRun, Pace};
use view::server::{RunSource, Shown};
use warm_start::FormedSaver;

/// What to run and where to put it.
#[derive(Clone)]
pub struct RunOptions {
    /// The experiment file.
    pub config: PathBuf,
    /// What the command line puts over it.
    pub overrides: Overrides,
    /// Folder of results; the run gets a folder of its name in it.
    pub out: PathBuf,
    /// Which earlier results the result replaces.
    pub replace: ReplacePolicy,
    /// How the sides are started.
    pub start: StartOptions,
    /// Where it is shown while it lasts.
    pub live: Option<LiveView>,
    /// The file in which the network is saved once it has formed.
    pub save_formed: Option<PathBuf>,
}

/// Where a run is shown while it lasts.
#[derive(Clone)]
pub struct LiveView {
    /// What the server shows.
    pub shown: Shown,
    /// The address of the page.
    pub url: String,
    /// Whether the run may go on.
    pub pace: Arc<Pace>,
    /// Viewers may pause and step it.
    pub controllable: bool,
}

impl LiveView {
    /// Begins to show a run.
    fn begin(&self, name: &str, configured: &Configured) -> std::io::Result<LiveFeed> {
        let pace = Arc::clone(&self.pace);
        let (live, feed) = LiveRun::begin(name, configured, pace, self.controllable)?;
        self.shown.replace(RunSource::Live(live));
        Ok(feed)
    }
}

/// Why a run did not leave complete results.
#[derive(Debug, thiserror::Error)]
pub enum RunError {
    /// The file cannot be run. Nothing was started.
    #[error(transparent)]
    Refused(#[from] Refusal),
    /// The results do not fit where they are to go. Nothing was started.
    #[error("{0}")]
    Space(String),
    /// A side cannot be started or reached, or failed.
    #[error("{error}{}", kept_text(.kept))]
    Side {
        /// What happened.
        error: SideError,
        /// What was recorded until then.
        kept: Option<Box<Finished>>,
    },
    /// The network has not formed in time.
    #[error("{account}\nthe partial recording is in {}", kept.dir.display())]
    NotFormed {
        /// Who is missing, and why.
        account: String,
        /// What was recorded.
        kept: Box<Finished>,
    },
    /// The formed network cannot be saved. Nothing was run.
    #[error("--save-formed {}: {reason}", path.display())]
    NotSaved {
        /// Where it was to go.
        path: PathBuf,
        /// Why not.
        reason: String,
    },
    /// Someone stopped it before the first step.
    #[error("stopped by {signal} before the first step; nothing was recorded")]
    Interrupted {
        /// The signal.
        signal: &'static str,
    },
    /// The folder of a killed run cannot be used.
    #[error("{error}")]
    Leftover {
        /// What is wrong with it.
        error: LeftoverError,
    },
    /// A killed run left no checkpoint.
    #[error(
        "{} holds no checkpoint, so the run cannot go on from there: run the experiment again, or keep what was recorded \
         with {} recover {}", dir.display(), program_name(), dir.display()
    )]
    NoCheckpoint {
        /// Its folder.
        dir: PathBuf,
    },
    /// What a killed run has left cannot be made a result.
    #[error("{} cannot be recovered: {reason}", dir.display())]
    NotRecovered {
        /// Its folder.
        dir: PathBuf,
        /// Why not.
        reason: String,
    },
    /// A recorded run cannot be run again.
    #[error("{} cannot be reproduced: {reason}", dir.display())]
    NotReproducible {
        /// Its folder.
        dir: PathBuf,
        /// Why not.
        reason: String,
    },
    /// A file of a recorded run is not what the run wrote.
    #[error("{error}")]
    Unbelieved {
        /// Which, and where.
        error: ResultError,
    },
    /// A run that lost a side could not go on, or its record could not be written to the end.
    #[error("{error}{}", way_on(dir, error))]
    NotEnded {
        /// Why not.
        error: Box<Self>,
        /// The folder of what was recorded.
        dir: PathBuf,
    },
    /// Results cannot be written.
    #[error("{error}")]
    Record {
        /// What stands in the way.
        error: RecordError,
        /// It was found before the first step.
        before_start: bool,
    },
}

/// What the user can do with what a run left in a folder when an error ended it.
fn way_on(dir: &Path, error: &RunError) -> String {
    if !dir.join(LOG_FILE).is_file() {
        return String::new();
    }
    let is_full = matches!(error, RunError::Record { error, .. } if error.is_of_full_disk());
    let first = if is_full { "free space on the disk, then " } else { "" };
    let (shown, program) = (dir.display(), program_name());
    let resume = if dir.join(checkpoint::FILE).is_file() {
        format!("go on from its checkpoint with {program} run --resume {shown}, or ")
    } else {
        String::new()
    };
    format!(
        "\nwhat was recorded is in {shown}; {first}{resume}keep what was recorded with {program} recover {shown}"
    )
}

fn kept_text(kept: &Option<Box<Finished>>) -> String {
    kept.as_ref().map_or_else(String::new, |kept| {
        format!("\nthe partial recording is in {}", kept.dir.display())
    })
}

/// What to say if an earlier result kept the place of a new one.
fn next_to(finished: &Finished) -> Option<String> {
    let kept = finished.kept.as_ref()?;
    let (earlier, new) = (kept.dir.display(), finished.dir.display());
    let hint = match kept.reason {
        KeptReason::Incomplete => String::new(),
        KeptReason::OtherSeed(_) | KeptReason::OtherConfiguration => {
            format!("; to replace {earlier} instead, give --replace")
        }
    };
    Some(format!(
        "{earlier} was not replaced: {}. The result of this run is in {new}{hint}",
        kept.reason
    ))
}

impl RunError {
    /// 2: the request was wrong; 1: the work failed.
    #[must_use]
    pub fn exit_status(&self) -> u8 {
        match self {
            Self::Refused(_)
            | Self::NotSaved { .. }
            | Self::Space(_)
            | Self::Leftover { .. }
            | Self::NoCheckpoint { .. }
            | Self::NotRecovered { .. }
            | Self::NotReproducible { .. } => 2,
            Self::Record { before_start: true, .. } => 2,
            Self::Side { error, .. } => side_status(error),
            Self::Record { .. }
            | Self::Unbelieved { .. }
            | Self::Interrupted { .. }
            | Self::NotFormed { .. }
            | Self::NotEnded { .. } => 1,
        }
    }
}

fn side_status(error: &SideError) -> u8 {
    match error {
        SideError::Both(robots, network) => side_status(robots).max(side_status(network)),
        SideError::Unreachable { .. }
        | SideError::NotASimulator { .. }
        | SideError::Certificate { .. }
        | SideError::Command { .. }
        | SideError::Unacceptable { .. }
        | SideError::Cannot { .. } => 2,
        SideError::Start { .. }
        | SideError::Exited { .. }
        | SideError::Lost { .. }
        | SideError::Hangs { .. }
        | SideError::TooSlow { .. }
        | SideError::Refused { .. }
        | SideError::Taken { .. }
        | SideError::Garbage { .. }
        | SideError::WrongStep { .. }
        | SideError::WrongTime { .. }
        | SideError::WrongDigest { .. } => 1,
    }
}

/// A run that ended as it should, or was interrupted.
#[derive(Debug)]
pub struct RunReport {
    /// What it left.
    pub finished: Finished,
    /// Steps taken.
    pub n_steps: u64,
    /// Simulated time (ns).
    pub time_ns: u64,
    /// Real time spent on steps (s).
    pub wall_s: f64,
    /// It was interrupted.
    pub interrupted: bool,
    /// When the network had formed (ns), if it has anything to form and did.
    pub formed_ns: Option<u64>,
}

/// Receives the progress of a run.
pub trait Audience: ProgressObserver {
    /// Something to check before the results are trusted, said before the first step.
    fn warn(&mut self, warning: &str);

    /// Something to know while the run lasts, said before the first step.
    fn note(&mut self, note: &str);
}

/// Runs an experiment.
///
/// # Errors
///
/// See [`RunError`].
pub fn run<'a>(
    options: &'a RunOptions,
    audience: &'a mut dyn Audience,
) -> Work<'a, Result<RunReport, RunError>> {
    Box::pin(from_file(options, audience))
}

async fn from_file(
    options: &RunOptions,
    audience: &mut dyn Audience,
) -> Result<RunReport, RunError> {
    let mut plan = experiment::load(&options.config, &options.overrides)?;
    let formed = FormedFiles::default().open(&mut plan)?;
    let plan = plan;
    let save_formed = options.save_formed.as_deref();
    if let (Some(path), Some(_)) = (save_formed, &formed) {
        let reason =
            "the experiment itself starts from a formed network; leave out experiment.warm_start";
        return Err(not_saved(path, reason));
    }
    disk_space::fits(disk_space::least_bytes(&plan), &options.out).map_err(RunError::Space)?;
    if let Some(warning) = disk_space::fits_if_ended_early(&plan, &options.out) {
        audience.warn(&warning);
    }
    if let Some(profile) = &plan.profile {
        audience.note(profile);
    }
    let mut interrupt = Interrupt::listen();
    // A place for the results first: what cannot be written is not worth computing.
    let reservation = Reservation::new(&options.out, &plan.name)
        .map_err(|error| RunError::Record { error, before_start: true })?;
    for leftover in reservation.leftovers() {
        let leftover = leftover.display();
        audience.warn(&format!(
            "{leftover} is left by an earlier run that did not end; {program} run --resume {leftover} goes on with it, \
             {program} recover {leftover} makes results of it",
            program = program_name()
        ));
    }
    let log = &options.start.run_log;
    log.add("orchestrator", &provenance::opening(&plan));
    let started = tokio::select! {
        biased;
        started = start(&plan, &options.start, Wanted::Record, formed.as_deref()) => started,
        // What was started ends with the future that holds it.
        signal = interrupt.first() => Err(RunError::Interrupted { signal }),
    };
    let begun = Begun { reservation, replace: options.replace, log: log.clone(), before: None };
    let started = started?;
    if let Some(path) = save_formed
        && let Err(error) = can_save(path, &started)
    {
        started.coupled.stop().await;
        return Err(error);
    }
    let saver = save_formed.map(|path| {
        let exchange = started.exchange.clone();
        FormedSaver::new(path.to_owned(), &started.robots, &started.network, exchange)
    });
    let shown = options.live.as_ref().map(|live| {
        let mut exchange = started.exchange.clone();
        // Where the network had formed with another one.
        exchange.robots_request.experiment.seed = plan.experiment.seed;
        live.begin(&plan.name, &exchange)
    });
    let mut feed = shown.transpose().unwrap_or_else(|error| {
        audience.warn(&format!("the run cannot be shown while it lasts: {error}"));
        None
    });
    if let Some(feed) = &mut feed {
        started.formed_steps.iter().for_each(|step| feed.step(step));
    }
    // Not before there is something to see.
    if let (Some(live), Some(_)) = (&options.live, &feed) {
        audience.note(&format!("watch the run at {}", live.url));
    }
    let mut attempt = Attempt::begin(&plan, begun, started).await?;
    attempt.recording.live = feed;
    attempt.recording.saver = saver;
    let origin = Origin::new(options.out.clone(), options.replace);
    carry_out(&plan, &options.start, attempt, origin, interrupt, audience).await
}

/// Refuses to save a network that never forms, or of simulators that cannot be put back.
fn can_save(path: &Path, started: &Started) -> Result<(), RunError> {
    if !started.waits {
        let reason = "the robots of this experiment do not wait until the network has formed; set experiment.start = \
                      \"when-formed\" and netsim.mode = \"6tisch\"";
        return Err(not_saved(path, reason));
    }
    for side in [&started.robots, &started.network] {
        if !side.snapshots {
            return Err(not_saved(path, format!("{} does not support snapshots", side.name)));
        }
    }
    Ok(())
}

fn not_saved(path: &Path, reason: impl Into<String>) -> RunError {
    RunError::NotSaved { path: path.to_owned(), reason: reason.into() }
}

/// How an experiment ends that is not driven to its end.
fn ended_by(failure: &Failure<RecordError>) -> Ending {
    Ending { never_formed: matches!(failure, Failure::NotFormed(_)), ..failed(failure) }
}

fn failed(error: &dyn std::error::Error) -> Ending {
    Ending::early(Status::Failed, error.to_string())
}

/// A step as it is recorded.
#[must_use]
pub fn record_of(Taken { outcome, commands, .. }: Taken) -> StepRecord {
    StepRecord {
        step: outcome.step,
        time_ns: outcome.time_ns,
        digest: outcome.digest(),
        robots: outcome.robots,
        network: outcome.network,
        commands,
    }
}
