//! How far the exploration is. The definitions stand in `docs/metrics.md`.

use super::Moment;
use super::grid::Grid;
use super::way::Costs;
use proto::ids::AgentId;
use proto::time::{SimDuration, SimTime};
use proto::types::TaskFigure;
use serde::{Deserialize, Serialize};

/// What is counted.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Tally {
    /// By cell: robots can get there.
    is_reachable: Vec<bool>,
    n_reachable: u64,
    /// By cell: when a robot saw it first. [`SimTime::NEVER`]: none has.
    seen: Vec<SimTime>,
    n_seen: u64,
    n_mapped: u64,
    /// Of all cells on the map, those that robots cannot get to included: how many, and the time from sight to map (ns).
    n_on_map: u64,
    delay_ns: u128,
    begun: SimTime,
    /// How long after the beginning so much of what robots can get to was on the map.
    mapped_90: Option<SimDuration>,
    /// Age of what the base has heard, times the length of the step, summed over steps and robots (ns²), and those lengths (ns).
    age_ns2: u128,
    age_over_ns: u128,
    n_reports: u64,
    n_again: u64,
    n_orders: u64,
}

/// A share of the area that counts as most of it.
const MOST: f64 = 0.9;

impl Tally {
    /// Nothing is seen yet; robots begin in these cells.
    pub(super) fn new(grid: &Grid, solid: &[bool], starts: &[u16]) -> Self {
        let mut is_reachable = vec![false; grid.n_cells()];
        for &start in starts {
            // All that is reached from a place already reached has been found from there.
            if is_reachable[usize::from(start)] {
                continue;
            }
            let costs = Costs::from(grid, start, |cell| !solid[usize::from(cell)]);
            for (cell, is_reachable) in (0..).zip(&mut is_reachable) {
                *is_reachable |= costs.to(cell).is_some() && !solid[usize::from(cell)];
            }
        }
        let n_reachable = is_reachable.iter().filter(|&&reachable| reachable).count() as u64;
        Self {
            is_reachable,
            n_reachable,
            seen: vec![SimTime::NEVER; grid.n_cells()],
            n_seen: 0,
            n_mapped: 0,
            n_on_map: 0,
            delay_ns: 0,
            begun: SimTime::START,
            mapped_90: None,
            age_ns2: 0,
            age_over_ns: 0,
            n_reports: 0,
            n_again: 0,
            n_orders: 0,
        }
    }

    /// The robots are free to move.
    pub(super) fn begin(&mut self, now: SimTime) {
        self.begun = now;
    }

    /// A robot has seen a cell that it did not know.
    pub(super) fn see(&mut self, cell: u16, now: SimTime) {
        let place = usize::from(cell);
        if self.seen[place] == SimTime::NEVER {
            self.seen[place] = now;
            self.n_seen += u64::from(self.is_reachable[place]);
        }
    }

    /// A cell is on the map.
    pub(super) fn map(&mut self, cell: u16, now: SimTime) {
        let place = usize::from(cell);
        self.n_on_map += 1;
        self.delay_ns += u128::from(now.saturating_since(self.seen[place]).ns());
        self.n_mapped += u64::from(self.is_reachable[place]);
        if self.mapped_90.is_none() && MOST * self.n_reachable as f64 <= self.n_mapped as f64 {
            self.mapped_90 = Some(now - self.begun);
        }
    }

    pub(super) fn count_reports(&mut self, n: u64, n_again: u64) {
        self.n_reports += n;
        self.n_again += n_again;
    }

    pub(super) fn count_order(&mut self) {
        self.n_orders += 1;
    }

    /// A step: how old is what the base has heard of each robot? `said` says when that was said.
    pub(super) fn add(
        &mut self,
        moment: &Moment<'_>,
        base: AgentId,
        said: impl Fn(AgentId) -> Option<SimTime>,
    ) {
        let step_ns = u128::from((moment.until - moment.from).ns());
        let agents = moment.states.alive.iter_ones().map(AgentId::from_index);
        for agent in agents.filter(|agent| *agent != base) {
            let said = said(agent).unwrap_or(self.begun).max(self.begun);
            self.age_ns2 += step_ns * u128::from(moment.from.saturating_since(said).ns());
            self.age_over_ns += step_ns;
        }
    }

    /// All that is known.
    pub(super) fn figures(&self) -> Vec<TaskFigure> {
        let ratio = |n: u64, of: u64| (of != 0).then(|| n as f64 / of as f64);
        let mean_s = |sum: u128, n: u128| (n != 0).then(|| sum as f64 / n as f64 / 1e9);
        [
            ("mapped_ratio", ratio(self.n_mapped, self.n_reachable)),
            ("seen_ratio", ratio(self.n_seen, self.n_reachable)),
            ("mapped_90_s", self.mapped_90.map(SimDuration::seconds)),
            ("map_delay_s", mean_s(self.delay_ns, u128::from(self.n_on_map))),
            ("map_age_s", mean_s(self.age_ns2, self.age_over_ns)),
            ("map_reports", Some(self.n_reports as f64)),
            ("map_reports_repeated", Some(self.n_again as f64)),
            ("waypoint_orders", Some(self.n_orders as f64)),
        ]
        .into_iter()
        .filter_map(|(name, value)| Some(TaskFigure { name: name.to_owned(), value: value? }))
        .collect()
    }
}
