//! Changes of the model: one mechanism, and who may ask for it.
//!
//! A [`Replacement`] puts a candidate into the model in place of some terms, or of none. Choosers are asked in turn:
//!
//! | chooser | enters | leaves |
//! |---|---|---|
//! | `addition` | an acceptable candidate | nothing |
//! | `exchange` | an effect that explains more than a term, or is a special case of it | that term |
//! | `one_for_several` | a candidate that was indistinguishable from several terms | these |
//! | `curve_for_effect` | a curve, where the dependence is not linear | the effect that is nested in it |
//!
//! What it makes superfluous leaves by backward elimination. What has left does not come back.

use super::candidate_test::CandidateTest;
use super::search::{Search, with_term, without_term};
use super::selection::Selection;
use crate::progress::SearchProgress;
use proto::effect::CONSTANT;
use std::collections::BTreeMap;
use study::thresholds::{FAMILY_ERROR, NESTED_LEVEL, UNCORRECTED_LEVEL, WORTH_NATS};
use study::{COMMON, Study, TermId};
use tracing::debug;

/// A change of the model: a candidate enters it.
#[derive(Debug)]
pub(super) struct Replacement {
    /// The test of the candidate.
    pub(super) new: CandidateTest,
    /// The terms that it replaces; none: it is added.
    pub(super) old: Vec<TermId>,
}

/// A way to find what is to enter the model, from the tests of a round.
type Chooser<'a, S> = fn(&Search<'a, S>, &[CandidateTest], &Selection) -> Option<Replacement>;

impl<'a, S: Study> Search<'a, S> {
    /// What enters the model next: an acceptable candidate or, where there is none, what replaces terms of the model.
    pub(super) fn replacement(
        &self,
        tests: &[CandidateTest],
        selection: &Selection,
    ) -> Option<Replacement> {
        let choosers: [Chooser<'a, S>; 4] =
            [Self::addition, Self::exchange, Self::one_for_several, Self::curve_for_effect];
        choosers.into_iter().find_map(|choose| choose(self, tests, selection))
    }

    /// An acceptable candidate, which is added.
    fn addition(&self, tests: &[CandidateTest], selection: &Selection) -> Option<Replacement> {
        let new = self.choose(tests, &selection.accepted(), &selection.removed)?.clone();
        Some(Replacement { new, old: Vec::new() })
    }

    /// Exchange step: an effect in place of one term. The effect is plausible on top of all accepted terms, and predicts held-out rows
    /// better without the old term, or as well if it is a special case of that term; and it is more than what dependent rows share. Random
    /// effects do not replace the level about which they vary.
    fn exchange(&self, tests: &[CandidateTest], selection: &Selection) -> Option<Replacement> {
        let candidates = self.study.candidates();
        let accepted = selection.accepted();
        let effects = tests.iter().filter(|test| test.verdict.is_plausible());
        for test in effects.filter(|test| !self.is_curve(test)) {
            let new = &candidates[test.term];
            for &old in &accepted {
                let all = self.full_fit(&with_term(&accepted, test.term), COMMON, None);
                let rest = without_term(&accepted, old);
                let terms = with_term(&rest, test.term);
                self.prepare(&terms, &all);
                let over = self.gain(&terms, &accepted, COMMON);
                let is_special = candidates[old].generalises.contains(&new.name);
                let margin = if is_special { 0.0 } else { 2.0 * over.standard_error };
                if margin < over.gain
                    && !self.is_level_of_random(old, &terms)
                    && self.stands_clustered(test.term, &rest)
                    && self.contradiction(test.term, &rest).is_none()
                {
                    return Some(Replacement { new: test.clone(), old: vec![old] });
                }
            }
        }
        None
    }

    /// One candidate in place of several terms. It was indistinguishable from each of them, and predicts held-out rows as well as they do
    /// together. The data have shown that something is missing, so a p-value below [`UNCORRECTED_LEVEL`] at its own level suffices.
    fn one_for_several(
        &self,
        _tests: &[CandidateTest],
        selection: &Selection,
    ) -> Option<Replacement> {
        let accepted = selection.accepted();
        let mut tied: BTreeMap<TermId, Vec<TermId>> = BTreeMap::new();
        for test in &selection.decided {
            for &rival in &test.ties {
                tied.entry(rival).or_default().push(test.term);
            }
        }
        let is_new = |term: &TermId| !accepted.contains(term) && !selection.removed.contains(term);
        tied.retain(|rival, olds| 1 < olds.len() && is_new(rival));
        tied.into_iter().find_map(|(rival, old)| {
            let rest: Vec<TermId> =
                accepted.iter().copied().filter(|term| !old.contains(term)).collect();
            let all = self.full_fit(&with_term(&accepted, rival), COMMON, None);
            self.prepare(&rest, &all);
            let test = self.test_candidate(&rest, rival);
            self.prepare(&with_term(&rest, rival), &all);
            let common = self.gain(&with_term(&rest, rival), &rest, COMMON);
            let over = self.gain(&with_term(&rest, rival), &accepted, COMMON);
            let is_likely = test.gain.p_value < UNCORRECTED_LEVEL && common.p_value < FAMILY_ERROR;
            debug!(?rival, gain = over.gain, p = test.gain.p_value, "one for several");
            (is_likely && 0.0 <= over.gain && self.contradiction(rival, &rest).is_none()).then(
                || Replacement {
                    new: CandidateTest { common, ..test }.accepted_on_common_split(),
                    old,
                },
            )
        })
    }

    /// A curve in place of an effect, because the dependence is not linear. The effect is nested in the curve, the curve predicts held-out
    /// rows better, and a likelihood-ratio test at [`NESTED_LEVEL`] rejects the effect with a constant offset.
    fn curve_for_effect(
        &self,
        _tests: &[CandidateTest],
        selection: &Selection,
    ) -> Option<Replacement> {
        let candidates = self.study.candidates();
        let accepted = &selection.accepted()[..];
        let is_new = |curve: &TermId| {
            candidates[*curve].is_tried()
                && candidates[*curve].curve_over().is_some()
                && !accepted.contains(curve)
                && !selection.removed.contains(curve)
        };
        let level = candidates.find(|candidate| candidate.linear_in == Some(CONSTANT));
        let curves: Vec<TermId> = candidates.ids().filter(is_new).collect();
        let effects = accepted.iter().filter(|&&old| candidates[old].curve_over().is_none());
        let pairs = effects.flat_map(|&old| curves.iter().map(move |&curve| (old, curve)));
        let has_in_it = |&(old, curve): &(TermId, TermId)| {
            candidates[curve].generalises.contains(&candidates[old].name)
        };
        let beyond = pairs.filter(has_in_it).filter_map(|(old, curve)| {
            let all = self.full_fit(accepted, COMMON, None);
            let terms = with_term(&without_term(accepted, old), curve);
            self.prepare(&terms, &all);
            let mut within = accepted.to_vec();
            within.extend(level.filter(|level| !accepted.contains(level)));
            let [n_curve, n_old] = [curve, old].map(|term| candidates[term].n_parameters);
            let [general, within] =
                [&terms, &within].map(|terms| self.full_fit(terms, COMMON, Some(&all)));
            let p_value =
                self.likelihood_ratio_p_value(&general, &within, n_curve.saturating_sub(n_old + 1));
            let over = self.gain(&terms, accepted, COMMON);
            debug!(name = candidates[curve].name, p_value, gain = over.gain, "more than linear");
            (p_value < NESTED_LEVEL && 0.0 < over.gain).then_some((p_value, old, curve))
        });
        let (_, old, curve) = beyond.min_by(|a, b| a.0.total_cmp(&b.0))?;
        let new = self.test_candidate(&without_term(accepted, old), curve);
        Some(Replacement { new, old: vec![old] })
    }

    /// Backward elimination: removes accepted terms that no longer gain significantly. The last one was tested just now; it is weighed again
    /// only against the mean of a curve without one, which that curve then has.
    pub(super) fn backward_elimination(&self, selection: &mut Selection) {
        let candidates = self.study.candidates();
        let mut index = 0;
        while index < selection.decided.len() {
            let accepted = selection.accepted();
            let term = accepted[index];
            let lacks_mean = |&other: &TermId| other != term && self.stand_in_for(other) != other;
            if index + 1 == accepted.len() && !accepted.iter().any(lacks_mean) {
                break;
            }
            let level = candidates[term].level;
            let has_mean = candidates[term].curve_over().is_some();
            let stand_in = |term: TermId| if has_mean { term } else { self.stand_in_for(term) };
            let rest = without_term(&accepted, term).into_iter().map(stand_in);
            let rest: Vec<TermId> = rest.collect();
            let all = self.full_fit(&accepted, level, None);
            self.prepare(&rest, &all);
            let gain = self.term_gain(term, &accepted, &rest, level);
            debug!(
                name = candidates[term].name,
                gain = gain.gain,
                p = gain.p_value,
                "weighed again"
            );
            let is_beside_drift = || 0.0 < gain.gain && self.stands_beside_drift(term, &rest);
            let is_chance = || {
                FAMILY_ERROR < gain.p_value && !self.is_asked_for(term, &rest) && !is_beside_drift()
            };
            if !self.is_level_of_random(term, &rest)
                && (gain.gain < WORTH_NATS / 10.0 || is_chance())
            {
                (self.report)(SearchProgress::Removed { name: &candidates[term].name });
                selection.remove(&[term]);
                selection.decided.iter_mut().for_each(|test| test.term = stand_in(test.term));
            } else {
                index += 1;
            }
        }
    }

    /// For a curve without a constant part the candidate that has one; any other term itself.
    fn stand_in_for(&self, term: TermId) -> TermId {
        let all = self.study.candidates();
        all.find(|candidate| candidate.stands_in_for == Some(term)).unwrap_or(term)
    }
}
