//! Which of the candidates that are acceptable is taken, and which cannot be told from it.

use super::{COMMON, NEARLY, Search, Trial, with, without};
use crate::acceptance::{FAMILY_ERROR, WORTH_NATS};
use crate::gain::Gain;
use proto::effect::{CONSTANT, Level};
use rayon::prelude::*;
use statrs::distribution::{ChiSquared, ContinuousCDF as _};
use std::collections::BTreeMap;
use study::Study;
use tracing::debug;

/// A law that explains this share of what levels per link or node do goes before them.
const MOSTLY: f64 = 0.85;
/// What gains so much by chance with at most this probability is likely: enough, where something else is beyond doubt.
const LIKELY: f64 = 0.05;

/// What a curve explains beyond an effect by chance with at most this probability, were all rows independent, the effect cannot.
const BEYOND_DOUBT: f64 = 1e-6;

/// The trial wanted that gains most on the common split; the first of equals.
fn greatest(trials: &[Trial], wanted: &dyn Fn(&Trial) -> bool) -> Option<usize> {
    (0..trials.len())
        .filter(|&index| wanted(&trials[index]))
        .max_by(|&a, &b| trials[a].common.gain.total_cmp(&trials[b].common.gain).then(b.cmp(&a)))
}

impl<S: Study> Search<'_, S> {
    /// Whether a trial's candidate is a free curve over something, which names no cause.
    fn is_curve(&self, trial: &Trial) -> bool {
        self.study.candidates()[trial.term].curve_over().is_some()
    }

    /// The trial to take, as an index: an acceptable one, or one that explains more than that. What was `removed` does not come
    /// back.
    pub(super) fn choose(
        &self,
        trials: &[Trial],
        accepted: &[usize],
        removed: &[usize],
    ) -> Option<usize> {
        let candidates = self.study.candidates();
        let is_curve = |trial: &Trial| self.is_curve(trial);
        let effect = greatest(trials, &|trial| trial.is_acceptable && !is_curve(trial));
        // That something is missing is beyond doubt where an effect is acceptable: a curve which is beyond chance by itself need not
        // be so with all candidates counted, to be held against that effect.
        let best_curve = |wanted: &dyn Fn(&Trial) -> bool| {
            greatest(trials, &|trial| {
                let may_compete = trial.is_acceptable || effect.is_some() && trial.is_plausible;
                is_curve(trial) && wanted(trial) && may_compete
            })
        };
        let mut curve = best_curve(&|_| true);
        // What was measured beside is a better name for a cause than time or place, if it explains as much.
        let given = best_curve(&|trial| !candidates[trial.term].is_derived);
        if let (Some(best), Some(given)) = (curve, given)
            && trials[given].is_as_certain_as(&trials[best])
        {
            let over = self.between(&trials[best], &trials[given], accepted);
            if over.gain <= 2.0 * over.standard_error {
                curve = Some(given);
            }
        }
        while let Some(special) = curve.and_then(|best| self.special_case(best, trials, accepted)) {
            curve = Some(special);
        }
        curve = curve.map(|best| self.with_more(best, trials, accepted).unwrap_or(best));
        let Some(mut best) = effect else { return curve };
        let whole = best;
        while let Some(special) = self.special_case(best, trials, accepted) {
            best = special;
        }
        if let Some(law) = self.law_under(best, trials, accepted) {
            best = law;
        }
        // Of rivals that cannot be told apart, the one with fewer parameters.
        let n_parameters = |index: usize| candidates[trials[index].term].n_parameters;
        for rival in 0..trials.len() {
            if rival != best
                && trials[rival].is_acceptable
                && !is_curve(&trials[rival])
                && n_parameters(rival) < n_parameters(best)
                && self.is_tied(&trials[best], &trials[rival], accepted)
            {
                best = rival;
            }
        }
        // That something is missing is beyond doubt: what is beyond chance as the only candidate goes first if it explains more.
        let explains_more = |trial: &Trial| {
            if trial.is_acceptable
                || FAMILY_ERROR < trial.gain.p_value
                || removed.contains(&trial.term)
                || is_curve(trial)
                || candidates[trial.term].n_parameters > n_parameters(best)
            {
                return false;
            }
            let over = self.between(trial, &trials[best], accepted);
            over.standard_error < over.gain
        };
        best = greatest(trials, &explains_more).unwrap_or(best);
        if let Some(curve) = curve {
            let level = self.common_to(&trials[curve], &trials[best]);
            let over = self.between_at(&trials[curve], &trials[best], accepted, level);
            // A level of its own for every node or link follows any curve: there it need not be much better.
            let is_random = candidates[trials[best].term].level == Level::Random;
            let margin = if is_random && trials[curve].is_acceptable {
                0.0
            } else {
                (2.0 * over.standard_error).max(WORTH_NATS / 10.0)
            };
            // Levels of nodes and links that explain more of the same than the curve leave it to the law that goes before them.
            let own = self.study.judged(candidates[trials[curve].term].level);
            let is_beaten = whole != best
                && self.between_at(&trials[curve], &trials[whole], accepted, own).gain <= 0.0;
            if margin < over.gain && !is_beaten {
                return Some(curve);
            }
        }
        Some(best)
    }

    /// A special case of the best that goes before it. One that predicts unknown places, with everything random carried along,
    /// does; any other only if it explains as much. That something is missing is beyond doubt, so that one which is
    /// beyond chance by itself need not be so with all candidates counted, if it explains more.
    fn special_case(&self, best: usize, trials: &[Trial], accepted: &[usize]) -> Option<usize> {
        let candidates = self.study.candidates();
        let general = &candidates[trials[best].term].generalises;
        let goes_before = |trial: &Trial| {
            let special = &candidates[trial.term];
            if !trial.is_plausible || !general.contains(&special.name) {
                return false;
            }
            if trial.is_acceptable && special.level == Level::Place {
                return true;
            }
            let over = self.between(&trials[best], trial, accepted);
            let margin = if trial.is_acceptable { 2.0 * over.standard_error } else { 0.0 };
            over.gain <= margin
        };
        greatest(trials, &goes_before)
    }

    /// Where the best is random, which fits any pattern of known links and nodes: the law that predicts unknown ones best, beyond
    /// chance with everything random carried along; else the simplest that explains nearly as much, for levels about a mean that
    /// is wrong explain the mean, too.
    fn law_under(&self, best: usize, trials: &[Trial], accepted: &[usize]) -> Option<usize> {
        let candidates = self.study.candidates();
        if candidates[trials[best].term].level != Level::Random {
            return None;
        }
        let is_law = |trial: &Trial| {
            trial.is_acceptable
                && candidates[trial.term].level != Level::Random
                && !self.is_curve(trial)
        };
        let laws: Vec<usize> = (0..trials.len()).filter(|&index| is_law(&trials[index])).collect();
        let on_places = |index: usize| {
            let parent = self.full(accepted, Level::Place, None);
            let terms = with(accepted, trials[index].term);
            self.full(&terms, Level::Place, Some(&parent));
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
        let enough = MOSTLY * trials[best].common.gain;
        let n_parameters = |index: usize| candidates[trials[index].term].n_parameters;
        laws.into_iter().filter(|&index| enough <= trials[index].common.gain).min_by(|&a, &b| {
            let gains = [b, a].map(|index| trials[index].common.gain);
            n_parameters(a).cmp(&n_parameters(b)).then(gains[0].total_cmp(&gains[1]))
        })
    }

    /// What one candidate gains over another on the common split.
    fn between(&self, a: &Trial, b: &Trial, accepted: &[usize]) -> Gain {
        self.between_at(a, b, accepted, COMMON)
    }

    /// What one candidate gains over another.
    fn between_at(&self, a: &Trial, b: &Trial, accepted: &[usize], level: Level) -> Gain {
        self.gain(&with(accepted, a.term), &with(accepted, b.term), level)
    }

    /// The level at which both are judged; the common split, if they differ.
    fn common_to(&self, a: &Trial, b: &Trial) -> Level {
        let [a, b] =
            [a, b].map(|trial| self.study.judged(self.study.candidates()[trial.term].level));
        if a == b { a } else { COMMON }
    }

    /// Whether two candidates predict alike, and neither adds anything to the other.
    fn is_tied(&self, a: &Trial, b: &Trial, accepted: &[usize]) -> bool {
        let difference = self.between(a, b, accepted);
        // What is not beyond chance by its own measure may well explain more where places and nodes are known.
        let apart = if b.is_significant { difference.gain.abs() } else { difference.gain };
        if 2.0 * difference.standard_error < apart {
            return false;
        }
        let both = with(&with(accepted, a.term), b.term);
        let adds = |first: &Trial, second: &Trial| {
            let level = self.study.candidates()[second.term].level;
            let one = self.full(&with(accepted, first.term), COMMON, None);
            self.full(&with(accepted, first.term), level, Some(&one));
            self.full(&both, level, Some(&one));
            let gain = self.gain_of(second.term, &both, &with(accepted, first.term), level);
            gain.p_value < FAMILY_ERROR && WORTH_NATS / 2.0 < gain.gain
        };
        !((b.is_significant && adds(a, b)) || adds(b, a))
    }

    /// Whether a candidate that is not beyond chance by its own measure, places and nodes left out, explains the rows nearly as
    /// well as the chosen one where these are known.
    fn rivals(&self, best: &Trial, trial: &Trial, accepted: &[usize]) -> bool {
        let candidate = &self.study.candidates()[trial.term];
        if candidate.untestable.is_some()
            || accepted.contains(&trial.term)
            || self.study.judged(candidate.level) == COMMON
        {
            return false;
        }
        let parent = self.full(accepted, COMMON, None);
        let before = self.study.log_likelihood(&parent);
        let rise = |fit: &S::Fit| self.study.log_likelihood(fit) - before;
        let enough = NEARLY * rise(&self.full(&with(accepted, best.term), COMMON, None));
        let terms = with(accepted, trial.term);
        let fit = self.promising(&terms, COMMON, &parent, enough);
        debug!(name = candidate.name, rise = ?fit.as_ref().map(|fit| rise(fit)), enough, "rival");
        fit.map(|fit| rise(&fit)).is_some_and(|rise| {
            enough <= rise && !self.is_but_a_special_case(accepted, trial.term, COMMON, rise)
        })
    }

    /// Candidates that cannot be told from the chosen one: other curves from a curve, which no effect explains as well, and from
    /// an effect other effects.
    pub(super) fn ties(&self, best: usize, trials: &[Trial], accepted: &[usize]) -> Vec<usize> {
        let is_curve = self.is_curve(&trials[best]);
        let is_tied = |(index, trial): &(usize, &Trial)| {
            let is_likely =
                trial.is_significant || is_curve && trial.is_as_certain_as(&trials[best]);
            let is_rival = || !is_curve && self.rivals(&trials[best], trial, accepted);
            *index != best
                && self.is_curve(trial) == is_curve
                && (is_likely || is_rival())
                && !(is_curve && self.says_nothing_more(trial, trials, accepted))
                && self.is_tied(&trials[best], trial, accepted)
        };
        trials.par_iter().enumerate().filter(is_tied).map(|(_, trial)| trial.term).collect()
    }

    /// Strikes out candidates that could not be told from an accepted one when it was taken, and can with all that came after it.
    pub(super) fn part(&self, decided: &mut [Trial], accepted: &[usize]) {
        let Some(&last) = accepted.last() else { return };
        for trial in decided.iter_mut().filter(|trial| trial.term != last) {
            let rest = without(accepted, trial.term);
            let is_still_tied = |&rival: &usize| {
                let mut again = self.attempt(&rest, rival);
                again.is_significant = again.gain.p_value < FAMILY_ERROR;
                (again.is_significant || self.rivals(trial, &again, &rest))
                    && self.is_tied(trial, &again, &rest)
            };
            let ties: Vec<usize> = trial.ties.par_iter().copied().filter(is_still_tied).collect();
            trial.ties = ties;
        }
    }

    /// Whether a curve has another in it that is beyond chance, and what it has beyond that is not even likely, were all rows
    /// independent.
    fn says_nothing_more(&self, trial: &Trial, trials: &[Trial], accepted: &[usize]) -> bool {
        let others = trials.iter().filter(|other| other.is_significant && self.is_curve(other));
        others
            .filter_map(|other| self.beyond(trial, other, accepted))
            .any(|p_value| LIKELY < p_value)
    }

    /// The probability by chance of what a curve explains beyond another that it has in it, were all rows independent; none where
    /// it has not.
    fn beyond(&self, trial: &Trial, special: &Trial, accepted: &[usize]) -> Option<f64> {
        let [general, within] = [trial, special].map(|trial| &self.study.candidates()[trial.term]);
        if !general.generalises.contains(&within.name) {
            return None;
        }
        let more = general.n_parameters.saturating_sub(within.n_parameters);
        let [general, within] =
            [trial, special].map(|trial| self.full(&with(accepted, trial.term), COMMON, None));
        Some(self.by_chance(&general, &within, more))
    }

    /// The probability by chance of what a fit explains beyond another that it has in it, with so many numbers more, were all rows
    /// independent.
    fn by_chance(&self, general: &S::Fit, within: &S::Fit, more: usize) -> f64 {
        let [high, low] = [general, within].map(|fit| self.study.log_likelihood(fit));
        let law = ChiSquared::new(more as f64);
        law.map_or(1.0, |law| law.sf(2.0 * (high - low).max(0.0)))
    }

    /// Of the curves that have the chosen one in them that which explains most beyond it, if that is more than likely with all of
    /// them counted: it names a cause. That the chosen one cannot be told from it is said.
    fn with_more(&self, chosen: usize, trials: &[Trial], accepted: &[usize]) -> Option<usize> {
        let more: Vec<(usize, f64)> = (0..trials.len())
            .filter(|&index| {
                self.is_curve(&trials[index]) && trials[index].is_as_certain_as(&trials[chosen])
            })
            .filter_map(|index| {
                Some((index, self.beyond(&trials[index], &trials[chosen], accepted)?))
            })
            .collect();
        let likely = LIKELY / more.len() as f64;
        let best = more.into_iter().min_by(|a, b| a.1.total_cmp(&b.1));
        best.filter(|(_, p_value)| *p_value < likely).map(|(index, _)| index)
    }

    /// An accepted term, and the trial that had better stand in its place: it is beyond chance on top of all, and predicts more
    /// without the other, or, as its special case, as much.
    pub(super) fn exchange(&self, trials: &[Trial], accepted: &[usize]) -> Option<(usize, usize)> {
        let candidates = self.study.candidates();
        for (index, trial) in trials.iter().enumerate() {
            let new = &candidates[trial.term];
            if !trial.is_plausible || self.is_curve(trial) {
                continue;
            }
            for &old in accepted {
                let all = self.full(&with(accepted, trial.term), COMMON, None);
                let terms = with(&without(accepted, old), trial.term);
                self.prepare(&terms, &all);
                let over = self.gain(&terms, accepted, COMMON);
                let is_special = candidates[old].generalises.contains(&new.name);
                let margin = if is_special { 0.0 } else { 2.0 * over.standard_error };
                if margin < over.gain {
                    return Some((old, index));
                }
            }
        }
        None
    }

    /// An accepted effect, and the curve that had better stand in its place: the curve has the effect in it, predicts better, and
    /// explains what the effect and another level cannot, beyond doubt. To call such a thing by the effect's name would be wrong.
    pub(super) fn more_than_linear(
        &self,
        accepted: &[usize],
        removed: &[usize],
    ) -> Option<(Vec<usize>, Trial)> {
        let candidates = self.study.candidates();
        let is_new = |curve: &usize| {
            candidates[*curve].is_tried()
                && candidates[*curve].curve_over().is_some()
                && !accepted.contains(curve)
                && !removed.contains(curve)
        };
        let level = candidates.iter().position(|candidate| candidate.linear_in == Some(CONSTANT));
        let curves: Vec<usize> = (0..candidates.len()).filter(is_new).collect();
        let effects = accepted.iter().filter(|&&old| candidates[old].curve_over().is_none());
        let pairs = effects.flat_map(|&old| curves.iter().map(move |&curve| (old, curve)));
        let has_in_it = |&(old, curve): &(usize, usize)| {
            candidates[curve].generalises.contains(&candidates[old].name)
        };
        let beyond = pairs.filter(has_in_it).filter_map(|(old, curve)| {
            let all = self.full(accepted, COMMON, None);
            let terms = with(&without(accepted, old), curve);
            self.prepare(&terms, &all);
            let mut within = accepted.to_vec();
            within.extend(level.filter(|level| !accepted.contains(level)));
            let [n_curve, n_old] = [curve, old].map(|term| candidates[term].n_parameters);
            let [general, within] =
                [&terms, &within].map(|terms| self.full(terms, COMMON, Some(&all)));
            let p_value = self.by_chance(&general, &within, n_curve.saturating_sub(n_old + 1));
            let over = self.gain(&terms, accepted, COMMON);
            debug!(name = candidates[curve].name, p_value, gain = over.gain, "more than linear");
            (p_value < BEYOND_DOUBT && 0.0 < over.gain).then_some((p_value, old, curve))
        });
        let (_, old, curve) = beyond.min_by(|a, b| a.0.total_cmp(&b.0))?;
        Some((vec![old], self.attempt(&without(accepted, old), curve)))
    }

    /// Accepted terms, and the one candidate that had better stand in place of them all: it could not be told from any of them,
    /// and predicts as well as they do together. That something is missing is beyond doubt, so that by its own measure it need
    /// but be likely.
    pub(super) fn one_for_many(
        &self,
        decided: &[Trial],
        accepted: &[usize],
        removed: &[usize],
    ) -> Option<(Vec<usize>, Trial)> {
        let mut tied: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
        for trial in decided {
            for &rival in &trial.ties {
                tied.entry(rival).or_default().push(trial.term);
            }
        }
        let is_new = |term: &usize| !accepted.contains(term) && !removed.contains(term);
        tied.retain(|rival, olds| 1 < olds.len() && is_new(rival));
        tied.into_iter().find_map(|(rival, olds)| {
            let rest: Vec<usize> =
                accepted.iter().copied().filter(|term| !olds.contains(term)).collect();
            let all = self.full(&with(accepted, rival), COMMON, None);
            self.prepare(&rest, &all);
            let trial = self.attempt(&rest, rival);
            self.prepare(&with(&rest, rival), &all);
            let common = self.gain(&with(&rest, rival), &rest, COMMON);
            let over = self.gain(&with(&rest, rival), accepted, COMMON);
            let is_likely = trial.gain.p_value < LIKELY && common.p_value < FAMILY_ERROR;
            debug!(rival, gain = over.gain, p = trial.gain.p_value, "one for many");
            (is_likely && 0.0 <= over.gain).then(|| (olds, Trial { common, ..trial }.by_common()))
        })
    }
}
