//! What is left over when no effect gains any more.

use super::RobotStudy;
use crate::diagnose::ladder::{COMMON, Ladder, Search, share_scale};
use crate::diagnose::scan::{self, Residuals, Structure};
use crate::study::folds::Blocks;
use crate::study::view::Viewed as _;

/// A covariate whose error is part of a window's error: both hold the position measured when the window begins.
const SHARES_ITS_ERROR: &str = "measured_speed_mps";

impl RobotStudy {
    /// The strongest structure over a covariate, along or across the motion, that nothing in the model explains.
    #[must_use]
    pub fn left_over(&self, search: &Search<'_, Self>, ladder: &Ladder) -> Option<Structure> {
        let levels: Vec<&Blocks> = [&self.in_time, &self.in_place]
            .into_iter()
            .filter(|blocks| blocks.suffices())
            .collect();
        if !ladder.is_complete() || levels.is_empty() {
            return None;
        }
        let view = self.view(&search.full(&ladder.accepted, COMMON, None));
        let n = view.predicted.len();
        let along: Vec<f64> = (0..n).map(|row| view.scaled_at(row)).collect();
        let across: Vec<f64> = (0..n).map(|row| view.scaled_across(row)).collect();
        let mut covariates = self.covariates();
        covariates.retain(|(name, _)| name != SHARES_ITS_ERROR);
        let (first, last) = (ladder.rungs.first()?, ladder.rungs.last()?);
        let configured = share_scale(first.scores.mean_square(), last.scores.mean_square());
        let residuals = [&along[..], &across].map(|values| Residuals { values, configured });
        scan::strongest(&covariates, &residuals, &levels)
    }
}
