//! `burst`: several packets at once, once.

use super::config::Largest;
use super::sender::{Sender, SenderKeys};
use super::{Context, Host, Packet, Reading, Traffic};
use proto::config::{Section, Variant, variant};
use proto::time::{SimDuration, SimTime};
use serde::{Deserialize, Serialize};

/// One burst of packets.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Burst {
    sender: Sender,
    /// So long after the mote may send.
    after: SimDuration,
    /// At least 1.
    n_packets: u32,
    next: Option<SimTime>,
}

/// One burst of packets.
#[derive(Section)]
struct Keys {
    /// Delay after the time at which the mote may send (s).
    #[key(range = 0.0..=1e6)]
    at_s: f64,
    /// How many.
    #[key(range = 1..=10_000, default = 1)]
    n_packets: u32,
    #[key(flatten)]
    sender: SenderKeys,
}

impl Burst {
    /// `n_packets` (at least 1), `after` after the mote may send.
    #[must_use]
    pub fn new(sender: Sender, after: SimDuration, n_packets: u32) -> Self {
        Self { sender, after, n_packets, next: None }
    }
}

impl super::Kind for Burst {
    const VARIANT: Variant = variant::<Keys>("burst");

    fn read(reading: &mut Reading<'_>) -> Option<Self> {
        let keys = Keys::read(reading.table);
        Some(Self::new(
            Sender::of(keys.sender, reading)?,
            SimDuration::from_seconds(keys.at_s),
            keys.n_packets,
        ))
    }

    fn assigned(&self, host: &Host) -> Option<Self> {
        Some(Self::new(self.sender.assigned(host)?, self.after, self.n_packets))
    }

    fn largest(&self) -> Largest {
        self.sender.largest()
    }
}

impl Traffic for Burst {
    /// A burst comes its time after the mote has become ready and is not repeated once it has begun.
    fn set_ready(&mut self, is_ready: bool, cx: &mut Context<'_>) {
        self.next = match (is_ready, self.next) {
            (false, _) => None,
            (true, Some(next)) => Some(next),
            (true, None) if self.sender.n_sent() == 0 => Some(cx.now + self.after),
            (true, None) => None,
        };
    }

    fn poll_timeout(&self) -> Option<SimTime> {
        self.next
    }

    fn handle_timeout(&mut self, cx: &mut Context<'_>) -> Option<Packet> {
        let packet = self.sender.packet(cx.now, cx.dice);
        if self.n_packets <= self.sender.n_sent() {
            self.next = None;
        }
        Some(packet)
    }
}
