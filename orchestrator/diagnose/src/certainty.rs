//! What of all that was accepted is certain. A selection accepts what predicts rows left out better; a name is certain only if the data
//! also tell how large the effect is, show what is its own, and leave nothing else open that it may be part of.

use crate::gate::Gate;
use crate::ladder::{Ladder, Search, without_term};
use crate::pure_error::PureError;
use numbers::format::with_unit;
use proto::effect::Level;
use study::thresholds::{IDENTIFIED_HALF, LACK_OF_FIT_RATIO};
use study::{Estimate, Study, TermId};

/// What is seen of the model with all that was accepted.
pub(crate) struct Remains<'a> {
    /// Constants by which it is wrong.
    pub gate: &'a Gate,
    /// What it leaves beside what repeats differ by.
    pub pure: Option<PureError>,
    /// Whether there is structure that no effect explains.
    pub has_structure: bool,
}

impl Remains<'_> {
    /// Whether something else is missing.
    fn is_something(&self) -> bool {
        self.has_structure
            || !self.gate.misfits.is_empty()
            || self.pure.is_some_and(|pure| pure.is_alarming())
    }
}

/// Why each accepted effect is not certain; none: it is.
pub(crate) fn doubts<S: Study>(
    study: &S,
    search: &Search<'_, S>,
    ladder: &Ladder,
    known: &[(TermId, Vec<Estimate>)],
    remains: &Remains<'_>,
) -> Vec<(TermId, String)> {
    let candidates = study.candidates();
    let is_effect = |term: &&TermId| candidates[**term].curve_over().is_none();
    let effects = ladder.accepted.iter().filter(is_effect).enumerate();
    let worse = search.worse_headings(&ladder.accepted, &[]);
    let contradiction = |term: TermId| {
        let others = without_term(&ladder.accepted, term);
        search.contradiction(term, &others).or_else(|| worse.clone())
    };
    let doubt =
        |(place, &term): (usize, &TermId)| {
            let candidate = &candidates[term];
            let estimates = known.iter().find(|(other, _)| *other == term);
            let main = estimates.and_then(|(_, estimates)| estimates.first());
            let why = match main {
            Some(main) if candidate.level == Level::Random && !is_identified(main) => Some(format!(
                "{} is not identified, it may be {} to {}",
                main.name,
                number(main.low),
                with_unit(&number(main.high), &main.unit)
            )),
            _ if candidate.is_spread && !is_independent(remains.pure) => Some(
                "these data do not show that what it spreads is independent from frame to frame"
                    .to_owned(),
            ),
            _ if 0 < place && remains.is_something() => {
                Some("something else is missing, of which it may be a part".to_owned())
            }
            _ => contradiction(term),
        };
            why.map(|why| (term, why))
        };
    effects.filter_map(doubt).collect()
}

fn number(value: f64) -> String {
    format!("{value:.3}")
}

/// Whether the spread of a random effect is known to within a factor.
fn is_identified(spread: &Estimate) -> bool {
    spread.is_identifiable
        && 0.0 < spread.low
        && libm::log(spread.high / spread.low) / 2.0 <= IDENTIFIED_HALF
}

/// Whether rows that repeat each other differ by all that is left.
fn is_independent(pure: Option<PureError>) -> bool {
    pure.is_some_and(|pure| {
        let ratio = (pure.remaining / pure.pure) * (pure.remaining / pure.pure);
        ratio < LACK_OF_FIT_RATIO && !pure.is_alarming()
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_spread_is_identified_within_a_factor() {
        let of = |low, high| Estimate::new("sd_db", "dB", 1.7, (low, high));
        assert!(is_identified(&of(1.1, 2.6)));
        assert!(!is_identified(&of(0.045, 296.0)) && !is_identified(&of(0.0, 2.0)));
        assert!(!is_identified(&of(1.5, 2.0).not_identifiable()));
    }

    #[test]
    fn what_repeats_share_is_not_independent_from_frame_to_frame() {
        let of = |remaining, least_ratio| PureError { remaining, pure: 1.0, least_ratio };
        assert!(is_independent(Some(of(1.05, 1.0))));
        assert!(!is_independent(Some(of(1.5, 1.9))) && !is_independent(None));
    }
}
