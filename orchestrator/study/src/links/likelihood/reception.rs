//! The probability that a frame passes, over everything about its strength that is not seen.

use crate::thresholds::STRAY_FRAMES;
use physics::reception::Curve;
use physics::scatter::Law;

/// Step of the tables (dB).
const STEP_DB: f64 = 0.1;
/// The tables reach so many standard deviations beyond the curve.
const REACH_SD: f64 = 6.0;

/// The grid over which noise is averaged: its greatest step, and how far it reaches (standard deviations of the noise).
const KERNEL_STEP_SD: f64 = 1.0 / 8.0;
const KERNEL_REACH_SD: f64 = 5.0;

/// Discrete part of the fading from frame to frame, beside normal noise: deviations from the mean power (dB) with their probabilities.
#[derive(Clone, Debug, PartialEq)]
pub struct PowerMixture(pub Vec<(f64, f64)>);

impl PowerMixture {
    /// How a random contribution varies from frame to frame.
    #[must_use]
    pub fn of_law(law: &Law) -> Self {
        Self(law.levels())
    }

    /// No spread: the deviation is 0 dB with certainty.
    #[must_use]
    pub fn none() -> Self {
        Self(vec![(0.0, 1.0)])
    }

    /// Both, independent of each other.
    #[must_use]
    pub fn and(&self, other: &Self) -> Self {
        let product = |&(a, p): &(f64, f64)| other.0.iter().map(move |&(b, q)| (a + b, p * q));
        Self(self.0.iter().flat_map(product).collect())
    }

    /// The weakest level (dB).
    #[must_use]
    pub fn least(&self) -> f64 {
        self.0.iter().fold(f64::INFINITY, |least, (level, _)| least.min(*level))
    }

    /// The strongest level (dB).
    #[must_use]
    pub fn greatest(&self) -> f64 {
        self.0.iter().fold(f64::NEG_INFINITY, |greatest, (level, _)| greatest.max(*level))
    }

    /// Deviations (dB) from the mean under normal noise about these levels, at equal steps, with weights that sum to 1. Step and reach
    /// beyond the levels are in standard deviations of the noise.
    #[must_use]
    pub fn grid(&self, sd_db: f64, step_sd: f64, reach_sd: f64) -> Vec<(f64, f64)> {
        let sums = self.moments(sd_db, step_sd, reach_sd);
        sums.into_iter().map(|(deviation, [weight, ..])| (deviation, weight)).collect()
    }

    /// The same with, besides each weight, its products with z and z² − 1, z being how many standard deviations of the noise a deviation
    /// lies above the level from which it comes.
    fn moments(&self, sd_db: f64, step_sd: f64, reach_sd: f64) -> Vec<(f64, [f64; 3])> {
        let (least, beyond) = (self.least(), (reach_sd / step_sd).ceil() as i64);
        let span = ((self.greatest() - least) / (step_sd * sd_db)).ceil() as i64;
        let mut grid: Vec<(f64, [f64; 3])> = (-beyond..=span + beyond)
            .map(|i| (least + i as f64 * step_sd * sd_db, [0.0; 3]))
            .collect();
        for &(level, p) in &self.0 {
            for (deviation, sums) in &mut grid {
                let z = (*deviation - level) / sd_db;
                if z.abs() <= reach_sd + step_sd {
                    let weight = p * libm::exp(-0.5 * z * z);
                    sums[0] += weight;
                    sums[1] += weight * z;
                    sums[2] += weight * (z * z - 1.0);
                }
            }
        }
        let total: f64 = grid.iter().map(|(_, [weight, ..])| weight).sum();
        grid.iter_mut().flat_map(|(_, sums)| sums).for_each(|sum| *sum /= total);
        grid
    }

    /// Variance (dB²).
    #[must_use]
    pub fn variance(&self) -> f64 {
        let mean: f64 = self.0.iter().map(|(level, p)| level * p).sum();
        self.0.iter().map(|(level, p)| p * (level - mean) * (level - mean)).sum()
    }
}

/// A reception curve, sampled.
#[derive(Clone, Debug)]
pub struct SampledCurve {
    from_dbm: f64,
    values: Vec<f64>,
    /// From here on all frames pass alike (dBm), and the logarithm of how many.
    level_from_dbm: f64,
    ln_level: f64,
}

impl SampledCurve {
    /// Samples a reception curve at equal steps.
    #[must_use]
    pub fn tabulate(curve: &dyn Curve) -> Self {
        let from_dbm = curve.floor_dbm().max(-200.0);
        let to_dbm = curve.ceiling_dbm().min(100.0).max(from_dbm + 1.0);
        let n = ((to_dbm - from_dbm) / STEP_DB).ceil() as usize + 2;
        let values = (0..n)
            .map(|i| {
                let p = curve.reception_probability(from_dbm + i as f64 * STEP_DB);
                STRAY_FRAMES + (1.0 - 2.0 * STRAY_FRAMES) * p
            })
            .collect();
        Self::new(from_dbm, values)
    }

    fn new(from_dbm: f64, values: Vec<f64>) -> Self {
        let last = values[values.len() - 1];
        let n_before = values.iter().rposition(|&value| value != last).map_or(0, |index| index + 1);
        let level_from_dbm = from_dbm + n_before as f64 * STEP_DB;
        Self { from_dbm, level_from_dbm, ln_level: libm::log(last), values }
    }

    /// Probability that a frame of this strength passes.
    #[must_use]
    pub fn probability_at(&self, dbm: f64) -> f64 {
        let place = (dbm - self.from_dbm) / STEP_DB;
        let last = self.values.len() - 1;
        if place <= 0.0 {
            return self.values[0];
        }
        let index = place as usize;
        if last <= index {
            return self.values[last];
        }
        let part = place - index as f64;
        self.values[index] + part * (self.values[index + 1] - self.values[index])
    }

    /// The same without the frames that go against the curve.
    #[must_use]
    pub fn own_at(&self, dbm: f64) -> f64 {
        ((self.probability_at(dbm) - STRAY_FRAMES) / (1.0 - 2.0 * STRAY_FRAMES)).clamp(0.0, 1.0)
    }

    /// The logarithm of [`Self::probability_at`].
    #[must_use]
    pub fn ln_at(&self, dbm: f64) -> f64 {
        if self.level_from_dbm <= dbm { self.ln_level } else { libm::log(self.probability_at(dbm)) }
    }

    /// Whether frames about as strong as this, by `reach_db`, pass alike: above the curve, or below it.
    #[must_use]
    pub fn is_level(&self, dbm: f64, reach_db: f64) -> bool {
        self.level_from_dbm <= dbm - reach_db || dbm + reach_db <= self.from_dbm
    }

    /// Averages over normal noise about the mean.
    #[must_use]
    pub fn averaged(&self, sd_db: f64, spread: &PowerMixture) -> AveragedCurve {
        let sd_db = sd_db.max(0.05);
        let widest = spread.0.iter().fold(0.0f64, |widest, (level, _)| widest.max(level.abs()));
        let reach = REACH_SD * sd_db + widest;
        let step = (sd_db / 4.0).clamp(STEP_DB, 1.0);
        let from_dbm = self.from_dbm - reach;
        let span = (self.values.len() - 1) as f64 * STEP_DB + 2.0 * reach;
        let n = (span / step).ceil() as usize + 2;
        let kernel = spread.moments(sd_db, (0.5 / sd_db).min(KERNEL_STEP_SD), KERNEL_REACH_SD);
        let moments = |mean: f64| {
            let mut sums = [0.0; 3];
            for (deviation, weights) in &kernel {
                let passes = self.probability_at(mean + deviation);
                for (sum, weight) in sums.iter_mut().zip(weights) {
                    *sum += weight * passes;
                }
            }
            sums
        };
        let values = (0..n).map(|i| moments(from_dbm + i as f64 * step)).collect();
        AveragedCurve { from_dbm, step, sd_db, values }
    }
}

/// The probability that a frame passes as a function of its mean level, noise averaged out, with derivatives.
#[derive(Clone, Debug)]
pub struct AveragedCurve {
    /// The first mean level at which it was computed (dBm).
    pub from_dbm: f64,
    /// The step from one to the next (dB).
    pub step: f64,
    sd_db: f64,
    values: Vec<[f64; 3]>,
}

/// What [`AveragedCurve`] says about a level.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Chance {
    /// Probability that a frame passes.
    pub passes: f64,
    /// Its derivative over the level (1/dB).
    pub slope: f64,
    /// Its second derivative (1/dB²).
    pub bend: f64,
    /// Its derivative over the logarithm of the noise's standard deviation.
    pub over_ln_sd: f64,
    /// Mean deviation of the frames that pass from the mean level (dB), as far as it is due to the normal noise.
    pub received_noise_db: f64,
}

impl AveragedCurve {
    /// The mean levels (dBm) at which it was computed.
    pub fn points(&self) -> impl Iterator<Item = f64> + use<'_> {
        (0..self.values.len()).map(|i| self.from_dbm + i as f64 * self.step)
    }

    /// From the first of them to the last (dB).
    #[must_use]
    pub fn width_db(&self) -> f64 {
        (self.values.len() - 1) as f64 * self.step
    }

    /// The interpolated probability of reception at a mean power (dBm), with its derivatives.
    #[must_use]
    pub fn reception_at(&self, dbm: f64) -> Chance {
        let place = ((dbm - self.from_dbm) / self.step).max(0.0);
        let last = self.values.len() - 1;
        let index = (place as usize).min(last - 1);
        let part = (place - index as f64).min(1.0);
        let (a, b) = (&self.values[index], &self.values[index + 1]);
        let [_, m1, m2] = std::array::from_fn(|k| a[k] + part * (b[k] - a[k]));
        // A cubic through both values with both slopes.
        let width = self.step / self.sd_db;
        let (rise, rest) = (b[0] - a[0], 1.0 - part);
        let bend = rest * (a[1] * width - rise) - part * (b[1] * width - rise);
        let m0 = a[0] + part * rise + part * rest * bend;
        Chance {
            passes: m0,
            slope: m1 / self.sd_db,
            bend: m2 / (self.sd_db * self.sd_db),
            over_ln_sd: m2,
            received_noise_db: self.sd_db * m1 / m0,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A normal distribution function about −90 dBm, 1.5 dB wide: averaged over normal noise of 2 dB it is one of 2.5 dB.
    #[derive(Debug)]
    struct Normal;

    fn below(z: f64) -> f64 {
        0.5 * libm::erfc(-z / std::f64::consts::SQRT_2)
    }

    impl Curve for Normal {
        fn reception_probability(&self, rssi_dbm: f64) -> f64 {
            below((rssi_dbm + 90.0) / 1.5)
        }
        fn floor_dbm(&self) -> f64 {
            -99.0
        }
        fn ceiling_dbm(&self) -> f64 {
            -81.0
        }
    }

    #[test]
    fn a_normal_curve_averaged_over_normal_noise_is_a_wider_one() {
        let averaged = SampledCurve::tabulate(&Normal).averaged(2.0, &PowerMixture::none());
        for z in [-1.5f64, -0.5, 0.0, 1.0, 2.0] {
            let chance = averaged.reception_at(-90.0 + 2.5 * z);
            let density = libm::exp(-0.5 * z * z) / std::f64::consts::TAU.sqrt();
            // A frame in a thousand goes against the curve on either side.
            assert!((chance.passes - below(z)).abs() < 2e-3, "{z}: {chance:?}");
            assert!((chance.slope - density / 2.5).abs() < 2e-3, "{z}: {chance:?}");
            assert!((chance.bend + z * density / 6.25).abs() < 2e-3, "{z}: {chance:?}");
        }
    }
}
