//! Lack of fit against pure error: whether a model leaves more than noise.
//!
//! The residual variance alone cannot show it: the more a model misses, the larger is the noise that is fitted to it. It is therefore
//! compared with estimates of the noise variance. If the model is right, each estimate is close to the residual variance. If it is wrong,
//! at least one of them is smaller:
//!
//! * Repeats: half of the mean squared difference of two rows of one series that follow each other closely. Their model error is nearly
//!   the same, so that the difference is noise (N. R. Draper and H. Smith, Applied Regression Analysis, 3rd edition 1998, section 2.1).
//!   For robots it is taken along and across the motion, and to the east and north.
//! * The bulk of the rows, for robots: the squared median absolute error, scaled to a variance. It is not affected by a model that is
//!   wrong on fewer than half of the rows. The largest [`FREE_SHARE`] of the errors is left out of the residual variance here.

use std::collections::BTreeMap;
use study::linear::{Dependence, Linearised};
use study::thresholds::{
    FEWEST_CLUSTERS, FREE_SHARE, LACK_OF_FIT_RATIO, MOST_REPEAT_BLOCKS, REPEAT_WINDOWS,
};

/// Spans of a campaign that are clusters of rows, in each series.
const REPEAT_CLUSTERS: f64 = 10.0;
/// The standard normal quantile of a one-sided bound of 95 %.
const Z_95: f64 = 1.644_853_626_951_472_2;
/// The median absolute value of a standard normal number.
const MEDIAN_ABSOLUTE: f64 = 0.674_489_750_196_081_7;

/// What is left beside noise.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct PureError {
    /// Root mean square of what the model leaves.
    pub remaining: f64,
    /// Root mean square of the noise.
    pub pure: f64,
    /// Least ratio of both variances that the data allow (95 %, clustered).
    pub least_ratio: f64,
    /// The greatest, likewise.
    pub greatest_ratio: f64,
}

impl PureError {
    /// Whether the model leaves more than noise, beyond chance and by as much as matters.
    pub(crate) fn is_alarming(&self) -> bool {
        LACK_OF_FIT_RATIO < self.least_ratio
    }
}

/// By cluster: sums of squared residuals, of squared noise, and of rows.
type Sums = BTreeMap<(u32, [u32; 2], u64), [f64; 3]>;

/// Compares the residual variance with each estimate of the noise, and returns the comparison with the largest lower bound of the ratio.
/// None if too few rows have a repeat.
pub(crate) fn pure_error(rows: &Linearised, dependence: &Dependence) -> Option<PureError> {
    let known =
        |row: &usize| rows.errors[*row][0].is_finite() && dependence.times_s[*row].is_finite();
    let known: Vec<usize> = (0..rows.errors.len()).filter(known).collect();
    let mut found = vec![of_repeats(&rows.errors, &known, dependence)?];
    if !rows.directions.is_empty() {
        let turned = |(errors, [cos, sin]): (&[f64; 3], &[f64; 2])| {
            let [along, across, up] = *errors;
            [along * cos - across * sin, along * sin + across * cos, up]
        };
        let fixed: Vec<[f64; 3]> = rows.errors.iter().zip(&rows.directions).map(turned).collect();
        found.extend(of_repeats(&fixed, &known, dependence));
        found.extend(of_bulk(&rows.errors, &known, dependence));
    }
    found.into_iter().max_by(|a, b| a.least_ratio.total_cmp(&b.least_ratio))
}

/// The cluster of each row: its series, its nodes and a span of time.
fn clusters(known: &[usize], dependence: &Dependence) -> Vec<(u32, [u32; 2], u64)> {
    let times_s = || known.iter().map(|&row| dependence.times_s[row]);
    let first_s = times_s().fold(f64::INFINITY, f64::min);
    let span_s = times_s().fold(f64::NEG_INFINITY, f64::max) - first_s;
    let cluster = |(row, time_s): (usize, &f64)| {
        let ends = dependence.nodes.as_ref().map_or([0; 2], |nodes| nodes[row]);
        let block = (time_s - first_s) / span_s * REPEAT_CLUSTERS;
        (dependence.series[row], ends, block as u64)
    };
    dependence.times_s.iter().enumerate().map(cluster).collect()
}

fn of_repeats(errors: &[[f64; 3]], known: &[usize], dependence: &Dependence) -> Option<PureError> {
    let Dependence { times_s, shortest_s, nodes, .. } = dependence;
    // Neighbouring windows of a robot share the error of one position; frames have none in common.
    let [least_s, most_s] = match nodes {
        None => [REPEAT_WINDOWS[0] * (1.0 - 1e-6), REPEAT_WINDOWS[1]],
        Some(_) => [0.0, MOST_REPEAT_BLOCKS],
    }
    .map(|blocks| blocks * shortest_s);
    let mut repeating: BTreeMap<(u32, [u32; 2]), Vec<usize>> = BTreeMap::new();
    for &row in known {
        let ends = nodes.as_ref().map_or([0; 2], |nodes| nodes[row]);
        repeating.entry((dependence.series[row], ends)).or_default().push(row);
    }
    let clusters = clusters(known, dependence);
    let mut sums = Sums::new();
    for members in repeating.values_mut() {
        members.sort_by(|&a, &b| times_s[a].total_cmp(&times_s[b]));
        let mut later = 0;
        for (place, &row) in members.iter().enumerate() {
            later = later.max(place + 1);
            while later < members.len() && times_s[members[later]] - times_s[row] < least_s {
                later += 1;
            }
            let Some(&repeat) = members.get(later) else { break };
            if most_s < times_s[repeat] - times_s[row] {
                continue;
            }
            let sums = sums.entry(clusters[row]).or_default();
            for (a, b) in errors[row].iter().zip(&errors[repeat]) {
                if a.is_finite() && b.is_finite() {
                    sums[0] += 0.5 * (a * a + b * b);
                    sums[1] += 0.5 * (a - b) * (a - b);
                }
            }
            sums[2] += 1.0;
        }
    }
    compared(&sums)
}

fn of_bulk(errors: &[[f64; 3]], known: &[usize], dependence: &Dependence) -> Option<PureError> {
    let size = |row: usize| -> f64 {
        errors[row].iter().filter(|error| error.is_finite()).map(|error| error * error).sum()
    };
    let mut absolute: Vec<f64> = known
        .iter()
        .flat_map(|&row| errors[row])
        .filter(|error| error.is_finite())
        .map(f64::abs)
        .collect();
    absolute.sort_by(f64::total_cmp);
    let sd = absolute.get(absolute.len() / 2)? / MEDIAN_ABSOLUTE;
    let mut by_size = known.to_vec();
    by_size.sort_by(|&a, &b| size(a).total_cmp(&size(b)).then(a.cmp(&b)));
    by_size.truncate(((1.0 - FREE_SHARE) * known.len() as f64) as usize);
    let clusters = clusters(known, dependence);
    let mut sums = Sums::new();
    for row in by_size {
        let n_parts = errors[row].iter().filter(|error| error.is_finite()).count() as f64;
        let sums = sums.entry(clusters[row]).or_default();
        sums[0] += size(row);
        sums[1] += n_parts * sd * sd;
        sums[2] += 1.0;
    }
    compared(&sums)
}

fn compared(sums: &Sums) -> Option<PureError> {
    if sums.len() < FEWEST_CLUSTERS {
        return None;
    }
    let total = sums.values().fold([0.0; 3], |[r, p, n], s| [r + s[0], p + s[1], n + s[2]]);
    let [remaining, pure, n] = total;
    let ratio = remaining / pure;
    let squares: f64 = sums.values().map(|[r, p, _]| (r - ratio * p) * (r - ratio * p)).sum();
    let beyond = Z_95 * squares.sqrt() / pure;
    let least_ratio = ratio - beyond;
    Some(PureError {
        remaining: (remaining / n).sqrt(),
        pure: (pure / n).sqrt(),
        least_ratio: if least_ratio.is_finite() { least_ratio } else { 0.0 },
        greatest_ratio: ratio + beyond,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use proto::rng::{Draws, Purpose};

    /// Eight series of 200 rows, each with the errors that `errors` gives for series and time.
    fn compared_with(
        errors: impl Fn((u32, u32)) -> [f64; 3],
        directions: Vec<[f64; 2]>,
    ) -> PureError {
        let keys = || (0..8u32).flat_map(|series| (0..200u32).map(move |time| (series, time)));
        let errors = keys().map(errors).collect();
        let rows = Linearised { errors, directions, ..Linearised::default() };
        let dependence = Dependence {
            times_s: keys().map(|(_, time)| f64::from(time)).collect(),
            series: keys().map(|(series, _)| series).collect(),
            campaigns: keys().map(|_| 0).collect(),
            shortest_s: 1.0,
            nodes: None,
            replicates: None,
        };
        pure_error(&rows, &dependence).expect("enough rows repeat each other")
    }

    /// Noise of one unit beside what `missed` says of series and time.
    fn of(missed: impl Fn(u32, u32) -> f64) -> PureError {
        let draws = Draws::new(3, Purpose::Resample);
        let error = |(series, time): (u32, u32)| {
            let noise = draws.normal(u64::from(series), u64::from(time), 0);
            [noise + missed(series, time), f64::NAN, f64::NAN]
        };
        compared_with(error, Vec::new())
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

    #[test]
    fn what_is_missed_on_few_rows_is_more_than_the_bulk_differs_by() {
        let draws = Draws::new(5, Purpose::Resample);
        let of = |missed: f64, share: u32| {
            let error = |(series, time): (u32, u32)| {
                let noise = |k| draws.normal(u64::from(series), u64::from(time), k);
                let off = if (7 * time + 3 * series) % 100 < share { missed } else { 0.0 };
                [noise(0) + off, noise(1), f64::NAN]
            };
            compared_with(error, vec![[1.0, 0.0]; 8 * 200])
        };
        assert!(!of(0.0, 0).is_alarming());
        assert!(of(5.0, 15).is_alarming());
        // A window in a hundred is off for reasons of its own.
        assert!(!of(10.0, 1).is_alarming());
    }
}
