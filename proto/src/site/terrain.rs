//! The height of the ground.

use crate::config::{self, Default, Field, Kind, Problem, Range, TableSpec};
use serde::{Deserialize, Serialize};

const NUMBER: Kind = Kind::Number(Range::closed(-1e6, 1e6));

/// Description of `[site.terrain]`.
pub(super) const SPEC: TableSpec = TableSpec {
    doc: "Heights of the ground on a square grid; between its points, bilinear; outside, as at the border.",
    fields: &[
        Field {
            key: "origin_m",
            doc: "Where the first point of the first row lies (x, y in m).",
            kind: Kind::List { of: &NUMBER, min: 2, max: 2 },
            default: Default::Required,
        },
        Field {
            key: "spacing_m",
            doc: "Distance between neighbouring points (m).",
            kind: Kind::Number(Range::above(0.0, 1e6)),
            default: Default::Required,
        },
        Field {
            key: "height_m",
            doc: "Heights (m): rows from south to north, each from west to east.",
            kind: Kind::List {
                of: &Kind::List { of: &NUMBER, min: 2, max: 100_000 },
                min: 2,
                max: 100_000,
            },
            default: Default::Required,
        },
    ],
    tag: None,
};

/// Heights of the ground on a square grid.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Terrain {
    /// Where the first point of the first row lies (m).
    pub origin_m: [f64; 2],
    /// Distance between neighbouring points (m).
    pub spacing_m: f64,
    /// Heights (m): rows from south to north, each from west to east.
    pub height_m: Vec<Vec<f64>>,
}

impl Terrain {
    /// Refuses rows of unequal length.
    pub(super) fn check(&self, path: &str, problems: &mut Vec<Problem>) {
        let n = self.height_m[0].len();
        for (index, row) in self.height_m.iter().enumerate().filter(|(_, row)| row.len() != n) {
            let place = format!("{}[{index}]", config::join(path, "height_m"));
            problems.push(
                Problem::new(place, format!("must have {n} heights, as the first row has"))
                    .value(format!("{}", row.len())),
            );
        }
    }

    /// How steeply the ground rises towards the east and the north (m per m).
    #[must_use]
    pub fn gradient(&self, at_m: [f64; 2]) -> [f64; 2] {
        let cells = [self.height_m[0].len() - 1, self.height_m.len() - 1];
        let place: [f64; 2] =
            std::array::from_fn(|axis| (at_m[axis] - self.origin_m[axis]) / self.spacing_m);
        // Beyond the border heights no longer change across it.
        let within: [bool; 2] =
            std::array::from_fn(|axis| (0.0..=cells[axis] as f64).contains(&place[axis]));
        let cell: [usize; 2] = std::array::from_fn(|axis| {
            place[axis].clamp(0.0, (cells[axis] - 1) as f64).floor() as usize
        });
        let [u, v]: [f64; 2] =
            std::array::from_fn(|axis| (place[axis] - cell[axis] as f64).clamp(0.0, 1.0));
        let height = |column: usize, row: usize| self.height_m[cell[1] + row][cell[0] + column];
        let east = (height(1, 0) - height(0, 0)) * (1.0 - v) + (height(1, 1) - height(0, 1)) * v;
        let north = (height(0, 1) - height(0, 0)) * (1.0 - u) + (height(1, 1) - height(1, 0)) * u;
        let part = |axis: usize, rise: f64| if within[axis] { rise / self.spacing_m } else { 0.0 };
        [part(0, east), part(1, north)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_saddle_rises_as_its_equation_says() {
        // h = x y on a grid is bilinear: its gradient is (y, x).
        let coordinates = [0.0, 2.0, 4.0];
        let terrain = Terrain {
            origin_m: [0.0, 0.0],
            spacing_m: 2.0,
            height_m: coordinates.map(|y| coordinates.map(|x| x * y).to_vec()).to_vec(),
        };
        for at_m in [[0.5, 0.25], [3.0, 1.0], [1.0, 3.5], [2.0, 2.0], [4.0, 4.0]] {
            let [east, north] = terrain.gradient(at_m);
            assert!((east - at_m[1]).abs() < 1e-12 && (north - at_m[0]).abs() < 1e-12, "{at_m:?}");
        }
        assert_eq!(terrain.gradient([-1.0, 1.0]), [0.0, 0.0], "west of it, as at the border");
    }

    #[test]
    fn rows_of_unequal_length_are_refused() {
        let text = "[terrain]\norigin_m = [0, 0]\nspacing_m = 1\nheight_m = [[0, 1], [0, 1, 2]]";
        let node = config::parse(text).unwrap();
        let mut problems = Vec::new();
        super::super::read(&node, "site", &mut problems);
        assert_eq!(
            problems[0].to_string(),
            "site.terrain.height_m[1]: must have 2 heights, as the first row has, got 3"
        );
    }
}
