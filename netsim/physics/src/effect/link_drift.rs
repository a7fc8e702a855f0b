//! An offset of each link that drifts.

use super::drift::Drift;
use super::{Effect, Entry, UNCHECKED};
use crate::scatter::{Law, Renewal, Scatter};
use proto::config::Section;
use proto::effect::{Catalogued, Level, Need, Role};
use proto::rng::Purpose;

/// `kind = "link-drift"`.
pub const ENTRY: Entry = Entry::new::<LinkDrift>(UNCHECKED, |table, ordinal| {
    let LinkDrift { drift } = LinkDrift::read(table);
    Some(Box::new(LinkDrift { drift: Drift { ordinal, ..drift } }))
});

/// An offset of each link, the same in both directions, that changes slowly in time.
///
/// # Mechanism
///
/// People, doors and vehicles come and go, and plants move, near some links and not near others: the received power of a link between
/// stationary nodes varies over minutes.
///
/// # Equation
///
/// ```text
/// RSSI' = RSSI + X(t), X ~ N(0, sd_db^2) per unordered pair; correlation e^(-time / correlation_s)
/// ```
///
/// # Source
///
/// G. E. Uhlenbeck, L. S. Ornstein, Physical Review 36 (1930) 823 (the process); N. Patwari, J. Wilson, RF sensor networks for
/// device-free localization, Proceedings of the IEEE 98 (2010) 1961 (people change links near them).
///
/// # Validity
///
/// Links are independent of each other, although real neighbouring links share obstacles. Clipped at 5 sd.
///
/// # Trace
///
/// Errors of one link that are correlated for minutes and in both directions, but not with those of other links.
///
/// # Model
///
/// A stationary Gauss-Markov process. The same on all channels. Values are those at the begin of a control period.
#[derive(Clone, Copy, Debug, PartialEq, Catalogued, Section)]
#[effect(
    name = "link-drift",
    needs = &[Need::Readings, Need::Time, Need::Still],
    example = "sd_db = 3.0\ncorrelation_s = 300.0\n",
    parameters = Drift::FIT.parameters,
    level = Level::Random,
    role = Role::RandomPerLinkInTime,
)]
pub struct LinkDrift {
    /// Its law.
    #[key(flatten)]
    pub drift: Drift,
}

impl Effect for LinkDrift {
    fn scatter(&self) -> Option<Scatter> {
        (self.drift.sd_db != 0.0).then_some(Scatter {
            law: Law::Normal { sd_db: self.drift.sd_db },
            renewal: Renewal::Time { length_s: self.drift.correlation_s, is_common: false },
            purpose: Purpose::LinkDrift,
            ordinal: self.drift.ordinal,
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
    fn links_drift_by_themselves_and_forget_over_the_correlation_time() {
        let scatter = made("link-drift", "sd_db = 2.0\ncorrelation_s = 100.0").scatter().unwrap();
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
        assert_ne!(value(1, 2, 50.0), value(5, 9, 50.0));
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
