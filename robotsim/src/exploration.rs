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
use proto::ids::AgentId;
use proto::site::Site;
use proto::time::{SimDuration, SimTime};
use proto::types::{AgentMessage, AgentStates, Deliveries, TaskFigure};
use serde::{Deserialize, Serialize};
use tally::Tally;

/// What the controller is configured with.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// The area in cells.
    pub grid: Grid,
    /// The robot to which maps are sent and which sends the others to places; it stays where it is.
    pub base: AgentId,
    /// How far a robot sees (m).
    pub range_m: f64,
    /// How fast it goes (m/s).
    pub speed_mps: f64,
    /// How often robots report, and the base answers.
    pub report_every: SimDuration,
    /// After this time without an answer a message is sent again.
    pub retry_after: SimDuration,
    /// After this time without a word from the base a robot that waits for one goes back towards where it began. `None`: never.
    pub return_after: Option<SimDuration>,
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
    /// By robot: when it reports next, and when the base answers it next. Empty before the first step.
    due: Vec<[SimTime; 2]>,
    /// Where each robot goes (m).
    aims_m: Vec<Option<[f64; 2]>>,
    is_done: bool,
}

/// What a step of the explorers is made of.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Moment<'a> {
    /// When the step begins and ends.
    pub(crate) from: SimTime,
    pub(crate) until: SimTime,
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
        let starts: Vec<u16> =
            AgentId::first(n).filter_map(|agent| cell_of(grid, states, agent)).collect();
        let tally = Tally::new(grid, &solid, &starts);
        Self {
            solid,
            explorers: vec![Explorer::new(grid.n_cells()); n],
            base: Base::new(grid.n_cells(), n),
            tally,
            due: Vec::new(),
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
            && (self.due.is_empty() || self.due.len() == n_robots)
    }

    /// The point (m) to which a robot goes, if anywhere.
    #[must_use]
    pub fn aim_m(&self, agent: AgentId) -> Option<[f64; 2]> {
        self.aims_m[agent.index()]
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
        let now = moment.from;
        let n = moment.states.len();
        if self.due.is_empty() {
            // Spread over the time between two reports, so that not all speak at once.
            let phase = |place: u64| now + settings.report_every * place / n as u64;
            self.due = (0..n as u64).map(|place| [phase(place); 2]).collect();
            self.tally.begin(now);
        }
        self.look(settings, moment);
        if let (Source::Heard, Some(deliveries)) = (moment.source, moment.deliveries) {
            self.read(settings, moment, deliveries);
        }
        self.base.plan(settings, now);
        let mut messages = Vec::new();
        let believed = |agent| cell_of(&settings.grid, moment.believed, agent);
        for agent in AgentId::first(n).filter(|agent| moment.states.alive.get(agent.index())) {
            if agent == settings.base {
                continue;
            }
            match moment.source {
                Source::Heard => {
                    let base = moment.states.alive.get(settings.base.index());
                    if self.is_due(settings, agent, 0, now)
                        && let Some(cell) = believed(agent)
                    {
                        let (reports, n_again) =
                            self.explorers[agent.index()].poll_reports(settings, cell, now);
                        self.tally.count_reports(reports.len() as u64, n_again);
                        let send = |report: Report| message(agent, settings.base, report.encode());
                        messages.extend(reports.into_iter().map(send));
                    }
                    if base
                        && self.is_due(settings, agent, 1, now)
                        && let Some(order) = self.base.poll_order(settings, agent, now)
                    {
                        self.tally.count_order();
                        messages.push(message(settings.base, agent, order.encode()));
                    }
                }
                Source::Truth => {
                    if let Some(cell) = believed(agent) {
                        self.tell_at_once(settings, agent, cell, now);
                    }
                }
            }
        }
        for agent in 0..n {
            let [x_m, y_m, _] = moment.believed.position_m(agent);
            self.aims_m[agent] = self.explorers[agent].aim_m(&settings.grid, [x_m, y_m]);
        }
        let is_alive =
            |agent: &AgentId| moment.states.alive.get(agent.index()) && *agent != settings.base;
        self.is_done = self.base.is_out_of_frontiers()
            && AgentId::first(n).filter(is_alive).all(|agent| {
                self.explorers[agent.index()].has_told_all() && self.base.knows(agent)
            });
        let said = |agent| self.base.said(agent);
        self.tally.add(moment, settings.base, said);
        messages
    }

    /// Everyone looks around.
    fn look(&mut self, settings: &Settings, moment: &Moment<'_>) {
        let now = moment.from;
        let grid = &settings.grid;
        for agent in AgentId::first(moment.states.len()) {
            let Some(cell) = cell_of(grid, moment.states, agent) else { continue };
            if !moment.states.alive.get(agent.index()) {
                continue;
            }
            let (base, tally, solid) = (&mut self.base, &mut self.tally, &self.solid);
            self.explorers[agent.index()].look(grid, solid, settings.range_m, cell, |seen| {
                tally.see(seen, now);
                // What the base sees itself is on its map at once.
                let what = if solid[usize::from(seen)] { Cell::Occupied } else { Cell::Free };
                if agent == settings.base && base.put(seen, what) {
                    tally.map(seen, now);
                }
            });
        }
    }

    /// Everyone reads what was delivered.
    fn read(&mut self, settings: &Settings, moment: &Moment<'_>, deliveries: &Deliveries) {
        let sent = &deliveries.transmissions;
        let now = moment.from;
        let payloads: Vec<&[u8]> = sent.payloads.iter().collect();
        if moment.states.alive.get(settings.base.index()) {
            for index in deliveries.heard_by(settings.base.index()) {
                if let Some(report) = Report::decode(payloads[index]) {
                    let said = SimTime::from_ns(sent.sent_ns[index]);
                    self.take_report(AgentId(sent.sender[index]), &report, said, now);
                }
            }
        }
        let others = AgentId::first(moment.states.len()).filter(|agent| *agent != settings.base);
        for agent in others {
            let Some(cell) = cell_of(&settings.grid, moment.believed, agent) else { continue };
            if !moment.states.alive.get(agent.index()) {
                continue;
            }
            let explorer = &mut self.explorers[agent.index()];
            for index in deliveries.heard_by(agent.index()) {
                let is_from_base = AgentId(sent.sender[index]) == settings.base;
                if let Some(order) = Order::decode(payloads[index]).filter(|_| is_from_base) {
                    explorer.handle_order(&settings.grid, cell, now, &order);
                }
            }
            explorer.come_back(settings, cell, now);
        }
    }

    fn take_report(&mut self, from: AgentId, report: &Report, said: SimTime, now: SimTime) {
        let tally = &mut self.tally;
        self.base.handle_report(from, report, said, now, |cell| tally.map(cell, now));
    }

    /// The ideal baseline: what a robot has to say, and what the base has to say to it, is known at once.
    fn tell_at_once(&mut self, settings: &Settings, agent: AgentId, cell: u16, now: SimTime) {
        loop {
            let (reports, _) = self.explorers[agent.index()].poll_reports(settings, cell, now);
            if reports.is_empty() {
                break;
            }
            for report in reports {
                self.take_report(agent, &report, now, now);
            }
            self.answer(settings, agent, cell, now);
        }
        self.base.plan(settings, now);
        self.answer(settings, agent, cell, now);
    }

    fn answer(&mut self, settings: &Settings, agent: AgentId, cell: u16, now: SimTime) {
        if let Some(order) = self.base.poll_order(settings, agent, now) {
            self.explorers[agent.index()].handle_order(&settings.grid, cell, now, &order);
        }
    }

    /// Whether it is a robot's time to report (0), or the base's to answer it (1).
    fn is_due(&mut self, settings: &Settings, agent: AgentId, which: usize, now: SimTime) -> bool {
        let due = &mut self.due[agent.index()][which];
        let is_due = *due <= now;
        while *due <= now {
            *due += settings.report_every;
        }
        is_due
    }
}

/// The cell in which an agent is.
fn cell_of(grid: &Grid, states: &AgentStates, agent: AgentId) -> Option<u16> {
    let [x_m, y_m, _] = states.position_m(agent.index());
    grid.cell_at([x_m, y_m])
}

fn message(sender: AgentId, destination: AgentId, payload: bytes::Bytes) -> AgentMessage {
    AgentMessage { sender: sender.0, destination: destination.0, payload }
}
