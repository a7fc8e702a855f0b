//! An offset of the received power that is common to all links and drifts.

use super::{Effect, Entry, UNCHECKED};
use crate::scatter::{Law, Renewal, Scatter};
use proto::config::Section;
use proto::effect::{Catalogued, Level, Need, Role};
use proto::rng::Purpose;

/// `kind = "drift"`.
pub const ENTRY: Entry = Entry::new::<Drift>(UNCHECKED, |table, ordinal| {
    Some(Box::new(Drift { ordinal, ..Drift::read(table) }))
});

/// An offset of the received power that is common to all links and changes slowly in time.
///
/// # Mechanism
///
/// Gain of the common electronics, supply voltage, weather and the crowd at a site change over minutes and hours, for all links at
/// once. Without a covariate for it, it appears as an offset that varies slowly.
///
/// # Equation
///
/// ```text
/// RSSI' = RSSI + X(t), X ~ N(0, sd_db^2), the same for all links; correlation e^(-time / correlation_s)
/// ```
///
/// # Source
///
/// G. E. Uhlenbeck, L. S. Ornstein, Physical Review 36 (1930) 823 (the process); C. A. Boano et al., IEEE Trans. Industrial
/// Informatics 6 (2010) 451 (levels of an outdoor network that follow the day).
///
/// # Validity
///
/// One offset for all links, regardless of motion. If a measured covariate varies in the same way, prefer it as the cause. Clipped
/// at 5 sd.
///
/// # Trace
///
/// Errors that are correlated across all links for minutes, and that no covariate explains.
#[derive(Clone, Copy, Debug, PartialEq, Catalogued, Section)]
#[effect(
    name = "drift",
    needs = &[Need::Readings, Need::Time],
    example = "sd_db = 1.5\ncorrelation_s = 300.0\n",
    level = Level::Random,
    role = Role::RandomInTime,
)]
pub struct Drift {
    /// Standard deviation (dB).
    #[key(range = 0.0..=20.0)]
    #[fit(unit = "dB", starts = [1.0], step = 0.1)]
    pub sd_db: f64,
    /// Time over which the correlation falls to 1/e (s).
    #[key(range = 1.0..=1e6, default = 300.0)]
    #[fit(unit = "s", starts = [30.0, 100.0, 300.0, 1000.0], step = 10.0)]
    pub correlation_s: f64,
    /// Tells several such effects apart.
    #[key(skip)]
    pub ordinal: u32,
}

impl Effect for Drift {
    fn scatter(&self) -> Option<Scatter> {
        (self.sd_db != 0.0).then_some(Scatter {
            law: Law::Normal { sd_db: self.sd_db },
            renewal: Renewal::Time { length_s: self.correlation_s, is_common: true },
            purpose: Purpose::Drift,
            ordinal: self.ordinal,
            directed: false,
        })
    }

    fn is_isotropic(&self) -> bool {
        true
    }
}

#[cfg(test)]
mod tests {
    use crate::effect::testing::made;
    use crate::scatter::{Moment, PairBlock};
    use proto::ids::MoteId;

    #[test]
    fn all_links_drift_together_and_forget_over_the_correlation_time() {
        let scatter = made("drift", "sd_db = 2.0\ncorrelation_s = 100.0").scatter().unwrap();
        let value = |a: u32, b: u32, time_s: f64| {
            let period_ns = (1e9 * time_s) as u64;
            let at = Moment { period_ns, sent_ns: period_ns, way_m: 0.0, channel: None };
            scatter.value_db(
                &mut PairBlock::new(7, MoteId(a), MoteId(b), period_ns),
                MoteId(a),
                MoteId(b),
                at,
            )
        };
        assert_eq!(value(1, 2, 50.0), value(2, 1, 50.0));
        assert_eq!(value(1, 2, 50.0), value(5, 9, 50.0));
        assert_ne!(value(1, 2, 50.0), value(1, 2, 90.0));
        // 2,000 values, 16 correlation times apart: independent. Variance 4 with a standard error of 0.13, correlation e^-1 = 0.37
        // over 100 s with one of 0.02; beyond 4.5 of them one seed in 150,000.
        let pairs: Vec<(f64, f64)> = (0..2000)
            .map(|k| {
                (value(0, 1, 1600.0 * f64::from(k)), value(0, 1, 1600.0 * f64::from(k) + 100.0))
            })
            .collect();
        let mean = |f: fn(&(f64, f64)) -> f64| pairs.iter().map(f).sum::<f64>() / 2000.0;
        let variance = mean(|pair| pair.0 * pair.0);
        assert!((variance - 4.0).abs() < 0.58, "{variance}");
        let correlation = mean(|pair| pair.0 * pair.1) / variance;
        assert!((correlation - 0.368).abs() < 0.09, "{correlation}");
    }
}
