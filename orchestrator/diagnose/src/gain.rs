//! Held-out scores of a model, and the gain of one model over another.

use numbers::power::integer_power;
use numbers::statistics::mean_ignoring_nan;
use statrs::distribution::{ContinuousCDF, StudentsT};
use study::RowScore;
use study::thresholds::{FEWEST_BLOCKS, TIED_ERRORS, UNCORRECTED_LEVEL};

/// Means of the scores over all rows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scores {
    /// Log predictive density (nats per row).
    pub log_score: f64,
    /// Root of the mean squared error (dB or m).
    pub rmse: f64,
    /// Of links: root mean square of readings less predicted mean levels (dB), whatever is received; none where nothing was read.
    pub rmse_received_db: Option<f64>,
    /// Of robots: root mean squared error of predicted headings (rad); none where the body does not turn.
    pub rmse_heading_rad: Option<f64>,
    /// Continuous ranked probability score (dB or m).
    pub crps: f64,
    /// Log loss of reception (nats per frame); NaN where reception is unknown.
    pub reception_log_loss: f64,
}

impl Scores {
    /// Means over rows, values that are NaN ignored.
    #[must_use]
    pub fn mean(rows: &[RowScore]) -> Self {
        let plain_square = mean_ignoring_nan(rows.iter().map(|row| row.plain_squared_error));
        let heading_square =
            mean_ignoring_nan(rows.iter().map(|row| row.heading_squared_error_rad2));
        Self {
            log_score: mean_ignoring_nan(rows.iter().map(|row| row.log)),
            rmse: mean_ignoring_nan(rows.iter().map(|row| row.squared_error)).sqrt(),
            rmse_received_db: Some(plain_square.sqrt()).filter(|rmse_db| rmse_db.is_finite()),
            rmse_heading_rad: Some(heading_square.sqrt()).filter(|rmse_rad| rmse_rad.is_finite()),
            crps: mean_ignoring_nan(rows.iter().map(|row| row.crps)),
            reception_log_loss: mean_ignoring_nan(rows.iter().map(|row| row.reception_log_loss)),
        }
    }

    /// Mean squared error (dB² or m²).
    pub(crate) fn mean_square(&self) -> f64 {
        self.rmse * self.rmse
    }

    /// The share of the parent's error that `self` removes: the greatest over mean squared error, CRPS and log loss of reception.
    pub(crate) fn share_removed(&self, parent: &Self) -> f64 {
        let share = |now: f64, before: f64| {
            let share = 1.0 - now / before;
            if share.is_finite() { share } else { 0.0 }
        };
        share(self.mean_square(), parent.mean_square())
            .max(share(self.crps, parent.crps))
            .max(share(self.reception_log_loss, parent.reception_log_loss))
    }
}

/// Gain in held-out log score from adding a term.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gain {
    /// Mean difference of the log scores (nats per row).
    pub gain: f64,
    /// Its standard error, clustered over blocks (nats per row).
    pub standard_error: f64,
    /// One-sided p-value of the gain by a t test over blocks, corrected for skewness.
    pub p_value: f64,
    /// Number of blocks with a scored row.
    pub n_blocks: usize,
    /// Number of rows that both models score.
    pub n_rows: usize,
}

impl Gain {
    /// No gain at all.
    pub const NONE: Self =
        Self { gain: 0.0, standard_error: 0.0, p_value: 1.0, n_blocks: 0, n_rows: 0 };

    /// The gain summed over all rows (nats).
    #[must_use]
    pub fn total(&self) -> f64 {
        self.gain * self.n_rows as f64
    }

    /// Standard errors beyond which a gain is no chance, with a probability of about 95 %: of a few blocks by Student's t.
    #[must_use]
    pub(crate) fn apart_errors(&self) -> f64 {
        if FEWEST_BLOCKS <= self.n_blocks {
            return TIED_ERRORS;
        }
        StudentsT::new(0.0, 1.0, self.n_blocks.saturating_sub(1) as f64)
            .map_or(f64::INFINITY, |law| -law.inverse_cdf(UNCORRECTED_LEVEL / 2.0))
    }

    /// The gain of a candidate over its parent, from the scores of the same rows under both. `block_of_row`: the block of each row.
    #[must_use]
    pub fn from_scores(candidate: &[RowScore], parent: &[RowScore], block_of_row: &[u32]) -> Self {
        Self::of(candidate, parent, block_of_row, |row| row.log)
    }

    /// The same of another score.
    pub(crate) fn of(
        candidate: &[RowScore],
        parent: &[RowScore],
        block_of_row: &[u32],
        score: impl Fn(&RowScore) -> f64,
    ) -> Self {
        let n_blocks = block_of_row.iter().max().map_or(0, |&last| last as usize + 1);
        let mut sums = vec![(0.0, 0usize); n_blocks];
        for ((a, b), &block) in candidate.iter().zip(parent).zip(block_of_row) {
            let difference = score(a) - score(b);
            if !difference.is_nan() {
                sums[block as usize].0 += difference;
                sums[block as usize].1 += 1;
            }
        }
        Self::of_sums(sums)
    }

    /// The same of sums over blocks: the differences of the scores, and the number of rows.
    pub(crate) fn of_sums(mut sums: Vec<(f64, usize)>) -> Self {
        // Rows that are not scored have no part in it.
        sums.retain(|&(_, n)| 0 < n);
        let n_blocks = sums.len();
        let n_rows = sums.iter().map(|&(_, n)| n).sum::<usize>();
        let n = n_rows as f64;
        let gain = sums.iter().map(|(sum, _)| sum).sum::<f64>() / n;
        let blocks = n_blocks as f64;
        let moment = |power: i32| -> f64 {
            sums.iter().map(|&(sum, n)| integer_power(sum - n as f64 * gain, power)).sum()
        };
        let (squares, cubes) = (moment(2), moment(3));
        let standard_error = (blocks / (blocks - 1.0) * squares).sqrt() / n;
        let skewness =
            blocks / (blocks - 2.0) * cubes / squares * ((blocks - 1.0) / squares).sqrt();
        let unjudged = Self { gain, standard_error, p_value: 1.0, n_blocks, n_rows };
        unjudged.with_p_value(|t| skewness_corrected_t(t, skewness, blocks))
    }

    /// The same gain with the p-value of Student's t, without the correction for skewness.
    #[must_use]
    pub fn by_students_t(self) -> Self {
        self.with_p_value(|t| t)
    }

    /// The same gain with the p-value of Student's t distribution at a transformed t statistic.
    fn with_p_value(self, made_of: impl FnOnce(f64) -> f64) -> Self {
        let p_value = match StudentsT::new(0.0, 1.0, self.n_blocks as f64 - 1.0) {
            Ok(law) if 0.0 < self.standard_error => {
                law.sf(made_of(self.gain / self.standard_error))
            }
            _ => 1.0,
        };
        Self { p_value, ..self }
    }
}

/// Student's t of a mean above 0, of `n` values that are skewed to the right. If a few of them dominate the mean, they dominate its
/// standard error as well, so that t is too small (L. Chen, Testing the mean of skewed distributions, J. Am. Stat. Assoc. 90, 1995).
fn skewness_corrected_t(t: f64, skewness: f64, n: f64) -> f64 {
    if t.is_nan() || t <= 0.0 || skewness.is_nan() || skewness <= 0.0 {
        return t;
    }
    let a = skewness / (6.0 * n.sqrt());
    t + a * (1.0 + 2.0 * t * t) + 4.0 * a * a * (t + 2.0 * t * t * t)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proto::rng::{Draws, Purpose};

    fn gain(values: &[f64]) -> Gain {
        let score = |log: f64| RowScore {
            log,
            squared_error: f64::NAN,
            plain_squared_error: f64::NAN,
            heading_squared_error_rad2: f64::NAN,
            log_of_position: f64::NAN,
            crps: f64::NAN,
            reception_log_loss: f64::NAN,
        };
        let candidate: Vec<RowScore> = values.iter().map(|&value| score(value)).collect();
        let parent = vec![score(0.0); values.len()];
        let blocks: Vec<u32> = (0..values.len() as u32).collect();
        Gain::from_scores(&candidate, &parent, &blocks)
    }

    #[test]
    fn values_that_lie_evenly_are_judged_by_students_t() {
        let values: Vec<f64> = (0..60).map(|k| 0.1 + if k % 2 == 0 { 0.5 } else { -0.5 }).collect();
        let Gain { gain, standard_error, p_value, .. } = gain(&values);
        let law = StudentsT::new(0.0, 1.0, 59.0).unwrap();
        assert!((p_value - law.sf(gain / standard_error)).abs() < 1e-9, "{p_value}");
    }

    #[test]
    fn few_values_that_gain_much_are_no_chance_and_two_are() {
        let with = |n: usize| {
            gain(&(0..60).map(|k| if k < n { 50.0 } else { 0.0 }).collect::<Vec<f64>>()).p_value
        };
        // Student's t would say 0.0017 and 0.08.
        assert!((1e-6..1e-4).contains(&with(8)), "{}", with(8));
        assert!((0.005..0.05).contains(&with(2)), "{}", with(2));
    }

    #[test]
    fn of_four_blocks_more_standard_errors_are_chance_than_of_many() {
        let of = |n_blocks| Gain { n_blocks, ..Gain::NONE }.apart_errors();
        // By tables: 3.18 at three degrees of freedom.
        assert!((of(4) - 3.18).abs() < 0.01, "{}", of(4));
        assert!((of(60) - TIED_ERRORS).abs() < f64::EPSILON);
    }

    /// Gains under a model that is right lie below 0 in the mean, and e^gain is 1 in the mean: a gain of few blocks by chance is
    /// not taken for more than that.
    #[test]
    fn gains_by_chance_are_found_as_often_as_stated_or_less() {
        let draws = Draws::new(5, Purpose::Resample);
        for spread in [0.1_f64, 0.5, 1.0, 2.0] {
            let n_found = (0..2000)
                .filter(|&trial| {
                    let value =
                        |block| spread * draws.normal(trial, block, 0) - 0.5 * spread * spread;
                    gain(&(0..60).map(value).collect::<Vec<f64>>()).p_value < 0.01
                })
                .count();
            assert!(n_found <= 32, "{spread}: {n_found} of 2000");
        }
    }
}
