//! The likelihood of a fit as a function that is maximised.

use super::CONVERGED_NATS;
use super::FitProblem;
use super::Point;
use crate::links::random_effects::{NewtonStep, Solver};
use nalgebra::{DMatrix, DVector};
use numbers::optimise::levenberg_marquardt::{LevenbergMarquardt, Objective};

impl FitProblem<'_> {
    /// The optimum near a start, and the last step towards it, which holds the information there.
    pub(super) fn maximum(&self, start: Point, most_steps: usize) -> (Point, NewtonStep) {
        let search = LevenbergMarquardt {
            damping: 1e-4,
            min_damping: 1e-6,
            singular: (10.0, 1e-3),
            max_iterations: most_steps,
            min_gain: CONVERGED_NATS,
            ..LevenbergMarquardt::default()
        };
        let found = search.maximise(&mut Likelihood(self), start);
        let lm_step = found.step.unwrap_or_else(|| {
            let p = self.n_parameters(&found.point);
            NewtonStep {
                parameters: DVector::zeros(p),
                random: found.point.random.clone(),
                information: DMatrix::zeros(p, p),
                half_log_determinant: 0.0,
            }
        });
        (found.point, lm_step)
    }
}

/// The likelihood of a fit's rows as a function of its parameters, noise and random effects.
struct Likelihood<'a>(&'a FitProblem<'a>);

impl Objective for Likelihood<'_> {
    type Point = Point;
    type Equations = (Vec<f64>, DMatrix<f64>, DVector<f64>);
    type Step = NewtonStep;

    fn value(&self, point: &Point) -> f64 {
        point.log
    }

    fn equations(&mut self, point: &Point) -> Option<Self::Equations> {
        Some(self.0.derivatives(point))
    }

    fn step(
        &mut self,
        point: &Point,
        (jacobian, extra, gradient): &Self::Equations,
        damping: f64,
    ) -> Option<NewtonStep> {
        let solver = Solver {
            cells: self.0.cells,
            train: self.0.train,
            slopes: &point.likelihoods,
            jacobian,
            n_parameters: gradient.len(),
        };
        solver.step(&point.random, extra, gradient, damping)
    }

    fn advance(&mut self, point: &Point, step: &NewtonStep) -> Result<Point, f64> {
        let next = self.0.after_step(point, step);
        let change = next.log - point.log;
        if change.is_finite() && 0.0 <= change { Ok(next) } else { Err(change) }
    }

    fn is_interrupted(&self) -> bool {
        self.0.stop.is_set()
    }
}
