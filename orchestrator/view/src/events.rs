//! What happened in a step, found by comparing states with those of the step before.

use crate::view::{Event, EventKind};
use metrics::Task;
use metrics::contacts::Contacts;
use metrics::period::Period;
use metrics::solids::Solids;
use proto::site::Site;
use proto::types::{AgentCommand, AgentOrder, Bitmap, MoteCommand, MoteOrder, MoteStates};
use std::collections::BTreeMap;

/// A robot that has heard nobody for so many steps is isolated.
pub(crate) const ISOLATED_STEPS: u32 = 20;
/// A run has at most so many events of a kind in its overview.
const MOST_OF_A_KIND: u32 = 10_000;
/// No preferred parent.
const NO_PARENT: u32 = u32::MAX;

/// Finds events.
#[derive(Clone, Debug, Default)]
pub(crate) struct EventFinder {
    alive: Option<Bitmap>,
    motes: Option<MoteStates>,
    /// Of each robot: for how many steps it has heard nobody. `None`: it never heard anybody.
    silent_steps: Vec<Option<u32>>,
    has_formed: bool,
    is_complete: bool,
    empty: Vec<bool>,
    task: Task,
    contacts: Contacts,
    /// `None`: nothing to collide with, or robots of unknown size.
    solids: Option<Solids>,
    n_of_kind: [u32; 16],
    found: Vec<Event>,
}

impl EventFinder {
    /// Begins with who is there in the beginning.
    ///
    /// * `task`, `site`: what robots can collide with, and how large they are.
    pub(crate) fn new(task: Task, site: &Site, alive: &Bitmap, motes: Option<&MoteStates>) -> Self {
        Self {
            alive: Some(alive.clone()),
            motes: motes.cloned(),
            solids: Solids::from_site(site, &task),
            task,
            ..Self::default()
        }
    }

    /// Adds what happened in a period.
    pub(crate) fn add(&mut self, period: &Period<'_>) {
        self.robots(period);
        self.motes(period);
        self.neighbours(period);
        self.batteries(period);
        self.collisions(period);
        let formed = period.formation.is_some_and(|formation| formation.formed_ns.is_some());
        if formed && !std::mem::replace(&mut self.has_formed, formed) {
            self.push(period, EventKind::Formed, None, "the network has formed".to_owned());
        }
        if period.task_complete && !self.is_complete {
            self.push(period, EventKind::Task, None, "the task is complete".to_owned());
        }
        self.is_complete = period.task_complete;
    }

    /// Adds orders that took effect in a period.
    pub(crate) fn orders(
        &mut self,
        period: &Period<'_>,
        motes: &[MoteCommand],
        robots: &[AgentCommand],
    ) {
        let mut jammed: BTreeMap<&str, Vec<u32>> = BTreeMap::new();
        for MoteCommand { source, order } in motes {
            let (agent, what) = match order {
                MoteOrder::Kill(mote) => (Some(*mote), format!("switch off mote {mote}")),
                MoteOrder::Revive(mote) => (Some(*mote), format!("switch on mote {mote}")),
                MoteOrder::Add(mote) => (Some(*mote), format!("add mote {mote}")),
                MoteOrder::Jam { channel, .. } => {
                    jammed.entry(source).or_default().push(*channel);
                    continue;
                }
                // Traffic of the robots themselves: their payloads, not an event.
                MoteOrder::Send { .. } => continue,
            };
            self.push(period, EventKind::Order, agent, format!("order of {source}: {what}"));
        }
        for (source, channels) in jammed {
            let text = match channels[..] {
                [channel] => format!("order of {source}: jam channel {channel}"),
                _ => format!("order of {source}: jam {} channels", channels.len()),
            };
            self.push(period, EventKind::Order, None, text);
        }
        for AgentCommand { source, agent, order } in robots {
            let what = match order {
                AgentOrder::Velocity(_) => "hold a velocity",
                AgentOrder::Waypoint(_) => "go to a waypoint",
                AgentOrder::Release => "follow its own controller",
            };
            let text = format!("order of {source}: robot {agent} is to {what}");
            self.push(period, EventKind::Order, Some(*agent), text);
        }
    }

    /// Takes the events found since they were last taken.
    pub(crate) fn take(&mut self) -> Vec<Event> {
        std::mem::take(&mut self.found)
    }

    fn push(&mut self, period: &Period<'_>, kind: EventKind, agent: Option<u32>, text: String) {
        let count = &mut self.n_of_kind[kind as usize];
        *count += 1;
        if *count <= MOST_OF_A_KIND {
            self.found.push(Event {
                step: period.step,
                time_ns: period.time_ns,
                kind: kind.into(),
                agent,
                text,
            });
        }
    }

    fn robots(&mut self, period: &Period<'_>) {
        let alive = &period.states.alive;
        let Some(before) = self.alive.take() else {
            self.alive = Some(alive.clone());
            return;
        };
        if before != *alive {
            for agent in 0..alive.len() {
                let (kind, what) = match (before.get(agent), alive.get(agent)) {
                    (true, false) => (EventKind::Death, "is lost"),
                    (false, true) => (EventKind::Birth, "is there"),
                    _ => continue,
                };
                self.push(period, kind, Some(agent as u32), format!("robot {agent} {what}"));
            }
        }
        self.alive = Some(alive.clone());
    }

    fn motes(&mut self, period: &Period<'_>) {
        let motes = period.motes;
        let Some(before) = self.motes.take() else {
            self.motes = Some(motes.clone());
            return;
        };
        for mote in 0..motes.alive.len() {
            let agent = Some(mote as u32);
            match (before.alive.get(mote), motes.alive.get(mote)) {
                (true, false) => {
                    let text = format!("the radio of robot {mote} is off");
                    self.push(period, EventKind::Death, agent, text);
                }
                (false, true) => {
                    let text = format!("the radio of robot {mote} is on");
                    self.push(period, EventKind::Birth, agent, text);
                }
                _ => {}
            }
            if let (Some(joined_before), Some(joined)) = (&before.joined, &motes.joined) {
                match (joined_before.get(mote), joined.get(mote)) {
                    (false, true) => {
                        let text = format!("mote {mote} has joined the network");
                        self.push(period, EventKind::Join, agent, text);
                    }
                    (true, false) => {
                        let text = format!("mote {mote} has left the network");
                        self.push(period, EventKind::Leave, agent, text);
                    }
                    _ => {}
                }
            }
            let parent_of = |motes: &MoteStates| motes.parent.get(mote).copied();
            if let (Some(from), Some(to)) = (parent_of(&before), parent_of(motes))
                && from != to
            {
                let text = match (from, to) {
                    (_, NO_PARENT) => format!("mote {mote} has lost its parent {from}"),
                    (NO_PARENT, _) => format!("mote {mote} has chosen parent {to}"),
                    _ => format!("mote {mote} has changed its parent from {from} to {to}"),
                };
                self.push(period, EventKind::Parent, agent, text);
            }
        }
        self.motes = Some(motes.clone());
    }

    /// Robots that heard somebody and now hear nobody for long, or hear somebody again.
    fn neighbours(&mut self, period: &Period<'_>) {
        if period.held {
            return;
        }
        self.silent_steps.resize(period.states.len(), None);
        for agent in 0..period.states.len() {
            let agent_u32 = Some(agent as u32);
            let hears = 0 < period.counts.neighbours[agent];
            let silent = self.silent_steps[agent];
            if hears {
                if silent.is_some_and(|steps| ISOLATED_STEPS <= steps) {
                    let text = format!("robot {agent} hears others again");
                    self.push(period, EventKind::Reached, agent_u32, text);
                }
                self.silent_steps[agent] = Some(0);
            } else if let Some(steps) = silent
                && period.states.alive.get(agent)
            {
                self.silent_steps[agent] = Some(steps.saturating_add(1));
                if steps + 1 == ISOLATED_STEPS {
                    let text = format!("robot {agent} has heard nobody for {ISOLATED_STEPS} steps");
                    self.push(period, EventKind::Isolated, agent_u32, text);
                }
            }
        }
    }

    /// As the summary's `collisions` and `site_collisions` count them.
    fn collisions(&mut self, period: &Period<'_>) {
        let mut met = Vec::new();
        if let Some(solids) = &mut self.solids {
            solids.add(&self.task, period, |agent, n| met.extend((0..n).map(|_| agent as u32)));
        }
        for agent in met {
            let text = format!("robot {agent} hits a wall or an obstacle");
            self.push(period, EventKind::SiteCollision, Some(agent), text);
        }
        let alive: Vec<usize> = period.states.alive.iter_ones().collect();
        if period.held || alive.is_empty() || self.task.diameter_m.is_none() {
            return;
        }
        for (one, other) in self.contacts.add(&self.task, period.states, &alive) {
            let text = format!("robot {one} collides with robot {other}");
            self.push(period, EventKind::Collision, Some(one), text);
        }
    }

    fn batteries(&mut self, period: &Period<'_>) {
        let column = period.statistics.and_then(|statistics| statistics.column("battery_empty"));
        let Some(column) = column else { return };
        self.empty.resize(column.values.len(), false);
        for mote in 0..column.values.len() {
            let is_empty = column.values[mote] == 1.0;
            if is_empty && !self.empty[mote] {
                let text = format!("the battery of mote {mote} is empty");
                self.push(period, EventKind::Death, Some(mote as u32), text);
            }
            self.empty[mote] = is_empty;
        }
    }
}
