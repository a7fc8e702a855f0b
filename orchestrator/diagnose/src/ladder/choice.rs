//! Choice among acceptable candidates, and the candidates that are statistically indistinguishable from the chosen one.

use super::{COMMON, CandidateTest, Search, with_term, without_term};
use crate::acceptance::Verdict;
use crate::gain::Gain;
use crate::progress::SearchProgress;
use proto::effect::{CONSTANT, Level};
use rayon::prelude::*;
use statrs::distribution::{ChiSquared, ContinuousCDF as _};
use std::collections::BTreeMap;
use study::thresholds::{
    FAMILY_ERROR, NESTED_LEVEL, PREFERRED_SHARE, RIVAL_SHARE, TIED_ERRORS, UNCORRECTED_LEVEL,
    WORTH_NATS,
};
use study::{Study, TermId};
use tracing::debug;

/// The index of the wanted test with the greatest gain on the common split; the first of equal ones.
fn greatest_gain(
    tests: &[CandidateTest],
    wanted: &dyn Fn(&CandidateTest) -> bool,
) -> Option<usize> {
    (0..tests.len())
        .filter(|&index| wanted(&tests[index]))
        .max_by(|&a, &b| tests[a].common.gain.total_cmp(&tests[b].common.gain).then(b.cmp(&a)))
}

impl<S: Study> Search<'_, S> {
    /// Whether a test's candidate is a spline over a covariate, which names no physical cause.
    fn is_curve(&self, test: &CandidateTest) -> bool {
        self.study.candidates()[test.term].curve_over().is_some()
    }

    /// The test to take, as an index: an acceptable one, or one that explains more than that. What was `removed` does not come
    /// back.
    pub(super) fn choose(
        &self,
        tests: &[CandidateTest],
        accepted: &[TermId],
        removed: &[TermId],
    ) -> Option<usize> {
        let candidates = self.study.candidates();
        let is_curve = |test: &CandidateTest| self.is_curve(test);
        let effect = greatest_gain(tests, &|test| test.verdict.is_acceptable() && !is_curve(test));
        // An acceptable effect already shows that something is missing. So a curve is compared with that effect if the curve is
        // significant by itself, even if it is not after the correction for all candidates.
        let best_curve = |wanted: &dyn Fn(&CandidateTest) -> bool| {
            greatest_gain(tests, &|test| {
                let may_compete =
                    test.verdict.is_acceptable() || effect.is_some() && test.verdict.is_plausible();
                is_curve(test) && wanted(test) && may_compete
            })
        };
        let mut curve = best_curve(&|_| true);
        // What was measured beside is a better name for a cause than time or place, if it explains as much.
        let given = best_curve(&|test| !candidates[test.term].is_derived);
        if let (Some(best), Some(given)) = (curve, given)
            && tests[given].is_as_certain_as(&tests[best])
        {
            let over = self.gain_between(&tests[best], &tests[given], accepted);
            if over.gain <= TIED_ERRORS * over.standard_error {
                curve = Some(given);
            }
        }
        while let Some(special) = curve.and_then(|best| self.special_case(best, tests, accepted)) {
            curve = Some(special);
        }
        curve = curve.map(|best| self.richer_curve(best, tests, accepted).unwrap_or(best));
        let Some(mut best) = effect else { return curve };
        let whole = best;
        while let Some(special) = self.special_case(best, tests, accepted) {
            best = special;
        }
        if let Some(law) = self.effect_instead_of_random(best, tests, accepted) {
            best = law;
        }
        // Random effects are about a mean that is right: what all rows are off by goes first. So it does where it does mostly what another
        // effect with more numbers does.
        let level = |test: &CandidateTest| {
            test.verdict.is_acceptable() && candidates[test.term].linear_in == Some(CONSTANT)
        };
        if let Some(level) = tests.iter().position(level)
            && (candidates[tests[best].term].level == Level::Random
                || PREFERRED_SHARE * tests[best].common.gain <= tests[level].common.gain)
            && self.is_off(accepted)
        {
            best = level;
        }
        // Of rivals that are statistically indistinguishable, the one with fewer parameters.
        let n_parameters = |index: usize| candidates[tests[index].term].n_parameters;
        for rival in 0..tests.len() {
            if rival != best
                && tests[rival].verdict.is_acceptable()
                && !is_curve(&tests[rival])
                && n_parameters(rival) < n_parameters(best)
                && self.is_tied(&tests[best], &tests[rival], accepted)
            {
                best = rival;
            }
        }
        // That something is missing is beyond doubt: what is beyond chance as the only candidate goes first if it explains more.
        let explains_more = |test: &CandidateTest| {
            if test.verdict.is_acceptable()
                || FAMILY_ERROR < test.gain.p_value
                || removed.contains(&test.term)
                || is_curve(test)
                || candidates[test.term].n_parameters > n_parameters(best)
            {
                return false;
            }
            let over = self.gain_between(test, &tests[best], accepted);
            over.standard_error < over.gain && self.stands_clustered(test.term, accepted)
        };
        best = greatest_gain(tests, &explains_more).unwrap_or(best);
        if let Some(curve) = curve {
            let level = self.common_level(&tests[curve], &tests[best]);
            let over = self.gain_between_at(&tests[curve], &tests[best], accepted, level);
            // A level of its own for every node or link follows any curve: there it need not be much better.
            let is_random = candidates[tests[best].term].level == Level::Random;
            let margin = if is_random && tests[curve].verdict.is_acceptable() {
                0.0
            } else {
                (2.0 * over.standard_error).max(WORTH_NATS / 10.0)
            };
            // If random effects per node or link explain more of the same error than the curve, the physical law is preferred to both.
            let own = self.study.judging_level(candidates[tests[curve].term].level);
            let is_beaten = whole != best
                && self.gain_between_at(&tests[curve], &tests[whole], accepted, own).gain <= 0.0;
            if margin < over.gain && !is_beaten {
                return Some(curve);
            }
        }
        Some(best)
    }

    /// A special case of the best candidate that is preferred to it. An acceptable one that is judged on unseen places is preferred;
    /// any other only if it gains as much. The data have shown that something is missing, so a special case that is significant
    /// without the correction is preferred if it gains more and is more than what dependent rows share.
    fn special_case(
        &self,
        best: usize,
        tests: &[CandidateTest],
        accepted: &[TermId],
    ) -> Option<usize> {
        let candidates = self.study.candidates();
        let general = &candidates[tests[best].term].generalises;
        let goes_before = |test: &CandidateTest| {
            let special = &candidates[test.term];
            if !test.verdict.is_plausible() || !general.contains(&special.name) {
                return false;
            }
            if test.verdict.is_acceptable() && special.level == Level::Place {
                return true;
            }
            let over = self.gain_between(&tests[best], test, accepted);
            let margin = if test.verdict.is_acceptable() { 2.0 * over.standard_error } else { 0.0 };
            over.gain <= margin
                && (test.verdict.is_acceptable() || self.stands_clustered(test.term, accepted))
        };
        greatest_gain(tests, &goes_before)
    }

    /// Where the best candidate is a random effect, which fits any pattern of known links and nodes, the physical effect to prefer.
    /// That is the one that predicts unseen places significantly better, random effects included in both models. If there is none,
    /// it is the one with the fewest parameters that gains at least [`PREFERRED_SHARE`] as much: random effects about a wrong mean explain
    /// the mean, too.
    fn effect_instead_of_random(
        &self,
        best: usize,
        tests: &[CandidateTest],
        accepted: &[TermId],
    ) -> Option<usize> {
        let candidates = self.study.candidates();
        if candidates[tests[best].term].level != Level::Random {
            return None;
        }
        let is_law = |test: &CandidateTest| {
            test.verdict.is_acceptable()
                && candidates[test.term].level != Level::Random
                && !self.is_curve(test)
        };
        let laws: Vec<usize> = (0..tests.len()).filter(|&index| is_law(&tests[index])).collect();
        let on_places = |index: usize| {
            let parent = self.full_fit(accepted, Level::Place, None);
            let terms = with_term(accepted, tests[index].term);
            self.full_fit(&terms, Level::Place, Some(&parent));
            self.gain(&terms, accepted, Level::Place)
        };
        let gains: Vec<(usize, Gain)> =
            laws.par_iter().map(|&index| (index, on_places(index))).collect();
        let beyond_links = gains
            .into_iter()
            .filter(|(_, gain)| gain.p_value < FAMILY_ERROR && WORTH_NATS <= gain.gain)
            .max_by(|a, b| a.1.gain.total_cmp(&b.1.gain));
        if let Some((index, _)) = beyond_links {
            return Some(index);
        }
        let enough = PREFERRED_SHARE * tests[best].common.gain;
        let n_parameters = |index: usize| candidates[tests[index].term].n_parameters;
        laws.into_iter().filter(|&index| enough <= tests[index].common.gain).min_by(|&a, &b| {
            let gains = [b, a].map(|index| tests[index].common.gain);
            n_parameters(a).cmp(&n_parameters(b)).then(gains[0].total_cmp(&gains[1]))
        })
    }

    /// Gain of one candidate over another on the common split.
    fn gain_between(&self, a: &CandidateTest, b: &CandidateTest, accepted: &[TermId]) -> Gain {
        self.gain_between_at(a, b, accepted, COMMON)
    }

    /// Gain of one candidate over another, both on top of `accepted`, over blocks of a level.
    fn gain_between_at(
        &self,
        a: &CandidateTest,
        b: &CandidateTest,
        accepted: &[TermId],
        level: Level,
    ) -> Gain {
        self.gain(&with_term(accepted, a.term), &with_term(accepted, b.term), level)
    }

    /// The level at which both candidates are judged; the common split if their levels differ.
    fn common_level(&self, a: &CandidateTest, b: &CandidateTest) -> Level {
        let [a, b] =
            [a, b].map(|test| self.study.judging_level(self.study.candidates()[test.term].level));
        if a == b { a } else { COMMON }
    }

    /// Whether two candidates are indistinguishable: their held-out scores agree within [`TIED_ERRORS`], and neither gains
    /// significantly on top of the other.
    fn is_tied(&self, a: &CandidateTest, b: &CandidateTest, accepted: &[TermId]) -> bool {
        let difference = self.gain_between(a, b, accepted);
        // What is not beyond chance by its own measure may well explain more where places and nodes are known.
        let apart =
            if b.verdict.is_significant() { difference.gain.abs() } else { difference.gain };
        if TIED_ERRORS * difference.standard_error < apart {
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

    /// Candidates that are indistinguishable from the chosen one: other curves if it is a curve, other effects if it is an effect.
    pub(super) fn ties(
        &self,
        best: usize,
        tests: &[CandidateTest],
        accepted: &[TermId],
    ) -> Vec<TermId> {
        let is_curve = self.is_curve(&tests[best]);
        // Of two of one effect, whichever is first is the first.
        let first = |term: TermId| self.study.candidates()[term].another_of.unwrap_or(term);
        let is_same_effect = |term: TermId| first(term) == first(tests[best].term);
        // That something is missing was shown: what gains nearly as much need not be beyond chance by itself to be a cause of it.
        let gains_as_much = |test: &CandidateTest| {
            test.gain.p_value < UNCORRECTED_LEVEL
                && PREFERRED_SHARE * tests[best].common.gain <= test.common.gain
                && self.study.candidates()[test.term].untestable.is_none()
        };
        let is_tied = |(index, test): &(usize, &CandidateTest)| {
            let is_likely = test.verdict.is_significant()
                || is_curve && test.is_as_certain_as(&tests[best])
                || !is_curve && gains_as_much(test);
            let is_rival = || !is_curve && self.is_rival(&tests[best], test, accepted);
            *index != best
                && !is_same_effect(test.term)
                && self.is_curve(test) == is_curve
                && (is_likely || is_rival())
                && !(is_curve && self.is_no_better_than_nested(test, tests, accepted))
                && self.is_tied(&tests[best], test, accepted)
        };
        tests.par_iter().enumerate().filter(is_tied).map(|(_, test)| test.term).collect()
    }

    /// Drops ties that the terms accepted later resolve: candidates that were indistinguishable from an accepted one when it was
    /// accepted, and no longer are.
    pub(super) fn drop_resolved_ties(&self, decided: &mut [CandidateTest], accepted: &[TermId]) {
        let Some(&last) = accepted.last() else { return };
        for test in decided.iter_mut().filter(|test| test.term != last) {
            let rest = without_term(accepted, test.term);
            let is_still_tied = |&rival: &TermId| {
                let mut again = self.test_candidate(&rest, rival);
                if again.gain.p_value < FAMILY_ERROR {
                    again.verdict = Verdict::Significant;
                }
                (again.verdict.is_significant() || self.is_rival(test, &again, &rest))
                    && self.is_tied(test, &again, &rest)
            };
            let ties: Vec<TermId> = test.ties.par_iter().copied().filter(is_still_tied).collect();
            test.ties = ties;
        }
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
    fn p_value_beyond_nested(
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

    /// P-value of the likelihood-ratio test of a fit against a nested one with `more` parameters fewer, by the chi-squared
    /// distribution. Rows count as independent.
    fn likelihood_ratio_p_value(&self, general: &S::Fit, within: &S::Fit, more: usize) -> f64 {
        let [high, low] = [general, within].map(|fit| self.study.log_likelihood(fit));
        let law = ChiSquared::new(more as f64);
        law.map_or(1.0, |law| law.sf(2.0 * (high - low).max(0.0)))
    }

    /// Of the curves in which the chosen one is nested, the one with the least p-value against it, if it is significant at
    /// [`UNCORRECTED_LEVEL`] after Bonferroni's correction for all of them.
    fn richer_curve(
        &self,
        chosen: usize,
        tests: &[CandidateTest],
        accepted: &[TermId],
    ) -> Option<usize> {
        let more: Vec<(usize, f64)> = (0..tests.len())
            .filter(|&index| {
                self.is_curve(&tests[index]) && tests[index].is_as_certain_as(&tests[chosen])
            })
            .filter_map(|index| {
                Some((index, self.p_value_beyond_nested(&tests[index], &tests[chosen], accepted)?))
            })
            .collect();
        let likely = UNCORRECTED_LEVEL / more.len() as f64;
        let best = more.into_iter().min_by(|a, b| a.1.total_cmp(&b.1));
        best.filter(|(_, p_value)| *p_value < likely).map(|(index, _)| index)
    }

    /// Exchange step: an accepted term, and the index of the test whose effect should replace it. The effect is plausible on top of
    /// all accepted terms, and predicts held-out rows better without the old term, or as well if it is a special case of that term;
    /// and it is more than what dependent rows share. Random effects do not replace the level about which they vary.
    pub(super) fn exchange_step(
        &self,
        tests: &[CandidateTest],
        accepted: &[TermId],
    ) -> Option<(TermId, usize)> {
        let candidates = self.study.candidates();
        for (index, test) in tests.iter().enumerate() {
            let new = &candidates[test.term];
            if !test.verdict.is_plausible() || self.is_curve(test) {
                continue;
            }
            for &old in accepted {
                let all = self.full_fit(&with_term(accepted, test.term), COMMON, None);
                let rest = without_term(accepted, old);
                let terms = with_term(&rest, test.term);
                self.prepare(&terms, &all);
                let over = self.gain(&terms, accepted, COMMON);
                let is_special = candidates[old].generalises.contains(&new.name);
                let margin = if is_special { 0.0 } else { 2.0 * over.standard_error };
                if margin < over.gain
                    && !self.is_level_of_random(old, &terms)
                    && self.stands_clustered(test.term, &rest)
                {
                    return Some((old, index));
                }
            }
        }
        None
    }

    /// An accepted effect, and the curve that should replace it because the dependence is not linear. The effect is nested in the
    /// curve, the curve predicts held-out rows better, and a likelihood-ratio test at [`NESTED_LEVEL`] rejects the effect with a
    /// constant offset.
    pub(super) fn nonlinear_replacement(
        &self,
        accepted: &[TermId],
        removed: &[TermId],
    ) -> Option<(Vec<TermId>, CandidateTest)> {
        let candidates = self.study.candidates();
        let is_new = |curve: &TermId| {
            candidates[*curve].is_tried()
                && candidates[*curve].curve_over().is_some()
                && !accepted.contains(curve)
                && !removed.contains(curve)
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
        Some((vec![old], self.test_candidate(&without_term(accepted, old), curve)))
    }

    /// Several accepted terms, and the one candidate that should replace them all. It was indistinguishable from each of them, and
    /// predicts held-out rows as well as they do together. The data have shown that something is missing, so a p-value below
    /// [`UNCORRECTED_LEVEL`] at its own level suffices.
    pub(super) fn single_replacement(
        &self,
        decided: &[CandidateTest],
        accepted: &[TermId],
        removed: &[TermId],
    ) -> Option<(Vec<TermId>, CandidateTest)> {
        let mut tied: BTreeMap<TermId, Vec<TermId>> = BTreeMap::new();
        for test in decided {
            for &rival in &test.ties {
                tied.entry(rival).or_default().push(test.term);
            }
        }
        let is_new = |term: &TermId| !accepted.contains(term) && !removed.contains(term);
        tied.retain(|rival, olds| 1 < olds.len() && is_new(rival));
        tied.into_iter().find_map(|(rival, olds)| {
            let rest: Vec<TermId> =
                accepted.iter().copied().filter(|term| !olds.contains(term)).collect();
            let all = self.full_fit(&with_term(accepted, rival), COMMON, None);
            self.prepare(&rest, &all);
            let test = self.test_candidate(&rest, rival);
            self.prepare(&with_term(&rest, rival), &all);
            let common = self.gain(&with_term(&rest, rival), &rest, COMMON);
            let over = self.gain(&with_term(&rest, rival), accepted, COMMON);
            let is_likely = test.gain.p_value < UNCORRECTED_LEVEL && common.p_value < FAMILY_ERROR;
            debug!(?rival, gain = over.gain, p = test.gain.p_value, "one for many");
            (is_likely && 0.0 <= over.gain)
                .then(|| (olds, CandidateTest { common, ..test }.accepted_on_common_split()))
        })
    }

    /// Backward elimination: removes accepted terms that no longer gain significantly. The last one was tested just now; it is weighed again
    /// only against the mean of a curve without one. Returns the removed terms.
    pub(super) fn backward_elimination(&self, accepted: &mut Vec<TermId>) -> Vec<TermId> {
        let candidates = self.study.candidates();
        let mut removed = Vec::new();
        let mut index = 0;
        while index < accepted.len() {
            let term = accepted[index];
            let lacks_mean = |&other: &TermId| other != term && self.stand_in_for(other) != other;
            if index + 1 == accepted.len() && !accepted.iter().any(lacks_mean) {
                break;
            }
            let level = candidates[term].level;
            let mut rest = without_term(accepted, term);
            if candidates[term].curve_over().is_none() {
                rest.iter_mut().for_each(|term| *term = self.stand_in_for(*term));
            }
            let all = self.full_fit(accepted, level, None);
            self.prepare(&rest, &all);
            let gain = self.term_gain(term, accepted, &rest, level);
            debug!(
                name = candidates[term].name,
                gain = gain.gain,
                p = gain.p_value,
                "weighed again"
            );
            let is_chance = || FAMILY_ERROR < gain.p_value && !self.is_asked_for(term, &rest);
            if !self.is_level_of_random(term, &rest)
                && (gain.gain < WORTH_NATS / 10.0 || is_chance())
            {
                (self.report)(SearchProgress::Removed { name: &candidates[term].name });
                *accepted = rest;
                removed.push(term);
            } else {
                index += 1;
            }
        }
        removed
    }
}
