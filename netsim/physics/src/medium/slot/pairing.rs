//! Which emissions arrive at which receivers: sparse, by channel and by reach.

use super::air::{Arrival, Listening, Paths, Sent};
use crate::timing::{ACK_WAIT_NS, RX_ACK_DELAY_NS};
use proto::ids::MoteId;
use proto::rng::Purpose;

/// Something on the air. Times count from the slot's true begin.
#[derive(Clone, Copy, Debug)]
pub(super) struct Emission {
    pub(super) sender: MoteId,
    pub(super) channel: u8,
    pub(super) begins_ns: i64,
    pub(super) ends_ns: i64,
    /// For which draws.
    pub(super) purpose: Purpose,
    /// Whose place among the caller's frames or acknowledgments.
    pub(super) number: u32,
}

impl Emission {
    pub(super) fn sent(&self, slot_ns: u64) -> Sent {
        Sent {
            sender: self.sender,
            channel: self.channel,
            sent_ns: slot_ns.saturating_add_signed(self.begins_ns),
            end_ns: slot_ns.saturating_add_signed(self.ends_ns),
        }
    }
}

/// A receiver that is on.
#[derive(Clone, Copy, Debug)]
pub(super) struct Ear {
    pub(super) receiver: MoteId,
    pub(super) channel: u8,
    pub(super) opens_ns: i64,
    pub(super) closes_ns: i64,
    /// It is deaf if it sends something that ends later.
    silent_from_ns: i64,
    /// Last of what it hears, in [`Pairing`]'s list.
    last_heard: u32,
}

impl Ear {
    /// A mote that hears the slot's frames, unless it sends one.
    pub(super) fn of_frames(listening: &Listening) -> Self {
        let &Listening { receiver, channel, opens_ns, closes_ns } = listening;
        let silent_from_ns = i64::MIN;
        Self { receiver, channel, opens_ns, closes_ns, silent_from_ns, last_heard: NONE }
    }

    /// The sender of a frame, waiting for its acknowledgment.
    pub(super) fn of_acknowledgments(frame: &Emission) -> Self {
        let opens_ns = frame.ends_ns + RX_ACK_DELAY_NS;
        Self {
            receiver: frame.sender,
            channel: frame.channel,
            opens_ns,
            closes_ns: opens_ns + ACK_WAIT_NS,
            silent_from_ns: frame.ends_ns,
            last_heard: NONE,
        }
    }
}

const NONE: u32 = u32::MAX;
/// So few receivers are asked without looking who is near.
const FEW: usize = 32;

/// What arrives somewhere.
#[derive(Clone, Copy, Debug)]
struct Heard {
    emission: u32,
    arrival: Arrival,
    /// What the same ear hears besides.
    previous: u32,
}

/// Room for pairing.
#[derive(Debug, Default)]
pub(super) struct Pairing {
    heard: Vec<Heard>,
    /// Ears by channel, for channels on which something is sent.
    ears_on: Vec<Vec<u32>>,
    /// Ear by mote.
    ear_of: Vec<u32>,
    receivers: Vec<MoteId>,
    asked: Vec<u32>,
    arrivals: Vec<Arrival>,
}

impl Pairing {
    /// Finds what arrives at each ear.
    pub(super) fn pair<P: Paths + ?Sized>(
        &mut self,
        paths: &mut P,
        slot_ns: u64,
        emissions: &[Emission],
        ears: &mut [Ear],
    ) {
        self.heard.clear();
        if self.ears_on.is_empty() {
            self.ears_on.resize_with(usize::from(u8::MAX) + 1, Vec::new);
        }
        self.sort(emissions, ears);
        for (number, emission) in (0..).zip(emissions) {
            self.ask(paths, emission, ears);
            if self.receivers.is_empty() {
                continue;
            }
            self.arrivals.clear();
            paths.arrivals(emission.sent(slot_ns), &self.receivers, &mut self.arrivals);
            for (&ear, &arrival) in self.asked.iter().zip(&self.arrivals) {
                if !arrival.is_nothing() {
                    let previous = ears[ear as usize].last_heard;
                    ears[ear as usize].last_heard = self.heard.len() as u32;
                    self.heard.push(Heard { emission: number, arrival, previous });
                }
            }
        }
        for ear in &*ears {
            if let Some(place) = self.ear_of.get_mut(ear.receiver.index()) {
                *place = NONE;
            }
        }
        for emission in emissions {
            self.ears_on[usize::from(emission.channel)].clear();
        }
    }

    /// Ears by channel and by mote, those that transmit while they should listen left out.
    fn sort(&mut self, emissions: &[Emission], ears: &[Ear]) {
        let mut is_used = [false; 256];
        for emission in emissions {
            is_used[usize::from(emission.channel)] = true;
        }
        for (number, ear) in (0..).zip(ears) {
            let mote = ear.receiver.index();
            if self.ear_of.len() <= mote {
                self.ear_of.resize(mote + 1, NONE);
            }
            if is_used[usize::from(ear.channel)] {
                debug_assert_eq!(self.ear_of[mote], NONE, "mote {mote} listens once");
                self.ear_of[mote] = number;
            }
        }
        // Half duplex.
        for emission in emissions {
            if let Some(place) = self.ear_of.get_mut(emission.sender.index())
                && let Some(ear) = ears.get(*place as usize)
                && ear.silent_from_ns < emission.ends_ns
            {
                *place = NONE;
            }
        }
        for (number, ear) in (0..).zip(ears) {
            if self.ear_of[ear.receiver.index()] == number {
                self.ears_on[usize::from(ear.channel)].push(number);
            }
        }
    }

    /// Lists the ears that an emission may reach.
    fn ask<P: Paths + ?Sized>(&mut self, paths: &mut P, emission: &Emission, ears: &[Ear]) {
        let Self { ears_on, ear_of, receivers, asked, .. } = self;
        receivers.clear();
        asked.clear();
        let on_channel = &ears_on[usize::from(emission.channel)];
        let mut ask = |number: u32, receiver: MoteId| {
            if receiver != emission.sender {
                asked.push(number);
                receivers.push(receiver);
            }
        };
        if FEW < on_channel.len()
            && let Some(neighbours) = paths.neighbours(emission.sender)
            && neighbours.len() < on_channel.len()
        {
            for &mote in neighbours {
                let number = ear_of.get(mote.index()).copied().unwrap_or(NONE);
                if ears.get(number as usize).is_some_and(|ear| ear.channel == emission.channel) {
                    ask(number, mote);
                }
            }
        } else {
            for &number in on_channel {
                ask(number, ears[number as usize].receiver);
            }
        }
    }

    /// Numbers of the emissions that an ear hears, the last first, and what of them arrives.
    pub(super) fn heard_by(&self, ear: &Ear) -> impl Iterator<Item = (usize, Arrival)> + '_ {
        let mut next = ear.last_heard;
        std::iter::from_fn(move || {
            let heard = self.heard.get(next as usize)?;
            next = heard.previous;
            Some((heard.emission as usize, heard.arrival))
        })
    }

    /// What arrives at one receiver.
    pub(super) fn single<P: Paths + ?Sized>(
        &mut self,
        paths: &mut P,
        sent: Sent,
        receiver: MoteId,
    ) -> Arrival {
        self.arrivals.clear();
        paths.arrivals(sent, &[receiver], &mut self.arrivals);
        self.arrivals.first().copied().unwrap_or(Arrival::NOTHING)
    }
}
