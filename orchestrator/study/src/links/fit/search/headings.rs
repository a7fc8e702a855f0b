//! Headings of nodes that stand still and tell none: found together with the pattern of their antennas.

use crate::links::likelihood::RowLikelihood;
use crate::links::rows::ModelledLinks;
use crate::links::terms::TermState;
use nalgebra::{DMatrix, DVector};
use numbers::optimise::levenberg_marquardt::{LevenbergMarquardt, Objective, damped};
use std::collections::BTreeMap;
use std::f64::consts::TAU;

/// Directions that are tried first, around the circle.
const DIRECTIONS: u32 = 12;
/// Steps of the search.
const STEPS: usize = 25;
/// What is gained in the last step (nats).
const CONVERGED_NATS: f64 = 1e-3;

/// One end of a row: cosine and sine of where the other one lies, from the own heading where it is known; else which direction
/// is sought.
#[derive(Clone, Copy)]
struct Sight {
    bearing: [f64; 2],
    unknown: Option<usize>,
}

/// A row: its two ends, and what the likelihood says about a change of its level.
struct PatternRow {
    ends: [Option<Sight>; 2],
    slope: f64,
    weight: f64,
    /// What the pattern of the fit adds already (dB).
    known_db: f64,
}

/// The nodes that stand still and tell no heading, in the order of their numbers.
fn nodes_without(rows: &ModelledLinks, train: &[u32]) -> Vec<u32> {
    let still = rows.still();
    let mut known: BTreeMap<u32, bool> = BTreeMap::new();
    for &row in train {
        let (tx, rx) = rows.ends(row as usize);
        for end in [tx, rx] {
            *known.entry(end.id.0).or_insert(false) |= end.heading_rad.is_some();
        }
    }
    let is_sought = |id: &u32, known: bool| !known && still.get(id).copied().unwrap_or(false);
    known.into_iter().filter(|(id, known)| is_sought(id, *known)).map(|(id, _)| id).collect()
}

fn pattern_rows(
    rows: &ModelledLinks,
    train: &[u32],
    likelihoods: &[RowLikelihood],
    nodes: &[u32],
) -> Vec<PatternRow> {
    train
        .iter()
        .zip(likelihoods)
        .map(|(&row, slope)| {
            let (tx, rx) = rows.ends(row as usize);
            let sight = |own: &physics::link::End, other: &physics::link::End| {
                let [dx, dy] = [0, 1].map(|k| other.position_m[k] - own.position_m[k]);
                if dx == 0.0 && dy == 0.0 {
                    return None;
                }
                let bearing_rad = libm::atan2(dy, dx);
                let (unknown, heading_rad) = match own.heading_rad {
                    Some(heading_rad) => (None, heading_rad),
                    None => (Some(nodes.binary_search(&own.id.0).ok()?), 0.0),
                };
                Some(Sight { bearing: unit(bearing_rad - heading_rad), unknown })
            };
            PatternRow {
                ends: [sight(tx, rx), sight(rx, tx)],
                slope: slope.over_level,
                weight: slope.weight,
                known_db: 0.0,
            }
        })
        .collect()
}

/// Parameters: the difference between front and back (dB), then where the front is (rad): of the body, of each node.
type Params = DVector<f64>;

/// Cosine and sine.
fn unit(angle_rad: f64) -> [f64; 2] {
    let (sin, cos) = libm::sincos(angle_rad);
    [cos, sin]
}

/// A pattern: how much weaker its back is (dB), and where the front is, of the body and of each node.
struct CardioidPattern {
    front_to_back_db: f64,
    fronts: Vec<[f64; 2]>,
}

impl CardioidPattern {
    fn from_angles(params: &Params) -> Self {
        let fronts = params.iter().skip(1).map(|&angle_rad| unit(angle_rad)).collect();
        Self { front_to_back_db: params[0], fronts }
    }

    /// Where among the parameters the front of an end stands, and cosine and sine of the other end as seen from there.
    fn seen_from_front(&self, sight: &Sight) -> (usize, [f64; 2]) {
        let place = sight.unknown.map_or(0, |node| 1 + node);
        let ([cos, sin], [front_cos, front_sin]) = (sight.bearing, self.fronts[place]);
        (1 + place, [cos * front_cos + sin * front_sin, sin * front_cos - cos * front_sin])
    }

    /// What it adds to a row (dB).
    fn added(&self, row: &PatternRow) -> f64 {
        let ends = row.ends.iter().flatten();
        ends.map(|sight| -0.5 * self.front_to_back_db * (1.0 - self.seen_from_front(sight).1[0]))
            .sum()
    }
}

/// What the likelihood gains (nats, a parabola about the fit).
fn gain(all: &[PatternRow], params: &Params) -> f64 {
    let pattern = CardioidPattern::from_angles(params);
    all.iter()
        .map(|row| {
            let more = pattern.added(row) - row.known_db;
            more * (row.slope - 0.5 * row.weight * more)
        })
        .sum()
}

/// Information and gradient.
fn derivatives(all: &[PatternRow], params: &Params) -> (DMatrix<f64>, Params) {
    let n = params.len();
    let pattern = CardioidPattern::from_angles(params);
    let mut information = DMatrix::zeros(n, n);
    let mut gradient = DVector::zeros(n);
    for row in all {
        let mut entries = [(0, 0.0); 4];
        let mut added = 0.0;
        for (k, sight) in row.ends.iter().flatten().enumerate() {
            let (index, [cos, sin]) = pattern.seen_from_front(sight);
            let shape = -0.5 * (1.0 - cos);
            added += params[0] * shape;
            entries[2 * k] = (0, shape);
            entries[2 * k + 1] = (index, 0.5 * params[0] * sin);
        }
        let slope = row.slope - row.weight * (added - row.known_db);
        for &(i, a) in &entries {
            gradient[i] += a * slope;
            for &(j, b) in &entries {
                information[(i, j)] += row.weight * a * b;
            }
        }
    }
    (information, gradient)
}

/// The gain of a pattern as a function of its parameters.
struct Gain<'a>(&'a [PatternRow]);

impl Objective for Gain<'_> {
    type Point = (f64, Params);
    type Equations = (DMatrix<f64>, Params);
    type Step = Params;

    fn value(&self, (gain, _): &Self::Point) -> f64 {
        *gain
    }

    fn equations(&mut self, (_, params): &Self::Point) -> Option<Self::Equations> {
        Some(derivatives(self.0, params))
    }

    fn step(
        &mut self,
        _: &Self::Point,
        (information, gradient): &Self::Equations,
        damping: f64,
    ) -> Option<Params> {
        damped(information, damping, 1e-6).cholesky().map(|factor| factor.solve(gradient))
    }

    fn advance(
        &mut self,
        (before, params): &Self::Point,
        step: &Params,
    ) -> Result<Self::Point, f64> {
        let mut next = params + step;
        next[0] = next[0].clamp(0.0, 40.0);
        let now = gain(self.0, &next);
        if *before < now { Ok((now, next)) } else { Err(f64::NEG_INFINITY) }
    }
}

/// Gain and parameters at the optimum near a start.
fn optimum(all: &[PatternRow], start: Params) -> (f64, Params) {
    let search = LevenbergMarquardt {
        damping: 1e-2,
        decrease: 0.3,
        max_trials: STEPS,
        max_evaluations: STEPS,
        min_gain: CONVERGED_NATS,
        ..LevenbergMarquardt::default()
    };
    search.maximise(&mut Gain(all), (gain(all, &start), start)).point
}

/// States of a cardioid pattern, with headings for the nodes that tell none: from each of `starts` the best.
#[must_use]
pub fn patterns(
    rows: &ModelledLinks,
    train: &[u32],
    likelihoods: &[RowLikelihood],
    starts: &[TermState],
) -> Vec<TermState> {
    let nodes = nodes_without(rows, train);
    // Without unknown headings the pattern is an ordinary term, which the fit itself maximises.
    if nodes.is_empty() {
        return starts.to_vec();
    }
    let all = pattern_rows(rows, train, likelihoods, &nodes);
    let found = starts.iter().map(|start| {
        let mut params = DVector::zeros(2 + nodes.len());
        params[0] = start.values[0];
        params[1] = start.values[1];
        // Each node by itself first.
        for node in 0..nodes.len() {
            let own: Vec<PatternRow> = all
                .iter()
                .filter_map(|row| {
                    let mut ends = row.ends;
                    for end in &mut ends {
                        *end = end.filter(|sight| sight.unknown == Some(node));
                    }
                    ends.iter().any(Option::is_some).then_some(PatternRow { ends, ..*row })
                })
                .collect();
            let trials = (0..DIRECTIONS).map(|k| {
                let mut trial = params.clone();
                trial[2 + node] = TAU * f64::from(k) / f64::from(DIRECTIONS);
                (gain(&own, &trial), trial[2 + node])
            });
            let best = trials.max_by(|a, b| a.0.total_cmp(&b.0)).map_or(0.0, |(_, angle)| angle);
            params[2 + node] = best;
        }
        optimum(&all, params)
    });
    let best = found.max_by(|a, b| a.0.total_cmp(&b.0));
    best.map_or_else(|| starts.to_vec(), |(_, params)| vec![state_of(&params, &nodes, &starts[0])])
}

/// The antenna pattern of a fit, and the derivatives of the likelihood of its rows.
struct FittedPattern {
    nodes: Vec<u32>,
    params: Params,
    all: Vec<PatternRow>,
}

fn fitted_pattern(
    rows: &ModelledLinks,
    train: &[u32],
    likelihoods: &[RowLikelihood],
    state: &TermState,
) -> FittedPattern {
    let nodes = nodes_without(rows, train);
    let headings = state.table.get("headings_rad").and_then(toml::Value::as_array);
    let heading = |node: &u32| headings?.get(*node as usize)?.as_float();
    let mut params = DVector::zeros(2 + nodes.len());
    params[0] = state.values[0];
    params[1] = state.values[1];
    for (index, node) in nodes.iter().enumerate() {
        params[2 + index] = heading(node).unwrap_or_default() + state.values[1];
    }
    let mut all = pattern_rows(rows, train, likelihoods, &nodes);
    let pattern = CardioidPattern::from_angles(&params);
    for row in &mut all {
        row.known_db = pattern.added(row);
    }
    FittedPattern { nodes, params, all }
}

/// Standard errors of the difference between front and back (dB) and of the boresight (rad), headings unknown. `likelihoods`: slopes
/// under the fit with the pattern. None where they are not determined.
#[must_use]
pub fn errors(
    rows: &ModelledLinks,
    train: &[u32],
    likelihoods: &[RowLikelihood],
    state: &TermState,
) -> Option<[f64; 2]> {
    let FittedPattern { params, all, .. } = fitted_pattern(rows, train, likelihoods, state);
    let (information, _) = derivatives(&all, &params);
    let inverse = information.try_inverse()?;
    let error = |k: usize| inverse[(k, k)].max(0.0).sqrt();
    Some([error(0), error(1)])
}

/// Refines a pattern by the likelihood about the fit that includes it: the first search approximated the one without.
#[must_use]
pub fn refine(
    rows: &ModelledLinks,
    train: &[u32],
    likelihoods: &[RowLikelihood],
    state: &TermState,
) -> TermState {
    let FittedPattern { nodes, params, all } = fitted_pattern(rows, train, likelihoods, state);
    let (_, params) = optimum(&all, params);
    state_of(&params, &nodes, state)
}

/// The state of a pattern and headings.
fn state_of(params: &Params, nodes: &[u32], start: &TermState) -> TermState {
    let wrapped = |angle: f64| angle - TAU * (angle / TAU).round();
    let boresight = wrapped(params[1]);
    let mut headings = vec![0.0; nodes.last().map_or(0, |&last| last as usize + 1)];
    for (index, &node) in nodes.iter().enumerate() {
        headings[node as usize] = wrapped(params[2 + index] - boresight);
    }
    let mut state = start.clone();
    let headings = headings.into_iter().map(toml::Value::Float).collect();
    state.table.insert("headings_rad".to_owned(), toml::Value::Array(headings));
    state.values = vec![params[0].max(0.1), boresight];
    state
}
