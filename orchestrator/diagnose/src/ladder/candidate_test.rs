//! Tests of candidates: what each gains beside the terms of a model.

use super::search::{Search, with_term};
use crate::acceptance::Verdict;
use crate::gain::Gain;
use crate::progress::SearchProgress;
use proto::effect::Level;
use rayon::prelude::*;
use std::ops::Range;
use std::sync::atomic::{AtomicUsize, Ordering};
use study::thresholds::{FAMILY_ERROR, FEWEST_BLOCKS_WITHIN, HOPELESS_NATS, SPECIAL_CASE_NATS};
use study::{COMMON, Study, TermId};
use tracing::debug;

/// The result of the last test of a candidate on top of the accepted terms.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct CandidateTest {
    /// The candidate.
    pub term: TermId,
    /// Gain in held-out log score, over blocks of the level at which its covariate varies.
    pub gain: Gain,
    /// The same over blocks of time, the split that all candidates share and are ordered by.
    pub common: Gain,
    /// By how much it raises the log likelihood of all rows (nats); 0 where it was not fitted.
    pub rise: f64,
    /// What was decided on it.
    pub verdict: Verdict,
    /// Candidates that these data cannot distinguish from it.
    pub ties: Vec<TermId>,
}

impl CandidateTest {
    /// Whether it may replace another: it is acceptable, or neither is and it is plausible.
    pub(super) fn is_as_certain_as(&self, other: &Self) -> bool {
        self.verdict.is_acceptable()
            || self.verdict.is_plausible() && !other.verdict.is_acceptable()
    }

    /// The test as reported once its candidate is accepted: with the gain on the common split where that decided.
    pub(super) fn into_accepted(self) -> Self {
        if self.verdict.is_acceptable() { self } else { self.accepted_on_common_split() }
    }

    /// The same test, judged by the gain on the common split.
    pub(super) fn accepted_on_common_split(self) -> Self {
        Self { gain: self.common, verdict: Verdict::Acceptable, ..self }
    }
}

impl<S: Study> Search<'_, S> {
    /// Tests every candidate on top of `accepted`, in parallel.
    pub(super) fn test_all(&self, accepted: &[TermId], round: usize) -> Vec<CandidateTest> {
        let candidates = self.study.candidates();
        let wanted: Vec<TermId> =
            candidates.ids().filter(|&term| candidates[term].stands_in_for.is_none()).collect();
        let n = wanted.len();
        let done = AtomicUsize::new(0);
        let try_one = |term| {
            let test = self.test_candidate(accepted, term);
            let done = done.fetch_add(1, Ordering::Relaxed) + 1;
            let name = candidates[term].name.as_str();
            (self.report)(SearchProgress::Tried { round, done, of: n, name });
            test
        };
        wanted.into_par_iter().map(try_one).collect()
    }

    /// Tests a candidate on top of `accepted`: screens it, fits it, and scores it on held-out rows. A candidate that is untestable,
    /// hopeless by its likelihood, or no better than a special case of it keeps a gain of 0.
    pub(super) fn test_candidate(&self, accepted: &[TermId], term: TermId) -> CandidateTest {
        let candidate = &self.study.candidates()[term];
        let hopeless = CandidateTest {
            term,
            gain: Gain::NONE,
            common: Gain::NONE,
            rise: 0.0,
            verdict: Verdict::Rejected,
            ties: Vec::new(),
        };
        let level = candidate.level;
        if self.is_stopped()
            || !candidate.is_tried_beside(accepted)
            || accepted.contains(&term)
            || !self.study.blocks(level).suffices()
        {
            return hopeless;
        }
        let parent = self.full_fit(accepted, level, None);
        let terms = with_term(accepted, term);
        let Some(fit) = self.fit_if_promising(&terms, level, &parent, HOPELESS_NATS / 2.0) else {
            debug!(name = candidate.name, "screened out");
            return hopeless;
        };
        let rise = self.study.log_likelihood(&fit) - self.study.log_likelihood(&parent);
        debug!(name = candidate.name, rise, "fitted");
        // What its numbers raise by chance they take away again on rows left out; those of a curve are held near 0.
        let by_chance = if candidate.curve_over().is_none() { candidate.n_parameters } else { 0 };
        if rise < HOPELESS_NATS + by_chance as f64
            || self.is_no_better_than_special_case(accepted, term, level, rise)
        {
            return hopeless;
        }
        let gain = self.term_gain(term, &terms, accepted, level);
        let common = if self.study.judging_level(level) == COMMON || FAMILY_ERROR < gain.p_value {
            gain
        } else {
            self.full_fit(&terms, COMMON, Some(&fit));
            self.term_gain(term, &terms, accepted, COMMON)
        };
        debug!(name = candidate.name, gain = gain.gain, p = gain.p_value, "scored");
        CandidateTest { gain, common, rise, ..hopeless }
    }

    /// Whether a special case of a candidate, a nested model, raises the likelihood nearly as much as the candidate, by `rise` (nats).
    pub(super) fn is_no_better_than_special_case(
        &self,
        accepted: &[TermId],
        term: TermId,
        level: Level,
        rise: f64,
    ) -> bool {
        let candidates = self.study.candidates();
        let general = &candidates[term];
        let parent = self.full_fit(accepted, level, None);
        let is_special = |&special: &TermId| {
            let candidate = &candidates[special];
            candidate.is_tried()
                && !accepted.contains(&special)
                && general.generalises.contains(&candidate.name)
        };
        candidates.ids().filter(is_special).any(|special| {
            let terms = with_term(accepted, special);
            // As it is tried by itself, perhaps at this moment: whoever comes first, the fit is the same.
            let fit = self.fit_if_promising(&terms, level, &parent, HOPELESS_NATS / 2.0);
            let is_as_good = fit.is_some_and(|fit| {
                let risen = self.study.log_likelihood(&fit) - self.study.log_likelihood(&parent);
                rise < risen + SPECIAL_CASE_NATS
            });
            // Random levels that exchanges refute do not stand in the way of those that contain them.
            let is_random = candidates[special].level == Level::Random;
            is_as_good && (!is_random || self.stands_clustered(special, accepted))
        })
    }

    /// The gain of one term. For a curve, which names no physical cause, the p-value is that of Student's t without the correction for
    /// skewness.
    pub(super) fn term_gain(
        &self,
        term: TermId,
        terms: &[TermId],
        parent: &[TermId],
        level: Level,
    ) -> Gain {
        let gain = self.gain_in_time(terms, parent, (term, level));
        let is_curve = self.study.candidates()[term].curve_over().is_some();
        if is_curve { gain.by_students_t() } else { gain }
    }

    /// The gain of terms over `parent`, its p-value from the blocks of the span of time to which a term is limited: in all others there is
    /// no gain to vary.
    fn gain_in_time(&self, terms: &[TermId], parent: &[TermId], limited: (TermId, Level)) -> Gain {
        let (term, level) = limited;
        let gain = self.gain(terms, parent, level);
        let span_s = self.study.candidates()[term].only.as_ref().map(study::span_s);
        let is_limited = |span_s: &Range<f64>| span_s.start.is_finite() || span_s.end.is_finite();
        let Some(span_s) = span_s.filter(is_limited) else { return gain };
        let mut scores = self.held_out_scores(terms, level).to_vec();
        for (score, time_s) in scores.iter_mut().zip(self.study.dependence().times_s) {
            if !span_s.contains(&time_s) {
                score.log = f64::NAN;
            }
        }
        let blocks = self.study.blocks(level);
        let before = self.held_out_scores(parent, level);
        let within = Gain::from_scores(&scores, &before, blocks.dependent());
        if within.n_blocks < FEWEST_BLOCKS_WITHIN {
            gain
        } else {
            Gain { p_value: within.p_value, ..gain }
        }
    }
}
