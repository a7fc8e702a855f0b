//! How large effects may be that were not found, and how large each would have had to be.
//!
//! Both follow from the score test of an effect beside all that was accepted. The estimate of its amplitude is approximately normal
//! (D. R. Cox and D. V. Hinkley, Theoretical Statistics, 1974, section 9.3). Sizes are root mean squares of what the effect moves, over the
//! rows, so that all effects are in the unit of the errors.

use crate::ladder::dependence_of;
use crate::score_test::{ScoreTest, ScoreTests};
use statrs::distribution::{ContinuousCDF as _, Normal, StudentsT};
use study::linear::{Column, Linearised};
use study::thresholds::{
    DETECTABLE_PROBABILITY, FAMILY_ERROR, INTERVAL_PROBABILITY, UNCORRECTED_LEVEL, WORTH_SHARE,
};
use study::{Candidate, Study, TermId};

/// What the data say of an effect that was not accepted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct SizeBounds {
    /// The effect.
    pub term: TermId,
    /// It moves rows by no more than this (90 %, of all such effects at once).
    pub upper: f64,
    /// From this size on it would have been found with a probability of [`DETECTABLE_PROBABILITY`].
    pub detectable: f64,
    /// P-value of the effect, corrected for all candidates and for all groups of rows on which each was tested.
    pub p_value: f64,
    /// The size from which on it is worth having.
    pub worth: f64,
}

impl SizeBounds {
    /// Whether it may be missing, though it was not found.
    pub(crate) fn is_possible(&self) -> bool {
        self.p_value < UNCORRECTED_LEVEL && self.worth < self.upper
    }
}

/// Bounds of all effects of the catalogue that move means and were not accepted, beside all that was.
///
/// * `n_tried`: how many terms the search tried.
/// * `rows`, `fit`: the fit of what was accepted to all rows of the study, and its slopes.
pub(crate) fn size_bounds<S: Study>(
    study: &S,
    n_tried: usize,
    (rows, fit): (&Linearised, &S::Fit),
    accepted: &[TermId],
) -> Vec<SizeBounds> {
    let candidates = study.candidates();
    let may_be = |term: &TermId| {
        let candidate = &candidates[*term];
        candidate.curve_over().is_none()
            && candidate.only.is_none()
            && candidate.is_tried_beside(accepted)
            && !accepted.contains(term)
    };
    let columns = |term: TermId| (term, study.columns(fit, term));
    let all: Vec<(TermId, Vec<Column>)> = candidates.ids().filter(may_be).map(columns).collect();
    let n_columns: usize = all.iter().map(|(_, columns)| columns.len()).sum();
    let n_tried = n_tried.max(n_columns) as f64;
    // Each was tested on each group of rows, too.
    let limited = study.partitions().into_iter().filter(|partition| partition.key.is_some());
    let n_sets = 1 + limited.map(|partition| partition.groups.len()).sum::<usize>();
    let known = rows.errors.iter().filter(|errors| errors[0].is_finite()).count() as f64;
    let square = rows.errors.iter().flatten().filter(|it| it.is_finite()).map(|it| it * it);
    let worth = (WORTH_SHARE * square.sum::<f64>() / known).sqrt();
    let of_term = |(term, columns): &(TermId, Vec<Column>)| {
        let dependence = dependence_of(study, *term);
        let tests = ScoreTests::new(rows, &dependence);
        let of_column = |column: &Column| {
            let test = tests.test(column, &[])?;
            let bounds = of_test(&test, moved(column, rows), n_tried, worth, *term);
            let is_possible = 0.0 < test.amplitude || !is_one_sided(&candidates[*term]);
            let p_value =
                if is_possible { (n_sets as f64 * n_tried * test.p_value).min(1.0) } else { 1.0 };
            Some(SizeBounds { p_value, ..bounds })
        };
        // Of several columns, the greatest sizes and the least p-value.
        let all: Option<Vec<SizeBounds>> = columns.iter().map(of_column).collect();
        all?.into_iter().reduce(|a, b| SizeBounds {
            upper: a.upper.max(b.upper),
            detectable: a.detectable.max(b.detectable),
            p_value: a.p_value.min(b.p_value),
            ..a
        })
    };
    all.iter().filter_map(of_term).collect()
}

/// Whether an effect acts to one side only: the value at which it does nothing is an end of its range. A column is what it moves from there.
fn is_one_sided(candidate: &Candidate) -> bool {
    candidate.parameters.first().is_some_and(|size| {
        size.null.is_some_and(|null| {
            null.total_cmp(&size.min).is_eq() || null.total_cmp(&size.max).is_eq()
        })
    })
}

/// Root mean square of a column over the rows that have an error, of the parts that have one.
pub(crate) fn moved(column: &Column, rows: &Linearised) -> f64 {
    let known = column.iter().zip(&rows.errors).filter(|(_, errors)| errors[0].is_finite());
    let (sum, n) = known.fold((0.0, 0.0), |(sum, n), (parts, errors)| {
        let known = parts.iter().zip(errors).filter(|(it, error)| (*it * *error).is_finite());
        (sum + known.map(|(it, _)| it * it).sum::<f64>(), n + 1.0)
    });
    (sum / n).sqrt()
}

/// Bounds by one test of `n_tests`. `scale`: what an amplitude of 1 moves.
fn of_test(test: &ScoreTest, scale: f64, n_tests: f64, worth: f64, term: TermId) -> SizeBounds {
    let critical = StudentsT::new(0.0, 1.0, test.freedom)
        .map_or(f64::INFINITY, |law| -law.inverse_cdf(FAMILY_ERROR / n_tests / 2.0));
    let found = Normal::standard().inverse_cdf(DETECTABLE_PROBABILITY);
    let beyond = found * test.standard_error;
    SizeBounds {
        term,
        upper: scale * test.upper_bound((1.0 - INTERVAL_PROBABILITY) / n_tests),
        detectable: (scale * (critical * test.standard_error + beyond)).max(worth + scale * beyond),
        p_value: (n_tests * test.p_value).min(1.0),
        worth,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use study::PerTerm;

    /// Bounds of an effect that moves rows by 2 dB per unit, by one of 10 tests.
    fn bounds(amplitude: f64, worth: f64) -> SizeBounds {
        let test = ScoreTest {
            amplitude,
            standard_error: 0.1,
            freedom: 1e4,
            p_value: 0.004,
            rise: 0.0,
            n_clusters: 100,
        };
        let term = std::iter::once(()).collect::<PerTerm<()>>().ids().next().unwrap();
        of_test(&test, 2.0, 10.0, worth, term)
    }

    #[test]
    fn bounds_are_sizes_that_are_not_excluded_and_that_would_be_found() {
        let found = bounds(-0.3, 0.0);
        // One-sided 1 % of the normal law: 2.3263; two-sided 0.05 %: 3.4808; 90 %: 1.2816.
        assert!((found.upper - 2.0 * (0.3 + 0.232_63)).abs() < 2e-3, "{found:?}");
        assert!((found.detectable - 0.2 * (3.4808 + 1.2816)).abs() < 2e-3, "{found:?}");
        assert!((found.p_value - 0.04).abs() < 1e-12);
        // What is not worth having is not found however sure it is.
        let dull = bounds(-0.3, 5.0);
        assert!((dull.detectable - (5.0 + 0.256_31)).abs() < 2e-3, "{dull:?}");
    }

    #[test]
    fn what_may_be_missing_is_significant_and_may_be_worth_having() {
        assert!(bounds(-0.3, 0.5).is_possible());
        assert!(!bounds(-0.3, 2.0).is_possible());
    }

    #[test]
    fn what_a_column_moves_is_a_root_mean_square_over_rows_with_errors() {
        let rows = Linearised {
            errors: vec![[1.0, f64::NAN, f64::NAN], [f64::NAN; 3], [0.5, f64::NAN, f64::NAN]],
            ..Linearised::default()
        };
        let column = vec![[3.0, f64::NAN, f64::NAN], [100.0, 0.0, 0.0], [4.0, f64::NAN, f64::NAN]];
        assert!((moved(&column, &rows) - 12.5_f64.sqrt()).abs() < 1e-12);
    }
}
