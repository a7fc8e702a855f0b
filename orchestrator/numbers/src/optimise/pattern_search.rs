//! Pattern search: the direct search of R. Hooke and T. Jeeves (Journal of the ACM 8, 1961) in the general form of T. Kolda, R. Lewis
//! and V. Torczon (SIAM Review 45, 2003).

use super::{Optimum, Termination};

/// Which of the trial points about the best point becomes the next one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Polling {
    /// The best of all.
    Complete,
    /// The first that is better. The others are not evaluated.
    Opportunistic,
}

/// A search among trial points about the best point, at smaller and smaller steps.
#[derive(Clone, Copy, Debug)]
pub struct PatternSearch {
    /// The first step.
    pub step: f64,
    /// The search has converged once the step is not above this.
    pub min_step: f64,
    /// Most iterations.
    pub max_iterations: usize,
    /// Which trial point is taken.
    pub polling: Polling,
    /// The step after an iteration without a better point.
    pub contract: fn(f64) -> f64,
    /// Whether the step contracts after each iteration, also after those that found a better point.
    pub contracts_always: bool,
}

impl Default for PatternSearch {
    fn default() -> Self {
        Self {
            step: 1.0,
            min_step: 0.0,
            max_iterations: usize::MAX,
            polling: Polling::Complete,
            contract: |step| 0.5 * step,
            contracts_always: false,
        }
    }
}

impl PatternSearch {
    /// Maximises `value` from `start`. `poll` gives the trial points about a point for a step.
    pub fn maximise<P: Clone, I: IntoIterator<Item = P>>(
        &self,
        start: P,
        poll: impl Fn(&P, f64) -> I,
        mut value: impl FnMut(&P) -> f64,
    ) -> Optimum<P> {
        let mut best = (value(&start), start);
        let mut step = self.step;
        for _ in 0..self.max_iterations {
            if step <= self.min_step {
                break;
            }
            let mut next: Option<(f64, P)> = None;
            for trial in poll(&best.1, step) {
                let there = value(&trial);
                if next.as_ref().map_or(best.0, |next| next.0) < there {
                    next = Some((there, trial));
                    if self.polling == Polling::Opportunistic {
                        break;
                    }
                }
            }
            if next.is_none() || self.contracts_always {
                step = (self.contract)(step);
            }
            best = next.unwrap_or(best);
        }
        let is_fine = step <= self.min_step;
        let termination = if is_fine { Termination::Converged } else { Termination::Limit };
        Optimum { point: best.1, value: best.0, termination }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn search() -> PatternSearch {
        PatternSearch { step: 0.5, min_step: 1e-6, ..PatternSearch::default() }
    }

    fn compass(point: &[f64; 2], step: f64) -> [[f64; 2]; 4] {
        let [x, y] = *point;
        [[x + step, y], [x - step, y], [x, y + step], [x, y - step]]
    }

    #[test]
    fn a_maximum_on_a_curved_ridge_is_found_with_either_polling() {
        let value = |[x, y]: &[f64; 2]| {
            let (a, b) = (1.0 - x, y - x * x);
            -(a * a + 10.0 * b * b)
        };
        for polling in [Polling::Complete, Polling::Opportunistic] {
            let search = PatternSearch { polling, ..search() };
            let found = search.maximise([-1.2, 1.0], compass, value);
            assert_eq!(found.termination, Termination::Converged);
            assert!(found.point.iter().all(|x| (x - 1.0).abs() < 1e-3), "{polling:?}: {found:?}");
        }
    }

    #[test]
    fn a_staircase_has_no_slope_and_is_climbed() {
        let stairs = |[x, y]: &[f64; 2]| -((x - 3.0).abs().floor() + (y + 2.0).abs().floor());
        let found = PatternSearch { step: 4.0, ..search() }.maximise([20.0, 20.0], compass, stairs);
        assert_eq!(found.value, 0.0, "{found:?}");
    }

    #[test]
    fn trials_without_a_value_are_never_better() {
        let value = |[x, _]: &[f64; 2]| if *x < 1.0 { *x } else { f64::NAN };
        let found = search().maximise([0.0; 2], compass, value);
        assert!(found.value < 1.0 && (found.value - 1.0).abs() < 1e-5, "{found:?}");
    }

    #[test]
    fn complete_polling_takes_the_best_and_opportunistic_the_first() {
        let value = |[x, y]: &[f64; 2]| x + 2.0 * y;
        let one = |polling| {
            let search = PatternSearch { polling, max_iterations: 1, ..search() };
            search.maximise([0.0; 2], compass, value)
        };
        assert_eq!(one(Polling::Complete).point, [0.0, 0.5]);
        assert_eq!(one(Polling::Opportunistic).point, [0.5, 0.0]);
        assert_eq!(one(Polling::Complete).termination, Termination::Limit);
    }

    #[test]
    fn a_step_that_always_contracts_bounds_how_far_the_search_goes() {
        let search = PatternSearch { contracts_always: true, ..search() };
        let found = search.maximise([0.0; 2], compass, |[x, _]| *x);
        assert!((found.point[0] - 1.0).abs() < 1e-5, "0.5 + 0.25 + …: {found:?}");
    }
}
