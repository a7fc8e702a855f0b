//! Ways over a grid: what it costs to get where, and where a way turns.

use super::grid::Grid;
use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// What it costs to get from one cell to all others, in fifths of a cell's side.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Costs {
    /// `u32::MAX`: there is no way.
    cost: Vec<u32>,
    /// The cell before, on the cheapest way.
    before: Vec<u16>,
}

/// A step to a cell beside costs 5, one across a corner 7, for which 7.07 would be exact.
const STEPS: [(i32, i32, u32); 8] =
    [(1, 0, 5), (0, 1, 5), (-1, 0, 5), (0, -1, 5), (1, 1, 7), (-1, 1, 7), (-1, -1, 7), (1, -1, 7)];

impl Costs {
    /// The cheapest ways from a cell over passable ones (Dijkstra 1959). Corners are not cut: a step across one needs both
    /// cells beside it. The first cell need not be passable.
    #[must_use]
    pub(super) fn from(grid: &Grid, start: u16, is_passable: impl Fn(u16) -> bool) -> Self {
        let mut cost = vec![u32::MAX; grid.n_cells()];
        let mut before = vec![start; grid.n_cells()];
        let mut open = BinaryHeap::new();
        cost[usize::from(start)] = 0;
        open.push(Reverse((0, start)));
        while let Some(Reverse((so_far, cell))) = open.pop() {
            if cost[usize::from(cell)] < so_far {
                continue;
            }
            let (column, row) = grid.place(cell);
            let passable = |right: i32, up: i32| {
                grid.cell_in(column + right, row + up).filter(|&cell| is_passable(cell))
            };
            for (right, up, step) in STEPS {
                let Some(next) = passable(right, up) else { continue };
                let is_across = right != 0 && up != 0;
                if is_across && (passable(right, 0).is_none() || passable(0, up).is_none()) {
                    continue;
                }
                let place = usize::from(next);
                if so_far + step < cost[place] {
                    cost[place] = so_far + step;
                    before[place] = cell;
                    open.push(Reverse((so_far + step, next)));
                }
            }
        }
        Self { cost, before }
    }

    /// What it costs to get to a cell; `None`: there is no way.
    #[must_use]
    pub(super) fn to(&self, cell: u16) -> Option<u32> {
        Some(self.cost[usize::from(cell)]).filter(|&cost| cost != u32::MAX)
    }

    /// The cells of the cheapest way to a cell, the first one left out; empty where there is none, or none needed.
    #[must_use]
    pub(super) fn way(&self, to: u16) -> Vec<u16> {
        let mut way = Vec::new();
        let mut cell = to;
        while self.to(cell).is_some_and(|cost| cost != 0) {
            way.push(cell);
            cell = self.before[usize::from(cell)];
        }
        way.reverse();
        way
    }
}

/// Where a way that begins at a cell turns, and where it ends.
#[must_use]
pub(super) fn corners(grid: &Grid, from: u16, way: &[u16]) -> Vec<u16> {
    let mut corners = Vec::new();
    let mut last = grid.place(from);
    let mut heading = None;
    for &cell in way {
        let place = grid.place(cell);
        let towards = (place.0 - last.0, place.1 - last.1);
        if heading == Some(towards) {
            corners.pop();
        }
        heading = Some(towards);
        corners.push(cell);
        last = place;
    }
    corners
}

/// The cells between a cell and the corners of a way that begins there: the inverse of [`corners`]. Nothing beyond the first corner
/// that is not straight ahead.
#[must_use]
pub(super) fn straight(grid: &Grid, from: u16, corners: &[u16]) -> Vec<u16> {
    let mut way = Vec::new();
    let (mut column, mut row) = grid.place(from);
    for &corner in corners {
        let (to_column, to_row) = grid.place(corner);
        let (across, up) = (to_column - column, to_row - row);
        if across != 0 && up != 0 && across.abs() != up.abs() {
            break;
        }
        while (column, row) != (to_column, to_row) {
            column += across.signum();
            row += up.signum();
            way.extend(grid.cell_in(column, row));
        }
    }
    way
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Five by five, with a wall between the columns 1 and 3 that is open in the north.
    fn walled() -> (Grid, fn(u16) -> bool) {
        let grid = Grid::new([0.0, 0.0], [5.0, 5.0], 1.0).unwrap();
        (grid, |cell| ![2, 7, 12, 17].contains(&cell))
    }

    #[test]
    fn a_way_goes_round_a_wall_and_cuts_no_corner() {
        let (grid, is_passable) = walled();
        let costs = Costs::from(&grid, 10, is_passable);
        // Up one and across one, up one, two along the north, down two.
        assert_eq!(costs.to(14), Some(7 + 5 + 5 + 5 + 5 + 7));
        let way = costs.way(14);
        assert_eq!(way.len(), 6);
        assert!(way.contains(&21) && way.contains(&22) && way.contains(&23), "{way:?}");
        assert!(way.iter().all(|&cell| is_passable(cell)));
        assert_eq!(costs.to(12), None, "inside the wall");
        assert!(costs.way(12).is_empty());
        assert!(costs.way(10).is_empty());
    }

    #[test]
    fn the_cost_is_the_octile_distance_where_nothing_is_in_the_way() {
        let grid = Grid::new([0.0, 0.0], [9.0, 7.0], 1.0).unwrap();
        let costs = Costs::from(&grid, 30, |_| true);
        let (column, row) = grid.place(30);
        for cell in 0..63 {
            let (to_column, to_row) = grid.place(cell);
            let (dx, dy) = ((to_column - column).abs(), (to_row - row).abs());
            let expected = 5 * (dx.max(dy) - dx.min(dy)) + 7 * dx.min(dy);
            assert_eq!(costs.to(cell), Some(expected as u32));
        }
    }

    #[test]
    fn a_way_is_known_from_its_corners() {
        let (grid, is_passable) = walled();
        for from in (0..25).filter(|&cell| is_passable(cell)) {
            let costs = Costs::from(&grid, from, is_passable);
            for to in (0..25).filter(|&cell| is_passable(cell)) {
                let way = costs.way(to);
                let turns = corners(&grid, from, &way);
                assert!(turns.len() <= way.len());
                assert_eq!(straight(&grid, from, &turns), way);
            }
        }
    }
}
