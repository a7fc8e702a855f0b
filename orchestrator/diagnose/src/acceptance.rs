//! The acceptance rule: which of the tested terms are significant, and large enough to be worth adding.
//!
//! `diagnose` applies it to all candidates of a round, `power` to one effect. A term is accepted if its gain on held-out rows is
//! significant at [`FAMILY_ERROR`] after Holm's correction for all candidates, and large enough. It is large enough by its gain per
//! row, or by the share of the error that it removes.

use crate::gain::{Gain, Scores};
use statrs::distribution::{ContinuousCDF as _, StudentsT};
use study::thresholds::{FAMILY_ERROR, LEAST_ERROR_SHARE, WORTH_NATS, WORTH_SHARE};

/// What was decided on one term.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Verdict {
    /// Neither significant after the correction nor plausible.
    Rejected,
    /// Significant at [`FAMILY_ERROR`] after Holm's correction for all candidates, but not to be added: it is not worth having, or was
    /// removed before.
    Significant,
    /// Significant at [`FAMILY_ERROR`] only if it were the only candidate, and worth having.
    Plausible,
    /// Significant after the correction, and worth having.
    Acceptable,
    /// Acceptable by its gain, but it moves no more than what rows that depend on each other may share.
    Withheld,
    /// Worth having by its gain, but the measurements show what it rules out, or another channel gets worse.
    Contradicted,
}

impl Verdict {
    /// The verdict on a term by its gain. `is_plausible`: significant if it were the only candidate, and to be added.
    #[must_use]
    pub(crate) fn by_gain(is_significant: bool, is_plausible: bool) -> Self {
        match (is_significant, is_plausible) {
            (false, false) => Self::Rejected,
            (true, false) => Self::Significant,
            (false, true) => Self::Plausible,
            (true, true) => Self::Acceptable,
        }
    }

    /// Significant after the correction for all candidates.
    #[must_use]
    pub(crate) fn is_significant(self) -> bool {
        matches!(self, Self::Significant | Self::Acceptable)
    }

    /// Significant if it were the only candidate, and worth having.
    #[must_use]
    pub(crate) fn is_plausible(self) -> bool {
        matches!(self, Self::Plausible | Self::Acceptable)
    }

    /// Significant after the correction, and worth having.
    #[must_use]
    pub(crate) fn is_acceptable(self) -> bool {
        self == Self::Acceptable
    }
}

/// Judges terms that were each tested on top of the same model.
///
/// * `gains`: of the terms, on held-out rows.
/// * `n_candidates`: the number of candidates in the correction, including those that were not worth a test.
/// * `least_share`: the share of the error that a term must remove if its gain alone is not worth it; at least [`WORTH_SHARE`].
/// * `share_removed`: the share of the error that the term at an index removes; asked only where the gain is significant by itself.
#[must_use]
pub(crate) fn judge(
    gains: &[Gain],
    n_candidates: usize,
    least_share: f64,
    share_removed: impl Fn(usize) -> f64,
) -> Vec<Verdict> {
    let is_significant = holm(gains, n_candidates);
    let judge_one = |(index, is_significant): (usize, bool)| {
        let gain = &gains[index];
        let is_plausible = gain.p_value < FAMILY_ERROR
            && is_worth(gain.gain, least_share, || share_removed(index));
        Verdict::by_gain(is_significant, is_plausible)
    };
    is_significant.into_iter().enumerate().map(judge_one).collect()
}

/// Whether a gain (nats per row) or the share of the error that is removed is worth having.
#[must_use]
pub(crate) fn is_worth(gain: f64, least_share: f64, share_removed: impl FnOnce() -> f64) -> bool {
    WORTH_NATS <= gain || WORTH_SHARE.max(least_share) <= share_removed()
}

/// The least share of the present error that a term must remove, so that it removes [`LEAST_ERROR_SHARE`] of the error of the model as
/// configured.
#[must_use]
pub(crate) fn least_share(configured: &Scores, present: &Scores) -> f64 {
    LEAST_ERROR_SHARE * share_scale(configured.mean_square(), present.mean_square())
}

/// How many times greater the mean squared error of the model as configured is than that of another, at least 1: shares of the
/// one are so many times smaller than shares of the other.
#[must_use]
pub(crate) fn share_scale(configured: f64, other: f64) -> f64 {
    let scale = configured / other;
    if scale.is_finite() { scale.max(1.0) } else { 1.0 }
}

/// Whether a term is certain by its total gain (nats). This matters if blocks are too few or too unlike for any term to be significant
/// after the correction. A likelihood ratio of held-out rows exceeds e^g by chance with a probability of at most e^-g. The effective
/// sample size is the number of rows divided by `design_effect`.
#[must_use]
pub(crate) fn is_certain_by_total(gain: &Gain, n_candidates: usize, design_effect: f64) -> bool {
    let least = libm::log(n_candidates as f64 / FAMILY_ERROR) * design_effect;
    least < gain.total()
}

/// Standard errors that a gain over so many blocks must exceed to be the first that Holm's rule accepts.
#[must_use]
pub(crate) fn critical_t(n_candidates: usize, n_blocks: usize) -> f64 {
    StudentsT::new(0.0, 1.0, (n_blocks.max(2) - 1) as f64)
        .map_or(f64::INFINITY, |law| -law.inverse_cdf(FAMILY_ERROR / n_candidates as f64))
}

/// Which gains are significant with `n` candidates counted (S. Holm, A simple sequentially rejective multiple test procedure,
/// Scand. J. Stat. 6, 1979).
fn holm(gains: &[Gain], n: usize) -> Vec<bool> {
    let mut order: Vec<usize> = (0..gains.len()).collect();
    order.sort_by(|&a, &b| gains[a].p_value.total_cmp(&gains[b].p_value));
    let mut is_significant = vec![false; gains.len()];
    for (rank, index) in order.into_iter().enumerate() {
        let left = n.saturating_sub(rank).max(1) as f64;
        if FAMILY_ERROR / left < gains[index].p_value {
            break;
        }
        is_significant[index] = true;
    }
    is_significant
}

#[cfg(test)]
mod tests {
    use super::*;

    fn gain(gain: f64, p_value: f64) -> Gain {
        Gain { gain, standard_error: 0.001, p_value, n_blocks: 60, n_rows: 1000 }
    }

    #[test]
    fn holm_corrects_the_least_p_value_for_all_candidates_and_each_next_for_one_less() {
        // 0.005 / 10 = 0.0005, 0.005 / 9 = 0.00056.
        let p_values = |first, second| [gain(1.0, second), gain(1.0, first)];
        assert_eq!(holm(&p_values(0.0005, 0.00055), 10), [true, true]);
        assert_eq!(holm(&p_values(0.00051, 0.00051), 10), [false, false]);
        assert_eq!(holm(&p_values(0.0001, 0.0006), 10), [false, true]);
    }

    #[test]
    fn one_term_is_judged_as_the_first_of_many() {
        let alone = |p_value| judge(&[gain(1.0, p_value)], 10, 0.0, |_| 0.0)[0];
        assert!(alone(0.0004).is_acceptable());
        assert_eq!(alone(0.004), Verdict::Plausible);
        assert_eq!(alone(0.006), Verdict::Rejected);
    }

    #[test]
    fn a_significant_term_is_refused_unless_its_gain_or_its_share_of_the_error_is_worth_it() {
        let judged = |nats, least, share: f64| {
            judge(&[gain(nats, 1e-9)], 10, least, |_| share)[0].is_acceptable()
        };
        assert!(judged(0.01, 0.5, 0.0));
        assert!(!judged(0.009, 0.0, 0.009));
        assert!(judged(0.009, 0.0, 0.01));
        assert!(!judged(0.009, 0.02, 0.015));
    }

    #[test]
    fn the_share_of_the_error_is_not_asked_of_terms_that_are_not_significant() {
        let asked = std::cell::Cell::new(0);
        let share = |_| {
            asked.set(asked.get() + 1);
            1.0
        };
        let _ = judge(&[gain(0.0, 1.0), gain(0.001, 1e-6), gain(1.0, 1e-6)], 3, 0.0, share);
        assert_eq!(asked.get(), 1);
    }

    #[test]
    fn a_total_gain_is_certain_beyond_the_logarithm_of_candidates_over_the_error() {
        // ln(10 / 0.005) = 7.6 nats of 1000 rows.
        assert!(is_certain_by_total(&gain(0.0077, 0.004), 10, 1.0));
        assert!(!is_certain_by_total(&gain(0.0075, 0.004), 10, 1.0));
        assert!(!is_certain_by_total(&gain(0.0077, 0.004), 10, 4.0));
    }

    #[test]
    fn the_critical_t_is_that_of_students_law() {
        // One-sided 0.0005 at 59 degrees of freedom, by tables 3.46.
        assert!((critical_t(10, 60) - 3.46).abs() < 0.01, "{}", critical_t(10, 60));
        assert!(critical_t(10, 2).is_finite());
    }
}
