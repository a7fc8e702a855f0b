//! A mote's clock: how far it has drifted from true time since it was last corrected.

use crate::dice::Dice;
use serde::{Deserialize, Serialize};

/// A crystal and its last correction.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Clock {
    /// How much too fast (parts per 10⁹, negative: too slow).
    rate_ppb: i64,
    /// When it was corrected (ns).
    corrected_ns: u64,
    /// How far it was off then (ns; positive: its slots begin late).
    offset_ns: i64,
    /// Resolution of a correction (ns): one tick.
    tick_ns: u64,
}

impl Clock {
    /// A clock of a rate error uniform within ±`max_drift_ppm`, corrected in ticks of a `crystal_hz` crystal.
    ///
    /// The rate is constant: temperature and ageing are absent.
    #[must_use]
    pub fn new(max_drift_ppm: f64, crystal_hz: u32, dice: &mut Dice) -> Self {
        let rate_ppb = libm::round(dice.between(-1.0, 1.0) * max_drift_ppm * 1e3) as i64;
        Self { rate_ppb, tick_ns: 1_000_000_000 / u64::from(crystal_hz), ..Self::exact() }
    }

    /// A clock that is always right: a root's, which defines time.
    #[must_use]
    pub fn exact() -> Self {
        Self { rate_ppb: 0, corrected_ns: 0, offset_ns: 0, tick_ns: 0 }
    }

    /// The same crystal, faster by so much (ppm).
    #[must_use]
    pub fn faster(self, ppm: f64) -> Self {
        Self { rate_ppb: self.rate_ppb + libm::round(ppm * 1e3) as i64, ..self }
    }

    /// How far it is off (ns): its slots begin that much after true time.
    #[must_use]
    pub fn deviation_ns(&self, now_ns: u64) -> i64 {
        let elapsed_ns = now_ns.saturating_sub(self.corrected_ns);
        let whole = i64::try_from(elapsed_ns).ok().and_then(|ns| self.rate_ppb.checked_mul(ns));
        self.offset_ns
            - match whole {
                Some(product) => product / 1_000_000_000,
                // After 9 million seconds at 1000 ppm.
                None => (i128::from(self.rate_ppb) * i128::from(elapsed_ns) / 1_000_000_000) as i64,
            }
    }

    /// Takes over the time of another clock that is off by `source_ns`, to within a tick.
    pub fn correct(&mut self, source_ns: i64, now_ns: u64, dice: &mut Dice) {
        self.offset_ns = source_ns + dice.below(self.tick_ns.max(1)) as i64;
        self.corrected_ns = now_ns;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proto::rng::Purpose;

    #[test]
    fn a_clock_drifts_with_its_rate_and_is_put_right_to_a_tick() {
        for seed in 0..200 {
            let mut dice = Dice::new(seed, Purpose::Mac, 1);
            let mut clock = Clock::new(30.0, 32_768, &mut dice);
            assert!(clock.deviation_ns(100_000_000_000).abs() <= 3_000_000);
            clock.correct(-500, 100_000_000_000, &mut dice);
            let after_ns = clock.deviation_ns(100_000_000_000);
            assert!((-500..-500 + 30_518).contains(&after_ns), "{after_ns}");
        }
        assert_eq!(Clock::exact().deviation_ns(u64::MAX), 0);
    }
}
