//! Comparing what was simulated here with a figure that another program left, of which only that figure is known.

use proto::rng::{Draws, Purpose};

/// A quantile (`share` from 0 to 1) of some values, after Hazen: the median of an even number is the mean of the middle
/// two, and the third smallest of eight is the quantile 2.5 / 8.
///
/// # Panics
///
/// If there are no values.
#[must_use]
pub fn quantile(values: &[f64], share: f64) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let last = sorted.len() - 1;
    let place = (share * sorted.len() as f64 - 0.5).clamp(0.0, last as f64);
    let below = place as usize;
    sorted[below] + (place - below as f64) * (sorted[(below + 1).min(last)] - sorted[below])
}

/// The middle one, or the mean of the two middle ones.
///
/// # Panics
///
/// If there are no values.
#[must_use]
pub fn median(values: &[f64]) -> f64 {
    quantile(values, 0.5)
}

/// An interval that holds the median of what `values` were drawn from, at least with this probability: between two of the values, by the
/// sign test. Of few values, all of them.
///
/// # Panics
///
/// If there are no values.
#[must_use]
pub fn median_interval(values: &[f64], level: f64) -> [f64; 2] {
    let mut ascending = values.to_vec();
    ascending.sort_by(f64::total_cmp);
    let n = ascending.len();
    // How many of n fair coins show heads: at most `rank` with a probability of `below`.
    let (mut rank, mut term) = (0, 0.5_f64.powi(n as i32));
    let mut below = term;
    while rank < n / 2 {
        term *= (n - rank) as f64 / (rank + 1) as f64;
        if (1.0 - level) / 2.0 < below + term {
            break;
        }
        below += term;
        rank += 1;
    }
    [ascending[rank], ascending[n - 1 - rank]]
}

/// The mean.
///
/// # Panics
///
/// If there are no values.
#[must_use]
pub fn mean(values: &[f64]) -> f64 {
    assert_ne!(values.len(), 0, "no values have no mean");
    values.iter().sum::<f64>() / values.len() as f64
}

/// The standard deviation, with n - 1 in its denominator.
#[must_use]
pub fn deviation(values: &[f64]) -> f64 {
    let mean = mean(values);
    let sum: f64 = values.iter().map(|value| (value - mean).powi(2)).sum();
    (sum / (values.len() as f64 - 1.0)).sqrt()
}

/// The exact interval of a probability of which `n_of` of `n` cases were: Clopper and Pearson 1934, with this probability to miss
/// it.
#[must_use]
pub fn binomial_interval(n_of: usize, n: usize, level: f64) -> [f64; 2] {
    // The probability of at most k of n.
    let at_most = |k: usize, share: f64| {
        let mut log = n as f64 * (-share).ln_1p();
        let mut sum = log.exp();
        for i in 1..=k {
            log += ((n - i + 1) as f64 / i as f64).ln() + share.ln() - (-share).ln_1p();
            sum += log.exp();
        }
        sum
    };
    let solved = |k: usize, probability: f64| {
        let (mut low, mut high) = (0.0, 1.0);
        for _ in 0..60 {
            let middle = (low + high) / 2.0;
            if probability < at_most(k, middle) {
                low = middle;
            } else {
                high = middle;
            }
        }
        (low + high) / 2.0
    };
    [
        if n_of == 0 { 0.0 } else { solved(n_of - 1, 1.0 - level / 2.0) },
        if n_of == n { 1.0 } else { solved(n_of, level / 2.0) },
    ]
}

/// What a figure of our runs, and the same figure of as many as another program had, come to by chance: 4000 draws of
/// either from our runs.
#[derive(Clone, Debug)]
pub struct Resampled {
    own: Vec<f64>,
    other: Vec<f64>,
}

impl Resampled {
    /// Of `values`, one per run, as many for ourselves and `n_runs` for the other program.
    #[must_use]
    pub fn bootstrap(values: &[f64], n_runs: usize, figure: impl Fn(&[f64]) -> f64) -> Self {
        let draws = Draws::new(1, Purpose::RecordSample);
        let resampled = |n: usize, draw: u64, side: u64| {
            let pick = |k| values[(draws.uniform(draw, side, k) * values.len() as f64) as usize];
            figure(&(0..n as u64).map(pick).collect::<Vec<_>>())
        };
        Self {
            own: (0..4000).map(|draw| resampled(values.len(), draw, 0)).collect(),
            other: (0..4000).map(|draw| resampled(n_runs, draw, 1)).collect(),
        }
    }

    /// Ours less the other's, if each run of the other came to `factor` times as much.
    fn differences(&self, factor: f64) -> Vec<f64> {
        self.own.iter().zip(&self.other).map(|(own, other)| own - factor * other).collect()
    }

    /// How often a difference would be found at `level` if each run of the other came to `factor` times as much: the power
    /// of the comparison.
    #[must_use]
    pub fn power(&self, factor: f64, level: f64) -> f64 {
        let chance = self.differences(1.0);
        let [low, high] = [level / 2.0, 1.0 - level / 2.0].map(|share| quantile(&chance, share));
        let differences = self.differences(factor);
        let n_outside = differences.iter().filter(|&&d| d < low || high < d).count();
        n_outside as f64 / differences.len() as f64
    }

    /// The largest factor below 1 and the smallest above, in steps of 0.05, for which that is so in four of five cases.
    /// `None`: for none down to 0, up to 5.
    #[must_use]
    pub fn detectable(&self, level: f64) -> [Option<f64>; 2] {
        let is_found = |factor: &f64| 0.8 <= self.power(*factor, level);
        let step = |k: i32| f64::from(20 + k) / 20.0;
        [(1..=20).map(|k| step(-k)).find(is_found), (1..=80).map(step).find(is_found)]
    }
}

/// A quantile that was measured elsewhere.
#[derive(Clone, Copy, Debug)]
pub struct Measured {
    /// Its value.
    pub value: f64,
    /// Half a unit of its last digit.
    pub rounding: f64,
    /// Which quantile.
    pub share: f64,
    /// Of how many runs.
    pub n_runs: usize,
}

/// How a quantile of ours compares with one that was measured.
#[derive(Clone, Copy, Debug)]
pub struct Comparison {
    /// Ours.
    pub own: f64,
    /// 95 % bootstrap interval of the difference, ours less the measured one.
    pub interval: [f64; 2],
    /// How often the difference would be as great in its direction or greater, in either direction, if both programs
    /// simulated the same.
    pub probability: f64,
}

impl Comparison {
    /// Compares a quantile of `values`, one per run, with a measured one.
    ///
    /// # Model
    ///
    /// Of the measured runs only a quantile is known, so their scatter is taken to be that of ours: the basic bootstrap
    /// (Davison and Hinkley 1997, § 5.2) with as many of our runs drawn for either side as that side had. 4000 draws.
    #[must_use]
    pub fn of_mean(values: &[f64], measured: Measured) -> Self {
        let Measured { value, rounding, share, n_runs } = measured;
        let figure = |of: &[f64]| quantile(of, share);
        Self::by(&Resampled::bootstrap(values, n_runs, figure), figure(values), value, rounding)
    }

    /// Compares the mean of `values`, one per run, with that of `n_runs` measured ones, in the same way. `rounding`: half a
    /// unit of its last digit.
    #[must_use]
    pub fn of_means(values: &[f64], measured: f64, rounding: f64, n_runs: usize) -> Self {
        Self::by(&Resampled::bootstrap(values, n_runs, mean), mean(values), measured, rounding)
    }

    fn by(resampled: &Resampled, own: f64, measured: f64, rounding: f64) -> Self {
        let chance = resampled.differences(1.0);
        let difference = own - measured;
        let share_of = |holds: &dyn Fn(f64) -> bool| {
            chance.iter().filter(|&&c| holds(c)).count() as f64 / chance.len() as f64
        };
        let above = share_of(&|c| difference - rounding <= c);
        let below = share_of(&|c| c <= difference + rounding);
        Self {
            own,
            interval: [
                difference - quantile(&chance, 0.975) - rounding,
                difference - quantile(&chance, 0.025) + rounding,
            ],
            probability: (2.0 * above.min(below)).min(1.0),
        }
    }

    /// No difference is within the interval.
    #[must_use]
    pub fn agrees(&self) -> bool {
        self.interval[0] <= 0.0 && 0.0 <= self.interval[1]
    }

    /// The interval is within this on either side of no difference.
    #[must_use]
    pub fn excludes(&self, difference: f64) -> bool {
        -difference < self.interval[0] && self.interval[1] < difference
    }
}

#[cfg(test)]
mod tests {
    use super::{binomial_interval, median_interval};

    #[test]
    fn intervals_of_shares_are_exact() {
        // 1 - 0.025^(1/10), and what a sum of terms by log-gamma functions gives in another language.
        for ([n_of, n], [low, high]) in [
            ([0, 10], [0.0, 0.308_497]),
            ([5, 10], [0.187_086, 0.812_914]),
            ([10, 10], [0.691_503, 1.0]),
            ([20, 1000], [0.012_258, 0.030_720]),
        ] {
            let found = binomial_interval(n_of, n, 0.05);
            assert!((found[0] - low).abs() < 1e-6 && (found[1] - high).abs() < 1e-6, "{found:?}");
        }
    }

    #[test]
    fn the_interval_of_a_median_is_that_of_the_sign_test() {
        // Of ten coins one head or fewer: 11 of 1024; two or fewer: 56 of 1024, more than 5 %.
        let values: Vec<f64> = (1..=10).rev().map(f64::from).collect();
        assert_eq!(median_interval(&values, 0.9), [2.0, 9.0]);
        assert_eq!(median_interval(&[3.0, 1.0], 0.9), [1.0, 3.0]);
    }
}
