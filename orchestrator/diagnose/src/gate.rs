//! The gate before the verdict that nothing is missing: whether the model is visibly wrong, whatever the cause.
//!
//! Every constant by which rows may be off is tested, of all rows and of each group of rows (a robot, a sender, a campaign), by
//! cluster-robust score tests. A test asks whether the constant is *more than a margin*: removing it would lower the mean squared error by
//! 1 %. What is significant and smaller is worth nothing.

use crate::score_test::{ScoreTest, ScoreTests, upper_tail};
use numbers::statistics::mean;
use schemars::JsonSchema;
use serde::Serialize;
use statrs::distribution::{ContinuousCDF as _, StudentsT};
use std::collections::BTreeMap;
use study::Study;
use study::linear::{Dependence, Direction, Group, Linearised, Partition, on_rows};
use study::thresholds::{
    FAMILY_ERROR, FEWEST_ERROR_GROUPS, FREE_SHARE, GROUP_ERROR_RATIO, INTERVAL_PROBABILITY,
    NOISE_BLOCKS, NOISIER_RATIO, TRIMMED_SHARE, UNCORRECTED_LEVEL, WORTH_SHARE,
};

/// A constant by which the model is wrong, of all rows or of a group of them.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Misfit {
    /// What is off, and of which rows: `robots are off to the left`.
    pub what: String,
    /// The rows: `robot 3`, `sender 7`; absent: all.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub of: Option<String>,
    /// By how much, in `unit`.
    pub off: f64,
    /// Unit of `off`: dB or m.
    pub unit: &'static str,
    /// Standard error of `off`, clustered.
    pub standard_error: f64,
    /// Probability of as much beyond what is worth mentioning by chance, times the number of tests.
    pub p_value: f64,
}

impl Misfit {
    /// The misfit in words: `readings are off by -15.5 dB (sender 3)`.
    #[must_use]
    pub fn sentence(&self) -> String {
        let of = self.of.as_ref().map(|of| format!(" ({of})")).unwrap_or_default();
        format!("{} by {:.*} {}{of}", self.what, decimals(self.off, 1.0), self.off, self.unit)
    }
}

/// Decimals that show two digits of a number, and at least so many.
pub(crate) fn decimals(value: f64, least: f64) -> usize {
    let digits = 1.0 - libm::floor(libm::log10(value.abs().max(1e-9)));
    digits.clamp(least, 6.0) as usize
}

/// What the gate saw.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Gate {
    /// Constants beyond what is worth mentioning, the surest first.
    pub misfits: Vec<Misfit>,
    /// The greatest constant error that may be hidden in these data (90 % bound), and the standard deviation of what is left, with their
    /// unit: where the first exceeds the second, these data cannot tell that the model is right. None where no bound can be stated.
    pub could_hide: Option<(f64, f64, &'static str)>,
    /// There are constants that rows may be off by, and the data are too few for a bound of any.
    pub is_unbounded: bool,
}

impl Gate {
    /// Whether data with this gate are too few to tell that nothing is missing.
    #[must_use]
    pub fn tells_too_little(&self) -> bool {
        self.is_unbounded || self.could_hide.is_some_and(|(bound, sd, _)| sd < bound)
    }
}

/// Mean squared error of all parts.
fn mean_square(rows: &Linearised) -> f64 {
    let squares = rows.errors.iter().flatten().filter(|error| error.is_finite());
    let n = rows.errors.iter().filter(|error| error[0].is_finite()).count() as f64;
    squares.map(|error| error * error).sum::<f64>() / n
}

/// Looks at what a fit leaves.
#[must_use]
pub(crate) fn gate<S: Study>(study: &S, fit: &S::Fit) -> Gate {
    study.linearised(fit).map_or_else(Gate::default, |rows| of_slopes(study, &rows))
}

/// The same of the slopes of a fit.
#[must_use]
pub(crate) fn of_slopes<S: Study>(study: &S, rows: &Linearised) -> Gate {
    let dependence = study.dependence();
    let plain = rows.plain();
    let all_tests = [rows, &plain].map(|rows| ScoreTests::new(rows, &dependence));
    let square = mean_square(rows);
    let directions = study.directions();
    let partitions = study.partitions();
    let n_groups: usize = partitions.iter().map(|partition| partition.groups.len()).sum();
    let n_tests = (all_tests.len() * directions.len() * (1 + n_groups)) as f64;
    let all: Vec<u32> = (0..rows.slopes.len() as u32).collect();
    let sets = std::iter::once((None, &all)).chain(partitions.iter().flat_map(|partition| {
        partition
            .groups
            .iter()
            .map(|group| (Some(format!("{} {}", partition.of, group.id)), &group.rows))
    }));
    let mut gate = Gate::default();
    for (of, members) in sets {
        let share = members.len() as f64 / all.len() as f64;
        let margin = (WORTH_SHARE * square / share).sqrt();
        for Direction { name, unit, column } in &directions {
            let column = on_rows(column, members);
            let of_tests = all_tests.iter().filter_map(|tests| tests.test(&column, &[]));
            let of_tests: Vec<ScoreTest> = of_tests.collect();
            if let (None, Some(test)) = (&of, of_tests.first()) {
                let bound = test.upper_bound(1.0 - INTERVAL_PROBABILITY);
                let hides = gate.could_hide.is_none_or(|(before, ..)| before < bound);
                if hides {
                    gate.could_hide = Some((bound, (square / parts(rows)).sqrt(), unit));
                }
            }
            // All rows have half of the error, all groups together the other.
            let n_of_all = (all_tests.len() * directions.len()) as f64;
            let times = 2.0 * if of.is_none() { n_of_all } else { n_tests };
            let p_value_of = |test: &ScoreTest| (times * test.p_value_beyond(margin)).min(1.0);
            let surest = of_tests.iter().min_by(|a, b| p_value_of(a).total_cmp(&p_value_of(b)));
            let Some(test) = surest else { continue };
            let p_value = p_value_of(test);
            if p_value < FAMILY_ERROR {
                gate.misfits.push(Misfit {
                    what: (*name).to_owned(),
                    of: of.clone(),
                    off: test.amplitude,
                    unit,
                    standard_error: test.standard_error,
                    p_value,
                });
            }
        }
    }
    gate.is_unbounded = gate.could_hide.is_none() && !directions.is_empty();
    for partition in &partitions {
        gate.misfits.extend(spread_apart(rows, partition, directions.first()));
    }
    gate.misfits.sort_by(|a, b| a.p_value.total_cmp(&b.p_value));
    gate
}

/// Squared errors of some rows with the number of the row, ascending, without the largest of them. `share`: how many are left out.
fn trimmed_squares(rows: &Linearised, members: &[u32], share: f64) -> Vec<(f64, u32)> {
    let square = |&row: &u32| {
        let errors = rows.errors[row as usize];
        let known = errors.iter().filter(|error| error.is_finite());
        errors[0].is_finite().then(|| (known.map(|error| error * error).sum(), row))
    };
    let mut squares: Vec<(f64, u32)> = members.iter().filter_map(square).collect();
    squares.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    squares.truncate(((1.0 - share) * squares.len() as f64) as usize);
    squares
}

fn mean_of_squares(squares: &[(f64, u32)]) -> f64 {
    mean(squares.iter().map(|(square, _)| *square))
}

/// A group of rows whose errors are far greater than those of each other group: a model that is wrong for one robot alone, whose rows a
/// likelihood with heavy tails passes over.
fn spread_apart(
    rows: &Linearised,
    partition: &Partition,
    direction: Option<&Direction>,
) -> Option<Misfit> {
    let unit = direction?.unit;
    let root_mean_square = |group: &Group| {
        let squares = trimmed_squares(rows, &group.rows, TRIMMED_SHARE);
        (!squares.is_empty()).then(|| mean_of_squares(&squares).sqrt()).filter(|error| 0.0 < *error)
    };
    let all: Vec<(u32, f64)> = partition
        .groups
        .iter()
        .filter_map(|group| Some((group.id, root_mean_square(group)?)))
        .collect();
    if all.len() < FEWEST_ERROR_GROUPS {
        return None;
    }
    let &(id, most) = all.iter().max_by(|a, b| a.1.total_cmp(&b.1))?;
    let others: Vec<f64> =
        all.iter().filter(|(other, _)| *other != id).map(|(_, error)| libm::log(*error)).collect();
    let n = others.len() as f64;
    let mean = others.iter().sum::<f64>() / n;
    let squares: f64 = others.iter().map(|other| (other - mean) * (other - mean)).sum();
    let standard_error = (squares / (n - 1.0) * (1.0 + 1.0 / n)).sqrt();
    let beyond = (libm::log(most / GROUP_ERROR_RATIO) - mean) / standard_error;
    // Of all groups the one whose errors are greatest.
    let p_value = StudentsT::new(0.0, 1.0, n - 1.0).map_or(1.0, |law| law.sf(beyond)) * (n + 1.0);
    let typical = libm::exp(mean);
    (p_value < FAMILY_ERROR).then(|| Misfit {
        what: "errors exceed those of the others".to_owned(),
        of: Some(format!("{} {id}", partition.of)),
        off: most - typical,
        unit,
        standard_error: typical * standard_error,
        p_value,
    })
}

/// A group of rows whose errors have a greater variance than those of the other rows: the place or the clock of a node may be wrong, which
/// moves no mean.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Noisier {
    /// The rows: `sender 7`.
    pub of: String,
    /// Root mean squared error of its rows, and of all others.
    pub errors: [f64; 2],
    /// Least ratio of both variances that the data allow (95 %, corrected for all groups).
    pub least_ratio: f64,
}

/// The group of rows that surely scatters more than the others.
pub(crate) fn noisiest<S: Study>(study: &S, rows: &Linearised) -> Option<Noisier> {
    let (partitions, dependence) = (study.partitions(), study.dependence());
    let all = partitions.iter().filter_map(|partition| noisier(rows, partition, &dependence));
    all.max_by(|a, b| a.least_ratio.total_cmp(&b.least_ratio))
}

/// The group of a partition that surely scatters more than the other rows. Squares are trimmed alike in all groups, and blocks of time are
/// independent.
fn noisier(rows: &Linearised, partition: &Partition, dependence: &Dependence) -> Option<Noisier> {
    let n_groups = partition.groups.len();
    let block = time_blocks(dependence).filter(|_| FEWEST_ERROR_GROUPS <= n_groups)?;
    let of_group = |group: &Group| {
        let mut is_in = vec![false; rows.errors.len()];
        group.rows.iter().for_each(|&row| is_in[row as usize] = true);
        let outside: Vec<u32> =
            (0..is_in.len() as u32).filter(|&row| !is_in[row as usize]).collect();
        let squares = trimmed_squares(rows, &group.rows, FREE_SHARE);
        let outside = trimmed_squares(rows, &outside, FREE_SHARE);
        let (own, others) = (mean_of_squares(&squares), mean_of_squares(&outside));
        let mut blocks: BTreeMap<(u32, u64), f64> = BTreeMap::new();
        for &(square, row) in &squares {
            *blocks.entry(block(row)).or_default() += square - own;
        }
        let freedom = blocks.len().checked_sub(1).filter(|&n| FEWEST_ERROR_GROUPS <= n)? as f64;
        let variance: f64 = blocks.values().map(|sum| sum * sum).sum();
        let level = UNCORRECTED_LEVEL / n_groups as f64;
        let quantile = -StudentsT::new(0.0, 1.0, freedom).ok()?.inverse_cdf(level);
        let least = own - quantile * variance.sqrt() / squares.len() as f64;
        Some(Noisier {
            of: format!("{} {}", partition.of, group.id),
            errors: [own.sqrt(), others.sqrt()],
            least_ratio: least / others,
        })
    };
    let all = partition.groups.iter().filter_map(of_group);
    all.filter(|one| NOISIER_RATIO < one.least_ratio)
        .max_by(|a, b| a.least_ratio.total_cmp(&b.least_ratio))
}

/// The group of rows whose share of lost frames differs most from the prediction of a fit, as a clause; `None`: no difference is significant.
/// A less sensitive receiver, or interference at one node, changes losses without changing RSSI.
pub(crate) fn lost_otherwise<S: Study>(study: &S, fit: &S::Fit) -> Option<String> {
    let residuals = study.scanned_residuals(fit).components;
    let surprise = &residuals.iter().find(|component| !component.is_of_error)?.standardised;
    let (partitions, dependence) = (study.partitions(), study.dependence());
    let n_groups: usize = partitions.iter().map(|partition| partition.groups.len()).sum();
    let block = time_blocks(&dependence)?;
    let of_group = |partition: &Partition, group: &Group| {
        let mut blocks: BTreeMap<(u32, u64), [f64; 2]> = BTreeMap::new();
        for &row in group.rows.iter().filter(|row| surprise[**row as usize].is_finite()) {
            let sums = blocks.entry(block(row)).or_default();
            *sums = [sums[0] + 1.0, sums[1] + surprise[row as usize]];
        }
        let add = |all: [f64; 2], one: &[f64; 2]| [all[0] + one[0], all[1] + one[1]];
        let [n, sum] = blocks.values().fold([0.0; 2], add);
        let mean = sum / n;
        let freedom = blocks.len().checked_sub(1).filter(|&n| FEWEST_ERROR_GROUPS <= n)? as f64;
        let apart = |[n, sum]: &[f64; 2]| (sum - n * mean) * (sum - n * mean);
        // Surprise has variance 1 where the model is right; without a single loss, blocks hardly differ.
        let variance = blocks.values().map(apart).sum::<f64>().max(n);
        // A group without rows has neither.
        let t = Some(sum.abs() / variance.sqrt()).filter(|t| t.is_finite())?;
        let p_value = 2.0 * n_groups as f64 * upper_tail(t, freedom);
        let is_worth = WORTH_SHARE < mean * mean;
        (is_worth && p_value < FAMILY_ERROR).then(|| {
            let how = if mean < 0.0 { "more" } else { "less" };
            let said = format!(
                "frames of {} {} are lost {how} often than the model predicts",
                partition.of, group.id
            );
            (mean.abs(), said)
        })
    };
    let all = partitions.iter().flat_map(|partition| {
        partition.groups.iter().filter_map(move |group| of_group(partition, group))
    });
    all.max_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, said)| said)
}

/// What is said where nothing else is wrong.
pub(crate) fn nothing_but(lost: &str) -> String {
    format!("nothing was found for certain: {lost}")
}

/// The block of time of a row, in its campaign. None: times are not known.
fn time_blocks(dependence: &Dependence) -> Option<impl Fn(u32) -> (u32, u64)> {
    let times_s = &dependence.times_s;
    let span = times_s.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), &time_s| {
        (low.min(time_s), high.max(time_s))
    });
    let block = move |row: u32| {
        let share = (times_s[row as usize] - span.0) / (span.1 - span.0);
        (dependence.campaigns[row as usize], (share * NOISE_BLOCKS) as u64)
    };
    times_s.iter().all(|time_s| time_s.is_finite()).then_some(block)
}

/// Parts of which errors are known.
pub(crate) fn parts(rows: &Linearised) -> f64 {
    let known = |errors: &&[f64; 3]| errors[0].is_finite();
    let first = rows.errors.iter().find(known);
    first.map_or(1.0, |errors| errors.iter().filter(|error| error.is_finite()).count() as f64)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proto::rng::{Draws, Purpose};

    fn misfit(off: f64, of: Option<&str>) -> Misfit {
        Misfit {
            what: "readings are off".to_owned(),
            of: of.map(str::to_owned),
            off,
            unit: "dB",
            standard_error: 0.1,
            p_value: 1e-6,
        }
    }

    #[test]
    fn a_misfit_is_said_with_two_digits() {
        assert_eq!(misfit(-15.53, None).sentence(), "readings are off by -15.5 dB");
        let of = misfit(0.01234, Some("robot 3"));
        assert_eq!(of.sentence(), "readings are off by 0.012 dB (robot 3)");
    }

    /// What a partition of groups of 100 rows each gives, the errors of the first so many times those of the others.
    fn apart(n_groups: u32, times: f64, is_outlier: bool) -> Option<Misfit> {
        let errors = (0..100 * n_groups).map(|row| {
            let (group, k) = (row / 100, row % 100);
            let size = 0.9 + 0.02 * f64::from(group) + 0.001 * f64::from(k);
            let is_first = group == 0 && (!is_outlier || k < 4);
            [size * if is_first { times } else { 1.0 }, f64::NAN, f64::NAN]
        });
        let rows = Linearised { errors: errors.collect(), ..Linearised::default() };
        let group = |id| Group { id, rows: (100 * id..100 * (id + 1)).collect() };
        let groups = (0..n_groups).map(group).collect();
        let partition = Partition { of: "robot", key: Some("agents"), groups };
        let direction = Direction { name: "", unit: "m", column: Vec::new() };
        spread_apart(&rows, &partition, Some(&direction))
    }

    #[test]
    fn a_robot_whose_errors_are_far_greater_is_a_misfit() {
        let found = apart(8, 20.0, false).expect("20 times the others");
        assert_eq!(found.of.as_deref(), Some("robot 0"));
        assert!((15.0..25.0).contains(&found.off), "{}", found.off);
        // Not worth mentioning, too few to compare, or a few outliers.
        assert_eq!(apart(8, 1.5, false), None);
        assert_eq!(apart(4, 20.0, false), None);
        assert_eq!(apart(8, 1000.0, true), None);
    }

    #[test]
    fn data_tell_too_little_where_more_could_hide_than_the_noise() {
        let hides = |bound: f64| Gate { could_hide: Some((bound, 1.0, "dB")), ..Gate::default() };
        assert!(hides(1.1).tells_too_little() && !hides(0.9).tells_too_little());
        // Nor do they where no bound can be stated of a constant that there may be.
        assert!(Gate { is_unbounded: true, ..Gate::default() }.tells_too_little());
        assert!(!Gate::default().tells_too_little());
    }

    #[test]
    fn a_node_that_scatters_more_than_the_others_is_told() {
        let found = |times: f64| {
            let draws = Draws::new(4, Purpose::Resample);
            let error = |row: u64| draws.normal(row, 0, 0) * if row < 300 { times } else { 1.0 };
            let errors = (0..3000).map(|row| [error(row), f64::NAN, f64::NAN]).collect();
            let rows = Linearised { errors, ..Linearised::default() };
            let group = |id| Group { id, rows: (300 * id..300 * (id + 1)).collect() };
            let groups = (0..10).map(group).collect();
            let dependence = Dependence {
                times_s: (0..3000).map(|row| f64::from(row % 300)).collect(),
                series: vec![0; 3000],
                campaigns: vec![0; 3000],
                shortest_s: 1.0,
                nodes: None,
                replicates: None,
            };
            noisier(&rows, &Partition { of: "node", key: None, groups }, &dependence)
        };
        let noisy = found(1.5).expect("twice the variance");
        assert_eq!(noisy.of, "node 0");
        assert!((noisy.errors[0] / noisy.errors[1] - 1.5).abs() < 0.15, "{noisy:?}");
        assert_eq!(found(1.0), None);
    }
}
