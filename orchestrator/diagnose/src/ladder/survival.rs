//! Whether an effect stands where something else is missing, of which it may be a part.

use super::Ladder;
use super::search::{Search, with_term, without_term};
use proto::effect::Level;
use rayon::prelude::*;
use study::thresholds::FAMILY_ERROR;
use study::{COMMON, Study, TermId};

impl<S: Study> Search<'_, S> {
    /// Whether an accepted term predicts rows left out better beside each of the best free curves, and beside all of them: those over some
    /// covariates, and of each channel the one that gains most beside all that was accepted. A curve takes what is only a part of
    /// something unknown. A random effect follows any structure, so that it does not survive structure over what no curve follows.
    pub(crate) fn survives_beside_curves(
        &self,
        term: TermId,
        ladder: &Ladder,
        covariates: &[&str],
    ) -> bool {
        let candidates = self.study.candidates();
        let has_curve =
            |over: &&str| candidates.ids().any(|id| candidates[id].curve_over() == Some(*over));
        if candidates[term].level == Level::Random && !covariates.iter().all(has_curve) {
            return false;
        }
        let others = without_term(&ladder.accepted, term);
        let curves = self.best_curves(ladder, covariates);
        curves.par_iter().all(|&curve| self.survives_beside(term, &with_term(&others, curve)))
            && (curves.len() < 2 || self.survives_beside(term, &[others, curves].concat()))
    }

    fn best_curves(&self, ladder: &Ladder, covariates: &[&str]) -> Vec<TermId> {
        let candidates = self.study.candidates();
        let is_free = |term: &TermId| {
            candidates[*term].curve_over().is_some()
                && candidates[*term].is_tried()
                && !ladder.accepted.contains(term)
        };
        let is_over = |term: &TermId| {
            candidates[*term].curve_over().is_some_and(|over| covariates.contains(&over))
        };
        let mut curves: Vec<TermId> = candidates.ids().filter(is_free).filter(is_over).collect();
        for is_of_losses in [false, true] {
            let of_channel = ladder.tests.iter().filter(|test| {
                is_free(&test.term)
                    && 0.0 < test.gain.gain
                    && candidates[test.term].is_of_losses() == is_of_losses
            });
            curves.extend(
                of_channel.max_by(|a, b| a.gain.gain.total_cmp(&b.gain.gain)).map(|it| it.term),
            );
        }
        curves.sort_unstable();
        curves.dedup();
        curves
    }

    fn survives_beside(&self, term: TermId, others: &[TermId]) -> bool {
        let terms = with_term(others, term);
        [self.study.candidates()[term].level, COMMON].into_iter().any(|level| {
            let gain = self.term_gain(term, &terms, others, level);
            0.0 < gain.gain && gain.p_value < FAMILY_ERROR
        })
    }
}
