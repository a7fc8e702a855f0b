//! A TSCH slot on the air: all transmissions and listeners of a slot resolved together.
//!
//! | module | what |
//! |---|---|
//! | [`air`] | what is on the air, who listens, and what arrives where |
//! | `lock` | one receiver among the frames that arrive at it |
//!
//! First [`SlotMedium::resolve`] says what became of the frames, then, once it is known who acknowledges which of them,
//! [`SlotMedium::acknowledge`] says what became of the acknowledgments. Both are functions of their arguments: what is kept
//! between calls is room to work in.
//!
//! # Model
//!
//! * A receiver that is synchronised hears only frames which begin within the guard time about its own clock.
//! * It locks on to the first frame whose synchronisation header it detects; while that lasts it turns to a frame which is
//!   stronger by [`Rule::capture_db`]. Whatever else arrives on its channel interferes, whether or not it could be
//!   detected.
//! * One draw per frame and receiver decides: u < p receives the frame, with p the probability under noise alone times the
//!   factors of [`Rule::survival`]; u < p′ detects its header, with p′ the same over the header's part of the frame. So who
//!   receives a frame has detected it.
//! * An acknowledgment begins a fixed time after the end of its frame and is heard by the frame's sender if it begins
//!   within its window. It meets other acknowledgments and longer frames that are still on the air.
//!
//! # Validity
//!
//! An acknowledgment does not disturb longer frames that are still on the air. Propagation takes no time. Adjacent
//! channels do not interfere. A receiver whose frame was lost does not listen again in this slot.
//!
//! # Cost
//!
//! Proportional to transmissions times listeners on their channel and in reach. Order and grouping of both are free; the
//! result does not depend on them. After the first slots nothing is allocated.

pub mod air;
mod lock;
mod pairing;

#[cfg(test)]
mod tests;

pub use air::{Acknowledgment, Arrival, Listening, OnAir, Paths, Reception, Sent, Slot};

use crate::interference::Rule;
use crate::timing::{Airtime, TX_ACK_DELAY_NS};
use lock::{Locker, ReceiverOutcome};
use pairing::{Ear, Emission, Pairing};
use proto::rng::Purpose;

/// Resolves slots.
#[derive(Debug)]
pub struct SlotMedium {
    seed: u64,
    rule: Box<dyn Rule>,
    perfect_acks: bool,
    airtime: Airtime,
    pairing: Pairing,
    locker: Locker,
    emissions: Vec<Emission>,
    ears: Vec<Ear>,
    ear_of_acknowledgment: Vec<u32>,
    receptions: Vec<Reception>,
}

impl SlotMedium {
    /// A medium. `perfect_acks`: acknowledgments always arrive and never meet anything, as in the 6TiSCH simulator.
    #[must_use]
    pub fn new(seed: u64, rule: Box<dyn Rule>, perfect_acks: bool) -> Self {
        Self {
            seed,
            rule,
            perfect_acks,
            airtime: Airtime::O_QPSK_2450,
            pairing: Pairing::default(),
            locker: Locker::new(Airtime::O_QPSK_2450),
            emissions: Vec::new(),
            ears: Vec::new(),
            ear_of_acknowledgment: Vec::new(),
            receptions: Vec::new(),
        }
    }

    /// The same medium with frames of another physical layer than 2.4 GHz O-QPSK.
    #[must_use]
    pub fn with_airtime(self, airtime: Airtime) -> Self {
        Self { airtime, locker: Locker::new(airtime), ..self }
    }

    /// Draws by another seed from here on.
    pub fn reseed(&mut self, seed: u64) {
        self.seed = seed;
    }

    /// What each listener receives, in their order. A mote that transmits does not hear. A mote listens at most once.
    pub fn resolve<P: Paths + ?Sized>(
        &mut self,
        paths: &mut P,
        slot: Slot,
        on_air: &[OnAir],
        listening: &[Listening],
    ) -> &[Reception] {
        if let ([frame], true) = (on_air, paths.is_certain()) {
            self.receive_all(paths, frame, listening);
            return &self.receptions;
        }
        self.emissions.clear();
        let airtime = self.airtime;
        let frames = on_air.iter().zip(0..);
        self.emissions.extend(frames.map(|(frame, number)| data(frame, number, &airtime)));
        self.ears.clear();
        self.ears.extend(listening.iter().map(Ear::of_frames));
        self.pairing.pair(paths, slot.begins_ns, &self.emissions, &mut self.ears);
        self.receptions.clear();
        for ear in &self.ears {
            let outcome = self.locker.outcome(
                &*self.rule,
                (self.seed, slot.asn.0),
                &self.emissions,
                ear,
                self.pairing.heard_by(ear),
            );
            self.receptions.push(match outcome {
                ReceiverOutcome::Idle => Reception::Idle,
                ReceiverOutcome::Lost { emission } => {
                    Reception::Lost { transmission: self.emissions[emission].number }
                }
                ReceiverOutcome::Received { emission, rssi_dbm } => {
                    Reception::Received { transmission: self.emissions[emission].number, rssi_dbm }
                }
            });
        }
        &self.receptions
    }

    /// The only frame of a slot arrives for certain wherever its begin is waited for.
    fn receive_all<P: Paths + ?Sized>(
        &mut self,
        paths: &P,
        frame: &OnAir,
        listening: &[Listening],
    ) {
        let OnAir { sender, channel, .. } = *frame;
        let begins_ns = frame.begins_ns();
        let is_sent = paths.is_on(sender);
        self.receptions.clear();
        self.receptions.extend(listening.iter().map(|ear| {
            let waits = (ear.opens_ns..=ear.closes_ns).contains(&begins_ns);
            let is_heard = is_sent
                && waits
                && ear.channel == channel
                && ear.receiver != sender
                && paths.is_on(ear.receiver);
            if is_heard {
                Reception::Received { transmission: 0, rssi_dbm: f64::NAN }
            } else {
                Reception::Idle
            }
        }));
    }

    /// What becomes of acknowledgments of `on_air`'s frames, in their order: whether the frame's sender receives it. In
    /// what is returned, `transmission` counts acknowledgments; [`Reception::Lost`] also means that something else was
    /// received instead.
    pub fn acknowledge<P: Paths + ?Sized>(
        &mut self,
        paths: &mut P,
        slot: Slot,
        on_air: &[OnAir],
        acknowledgments: &[Acknowledgment],
    ) -> &[Reception] {
        self.receptions.clear();
        if acknowledgments.is_empty() {
            return &self.receptions;
        }
        self.lay_out_acknowledgments(on_air, acknowledgments);
        if self.perfect_acks {
            self.deliver_all(paths, slot);
            return &self.receptions;
        }
        self.pairing.pair(paths, slot.begins_ns, &self.emissions, &mut self.ears);
        for (&ear, number) in self.ear_of_acknowledgment.iter().zip(0..) {
            let ear = &self.ears[ear as usize];
            let outcome = self.locker.outcome(
                &*self.rule,
                (self.seed, slot.asn.0),
                &self.emissions,
                ear,
                self.pairing.heard_by(ear),
            );
            self.receptions.push(match outcome {
                ReceiverOutcome::Idle => Reception::Idle,
                // Acknowledgments stand first among the emissions.
                ReceiverOutcome::Received { emission, rssi_dbm } if emission == number as usize => {
                    Reception::Received { transmission: number, rssi_dbm }
                }
                ReceiverOutcome::Lost { .. } | ReceiverOutcome::Received { .. } => {
                    Reception::Lost { transmission: number }
                }
            });
        }
        &self.receptions
    }

    /// Emissions: acknowledgments, then frames that last into the time when one is awaited. Ears: senders of the frames.
    fn lay_out_acknowledgments(&mut self, on_air: &[OnAir], acknowledgments: &[Acknowledgment]) {
        self.emissions.clear();
        self.ears.clear();
        self.ear_of_acknowledgment.clear();
        let mut opens_first_ns = i64::MAX;
        for (acknowledgment, number) in acknowledgments.iter().zip(0..) {
            let frame = data(&on_air[acknowledgment.transmission as usize], 0, &self.airtime);
            let begins_ns = frame.ends_ns + TX_ACK_DELAY_NS;
            self.emissions.push(Emission {
                sender: acknowledgment.receiver,
                channel: frame.channel,
                begins_ns,
                ends_ns: begins_ns + self.airtime.of(acknowledgment.psdu_bytes),
                purpose: Purpose::SlotAcknowledgment,
                number,
            });
            let awaiting = Ear::of_acknowledgments(&frame);
            opens_first_ns = opens_first_ns.min(awaiting.opens_ns);
            // Two who acknowledge the same frame speak to the same ear.
            let earlier = acknowledgments[..number as usize]
                .iter()
                .position(|other| other.transmission == acknowledgment.transmission);
            let ear = earlier.map_or(self.ears.len() as u32, |k| self.ear_of_acknowledgment[k]);
            self.ear_of_acknowledgment.push(ear);
            if earlier.is_none() {
                self.ears.push(awaiting);
            }
        }
        let airtime = self.airtime;
        let frames = on_air.iter().zip(0..).map(|(frame, number)| data(frame, number, &airtime));
        self.emissions.extend(frames.filter(|frame| opens_first_ns < frame.ends_ns));
    }

    fn deliver_all<P: Paths + ?Sized>(&mut self, paths: &mut P, slot: Slot) {
        for (&ear, number) in self.ear_of_acknowledgment.iter().zip(0..) {
            let sent = self.emissions[number as usize].sent(slot.begins_ns);
            let arrival = self.pairing.single(paths, sent, self.ears[ear as usize].receiver);
            let rssi_dbm = arrival.register_rssi_dbm;
            self.receptions.push(Reception::Received { transmission: number, rssi_dbm });
        }
    }
}

fn data(frame: &OnAir, number: u32, airtime: &Airtime) -> Emission {
    Emission {
        sender: frame.sender,
        channel: frame.channel,
        begins_ns: frame.begins_ns(),
        ends_ns: frame.ends_ns(airtime),
        purpose: Purpose::SlotReception,
        number,
    }
}
