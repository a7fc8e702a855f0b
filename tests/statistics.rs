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
    pub fn of(values: &[f64], measured: Measured) -> Self {
        let Measured { value, rounding, share, n_runs } = measured;
        let draws = Draws::new(1, Purpose::RecordSample);
        let resampled = |n: usize, draw: u64, side: u64| {
            let pick = |k| values[(draws.uniform(draw, side, k) * values.len() as f64) as usize];
            quantile(&(0..n as u64).map(pick).collect::<Vec<_>>(), share)
        };
        let chance: Vec<f64> = (0..4000)
            .map(|draw| resampled(values.len(), draw, 0) - resampled(n_runs, draw, 1))
            .collect();
        let own = quantile(values, share);
        let difference = own - value;
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
