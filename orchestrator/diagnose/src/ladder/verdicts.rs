//! Verdicts on the tests of a round.

use super::candidate_test::CandidateTest;
use super::search::{Search, with_term};
use super::selection::Selection;
use crate::acceptance::{self, Verdict};
use crate::gain::{Gain, Scores};
use proto::effect::Level;
use study::thresholds::{EVIDENT_NATS, WORTH_NATS};
use study::{COMMON, Study, TermId};
use tracing::debug;

impl<S: Study> Search<'_, S> {
    /// Decides on the tests of a round. A term that was removed once is not accepted again.
    pub(super) fn judge(&self, tests: &mut [CandidateTest], selection: &Selection) {
        let accepted = selection.accepted();
        self.apply_acceptance_rule(tests, &accepted, selection);
        let is_any_acceptable =
            |tests: &[CandidateTest]| tests.iter().any(|test| test.verdict.is_acceptable());
        if !is_any_acceptable(tests) {
            self.accept_by_total(tests, &accepted);
        }
        if !is_any_acceptable(tests)
            && let Some(test) = self.most_evident(tests, &accepted, &selection.removed)
        {
            test.verdict = Verdict::Acceptable;
        }
    }

    /// Judges tests by the acceptance rule. A term that was removed once is not accepted again.
    fn apply_acceptance_rule(
        &self,
        tests: &mut [CandidateTest],
        accepted: &[TermId],
        selection: &Selection,
    ) {
        let Selection { rungs, removed, .. } = selection;
        let floor = acceptance::least_share(&rungs[0].scores, &rungs[rungs.len() - 1].scores);
        let gains: Vec<Gain> = tests.iter().map(|test| test.gain).collect();
        let terms: Vec<TermId> = tests.iter().map(|test| test.term).collect();
        let share_removed = |index: usize| self.share_removed(terms[index], accepted);
        let verdicts = acceptance::judge(&gains, self.n_tried(), floor, share_removed);
        for (test, verdict) in tests.iter_mut().zip(verdicts) {
            let is_asked_for = || self.is_asked_for(test.term, accepted) && 0.0 < test.gain.gain;
            let is_beside_drift =
                || 0.0 < test.gain.gain && self.stands_beside_drift(test.term, accepted);
            let is_replicated = || 0.0 < test.gain.gain && self.is_replicated(test.term, accepted);
            let is_shown = || is_asked_for() || is_beside_drift() || is_replicated();
            let is_significant = verdict.is_significant() || is_shown();
            let is_worth = || {
                let share = || self.share_removed(test.term, accepted);
                is_shown() && acceptance::is_worth(test.gain.gain, floor, share)
            };
            let is_plausible =
                (verdict.is_plausible() || is_worth()) && !removed.contains(&test.term);
            test.verdict = Verdict::by_gain(is_significant, is_plausible);
            if test.verdict.is_plausible()
                && let Some(why) = self.contradiction(test.term, accepted)
            {
                debug!(name = self.study.candidates()[test.term].name, why, "contradicted");
                test.verdict = Verdict::Contradicted;
            }
            if test.verdict.is_acceptable()
                && !is_beside_drift()
                && !self.stands_clustered(test.term, accepted)
            {
                debug!(
                    name = self.study.candidates()[test.term].name,
                    "no more than what rows share"
                );
                test.verdict = Verdict::Withheld;
            }
        }
    }

    /// Where no test is significant by its blocks: candidates that are certain by their total gain. Beside accepted effects, only levels
    /// of links, nodes and channels: what they explain comes in small parts from all rows, of which blocks of time tell little.
    fn accept_by_total(&self, tests: &mut [CandidateTest], accepted: &[TermId]) {
        let is_random = |term: TermId| self.study.candidates()[term].level == Level::Random;
        let may_be = |test: &CandidateTest| {
            // Of a few replicates, rows tell nothing of how these differ.
            let level = self.study.candidates()[test.term].level;
            self.study.blocks(self.study.judging_level(level)).are_many()
                && (accepted.is_empty() || is_random(test.term))
        };
        for test in tests.iter_mut().filter(|test| test.verdict.is_plausible() && may_be(test)) {
            let design_effect = self.study.design_effect();
            if acceptance::is_certain_by_total(&test.gain, self.n_tried(), design_effect)
                && self.stands_clustered(test.term, accepted)
            {
                test.verdict = Verdict::Acceptable;
            }
        }
    }

    /// Of random levels that are evident from all rows at once, those that raise the likelihood most. Where nodes never come back to a place,
    /// rows left out tell little of levels of places; the likelihood, levels integrated out, tells all.
    fn most_evident<'t>(
        &self,
        tests: &'t mut [CandidateTest],
        accepted: &[TermId],
        removed: &[TermId],
    ) -> Option<&'t mut CandidateTest> {
        let least = EVIDENT_NATS.max(WORTH_NATS * self.all.len() as f64);
        let may_be = |test: &&mut CandidateTest| {
            self.study.candidates()[test.term].level == Level::Random
                && self.study.blocks(COMMON).are_many()
                && !removed.contains(&test.term)
                && least < test.rise
                && 0.0 < test.gain.gain
        };
        let evident = tests.iter_mut().filter(may_be);
        let most = evident.max_by(|a, b| a.rise.total_cmp(&b.rise));
        most.filter(|test| self.stands_clustered(test.term, accepted))
    }

    /// Number of candidates that p-values are corrected for.
    pub(crate) fn n_tried(&self) -> usize {
        self.study.candidates().iter().filter(|candidate| candidate.is_tried()).count()
    }

    /// The share of the error that a term removes beside those accepted.
    fn share_removed(&self, term: TermId, accepted: &[TermId]) -> f64 {
        let level = self.study.candidates()[term].level;
        let now = Scores::mean(&self.held_out_scores(&with_term(accepted, term), level));
        now.share_removed(&Scores::mean(&self.held_out_scores(accepted, level)))
    }
}
