//! Whether a term is worth a fit: a few steps from its starts, with what the parent's numbers do taken as known.

use super::derivatives::Derivatives;
use super::fit::{stepped, uphill};
use super::fit_state::{FitState, damped};
use super::{RobotFit, RobotModel};
use crate::thresholds::{SCREEN_CLIMBING_NATS, SCREEN_QUIET_NATS};

/// Most steps from a start.
const STEPS: usize = 4;

impl RobotModel {
    /// The best of a few steps from the starts of a term on top of its parent, whose derivatives (`known`, at all windows)
    /// are held. None where that does not tell what the term is worth.
    pub(super) fn screened(
        &self,
        parent: &RobotFit,
        known: &Derivatives,
        term: usize,
        train: &[u32],
    ) -> Option<RobotFit> {
        let known = known.at_rows(train);
        let followed = self.begun(parent, term, train).into_iter();
        let (last_gain, fit, at) = followed
            .filter_map(|(fit, at)| self.followed(fit, at, &known, train))
            .max_by(|a, b| a.2.total.total_cmp(&b.2.total))?;
        let is_settled = last_gain < SCREEN_CLIMBING_NATS || parent.log_likelihood < at.total;
        is_settled.then(|| self.ended(fit, at))
    }

    /// Where a start leads, and what the last step gained (nats).
    fn followed(
        &self,
        mut fit: RobotFit,
        mut at: FitState,
        known: &Derivatives,
        train: &[u32],
    ) -> Option<(f64, RobotFit, FitState)> {
        self.settle(&fit, &mut at);
        let numbers = self.numbers_of(&fit.terms);
        let mut gained = 0.0;
        let mut derivatives = known.clone();
        for _ in 0..STEPS {
            fit.density = at.density;
            let here = (&at.residuals[..], &at.paths);
            derivatives.replace_after(known.len(), self.jacobian(&fit, here, train, known.len())?);
            let (information, slope) = self.normal_equations(&fit, &at, &derivatives);
            gained = 0.0;
            for damping in [1e-3, 0.1, 10.0] {
                let matrix = damped(&information, damping);
                let Some(step) = uphill(&matrix, &slope, &at.values, &numbers) else { continue };
                let promised = 0.5 * step.dot(&slope);
                if promised < SCREEN_QUIET_NATS {
                    break;
                }
                fit.values = stepped(&at.values, &step, &numbers);
                if let Some(next) = self.better(&fit, &at, train) {
                    gained = next.total - at.total;
                    at = next;
                    break;
                }
            }
            fit.values.clone_from(&at.values);
            if gained < SCREEN_QUIET_NATS || self.stop.is_set() {
                break;
            }
        }
        Some((gained, fit, at))
    }
}
