//! The place of a node at which its cells are likeliest.

use super::cells::NodeCells;
use super::moved;
use crate::defects::evidence::Evidence;
use measure::links::LinkRow;
use numbers::normal::Z_90;

/// Directions and distances of the places that are tried.
const N_DIRECTIONS: usize = 16;
/// The least distance (m), and how many times further the next is.
const FIRST_M: f64 = 1.5;
const FACTOR: f64 = 1.35;
/// Rounds of refinement; each tries neighbours at a step that is halved where none is better.
const N_REFINED: usize = 24;
/// The refined step is at least this (m).
const LEAST_STEP_M: f64 = 0.05;
/// So many rows stand for a cell.
const ROWS_OF_CELL: usize = 5;

/// A place.
#[derive(Clone, Copy, Debug)]
pub(super) struct Found {
    /// In the plane (m).
    pub(super) place_m: [f64; 2],
    /// Half of the 90 % interval of each coordinate (m).
    pub(super) half_m: [f64; 2],
    /// From the surveyed place (m).
    pub(super) shift_m: f64,
    /// Logarithm of the ratio of likelihoods over the surveyed place (nats).
    pub(super) gain_nats: f64,
    /// The weighted square that is left there.
    pub(super) square: f64,
    /// How many places were tried.
    pub(super) n_places: usize,
}

/// The rows that stand for the cells of a node, and what they are predicted as.
struct Places<'a> {
    evidence: &'a Evidence<'a>,
    cells: &'a NodeCells,
    node: u32,
    some: crate::links::rows::ModelledLinks,
    /// The cell of each of these rows.
    cell_of: Vec<usize>,
    /// Their power at the surveyed place (dBm).
    surveyed_dbm: Vec<f64>,
}

impl<'a> Places<'a> {
    fn new(evidence: &'a Evidence<'a>, cells: &'a NodeCells, node: u32) -> Self {
        let mut of_row = vec![None; evidence.rows().len()];
        for (number, cell) in cells.0.iter().enumerate() {
            let step = cell.rows.len().div_ceil(ROWS_OF_CELL);
            cell.rows.iter().step_by(step).for_each(|&row| of_row[row] = Some(number));
        }
        let kept: Vec<bool> = of_row.iter().map(Option::is_some).collect();
        let some = evidence.modelled().some(&kept);
        let levels = evidence.study.row_predictions(evidence.fit, &some);
        let surveyed_dbm = levels.iter().map(|level| level.power_dbm).collect();
        Self {
            evidence,
            cells,
            node,
            some,
            cell_of: of_row.into_iter().flatten().collect(),
            surveyed_dbm,
        }
    }

    /// The weighted square at a place (m); infinite where the model does not predict.
    fn square(&self, place_m: [f64; 2]) -> f64 {
        let rows: Vec<LinkRow> =
            self.some.links.rows.iter().map(|row| moved(row, self.node, place_m)).collect();
        let Some(changed) = self.some.with_rows(rows) else { return f64::INFINITY };
        let levels = self.evidence.study.row_predictions(self.evidence.fit, &changed);
        let mut sums = vec![(0.0, 0.0); self.cells.0.len()];
        for ((level, surveyed_dbm), &cell) in
            levels.iter().zip(&self.surveyed_dbm).zip(&self.cell_of)
        {
            sums[cell].0 += level.power_dbm - surveyed_dbm;
            sums[cell].1 += 1.0;
        }
        let moved_db: Vec<f64> = sums.into_iter().map(|(sum, n)| sum / n).collect();
        let square = self.cells.square(&moved_db);
        if square.is_finite() { square } else { f64::INFINITY }
    }
}

/// The place at which the cells of a node are likeliest. `others`: degrees of freedom of the variance of the cells of other nodes.
pub(super) fn best_place(
    evidence: &Evidence<'_>,
    node: u32,
    cells: &NodeCells,
    others: f64,
) -> Option<Found> {
    let places = Places::new(evidence, cells, node);
    let surveyed_m = places.some.links.rows.iter().find_map(|row| {
        let place_m = if row.tx == node { row.tx_m } else { row.rx_m };
        place_m[..2].iter().all(|m| m.is_finite()).then_some([place_m[0], place_m[1]])
    })?;
    let reach_m = places
        .some
        .links
        .rows
        .iter()
        .flat_map(|row| [row.tx_m, row.rx_m])
        .map(|place_m| libm::hypot(place_m[0] - surveyed_m[0], place_m[1] - surveyed_m[1]))
        .fold(0.0, f64::max);
    let before = cells.square(&vec![0.0; cells.0.len()]);
    let (mut best_m, mut least, mut n_places) = (surveyed_m, before, 0);
    let mut distance_m = FIRST_M;
    let mut step_m = FIRST_M / 2.0;
    while distance_m <= reach_m {
        for direction in 0..N_DIRECTIONS {
            let angle = direction as f64 / N_DIRECTIONS as f64 * std::f64::consts::TAU;
            let place_m = [
                surveyed_m[0] + distance_m * libm::cos(angle),
                surveyed_m[1] + distance_m * libm::sin(angle),
            ];
            let square = places.square(place_m);
            n_places += 1;
            if square < least {
                (best_m, least, step_m) = (place_m, square, distance_m / 5.0);
            }
        }
        distance_m *= FACTOR;
    }
    for _ in 0..N_REFINED {
        let mut is_better = false;
        for [x, y] in [[1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]] {
            let place_m = [best_m[0] + x * step_m, best_m[1] + y * step_m];
            let square = places.square(place_m);
            n_places += 1;
            if square < least {
                (best_m, least, is_better) = (place_m, square, true);
            }
        }
        if !is_better {
            step_m /= 2.0;
            if step_m < LEAST_STEP_M {
                break;
            }
        }
    }
    // Student's t of many dimensions.
    let freedom = cells.freedom();
    let gain_nats = 0.5 * (others + freedom) * libm::log((others + before) / (others + least));
    let half_m = half_intervals_m(&places, best_m, least);
    let shift_m = libm::hypot(best_m[0] - surveyed_m[0], best_m[1] - surveyed_m[1]);
    Some(Found { place_m: best_m, half_m, shift_m, gain_nats, square: least, n_places })
}

/// Half of the 90 % interval of each coordinate (m), by the curvature of the square.
fn half_intervals_m(places: &Places<'_>, best_m: [f64; 2], least: f64) -> [f64; 2] {
    let step_m = 10.0 * LEAST_STEP_M;
    let at = |x: f64, y: f64| places.square([best_m[0] + x * step_m, best_m[1] + y * step_m]);
    let curvature = |plus: f64, minus: f64| (plus + minus - 2.0 * least) / (step_m * step_m);
    let (xx, yy) = (curvature(at(1.0, 0.0), at(-1.0, 0.0)), curvature(at(0.0, 1.0), at(0.0, -1.0)));
    let xy =
        0.25 * (curvature(at(1.0, 1.0), at(-1.0, -1.0)) - curvature(at(1.0, -1.0), at(-1.0, 1.0)));
    let scale = (least / (places.cells.freedom() - 2.0)).max(1.0);
    // The variance is twice the inverse of the curvature.
    let determinant = xx * yy - xy * xy;
    [yy, xx].map(|other| {
        let variance = if 0.0 < determinant { other / determinant } else { f64::INFINITY };
        Z_90 * (2.0 * scale * variance).sqrt()
    })
}
