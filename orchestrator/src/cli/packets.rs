//! The commands that hold a network against measured packets.

use super::inputs::print_account;
use super::stop::Stopper;
use super::{Failure, write_json, write_whole};
use crate::console::say;
use clap::Args;
use experiment::{Overrides, Plan};
use measure::config::Compared;
use measure::packets::{self, MeasuredPackets};
use measure::table::DataTable;
use network::compare::{self, ComparisonOptions};
use network::comparison::NetworkComparison;
use network::diagnosis::NetworkDiagnosis;
use network::error_split::NetworkErrorSplit;
use network::extend;
use network::resimulate::Resimulation;
use network::search::{self, NetworkSearch};
use network::split;
use network::tracks::Tracks;
use proto::bounds::PACKET_TIME_S;
use std::path::{Path, PathBuf};
use study::StopFlag;
use study::open::{self, DataAccount};
use study::thresholds::{FEWEST_PACKETS_SEEDS, PACKETS_LEVEL};

/// How the experiment is simulated again, to be compared with measured packets.
#[derive(Args, Clone)]
pub(super) struct ResimulationArgs {
    /// Packets only: measured robot positions, as a table with time_s, agent, x_m, y_m, or the folder of a run [default:

    /// robots move as the experiment simulates them]

    #[arg(long, value_name = "FILE")]
    positions: Option<PathBuf>,
    /// Packets and --heard only: number of seeds under which the network is simulated
    #[arg(long, value_name = "N", default_value_t = ComparisonOptions::default().seeds)]
    seeds: u64,
    /// Packets only: ignore packets created before this time (s). With --heard: time at which the task began (s)
    #[arg(long, value_name = "S", default_value_t = 0.0)]
    from: f64,
    /// Packets only: end of the campaign (s), if it is later than the last packet
    #[arg(long, value_name = "S")]
    until: Option<f64>,
}

/// Measured packets, and the experiment that is compared with them.
pub(super) struct Opened {
    pub(super) resimulation: Resimulation,
    pub(super) packets: MeasuredPackets,
    pub(super) account: DataAccount,
    pub(super) asked: ComparisonOptions,
}

impl ResimulationArgs {
    /// What is asked.
    pub(super) fn asked(&self) -> ComparisonOptions {
        ComparisonOptions { seeds: self.seeds, from_s: self.from }
    }

    /// Where robots were must have been measured.
    pub(super) fn needs_positions(&self) -> Result<(), Failure> {
        if self.positions.is_some() {
            return Ok(());
        }
        Err(Failure::request(
            "--links: requires --positions, because measured links are replayed between robots at their measured \
             positions; give --positions FILE",
        ))
    }

    /// As they would be typed.
    pub(super) fn words(&self) -> String {
        let positions = self.positions.as_ref();
        format!(
            "{} --seeds {} --from {}{}",
            positions.map_or_else(String::new, |path| format!(" --positions {}", path.display())),
            self.seeds,
            self.from,
            self.until.map_or_else(String::new, |until_s| format!(" --until {until_s}"))
        )
    }

    /// Reads everything.
    pub(super) fn open(
        &self,
        config: &Path,
        set: &[String],
        table: &DataTable,
    ) -> Result<Opened, Failure> {
        let overrides = Overrides { set: set.to_vec(), ..Overrides::default() };
        let plan: Plan = experiment::load(config, &overrides).map_err(Failure::request)?;
        let packets = packets::read(table)
            .map_err(|why| Failure::request(format!("{}: {why}", table.path.display())))?;
        let tracks = match &self.positions {
            Some(path) => Some(Tracks::read(path).map_err(Failure::request)?),
            None => None,
        };
        let resimulation = Resimulation::new(plan, tracks, &packets.packets)
            .map_err(|error| Failure::request(format!("{}: {error}", config.display())))?;
        let resimulation = match self.until {
            None => resimulation,
            Some(until_s) if (PACKET_TIME_S.most as f64) < until_s => {
                return Err(Failure::request(format!(
                    "--until {until_s}: must be at most {} s (7 days)",
                    PACKET_TIME_S.most
                )));
            }
            Some(until_s) if until_s.is_finite() && resimulation.duration_s() <= until_s => {
                resimulation.extended_to(until_s)
            }
            Some(until_s) => {
                return Err(Failure::request(format!(
                    "--until {until_s}: must be at least {} s, when the last packet ends",
                    resimulation.duration_s()
                )));
            }
        };
        let mut account = DataAccount {
            data: open::file_of(table),
            rows: packets.n_rows,
            used: packets.packets.len(),
            rejected: packets.rejected.clone(),
            warnings: packets.warnings.clone(),
            predicted_by: None,
        };
        if resimulation.resends() {
            account.warnings.push(
                "the experiment has no [[netsim.app]]: the simulation resends the measured packets at their measured \
                 times, whether or not motes have joined"
                    .to_owned(),
            );
        }
        Ok(Opened { resimulation, packets, account, asked: self.asked() })
    }
}

/// `murmuration compare` of packets.
pub(super) fn compare(opened: &Opened) -> Result<NetworkComparison, Failure> {
    let Opened { resimulation, packets, account, asked } = opened;
    print_account(account);
    tracing::info!("{} seeds of {:.0} s", asked.seeds, resimulation.duration_s());
    let found = compare::compare(resimulation, &packets.packets, *asked, account)
        .map_err(Failure::request)?;
    say(compare::words::text(&found));
    Ok(found)
}

/// Where the error comes from.
pub(super) fn split(
    opened: &Opened,
    config: &Compared,
    links: &DataTable,
) -> Result<NetworkErrorSplit, Failure> {
    let Opened { resimulation, packets, asked, .. } = opened;
    let split = split::split(resimulation, &packets.packets, *asked, config, links)
        .map_err(Failure::request)?;
    say(format!("\n{}", split::text(&split)));
    Ok(split::answer(&split))
}

impl Opened {
    /// The same, whose simulations end early once `stop` is set.
    pub(super) fn with_stop_flag(self, stop: &StopFlag) -> Self {
        Self { resimulation: self.resimulation.with_stop_flag(stop), ..self }
    }

    /// Seeds that suffice to tell a gain from chance.
    fn check_seeds(&self) -> Result<(), Failure> {
        if self.asked.seeds < FEWEST_PACKETS_SEEDS {
            return Err(Failure::request(format!(
                "--seeds {}: must be at least {FEWEST_PACKETS_SEEDS}; with fewer seeds no gain can be significant at level {PACKETS_LEVEL}",
                self.asked.seeds
            )));
        }
        Ok(())
    }
}

/// `murmuration diagnose` of packets.
pub(super) fn diagnose(opened: &Opened, stopper: &Stopper) -> Result<NetworkDiagnosis, Failure> {
    opened.check_seeds()?;
    let Opened { resimulation, packets, account, asked } = opened;
    print_account(account);
    let candidates = search::catalogue();
    let diagnosis = NetworkSearch::new(resimulation, &packets.packets, *asked, &candidates)
        .with_stop_flag(stopper.flag().as_atomic());
    let found = diagnosis.stepwise_selection().map_err(Failure::request)?;
    let answer = search::answer(&found, *asked, account);
    say(search::text(&found, &answer));
    Ok(answer)
}

/// Which effects are added to an experiment, and where it is written.
pub(super) struct Adding<'a> {
    pub(super) config: &'a Path,
    pub(super) text: &'a str,
    pub(super) effects: &'a [String],
    pub(super) all: bool,
    pub(super) output: &'a Path,
    pub(super) json: Option<&'a Path>,
    pub(super) is_partial_wanted: bool,
}

/// `murmuration extend` of packets.
pub(super) fn extend(
    opened: &Opened,
    adding: &Adding<'_>,
    stopper: &Stopper,
) -> Result<(), Failure> {
    let Opened { resimulation, packets, account, asked } = opened;
    let candidates = search::catalogue();
    let named: Result<Vec<usize>, _> =
        adding.effects.iter().map(|name| extend::candidate(&candidates, name)).collect();
    let named = named.map_err(Failure::request)?;
    print_account(account);
    let diagnosis = NetworkSearch::new(resimulation, &packets.packets, *asked, &candidates);
    let effects = if adding.all {
        opened.check_seeds()?;
        let diagnosis = NetworkSearch::new(resimulation, &packets.packets, *asked, &candidates)
            .with_stop_flag(stopper.flag().as_atomic());
        let found = diagnosis.stepwise_selection().map_err(Failure::request)?;
        if found.stopped.is_some() && !adding.is_partial_wanted {
            return Err(stopper.refuse_partial(
                "Give it more time, or add the effects that were accepted until then with --partial",
            ));
        }
        found.accepted
    } else {
        named
    };
    let extended = extend::extend(&diagnosis, &effects, (adding.config, adding.text), account)
        .map_err(Failure::work)?;
    write_whole("--output", adding.output, &extended.text)?;
    let parts: Vec<String> = extended
        .added
        .iter()
        .map(|(candidate, fitted)| {
            format!("{}, {}", candidate.name, search::parameter_text(candidate, fitted))
        })
        .collect();
    let p_values = extended.rungs.each_ref().map(|rung| rung.among.placed.p_value);
    say(format!(
        "{}: added {}. Consistency of the packets with the model: p = {:.3} before, {:.3} after",
        adding.output.display(),
        parts.join("; "),
        p_values[0],
        p_values[1]
    ));
    write_json(adding.json, &extended.answer())
}
