//! What a fitted model predicts for the rows, and their residuals.

mod correction;
pub mod directions;
mod estimates;
mod view;

use crate::links::LinkStudy;
use crate::links::fit::LinkFit;
use crate::links::likelihood::{Instrument, RegisterResponse, RowPrediction};
use crate::links::random_effects::RowCells;
use crate::links::terms::TermSpec;
use crate::links::terms::active::AlteredRegister;
use crate::symbolic::{self, FittedFormula, UnexplainedResiduals};
use crate::thresholds::LEAST_EXPECTED_PASS;
use crate::{Component, PredictionDifference, Residuals, RowScore, TermId};
use numbers::power::square;
use numbers::statistics::mean_ignoring_nan;
use physics::effect::formula::NAMES;
use proto::effect::CONSTANT;
use std::collections::BTreeMap;

/// What formulas of readings are added to …
const MEAN: &str = "mean";
/// … and those of losses.
const LOSS: &str = "loss";

/// What a model predicts for a row.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Predicted {
    /// What a received row should read (dBm).
    pub rssi_dbm: f64,
    /// Standard deviation of that (dB).
    pub sd_db: f64,
    /// Probability of reception, or the share of frames.
    pub passes: f64,
    /// Standard deviation of what is received about that.
    pub passes_sd: f64,
    /// The mean level that decides over reception (dBm).
    pub level_dbm: f64,
}

/// The instrument of a fit where the level has a variance (dB²) of its own: made in steps of 2 % of the noise.
pub(super) fn instrument_for<'a>(
    fit: &LinkFit,
    extra: f64,
    tables: &'a mut BTreeMap<i64, Instrument>,
) -> &'a Instrument {
    let variance = fit.instrument.sd_db * fit.instrument.sd_db + extra;
    let key = (25.0 * libm::log(variance)).round() as i64;
    tables.entry(key).or_insert_with(|| fit.instrument.with_sd(libm::exp(key as f64 / 50.0)))
}

/// Residuals of all rows, NaN where there is none.
#[derive(Clone, Debug)]
pub struct LinkResiduals {
    /// Deviations of readings (dB); where readings are given, of the share of frames received.
    pub deviation: Vec<f64>,
    /// The same in standard deviations.
    pub scaled: Vec<f64>,
    /// Surprise of reception in standard deviations; NaN where readings are given.
    pub surprise: Vec<f64>,
}

/// The random effects of a row.
#[derive(Clone, Copy, Debug)]
pub(super) struct RandomEffect {
    /// Its best linear unbiased prediction: the posterior mode.
    blup_db: f64,
    /// Its posterior variance (dB²).
    variance: f64,
}

impl RandomEffect {
    pub(super) fn for_row(fit: &LinkFit, cells: &RowCells, row: usize) -> Self {
        Self { blup_db: fit.random.level_db(cells, row), variance: fit.random.variance(cells, row) }
    }
}

/// A reading less the mean level that is predicted for its frame (dB), whatever is received; NaN where nothing was read.
pub(super) fn plain_error_db(rssi_dbm: f64, level: &RowPrediction, blup_db: f64) -> f64 {
    rssi_dbm - level.power_dbm - blup_db - level.range.offset_db
}

impl LinkStudy {
    /// Scores one row.
    pub(super) fn score(
        &self,
        fit: &LinkFit,
        row: usize,
        (level, otherwise): (&RowPrediction, &AlteredRegister<'_>),
        RandomEffect { blup_db, variance }: RandomEffect,
        tables: &mut BTreeMap<i64, Instrument>,
    ) -> RowScore {
        let measured = &self.rows.links.rows[row];
        let read = otherwise.read(&self.rows, row);
        let read = read.as_ref().map(|read| read as RegisterResponse<'_>);
        if fit.instrument.readings.is_given {
            return fit.instrument.score_given(measured, level);
        }
        let plain_db = plain_error_db(measured.rssi_dbm, level, blup_db);
        let score = if fit.instrument.readings.is_aggregated {
            fit.instrument.score_row(measured, level, (blup_db, variance), read)
        } else {
            instrument_for(fit, variance, tables).score(measured, level, blup_db, read)
        };
        RowScore { plain_squared_error: plain_db * plain_db, ..score }
    }

    /// What a fit predicts for every row.
    #[must_use]
    pub fn predictions(&self, fit: &LinkFit) -> Vec<Predicted> {
        let specs = self.specs_of(&fit.terms);
        let cells = self.cells(fit.scales);
        let otherwise = fit.otherwise(&self.rows);
        let mut tables: BTreeMap<i64, Instrument> = BTreeMap::new();
        let one = |row: usize| {
            let level = fit.level((&self.rows, &specs), row, &otherwise);
            let RandomEffect { blup_db, variance } = RandomEffect::for_row(fit, &cells, row);
            let level_dbm = level.power_dbm + blup_db - level.shift_db;
            let read = otherwise.read(&self.rows, row);
            let read = read.as_ref().map(|read| read as RegisterResponse<'_>);
            if fit.instrument.readings.is_given {
                let measured = &self.rows.links.rows[row];
                let (passes, passes_sd) = fit.instrument.share_of(measured, &level);
                let (rssi_dbm, sd_db) = (measured.rssi_dbm, f64::NAN);
                return Predicted { rssi_dbm, sd_db, passes, passes_sd, level_dbm };
            }
            if fit.instrument.readings.is_aggregated {
                let measured = &self.rows.links.rows[row];
                let [rssi_dbm, sd_db, passes, passes_sd] =
                    fit.instrument.row_of(measured, &level, (blup_db, variance), read);
                return Predicted { rssi_dbm, sd_db, passes, passes_sd, level_dbm };
            }
            let instrument = instrument_for(fit, variance, &mut tables);
            let (rssi_dbm, sd_db) = instrument.reading(&level, blup_db, read);
            let passes = instrument.reception(&level, blup_db);
            let passes_sd = (passes * (1.0 - passes)).max(1e-6).sqrt();
            Predicted { rssi_dbm, sd_db, passes, passes_sd, level_dbm }
        };
        (0..self.rows.len()).map(one).collect()
    }

    /// Residuals of the rows under a fit.
    #[must_use]
    pub fn residuals(&self, fit: &LinkFit) -> LinkResiduals {
        let nothing = vec![f64::NAN; self.rows.len()];
        let [deviation, scaled, surprise] = [nothing.clone(), nothing.clone(), nothing];
        let mut all = LinkResiduals { deviation, scaled, surprise };
        for (row, predicted) in self.predictions(fit).into_iter().enumerate() {
            let measured = &self.rows.links.rows[row];
            if self.rows.links.readings.is_given {
                all.deviation[row] = measured.received / measured.frames - predicted.passes;
                all.scaled[row] = all.deviation[row] / predicted.passes_sd;
                continue;
            }
            if measured.rssi_dbm.is_finite() {
                all.deviation[row] = measured.rssi_dbm - predicted.rssi_dbm;
                all.scaled[row] = all.deviation[row] / predicted.sd_db;
            }
            if self.rows.links.readings.has_losses() && measured.received.is_finite() {
                let share = measured.received / measured.frames;
                all.surprise[row] = (share - predicted.passes) / predicted.passes_sd;
            }
        }
        all
    }

    /// The share of frames that was lost of those that should have passed, row by row; NaN where hardly one should.
    fn excess_losses(&self, fit: &LinkFit) -> Vec<f64> {
        let lost = |(row, predicted): (usize, Predicted)| {
            let measured = &self.rows.links.rows[row];
            let share = 1.0 - measured.received / measured.frames / predicted.passes;
            if predicted.passes < LEAST_EXPECTED_PASS { f64::NAN } else { share }
        };
        self.predictions(fit).into_iter().enumerate().map(lost).collect()
    }

    /// Covariates of these rows that a formula may name.
    fn formula_covariates<'a>(
        &self,
        covariates: &'a [(String, Vec<f64>)],
    ) -> Vec<&'a (String, Vec<f64>)> {
        let is_known = |name: &String| {
            NAMES.iter().any(|(known, _)| known == name)
                || self.rows.links.covariates.iter().any(|(column, _)| column == name)
        };
        covariates.iter().filter(|(name, _)| is_known(name)).collect()
    }

    /// Standardised residuals of readings and of reception.
    pub(super) fn standardised(&self, fit: &LinkFit) -> Residuals {
        let LinkResiduals { deviation, scaled, surprise } = self.residuals(fit);
        Residuals {
            components: vec![
                Component { standardised: scaled, is_of_error: true },
                Component { standardised: surprise, is_of_error: false },
            ],
            mean_square: Some(mean_ignoring_nan(deviation.iter().map(|d| d * d))),
        }
    }

    /// The formula of an accepted curve, for the residuals of a fit without it.
    pub(super) fn curve_as_formula(
        &self,
        term: TermId,
        fit_without: &LinkFit,
    ) -> Option<FittedFormula> {
        let TermSpec::Curve(curve) = &self.specs[term] else { return None };
        let (deviation, target) = if curve.is_loss {
            (self.excess_losses(fit_without), LOSS)
        } else {
            (self.residuals(fit_without).deviation, MEAN)
        };
        if curve.covariate == CONSTANT {
            return symbolic::constant(&deviation, target);
        }
        let covariates = self.covariates();
        let others = self.formula_covariates(&covariates);
        let deviations = UnexplainedResiduals { values: &deviation, factor: None, target };
        symbolic::of_covariate((&curve.covariate, &curve.values), &others, deviations, &self.time)
    }

    /// The formula of a covariate, for the residuals of readings.
    pub(super) fn residuals_as_formula(
        &self,
        covariate: &str,
        fit: &LinkFit,
    ) -> Option<FittedFormula> {
        let covariates = self.covariates();
        let (name, values) = covariates.iter().find(|(name, _)| name == covariate)?;
        let LinkResiduals { deviation, .. } = self.residuals(fit);
        let others = self.formula_covariates(&covariates);
        let deviations = UnexplainedResiduals { values: &deviation, factor: None, target: MEAN };
        symbolic::of_covariate((name, values), &others, deviations, &self.time)
    }
}

/// Levels that are closer (dB) are the same.
const SAME_DB: f64 = 1e-6;

impl LinkStudy {
    /// The difference of two fits, row by row: of the levels that they predict or, where these are the same, of the probability of
    /// reception.
    pub(super) fn difference_by_row(&self, one: &LinkFit, other: &LinkFit) -> PredictionDifference {
        let (one, other) = (self.predictions(one), self.predictions(other));
        let both = || one.iter().zip(&other);
        let by_row: Vec<f64> = both().map(|(a, b)| (a.rssi_dbm - b.rssi_dbm).abs()).collect();
        let readings = &self.rows.links.readings;
        let are_frames = readings.has_losses() && !readings.is_aggregated;
        // A frame has a reading if it is received.
        let of_reading = |row: &Predicted| {
            let received = if are_frames { row.passes } else { 1.0 };
            received / square(row.sd_db)
        };
        let of_delivery = |row: &Predicted| 1.0 / square(100.0 * row.passes_sd);
        let (by_row, unit, information): (Vec<f64>, _, Vec<f64>) =
            if by_row.iter().any(|&apart_db| SAME_DB < apart_db) {
                (by_row, "dB", one.iter().map(of_reading).collect())
            } else {
                let points = both().map(|(a, b)| 100.0 * (a.passes - b.passes).abs());
                (points.collect(), "points of delivery", one.iter().map(of_delivery).collect())
            };
        let known = |it: f64| if it.is_finite() { it } else { 0.0 };
        let information = information.into_iter().map(known).collect();
        PredictionDifference { by_row, unit, information, covariates: self.covariates() }
    }
}
