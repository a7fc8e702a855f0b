//! Where the error of a network comes from: robots, radio or protocol.
//!
//! The model runs in three forms: as a whole; with the measured tracks in place of its robots; and with the measured links in place
//! of its radio as well. The part that a step replaced accounts for the error that the step removes. The remaining error belongs
//! to the rest: protocols, applications, effects on motes.
//!
//! Measured links are counts of frames, so a trace of links is less accurate than a radio. The third step is therefore compared
//! with a trace of the links that the model itself would have measured at the same rows. The error of that trace is subtracted
//! from the remaining error.

mod words;

use super::compare::ComparisonOptions;
use super::kpis::{KPIS, NetworkFigures};
use super::request::simulating;
use super::resimulate::{Resimulation, ResimulationError};
use super::spread::place;
use bytes::Bytes;
use diagnose::{Observer, simulate};
use measure::config::Compared;
use measure::links::{self, LinkRow};
use measure::packets::MeasuredPacket;
use measure::table::DataTable;
use numbers::normal::Z_90;
use numbers::power::square;
use numbers::statistics::{mean, variance};
use proto::rng::{Draws, Purpose};
use statrs::distribution::{ContinuousCDF as _, StudentsT};
use std::collections::BTreeMap;
use std::fmt::Write as _;
use study::open::OpenError;
use study::thresholds::{
    COUNTED_FRAMES, LEAST_FIGURE_DIFFERENCE, PACKETS_LEVEL, SPLIT_CAMPAIGNS, SPLIT_RUNS,
};
pub(crate) use words::{answer, text};

/// Readings of a model without noise, as `simulate` takes them (dB).
const NO_NOISE_DB: f64 = 1e-3;

/// Why an error cannot be split.
#[derive(Debug, thiserror::Error)]
pub enum SplitError {
    /// The network refuses something.
    #[error(transparent)]
    Resimulation(#[from] ResimulationError),
    /// The links cannot be used.
    #[error("{0}")]
    Links(String),
    /// Nor can the radio measure them.
    #[error(transparent)]
    Open(#[from] OpenError),
}

/// What frames between two motes came to within some time.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Count {
    from_s: f64,
    tx: u32,
    rx: u32,
    frames: f64,
    received: f64,
    /// Sum of the readings, and how many they are.
    readings: (f64, f64),
}

/// Links as they were measured.
#[derive(Clone, Debug)]
pub(crate) struct Campaign {
    counts: Vec<Count>,
    n_agents: usize,
    until_s: f64,
}

impl Campaign {
    /// Of link samples or an aggregated table.
    ///
    /// # Errors
    ///
    /// They say nothing of reception, or name motes that the experiment does not have; in words for their author.
    pub(crate) fn from_table(
        table: &DataTable,
        n_agents: usize,
        until_s: f64,
    ) -> Result<Self, String> {
        let rows = links::read(table)?.rows;
        let known: Vec<&LinkRow> = rows.iter().filter(|row| row.received.is_finite()).collect();
        if known.is_empty() {
            return Err("no row says whether a frame was received; add the column received or pdr"
                .to_owned());
        }
        let most = known.iter().map(|row| row.tx.max(row.rx)).max().unwrap_or_default();
        if n_agents <= most as usize {
            return Err(format!(
                "the links mention mote {most}, but the experiment has {n_agents} agents, motes 0 to {}",
                n_agents - 1
            ));
        }
        let time_s = |row: &LinkRow| if row.time_s.is_finite() { row.time_s.max(0.0) } else { 0.0 };
        let mut frames_of: BTreeMap<(u32, u32), f64> = BTreeMap::new();
        for row in &known {
            *frames_of.entry((row.tx, row.rx)).or_insert(0.0) += row.frames;
        }
        let mean = frames_of.values().sum::<f64>() / frames_of.len() as f64;
        let span_s = known.iter().map(|row| time_s(row)).fold(0.0, f64::max).max(1e-9);
        let parts = (mean / COUNTED_FRAMES).floor().max(1.0);
        let mut counts: BTreeMap<(u64, u32, u32), Count> = BTreeMap::new();
        for row in &known {
            let part = (time_s(row) / span_s * parts).floor().min(parts - 1.0);
            let count = counts.entry((part as u64, row.tx, row.rx)).or_insert(Count {
                from_s: part / parts * span_s,
                tx: row.tx,
                rx: row.rx,
                frames: 0.0,
                received: 0.0,
                readings: (0.0, 0.0),
            });
            count.frames += row.frames;
            count.received += row.received;
            if row.rssi_dbm.is_finite() && 0.0 < row.received {
                count.readings.0 += row.received * row.rssi_dbm;
                count.readings.1 += row.received;
            }
        }
        Ok(Self { counts: counts.into_values().collect(), n_agents, until_s })
    }

    /// As a trace for the radio, with shares received drawn about those counted as far as the counts leave open: on the scale of
    /// the arcsine of their root, where counting scatters alike everywhere (M. F. Freeman, J. W. Tukey, Ann. Math. Stat. 21, 1950).
    fn trace(&self, number: u64) -> Bytes {
        let draws = Draws::new(number, Purpose::Resample);
        let channels: Vec<String> = (11..=26).map(|channel: u8| channel.to_string()).collect();
        let mut text = format!(
            "{{\"tx_length\": 1, \"start_date\": \"{}\", \"stop_date\": \"{}\", \"channels\": [{}], \"location\": \"measured\", \
             \"node_count\": {}, \"interframe_duration\": 1}}\ndatetime,src,dst,channel,mean_rssi,pdr,tx_count\n",
            date(0.0),
            date(self.until_s.max(1.0)),
            channels.join(", "),
            self.n_agents
        );
        for (k, count) in self.counts.iter().enumerate() {
            let mut share = count.received / count.frames;
            if 0.0 < share && share < 1.0 {
                let angle = libm::asin(libm::sqrt(share))
                    + 0.5 / libm::sqrt(count.frames) * draws.normal(k as u64, 0, 0);
                share = square(libm::sin(angle.clamp(0.0, std::f64::consts::FRAC_PI_2)));
            }
            let rssi = if 0.0 < count.readings.1 {
                format!("{:.2}", count.readings.0 / count.readings.1)
            } else {
                String::new()
            };
            // Where none was read none is received, as far as a trace goes.
            if rssi.is_empty() {
                share = 0.0;
            }
            let _ = writeln!(
                text,
                "{},{},{},,{rssi},{share:.6},{:.0}",
                date(count.from_s),
                count.tx,
                count.rx,
                count.frames
            );
        }
        Bytes::from(text)
    }
}

/// A time of a campaign as a trace has it.
fn date(time_s: f64) -> String {
    let tenths = (time_s * 10.0).floor() as u64;
    let (s, tenth) = (tenths / 10, tenths % 10);
    let (day, s) = (s / 86_400, s % 86_400);
    format!("2000-01-{:02}T{:02}:{:02}:{:02}.{tenth}", day + 1, s / 3600, s / 60 % 60, s % 60)
}

/// The part of the error in one figure that goes with one source.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct SplitPart {
    /// Estimated part of the error, in the figure's unit.
    pub value: f64,
    /// 90 % interval.
    pub interval: [f64; 2],
    /// In standard errors, on the figure's scale.
    pub z: f64,
}

/// A source of error: robots, radio or protocol.
#[derive(Clone, Debug)]
pub(crate) struct ErrorSource {
    /// `robot`, `radio` or `protocol`.
    pub name: &'static str,
    /// By figure; none where it is not known.
    pub parts: Vec<Option<SplitPart>>,
    /// P-value: probability of as great a part in any figure if this source has no error.
    pub p_value: f64,
}

/// Attribution of the error of a network model to robots, radio and protocol.
#[derive(Clone, Debug)]
pub(crate) struct ErrorSplit {
    /// Figures of the measurement.
    pub measured: NetworkFigures,
    /// Means of the whole model, with measured tracks, with a trace of its own links, with a trace of the measured links.
    pub means: [[f64; KPIS.len()]; 4],
    /// Robot, radio, protocol.
    pub shares: [ErrorSource; 3],
    /// Number of seeds per variant of the model.
    pub seeds: u64,
}

impl ErrorSplit {
    /// The sources whose part is significant.
    #[must_use]
    pub(crate) fn found(&self) -> Vec<&ErrorSource> {
        self.shares.iter().filter(|share| share.p_value <= PACKETS_LEVEL).collect()
    }
}

/// Mean, variance and size of a sample.
#[derive(Clone, Copy, Debug)]
struct SampleMoments {
    mean: f64,
    variance: f64,
    n: f64,
}

impl SampleMoments {
    fn from_values(values: &[f64]) -> Self {
        let all = values.iter().copied();
        Self { mean: mean(all.clone()), variance: variance(all), n: values.len() as f64 }
    }

    fn variance_of_mean(self) -> f64 {
        self.variance / self.n
    }
}

/// Attributes the error of a network model to robots, radio and protocol.
///
/// * `resimulation`: with the measured tracks.
/// * `config`: the same experiment, as far as its radio is concerned.
/// * `links`: what was measured of links.
///
/// # Errors
///
/// See [`SplitError`].
pub(crate) fn split(
    resimulation: &Resimulation,
    (measured, asked): (&[MeasuredPacket], ComparisonOptions),
    (config, links): (&Compared, &DataTable),
    observer: &dyn Observer,
) -> Result<ErrorSplit, SplitError> {
    let n_agents = resimulation.plan().experiment.agent_count;
    let campaign = |table: &DataTable| {
        Campaign::from_table(table, n_agents, resimulation.duration_s())
            .map_err(|why| SplitError::Links(format!("{}: {why}", links.path.display())))
    };
    let network = resimulation.network();
    let seeds = 0..asked.seeds;
    simulating(observer, "simulating the whole model");
    let whole = resimulation.with_its_robots()?.figures(&network, seeds.clone(), asked.from_s)?;
    simulating(observer, "simulating with the measured tracks");
    let tracked = resimulation.figures(&network, seeds.clone(), asked.from_s)?;
    simulating(observer, "simulating with the measured links");
    let traced = traced(&network);
    let here = campaign(links)?;
    let over = |campaign: &Campaign, seeds: std::ops::Range<u64>| {
        let runs: Vec<(u64, Bytes)> = seeds.map(|seed| (seed, campaign.trace(seed))).collect();
        resimulation.figures_over(&traced, &runs, asked.from_s)
    };
    let linked = over(&here, seeds)?;
    simulating(observer, "simulating with links as the model would have measured them");
    let mut own: Vec<NetworkFigures> = Vec::new();
    for number in 0..SPLIT_CAMPAIGNS {
        let simulated = simulate::simulate(config, links, number + 1, Some(NO_NOISE_DB))?;
        let table = DataTable::of_columns(simulated.names, simulated.columns);
        let first = asked.seeds + number * SPLIT_RUNS;
        own.extend(over(&campaign(&table)?, first..first + SPLIT_RUNS)?);
    }
    let measured = NetworkFigures::from_packets(measured, asked.from_s);
    Ok(parted(measured, [&whole, &tracked, &own, &linked], asked.seeds))
}

/// The parts, by the figures of the runs.
fn parted(measured: NetworkFigures, runs: [&[NetworkFigures]; 4], seeds: u64) -> ErrorSplit {
    let raw = |run: &NetworkFigures| run.values;
    let levels = |of: &dyn Fn(&NetworkFigures) -> [f64; KPIS.len()], k: usize| {
        runs.map(|runs| {
            SampleMoments::from_values(&runs.iter().map(|run| of(run)[k]).collect::<Vec<f64>>())
        })
    };
    // What the model's own campaigns of links differ by beyond the chances of runs over them.
    let between = |of: &dyn Fn(&NetworkFigures) -> [f64; KPIS.len()], k: usize| {
        let groups: Vec<SampleMoments> = runs[2]
            .chunks(SPLIT_RUNS as usize)
            .map(|group| {
                SampleMoments::from_values(
                    &group.iter().map(|run| of(run)[k]).collect::<Vec<f64>>(),
                )
            })
            .collect();
        let within =
            groups.iter().map(|group| group.variance_of_mean()).sum::<f64>() / groups.len() as f64;
        let means: Vec<f64> = groups.iter().map(|group| group.mean).collect();
        (SampleMoments::from_values(&means).variance - within).max(0.0)
    };
    let differences =
        |of: &dyn Fn(&NetworkFigures) -> [f64; KPIS.len()], k: usize| -> [(f64, f64); 3] {
            let [whole, tracked, own, linked] = levels(of, k);
            [
                (tracked.mean - whole.mean, tracked.variance_of_mean() + whole.variance_of_mean()),
                (
                    linked.mean - own.mean,
                    linked.variance_of_mean() + own.variance_of_mean() + between(of, k),
                ),
                // Without the error of the trace itself.
                (
                    of(&measured)[k] - linked.mean - (tracked.mean - own.mean),
                    linked.variance
                        + linked.variance_of_mean()
                        + tracked.variance_of_mean()
                        + own.variance_of_mean(),
                ),
            ]
        };
    let names = ["robot", "radio", "protocol"];
    let mut shares = names.map(|name| ErrorSource { name, parts: Vec::new(), p_value: 1.0 });
    for k in 0..KPIS.len() {
        let in_units = differences(&raw, k);
        let on_scale = differences(&NetworkFigures::scaled, k);
        for (share, (unit, scale)) in shares.iter_mut().zip(in_units.into_iter().zip(on_scale)) {
            let sd = libm::sqrt(unit.1);
            let part = SplitPart {
                value: unit.0,
                interval: [unit.0 - Z_90 * sd, unit.0 + Z_90 * sd],
                z: scale.0 / libm::sqrt(scale.1).max(LEAST_FIGURE_DIFFERENCE),
            };
            share.parts.push((part.value.is_finite() && part.z.is_finite()).then_some(part));
        }
    }
    let [robot, radio, protocol] = &mut shares;
    robot.p_value = furthest(&robot.parts, runs[0].len() as f64 - 1.0);
    radio.p_value = furthest(&radio.parts, SPLIT_CAMPAIGNS as f64 - 1.0);
    let shifts: Vec<f64> = (0..KPIS.len())
        .map(|k| levels(&NetworkFigures::scaled, k))
        .map(|[_, tracked, own, _]| tracked.mean - own.mean)
        .collect();
    let shifted = |run: &NetworkFigures| {
        run.scaled().iter().zip(&shifts).map(|(x, shift)| x + shift).collect()
    };
    let scaled: Vec<Vec<f64>> = runs[3].iter().map(shifted).collect();
    protocol.p_value = place(&measured.scaled(), &scaled).p_value;
    let means = runs.map(|runs| {
        std::array::from_fn(|k| {
            SampleMoments::from_values(&runs.iter().map(|run| run.values[k]).collect::<Vec<f64>>())
                .mean
        })
    });
    ErrorSplit { measured, means, shares, seeds }
}

/// The chance that any of the figures lies so many standard errors out: each counted (Bonferroni).
fn furthest(parts: &[Option<SplitPart>], freedom: f64) -> f64 {
    let known = parts.iter().flatten();
    let n = known.clone().count() as f64;
    let z = known.map(|part| part.z.abs()).fold(0.0, f64::max);
    StudentsT::new(0.0, 1.0, freedom).map_or(1.0, |t| (2.0 * n * t.sf(z)).min(1.0))
}

/// A network's section whose radio is a trace of links.
fn traced(network: &toml::Table) -> toml::Table {
    let mut network = network.clone();
    let kept = network.get("phy").and_then(|phy| phy.get("interference")).cloned();
    let mut phy = toml::Table::new();
    phy.insert("propagation".to_owned(), "trace".into());
    phy.insert("file".to_owned(), super::resimulate::LINKS.into());
    phy.extend(kept.map(|kept| ("interference".to_owned(), kept)));
    network.insert("phy".to_owned(), toml::Value::Table(phy));
    network
}
