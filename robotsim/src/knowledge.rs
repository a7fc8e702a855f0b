//! What each robot knows of the others.
//!
//! With `knowledge = "heard"` a robot knows what was delivered to it in the period that just ended and nothing else: the
//! contents of the frames and when they were sent. Of a sender heard more than once, the last frame counts. A robot has
//! no memory: who was not heard in that period is not known. With `knowledge = "truth"` every robot is told the present
//! state of every other; no radio works like that, so it serves as the ideal baseline only.

use crate::payload::{self, Motion};
use proto::types::{AgentStates, Deliveries, Heard};

/// Where a robot's knowledge of the others comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Source {
    /// From what it heard.
    Heard,
    /// From nowhere: it is told.
    Truth,
}

/// A robot as another knows it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Seen {
    /// Which robot.
    pub agent: u32,
    /// Of when the knowledge is (ns).
    pub sent_ns: u64,
    /// Where it was, and how it moved.
    pub motion: Motion,
}

/// What all robots know at a moment.
#[derive(Debug)]
pub struct Knowledge<'a> {
    /// By transmission (heard) or by agent (truth). `None`: not readable, or not alive.
    seen: Vec<Option<Seen>>,
    /// Who knows which of them. `None`: everyone all.
    deliveries: Option<&'a Deliveries>,
    /// Some sender was on the air more than once.
    repeated: bool,
    n_foreign: u64,
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
            n_foreign += u64::from(motion.is_none());
            seen.push(motion.map(|motion| Seen { agent, sent_ns, motion }));
            repeated |= std::mem::replace(&mut on_air[agent as usize], true);
        }
        Self { seen, deliveries: Some(deliveries), repeated, n_foreign }
    }

    /// The truth at `now_ns`.
    #[must_use]
    pub fn truth(states: &AgentStates, now_ns: u64) -> Self {
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
                let seen = Seen { agent: agent as u32, sent_ns: now_ns, motion };
                states.alive.get(agent).then_some(seen)
            })
            .collect();
        Self { seen, deliveries: None, repeated: false, n_foreign: 0 }
    }

    fn nothing() -> Self {
        Self { seen: Vec::new(), deliveries: None, repeated: false, n_foreign: 0 }
    }

    /// Visits every robot that `agent` knows of, itself excepted, each once, in an order that is always the same.
    pub fn for_each_known_to(&self, agent: usize, mut visit: impl FnMut(&Seen)) {
        let mut visit_other = |seen: &Seen| {
            if seen.agent as usize != agent {
                visit(seen);
            }
        };
        match self.deliveries {
            None => self.seen.iter().flatten().for_each(visit_other),
            Some(deliveries) if !self.repeated => deliveries
                .heard_by(agent)
                .filter_map(|index| self.seen[index].as_ref())
                .for_each(visit_other),
            Some(deliveries) => {
                // Transmissions are in order of time: of a sender, the largest index is the last frame.
                let mut latest: Vec<(u32, usize)> = deliveries
                    .heard_by(agent)
                    .filter_map(|index| self.seen[index].map(|seen| (seen.agent, index)))
                    .collect();
                latest.sort_unstable();
                for (position, &(sender, index)) in latest.iter().enumerate() {
                    let is_last = latest.get(position + 1).is_none_or(|next| next.0 != sender);
                    if let (true, Some(seen)) = (is_last, &self.seen[index]) {
                        visit_other(seen);
                    }
                }
            }
        }
    }

    /// Whether anything at all could be known: somebody was on the air, or the truth is told.
    #[must_use]
    pub fn is_any(&self) -> bool {
        !self.seen.is_empty()
    }

    /// Transmissions whose payload is not one of ours.
    #[must_use]
    pub fn n_foreign(&self) -> u64 {
        self.n_foreign
    }

    /// At most how many visits [`Self::for_each_known_to`] makes over all agents: the work that a controller has.
    #[must_use]
    pub fn n_visits_max(&self) -> usize {
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
        knowledge.for_each_known_to(0, |seen| {
            known.push((seen.agent, seen.sent_ns, seen.motion.position_m[0]));
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
        assert_eq!(known_to_0(&Knowledge::truth(&AgentStates::at_origin(2), 5)), [(1, 5, 0.0)]);
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
        assert_eq!(known_to_0(&Knowledge::truth(&states, 0)), [(2, 0, 0.0)]);
    }
}
