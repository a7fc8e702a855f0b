//! How well the place of a hidden obstacle is known: the places that the likelihood allows, drawn by a random walk.
//!
//! The likelihood is a staircase in the coordinates: it changes where an edge passes another way. A profile stops at the first
//! step that is high; a walk goes on to what lies behind it.

use super::LinkPath;
use super::ObstacleShape;
use super::ways;
use crate::links::likelihood::RowLikelihood;
use crate::links::rows::ModelledLinks;
use crate::links::terms::TermState;
use numbers::optimise::metropolis::{Metropolis, Proposal};
use numbers::statistics::quantile_nearest;
use proto::rng::{Draws, Purpose, normal, uniform};

/// Steps of the walk, and how many looks at a way it may take in all.
const STEPS: (usize, usize) = (1_000, 20_000);
const MOST_LOOKS: usize = 100_000_000;
/// The first steps are forgotten: one in so many.
const FORGOTTEN: usize = 8;
/// Least and greatest size of a move (m), and of a change of the loss (dB).
const MOVES_M: (f64, f64) = (0.02, 6.0);
const CHANGES_DB: (f64, f64) = (0.02, 2.0);
/// No obstacle is larger (m), none attenuates more (dB).
const WIDEST_M: f64 = 50.0;
const MOST_DB: f64 = 60.0;

/// A number of an obstacle with its interval (m; of the loss dB).
#[derive(Clone, Debug, PartialEq)]
pub struct Coordinate {
    /// `from_x_m`, `centre_y_m`, `radius_m`, …, `loss_db`.
    pub name: &'static str,
    /// The estimate, in the unit of the parameter.
    pub value: f64,
    /// Lower end of its interval.
    pub low: f64,
    /// Upper end of its interval.
    pub high: f64,
}

/// The place of an obstacle in a state.
fn shape_of(state: &TermState) -> Option<ObstacleShape> {
    let list = |key: &str| -> Option<[f64; 2]> {
        let list = state.table.get(key)?.as_array()?;
        Some([list.first()?.as_float()?, list.get(1)?.as_float()?])
    };
    if let (Some(a), Some(b)) = (list("from_m"), list("to_m")) {
        return Some(ObstacleShape::Segment(a, b));
    }
    Some(ObstacleShape::Disc(list("centre_m")?, state.table.get("radius_m")?.as_float()?))
}

/// An obstacle that was fitted, and the ways with what the rows on them still ask for.
struct FittedObstacle {
    ways: Vec<LinkPath>,
    /// Of each way, what the fitted obstacle takes (dB).
    taken_db: Vec<f64>,
    shape: ObstacleShape,
    /// Least and greatest coordinates (m) between which ways lie, and what was fitted: beyond them an end cannot be located.
    bounds_m: [[f64; 2]; 2],
}

impl FittedObstacle {
    fn new(ways: Vec<LinkPath>, shape: ObstacleShape, loss_db: f64) -> Self {
        let taken = |way: &LinkPath| if shape.is_crossed(way) { loss_db } else { 0.0 };
        let places = ways.iter().flat_map(|way| [way.from_m, way.to_m]);
        let places = places.chain(shape.places());
        let mut bounds_m = [[f64::INFINITY; 2], [f64::NEG_INFINITY; 2]];
        for place in places {
            for axis in 0..2 {
                bounds_m[0][axis] = bounds_m[0][axis].min(place[axis]);
                bounds_m[1][axis] = bounds_m[1][axis].max(place[axis]);
            }
        }
        Self { taken_db: ways.iter().map(taken).collect(), ways, shape, bounds_m }
    }

    /// What the likelihood loses (nats) with the obstacle at these numbers, the loss (dB) the last: a parabola about the fit.
    fn lost_nats(&self, numbers: &[f64]) -> f64 {
        let (loss_db, place) =
            numbers.split_last().map_or((0.0, numbers), |(l, place)| (*l, place));
        let shape = self.shape.with_numbers(place);
        let lost = self.ways.iter().zip(&self.taken_db).map(|(way, taken_db)| {
            let takes_db = if shape.is_crossed(way) { loss_db } else { 0.0 };
            let change = taken_db - takes_db;
            change * (0.5 * change * way.weight - way.slope)
        });
        lost.sum()
    }

    /// A sample of the numbers under the likelihood, from a start.
    fn sample(&self, start: Vec<f64>) -> Vec<Vec<f64>> {
        let draws = Draws::new(4, Purpose::Resample);
        let n_steps = (MOST_LOOKS / self.ways.len().max(1)).clamp(STEPS.0, STEPS.1);
        let propose = |step: usize, current: &Vec<f64>| {
            let [what, size, one, other] = draws.words(0, step as u64, 0);
            let [accept, turn, ..] = draws.words(0, step as u64, 1);
            let size = (uniform(size), uniform(turn));
            let state = self.proposed(current, what, size, normal(one, other));
            self.is_possible(&state).then_some(Proposal { state, uniform: uniform(accept) })
        };
        let walk = Metropolis { n_steps, burn_in: n_steps / FORGOTTEN };
        walk.sample(start, |numbers| -self.lost_nats(numbers), propose)
    }

    /// A symmetric proposal, as likely as its reverse. It moves one number; a segment or one end of it, along, across or about an
    /// end; or a disc of which one edge stays. `turn`: a number in 0 to 1.
    fn proposed(&self, current: &[f64], what: u64, (size, turn): (f64, f64), by: f64) -> Vec<f64> {
        let scaled = |(least, most): (f64, f64)| by * least * libm::pow(most / least, size);
        let mut proposed = current.to_vec();
        let loss = current.len() - 1;
        let own_moves = match self.shape {
            ObstacleShape::Segment(..) => 6,
            ObstacleShape::Disc(..) => 2,
        };
        let k = (what % (current.len() as u64 + own_moves)) as usize;
        if k == loss {
            proposed[k] += scaled(CHANGES_DB);
            return proposed;
        }
        let by_m = scaled(MOVES_M);
        if k < loss {
            proposed[k] += by_m;
            return proposed;
        }
        if let ObstacleShape::Disc(..) = self.shape {
            let (sin, cos) = libm::sincos(std::f64::consts::TAU * turn);
            proposed[0] += by_m * cos;
            proposed[1] += by_m * sin;
            proposed[2] += by_m;
            return proposed;
        }
        let (east, north) = (current[2] - current[0], current[3] - current[1]);
        let length_m = libm::hypot(east, north);
        let (east, north) = (east / length_m, north / length_m);
        let mut add = |end: usize, east_m: f64, north_m: f64| {
            proposed[2 * end] += east_m;
            proposed[2 * end + 1] += north_m;
        };
        match k - current.len() {
            // One end along the segment; both, and both across it.
            end @ (0 | 1) => add(end, by_m * east, by_m * north),
            2 => (0..2).for_each(|end| add(end, by_m * east, by_m * north)),
            3 => (0..2).for_each(|end| add(end, -by_m * north, by_m * east)),
            // One end about the other, by an arc so long.
            about => {
                let (sin, cos) = libm::sincos(by_m / length_m);
                let end = about % 2;
                let sign = if end == 0 { -1.0 } else { 1.0 };
                let turned = [east * cos - north * sin - east, east * sin + north * cos - north];
                add(end, sign * length_m * turned[0], sign * length_m * turned[1]);
            }
        }
        proposed
    }

    fn is_possible(&self, numbers: &[f64]) -> bool {
        let Some((loss_db, place)) = numbers.split_last() else { return false };
        let size_m = match self.shape {
            ObstacleShape::Segment(..) => libm::hypot(place[2] - place[0], place[3] - place[1]),
            ObstacleShape::Disc(..) => place[2],
        };
        let [least, most] = self.bounds_m;
        let is_within =
            |at: [f64; 2]| (0..2).all(|axis| least[axis] <= at[axis] && at[axis] <= most[axis]);
        0.0 < *loss_db
            && *loss_db < MOST_DB
            && 0.1 < size_m
            && size_m < 2.0 * WIDEST_M
            && self.shape.with_numbers(place).places().all(is_within)
    }
}

/// The coordinates of a hidden obstacle and its loss, each with the interval in which `1 − 2 * tail` of what the likelihood allows
/// lies. `likelihoods`: slopes under the fit with it.
#[must_use]
pub fn coordinates(
    rows: &ModelledLinks,
    train: &[u32],
    likelihoods: &[RowLikelihood],
    state: &TermState,
    tail: f64,
) -> Vec<Coordinate> {
    let (Some(shape), Some(&loss_db)) = (shape_of(state), state.values.first()) else {
        return Vec::new();
    };
    let names: &[&'static str] = match shape {
        ObstacleShape::Segment(..) => &["from_x_m", "from_y_m", "to_x_m", "to_y_m", "loss_db"],
        ObstacleShape::Disc(..) => &["centre_x_m", "centre_y_m", "radius_m", "loss_db"],
    };
    let found: Vec<f64> = shape.numbers().into_iter().chain([loss_db]).collect();
    let drawn =
        FittedObstacle::new(ways(rows, train, likelihoods), shape, loss_db).sample(found.clone());
    names
        .iter()
        .zip(found)
        .enumerate()
        .map(|(k, (name, value))| {
            let mut values: Vec<f64> = drawn.iter().map(|numbers| numbers[k]).collect();
            values.sort_by(f64::total_cmp);
            let [low, high] = [tail, 1.0 - tail].map(|share| quantile_nearest(&values, share));
            // The likeliest place need not lie within the central part of a sample.
            Coordinate { name, value, low: low.min(value), high: high.max(value) }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Ways along y, a metre apart, longer than any segment; the segment along x cuts those at 4 to 7.
    fn walk(weight: f64) -> FittedObstacle {
        let way = |x: f64| LinkPath { from_m: [x, -200.0], to_m: [x, 200.0], slope: 0.0, weight };
        let ways = (0..11).map(|x| way(f64::from(x))).collect();
        FittedObstacle::new(ways, ObstacleShape::Segment([3.5, 0.0], [7.5, 0.0]), 4.0)
    }

    #[test]
    fn an_edge_lies_between_the_ways_that_it_parts() {
        let walk = walk(10.0);
        let moved = |to: f64| walk.lost_nats(&[3.5, 0.0, to, 0.0, 4.0]);
        assert_eq!(moved(7.9), 0.0);
        assert_eq!(moved(8.1), 80.0, "one way more: half of 16 dB² times 10");
        assert_eq!(moved(6.9), 80.0, "one less");
        assert_eq!(walk.lost_nats(&[3.5, 0.0, 7.5, 0.0, 3.0]), 20.0, "four ways, a decibel each");
    }

    #[test]
    fn a_segment_keeps_its_length_as_it_is_moved_or_turned_and_its_line_as_it_grows() {
        let walk = walk(10.0);
        let current = [1.0, 2.0, 4.0, 6.0, 3.0];
        let extent_m = |numbers: &[f64]| (numbers[2] - numbers[0], numbers[3] - numbers[1]);
        for what in 5..11 {
            let proposed = walk.proposed(&current, what, (0.9, 0.3), 1.3);
            let (east_m, north_m) = extent_m(&proposed);
            let is_grown = what < 7;
            assert_eq!((libm::hypot(east_m, north_m) - 5.0).abs() < 1e-12, !is_grown, "{what}");
            let across_m = 4.0 * east_m - 3.0 * north_m;
            assert_eq!(across_m.abs() < 1e-12, what < 9, "{what}: {proposed:?}");
            assert_ne!(proposed, current, "{what}");
        }
    }

    #[test]
    fn what_the_likelihood_allows_is_drawn_evenly() {
        let drawn = walk(10.0).sample(vec![3.5, 0.0, 7.5, 0.0, 4.0]);
        let ends: Vec<f64> = drawn.iter().map(|numbers| numbers[2]).collect();
        let mean = ends.iter().sum::<f64>() / ends.len() as f64;
        // Anywhere between the ways at 7 and 8, not beyond.
        assert!(ends.iter().all(|x| (6.99..8.01).contains(x)));
        assert!((mean - 7.5).abs() < 0.1, "{mean}");
        // A normal law of 1/sqrt(4 * 10) dB.
        let losses = drawn.iter().map(|numbers| numbers[4] - 4.0);
        let sd_db = (losses.map(|db| db * db).sum::<f64>() / drawn.len() as f64).sqrt();
        assert!((0.12..0.20).contains(&sd_db), "{sd_db}");
    }
}
