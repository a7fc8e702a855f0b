//! A grid.

use super::{Entry, LENGTH, Place, Scenario};
use crate::context::field;
use proto::config::{Default, Kind, Variant, typed};
use proto::rng::Draws;
use serde::Deserialize;

pub(super) const ENTRY: Entry = Entry {
    variant: Variant {
        name: "grid",
        doc: "On a grid around the origin, in rows from west to east, starting in the south.",
        fields: &[
            field("spacing_m", "Distance between neighbours (m).", LENGTH, Default::Number(2.0)),
            field(
                "columns",
                "Robots per row. Absent: as many as make the grid square.",
                Kind::Integer { min: 1, max: u32::MAX as i64 },
                Default::Absent,
            ),
        ],
    },
    build: |table, _, _| Some(Box::new(typed::<Grid>(table))),
};

/// Agent i in row ⌊i/c⌋ and column i mod c of c columns, c = ⌈√n⌉ unless it is given.
#[derive(Debug, Deserialize)]
struct Grid {
    spacing_m: f64,
    columns: Option<usize>,
}

impl Scenario for Grid {
    fn place(&self, agent: usize, n_agents: usize, _draws: Draws) -> Place {
        let square = (1..).find(|columns| n_agents <= columns * columns).unwrap_or(1);
        let columns = self.columns.unwrap_or(square).min(n_agents);
        let rows = n_agents.div_ceil(columns);
        let offset_m =
            |index: usize, n: usize| self.spacing_m * (index as f64 - 0.5 * (n - 1) as f64);
        let position_m = [offset_m(agent % columns, columns), offset_m(agent / columns, rows), 0.0];
        Place { position_m, heading_rad: None }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proto::rng::Purpose;

    #[test]
    fn a_grid_is_centred_and_evenly_spaced() {
        let places = |n, columns| -> Vec<[f64; 2]> {
            let grid = Grid { spacing_m: 3.0, columns };
            let places = grid.places(n, Draws::new(1, Purpose::Scenario));
            places.iter().map(|place| [place.position_m[0], place.position_m[1]]).collect()
        };
        assert_eq!(places(4, None), [[-1.5, -1.5], [1.5, -1.5], [-1.5, 1.5], [1.5, 1.5]]);
        assert_eq!(places(3, Some(7)), [[-3.0, 0.0], [0.0, 0.0], [3.0, 0.0]]);
        assert_eq!(places(5, None)[3], [-3.0, 1.5]);
    }
}
