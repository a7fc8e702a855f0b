//! The next measurement: where two models that the data cannot tell apart differ most. They are rivals, or one model at both ends
//! of the interval of a parameter.

use super::diagnosis::NextMeasurement;
use super::ladder::{Ladder, Search};
use study::{COMMON, Estimate, PredictionDifference, Study};

/// Bins of a covariate.
const BINS: usize = 10;
/// A bin with fewer rows says nothing.
const FEWEST_ROWS: usize = 20;

/// Conditions under which models differ: a range of one covariate.
#[derive(Clone, Debug, PartialEq)]
pub struct Condition {
    /// Name of the covariate by which rows are selected.
    pub covariate: String,
    /// Least value of the covariate, in its own unit.
    pub from: f64,
    /// Greatest value of the covariate, in its own unit.
    pub to: f64,
    /// Mean difference of the two predictions in that range (dB, m or a share of frames).
    pub inside: f64,
    /// Mean difference of all other rows.
    pub outside: f64,
}

/// The tenth of the rows, by one covariate, in which two models differ most.
#[must_use]
pub fn greatest_difference(difference: &PredictionDifference) -> Option<Condition> {
    let total: f64 = difference.by_row.iter().sum();
    let n = difference.by_row.len();
    let mut best: Option<Condition> = None;
    for (name, values) in &difference.covariates {
        let mut order: Vec<usize> = (0..n).filter(|&row| values[row].is_finite()).collect();
        order.sort_by(|&a, &b| values[a].total_cmp(&values[b]).then(a.cmp(&b)));
        for part in order.chunks(order.len().div_ceil(BINS).max(FEWEST_ROWS)) {
            let (Some(&first), Some(&last)) = (part.first(), part.last()) else { continue };
            let sum: f64 = part.iter().map(|&row| difference.by_row[row]).sum();
            if part.len() < FEWEST_ROWS || n <= part.len() {
                continue;
            }
            let inside = sum / part.len() as f64;
            if best.as_ref().is_none_or(|best| best.inside < inside) {
                best = Some(Condition {
                    covariate: name.clone(),
                    from: values[first],
                    to: values[last],
                    inside,
                    outside: (total - sum) / (n - part.len()) as f64,
                });
            }
        }
    }
    best
}

/// A parameter is known weakly where its interval is longer than so many times its value.
const WEAK: f64 = 1.0;

/// For each tie, and each parameter that is known weakly, where the rivals differ most. `estimates`: by term.
pub fn measurements<S: Study>(
    study: &S,
    search: &Search<'_, S>,
    ladder: &Ladder,
    estimates: &[(usize, Vec<Estimate>)],
) -> Vec<NextMeasurement> {
    let candidates = study.candidates();
    let chosen = search.full_fit(&ladder.accepted, COMMON, None);
    let mut all = Vec::new();
    for (place, &term) in ladder.accepted.iter().enumerate() {
        let Some(test) = ladder.tests.iter().find(|test| test.term == term) else { continue };
        for &rival in test.ties.iter().filter(|tie| !ladder.accepted.contains(tie)) {
            let mut terms = ladder.accepted.clone();
            terms[place] = rival;
            let other = search.full_fit(&terms, COMMON, Some(&chosen));
            let (a, b) = (&candidates[term].name, &candidates[rival].name);
            let aim = format!("to distinguish {a} from {b}");
            all.extend(measurement(study, (&chosen, &other), [a, b], &aim));
        }
    }
    for (term, estimates) in estimates {
        let name = &candidates[*term].name;
        for Estimate { name: key, value, low, high, .. } in estimates {
            if high - low <= WEAK * value.abs() || !(high - low).is_finite() {
                continue;
            }
            let held_at = |end: f64| study.with_parameter_held(&chosen, *term, key, end);
            let (Some(least), Some(most)) = (held_at(*low), held_at(*high)) else { continue };
            let ends = [low, high].map(|end| format!("{key} = {end:.4}"));
            let aim = format!("to narrow the interval of {key} of {name}, {low:.4} to {high:.4}");
            all.extend(measurement(study, (&least, &most), [&ends[0], &ends[1]], &aim));
        }
    }
    all
}

/// Where two fits differ most; none where no condition stands out.
fn measurement<S: Study>(
    study: &S,
    (one, other): (&S::Fit, &S::Fit),
    between: [&str; 2],
    aim: &str,
) -> Option<NextMeasurement> {
    let difference = study.prediction_difference(one, other)?;
    // A share that is printed as 0.00 does not help to choose a condition.
    let at = greatest_difference(&difference).filter(|at| 0.005 <= at.inside)?;
    let sentence = sentence(aim, &at, difference.unit);
    Some(NextMeasurement {
        between: between.map(str::to_owned),
        covariate: at.covariate,
        from: at.from,
        to: at.to,
        difference: at.inside,
        elsewhere: at.outside,
        unit: difference.unit,
        sentence,
    })
}

/// Where to measure, and what for, in words.
fn sentence(aim: &str, at: &Condition, unit: &str) -> String {
    format!(
        "{aim}, measure at {} from {:.3} to {:.3}: there the predictions differ by {:.2} {unit}, elsewhere by {:.2} {unit}",
        at.covariate, at.from, at.to, at.inside, at.outside
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_tenth_with_the_greatest_difference_is_named() {
        let x: Vec<f64> = (0..1000).map(|row| f64::from(row * 7 % 1000)).collect();
        let by_row = x.iter().map(|x| if (300.0..400.0).contains(x) { 2.0 } else { 0.5 }).collect();
        let other = (0..1000).map(|row| f64::from(row % 13)).collect();
        let covariates = vec![("other".to_owned(), other), ("x".to_owned(), x)];
        let found =
            greatest_difference(&PredictionDifference { by_row, unit: "dB", covariates }).unwrap();
        assert_eq!((found.covariate.as_str(), found.from, found.to), ("x", 300.0, 399.0));
        assert_eq!((found.inside, found.outside), (2.0, 0.5));
    }
}
