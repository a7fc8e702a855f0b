//! A moving node whose places are those of another time: its clock is late, or runs fast or slow.
//!
//! The place of a node between two of its rows is known where these are near in time. So each trial clock, late by so much in the middle
//! of the campaign and by so much more at its end than at its beginning, gives other places, and the rows of the node another
//! likelihood. If the clock is right, the ratio of both likelihoods exceeds a number c with a probability of at most 1/c, whatever the trial
//! clock (J. Ville, Étude critique de la notion de collectif, 1939): that, for as many rows as are independent, is the test of each node
//! and trial clock.

use super::clock_skew::tracks::{Tracks, is_apart};
use super::evidence::{Evidence, p_value_by_blocks};
use super::{Correction, Defect};
use crate::Estimate;
use crate::thresholds::{
    FEWEST_TRACKED_ROWS, LEAST_CLOCK_SHIFT_S, LEAST_TRACKED_SHARE, MOST_CLOCK_GAP_M,
    UNCORRECTED_LEVEL,
};
use measure::links::LinkRow;
use numbers::normal::Z_90;
use numbers::optimise::nelder_mead::NelderMead;
use numbers::statistics::range;
use std::collections::BTreeMap;

/// The name of this kind.
pub const NAME: &str = "clock-rate";
/// Trial clocks: so many steps either way, of the middle and of half the change over the campaign. In one the node moves so far (m).
const STEP_M: f64 = 3.0;
const N_STEPS: i32 = 6;
/// Rows of a node that are compared: of each node, and of the one that gains most.
const MOST_ROWS: (usize, usize) = (200, 600);
/// Evaluations of the likelihood in the search for the best clock.
const MOST_LOOKS: usize = 80;
/// The share of a step by which a clock is moved for the curvature of the likelihood.
const CURVATURE_SHARE: f64 = 0.1;

/// A clock: how late it is (s) in the middle of the campaign, and how much later at its end than in the middle.
type Clock = [f64; 2];

/// A node's rows, and the span of the campaign.
struct Node<'a> {
    evidence: &'a Evidence<'a>,
    tracks: &'a Tracks,
    node: u32,
    rows: Vec<usize>,
    /// Log likelihood of each of these rows with the measured places (nats).
    logs: Vec<f64>,
    middle_s: f64,
    half_s: f64,
    step_s: f64,
}

/// What a clock gains.
#[derive(Clone, Copy, Debug)]
struct Gain {
    nats: f64,
    p_value: f64,
    n_known: usize,
}

impl<'a> Node<'a> {
    fn new(
        evidence: &'a Evidence<'a>,
        tracks: &'a Tracks,
        (node, rows): (u32, &[usize]),
        [from_s, to_s]: [f64; 2],
        most_rows: usize,
    ) -> Option<Self> {
        let n = rows.len().min(most_rows);
        let mut rows: Vec<usize> = (0..n).map(|k| rows[k * rows.len() / n]).collect();
        let time_s = |row: usize| evidence.rows()[row].time_s;
        rows.sort_by(|&a, &b| time_s(a).total_cmp(&time_s(b)));
        let (middle_s, half_s) = (0.5 * (from_s + to_s), 0.5 * (to_s - from_s));
        let step_s = STEP_M / tracks.speed_mps(node)?;
        let logs = Vec::new();
        let mut node = Self { evidence, tracks, node, rows, logs, middle_s, half_s, step_s };
        let as_is = node.rows.iter().map(|&row| (row, evidence.rows()[row])).collect();
        node.logs = node.logs(as_is)?;
        Some(node)
    }

    /// How late a clock is at a time (s).
    fn late_s(&self, clock: Clock, time_s: f64) -> f64 {
        clock[0] + clock[1] * (time_s - self.middle_s) / self.half_s
    }

    /// A row with the place that the node has by a clock; none where nobody tells.
    fn row_by_clock(&self, row: &LinkRow, clock: Clock) -> Option<LinkRow> {
        let time_s = row.time_s - self.late_s(clock, row.time_s);
        let place = self.tracks.place(row.run, self.node, time_s)?;
        let mut row = *row;
        *(if row.tx == self.node { &mut row.tx_m } else { &mut row.rx_m }) = place;
        Some(row)
    }

    /// The rows that are compared, each by its index, with the place that the node has by a clock; none where nobody tells.
    fn by_clock(&self, clock: Clock) -> impl Iterator<Item = Option<(usize, LinkRow)>> + '_ {
        let moved =
            move |&row: &usize| Some((row, self.row_by_clock(&self.evidence.rows()[row], clock)?));
        self.rows.iter().map(moved)
    }

    /// Log likelihoods of rows (nats).
    fn logs(&self, rows: Vec<(usize, LinkRow)>) -> Option<Vec<f64>> {
        let Evidence { instrument, intercept_db, .. } = self.evidence;
        let (changed, levels) = self.evidence.predicted(rows)?;
        let log = |(row, level)| instrument.row_likelihood(row, level, *intercept_db).log;
        Some(changed.links.rows.iter().zip(&levels).map(log).collect())
    }

    /// What a clock gains over rows whose place it gives.
    fn gain(&self, clock: Clock) -> Option<Gain> {
        let changed: Vec<Option<(usize, LinkRow)>> = self.by_clock(clock).collect();
        let known =
            || changed.iter().zip(&self.logs).filter_map(|(it, log)| Some((it.as_ref()?, log)));
        let logs = self.logs(known().map(|(it, _)| *it).collect())?;
        let of_block = self.evidence.blocks().dependent();
        let gains: Vec<(u32, f64)> = known()
            .zip(&logs)
            .map(|(((row, _), before), after)| (of_block[*row], after - before))
            .collect();
        let (nats, n_known) = (gains.iter().map(|(_, gain)| gain).sum(), gains.len());
        Some(Gain { nats, p_value: p_value_by_blocks(gains), n_known })
    }

    /// How many rows carry the information of one independent row, by the correlation of what a clock leaves of consecutive readings:
    /// one and twice the sum of its first positive terms (C. Geyer, Practical Markov chain Monte Carlo, Stat. Sci. 7, 1992).
    fn design_effect(&self, clock: Clock) -> Option<f64> {
        let Evidence { instrument, intercept_db, .. } = self.evidence;
        let rows = self.by_clock(clock).flatten().collect();
        let (changed, levels) = self.evidence.predicted(rows)?;
        let left = changed.links.rows.iter().zip(&levels).map(|(row, level)| {
            let (mean_dbm, sd_db) = instrument.reading(level, *intercept_db, None);
            (row.rssi_dbm - mean_dbm) / sd_db
        });
        let left: Vec<f64> = left.filter(|left| left.is_finite()).collect();
        let product = |lag: usize| {
            left.iter().zip(&left[lag.min(left.len())..]).map(|(a, b)| a * b).sum::<f64>()
        };
        let square = product(0);
        let correlations = (1..left.len()).map(|lag| product(lag) / square);
        Some(1.0 + 2.0 * correlations.take_while(|it| 0.0 < *it).sum::<f64>())
    }

    /// Whether a clock gives so many rows a place that they are comparable with the rows as they stand.
    fn is_tracked(&self, gain: &Gain) -> bool {
        FEWEST_TRACKED_ROWS <= gain.n_known
            && LEAST_TRACKED_SHARE * self.rows.len() as f64 <= gain.n_known as f64
    }

    /// The trial clock that gains most, and how much (nats).
    fn best_trial(&self) -> Option<(Clock, f64)> {
        let steps = || (-N_STEPS..=N_STEPS).map(|step| f64::from(step) * self.step_s);
        let clocks = steps().flat_map(|middle| steps().map(move |end| [middle, end]));
        let gained = clocks.filter_map(|clock| Some((clock, self.gain(clock)?)));
        let tracked = gained.filter(|(_, gain)| self.is_tracked(gain));
        let nats = tracked.map(|(clock, gain)| (clock, gain.nats));
        nats.max_by(|a, b| a.1.total_cmp(&b.1))
    }

    /// The likeliest clock near a trial, with what it gains. One number: it is as late at the end as in the middle.
    fn refined(&self, start: &[f64]) -> Option<(Clock, Gain)> {
        let search = NelderMead { max_evaluations: MOST_LOOKS, tolerance: 1e-3 };
        let clock = |numbers: &[f64]| [numbers[0], numbers.get(1).copied().unwrap_or_default()];
        let cost = |numbers: &[f64]| {
            let gain = self.gain(clock(numbers)).filter(|gain| self.is_tracked(gain));
            gain.map_or(f64::INFINITY, |gain| -gain.nats)
        };
        let steps_s = vec![self.step_s / 4.0; start.len()];
        let clock = clock(&search.minimise(&cost, start.to_vec(), &steps_s).point);
        Some((clock, self.gain(clock)?))
    }

    /// The likeliest clock near a trial, with what it gains and its standard errors (s): one that does not drift if the interval of the drift
    /// includes 0.
    fn likeliest(&self, start: Clock) -> Option<(Clock, Gain, [f64; 2])> {
        let (clock, gain) = self.refined(&start)?;
        let errors_s = self.errors_s(clock)?;
        if Z_90 * errors_s[1] < clock[1].abs() {
            return Some((clock, gain, errors_s));
        }
        let (clock, gain) = self.refined(&clock[..1])?;
        Some((clock, gain, self.errors_s(clock)?))
    }

    /// The standard errors of a clock (s) by the curvature of the likelihood: of one that drifts by both numbers, of another by the first.
    fn errors_s(&self, clock: Clock) -> Option<[f64; 2]> {
        let by_s = CURVATURE_SHARE * self.step_s;
        let at = |middle: f64, end: f64| {
            let moved = [clock[0] + middle * by_s, clock[1] + end * by_s];
            self.gain(moved).map(|gain| gain.nats)
        };
        let (here, square) = (at(0.0, 0.0)?, by_s * by_s);
        let middle = (2.0 * here - at(1.0, 0.0)? - at(-1.0, 0.0)?) / square;
        if clock[1] == 0.0 {
            return (0.0 < middle).then(|| [1.0 / middle.sqrt(), 0.0]);
        }
        let end = (2.0 * here - at(0.0, 1.0)? - at(0.0, -1.0)?) / square;
        let both =
            (at(1.0, -1.0)? + at(-1.0, 1.0)? - at(1.0, 1.0)? - at(-1.0, -1.0)?) / (4.0 * square);
        let determinant = middle * end - both * both;
        let errors = [(end / determinant).sqrt(), (middle / determinant).sqrt()];
        errors.iter().all(|error| error.is_finite()).then_some(errors)
    }
}

/// A clock in words, by how late it is (s) at the beginning and at the end: a late clock stamps early.
fn in_words(node: u32, [begin_s, end_s]: [f64; 2]) -> String {
    let off = |s: f64| format!("{:.2} s too {}", s.abs(), if 0.0 < s { "early" } else { "late" });
    let [begin, end] = [begin_s, end_s].map(off);
    if begin == end {
        return format!("positions of node {node} are stamped {begin}");
    }
    format!(
        "positions of node {node} are stamped {begin} at the beginning and {end} at the end of the campaign"
    )
}

/// Looks for a moving node whose clock is wrong.
#[must_use]
pub fn test(evidence: &Evidence<'_>) -> Option<Defect> {
    let (rows, still) = (evidence.rows(), evidence.modelled().still());
    let span_s = range(rows.iter().map(|row| row.time_s));
    let tracks = Tracks::new(rows, MOST_CLOCK_GAP_M);
    if !span_s.iter().all(|end| end.is_finite()) || span_s[0] == span_s[1] {
        return None;
    }
    let mut of_node: BTreeMap<u32, Vec<usize>> = BTreeMap::new();
    for (index, row) in rows.iter().enumerate() {
        for node in [row.tx, row.rx].into_iter().filter(|node| still.get(node) == Some(&false)) {
            of_node.entry(node).or_default().push(index);
        }
    }
    let node = |node: u32, most_rows: usize| {
        Node::new(evidence, &tracks, (node, of_node[&node].as_slice()), span_s, most_rows)
    };
    let trial = |&id: &u32| Some((id, node(id, MOST_ROWS.0)?.best_trial()?));
    let trials: Vec<(u32, (Clock, f64))> = of_node.keys().filter_map(trial).collect();
    let &(id, (start, _)) = trials.iter().max_by(|a, b| a.1.1.total_cmp(&b.1.1))?;
    let node = node(id, MOST_ROWS.1)?;
    let (clock, gain, errors_s) = node.likeliest(start)?;
    let ends_s = [clock[0] - clock[1], clock[0] + clock[1]];
    let most_s = ends_s.into_iter().map(f64::abs).fold(0.0, f64::max);
    tracing::debug!(node = node.node, ?clock, ?gain, "clock");
    // The gain must not be that of a few moments.
    if most_s < LEAST_CLOCK_SHIFT_S || UNCORRECTED_LEVEL < gain.p_value {
        return None;
    }
    let p_value = libm::exp(-gain.nats / node.design_effect(clock)?);
    let concerned = &of_node[&node.node];
    let (mut changed, mut is_known) = (rows.to_vec(), vec![false; rows.len()]);
    let (mut replaced, mut left_out) = (Vec::new(), Vec::new());
    for &row in concerned {
        match node.row_by_clock(&rows[row], clock) {
            Some(moved) => {
                (changed[row], is_known[row]) = (moved, true);
                if is_apart(moved.tx_m, rows[row].tx_m) || is_apart(moved.rx_m, rows[row].rx_m) {
                    replaced.push((row as u32, moved));
                }
            }
            None => left_out.push(row as u32),
        }
    }
    let other = evidence.alternative(&changed, false)?;
    let share = evidence.share_removed(&other, &|row| is_known[row]);
    let estimate = |name, unit, value: f64, error: f64| {
        Estimate::new(name, unit, value, (value - Z_90 * error, value + Z_90 * error))
    };
    // Bonferroni: each node by each trial clock, and those of the search for the best.
    let n_clocks = (2 * N_STEPS + 1).pow(2) as usize + MOST_LOOKS;
    let per_s = 1.0 / node.half_s;
    let mut estimates = vec![estimate("shift_s", "s", clock[0], errors_s[0])];
    if clock[1] != 0.0 {
        estimates.push(estimate("rate", "", clock[1] * per_s, errors_s[1] * per_s));
    }
    Some(Defect {
        name: NAME,
        p_value: ((trials.len() * n_clocks) as f64 * p_value).min(1.0),
        share,
        estimates,
        nodes: vec![node.node],
        runs: Vec::new(),
        n_rows: concerned.len(),
        first_line: concerned.iter().map(|&row| rows[row].line).min()?,
        clause: in_words(node.node, ends_s),
        correction: Correction { replaced, ..Correction::leaving_out(left_out) },
    })
}
