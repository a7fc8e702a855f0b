//! Means, variances and quantiles.
//!
//! Sums run in the order of the values, so that the same values in the same order give the same bits.
//! Functions of quantiles take values in ascending order. Of no values, every mean and quantile is NaN.
//!
//! Four definitions of a quantile are in use, which differ only between neighbouring values:
//!
//! | function | value at place `share · (n − 1)` |
//! |---|---|
//! | [`quantile`] | interpolated between the two neighbours |
//! | [`quantile_lower`] | the lower neighbour |
//! | [`quantile_nearest`] | the nearest neighbour |
//! | [`nth_quantile`] | the lower neighbour, the share being a fraction of two integers |

/// The arithmetic mean. NaN if any value is.
#[must_use]
pub fn mean(values: impl IntoIterator<Item = f64>) -> f64 {
    let mut n = 0_u64;
    let sum: f64 = values.into_iter().inspect(|_| n += 1).sum();
    sum / n as f64
}

/// The arithmetic mean of the values that are not NaN.
#[must_use]
pub fn mean_ignoring_nan(values: impl IntoIterator<Item = f64>) -> f64 {
    let known = values.into_iter().filter(|value| !value.is_nan());
    let (sum, n) = known.fold((0.0, 0_u64), |(sum, n), value| (sum + value, n + 1));
    sum / n as f64
}

/// The least and the greatest value, without those that are NaN: infinite, and the first above the second, if there is none.
#[must_use]
pub fn range(values: impl IntoIterator<Item = f64>) -> [f64; 2] {
    let none = [f64::INFINITY, f64::NEG_INFINITY];
    values.into_iter().fold(none, |[low, high], value| [low.min(value), high.max(value)])
}

/// A sum divided by a number, or by a duration, if that is positive. For means whose sum is kept while a run goes on.
#[must_use]
pub fn ratio(sum: f64, n: f64) -> Option<f64> {
    (0.0 < n).then(|| sum / n)
}

/// The sample variance: the squared deviations from the mean, summed and divided by `n − 1`. Of a single value, and of none, 0.
#[must_use]
pub fn variance(values: impl IntoIterator<Item = f64, IntoIter: Clone>) -> f64 {
    let values = values.into_iter();
    let mean = mean(values.clone());
    let mut n = 0_u64;
    let squares: f64 = values
        .inspect(|_| n += 1)
        .map(|value| {
            let deviation = value - mean;
            deviation * deviation
        })
        .sum();
    squares / (n as f64 - 1.0).max(1.0)
}

/// The sample standard deviation, the root of [`variance`].
#[must_use]
pub fn standard_deviation(values: impl IntoIterator<Item = f64, IntoIter: Clone>) -> f64 {
    libm::sqrt(variance(values))
}

/// Pearson's correlation of two samples of the same length; `None` if one of them is constant.
#[must_use]
pub fn correlation(x: &[f64], y: &[f64]) -> Option<f64> {
    let [mean_x, mean_y] = [x, y].map(|values| mean(values.iter().copied()));
    let [mut xx, mut yy, mut xy] = [0.0; 3];
    for (a, b) in x.iter().zip(y) {
        let (a, b) = (a - mean_x, b - mean_y);
        xx += a * a;
        yy += b * b;
        xy += a * b;
    }
    (0.0 < xx && 0.0 < yy).then(|| xy / libm::sqrt(xx * yy))
}

/// The quantile of ascending values by linear interpolation: definition 7 of Hyndman and Fan (The American Statistician 50(4),
/// 1996), which is the default of NumPy and R. `share` is from 0 to 1.
#[must_use]
pub fn quantile<T: Copy + Into<f64>>(ascending: &[T], share: f64) -> f64 {
    let Some(last) = ascending.len().checked_sub(1) else { return f64::NAN };
    let place = share * last as f64;
    let below = (place as usize).min(last);
    let above = (below + 1).min(last);
    let (low, high): (f64, f64) = (ascending[below].into(), ascending[above].into());
    low + (high - low) * (place - below as f64)
}

/// The quantile of ascending values without interpolation: the lower neighbour (NumPy's method `lower`). `share` is from 0 to 1.
#[must_use]
pub fn quantile_lower(ascending: &[f64], share: f64) -> f64 {
    let last = ascending.len().saturating_sub(1);
    ascending.get((share * last as f64) as usize).copied().unwrap_or(f64::NAN)
}

/// The quantile of ascending values without interpolation: the nearest neighbour, the upper one half way between two. `share` is
/// from 0 to 1.
#[must_use]
pub fn quantile_nearest(ascending: &[f64], share: f64) -> f64 {
    let last = ascending.len().saturating_sub(1);
    ascending.get((share * last as f64).round() as usize).copied().unwrap_or(f64::NAN)
}

/// The `k`-th of the values that divide an ascending list into `n` parts of about equal size, from the least (`k` = 0) to the
/// greatest (`k = n`): the lower neighbour at place `k · (length − 1) / n`.
///
/// # Panics
///
/// If `n` is 0.
#[must_use]
pub fn nth_quantile(ascending: &[f64], k: usize, n: usize) -> f64 {
    let last = ascending.len().saturating_sub(1);
    ascending.get(k * last / n).copied().unwrap_or(f64::NAN)
}

/// The median of ascending values that is one of them: of an even number, the upper of the two in the middle.
#[must_use]
pub fn median_high(ascending: &[f64]) -> f64 {
    ascending.get(ascending.len() / 2).copied().unwrap_or(f64::NAN)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_range_passes_over_what_is_no_number() {
        assert_eq!(range([2.0, f64::NAN, -1.0, 3.0]), [-1.0, 3.0]);
        assert_eq!(range([]), [f64::INFINITY, f64::NEG_INFINITY]);
    }

    #[test]
    fn means_and_deviations_are_those_of_numpy() {
        // numpy: mean([8, 1, 16, 2, 4]) = 6.2, std(ddof=1) = 6.099180272790763; equal up to rounding.
        let values = [8.0, 1.0, 16.0, 2.0, 4.0];
        assert!((mean(values) - 6.2).abs() < 1e-12);
        assert!((standard_deviation(values) - 6.099_180_272_790_763).abs() < 1e-12);
        assert!((variance(values) - 37.2).abs() < 1e-12);
    }

    #[test]
    fn nan_is_passed_on_unless_it_is_ignored() {
        assert!(mean([1.0, f64::NAN, 4.0]).is_nan());
        assert_eq!(mean_ignoring_nan([1.0, f64::NAN, 4.0]).to_bits(), 2.5_f64.to_bits());
    }

    #[test]
    fn quantiles_are_those_of_numpy() {
        // numpy.quantile([1, 2, 4, 8], share) with the methods linear, lower and nearest; equal up to rounding.
        let values = [1.0, 2.0, 4.0, 8.0];
        let near = |a: f64, b: f64| (a - b).abs() < 1e-12;
        for (share, linear, lower, nearest) in [
            (0.0, 1.0, 1.0, 1.0),
            (0.1, 1.3, 1.0, 1.0),
            (0.5, 3.0, 2.0, 4.0),
            (0.9, 6.8, 4.0, 8.0),
            (1.0, 8.0, 8.0, 8.0),
        ] {
            assert!(near(quantile(&values, share), linear), "{share}");
            assert!(near(quantile(&[1_u32, 2, 4, 8], share), linear), "{share}");
            assert!(near(quantile_lower(&values, share), lower), "{share}");
            assert!(near(quantile_nearest(&values, share), nearest), "{share}");
        }
    }

    #[test]
    fn parts_have_about_equal_sizes() {
        let values: Vec<f64> = (0..10).map(f64::from).collect();
        let edges: Vec<f64> = (0..=4).map(|k| nth_quantile(&values, k, 4)).collect();
        assert_eq!(edges, [0.0, 2.0, 4.0, 6.0, 9.0]);
    }

    #[test]
    fn the_high_median_is_one_of_the_values() {
        assert_eq!([median_high(&[1.0, 2.0, 4.0]), median_high(&[1.0, 2.0, 4.0, 8.0])], [2.0, 4.0]);
    }

    #[test]
    fn no_values_have_no_mean_and_no_quantile_and_one_does_not_vary() {
        let none: [f64; 0] = [];
        for value in [
            mean(none),
            mean_ignoring_nan([f64::NAN]),
            quantile(&none, 0.5),
            quantile_lower(&none, 0.5),
            quantile_nearest(&none, 0.5),
            nth_quantile(&none, 1, 2),
            median_high(&none),
        ] {
            assert!(value.is_nan(), "{value}");
        }
        assert_eq!(ratio(1.0, 0.0), None);
        assert_eq!(ratio(1.0, 2.0), Some(0.5));
        assert!(variance([3.0]).abs() < 1e-300 && variance(none).abs() < 1e-300);
    }
}
