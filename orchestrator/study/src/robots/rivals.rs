//! Comparison of rival models: where their predictions differ is what to measure next.

use super::terms::Term;
use super::{RobotFit, RobotStudy};
use crate::view::Viewed as _;
use crate::{PredictionDifference, TermId};
use numbers::power::square;

impl RobotStudy {
    /// The distance (m) between the ends that two fits predict of each window.
    pub(super) fn difference_of_ends(
        &self,
        one: &RobotFit,
        other: &RobotFit,
    ) -> Option<PredictionDifference> {
        let ends = |fit: &RobotFit| {
            let (physics, gains) = self.model.physics(fit)?;
            Some(self.model.tracks.ends_m(&physics, gains))
        };
        let by_row = ends(one)?
            .iter()
            .zip(ends(other)?)
            .map(|(a, b)| (0..3).map(|i| square(a[i] - b[i])).sum::<f64>().sqrt())
            .collect();
        let view = self.view(one);
        // Across the motion, where positions tell less.
        let information = view.across.iter().map(|[_, sd_m]| 1.0 / square(*sd_m)).collect();
        Some(PredictionDifference { by_row, unit: "m", information, covariates: self.covariates() })
    }

    /// A fit with a number of an effect at another value; the others follow as far as their estimates are correlated with it.
    pub(super) fn held_at(
        &self,
        fit: &RobotFit,
        term: TermId,
        key: &str,
        value: f64,
    ) -> Option<RobotFit> {
        let Term::Effect(effect) = &self.model.terms[term] else { return None };
        let k = effect.parameters.iter().position(|parameter| parameter.key == key)?;
        let held = fit.first(&self.model, term) + k;
        let covariance = self.model.covariance(fit, &self.in_time)?;
        let moved = value - fit.values[held];
        let mut fit = RobotFit { derivatives: std::sync::Arc::default(), ..fit.clone() };
        for (index, number) in self.model.numbers_of(&fit.terms).iter().enumerate() {
            let follows = covariance[(index, held)] / covariance[(held, held)];
            // A number without information has no correlation to follow.
            if follows.is_finite() {
                fit.values[index] =
                    (fit.values[index] + follows * moved).clamp(number.min, number.max);
            }
        }
        fit.values[held] = value;
        Some(fit)
    }
}
