//! The search: which term makes the model predict data that it has not seen better; then which next; until none does.
//!
//! | module | what |
//! |---|---|
//! | `search` | the state of a search: fits of models and their scores on held-out rows, each computed once |
//! | `candidate_test` | what a candidate gains beside the terms of a model |
//! | `clustered` | whether that is more than what rows that depend on each other may share |
//! | `contradiction` | which candidates the measurements contradict |
//! | `verdicts` | which candidates are acceptable |
//! | `choice` | which acceptable candidate is added |
//! | `replacement` | changes of the model: what enters it in place of what, and what leaves it |
//! | `nearest` | the effect that comes nearest to a curve |
//! | `survival` | whether an effect stands where something else is missing |
//! | `ties` | which candidates these data cannot distinguish from the one that enters |
//! | `selection` | the rounds of a selection |
//! | `limits` | effects that are limited to some rows, as candidates of a further selection |

mod candidate_test;
mod choice;
mod clustered;
mod contradiction;
mod limits;
mod nearest;
mod node_levels;
mod replacement;
mod search;
mod selection;
mod survival;
mod ties;
mod verdicts;

use super::gain::Scores;
use super::progress::SearchProgress;
use crate::acceptance::Verdict;
use std::sync::Arc;
use study::thresholds::MOST_LIMITED_OF_A_KIND;
use study::{Study, TermId};

pub(crate) use candidate_test::CandidateTest;
pub(crate) use clustered::dependence_of;
pub(crate) use contradiction::Channel;
pub(crate) use limits::screened;
pub(crate) use nearest::Nearest;
pub(crate) use search::{Known, Search, without_term};

/// One model of the stepwise selection, with its held-out scores.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct LadderStep {
    /// Terms in the model, as numbers of candidates.
    pub terms: Vec<TermId>,
    /// Mean held-out scores on the common split.
    pub scores: Scores,
}

/// The result of a stepwise selection.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Ladder {
    /// Terms in the order in which they were added.
    pub accepted: Vec<TermId>,
    /// The model as configured, then with each term.
    pub rungs: Vec<LadderStep>,
    /// For each candidate the test that decided: of the round in which it was accepted, else of the last.
    pub tests: Vec<CandidateTest>,
    /// Why the measurements are too few for a search, if they are.
    pub too_little: Option<String>,
    /// The round in which the search was stopped, if so: what was accepted before stands, nothing more was looked for.
    pub stopped: Option<usize>,
}

impl Ladder {
    /// The test that decided on a candidate.
    pub(crate) fn test_of(&self, term: TermId) -> Option<&CandidateTest> {
        self.tests.iter().find(|test| test.term == term)
    }

    /// Candidates that were withheld in the last round.
    pub(crate) fn withheld(&self) -> impl Iterator<Item = TermId> + '_ {
        let withheld = self.tests.iter().filter(|test| test.verdict == Verdict::Withheld);
        withheld.map(|test| test.term)
    }

    /// Candidates that measurements contradicted in the last round.
    pub(crate) fn contradicted(&self) -> impl Iterator<Item = TermId> + '_ {
        let contradicted = self.tests.iter().filter(|test| test.verdict == Verdict::Contradicted);
        contradicted.map(|test| test.term)
    }

    /// Whether there was enough to tell something, and the search came to its end.
    #[must_use]
    pub(crate) fn is_complete(&self) -> bool {
        self.too_little.is_none() && self.stopped.is_none()
    }
}

/// Rounds in which limited effects are looked for.
const MOST_ROUNDS: usize = 4;

/// Selects effects step by step. Then adds the limited effects that the residuals suggest as candidates and selects again, until they
/// suggest none.
///
/// * `whole`: the study of all rows, where the search uses some of them only. It gets the same candidates.
///
/// Returns the selection, and what the search has computed.
pub(crate) fn select<S: Study>(
    study: &mut S,
    mut whole: Option<&mut S>,
    report: &(dyn Fn(SearchProgress<'_>) + Sync),
) -> (Ladder, Arc<Known<S::Fit>>) {
    let mut known = Arc::<Known<S::Fit>>::default();
    let mut round = 0;
    loop {
        let search = Search::new(study, report).with_known(known);
        let ladder = search.stepwise_selection();
        known = search.known();
        round += 1;
        if !ladder.is_complete() || MOST_ROUNDS <= round {
            return (ladder, known);
        }
        let found = limits::proposals(study, &search, &ladder.accepted);
        let n_before = study.candidates().len();
        let another =
            ladder.accepted.iter().filter_map(|&term| wanted_another(study, &ladder, term));
        for term in another.collect::<Vec<_>>() {
            if study.add_another(term).is_some()
                && let Some(whole) = &mut whole
            {
                let _ = whole.add_another(term);
            }
        }
        for proposal in found {
            let is_known = study.candidates().iter().any(|candidate| {
                candidate.only.as_ref() == Some(&proposal.only)
                    && candidate.effect() == study.candidates()[proposal.term].name
            });
            // What cannot be limited is not.
            if !is_known
                && study.add_limited(proposal.term, &proposal.only).is_ok()
                && let Some(whole) = &mut whole
            {
                let _ = whole.add_limited(proposal.term, &proposal.only);
            }
        }
        if study.candidates().len() == n_before {
            return (ladder, known);
        }
    }
}

/// The effect of which another is to be tried, where a term is such an effect and each of those there are is in the model already.
fn wanted_another<S: Study>(study: &S, ladder: &Ladder, term: TermId) -> Option<TermId> {
    let candidates = study.candidates();
    let first = candidates[term].another_of.unwrap_or(term);
    let all = candidates
        .ids()
        .filter(|&other| other == first || candidates[other].another_of == Some(first));
    let all: Vec<TermId> = all.collect();
    let is_last = all.last() == Some(&term) && all.len() < MOST_LIMITED_OF_A_KIND;
    (is_last && all.iter().all(|other| ladder.accepted.contains(other))).then_some(first)
}

#[cfg(test)]
pub(crate) mod tests;
