//! The likelihood of windows as a function of the numbers of a fit, which is maximised.

use super::derivatives::Derivatives;
use super::fit_state::{DAMPING_FLOOR, FitState};
use super::{RobotFit, RobotModel};
use nalgebra::{DMatrix, DVector};
use numbers::optimise::levenberg_marquardt::{Objective, bounded_step, damped};

/// A number that a fit sets.
#[derive(Clone, Copy, Debug)]
pub(super) struct Number {
    pub(super) min: f64,
    pub(super) max: f64,
    pub(super) step: f64,
}

/// Where the derivatives of residuals come from.
pub(super) enum Slopes {
    /// All are computed at each point.
    Computed,
    /// Those by the first numbers are taken from another fit; the others are computed at each point.
    KnownFirst {
        /// The derivatives by all numbers, of which those after the first `n` are replaced.
        derivatives: Derivatives,
        /// How many are known.
        n: usize,
    },
    /// All are taken from a point with these numbers (the chord method).
    Known(Derivatives, Vec<f64>),
}

/// The likelihood of the windows `train` as a function of the numbers of a fit.
pub(super) struct Likelihood<'a> {
    model: &'a RobotModel,
    train: &'a [u32],
    numbers: Vec<Number>,
    slopes: Slopes,
    /// The terms, with the numbers that were tried last.
    pub(super) fit: RobotFit,
}

impl<'a> Likelihood<'a> {
    pub(super) fn new(
        model: &'a RobotModel,
        fit: RobotFit,
        train: &'a [u32],
        slopes: Slopes,
    ) -> Self {
        Self { model, train, numbers: model.numbers_of(&fit.terms), slopes, fit }
    }
}

impl Objective for Likelihood<'_> {
    type Point = FitState;
    type Equations = (DMatrix<f64>, DVector<f64>);
    type Step = DVector<f64>;

    fn value(&self, at: &FitState) -> f64 {
        at.total
    }

    fn equations(&mut self, at: &FitState) -> Option<Self::Equations> {
        self.fit.density = at.density;
        self.fit.values.clone_from(&at.values);
        let jacobian = |from: usize| {
            self.model.jacobian(&self.fit, (&at.residuals, &at.paths), self.train, from)
        };
        let own;
        let derivatives = match &mut self.slopes {
            Slopes::Computed => {
                own = jacobian(0)?;
                &own
            }
            Slopes::KnownFirst { derivatives, n } => {
                derivatives.replace_after(*n, jacobian(*n)?);
                derivatives
            }
            Slopes::Known(derivatives, start) => {
                let by: Vec<f64> = at.values.iter().zip(start).map(|(a, b)| a - *b).collect();
                own = derivatives.moved(&by);
                &own
            }
        };
        Some(self.model.normal_equations(&self.fit, at, derivatives))
    }

    fn step(
        &mut self,
        at: &FitState,
        (information, slope): &Self::Equations,
        damping: f64,
    ) -> Option<DVector<f64>> {
        let matrix = damped(information, damping, DAMPING_FLOOR);
        let bounds = |i: usize| (self.numbers[i].min, self.numbers[i].max);
        bounded_step(&matrix, slope, &at.values, bounds)
    }

    fn predicted_gain(&self, (_, slope): &Self::Equations, step: &DVector<f64>) -> f64 {
        0.5 * step.dot(slope)
    }

    fn advance(&mut self, at: &FitState, step: &DVector<f64>) -> Result<FitState, f64> {
        let moved = at.values.iter().zip(step.iter()).zip(&self.numbers);
        let within = |((value, step), number): ((&f64, &f64), &Number)| {
            (value + step).clamp(number.min, number.max)
        };
        self.fit.values = moved.map(within).collect();
        let next = self.model.point(&self.fit, self.train);
        let mut next = next.ok_or(f64::NEG_INFINITY)?;
        // The scatters of a step that loses without them are not worth a search, unless it is the only one that is tried.
        let is_only = matches!(self.slopes, Slopes::Known(..));
        if !is_only && next.total <= at.total {
            return Err(f64::NEG_INFINITY);
        }
        self.model.settle(&self.fit, &mut next);
        let gained = next.total - at.total;
        if 0.0 < gained || !is_only { Ok(next) } else { Err(gained) }
    }

    fn is_interrupted(&self) -> bool {
        self.model.stop.is_set()
    }
}
