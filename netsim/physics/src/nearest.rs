//! Who is near whom: a uniform grid over the plane, and the k nearest neighbours found with it.

use super::end::End;
use proto::ids::MoteId;

/// Points sorted into square cells.
///
/// A query returns a superset of what lies within a distance; who asks decides by the distance itself. So a grid never
/// changes a result, it only spares looking at what is far away.
#[derive(Clone, Debug, Default)]
pub struct Grid {
    cell_m: f64,
    /// Cell of each point and the point's index, sorted.
    entries: Vec<(u64, u32)>,
    /// Where each cell's entries begin, if points lie so close together that all cells between them can be listed.
    table: Option<Table>,
}

/// The cells of a rectangle, row after row, with where each one's entries begin; at the end, where the last one's end.
#[derive(Clone, Debug)]
struct Table {
    left: i64,
    bottom: i64,
    n_columns: i64,
    n_rows: i64,
    begins: Vec<u32>,
}

/// Cells are numbered up to this far from the origin; what lies farther counts to the outermost cell, which keeps
/// neighbouring cells neighbours.
const OUTERMOST: f64 = (1 << 30) as f64;

impl Grid {
    /// Sorts points into cells of `cell_m`, greater than 0.
    pub fn build(&mut self, cell_m: f64, points: impl Iterator<Item = [f64; 2]>) {
        self.cell_m = cell_m;
        self.entries.clear();
        let column = |x: f64| column(x, cell_m);
        let cells: Vec<(i64, i64)> = points.map(|[x, y]| (column(x), column(y))).collect();
        self.table = Table::covering(&cells);
        match &self.table {
            Some(table) => table.sort(&cells, &mut self.entries),
            None => {
                self.entries.extend(cells.iter().zip(0..).map(|(&(x, y), i)| (key(x, y), i)));
                self.entries.sort_unstable();
            }
        }
    }

    /// Sorts agents into cells of which those in the middle hold about `per_cell`.
    pub fn build_for(&mut self, agents: &[End], per_cell: usize) {
        // The spread of the middle half: a few agents far out must not make the cells useless.
        let extent = |axis: usize| {
            let mut values: Vec<f64> = agents.iter().map(|end| end.position_m[axis]).collect();
            values.sort_unstable_by(f64::total_cmp);
            match values.len() {
                0 => 1.0,
                n => (values[n * 3 / 4] - values[n / 4]).max(1e-3),
            }
        };
        let area_m2 = 4.0 * extent(0) * extent(1);
        let cell_m = (area_m2 * per_cell.max(1) as f64 / agents.len().max(1) as f64).sqrt();
        self.build(cell_m, agents.iter().map(|end| [end.position_m[0], end.position_m[1]]));
    }

    /// Indices of the points in the cells that touch the square of half side `reach_m` around (x, y): at least all
    /// within `reach_m`, in no particular order.
    pub fn around(&self, [x, y]: [f64; 2], reach_m: f64) -> impl Iterator<Item = u32> + '_ {
        self.in_box([x - reach_m, y - reach_m], [x + reach_m, y + reach_m])
    }

    /// Indices of the points in the cells that touch a box, and possibly of others.
    pub fn in_box(&self, low: [f64; 2], high: [f64; 2]) -> impl Iterator<Item = u32> + '_ {
        let (left, right) = (self.column(low[0]), self.column(high[0]));
        let (bottom, top) = (self.column(low[1]), self.column(high[1]));
        // More rows than points: look at the points.
        let is_tall = (self.entries.len() as u64) < top.abs_diff(bottom);
        let all = if is_tall { &self.entries[..] } else { &[] };
        let rows = if is_tall { bottom..bottom } else { bottom..top + 1 };
        all.iter()
            .map(|&(_, index)| index)
            .chain(rows.flat_map(move |row| self.of_row(row, left, right)))
    }

    /// Indices of the points of a row of cells, from the column `left` to `right`.
    fn of_row(&self, row: i64, left: i64, right: i64) -> impl Iterator<Item = u32> + '_ {
        let entries = match &self.table {
            Some(table) => &self.entries[table.of_row(row, left, right)],
            None => {
                let from = self.entries.partition_point(|&(cell, _)| cell < key(left, row));
                let last = key(right, row);
                let rest = &self.entries[from..];
                &rest[..rest.iter().take_while(|&&(cell, _)| cell <= last).count()]
            }
        };
        entries.iter().map(|&(_, index)| index)
    }

    /// How many pairs of points lie in the same or in neighbouring cells, each counted from both ends: what a search
    /// within one cell's width looks at.
    #[must_use]
    pub fn n_candidates(&self) -> usize {
        let mut total = 0;
        for cell in self.entries.chunk_by(|a, b| a.0 == b.0) {
            let (column, row) = unkey(cell[0].0);
            for row in row - 1..=row + 1 {
                let from = self.entries.partition_point(|&(c, _)| c < key(column - 1, row));
                let to = self.entries.partition_point(|&(c, _)| c <= key(column + 1, row));
                total += cell.len() * (to - from);
            }
        }
        total
    }

    fn column(&self, x: f64) -> i64 {
        column(x, self.cell_m)
    }
}

impl Table {
    /// Of these cells. `None`: most of the rectangle around them would be empty.
    fn covering(cells: &[(i64, i64)]) -> Option<Self> {
        let &(x, y) = cells.first()?;
        let mut bounds = [x, x, y, y];
        for &(x, y) in cells {
            bounds = [bounds[0].min(x), bounds[1].max(x), bounds[2].min(y), bounds[3].max(y)];
        }
        let [left, right, bottom, top] = bounds;
        let (n_columns, n_rows) = (right - left + 1, top - bottom + 1);
        let n_cells = n_columns.saturating_mul(n_rows);
        if SPARSEST * (cells.len() as i64) < n_cells {
            return None;
        }
        let mut table = Self { left, bottom, n_columns, n_rows, begins: Vec::new() };
        table.begins = vec![0; n_cells as usize + 1];
        for &cell in cells {
            let place = table.place(cell);
            table.begins[place + 1] += 1;
        }
        let mut sum = 0;
        for begin in &mut table.begins {
            sum += *begin;
            *begin = sum;
        }
        Some(table)
    }

    fn place(&self, (x, y): (i64, i64)) -> usize {
        ((y - self.bottom) * self.n_columns + x - self.left) as usize
    }

    /// Entries of these cells, sorted.
    fn sort(&self, cells: &[(i64, i64)], entries: &mut Vec<(u64, u32)>) {
        entries.resize(cells.len(), (0, 0));
        let mut next = self.begins.clone();
        for (&(x, y), index) in cells.iter().zip(0..) {
            let slot = &mut next[self.place((x, y))];
            entries[*slot as usize] = (key(x, y), index);
            *slot += 1;
        }
    }

    /// Where the entries of a row's cells stand, from the column `left` to `right`.
    fn of_row(&self, row: i64, left: i64, right: i64) -> std::ops::Range<usize> {
        let (left, right) = (left.max(self.left), right.min(self.left + self.n_columns - 1));
        if right < left || !(self.bottom..self.bottom + self.n_rows).contains(&row) {
            return 0..0;
        }
        let begin = |x: i64| self.place((x, row));
        self.begins[begin(left)] as usize..self.begins[begin(right) + 1] as usize
    }
}

/// Cells to a point above which they are not listed.
const SPARSEST: i64 = 8;

fn column(x: f64, cell_m: f64) -> i64 {
    (x / cell_m).floor().clamp(-OUTERMOST, OUTERMOST) as i64
}

/// Cells of a row stand side by side in the order of keys.
fn key(column: i64, row: i64) -> u64 {
    let shifted = |number: i64| (number + (1 << 31)) as u64;
    shifted(row) << 32 | shifted(column)
}

fn unkey(key: u64) -> (i64, i64) {
    let number = |part: u64| part as i64 - (1 << 31);
    (number(key & 0xffff_ffff), number(key >> 32))
}

/// The k nearest neighbours of every agent. Equal distances: the lower number is nearer.
#[derive(Clone, Debug)]
pub struct Nearest {
    /// Agents' numbers, ascending, and the place of each in `agents`.
    places: Vec<(MoteId, u32)>,
    /// Per place in `agents`, the places of its neighbours, nearest first.
    neighbours: Vec<Vec<u32>>,
    /// Per place, the square of the distance (m²) and the number of the last of them.
    last: Vec<Option<(f64, MoteId)>>,
}

impl Nearest {
    /// Finds the `k` nearest neighbours of every agent.
    #[must_use]
    pub fn find(agents: &[End], k: usize) -> Self {
        let mut places: Vec<(MoteId, u32)> = agents.iter().map(|end| end.id).zip(0..).collect();
        places.sort_unstable();
        // Too few agents for a grid to pay: all pairs.
        let grid = (64 <= agents.len() && 8 * k <= agents.len()).then(|| {
            let mut grid = Grid::default();
            grid.build_for(agents, k);
            grid
        });
        let neighbours: Vec<Vec<u32>> = agents
            .iter()
            .map(|agent| match &grid {
                Some(grid) => nearest_by_rings(agents, grid, agent, k),
                None => nearest_of_all(agents, agent, k),
            })
            .collect();
        let last = neighbours
            .iter()
            .zip(agents)
            .map(|(neighbours, agent)| {
                neighbours.last().map(|&place| {
                    let other = &agents[place as usize];
                    (agent.distance_squared_m2(other), other.id)
                })
            })
            .collect();
        Self { places, neighbours, last }
    }

    /// Whether `other` is among the nearest of the agent with number `of`. `None`: that agent is not known.
    #[must_use]
    pub fn is_among(&self, of: &End, other: &End) -> Option<bool> {
        let found = self.places.binary_search_by_key(&of.id, |&(id, _)| id).ok()?;
        let place = self.places[found].1 as usize;
        Some(self.last[place].is_some_and(|(distance, id)| {
            (of.distance_squared_m2(other), other.id) <= (distance, id)
        }))
    }

    /// Places, in the list the search was made over, of the nearest of the agent at `place`.
    #[must_use]
    pub fn neighbours_of(&self, place: usize) -> &[u32] {
        &self.neighbours[place]
    }
}

fn nearest_of_all(agents: &[End], agent: &End, k: usize) -> Vec<u32> {
    first_k(agents, agent, k, (0..agents.len() as u32).collect())
}

fn first_k(agents: &[End], agent: &End, k: usize, mut places: Vec<u32>) -> Vec<u32> {
    places.retain(|&place| agents[place as usize].id != agent.id);
    let order = |place: &u32| {
        let other = &agents[*place as usize];
        (agent.distance_squared_m2(other), other.id)
    };
    let compare = |a: &u32, b: &u32| {
        let (a, b) = (order(a), order(b));
        a.0.total_cmp(&b.0).then(a.1.cmp(&b.1))
    };
    if k < places.len() {
        if k == 0 {
            return Vec::new();
        }
        places.select_nth_unstable_by(k - 1, compare);
        places.truncate(k);
    }
    places.sort_unstable_by(compare);
    places
}

/// Looks within a square that doubles until the k-th nearest found lies within its half side.
fn nearest_by_rings(agents: &[End], grid: &Grid, agent: &End, k: usize) -> Vec<u32> {
    let centre = [agent.position_m[0], agent.position_m[1]];
    let mut reach_m = grid.cell_m;
    for _ in 0..6 {
        let found = first_k(agents, agent, k, grid.around(centre, reach_m).collect());
        if found.len() == k {
            let last = found
                .last()
                .map_or(0.0, |&place| agent.distance_squared_m2(&agents[place as usize]));
            if last <= reach_m * reach_m {
                return found;
            }
        }
        reach_m *= 2.0;
    }
    nearest_of_all(agents, agent, k)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn agents() -> impl Strategy<Value = Vec<End>> {
        let near = prop::array::uniform3(-20i32..20).prop_map(|p| p.map(|x| f64::from(x) / 4.0));
        let far = prop::array::uniform3(-1e9..1e9f64);
        prop::collection::vec(prop_oneof![20 => near, 1 => far], 1..200).prop_map(|positions| {
            positions
                .into_iter()
                .zip(0..)
                .map(|(position, id)| End::new(MoteId(id), position))
                .collect()
        })
    }

    proptest! {
        #[test]
        fn a_grid_finds_at_least_all_within_reach(agents in agents(), reach_m in 0.1..9.0f64) {
            let mut grid = Grid::default();
            grid.build(reach_m, agents.iter().map(|end| [end.position_m[0], end.position_m[1]]));
            for agent in &agents {
                let centre = [agent.position_m[0], agent.position_m[1]];
                let mut found: Vec<u32> = grid.around(centre, reach_m).collect();
                found.sort_unstable();
                let n = found.len();
                found.dedup();
                prop_assert_eq!(n, found.len(), "twice the same");
                for other in &agents {
                    if agent.distance_squared_m2(other) <= reach_m * reach_m {
                        prop_assert!(found.binary_search(&other.id.0).is_ok());
                    }
                }
            }
        }

        #[test]
        fn rings_and_all_pairs_find_the_same_neighbours(agents in agents(), k in 0usize..8) {
            let nearest = Nearest::find(&agents, k);
            for (place, agent) in agents.iter().enumerate() {
                prop_assert_eq!(nearest.neighbours_of(place), nearest_of_all(&agents, agent, k));
            }
        }
    }

    #[test]
    fn close_together_or_far_apart_points_stand_in_the_order_of_their_cells() {
        let mut state = 1_u32;
        let mut next = || {
            // xorshift (Marsaglia 2003).
            state ^= state << 13;
            state ^= state >> 17;
            state ^= state << 5;
            f64::from(state % 1000)
        };
        for (spread_m, is_listed) in [(0.03, true), (30.0, false)] {
            let points: Vec<[f64; 2]> =
                (0..300).map(|_| [0; 2].map(|_| spread_m * next())).collect();
            let mut grid = Grid::default();
            grid.build(1.0, points.iter().copied());
            assert_eq!(grid.table.is_some(), is_listed);
            let cell = |[x, y]: [f64; 2]| key(column(x, 1.0), column(y, 1.0));
            let mut sorted: Vec<(u64, u32)> =
                points.iter().map(|&point| cell(point)).zip(0..).collect();
            sorted.sort_unstable();
            assert_eq!(grid.entries, sorted);
        }
    }

    #[test]
    fn of_two_equally_far_the_lower_number_is_nearer() {
        let agents = [
            End::new(MoteId(0), [0.0; 3]),
            End::new(MoteId(1), [1.0, 0.0, 0.0]),
            End::new(MoteId(2), [-1.0, 0.0, 0.0]),
        ];
        let nearest = Nearest::find(&agents, 1);
        assert_eq!(nearest.is_among(&agents[0], &agents[1]), Some(true));
        assert_eq!(nearest.is_among(&agents[0], &agents[2]), Some(false));
    }
}
