//! The command that splits the error of a swarm's task.

use super::{Failure, inputs};
use crate::console::say;
use experiment::Overrides;
use measure::table::DataTable;
use network::compare::ComparisonOptions;
use network::resimulate::Resimulation;
use network::task::comparison::{HeardFile, TaskComparison};
use network::task::receptions::Receptions;
use network::task::{self, MeasuredSwarm};
use network::tracks::Tracks;
use std::path::Path;
use study::open::{self, DataAccount};
use study::thresholds::FEWEST_PACKETS_SEEDS;

/// Files of a swarm that was measured, and the experiment that is compared with it.
pub(super) struct Files<'a> {
    pub(super) config: &'a Path,
    pub(super) set: &'a [String],
    /// Where robots were.
    pub(super) data: &'a Path,
    /// Who heard whom.
    pub(super) heard: &'a Path,
}

/// Where the error of the task comes from.
pub(super) fn split(
    files: &Files<'_>,
    asked: ComparisonOptions,
) -> Result<TaskComparison, Failure> {
    if asked.seeds < FEWEST_PACKETS_SEEDS {
        return Err(Failure::request(format!(
            "--seeds {}: must be at least {FEWEST_PACKETS_SEEDS}; with fewer seeds no part of the error can be significant",
            asked.seeds
        )));
    }
    let overrides = Overrides { set: files.set.to_vec(), ..Overrides::default() };
    let plan = experiment::load(files.config, &overrides).map_err(Failure::request)?;
    let compared = inputs::compared(files.config, files.set)?;
    let (tracks, table) = Tracks::with_table(files.data).map_err(Failure::request)?;
    let tracks = tracks
        .since(asked.from_s)
        .map_err(|why| Failure::request(format!("--from {}: {why}", asked.from_s)))?;
    let n_agents = plan.experiment.agent_count;
    let heard = Receptions::read(files.heard, n_agents, asked.from_s).map_err(Failure::request)?;
    let resimulation = Resimulation::of_task(plan, tracks.clone())
        .map_err(|error| Failure::request(format!("{}: {error}", files.config.display())))?;
    let sd_m = open::localization_sd_m(&compared);
    let account = account(&table, &heard, files.heard, sd_m);
    inputs::print_account(&account);
    tracing::info!(
        "simulating {} seeds of {:.0} s, three times",
        asked.seeds,
        resimulation.duration_s()
    );
    let measured = MeasuredSwarm {
        resimulation: &resimulation,
        tracks: &tracks,
        heard: &heard,
        sd_m: sd_m.unwrap_or(0.0),
    };
    let split = measured.split(asked).map_err(Failure::request)?;
    say(task::text(&split));
    let heard = HeardFile { file: files.heard.display().to_string(), deliveries: heard.n() };
    Ok(task::answer(&split, asked, &account, heard))
}

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
