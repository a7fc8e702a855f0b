//! Medians with intervals, of samples and of differences between pairs.

use super::sweep_summary::{Interval, IntervalKind, MetricSpread};
use numbers::format::{number, number_within};
use numbers::statistics::{mean, quantile, standard_deviation};
use proto::rng::{Draws, Purpose};

/// Of fewer values a bootstrap interval of the median says nothing: with five it covers the median in 92 % of cases at
/// best, with less in fewer.
pub(crate) const FEWEST: usize = 5;
/// Resamples: the ends of an interval then scatter by about a fiftieth of its length.
const RESAMPLES: u64 = 4000;

impl MetricSpread {
    /// Of these values; `None` of none.
    #[must_use]
    pub fn from_values(values: &[f64]) -> Option<Self> {
        let mut ascending = values.to_vec();
        ascending.sort_by(f64::total_cmp);
        let (&min, &max) = (ascending.first()?, ascending.last()?);
        let median_interval_95 = interval(&ascending);
        let interval = match median_interval_95 {
            Some([low, high]) => Some(Interval { low, high, kind: IntervalKind::Bootstrap95 }),
            None if 1 < ascending.len() => {
                Some(Interval { low: min, high: max, kind: IntervalKind::Range })
            }
            None => None,
        };
        Some(Self {
            min,
            q25: quantile(&ascending, 0.25),
            median: quantile(&ascending, 0.5),
            q75: quantile(&ascending, 0.75),
            max,
            mean: mean(ascending.iter().copied()),
            sd: (1 < ascending.len()).then(|| standard_deviation(ascending.iter().copied())),
            median_interval_95,
            interval,
        })
    }
}

impl Interval {
    /// What it is, in words: `95 % interval`, or `range of 3` of so many trials.
    pub(crate) fn words(self, n: usize) -> String {
        match self.kind {
            IntervalKind::Bootstrap95 => "95 % interval".to_owned(),
            IntervalKind::Range => format!("range of {n}"),
        }
    }

    /// Whether the two have a value in common.
    pub(crate) fn overlaps(self, other: Self) -> bool {
        self.low <= other.high && other.low <= self.high
    }

    /// A median and the ends of its interval, with the digits that the interval warrants. Values that are smaller than half its
    /// width have three digits: 0.0332 with the interval from 0.0268 to 20.2 is not 0.
    pub(crate) fn digits(self, median: f64) -> [String; 3] {
        let half = (self.high - self.low) / 2.0;
        [median, self.low, self.high].map(|value| {
            if value.abs() < half { number(value) } else { number_within(value, half) }
        })
    }

    /// The same with about three digits each, or more if the ends of the interval would else look the same.
    pub(crate) fn short_digits(self, median: f64) -> [String; 3] {
        let plain = [median, self.low, self.high].map(number);
        if self.low < self.high && plain[1] == plain[2] { self.digits(median) } else { plain }
    }
}

/// Percentile bootstrap interval of the median (Efron 1979): the 2.5 % and 97.5 % quantiles of the medians of resamples. The
/// draws are always the same, so that the same values have the same interval.
fn interval(ascending: &[f64]) -> Option<[f64; 2]> {
    let n = ascending.len();
    if n < FEWEST {
        return None;
    }
    let draws = Draws::new(n as u64, Purpose::Resample);
    let mut medians: Vec<f64> = Vec::with_capacity(RESAMPLES as usize);
    // How often each value is drawn: an ascending resample without sorting.
    let mut counts = vec![0usize; n];
    for resample in 0..RESAMPLES {
        counts.fill(0);
        for block in 0..n.div_ceil(4) {
            let words = draws.words(resample, block as u64, 0);
            for &word in words.iter().take(n - 4 * block) {
                // The upper half of a product: n is small against 2^64.
                counts[((u128::from(word) * n as u128) >> 64) as usize] += 1;
            }
        }
        medians.push(
            (resampled_value(ascending, &counts, (n - 1) / 2)
                + resampled_value(ascending, &counts, n / 2))
                / 2.0,
        );
    }
    medians.sort_by(f64::total_cmp);
    Some([quantile(&medians, 0.025), quantile(&medians, 0.975)])
}

/// The value at a place of the resample in which each value stands so often.
fn resampled_value(ascending: &[f64], counts: &[usize], place: usize) -> f64 {
    let mut passed = 0;
    for (value, count) in ascending.iter().zip(counts) {
        passed += count;
        if place < passed {
            return *value;
        }
    }
    f64::NAN
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_spread_is_that_of_numpy() {
        // numpy: quantile([1, 2, 4, 8, 16], [.25, .5, .75]) = 2, 4, 8; mean 6.2; std(ddof=1) = 6.0992...
        let spread = MetricSpread::from_values(&[8.0, 1.0, 16.0, 2.0, 4.0]).unwrap();
        assert_eq!(
            [spread.min, spread.q25, spread.median, spread.q75, spread.max],
            [1.0, 2.0, 4.0, 8.0, 16.0]
        );
        assert!((spread.mean - 6.2).abs() < 1e-12);
        assert!((spread.sd.unwrap() - 6.099_180_272_790_763).abs() < 1e-12);
        assert!(MetricSpread::from_values(&[]).is_none());
    }

    #[test]
    fn few_values_have_their_range_and_one_has_no_interval() {
        let of = |values: &[f64]| MetricSpread::from_values(values).unwrap();
        let four = of(&[4.0, 1.0, 3.0, 2.0]);
        let range = Interval { low: 1.0, high: 4.0, kind: IntervalKind::Range };
        assert_eq!((four.median_interval_95, four.interval), (None, Some(range)));
        assert_eq!(range.words(4), "range of 4");
        assert_eq!(of(&[1.0]).interval, None);
        let five = of(&[4.0, 1.0, 3.0, 2.0, 5.0]);
        let [low, high] = five.median_interval_95.unwrap();
        let bootstrap = Interval { low, high, kind: IntervalKind::Bootstrap95 };
        assert_eq!(five.interval, Some(bootstrap));
        assert!(bootstrap.overlaps(range) && !range.overlaps(Interval { low: 4.5, ..bootstrap }));
        // What a summary of an earlier version lacks is absent.
        let mut old = serde_json::json!(four);
        assert_eq!(
            old["interval"],
            serde_json::json!({ "low": 1.0, "high": 4.0, "kind": "range" })
        );
        old.as_object_mut().unwrap().remove("interval");
        assert_eq!(serde_json::from_value::<MetricSpread>(old).unwrap().interval, None);
    }

    #[test]
    fn digits_tell_the_ends_of_an_interval_apart() {
        let interval = |low, high| Interval { low, high, kind: IntervalKind::Range };
        assert_eq!(interval(0.9997, 1.0).digits(0.9999), ["0.99990", "0.99970", "1.00000"]);
        assert_eq!(interval(0.91, 0.95).digits(0.93), ["0.930", "0.910", "0.950"]);
        assert_eq!(interval(1.0, 1.0).digits(1.0), ["1.00"; 3]);
        assert_eq!(interval(0.0268, 20.2).digits(0.0332), ["0.0332", "0.0268", "20"]);
        assert_eq!(interval(99.54, 100.0).digits(99.96), ["99.96", "99.54", "100.00"]);
        assert_eq!(interval(0.9997, 1.0).short_digits(0.9999), ["0.99990", "0.99970", "1.00000"]);
        assert_eq!(interval(1.0, 2.5).short_digits(1.25), ["1.25", "1.00", "2.50"]);
    }

    #[test]
    fn the_range_of_n_values_covers_the_median_as_often_as_the_docs_say() {
        // 4,000 samples of 3: 1 − 2^(1−3) = 75 %, with a standard deviation of 0.7 %.
        let draws = Draws::new(12, Purpose::Control);
        let covered = (0..4000u64)
            .filter(|&sample| {
                let values: Vec<f64> = (0..3).map(|i| draws.uniform(sample, i, 0)).collect();
                let range = MetricSpread::from_values(&values).unwrap().interval.unwrap();
                range.low <= 0.5 && 0.5 <= range.high
            })
            .count();
        assert!((2890..3110).contains(&covered), "{covered} of 4000");
    }

    #[test]
    fn intervals_cover_the_median_about_as_often_as_they_say() {
        // 400 samples of 15 exponential values; the median of the distribution is ln 2. The percentile bootstrap of a median
        // covers a little less than 95 %; the number covered has a standard deviation of about 4.7, so that below 360
        // (90 %) or at 396 and above (99 %) would come up less than once in a thousand with 94 %.
        let draws = Draws::new(11, Purpose::Control);
        let covered = (0..400u64)
            .filter(|&sample| {
                let values: Vec<f64> =
                    (0..15).map(|i| -libm::log(1.0 - draws.uniform(sample, i, 0))).collect();
                let [low, high] =
                    MetricSpread::from_values(&values).unwrap().median_interval_95.unwrap();
                low <= std::f64::consts::LN_2 && std::f64::consts::LN_2 <= high
            })
            .count();
        assert!((360..396).contains(&covered), "{covered} of 400");
    }

    #[test]
    fn an_interval_of_equal_values_is_a_point_and_moves_with_them() {
        assert_eq!(
            MetricSpread::from_values(&[3.0; 8]).unwrap().median_interval_95,
            Some([3.0, 3.0])
        );
        let values = [0.1, 0.5, 0.7, 0.2, 0.9, 0.4];
        let moved = values.map(|value| value + 100.0);
        let [a, b] = [&values, &moved]
            .map(|v| MetricSpread::from_values(v).unwrap().median_interval_95.unwrap());
        assert!((a[0] + 100.0 - b[0]).abs() < 1e-9 && (a[1] + 100.0 - b[1]).abs() < 1e-9);
    }
}
