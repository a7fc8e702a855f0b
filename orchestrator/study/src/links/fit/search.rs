//! Places, nodes and times that an effect needs and that no map shows: found from the residuals of the likelihood.
//!
//! A term with a contribution c(row) of small size raises the log likelihood by about S²/2I, S the sum of c times the
//! slope over the level, I that of c² times the weight (the score test). So thousands of places are compared at the price
//! of one pass each; the best are then fitted in full.

pub mod headings;
pub mod places;
pub mod windows;

use super::LinkFit;
use crate::links::likelihood::RowLikelihood;
use crate::links::random_effects::RowCells;
use crate::links::rows::ModelledLinks;
use crate::links::terms::{TermSpec, TermState};
use numbers::optimise::pattern_search::PatternSearch;
use std::collections::BTreeMap;

/// Distance between the points of the first search (m), at the least.
const GRID_M: f64 = 6.0;
/// Most points of the grid along a side.
const MOST_POINTS: usize = 12;
/// An obstacle of radius (m) in the first search.
const RADII_M: [f64; 3] = [1.0, 2.5, 5.0];
/// The places are refined to this (m).
const FINEST_M: f64 = 0.05;
/// How many places are fitted in full.
const FINALISTS: usize = 3;
/// Losses that are tried (dB).
const LOSSES_DB: [f64; 4] = [2.0, 4.0, 8.0, 14.0];

/// The log likelihood of each training row under a fit, with its derivatives by the row's level (per dB), in the order of `train`.
#[must_use]
pub fn row_likelihoods(
    rows: &ModelledLinks,
    fit: &LinkFit,
    specs: &[&TermSpec],
    cells: &RowCells,
    train: &[u32],
) -> Vec<RowLikelihood> {
    let otherwise = fit.otherwise(rows);
    train
        .iter()
        .map(|&row| {
            let level = fit.level((rows, specs), row as usize, &otherwise);
            let blup_db = fit.random.level_db(cells, row as usize);
            fit.instrument.row_likelihood(&rows.links.rows[row as usize], &level, blup_db)
        })
        .collect()
}

/// A path between two places in the plane, with the derivatives of the rows on it, summed.
#[derive(Clone, Copy, Debug)]
struct LinkPath {
    from_m: [f64; 2],
    to_m: [f64; 2],
    slope: f64,
    weight: f64,
}

/// Paths of the training rows, those between the same two places summed.
fn ways(rows: &ModelledLinks, train: &[u32], likelihoods: &[RowLikelihood]) -> Vec<LinkPath> {
    let mut ways: BTreeMap<[u64; 4], LinkPath> = BTreeMap::new();
    for (&row, slope) in train.iter().zip(likelihoods) {
        let (tx, rx) = rows.ends(row as usize);
        let (mut a, mut b) =
            ([tx.position_m[0], tx.position_m[1]], [rx.position_m[0], rx.position_m[1]]);
        if (b[0], b[1]) < (a[0], a[1]) {
            std::mem::swap(&mut a, &mut b);
        }
        let key = [a[0], a[1], b[0], b[1]].map(f64::to_bits);
        let way =
            ways.entry(key).or_insert(LinkPath { from_m: a, to_m: b, slope: 0.0, weight: 0.0 });
        way.slope += slope.over_level;
        way.weight += slope.weight;
    }
    ways.into_values().collect()
}

/// A candidate obstacle in the plane: a wall or a disc (m).
#[derive(Clone, Copy, Debug, PartialEq)]
enum ObstacleShape {
    Segment([f64; 2], [f64; 2]),
    Disc([f64; 2], f64),
}

impl ObstacleShape {
    fn is_crossed(&self, way: &LinkPath) -> bool {
        match *self {
            Self::Segment(a, b) => crosses(way.from_m, way.to_m, a, b),
            Self::Disc(centre, radius_m) => {
                square_of_distance(centre, way.from_m, way.to_m) <= radius_m * radius_m
            }
        }
    }

    fn numbers(&self) -> Vec<f64> {
        match *self {
            Self::Segment(a, b) => vec![a[0], a[1], b[0], b[1]],
            Self::Disc(centre, radius_m) => vec![centre[0], centre[1], radius_m],
        }
    }

    /// Where it is: both ends, or the centre.
    fn places(&self) -> impl Iterator<Item = [f64; 2]> {
        let (first, last) = match *self {
            Self::Segment(a, b) => (a, Some(b)),
            Self::Disc(centre, _) => (centre, None),
        };
        [first].into_iter().chain(last)
    }

    fn with_numbers(&self, numbers: &[f64]) -> Self {
        match *self {
            Self::Segment(..) => Self::Segment([numbers[0], numbers[1]], [numbers[2], numbers[3]]),
            Self::Disc(..) => Self::Disc([numbers[0], numbers[1]], numbers[2].abs().max(0.1)),
        }
    }
}

/// Twice the area of a triangle, with its sign.
fn area(a: [f64; 2], b: [f64; 2], c: [f64; 2]) -> f64 {
    (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
}

fn crosses(a: [f64; 2], b: [f64; 2], c: [f64; 2], d: [f64; 2]) -> bool {
    (area(a, b, c) > 0.0) != (area(a, b, d) > 0.0) && (area(c, d, a) > 0.0) != (area(c, d, b) > 0.0)
}

/// Of a point from the straight way between two others (m²).
fn square_of_distance(point: [f64; 2], a: [f64; 2], b: [f64; 2]) -> f64 {
    let along = [b[0] - a[0], b[1] - a[1]];
    let length2 = along[0] * along[0] + along[1] * along[1];
    let part = if 0.0 < length2 {
        (((point[0] - a[0]) * along[0] + (point[1] - a[1]) * along[1]) / length2).clamp(0.0, 1.0)
    } else {
        0.0
    };
    let off = [point[0] - a[0] - part * along[0], point[1] - a[1] - part * along[1]];
    off[0] * off[0] + off[1] * off[1]
}

/// What a shape gains at its best loss (nats, by the score test), and that loss (dB). `mean` is the slope and weight that
/// all rows share: an obstacle must explain more than a constant would.
fn score_gain(shape: &ObstacleShape, ways: &[LinkPath]) -> (f64, f64) {
    let (mut slope, mut weight) = (0.0, 0.0);
    for way in ways.iter().filter(|way| shape.is_crossed(way)) {
        slope += way.slope;
        weight += way.weight;
    }
    // An obstacle can only attenuate.
    if weight <= 0.0 || 0.0 <= slope {
        return (0.0, 0.0);
    }
    // The gain is a parabola in the loss; only losses are allowed.
    (0.5 * slope * slope / weight, -slope / weight)
}

/// Obstacles that are tried first: on a grid between the ends of ways.
fn shapes_of(places: impl Iterator<Item = [f64; 2]>) -> Vec<ObstacleShape> {
    let mut low = [f64::INFINITY; 2];
    let mut high = [f64::NEG_INFINITY; 2];
    for place in places {
        for k in 0..2 {
            low[k] = low[k].min(place[k]);
            high[k] = high[k].max(place[k]);
        }
    }
    let side = |k: usize| {
        let n = (((high[k] - low[k]) / GRID_M).ceil() as usize + 1).clamp(2, MOST_POINTS);
        let step = (high[k] - low[k]) / (n - 1) as f64;
        (0..n).map(move |i| low[k] + i as f64 * step)
    };
    let points: Vec<[f64; 2]> = side(0).flat_map(|x| side(1).map(move |y| [x, y])).collect();
    let mut shapes: Vec<ObstacleShape> = Vec::new();
    for (i, &a) in points.iter().enumerate() {
        shapes.extend(RADII_M.iter().map(|&radius_m| ObstacleShape::Disc(a, radius_m)));
        shapes.extend(points[..i].iter().map(|&b| ObstacleShape::Segment(a, b)));
    }
    shapes
}

/// States of a hidden obstacle at the places that explain most.
#[must_use]
pub fn obstacles(
    rows: &ModelledLinks,
    train: &[u32],
    likelihoods: &[RowLikelihood],
    start: &TermState,
) -> Vec<TermState> {
    let ways = ways(rows, train, likelihoods);
    let places = ways.iter().flat_map(|way| [way.from_m, way.to_m]);
    let shapes = shapes_of(places).into_iter();
    let mut ranked: Vec<(f64, ObstacleShape)> =
        shapes.map(|shape| (score_gain(&shape, &ways).0, shape)).collect();
    ranked.sort_by(|a, b| b.0.total_cmp(&a.0));
    // The best of each kind, and others that are not the same place again.
    let mut finalists: Vec<(f64, ObstacleShape)> = Vec::new();
    for kind in [true, false] {
        let of_kind =
            ranked.iter().filter(|(_, shape)| matches!(shape, ObstacleShape::Segment(..)) == kind);
        let refined: Vec<(f64, ObstacleShape)> =
            of_kind.take(8).map(|&(_, shape)| refined(shape, &ways)).collect();
        finalists.extend(refined);
    }
    finalists.sort_by(|a, b| b.0.total_cmp(&a.0));
    let mut states = Vec::new();
    for &(_, shape) in &finalists {
        let (gain, loss_db) = score_gain(&shape, &ways);
        if gain <= 0.0 || FINALISTS <= states.len() {
            break;
        }
        let mut state = start.clone();
        let list = |numbers: &[f64]| {
            toml::Value::Array(numbers.iter().map(|&number| toml::Value::Float(number)).collect())
        };
        match shape {
            ObstacleShape::Segment(a, b) => {
                state.table.insert("from_m".to_owned(), list(&a));
                state.table.insert("to_m".to_owned(), list(&b));
            }
            ObstacleShape::Disc(centre, radius_m) => {
                state.table.insert("centre_m".to_owned(), list(&centre));
                state.table.insert("radius_m".to_owned(), toml::Value::Float(radius_m));
            }
        }
        // The parabola underestimates losses of frames that never arrive: larger ones are tried as well.
        let nearest = LOSSES_DB.iter().copied().find(|&other| loss_db < other);
        state.values = vec![nearest.unwrap_or(loss_db).max(0.5)];
        if !states.contains(&state) {
            states.push(state);
        }
    }
    if states.is_empty() {
        let mut state = start.clone();
        let far = toml::Value::Array(vec![toml::Value::Float(1e6); 2]);
        state.table.insert("centre_m".to_owned(), far);
        state.table.insert("radius_m".to_owned(), toml::Value::Float(0.1));
        states.push(state);
    }
    states
}

/// The best shape near one: the gain is a staircase, which has no slope to follow.
fn refined(shape: ObstacleShape, ways: &[LinkPath]) -> (f64, ObstacleShape) {
    let poll = |shape: &ObstacleShape, step_m: f64| {
        let numbers = shape.numbers();
        let moved = |moves: &[(usize, f64)]| {
            let mut numbers = numbers.clone();
            for &(k, by_m) in moves {
                numbers[k] += by_m;
            }
            shape.with_numbers(&numbers)
        };
        let signed = |k: usize| [(k, -step_m), (k, step_m)];
        let mut trials: Vec<ObstacleShape> =
            (0..numbers.len()).flat_map(signed).map(|one| moved(&[one])).collect();
        if let ObstacleShape::Segment(..) = shape {
            let whole = [(0, step_m), (0, -step_m), (1, step_m), (1, -step_m)];
            trials.extend(whole.map(|(axis, by_m)| moved(&[(axis, by_m), (axis + 2, by_m)])));
        }
        trials
    };
    let search =
        PatternSearch { step: GRID_M / 2.0, min_step: FINEST_M, ..PatternSearch::default() };
    let found = search.maximise(shape, poll, |shape| score_gain(shape, ways).0);
    (found.value, found.point)
}

/// States of batteries that sag: all transmitters alike, or those that do so beyond doubt.
#[must_use]
pub fn sagging(
    rows: &ModelledLinks,
    train: &[u32],
    likelihoods: &[RowLikelihood],
    start: &TermState,
) -> Vec<TermState> {
    // Slope of each transmitter over time, by the score test, its mean level taken out.
    let mut sums: BTreeMap<u32, [f64; 5]> = BTreeMap::new();
    for (&row, slope) in train.iter().zip(likelihoods) {
        let measured = &rows.links.rows[row as usize];
        let hours = measured.time_s / 3600.0;
        if hours.is_finite() {
            let sum = sums.entry(measured.tx).or_default();
            sum[0] += slope.weight;
            sum[1] += slope.weight * hours;
            sum[2] += slope.weight * hours * hours;
            sum[3] += slope.over_level;
            sum[4] += slope.over_level * hours;
        }
    }
    let mut slopes: Vec<(u32, f64, f64)> = Vec::new();
    for (&node, &[w, wt, wtt, g, gt]) in &sums {
        let (spread, pull) = (wtt - wt * wt / w, gt - g * wt / w);
        if 0.0 < spread {
            slopes.push((node, pull / spread, spread));
        }
    }
    // Falling transmitters in the order of their evidence: the set at which the evidence is greatest.
    slopes.sort_by(|a, b| (a.1 * a.2.sqrt()).total_cmp(&(b.1 * b.2.sqrt())));
    let (mut pull, mut spread, mut best) = (0.0, 0.0, (0.0, 0, -0.5));
    for (n, &(_, slope, weight)) in slopes.iter().enumerate() {
        pull += slope * weight;
        spread += weight;
        let gain = 0.5 * pull * pull / spread;
        if pull < 0.0 && best.0 < gain {
            best = (gain, n + 1, pull / spread);
        }
    }
    let all = TermState { values: vec![best.2], ..start.clone() };
    let mut some = all.clone();
    let mut nodes: Vec<u32> = slopes[..best.1].iter().map(|(node, ..)| *node).collect();
    nodes.sort_unstable();
    if nodes.is_empty() || nodes.len() == slopes.len() {
        return vec![all];
    }
    let nodes = nodes.into_iter().map(|node| toml::Value::Integer(i64::from(node))).collect();
    some.table.insert("nodes".to_owned(), toml::Value::Array(nodes));
    vec![some, all]
}
