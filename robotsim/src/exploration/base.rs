//! The base: the map that all parts come to, and the planner that sends robots to its frontiers.

use super::Settings;
use super::grid::Cell;
use super::message::{Order, Report};
use super::way::{Costs, corners};
use proto::ids::AgentId;
use proto::time::SimTime;
use serde::{Deserialize, Serialize};

/// What the base knows.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Base {
    map: Vec<Cell>,
    robots: Vec<Known>,
    /// It has learnt something since it planned last.
    has_news: bool,
    /// No robot that it knows of can get to anything unknown.
    is_out_of_frontiers: bool,
}

/// A robot as the base knows it.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
struct Known {
    /// Where it said that it stands.
    cell: Option<u16>,
    /// When it was heard last, and when it had said that.
    heard: SimTime,
    said: SimTime,
    /// Number of the last order that it said to have taken.
    taken: u16,
    /// All parts up to this number have come, and of the 16 after it these.
    received: u16,
    later: u16,
    /// It has reported a part since it was answered.
    waits: bool,
    /// Number of its last order, the path that it was sent, and when; `None`: it was not sent yet.
    order: u16,
    way: Vec<u16>,
    sent: Option<SimTime>,
    /// The frontier to which it is sent.
    goal: Option<u16>,
}

/// A robot that was not heard for so many times as long as it waits before it says something again is lost.
const LOST_AFTER: u64 = 4;

impl Base {
    pub(super) fn new(n_cells: usize, n_robots: usize) -> Self {
        Self {
            map: vec![Cell::Unknown; n_cells],
            robots: vec![Known::default(); n_robots],
            has_news: true,
            is_out_of_frontiers: false,
        }
    }

    /// Puts a cell on the map. Returns whether it is new there.
    pub(super) fn put(&mut self, cell: u16, what: Cell) -> bool {
        let place = &mut self.map[usize::from(cell)];
        let is_new = *place == Cell::Unknown;
        if is_new {
            *place = what;
            self.has_news = true;
        }
        is_new
    }

    /// A robot's report has come, which it made at `said`. `visit` receives the cells that are new on the map.
    pub(super) fn handle_report(
        &mut self,
        from: AgentId,
        report: &Report,
        said: SimTime,
        now: SimTime,
        mut visit: impl FnMut(u16),
    ) {
        let n_cells = self.map.len();
        for run in &report.runs {
            let what = if run.is_occupied { Cell::Occupied } else { Cell::Free };
            for cell in run.cells().filter(|&cell| usize::from(cell) < n_cells) {
                if self.put(cell, what) {
                    visit(cell);
                }
            }
        }
        let known = &mut self.robots[from.index()];
        known.heard = now;
        // Who has nothing to do may have been taken for lost.
        self.has_news |= known.goal.is_none();
        if report.part != 0 {
            known.waits = true;
            known.receive(report.part);
        }
        // Reports overtake each other: where it was before is no news.
        if known.cell.is_none() || known.said <= said {
            known.said = said;
            if usize::from(report.cell) < n_cells
                && (known.cell, known.taken) != (Some(report.cell), report.order)
            {
                known.cell = Some(report.cell);
                known.taken = report.order;
                self.has_news = true;
            }
        }
    }

    /// When what was last heard of a robot had been said; `None`: nothing was heard.
    pub(super) fn said(&self, robot: AgentId) -> Option<SimTime> {
        let known = &self.robots[robot.index()];
        known.cell.map(|_| known.said)
    }

    /// Whether it has heard of a robot.
    pub(super) fn knows(&self, robot: AgentId) -> bool {
        self.robots[robot.index()].cell.is_some()
    }

    /// No robot that it knows of can get to anything unknown.
    pub(super) fn is_out_of_frontiers(&self) -> bool {
        self.is_out_of_frontiers
    }

    /// Sends robots to frontiers: free cells beside unknown ones (Yamauchi 1997).
    ///
    /// Of all robots without a goal and all frontiers that no other robot will see from its goal, the pair with the shortest way comes
    /// first (Burgard et al. 2005, with the way as the only cost), then the next. A goal is kept until the robot is there, or it
    /// is none any more.
    pub(super) fn plan(&mut self, settings: &Settings, now: SimTime) {
        let is_lost = |known: &Known| known.heard + LOST_AFTER * settings.retry_after < now;
        for known in &mut self.robots {
            if known.goal.is_some() && is_lost(known) {
                known.goal = None;
                self.has_news = true;
            }
        }
        if !std::mem::take(&mut self.has_news) {
            return;
        }
        let grid = &settings.grid;
        let map = &self.map;
        let mapped = |cell: u16| map[usize::from(cell)];
        let is_frontier = |cell: u16| {
            mapped(cell) == Cell::Free
                && grid.beside(cell).any(|beside| mapped(beside) == Cell::Unknown)
        };
        for known in &mut self.robots {
            let is_there = known.goal.is_some() && known.cell == known.goal;
            if is_there || known.goal.is_some_and(|goal| !is_frontier(goal)) {
                known.goal = None;
            }
        }
        let frontiers: Vec<u16> = (0..map.len() as u32)
            .map(|cell| cell as u16)
            .filter(|&cell| is_frontier(cell))
            .collect();
        let will_see = |goal: u16, cell: u16| {
            let [ax_m, ay_m] = grid.centre_m(goal);
            let [bx_m, by_m] = grid.centre_m(cell);
            goal == cell
                || libm::hypot(ax_m - bx_m, ay_m - by_m) <= settings.range_m
                    && grid.sees(goal, cell, |between| mapped(between) == Cell::Occupied)
        };
        let mut open = frontiers.clone();
        for goal in self.robots.iter().filter_map(|known| known.goal) {
            open.retain(|&cell| !will_see(goal, cell));
        }
        let is_free = |cell: u16| mapped(cell) == Cell::Free;
        let mut idle: Vec<(usize, u16, Costs)> = Vec::new();
        // Whoever is lost may come back, and go where the others cannot.
        let is_in_question =
            |known: &Known| known.goal.is_some() || is_lost(known) && !frontiers.is_empty();
        let mut is_any_reachable =
            self.robots.iter().filter(|known| known.cell.is_some()).any(is_in_question);
        for (robot, known) in self.robots.iter().enumerate() {
            let Some(cell) = known.cell.filter(|_| !is_lost(known)) else { continue };
            if known.goal.is_none() {
                let costs = Costs::from(grid, cell, is_free);
                is_any_reachable |= frontiers.iter().any(|&cell| costs.to(cell).is_some());
                idle.push((robot, cell, costs));
            }
        }
        self.is_out_of_frontiers = !is_any_reachable;
        while let Some((_, place, goal)) = nearest(&idle, &open) {
            let (robot, cell, costs) = idle.swap_remove(place);
            open.retain(|&cell| !will_see(goal, cell));
            let way = costs.way(goal);
            self.robots[robot].send_to(goal, told(settings, cell, &way));
        }
        // A robot that has come to the end of the part of a longer path that fitted into its order.
        for known in &mut self.robots {
            if let (Some(goal), Some(cell)) = (known.goal, known.cell)
                && known.taken == known.order
                && known.way.last() == Some(&cell)
            {
                let way = Costs::from(grid, cell, is_free).way(goal);
                known.send_to(goal, told(settings, cell, &way));
            }
        }
    }

    /// What there is to say to a robot: that parts have come, or a way that it has not taken.
    pub(super) fn poll_order(
        &mut self,
        settings: &Settings,
        robot: AgentId,
        now: SimTime,
    ) -> Option<Order> {
        let known = &mut self.robots[robot.index()];
        let is_due = known.sent.is_none_or(|sent| sent + settings.retry_after <= now);
        let has_order = known.taken != known.order && is_due;
        if !has_order && !known.waits {
            return None;
        }
        known.waits = false;
        if known.taken != known.order {
            known.sent = Some(now);
        }
        let corners = if known.taken == known.order { Vec::new() } else { known.way.clone() };
        Some(Order { received: known.received, later: known.later, number: known.order, corners })
    }
}

impl Known {
    /// A part has come.
    fn receive(&mut self, part: u16) {
        let after = part.wrapping_sub(self.received);
        if part <= self.received || 17 <= after {
            return;
        }
        self.later |= 1 << (after - 1);
        while self.later & 1 == 1 {
            self.later >>= 1;
            self.received += 1;
        }
    }

    fn send_to(&mut self, goal: u16, way: Vec<u16>) {
        self.goal = Some(goal);
        self.way = way;
        self.order = self.order.wrapping_add(1);
        self.sent = None;
    }
}

/// As much of a path as fits into a message: where it begins, turns and ends.
fn told(settings: &Settings, from: u16, way: &[u16]) -> Vec<u16> {
    let turns = corners(&settings.grid, from, way);
    let mut told = vec![from];
    told.extend(turns.into_iter().take(settings.corners_max() - 1));
    told
}

/// The cheapest way of any robot to any frontier: its cost, the robot's place among those that are idle, and the frontier. Of
/// equal ones the robot with the lowest number, then the first frontier.
fn nearest(idle: &[(usize, u16, Costs)], open: &[u16]) -> Option<(u32, usize, u16)> {
    let mut best: Option<((u32, usize, u16), usize)> = None;
    for (place, (robot, _, costs)) in idle.iter().enumerate() {
        for &cell in open {
            let Some(cost) = costs.to(cell) else { continue };
            let key = (cost, *robot, cell);
            if best.is_none_or(|(least, _)| key < least) {
                best = Some((key, place));
            }
        }
    }
    best.map(|((cost, _, cell), place)| (cost, place, cell))
}

#[cfg(test)]
mod tests {
    use super::super::grid::Grid;
    use super::super::message::Run;
    use super::*;
    use proto::time::SimDuration;

    fn at(ns: u64) -> SimTime {
        SimTime::from_ns(ns)
    }

    fn settings() -> Settings {
        Settings {
            grid: Grid::new([0.0, 0.0], [20.0, 3.0], 1.0).unwrap(),
            base: AgentId(0),
            range_m: 3.0,
            speed_mps: 1.0,
            report_every: SimDuration::from_ns(1_000),
            retry_after: SimDuration::from_ns(5_000),
            return_after: None,
            message_bytes: 40,
        }
    }

    fn report(part: u16, order: u16, cell: u16, runs: &[(u16, u8)]) -> Report {
        let run = |&(first, n)| Run { first, n, is_occupied: false };
        Report { part, order, cell, runs: runs.iter().map(run).collect() }
    }

    /// The columns 5 to 14 of a corridor are known, two robots stand at its quarters.
    fn corridor() -> (Settings, Base) {
        let settings = settings();
        let mut base = Base::new(settings.grid.n_cells(), 3);
        base.handle_report(
            AgentId(1),
            &report(1, 0, 27, &[(5, 10), (25, 10), (45, 10)]),
            at(0),
            at(0),
            |_| (),
        );
        base.handle_report(AgentId(2), &report(1, 0, 32, &[]), at(0), at(0), |_| ());
        (settings, base)
    }

    #[test]
    fn each_robot_is_sent_to_the_frontier_that_is_nearest_and_no_two_to_one() {
        let (settings, mut base) = corridor();
        base.plan(&settings, at(10));
        let goals: Vec<_> = base.robots.iter().map(|known| known.goal).collect();
        assert_eq!(goals, [None, Some(25), Some(34)], "the ends of the middle row");
        let order = base.poll_order(&settings, AgentId(1), at(10)).unwrap();
        assert_eq!((order.received, order.number, order.corners), (1, 1, vec![27, 25]));
        assert_eq!(base.poll_order(&settings, AgentId(1), at(11)), None, "it is on its way");
        // With one end explored both could go to the other; the nearer does, and its fellow stays.
        for cell in [0, 20, 40] {
            for cell in cell..cell + 5 {
                base.put(cell, Cell::Free);
            }
        }
        base.plan(&settings, at(20));
        assert_eq!(base.robots[1].goal, None);
        assert_eq!(base.robots[2].goal, Some(34));
        assert!(!base.is_out_of_frontiers());
    }

    #[test]
    fn an_order_that_was_not_taken_is_sent_again() {
        let (settings, mut base) = corridor();
        base.plan(&settings, at(0));
        let first = base.poll_order(&settings, AgentId(2), at(0)).unwrap();
        assert_eq!(base.poll_order(&settings, AgentId(2), at(4_999)), None);
        assert_eq!(base.poll_order(&settings, AgentId(2), at(5_000)), Some(first));
        base.handle_report(AgentId(2), &report(0, 1, 33, &[]), at(6_000), at(6_000), |_| ());
        assert_eq!(base.poll_order(&settings, AgentId(2), at(20_000)), None);
    }

    #[test]
    fn parts_that_come_in_any_order_are_told_of() {
        let (settings, mut base) = corridor();
        for part in [4, 2, 7, 2] {
            base.handle_report(AgentId(1), &report(part, 0, 27, &[]), at(1), at(1), |_| ());
        }
        let order = base.poll_order(&settings, AgentId(1), at(1)).unwrap();
        assert_eq!((order.received, order.later), (2, 0b1_0010));
        base.handle_report(AgentId(1), &report(3, 0, 27, &[]), at(2), at(2), |_| ());
        let order = base.poll_order(&settings, AgentId(1), at(2)).unwrap();
        assert_eq!((order.received, order.later), (4, 0b100));
    }

    #[test]
    fn the_goal_of_a_robot_that_is_not_heard_any_more_is_for_others() {
        let (settings, mut base) = corridor();
        base.plan(&settings, at(0));
        base.handle_report(AgentId(2), &report(0, 1, 34, &[]), at(19_000), at(19_000), |_| ());
        for row in [15, 35, 55] {
            for cell in row..row + 5 {
                base.put(cell, Cell::Free);
            }
        }
        base.plan(&settings, at(20_000));
        assert_eq!((base.robots[1].goal, base.robots[2].goal), (Some(25), None));
        base.plan(&settings, at(20_001));
        assert_eq!((base.robots[1].goal, base.robots[2].goal), (None, Some(25)));
    }

    #[test]
    fn a_way_that_a_message_cannot_hold_is_told_in_parts() {
        let mut settings = settings();
        settings.message_bytes = 11;
        let mut base = Base::new(60, 2);
        // A free way from 0 that turns twice: along the south, up at column 4, along the north to column 8.
        for cell in [0, 1, 2, 3, 4, 24, 44, 45, 46, 47, 48] {
            base.put(cell, Cell::Free);
        }
        for cell in (0..60).filter(|&cell| cell != 49) {
            // Those that are free stay so.
            base.put(cell, Cell::Occupied);
        }
        base.handle_report(AgentId(1), &report(0, 0, 0, &[]), at(0), at(0), |_| ());
        base.plan(&settings, at(0));
        assert_eq!(base.poll_order(&settings, AgentId(1), at(0)).unwrap().corners, [0, 4]);
        base.handle_report(AgentId(1), &report(0, 1, 4, &[]), at(1), at(1), |_| ());
        base.plan(&settings, at(1));
        assert_eq!(base.poll_order(&settings, AgentId(1), at(1)).unwrap().corners, [4, 44]);
        base.handle_report(AgentId(1), &report(0, 2, 44, &[]), at(2), at(2), |_| ());
        base.plan(&settings, at(2));
        assert_eq!(base.poll_order(&settings, AgentId(1), at(2)).unwrap().corners, [44, 48]);
        assert_eq!(base.robots[1].goal, Some(48));
    }
}
