//! Power that differs from frame to frame.

use super::{Effect, Entry, UNCHECKED};
use crate::scatter::{Law, Renewal, Scatter};
use proto::config::Section;
use proto::effect::{Catalogued, Level, Need};
use proto::rng::Purpose;

/// `kind = "fast-fading"`.
pub const ENTRY: Entry = Entry::new::<FastFading>(UNCHECKED, |table, ordinal| {
    Some(Box::new(FastFading { ordinal, ..FastFading::read(table) }))
});

/// The power of every frame follows a Rice distribution.
///
/// # Mechanism
///
/// While anything moves, the reflected waves add up differently for every frame, in addition to the direct wave.
///
/// # Equation
///
/// ```text
/// RSSI' = RSSI + 10 log10 |sqrt(K/(K+1)) + sqrt(1/(K+1)) g|^2, g complex normal with E|g|^2 = 1, K = 10^(k_factor_db / 10)
/// ```
///
/// # Source
///
/// S. O. Rice, Mathematical analysis of random noise, Bell System Technical Journal 24 (1945) 46; Rappaport, § 5.6.
///
/// # Validity
///
/// Independent from frame to frame, in both directions and on all channels; constant within a frame. The mean power is unchanged,
/// so the mean in dB falls, by 2.51 dB for Rayleigh fading: this is aliased with system-gain. Fades are limited to -60 dB.
///
/// # Trace
///
/// Residuals skewed towards weak frames, with a constant mean.
#[derive(Clone, Copy, Debug, PartialEq, Catalogued, Section)]
#[effect(
    name = "fast-fading",
    needs = &[Need::Readings],
    is_spread = true,
    example = "k_factor_db = 3.0\n",
    level = Level::Random,
)]
pub struct FastFading {
    /// Rician K-factor: power of the direct wave to that of all others (dB). -30 and less: Rayleigh, no direct wave; 6 to 12 with
    /// line of sight.
    #[key(range = -60.0..=60.0)]
    #[fit(unit = "dB", range = -20.0..=30.0, starts = [0.0, 10.0], step = 0.1)]
    pub k_factor_db: f64,
    /// Tells several such effects apart.
    #[key(skip)]
    pub ordinal: u32,
}

impl Effect for FastFading {
    fn scatter(&self) -> Option<Scatter> {
        Some(Scatter {
            law: Law::Rician { k_factor_db: self.k_factor_db },
            renewal: Renewal::Frame,
            purpose: Purpose::FastFading,
            ordinal: self.ordinal,
            directed: true,
        })
    }

    fn is_isotropic(&self) -> bool {
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scatter::{Moment, PairBlock};
    use proto::ids::MoteId;

    fn draws(k_factor_db: f64, n: u64) -> Vec<f64> {
        let scatter = FastFading { k_factor_db, ordinal: 0 }.scatter().unwrap();
        let (most, least) = (scatter.max_gain_db(), -scatter.max_loss_db());
        (0..n)
            .map(|sent_ns| {
                let at = Moment { period_ns: 0, sent_ns, way_m: 0.0, channel: None };
                scatter.value_db(
                    &mut PairBlock::new(5, MoteId(0), MoteId(1), 0),
                    MoteId(0),
                    MoteId(1),
                    at,
                )
            })
            .inspect(|&value_db| assert!(least <= value_db && value_db <= most, "{value_db}"))
            .collect()
    }

    fn mean(values: impl ExactSizeIterator<Item = f64>) -> f64 {
        let n = values.len() as f64;
        values.sum::<f64>() / n
    }

    #[test]
    fn rayleigh_power_is_exponential_with_mean_1() {
        // 40,000 frames; a correct program exceeds one of these bounds for fewer than one seed in 10,000. The seed is fixed.
        let values = draws(-60.0, 40_000);
        let power = mean(values.iter().map(|db| 10f64.powf(db / 10.0)));
        assert!((power - 1.0).abs() < 4.5 / 200.0, "{power}");
        // The mean of ln of an exponential number is minus Euler's constant; its standard deviation is pi/sqrt 6.
        let scale = 10.0 / std::f64::consts::LN_10;
        let level_db = mean(values.iter().copied());
        assert!((level_db + 0.577_215_664_9 * scale).abs() < 4.5 * 1.2825 * scale / 200.0);
        assert!((0.577_215_664_9 * scale - 2.51).abs() < 0.005, "as documented");
        // P(power < x) = 1 - e^-x: a tenth of the mean.
        let deep = values.iter().filter(|&&db| db < -10.0).count() as f64 / 4e4;
        assert!((deep - (1.0 - (-0.1f64).exp())).abs() < 4.5 * (0.095 * 0.905 / 4e4f64).sqrt());
    }

    #[test]
    fn with_a_steady_wave_power_keeps_its_mean_and_has_rices_variance() {
        // The variance of the power is (1 + 2 K)/(1 + K)^2 for unit mean.
        for k_factor_db in [0.0f64, 6.0, 15.0] {
            let k = 10f64.powf(k_factor_db / 10.0);
            let expected = (1.0 + 2.0 * k) / ((1.0 + k) * (1.0 + k));
            let powers: Vec<f64> =
                draws(k_factor_db, 40_000).iter().map(|db| 10f64.powf(db / 10.0)).collect();
            let average = mean(powers.iter().copied());
            assert!(
                (average - 1.0).abs() < 4.5 * expected.sqrt() / 200.0,
                "{k_factor_db}: {average}"
            );
            let variance = mean(powers.iter().map(|power| (power - 1.0).powi(2)));
            // The fourth moment is at most 9 times the squared variance, that of an exponential number.
            assert!((variance / expected - 1.0).abs() < 4.5 * 8f64.sqrt() / 200.0, "{k_factor_db}");
        }
    }
}
