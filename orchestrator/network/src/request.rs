//! The questions about measured packets, each one function: [`compare()`], [`split()`], [`diagnose()`], [`extend()`].

use crate::candidate_fits::FittedEffect;
use crate::candidates::CandidateEffect;
use crate::compare::{self, ComparisonOptions};
use crate::comparison::NetworkComparison;
use crate::diagnosis::NetworkDiagnosis;
use crate::error_split::NetworkErrorSplit;
use crate::extend::{self, NetworkExtendError};
use crate::extension::NetworkExtension;
use crate::resimulate::{Resimulation, ResimulationError};
use crate::search::{self, NetworkSearch, SearchResult};
use crate::split::{self, SplitError};
use crate::tracks::Tracks;
use ::diagnose::extend::ExtendError;
use ::diagnose::progress::SearchProgress;
use ::diagnose::{Effects, Observer, Stopped};
use experiment::{Consent, Overrides, Plan};
use input::Reading;
use measure::DataError;
use measure::account::DataAccount;
use measure::config::Compared;
use measure::packets::{self, MeasuredPacket};
use measure::table::DataTable;
use proto::bounds::PACKET_TIME_S;
use std::path::Path;
use study::open;
use study::thresholds::{FEWEST_PACKETS_SEEDS, PACKETS_LEVEL};

/// Measured packets, and the experiment that is compared with them.
#[derive(Clone, Debug)]
pub struct PacketRequest {
    /// The experiment, to be simulated again.
    pub resimulation: Resimulation,
    /// The packets.
    pub packets: Vec<MeasuredPacket>,
    /// The file, and how much of it is used.
    pub account: DataAccount,
    /// Number of seeds, and the time from which on packets count.
    pub options: ComparisonOptions,
}

/// Files about measured packets.
#[derive(Clone, Copy, Debug)]
pub struct PacketFiles<'a> {
    /// The experiment (TOML).
    pub config: &'a Path,
    /// Keys that are set over it.
    pub set: &'a [String],
    /// What the experiment may do outside of its own folder.
    pub consent: &'a Consent,
    /// The packets.
    pub table: &'a DataTable,
    /// Where robots were; none: they move as the experiment simulates them.
    pub positions: Option<&'a Path>,
    /// End of the campaign (s), if it is later than the last packet.
    pub until_s: Option<f64>,
    /// How files of measurements are read.
    pub reading: Reading,
}

/// Why packets have no answer.
#[derive(Debug, thiserror::Error)]
pub enum PacketError {
    /// One of the files cannot be used.
    #[error("{0}")]
    File(String),
    /// A file of measurements cannot be used.
    #[error(transparent)]
    Data(#[from] DataError),
    /// The campaign cannot end then.
    #[error("{until_s}: must be {bound}")]
    Until {
        /// The end asked for (s).
        until_s: f64,
        /// What it may be.
        bound: String,
    },
    /// The seeds cannot tell a gain from chance.
    #[error(
        "{seeds}: must be at least {FEWEST_PACKETS_SEEDS}; with fewer seeds no gain can be significant at level {PACKETS_LEVEL}"
    )]
    TooFewSeeds {
        /// The number asked for.
        seeds: u64,
    },
    /// An effect cannot be added.
    #[error(transparent)]
    Effect(#[from] ExtendError),
    /// The network refuses its configuration.
    #[error(transparent)]
    Resimulation(#[from] ResimulationError),
    /// The extended experiment cannot be written.
    #[error(transparent)]
    Extend(#[from] NetworkExtendError),
    /// The search was stopped before anything could be answered.
    #[error("the search was stopped: {0}")]
    Stopped(Stopped),
}

impl PacketRequest {
    /// Packets that the experiment is simulated again for.
    #[must_use]
    pub fn new(
        resimulation: Resimulation,
        packets: Vec<MeasuredPacket>,
        options: ComparisonOptions,
    ) -> Self {
        Self { resimulation, packets, account: DataAccount::default(), options }
    }

    /// Reads all files.
    ///
    /// # Errors
    ///
    /// What is wrong with one of them, in words for its author.
    pub fn open(files: &PacketFiles<'_>, options: ComparisonOptions) -> Result<Self, PacketError> {
        let PacketFiles { config, set, consent, table, positions, until_s, reading } = *files;
        let named =
            |path: &Path, why: String| PacketError::File(format!("{}: {why}", path.display()));
        let overrides =
            Overrides { set: set.to_vec(), consent: consent.clone(), ..Overrides::default() };
        let plan: Plan = experiment::load(config, &overrides)
            .map_err(|error| PacketError::File(error.to_string()))?;
        let measured = packets::read(table).map_err(|why| named(&table.path, why))?;
        let tracks = positions.map(|path| Tracks::read(path, reading)).transpose()?;
        let resimulation = Resimulation::new(plan, tracks, &measured.packets)
            .map_err(|error| named(config, error.to_string()))?;
        let resimulation = match until_s {
            None => resimulation,
            Some(until_s) if (PACKET_TIME_S.most as f64) < until_s => {
                let bound = format!("at most {} s (7 days)", PACKET_TIME_S.most);
                return Err(PacketError::Until { until_s, bound });
            }
            Some(until_s) if until_s.is_finite() && resimulation.duration_s() <= until_s => {
                resimulation.extended_to(until_s)
            }
            Some(until_s) => {
                let least_s = resimulation.duration_s();
                let bound = format!("at least {least_s} s, when the last packet ends");
                return Err(PacketError::Until { until_s, bound });
            }
        };
        let mut account = DataAccount {
            data: open::file_of(table),
            rows: measured.n_rows,
            used: measured.packets.len(),
            rejected: measured.rejected,
            warnings: measured.warnings,
            predicted_by: None,
        };
        if resimulation.resends() {
            account.warnings.push(
                "the experiment has no [[netsim.app]]: the simulation resends the measured packets at their measured \
                 times, whether or not motes have joined"
                    .to_owned(),
            );
        }
        Ok(Self { resimulation, packets: measured.packets, account, options })
    }

    /// Whether the seeds suffice to tell a gain from chance.
    fn check_seeds(&self) -> Result<(), PacketError> {
        let seeds = self.options.seeds;
        if seeds < FEWEST_PACKETS_SEEDS { Err(PacketError::TooFewSeeds { seeds }) } else { Ok(()) }
    }

    /// Selects effects that the network lacks.
    fn select(
        &self,
        resimulation: &Resimulation,
        candidates: &[CandidateEffect],
        observer: &dyn Observer,
    ) -> Result<SearchResult, ResimulationError> {
        let measured = (&self.packets[..], self.options);
        NetworkSearch::new(resimulation, measured, candidates, observer).stepwise_selection()
    }
}

/// Logs what is simulated next, and reports it to an observer.
pub(crate) fn simulating(observer: &dyn Observer, what: &str) {
    tracing::info!("{what}");
    observer.progress(SearchProgress::Simulating { what });
}

/// Compares the network as configured with the packets; nothing is fitted.
///
/// # Errors
///
/// The network refuses its configuration, or the observer stopped the simulations.
pub fn compare(
    request: &PacketRequest,
    observer: &dyn Observer,
) -> Result<Worded<NetworkComparison>, ResimulationError> {
    observer.opened(&request.account);
    let resimulation = request.resimulation.stopped_by(observer);
    tracing::info!("{} seeds of {:.0} s", request.options.seeds, resimulation.duration_s());
    let answer =
        compare::compare(&resimulation, &request.packets, request.options, &request.account)?;
    let text = compare::words::text(&answer);
    Ok(Worded { answer, text })
}

/// An answer, and the same as a person reads it.
#[derive(Clone, Debug)]
pub struct Worded<A> {
    /// The answer.
    pub answer: A,
    /// Its words.
    pub text: String,
}

/// Finds out whether the robots, the radio or the protocol are wrong, by links that were measured during the same campaign.
/// It answers beside [`compare()`], which reports the account to the observer; this function does not.
///
/// # Errors
///
/// The links cannot be used, the network refuses its configuration, or the observer stopped the simulations.
pub fn split(
    request: &PacketRequest,
    config: &Compared,
    links: &DataTable,
    observer: &dyn Observer,
) -> Result<Worded<NetworkErrorSplit>, SplitError> {
    let resimulation = request.resimulation.stopped_by(observer);
    let measured = (&request.packets[..], request.options);
    let split = split::split(&resimulation, measured, (config, links), observer)?;
    Ok(Worded { answer: split::answer(&split), text: split::text(&split) })
}

/// Finds the effects that the network lacks. A search that is stopped gives the answer that it has until then, with `complete` false.
///
/// # Errors
///
/// There are too few seeds, or the network refuses its configuration.
pub fn diagnose(
    request: &PacketRequest,
    observer: &dyn Observer,
) -> Result<Worded<NetworkDiagnosis>, PacketError> {
    request.check_seeds()?;
    observer.opened(&request.account);
    let resimulation = request.resimulation.stopped_by(observer);
    let found = request.select(&resimulation, &search::catalogue(), observer)?;
    let answer = search::answer(&found, request.options, &request.account);
    let text = search::text(&found, &answer);
    Ok(Worded { answer, text })
}

/// An experiment with effects added.
#[derive(Clone, Debug)]
pub struct ExtendedExperiment {
    /// The new file's text.
    pub text: String,
    /// The effects that were added, each with its fit.
    pub added: Vec<(CandidateEffect, FittedEffect)>,
    /// What was added, and how consistent the packets are with the model before and after.
    pub answer: NetworkExtension,
}

/// Adds effects to the network, fitted to the packets.
///
/// * `config`: path and text of the experiment.
/// * `accepts_partial`: whether the effects that were accepted until a search was stopped are added.
///
/// # Errors
///
/// An effect cannot be added, there are too few seeds to search for effects, or the search was stopped.
pub fn extend(
    request: &PacketRequest,
    config: (&Path, &str),
    (effects, accepts_partial): (&Effects, bool),
    observer: &dyn Observer,
) -> Result<ExtendedExperiment, PacketError> {
    let candidates = search::catalogue();
    let names = match effects {
        Effects::Named(names) => &names[..],
        Effects::Accepted => &[],
    };
    let named: Result<Vec<usize>, ExtendError> =
        names.iter().map(|name| extend::candidate(&candidates, name)).collect();
    let mut terms = named?;
    observer.opened(&request.account);
    let resimulation = request.resimulation.stopped_by(observer);
    if *effects == Effects::Accepted {
        request.check_seeds()?;
        let found = request.select(&resimulation, &candidates, observer)?;
        if found.stopped.is_some() && !accepts_partial {
            return Err(PacketError::Stopped(Stopped::Search));
        }
        terms = found.accepted;
    }
    let measured = (&request.packets[..], request.options);
    let search = NetworkSearch::new(&resimulation, measured, &candidates, observer);
    let extended = extend::extend(&search, &terms, config, &request.account)?;
    let answer = extended.answer();
    Ok(ExtendedExperiment { text: extended.text, added: extended.added, answer })
}
