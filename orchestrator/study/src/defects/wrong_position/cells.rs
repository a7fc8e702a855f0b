//! Mean residuals of links, and how much they vary beside the levels of senders and receivers.

use crate::defects::evidence::Evidence;
use crate::thresholds::{
    FEWEST_NODE_CELLS, FEWEST_OTHER_CELLS, FEWEST_REPEATED_ROWS, NODE_SQUARES_ACROSS,
};
use numbers::power::square;
use std::collections::BTreeMap;

/// A link: its sender, its receiver and the square of each.
type CellKey = (u32, u32, [[i64; 3]; 2]);

/// Steps in which levels of senders and receivers are fitted.
const STEPS: usize = 30;

/// Rows of a link with one mean: of one direction, towards a square of the plane where an end moves.
#[derive(Clone, Debug)]
pub(super) struct Cell {
    pub(super) tx: u32,
    pub(super) rx: u32,
    /// Rows that have a reading.
    pub(super) rows: Vec<usize>,
    /// Their mean residual (dB).
    mean_db: f64,
    /// Variance of that by the noise of single rows (dB²).
    noise: f64,
}

impl Cell {
    pub(super) fn has(&self, node: u32) -> bool {
        self.tx == node || self.rx == node
    }
}

/// The cells of all rows that have a reading and known places. `None` where too few rows repeat others.
pub(super) fn cells(evidence: &Evidence<'_>) -> Option<Vec<Cell>> {
    let rows = evidence.rows();
    let moving = evidence.study.moving();
    let places_m = || rows.iter().flat_map(|row| [row.tx_m, row.rx_m]);
    let span_m = (0..2)
        .map(|axis| {
            let along = || places_m().map(|place_m| place_m[axis]).filter(|m| m.is_finite());
            along().fold(f64::NEG_INFINITY, f64::max) - along().fold(f64::INFINITY, f64::min)
        })
        .fold(0.0, f64::max);
    let side_m = (span_m / NODE_SQUARES_ACROSS).max(1e-3);
    let of_place = |place_m: [f64; 3], is_moving: bool| {
        if is_moving { evidence.modelled().square_numbers(place_m, side_m) } else { [0; 3] }
    };
    let mut by_key: BTreeMap<CellKey, Vec<usize>> = BTreeMap::new();
    for row in evidence.received().filter(|&row| evidence.residual_db(row).is_finite()) {
        let (one, [tx_moves, rx_moves]) = (&rows[row], moving[row]);
        let squares = [of_place(one.tx_m, tx_moves), of_place(one.rx_m, rx_moves)];
        by_key.entry((one.tx, one.rx, squares)).or_default().push(row);
    }
    let mean_db = |rows: &[usize]| {
        rows.iter().map(|&row| evidence.residual_db(row)).sum::<f64>() / rows.len() as f64
    };
    let (mut squares, mut n_repeated) = (0.0, 0);
    for rows in by_key.values() {
        let mean_db = mean_db(rows);
        squares += rows.iter().map(|&row| square(evidence.residual_db(row) - mean_db)).sum::<f64>();
        n_repeated += rows.len() - 1;
    }
    if n_repeated < FEWEST_REPEATED_ROWS {
        return None;
    }
    let quantum_db = evidence.modelled().links.readings.quantum_db;
    let variance = squares / n_repeated as f64 + square(quantum_db) / 12.0;
    let cell = |((tx, rx, _), rows): ((u32, u32, _), Vec<usize>)| Cell {
        tx,
        rx,
        mean_db: mean_db(&rows),
        noise: variance / rows.len() as f64,
        rows,
    };
    Some(by_key.into_iter().map(cell).collect())
}

/// Levels of senders and receivers (dB), and what is left of the variance of cells.
#[derive(Debug)]
pub(super) struct Levels {
    tx_db: BTreeMap<u32, Level>,
    rx_db: BTreeMap<u32, Level>,
    /// Variance that cells have beside the noise of their rows (dB²).
    own: f64,
    /// Mean square of the weighted residuals of cells.
    scale: f64,
    /// Degrees of freedom of that.
    pub(super) freedom: f64,
}

/// A level (dB), and the variance of its estimate (dB²).
#[derive(Clone, Copy, Debug, Default)]
struct Level {
    db: f64,
    variance: f64,
}

impl Levels {
    /// Of these cells. `None` where they are too few.
    pub(super) fn new(cells: &[&Cell]) -> Option<Self> {
        let empty = Self {
            tx_db: BTreeMap::new(),
            rx_db: BTreeMap::new(),
            own: 0.0,
            scale: 1.0,
            freedom: 0.0,
        };
        let mut levels = empty.fitted(cells);
        levels.freedom =
            cells.len() as f64 - (levels.tx_db.len() + levels.rx_db.len()) as f64 + 1.0;
        if levels.freedom < FEWEST_OTHER_CELLS {
            return None;
        }
        // The variance of cells by moments, then once more with the weights that follow from it.
        for _ in 0..2 {
            let squares: f64 = cells.iter().map(|cell| square(levels.residual_db(cell))).sum();
            let noise = cells.iter().map(|cell| cell.noise).sum::<f64>() / cells.len() as f64;
            levels.own = (squares / levels.freedom - noise).max(0.0);
            levels = levels.fitted(cells);
        }
        let squares = cells
            .iter()
            .map(|cell| square(levels.residual_db(cell)) / (levels.own + cell.noise))
            .sum::<f64>();
        levels.scale = (squares / levels.freedom).max(1.0);
        Some(levels)
    }

    fn residual_db(&self, cell: &Cell) -> f64 {
        let level = |levels: &BTreeMap<u32, Level>, node| {
            levels.get(node).map_or(0.0, |level: &Level| level.db)
        };
        cell.mean_db - level(&self.tx_db, &cell.tx) - level(&self.rx_db, &cell.rx)
    }

    /// The levels of highest likelihood, by turns those of senders and of receivers.
    fn fitted(mut self, cells: &[&Cell]) -> Self {
        for _ in 0..STEPS {
            for is_sender in [true, false] {
                let mut sums: BTreeMap<u32, (f64, f64)> = BTreeMap::new();
                for cell in cells {
                    let (node, levels) =
                        if is_sender { (cell.tx, &self.tx_db) } else { (cell.rx, &self.rx_db) };
                    let own_db = levels.get(&node).map_or(0.0, |level| level.db);
                    let weight = 1.0 / (self.own + cell.noise);
                    let sum = sums.entry(node).or_default();
                    sum.0 += weight * (self.residual_db(cell) + own_db);
                    sum.1 += weight;
                }
                let level = |(node, (sum, weight)): (u32, (f64, f64))| {
                    (node, Level { db: sum / weight, variance: 1.0 / weight })
                };
                let levels = sums.into_iter().map(level).collect();
                if is_sender {
                    self.tx_db = levels;
                } else {
                    self.rx_db = levels;
                }
            }
        }
        self
    }

    /// The cells of a node whose other ends have a known level. `None` where they are too few.
    pub(super) fn of_node(&self, node: u32, cells: &[&Cell]) -> Option<NodeCells> {
        let one = |cell: &&Cell| {
            let level =
                if cell.tx == node { self.rx_db.get(&cell.rx) } else { self.tx_db.get(&cell.tx) }?;
            let variance = self.scale * (self.own + cell.noise + level.variance);
            Some(NodeCell {
                rows: cell.rows.clone(),
                is_sender: cell.tx == node,
                residual_db: cell.mean_db - level.db,
                weight: 1.0 / variance,
            })
        };
        let cells = NodeCells(cells.iter().filter_map(one).collect());
        (FEWEST_NODE_CELLS <= cells.freedom()).then_some(cells)
    }
}

/// A cell of a node, beside the level of its other end.
#[derive(Debug)]
pub(super) struct NodeCell {
    pub(super) rows: Vec<usize>,
    is_sender: bool,
    residual_db: f64,
    weight: f64,
}

/// The cells of a node.
#[derive(Debug)]
pub(super) struct NodeCells(pub(super) Vec<NodeCell>);

impl NodeCells {
    /// Sum of the weighted squares of residuals beside a level of the node as sender and one as receiver, if each cell were moved by
    /// so much (dB).
    pub(super) fn square(&self, moved_db: &[f64]) -> f64 {
        let of_end = |is_sender: bool| {
            let cells = || {
                let cells = self.0.iter().zip(moved_db);
                cells.filter(move |(cell, _)| cell.is_sender == is_sender)
            };
            let weight: f64 = cells().map(|(cell, _)| cell.weight).sum();
            if weight == 0.0 {
                return 0.0;
            }
            let left_db = |(cell, moved_db): (&NodeCell, &f64)| cell.residual_db - moved_db;
            let mean_db = cells().map(|pair| pair.0.weight * left_db(pair)).sum::<f64>() / weight;
            cells().map(|pair| pair.0.weight * square(left_db(pair) - mean_db)).sum::<f64>()
        };
        of_end(true) + of_end(false)
    }

    /// Degrees of freedom beside the levels of the node.
    pub(super) fn freedom(&self) -> f64 {
        let has = |is_sender: bool| self.0.iter().any(|cell| cell.is_sender == is_sender);
        self.0.len() as f64 - f64::from(u8::from(has(true)) + u8::from(has(false)))
    }

    /// The mean square at the surveyed place; 1 where cells vary as those of others.
    pub(super) fn mean_square(&self) -> f64 {
        self.square(&vec![0.0; self.0.len()]) / self.freedom()
    }
}
