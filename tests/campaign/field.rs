//! Random fields over pairs of nodes: drawn, and foretold from what was measured.

use super::draws::Draws;
use super::geometry::distance;
use super::radio;
use super::world::{Row, World};
use std::collections::BTreeMap;

/// How the values of a pair belong together.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Kernel {
    /// By how far the ends have moved, together: correlation 1/e over a distance (Gudmundson 1991).
    Place { variance: f64, decorrelation_m: f64 },
    /// By the difference of channels, 1/e over the coherence bandwidth, and as the ends move, 1/e over half a wavelength.
    Frequency { variance: f64, coherence_mhz: f64 },
}

impl Kernel {
    /// Covariance of two rows of one pair (dB²).
    pub(crate) fn covariance(self, one: &Row, other: &Row) -> f64 {
        // The same node may send in one row and receive in the other.
        let place = |row: &Row, is_low: bool| {
            if (row.tx < row.rx) == is_low { row.tx_at.plane_m } else { row.rx_at.plane_m }
        };
        let moved_m: f64 =
            [true, false].map(|low| distance(place(one, low), place(other, low))).iter().sum();
        match self {
            Self::Place { variance, decorrelation_m } => {
                variance * (-moved_m / decorrelation_m).exp()
            }
            Self::Frequency { variance, coherence_mhz } => {
                let apart_mhz =
                    (radio::centre_mhz(one.channel) - radio::centre_mhz(other.channel)).abs();
                let half_m = radio::LIGHT_MPS / 2.44e9 / 2.0;
                variance * (-apart_mhz / coherence_mhz - moved_m / half_m).exp()
            }
        }
    }
}

/// Rows by unordered pair of nodes.
pub(crate) fn pairs(rows: &[Row]) -> Vec<Vec<usize>> {
    let mut pairs: BTreeMap<(usize, usize), Vec<usize>> = BTreeMap::new();
    for (index, row) in rows.iter().enumerate() {
        pairs.entry((row.tx.min(row.rx), row.tx.max(row.rx))).or_default().push(index);
    }
    pairs.into_values().collect()
}

/// One draw of the field, per row (dB).
pub(crate) fn pair_field(world: &World, kernel: Kernel, draws: &mut Draws) -> Vec<f64> {
    let mut values = vec![0.0; world.rows.len()];
    for pair in pairs(&world.rows) {
        let covariance = matrix(pair.len(), |i, j| {
            let same = if i == j { 1e-9 } else { 0.0 };
            kernel.covariance(&world.rows[pair[i]], &world.rows[pair[j]]) + same
        });
        let root = Cholesky::factorise(covariance);
        let normals: Vec<f64> = pair.iter().map(|_| draws.normal()).collect();
        for (i, &row) in pair.iter().enumerate() {
            values[row] = root.lower[i].iter().zip(&normals).map(|(l, z)| l * z).sum();
        }
    }
    values
}

/// A lower triangular matrix, row by row, each up to the diagonal.
pub(crate) fn matrix(n: usize, of: impl Fn(usize, usize) -> f64) -> Vec<Vec<f64>> {
    (0..n).map(|i| (0..=i).map(|j| of(i, j)).collect()).collect()
}

/// The Cholesky factor of a positive definite matrix.
pub(crate) struct Cholesky {
    lower: Vec<Vec<f64>>,
}

impl Cholesky {
    /// Factors a matrix, of which the lower triangle is given.
    pub(crate) fn factorise(mut a: Vec<Vec<f64>>) -> Self {
        for i in 0..a.len() {
            let (done, rest) = a.split_at_mut(i);
            let row = &mut rest[0];
            for j in 0..i {
                let sum: f64 = row[..j].iter().zip(&done[j][..j]).map(|(x, y)| x * y).sum();
                row[j] = (row[j] - sum) / done[j][j];
            }
            let sum: f64 = row[..i].iter().map(|x| x * x).sum();
            let square = row[i] - sum;
            assert!(0.0 < square, "not positive definite: {square}");
            row[i] = square.sqrt();
        }
        Self { lower: a }
    }

    /// Solves A x = b.
    pub(crate) fn solve(&self, b: &[f64]) -> Vec<f64> {
        let mut x = b.to_vec();
        for (i, row) in self.lower.iter().enumerate() {
            let sum: f64 = row[..i].iter().zip(&x).map(|(l, x)| l * x).sum();
            x[i] = (x[i] - sum) / row[i];
        }
        for i in (0..x.len()).rev() {
            x[i] /= self.lower[i][i];
            for j in 0..i {
                x[j] -= self.lower[i][j] * x[i];
            }
        }
        x
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_system_is_solved() {
        let a = Cholesky::factorise(vec![vec![4.0], vec![2.0, 3.0], vec![0.0, 1.0, 2.0]]);
        // A (1, 2, 3) by hand.
        let x = a.solve(&[8.0, 11.0, 8.0]);
        for (value, expected) in x.iter().zip([1.0, 2.0, 3.0]) {
            assert!((value - expected).abs() < 1e-12, "{x:?}");
        }
    }
}
