//! A robot that explores: what it has seen and reported, and where it goes.

use super::Settings;
use super::grid::{Cell, Grid};
use super::message::{MAX_RUN, Order, Report, Run};
use super::way::{Costs, corners, straight};
use proto::time::SimTime;
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet, VecDeque};

/// What a robot knows and has to tell.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Explorer {
    map: Vec<Cell>,
    /// The cell from which it looked around last.
    looked_from: Option<u16>,
    /// Seen, and not reported yet.
    fresh: BTreeSet<u16>,
    /// Reported parts that are not known to have arrived, by number.
    parts: BTreeMap<u16, Part>,
    /// Number of the next part.
    next: u16,
    /// Number of the last order taken.
    order: u16,
    /// Where its way turns, the next corner first.
    way: VecDeque<u16>,
    /// The cell in which it began, and when it last heard the base, or began.
    heard: Option<(u16, SimTime)>,
    /// Its last report: cell and order, and when.
    told: Option<(u16, u16, SimTime)>,
}

/// A reported part of the map.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct Part {
    runs: Vec<Run>,
    told: SimTime,
}

/// Parts that may be on their way: as many as an order acknowledges.
const MAX_PARTS: usize = 16;

/// Parts in one report.
const MAX_AT_A_TIME: usize = 2;

impl Explorer {
    pub(super) fn new(n_cells: usize) -> Self {
        Self {
            map: vec![Cell::Unknown; n_cells],
            looked_from: None,
            fresh: BTreeSet::new(),
            parts: BTreeMap::new(),
            next: 1,
            order: 0,
            way: VecDeque::new(),
            heard: None,
            told: None,
        }
    }

    /// Looks around, if it stands in another cell than before. `visit` receives the cells that are new to it.
    pub(super) fn look(
        &mut self,
        grid: &Grid,
        solid: &[bool],
        range_m: f64,
        cell: u16,
        mut visit: impl FnMut(u16),
    ) {
        if self.looked_from.replace(cell) == Some(cell) {
            return;
        }
        let (map, fresh) = (&mut self.map, &mut self.fresh);
        let see = |seen: u16| {
            let place = usize::from(seen);
            if map[place] == Cell::Unknown {
                map[place] = if solid[place] { Cell::Occupied } else { Cell::Free };
                fresh.insert(seen);
                visit(seen);
            }
        };
        grid.seen_from(cell, range_m, see, |between| solid[usize::from(between)]);
    }

    /// Takes an order: parts that have arrived are not reported again, and a newer path replaces the one before.
    pub(super) fn handle_order(&mut self, grid: &Grid, cell: u16, now: SimTime, order: &Order) {
        let (began, _) = self.heard.unwrap_or((cell, now));
        self.heard = Some((began, now));
        self.parts.retain(|&part, _| {
            let after = part.wrapping_sub(order.received);
            let is_received = part <= order.received
                || (1..=16).contains(&after) && order.later >> (after - 1) & 1 == 1;
            !is_received
        });
        let ahead = order.number.wrapping_sub(self.order);
        if ahead == 0 || 0x8000 <= ahead {
            return;
        }
        self.order = order.number;
        self.way.clear();
        let Some((&begin, turns)) = order.corners.split_first() else { return };
        let Some(&goal) = order.corners.last() else { return };
        // The way begins where the base took it to be; back there leads its own trail, along which it has seen all.
        let told = swath(grid, begin, &straight(grid, begin, turns));
        let is_passable =
            |cell: u16| told.contains(&cell) || self.map[usize::from(cell)] == Cell::Free;
        let way = Costs::from(grid, cell, is_passable).way(goal);
        self.way = corners(grid, cell, &way).into();
    }

    /// Turns back to where it began, where there was a network, over cells that it has seen, if it is too long ago that it heard
    /// the base and it waits for a word: about what it has reported, or where to go.
    pub(super) fn come_back(&mut self, settings: &Settings, cell: u16, now: SimTime) {
        let Some(return_after) = settings.return_after else { return };
        let &mut (back, heard) = self.heard.get_or_insert((cell, now));
        let waits = self.way.is_empty() || !self.parts.is_empty();
        let is_there = cell == back || self.way.back() == Some(&back);
        if now < heard + return_after || !waits || is_there {
            return;
        }
        let grid = &settings.grid;
        let is_passable = |cell: u16| self.map[usize::from(cell)] == Cell::Free;
        let way = Costs::from(grid, cell, is_passable).way(back);
        self.way = corners(grid, cell, &way).into();
    }

    /// What it has to report: parts that are new or that it has waited for in vain, or else where it stands. `None` of it if nothing
    /// is new. The second number counts those among them that were reported before.
    pub(super) fn poll_reports(
        &mut self,
        settings: &Settings,
        cell: u16,
        now: SimTime,
    ) -> (Vec<Report>, u64) {
        let mut reports = Vec::new();
        let mut n_again = 0;
        let report = |part, runs| Report { part, order: self.order, cell, runs };
        let is_due = |part: &Part| part.told + settings.retry_after <= now;
        for (&number, part) in
            self.parts.iter_mut().filter(|(_, part)| is_due(part)).take(MAX_AT_A_TIME)
        {
            part.told = now;
            n_again += 1;
            reports.push(report(number, part.runs.clone()));
        }
        while reports.len() < MAX_AT_A_TIME && self.parts.len() < MAX_PARTS {
            let runs = take_runs(&mut self.fresh, &self.map, settings.runs_max());
            if runs.is_empty() {
                break;
            }
            reports.push(report(self.next, runs.clone()));
            self.parts.insert(self.next, Part { runs, told: now });
            self.next = self.next.wrapping_add(1);
        }
        let is_news = self.told.is_none_or(|(told_cell, told_order, told)| {
            (told_cell, told_order) != (cell, self.order) || told + settings.retry_after <= now
        });
        if reports.is_empty() && is_news {
            reports.push(report(0, Vec::new()));
        }
        if !reports.is_empty() {
            self.told = Some((cell, self.order, now));
        }
        (reports, n_again)
    }

    /// Nothing that it has seen is unknown to the base, as far as it knows.
    pub(super) fn has_told_all(&self) -> bool {
        self.fresh.is_empty() && self.parts.is_empty()
    }

    /// The point to which it goes now (m), if anywhere; a corner that it is within a tenth of a cell of is passed.
    pub(super) fn aim_m(&mut self, grid: &Grid, at_m: [f64; 2]) -> Option<[f64; 2]> {
        while let Some(&corner) = self.way.front() {
            let aim_m = grid.centre_m(corner);
            let off_m = libm::hypot(aim_m[0] - at_m[0], aim_m[1] - at_m[1]);
            if 0.1 * grid.cell_m() < off_m {
                return Some(aim_m);
            }
            self.way.pop_front();
        }
        None
    }
}

/// The cells of a way, and those beside its steps across corners: the base knows those as free, too.
fn swath(grid: &Grid, from: u16, way: &[u16]) -> BTreeSet<u16> {
    let mut cells = BTreeSet::from([from]);
    let mut last = from;
    for &cell in way {
        let ((column, row), (next_column, next_row)) = (grid.place(last), grid.place(cell));
        cells.extend(grid.cell_in(next_column, row));
        cells.extend(grid.cell_in(column, next_row));
        cells.insert(cell);
        last = cell;
    }
    cells
}

/// Takes cells that fit into so many runs out of those to report.
fn take_runs(fresh: &mut BTreeSet<u16>, map: &[Cell], n_max: usize) -> Vec<Run> {
    let mut runs: Vec<Run> = Vec::new();
    while let Some(&cell) = fresh.first() {
        let is_occupied = map[usize::from(cell)] == Cell::Occupied;
        let has_room = runs.len() < n_max;
        match runs.last_mut() {
            Some(run)
                if run.is_occupied == is_occupied
                    && run.n < MAX_RUN
                    && run.first.checked_add(u16::from(run.n)) == Some(cell) =>
            {
                run.n += 1;
            }
            _ if has_room => runs.push(Run { first: cell, n: 1, is_occupied }),
            _ => break,
        }
        fresh.pop_first();
    }
    runs
}

#[cfg(test)]
mod tests {
    use super::*;
    use proto::ids::AgentId;
    use proto::time::SimDuration;

    fn settings() -> Settings {
        Settings {
            grid: Grid::new([0.0, 0.0], [10.0, 10.0], 1.0).unwrap(),
            base: AgentId(0),
            range_m: 3.0,
            speed_mps: 1.0,
            report_every: SimDuration::from_ns(1_000),
            retry_after: SimDuration::from_ns(5_000),
            return_after: None,
            message_bytes: 16,
        }
    }

    fn order(received: u16, later: u16, number: u16, corners: &[u16]) -> Order {
        Order { received, later, number, corners: corners.to_vec() }
    }

    #[test]
    fn what_has_come_is_not_told_again_and_what_has_not_is() {
        let settings = settings();
        let grid = settings.grid;
        let mut robot = Explorer::new(grid.n_cells());
        let solid = vec![false; 100];
        let mut n_seen = 0;
        robot.look(&grid, &solid, settings.range_m, 55, |_| n_seen += 1);
        assert_eq!(n_seen, 29, "a disc of three cells");
        let mut told = Vec::new();
        for round in 0..3 {
            let (reports, n_again) =
                robot.poll_reports(&settings, 55, SimTime::from_ns(1_000 * round));
            assert_eq!(n_again, 0);
            told.extend(reports);
        }
        // Seven rows, three runs in a message.
        let parts: Vec<_> = told.iter().map(|report| (report.part, report.runs.len())).collect();
        assert_eq!(parts, [(1, 3), (2, 3), (3, 1)]);
        let cells: BTreeSet<u16> =
            told.iter().flat_map(|r| &r.runs).flat_map(|r| r.cells()).collect();
        assert_eq!(cells.len(), n_seen);
        // The first and the third came.
        robot.handle_order(&grid, 55, SimTime::START, &order(1, 0b10, 0, &[]));
        assert_eq!(robot.poll_reports(&settings, 55, SimTime::from_ns(4_000)), (vec![], 0));
        let (reports, n_again) = robot.poll_reports(&settings, 55, SimTime::from_ns(5_000));
        assert_eq!((reports[0].part, reports.len(), n_again), (2, 1, 1));
        assert!(!robot.has_told_all());
        robot.handle_order(&grid, 55, SimTime::START, &order(3, 0, 0, &[]));
        assert!(robot.has_told_all());
    }

    #[test]
    fn a_robot_that_went_on_finds_to_the_way_it_is_told() {
        let settings = settings();
        let grid = settings.grid;
        let mut robot = Explorer::new(grid.n_cells());
        let solid = vec![false; 100];
        for cell in 50..=53 {
            robot.look(&grid, &solid, 1.0, cell, |_| ());
        }
        // The base takes it to be in cell 50, and sends it from there to the north.
        robot.handle_order(&grid, 53, SimTime::START, &order(0, 0, 1, &[50, 90]));
        let mut at_m = grid.centre_m(53);
        let mut passed = BTreeSet::new();
        while let Some(aim_m) = robot.aim_m(&grid, at_m) {
            let (dx, dy) = (aim_m[0] - at_m[0], aim_m[1] - at_m[1]);
            let step = 0.05 / libm::hypot(dx, dy).max(0.05);
            at_m = [at_m[0] + step * dx, at_m[1] + step * dy];
            passed.insert(grid.cell_at(at_m).unwrap());
        }
        assert_eq!(grid.cell_at(at_m), Some(90));
        let known =
            |cell: u16| robot.map[usize::from(cell)] == Cell::Free || cell.is_multiple_of(10);
        assert!(passed.iter().all(|&cell| known(cell)), "{passed:?}");
        // Across corners of cells that it has not seen itself, too.
        robot.handle_order(&grid, 90, SimTime::START, &order(0, 0, 2, &[90, 45, 49]));
        assert!(robot.aim_m(&grid, at_m).is_some() && robot.way.back() == Some(&49));
        robot.way.clear();
        // An older order, or the same again, changes nothing.
        robot.handle_order(&grid, 90, SimTime::START, &order(0, 0, 1, &[90, 95]));
        robot.handle_order(&grid, 90, SimTime::START, &order(0, 0, 2, &[90, 95]));
        assert_eq!(robot.aim_m(&grid, at_m), None);
    }
}
