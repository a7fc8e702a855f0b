//! How large the noise of readings can be, by the readings of received frames alone.
//!
//! Lost frames are evidence of noise, too: with more of it, more strong frames are lost and more weak ones pass. A model whose level
//! is far off takes them for a noise that no reading shows, and the mean reading of frames that are received then lies far from the
//! mean level. Readings bound the noise from above, as follows.
//!
//! Let readings be normal about the mean level with standard deviation σ, and let the frames above a power be received: `a` standard
//! deviations above the mean level. The mean square of the received about the mean level is (N. L. Johnson, S. Kotz and
//! N. Balakrishnan, Continuous Univariate Distributions, vol. 1, 2nd ed., § 13.10.1)
//!
//! ```text
//! E[x² | x > a σ] = σ² (1 + a φ(a) / (1 − Φ(a)))
//! ```
//!
//! which is least at a = −0.840, where it is 0.7055 σ². A probability of reception that never falls with the power is a mixture of
//! such thresholds, so that the bound holds for any curve of reception: where the model is right, σ is at most 1.1906 times the root
//! mean square of the plain errors.

use super::{FitProblem, NOISE_DB};
use crate::links::likelihood::{Noise, RowPrediction};
use crate::links::predict::plain_error_db;
use crate::thresholds::{NOISE_BOUND_ERRORS, NOISE_BOUND_RATIO};

/// The greatest standard deviation of the noise (dB) that plain errors allow: readings less mean levels (dB), NaN of lost frames.
/// Infinite if no frame was received.
pub(in crate::links) fn greatest_sd_db(plain_errors_db: impl Iterator<Item = f64>) -> f64 {
    let (mut squares, mut n) = (0.0, 0.0);
    for error_db in plain_errors_db.filter(|error_db| !error_db.is_nan()) {
        squares += error_db * error_db;
        n += 1.0;
    }
    if n == 0.0 {
        return f64::INFINITY;
    }
    NOISE_BOUND_RATIO * f64::sqrt(squares / n) * (1.0 + NOISE_BOUND_ERRORS / f64::sqrt(2.0 * n))
}

impl FitProblem<'_> {
    /// The noise, no greater than the readings of received frames allow. `levels`: of the rows that are fitted, without random
    /// effects. These follow the readings, so that errors about levels with them would be too small; without, the bound is looser.
    pub(in crate::links) fn bounded(&self, noise: Noise, levels: &[RowPrediction]) -> Noise {
        // The bound is derived for readings of single frames.
        if self.rows.links.readings.is_aggregated || self.fixed_sd_db.is_some() {
            return noise;
        }
        let errors_db = self.train.iter().zip(levels).map(|(&row, level)| {
            plain_error_db(self.rows.links.rows[row as usize].rssi_dbm, level, 0.0)
        });
        let most_db = greatest_sd_db(errors_db).clamp(NOISE_DB.0, NOISE_DB.1);
        Noise { sd_db: noise.sd_db.min(most_db), ..noise }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proto::rng::{Draws, Purpose};

    /// Readings of noise of 1 dB, received above a threshold (standard deviations above the mean level).
    fn received(threshold: f64) -> impl Iterator<Item = f64> {
        let draws = Draws::new(3, Purpose::Resample);
        (0..200_000).map(move |row| {
            let reading_db = draws.normal(row, 0, 0);
            if threshold < reading_db { reading_db } else { f64::NAN }
        })
    }

    #[test]
    fn the_noise_is_within_the_bound_wherever_frames_are_lost() {
        for threshold in [-3.0, -1.5, -0.84, 0.0, 1.0, 2.0] {
            let most_db = greatest_sd_db(received(threshold));
            assert!(1.0 <= most_db, "{threshold}: {most_db}");
        }
        // The threshold at which the bound is sharp: 200,000 draws say it to 0.5 %, and the allowance for chance is as much.
        let sharp_db = greatest_sd_db(received(-0.84));
        assert!(sharp_db < 1.015, "{sharp_db}");
    }

    #[test]
    fn a_constant_bias_bounds_the_noise_by_its_own_size() {
        let biased = (0..800).map(|row| if row % 2 == 0 { 15.0 } else { f64::NAN });
        let most_db = greatest_sd_db(biased);
        let expected_db = 15.0 * 1.1906 * (1.0 + 3.0 / 800.0_f64.sqrt());
        assert!((most_db - expected_db).abs() < 1e-9, "{most_db}");
        assert_eq!(greatest_sd_db([f64::NAN].into_iter()), f64::INFINITY);
    }
}
