//! A node that turns on the spot before another: passes through all bearings, each of which shows the pattern of its antenna by itself.

use super::ModelledLinks;
use super::covariates::bearing_rad;
use crate::thresholds::{FEWEST_PASS_ROWS, SPOT_M};
use std::collections::BTreeMap;
use std::f64::consts::FRAC_PI_2;

/// Rows in passes of a node through all bearings at which it sees another, both on one spot.
#[derive(Clone, Debug, PartialEq)]
pub struct Passes {
    /// The rows of each pass.
    pub rows: Vec<Vec<u32>>,
    /// Sums of the cosines and of the sines of the bearings at both ends of each row, 0 where a heading is unknown: what the first harmonic of
    /// one pattern at all nodes moves, along its two directions.
    pub harmonic: Vec<[f64; 2]>,
}

impl Passes {
    /// The passes of the end of links, sender or receiver, that makes more of them.
    #[must_use]
    pub fn of(rows: &ModelledLinks) -> Self {
        let bearings: Vec<[Option<f64>; 2]> =
            (0..rows.len()).map(|row| [0, 1].map(|end| bearing_rad(rows, row, end))).collect();
        let harmonic = bearings.iter().map(|ends| {
            ends.iter().flatten().fold([0.0; 2], |sum, bearing_rad| {
                let (sine, cosine) = libm::sincos(*bearing_rad);
                [sum[0] + cosine, sum[1] + sine]
            })
        });
        let [senders, receivers] = [0, 1].map(|end| {
            let bearings: Vec<Option<f64>> = bearings.iter().map(|ends| ends[end]).collect();
            passes_of_end(rows, &bearings)
        });
        let rows = if senders.len() < receivers.len() { receivers } else { senders };
        Self { rows, harmonic: harmonic.collect() }
    }
}

/// A pass that has not come to its end.
#[derive(Default)]
struct Open {
    rows: Vec<u32>,
    /// Which quadrants were seen.
    seen: [bool; 4],
    last: usize,
}

impl Open {
    fn is_through(&self) -> bool {
        self.seen == [true; 4] && FEWEST_PASS_ROWS <= self.rows.len()
    }
}

/// Passes of one end of links.
fn passes_of_end(rows: &ModelledLinks, bearings_rad: &[Option<f64>]) -> Vec<Vec<u32>> {
    let measured = &rows.links.rows;
    let mut order: Vec<usize> = (0..rows.len()).collect();
    order.retain(|&row| bearings_rad[row].is_some() && measured[row].rssi_dbm.is_finite());
    order.sort_by(|&a, &b| {
        let runs = measured[a].run.cmp(&measured[b].run);
        runs.then(measured[a].time_s.total_cmp(&measured[b].time_s)).then(a.cmp(&b))
    });
    passes(order.into_iter().map(|row| {
        let (tx, rx) = rows.ends(row);
        let spots = [tx, rx].map(|end| rows.square_numbers(end.position_m, SPOT_M));
        let key = (measured[row].run, tx.id.0, rx.id.0, spots);
        (row as u32, key, bearings_rad[row].unwrap_or_default())
    }))
}

/// Rows in order of time, with what must be the same throughout a pass and a bearing (rad), in passes. A pass ends when all quadrants of
/// bearings were seen, and the last of them is left.
fn passes<K: Ord>(steps: impl Iterator<Item = (u32, K, f64)>) -> Vec<Vec<u32>> {
    let mut open: BTreeMap<K, Open> = BTreeMap::new();
    let mut passes = Vec::new();
    for (row, key, bearing_rad) in steps {
        let quadrant = (libm::floor(bearing_rad / FRAC_PI_2) as i64).rem_euclid(4) as usize;
        let pass = open.entry(key).or_default();
        if pass.is_through() && quadrant != pass.last {
            passes.push(std::mem::take(&mut pass.rows));
            pass.seen = [false; 4];
        }
        pass.rows.push(row);
        pass.seen[quadrant] = true;
        pass.last = quadrant;
    }
    passes.extend(open.into_values().filter(Open::is_through).map(|pass| pass.rows));
    passes
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    /// Lengths of the passes at these bearings, in turns, all on one spot.
    fn lengths(turns: impl Iterator<Item = f64>) -> Vec<usize> {
        let steps = turns.enumerate().map(|(row, turns)| (row as u32, 0, TAU * turns));
        passes(steps).into_iter().map(|pass| pass.len()).collect()
    }

    #[test]
    fn each_turn_is_a_pass_and_a_part_of_one_is_none() {
        let turning = |n: u32| (0..n).map(|row| (f64::from(row) + 0.5) / 40.0);
        assert_eq!(lengths(turning(160)), [40; 4]);
        assert_eq!(lengths(turning(25)), [0; 0]);
        // Backwards, and with noise of the heading that crosses the edges of quadrants.
        assert_eq!(lengths(turning(160).map(|turns| -turns)), [40; 4]);
        let noisy = |(row, turns): (usize, f64)| turns + if row % 2 == 0 { 0.03 } else { -0.03 };
        assert_eq!(lengths(turning(160).enumerate().map(noisy)).len(), 4);
    }

    #[test]
    fn bearings_in_any_order_are_passed_and_half_of_the_plane_is_not() {
        let mixed = (0..80u32).map(|row| (f64::from(row * 31 % 80) + 0.5) / 80.0);
        assert!(4 <= lengths(mixed).len());
        let half = (0..400u32).map(|row| f64::from(row % 40) / 80.0);
        assert_eq!(lengths(half), [0; 0]);
    }

    #[test]
    fn what_is_passed_on_several_spots_counts_on_each_by_itself() {
        let steps = (0..320u32).map(|row| (row, row / 20 % 2, TAU * (f64::from(row) + 0.5) / 80.0));
        assert!(passes(steps).is_empty());
    }
}
