//! Several columns beside all that was estimated: their correlations, and the least-squares fit of all of them together.

use super::{LEAST_LEFT, ScoreTests};
use nalgebra::{DMatrix, DVector};
use study::linear::Column;

/// Columns made orthogonal to all that was estimated.
#[derive(Clone, Debug)]
pub(crate) struct Products {
    /// Each column, of length 1; zero where it moves nothing else than what was estimated.
    units: Vec<Column>,
    correlations: DMatrix<f64>,
}

impl ScoreTests<'_> {
    /// What these columns move beside all that was estimated.
    #[must_use]
    pub(crate) fn products(&self, columns: &[&Column]) -> Products {
        let unit = |column: &&Column| {
            let left = self.left(column, &[&self.estimated]);
            let Some((mut unit, information)) = left else { return vec![[0.0; 3]; column.len()] };
            let length = information.sqrt();
            unit.iter_mut().flatten().for_each(|value| *value /= length);
            unit
        };
        let units: Vec<Column> = columns.iter().map(unit).collect();
        let n = units.len();
        let mut correlations = DMatrix::zeros(n, n);
        for i in 0..n {
            for j in 0..=i {
                let product = self.inner(&units[i], &units[j]);
                (correlations[(i, j)], correlations[(j, i)]) = (product, product);
            }
        }
        Products { units, correlations }
    }

    /// What the least-squares fit of all columns to the slopes moves, and how many independent numbers it has.
    #[must_use]
    pub(crate) fn fitted(&self, products: &Products) -> (Column, usize) {
        let totals = products.units.iter().map(|unit| self.total(unit));
        let totals = DVector::from_iterator(products.units.len(), totals);
        let (steps, rank) = solved(&products.correlations, &totals);
        let mut moved = vec![[0.0; 3]; self.rows.slopes.len()];
        for (step, unit) in steps.iter().zip(&products.units) {
            for (moved, unit) in moved.iter_mut().flatten().zip(unit.iter().flatten()) {
                *moved += step * unit;
            }
        }
        (moved, rank)
    }
}

impl Products {
    /// The correlation of two columns.
    #[must_use]
    pub(crate) fn correlation(&self, a: usize, b: usize) -> f64 {
        self.correlations[(a, b)]
    }

    /// The share R² of the information of a column that some others explain.
    #[must_use]
    pub(crate) fn explained(&self, column: usize, by: &[usize]) -> f64 {
        let among = DMatrix::from_fn(by.len(), by.len(), |i, j| self.correlations[(by[i], by[j])]);
        let with = DVector::from_fn(by.len(), |i, _| self.correlations[(by[i], column)]);
        let (steps, _) = solved(&among, &with);
        steps.dot(&with).clamp(0.0, 1.0)
    }
}

/// The solution of least norm of a symmetric system that may be singular, and its rank.
fn solved(matrix: &DMatrix<f64>, right: &DVector<f64>) -> (DVector<f64>, usize) {
    if right.is_empty() {
        return (right.clone(), 0);
    }
    let eigen = matrix.clone().symmetric_eigen();
    let most = eigen.eigenvalues.max();
    let (mut solution, mut rank) = (DVector::zeros(right.len()), 0);
    for (value, vector) in eigen.eigenvalues.iter().zip(eigen.eigenvectors.column_iter()) {
        if LEAST_LEFT * most < *value {
            solution += vector * (vector.dot(right) / value);
            rank += 1;
        }
    }
    (solution, rank)
}

#[cfg(test)]
mod tests {
    use super::*;
    use study::linear::{Dependence, Linearised};

    fn column(values: [f64; 4]) -> Column {
        values.map(|value| [value, 0.0, 0.0]).to_vec()
    }

    #[test]
    fn a_set_of_columns_explains_what_none_of_them_explains_alone() {
        let [sum, a, b] =
            [[1.0, 1.0, 1.0, 0.0], [1.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]].map(column);
        let rows = Linearised {
            slopes: column([2.0, 2.0, -1.0, 0.5]),
            weights: vec![[1.0, 0.0, 0.0]; 4],
            errors: column([2.0, 2.0, -1.0, 0.5]),
            ..Linearised::default()
        };
        let dependence = Dependence::default();
        let tests = ScoreTests::new(&rows, &dependence);
        let products = tests.products(&[&sum, &a, &b]);
        let explained = |by: &[usize]| products.explained(0, by);
        assert!((explained(&[1]) - 2.0 / 3.0).abs() < 1e-12);
        assert!((explained(&[2]) - 1.0 / 3.0).abs() < 1e-12);
        assert!((explained(&[1, 2]) - 1.0).abs() < 1e-12 && explained(&[]) == 0.0);
        assert!((products.correlation(0, 1) - (2.0_f64 / 3.0).sqrt()).abs() < 1e-12);
        // The sum is a combination of the others, so that the fit has two numbers.
        let (moved, rank) = tests.fitted(&products);
        assert_eq!(rank, 2);
        for (moved, expected) in moved.iter().zip([2.0, 2.0, -1.0, 0.0]) {
            assert!((moved[0] - expected).abs() < 1e-9, "{moved:?}");
        }
    }
}
