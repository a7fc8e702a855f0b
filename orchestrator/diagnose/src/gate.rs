//! The gate before the verdict that nothing is missing: whether the model is visibly wrong, whatever the cause.
//!
//! Every constant by which rows may be off is tested, of all rows and of each group of rows (a robot, a sender, a campaign), by
//! cluster-robust score tests. A test asks whether the constant is *more than a margin*: removing it would lower the mean squared error by
//! 1 %. What is significant and smaller is worth nothing.

use crate::acceptance::{FAMILY_ERROR, WORTH_SHARE};
use crate::score_test::ScoreTests;
use schemars::JsonSchema;
use serde::Serialize;
use study::Study;
use study::linear::{Direction, Linearised, on_rows};

/// A bound on what may be hidden holds with this probability.
const BOUND: f64 = 0.9;

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
        format!("{} by {:.*} {}{of}", self.what, decimals(self.off), self.off, self.unit)
    }
}

/// Decimals that show two digits of a number, and one at least.
fn decimals(value: f64) -> usize {
    let digits = 1.0 - libm::floor(libm::log10(value.abs().max(1e-9)));
    digits.clamp(1.0, 6.0) as usize
}

/// What the gate saw.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Gate {
    /// Constants beyond what is worth mentioning, the surest first.
    pub misfits: Vec<Misfit>,
    /// The greatest constant error that may be hidden in these data (90 % bound), and the standard deviation of what is left, with their
    /// unit: where the first exceeds the second, these data cannot tell that the model is right.
    pub could_hide: Option<(f64, f64, &'static str)>,
}

impl Gate {
    /// Whether data with this gate are too few to tell that nothing is missing.
    #[must_use]
    pub fn tells_too_little(&self) -> bool {
        self.could_hide.is_some_and(|(bound, sd, _)| sd < bound)
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
pub fn gate<S: Study>(study: &S, fit: &S::Fit) -> Gate {
    let Some(rows) = study.linearised(fit) else { return Gate::default() };
    let dependence = study.dependence();
    let tests = ScoreTests::new(&rows, &dependence);
    let square = mean_square(&rows);
    let directions = study.directions();
    let partitions = study.partitions();
    let n_groups: usize = partitions.iter().map(|partition| partition.groups.len()).sum();
    let n_tests = (directions.len() * (1 + n_groups)) as f64;
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
            let Some(test) = tests.test(&on_rows(column, members), &[]) else { continue };
            if of.is_none() {
                let bound = test.upper_bound(1.0 - BOUND);
                let hides = gate.could_hide.is_none_or(|(before, ..)| before < bound);
                if hides {
                    gate.could_hide = Some((bound, (square / parts(&rows)).sqrt(), unit));
                }
            }
            // All rows have half of the error, all groups together the other.
            let times = if of.is_none() { 2.0 * directions.len() as f64 } else { 2.0 * n_tests };
            let p_value = (times * test.p_value_beyond(margin)).min(1.0);
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
    gate.misfits.sort_by(|a, b| a.p_value.total_cmp(&b.p_value));
    gate
}

/// Parts of which errors are known.
fn parts(rows: &Linearised) -> f64 {
    let known = |errors: &&[f64; 3]| errors[0].is_finite();
    let first = rows.errors.iter().find(known);
    first.map_or(1.0, |errors| errors.iter().filter(|error| error.is_finite()).count() as f64)
}

#[cfg(test)]
mod tests {
    use super::*;

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

    #[test]
    fn data_tell_too_little_where_more_could_hide_than_the_noise() {
        let hides = |bound: f64| Gate { could_hide: Some((bound, 1.0, "dB")), misfits: Vec::new() };
        assert!(hides(1.1).tells_too_little() && !hides(0.9).tells_too_little());
        assert!(!Gate::default().tells_too_little());
    }
}
