//! `poisson`: packets at random times.
//!
//! Packets of a mote are a Poisson process of rate 1/m: the intervals are independent and exponential, P(T > t) = e^(−t/m), and the
//! number in a time t has mean and variance t/m. The sum over n motes is a Poisson process of rate n/m. (Kingman, "Poisson
//! Processes", 1993.)

use super::config::Largest;
use super::sender::{Sender, SenderKeys};
use super::stream::Stream;
use super::{Context, Host, Packet, Reading, Traffic};
use proto::config::{Section, Variant, variant};
use proto::time::{SimDuration, SimTime};
use serde::{Deserialize, Serialize};

/// Packets at the times of a Poisson process.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Poisson {
    sender: Sender,
    mean: SimDuration,
    stream: Stream,
    next: Option<SimTime>,
}

/// A Poisson process: independent exponential intervals, from the time at which the mote may send.
#[derive(Section)]
struct Keys {
    /// Mean time between two packets of a mote (s): the reciprocal of its rate.
    #[key(range = 1e-3..=1e6, default = 60.0)]
    mean_interval_s: f64,
    #[key(flatten)]
    sender: SenderKeys,
}

impl Poisson {
    /// Packets with this mean interval.
    #[must_use]
    pub fn new(sender: Sender, mean: SimDuration) -> Self {
        Self { sender, mean, stream: Stream::default(), next: None }
    }
}

impl super::Kind for Poisson {
    const VARIANT: Variant = variant::<Keys>("poisson");

    fn read(reading: &mut Reading<'_>) -> Option<Self> {
        let keys = Keys::read(reading.table);
        Some(Self::new(
            Sender::of(keys.sender, reading)?,
            SimDuration::from_seconds(keys.mean_interval_s),
        ))
    }

    fn assigned(&self, host: &Host) -> Option<Self> {
        let stream = Stream::new(host.seed, host.mote, host.app);
        Some(Self { stream, ..Self::new(self.sender.assigned(host)?, self.mean) })
    }

    fn largest(&self) -> Largest {
        self.sender.largest()
    }
}

impl Traffic for Poisson {
    /// The process has no memory: it begins anew whenever the mote becomes ready.
    fn set_ready(&mut self, is_ready: bool, cx: &mut Context<'_>) {
        self.next = match (is_ready, self.next) {
            (false, _) => None,
            (true, Some(next)) => Some(next),
            (true, None) => Some(cx.now + self.stream.exponential(self.mean)),
        };
    }

    fn poll_timeout(&self) -> Option<SimTime> {
        self.next
    }

    /// Several packets may fall into one slot.
    fn handle_timeout(&mut self, cx: &mut Context<'_>) -> Option<Packet> {
        let next = self.next?;
        self.next = Some(next + self.stream.exponential(self.mean));
        Some(self.sender.packet(cx.now, cx.dice))
    }

    fn reseed(&mut self, seed: u64) {
        self.stream.reseed(seed);
    }
}
