//! Choice among acceptable candidates.

use super::candidate_test::CandidateTest;
use super::search::{Search, with_term};
use crate::acceptance::Verdict;
use crate::gain::Gain;
use proto::effect::{CONSTANT, Level};
use rayon::prelude::*;
use study::thresholds::{
    FAMILY_ERROR, PREFERRED_SHARE, TIED_ERRORS, UNCORRECTED_LEVEL, WORTH_NATS,
};
use study::{COMMON, Study, TermId};
use tracing::debug;

/// The wanted test with the greatest gain on the common split; the first of equal ones.
fn greatest_gain<'t>(
    tests: &'t [CandidateTest],
    wanted: &dyn Fn(&CandidateTest) -> bool,
) -> Option<&'t CandidateTest> {
    // The last of equal ones from the end.
    let wanted = tests.iter().rev().filter(|test| wanted(test));
    wanted.max_by(|a, b| a.common.gain.total_cmp(&b.common.gain))
}

impl<S: Study> Search<'_, S> {
    /// Whether a test's candidate is a spline over a covariate, which names no physical cause.
    pub(super) fn is_curve(&self, test: &CandidateTest) -> bool {
        self.study.candidates()[test.term].curve_over().is_some()
    }

    /// The test to take: an acceptable one, or one that explains more than that. What was `removed` does not come back.
    pub(super) fn choose<'t>(
        &self,
        tests: &'t [CandidateTest],
        accepted: &[TermId],
        removed: &[TermId],
    ) -> Option<&'t CandidateTest> {
        let is_effect = |test: &CandidateTest| !self.is_curve(test);
        let effect = greatest_gain(tests, &|test| test.verdict.is_acceptable() && is_effect(test));
        let curve = self.choose_curve(tests, accepted, effect.is_some());
        let Some(greatest) = effect else { return curve };
        let effect = self.choose_effect(greatest, tests, accepted, removed);
        let curve = curve.filter(|curve| {
            self.explains_more(curve, (effect, greatest), accepted)
                && !self.is_of_few_nodes(curve, tests, accepted)
        });
        Some(curve.unwrap_or(effect))
    }

    /// The curve to take. An acceptable effect already shows that something is missing. So a curve is compared with that effect if the
    /// curve is significant by itself, even if it is not after the correction for all candidates.
    fn choose_curve<'t>(
        &self,
        tests: &'t [CandidateTest],
        accepted: &[TermId],
        is_effect_acceptable: bool,
    ) -> Option<&'t CandidateTest> {
        let candidates = self.study.candidates();
        let best_curve = |wanted: &dyn Fn(&CandidateTest) -> bool| {
            greatest_gain(tests, &|test| {
                let may_compete = test.verdict.is_acceptable()
                    || is_effect_acceptable && test.verdict.is_plausible();
                self.is_curve(test) && wanted(test) && may_compete
            })
        };
        let mut best = best_curve(&|_| true)?;
        // What was measured beside is a better name for a cause than time or place, if it explains as much.
        if let Some(given) = best_curve(&|test| !candidates[test.term].is_derived)
            && given.is_as_certain_as(best)
        {
            let over = self.gain_between(best, given, accepted);
            if over.gain <= TIED_ERRORS * over.standard_error {
                best = given;
            }
        }
        while let Some(special) = self.special_case(best, tests, accepted) {
            best = special;
        }
        Some(self.richer_curve(best, tests, accepted).unwrap_or(best))
    }

    /// The effect to take where one is acceptable. `best`: of these the one with the greatest gain.
    fn choose_effect<'t>(
        &self,
        mut best: &'t CandidateTest,
        tests: &'t [CandidateTest],
        accepted: &[TermId],
        removed: &[TermId],
    ) -> &'t CandidateTest {
        let candidates = self.study.candidates();
        while let Some(special) = self.special_case(best, tests, accepted) {
            best = special;
        }
        if let Some(law) = self.effect_instead_of_random(best, tests, accepted) {
            best = law;
        }
        // Random effects are about a mean that is right: what all rows are off by goes first. So it does where it does mostly what another
        // effect with more numbers does.
        let is_level = |test: &&CandidateTest| {
            test.verdict.is_acceptable() && candidates[test.term].linear_in == Some(CONSTANT)
        };
        if let Some(level) = tests.iter().find(is_level)
            && (candidates[best.term].level == Level::Random
                || PREFERRED_SHARE * best.common.gain <= level.common.gain)
            && self.is_off(accepted)
        {
            best = level;
        }
        // Of rivals that are statistically indistinguishable, the one with fewer parameters.
        let n_parameters = |test: &CandidateTest| candidates[test.term].n_parameters;
        for rival in tests {
            if rival.term != best.term
                && rival.verdict.is_acceptable()
                && !self.is_curve(rival)
                && n_parameters(rival) < n_parameters(best)
                && self.is_tied(best, rival, accepted)
            {
                best = rival;
            }
        }
        // That something is missing is beyond doubt: what is beyond chance as the only candidate goes first if it explains more.
        let explains_more = |test: &CandidateTest| {
            if matches!(test.verdict, Verdict::Acceptable | Verdict::Contradicted)
                || FAMILY_ERROR < test.gain.p_value
                || removed.contains(&test.term)
                || self.is_curve(test)
                || n_parameters(test) > n_parameters(best)
            {
                return false;
            }
            let over = self.gain_between(test, best, accepted);
            over.standard_error < over.gain && self.stands_clustered(test.term, accepted)
        };
        greatest_gain(tests, &explains_more).unwrap_or(best)
    }

    /// Whether a curve explains more than the chosen effect. `greatest`: the acceptable effect with the greatest gain.
    fn explains_more(
        &self,
        curve: &CandidateTest,
        (effect, greatest): (&CandidateTest, &CandidateTest),
        accepted: &[TermId],
    ) -> bool {
        let candidates = self.study.candidates();
        let level = self.common_level(curve, effect);
        let over = self.gain_between_at(curve, effect, accepted, level);
        // Where an effect follows any curve, this one need not be much better.
        let n_numbers = candidates[curve.term].n_parameters;
        let follows_any = self.follows_any_curve(effect.term, n_numbers);
        let margin = if follows_any && curve.verdict.is_acceptable() {
            0.0
        } else {
            (2.0 * over.standard_error).max(WORTH_NATS / 10.0)
        };
        // If random effects per node or link explain more of the same error than the curve, the physical law is preferred to both.
        let own = self.study.judging_level(candidates[curve.term].level);
        let is_beaten = greatest.term != effect.term
            && self.gain_between_at(curve, greatest, accepted, own).gain <= 0.0;
        margin < over.gain && !is_beaten
    }

    /// Whether a curve explains no more than a level of all rows and one for each of a few nodes, which are simpler.
    fn is_of_few_nodes(
        &self,
        curve: &CandidateTest,
        tests: &[CandidateTest],
        accepted: &[TermId],
    ) -> bool {
        let candidates = self.study.candidates();
        let is_simpler = |test: &&CandidateTest| {
            test.verdict.is_acceptable()
                && candidates[test.term].level == Level::Random
                && !self.follows_any_curve(test.term, candidates[curve.term].n_parameters)
        };
        tests.iter().filter(is_simpler).any(|levels| {
            let simpler = self.with_levels(levels.term, accepted);
            let over = self.gain(&with_term(accepted, curve.term), &simpler, COMMON);
            debug!(?over, "curve over levels of nodes");
            over.gain <= 2.0 * over.standard_error
        })
    }

    /// A special case of the best candidate that is preferred to it. An acceptable one that is judged on unseen places is preferred;
    /// any other only if it gains as much. The data have shown that something is missing, so a special case that is significant
    /// without the correction is preferred if it gains more and is more than what dependent rows share.
    fn special_case<'t>(
        &self,
        best: &CandidateTest,
        tests: &'t [CandidateTest],
        accepted: &[TermId],
    ) -> Option<&'t CandidateTest> {
        let candidates = self.study.candidates();
        let general = &candidates[best.term].generalises;
        let goes_before = |test: &CandidateTest| {
            let special = &candidates[test.term];
            if !test.verdict.is_plausible() || !general.contains(&special.name) {
                return false;
            }
            if test.verdict.is_acceptable() && special.level == Level::Place {
                return true;
            }
            let over = self.gain_between(best, test, accepted);
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
    fn effect_instead_of_random<'t>(
        &self,
        best: &CandidateTest,
        tests: &'t [CandidateTest],
        accepted: &[TermId],
    ) -> Option<&'t CandidateTest> {
        let candidates = self.study.candidates();
        if candidates[best.term].level != Level::Random {
            return None;
        }
        let is_law = |test: &CandidateTest| {
            test.verdict.is_acceptable()
                && candidates[test.term].level != Level::Random
                && !self.is_curve(test)
        };
        let laws: Vec<&CandidateTest> = tests.iter().filter(|test| is_law(test)).collect();
        let on_places = |law: &CandidateTest| {
            let parent = self.full_fit(accepted, Level::Place, None);
            let terms = with_term(accepted, law.term);
            self.full_fit(&terms, Level::Place, Some(&parent));
            self.gain(&terms, accepted, Level::Place)
        };
        let gains: Vec<(&CandidateTest, Gain)> =
            laws.par_iter().map(|&law| (law, on_places(law))).collect();
        let beyond_links = gains
            .into_iter()
            .filter(|(_, gain)| gain.p_value < FAMILY_ERROR && WORTH_NATS <= gain.gain)
            .max_by(|a, b| a.1.gain.total_cmp(&b.1.gain));
        if let Some((law, _)) = beyond_links {
            return Some(law);
        }
        let enough = PREFERRED_SHARE * best.common.gain;
        let n_parameters = |law: &CandidateTest| candidates[law.term].n_parameters;
        laws.into_iter().filter(|law| enough <= law.common.gain).min_by(|a, b| {
            let fewer = n_parameters(a).cmp(&n_parameters(b));
            fewer.then(b.common.gain.total_cmp(&a.common.gain))
        })
    }

    /// Of the curves in which the chosen one is nested, the one with the least p-value against it, if it is significant at
    /// [`UNCORRECTED_LEVEL`] after Bonferroni's correction for all of them.
    fn richer_curve<'t>(
        &self,
        chosen: &CandidateTest,
        tests: &'t [CandidateTest],
        accepted: &[TermId],
    ) -> Option<&'t CandidateTest> {
        let may_replace =
            |test: &&CandidateTest| self.is_curve(test) && test.is_as_certain_as(chosen);
        let richer = tests
            .iter()
            .filter(may_replace)
            .filter_map(|test| Some((test, self.p_value_beyond_nested(test, chosen, accepted)?)));
        let richer: Vec<(&CandidateTest, f64)> = richer.collect();
        let likely = UNCORRECTED_LEVEL / richer.len() as f64;
        let best = richer.into_iter().min_by(|a, b| a.1.total_cmp(&b.1));
        best.filter(|(_, p_value)| *p_value < likely).map(|(test, _)| test)
    }

    /// Gain of one candidate over another on the common split.
    pub(super) fn gain_between(
        &self,
        a: &CandidateTest,
        b: &CandidateTest,
        accepted: &[TermId],
    ) -> Gain {
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
}
