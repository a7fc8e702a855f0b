//! The likelihood of a fit as a function that is maximised.

use super::{CONVERGED_NATS, FitProblem, Here};
use crate::links::cells::{NewtonStep, Solver};
use nalgebra::{DMatrix, DVector};
use numbers::optimise::levenberg_marquardt::{LevenbergMarquardt, Objective};

impl FitProblem<'_> {
    /// The optimum near a start, and the last step towards it, which holds the information there.
    pub(super) fn climb(&self, start: Here, most_steps: usize) -> (Here, NewtonStep) {
        let search = LevenbergMarquardt {
            damping: 1e-4,
            min_damping: 1e-6,
            singular: (10.0, 1e-3),
            max_iterations: most_steps,
            min_gain: CONVERGED_NATS,
            ..LevenbergMarquardt::default()
        };
        let found = search.maximise(&mut Likelihood(self), start);
        let last = found.step.unwrap_or_else(|| {
            let p = self.n_parameters(&found.point);
            NewtonStep {
                parameters: DVector::zeros(p),
                random: found.point.random.clone(),
                information: DMatrix::zeros(p, p),
                half_log_determinant: 0.0,
            }
        });
        (found.point, last)
    }
}

/// The likelihood of a fit's rows as a function of its parameters, noise and random effects.
struct Likelihood<'a>(&'a FitProblem<'a>);

impl Objective for Likelihood<'_> {
    type Point = Here;
    type Equations = (Vec<f64>, DMatrix<f64>, DVector<f64>);
    type Step = NewtonStep;

    fn value(&self, here: &Here) -> f64 {
        here.log
    }

    fn equations(&mut self, here: &Here) -> Option<Self::Equations> {
        Some(self.0.derivatives(here))
    }

    fn step(
        &mut self,
        here: &Here,
        (jacobian, extra, gradient): &Self::Equations,
        damping: f64,
    ) -> Option<NewtonStep> {
        let solver = Solver {
            cells: self.0.cells,
            train: self.0.train,
            slopes: &here.slopes,
            jacobian,
            n_parameters: gradient.len(),
        };
        solver.step(&here.random, extra, gradient, damping)
    }

    fn advance(&mut self, here: &Here, step: &NewtonStep) -> Result<Here, f64> {
        let next = self.0.moved(here, step);
        let change = next.log - here.log;
        if change.is_finite() && 0.0 <= change { Ok(next) } else { Err(change) }
    }

    fn is_interrupted(&self) -> bool {
        self.0.stop.is_set()
    }
}
