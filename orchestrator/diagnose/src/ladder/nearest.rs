//! The effect of the catalogue that comes nearest to a curve, which names no cause.

use super::Ladder;
use super::candidate_test::CandidateTest;
use super::search::{Search, with_term};
use proto::effect::Level;
use rayon::prelude::*;
use study::thresholds::{CATALOGUE_SHARE, FAMILY_ERROR, NEAREST_SHARE, STRUCTURE_BINS};
use study::{COMMON, Study, TermId};
use tracing::debug;

/// The effect that explains most of what a curve explains.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Nearest {
    /// The effect.
    pub term: TermId,
    /// Its gain, as a share of that of the curve.
    pub share: f64,
    /// Why it was not accepted in place of the curve.
    pub why_not: String,
}

impl<S: Study> Search<'_, S> {
    /// The effect that explains most of what a curve explains beside other terms, each in place of the curve. None: none explains as much as
    /// [`NEAREST_SHARE`] of it.
    pub(crate) fn nearest_effect(&self, curve: TermId, others: &[TermId]) -> Option<Nearest> {
        if self.is_stopped() {
            return None;
        }
        let candidates = self.study.candidates();
        let level = candidates[curve].level;
        let parent = self.full_fit(others, level, None);
        let with_curve = with_term(others, curve);
        let of_curve = self.full_fit(&with_curve, level, Some(&parent));
        let rise = self.study.log_likelihood(&of_curve) - self.study.log_likelihood(&parent);
        let gain_of_curve = self.gain(&with_curve, others, level).gain;
        let may_be = |term: &TermId| {
            !self.follows_any_curve(*term, candidates[curve].n_parameters)
                && candidates[*term].curve_over().is_none()
                && candidates[*term].is_tried_beside(others)
                && !others.contains(term)
        };
        let all: Vec<TermId> = candidates.ids().filter(may_be).collect();
        let share_of = |&term: &TermId| {
            let share = if candidates[term].level == Level::Random {
                // Judged on places left out, every model has levels of nodes.
                let levels = self.with_levels(term, others);
                let of_levels = self.gain(&levels, others, COMMON).gain;
                of_levels / self.gain(&with_curve, others, COMMON).gain
            } else {
                let with_effect = with_term(others, term);
                self.fit_if_promising(&with_effect, level, &parent, NEAREST_SHARE * rise)?;
                self.gain(&with_effect, others, level).gain / gain_of_curve
            };
            debug!(name = candidates[term].name, share, "nearest");
            (NEAREST_SHARE <= share).then_some((term, share))
        };
        let shares: Vec<(TermId, f64)> = all.par_iter().filter_map(share_of).collect();
        let (term, share) = shares.into_iter().max_by(|a, b| a.1.total_cmp(&b.1))?;
        Some(Nearest { term, share, why_not: self.why_not(term, Some(curve), others) })
    }

    /// The effect that gains most beside the terms of a selection, beside structure that was found in what it left and is worth `nats` per
    /// row.
    pub(crate) fn nearest_to_rest(&self, nats: f64, ladder: &Ladder) -> Option<Nearest> {
        let is_effect = |test: &&CandidateTest| {
            !self.is_curve(test)
                && !self.follows_any_curve(test.term, STRUCTURE_BINS)
                && !ladder.accepted.contains(&test.term)
        };
        let effects = ladder.tests.iter().filter(is_effect);
        let most = effects.max_by(|a, b| a.gain.gain.total_cmp(&b.gain.gain))?;
        let (term, share) = (most.term, most.gain.gain / nats);
        (NEAREST_SHARE <= share && !self.is_stopped()).then(|| Nearest {
            term,
            share,
            why_not: self.why_not(term, None, &ladder.accepted),
        })
    }

    /// Why an effect was not accepted, in place of a curve where one was.
    fn why_not(&self, term: TermId, curve: Option<TermId>, others: &[TermId]) -> String {
        if let Some(contradiction) = self.contradiction(term, others) {
            return contradiction;
        }
        let level = self.study.candidates()[term].level;
        let with_effect = with_term(others, term);
        let gain = self.term_gain(term, &with_effect, others, level);
        if FAMILY_ERROR / self.n_tried() as f64 <= gain.p_value {
            return format!(
                "its gain over {} may be chance (p = {:.1e} before the correction for all candidates)",
                self.study.blocks(level).unit,
                gain.p_value
            );
        }
        if !self.stands_clustered(term, others) {
            return "what it explains is no more than rows that follow each other may share"
                .to_owned();
        }
        let Some(curve) = curve else {
            return "it is not worth having by itself".to_owned();
        };
        let level = self.study.candidates()[curve].level;
        let over = self.gain(&with_term(others, curve), &with_effect, level);
        format!(
            "the structure explains {:.3} +- {:.3} nats per row more",
            over.gain, over.standard_error
        )
    }
}

impl Nearest {
    /// Whether it explains so much that the structure cannot be said to be of no known effect.
    pub(crate) fn may_be_cause(&self) -> bool {
        CATALOGUE_SHARE <= self.share
    }
}
