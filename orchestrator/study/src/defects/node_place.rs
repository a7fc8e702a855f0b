//! A node that stands still elsewhere than its survey says.
//!
//! A wrong place changes what the model predicts of every link of the node, each by its distance and direction. The mean residuals of
//! these links are regressed on what a trial place would change, beside a level of the node: shadowing and walls, which give each link
//! an error of its own, are the noise of this regression. A partner that moves has no mean residual; its rows count by the square of
//! the area in which it is, together with those of all others that move.
//!
//! The partner on which the regression rests most is left out of it: a link that is very short must not decide alone.
//!
//! Trial places stand on rings about the surveyed one. The amplitude of the change is free in the test, so that each place is one test
//! by Student's t, and none in the estimate, which a simplex search refines.

use super::evidence::Evidence;
use super::{Correction, Defect};
use crate::Estimate;
use crate::thresholds::CATALOGUE_SHARE;
use measure::links::LinkRow;
use numbers::optimise::nelder_mead::NelderMead;
use numbers::power::square;
use numbers::statistics::{mean, range};
use statrs::distribution::{ContinuousCDF as _, StudentsT};
use std::collections::BTreeMap;
use std::f64::consts::TAU;

/// The name of this kind.
pub const NAME: &str = "node-place";
/// Trial places: so many directions, and distances as shares of the root mean square distance to the partners.
const N_DIRECTIONS: u32 = 16;
const RINGS: [f64; 5] = [0.05, 0.12, 0.25, 0.5, 0.9];
/// The area in which partners move has so many squares along its greater side.
const SQUARES: f64 = 4.0;
/// Rows of one link that are compared, and of all nodes together.
const ROWS_OF_LINK: (usize, usize) = (4, 32);
const MOST_ROWS: usize = 100_000;
/// A place is moved by this (m) for the derivative of its interval.
const STEP_M: f64 = 0.05;

/// What stands for one partner: itself, or the square in which others move.
type Partner = (Option<u32>, i64, i64);

/// The level that all links of a node have in common, beside what its place changes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NodeLevel {
    /// Free: that of its device. The place must explain by what its links differ.
    Free,
    /// None: the place must explain the level, too. All links of a node at the edge of a site grow longer with it.
    Zero,
}

/// Rows of a node by partner.
struct Node<'a> {
    evidence: &'a Evidence<'a>,
    node: u32,
    level: NodeLevel,
    /// Rows of each partner, ascending.
    partners: Vec<Vec<usize>>,
    /// Root mean square distance to the partners (m).
    reach_m: f64,
    /// Mean residual of each partner (dB).
    residuals_db: Vec<f64>,
    /// What the model says of the rows as they stand (dBm), in the order of `partners`.
    readings_dbm: Vec<f64>,
}

/// The regression of residuals on a change.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Regression {
    p_value: f64,
    amplitude: f64,
    /// The share of the variance between partners that the change explains.
    share: f64,
}

/// Which end of a row is at a node.
fn end_at(row: &LinkRow, node: u32) -> Option<usize> {
    [row.tx, row.rx].iter().position(|&end| end == node)
}

/// A row with a node elsewhere by so much (m).
fn displaced(row: &LinkRow, node: u32, by_m: [f64; 2]) -> LinkRow {
    let mut row = *row;
    let place = if end_at(&row, node) == Some(0) { &mut row.tx_m } else { &mut row.rx_m };
    (place[0], place[1]) = (place[0] + by_m[0], place[1] + by_m[1]);
    row
}

impl<'a> Node<'a> {
    /// Rows of a node, at most so many of each partner.
    fn new(
        evidence: &'a Evidence<'a>,
        (node, level): (u32, NodeLevel),
        rows: &[usize],
        most: usize,
    ) -> Option<Self> {
        let (all, still) = (evidence.rows(), evidence.modelled().still());
        let partner = |row: usize| match end_at(&all[row], node) {
            Some(0) => (all[row].rx, all[row].rx_m),
            _ => (all[row].tx, all[row].tx_m),
        };
        let is_still = |row: usize| still.get(&partner(row).0) == Some(&true);
        let moving = || rows.iter().filter(|&&row| !is_still(row));
        let side = |axis: usize| {
            let [least, greatest] = range(moving().map(|&row| partner(row).1[axis]));
            (greatest - least) / SQUARES
        };
        let side_m = side(0).max(side(1));
        let key = |row: usize| -> Partner {
            let (id, place) = partner(row);
            let square = |axis: usize| (place[axis] / side_m).floor() as i64;
            if is_still(row) { (Some(id), 0, 0) } else { (None, square(0), square(1)) }
        };
        let mut partners: BTreeMap<Partner, Vec<usize>> = BTreeMap::new();
        rows.iter().for_each(|&row| partners.entry(key(row)).or_default().push(row));
        let usual = partners.values().map(Vec::len).sum::<usize>() / partners.len().max(1);
        // A partner of few rows has an error of its own, which the regression does not know.
        partners.retain(|_, rows| usual <= 4 * rows.len());
        let evenly = |rows: Vec<usize>| -> Vec<usize> {
            let n = rows.len().min(most);
            (0..n).map(|k| rows[k * rows.len() / n]).collect()
        };
        let partners: Vec<Vec<usize>> = partners.into_values().map(evenly).collect();
        let distance = |&row: &usize| {
            let LinkRow { tx_m, rx_m, .. } = &all[row];
            square(tx_m[0] - rx_m[0]) + square(tx_m[1] - rx_m[1])
        };
        let reach_m = mean(partners.iter().flatten().map(distance)).sqrt();
        let of = |rows: &Vec<usize>| mean(rows.iter().map(|&row| evidence.residual_db(row)));
        let residuals_db = partners.iter().map(of).collect();
        let mut node = Self {
            evidence,
            node,
            level,
            partners,
            reach_m,
            residuals_db,
            readings_dbm: Vec::new(),
        };
        node.readings_dbm = node.readings_dbm([0.0; 2])?;
        // Without any of them, the level and the amplitude leave nothing of two partners.
        (3 < node.partners.len() && 0.0 < reach_m).then_some(node)
    }

    /// What the model says of the rows (dBm) with the node elsewhere by so much (m).
    fn readings_dbm(&self, by_m: [f64; 2]) -> Option<Vec<f64>> {
        let Self { evidence, node, .. } = self;
        let rows = self.partners.iter().flatten();
        let rows = rows.map(|&row| (row, displaced(&evidence.rows()[row], *node, by_m))).collect();
        let (_, levels) = evidence.predicted(rows)?;
        let reading = |level| evidence.instrument.reading(level, evidence.intercept_db, None).0;
        Some(levels.iter().map(reading).collect())
    }

    /// By how much a place changes what the model says of each partner (dB), on average.
    fn changes_db(&self, by_m: [f64; 2]) -> Option<Vec<f64>> {
        let readings = self.readings_dbm(by_m)?;
        let mut pairs = readings.iter().zip(&self.readings_dbm);
        let of = |rows: &Vec<usize>| mean(pairs.by_ref().take(rows.len()).map(|(a, b)| a - b));
        Some(self.partners.iter().map(of).collect())
    }

    /// The residuals beside the level of the node when it is elsewhere (dB).
    fn left_db(&self, by_m: [f64; 2]) -> Option<Vec<f64>> {
        let changes = self.changes_db(by_m)?;
        let left =
            self.residuals_db.iter().zip(changes).map(|(residual, change)| residual - change);
        Some(self.level.taken_from(&left.collect::<Vec<f64>>()))
    }

    /// The trial place that is likeliest, by the p-value of its regression.
    fn best_trial(&self) -> Option<([f64; 2], Regression)> {
        let places = RINGS.iter().flat_map(|ring| {
            (0..N_DIRECTIONS).map(move |k| {
                let angle = TAU * f64::from(k) / f64::from(N_DIRECTIONS);
                [libm::cos(angle), libm::sin(angle)].map(|part| ring * self.reach_m * part)
            })
        });
        let regression = |by_m| {
            let found = without_any(&self.residuals_db, &self.changes_db(by_m)?, self.level)?;
            Some((by_m, found))
        };
        places.filter_map(regression).min_by(|a, b| a.1.p_value.total_cmp(&b.1.p_value))
    }

    /// The place that leaves least, and the standard error of each coordinate (m) with its degrees of freedom.
    fn refined(&self, start: [f64; 2]) -> Option<([f64; 2], [f64; 2], f64)> {
        let squares = |by_m: [f64; 2]| {
            let left = self.left_db(by_m);
            left.map_or(f64::INFINITY, |left| left.iter().map(|it| square(*it)).sum())
        };
        let search = NelderMead { max_evaluations: 80, tolerance: 1e-6 };
        let step_m = 0.1 * libm::hypot(start[0], start[1]);
        let cost = |by_m: &[f64]| squares([by_m[0], by_m[1]]);
        let found = search.minimise(&cost, start.to_vec(), &[step_m, step_m]).point;
        let by_m = [found[0], found[1]];
        let at = self.left_db(by_m)?;
        let slope = |axis: usize| {
            let mut moved = by_m;
            moved[axis] += STEP_M;
            let moved = self.left_db(moved)?;
            Some(at.iter().zip(moved).map(|(a, b)| (b - a) / STEP_M).collect::<Vec<f64>>())
        };
        let (x, y) = (slope(0)?, slope(1)?);
        let (xx, yy, xy) = (dot(&x, &x), dot(&y, &y), dot(&x, &y));
        let determinant = xx * yy - xy * xy;
        let freedom = at.len() as f64 - 2.0 - self.level.n_numbers();
        let variance = dot(&at, &at) / freedom / determinant;
        let errors = [(variance * yy).sqrt(), (variance * xx).sqrt()];
        (0.0 < freedom && errors.iter().all(|error| error.is_finite()))
            .then_some((by_m, errors, freedom))
    }
}

impl NodeLevel {
    /// Numbers less their level.
    fn taken_from(self, values: &[f64]) -> Vec<f64> {
        let level = match self {
            Self::Free => mean(values.iter().copied()),
            Self::Zero => 0.0,
        };
        values.iter().map(|value| value - level).collect()
    }

    /// How many numbers it is.
    fn n_numbers(self) -> f64 {
        match self {
            Self::Free => 1.0,
            Self::Zero => 0.0,
        }
    }
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// The regression of residuals on changes, beside the level of the node. `None`: too few, or nothing varies.
fn regression(residuals_db: &[f64], changes_db: &[f64], level: NodeLevel) -> Option<Regression> {
    let (y, x) = (level.taken_from(residuals_db), level.taken_from(changes_db));
    let (xx, xy, yy) = (dot(&x, &x), dot(&x, &y), dot(&y, &y));
    let freedom = y.len() as f64 - 1.0 - level.n_numbers();
    let amplitude = xy / xx;
    let share = xy * amplitude / yy;
    let t = amplitude * (xx * freedom / (yy * (1.0 - share))).sqrt();
    let law = StudentsT::new(0.0, 1.0, freedom).ok()?;
    t.is_finite().then(|| Regression { p_value: law.sf(t), amplitude, share })
}

/// The regression without the partner on which it rests most: a link that is very short, or behind a wall, must not decide alone.
fn without_any(residuals_db: &[f64], changes_db: &[f64], level: NodeLevel) -> Option<Regression> {
    let without = |left_out: usize| {
        let rest = |values: &[f64]| [&values[..left_out], &values[left_out + 1..]].concat();
        regression(&rest(residuals_db), &rest(changes_db), level)
    };
    let all: Option<Vec<Regression>> = (0..residuals_db.len()).map(without).collect();
    all?.into_iter().max_by(|a, b| a.p_value.total_cmp(&b.p_value))
}

/// Looks for a node whose place is surely wrong: another explains nearly all that its links differ by.
#[must_use]
pub fn test(evidence: &Evidence<'_>) -> Option<Defect> {
    likeliest(evidence, CATALOGUE_SHARE, NodeLevel::Free)
}

/// The node whose place is likeliest to be wrong, if another explains at least this share of what its links differ by, or beside no level of
/// the node of their squares.
#[must_use]
pub fn likeliest(evidence: &Evidence<'_>, least_share: f64, level: NodeLevel) -> Option<Defect> {
    let still = evidence.modelled().still();
    let mut of_node: BTreeMap<u32, Vec<usize>> = BTreeMap::new();
    for row in evidence.received() {
        let LinkRow { tx, rx, .. } = evidence.rows()[row];
        for node in [tx, rx].into_iter().filter(|node| still.get(node) == Some(&true)) {
            of_node.entry(node).or_default().push(row);
        }
    }
    let n_links = of_node.values().map(Vec::len).sum::<usize>().div_ceil(ROWS_OF_LINK.1);
    let most = (MOST_ROWS / n_links.max(1)).clamp(ROWS_OF_LINK.0, ROWS_OF_LINK.1);
    let nodes: Vec<Node<'_>> = of_node
        .iter()
        .filter_map(|(&node, rows)| Node::new(evidence, (node, level), rows, most))
        .collect();
    let trials = nodes.iter().filter_map(|node| Some((node, node.best_trial()?)));
    let (node, (trial_m, found)) = trials.min_by(|a, b| a.1.1.p_value.total_cmp(&b.1.1.p_value))?;
    tracing::debug!(node = node.node, ?trial_m, ?found, "place");
    if found.share < least_share {
        return None;
    }
    let start = trial_m.map(|part| part * found.amplitude.clamp(0.5, 2.0));
    let (by_m, errors, freedom) = node.refined(start)?;
    let rows = evidence.rows();
    let concerned: Vec<usize> =
        (0..rows.len()).filter(|&row| end_at(&rows[row], node.node).is_some()).collect();
    let mut changed = rows.to_vec();
    concerned.iter().for_each(|&row| changed[row] = displaced(&rows[row], node.node, by_m));
    let other = evidence.alternative(&changed, false)?;
    let share = evidence.share_removed(&other, &|row| end_at(&rows[row], node.node).is_some());
    let first = concerned.first().map(|&row| &rows[row])?;
    let surveyed_m = if end_at(first, node.node) == Some(0) { first.tx_m } else { first.rx_m };
    let reach = StudentsT::new(0.0, 1.0, freedom).ok()?.inverse_cdf(0.95);
    let estimate = |name: &'static str, axis: usize| {
        let (value, half) = (surveyed_m[axis] + by_m[axis], reach * errors[axis]);
        Estimate::new(name, "m", value, (value - half, value + half))
    };
    // Bonferroni: each node was tried at each place.
    let n_tests = (nodes.len() * RINGS.len() * N_DIRECTIONS as usize) as f64;
    Some(Defect {
        name: NAME,
        p_value: (n_tests * found.p_value).min(1.0),
        share,
        estimates: vec![estimate("x_m", 0), estimate("y_m", 1)],
        nodes: vec![node.node],
        runs: Vec::new(),
        n_rows: concerned.len(),
        first_line: concerned.iter().map(|&row| rows[row].line).min()?,
        clause: format!(
            "node {} stands at ({:.2}, {:.2}) m, {:.2} m from its surveyed place",
            node.node,
            surveyed_m[0] + by_m[0],
            surveyed_m[1] + by_m[1],
            libm::hypot(by_m[0], by_m[1])
        ),
        correction: Correction {
            replaced: concerned.iter().map(|&row| (row as u32, changed[row])).collect(),
            ..Correction::default()
        },
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_change_that_explains_the_residuals_is_significant() {
        let changes: Vec<f64> = (0..12).map(|k| libm::sin(f64::from(k))).collect();
        let noise = |k: usize| 0.1 * libm::cos(7.0 * k as f64);
        let residuals: Vec<f64> =
            changes.iter().enumerate().map(|(k, it)| 3.0 + 2.0 * it + noise(k)).collect();
        let found = regression(&residuals, &changes, NodeLevel::Free).unwrap();
        assert!(found.p_value < 1e-9 && (found.amplitude - 2.0).abs() < 0.1, "{found:?}");
        assert!(0.98 < found.share);
        // The opposite change is none.
        let opposite: Vec<f64> = changes.iter().map(|it| -it).collect();
        assert!(0.99 < regression(&residuals, &opposite, NodeLevel::Free).unwrap().p_value);
    }

    #[test]
    fn one_partner_does_not_decide() {
        let noise = |k: i32| 0.5 * libm::cos(7.0 * f64::from(k));
        let residuals: Vec<f64> =
            (0..10).map(|k| noise(k) + if k == 4 { 9.0 } else { 0.0 }).collect();
        let changes: Vec<f64> =
            (0..10).map(|k| if k == 4 { 6.0 } else { 0.1 * noise(k + 20) }).collect();
        assert!(regression(&residuals, &changes, NodeLevel::Free).unwrap().p_value < 1e-6);
        assert!(0.01 < without_any(&residuals, &changes, NodeLevel::Free).unwrap().p_value);
    }

    #[test]
    fn the_test_is_students_of_the_slope() {
        // t = 13.973463 with 3 degrees of freedom.
        let (y, x) = ([1.1, 1.9, 3.2, 3.8, 5.3], [1.0, 2.0, 3.0, 4.0, 5.0]);
        let found = regression(&y, &x, NodeLevel::Free).unwrap();
        assert!((found.amplitude - 1.03).abs() < 1e-12, "{found:?}");
        assert!((found.share - 0.984_868_176_8).abs() < 1e-9, "{found:?}");
        assert!((found.p_value - 0.000_396_806_6).abs() < 1e-9, "{found:?}");
        // Through the origin: Σxy / Σx² = 56.2 / 55.
        let found = regression(&y, &x, NodeLevel::Zero).unwrap();
        assert!((found.amplitude - 56.2 / 55.0).abs() < 1e-12, "{found:?}");
    }
}
