//! Applications: what motes send of their own accord.
//!
//! | module | what |
//! |---|---|
//! | [`config`] | `[[netsim.app]]` |
//!
//! An application is a machine that says when it sends what; addresses, routes and frames are the mote's business. It sends
//! only while the mote may ([`App::set_ready`]): packets that would fall in the time before do not exist.

pub mod config;

pub use config::{Pattern, Peer, Spec};

use crate::dice::Dice;
use bytes::Bytes;
use serde::{Deserialize, Serialize};

/// For whom a packet is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Destination {
    /// The root of the sender's own DODAG.
    Root,
    /// A mote.
    Mote(u32),
}

/// A packet to be sent.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Packet {
    /// Destination of the packet.
    pub destination: Destination,
    /// Length of its UDP payload (bytes).
    pub payload_bytes: u16,
    /// How many this application has sent before.
    pub counter: u32,
    /// When it came into being (ns).
    pub created_ns: u64,
}

impl Packet {
    /// UDP payload: the counter, most significant byte first, then zeros; cut to its length.
    #[must_use]
    pub fn payload(&self) -> Bytes {
        let mut bytes = self.counter.to_be_bytes().to_vec();
        bytes.resize(usize::from(self.payload_bytes), 0);
        Bytes::from(bytes)
    }
}

/// One application of one mote.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct App {
    pattern: Pattern,
    peer: Peer,
    payload_bytes: u16,
    own: u32,
    n_motes: u32,
    slot_ns: u64,
    counter: u32,
    /// The mote to which the next packet of [`Peer::All`] goes.
    turn: u32,
    phase: Phase,
}

/// What an application waits for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
enum Phase {
    /// For the mote to be ready.
    Stopped,
    /// For the next packet's time (ns).
    Waiting { next_ns: u64 },
    /// For nothing: its packets are sent.
    Done,
}

impl App {
    /// The application that `spec` gives mote `own` of `n_motes`; none if it is not among the senders or would send to itself
    /// only.
    #[must_use]
    pub fn new(spec: &Spec, own: u32, is_root: bool, n_motes: u32, slot_ns: u64) -> Option<Self> {
        let has_somebody = match spec.peer {
            Peer::Root => !is_root,
            Peer::Mote(mote) => mote != own,
            Peer::Random | Peer::All => 2 <= n_motes,
        };
        let sends = spec.senders.as_ref().is_none_or(|senders| senders.contains(&own));
        (sends && has_somebody).then_some(Self {
            pattern: spec.pattern,
            peer: spec.peer,
            payload_bytes: spec.payload_bytes,
            own,
            n_motes,
            slot_ns,
            counter: 0,
            turn: 0,
            phase: Phase::Stopped,
        })
    }

    /// The mote may send from now on, or no longer. Saying the same again changes nothing.
    ///
    /// Periodic packets begin a slot and a random part of a period later, anew each time: motes that become ready together do
    /// not send together. A burst comes its time after the mote has become ready and is not repeated once it has begun.
    pub fn set_ready(&mut self, is_ready: bool, now_ns: u64, dice: &mut Dice) {
        match (self.phase, is_ready) {
            (Phase::Stopped, true) => {
                let next_ns = match self.pattern {
                    Pattern::Periodic { period_ns, .. } => {
                        now_ns + self.slot_ns + dice.below(period_ns)
                    }
                    Pattern::Burst { after_ns, .. } => now_ns + after_ns,
                };
                self.phase = Phase::Waiting { next_ns };
            }
            (Phase::Waiting { .. }, false) => self.phase = Phase::Stopped,
            (Phase::Stopped, false) | (Phase::Waiting { .. }, true) | (Phase::Done, _) => {}
        }
    }

    /// When the next packet is due (ns).
    #[must_use]
    pub fn poll_timeout(&self) -> Option<u64> {
        match self.phase {
            Phase::Waiting { next_ns } => Some(next_ns),
            Phase::Stopped | Phase::Done => None,
        }
    }

    /// The packet that is due, if one is. Of a burst, one per call: ask until the time lies ahead or there is none.
    pub fn handle_timeout(&mut self, now_ns: u64, dice: &mut Dice) -> Option<Packet> {
        let Phase::Waiting { next_ns } = self.phase else { return None };
        if now_ns < next_ns {
            return None;
        }
        let packet = Packet {
            destination: self.next_destination(dice),
            payload_bytes: self.payload_bytes,
            counter: self.counter,
            created_ns: now_ns,
        };
        self.counter += 1;
        self.phase = match self.pattern {
            Pattern::Periodic { period_ns, jitter_ns } => {
                let pause_ns = dice.duration_ns(period_ns - jitter_ns, period_ns + jitter_ns);
                // From when it was due, so that slots of any length leave the period as it is; but never a backlog.
                Phase::Waiting { next_ns: (next_ns + pause_ns).max(now_ns) }
            }
            Pattern::Burst { n_packets, .. } if self.counter < n_packets => self.phase,
            Pattern::Burst { .. } => Phase::Done,
        };
        Some(packet)
    }

    fn next_destination(&mut self, dice: &mut Dice) -> Destination {
        match self.peer {
            Peer::Root => Destination::Root,
            Peer::Mote(mote) => Destination::Mote(mote),
            Peer::Random => {
                let other = dice.below(u64::from(self.n_motes) - 1) as u32;
                Destination::Mote(if other < self.own { other } else { other + 1 })
            }
            Peer::All => {
                if self.turn == self.own {
                    self.turn = (self.turn + 1) % self.n_motes;
                }
                let mote = self.turn;
                self.turn = (self.turn + 1) % self.n_motes;
                Destination::Mote(mote)
            }
        }
    }
}

#[cfg(test)]
mod tests;
