//! Lack of fit against pure error: whether a model leaves more than rows differ by that repeat each other.
//!
//! Two rows of one series soon after each other (a robot a window later, a link a while later) share what a model gets wrong, and not
//! the noise. Half of the mean square of the difference of their errors is therefore the variance of the noise, and never less: what the
//! model gets wrong may have changed between the two, which only hides a lack of fit (N. R. Draper and H. Smith, Applied Regression
//! Analysis, 3rd edition 1998, section 2.1; the variogram of G. Matheron, 1963, at the shortest lag). The residual itself says nothing of
//! it: the more a model misses, the greater is the noise that is fitted to it.

use std::collections::BTreeMap;
use study::linear::{Dependence, Linearised};
use study::thresholds::{
    FEWEST_CLUSTERS, LACK_OF_FIT_RATIO, MOST_REPEAT_BLOCKS, REPEAT_BLOCKS, REPEAT_CLUSTERS,
};

/// The standard normal quantile of a one-sided bound of 95 %.
const Z_95: f64 = 1.644_853_626_951_472_2;

/// What is left beside what repeats differ by.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct PureError {
    /// Root mean square of what the model leaves, of rows that have a repeat.
    pub remaining: f64,
    /// Root mean square of the noise, by repeats.
    pub pure: f64,
    /// Least ratio of both variances that the data allow (95 %, clustered).
    pub least_ratio: f64,
}

impl PureError {
    /// Whether the model leaves more than noise, beyond chance and by as much as matters.
    pub(crate) fn is_alarming(&self) -> bool {
        LACK_OF_FIT_RATIO < self.least_ratio
    }
}

/// Compares what is left with what repeats differ by. None where too few rows have a repeat.
pub(crate) fn pure_error(rows: &Linearised, dependence: &Dependence) -> Option<PureError> {
    let Dependence { times_s, series, shortest_s, nodes, .. } = dependence;
    let known = |row: &usize| rows.errors[*row][0].is_finite() && times_s[*row].is_finite();
    let mut repeating: BTreeMap<(u32, [u32; 2]), Vec<usize>> = BTreeMap::new();
    for row in (0..rows.errors.len()).filter(known) {
        let ends = nodes.as_ref().map_or([0; 2], |nodes| nodes[row]);
        repeating.entry((series[row], ends)).or_default().push(row);
    }
    let known_s = || (0..rows.errors.len()).filter(known).map(|row| times_s[row]);
    let first_s = known_s().fold(f64::INFINITY, f64::min);
    let span_s = known_s().fold(f64::NEG_INFINITY, f64::max) - first_s;
    // By series and time: what is left, and half of the squared differences.
    let mut clusters: BTreeMap<(u32, [u32; 2], u64), [f64; 2]> = BTreeMap::new();
    let mut n_pairs = 0usize;
    for (&(series, ends), members) in &mut repeating {
        members.sort_by(|&a, &b| times_s[a].total_cmp(&times_s[b]));
        let mut later = 0;
        for (place, &row) in members.iter().enumerate() {
            // The next window of a robot begins where this one ends, with the same error of position. Frames have none in common.
            let blocks = if nodes.is_some() { 0.0 } else { REPEAT_BLOCKS };
            let gap_s = blocks * shortest_s * (1.0 - 1e-6);
            later = later.max(place + 1);
            while later < members.len() && times_s[members[later]] - times_s[row] < gap_s {
                later += 1;
            }
            let Some(&repeat) = members.get(later) else { break };
            if MOST_REPEAT_BLOCKS * shortest_s < times_s[repeat] - times_s[row] {
                continue;
            }
            n_pairs += 1;
            let block = ((times_s[row] - first_s) / span_s * REPEAT_CLUSTERS) as u64;
            let sums = clusters.entry((series, ends, block)).or_default();
            for (a, b) in rows.errors[row].iter().zip(&rows.errors[repeat]) {
                if a.is_finite() && b.is_finite() {
                    sums[0] += 0.5 * (a * a + b * b);
                    sums[1] += 0.5 * (a - b) * (a - b);
                }
            }
        }
    }
    if clusters.len() < FEWEST_CLUSTERS {
        return None;
    }
    let [remaining, pure] = clusters.values().fold([0.0; 2], |[r, p], s| [r + s[0], p + s[1]]);
    let ratio = remaining / pure;
    let squares: f64 = clusters.values().map(|[r, p]| (r - ratio * p) * (r - ratio * p)).sum();
    let least_ratio = ratio - Z_95 * squares.sqrt() / pure;
    let n = n_pairs as f64;
    Some(PureError {
        remaining: (remaining / n).sqrt(),
        pure: (pure / n).sqrt(),
        least_ratio: if least_ratio.is_finite() { least_ratio } else { 0.0 },
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use proto::rng::{Draws, Purpose};

    /// Eight series of 200 rows: noise of one unit beside what `missed` says of series and time.
    fn of(missed: impl Fn(u32, u32) -> f64) -> PureError {
        let draws = Draws::new(3, Purpose::Resample);
        let keys = || (0..8u32).flat_map(|series| (0..200u32).map(move |time| (series, time)));
        let error = |(series, time): (u32, u32)| {
            let noise = draws.normal(u64::from(series), u64::from(time), 0);
            [noise + missed(series, time), f64::NAN, f64::NAN]
        };
        let rows = Linearised { errors: keys().map(error).collect(), ..Linearised::default() };
        let dependence = Dependence {
            times_s: keys().map(|(_, time)| f64::from(time)).collect(),
            series: keys().map(|(series, _)| series).collect(),
            campaigns: keys().map(|_| 0).collect(),
            shortest_s: 1.0,
            nodes: None,
        };
        pure_error(&rows, &dependence).expect("enough rows repeat each other")
    }

    #[test]
    fn noise_alone_is_what_repeats_differ_by() {
        let found = of(|_, _| 0.0);
        assert!((found.pure - 1.0).abs() < 0.05 && !found.is_alarming(), "{found:?}");
    }

    #[test]
    fn what_changes_slowly_is_more_than_repeats_differ_by() {
        let found = of(|series, time| 2.0 * libm::sin(f64::from(time + 25 * series) / 20.0));
        assert!((found.pure - 1.0).abs() < 0.1, "{found:?}");
        assert!(1.5 < found.remaining && found.is_alarming(), "{found:?}");
        // What changes from row to row looks like noise.
        assert!(!of(|_, time| if time % 4 < 2 { 1.0 } else { -1.0 }).is_alarming());
    }
}
