//! The noise of measurements before a search: what no effect of the catalogue explains of the slopes of the model as configured.
//!
//! The noise that is fitted to a model that lacks an effect contains that effect. So all effects are fitted at once, by one step of least
//! squares, and what they leave is the noise. Rows keep their dependence on each other.

use crate::score_test::ScoreTests;
use numbers::power::square;
use study::linear::{Column, Dependence, Linearised};

/// Slopes of a model that lacks nothing, and the root mean square of its errors.
pub(crate) struct Noise {
    /// The slopes, weights and errors that noise alone would leave.
    pub(crate) rows: Linearised,
    /// Root mean square of the errors (dB or m).
    pub(crate) rms: f64,
}

/// What columns leave of the slopes of a fit.
pub(crate) fn beside(rows: &Linearised, columns: &[&Column]) -> Noise {
    let rows = weighted_by_noise(rows, columns);
    let (moved, _) = fitted(&rows, columns);
    let slopes = by_part(&rows, &|row, part| {
        rows.slopes[row][part] - rows.weights[row][part] * moved[row][part]
    });
    let errors = by_part(&rows, &|row, part| rows.errors[row][part] - moved[row][part]);
    let known = errors.iter().filter(|errors| errors[0].is_finite()).count() as f64;
    let squares = errors.iter().flatten().filter(|it| it.is_finite()).map(|it| it * it);
    let rms = (squares.sum::<f64>() / known).sqrt();
    Noise { rows: Linearised { slopes, errors, ..rows }, rms }
}

/// What all columns together move, and how many independent numbers they have.
fn fitted(rows: &Linearised, columns: &[&Column]) -> (Column, usize) {
    let dependence = Dependence::default();
    let tests = ScoreTests::new(rows, &dependence);
    tests.fitted(&tests.products(columns))
}

/// A value for each row and part.
fn by_part(rows: &Linearised, value: &dyn Fn(usize, usize) -> f64) -> Column {
    (0..rows.slopes.len()).map(|row| [0, 1, 2].map(|part| value(row, part))).collect()
}

/// The same rows, their slopes and weights by the noise that the columns leave. Positions have one noise and headings another.
fn weighted_by_noise(rows: &Linearised, columns: &[&Column]) -> Linearised {
    let (moved, rank) = fitted(rows, columns);
    let is_error = [0, 1, 2].map(|part| rows.errors.iter().any(|errors| errors[part].is_finite()));
    let scale_of = |group: bool| {
        let (mut squares, mut weights, mut n) = (0.0, 0.0, 0.0);
        for (row, moved) in moved.iter().enumerate() {
            for part in (0..3).filter(|&part| is_error[part] == group) {
                let weight = rows.weights[row][part];
                squares += square(rows.slopes[row][part] - weight * moved[part]);
                weights += weight;
                n += f64::from(u8::from(0.0 < weight));
            }
        }
        // What the fit took of the noise.
        let taken = if group { n / (n - rank as f64).max(1.0) } else { 1.0 };
        let scale = taken * squares / weights;
        if scale.is_finite() && 0.0 < scale { scale.min(1.0) } else { 1.0 }
    };
    let [of_errors, of_others] = [true, false].map(scale_of);
    let scale = |part: usize| if is_error[part] { of_errors } else { of_others };
    let slopes = by_part(rows, &|row, part| rows.slopes[row][part] / scale(part));
    let weights = by_part(rows, &|row, part| rows.weights[row][part] / scale(part));
    Linearised { slopes, weights, ..rows.clone() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proto::rng::{Draws, Purpose};

    #[test]
    fn noise_is_what_columns_leave_with_the_weights_of_that_noise() {
        let draws = Draws::new(3, Purpose::Resample);
        let x: Vec<f64> = (0..2000).map(|row| f64::from(row % 7) - 3.0).collect();
        let noise = |row: usize| 0.5 * draws.normal(row as u64, 0, 0);
        let errors: Vec<f64> = (0..2000).map(|row| 4.0 * x[row] + noise(row)).collect();
        let variance = errors.iter().map(|it| it * it).sum::<f64>() / 2000.0;
        let of = |value: &dyn Fn(usize) -> f64, absent: f64| -> Column {
            (0..2000).map(|row| [value(row), absent, absent]).collect()
        };
        let rows = Linearised {
            slopes: of(&|row| errors[row] / variance, 0.0),
            weights: of(&|_| 1.0 / variance, 0.0),
            errors: of(&|row| errors[row], f64::NAN),
            ..Linearised::default()
        };
        let column = of(&|row| x[row], 0.0);
        let found = beside(&rows, &[&column]);
        // The standard error of the standard deviation of 2000 values of 0.5 is 0.008.
        assert!((found.rms - 0.5).abs() < 0.03, "{}", found.rms);
        let weight = found.rows.weights[0][0];
        assert!((weight.sqrt().recip() - 0.5).abs() < 0.03, "{weight}");
        let left: f64 = found.rows.slopes.iter().zip(&x).map(|(slope, x)| slope[0] * x).sum();
        assert!(left.abs() < 1e-6, "{left}");
    }
}
