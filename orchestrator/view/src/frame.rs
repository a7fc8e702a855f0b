//! Frames: the state at the end of a step, and what was on the air since the frame before.

use crate::view;
use metrics::period::Period;
use proto::types::{AgentStates, Coupling, Frames, MovedObstacle, Packets};
use record::StepRecord;
use std::collections::BTreeMap;

/// Positions are drawn to one in so many parts of a metre, and signal strengths to one in so many of a decibel: numbers with few digits
/// compress well.
const PARTS_PER_M: f64 = 512.0;
const PARTS_PER_DB: f32 = 4.0;
const PARTS_PER_RAD: f64 = 128.0;
/// So many deliveries may wait to be counted by pair.
const MOST_UNMERGED: usize = 200_000;
/// A frame that covers many steps is given no further frames of the radio once it has so many.
const MOST_FRAMES: usize = 5000;

/// Gathers periods until a frame is taken.
#[derive(Clone, Debug)]
pub struct FrameBuilder {
    /// How many steps the positions that the network uses are older than the step it runs.
    positions_behind: u32,
    from_ns: u64,
    n_sent: Vec<u32>,
    deliveries: Vec<Delivery>,
    packets: Option<Packets>,
    frames: Option<Frames>,
    moved: BTreeMap<String, [f64; 2]>,
}

/// Deliveries from one robot to another.
#[derive(Clone, Copy, Debug)]
struct Delivery {
    sender: u32,
    receiver: u32,
    received: u32,
    step: u64,
    rssi_dbm: f32,
    hops: u32,
}

impl FrameBuilder {
    /// Begins where a run does.
    #[must_use]
    pub fn new(coupling: Coupling) -> Self {
        Self::after(coupling, 0)
    }

    /// Begins after a step that ended at `time_ns`.
    #[must_use]
    pub fn after(coupling: Coupling, time_ns: u64) -> Self {
        Self {
            positions_behind: u32::from(coupling != Coupling::Sequential),
            from_ns: time_ns,
            n_sent: Vec::new(),
            deliveries: Vec::new(),
            packets: None,
            frames: None,
            moved: BTreeMap::new(),
        }
    }

    /// With obstacles that moved before (m).
    #[must_use]
    pub(crate) fn with_moved(self, moved: BTreeMap<String, [f64; 2]>) -> Self {
        Self { moved, ..self }
    }

    /// The frame of the beginning, before any step.
    #[must_use]
    pub fn start(states: &AgentStates) -> view::Frame {
        of_states(states)
    }

    /// Adds what was on the air in a period.
    pub fn add(&mut self, period: &Period<'_>) {
        let sent = &period.deliveries.transmissions;
        if !sent.is_empty() && self.n_sent.is_empty() {
            self.n_sent = vec![0; period.states.len()];
        }
        for (index, &sender) in sent.sender.iter().enumerate() {
            if sent.destination(index).is_none() {
                self.n_sent[sender as usize] += 1;
            }
        }
        let mut number = 0;
        for receiver in 0..period.states.len() {
            for index in period.deliveries.heard_by(receiver) {
                let sender = sent.sender[index];
                if sender as usize != receiver {
                    self.deliveries.push(Delivery {
                        sender,
                        receiver: receiver as u32,
                        received: 1,
                        step: period.step,
                        rssi_dbm: at(&period.deliveries.rssi_dbm, number, f32::NAN),
                        hops: at(&period.deliveries.hops, number, 1),
                    });
                }
                number += 1;
            }
        }
        if MOST_UNMERGED < self.deliveries.len() {
            self.merge();
        }
        if let Some(packets) = period.packets {
            self.packets.get_or_insert_default().append(packets);
        }
        if let Some(frames) = period.frames {
            let kept = self.frames.get_or_insert_default();
            if kept.len() < MOST_FRAMES {
                kept.append(frames);
            }
        }
        for MovedObstacle { name, centre_m } in period.moved_obstacles {
            self.moved.insert(name.clone(), *centre_m);
        }
    }

    /// The frame at the end of the latest step, whose period was added before.
    pub fn take(&mut self, record: &StepRecord) -> view::Frame {
        let StepRecord { step, time_ns, robots, network, .. } = record;
        self.merge();
        let moved = self.moved.iter().map(|(name, centre_m)| {
            MovedObstacle { name: name.clone(), centre_m: *centre_m }.into()
        });
        let frame = view::Frame {
            step: *step,
            time_ns: *time_ns,
            from_ns: self.from_ns,
            n_sent: std::mem::take(&mut self.n_sent),
            links: self.links(*step),
            motes: network.motes.clone().map(Into::into),
            formation: network.formation.clone().map(Into::into),
            packets: self.packets.take().map(Into::into),
            frames: self.frames.take().map(Into::into),
            moved_obstacles: moved.collect(),
            figures: robots.figures.iter().cloned().map(Into::into).collect(),
            held: robots.held,
            task_complete: robots.task_complete,
            ..of_states(&robots.states)
        };
        self.deliveries.clear();
        self.from_ns = *time_ns;
        frame
    }

    /// Counts deliveries by pair.
    fn merge(&mut self) {
        // Stable: of each pair the last delivery stays the last.
        self.deliveries.sort_by_key(|delivery| (delivery.sender, delivery.receiver));
        self.deliveries.dedup_by(|next, kept| {
            let same = (next.sender, next.receiver) == (kept.sender, kept.receiver);
            if same {
                *kept = Delivery { received: kept.received + next.received, ..*next };
            }
            same
        });
    }

    fn links(&self, step: u64) -> Option<view::Links> {
        let links = &self.deliveries;
        if links.is_empty() {
            return None;
        }
        let has_rssi = links.iter().any(|link| !link.rssi_dbm.is_nan());
        let steps_ago: Vec<u32> = links
            .iter()
            .map(|link| ((step - link.step) as u32).saturating_add(self.positions_behind))
            .collect();
        let hops: Vec<u32> = links.iter().map(|link| link.hops).collect();
        Some(view::Links {
            sender: links.iter().map(|link| link.sender).collect(),
            receiver: links.iter().map(|link| link.receiver).collect(),
            received: links.iter().map(|link| link.received).collect(),
            rssi_dbm: links
                .iter()
                .filter(|_| has_rssi)
                .map(|link| libm::roundf(link.rssi_dbm * PARTS_PER_DB) / PARTS_PER_DB)
                .collect(),
            steps_ago: if steps_ago.iter().all(|steps| *steps == 0) {
                Vec::new()
            } else {
                steps_ago
            },
            hops: if hops.iter().all(|hops| *hops == 1) { Vec::new() } else { hops },
        })
    }
}

/// An entry of a column that may be absent.
fn at<T: Copy>(column: &[T], index: usize, absent: T) -> T {
    column.get(index).copied().unwrap_or(absent)
}

fn rounded(value: f64, parts: f64) -> f32 {
    (libm::round(value * parts) / parts) as f32
}

/// A frame of robots alone.
fn of_states(states: &AgentStates) -> view::Frame {
    let single = |column: &[f64]| column.iter().map(|value| rounded(*value, PARTS_PER_M)).collect();
    let heading_rad =
        (0..states.len()).map(|agent| rounded(states.facing_rad(agent), PARTS_PER_RAD));
    view::Frame {
        alive: states.alive.as_bytes().to_vec(),
        x_m: single(&states.x_m),
        y_m: single(&states.y_m),
        z_m: if states.z_m.iter().all(|z| *z == 0.0) { Vec::new() } else { single(&states.z_m) },
        heading_rad: heading_rad.collect(),
        ..view::Frame::default()
    }
}
