//! Whether a term is worth a fit: a few steps from its starts, with what the parent's numbers do taken as known.

use super::derivatives::Derivatives;
use super::fit_state::FitState;
use super::objective::{Likelihood, Slopes};
use super::{RobotFit, RobotModel};
use crate::TermId;
use crate::thresholds::{SCREEN_CLIMBING_NATS, SCREEN_QUIET_NATS};
use numbers::optimise::Termination;
use numbers::optimise::levenberg_marquardt::LevenbergMarquardt;

/// Most steps from a start.
const STEPS: usize = 4;

impl RobotModel {
    /// The best of a few steps from the starts of a term on top of its parent, whose derivatives (`known`, at all windows)
    /// are held. None where that does not tell what the term is worth.
    pub(super) fn screen_term(
        &self,
        parent: &RobotFit,
        known: &Derivatives,
        term: TermId,
        train: &[u32],
    ) -> Option<RobotFit> {
        let known = known.at_rows(train);
        let (last_gain, fit, at) = self
            .best_starts(parent, term, train)
            .into_iter()
            .filter_map(|(fit, at)| self.steps_from(fit, at, &known, train))
            .max_by(|a, b| a.2.total.total_cmp(&b.2.total))?;
        let is_settled = last_gain < SCREEN_CLIMBING_NATS || parent.log_likelihood < at.total;
        is_settled.then(|| self.fit_at(fit, at))
    }

    /// Where a start leads, and what the last step gained (nats).
    fn steps_from(
        &self,
        fit: RobotFit,
        mut at: FitState,
        known: &Derivatives,
        train: &[u32],
    ) -> Option<(f64, RobotFit, FitState)> {
        self.settle(&fit, &mut at);
        // Each step tries the same three dampings.
        let search = LevenbergMarquardt {
            min_damping: 1e-3,
            decrease: 0.0,
            increase: 100.0,
            singular: (100.0, 0.0),
            max_iterations: STEPS,
            max_trials: 3,
            min_gain: SCREEN_QUIET_NATS,
            min_predicted_gain: SCREEN_QUIET_NATS,
            ..LevenbergMarquardt::default()
        };
        let slopes = Slopes::KnownFirst { derivatives: known.clone(), n: known.len() };
        let mut likelihood = Likelihood::new(self, fit, train, slopes);
        let found = search.maximise(&mut likelihood, at);
        let is_defined = found.termination != Termination::Undefined;
        is_defined.then_some((found.gain, likelihood.fit, found.point))
    }
}
