//! `periodic`: a packet again and again.

use super::config::Largest;
use super::sender::{Sender, SenderKeys};
use super::{Context, Host, Packet, Reading, Traffic};
use proto::config::{Section, Variant, variant};
use proto::time::{SimDuration, SimTime};
use serde::{Deserialize, Serialize};

/// Periodic packets.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Periodic {
    sender: Sender,
    /// Mean interval.
    period: SimDuration,
    /// Each interval is uniform within so much to either side; less than the period.
    jitter: SimDuration,
    slot: SimDuration,
    next: Option<SimTime>,
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
    /// Packets with this mean interval, and so much jitter.
    #[must_use]
    pub fn new(sender: Sender, period: SimDuration, jitter: SimDuration) -> Self {
        Self { sender, period, jitter, slot: SimDuration::ZERO, next: None }
    }
}

impl super::Kind for Periodic {
    const VARIANT: Variant = variant::<Keys>("periodic");

    fn read(reading: &mut Reading<'_>) -> Option<Self> {
        let keys = Keys::read(reading.table);
        let period = SimDuration::from_seconds(keys.period_s);
        Some(Self::new(
            Sender::of(keys.sender, reading)?,
            period,
            SimDuration::from_ns((period.ns() as f64 * keys.jitter) as u64),
        ))
    }

    fn assigned(&self, host: &Host) -> Option<Self> {
        let one = Self::new(self.sender.assigned(host)?, self.period, self.jitter);
        Some(Self { slot: host.slot, ..one })
    }

    fn largest(&self) -> Largest {
        self.sender.largest()
    }
}

impl Traffic for Periodic {
    /// Periodic packets begin a slot and a random part of a period later, anew each time: motes that become ready together do
    /// not send together.
    fn set_ready(&mut self, is_ready: bool, cx: &mut Context<'_>) {
        self.next = match (is_ready, self.next) {
            (false, _) => None,
            (true, Some(next)) => Some(next),
            (true, None) => {
                Some(cx.now + self.slot + SimDuration::from_ns(cx.dice.below(self.period.ns())))
            }
        };
    }

    fn poll_timeout(&self) -> Option<SimTime> {
        self.next
    }

    fn handle_timeout(&mut self, cx: &mut Context<'_>) -> Option<Packet> {
        let next = self.next?;
        let packet = self.sender.packet(cx.now, cx.dice);
        let (period, jitter) = (self.period, self.jitter);
        let pause = cx.dice.duration(period - jitter, period + jitter);
        // From when it was due, so that slots of any length leave the period as it is; but never a backlog.
        self.next = Some((next + pause).max(cx.now));
        Some(packet)
    }
}
