//! Exploration of rooms: robots map what they see, tell a base, and go where it sends them.
//!
//! | module | what |
//! |---|---|
//! | `grid` | the area in cells: which are solid, what is seen from where |
//! | `way` | ways over the grid |
//! | `message` | what robots and base say to each other |
//! | `explorer` | a robot: what it has seen and reported, where it goes |
//! | `base` | the base: the map that all parts come to, and who is sent where |
//! | `tally` | how far they are |
//!
//! Every message goes through the network as one more packet, from mote to mote, and is lost, late or out of order as any
//! other; with `knowledge = "truth"` they arrive at once, whatever the network does. A controller keeps nothing between
//! steps: what robots and base know is part of the swarm's state, and `crate::controller` reads from it where a robot
//! goes.

mod base;
mod explorer;
pub mod grid;
pub mod message;
mod tally;
mod way;

use crate::knowledge::Source;
use base::Base;
use explorer::Explorer;
use grid::{Cell, Grid};
use message::{CORNER_BYTES, HEADER_BYTES, Order, RUN_BYTES, Report};
use proto::site::Site;
use proto::types::{AgentMessage, AgentStates, Deliveries, TaskFigure};
use serde::{Deserialize, Serialize};
use tally::Tally;

/// What the controller is configured with.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// The area in cells.
    pub grid: Grid,
    /// The robot to which maps are sent and which sends the others to places; it stays where it is.
    pub base: usize,
    /// How far a robot sees (m).
    pub range_m: f64,
    /// How fast it goes (m/s).
    pub speed_mps: f64,
    /// How often robots report, and the base answers (ns).
    pub report_ns: u64,
    /// After this time (ns) without an answer a message is sent again.
    pub retry_ns: u64,
    /// After this time (ns) without a word from the base a robot that waits for one goes back towards where it began. `None`: never.
    pub return_ns: Option<u64>,
    /// Most octets of a message: room for a run of cells at least, and for a way with one corner.
    pub message_bytes: usize,
}

/// Least octets of a message: room for a run of cells, and for a way with one corner.
pub const MIN_MESSAGE_BYTES: usize = HEADER_BYTES + 2 * CORNER_BYTES;

impl Settings {
    /// Most runs in a report.
    fn runs_max(&self) -> usize {
        (self.message_bytes - HEADER_BYTES) / RUN_BYTES
    }

    /// Most cells of a way in an order, where it begins included.
    fn corners_max(&self) -> usize {
        (self.message_bytes - HEADER_BYTES) / CORNER_BYTES
    }
}

/// What the explorers and their base know, and how far they are.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct State {
    /// By cell: whether something solid is in it, in truth.
    solid: Vec<bool>,
    explorers: Vec<Explorer>,
    base: Base,
    tally: Tally,
    /// By robot: when it reports next, and when the base answers it next (ns). Empty before the first step.
    due_ns: Vec<[u64; 2]>,
    /// Where each robot goes (m).
    aims_m: Vec<Option<[f64; 2]>>,
    is_done: bool,
}

/// What a step of the explorers is made of.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Moment<'a> {
    /// Where the step begins and ends (ns).
    pub(crate) from_ns: u64,
    pub(crate) until_ns: u64,
    /// Where the robots are.
    pub(crate) states: &'a AgentStates,
    /// Where they take themselves to be.
    pub(crate) believed: &'a AgentStates,
    /// What was delivered.
    pub(crate) deliveries: Option<&'a Deliveries>,
    /// How what is known comes about.
    pub(crate) source: Source,
}

impl State {
    /// Nothing is known yet. `moves` says which obstacles of the site move: those are on no map.
    pub(crate) fn new(
        settings: &Settings,
        site: &Site,
        states: &AgentStates,
        moves: impl Fn(usize) -> bool,
    ) -> Self {
        let grid = &settings.grid;
        let n = states.len();
        let solid = grid.solid(site, moves);
        let starts: Vec<u16> = (0..n).filter_map(|agent| cell_of(grid, states, agent)).collect();
        let tally = Tally::new(grid, &solid, &starts);
        Self {
            solid,
            explorers: vec![Explorer::new(grid.n_cells()); n],
            base: Base::new(grid.n_cells(), n),
            tally,
            due_ns: Vec::new(),
            aims_m: vec![None; n],
            is_done: false,
        }
    }

    /// Whether it is a state of so many robots and cells.
    pub(crate) fn fits(&self, settings: &Settings, n_robots: usize) -> bool {
        let n_cells = settings.grid.n_cells();
        self.solid.len() == n_cells
            && self.explorers.len() == n_robots
            && self.aims_m.len() == n_robots
            && (self.due_ns.is_empty() || self.due_ns.len() == n_robots)
    }

    /// The point (m) to which a robot goes, if anywhere.
    #[must_use]
    pub fn aim_m(&self, agent: usize) -> Option<[f64; 2]> {
        self.aims_m[agent]
    }

    /// Nothing that robots can get to is unknown, and the base knows all that they have seen.
    #[must_use]
    pub fn is_done(&self) -> bool {
        self.is_done
    }

    /// How far they are.
    #[must_use]
    pub(crate) fn figures(&self) -> Vec<TaskFigure> {
        self.tally.figures()
    }

    /// Robots look around, read what has come, and say what there is to say. Returns what is to be sent.
    pub(crate) fn advance(
        &mut self,
        settings: &Settings,
        moment: &Moment<'_>,
    ) -> Vec<AgentMessage> {
        let now_ns = moment.from_ns;
        let n = moment.states.len();
        if self.due_ns.is_empty() {
            // Spread over the time between two reports, so that not all speak at once.
            let phase = |agent: usize| now_ns + settings.report_ns * agent as u64 / n as u64;
            self.due_ns = (0..n).map(|agent| [phase(agent); 2]).collect();
            self.tally.begin(now_ns);
        }
        self.look(settings, moment);
        if let (Source::Heard, Some(deliveries)) = (moment.source, moment.deliveries) {
            self.read(settings, moment, deliveries);
        }
        self.base.plan(settings, now_ns);
        let mut messages = Vec::new();
        let believed = |agent| cell_of(&settings.grid, moment.believed, agent);
        for agent in (0..n).filter(|&agent| moment.states.alive.get(agent)) {
            if agent == settings.base {
                continue;
            }
            match moment.source {
                Source::Heard => {
                    let base = moment.states.alive.get(settings.base);
                    if self.is_due(settings, agent, 0, now_ns)
                        && let Some(cell) = believed(agent)
                    {
                        let (reports, n_again) =
                            self.explorers[agent].poll_reports(settings, cell, now_ns);
                        self.tally.count_reports(reports.len() as u64, n_again);
                        let send = |report: Report| message(agent, settings.base, report.encode());
                        messages.extend(reports.into_iter().map(send));
                    }
                    if base
                        && self.is_due(settings, agent, 1, now_ns)
                        && let Some(order) = self.base.poll_order(settings, agent, now_ns)
                    {
                        self.tally.count_order();
                        messages.push(message(settings.base, agent, order.encode()));
                    }
                }
                Source::Truth => {
                    if let Some(cell) = believed(agent) {
                        self.tell_at_once(settings, agent, cell, now_ns);
                    }
                }
            }
        }
        for agent in 0..n {
            let [x_m, y_m, _] = moment.believed.position_m(agent);
            self.aims_m[agent] = self.explorers[agent].aim_m(&settings.grid, [x_m, y_m]);
        }
        let is_alive = |agent: &usize| moment.states.alive.get(*agent) && *agent != settings.base;
        self.is_done = self.base.is_out_of_frontiers()
            && (0..n)
                .filter(is_alive)
                .all(|agent| self.explorers[agent].has_told_all() && self.base.knows(agent));
        let said_ns = |agent| self.base.said_ns(agent);
        self.tally.add(moment, settings.base, said_ns);
        messages
    }

    /// Everyone looks around.
    fn look(&mut self, settings: &Settings, moment: &Moment<'_>) {
        let now_ns = moment.from_ns;
        let grid = &settings.grid;
        for agent in 0..moment.states.len() {
            let Some(cell) = cell_of(grid, moment.states, agent) else { continue };
            if !moment.states.alive.get(agent) {
                continue;
            }
            let (base, tally, solid) = (&mut self.base, &mut self.tally, &self.solid);
            self.explorers[agent].look(grid, solid, settings.range_m, cell, |seen| {
                tally.see(seen, now_ns);
                // What the base sees itself is on its map at once.
                let what = if solid[usize::from(seen)] { Cell::Occupied } else { Cell::Free };
                if agent == settings.base && base.put(seen, what) {
                    tally.map(seen, now_ns);
                }
            });
        }
    }

    /// Everyone reads what was delivered.
    fn read(&mut self, settings: &Settings, moment: &Moment<'_>, deliveries: &Deliveries) {
        let sent = &deliveries.transmissions;
        let now_ns = moment.from_ns;
        let payloads: Vec<&[u8]> = sent.payloads.iter().collect();
        if moment.states.alive.get(settings.base) {
            for index in deliveries.heard_by(settings.base) {
                if let Some(report) = Report::decode(payloads[index]) {
                    self.take_report(
                        sent.sender[index] as usize,
                        &report,
                        sent.sent_ns[index],
                        now_ns,
                    );
                }
            }
        }
        for agent in (0..moment.states.len()).filter(|&agent| agent != settings.base) {
            let Some(cell) = cell_of(&settings.grid, moment.believed, agent) else { continue };
            if !moment.states.alive.get(agent) {
                continue;
            }
            for index in deliveries.heard_by(agent) {
                let is_from_base = sent.sender[index] as usize == settings.base;
                if let Some(order) = Order::decode(payloads[index]).filter(|_| is_from_base) {
                    self.explorers[agent].handle_order(&settings.grid, cell, now_ns, &order);
                }
            }
            self.explorers[agent].come_back(settings, cell, now_ns);
        }
    }

    fn take_report(&mut self, from: usize, report: &Report, said_ns: u64, now_ns: u64) {
        let tally = &mut self.tally;
        self.base.handle_report(from, report, said_ns, now_ns, |cell| tally.map(cell, now_ns));
    }

    /// The ideal baseline: what a robot has to say, and what the base has to say to it, is known at once.
    fn tell_at_once(&mut self, settings: &Settings, agent: usize, cell: u16, now_ns: u64) {
        loop {
            let (reports, _) = self.explorers[agent].poll_reports(settings, cell, now_ns);
            if reports.is_empty() {
                break;
            }
            for report in reports {
                self.take_report(agent, &report, now_ns, now_ns);
            }
            self.answer(settings, agent, cell, now_ns);
        }
        self.base.plan(settings, now_ns);
        self.answer(settings, agent, cell, now_ns);
    }

    fn answer(&mut self, settings: &Settings, agent: usize, cell: u16, now_ns: u64) {
        if let Some(order) = self.base.poll_order(settings, agent, now_ns) {
            self.explorers[agent].handle_order(&settings.grid, cell, now_ns, &order);
        }
    }

    /// Whether it is a robot's time to report (0), or the base's to answer it (1).
    fn is_due(&mut self, settings: &Settings, agent: usize, which: usize, now_ns: u64) -> bool {
        let due_ns = &mut self.due_ns[agent][which];
        let is_due = *due_ns <= now_ns;
        while *due_ns <= now_ns {
            *due_ns += settings.report_ns;
        }
        is_due
    }
}

/// The cell in which an agent is.
fn cell_of(grid: &Grid, states: &AgentStates, agent: usize) -> Option<u16> {
    let [x_m, y_m, _] = states.position_m(agent);
    grid.cell_at([x_m, y_m])
}

fn message(sender: usize, destination: usize, payload: bytes::Bytes) -> AgentMessage {
    AgentMessage { sender: sender as u32, destination: destination as u32, payload }
}
