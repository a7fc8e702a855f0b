//! How well rows that were left out are predicted, and how much better than by another model.

use crate::study::RowScore;
use statrs::distribution::{ContinuousCDF, StudentsT};

/// Means of the scores over all rows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scores {
    /// Log predictive density (nats per row).
    pub log_score: f64,
    /// Root of the mean squared error (dB or m).
    pub rmse: f64,
    /// Continuous ranked probability score (dB or m).
    pub crps: f64,
    /// Log loss of reception (nats per frame); NaN where reception is unknown.
    pub reception_log_loss: f64,
}

/// Mean of what is a number.
pub(crate) fn mean(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, n) = values
        .filter(|value| !value.is_nan())
        .fold((0.0, 0usize), |(sum, n), value| (sum + value, n + 1));
    sum / n as f64
}

impl Scores {
    /// Of rows.
    #[must_use]
    pub fn of(rows: &[RowScore]) -> Self {
        Self {
            log_score: mean(rows.iter().map(|row| row.log)),
            rmse: mean(rows.iter().map(|row| row.squared_error)).sqrt(),
            crps: mean(rows.iter().map(|row| row.crps)),
            reception_log_loss: mean(rows.iter().map(|row| row.reception_log_loss)),
        }
    }

    /// Mean squared error (dB² or m²).
    pub(crate) fn mean_square(&self) -> f64 {
        self.rmse * self.rmse
    }

    /// The greatest share of an error that `self` has less than `parent`.
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

/// What adding a term gains on rows left out.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gain {
    /// Nats per row.
    pub gain: f64,
    /// Its standard error, over blocks.
    pub standard_error: f64,
    /// Probability of as great a gain by chance.
    pub p_value: f64,
    /// Number of blocks.
    pub n_blocks: usize,
    /// Number of rows.
    pub n_rows: usize,
}

impl Gain {
    /// No gain at all.
    pub const NONE: Self =
        Self { gain: 0.0, standard_error: 0.0, p_value: 1.0, n_blocks: 0, n_rows: 0 };

    /// Of all rows together (nats).
    #[must_use]
    pub fn total(&self) -> f64 {
        self.gain * self.n_rows as f64
    }

    /// Of rows in blocks: scores of the candidate less those of its parent.
    #[must_use]
    pub fn of(candidate: &[RowScore], parent: &[RowScore], block_of_row: &[u32]) -> Self {
        let n_blocks = block_of_row.iter().max().map_or(0, |&last| last as usize + 1);
        let mut sums = vec![(0.0, 0usize); n_blocks];
        for ((a, b), &block) in candidate.iter().zip(parent).zip(block_of_row) {
            let difference = a.log - b.log;
            if !difference.is_nan() {
                sums[block as usize].0 += difference;
                sums[block as usize].1 += 1;
            }
        }
        // Rows that are not scored have no part in it.
        sums.retain(|&(_, n)| 0 < n);
        let n_blocks = sums.len();
        let n_rows = sums.iter().map(|&(_, n)| n).sum::<usize>();
        let n = n_rows as f64;
        let gain = sums.iter().map(|(sum, _)| sum).sum::<f64>() / n;
        let blocks = n_blocks as f64;
        let spread: f64 =
            sums.iter().map(|&(sum, n)| (sum - n as f64 * gain) * (sum - n as f64 * gain)).sum();
        let standard_error = (blocks / (blocks - 1.0) * spread).sqrt() / n;
        let p_value = match StudentsT::new(0.0, 1.0, blocks - 1.0) {
            Ok(t) if 0.0 < standard_error => t.sf(gain / standard_error),
            _ => 1.0,
        };
        Self { gain, standard_error, p_value, n_blocks, n_rows }
    }
}
