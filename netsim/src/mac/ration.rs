//! Airtime that is rationed: what is left of it.

use super::effect::Duty;
use proto::time::{SimDuration, SimTime};
use serde::{Deserialize, Serialize};

/// What a mote may still send. Full at first.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Ration {
    /// Part of the time that comes back.
    fraction: f64,
    /// Most that can be saved up (ns).
    most_ns: f64,
    /// What was left (ns); less than nothing after a frame that was longer than that.
    left_ns: f64,
    /// When.
    at: SimTime,
}

impl Ration {
    /// The full ration of a mote: time on air for a whole window.
    #[must_use]
    pub(crate) fn new(duty: Duty) -> Self {
        let most_ns = duty.fraction * duty.window.ns() as f64;
        Self { fraction: duty.fraction, most_ns, left_ns: most_ns, at: SimTime::START }
    }

    /// What is left.
    fn left_ns(&self, now: SimTime) -> f64 {
        let back_ns = self.fraction * now.saturating_since(self.at).ns() as f64;
        self.most_ns.min(self.left_ns + back_ns)
    }

    /// Whether anything is left.
    #[must_use]
    pub(crate) fn allows(&self, now: SimTime) -> bool {
        0.0 < self.left_ns(now)
    }

    /// So long a frame was sent.
    pub(crate) fn spend(&mut self, airtime: SimDuration, now: SimTime) {
        self.left_ns = self.left_ns(now) - airtime.ns() as f64;
        self.at = now;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ration_is_used_up_comes_back_and_cannot_be_saved_beyond_its_window() {
        // One part in a hundred of 10 s: 0.1 s.
        let mut ration =
            Ration::new(Duty { fraction: 0.01, window: SimDuration::from_ns(10_000_000_000) });
        let ms = 1_000_000;
        ration.spend(SimDuration::from_ns(60 * ms), SimTime::START);
        assert!(ration.allows(SimTime::START));
        ration.spend(SimDuration::from_ns(60 * ms), SimTime::START);
        // 20 ms too much come back in 2 s.
        assert!(!ration.allows(SimTime::from_ns(2_000 * ms)));
        assert!(ration.allows(SimTime::from_ns(2_001 * ms)));
        ration.spend(SimDuration::from_ns(100 * ms), SimTime::from_ns(3_600_000 * ms));
        assert!(!ration.allows(SimTime::from_ns(3_600_000 * ms)));
    }

    #[test]
    fn in_the_long_run_a_mote_sends_that_part_of_the_time() {
        let mut ration =
            Ration::new(Duty { fraction: 0.002, window: SimDuration::from_ns(60_000_000_000) });
        let (length, airtime) = (SimDuration::from_ms(10), SimDuration::from_ms(4));
        let mut sent = SimDuration::ZERO;
        let n_slots = 1_000_000;
        for now in (0..n_slots).map(|slot| SimTime::START + slot * length) {
            if ration.allows(now) {
                ration.spend(airtime, now);
                sent += airtime;
            }
        }
        let fraction = sent.ns() as f64 / (n_slots * length).ns() as f64;
        // The first ration comes on top: 60 s of 10,000.
        assert!((fraction / 0.002 - 1.0 - 60.0 / 10_000.0).abs() < 1e-3, "{fraction}");
    }
}
