//! Which of the changes that were found are certain. Each was accepted because it predicts held-out rows better; it is certain only if
//! recordings show it beyond what those of one condition differ by, its size is known and plausible, and nothing else is open that it may
//! be part of.

use super::contrast::Sides;
use super::search::{Found, FoundChange};
use crate::certainty::{
    BEGINNING, PART, at_bound, implausible, is_size_identified, of_unknown_shape, unidentified,
};
use crate::ladder::Search;
use study::thresholds::{FAMILY_ERROR, FEWEST_REPLICATES};
use study::{Candidate, Estimate, Study};

/// Why a change is not certain; none: it is, or it is tied and says so.
///
/// * `is_something`: whether B is off beyond A in what no change explains.
pub(super) fn doubt<S: Study>(
    study: &S,
    search: &Search<'_, S>,
    found: &Found<S::Fit>,
    (change, in_a, in_b): (&FoundChange, &[Estimate], &[Estimate]),
    (sides, is_something): (&Sides, bool),
) -> Option<String> {
    let candidate = &study.candidates()[change.in_b];
    implausible(candidate, in_b)
        .or_else(|| {
            if change.in_a.is_some() {
                unidentified_difference(candidate, in_a, in_b)
            } else {
                unidentified(candidate, in_b)
            }
        })
        .or_else(|| of_unknown_shape(candidate, in_b))
        .or_else(|| at_bound(candidate, in_b))
        .or_else(|| is_something.then(|| PART.to_owned()))
        .or_else(|| {
            let is_first = search.is_of_beginnings(change.in_b, &found.terms);
            is_first.then(|| BEGINNING.to_owned())
        })
        .or_else(|| {
            let names: Vec<&str> = sides.apart.iter().map(|it| it.covariate.as_str()).collect();
            (!names.is_empty())
                .then(|| format!("A and B have hardly a value in common of {}", names.join(", ")))
        })
        .or_else(|| of_recordings(change.recordings_p_value, sides.recordings.counts()))
}

/// Why recordings do not show a change. `p_value`: by recordings, times the number of tests; `counts`: of A and of B.
fn of_recordings(p_value: Option<f64>, counts: [usize; 2]) -> Option<String> {
    match p_value {
        Some(p_value) if p_value < FAMILY_ERROR => None,
        Some(p_value) => Some(format!(
            "recordings of one campaign differ by nearly as much (p = {:.2} by recordings)",
            p_value.min(1.0)
        )),
        None => Some(format!(
            "what differs from one recording to the next looks the same: a change is certain from {FEWEST_REPLICATES} recordings of \
             each campaign on, and there are {} of A and {} of B (column run)",
            counts[0], counts[1]
        )),
    }
}

/// Which difference of an effect that both campaigns have is not known to within half of it.
fn unidentified_difference(
    candidate: &Candidate,
    in_a: &[Estimate],
    in_b: &[Estimate],
) -> Option<String> {
    let of_b =
        in_b.iter().find(|it| candidate.parameter(it).is_some_and(|it| it.null.is_some()))?;
    let of_a = in_a.iter().find(|it| it.name == of_b.name)?;
    let difference = super::answer::difference_of(of_a, of_b);
    let is_identified = of_a.is_identifiable && is_size_identified(&difference, 0.0);
    (!is_identified).then(|| {
        format!(
            "the difference of {} is not identified, it may be {:.3} to {:.3} {}",
            of_b.name, difference.low, difference.high, difference.unit
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_recording_a_side_makes_nothing_certain() {
        let why = of_recordings(None, [1, 1]).unwrap();
        assert!(why.contains("4 recordings") && why.contains("1 of A and 1 of B"), "{why}");
    }

    #[test]
    fn a_change_must_exceed_what_recordings_differ_by() {
        assert_eq!(of_recordings(Some(1e-4), [5, 5]), None);
        let why = of_recordings(Some(0.2), [5, 5]).unwrap();
        assert!(why.contains("p = 0.20"), "{why}");
    }
}
