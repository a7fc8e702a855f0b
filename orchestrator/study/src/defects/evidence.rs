//! What the tests of defects compare: the rows, and what a fitted model predicts for each.

use crate::folds::Blocks;
use crate::links::LinkStudy;
use crate::links::fit::LinkFit;
use crate::links::likelihood::{Instrument, RowLikelihood, RowPrediction};
use crate::links::rows::ModelledLinks;
use crate::thresholds::FEWEST_SUMMED_BLOCKS;
use crate::{COMMON, Study as _};
use measure::links::LinkRow;
use statrs::distribution::{Binomial, ContinuousCDF as _, DiscreteCDF as _, StudentsT};
use std::collections::BTreeMap;

/// Steps in which level and noise are fitted.
const STEPS: usize = 12;
/// They are known once a step changes both by less than this (dB; logarithm of the noise).
const CLOSE: f64 = 1e-4;
/// The noise is at least this (dB).
const LEAST_SD_DB: f64 = 0.2;
/// The grid over which the noise of a reading is averaged: its step, and how far it reaches (standard deviations).
const STEP_SD: f64 = 0.125;
const REACH_SD: f64 = 6.0;

/// Rows and the predictions of a model, whose level and noise are fitted to them.
///
/// Random effects per link or node are no part of the predictions: what they would explain is part of the noise, so that tests err
/// towards finding nothing.
#[derive(Debug)]
pub struct Evidence<'a> {
    /// The measurements and the model.
    pub study: &'a LinkStudy,
    /// The fit of the model and the terms that were added to it.
    pub fit: &'a LinkFit,
    /// Noise and reception.
    pub instrument: Instrument,
    /// What is added to the power of all rows (dB).
    pub intercept_db: f64,
    /// What the model says of each row, before `intercept_db`.
    pub levels: Vec<RowPrediction>,
    /// What each row should read if its frame is received (dBm).
    pub mean_dbm: Vec<f64>,
    /// Standard deviation of that (dB).
    pub sd_db: Vec<f64>,
    /// Log likelihood of each row (nats).
    pub logs: Vec<f64>,
    /// Log loss of reception, summed over all rows (nats); 0 where nothing was lost.
    pub log_loss: f64,
}

/// The same readings with other contents of their rows, such as other headings: what the model then says of them.
#[derive(Clone, Debug)]
pub struct Alternative {
    /// Log likelihood of each row (nats).
    pub logs: Vec<f64>,
    /// The reading of each row less its prediction (dB); NaN where nothing was received.
    pub residuals_db: Vec<f64>,
    /// Log loss of reception of each row (nats); 0 where that is unknown.
    pub log_losses: Vec<f64>,
}

/// Which rows of an alternative are compared.
pub type Scope<'a> = &'a dyn Fn(usize) -> bool;

impl<'a> Evidence<'a> {
    /// The evidence under a fit. `None` where readings are taken as given, so that nothing predicts them.
    #[must_use]
    pub fn new(study: &'a LinkStudy, fit: &'a LinkFit) -> Option<Self> {
        let rows = &study.rows;
        if rows.links.readings.is_given {
            return None;
        }
        let levels = study.row_predictions(fit, rows);
        let (instrument, intercept_db) = fitted(&fit.instrument, &rows.links.rows, &levels)?;
        let expected = |level: &RowPrediction| instrument.reading(level, intercept_db, None);
        let (mean_dbm, sd_db) = levels.iter().map(expected).unzip();
        let of_row = |(row, level)| instrument.row_likelihood(row, level, intercept_db).log;
        let logs = rows.links.rows.iter().zip(&levels).map(of_row).collect();
        let losses = rows.links.rows.iter().zip(&levels);
        let log_loss =
            losses.map(|(row, level)| log_loss(&instrument, row, level, intercept_db)).sum();
        Some(Self { study, fit, instrument, intercept_db, levels, mean_dbm, sd_db, logs, log_loss })
    }

    /// What the model says if these rows stand in place of the measured ones; `None`: it cannot predict all of them. `is_refitted`: level
    /// and noise are fitted again, as those of the measured rows were. Else they stay, for rows of which only some would change.
    #[must_use]
    pub fn alternative(&self, rows: &[LinkRow], is_refitted: bool) -> Option<Alternative> {
        let (changed, levels) = self.predicted(rows.iter().copied().enumerate().collect())?;
        let rows = &changed.links.rows;
        let again = if is_refitted { Some(fitted(&self.instrument, rows, &levels)?) } else { None };
        let (instrument, intercept_db) =
            again.as_ref().map_or((&self.instrument, self.intercept_db), |(it, intercept_db)| {
                (it, *intercept_db)
            });
        let each = || rows.iter().zip(&levels);
        let residual_db = |(row, level): (&LinkRow, &RowPrediction)| {
            row.rssi_dbm - instrument.reading(level, intercept_db, None).0
        };
        Some(Alternative {
            logs: each()
                .map(|(row, level)| instrument.row_likelihood(row, level, intercept_db).log)
                .collect(),
            residuals_db: each().map(residual_db).collect(),
            log_losses: each()
                .map(|(row, level)| log_loss(instrument, row, level, intercept_db))
                .collect(),
        })
    }

    /// Some rows, each by its index, with other contents, and what the model says of each; `None`: it cannot predict all of them.
    #[must_use]
    pub fn predicted(
        &self,
        rows: Vec<(usize, LinkRow)>,
    ) -> Option<(ModelledLinks, Vec<RowPrediction>)> {
        let changed = self.modelled().with_some_rows(rows)?;
        let levels = self.study.row_predictions(self.fit, &changed);
        Some((changed, levels))
    }

    /// What an alternative gains in log likelihood over the rows of a scope (nats), and the p-value of that by blocks of time.
    #[must_use]
    pub fn gain(&self, other: &Alternative, is_in: Scope<'_>) -> (f64, f64) {
        let of_block = &self.blocks().dependent();
        let rows = || (0..self.logs.len()).filter(|&row| is_in(row));
        let gain = |row: usize| other.logs[row] - self.logs[row];
        let total = rows().map(gain).sum();
        (total, p_value_by_blocks(rows().map(|row| (of_block[row], gain(row)))))
    }

    /// The share of the squared error of all readings that an alternative removes over the rows of a scope, or that of the log loss of
    /// reception, whichever is greater.
    #[must_use]
    pub fn share_removed(&self, other: &Alternative, is_in: Scope<'_>) -> f64 {
        let (mut square, mut loss) = (0.0, 0.0);
        for row in (0..self.logs.len()).filter(|&row| is_in(row)) {
            if self.rows()[row].rssi_dbm.is_finite() {
                let (now, then) = (self.residual_db(row), other.residuals_db[row]);
                square += now * now - then * then;
            }
            let level = &self.levels[row];
            loss += log_loss(&self.instrument, &self.rows()[row], level, self.intercept_db)
                - other.log_losses[row];
        }
        let by_loss = if 0.0 < self.log_loss { loss / self.log_loss } else { 0.0 };
        (square / self.squared_error()).max(by_loss)
    }

    /// The rows.
    #[must_use]
    pub fn rows(&self) -> &'a [LinkRow] {
        &self.study.rows.links.rows
    }

    /// The rows as the physics sees them.
    #[must_use]
    pub fn modelled(&self) -> &'a ModelledLinks {
        &self.study.rows
    }

    /// Whether each row is one frame, so that a reading is that of one frame.
    #[must_use]
    pub fn has_single_frames(&self) -> bool {
        !self.study.rows.links.readings.is_aggregated
    }

    /// Rows that have a reading, ascending.
    pub fn received(&self) -> impl Iterator<Item = usize> + '_ {
        (0..self.rows().len()).filter(|&row| self.rows()[row].rssi_dbm.is_finite())
    }

    /// The reading of a row less its prediction (dB).
    #[must_use]
    pub fn residual_db(&self, row: usize) -> f64 {
        self.rows()[row].rssi_dbm - self.mean_dbm[row]
    }

    /// Sum of the squared residuals of readings (dB²).
    #[must_use]
    pub fn squared_error(&self) -> f64 {
        self.received().map(|row| self.residual_db(row) * self.residual_db(row)).sum()
    }

    /// Blocks of time, which are independent of each other.
    #[must_use]
    pub fn blocks(&self) -> &'a Blocks {
        self.study.blocks(COMMON)
    }

    /// The probability that a received row reads from `low_dbm` to `high_dbm` before rounding: noise and reception at each strength,
    /// over the same without bounds.
    #[must_use]
    pub fn probability_between(&self, row: usize, low_dbm: f64, high_dbm: f64) -> f64 {
        let level = &self.levels[row];
        let power_dbm = level.power_dbm + self.intercept_db;
        let by_curve = level.stated.is_none() && self.instrument.readings.is_of_received();
        let sd_db = self.instrument.sd_db;
        let n = (REACH_SD / STEP_SD) as i32;
        let (mut all, mut inside) = (0.0, 0.0);
        for &(deviation_db, share) in &self.instrument.spread.0 {
            for step in -n..=n {
                let z = f64::from(step) * STEP_SD;
                let strength_dbm = power_dbm + deviation_db + z * sd_db;
                let passes = if by_curve {
                    self.instrument.curve.probability_at(strength_dbm - level.shift_db)
                } else {
                    1.0
                };
                let weight = share * libm::exp(-0.5 * z * z) * passes;
                // Of the step about this strength, the part inside the bounds.
                let reading_dbm = strength_dbm + level.register_db;
                let half_db = 0.5 * STEP_SD * sd_db;
                let part = (high_dbm.min(reading_dbm + half_db)
                    - low_dbm.max(reading_dbm - half_db))
                    / (2.0 * half_db);
                all += weight;
                inside += weight * part.clamp(0.0, 1.0);
            }
        }
        inside / all
    }
}

/// The log loss of reception of a row (nats), 0 where it is unknown.
fn log_loss(
    instrument: &Instrument,
    row: &LinkRow,
    level: &RowPrediction,
    intercept_db: f64,
) -> f64 {
    if !instrument.readings.has_losses() || !row.received.is_finite() {
        return 0.0;
    }
    let passes = instrument.reception(level, intercept_db).clamp(1e-9, 1.0 - 1e-9);
    -row.received * libm::log(passes) - (row.frames - row.received) * libm::log(1.0 - passes)
}

/// Level (dB) and noise of highest likelihood, by Fisher's scoring: the noise has an information of two for each reading over its
/// logarithm.
fn fitted(
    start: &Instrument,
    rows: &[LinkRow],
    levels: &[RowPrediction],
) -> Option<(Instrument, f64)> {
    let n_readings = rows.iter().filter(|row| row.rssi_dbm.is_finite()).count() as f64;
    // One reading determines the level and leaves nothing for the noise.
    if n_readings < 2.0 {
        return None;
    }
    let (mut intercept_db, mut instrument) = (0.0, start.with_sd(start.sd_db.max(LEAST_SD_DB)));
    for _ in 0..STEPS {
        let mut sum = RowLikelihood::default();
        for (row, level) in rows.iter().zip(levels) {
            let one = instrument.row_likelihood(row, level, intercept_db);
            sum.over_level += one.over_level;
            sum.weight += one.weight;
            sum.over_ln_sd += one.over_ln_sd;
        }
        let most_db = 4.0 * instrument.sd_db;
        let step_db = (sum.over_level / sum.weight).clamp(-most_db, most_db);
        let ln_step = (0.5 * sum.over_ln_sd / n_readings).clamp(-0.7, 0.7);
        if !step_db.is_finite() || !ln_step.is_finite() {
            return None;
        }
        intercept_db += step_db;
        let sd_db = (instrument.sd_db * libm::exp(ln_step)).max(LEAST_SD_DB);
        instrument = instrument.with_sd(sd_db);
        if step_db.abs() < CLOSE && ln_step.abs() < CLOSE {
            break;
        }
    }
    Some((instrument, intercept_db))
}

/// The one-sided p-value of a mean above 0 of sums over blocks, by Student's t: rows of a block depend on each other, blocks do not.
/// `values`: block and value of each row. Fewer than `FEWEST_SUMMED_BLOCKS` blocks show nothing.
#[must_use]
pub fn p_value_by_blocks(values: impl IntoIterator<Item = (u32, f64)>) -> f64 {
    let mut sums: BTreeMap<u32, f64> = BTreeMap::new();
    for (block, value) in values {
        *sums.entry(block).or_insert(0.0) += value;
    }
    let n = sums.len();
    if n < FEWEST_SUMMED_BLOCKS {
        return 1.0;
    }
    let mean = sums.values().sum::<f64>() / n as f64;
    let squares: f64 = sums.values().map(|sum| (sum - mean) * (sum - mean)).sum();
    let error = (squares / (n * (n - 1)) as f64).sqrt();
    if mean <= 0.0 {
        return 1.0;
    }
    match StudentsT::new(0.0, 1.0, (n - 1) as f64) {
        Ok(law) if 0.0 < error => law.sf(mean / error),
        _ => 1.0,
    }
}

/// The probability of at least `n_hits` hits in `n_trials` with this chance each. Where chances differ and this is their mean, the
/// true probability is no greater beyond the mean (W. Hoeffding, On the distribution of the number of successes in independent
/// trials, Ann. Math. Stat. 27, 1956).
#[must_use]
pub fn binomial_p_value(n_hits: usize, n_trials: usize, chance: f64) -> f64 {
    if n_hits == 0 {
        return 1.0;
    }
    match Binomial::new(chance.clamp(0.0, 1.0), n_trials as u64) {
        Ok(law) => law.sf(n_hits as u64 - 1),
        Err(_) => 1.0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_mean_over_blocks_is_tested_by_students_t() {
        // Ten sums with mean 1 and standard deviation 1.054: t = 3.0, 9 degrees of freedom, one-sided p = 0.00748.
        let values = [0.0, 2.0, 0.0, 2.0, 0.0, 2.0, 0.0, 2.0, 0.0, 2.0];
        let rows = values.iter().enumerate().map(|(block, &value)| (block as u32, value));
        let p_value = p_value_by_blocks(rows.clone());
        assert!((p_value - 0.00748).abs() < 1e-4, "{p_value}");
        // Rows of one block are one value.
        let halves = rows.clone().chain(rows).map(|(block, value)| (block, 0.5 * value));
        assert!((p_value_by_blocks(halves) - p_value).abs() < 1e-12);
    }

    #[test]
    fn hits_are_counted_by_the_binomial_law() {
        // At least 3 of 4 with an even chance: 5 of 16.
        assert!((binomial_p_value(3, 4, 0.5) - 5.0 / 16.0).abs() < 1e-12);
        assert!((binomial_p_value(0, 4, 0.5) - 1.0).abs() < 1e-12);
    }

    #[test]
    fn few_blocks_and_means_below_zero_show_nothing() {
        let rows = |n: u32, sign: f64| (0..n).map(move |k| (k, sign * (1.0 + 0.01 * f64::from(k))));
        assert!(p_value_by_blocks(rows(8, 1.0)) < 1e-6);
        assert!((p_value_by_blocks(rows(7, 1.0)) - 1.0).abs() < 1e-12);
        assert!((p_value_by_blocks(rows(8, -1.0)) - 1.0).abs() < 1e-12);
    }
}
