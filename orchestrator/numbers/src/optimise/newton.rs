//! Newton's method for the maximum of a smooth function of one number, with derivatives by central differences (J. Nocedal and
//! S. Wright, Numerical Optimization, 2006, § 8.1).

/// Newton's method with a bound on its steps. Its unit is the width of the maximum: one over the root of minus the second derivative,
/// which for a log density is the standard deviation of the normal approximation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Newton {
    /// The distance of the points at which differences are taken.
    pub difference: f64,
    /// Most iterations.
    pub max_iterations: usize,
    /// A step is at most this many widths, and this much more.
    pub max_step: (f64, f64),
    /// The search has converged once a step is shorter than this many widths.
    pub tolerance: f64,
}

impl Newton {
    /// The maximum near `start`, and its width. `min_curvature` is taken for the curvature (minus the second derivative) where that is less,
    /// so that the search also climbs where the function is not concave.
    pub fn maximise(
        &self,
        value: impl Fn(f64) -> f64,
        start: f64,
        min_curvature: f64,
    ) -> (f64, f64) {
        let (mut x, mut width) = (start, min_curvature.sqrt().recip());
        let h = self.difference;
        for _ in 0..self.max_iterations {
            let (below, here, above) = (value(x - h), value(x), value(x + h));
            let (slope, curvature) =
                ((above - below) / (2.0 * h), (2.0 * here - above - below) / (h * h));
            let curvature = curvature.max(min_curvature);
            width = curvature.sqrt().recip();
            let max = self.max_step.0 * width + self.max_step.1;
            let step = (slope / curvature).clamp(-max, max);
            x += step;
            if step.abs() < self.tolerance * width {
                break;
            }
        }
        (x, width)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SEARCH: Newton =
        Newton { difference: 1e-3, max_iterations: 50, max_step: (2.0, 1.0), tolerance: 1e-6 };

    #[test]
    fn a_parabola_takes_one_step() {
        let one = Newton { max_iterations: 1, ..SEARCH };
        let (top, width) = one.maximise(|x| -2.0 * (x - 0.7) * (x - 0.7), 0.2, 0.1);
        assert!((top - 0.7).abs() < 1e-6 && (width - 0.5).abs() < 1e-6, "{top} {width}");
    }

    #[test]
    fn the_mode_of_a_gamma_density_is_found() {
        // Shape 5, rate 2: the mode is 4/2, and minus the second derivative 4/2² there.
        let (top, width) = SEARCH.maximise(|x| 4.0 * libm::log(x) - 2.0 * x, 1.0, 1e-3);
        assert!((top - 2.0).abs() < 1e-5 && (width - 1.0).abs() < 1e-5, "{top} {width}");
    }

    #[test]
    fn a_step_is_bounded_and_climbs_where_the_function_is_not_concave() {
        // Cauchy's log density is convex beyond 1.
        let cauchy = |x: f64| -libm::log1p(x * x);
        let one = Newton { max_iterations: 1, ..SEARCH };
        let (next, _) = one.maximise(cauchy, 8.0, 1.0);
        assert!((5.0..8.0).contains(&next), "{next}");
        let (top, width) = SEARCH.maximise(cauchy, 8.0, 0.1);
        assert!(top.abs() < 1e-4 && (width - 0.5_f64.sqrt()).abs() < 1e-4, "{top} {width}");
    }
}
