//! What a search for missing effects asks of robot samples: the trait [`Study`].

use super::density::Residual;
use super::motion::MotionWindow;
use super::terms::{Starts, Term};
use super::{RobotFit, RobotStudy};
use crate::folds::Blocks;
use crate::limits::NotLimited;
use crate::linear::{Column, Dependence, Direction, Linearised, Partition, Signature};
use crate::symbolic::FittedFormula;
use crate::thresholds::TAIL_90;
use crate::{
    Candidate, Estimate, PerTerm, PredictionDifference, Residuals, RowScore, Study, TermId,
    caution, is_as_wide, joined,
};
use measure::robots::RobotSamples;
use numbers::normal::Z_90;
use numbers::power::square;
use proto::effect::Level;
use statrs::distribution::{ContinuousCDF, StudentsT};
use std::sync::PoisonError;

impl Study for RobotStudy {
    type Fit = RobotFit;

    fn candidates(&self) -> &PerTerm<Candidate> {
        &self.candidates
    }

    fn n_rows(&self) -> usize {
        self.model.tracks.windows.len()
    }

    fn is_stopped(&self) -> bool {
        self.model.stop.is_set()
    }

    fn design_effect(&self) -> f64 {
        self.model.tracks.n_overlapping
    }

    fn blocks(&self, level: Level) -> &Blocks {
        match level {
            Level::Place => &self.in_place,
            Level::Time | Level::Random | Level::Run => &self.in_time,
        }
    }

    fn fit(
        &self,
        terms: &[TermId],
        train: &[u32],
        _level: Level,
        start: Option<&RobotFit>,
    ) -> RobotFit {
        let is_all = train.len() == self.n_fitted;
        let sorted = {
            let mut sorted = terms.to_vec();
            sorted.sort_unstable();
            sorted
        };
        // A fit to all rows depends on the set of terms, not on their order: searches ask for the same set again.
        if is_all && let Some(fit) = self.cached_fit(&sorted) {
            return self.model.with_terms(terms, &fit);
        }
        let start = start.unwrap_or(&self.configured);
        if self.is_stopped() {
            return start.clone();
        }
        // A fold's fit starts where all rows lead.
        if !is_all && start.terms == terms {
            let derivatives = start.derivatives.get_or_init(|| self.model.derivatives(start));
            if let Some(derivatives) = derivatives {
                return self.model.refit_by_chords(start, derivatives, train);
            }
        }
        let fit = self.model.fitted(terms, train, start);
        if is_all && !self.is_stopped() {
            let mut cache = self.cache.lock().unwrap_or_else(PoisonError::into_inner);
            cache.insert(sorted.clone(), self.model.with_terms(&sorted, &fit));
        }
        fit
    }

    fn screen(&self, terms: &[TermId], _level: Level, parent: &RobotFit) -> Option<RobotFit> {
        let (&term, before) = terms.split_last()?;
        // The parent's derivatives are in the order of its terms.
        if before != parent.terms || self.is_stopped() {
            return None;
        }
        let known = parent.derivatives.get_or_init(|| self.model.derivatives(parent)).as_ref()?;
        self.model.screen_term(parent, known, term, &self.fitted_rows())
    }

    fn do_headings_drift(&self) -> bool {
        self.robots().shape.is_turning() && self.headings_drift()
    }

    fn beginnings(&self) -> Option<Vec<bool>> {
        let tracks = &self.model.tracks;
        let RobotSamples { samples, tracks: ranges, .. } = &tracks.robots;
        let is_first = |(row, window): (usize, &MotionWindow)| {
            let begin_s = samples[ranges[window.track as usize].start].time_s;
            tracks.start(window).time_s < begin_s + tracks.window_s(row)
        };
        Some(tracks.windows.iter().enumerate().map(is_first).collect())
    }

    fn prediction_difference(
        &self,
        one: &RobotFit,
        other: &RobotFit,
    ) -> Option<PredictionDifference> {
        self.difference_of_ends(one, other)
    }

    fn scanned_covariates(&self) -> Vec<(String, Vec<f64>)> {
        self.independent_covariates()
    }

    fn scanned_blocks(&self) -> Vec<&Blocks> {
        [&self.in_time, &self.in_place].into_iter().filter(|blocks| blocks.are_many()).collect()
    }

    fn scanned_residuals(&self, fit: &RobotFit) -> Residuals {
        self.standardised(fit)
    }

    fn formula_of_curve(&self, term: TermId, fit_without: &RobotFit) -> Option<FittedFormula> {
        let (Term::Curve(curve), Some(name)) =
            (&self.model.terms[term], self.candidates[term].curve_over())
        else {
            return None;
        };
        self.formula((name, curve.values()), &self.independent_covariates(), fit_without)
    }

    fn formula_of_residuals(&self, covariate: &str, fit: &RobotFit) -> Option<FittedFormula> {
        if self.robots().commands.is_inertial() {
            return None;
        }
        let covariates = self.independent_covariates();
        let (name, values) = covariates.iter().find(|(name, _)| name == covariate)?;
        self.formula((name, values), &covariates, fit)
    }

    fn with_parameter_held(
        &self,
        fit: &RobotFit,
        term: TermId,
        key: &str,
        value: f64,
    ) -> Option<RobotFit> {
        self.held_at(fit, term, key, value)
    }

    fn linearised(&self, fit: &RobotFit) -> Option<Linearised> {
        self.linearised_at(fit)
    }

    fn columns(&self, fit: &RobotFit, term: TermId) -> Vec<Column> {
        self.signatures_of(fit, term).into_iter().map(|signature| signature.column).collect()
    }

    fn signatures(&self, fit: &RobotFit, term: TermId) -> Vec<Signature> {
        self.signatures_of(fit, term)
    }

    fn is_searched_for(&self, term: TermId) -> bool {
        matches!(&self.model.terms[term], Term::Effect(it) if matches!(it.starts, Starts::Discs(_)))
    }

    fn columns_of_curve(&self, fit: &RobotFit, term: TermId) -> Vec<Column> {
        self.curve_columns_of(fit, term)
    }

    fn directions(&self) -> Vec<Direction> {
        self.directions_of()
    }

    fn partitions(&self) -> Vec<Partition> {
        self.partitions_of()
    }

    fn dependence(&self) -> Dependence {
        self.dependence_of()
    }

    fn add_limited(&mut self, term: TermId, limits: &toml::Table) -> Result<TermId, NotLimited> {
        self.limit(term, limits)
    }

    fn contradiction(&self, fit: &RobotFit, term: TermId) -> Option<String> {
        self.contradicted(fit, term)
    }

    fn is_collinear(&self, fit: &RobotFit, term: TermId) -> bool {
        let covariance = self.model.covariance(fit, &self.in_time);
        matches!(&self.model.terms[term], Term::Effect(_))
            && self.confounded(fit, term, covariance.as_ref()).is_some()
    }

    fn begins_in_time(&self, term: TermId) -> bool {
        matches!(&self.model.terms[term], Term::Effect(effect) if effect.has_beginning())
    }

    fn log_likelihood(&self, fit: &RobotFit) -> f64 {
        fit.log_likelihood
    }

    fn scores(&self, fit: &RobotFit, test: &[u32]) -> Vec<RowScore> {
        let residuals = self.model.residuals(fit, test).unwrap_or_default();
        let score = |residual: &Residual| RowScore {
            log: fit.density.log(residual),
            squared_error: residual.parts_m.iter().map(|part| part * part).sum(),
            plain_squared_error: f64::NAN,
            heading_squared_error_rad2: square(residual.heading_rad),
            log_of_position: if fit.density.heading.is_some() {
                fit.density.log_of_position(residual)
            } else {
                f64::NAN
            },
            crps: fit.density.crps_m(residual),
            reception_log_loss: f64::NAN,
        };
        residuals.iter().map(score).collect()
    }

    fn estimates(&self, fit: &RobotFit, term: TermId) -> (Vec<Estimate>, Option<String>) {
        let effect = match &self.model.terms[term] {
            Term::Effect(effect) => effect,
            Term::Noise(_) => return (vec![self.noise(fit)], None),
            Term::Curve(_) => return (Vec::new(), None),
        };
        let numbers = fit.numbers(&self.model, term);
        let first = fit.first(&self.model, term);
        let covariance = self.model.covariance(fit, &self.in_time);
        let freedom = (self.in_time.n_blocks() as f64 - 1.0).max(1.0);
        let quantile =
            StudentsT::new(0.0, 1.0, freedom).map_or(Z_90, |t| t.inverse_cdf(1.0 - TAIL_90));
        // A threshold is the only number of its effect.
        let by_likelihood = effect
            .threshold_on()
            .filter(|_| !self.is_stopped())
            .and_then(|_| self.model.threshold_interval(fit, term, &self.fitted_rows()));
        let mut cautions = Vec::new();
        let estimates = effect
            .parameters
            .iter()
            .zip(numbers)
            .enumerate()
            .map(|(index, (parameter, &value))| {
                if let Some((low, high)) = by_likelihood {
                    let ends = (low, high);
                    let mut estimate = Estimate::new(parameter.key, parameter.unit, value, ends);
                    let ends = [estimate.low, estimate.high];
                    estimate.is_identifiable = !is_as_wide(ends, [parameter.min, parameter.max]);
                    cautions.extend(caution(parameter, &estimate));
                    return estimate;
                }
                let variance =
                    covariance.as_ref().map_or(f64::NAN, |c| c[(first + index, first + index)]);
                let half = quantile * variance.sqrt();
                let span = parameter.max - parameter.min;
                let (low, high) = if half.is_finite() {
                    ((value - half).max(parameter.min), (value + half).min(parameter.max))
                } else {
                    (parameter.min, parameter.max)
                };
                let mut estimate = Estimate::new(parameter.key, parameter.unit, value, (low, high));
                let is_wide = is_as_wide([low, high], [parameter.min, parameter.max]);
                estimate.is_identifiable = !half.is_nan() && half < span && !is_wide;
                cautions.extend(caution(parameter, &estimate));
                estimate
            })
            .collect();
        (estimates, joined(cautions).or_else(|| self.confounded(fit, term, covariance.as_ref())))
    }

    fn settings(&self, fit: &RobotFit, term: TermId) -> Option<toml::Table> {
        self.effect_table(fit, term)
    }
}
