//! A grid.

use super::{Entry, LENGTH, Place, Scenario};
use proto::config::{Section, variant};
use proto::ids::AgentId;
use proto::rng::Draws;

pub(super) const ENTRY: Entry = Entry {
    variant: variant::<Grid>("grid"),
    build: |table, _, _| Some(Box::new(Grid::read(table))),
};

/// On a grid around the origin, in rows from west to east, starting in the south.
///
/// Agent i in row ⌊i/c⌋ and column i mod c of c columns, c = ⌈√n⌉ unless it is given.
#[derive(Debug, Section)]
struct Grid {
    /// Distance between neighbours (m).
    #[key(kind = LENGTH, default = 2.0)]
    spacing_m: f64,
    /// Robots per row. Absent: as many as make the grid square.
    #[key(range = 1..=u32::MAX)]
    columns: Option<usize>,
}

impl Scenario for Grid {
    fn place(&self, agent: AgentId, n_agents: usize, _draws: Draws) -> Place {
        let square = (1..).find(|columns| n_agents <= columns * columns).unwrap_or(1);
        let columns = self.columns.unwrap_or(square).min(n_agents);
        let rows = n_agents.div_ceil(columns);
        let offset_m =
            |index: usize, n: usize| self.spacing_m * (index as f64 - 0.5 * (n - 1) as f64);
        let (row, column) = (agent.index() / columns, agent.index() % columns);
        let position_m = [offset_m(column, columns), offset_m(row, rows), 0.0];
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
