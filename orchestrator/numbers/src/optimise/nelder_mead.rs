//! The simplex method of J. Nelder and R. Mead (Computer Journal 7, 1965), with the standard coefficients 1, 2, 1/2 and 1/2.

use super::{Optimum, Termination};

/// The simplex method: for few variables, without derivatives.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NelderMead {
    /// Most evaluations of the function. The last iteration may exceed them by the number of variables.
    pub max_evaluations: usize,
    /// The search has converged once all values of the simplex differ by less than this.
    pub tolerance: f64,
}

impl NelderMead {
    /// Minimises a function from `start`. The first simplex reaches from there by `steps`, one along each axis.
    pub fn minimise(
        &self,
        cost: &dyn Fn(&[f64]) -> f64,
        start: Vec<f64>,
        steps: &[f64],
    ) -> Optimum<Vec<f64>> {
        let n = start.len();
        let vertex = |point: Vec<f64>| {
            let value = cost(&point);
            (point, if value.is_nan() { f64::INFINITY } else { value })
        };
        let mut simplex = vec![vertex(start.clone())];
        for (axis, step) in steps.iter().enumerate() {
            let mut point = start.clone();
            point[axis] += step;
            simplex.push(vertex(point));
        }
        let mut evaluations = n + 1;
        let mut termination = Termination::Limit;
        while evaluations < self.max_evaluations {
            simplex.sort_by(|a, b| a.1.total_cmp(&b.1));
            if simplex[n].1 - simplex[0].1 < self.tolerance {
                termination = Termination::Converged;
                break;
            }
            let centroid: Vec<f64> = (0..n)
                .map(|axis| {
                    simplex[..n].iter().map(|(point, _)| point[axis]).sum::<f64>() / n as f64
                })
                .collect();
            let along = |factor: f64| -> Vec<f64> {
                let axes = centroid.iter().zip(&simplex[n].0);
                axes.map(|(centre, worst)| centre + factor * (worst - centre)).collect()
            };
            let reflected = vertex(along(-1.0));
            evaluations += 1;
            let next = if reflected.1 < simplex[0].1 {
                evaluations += 1;
                let expanded = vertex(along(-2.0));
                if expanded.1 < reflected.1 { expanded } else { reflected }
            } else if reflected.1 < simplex[n - 1].1 {
                reflected
            } else {
                evaluations += 1;
                let is_inside = simplex[n].1 <= reflected.1;
                let contracted = vertex(along(if is_inside { 0.5 } else { -0.5 }));
                if contracted.1 < simplex[n].1.min(reflected.1) {
                    contracted
                } else {
                    let best = simplex[0].0.clone();
                    for (point, value) in &mut simplex[1..] {
                        let halfway =
                            best.iter().zip(&*point).map(|(a, b)| 0.5 * (a + b)).collect();
                        (*point, *value) = vertex(halfway);
                    }
                    evaluations += n;
                    continue;
                }
            };
            simplex[n] = next;
        }
        simplex.sort_by(|a, b| a.1.total_cmp(&b.1));
        let (point, value) = simplex.swap_remove(0);
        Optimum { point, value, termination }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SEARCH: NelderMead = NelderMead { max_evaluations: 1500, tolerance: 1e-10 };

    fn rosenbrock(x: &[f64]) -> f64 {
        let (a, b) = (1.0 - x[0], x[1] - x[0] * x[0]);
        a * a + 100.0 * b * b
    }

    #[test]
    fn the_minimum_of_rosenbrocks_valley_is_found() {
        let found = SEARCH.minimise(&rosenbrock, vec![-1.2, 1.0], &[0.5, 0.5]);
        assert_eq!(found.termination, Termination::Converged);
        assert!(found.value < 1e-9, "{found:?}");
        assert!(found.point.iter().all(|x| (x - 1.0).abs() < 1e-4), "{found:?}");
    }

    /// D. Himmelblau, Applied Nonlinear Programming (1972): four minima, each of 0.
    #[test]
    fn each_minimum_of_himmelblaus_function_is_found_from_nearby() {
        let cost = |x: &[f64]| {
            let (a, b) = (x[0] * x[0] + x[1] - 11.0, x[0] + x[1] * x[1] - 7.0);
            a * a + b * b
        };
        for (start, minimum) in [
            ([2.5, 2.5], [3.0, 2.0]),
            ([-3.0, 3.0], [-2.805_118, 3.131_312]),
            ([-4.0, -3.0], [-3.779_310, -3.283_186]),
            ([3.5, -2.0], [3.584_428, -1.848_126]),
        ] {
            let found = SEARCH.minimise(&cost, start.to_vec(), &[0.2, 0.2]);
            assert!(found.value < 1e-8, "{found:?}");
            for (x, expected) in found.point.iter().zip(minimum) {
                assert!((x - expected).abs() < 1e-4, "{found:?}");
            }
        }
    }

    #[test]
    fn a_search_without_enough_evaluations_says_so_and_returns_its_best_vertex() {
        let few = NelderMead { max_evaluations: 40, ..SEARCH };
        let found = few.minimise(&rosenbrock, vec![-1.2, 1.0], &[0.5, 0.5]);
        assert_eq!(found.termination, Termination::Limit);
        assert!(found.value < rosenbrock(&[-1.2, 1.0]));
        assert_eq!(found.value, rosenbrock(&found.point));
    }

    #[test]
    fn values_that_are_no_numbers_are_avoided() {
        let cost = |x: &[f64]| if x[0] < 0.0 { f64::NAN } else { (x[0] - 0.3) * (x[0] - 0.3) };
        let found = SEARCH.minimise(&cost, vec![1.0], &[-2.0]);
        assert!((found.point[0] - 0.3).abs() < 1e-4, "{found:?}");
    }
}
