//! Airtime that is rationed: what is left of it.

use super::effect::Duty;
use serde::{Deserialize, Serialize};

/// What a mote may still send. Full at first.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Ration {
    /// Part of the time that comes back.
    fraction: f64,
    /// Most that can be saved up (ns).
    most_ns: f64,
    /// What was left (ns); less than nothing after a frame that was longer than that.
    left_ns: f64,
    /// When (ns).
    at_ns: u64,
}

impl Ration {
    /// The full ration of a mote: time on air for a whole window.
    #[must_use]
    pub fn new(duty: Duty) -> Self {
        let most_ns = duty.fraction * duty.window_ns as f64;
        Self { fraction: duty.fraction, most_ns, left_ns: most_ns, at_ns: 0 }
    }

    /// What is left (ns).
    fn left_ns(&self, now_ns: u64) -> f64 {
        let back_ns = self.fraction * now_ns.saturating_sub(self.at_ns) as f64;
        self.most_ns.min(self.left_ns + back_ns)
    }

    /// Whether anything is left.
    #[must_use]
    pub fn allows(&self, now_ns: u64) -> bool {
        0.0 < self.left_ns(now_ns)
    }

    /// So long a frame was sent.
    pub fn spend(&mut self, airtime_ns: u64, now_ns: u64) {
        self.left_ns = self.left_ns(now_ns) - airtime_ns as f64;
        self.at_ns = now_ns;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ration_is_used_up_comes_back_and_cannot_be_saved_beyond_its_window() {
        // One part in a hundred of 10 s: 0.1 s.
        let mut ration = Ration::new(Duty { fraction: 0.01, window_ns: 10_000_000_000 });
        let ms = 1_000_000;
        ration.spend(60 * ms, 0);
        assert!(ration.allows(0));
        ration.spend(60 * ms, 0);
        // 20 ms too much come back in 2 s.
        assert!(!ration.allows(2_000 * ms));
        assert!(ration.allows(2_001 * ms));
        ration.spend(100 * ms, 3_600_000 * ms);
        assert!(!ration.allows(3_600_000 * ms));
    }

    #[test]
    fn in_the_long_run_a_mote_sends_that_part_of_the_time() {
        let mut ration = Ration::new(Duty { fraction: 0.002, window_ns: 60_000_000_000 });
        let (slot_ns, airtime_ns) = (10_000_000u64, 4_000_000u64);
        let mut sent_ns = 0;
        let n_slots = 1_000_000;
        for now_ns in (0..n_slots).map(|slot| slot * slot_ns) {
            if ration.allows(now_ns) {
                ration.spend(airtime_ns, now_ns);
                sent_ns += airtime_ns;
            }
        }
        let fraction = sent_ns as f64 / (n_slots * slot_ns) as f64;
        // The first ration comes on top: 60 s of 10,000.
        assert!((fraction / 0.002 - 1.0 - 60.0 / 10_000.0).abs() < 1e-3, "{fraction}");
    }
}
