//! A comparison of a configured network with measured packets.

pub(crate) mod words;

use super::comparison::{
    AmongSeeds, BySource, DeliveryOfModel, MoteBin, MoteDelivery, NetworkComparison,
    NetworkVerdict, SCHEMA,
};
use super::kpis::{KPIS, MoteCounts, NetworkFigures};
use super::resimulate::{Resimulation, ResimulationError};
use super::spread::{FigurePlacement, Placement, kpi, place};
use indexmap::IndexMap;
use measure::account::DataAccount;
use measure::packets::MeasuredPacket;
use numbers::format::{number, percent};
use numbers::statistics::{mean, quantile};
use std::collections::BTreeSet;
use study::thresholds::{CONSISTENCY_LEVEL, FEWEST_CONSISTENCY_SEEDS, TAIL_90};

/// Options of a comparison.
#[derive(Clone, Copy, Debug)]
pub struct ComparisonOptions {
    /// Number of seeds under which the network is simulated, at least 19.
    pub seeds: u64,
    /// Simulated time (s) before which packets that were created are not compared.
    pub from_s: f64,
}

impl Default for ComparisonOptions {
    fn default() -> Self {
        Self { seeds: 199, from_s: 0.0 }
    }
}

/// A measurement compared with runs of the model under many seeds.
#[derive(Clone, Debug)]
pub struct SeedComparison {
    /// Figures of the measurement.
    pub measured: NetworkFigures,
    /// Figures of the run under each seed.
    pub seeds: Vec<NetworkFigures>,
    /// P-values of the measurement among the runs.
    pub placed: Placement,
}

impl SeedComparison {
    /// Compares measured packets, made from `from_s` on, with those of runs of a model.
    #[must_use]
    pub fn from_packets(
        measured: &[MeasuredPacket],
        runs: &[Vec<MeasuredPacket>],
        from_s: f64,
    ) -> Self {
        let seeds = runs.iter().map(|run| NetworkFigures::from_packets(run, from_s)).collect();
        Self::from_figures(NetworkFigures::from_packets(measured, from_s), seeds)
    }

    /// Compares the figures of a measurement with those of the runs under each seed.
    #[must_use]
    pub fn from_figures(measured: NetworkFigures, seeds: Vec<NetworkFigures>) -> Self {
        let scaled: Vec<Vec<f64>> = seeds.iter().map(|seed| seed.scaled().to_vec()).collect();
        let placed = place(&measured.scaled(), &scaled);
        Self { measured, seeds, placed }
    }

    /// A figure of the seeds: mean, and where the middle 90 % lie.
    #[must_use]
    pub fn model(&self, k: usize) -> (f64, [f64; 2]) {
        spread(self.seeds.iter().map(|seed| seed.values[k]).collect())
    }
}

/// Mean of the finite values, and where the middle 90 % lie.
fn spread(mut values: Vec<f64>) -> (f64, [f64; 2]) {
    values.retain(|value| value.is_finite());
    if values.is_empty() {
        return (f64::NAN, [f64::NAN; 2]);
    }
    values.sort_by(f64::total_cmp);
    (mean(values.iter().copied()), [TAIL_90, 1.0 - TAIL_90].map(|share| quantile(&values, share)))
}

/// Holds a network as configured against measured packets, nothing fitted.
///
/// # Errors
///
/// The network refuses its configuration.
pub(crate) fn compare(
    resimulation: &Resimulation,
    measured: &[MeasuredPacket],
    asked: ComparisonOptions,
    account: &DataAccount,
) -> Result<NetworkComparison, ResimulationError> {
    let among = among(resimulation, &resimulation.network(), measured, asked)?;
    let (verdict, sentence) = sentence(&among);
    Ok(NetworkComparison {
        schema: SCHEMA,
        kind: "network",
        among: among_seeds(&among, asked),
        verdict,
        sentence,
        account: account.clone(),
        error_split: None,
    })
}

/// A measurement among the runs of a network's section under the seeds of comparisons.
///
/// # Errors
///
/// The network refuses that section.
pub(crate) fn among(
    resimulation: &Resimulation,
    network: &toml::Table,
    measured: &[MeasuredPacket],
    asked: ComparisonOptions,
) -> Result<SeedComparison, ResimulationError> {
    let seeds = resimulation.figures(network, 0..asked.seeds, asked.from_s)?;
    Ok(SeedComparison::from_figures(NetworkFigures::from_packets(measured, asked.from_s), seeds))
}

/// A figure in words: `93.1 %`, `1.24 s`.
fn shown(value: f64, unit: &str) -> String {
    match unit {
        _ if value.is_nan() => "undefined".to_owned(),
        "" => percent(value),
        unit => format!("{} {unit}", number(value)),
    }
}

/// The result in a sentence.
pub(super) fn sentence(among: &SeedComparison) -> (NetworkVerdict, String) {
    let n = among.seeds.len();
    let p_value = among.placed.p_value;
    if n < FEWEST_CONSISTENCY_SEEDS {
        let text =
            format!("{n} seeds are too few for a test; use at least {FEWEST_CONSISTENCY_SEEDS}");
        return (NetworkVerdict::TooFewSeeds, text);
    }
    if CONSISTENCY_LEVEL < p_value {
        let text = format!(
            "the packets are consistent with the model (p = {p_value:.3}): {} of {n} seeds deviate as much",
            (p_value * (n as f64 + 1.0)).round() as u64 - 1
        );
        return (NetworkVerdict::Agrees, text);
    }
    let mut far: Vec<(usize, FigurePlacement)> =
        among.placed.figures.iter().enumerate().filter_map(|(k, it)| Some((k, (*it)?))).collect();
    far.sort_by(|a, b| b.1.z.abs().total_cmp(&a.1.z.abs()));
    let parts: Vec<String> = far
        .iter()
        .enumerate()
        .filter(|(place, (_, standing))| *place == 0 || standing.p_value <= CONSISTENCY_LEVEL)
        .take(3)
        .map(|(_, (k, _))| {
            let (_, [low, high]) = among.model(*k);
            let unit = KPIS[*k].unit;
            format!(
                "{} is {}, and the model predicts {} to {}",
                KPIS[*k].name,
                shown(among.measured.values[*k], unit),
                shown(low, unit),
                shown(high, unit)
            )
        })
        .collect();
    let text = format!(
        "the packets are inconsistent with the model (p = {p_value:.3}): {}",
        parts.join("; ")
    );
    (NetworkVerdict::Differs, text)
}

/// The part of an answer that says where measured packets stand among the runs of a model.
#[must_use]
pub(crate) fn among_seeds(among: &SeedComparison, asked: ComparisonOptions) -> AmongSeeds {
    let (mut kpis, mut scores, mut intervals) = (Vec::new(), IndexMap::new(), IndexMap::new());
    for (k, figure) in KPIS.iter().enumerate() {
        let measured = among.measured.values[k];
        let (mean, [low, high]) = among.model(k);
        let standing = among.placed.figures[k];
        if standing.is_some() {
            scores.insert(figure.name.to_owned(), measured - mean);
            intervals.insert(figure.name.to_owned(), [measured - high, measured - low]);
        }
        let seeds = among.seeds.iter().map(|seed| seed.values[k]).collect();
        kpis.push(kpi(figure, measured, mean, [low, high], seeds, standing));
    }
    let (motes, by_source) = by_mote(among);
    AmongSeeds {
        unit: "seed",
        seeds: asked.seeds,
        from_s: asked.from_s,
        scores,
        intervals,
        kpis,
        motes,
        places: [by_source],
        p_value: among.placed.p_value,
    }
}

/// Delivery of each mote, and whether the error goes with the mote.
fn by_mote(among: &SeedComparison) -> (Vec<MoteDelivery>, BySource) {
    let runs = || among.seeds.iter().chain([&among.measured]);
    let numbers: BTreeSet<u32> = runs().flat_map(|run| run.of_mote.keys().copied()).collect();
    // A mote that sent nothing delivered nothing.
    let share =
        |run: &NetworkFigures, mote: u32| run.of_mote.get(&mote).map_or(0.0, |of| of.share());
    let scaled = |run: &NetworkFigures| -> Vec<f64> {
        let counts_of = |mote: &u32| run.of_mote.get(mote).copied().unwrap_or_default();
        let odds = |of: MoteCounts| {
            (f64::from(of.arrived) + 0.5) / (f64::from(of.sent - of.arrived) + 0.5)
        };
        numbers.iter().map(|mote| libm::log(odds(counts_of(mote)))).collect()
    };
    let seeds: Vec<Vec<f64>> = among.seeds.iter().map(scaled).collect();
    let placed = place(&scaled(&among.measured), &seeds);
    let mut motes = Vec::new();
    let mut bins = Vec::new();
    for &mote in &numbers {
        let counts = among.measured.of_mote.get(&mote).copied().unwrap_or_default();
        let measured = share(&among.measured, mote);
        // A seed in which the mote made no packet says nothing of its delivery.
        let sending = among.seeds.iter().filter(|seed| seed.of_mote.contains_key(&mote));
        let (mean, [low, high]) = spread(sending.map(|seed| share(seed, mote)).collect());
        motes.push(MoteDelivery {
            mote,
            sent: counts.sent,
            arrived: counts.arrived,
            delivery: measured,
            model: DeliveryOfModel { mean, low, high },
            is_outside: measured < low || high < measured,
        });
        let bias = measured - mean;
        bins.push(MoteBin { from: mote, to: mote, n: counts.sent, bias, rmse: bias.abs() });
    }
    let by_source = BySource { covariate: "source", explained: (), p_value: placed.p_value, bins };
    (motes, by_source)
}
