//! Residuals of windows, and short formulas for their structure.

use super::density::Residual;
use super::{RobotFit, RobotStudy};
use crate::symbolic::{self, FittedFormula, UnexplainedResiduals};
use crate::thresholds::SECOND_DIRECTION_SHARE;
use crate::view::Viewed as _;
use crate::{Component, Residuals, Study as _};
use numbers::power::square;
use numbers::statistics::mean_ignoring_nan;
use robotsim::dynamics::effect::NAMES;

/// A covariate whose error is part of a window's error: both hold the position measured when the window begins.
const SHARES_ITS_ERROR: &str = "measured_speed_mps";
/// The number of a robot.
const AGENT: &str = "agent";
/// What formulas may be multiplied by: what robots lose of their way is a share of it.
const SPEED: &str = "speed_mps";

/// A covariate of each window.
type Covariate<'a> = (&'a str, &'a [f64]);

impl RobotStudy {
    /// Covariates of each window whose errors are independent of the window's, robots' numbers apart: no law follows a number.
    pub(super) fn independent_covariates(&self) -> Vec<(String, Vec<f64>)> {
        let mut covariates = self.covariates();
        covariates.retain(|(name, _)| name != SHARES_ITS_ERROR && name != AGENT);
        covariates
    }

    /// Standardised residuals along and across the motion and, where all campaigns have one frame, to the east and to the north: what pushes
    /// robots in a place pushes them one way, whichever way they move.
    pub(super) fn standardised(&self, fit: &RobotFit) -> Residuals {
        let view = self.view(fit);
        let n = view.predicted.len();
        let mut along: Vec<f64> = (0..n).map(|row| view.scaled_at(row)).collect();
        let mut across: Vec<f64> = (0..n).map(|row| view.scaled_across(row)).collect();
        let frames = &self.model.directions;
        let mut fixed = Vec::new();
        if !self.model.tracks.is_relative() {
            let turned = |by: fn([f64; 2]) -> [f64; 2]| -> Vec<f64> {
                let both = frames.iter().copied().map(by).zip(along.iter().zip(&across));
                both.map(|([of_along, of_across], (along, across))| {
                    of_along * along + of_across * across
                })
                .collect()
            };
            fixed = vec![turned(|[cos, sin]| [cos, -sin]), turned(|[cos, sin]| [sin, cos])];
            // What pushes all robots one way is no structure over the direction in which they move.
            let [east, north] = [0, 1].map(|k: usize| mean_ignoring_nan(fixed[k].iter().copied()));
            for (row, [cos, sin]) in frames.iter().enumerate() {
                along[row] -= cos * east + sin * north;
                across[row] -= cos * north - sin * east;
            }
        }
        let component = |standardised| Component { standardised, is_of_error: true };
        let all = [along, across].into_iter().chain(fixed);
        Residuals { components: all.map(component).collect(), mean_square: None }
    }

    /// The names that formulas may use beside those that every robot has.
    fn is_known(&self, name: &str) -> bool {
        NAMES.iter().any(|(known, _)| *known == name)
            || self.robots().covariates.iter().any(|(column, _)| column == name)
    }

    /// The short formula of a covariate, along the direction in which it explains most of what a fit leaves.
    pub(super) fn formula(
        &self,
        covariate: Covariate<'_>,
        covariates: &[(String, Vec<f64>)],
        fit: &RobotFit,
    ) -> Option<FittedFormula> {
        if !self.is_known(covariate.0) {
            return None;
        }
        let others: Vec<&(String, Vec<f64>)> =
            covariates.iter().filter(|(name, _)| self.is_known(name)).collect();
        let windows: Vec<u32> = (0..self.n_rows() as u32).collect();
        let residuals = self.model.residuals(fit, &windows)?;
        // What acts all the time has acted before the window, too, and part of that is not corrected yet.
        let before_s = self.model.uncorrected_s(self.model.gains(fit));
        let acted_s = |row: usize| self.model.tracks.window_s(row) + before_s[row];
        let over_windows = |value: &dyn Fn(usize, &Residual) -> f64| -> Vec<f64> {
            residuals.iter().enumerate().map(|(row, residual)| value(row, residual)).collect()
        };
        let velocity =
            |part: usize| over_windows(&|row, residual| residual.parts_m[part] / acted_s(row));
        let [ahead, left] = [velocity(0), velocity(1)];
        let turned = |by: &dyn Fn([f64; 2]) -> [f64; 2]| {
            over_windows(&|row, _| {
                let [with_ahead, with_left] = by(self.model.directions[row]);
                with_ahead * ahead[row] + with_left * left[row]
            })
        };
        let east = turned(&|[cos, sin]| [cos, -sin]);
        let north = turned(&|[cos, sin]| [sin, cos]);
        let speed = over_windows(&|row, residual| residual.way_m / self.model.tracks.window_s(row));
        let unexplained = |values, target| UnexplainedResiduals { values, factor: None, target };
        let share = UnexplainedResiduals {
            factor: Some((SPEED, &speed)),
            ..unexplained(&ahead[..], "ahead")
        };
        let total = mean_ignoring_nan(
            residuals.iter().map(|residual| residual.parts_m.iter().map(|m| m * m).sum()),
        );
        // What a formula takes of the mean square error (m²).
        let explained = |deviations: UnexplainedResiduals<'_>| {
            let found = symbolic::of_covariate(covariate, &others, deviations, &self.in_time)?;
            let taken = mean_ignoring_nan((0..residuals.len()).map(|row| {
                let value = deviations.values[row];
                let taken = (value * value - found.rmse * found.rmse) * square(acted_s(row));
                if covariate.1[row].is_finite() { taken } else { 0.0 }
            }));
            Some((taken, found))
        };
        let [east, north] =
            [unexplained(&east, "east"), unexplained(&north, "north")].map(explained);
        let [share, ahead] = [share, unexplained(&ahead, "ahead")].map(explained);
        let left = explained(unexplained(&left, "left"));
        let pairs = [(east, north), (share, left.clone()), (ahead, left)];
        let found = pairs.into_iter().filter_map(|(one, other)| {
            let (one, other) = (one?, other?);
            let (more, less) = if one.0 < other.0 { (other, one) } else { (one, other) };
            let unexplained = total - more.0;
            let is_along_both = SECOND_DIRECTION_SHARE * unexplained < less.0;
            let unexplained = if is_along_both { unexplained - less.0 } else { unexplained };
            let also = is_along_both.then_some((less.1.text, less.1.target));
            Some(FittedFormula { also, rmse: unexplained.max(0.0).sqrt(), ..more.1 })
        });
        // Of two that are as good the simpler.
        let cost = |formula: &FittedFormula| {
            let parts = if formula.also.is_some() { 2 } else { 1 };
            formula.rmse * (1.0 + SECOND_DIRECTION_SHARE * f64::from(parts))
        };
        found.min_by(|a, b| cost(a).total_cmp(&cost(b)))
    }
}
