//! One stepwise selection of effects.

use super::{CandidateTest, Ladder, LadderStep, Search, with_term};
use crate::acceptance::{self, Verdict};
use crate::gain::Scores;
use crate::progress::SearchProgress;
use crate::stepwise::{self, Round, Stepwise};
use proto::effect::Level;
use std::convert::Infallible;
use study::thresholds::MOST_ACCEPTED;
use study::{Study, TermId};

/// What is selected.
#[derive(Clone)]
struct Selection {
    /// Terms in the order in which they were added.
    accepted: Vec<TermId>,
    /// For each of them the test that decided.
    decided: Vec<CandidateTest>,
    /// The model as configured, then with each term.
    rungs: Vec<LadderStep>,
    /// Terms that were removed once. They are not accepted again.
    removed: Vec<TermId>,
    /// All tests of the round that found nothing more.
    last: Vec<CandidateTest>,
}

/// The rounds of a selection.
struct Rounds<'s, 'a, S: Study> {
    search: &'s Search<'a, S>,
    /// Scores of the model as configured.
    configured: Scores,
}

impl<S: Study> Search<'_, S> {
    /// Stepwise selection. Each round tests all candidates, accepts one or exchanges it for accepted ones, and removes by backward
    /// elimination what it made superfluous. The selection ends when no candidate is acceptable.
    pub(crate) fn stepwise_selection(&self) -> Ladder {
        let rung = self.rung(&[]);
        let too_little = self.too_little();
        let mut rounds = Rounds { search: self, configured: rung.scores };
        let mut selection = Selection {
            accepted: Vec::new(),
            decided: Vec::new(),
            rungs: vec![rung],
            removed: Vec::new(),
            last: Vec::new(),
        };
        let mut n_rounds = 0;
        let mut stopped = None;
        if too_little.is_none() {
            let Ok(ended) = stepwise::select(&mut rounds, &mut selection);
            (n_rounds, stopped) = (ended.rounds, ended.stopped_in());
        }
        let Selection { accepted, mut decided, rungs, last, .. } = selection;
        if stopped.is_none() {
            (self.report)(SearchProgress::Ties);
            let before = decided.clone();
            self.drop_resolved_ties(&mut decided, &accepted);
            if self.is_stopped() {
                decided = before;
                stopped = Some(n_rounds.max(1));
            }
        }
        let mut tests = decided;
        let is_decided: Vec<TermId> = tests.iter().map(|test| test.term).collect();
        tests.extend(last.into_iter().filter(|test| !is_decided.contains(&test.term)));
        Ladder { accepted, rungs, tests, too_little, stopped }
    }
}

impl<S: Study> Stepwise for Rounds<'_, '_, S> {
    type Selection = Selection;
    type Error = Infallible;

    fn may_go_on(&self, selection: &Selection, _rounds: usize) -> bool {
        selection.accepted.len() < MOST_ACCEPTED
    }

    fn round(&mut self, selection: &mut Selection, round: usize) -> Result<Round, Infallible> {
        let search = self.search;
        (search.report)(SearchProgress::Round { round });
        for level in search.levels() {
            search.held_out_scores(&selection.accepted, level);
        }
        let mut tests = search.test_all(&selection.accepted, round);
        if search.is_stopped() {
            return Ok(Round::Stopped);
        }
        self.judge(&mut tests, selection);
        let found = self.next(&mut tests, selection);
        if search.is_stopped() {
            return Ok(Round::Stopped);
        }
        let Some((best, in_place_of)) = found else {
            selection.last = tests;
            return Ok(Round::Finished);
        };
        self.accept(tests, best, in_place_of, selection);
        Ok(if search.is_stopped() { Round::Stopped } else { Round::Changed })
    }
}

impl<S: Study> Rounds<'_, '_, S> {
    /// Applies the acceptance rule to the tests of a round.
    fn judge(&self, tests: &mut [CandidateTest], selection: &Selection) {
        let search = self.search;
        let Selection { accepted, rungs, removed, .. } = selection;
        let floor = acceptance::least_share(&self.configured, &rungs[rungs.len() - 1].scores);
        search.apply_acceptance_rule(tests, accepted, removed, floor);
        if !tests.iter().any(|test| test.verdict.is_acceptable()) {
            // Beside accepted effects, only levels of links, nodes and channels: what they explain comes in small parts from
            // all rows, of which blocks of time tell little.
            let is_random = |term: TermId| search.study.candidates()[term].level == Level::Random;
            let may_be = |test: &CandidateTest| accepted.is_empty() || is_random(test.term);
            for test in tests.iter_mut().filter(|test| test.verdict.is_plausible() && may_be(test))
            {
                let is_certain = acceptance::is_certain_by_total(
                    &test.gain,
                    search.n_tried(),
                    search.study.design_effect(),
                );
                if is_certain && search.stands_clustered(test.term, accepted) {
                    test.verdict = Verdict::Acceptable;
                }
            }
        }
        if !tests.iter().any(|test| test.verdict.is_acceptable())
            && let Some(index) = search.most_evident(tests, accepted, removed)
        {
            tests[index].verdict = Verdict::Acceptable;
        }
    }

    /// The test whose term comes next, and the accepted terms that it replaces.
    fn next(
        &self,
        tests: &mut [CandidateTest],
        selection: &Selection,
    ) -> Option<(usize, Vec<TermId>)> {
        let search = self.search;
        let Selection { accepted, decided, removed, .. } = selection;
        search
            .choose(tests, accepted, removed)
            .map(|best| (best, Vec::new()))
            .or_else(|| search.exchange_step(tests, accepted).map(|(old, new)| (new, vec![old])))
            .or_else(|| {
                let (olds, test) = search
                    .single_replacement(decided, accepted, removed)
                    .or_else(|| search.nonlinear_replacement(accepted, removed))?;
                let new = tests.iter().position(|other| other.term == test.term)?;
                tests[new] = test;
                Some((new, olds))
            })
    }

    /// Adds the term of a test, and removes what it replaces or makes superfluous.
    fn accept(
        &self,
        mut tests: Vec<CandidateTest>,
        best: usize,
        in_place_of: Vec<TermId>,
        selection: &mut Selection,
    ) {
        let search = self.search;
        let candidates = search.study.candidates();
        let Selection { accepted, decided, rungs, removed, .. } = selection;
        let name = |term: TermId| candidates[term].name.as_str();
        if in_place_of.is_empty() {
            (search.report)(SearchProgress::Accepted { name: name(tests[best].term) });
        } else {
            let old = in_place_of.iter().map(|&old| name(old)).collect();
            (search.report)(SearchProgress::Exchanged { new: name(tests[best].term), old });
            accepted.retain(|term| !in_place_of.contains(term));
            removed.extend(in_place_of);
        }
        let ties = search.ties(best, &tests, accepted);
        let test = CandidateTest { ties, ..tests.swap_remove(best).into_accepted() };
        *accepted = with_term(accepted, test.term);
        let fit = search.full_fit(accepted, candidates[test.term].level, None);
        search.prepare(accepted, &fit);
        decided.push(test);
        removed.extend(search.backward_elimination(accepted));
        for test in &mut *decided {
            let in_its_place = |&&term: &&TermId| {
                !accepted.contains(&test.term) && candidates[term].stands_in_for == Some(test.term)
            };
            test.term = accepted.iter().find(in_its_place).copied().unwrap_or(test.term);
        }
        decided.retain(|test| accepted.contains(&test.term));
        *rungs = search.rungs(accepted);
    }
}
