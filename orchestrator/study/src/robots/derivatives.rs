//! How residuals of robots change with the numbers of a fit, and where that leads.

use super::density::Residual;
use super::fit_state::{DAMPING_FLOOR, FitState, LEAST_DAMPED, Unchanged};
use super::motion::ModelPaths;
use super::{RobotFit, RobotModel};
use crate::thresholds::CURVE_PRIOR_SD;
use nalgebra::{DMatrix, DVector};
use numbers::optimise::levenberg_marquardt::damped;
use numbers::power::square;

/// How far numbers are moved to see how residuals bend, in units of their small steps.
const BEND_STEPS: f64 = 0.2;
/// A bend counts as so many times what the slopes of residuals say of the likelihood's curvature at most, downwards and upwards:
/// where residuals jump there is no telling.
const MOST_BENT: [f64; 2] = [-0.5, 4.0];

/// How the components of each residual change: see [`Residual::less`].
type DerivativeColumn = Vec<[f64; 3]>;

/// Derivatives of residuals at a fit.
#[derive(Clone, Debug, Default)]
pub(super) struct Derivatives {
    /// By each number.
    pub(super) by: Vec<DerivativeColumn>,
    /// More about the first numbers, which say how much measurements count.
    bends: Vec<Bend>,
}

/// What a first derivative does not say. How much measurements count does not go into predictions by straight lines: steps that
/// take it to do so lead beyond the optimum, again and again.
#[derive(Clone, Debug)]
struct Bend {
    /// Second derivatives of residuals.
    second: DerivativeColumn,
    /// Derivative of the spread of each.
    spread: Vec<f64>,
}

impl Derivatives {
    /// By how many numbers.
    pub(super) fn len(&self) -> usize {
        self.by.len()
    }

    /// By the first `n` numbers, those that say how much measurements count among them, and those of `more`.
    pub(super) fn replace_after(&mut self, n: usize, more: Self) {
        self.by.truncate(n);
        self.by.extend(more.by);
    }

    /// At some of the windows.
    pub(super) fn at_rows(&self, rows: &[u32]) -> Self {
        fn select<T: Copy>(column: &[T], rows: &[u32]) -> Vec<T> {
            rows.iter().map(|&row| column[row as usize]).collect()
        }
        let bend = |bend: &Bend| Bend {
            second: select(&bend.second, rows),
            spread: select(&bend.spread, rows),
        };
        Self {
            by: self.by.iter().map(|column| select(column, rows)).collect(),
            bends: self.bends.iter().map(bend).collect(),
        }
    }

    /// Where numbers have moved by so much. How the spread of residuals changes is taken to be the same there.
    pub(super) fn moved(&self, by: &[f64]) -> Self {
        let mut moved = self.clone();
        for ((column, bend), by) in moved.by.iter_mut().zip(&self.bends).zip(by) {
            for (first, second) in column.iter_mut().zip(&bend.second) {
                *first = std::array::from_fn(|i| first[i] + by * second[i]);
            }
        }
        moved
    }
}

/// An information matrix with what bends of residuals add to its first diagonal elements. Beside numbers that say nearly the same,
/// a bend may leave no summit to step to: then it does not count.
fn with_bends(straight: DMatrix<f64>, bends: &[f64]) -> DMatrix<f64> {
    let mut bent = straight.clone();
    for (i, bend) in bends.iter().enumerate() {
        let [least, most] = MOST_BENT.map(|share| share * straight[(i, i)]);
        bent[(i, i)] += bend.max(least).min(most);
    }
    if damped(&bent, LEAST_DAMPED, DAMPING_FLOOR).cholesky().is_some() { bent } else { straight }
}

impl RobotModel {
    /// Derivatives at all windows under a fit.
    pub(super) fn derivatives(&self, fit: &RobotFit) -> Option<Derivatives> {
        let all: Vec<u32> = (0..self.tracks.windows.len() as u32).collect();
        let (residuals, paths) = self.residuals_and_paths(fit, &all, Unchanged::default())?;
        self.jacobian(fit, (&residuals, &paths), &all, 0)
    }

    /// Derivatives by the numbers from the `from`th on of residuals that are `at` under a fit, `paths` being those of its
    /// model alone.
    pub(super) fn jacobian(
        &self,
        fit: &RobotFit,
        (at, paths): (&[Residual], &ModelPaths),
        train: &[u32],
        from: usize,
    ) -> Option<Derivatives> {
        let numbers = self.numbers_of(&fit.terms);
        let mut derivatives = Derivatives::default();
        let actings = self.actings(fit);
        let moved = |index: usize, by: f64, known: Unchanged<'_>| {
            let mut moved = fit.clone();
            moved.values[index] += by;
            self.residuals_and_paths(&moved, train, known).map(|(residuals, _)| residuals)
        };
        for (index, number) in numbers.iter().enumerate().skip(from) {
            if index < self.n_gains() {
                // How much measurements count does not change what the model does alone …
                let known =
                    Unchanged { paths: (!paths.is_empty()).then_some(paths), actings: None };
                let h = BEND_STEPS * number.step;
                let [above, below] = [moved(index, h, known)?, moved(index, -h, known)?];
                let both = || above.iter().zip(&below);
                let slope = |(a, b): (&Residual, &Residual)| a.less(b).map(|it| it / (2.0 * h));
                let second = |((a, b), at): ((&Residual, &Residual), &Residual)| {
                    let mut second = std::array::from_fn(|i| {
                        (a.parts_m[i] - 2.0 * at.parts_m[i] + b.parts_m[i]) / (h * h)
                    });
                    if !at.heading_rad.is_nan() {
                        second[2] = (a.less(at)[2] + b.less(at)[2]) / (h * h);
                    }
                    second
                };
                derivatives.by.push(both().map(slope).collect());
                derivatives.bends.push(Bend {
                    second: both().zip(at).map(second).collect(),
                    spread: both().map(|(a, b)| (a.spread - b.spread) / (2.0 * h)).collect(),
                });
                continue;
            }
            if let Some(acting) = actings.iter().find(|acting| acting.numbers.contains(&index)) {
                let k = index - acting.numbers.start;
                let column = train.iter().zip(at).map(|(&row, residual)| {
                    let [along, across] = self.curve_column(acting, k, row, residual);
                    [-along, -across, 0.0]
                });
                derivatives.by.push(column.collect());
                continue;
            }
            let h = 0.02 * number.step;
            // At the upper bound the difference is taken downwards: values beyond it are not valid.
            let h = if number.max < fit.values[index] + h { -h } else { h };
            // … and nothing else changes what curves do.
            let displaced = moved(index, h, Unchanged { paths: None, actings: Some(&actings) })?;
            let column = displaced.iter().zip(at);
            let column = column.map(|(displaced, at)| displaced.less(at).map(|it| it / h));
            derivatives.by.push(column.collect());
        }
        Some(derivatives)
    }

    /// Information matrix and slope of the log likelihood, each window counting as much as the density says.
    pub(super) fn normal_equations(
        &self,
        fit: &RobotFit,
        at: &FitState,
        Derivatives { by: columns, bends }: &Derivatives,
    ) -> (DMatrix<f64>, DVector<f64>) {
        let n = columns.len();
        let mut information = DMatrix::zeros(n, n);
        let mut slope = DVector::zeros(n);
        let mut bent = vec![0.0; bends.len()];
        for (row, residual) in at.residuals.iter().enumerate() {
            let (parts, scales) = at.density.pulls(residual);
            let sd_m = at.density.sd_m(residual);
            for part in 0..at.density.n_components() {
                let scale = scales[part];
                for (i, bend) in bends.iter().enumerate() {
                    bent[i] += scale * parts[part] * bend.second[row][part];
                    // The concentration of headings is the same for all windows.
                    if part < at.density.n_parts {
                        let own = square(at.density.sd_m / sd_m[part]);
                        let surprise = scale * square(parts[part]) - 1.0;
                        slope[i] += 0.5 * own * surprise * bend.spread[row];
                    }
                }
                for i in 0..n {
                    let by_i = columns[i][row][part] * scale;
                    slope[i] -= by_i * parts[part];
                    for j in 0..=i {
                        information[(i, j)] += by_i * columns[j][row][part];
                    }
                }
            }
        }
        let mut first = self.base.len();
        for &term in &fit.terms {
            if self.curve(term).is_some() {
                for index in first..first + self.n_numbers(term) {
                    information[(index, index)] += 1.0 / (CURVE_PRIOR_SD * CURVE_PRIOR_SD);
                    slope[index] -= fit.values[index] / (CURVE_PRIOR_SD * CURVE_PRIOR_SD);
                }
            }
            first += self.n_numbers(term);
        }
        for i in 0..n {
            for j in 0..i {
                information[(j, i)] = information[(i, j)];
            }
        }
        (with_bends(information, &bent), slope)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bends_count_within_limits_and_only_where_a_summit_is_left() {
        let matrix_with = |cross: f64| DMatrix::from_row_slice(2, 2, &[4.0, cross, cross, 1.0]);
        let first = |matrix: DMatrix<f64>| (matrix[(0, 0)], matrix[(1, 1)]);
        assert_eq!(first(with_bends(matrix_with(0.5), &[-1.0])), (3.0, 1.0));
        assert_eq!(first(with_bends(matrix_with(0.5), &[100.0])), (20.0, 1.0));
        assert_eq!(first(with_bends(matrix_with(0.5), &[-100.0])), (2.0, 1.0));
        assert_eq!(first(with_bends(matrix_with(0.5), &[f64::NAN])), (2.0, 1.0));
        // 4 · 1 − 1.9² is still above 0, 3 · 1 − 1.9² is not.
        assert_eq!(first(with_bends(matrix_with(1.9), &[-1.0])), (4.0, 1.0));
    }
}
