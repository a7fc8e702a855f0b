//! What each robot knows of the others.
//!
//! With `knowledge = "heard"` a robot knows what was delivered to it in the period that just ended and nothing else: the
//! contents of the frames and when they were sent. Of a sender heard more than once, the last frame counts. A robot has
//! no memory, unless it is given one: who was not heard in that period is not known. With `knowledge = "truth"` every robot is told the present
//! state of every other; no radio works like that, so it serves as the ideal baseline only.

use crate::exploration::message;
use crate::payload::{self, Motion};
use proto::config::{Choice, Section};
use proto::ids::AgentId;
use proto::time::{SimDuration, SimTime};
use proto::types::{AgentStates, Deliveries, Heard, NS_PER_S};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Where a robot's knowledge of the others comes from.
#[derive(Choice, Clone, Copy, Debug, PartialEq, Eq)]
pub enum Source {
    /// The messages delivered to it in the control period that just ended.
    Heard,
    /// The true state of all others at once: an ideal baseline without radio.
    Truth,
}

/// A robot as another knows it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Seen {
    /// Number of the robot that is known of.
    pub agent: AgentId,
    /// Of when the knowledge is.
    pub sent: SimTime,
    /// Where it was, and how it moved.
    pub motion: Motion,
    /// Received strength of the frame that carried it (dBm), where that was asked for.
    pub rssi_dbm: Option<f32>,
}

/// How long robots remember the states they have received.
#[derive(Clone, Copy, Debug, PartialEq, Section)]
pub struct Memory {
    /// Time for which a robot remembers another one after its last message (s).
    #[key(above = 0.0, most = 1e6)]
    pub keep_s: f64,
    /// Whether to extrapolate its position with its last known velocity; otherwise it is assumed to stay.
    #[key(default = true)]
    pub extrapolate: bool,
}

/// Whom one robot remembers: by agent, when it was known last, and what.
pub type Remembered = BTreeMap<AgentId, (SimTime, Seen)>;

impl Memory {
    /// Adds what is known at `now`, and forgets what is too old.
    pub fn take_up(&self, knowledge: &Knowledge<'_>, now: SimTime, all: &mut [Remembered]) {
        let keep = SimDuration::from_ns(libm::round(self.keep_s * NS_PER_S as f64) as u64);
        for (agent, remembered) in AgentId::first(all.len()).zip(all) {
            knowledge.for_each_known_to(agent, |seen| {
                remembered.insert(seen.agent, (now, *seen));
            });
            remembered.retain(|_, (known, _)| now - *known <= keep);
        }
    }
}

/// What a robot remembers, and how it reads it.
#[derive(Clone, Copy, Debug)]
struct Recollection<'a> {
    all: &'a [Remembered],
    extrapolate: bool,
    now: SimTime,
}

impl Recollection<'_> {
    fn for_each_known_to(&self, agent: AgentId, mut visit: impl FnMut(&Seen)) {
        for (known, seen) in self.all[agent.index()].values() {
            let mut seen = *seen;
            if self.extrapolate {
                // What was heard in a period was true at its end, which is when it came to be known.
                let age_s = (self.now - *known).seconds();
                let motion = &mut seen.motion;
                for (place, velocity) in motion.position_m.iter_mut().zip(motion.velocity_mps) {
                    *place += velocity * age_s;
                }
            }
            visit(&seen);
        }
    }
}

/// What all robots know at a moment.
#[derive(Debug)]
pub struct Knowledge<'a> {
    /// By transmission (heard) or by agent (truth). `None`: not readable, or not alive.
    seen: Vec<Option<Seen>>,
    /// Who knows which of them. `None`: everyone all.
    deliveries: Option<&'a Deliveries>,
    /// By receiver, where its strengths of frames begin. Empty: there are none.
    rssi_begins: Vec<usize>,
    /// Some sender was on the air more than once.
    repeated: bool,
    n_foreign: u64,
    /// In place of all this: what they remember.
    memory: Option<Recollection<'a>>,
}

impl<'a> Knowledge<'a> {
    /// What was heard. Payloads are read once per transmission, not once per delivery.
    #[must_use]
    pub fn heard(deliveries: Option<&'a Deliveries>, n_agents: usize) -> Self {
        let Some(deliveries) = deliveries else { return Self::nothing() };
        let transmissions = &deliveries.transmissions;
        let mut seen = Vec::with_capacity(transmissions.len());
        let mut on_air = vec![false; n_agents];
        let mut repeated = false;
        let mut n_foreign = 0;
        for ((&agent, &sent_ns), bytes) in transmissions
            .sender
            .iter()
            .zip(&transmissions.sent_ns)
            .zip(transmissions.payloads.iter())
        {
            let motion = payload::decode(bytes);
            n_foreign += u64::from(motion.is_none() && !message::is_message(bytes));
            seen.push(motion.map(|motion| Seen {
                agent: AgentId(agent),
                sent: SimTime::from_ns(sent_ns),
                motion,
                rssi_dbm: None,
            }));
            repeated |= std::mem::replace(&mut on_air[agent as usize], true);
        }
        let mut rssi_begins = Vec::new();
        if !deliveries.rssi_dbm.is_empty() {
            let mut begin = 0;
            rssi_begins.extend((0..n_agents).map(|agent| {
                let end = begin + deliveries.heard_by(agent).count();
                std::mem::replace(&mut begin, end)
            }));
        }
        Self { seen, deliveries: Some(deliveries), rssi_begins, repeated, n_foreign, memory: None }
    }

    /// The truth at `now`.
    #[must_use]
    pub fn truth(states: &AgentStates, now: SimTime) -> Self {
        let seen = (0..states.len())
            .map(|agent| {
                let motion = Motion {
                    position_m: states.position_m(agent),
                    velocity_mps: [
                        states.vx_mps[agent],
                        states.vy_mps[agent],
                        states.vz_mps[agent],
                    ],
                };
                let id = AgentId::from_index(agent);
                let seen = Seen { agent: id, sent: now, motion, rssi_dbm: None };
                states.alive.get(agent).then_some(seen)
            })
            .collect();
        Self { seen, ..Self::nothing() }
    }

    fn nothing() -> Self {
        Self {
            seen: Vec::new(),
            deliveries: None,
            rssi_begins: Vec::new(),
            repeated: false,
            n_foreign: 0,
            memory: None,
        }
    }

    /// What robots remember, in place of what they know by themselves.
    #[must_use]
    pub fn with_memory(self, memory: &Memory, all: &'a [Remembered], now: SimTime) -> Self {
        let memory = Recollection { all, extrapolate: memory.extrapolate, now };
        Self { memory: Some(memory), ..self }
    }

    /// Visits every robot that `agent` knows of, itself excepted, each once, in an order that is always the same.
    pub fn for_each_known_to(&self, agent: AgentId, mut visit: impl FnMut(&Seen)) {
        if let Some(memory) = &self.memory {
            memory.for_each_known_to(agent, visit);
            return;
        }
        let mut visit_other = |seen: &Seen| {
            if seen.agent != agent {
                visit(seen);
            }
        };
        let place = agent.index();
        match self.deliveries {
            None => self.seen.iter().flatten().for_each(visit_other),
            Some(deliveries) if !self.repeated && self.rssi_begins.is_empty() => deliveries
                .heard_by(place)
                .filter_map(|index| self.seen[index].as_ref())
                .for_each(visit_other),
            // The order in which others are visited is the same whether strengths are reported or not: sums depend on it.
            Some(deliveries) if !self.repeated => {
                let rssi_dbm = &deliveries.rssi_dbm[self.rssi_begins[place]..];
                for (index, &rssi_dbm) in deliveries.heard_by(place).zip(rssi_dbm) {
                    if let Some(seen) = &self.seen[index] {
                        visit_other(&Seen { rssi_dbm: Some(rssi_dbm), ..*seen });
                    }
                }
            }
            Some(deliveries) => {
                let rssi_dbm =
                    self.rssi_begins.get(place).map(|&begin| &deliveries.rssi_dbm[begin..]);
                // Transmissions are in order of time: of a sender, the largest index is the last frame.
                let mut latest: Vec<(AgentId, usize, usize)> = (0..)
                    .zip(deliveries.heard_by(place))
                    .filter_map(|(nth, index)| {
                        self.seen[index].map(|seen| (seen.agent, index, nth))
                    })
                    .collect();
                latest.sort_unstable();
                for (position, &(sender, index, nth)) in latest.iter().enumerate() {
                    let is_last = latest.get(position + 1).is_none_or(|next| next.0 != sender);
                    if let (true, Some(seen)) = (is_last, &self.seen[index]) {
                        visit_other(&Seen { rssi_dbm: rssi_dbm.map(|all| all[nth]), ..*seen });
                    }
                }
            }
        }
    }

    /// Whether anything at all could be known: somebody was on the air, or robots know the truth.
    #[must_use]
    pub fn is_any(&self) -> bool {
        !self.seen.is_empty()
            || self.memory.is_some_and(|memory| memory.all.iter().any(|known| !known.is_empty()))
    }

    /// Transmissions whose payload is not one of ours.
    #[must_use]
    pub fn n_foreign(&self) -> u64 {
        self.n_foreign
    }

    /// At most how many visits [`Self::for_each_known_to`] makes over all agents: the work that a controller has.
    #[must_use]
    pub fn n_visits_max(&self) -> usize {
        if let Some(memory) = &self.memory {
            return memory.all.iter().map(BTreeMap::len).sum();
        }
        match self.deliveries.map(|deliveries| &deliveries.heard) {
            None => self.seen.len() * self.seen.len(),
            Some(Heard::Lists { indices, .. }) => indices.len(),
            Some(Heard::Rows { bytes, .. }) => 8 * bytes.len(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proto::types::{Payloads, Transmissions};

    /// One frame per (sender, sent_ns, x_m), heard by agent 0; a frame without x_m is foreign.
    fn deliveries(frames: &[(u32, u64, Option<f64>)]) -> Deliveries {
        let mut lengths = Vec::new();
        let mut data = Vec::new();
        for (_, _, x_m) in frames {
            let before = data.len();
            match x_m {
                Some(x_m) => {
                    data.extend_from_slice(&x_m.to_le_bytes());
                    data.extend_from_slice(&[0; 40]);
                }
                None => data.extend_from_slice(b"hello"),
            }
            lengths.push((data.len() - before) as u32);
        }
        Deliveries {
            transmissions: Transmissions {
                sender: frames.iter().map(|frame| frame.0).collect(),
                sent_ns: frames.iter().map(|frame| frame.1).collect(),
                end_ns: frames.iter().map(|frame| frame.1 + 1).collect(),
                payloads: Payloads::new(lengths, data.into()).unwrap(),
                ..Transmissions::default()
            },
            heard: Heard::Lists {
                ends: vec![frames.len() as u32; 4],
                indices: (0..frames.len() as u32).collect(),
            },
            ..Deliveries::default()
        }
    }

    fn known_to_0(knowledge: &Knowledge<'_>) -> Vec<(u32, u64, f64)> {
        let mut known = Vec::new();
        knowledge.for_each_known_to(AgentId(0), |seen| {
            known.push((seen.agent.0, seen.sent.ns(), seen.motion.position_m[0]));
        });
        known
    }

    #[test]
    fn of_a_sender_heard_twice_the_last_frame_counts() {
        let deliveries = deliveries(&[(1, 10, Some(1.0)), (2, 20, Some(2.0)), (1, 30, Some(3.0))]);
        let knowledge = Knowledge::heard(Some(&deliveries), 4);
        assert_eq!(known_to_0(&knowledge), [(1, 30, 3.0), (2, 20, 2.0)]);
    }

    #[test]
    fn others_are_visited_in_the_same_order_whether_strengths_are_told_or_not() {
        let silent = deliveries(&[(3, 10, Some(1.0)), (1, 20, Some(2.0)), (2, 30, Some(3.0))]);
        let told = Deliveries { rssi_dbm: vec![-50.0; 3], ..silent.clone() };
        let expected = [(3, 10, 1.0), (1, 20, 2.0), (2, 30, 3.0)];
        for deliveries in [&silent, &told] {
            assert_eq!(known_to_0(&Knowledge::heard(Some(deliveries), 4)), expected);
        }
    }

    #[test]
    fn foreign_payloads_are_counted_and_hide_nothing() {
        let deliveries = deliveries(&[(1, 10, Some(1.0)), (1, 20, None), (3, 30, None)]);
        let knowledge = Knowledge::heard(Some(&deliveries), 4);
        assert_eq!(known_to_0(&knowledge), [(1, 10, 1.0)]);
        assert_eq!(knowledge.n_foreign(), 2);
    }

    #[test]
    fn nobody_learns_of_itself() {
        let deliveries = deliveries(&[(0, 10, Some(1.0)), (2, 20, Some(2.0))]);
        assert_eq!(known_to_0(&Knowledge::heard(Some(&deliveries), 4)), [(2, 20, 2.0)]);
        assert_eq!(
            known_to_0(&Knowledge::truth(&AgentStates::at_origin(2), SimTime::from_ns(5))),
            [(1, 5, 0.0)]
        );
    }

    #[test]
    fn before_the_first_period_nothing_is_known() {
        let knowledge = Knowledge::heard(None, 4);
        assert!(!knowledge.is_any());
        assert!(known_to_0(&knowledge).is_empty());
    }

    #[test]
    fn the_truth_leaves_out_those_that_do_not_exist() {
        let mut states = AgentStates::at_origin(3);
        states.alive.set(1, false);
        assert_eq!(known_to_0(&Knowledge::truth(&states, SimTime::START)), [(2, 0, 0.0)]);
    }
}
