//! Fitting a model of robots: robust least squares (Levenberg and Marquardt) on the windows' residuals, with the scatter
//! that makes them likeliest.

use super::density::Residual;
use super::derivatives::Derivatives;
use super::fit_state::{FitState, LEAST_DAMPED, Unchanged};
use super::motion::ModelPaths;
use super::objective::{Likelihood, Slopes};
use super::{RobotFit, RobotModel};
use crate::TermId;
use crate::folds::Blocks;
use crate::thresholds::CURVE_PRIOR_SD;
use nalgebra::DMatrix;
use numbers::optimise::Termination;
use numbers::optimise::levenberg_marquardt::LevenbergMarquardt;
use std::sync::Arc;

/// Most steps of a fit.
const MOST_STEPS: usize = 60;
/// A fit has converged when a step gains less (nats) …
const CONVERGED_NATS: f64 = 1e-4;
/// … twice in a row.
const CONVERGED_TIMES: usize = 2;
/// A step is not tried that promises less than this share of the gain at which a fit has converged.
const PROMISING: f64 = 0.1;
/// A fit to some of the windows, warm-started from the fit to all, has converged when a step gains less than this (nats). The
/// distance of a fold's fit from its optimum affects scores in second order only, and decisions are about tens of nats. The same
/// holds for thresholds and other numbers that are searched in turn.
const NEAR_NATS: f64 = 1e-2;
/// Most steps of a fit to some of the windows with the derivatives at its start, before they are computed anew.
const CHORD_STEPS: usize = 8;
/// Most further steps of such a fit: where the likelihood has jumps, there is no end to them.
const FOLD_STEPS: usize = 10;
/// Thresholds and other numbers are searched in turn so many times at most.
const SETTLING_TIMES: usize = 5;
/// Steps of a first look at each of several starts.
const LOOK_STEPS: usize = 6;
/// Logarithms of gains that are tried where a fit has converged.
const TRIED_GAINS: [f64; 3] = [-4.0, -2.5, -1.0];
/// How many of several starts are followed.
const N_FOLLOWED: usize = 3;

impl RobotModel {
    /// Fits `terms` to the windows `train`. `start` holds the numbers of some of the terms.
    pub(super) fn fitted(&self, terms: &[TermId], train: &[u32], start: &RobotFit) -> RobotFit {
        // Numbers that are known, and the first term that is not.
        let known: Vec<TermId> =
            terms.iter().copied().filter(|term| start.terms.contains(term)).collect();
        let mut fit = self.fit_to_convergence(self.with_terms(&known, start), train);
        for &term in terms.iter().filter(|term| !known.contains(term)) {
            fit = self.with_term_added(&fit, term, train);
            if self.stop.is_set() {
                return start.clone();
            }
        }
        fit = self.refine_jointly(self.with_gains_tried(fit, train), train);
        // Numbers in the order of the terms.
        if fit.terms == terms { fit } else { self.with_terms(terms, &fit) }
    }

    /// The numbers of a fit for other terms, all of which it has.
    pub(super) fn with_terms(&self, terms: &[TermId], fit: &RobotFit) -> RobotFit {
        let mut values = fit.values[..self.base.len()].to_vec();
        for term in terms {
            values.extend_from_slice(fit.numbers(self, *term));
        }
        RobotFit { terms: terms.to_vec(), values, derivatives: Arc::default(), ..fit.clone() }
    }

    /// A fit with one more term: from the best of its starts.
    fn with_term_added(&self, parent: &RobotFit, term: TermId, train: &[u32]) -> RobotFit {
        let best = self
            .best_starts(parent, term, train)
            .into_iter()
            .map(|(fit, _)| self.maximise(fit, train, LOOK_STEPS, CONVERGED_NATS))
            .max_by(|a, b| a.log_likelihood.total_cmp(&b.log_likelihood));
        self.fit_to_convergence(best.unwrap_or_else(|| parent.clone()), train)
    }

    /// A fit, or a better one with other gains: a model that is wrong trusts each measurement, and the likelihood of a right one may have
    /// a maximum there, too.
    pub(super) fn with_gains_tried(&self, fit: RobotFit, train: &[u32]) -> RobotFit {
        let mut best = fit;
        for index in 0..self.n_gains() {
            let at = |value: f64| {
                let mut tried = RobotFit { derivatives: Arc::default(), ..best.clone() };
                tried.values[index] = value;
                let total = self.point(&tried, train)?.total;
                (best.log_likelihood < total).then_some((tried, total))
            };
            let better = TRIED_GAINS.into_iter().filter_map(at);
            if let Some((tried, _)) = better.max_by(|a, b| a.1.total_cmp(&b.1)) {
                let found = self.fit_to_convergence(tried, train);
                if best.log_likelihood < found.log_likelihood {
                    best = found;
                }
            }
        }
        best
    }

    /// Fits with one more term, at the best of its starts.
    pub(super) fn best_starts(
        &self,
        parent: &RobotFit,
        term: TermId,
        train: &[u32],
    ) -> Vec<(RobotFit, FitState)> {
        let terms: Vec<TermId> = parent.terms.iter().copied().chain([term]).collect();
        let begin = |start: Vec<f64>| {
            let fit = RobotFit {
                terms: terms.clone(),
                values: parent.values.iter().copied().chain(start).collect(),
                derivatives: Arc::default(),
                ..parent.clone()
            };
            let point = self.point(&fit, train)?;
            Some((fit, point))
        };
        let mut starts: Vec<(RobotFit, FitState)> =
            self.starts(term, parent, train).into_iter().filter_map(begin).collect();
        starts.sort_by(|a, b| b.1.total.total_cmp(&a.1.total));
        starts.truncate(N_FOLLOWED);
        starts
    }

    /// Refines thresholds and other parameters jointly, since the optimum of each depends on the others.
    fn refine_jointly(&self, fit: RobotFit, train: &[u32]) -> RobotFit {
        let mut fit = self.refine_thresholds(fit, train);
        // Without a threshold nothing has moved since the fit converged.
        if fit.terms.iter().all(|&term| self.threshold_on(term).is_none()) {
            return fit;
        }
        for _ in 0..SETTLING_TIMES {
            let next = self.refine_thresholds(self.fit_to_convergence(fit.clone(), train), train);
            let gained = next.log_likelihood - fit.log_likelihood;
            if 0.0 < gained {
                fit = next;
            }
            if gained.is_nan() || gained < NEAR_NATS || self.stop.is_set() {
                break;
            }
        }
        fit
    }

    /// A fit that has converged.
    fn fit_to_convergence(&self, fit: RobotFit, train: &[u32]) -> RobotFit {
        self.maximise(fit, train, MOST_STEPS, CONVERGED_NATS)
    }

    /// A fit to some of the windows by one whose derivatives at all windows are known: by steps with these (the chord method),
    /// and by the method of Levenberg and Marquardt where these do not converge.
    pub(super) fn refit_by_chords(
        &self,
        start: &RobotFit,
        derivatives: &Derivatives,
        train: &[u32],
    ) -> RobotFit {
        let Some(mut at) = self.point(start, train) else {
            return self.fit_to_convergence(start.clone(), train);
        };
        self.settle(start, &mut at);
        let search = LevenbergMarquardt {
            damping: LEAST_DAMPED,
            min_damping: LEAST_DAMPED,
            max_iterations: CHORD_STEPS,
            max_trials: 1,
            min_gain: NEAR_NATS,
            min_predicted_gain: NEAR_NATS,
            ..LevenbergMarquardt::default()
        };
        let slopes = Slopes::Known(derivatives.at_rows(train), start.values.clone());
        let mut likelihood = Likelihood::new(self, start.clone(), train, slopes);
        let found = search.maximise(&mut likelihood, at);
        let fit = self.fit_at(likelihood.fit, found.point);
        if found.termination == Termination::Converged {
            return fit;
        }
        self.maximise(fit, train, FOLD_STEPS, NEAR_NATS)
    }

    /// The fit at a point.
    pub(super) fn fit_at(&self, fit: RobotFit, at: FitState) -> RobotFit {
        RobotFit {
            terms: fit.terms,
            values: at.values,
            density: at.density,
            log_likelihood: at.total,
            derivatives: Arc::default(),
        }
    }

    /// Residuals of some windows under a fit's numbers.
    pub(super) fn residuals(&self, fit: &RobotFit, rows: &[u32]) -> Option<Vec<Residual>> {
        self.residuals_and_paths(fit, rows, Unchanged::default()).map(|(residuals, _)| residuals)
    }

    /// Residuals of some windows under a fit's numbers, and the paths of the model alone unless these are known.
    pub(super) fn residuals_and_paths(
        &self,
        fit: &RobotFit,
        rows: &[u32],
        known: Unchanged<'_>,
    ) -> Option<(Vec<Residual>, ModelPaths)> {
        let (physics, gains) = self.physics(fit)?;
        let (paths, all) = match known.paths {
            Some(known) => (ModelPaths::new(), self.tracks.residuals(&physics, known, gains)),
            None => {
                let paths = self.tracks.paths(&physics);
                let all = self.tracks.residuals(&physics, &paths, gains);
                (paths, all)
            }
        };
        let mut residuals: Vec<Residual> = rows.iter().map(|&row| all[row as usize]).collect();
        let own = known.actings.is_none().then(|| self.actings(fit));
        for acting in known.actings.or(own.as_deref()).unwrap_or_default() {
            let numbers = &fit.values[acting.numbers.clone()];
            for (residual, &row) in residuals.iter_mut().zip(rows) {
                for (index, number) in numbers.iter().enumerate() {
                    let column = self.curve_column(acting, index, row, residual);
                    residual.parts_m[0] -= column[0] * number;
                    residual.parts_m[1] -= column[1] * number;
                }
            }
        }
        Some((residuals, paths))
    }

    fn penalty(&self, fit: &RobotFit) -> f64 {
        let curves = fit.terms.iter().filter(|&&term| self.curve(term).is_some());
        let squares: f64 =
            curves.flat_map(|&term| fit.numbers(self, term)).map(|number| number * number).sum();
        0.5 * squares / (CURVE_PRIOR_SD * CURVE_PRIOR_SD)
    }

    /// The fit's numbers with their likeliest noise; the ratio of its scatters stays as it is.
    pub(super) fn point(&self, fit: &RobotFit, train: &[u32]) -> Option<FitState> {
        let (residuals, paths) = self.residuals_and_paths(fit, train, Unchanged::default())?;
        let is_noise_free = self.is_noise_free(&fit.terms);
        let density = fit.density.fitted(&residuals, is_noise_free, false);
        let total = density.total(&residuals) - self.penalty(fit);
        let values = fit.values.clone();
        total.is_finite().then_some(FitState { values, paths, residuals, density, total })
    }

    /// Searches the ratio of the scatters at a point, where directions scatter.
    pub(super) fn settle(&self, fit: &RobotFit, at: &mut FitState) {
        if self.has_direction() {
            let is_noise_free = self.is_noise_free(&fit.terms);
            at.density = at.density.fitted(&at.residuals, is_noise_free, true);
            at.total = at.density.total(&at.residuals) - self.penalty(fit);
        }
    }

    /// Maximises the likelihood by at most so many steps, until one gains less than `converged` (nats).
    fn maximise(
        &self,
        mut fit: RobotFit,
        train: &[u32],
        most_steps: usize,
        converged: f64,
    ) -> RobotFit {
        let Some(mut at) = self.point(&fit, train) else {
            fit.log_likelihood = f64::NEG_INFINITY;
            return fit;
        };
        self.settle(&fit, &mut at);
        let search = LevenbergMarquardt {
            min_damping: LEAST_DAMPED,
            increase: 8.0,
            max_iterations: most_steps,
            min_gain: converged,
            patience: CONVERGED_TIMES,
            min_predicted_gain: PROMISING * converged,
            ..LevenbergMarquardt::default()
        };
        let mut likelihood = Likelihood::new(self, fit, train, Slopes::Computed);
        let found = search.maximise(&mut likelihood, at);
        self.fit_at(likelihood.fit, found.point)
    }

    /// Covariance of the parameters of a fit to all windows, clustered over blocks of windows. Correlations near 1 in it show which
    /// parameters are not identifiable.
    pub(super) fn covariance(&self, fit: &RobotFit, blocks: &Blocks) -> Option<DMatrix<f64>> {
        let all = blocks.fitted();
        let point = self.point(fit, &all)?;
        let derivatives = self.jacobian(fit, (&point.residuals, &point.paths), &all, 0)?;
        let (mut information, _) = self.normal_equations(fit, &point, &derivatives);
        let columns = &derivatives.by;
        let n = columns.len();
        let n_blocks = blocks.n_blocks();
        let mut scores = DMatrix::zeros(n_blocks, n);
        for (row, (residual, &window)) in point.residuals.iter().zip(&all).enumerate() {
            let weight = point.density.weight(residual);
            let sd_m = point.density.sd_m(residual);
            let (parts, scales) = point.density.pulls(residual);
            for part in 0..point.density.n_components() {
                let pull = if part < point.density.n_parts {
                    weight * parts[part] / (sd_m[part] * sd_m[part])
                } else {
                    scales[part] * parts[part]
                };
                for i in 0..n {
                    scores[(blocks.of_row[window as usize] as usize, i)] -=
                        pull * columns[i][row][part];
                }
            }
        }
        for i in 0..n {
            information[(i, i)] = information[(i, i)] * (1.0 + 1e-10) + 1e-12;
        }
        let inverse = information.cholesky()?.inverse();
        let share = n_blocks as f64 / (n_blocks as f64 - 1.0).max(1.0);
        Some(&inverse * (scores.transpose() * &scores) * share * &inverse)
    }
}
