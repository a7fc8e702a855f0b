//! How likely the share of frames received of a row is, its mean reading being given.
//!
//! The reading is taken for the level u at which the frames arrived. Rows of one level differ by more than the chance of counting:
//! whatever disturbs frames comes and goes, and receivers are not alike. With k frames sent, y the share received and p(u) the
//! probability that a frame passes:
//!
//! ```text
//! y ~ N(m, s² + v)
//! m = p/(1 − q),  v = (p² + p(1 − p)/k)/(1 − q) − m²,  q = (1 − p)^k
//! ```
//!
//! m and v are mean and variance of the share where something was received, as it was wherever there is a reading. s is found with
//! everything else. A binomial alone would be sure of itself by hundreds of nats a row, and one frame of a thousand lost at a level
//! where all pass would decide over the curve.

use super::Instrument;
use super::RowLikelihood;
use super::RowPrediction;
use super::normal_crps;
use crate::RowScore;
use measure::links::LinkRow;

/// Half the way over which slopes are taken (dB): curves are sampled at steps of a tenth.
const HALF_STEP_DB: f64 = 0.01;
const LN_TAU: f64 = 1.837_877_066_409_345_5;

/// Least probability that a frame passes. Below it a row with a reading received one frame, and holds no further information.
const LEAST_PASSES: f64 = 1e-9;

/// Mean and variance of the share of `frames` that are received, each with the probability `passes`, something being received.
fn moments(passes: f64, frames: f64) -> (f64, f64) {
    let any = -libm::expm1(frames * libm::log1p(-passes));
    let mean = passes / any;
    let square = (passes * passes + passes * (1.0 - passes) / frames) / any;
    (mean, (square - mean * mean).max(0.0))
}

impl Instrument {
    /// Mean and variance of the share received of a row `away_db` beyond its level.
    fn moments(&self, row: &LinkRow, level: &RowPrediction, away_db: f64) -> (f64, f64) {
        let power_dbm = level.power_dbm - level.shift_db + away_db;
        let survival = libm::exp(level.ln_survival);
        // Frames that go against the curve make a share less certain, not greater or less.
        let own = moments(LEAST_PASSES.max(self.curve.own_at(power_dbm)) * survival, row.frames);
        let all = moments(self.curve.probability_at(power_dbm) * survival, row.frames);
        (own.0, self.share_sd * self.share_sd + all.1)
    }

    /// The share of the frames of a row that should be received, something being received, and the standard deviation of that.
    #[must_use]
    pub fn share_of(&self, row: &LinkRow, level: &RowPrediction) -> (f64, f64) {
        let (mean, variance) = self.moments(row, level, 0.0);
        (mean, variance.sqrt())
    }

    /// Log likelihood of the share received of a row. Over the logarithm of the noise stands the derivative over that of s.
    pub(super) fn share_likelihood(&self, row: &LinkRow, level: &RowPrediction) -> RowLikelihood {
        let (mean, variance) = self.moments(row, level, 0.0);
        let [below, above] = [-HALF_STEP_DB, HALF_STEP_DB].map(|db| self.moments(row, level, db));
        let over_level = |above: f64, below: f64| (above - below) / (2.0 * HALF_STEP_DB);
        let (rises, widens) =
            (over_level(above.0, below.0), over_level(above.1, below.1) / variance);
        let away = row.received / row.frames - mean;
        let z2 = away * away / variance;
        RowLikelihood {
            log: -0.5 * (z2 + libm::log(variance) + LN_TAU),
            over_level: rises * away / variance + 0.5 * widens * (z2 - 1.0),
            weight: rises * rises / variance + 0.5 * widens * widens,
            over_ln_sd: self.share_sd * self.share_sd / variance * (z2 - 1.0),
            over_ln_link_sd: 0.0,
        }
    }

    /// Scores the prediction of the share received of a row: errors are of that share.
    #[must_use]
    pub fn score_given(&self, row: &LinkRow, level: &RowPrediction) -> RowScore {
        let (mean, sd) = self.share_of(row, level);
        let measured = row.received / row.frames;
        let away = measured - mean;
        let share = mean.clamp(1e-9, 1.0 - 1e-9);
        RowScore {
            log: self.share_likelihood(row, level).log,
            squared_error: away * away,
            plain_squared_error: f64::NAN,
            heading_squared_error_rad2: f64::NAN,
            log_of_position: f64::NAN,
            crps: normal_crps(away, sd),
            reception_log_loss: -measured * libm::log(share)
                - (1.0 - measured) * libm::log(1.0 - share),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::row;
    use super::*;
    use crate::links::likelihood::Noise;
    use crate::links::likelihood::reception::{PowerMixture, SampledCurve};
    use measure::links::{Losses, Readings};
    use numbers::power::square;
    use physics::reception::table::Table;

    fn instrument(share_sd: f64) -> Instrument {
        let readings = Readings {
            quantum_db: 0.0,
            losses: Losses::Logged,
            is_aggregated: true,
            is_given: true,
        };
        let noise = Noise { sd_db: 2.0, link_sd_db: 2.0, share_sd };
        Instrument::new(
            SampledCurve::tabulate(&Table::dust()),
            PowerMixture::none(),
            noise,
            readings,
        )
    }

    fn level(power_dbm: f64) -> RowPrediction {
        RowPrediction {
            power_dbm,
            register_db: 0.0,
            range: crate::links::likelihood::register::PowerRange::shifted(0.0),
            shift_db: 0.5,
            ln_survival: -0.1,
            stated: None,
        }
    }

    #[test]
    fn slopes_are_those_of_the_likelihood() {
        let row = row(100.0, 62.0, -90.0);
        // Amid two samples of the curve, so that it is straight as far as is looked.
        for power_dbm in [-94.95, -92.95, -87.95] {
            let at =
                |power_dbm: f64, sd: f64| instrument(sd).share_likelihood(&row, &level(power_dbm));
            let (here, h) = (at(power_dbm, 0.1), 1e-4);
            let by_level = (at(power_dbm + h, 0.1).log - at(power_dbm - h, 0.1).log) / (2.0 * h);
            let (wider, narrower) =
                (at(power_dbm, 0.1 * (1.0 + h)), at(power_dbm, 0.1 * (1.0 - h)));
            let by_sd = (wider.log - narrower.log) / (2.0 * h);
            // Of an even step the error goes with its square: 10^-4 of what bends over 1 dB.
            for (slope, difference) in [(here.over_level, by_level), (here.over_ln_sd, by_sd)] {
                let tolerance = 1e-3 * difference.abs().max(1.0);
                assert!(
                    (slope - difference).abs() < tolerance,
                    "{power_dbm}: {difference} {here:?}"
                );
            }
            assert!(0.0 < here.weight, "{here:?}");
        }
    }

    #[test]
    fn rows_scatter_by_what_is_added_and_by_chance() {
        // At -85.5 dBm pass 0.95865 of all frames, half between the points of the table at -86 and -85; of these a share e^-0.1 is not
        // lost otherwise. A frame in a thousand may go against it.
        let (mean, sd) = instrument(0.1).share_of(&row(50.0, 50.0, -85.0), &level(-85.0));
        let expected = 0.958_65 * libm::exp(-0.1);
        let with_stray = (0.001 + 0.998 * 0.958_65) * libm::exp(-0.1);
        assert!((mean - expected).abs() < 1e-9, "{mean} {expected}");
        assert!((sd * sd - 0.01 - with_stray * (1.0 - with_stray) / 50.0).abs() < 1e-9, "{sd}");
        let score = instrument(0.1).score_given(&row(50.0, 25.0, -85.0), &level(-85.0));
        assert!((score.squared_error - square(0.5 - expected)).abs() < 1e-9, "{score:?}");
    }

    #[test]
    fn a_row_with_a_reading_received_something() {
        // Below the table nothing passes: of two frames one did, if one at the least.
        let level = RowPrediction { power_dbm: -120.0, ln_survival: 0.0, ..level(0.0) };
        let (mean, sd) = instrument(0.0).share_of(&row(2.0, 1.0, -120.0), &level);
        let (p, any) = (0.001f64, 2.0 * 0.001 - 0.001 * 0.001);
        assert!((mean - 0.5).abs() < 1e-8, "{mean}");
        // A frame in a thousand may pass: one of two did, or with a chance of p²/any both.
        let both = p * p / any;
        let expected = 0.25 * (1.0 - both) + both - square(p / any);
        assert!((sd * sd - expected).abs() < 1e-9, "{sd}");
    }
}
