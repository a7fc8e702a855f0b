//! A grid of heights.

use crate::config::{CheckedValue, Key, Kind, Problem, Range, Section};
use serde::{Deserialize, Serialize};

/// Most rows, and most columns.
const MOST: usize = 1000;

/// Terrain heights on a grid, as from a survey. Heights are interpolated smoothly between grid points; outside the grid the ground
/// is level.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, Section)]
struct Written {
    /// The grid's south-western corner (x, y in m).
    #[key(range = Range::PLACE)]
    origin_m: [f64; 2],
    /// Spacing of the grid points (m), the same towards east and north.
    #[key(range = Range::LENGTH)]
    spacing_m: f64,
    /// Heights (m): rows from south to north, each from west to east.
    #[key(range = -1e4..=1e4, length = 2..=MOST, required)]
    height_m: Vec<Vec<f64>>,
}

/// Heights on a grid.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(from = "Written", into = "Written")]
pub struct Grid {
    written: Written,
    /// Points of a row, and rows.
    n: [usize; 2],
    /// Row by row, with one point more at each side.
    padded_m: Vec<f64>,
}

impl Key for Grid {
    const KIND: Kind = Written::KIND;

    fn from_value(value: &CheckedValue) -> Option<Self> {
        Written::from_value(value).map(Self::from)
    }
}

impl From<Written> for Grid {
    fn from(written: Written) -> Self {
        let rows = &written.height_m;
        let n = [rows.iter().map(Vec::len).min().unwrap_or(0), rows.len()];
        let mut padded_m = Vec::new();
        if 2 <= n[0] && 2 <= n[1] {
            padded_m.reserve((n[0] + 2) * (n[1] + 2));
            for row in 0..n[1] + 2 {
                let along = |column| beyond(row, n[1], |i| rows[i][column]);
                padded_m.extend((0..n[0] + 2).map(|column| beyond(column, n[0], along)));
            }
        }
        Self { written, n, padded_m }
    }
}

impl From<Grid> for Written {
    fn from(grid: Grid) -> Self {
        grid.written
    }
}

impl Grid {
    /// How steeply the ground rises towards the east and the north (m per m).
    ///
    /// Heights between the points are the cubic convolution of the sixteen around them with a = −1/2, exact to the third
    /// order in the spacing, and their slope has no steps (Keys, IEEE Trans. ASSP 29(6), 1981). Points beyond the edge are in
    /// line with the last two.
    #[must_use]
    pub fn gradient(&self, at_m: [f64; 2]) -> [f64; 2] {
        let Written { origin_m, spacing_m, .. } = self.written;
        let mut cell = [0; 2];
        let mut within = [0.0; 2];
        for axis in [0, 1] {
            let place = (at_m[axis] - origin_m[axis]) / spacing_m;
            let last = self.n[axis] - 1;
            if !(0.0..=last as f64).contains(&place) {
                return [0.0; 2];
            }
            cell[axis] = (place as usize).min(last - 1);
            within[axis] = place - cell[axis] as f64;
        }
        let [across, upward] = within.map(weights);
        let [along, rising] = within.map(slopes);
        let mut rise = [0.0; 2];
        for row in 0..4 {
            let begin = (cell[1] + row) * (self.n[0] + 2) + cell[0];
            let heights_m = &self.padded_m[begin..begin + 4];
            let sum = |weights: &[f64; 4]| -> f64 {
                heights_m.iter().zip(weights).map(|(height_m, weight)| height_m * weight).sum()
            };
            rise[0] += upward[row] * sum(&along);
            rise[1] += rising[row] * sum(&across);
        }
        rise.map(|part| part / spacing_m)
    }

    /// Adds what is wrong with it, which stands at `path`.
    pub(super) fn check(&self, path: &str, problems: &mut Vec<Problem>) {
        let rows = &self.written.height_m;
        for (index, row) in rows.iter().enumerate() {
            let n = rows[0].len();
            if row.len() != n {
                problems.push(
                    Problem::new(
                        format!("{path}.height_m[{index}]"),
                        format!("must have {n} entries, as many as the first row"),
                    )
                    .value(row.len()),
                );
            }
        }
    }
}

/// A value on a line of `n`, counted from one before the first: beyond the ends, in line with the last two.
fn beyond(index: usize, n: usize, value: impl Fn(usize) -> f64) -> f64 {
    match index {
        0 => 2.0 * value(0) - value(1),
        index if index <= n => value(index - 1),
        _ => 2.0 * value(n - 1) - value(n - 2),
    }
}

/// Weights of the four points around a place at `t` (0 to 1) between the middle two.
fn weights(t: f64) -> [f64; 4] {
    [
        0.5 * t * (-1.0 + t * (2.0 - t)),
        1.0 + 0.5 * t * t * (-5.0 + 3.0 * t),
        0.5 * t * (1.0 + t * (4.0 - 3.0 * t)),
        0.5 * t * t * (t - 1.0),
    ]
}

/// Their derivatives.
fn slopes(t: f64) -> [f64; 4] {
    [
        0.5 * (-1.0 + t * (4.0 - 3.0 * t)),
        0.5 * t * (-10.0 + 9.0 * t),
        0.5 * (1.0 + t * (8.0 - 9.0 * t)),
        0.5 * t * (3.0 * t - 2.0),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config;

    fn sampled(height_m: impl Fn(f64, f64) -> f64) -> Grid {
        let [origin_m, spacing_m] = [[-4.0, -2.0], [0.5; 2]];
        let axis = |axis: usize, n: usize| {
            (0..n).map(move |i| origin_m[axis] + i as f64 * spacing_m[axis])
        };
        let height_m = axis(1, 13).map(|y| axis(0, 17).map(|x| height_m(x, y)).collect()).collect();
        Written { origin_m, spacing_m: spacing_m[0], height_m }.into()
    }

    #[test]
    fn slopes_of_planes_and_saddles_are_exact() {
        let grid = sampled(|x, y| 3.0 - 0.25 * x + 0.5 * y + 0.125 * x * y);
        for [x, y] in [[-4.0, -2.0], [-3.9, 3.9], [0.2, 0.7], [4.0, 4.0]] {
            let [east, north] = grid.gradient([x, y]);
            assert!((east - (-0.25 + 0.125 * y)).abs() < 1e-12, "{east} at {x} {y}");
            assert!((north - (0.5 + 0.125 * x)).abs() < 1e-12, "{north} at {x} {y}");
        }
        assert_eq!(grid.gradient([4.1, 0.0]), [0.0; 2]);
        assert_eq!(grid.gradient([0.0, -2.1]), [0.0; 2]);
    }

    #[test]
    fn a_hill_on_a_grid_is_the_hill() {
        let hill = super::super::Hill { centre_m: [0.3, 1.1], height_m: 2.0, radius_m: 3.0 };
        let grid =
            sampled(|x, y| 2.0 * (-((x - 0.3f64).powi(2) + (y - 1.1f64).powi(2)) / 18.0).exp());
        for [x, y] in [[-2.2, -1.3], [0.1, 0.1], [1.7, 2.9], [3.1, -0.4]] {
            let [found, exact] = [grid.gradient([x, y]), hill.gradient([x, y])];
            for axis in [0, 1] {
                assert!((found[axis] - exact[axis]).abs() < 2e-3, "{found:?} {exact:?}");
            }
        }
    }

    #[test]
    fn rows_of_unequal_length_are_refused() {
        let text =
            "[terrain]\norigin_m = [0, 0]\nspacing_m = 1\nheight_m = [[1, 2], [1, 2, 3], [1, 2]]\n";
        let mut problems = Vec::new();
        crate::site::read(&config::parse(text).unwrap(), "site", &mut problems);
        let told: Vec<String> = problems.iter().map(ToString::to_string).collect();
        assert_eq!(
            told,
            ["site.terrain.height_m[1]: must have 2 entries, as many as the first row, got 3"]
        );
    }
}
