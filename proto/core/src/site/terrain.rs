//! The height of the ground.

mod grid;
mod hill;

pub use grid::Grid;
pub use hill::Hill;

use crate::config::{CheckedValue, Key, Kind, Problem};
use serde::{Deserialize, Serialize};

/// The ground.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Terrain {
    /// Hills on a plane.
    Hills(Vec<Hill>),
    /// Heights that were measured.
    Grid(Grid),
}

/// Heights of the ground in a net of equal rectangles.
#[derive(Clone, Debug, PartialEq)]
pub struct HeightNet {
    /// Corner of least x and y (m).
    pub from_m: [f64; 2],
    /// Width and depth of a rectangle (m).
    pub step_m: [f64; 2],
    /// Number of columns, and of rows.
    pub columns: usize,
    /// Heights (m), row after row from least y.
    pub height_m: Vec<f64>,
}

impl HeightNet {
    /// Where a column is (m).
    #[must_use]
    pub fn x_m(&self, column: usize) -> f64 {
        self.from_m[0] + self.step_m[0] * column as f64
    }

    /// Where a row is (m).
    #[must_use]
    pub fn y_m(&self, row: usize) -> f64 {
        self.from_m[1] + self.step_m[1] * row as f64
    }
}

impl Default for Terrain {
    /// A plane.
    fn default() -> Self {
        Self::Hills(Vec::new())
    }
}

impl Key for Terrain {
    const KIND: Kind = Kind::Either(&[Vec::<Hill>::KIND, Grid::KIND]);

    fn from_value(value: &CheckedValue) -> Option<Self> {
        let hills = Vec::from_value(value).map(Self::Hills);
        hills.or_else(|| Grid::from_value(value).map(Self::Grid))
    }

    fn absent() -> Option<Self> {
        Some(Self::default())
    }
}

impl Terrain {
    /// How steeply the ground rises towards the east and the north (m per m) at a place.
    #[must_use]
    pub fn gradient(&self, at_m: [f64; 2]) -> [f64; 2] {
        match self {
            Self::Hills(hills) => hills.iter().fold([0.0; 2], |[east, north], hill| {
                let rise = hill.gradient(at_m);
                [east + rise[0], north + rise[1]]
            }),
            Self::Grid(grid) => grid.gradient(at_m),
        }
    }

    /// Whether nothing is known of the ground: it is taken to be level.
    #[must_use]
    pub fn is_level(&self) -> bool {
        matches!(self, Self::Hills(hills) if hills.is_empty())
    }

    /// Heights over a rectangle between two corners (least and greatest x, y in m), in `squares` by `squares` parts. Only gradients are
    /// known: heights are summed up from them along the first row, then up every column, and the lowest is 0.
    #[must_use]
    pub fn net(&self, corners_m: [[f64; 2]; 2], squares: usize) -> HeightNet {
        let [from_m, to_m] = corners_m;
        let step_m = [0, 1].map(|axis| (to_m[axis] - from_m[axis]) / squares as f64);
        let mut net = HeightNet { from_m, step_m, columns: squares + 1, height_m: Vec::new() };
        let rise_m = |from: [f64; 2], to: [f64; 2]| {
            let gradient = self.gradient([0, 1].map(|axis| 0.5 * (from[axis] + to[axis])));
            gradient[0] * (to[0] - from[0]) + gradient[1] * (to[1] - from[1])
        };
        for row in 0..net.columns {
            for column in 0..net.columns {
                let here = [net.x_m(column), net.y_m(row)];
                let height_m = if row > 0 {
                    let below_m = net.height_m[(row - 1) * net.columns + column];
                    below_m + rise_m([here[0], net.y_m(row - 1)], here)
                } else if column > 0 {
                    net.height_m[column - 1] + rise_m([net.x_m(column - 1), here[1]], here)
                } else {
                    0.0
                };
                net.height_m.push(height_m);
            }
        }
        let lowest_m = net.height_m.iter().copied().fold(f64::INFINITY, f64::min);
        net.height_m.iter_mut().for_each(|height_m| *height_m -= lowest_m);
        net
    }

    /// Adds what is wrong with it, which stands at `path`.
    pub(super) fn check(&self, path: &str, problems: &mut Vec<Problem>) {
        match self {
            Self::Hills(_) => {}
            Self::Grid(grid) => grid.check(path, problems),
        }
    }
}
