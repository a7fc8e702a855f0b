//! The effect of the catalogue, or the two effects, that come nearest to a curve, which names no cause.

use super::Ladder;
use super::candidate_test::CandidateTest;
use super::search::{Search, with_term};
use proto::effect::Level;
use rayon::prelude::*;
use study::thresholds::{CATALOGUE_SHARE, FAMILY_ERROR, NEAREST_SHARE, STRUCTURE_BINS};
use study::{COMMON, Candidate, PerTerm, Study, TermId};
use tracing::debug;

/// The effect that explains most of what a curve explains, or two that do so together.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Nearest {
    /// The effect.
    pub term: TermId,
    /// A second effect: the two together may be the cause, the first alone may not.
    pub beside: Option<TermId>,
    /// Their gain, as a share of that of the curve.
    pub share: f64,
    /// Why the first was not accepted in place of the curve.
    pub why_not: String,
}

/// A curve, beside what it was accepted, and what it gains.
struct Curve<'a> {
    level: Level,
    others: &'a [TermId],
    with_curve: Vec<TermId>,
    /// By how much it raises the log likelihood (nats).
    rise: f64,
    /// Its gain in held-out log score.
    gain: f64,
}

impl<S: Study> Search<'_, S> {
    /// The effect that explains most of what a curve explains beside other terms, each in place of the curve; two, if only two together explain
    /// [`CATALOGUE_SHARE`] of it. None: none explains as much as [`NEAREST_SHARE`] of it.
    ///
    /// Two, because a curve over time takes up whatever was changed between recordings: another device, then its bearing.
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
        let gain = self.gain(&with_curve, others, level).gain;
        let curve_of = Curve { level, others, with_curve, rise, gain };
        let may_be = |term: &TermId| {
            !self.follows_any_curve(*term, candidates[curve].n_parameters)
                && candidates[*term].curve_over().is_none()
                && candidates[*term].is_tried_beside(others)
                && !others.contains(term)
        };
        let all: Vec<TermId> = candidates.ids().filter(may_be).collect();
        let most = |sets: Vec<Vec<TermId>>, least: f64| {
            let share = |set: Vec<TermId>| {
                let share = self.share_of_curve(&curve_of, &set, least)?;
                debug!(names = ?set.iter().map(|&term| &candidates[term].name).collect::<Vec<_>>(), share, "nearest");
                (least <= share).then_some((set, share))
            };
            let shares: Vec<(Vec<TermId>, f64)> = sets.into_par_iter().filter_map(share).collect();
            shares.into_iter().max_by(|a, b| a.1.total_cmp(&b.1))
        };
        let (one, share) = most(all.iter().map(|&term| vec![term]).collect(), NEAREST_SHARE)?;
        let term = one[0];
        let mut nearest =
            Nearest { term, beside: None, share, why_not: self.why_not(term, Some(curve), others) };
        if !nearest.may_be_cause() {
            let may_join =
                |other: &&TermId| **other != term && candidates[**other].is_tried_beside(&[term]);
            let pairs = all.iter().filter(may_join).map(|&other| vec![term, other]).collect();
            if let Some((pair, share)) = most(pairs, CATALOGUE_SHARE) {
                (nearest.beside, nearest.share) = (Some(pair[1]), share);
            }
        }
        Some(nearest)
    }

    /// What effects gain in place of a curve, as a share of its gain. None: the log likelihood rises by less than this share of what it
    /// rises by with the curve.
    fn share_of_curve(&self, curve: &Curve<'_>, effects: &[TermId], least: f64) -> Option<f64> {
        let Curve { level, others, ref with_curve, rise, gain: of_curve } = *curve;
        let is_random = |term: &TermId| self.study.candidates()[*term].level == Level::Random;
        if effects.iter().any(is_random) {
            // Judged on places left out, every model has levels of nodes.
            let mut with_effects = others.to_vec();
            for &term in effects {
                with_effects = if is_random(&term) {
                    self.with_levels(term, &with_effects)
                } else {
                    with_term(&with_effects, term)
                };
            }
            let gain = self.gain(&with_effects, others, COMMON).gain;
            return Some(gain / self.gain(with_curve, others, COMMON).gain);
        }
        let (&last, first) = effects.split_last()?;
        let rest = first.iter().fold(others.to_vec(), |all, &term| with_term(&all, term));
        let with_effects = with_term(&rest, last);
        // Whether the last is worth a fit is asked beside all others.
        let parent = self.full_fit(&rest, level, None);
        let without = self.full_fit(others, level, None);
        let of_first = self.study.log_likelihood(&parent) - self.study.log_likelihood(&without);
        self.fit_if_promising(&with_effects, level, &parent, least * rise - of_first)?;
        Some(self.gain(&with_effects, others, level).gain / of_curve)
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
            beside: None,
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
    /// The effect, or both.
    pub(crate) fn names(&self, candidates: &PerTerm<Candidate>) -> String {
        let mut names = candidates[self.term].name.clone();
        if let Some(beside) = self.beside {
            names.push_str(" with ");
            names.push_str(&candidates[beside].name);
        }
        names
    }

    /// Whether they explain so much that the structure cannot be said to be of no known effect.
    pub(crate) fn may_be_cause(&self) -> bool {
        CATALOGUE_SHARE <= self.share
    }
}
