//! One stepwise selection of effects.

use super::candidate_test::CandidateTest;
use super::replacement::Replacement;
use super::search::Search;
use super::{Ladder, LadderStep};
use crate::gain::Scores;
use crate::progress::SearchProgress;
use crate::stepwise::{self, Round, Stepwise};
use std::convert::Infallible;
use study::thresholds::{FEWEST_BLOCKS, MOST_ACCEPTED};
use study::{COMMON, Study, TermId};

/// What is selected.
#[derive(Clone)]
pub(super) struct Selection {
    /// The tests that decided on the terms of the model, in the order in which these were added.
    pub(super) decided: Vec<CandidateTest>,
    /// The model as configured, then with each term.
    pub(super) rungs: Vec<LadderStep>,
    /// Terms that left the model. They do not come back.
    pub(super) removed: Vec<TermId>,
    /// All tests of the round that found nothing more.
    last: Vec<CandidateTest>,
}

impl Selection {
    /// The terms of the model, in the order in which they were added.
    pub(super) fn accepted(&self) -> Vec<TermId> {
        self.decided.iter().map(|test| test.term).collect()
    }

    /// Removes terms from the model.
    pub(super) fn remove(&mut self, terms: &[TermId]) {
        self.decided.retain(|test| !terms.contains(&test.term));
        self.removed.extend(terms);
    }
}

impl<S: Study> Search<'_, S> {
    /// Stepwise selection. Each round tests all candidates, accepts one or exchanges it for accepted ones, and removes by backward
    /// elimination what it made superfluous. The selection ends when no candidate is acceptable.
    pub(crate) fn stepwise_selection(&self) -> Ladder {
        let too_little = self.too_little();
        let mut selection = Selection {
            decided: Vec::new(),
            rungs: self.rungs(&[]),
            removed: Vec::new(),
            last: Vec::new(),
        };
        let mut n_rounds = 0;
        let mut stopped = None;
        if too_little.is_none() {
            let Ok(ended) = stepwise::select(&mut Rounds(self), &mut selection);
            (n_rounds, stopped) = (ended.rounds, ended.stopped_in());
        }
        let accepted = selection.accepted();
        let Selection { mut decided, rungs, last, .. } = selection;
        if stopped.is_none() {
            (self.report)(SearchProgress::Ties);
            let before = decided.clone();
            self.drop_resolved_ties(&mut decided, &accepted);
            self.add_late_ties(&mut decided, &accepted);
            if self.is_stopped() {
                decided = before;
                stopped = Some(n_rounds.max(1));
            }
        }
        let mut tests = decided;
        tests.extend(last.into_iter().filter(|test| !accepted.contains(&test.term)));
        Ladder { accepted, rungs, tests, too_little, stopped }
    }

    fn too_little(&self) -> Option<String> {
        let blocks = self.study.blocks(COMMON);
        (!blocks.suffices()).then(|| {
            format!(
                "too few independent blocks: the data have {} {}, and at least {} are required",
                blocks.n_scored(),
                blocks.unit,
                FEWEST_BLOCKS
            )
        })
    }

    /// The model as configured, then with each term.
    fn rungs(&self, accepted: &[TermId]) -> Vec<LadderStep> {
        let all = self.full_fit(accepted, COMMON, None);
        let upto = |n: usize| {
            let terms = accepted[..n].to_vec();
            if 0 < n {
                self.prepare(&terms, &all);
            }
            let scores = Scores::mean(&self.held_out_scores(&terms, COMMON));
            LadderStep { terms, scores }
        };
        (0..=accepted.len()).map(upto).collect()
    }

    /// Puts a candidate into the model, and removes what it replaces or makes superfluous.
    fn replace(
        &self,
        Replacement { new, old }: Replacement,
        tests: &mut [CandidateTest],
        selection: &mut Selection,
    ) {
        let candidates = self.study.candidates();
        let name = |term: TermId| candidates[term].name.as_str();
        (self.report)(if old.is_empty() {
            SearchProgress::Accepted { name: name(new.term) }
        } else {
            let old = old.iter().map(|&old| name(old)).collect();
            SearchProgress::Exchanged { new: name(new.term), old }
        });
        selection.remove(&old);
        if let Some(test) = tests.iter_mut().find(|test| test.term == new.term) {
            test.clone_from(&new);
        }
        let ties = self.ties(&new, tests, &selection.accepted());
        let level = candidates[new.term].level;
        selection.decided.push(CandidateTest { ties, ..new.into_accepted() });
        let accepted = selection.accepted();
        let fit = self.full_fit(&accepted, level, None);
        self.prepare(&accepted, &fit);
        self.backward_elimination(selection);
        selection.rungs = self.rungs(&selection.accepted());
    }
}

/// The rounds of a selection.
struct Rounds<'s, 'a, S: Study>(&'s Search<'a, S>);

impl<S: Study> Stepwise for Rounds<'_, '_, S> {
    type Selection = Selection;
    type Error = Infallible;

    fn may_go_on(&self, selection: &Selection, _rounds: usize) -> bool {
        selection.decided.len() < MOST_ACCEPTED
    }

    fn round(&mut self, selection: &mut Selection, round: usize) -> Result<Round, Infallible> {
        let search = self.0;
        (search.report)(SearchProgress::Round { round });
        let accepted = selection.accepted();
        for level in search.levels() {
            search.held_out_scores(&accepted, level);
        }
        let mut tests = search.test_all(&accepted, round);
        if search.is_stopped() {
            return Ok(Round::Stopped);
        }
        search.judge(&mut tests, selection);
        let found = search.replacement(&tests, selection);
        if search.is_stopped() {
            return Ok(Round::Stopped);
        }
        let Some(replacement) = found else {
            selection.last = tests;
            return Ok(Round::Finished);
        };
        search.replace(replacement, &mut tests, selection);
        Ok(if search.is_stopped() { Round::Stopped } else { Round::Changed })
    }
}
