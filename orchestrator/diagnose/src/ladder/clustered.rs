//! What the slopes of a fit say of a term, of rows that depend on each other.

use super::{COMMON, CandidateTest, Search, with_term};
use crate::gain::{Gain, Scores};
use crate::score_test::{ScoreTest, ScoreTests};
use crate::{gate, limits};
use proto::effect::{CONSTANT, Level};
use std::ops::Range;
use study::thresholds::{
    EVIDENT_NATS, FAMILY_ERROR, FAR_HALF_INTERVALS, FEWEST_BLOCKS_WITHIN, UNCORRECTED_LEVEL,
    WORTH_NATS,
};
use study::{Study, TermId};
use tracing::debug;

impl<S: Study> Search<'_, S> {
    /// The gain of terms over `parent`, its p-value from the blocks of the span of time to which a term is limited: in all others there is
    /// no gain to vary.
    pub(super) fn gain_in_time(
        &self,
        terms: &[TermId],
        parent: &[TermId],
        limited: (TermId, Level),
    ) -> Gain {
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

    /// Whether what a term moves is beyond what rows that depend on each other may share: those of a node, and those that follow each
    /// other. A covariate that changes in time is no cause where the error drifts as slowly.
    pub(super) fn stands_clustered(&self, term: TermId, others: &[TermId]) -> bool {
        let candidate = &self.study.candidates()[term];
        let fit = self.full_fit(others, COMMON, None);
        if candidate.level == Level::Random {
            let agreement = self.study.agreement(&fit, term);
            debug!(name = candidate.name, ?agreement, "clustered");
            return agreement.is_none_or(|p_value| p_value < FAMILY_ERROR);
        }
        let Some(rows) = self.study.linearised(&fit) else { return true };
        let mut dependence = self.study.dependence();
        if candidate.level == Level::Place && dependence.nodes.is_none() {
            // Judged on places left out, which blocks of time are not.
            return true;
        }
        // What overlaps is together: an effect is not refused because of blocks that are as short as they can be.
        dependence.shortest_s *= 2.0;
        let varies_in_time = candidate.level == Level::Time;
        if varies_in_time && candidate.linear_in != Some(CONSTANT) {
            // Nodes see the same covariate at the same time: what is theirs does not follow it.
            dependence.nodes = None;
        }
        let tests = ScoreTests::new(&rows, &dependence);
        if candidate.curve_over().is_some() {
            let columns = self.study.columns_of_curve(&fit, term);
            let has_times = dependence.times_s.iter().all(|time_s| time_s.is_finite());
            if columns.is_empty() || !varies_in_time || !has_times {
                return true;
            }
            let p_value = tests.p_value_together(&columns);
            debug!(name = candidate.name, ?p_value, "clustered");
            return p_value.is_none_or(|p_value| p_value < UNCORRECTED_LEVEL);
        }
        let columns = self.study.columns(&fit, term);
        if columns.is_empty() {
            return true;
        }
        let (mut known, mut unknown_nats) = (Vec::<ScoreTest>::new(), 0.0);
        for column in &columns {
            match tests.test(column, &[]) {
                Some(test) => known.push(test),
                None => unknown_nats += tests.rise(column, &[]),
            }
        }
        // Of a push in some direction, the component that can be told may be the one that is not there.
        if known.iter().map(|test| test.rise).sum::<f64>() < unknown_nats {
            known.clear();
        }
        let least = known.iter().map(|test| test.p_value).fold(f64::INFINITY, f64::min);
        debug!(name = candidate.name, least, n = known.len(), "clustered");
        // Where nothing can be told, the gain on rows left out decides.
        known.is_empty() || least * (known.len() as f64) < UNCORRECTED_LEVEL
    }

    /// Of random levels that are evident from all rows at once, those that raise the likelihood most. Where nodes never come back to a place,
    /// rows left out tell little of levels of places; the likelihood, levels integrated out, tells all.
    pub(super) fn most_evident(
        &self,
        tests: &[CandidateTest],
        accepted: &[TermId],
        removed: &[TermId],
    ) -> Option<usize> {
        let least = EVIDENT_NATS.max(WORTH_NATS * self.all.len() as f64);
        let may_be = |test: &CandidateTest| {
            self.study.candidates()[test.term].level == Level::Random
                && !removed.contains(&test.term)
                && least < test.rise
                && 0.0 < test.gain.gain
        };
        let evident = (0..tests.len()).filter(|&index| may_be(&tests[index]));
        evident
            .max_by(|&a, &b| tests[a].rise.total_cmp(&tests[b].rise))
            .filter(|&index| self.stands_clustered(tests[index].term, accepted))
    }

    /// The share of the error that a term removes beside those accepted.
    pub(super) fn share_removed(&self, term: TermId, accepted: &[TermId]) -> f64 {
        let level = self.study.candidates()[term].level;
        let now = Scores::mean(&self.held_out_scores(&with_term(accepted, term), level));
        now.share_removed(&Scores::mean(&self.held_out_scores(accepted, level)))
    }

    /// Whether an effect that is limited to some rows, or moves all alike, is asked for by the slopes of the fit of others. Of few blocks, such
    /// as those of one robot, a mean of gains tells little.
    pub(super) fn is_asked_for(&self, term: TermId, others: &[TermId]) -> bool {
        let candidate = &self.study.candidates()[term];
        (candidate.only.is_some() || candidate.linear_in == Some(CONSTANT))
            && limits::p_value(self.study, &self.full_fit(others, COMMON, None), term)
                < FAMILY_ERROR
    }

    /// Whether a term is the level about which random effects vary, and is far from nothing beside them: it is not given up for them, which
    /// follow any level.
    pub(super) fn is_level_of_random(&self, term: TermId, others: &[TermId]) -> bool {
        let candidates = self.study.candidates();
        let is_random = |other: &TermId| candidates[*other].level == Level::Random;
        if candidates[term].linear_in != Some(CONSTANT) || !others.iter().any(is_random) {
            return false;
        }
        let fit = self.full_fit(&with_term(others, term), COMMON, None);
        let (estimates, _) = self.study.estimates(&fit, term);
        estimates.first().is_some_and(|level| {
            FAR_HALF_INTERVALS * (level.high - level.low) / 2.0 < level.value.abs()
        })
    }

    /// Whether all rows are off by a constant that is worth removing, beside these terms.
    pub(super) fn is_off(&self, terms: &[TermId]) -> bool {
        let gate = gate::gate(self.study, &self.full_fit(terms, COMMON, None));
        gate.misfits.iter().any(|misfit| misfit.of.is_none())
    }
}
