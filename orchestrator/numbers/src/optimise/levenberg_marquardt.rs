//! Newton's method, or that of Gauss and Newton, with the damping of Levenberg and Marquardt.
//!
//! K. Levenberg, Quarterly of Applied Mathematics 2 (1944); D. Marquardt, Journal of the SIAM 11 (1963); J. Nocedal and S. Wright,
//! Numerical Optimization (2006), § 10.3. Bounds by an active set: D. Bertsekas, SIAM Journal on Control and Optimization 20 (1982).
//!
//! An [`Objective`] says what its points and steps are. It may eliminate parameters from its equations, as a mixed model does with
//! random effects; [`damped`] and [`bounded_step`] solve equations that are dense.

use super::Termination;
use nalgebra::{DMatrix, DVector};

/// A function to maximise, such as a log likelihood.
pub trait Objective {
    /// Parameter values, with what was computed from them.
    type Point;
    /// Gradient and information matrix at a point, in the objective's own form.
    type Equations;
    /// A change of the parameters.
    type Step;

    /// The value at a point.
    fn value(&self, point: &Self::Point) -> f64;

    /// Gradient and information matrix at a point; `None`: they are not defined there.
    fn equations(&mut self, point: &Self::Point) -> Option<Self::Equations>;

    /// The step that solves the equations with this damping; `None`: they are singular.
    fn step(
        &mut self,
        point: &Self::Point,
        equations: &Self::Equations,
        damping: f64,
    ) -> Option<Self::Step>;

    /// By how much the quadratic model of the function rises along a step.
    fn predicted_gain(&self, _equations: &Self::Equations, _step: &Self::Step) -> f64 {
        f64::INFINITY
    }

    /// The point after a step.
    ///
    /// # Errors
    ///
    /// The step is refused: by how much it changes the value; −∞ where that change does not show convergence.
    fn advance(&mut self, point: &Self::Point, step: &Self::Step) -> Result<Self::Point, f64>;

    /// Whether the search is to stop after this iteration.
    fn is_interrupted(&self) -> bool {
        false
    }
}

/// Newton's method with a damping that adapts to its success. The damping is the share by which the diagonal of the information matrix
/// is raised.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LevenbergMarquardt {
    /// Damping of the first step.
    pub damping: f64,
    /// Least damping after an accepted step.
    pub min_damping: f64,
    /// Factor of the damping after an accepted step, below 1.
    pub decrease: f64,
    /// Factor of the damping after a refused step, above 1.
    pub increase: f64,
    /// Factor of the damping where the equations are singular, and its least value after that.
    pub singular: (f64, f64),
    /// Most iterations, each with new derivatives.
    pub max_iterations: usize,
    /// Most steps that one iteration tries.
    pub max_trials: usize,
    /// Most steps that all iterations together try.
    pub max_evaluations: usize,
    /// An iteration that gains less has converged. So has one whose refused step loses less, since only rounding stops it.
    pub min_gain: f64,
    /// Iterations in a row that must gain less than that.
    pub patience: usize,
    /// A step that promises less than this is not tried: the search has converged.
    pub min_predicted_gain: f64,
}

impl Default for LevenbergMarquardt {
    fn default() -> Self {
        Self {
            damping: 1e-3,
            min_damping: 0.0,
            decrease: 0.2,
            increase: 10.0,
            singular: (10.0, 0.0),
            max_iterations: 100,
            max_trials: 8,
            max_evaluations: usize::MAX,
            min_gain: 0.0,
            patience: 1,
            min_predicted_gain: 0.0,
        }
    }
}

/// The end of a search.
#[derive(Clone, Debug, PartialEq)]
pub struct Solution<P, S> {
    /// The best point.
    pub point: P,
    /// The last accepted step; where none was accepted, the first one that was tried.
    pub step: Option<S>,
    /// What the last iteration gained; 0 if it accepted no step.
    pub gain: f64,
    /// How the search ended.
    pub termination: Termination,
}

impl LevenbergMarquardt {
    /// Maximises an objective, from a point.
    pub fn maximise<O: Objective>(
        &self,
        objective: &mut O,
        start: O::Point,
    ) -> Solution<O::Point, O::Step> {
        let mut damping = self.damping;
        let (mut n_evaluations, mut n_small) = (0, 0);
        let mut end =
            Solution { point: start, step: None, gain: 0.0, termination: Termination::Limit };
        for _ in 0..self.max_iterations {
            let n_left = self.max_evaluations - n_evaluations;
            if n_left == 0 {
                break;
            }
            end.gain = 0.0;
            let Some(equations) = objective.equations(&end.point) else {
                return Solution { termination: Termination::Undefined, ..end };
            };
            let is_last = n_left <= self.max_trials;
            let mut ended = Some(if is_last { Termination::Limit } else { Termination::Stalled });
            for _ in 0..self.max_trials.min(n_left) {
                n_evaluations += 1;
                let Some(step) = objective.step(&end.point, &equations, damping) else {
                    let (factor, min) = self.singular;
                    damping = (damping * factor).max(min);
                    continue;
                };
                if objective.predicted_gain(&equations, &step) < self.min_predicted_gain {
                    ended = Some(Termination::Converged);
                    break;
                }
                match objective.advance(&end.point, &step) {
                    Ok(next) => {
                        end.gain = objective.value(&next) - objective.value(&end.point);
                        (end.point, end.step, ended) = (next, Some(step), None);
                        damping = (damping * self.decrease).max(self.min_damping);
                        break;
                    }
                    Err(change) => {
                        end.step.get_or_insert(step);
                        if -self.min_gain < change {
                            ended = Some(Termination::Converged);
                            break;
                        }
                        damping *= self.increase;
                    }
                }
            }
            n_small = if end.gain < self.min_gain { n_small + 1 } else { 0 };
            if ended.is_none() && (n_small == self.patience || end.gain == 0.0) {
                ended = Some(Termination::Converged);
            }
            if ended.is_none() && objective.is_interrupted() {
                ended = Some(Termination::Interrupted);
            }
            if let Some(termination) = ended {
                return Solution { termination, ..end };
            }
        }
        end
    }
}

/// An information matrix whose diagonal is raised by this share (Marquardt), and by `floor`: parameters without any effect then
/// stay where they are.
#[must_use]
pub fn damped(information: &DMatrix<f64>, share: f64, floor: f64) -> DMatrix<f64> {
    let mut matrix = information.clone();
    for i in 0..matrix.nrows() {
        matrix[(i, i)] += share * information[(i, i)] + floor;
    }
    matrix
}

/// The step to the maximum of a quadratic function under bounds on the parameters: `bounds` gives the least and the greatest value of
/// each. A parameter at a bound stays there if the step would lead beyond. Clipping the step afterwards would leave the others short of their
/// optimum, and a search would stall at the bound. `None`: the matrix is not positive definite.
#[must_use]
pub fn bounded_step(
    information: &DMatrix<f64>,
    gradient: &DVector<f64>,
    params: &[f64],
    bounds: impl Fn(usize) -> (f64, f64),
) -> Option<DVector<f64>> {
    let (mut matrix, mut gradient) = (information.clone(), gradient.clone());
    loop {
        let step = matrix.clone().cholesky()?.solve(&gradient);
        let leads_out = |&i: &usize| {
            let (min, max) = bounds(i);
            params[i] <= min && step[i] < 0.0 || max <= params[i] && 0.0 < step[i]
        };
        let active: Vec<usize> = (0..params.len()).filter(leads_out).collect();
        if active.is_empty() {
            return Some(step);
        }
        for i in active {
            matrix.row_mut(i).fill(0.0);
            matrix.column_mut(i).fill(0.0);
            matrix[(i, i)] = 1.0;
            gradient[i] = 0.0;
        }
    }
}

#[cfg(test)]
mod tests;
