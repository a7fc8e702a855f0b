//! Welch's t test of the means of two samples whose variances may differ (B. L. Welch, The generalization of Student's problem when several
//! different population variances are involved, Biometrika 34, 1947).

use statrs::distribution::{ContinuousCDF as _, StudentsT};
use study::thresholds::TAIL_90;

/// The mean of some rows, and how much it counts: the number of these rows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct WeightedMean {
    pub value: f64,
    pub n: f64,
}

/// A difference of means, by Welch's test.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct WelchTest {
    /// The mean of one sample less that of the other.
    pub difference: f64,
    pub standard_error: f64,
    pub freedom: f64,
}

impl WelchTest {
    fn t(self) -> f64 {
        self.difference / self.standard_error
    }

    /// Probability of a difference at most as great.
    #[must_use]
    pub(super) fn lower_tail(self) -> f64 {
        StudentsT::new(0.0, 1.0, self.freedom).map_or(1.0, |law| law.cdf(self.t()))
    }

    /// Two-sided p-value.
    #[must_use]
    pub(super) fn two_sided(self) -> f64 {
        StudentsT::new(0.0, 1.0, self.freedom).map_or(1.0, |law| 2.0 * law.sf(self.t().abs()))
    }

    /// Half of the 90 % interval.
    #[must_use]
    pub(super) fn half_width(self) -> f64 {
        let law = StudentsT::new(0.0, 1.0, self.freedom);
        law.map_or(f64::INFINITY, |law| law.inverse_cdf(1.0 - TAIL_90)) * self.standard_error
    }
}

/// Welch's test of the mean of one sample less that of another, of means that count by their weights. None where either has fewer than
/// `fewest` of them, or they do not vary.
#[must_use]
pub(super) fn welch(
    one: &[WeightedMean],
    other: &[WeightedMean],
    fewest: usize,
) -> Option<WelchTest> {
    // The weighted mean, and its squared standard error.
    let mean_and_variance = |sample: &[WeightedMean]| {
        let n: f64 = sample.iter().map(|block| block.n).sum();
        let mean = sample.iter().map(|block| block.n * block.value).sum::<f64>() / n;
        let blocks = sample.len() as f64;
        let squares: f64 = sample
            .iter()
            .map(|block| {
                let off = block.n * (block.value - mean);
                off * off
            })
            .sum();
        (mean, blocks / (blocks - 1.0) * squares / (n * n), blocks)
    };
    if one.len().min(other.len()) < fewest {
        return None;
    }
    let (mean_one, variance_one, n_one) = mean_and_variance(one);
    let (mean_other, variance_other, n_other) = mean_and_variance(other);
    let variance = variance_one + variance_other;
    let freedom = variance * variance
        / (variance_one * variance_one / (n_one - 1.0)
            + variance_other * variance_other / (n_other - 1.0));
    let (difference, standard_error) = (mean_one - mean_other, variance.sqrt());
    let is_known = (difference / standard_error).is_finite() && freedom.is_finite();
    is_known.then_some(WelchTest { difference, standard_error, freedom })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn blocks(values: &[f64]) -> Vec<WeightedMean> {
        values.iter().map(|&value| WeightedMean { value, n: 4.0 }).collect()
    }

    #[test]
    fn of_blocks_of_equal_size_it_is_welchs_test() {
        let one = [20.4, 24.2, 15.4, 21.4, 20.2, 18.5, 21.5, 19.8, 22.0, 18.1];
        let other = [21.8, 25.6, 20.2, 22.3, 23.5, 22.6, 24.9, 22.0, 23.8, 21.0];
        let test = welch(&blocks(&one), &blocks(&other), 10).unwrap();
        let (t, freedom) = (test.t(), test.freedom);
        let mean = |values: &[f64]| values.iter().sum::<f64>() / 10.0;
        let variance = |values: &[f64]| {
            let m = mean(values);
            values.iter().map(|v| (v - m) * (v - m)).sum::<f64>() / 9.0 / 10.0
        };
        let (va, vb) = (variance(&one), variance(&other));
        let expected = (mean(&one) - mean(&other)) / (va + vb).sqrt();
        assert!((t - expected).abs() < 1e-12, "{t} {expected}");
        let expected = (va + vb) * (va + vb) / (va * va / 9.0 + vb * vb / 9.0);
        assert!((freedom - expected).abs() < 1e-9, "{freedom} {expected}");
    }

    #[test]
    fn too_few_blocks_or_blocks_that_do_not_vary_have_no_test() {
        let many: Vec<f64> = (0..10).map(f64::from).collect();
        assert!(welch(&blocks(&many), &blocks(&many), 10).is_some());
        assert_eq!(welch(&blocks(&many[1..]), &blocks(&many), 10), None);
        assert_eq!(welch(&blocks(&[1.0; 10]), &blocks(&[1.0; 10]), 10), None);
    }

    #[test]
    fn worse_is_one_sided_and_different_is_not() {
        let low: Vec<f64> = (0..20).map(|k| f64::from(k % 5)).collect();
        let high: Vec<f64> = low.iter().map(|value| value + 3.0).collect();
        let worse = welch(&blocks(&low), &blocks(&high), 10).unwrap();
        let better = welch(&blocks(&high), &blocks(&low), 10).unwrap();
        assert!(worse.lower_tail() < 1e-6 && 0.999 < better.lower_tail());
        assert!((worse.two_sided() - better.two_sided()).abs() < 1e-15);
        assert!((worse.two_sided() - 2.0 * worse.lower_tail()).abs() < 1e-12);
    }
}
