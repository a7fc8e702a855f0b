//! How dense strengths lie about their mean, under noise and whatever varies beside.

use super::RowLikelihood;
use crate::links::likelihood::reception::PowerMixture;
use numbers::power::integer_power;

/// Step of a table (standard deviations of the noise).
const STEP_SD: f64 = 1.0 / 16.0;
/// A table reaches so many standard deviations beyond the levels of the spread.
const REACH_SD: f64 = 8.0;
/// The weight of a deviation is at least this share of that under the noise alone.
const LEAST_WEIGHT: f64 = 0.1;

/// The density of a deviation from the mean: normal about each level of a spread. Where there is more than one level, it is tabulated.
#[derive(Clone, Debug)]
pub(super) struct FadingDensity {
    spread: PowerMixture,
    /// Variance about each level (dB²).
    variance: f64,
    /// The share of it that is noise, the rest being rounding.
    noise_share: f64,
    /// Logarithm of the greatest density about a level.
    ln_peak: f64,
    from_db: f64,
    step_db: f64,
    rows: Vec<[f64; 4]>,
}

impl FadingDensity {
    /// About the levels of a spread with a variance (dB²) of which the square of `sd_db` is noise; looked up often if `is_tabulated`.
    pub(super) fn new(
        spread: &PowerMixture,
        variance: f64,
        sd_db: f64,
        is_tabulated: bool,
    ) -> Self {
        let about = Self {
            spread: spread.clone(),
            variance,
            noise_share: sd_db * sd_db / variance,
            ln_peak: -0.5 * libm::log(std::f64::consts::TAU * variance),
            from_db: 0.0,
            step_db: variance.sqrt() * STEP_SD,
            rows: Vec::new(),
        };
        if spread.0.len() == 1 || !is_tabulated {
            return about;
        }
        let reach_db = REACH_SD * variance.sqrt();
        let (from_db, to_db) = (spread.least() - reach_db, spread.greatest() + reach_db);
        let n = ((to_db - from_db) / about.step_db).ceil() as usize + 1;
        let rows = (0..n).map(|i| about.logarithm(from_db + i as f64 * about.step_db)).collect();
        Self { from_db, rows, ..about }
    }

    /// Variance about each level (dB²).
    pub(super) fn variance(&self) -> f64 {
        self.variance
    }

    /// Logarithm of the greatest density about a level.
    pub(super) fn ln_peak(&self) -> f64 {
        self.ln_peak
    }

    /// Logarithm of the density at a deviation with its first three derivatives over it. Those of log Σ p e^(d·l/v − l²/2v) are the
    /// cumulants of l/v, given the deviation.
    fn logarithm(&self, deviation_db: f64) -> [f64; 4] {
        let exponent = |level: f64| {
            let d = deviation_db - level;
            -0.5 * d * d / self.variance
        };
        let levels = &self.spread.0;
        let greatest =
            levels.iter().fold(f64::NEG_INFINITY, |most, &(level, _)| most.max(exponent(level)));
        let mut sums = [0.0; 4];
        for &(level, p) in levels {
            let part = p * libm::exp(exponent(level) - greatest);
            let d = (deviation_db - level) / self.variance;
            for (power, sum) in sums.iter_mut().enumerate() {
                *sum += part * integer_power(d, power as i32);
            }
        }
        let [total, ..] = sums;
        let [_, mean, square, cube] = sums.map(|sum| sum / total);
        let third = cube - 3.0 * mean * square + 2.0 * mean * mean * mean;
        [
            self.ln_peak + greatest + libm::log(total),
            -mean,
            square - mean * mean - 1.0 / self.variance,
            -third,
        ]
    }

    /// Log density at a deviation (dB), its derivative over the mean, minus its second derivative, and its derivative over the logarithm
    /// of the noise's standard deviation.
    pub(super) fn log_density_at(&self, deviation_db: f64) -> RowLikelihood {
        if let [(level, _)] = self.spread.0[..] {
            let d = deviation_db - level;
            let z2 = d * d / self.variance;
            return RowLikelihood {
                log: self.ln_peak - 0.5 * z2,
                over_level: d / self.variance,
                weight: 1.0 / self.variance,
                over_ln_sd: self.noise_share * (z2 - 1.0),
                over_ln_link_sd: 0.0,
            };
        }
        let place = (deviation_db - self.from_db) / self.step_db;
        let index = place as usize;
        let [log, first, second] = match self.rows.get(index..index + 2) {
            Some([a, b]) if 0.0 <= place => {
                let part = place - index as f64;
                let between =
                    |k: usize| super::cubic(part, self.step_db, [a[k], a[k + 1]], [b[k], b[k + 1]]);
                [between(0), between(1), between(2)]
            }
            _ => {
                let [log, first, second, _] = self.logarithm(deviation_db);
                [log, first, second]
            }
        };
        RowLikelihood {
            log,
            over_level: -first,
            weight: (-second).max(LEAST_WEIGHT / self.variance),
            // Noise spreads a density as heat spreads: its derivative over the variance is half its second over the deviation.
            over_ln_sd: self.noise_share * self.variance * (second + first * first),
            over_ln_link_sd: 0.0,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Levels as fading makes them: a long tail of weak ones.
    fn fading() -> PowerMixture {
        let levels: Vec<f64> =
            (1..=40).map(|i| 10.0 * libm::log10(-libm::log(f64::from(i) / 41.0))).collect();
        PowerMixture(levels.into_iter().map(|level| (level, 1.0 / 40.0)).collect())
    }

    #[test]
    fn a_table_is_as_good_as_the_sum_that_it_stands_for() {
        // With little noise the levels stand apart, and the density turns within a fraction of the noise.
        for (sd_db, tolerance) in [(0.5f64, 1e-4), (2.0, 1e-5)] {
            let variance = sd_db * sd_db + 1.0 / 12.0;
            let [table, sum] =
                [true, false].map(|is| FadingDensity::new(&fading(), variance, sd_db, is));
            for tenth in -400..200 {
                let deviation_db = f64::from(tenth) * 0.1003;
                let [a, b] = [&table, &sum].map(|density| density.log_density_at(deviation_db));
                let pairs = [
                    (a.log, b.log),
                    (a.over_level, b.over_level),
                    (a.weight, b.weight),
                    (a.over_ln_sd, b.over_ln_sd),
                ];
                for (a, b) in pairs {
                    assert!((a - b).abs() < tolerance * (1.0 + b.abs()), "{deviation_db}: {a} {b}");
                }
            }
        }
    }

    #[test]
    fn slopes_are_those_of_the_density() {
        let log_density = |deviation_db: f64, sd_db: f64| {
            FadingDensity::new(&fading(), sd_db * sd_db + 1.0 / 12.0, sd_db, false)
                .log_density_at(deviation_db)
        };
        for deviation_db in [-12.0, -3.3, 0.0, 2.1, 6.0] {
            let (here, h) = (log_density(deviation_db, 2.0), 1e-4);
            let apart = |f: &dyn Fn(f64) -> f64| (f(h) - f(-h)) / (2.0 * h);
            let by_mean = apart(&|h| log_density(deviation_db - h, 2.0).log);
            let bend = apart(&|h| log_density(deviation_db - h, 2.0).over_level);
            let by_ln_sd = apart(&|h| log_density(deviation_db, 2.0 * libm::exp(h)).log);
            let weight = (-bend).max(LEAST_WEIGHT / (2.0 * 2.0 + 1.0 / 12.0));
            for (slope, difference) in
                [(here.over_level, by_mean), (here.weight, weight), (here.over_ln_sd, by_ln_sd)]
            {
                assert!((slope - difference).abs() < 1e-6, "{deviation_db}: {slope} {difference}");
            }
        }
    }
}
