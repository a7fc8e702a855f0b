//! The numbers of effects that these data cannot tell from accepted ones.

use crate::answer::parameter;
use crate::diagnosis::Rival;
use crate::ladder::{Ladder, Search};
use study::{COMMON, Estimate, Study, TermId};

/// Most rivals of an accepted effect whose numbers are stated: each takes a fit.
const MOST_RIVALS: usize = 3;

/// The numbers of effects that are tied with accepted ones, each fitted in place of it; none once a search is stopped.
pub(crate) fn rivals<S: Study>(study: &S, search: &Search<'_, S>, ladder: &Ladder) -> Vec<Rival> {
    let candidates = study.candidates();
    let is_rival = |term: &&TermId| {
        !ladder.accepted.contains(term) && candidates[**term].curve_over().is_none()
    };
    let chosen = search.full_fit(&ladder.accepted, COMMON, None);
    let of_term = |(place, &term): (usize, &TermId)| {
        let ties = ladder.test_of(term).map_or(&[][..], |test| &test.ties);
        let fitted = |&rival: &TermId| {
            let mut terms = ladder.accepted.clone();
            terms[place] = rival;
            let fit = search.full_fit(&terms, COMMON, Some(&chosen));
            let (known, unknown) = told(study.estimates(&fit, rival).0);
            Rival {
                in_place_of: candidates[term].name.clone(),
                effect: candidates[rival].name.clone(),
                parameters: known.iter().map(parameter).collect(),
                not_identifiable: unknown.into_iter().map(|estimate| estimate.name).collect(),
            }
        };
        ties.iter().filter(is_rival).take(MOST_RIVALS).map(fitted).collect::<Vec<_>>()
    };
    let is_stopped = search.is_stopped();
    let accepted = ladder.accepted.iter().enumerate().filter(|_| !is_stopped);
    accepted.flat_map(of_term).collect()
}

/// Estimates of which the data say something, and the others.
pub(crate) fn told(estimates: Vec<Estimate>) -> (Vec<Estimate>, Vec<Estimate>) {
    estimates.into_iter().partition(|estimate| estimate.is_identifiable)
}
