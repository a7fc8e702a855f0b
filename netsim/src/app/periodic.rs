//! `periodic`: a packet again and again.

use super::config::Largest;
use super::sender::{Sender, SenderKeys, ns};
use super::{Context, Host, Packet, Reading, Traffic};
use proto::config::{Section, Variant, variant};
use serde::{Deserialize, Serialize};

/// Periodic packets.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Periodic {
    sender: Sender,
    /// Mean interval (ns).
    period_ns: u64,
    /// Each interval is uniform within so much (ns) to either side; less than the period.
    jitter_ns: u64,
    slot_ns: u64,
    next_ns: Option<u64>,
}

/// Periodically, from the time at which the mote may send.
#[derive(Section)]
struct Keys {
    /// Mean time between two packets of a mote (s). 60: the 6TiSCH simulator.
    #[key(range = 1e-3..=1e6, default = 60.0)]
    period_s: f64,
    /// Jitter: each interval is uniform within this fraction of period_s to either side. 0.05: the 6TiSCH simulator.
    #[key(range = 0.0..=0.99, default = 0.05)]
    jitter: f64,
    #[key(flatten)]
    sender: SenderKeys,
}

impl Periodic {
    /// Packets with this mean interval (ns), and so much jitter (ns).
    #[must_use]
    pub fn new(sender: Sender, period_ns: u64, jitter_ns: u64) -> Self {
        Self { sender, period_ns, jitter_ns, slot_ns: 0, next_ns: None }
    }
}

impl super::Kind for Periodic {
    const VARIANT: Variant = variant::<Keys>("periodic");

    fn read(reading: &mut Reading<'_>) -> Option<Self> {
        let keys = Keys::read(reading.table);
        let period_ns = ns(keys.period_s);
        Some(Self::new(
            Sender::of(keys.sender, reading)?,
            period_ns,
            (period_ns as f64 * keys.jitter) as u64,
        ))
    }

    fn assigned(&self, host: &Host) -> Option<Self> {
        let one = Self::new(self.sender.assigned(host)?, self.period_ns, self.jitter_ns);
        Some(Self { slot_ns: host.slot_ns, ..one })
    }

    fn largest(&self) -> Largest {
        self.sender.largest()
    }
}

impl Traffic for Periodic {
    /// Periodic packets begin a slot and a random part of a period later, anew each time: motes that become ready together do
    /// not send together.
    fn set_ready(&mut self, is_ready: bool, cx: &mut Context<'_>) {
        self.next_ns = match (is_ready, self.next_ns) {
            (false, _) => None,
            (true, Some(next_ns)) => Some(next_ns),
            (true, None) => Some(cx.now_ns + self.slot_ns + cx.dice.below(self.period_ns)),
        };
    }

    fn poll_timeout(&self) -> Option<u64> {
        self.next_ns
    }

    fn handle_timeout(&mut self, cx: &mut Context<'_>) -> Option<Packet> {
        let next_ns = self.next_ns?;
        let packet = self.sender.packet(cx.now_ns, cx.dice);
        let (period_ns, jitter_ns) = (self.period_ns, self.jitter_ns);
        let pause_ns = cx.dice.duration_ns(period_ns - jitter_ns, period_ns + jitter_ns);
        // From when it was due, so that slots of any length leave the period as it is; but never a backlog.
        self.next_ns = Some((next_ns + pause_ns).max(cx.now_ns));
        Some(packet)
    }
}
