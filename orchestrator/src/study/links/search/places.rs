//! How well the place of a hidden obstacle is known: how far it can be moved before the likelihood falls beyond chance.

use super::{Shape, Way, ways};
use crate::study::links::likelihood::Slope;
use crate::study::links::rows::Rows;
use crate::study::links::terms::State;

/// First and greatest move of a coordinate (m), and to what the others are fitted again.
const STEP_M: f64 = 0.1;
const FARTHEST_M: f64 = 30.0;
const FIRST_M: f64 = 1.0;
/// An end of an interval is halved so often.
const HALVES: usize = 4;

/// A coordinate of a place with its interval (m).
#[derive(Clone, Debug, PartialEq)]
pub struct Coordinate {
    /// `from_x_m`, `centre_y_m`, `radius_m`, …
    pub name: &'static str,
    /// Where it was found.
    pub value_m: f64,
    /// Lower end.
    pub low_m: f64,
    /// Upper end.
    pub high_m: f64,
}

/// The place of an obstacle in a state.
fn shape_of(state: &State) -> Option<Shape> {
    let list = |key: &str| -> Option<[f64; 2]> {
        let list = state.table.get(key)?.as_array()?;
        Some([list.first()?.as_float()?, list.get(1)?.as_float()?])
    };
    if let (Some(a), Some(b)) = (list("from_m"), list("to_m")) {
        return Some(Shape::Segment(a, b));
    }
    Some(Shape::Disc(list("centre_m")?, state.table.get("radius_m")?.as_float()?))
}

/// What the likelihood loses (nats) where the obstacle stands at `there` in place of `here`: a parabola about the fit.
fn lost(ways: &[Way], here: &Shape, there: &Shape, loss_db: f64) -> f64 {
    ways.iter()
        .map(|way| match (here.is_crossed(way), there.is_crossed(way)) {
            (true, false) => -loss_db * way.slope + 0.5 * loss_db * loss_db * way.weight,
            (false, true) => loss_db * way.slope + 0.5 * loss_db * loss_db * way.weight,
            _ => 0.0,
        })
        .sum()
}

/// The coordinates of a hidden obstacle, each moved, the others fitted again, until the likelihood has fallen by `fall_nats`. `left`: slopes
/// under the fit with it.
#[must_use]
pub fn coordinates(
    rows: &Rows,
    train: &[u32],
    left: &[Slope],
    state: &State,
    fall_nats: f64,
) -> Vec<Coordinate> {
    let (Some(here), Some(&loss_db)) = (shape_of(state), state.values.first()) else {
        return Vec::new();
    };
    let ways = ways(rows, train, left);
    let numbers = here.numbers();
    let names: &[&'static str] = match here {
        Shape::Segment(..) => &["from_x_m", "from_y_m", "to_x_m", "to_y_m"],
        Shape::Disc(..) => &["centre_x_m", "centre_y_m", "radius_m"],
    };
    // All other coordinates fitted again.
    let fallen = |k: usize, value: f64| {
        let mut best = numbers.clone();
        best[k] = value;
        let mut least = lost(&ways, &here, &here.of(&best), loss_db);
        let mut step = FIRST_M;
        while STEP_M < step && fall_nats < least {
            let moved = (0..best.len())
                .filter(|&other| other != k)
                .flat_map(|other| [(other, -step), (other, step)])
                .map(|(other, by)| {
                    let mut there = best.clone();
                    there[other] += by;
                    (lost(&ways, &here, &here.of(&there), loss_db), there)
                })
                .min_by(|a, b| a.0.total_cmp(&b.0));
            match moved {
                Some((now, there)) if now < least => (least, best) = (now, there),
                _ => step /= 2.0,
            }
        }
        least
    };
    let end = |k: usize, sign: f64| {
        let is_near = |reach: f64| {
            let there = numbers[k] + sign * reach;
            (names[k] != "radius_m" || 0.0 < there) && fallen(k, there) <= fall_nats
        };
        let (mut near, mut far) = (0.0, STEP_M);
        while far < FARTHEST_M && is_near(far) {
            (near, far) = (far, 1.6 * far);
        }
        for _ in 0..HALVES {
            let middle = 0.5 * (near + far);
            if is_near(middle) {
                near = middle;
            } else {
                far = middle;
            }
        }
        numbers[k] + sign * far
    };
    names
        .iter()
        .enumerate()
        .map(|(k, name)| Coordinate {
            name,
            value_m: numbers[k],
            low_m: end(k, -1.0),
            high_m: end(k, 1.0),
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_edge_lies_between_the_ways_that_it_parts() {
        // Ways along y, a metre apart; the segment along x cuts those from 3.5 to 7.5.
        let way = |x: f64| Way { from_m: [x, -5.0], to_m: [x, 5.0], slope: 0.0, weight: 10.0 };
        let ways: Vec<Way> = (0..11).map(|x| way(f64::from(x))).collect();
        let here = Shape::Segment([3.5, 0.0], [7.5, 0.0]);
        let moved = |to: f64| lost(&ways, &here, &Shape::Segment([3.5, 0.0], [to, 0.0]), 4.0);
        assert_eq!(moved(7.9), 0.0);
        assert_eq!(moved(8.1), 80.0, "one way more: half of 16 dB² times 10");
        assert_eq!(moved(6.9), 80.0, "one less");
    }
}
