//! The state of a fit between two steps, and what its steps and its derivatives have in common.

use super::curve::Acting;
use super::density::{Residual, ResidualDensity};
use super::motion::ModelPaths;

/// Least share of an information matrix's diagonal that is added to it, and what is added to elements of 0: numbers that change nothing
/// stay where they are.
pub(super) const LEAST_DAMPED: f64 = 1e-9;
pub(super) const DAMPING_FLOOR: f64 = 1e-12;

/// Parts of a fit that a change of parameters leaves unchanged, so that they need not be computed again.
#[derive(Clone, Copy, Default)]
pub(super) struct Unchanged<'a> {
    pub(super) paths: Option<&'a ModelPaths>,
    pub(super) actings: Option<&'a [Acting<'a>]>,
}

/// Parameter values of a fit, with what was computed from them.
pub(super) struct FitState {
    pub(super) values: Vec<f64>,
    pub(super) paths: ModelPaths,
    pub(super) residuals: Vec<Residual>,
    pub(super) density: ResidualDensity,
    pub(super) total: f64,
}
