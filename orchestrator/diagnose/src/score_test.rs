//! Cluster-robust efficient score tests: whether moving the predicted means of rows by a column would raise the likelihood, asked of one
//! fit without another.
//!
//! With slopes s and information w of the rows' means, a column x is first made orthogonal to the columns of everything that the fit
//! estimated (x̃, by the inner product that w defines). The efficient score is U = Σ s x̃, its information J = Σ w x̃², and one step leads to
//! the amplitude δ = U / J. The variance of U comes from sums U_c of what the step leaves, over clusters of rows that may depend on each
//! other, each corrected for what it took of the step itself (Bell and McCaffrey 2002): v = U_c / √(1 − J_c / J).
//!
//! * Time: blocks as long as the correlation of their sums demands, in each series and across series.
//! * Links: rows that share a node (Aronow, Samii and Assenova 2015), and time; both together by Cameron, Gelbach and Miller (2011).
//! * Sums of clusters are skewed: the statistic is corrected by Hall (1992), where that makes it smaller.
//!
//! A dimension with fewer than [`FEWEST_CLUSTERS`](study::thresholds::FEWEST_CLUSTERS) clusters gives no result. Replicates, such as a few
//! flights, take the place of all dimensions: of at least [`FEWEST_REPLICATES`](study::thresholds::FEWEST_REPLICATES), by Student's t.

mod clusters;
pub(crate) mod passes;
mod products;

use clusters::Clusters;
use nalgebra::{DMatrix, DVector};
use numbers::power::square;
pub(crate) use products::Products;
use statrs::distribution::{ContinuousCDF as _, FisherSnedecor, StudentsT};
use std::collections::BTreeMap;
use study::linear::{Column, Dependence, Linearised};

/// What is left of the information of a column beside what was estimated, where it can be tested.
const LEAST_LEFT: f64 = 1e-6;
/// Projections onto levels of nodes and what was estimated, in turn.
const MOST_PROJECTIONS: usize = 100;

/// The result of a score test.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct ScoreTest {
    /// The amplitude that one step leads to, in units of the column.
    pub amplitude: f64,
    /// Its standard error, by clusters.
    pub standard_error: f64,
    /// Degrees of freedom: of the dimension with the fewest.
    pub freedom: f64,
    /// Two-sided p-value.
    pub p_value: f64,
    /// By how much the step raises the log likelihood (nats), if rows are independent.
    pub rise: f64,
    /// The number of clusters whose signs bound the p-value, of the dimension with the fewest; [`usize::MAX`] of replicates, where
    /// Student's t alone decides.
    pub n_clusters: usize,
}

impl ScoreTest {
    /// P-value of the amplitude being greater than a margin, to either side.
    #[must_use]
    pub(crate) fn p_value_beyond(&self, margin: f64) -> f64 {
        let beyond = (self.amplitude.abs() - margin) / self.standard_error;
        if beyond.is_nan() || beyond <= 0.0 {
            return 1.0;
        }
        upper_tail(beyond, self.freedom).max(least_p_value(self.n_clusters))
    }

    /// The two-sided p-value of another amplitude with the same standard error.
    #[must_use]
    pub(crate) fn p_value_of(&self, amplitude: f64) -> f64 {
        let p_value = 2.0 * upper_tail(amplitude.abs() / self.standard_error, self.freedom);
        p_value.max(least_p_value(self.n_clusters)).min(1.0)
    }

    /// Design effect: the variance of the amplitude by clusters over that of independent rows.
    #[must_use]
    pub(crate) fn design_effect(&self) -> f64 {
        let information = 2.0 * self.rise / square(self.amplitude);
        information * square(self.standard_error)
    }

    /// The greatest amplitude (absolute) that a one-sided test at `level` does not reject.
    #[must_use]
    pub(crate) fn upper_bound(&self, level: f64) -> f64 {
        let quantile = StudentsT::new(0.0, 1.0, self.freedom)
            .map_or(f64::INFINITY, |law| law.inverse_cdf(1.0 - level));
        self.amplitude.abs() + quantile * self.standard_error
    }
}

/// The probability that Student's t with these degrees of freedom exceeds a value, which is a number; 1 without a degree of freedom.
pub(crate) fn upper_tail(t: f64, freedom: f64) -> f64 {
    StudentsT::new(0.0, 1.0, freedom).map_or(1.0, |law| law.sf(t))
}

/// No p-value is smaller than that of the signs of all clusters.
fn least_p_value(n_clusters: usize) -> f64 {
    libm::exp2(1.0 - n_clusters as f64)
}

/// Score and information of some rows for the amplitude of a column: sums over these rows of what the score test sums over all.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Total {
    pub slope: f64,
    pub information: f64,
}

impl Total {
    /// The amplitude that one step leads to, in units of the column.
    #[must_use]
    pub(crate) fn amplitude(self) -> f64 {
        self.slope / self.information
    }

    /// Adds those of other rows.
    pub(crate) fn add(&mut self, other: Self) {
        self.slope += other.slope;
        self.information += other.information;
    }
}

/// A column made orthogonal to others, of length 1.
#[derive(Clone, Debug)]
struct Unit(Column);

/// Score tests of one fit.
#[derive(Debug)]
pub(crate) struct ScoreTests<'a> {
    rows: &'a Linearised,
    clusters: Clusters<'a>,
    estimated: Vec<Unit>,
}

impl<'a> ScoreTests<'a> {
    /// Of a fit's slopes. `dependence`: which rows may depend on each other.
    #[must_use]
    pub(crate) fn new(rows: &'a Linearised, dependence: &'a Dependence) -> Self {
        let mut tests = Self { rows, clusters: Clusters::new(dependence), estimated: Vec::new() };
        tests.estimated = tests.units(&rows.estimated.iter().collect::<Vec<_>>());
        tests
    }

    fn inner(&self, a: &Column, b: &Column) -> f64 {
        let rows = self.rows.weights.iter().zip(a).zip(b);
        rows.map(|((w, a), b)| (0..3).map(|k| w[k] * a[k] * b[k]).sum::<f64>()).sum()
    }

    /// The column less what others explain of it; none where nothing is left.
    fn left(&self, column: &Column, others: &[&[Unit]]) -> Option<(Column, f64)> {
        let whole = self.inner(column, column);
        let mut left = column.clone();
        // Twice, for the rounding.
        for _ in 0..2 {
            for Unit(unit) in others.iter().copied().flatten() {
                let along = self.inner(&left, unit);
                for (left, unit) in left.iter_mut().zip(unit) {
                    for k in 0..3 {
                        left[k] -= along * unit[k];
                    }
                }
            }
        }
        let information = self.inner(&left, &left);
        (LEAST_LEFT * whole < information).then_some((left, information))
    }

    /// These columns made orthogonal to what was estimated and to each other.
    fn units(&self, columns: &[&Column]) -> Vec<Unit> {
        let mut units: Vec<Unit> = Vec::new();
        for column in columns {
            if let Some((mut left, information)) = self.left(column, &[&self.estimated, &units]) {
                let length = information.sqrt();
                left.iter_mut().flatten().for_each(|value| *value /= length);
                units.push(Unit(left));
            }
        }
        units
    }

    /// Tests a column beside others. None where nothing can be told: it moves what was estimated or what the others move, or clusters
    /// are too few.
    #[must_use]
    pub(crate) fn test(&self, column: &Column, beside: &[&Column]) -> Option<ScoreTest> {
        let beside = self.units(beside);
        let (left, information) = self.left(column, &[&self.estimated, &beside])?;
        let amplitude = self.total(&left) / information;
        // The slopes that are left after the step, along the column and along those beside it.
        let steps: Vec<(f64, &Column)> = beside
            .iter()
            .map(|Unit(unit)| (self.total(unit), unit))
            .chain([(amplitude, &left)])
            .collect();
        let after = |row: usize, k: usize| {
            let (s, w) = (self.rows.slopes[row], self.rows.weights[row]);
            s[k] - w[k] * steps.iter().map(|(step, column)| step * column[row][k]).sum::<f64>()
        };
        self.judged((&left, information), after)
    }

    /// Tests a column by the noise that a fit with its effect leaves. Where an effect is large, one step along it leaves more: the step is
    /// linear, and what counts of each row is as the noise with the effect in it says.
    #[must_use]
    pub(crate) fn test_in_noise_of(
        &self,
        column: &Column,
        with_effect: &Linearised,
    ) -> Option<ScoreTest> {
        let (left, information) = self.left(column, &[&self.estimated])?;
        let after = |row: usize, k: usize| {
            let weight = with_effect.weights[row][k];
            let scale = if 0.0 < weight { self.rows.weights[row][k] / weight } else { 0.0 };
            scale * with_effect.slopes[row][k]
        };
        self.judged((&left, information), after)
    }

    /// The test of a column of some information, by the slopes that are left with its effect, by row and part.
    fn judged(
        &self,
        (left, information): (&Column, f64),
        after: impl Fn(usize, usize) -> f64,
    ) -> Option<ScoreTest> {
        let total = self.total(left);
        let amplitude = total / information;
        let (mut left_over, mut informations) = (Vec::new(), Vec::new());
        for (row, x) in left.iter().enumerate() {
            let w = self.rows.weights[row];
            left_over.push((0..3).map(|k| after(row, k) * x[k]).sum::<f64>());
            informations.push((0..3).map(|k| w[k] * x[k] * x[k]).sum::<f64>());
        }
        let spread = self.clusters.spread(&left_over, &informations)?;
        let t = total / spread.variance.sqrt();
        let t = t.abs().min(corrected_for_skewness(t, &spread).abs());
        let p_value = (2.0 * upper_tail(t, spread.freedom)).max(least_p_value(spread.n_clusters));
        Some(ScoreTest {
            amplitude,
            standard_error: spread.variance.sqrt() / information,
            freedom: spread.freedom,
            p_value: p_value.min(1.0),
            rise: 0.5 * total * amplitude,
            n_clusters: spread.n_clusters,
        })
    }

    /// Score and information of each group of rows for the amplitude of a column, and the information of all rows. Another column serves as
    /// the instrument (P. G. Wright, The Tariff on Animal and Vegetable Oils, 1928, appendix B), made orthogonal to what was estimated and to
    /// some others. None where nothing of it is left.
    ///
    /// * `instrument`, `beside`: the other column, and those that it is made orthogonal to.
    /// * `groups`: the group of each row, by number from 0.
    #[must_use]
    pub(crate) fn by_group(
        &self,
        column: &Column,
        (instrument, beside): (&Column, &[&Column]),
        groups: &[usize],
    ) -> Option<(Vec<Total>, f64)> {
        let beside = self.units(beside);
        let (left, information) = self.left(instrument, &[&self.estimated, &beside])?;
        let n_groups = groups.iter().max().map_or(0, |last| last + 1);
        let mut totals = vec![Total::default(); n_groups];
        for (row, group) in groups.iter().enumerate() {
            let (s, w) = (self.rows.slopes[row], self.rows.weights[row]);
            for k in 0..3 {
                totals[*group].slope += left[row][k] * s[k];
                totals[*group].information += left[row][k] * w[k] * column[row][k];
            }
        }
        Some((totals, information))
    }

    /// What a column moves beside all that was estimated, and the information about its amplitude; none where that is nothing.
    #[must_use]
    pub(crate) fn beside_estimated(&self, column: &Column) -> Option<(Column, f64)> {
        self.left(column, &[&self.estimated])
    }

    /// The correlation of what two columns move beside all that was estimated; none where one moves nothing else.
    #[must_use]
    pub(crate) fn correlation(&self, a: &Column, b: &Column) -> Option<f64> {
        let (a, of_a) = self.left(a, &[&self.estimated])?;
        let (b, of_b) = self.left(b, &[&self.estimated])?;
        Some(self.inner(&a, &b) / (of_a * of_b).sqrt())
    }

    /// The share of a column's information, beside all that was estimated and a level of all rows, that is left beside a level for each
    /// sender and each receiver. `nodes`: sender and receiver of each row. None: the column moves nothing else than what was estimated.
    #[must_use]
    pub(crate) fn left_beside_nodes(&self, column: &Column, nodes: &[[u32; 2]]) -> Option<f64> {
        let of_all = self.beside_levels(column, &[vec![0; nodes.len()]])?;
        let ends = [0, 1].map(|end| nodes.iter().map(|ends| ends[end]).collect());
        let of_nodes = self.beside_levels(column, &ends);
        Some(of_nodes.unwrap_or(0.0) / of_all)
    }

    /// The information of a column beside what was estimated and levels of groups of rows, by projecting onto one after the other
    /// (I. Halperin, The product of projection operators, Acta Sci. Math. 23, 1962). `divisions`: the group of each row. None where nothing
    /// is left.
    fn beside_levels(&self, column: &Column, divisions: &[Vec<u32>]) -> Option<f64> {
        let whole = self.inner(column, column);
        let mut left = column.clone();
        let mut before = f64::INFINITY;
        for _ in 0..MOST_PROJECTIONS {
            let (beside, information) = self.left(&left, &[&self.estimated])?;
            left = beside;
            if information < LEAST_LEFT * whole {
                return None;
            }
            if before - information < LEAST_LEFT * whole {
                break;
            }
            before = information;
            for groups in divisions {
                let mut sums: BTreeMap<u32, [f64; 2]> = BTreeMap::new();
                for ((x, w), group) in left.iter().zip(&self.rows.weights).zip(groups) {
                    let sum = sums.entry(*group).or_default();
                    *sum = [sum[0] + w[0] * x[0], sum[1] + w[0]];
                }
                for (x, group) in left.iter_mut().zip(groups) {
                    let [sum, weight] = sums[group];
                    x[0] -= if 0.0 < weight { sum / weight } else { 0.0 };
                }
            }
        }
        Some(before.min(self.inner(&left, &left)))
    }

    /// P-value of several columns together, of rows that depend on each other in time (Hotelling's T², by Fisher's F). None where nothing can
    /// be told.
    #[must_use]
    pub(crate) fn p_value_together(&self, columns: &[Column]) -> Option<f64> {
        let units = self.units(&columns.iter().collect::<Vec<_>>());
        if units.is_empty() {
            return None;
        }
        let steps: Vec<f64> = units.iter().map(|Unit(unit)| self.total(unit)).collect();
        let mut left: Vec<Vec<f64>> = vec![Vec::new(); units.len()];
        for row in 0..self.rows.slopes.len() {
            let (s, w) = (self.rows.slopes[row], self.rows.weights[row]);
            let step = |k: usize| {
                steps.iter().zip(&units).map(|(step, Unit(unit))| step * unit[row][k]).sum::<f64>()
            };
            let after: [f64; 3] = std::array::from_fn(|k| s[k] - w[k] * step(k));
            for (left, Unit(unit)) in left.iter_mut().zip(&units) {
                left.push((0..3).map(|k| after[k] * unit[row][k]).sum());
            }
        }
        let p_value = |clusters: &Vec<Vec<f64>>| {
            let (n, k) = (clusters.len() as f64, units.len());
            let mut variance = DMatrix::zeros(k, k);
            for sum in clusters {
                let sum = DVector::from_column_slice(sum);
                variance += &sum * sum.transpose();
            }
            let total = DVector::from_column_slice(&steps);
            let square = (n - 1.0) / n * variance.cholesky()?.solve(&total).dot(&total);
            let freedom = [k as f64, n - k as f64];
            let law = FisherSnedecor::new(freedom[0], freedom[1]).ok()?;
            Some(law.sf(square * freedom[1] / (freedom[0] * (n - 1.0))))
        };
        let dimensions = self.clusters.in_time(&left)?;
        let p_values: Option<Vec<f64>> = dimensions.iter().map(p_value).collect();
        Some(p_values?.into_iter().fold(0.0, f64::max))
    }

    /// By how much a step along a column beside others would raise the log likelihood (nats), rows taken as independent; 0 where the
    /// column moves nothing else.
    #[must_use]
    pub(crate) fn rise(&self, column: &Column, beside: &[&Column]) -> f64 {
        let beside = self.units(beside);
        let Some((left, information)) = self.left(column, &[&self.estimated, &beside]) else {
            return 0.0;
        };
        let total = self.total(&left);
        0.5 * total * total / information
    }

    fn total(&self, column: &Column) -> f64 {
        let rows = self.rows.slopes.iter().zip(column);
        rows.map(|(s, x)| (0..3).map(|k| s[k] * x[k]).sum::<f64>()).sum()
    }
}

/// The t statistic of a sum of skewed parts (P. Hall, On the removal of skewness by transformation, J. R. Stat. Soc. B 54, 1992).
fn corrected_for_skewness(t: f64, spread: &clusters::Spread) -> f64 {
    let a = spread.skewness;
    t + a * t * t / 3.0 + a * a * t * t * t / 27.0 + a / 6.0
}

#[cfg(test)]
mod tests;
