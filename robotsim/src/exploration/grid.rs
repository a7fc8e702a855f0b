//! The area that is explored, in square cells: which are solid, what is seen from where.

use proto::site::{Obstacle, Site, Wall};
use serde::{Deserialize, Serialize};

/// What is known of a cell.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum Cell {
    /// Nothing.
    #[default]
    Unknown,
    /// Robots can be there.
    Free,
    /// A wall or an obstacle is in it.
    Occupied,
}

/// A rectangle in square cells, numbered row after row from the south-west.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Grid {
    from_m: [f64; 2],
    cell_m: f64,
    columns: i32,
    rows: i32,
}

/// Most cells a grid may have: their numbers have two octets.
pub const MAX_CELLS: usize = 65_535;

impl Grid {
    /// Cells of this size from the south-western corner on; those in the north and east may reach beyond the rectangle.
    /// `None`: there would be more than [`MAX_CELLS`].
    #[must_use]
    pub fn new(from_m: [f64; 2], to_m: [f64; 2], cell_m: f64) -> Option<Self> {
        // A length that is a whole number of cells but for rounding has so many.
        let count = |axis: usize| libm::ceil((to_m[axis] - from_m[axis]) / cell_m - 1e-9).max(1.0);
        let (columns, rows) = (count(0), count(1));
        (columns * rows <= MAX_CELLS as f64).then_some(Self {
            from_m,
            cell_m,
            columns: columns as i32,
            rows: rows as i32,
        })
    }

    /// How many cells there are.
    #[must_use]
    pub fn n_cells(&self) -> usize {
        (self.columns * self.rows) as usize
    }

    /// Side of a cell (m).
    #[must_use]
    pub fn cell_m(&self) -> f64 {
        self.cell_m
    }

    /// The cell in which a point lies; `None`: it lies outside.
    #[must_use]
    pub fn cell_at(&self, [x_m, y_m]: [f64; 2]) -> Option<u16> {
        let column = libm::floor((x_m - self.from_m[0]) / self.cell_m);
        let row = libm::floor((y_m - self.from_m[1]) / self.cell_m);
        let is_within = (0.0..f64::from(self.columns)).contains(&column)
            && (0.0..f64::from(self.rows)).contains(&row);
        if is_within { self.cell_in(column as i32, row as i32) } else { None }
    }

    /// The middle of a cell (m).
    #[must_use]
    pub fn centre_m(&self, cell: u16) -> [f64; 2] {
        let (column, row) = self.place(cell);
        [
            self.from_m[0] + self.cell_m * (f64::from(column) + 0.5),
            self.from_m[1] + self.cell_m * (f64::from(row) + 0.5),
        ]
    }

    /// Column and row of a cell.
    #[must_use]
    pub fn place(&self, cell: u16) -> (i32, i32) {
        (i32::from(cell) % self.columns, i32::from(cell) / self.columns)
    }

    /// The cell in this column and row, if there is one.
    #[must_use]
    pub fn cell_in(&self, column: i32, row: i32) -> Option<u16> {
        let is_within = (0..self.columns).contains(&column) && (0..self.rows).contains(&row);
        is_within.then(|| (row * self.columns + column) as u16)
    }

    /// Those that share a side with a cell.
    pub fn beside(&self, cell: u16) -> impl Iterator<Item = u16> + use<> {
        let (column, row) = self.place(cell);
        let grid = *self;
        [(1, 0), (0, 1), (-1, 0), (0, -1)]
            .into_iter()
            .filter_map(move |(right, up)| grid.cell_in(column + right, row + up))
    }

    /// Which cells are solid: those through which a wall goes, and those that an obstacle reaches into, whatever their
    /// heights.
    ///
    /// A cell holds its southern and western sides. A wall that only touches a corner is not in the cell.
    #[must_use]
    pub fn solid(&self, site: &Site, moves: impl Fn(usize) -> bool) -> Vec<bool> {
        let mut solid = vec![false; self.n_cells()];
        for wall in &site.wall {
            self.fill(&mut solid, bounds(wall.from_m, wall.to_m), |low_m, high_m| {
                goes_through(wall, low_m, high_m)
            });
        }
        for (_, obstacle) in site.obstacle.iter().enumerate().filter(|(index, _)| !moves(*index)) {
            let [x_m, y_m] = obstacle.centre_m;
            let r_m = obstacle.radius_m;
            let around = bounds([x_m - r_m, y_m - r_m], [x_m + r_m, y_m + r_m]);
            self.fill(&mut solid, around, |low_m, high_m| reaches_into(obstacle, low_m, high_m));
        }
        solid
    }

    /// Sets those cells of a part of the grid of which `is_in`, given two corners, holds.
    fn fill(
        &self,
        solid: &mut [bool],
        [low_m, high_m]: [[f64; 2]; 2],
        is_in: impl Fn([f64; 2], [f64; 2]) -> bool,
    ) {
        let index = |axis: usize, at_m: f64, n: i32| {
            let index = libm::floor((at_m - self.from_m[axis]) / self.cell_m);
            index.clamp(-1.0, f64::from(n)) as i32
        };
        for row in index(1, low_m[1], self.rows)..=index(1, high_m[1], self.rows) {
            for column in index(0, low_m[0], self.columns)..=index(0, high_m[0], self.columns) {
                let Some(cell) = self.cell_in(column, row) else { continue };
                let [x_m, y_m] = self.centre_m(cell);
                let half_m = 0.5 * self.cell_m;
                if is_in([x_m - half_m, y_m - half_m], [x_m + half_m, y_m + half_m]) {
                    solid[usize::from(cell)] = true;
                }
            }
        }
    }

    /// Whether one cell is seen from the middle of another: no cell between them blocks sight. A line exactly through a corner
    /// is blocked where both cells beside it are.
    #[must_use]
    pub fn sees(&self, from: u16, to: u16, blocks: impl Fn(u16) -> bool) -> bool {
        let ((mut column, mut row), (to_column, to_row)) = (self.place(from), self.place(to));
        let (across, up) = ((to_column - column).abs(), (to_row - row).abs());
        let (right, north) = ((to_column - column).signum(), (to_row - row).signum());
        let is_blocked = |column, row| self.cell_in(column, row).is_none_or(&blocks);
        let (mut i, mut j) = (0, 0);
        loop {
            // Which side the line leaves the cell by: exact, in whole numbers.
            let (by_side, by_end) = ((1 + 2 * i) * up, (1 + 2 * j) * across);
            if by_side == by_end {
                if (column, row) != (to_column, to_row)
                    && is_blocked(column + right, row)
                    && is_blocked(column, row + north)
                {
                    return false;
                }
                (i, j) = (i + 1, j + 1);
                (column, row) = (column + right, row + north);
            } else if by_side < by_end {
                i += 1;
                column += right;
            } else {
                j += 1;
                row += north;
            }
            if across <= i && up <= j {
                return true;
            }
            if is_blocked(column, row) {
                return false;
            }
        }
    }

    /// The cells within a distance (m) between middles that are seen from a cell, itself included, by number.
    pub fn seen_from(
        &self,
        cell: u16,
        range_m: f64,
        mut visit: impl FnMut(u16),
        blocks: impl Fn(u16) -> bool,
    ) {
        let reach = libm::floor(range_m / self.cell_m);
        let reach_squared = (range_m / self.cell_m) * (range_m / self.cell_m);
        let reach = reach.min(f64::from(self.columns.max(self.rows))) as i32;
        let (column, row) = self.place(cell);
        for up in -reach..=reach {
            for right in -reach..=reach {
                let Some(other) = self.cell_in(column + right, row + up) else { continue };
                if f64::from(right * right + up * up) <= reach_squared
                    && (other == cell || self.sees(cell, other, &blocks))
                {
                    visit(other);
                }
            }
        }
    }
}

/// The least rectangle around two points, as two corners.
fn bounds(a_m: [f64; 2], b_m: [f64; 2]) -> [[f64; 2]; 2] {
    [
        std::array::from_fn(|axis| a_m[axis].min(b_m[axis])),
        std::array::from_fn(|axis| a_m[axis].max(b_m[axis])),
    ]
}

/// Whether a wall has some length within a cell (after Liang and Barsky 1984).
fn goes_through(wall: &Wall, low_m: [f64; 2], high_m: [f64; 2]) -> bool {
    let (mut enters, mut leaves) = (0.0_f64, 1.0_f64);
    for axis in 0..2 {
        let (begin_m, way_m) = (wall.from_m[axis], wall.to_m[axis] - wall.from_m[axis]);
        if way_m == 0.0 {
            if begin_m < low_m[axis] || high_m[axis] <= begin_m {
                return false;
            }
        } else {
            let (a, b) = ((low_m[axis] - begin_m) / way_m, (high_m[axis] - begin_m) / way_m);
            enters = enters.max(a.min(b));
            leaves = leaves.min(a.max(b));
        }
    }
    enters < leaves
}

fn reaches_into(obstacle: &Obstacle, low_m: [f64; 2], high_m: [f64; 2]) -> bool {
    let off_m: [f64; 2] = std::array::from_fn(|axis| {
        let centre_m = obstacle.centre_m[axis];
        centre_m - centre_m.clamp(low_m[axis], high_m[axis])
    });
    off_m[0] * off_m[0] + off_m[1] * off_m[1] < obstacle.radius_m * obstacle.radius_m
}

#[cfg(test)]
mod tests {
    use super::*;

    fn wall(from_m: [f64; 2], to_m: [f64; 2]) -> Wall {
        Wall { from_m, to_m, height_m: None, material: None }
    }

    /// A picture, north above: `#` is solid.
    fn picture(grid: &Grid, is_set: impl Fn(u16) -> bool) -> Vec<String> {
        let row = |row| {
            let cells = (0..grid.columns).map(move |column| grid.cell_in(column, row).unwrap());
            cells.map(|cell| if is_set(cell) { '#' } else { '.' }).collect()
        };
        (0..grid.rows).rev().map(row).collect()
    }

    #[test]
    fn walls_and_obstacles_fill_the_cells_they_lie_in() {
        let grid = Grid::new([0.0, 0.0], [6.0, 4.0], 1.0).unwrap();
        let site = Site {
            wall: vec![wall([2.0, 0.0], [2.0, 2.0]), wall([0.0, 2.0], [2.0, 4.0])],
            obstacle: vec![Obstacle {
                name: None,
                centre_m: [4.5, 2.5],
                radius_m: 0.6,
                height_m: None,
                material: None,
            }],
            ..Site::default()
        };
        let solid = grid.solid(&site, |_| false);
        let shown = picture(&grid, |cell| solid[usize::from(cell)]);
        assert_eq!(shown, [".#..#.", "#..###", "..#.#.", "..#..."]);
        assert!(grid.solid(&Site { wall: vec![], ..site }, |_| true).iter().all(|solid| !solid));
    }

    #[test]
    fn walls_block_sight_and_are_seen_themselves() {
        let grid = Grid::new([0.0, 0.0], [7.0, 5.0], 1.0).unwrap();
        let walls = [10, 17, 24];
        let eye = grid.cell_in(1, 0).unwrap();
        let mut seen = Vec::new();
        grid.seen_from(eye, 10.0, |cell| seen.push(cell), |cell| walls.contains(&cell));
        let shown = picture(&grid, |cell| seen.contains(&cell));
        // The wall, in the column of x = 3, leaves open the southern row, in which the eye is, and the northern one. Its own
        // northern end is hidden behind the middle of it.
        assert_eq!(shown, ["###....", "###....", "####...", "####..#", "#######"]);
    }

    #[test]
    fn sight_is_mutual() {
        let grid = Grid::new([0.0, 0.0], [9.0, 9.0], 1.0).unwrap();
        let blocks = |cell: u16| u32::from(cell).wrapping_mul(2_654_435_761) >> 29 & 3 == 0;
        for a in 0..81 {
            for b in (0..81).filter(|&b| b != a) {
                assert_eq!(grid.sees(a, b, blocks), grid.sees(b, a, blocks), "{a} {b}");
            }
        }
    }

    #[test]
    fn a_point_lies_in_the_cell_whose_middle_is_nearest() {
        let grid = Grid::new([-3.0, 1.0], [1.0, 2.2], 0.4).unwrap();
        assert_eq!(grid.n_cells(), 30);
        for cell in 0..30 {
            assert_eq!(grid.cell_at(grid.centre_m(cell)), Some(cell));
        }
        assert_eq!(grid.cell_at([-3.1, 1.1]), None);
        assert_eq!(Grid::new([0.0, 0.0], [1000.0, 1000.0], 1.0), None);
    }
}
