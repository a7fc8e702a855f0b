//! Where a function of one number changes its sign: R. Brent, Algorithms for Minimization without Derivatives (1973), chapter 4; M. Dowell
//! and P. Jarratt, BIT 11 (1971), for the Illinois variant of false position.

/// The place between two numbers where a condition that holds at `inside` and not at `outside` stops to hold, by `n` bisections. The
/// error is at most the distance of the two, over 2 to the power of `n + 1`.
#[must_use]
pub fn bisection(inside: f64, outside: f64, n: usize, holds: impl Fn(f64) -> bool) -> f64 {
    let (mut inside, mut outside) = (inside, outside);
    for _ in 0..n {
        let middle = 0.5 * (inside + outside);
        *(if holds(middle) { &mut inside } else { &mut outside }) = middle;
    }
    0.5 * (inside + outside)
}

/// A point of a function.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// The argument.
    pub x: f64,
    /// The value there.
    pub y: f64,
}

/// The root between `low`, where the function is below 0, and `high`, where it is not: by false position, where the value at an end that
/// stays twice is halved (Illinois). The first step meets the root of a straight line.
///
/// The search ends once the value, or the distance of both ends, is below `tolerance`.
#[must_use]
pub fn illinois(
    value: impl Fn(f64) -> f64,
    (mut low, mut high): (Sample, Sample),
    tolerance: f64,
    max_iterations: usize,
) -> f64 {
    let mut was_below = None;
    for _ in 0..max_iterations {
        let x = ((low.x * high.y - high.x * low.y) / (high.y - low.y)).clamp(low.x, high.x);
        let between = Sample { x, y: value(x) };
        if between.y.abs() < tolerance || high.x - low.x < tolerance {
            return x;
        }
        let is_below = between.y < 0.0;
        *(if is_below { &mut low } else { &mut high }) = between;
        if was_below == Some(is_below) {
            (if is_below { &mut high } else { &mut low }).y *= 0.5;
        }
        was_below = Some(is_below);
    }
    high.x
}

/// Search for the distance from the minimum of a function that is nearly a parabola at which it has risen by so much: as for the ends of
/// a profile-likelihood interval. Each step scales the distance by the root of the ratio of wanted and found rise; once the distance is bracketed,
/// a step out of the bracket is replaced by a bisection.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ParabolicRoot {
    /// Most evaluations of the function.
    pub max_iterations: usize,
    /// A step changes the distance at most by this factor.
    pub max_ratio: f64,
    /// The search has converged once a step would change the distance by less than this share.
    pub tolerance: f64,
}

impl ParabolicRoot {
    /// The distance, searched from `start`; `max` where the function has not risen by `rise` there.
    pub fn find(&self, value: impl Fn(f64) -> f64, rise: f64, start: f64, max: f64) -> f64 {
        let (mut near, mut far) = (0.0, f64::INFINITY);
        let mut x = start.min(max);
        for _ in 0..self.max_iterations {
            let y = value(x);
            if y < rise {
                near = x;
                if max <= x {
                    break;
                }
            } else {
                far = x;
            }
            let ratio = (rise / y.max(1e-9)).sqrt().clamp(1.0 / self.max_ratio, self.max_ratio);
            let next = (x * ratio).min(max);
            let is_outside = next <= near || far <= next;
            x = if far.is_finite() && is_outside { 0.5 * (near + far) } else { next };
            if (ratio - 1.0).abs() < self.tolerance {
                break;
            }
        }
        x
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::cell::Cell;

    #[test]
    fn a_parabola_takes_one_step_and_one_more_to_see_it() {
        let search = ParabolicRoot { max_iterations: 2, max_ratio: 4.0, tolerance: 1e-9 };
        let root = search.find(|x| 0.5 * x * x, 1.353, 1.0, 10.0);
        assert!((root - 2.706_f64.sqrt()).abs() < 1e-12, "{root}");
        assert_eq!(search.find(|x| 0.5 * x * x, 1.353, 5.0, 1.5), 1.5, "not beyond the bound");
    }

    #[test]
    fn a_function_that_is_no_parabola_is_bracketed() {
        let search = ParabolicRoot { max_iterations: 60, max_ratio: 4.0, tolerance: 1e-6 };
        let quartic = search.find(|x| x * x * x * x, 1.0, 3.0, 10.0);
        assert!((quartic - 1.0).abs() < 1e-5, "{quartic}");
        // A step function has no ratio of 1: the bracket closes on its edge.
        let step = search.find(|x| if x < 0.7 { 0.1 } else { 9.0 }, 1.0, 0.01, 10.0);
        assert!((step - 0.7).abs() < 1e-6, "{step}");
    }

    #[test]
    fn bisection_halves_the_bracket_in_either_direction() {
        let root = bisection(0.0, 2.0, 50, |x| x * x < 2.0);
        assert!((root - std::f64::consts::SQRT_2).abs() < 1e-14, "{root}");
        let root = bisection(2.0, 0.0, 50, |x| 2.0 <= x * x);
        assert!((root - std::f64::consts::SQRT_2).abs() < 1e-14, "{root}");
        assert_eq!(bisection(0.0, 1.0, 2, |x| x < 0.3), 0.375, "0.5, then 0.25, then the middle");
    }

    fn root(value: impl Fn(f64) -> f64, low: f64, high: f64) -> (f64, usize) {
        let evaluations = Cell::new(0);
        let counted = |x: f64| {
            evaluations.set(evaluations.get() + 1);
            value(x)
        };
        let ends = [low, high].map(|x| Sample { x, y: value(x) });
        (illinois(counted, (ends[0], ends[1]), 1e-12, 100), evaluations.get())
    }

    #[test]
    fn a_straight_line_takes_one_evaluation() {
        assert_eq!(root(|x| 4.0 * (x - 0.25), 0.0, 1.0), (0.25, 1));
    }

    #[test]
    fn known_roots_are_found_in_few_evaluations() {
        for (value, low, high, expected) in [
            // The constant of Dottie.
            (
                &(|x: f64| x - libm::cos(x)) as &dyn Fn(f64) -> f64,
                0.0,
                1.0,
                0.739_085_133_215_160_7,
            ),
            // The example of Wallis, on which Newton showed his method.
            (&|x: f64| x * x * x - 2.0 * x - 5.0, 2.0, 3.0, 2.094_551_481_542_326_5),
            // Plain false position moves one end of this alone and needs thousands of evaluations.
            (
                &|x: f64| crate::power::integer_power(x, 9) - 1e-3,
                0.0,
                1.5,
                libm::pow(1e-3, 1.0 / 9.0),
            ),
        ] {
            let (found, evaluations) = root(value, low, high);
            assert!((found - expected).abs() < 1e-9, "{found} is not {expected}");
            assert!(evaluations <= 30, "{evaluations}");
        }
    }

    #[test]
    fn a_jump_over_zero_is_located() {
        let (found, _) = root(|x| if x < 0.3 { -1.0 } else { 2.0 }, 0.0, 1.0);
        assert!((found - 0.3).abs() < 1e-9, "{found}");
    }
}
