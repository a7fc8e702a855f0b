//! The minimum of a function of a few variables.

/// Most evaluations of the function.
const MOST_EVALUATIONS: usize = 1500;
/// The search ends once all values differ by less than this.
const CLOSE: f64 = 1e-6;

/// The place of a minimum and the value there, by the simplex method of J. Nelder and R. Mead (Computer Journal 7, 1965) with the
/// standard coefficients 1, 2, 1/2 and 1/2. `steps`: how far the first simplex reaches from the start along each axis.
pub(super) fn nelder_mead(
    cost: &dyn Fn(&[f64]) -> f64,
    start: Vec<f64>,
    steps: &[f64],
) -> (Vec<f64>, f64) {
    let n = start.len();
    let valued = |place: Vec<f64>| {
        let value = cost(&place);
        (place, if value.is_nan() { f64::INFINITY } else { value })
    };
    let mut simplex = vec![valued(start.clone())];
    for (axis, step) in steps.iter().enumerate() {
        let mut place = start.clone();
        place[axis] += step;
        simplex.push(valued(place));
    }
    let mut evaluations = n + 1;
    while evaluations < MOST_EVALUATIONS {
        simplex.sort_by(|a, b| a.1.total_cmp(&b.1));
        if simplex[n].1 - simplex[0].1 < CLOSE {
            break;
        }
        let centre: Vec<f64> = (0..n)
            .map(|axis| simplex[..n].iter().map(|(place, _)| place[axis]).sum::<f64>() / n as f64)
            .collect();
        let along = |factor: f64| -> Vec<f64> {
            let worst = &simplex[n].0;
            centre
                .iter()
                .zip(worst)
                .map(|(centre, worst)| centre + factor * (worst - centre))
                .collect()
        };
        let reflected = valued(along(-1.0));
        evaluations += 1;
        let next = if reflected.1 < simplex[0].1 {
            evaluations += 1;
            let expanded = valued(along(-2.0));
            if expanded.1 < reflected.1 { expanded } else { reflected }
        } else if reflected.1 < simplex[n - 1].1 {
            reflected
        } else {
            evaluations += 1;
            let is_inside = simplex[n].1 <= reflected.1;
            let contracted = valued(along(if is_inside { 0.5 } else { -0.5 }));
            if contracted.1 < simplex[n].1.min(reflected.1) {
                contracted
            } else {
                let best = simplex[0].0.clone();
                for (place, value) in &mut simplex[1..] {
                    let halfway = best.iter().zip(&*place).map(|(a, b)| 0.5 * (a + b)).collect();
                    (*place, *value) = valued(halfway);
                }
                evaluations += n;
                continue;
            }
        };
        simplex[n] = next;
    }
    simplex.sort_by(|a, b| a.1.total_cmp(&b.1));
    simplex.swap_remove(0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_minimum_of_rosenbrocks_valley_is_found() {
        let cost = |x: &[f64]| {
            let (a, b) = (1.0 - x[0], x[1] - x[0] * x[0]);
            a * a + 100.0 * b * b
        };
        let (place, value) = nelder_mead(&cost, vec![-1.2, 1.0], &[0.5, 0.5]);
        assert!(value < 1e-5, "{place:?}: {value}");
        assert!((place[0] - 1.0).abs() < 0.01 && (place[1] - 1.0).abs() < 0.01, "{place:?}");
    }
}
