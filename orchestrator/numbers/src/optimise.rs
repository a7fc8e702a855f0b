//! Methods of optimisation and of root finding, each under its name in the literature.
//!
//! | method | needs | finds |
//! |---|---|---|
//! | [`levenberg_marquardt`] | gradient, and information matrix or Hessian | a local maximum |
//! | [`newton`] | values of a smooth function of one number | a local maximum, and the curvature there |
//! | [`nelder_mead`] | values | a local minimum |
//! | [`pattern_search`] | values, and trial points about a point | a local maximum, also of a staircase |
//! | [`metropolis`] | a log density, and random proposals | a sample of the density |
//! | [`roots`] | values of a function of one number | a change of sign |
//!
//! The methods draw no random numbers and read no clock. A trial whose value is NaN is never taken for a better one.

pub mod levenberg_marquardt;
pub mod metropolis;
pub mod nelder_mead;
pub mod newton;
pub mod pattern_search;
pub mod roots;

/// How a search ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Termination {
    /// The last change of the value, or of the argument, was below the tolerance.
    Converged,
    /// No step improves the value, although the tolerance is not reached: a kink, or derivatives that do not fit the values.
    Stalled,
    /// The search used up its iterations or evaluations.
    Limit,
    /// The objective requested to stop.
    Interrupted,
    /// The objective has no derivatives at the last point.
    Undefined,
}

/// The best point of a search.
#[derive(Clone, Debug, PartialEq)]
pub struct Optimum<P> {
    /// The point.
    pub point: P,
    /// The value there.
    pub value: f64,
    /// How the search ended.
    pub termination: Termination,
}
