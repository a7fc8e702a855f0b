//! Samples and their quantiles, and counts over time, in memory that does not grow with the run.

use numbers::statistics::{quantile, ratio};

/// Numbers of which quantiles are wanted. Beyond `MAX_SAMPLES` only every second is kept, then every fourth, and so on.
#[derive(Clone, Debug)]
pub struct Samples {
    kept: Vec<f64>,
    /// One of so many is kept.
    stride: u64,
    n: u64,
    sum: f64,
    ends: [f64; 2],
}

impl Default for Samples {
    fn default() -> Self {
        let ends = [f64::INFINITY, f64::NEG_INFINITY];
        Self { kept: Vec::new(), stride: 1, n: 0, sum: 0.0, ends }
    }
}

impl Samples {
    /// Samples of all values, which are finite.
    pub fn from_values(values: impl IntoIterator<Item = f64>) -> Self {
        let mut samples = Self::default();
        values.into_iter().for_each(|value| samples.add(value));
        samples
    }

    /// Adds a finite number.
    pub fn add(&mut self, value: f64) {
        if self.n.is_multiple_of(self.stride) {
            if self.kept.len() == MAX_SAMPLES {
                let mut index = 0;
                self.kept.retain(|_| {
                    index += 1;
                    index % 2 == 1
                });
                self.stride *= 2;
            }
            if self.n.is_multiple_of(self.stride) {
                self.kept.push(value);
            }
        }
        self.n += 1;
        self.sum += value;
        self.ends = [self.ends[0].min(value), self.ends[1].max(value)];
    }

    /// Number of values that were added, including those not kept.
    pub fn len(&self) -> u64 {
        self.n
    }

    /// Whether no value was added.
    pub fn is_empty(&self) -> bool {
        self.n == 0
    }

    /// Those that were kept, ascending.
    pub fn ascending(&self) -> Vec<f64> {
        let mut values = self.kept.clone();
        values.sort_by(f64::total_cmp);
        values
    }

    /// Mean of all values that were added; `None` if there are none.
    pub fn mean(&self) -> Option<f64> {
        ratio(self.sum, self.n as f64)
    }

    /// A quantile, interpolated between neighbours (Hyndman and Fan's type 7). The ends are exact.
    pub fn quantile(&self, share: f64) -> Option<f64> {
        self.quantiles([share])[0]
    }

    /// Quantiles of the values that were kept, at these shares (0 to 1) and in their order; `None` without values.
    pub fn quantiles<const N: usize>(&self, shares: [f64; N]) -> [Option<f64>; N] {
        let values = self.ascending();
        shares.map(|share| {
            if values.is_empty() {
                return None;
            }
            if share <= 0.0 || 1.0 <= share {
                return Some(self.ends[usize::from(1.0 <= share)]);
            }
            Some(quantile(&values, share))
        })
    }
}

/// Most samples kept: 8 MB.
const MAX_SAMPLES: usize = 1 << 20;

/// Counts of two kinds over time, in bins that double in width when there are too many.
#[derive(Clone, Debug)]
pub struct PacketTimeline {
    /// Width of a bin (ns).
    pub bin_ns: u64,
    /// Both counts per bin, the first beginning at 0.
    pub bins: Vec<[u64; 2]>,
}

impl Default for PacketTimeline {
    fn default() -> Self {
        Self { bin_ns: 1_000_000_000, bins: Vec::new() }
    }
}

impl PacketTimeline {
    /// Counts one of the second kind, or of the first.
    pub fn add(&mut self, time_ns: u64, is_second: bool) {
        while MAX_BINS as u64 <= time_ns / self.bin_ns {
            self.bins = self
                .bins
                .chunks(2)
                .map(|pair| pair.iter().fold([0, 0], |sum, bin| [sum[0] + bin[0], sum[1] + bin[1]]))
                .collect();
            self.bin_ns *= 2;
        }
        let bin = (time_ns / self.bin_ns) as usize;
        if self.bins.len() <= bin {
            self.bins.resize(bin + 1, [0; 2]);
        }
        self.bins[bin][usize::from(is_second)] += 1;
    }
}

/// Most bins.
const MAX_BINS: usize = 120;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_of_few_are_exact() {
        // numpy.quantile([1, 2, 4, 8], [0, 0.1, 0.5, 0.9, 1]); equal up to rounding.
        let samples = Samples::from_values([8.0, 1.0, 4.0, 2.0]);
        let found = samples.quantiles([0.0, 0.1, 0.5, 0.9, 1.0]).map(Option::unwrap);
        for (found, expected) in found.into_iter().zip([1.0, 1.3, 3.0, 6.8, 8.0]) {
            assert!((found - expected).abs() < 1e-12, "{found}");
        }
        assert_eq!(samples.mean(), Some(3.75));
        assert_eq!(Samples::default().quantile(0.5), None);
    }

    #[test]
    fn quantiles_of_very_many_stay_close_and_the_ends_exact() {
        let n = 3 * MAX_SAMPLES as u64 + 17;
        // A permutation of 0..n, since n and the factor have no common divisor.
        let samples = Samples::from_values((0..n).map(|i| (i * 1_000_003 % n) as f64));
        assert!(samples.kept.len() <= MAX_SAMPLES && samples.stride == 4);
        assert_eq!(samples.len(), n);
        assert_eq!(samples.quantiles([0.0, 1.0]), [Some(0.0), Some((n - 1) as f64)]);
        let median = samples.quantile(0.5).unwrap();
        // A quarter of them in a regular pattern: the median is off by far less than a thousandth.
        assert!((median / n as f64 - 0.5).abs() < 1e-3, "{median}");
    }

    #[test]
    fn no_count_is_lost_when_time_goes_on() {
        let mut timeline = PacketTimeline::default();
        for i in 0..10_000u64 {
            timeline.add(i * 1_000_000_000, i % 4 == 0);
        }
        assert!(timeline.bins.len() <= MAX_BINS);
        let sum = timeline.bins.iter().fold([0, 0], |sum, bin| [sum[0] + bin[0], sum[1] + bin[1]]);
        assert_eq!(sum, [7500, 2500]);
        assert_eq!(timeline.bin_ns, 128_000_000_000);
    }
}
