//! Candidates that are statistically indistinguishable from a chosen one.

use super::candidate_test::CandidateTest;
use super::search::{Search, with_term, without_term};
use crate::acceptance::Verdict;
use crate::score_test::ScoreTests;
use proto::effect::Level;
use rayon::prelude::*;
use study::thresholds::{
    FAMILY_ERROR, RIVAL_SHARE, SAME_COLUMNS, TIED_NATS, UNCORRECTED_LEVEL, WORTH_NATS,
};
use study::{COMMON, Study, TermId};
use tracing::debug;

impl<S: Study> Search<'_, S> {
    /// Candidates that are indistinguishable from the chosen one: other curves if it is a curve, other effects if it is an effect.
    pub(super) fn ties(
        &self,
        best: &CandidateTest,
        tests: &[CandidateTest],
        accepted: &[TermId],
    ) -> Vec<TermId> {
        let is_curve = self.is_curve(best);
        // Of two of one effect, whichever is first is the first.
        let first = |term: TermId| self.study.candidates()[term].another_of.unwrap_or(term);
        let is_same_effect = |term: TermId| first(term) == first(best.term);
        // That something is missing was shown: what may be a cause of it need not be beyond chance by itself.
        let may_be_cause = |test: &CandidateTest| {
            test.gain.p_value < UNCORRECTED_LEVEL
                && self.study.candidates()[test.term].untestable.is_none()
        };
        let is_tied = |test: &&CandidateTest| {
            let is_likely = test.verdict.is_significant()
                || is_curve && test.is_as_certain_as(best)
                || !is_curve && may_be_cause(test);
            let is_rival = || !is_curve && self.is_rival(best, test, accepted);
            test.term != best.term
                && !is_same_effect(test.term)
                && self.is_curve(test) == is_curve
                && (is_likely || is_rival())
                && !(is_curve && self.is_no_better_than_nested(test, tests, accepted))
                && self.is_tied(best, test, accepted)
        };
        let mut ties: Vec<TermId> =
            tests.par_iter().filter(is_tied).map(|test| test.term).collect();
        let levels = (!is_curve).then(|| self.levels_of_nodes(best.term, accepted)).flatten();
        ties.extend(levels.filter(|levels| !ties.contains(levels)));
        ties
    }

    /// Drops ties that the terms accepted later resolve: candidates that were indistinguishable from an accepted one when it was
    /// accepted, and no longer are.
    pub(super) fn drop_resolved_ties(&self, decided: &mut [CandidateTest], accepted: &[TermId]) {
        let Some(&last) = accepted.last() else { return };
        for test in decided.iter_mut().filter(|test| test.term != last && !test.ties.is_empty()) {
            let rest = without_term(accepted, test.term);
            let levels = self.levels_of_nodes(test.term, accepted);
            let is_still_tied = |&rival: &TermId| {
                if levels == Some(rival) {
                    return true;
                }
                let again = self.tested_again(&rest, rival);
                (again.verdict.is_significant() || self.is_rival(test, &again, &rest))
                    && self.is_tied(test, &again, &rest)
            };
            let ties: Vec<TermId> = test.ties.par_iter().copied().filter(is_still_tied).collect();
            test.ties = ties;
        }
    }

    /// The test of a candidate when the search has ended, significant or not by its gain alone.
    fn tested_again(&self, accepted: &[TermId], term: TermId) -> CandidateTest {
        let test = self.test_candidate(accepted, term);
        if test.gain.p_value < FAMILY_ERROR {
            CandidateTest { verdict: Verdict::Significant, ..test }
        } else {
            test
        }
    }

    /// Adds ties of random levels that terms accepted later make: a level of each link explains what a law would explain as well, once
    /// another part of it is in the model.
    pub(super) fn add_late_ties(&self, decided: &mut [CandidateTest], accepted: &[TermId]) {
        let candidates = self.study.candidates();
        let Some(&last) = accepted.last() else { return };
        let is_random = |term: TermId| candidates[term].level == Level::Random;
        for test in decided.iter_mut().filter(|it| it.term != last && is_random(it.term)) {
            let rest = without_term(accepted, test.term);
            let is_law = |&rival: &TermId| {
                let candidate = &candidates[rival];
                candidate.curve_over().is_none()
                    && candidate.stands_in_for.is_none()
                    && !is_random(rival)
                    && !accepted.contains(&rival)
                    && !test.ties.contains(&rival)
            };
            let laws: Vec<TermId> = candidates.ids().filter(is_law).collect();
            let is_tied = |&rival: &TermId| {
                let instead = self.tested_again(&rest, rival);
                instead.verdict.is_significant() && self.is_tied(test, &instead, &rest)
            };
            let ties: Vec<TermId> = laws.into_par_iter().filter(is_tied).collect();
            test.ties.extend(ties);
        }
    }

    /// Whether two candidates are indistinguishable: their held-out scores agree within [`Gain::apart_errors`](crate::gain::Gain::apart_errors), and neither gains
    /// significantly on top of the other.
    pub(super) fn is_tied(
        &self,
        a: &CandidateTest,
        b: &CandidateTest,
        accepted: &[TermId],
    ) -> bool {
        let difference = self.gain_between(a, b, accepted);
        // What is not beyond chance by its own measure may well explain more where places and nodes are known.
        let apart =
            if b.verdict.is_significant() { difference.gain.abs() } else { difference.gain };
        let is_apart = difference.apart_errors() * difference.standard_error < apart
            && TIED_NATS < apart * difference.n_rows as f64;
        if is_apart && !self.moves_the_same(a.term, b.term, accepted) {
            return false;
        }
        let both = with_term(&with_term(accepted, a.term), b.term);
        let adds = |first: &CandidateTest, second: &CandidateTest| {
            let level = self.study.candidates()[second.term].level;
            let one = self.full_fit(&with_term(accepted, first.term), COMMON, None);
            self.full_fit(&with_term(accepted, first.term), level, Some(&one));
            self.full_fit(&both, level, Some(&one));
            let gain = self.term_gain(second.term, &both, &with_term(accepted, first.term), level);
            gain.p_value < FAMILY_ERROR && WORTH_NATS / 2.0 < gain.gain
        };
        !((b.verdict.is_significant() && adds(a, b)) || adds(b, a))
    }

    /// Whether two effects move means alike, beside all that a fit without them estimated.
    fn moves_the_same(&self, a: TermId, b: TermId, accepted: &[TermId]) -> bool {
        let fit = self.full_fit(accepted, COMMON, None);
        let Some(rows) = self.study.linearised(&fit) else { return false };
        let dependence = self.study.dependence();
        let tests = ScoreTests::new(&rows, &dependence);
        let [a, b] = [a, b].map(|term| self.study.columns(&fit, term));
        let pairs = a.iter().flat_map(|a| b.iter().map(move |b| (a, b)));
        pairs.filter_map(|(a, b)| tests.correlation(a, b)).any(|it| SAME_COLUMNS <= it.abs())
    }

    /// Whether a candidate that is not significant on held-out places or nodes raises the likelihood of all rows by at least
    /// [`RIVAL_SHARE`] as much as the chosen one.
    fn is_rival(&self, best: &CandidateTest, test: &CandidateTest, accepted: &[TermId]) -> bool {
        let candidate = &self.study.candidates()[test.term];
        if candidate.untestable.is_some()
            || !candidate.is_tried_beside(accepted)
            || accepted.contains(&test.term)
            || self.study.judging_level(candidate.level) == COMMON
        {
            return false;
        }
        let parent = self.full_fit(accepted, COMMON, None);
        let before = self.study.log_likelihood(&parent);
        let rise = |fit: &S::Fit| self.study.log_likelihood(fit) - before;
        let enough =
            RIVAL_SHARE * rise(&self.full_fit(&with_term(accepted, best.term), COMMON, None));
        let terms = with_term(accepted, test.term);
        let fit = self.fit_if_promising(&terms, COMMON, &parent, enough);
        debug!(name = candidate.name, rise = ?fit.as_ref().map(|fit| rise(fit)), enough, "rival");
        fit.map(|fit| rise(&fit)).is_some_and(|rise| {
            enough <= rise
                && !self.is_no_better_than_special_case(accepted, test.term, COMMON, rise)
        })
    }

    /// Whether a significant curve is nested in this one, and a likelihood-ratio test at [`UNCORRECTED_LEVEL`] does not reject the nested one.
    fn is_no_better_than_nested(
        &self,
        test: &CandidateTest,
        tests: &[CandidateTest],
        accepted: &[TermId],
    ) -> bool {
        let others =
            tests.iter().filter(|other| other.verdict.is_significant() && self.is_curve(other));
        others
            .filter_map(|other| self.p_value_beyond_nested(test, other, accepted))
            .any(|p_value| UNCORRECTED_LEVEL < p_value)
    }

    /// P-value of the likelihood-ratio test of a candidate against one that is nested in it, on top of `accepted`; `None` if
    /// `special` is not nested in it.
    pub(super) fn p_value_beyond_nested(
        &self,
        test: &CandidateTest,
        special: &CandidateTest,
        accepted: &[TermId],
    ) -> Option<f64> {
        let [general, within] = [test, special].map(|test| &self.study.candidates()[test.term]);
        if !general.generalises.contains(&within.name) {
            return None;
        }
        let more = general.n_parameters.saturating_sub(within.n_parameters);
        let [general, within] = [test, special]
            .map(|test| self.full_fit(&with_term(accepted, test.term), COMMON, None));
        Some(self.likelihood_ratio_p_value(&general, &within, more))
    }
}
