//! The question about a swarm's task, as one function: [`task()`].

use super::comparison::{HeardFile, TaskComparison};
use super::receptions::Receptions;
use super::{MeasuredSwarm, words};
use crate::compare::ComparisonOptions;
use crate::request::Worded;
use crate::resimulate::{Resimulation, ResimulationError};
use crate::tracks::Tracks;
use diagnose::Observer;
use experiment::{Consent, Overrides};
use input::Reading;
use measure::DataError;
use measure::account::DataAccount;
use measure::config::Compared;
use measure::table::DataTable;
use std::path::Path;
use study::open;
use study::thresholds::FEWEST_PACKETS_SEEDS;

/// Files about a measured swarm.
#[derive(Clone, Copy, Debug)]
pub struct TaskFiles<'a> {
    /// The experiment (TOML).
    pub config: &'a Path,
    /// Keys that are set over it.
    pub set: &'a [String],
    /// What the experiment may do outside of its own folder.
    pub consent: &'a Consent,
    /// Positions of the robots.
    pub data: &'a Path,
    /// Receptions: which robot received a message of which, and when.
    pub heard: &'a Path,
    /// How files of measurements are read.
    pub reading: Reading,
}

/// A measured swarm, and the experiment that is compared with it.
#[derive(Clone, Debug)]
pub struct TaskRequest {
    resimulation: Resimulation,
    tracks: Tracks,
    heard: Receptions,
    /// Standard deviation of the noise of measured positions, per component (m).
    sd_m: f64,
    account: DataAccount,
    heard_file: HeardFile,
    options: ComparisonOptions,
}

/// Why a measured swarm cannot be compared with an experiment.
#[derive(Debug, thiserror::Error)]
pub enum TaskError {
    /// One of the files cannot be used.
    #[error("{0}")]
    File(String),
    /// A file of measurements cannot be used.
    #[error(transparent)]
    Data(#[from] DataError),
    /// The seeds cannot tell a part of the error from chance.
    #[error(
        "{seeds}: must be at least {FEWEST_PACKETS_SEEDS}; with fewer seeds no part of the error can be significant"
    )]
    TooFewSeeds {
        /// The number asked for.
        seeds: u64,
    },
    /// The task cannot have begun then.
    #[error("{from_s}: {reason}")]
    From {
        /// The beginning asked for (s).
        from_s: f64,
        /// Why not.
        reason: String,
    },
}

impl TaskRequest {
    /// Reads all files.
    ///
    /// # Errors
    ///
    /// One of the files cannot be used, the task cannot have begun at `options.from_s`, or there are too few seeds.
    pub fn open(files: &TaskFiles<'_>, options: ComparisonOptions) -> Result<Self, TaskError> {
        let ComparisonOptions { seeds, from_s } = options;
        if seeds < FEWEST_PACKETS_SEEDS {
            return Err(TaskError::TooFewSeeds { seeds });
        }
        let file = |error: &dyn ToString| TaskError::File(error.to_string());
        let (set, consent) = (files.set.to_vec(), files.consent.clone());
        let overrides = Overrides { set, consent, ..Overrides::default() };
        let text = experiment::text_of(files.config).map_err(|error| file(&error))?;
        let plan = experiment::read(files.config, text.clone(), &overrides)
            .map_err(|error| file(&error))?;
        let compared =
            Compared::of_text(files.config, text, files.set).map_err(|error| file(&error))?;
        let (tracks, table) = Tracks::with_table(files.data, files.reading)?;
        let tracks = tracks.since(from_s).map_err(|reason| TaskError::From { from_s, reason })?;
        let n_agents = plan.experiment.agent_count;
        let heard = Receptions::read(files.heard, n_agents, from_s, files.reading)?;
        let resimulation = Resimulation::of_task(plan, tracks.clone())
            .map_err(|error| TaskError::File(format!("{}: {error}", files.config.display())))?;
        let sd_m = open::localization_sd_m(&compared);
        let account = account(&table, &heard, files.heard, sd_m);
        let heard_file =
            HeardFile { file: files.heard.display().to_string(), deliveries: heard.n() };
        let sd_m = sd_m.unwrap_or(0.0);
        Ok(Self { resimulation, tracks, heard, sd_m, account, heard_file, options })
    }
}

/// Rows of the positions and of the receptions, and a warning if positions count as exact.
fn account(
    table: &DataTable,
    heard: &Receptions,
    heard_path: &Path,
    sd_m: Option<f64>,
) -> DataAccount {
    let mut warnings =
        vec![format!("{}: {} rows, {} receptions", heard_path.display(), heard.n_rows, heard.n())];
    if sd_m.is_none() {
        warnings.push(
            "robotsim.localization.sd_m is not set: measured positions are taken as exact, so their measurement noise \
             counts as robot motion; set it if you know it"
                .to_owned(),
        );
    }
    DataAccount {
        data: open::file_of(table),
        rows: table.n_rows(),
        used: table.n_rows(),
        rejected: Vec::new(),
        warnings,
        predicted_by: None,
    }
}

/// Finds out whether the robots or the network cause the error of a swarm's task.
///
/// # Errors
///
/// A side refuses its configuration, robots need a column that the receptions do not have, or the observer stopped the
/// simulations.
pub fn task(
    request: &TaskRequest,
    observer: &dyn Observer,
) -> Result<Worded<TaskComparison>, ResimulationError> {
    let TaskRequest { tracks, heard, sd_m, account, heard_file, options, .. } = request;
    observer.opened(account);
    let resimulation = request.resimulation.stopped_by(observer);
    tracing::info!(
        "simulating {} seeds of {:.0} s, three times",
        options.seeds,
        resimulation.duration_s()
    );
    let measured = MeasuredSwarm { resimulation: &resimulation, tracks, heard, sd_m: *sd_m };
    let split = measured.split(*options, observer)?;
    let answer = words::answer(&split, *options, account, heard_file.clone());
    Ok(Worded { answer, text: words::text(&split) })
}
