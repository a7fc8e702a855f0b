//! One receiver among the frames that arrive at it.

use super::air::Arrival;
use super::pairing::{Ear, Emission};
use crate::interference::Rule;
use crate::timing::Airtime;
use proto::ids::MoteId;
use proto::rng::{Draws, Purpose, ordered_link};

/// What became of a receiver, in terms of emissions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum ReceiverOutcome {
    Idle,
    Lost { emission: usize },
    Received { emission: usize, rssi_dbm: f64 },
}

/// A frame that arrives.
#[derive(Clone, Copy, Debug)]
struct Candidate {
    begins_ns: i64,
    ends_ns: i64,
    sender: MoteId,
    purpose: Purpose,
    emission: usize,
    arrival: Arrival,
    /// What it adds to the interference with others.
    disturbance_mw: f64,
}

impl Candidate {
    fn frame_ns(&self) -> i64 {
        self.ends_ns - self.begins_ns
    }

    fn signal_dbm(&self) -> f64 {
        self.arrival.rssi_dbm - self.arrival.shift_db
    }

    /// Probability that its synchronisation header is detected, noise alone: the header's share of the frame.
    fn header_probability(&self, synchronisation_ns: i64) -> f64 {
        let probability = self.arrival.reception_probability;
        if probability <= 0.0 || 1.0 <= probability {
            return probability;
        }
        libm::pow(probability, synchronisation_ns as f64 / self.frame_ns() as f64)
    }
}

/// Room for the frames that arrive at one receiver.
#[derive(Debug)]
pub(super) struct Locker {
    /// The part of a frame by which a receiver notices it (ns).
    synchronisation_ns: i64,
    candidates: Vec<Candidate>,
    /// Time, candidate, and whether it begins, of what changes the interference.
    changes: Vec<(i64, u32, bool)>,
}

impl Locker {
    /// For frames of a physical layer.
    pub(super) fn new(airtime: Airtime) -> Self {
        let synchronisation_ns = airtime.synchronisation_ns;
        Self { synchronisation_ns, candidates: Vec::new(), changes: Vec::new() }
    }

    /// What becomes of a receiver at which `heard` arrives. Draws: by seed and absolute slot number.
    pub(super) fn outcome(
        &mut self,
        rule: &dyn Rule,
        (seed, asn): (u64, u64),
        emissions: &[Emission],
        ear: &Ear,
        heard: impl Iterator<Item = (usize, Arrival)>,
    ) -> ReceiverOutcome {
        let draw = |frame: &Candidate| {
            let link = ordered_link(frame.sender.0, ear.receiver.0);
            Draws::new(seed, frame.purpose).uniform(link, asn, 0)
        };
        let begins_in_time =
            |frame: &Candidate| (ear.opens_ns..=ear.closes_ns).contains(&frame.begins_ns);
        let mut heard = heard.map(|(emission, arrival)| candidate(emissions, emission, arrival));
        let Some(first) = heard.next() else { return ReceiverOutcome::Idle };
        let Some(second) = heard.next() else {
            return if begins_in_time(&first) {
                alone(&first, self.synchronisation_ns, draw)
            } else {
                ReceiverOutcome::Idle
            };
        };
        self.candidates.clear();
        self.candidates.extend([first, second].into_iter().chain(heard).map(|frame| Candidate {
            disturbance_mw: rule.disturbance_mw(frame.arrival.rssi_dbm),
            ..frame
        }));
        self.candidates.sort_unstable_by_key(|frame| (frame.begins_ns, frame.sender));
        self.among_others(rule, draw, begins_in_time)
    }

    fn among_others(
        &mut self,
        rule: &dyn Rule,
        draw: impl Fn(&Candidate) -> f64,
        begins_in_time: impl Fn(&Candidate) -> bool,
    ) -> ReceiverOutcome {
        let mut locked: Option<usize> = None;
        for i in 0..self.candidates.len() {
            let frame = self.candidates[i];
            if !begins_in_time(&frame) {
                continue;
            }
            if let Some(locked) = locked {
                let before = &self.candidates[locked];
                let is_late = before.begins_ns + self.synchronisation_ns <= frame.begins_ns;
                if is_late {
                    break;
                }
                if frame.arrival.rssi_dbm < before.arrival.rssi_dbm + rule.capture_db() {
                    continue;
                }
            }
            let probability = frame.header_probability(self.synchronisation_ns);
            let u = draw(&frame);
            if u < probability
                && (!rule.hides_preambles() || {
                    let header_ends_ns = frame.begins_ns + self.synchronisation_ns;
                    self.survives(rule, i, header_ends_ns, u, probability)
                })
            {
                locked = Some(i);
            }
        }
        let Some(locked) = locked else { return ReceiverOutcome::Idle };
        let frame = self.candidates[locked];
        let probability = frame.arrival.reception_probability;
        let u = draw(&frame);
        received(
            &frame,
            u < probability && self.survives(rule, locked, frame.ends_ns, u, probability),
        )
    }

    /// Whether u is less than a probability times the factors by which all others lower it as far as `until_ns`.
    fn survives(
        &mut self,
        rule: &dyn Rule,
        which: usize,
        until_ns: i64,
        u: f64,
        probability: f64,
    ) -> bool {
        let Self { candidates, changes, .. } = self;
        let frame = candidates[which];
        let (mut n_active, mut interference_mw) = (0, 0.0);
        changes.clear();
        for (other, k) in candidates.iter().zip(0..) {
            if until_ns <= other.begins_ns {
                // So do all that follow.
                break;
            }
            if k == which as u32 || other.ends_ns <= frame.begins_ns || other.disturbance_mw == 0.0
            {
                continue;
            }
            if other.begins_ns <= frame.begins_ns {
                n_active += 1;
                interference_mw += other.disturbance_mw;
            } else {
                changes.push((other.begins_ns, k, true));
            }
            if other.ends_ns < until_ns {
                changes.push((other.ends_ns, k, false));
            }
        }
        changes.sort_unstable();
        let mut probability = probability;
        let mut since_ns = frame.begins_ns;
        for &(time_ns, k, begins) in changes.iter().chain([&(until_ns, NOBODY, false)]) {
            if n_active != 0 && since_ns < time_ns {
                probability *= rule.survival(
                    frame.signal_dbm(),
                    interference_mw,
                    time_ns - since_ns,
                    frame.frame_ns(),
                );
                // It does not rise again.
                if probability <= u {
                    return false;
                }
            }
            since_ns = time_ns;
            let Some(other) = candidates.get(k as usize) else { continue };
            if begins {
                n_active += 1;
                interference_mw += other.disturbance_mw;
            } else {
                n_active -= 1;
                // What rounding leaves of a strong one is far below noise, and none when all have ended.
                interference_mw = match n_active {
                    0 => 0.0,
                    _ => (interference_mw - other.disturbance_mw).max(0.0),
                };
            }
        }
        true
    }
}

const NOBODY: u32 = u32::MAX;

fn candidate(emissions: &[Emission], emission: usize, arrival: Arrival) -> Candidate {
    let &Emission { begins_ns, ends_ns, sender, purpose, .. } = &emissions[emission];
    Candidate { begins_ns, ends_ns, sender, purpose, emission, arrival, disturbance_mw: 0.0 }
}

/// Nobody interferes.
#[inline]
fn alone(
    frame: &Candidate,
    synchronisation_ns: i64,
    draw: impl Fn(&Candidate) -> f64,
) -> ReceiverOutcome {
    let probability = frame.arrival.reception_probability;
    if 1.0 <= probability {
        return received(frame, true);
    }
    let u = draw(frame);
    if u < probability {
        received(frame, true)
    } else if u < frame.header_probability(synchronisation_ns) {
        received(frame, false)
    } else {
        ReceiverOutcome::Idle
    }
}

fn received(frame: &Candidate, is_received: bool) -> ReceiverOutcome {
    let emission = frame.emission;
    if is_received {
        ReceiverOutcome::Received { emission, rssi_dbm: frame.arrival.register_rssi_dbm }
    } else {
        ReceiverOutcome::Lost { emission }
    }
}
