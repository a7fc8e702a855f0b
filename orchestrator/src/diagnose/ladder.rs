//! The search: which term makes the model predict data that it has not seen better; then which next; until none does.

use super::gain::{Gain, Scores};
use crate::study::{Candidate, RowScore, Study};
use proto::effect::Level;
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, PoisonError};
use tracing::debug;

/// All candidates together may accept wrongly with this probability (Holm).
pub const FAMILY_ERROR: f64 = 0.005;
/// A term is worth having from this gain on (nats per row) …
pub(crate) const WORTH_NATS: f64 = 0.01;
/// … or from this share of the error removed.
pub(crate) const WORTH_SHARE: f64 = 0.01;
/// In any case it removes this share of the error of the model as configured.
const LEAST_SHARE: f64 = 0.001;
/// A term that raises the likelihood of all rows together by less (nats) cannot gain on rows left out.
const HOPELESS_NATS: f64 = 5.0;
/// A rival raises the likelihood by at least this share of what the chosen one does.
const NEARLY: f64 = 0.8;
/// No ladder has more rungs.
const MOST_TERMS: usize = 8;

/// What was found about a candidate when it was last tried.
#[derive(Clone, Debug, PartialEq)]
pub struct Trial {
    /// Which candidate.
    pub term: usize,
    /// Gain at its own level.
    pub gain: Gain,
    /// Gain on the common split, by which candidates are ordered.
    pub common: Gain,
    /// Beyond chance with all candidates counted.
    pub is_significant: bool,
    /// Beyond chance if it were the only candidate, and worth having.
    pub is_plausible: bool,
    /// Significant, and worth having.
    pub is_acceptable: bool,
    /// Candidates that these data cannot tell from it.
    pub ties: Vec<usize>,
}

/// A rung of the ladder.
#[derive(Clone, Debug, PartialEq)]
pub struct Rung {
    /// Terms in the model.
    pub terms: Vec<usize>,
    /// How well it predicts what it has not seen, on the common split.
    pub scores: Scores,
}

/// What a search found.
#[derive(Clone, Debug, PartialEq)]
pub struct Ladder {
    /// Terms in the order in which they were added.
    pub accepted: Vec<usize>,
    /// The model as configured, then with each term.
    pub rungs: Vec<Rung>,
    /// For each candidate the trial that decided: of the round in which it was accepted, else of the last.
    pub trials: Vec<Trial>,
    /// Why nothing can be told, if so.
    pub too_little: Option<String>,
}

/// Predictions of all rows by models that had not seen them, and fits to all rows: computed once.
pub struct Search<'a, S: Study> {
    study: &'a S,
    all: Vec<u32>,
    held_out: Cache<Arc<Vec<RowScore>>>,
    full: Cache<Arc<S::Fit>>,
    report: &'a (dyn Fn(&str) + Sync),
}

type Key = (Vec<usize>, Level);
type Cache<T> = Mutex<BTreeMap<Key, T>>;

fn look<T: Clone>(cache: &Cache<T>, key: &Key) -> Option<T> {
    cache.lock().unwrap_or_else(PoisonError::into_inner).get(key).cloned()
}

fn keep<T: Clone>(cache: &Cache<T>, key: Key, value: &T) {
    cache.lock().unwrap_or_else(PoisonError::into_inner).insert(key, value.clone());
}

impl<'a, S: Study> Search<'a, S> {
    /// A search; `report` is told what is being done.
    pub fn new(study: &'a S, report: &'a (dyn Fn(&str) + Sync)) -> Self {
        Self {
            study,
            all: study.fitted_rows(),
            held_out: Mutex::default(),
            full: Mutex::default(),
            report,
        }
    }

    /// A fit to all rows, which starts from `parent` if it has not been made yet.
    pub fn full(&self, terms: &[usize], level: Level, parent: Option<&S::Fit>) -> Arc<S::Fit> {
        let key = (terms.to_vec(), self.study.judged(level));
        if let Some(fit) = look(&self.full, &key) {
            return fit;
        }
        let fit = Arc::new(self.study.fit(terms, &self.all, level, parent));
        keep(&self.full, key, &fit);
        fit
    }

    /// Every row predicted by a fit to the other folds, in blocks of `level`.
    pub fn held_out(&self, terms: &[usize], level: Level) -> Arc<Vec<RowScore>> {
        let level = self.study.judged(level);
        let key = (terms.to_vec(), level);
        if let Some(scores) = look(&self.held_out, &key) {
            return scores;
        }
        let start = self.full(terms, level, None);
        let blocks = self.study.blocks(level);
        let n_folds = blocks.n_folds();
        let parts: Vec<(Vec<u32>, Vec<RowScore>)> = (0..n_folds)
            .into_par_iter()
            .map(|fold| {
                let (train, test) = blocks.split(fold);
                if train.is_empty() || test.is_empty() {
                    return (Vec::new(), Vec::new());
                }
                let scores = if n_folds == 1 {
                    self.study.scores(&start, &test)
                } else {
                    let fit = self.study.fit(terms, &train, level, Some(&start));
                    self.study.scores(&fit, &test)
                };
                (test, scores)
            })
            .collect();
        let nothing = RowScore {
            log: f64::NAN,
            squared_error: f64::NAN,
            crps: f64::NAN,
            reception_log_loss: f64::NAN,
        };
        let mut scores = vec![nothing; self.study.n_rows()];
        for (rows, part) in parts {
            for (row, score) in rows.into_iter().zip(part) {
                scores[row as usize] = score;
            }
        }
        let scores = Arc::new(scores);
        keep(&self.held_out, key, &scores);
        scores
    }

    /// Fits to all rows at every level, from one at some level.
    fn prepare(&self, terms: &[usize], from: &S::Fit) {
        for level in self.levels() {
            self.full(terms, level, Some(from));
        }
    }

    /// Levels at which candidates are judged.
    fn levels(&self) -> Vec<Level> {
        let is_used = |level: &Level| {
            let is_judged =
                |c: &Candidate| c.untestable.is_none() && self.study.judged(c.level) == *level;
            *level == COMMON
                || (self.study.candidates().iter().any(is_judged)
                    && self.study.blocks(*level).suffices())
        };
        [Level::Time, Level::Place, Level::Random].into_iter().filter(is_used).collect()
    }

    /// Gain of `terms` over `parent`, at a level.
    pub fn gain(&self, terms: &[usize], parent: &[usize], level: Level) -> Gain {
        let blocks = self.study.blocks(level);
        Gain::of(&self.held_out(terms, level), &self.held_out(parent, level), blocks.dependent())
    }

    /// A fit to all rows with one term more than `parent`; none where a quick one raises the likelihood by less than `least`
    /// (nats).
    fn promising(
        &self,
        terms: &[usize],
        level: Level,
        parent: &S::Fit,
        least: f64,
    ) -> Option<Arc<S::Fit>> {
        let start = self.study.screen(terms, level, parent);
        let before = self.study.log_likelihood(parent);
        if start.as_ref().is_some_and(|start| self.study.log_likelihood(start) - before < least) {
            return None;
        }
        Some(self.full(terms, level, Some(start.as_ref().unwrap_or(parent))))
    }

    /// Tries a candidate on top of `accepted`.
    fn attempt(&self, accepted: &[usize], term: usize) -> Trial {
        let candidate = &self.study.candidates()[term];
        let hopeless = Trial {
            term,
            gain: Gain::NONE,
            common: Gain::NONE,
            is_significant: false,
            is_plausible: false,
            is_acceptable: false,
            ties: Vec::new(),
        };
        let level = candidate.level;
        if candidate.untestable.is_some()
            || accepted.contains(&term)
            || !self.study.blocks(level).suffices()
        {
            return hopeless;
        }
        let begun = std::time::Instant::now();
        let parent = self.full(accepted, level, None);
        let terms = with(accepted, term);
        let Some(fit) = self.promising(&terms, level, &parent, HOPELESS_NATS / 2.0) else {
            debug!(name = candidate.name, took = ?begun.elapsed(), "screened out");
            return hopeless;
        };
        let rise = self.study.log_likelihood(&fit) - self.study.log_likelihood(&parent);
        debug!(name = candidate.name, rise, took = ?begun.elapsed(), "fitted");
        if rise < HOPELESS_NATS {
            return hopeless;
        }
        let gain = self.gain(&terms, accepted, level);
        let common = if self.study.judged(level) == COMMON || FAMILY_ERROR < gain.p_value {
            gain
        } else {
            self.full(&terms, COMMON, Some(&fit));
            self.gain(&terms, accepted, COMMON)
        };
        debug!(name = candidate.name, gain = gain.gain, p = gain.p_value, took = ?begun.elapsed(), "scored");
        Trial { gain, common, ..hopeless }
    }

    /// Climbs the ladder.
    pub fn climb(&self) -> Ladder {
        let candidates = self.study.candidates();
        let mut accepted: Vec<usize> = Vec::new();
        let mut decided: Vec<Trial> = Vec::new();
        let mut rungs = vec![self.rung(&[])];
        let too_little = self.too_little();
        let configured = rungs[0].scores;
        let mut removed: Vec<usize> = Vec::new();
        let mut last: Vec<Trial> = Vec::new();
        while too_little.is_none() && accepted.len() < MOST_TERMS {
            (self.report)(&format!("round {}: trying what may be missing", accepted.len() + 1));
            for level in self.levels() {
                self.held_out(&accepted, level);
            }
            let mut trials: Vec<Trial> = (0..candidates.len())
                .into_par_iter()
                .map(|term| self.attempt(&accepted, term))
                .collect();
            holm(&mut trials, candidates.iter().filter(|c| c.untestable.is_none()).count());
            let parent = rungs[rungs.len() - 1].scores;
            for trial in trials.iter_mut().filter(|trial| trial.gain.p_value < FAMILY_ERROR) {
                let level = candidates[trial.term].level;
                let terms = with(&accepted, trial.term);
                let now = Scores::of(&self.held_out(&terms, level));
                let before = Scores::of(&self.held_out(&accepted, level));
                let share = now.share_removed(&before);
                let floor = LEAST_SHARE * share_scale(&configured, &parent);
                trial.is_plausible = (WORTH_NATS <= trial.gain.gain
                    || WORTH_SHARE.max(floor) <= share)
                    && !removed.contains(&trial.term);
                trial.is_acceptable = trial.is_significant && trial.is_plausible;
            }
            let Some(best) = self.choose(&trials, &accepted) else {
                let Some((old, new)) = self.exchange(&trials, &accepted) else {
                    last = trials;
                    break;
                };
                let rest = without(&accepted, old);
                let ties = self.ties(new, &trials, &rest);
                let mut trial = trials.swap_remove(new);
                trial.ties = ties;
                let names = [old, trial.term].map(|term| candidates[term].name.as_str());
                (self.report)(&format!("{} in place of {}", names[1], names[0]));
                accepted = with(&rest, trial.term);
                decided.retain(|decided| decided.term != old);
                decided.push(trial);
                removed.push(old);
                rungs = self.rungs(&accepted);
                continue;
            };
            let ties = self.ties(best, &trials, &accepted);
            let mut trial = trials.swap_remove(best);
            trial.ties = ties;
            (self.report)(&format!("+ {}", candidates[trial.term].name));
            let terms = with(&accepted, trial.term);
            let fit = self.full(&terms, candidates[trial.term].level, None);
            self.prepare(&terms, &fit);
            accepted = terms;
            decided.push(trial);
            // What was accepted before may have stood in for what came now.
            let mut index = 0;
            while 1 < accepted.len() && index + 1 < accepted.len() {
                let term = accepted[index];
                let rest = without(&accepted, term);
                let all = self.full(&accepted, candidates[term].level, None);
                self.prepare(&rest, &all);
                let gain = self.gain(&accepted, &rest, candidates[term].level);
                if FAMILY_ERROR < gain.p_value || gain.gain < WORTH_NATS / 10.0 {
                    (self.report)(&format!("- {}", candidates[term].name));
                    accepted = rest;
                    decided.retain(|trial| trial.term != term);
                    removed.push(term);
                } else {
                    index += 1;
                }
            }
            rungs = self.rungs(&accepted);
        }
        let mut trials = decided;
        let is_decided: Vec<usize> = trials.iter().map(|trial| trial.term).collect();
        trials.extend(last.into_iter().filter(|trial| !is_decided.contains(&trial.term)));
        Ladder { accepted, rungs, trials, too_little }
    }

    fn too_little(&self) -> Option<String> {
        let blocks = self.study.blocks(COMMON);
        (!blocks.suffices()).then(|| {
            format!(
                "too few independent blocks to tell: {} {}, at least {} are needed",
                blocks.n_scored(),
                blocks.unit,
                crate::study::folds::FEWEST_BLOCKS
            )
        })
    }

    /// An accepted term, and the trial that had better stand in its place: it is beyond chance on top of all, and predicts more
    /// without the other, or, as its special case, as much.
    fn exchange(&self, trials: &[Trial], accepted: &[usize]) -> Option<(usize, usize)> {
        let candidates = self.study.candidates();
        for (index, trial) in trials.iter().enumerate() {
            let new = &candidates[trial.term];
            if !trial.is_plausible || new.curve_over().is_some() {
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

    /// The model as configured, then with each term.
    fn rungs(&self, accepted: &[usize]) -> Vec<Rung> {
        let all = self.full(accepted, COMMON, None);
        let upto = |n: usize| {
            if 0 < n {
                self.prepare(&accepted[..n], &all);
            }
            self.rung(&accepted[..n])
        };
        (0..=accepted.len()).map(upto).collect()
    }

    fn rung(&self, terms: &[usize]) -> Rung {
        Rung { terms: terms.to_vec(), scores: Scores::of(&self.held_out(terms, COMMON)) }
    }

    /// The acceptable trial to take, as an index.
    fn choose(&self, trials: &[Trial], accepted: &[usize]) -> Option<usize> {
        let candidates = self.study.candidates();
        let best_of = |wanted: &dyn Fn(&Trial) -> bool| {
            (0..trials.len())
                .filter(|&index| trials[index].is_acceptable && wanted(&trials[index]))
                .max_by(|&a, &b| {
                    trials[a].common.gain.total_cmp(&trials[b].common.gain).then(b.cmp(&a))
                })
        };
        let is_curve = |trial: &Trial| candidates[trial.term].curve_over().is_some();
        let is_given = |trial: &Trial| is_curve(trial) && !candidates[trial.term].is_derived;
        let mut curve = best_of(&is_curve);
        // What was measured beside is a better name for a cause than time or place, if it explains as much.
        if let (Some(best), Some(given)) = (curve, best_of(&is_given)) {
            let over = self.between(&trials[best], &trials[given], accepted);
            if over.gain <= 2.0 * over.standard_error {
                curve = Some(given);
            }
        }
        let effect = best_of(&|trial| !is_curve(trial));
        let Some(mut best) = effect else { return curve };
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
        if let Some(curve) = curve {
            let level = self.common_to(&trials[curve], &trials[best]);
            let over = self.between_at(&trials[curve], &trials[best], accepted, level);
            // A level of its own for every node or link follows any curve: there it need not be much better.
            let is_random = candidates[trials[best].term].level == Level::Random;
            let margin =
                if is_random { 0.0 } else { (2.0 * over.standard_error).max(WORTH_NATS / 2.0) };
            if margin < over.gain {
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
        (0..trials.len()).filter(|&index| goes_before(&trials[index])).max_by(|&a, &b| {
            trials[a].common.gain.total_cmp(&trials[b].common.gain).then(b.cmp(&a))
        })
    }

    /// Where the best is random, which fits any pattern of known links and nodes: the law that predicts unknown ones best, beyond
    /// chance with everything random carried along.
    fn law_under(&self, best: usize, trials: &[Trial], accepted: &[usize]) -> Option<usize> {
        let candidates = self.study.candidates();
        if candidates[trials[best].term].level != Level::Random {
            return None;
        }
        let is_law = |trial: &&Trial| {
            let candidate = &candidates[trial.term];
            trial.is_acceptable
                && candidate.level != Level::Random
                && candidate.curve_over().is_none()
        };
        trials
            .iter()
            .enumerate()
            .filter(|(_, trial)| is_law(trial))
            .map(|(index, trial)| {
                let parent = self.full(accepted, Level::Place, None);
                let terms = with(accepted, trial.term);
                self.full(&terms, Level::Place, Some(&parent));
                (index, self.gain(&terms, accepted, Level::Place))
            })
            .filter(|(_, gain)| gain.p_value < FAMILY_ERROR && WORTH_NATS <= gain.gain)
            .max_by(|a, b| a.1.gain.total_cmp(&b.1.gain))
            .map(|(index, _)| index)
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
            let gain = self.gain(&both, &with(accepted, first.term), level);
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
        fit.is_some_and(|fit| rise(&fit) >= enough)
    }

    /// Candidates that cannot be told from the chosen one.
    fn ties(&self, best: usize, trials: &[Trial], accepted: &[usize]) -> Vec<usize> {
        let candidates = self.study.candidates();
        trials
            .iter()
            .enumerate()
            .filter(|&(index, trial)| {
                index != best
                    && candidates[trial.term].curve_over().is_none()
                    && (trial.is_significant || self.rivals(&trials[best], trial, accepted))
                    && self.is_tied(&trials[best], trial, accepted)
            })
            .map(|(_, trial)| trial.term)
            .collect()
    }
}

/// The split on which candidates are ordered and ladders are drawn.
pub const COMMON: Level = Level::Time;

fn with(accepted: &[usize], term: usize) -> Vec<usize> {
    accepted.iter().copied().chain([term]).collect()
}

fn without(accepted: &[usize], term: usize) -> Vec<usize> {
    accepted.iter().copied().filter(|&other| other != term).collect()
}

/// How much greater the error of the model as configured is than that of the parent: shares of the one are so many times
/// smaller than shares of the other.
fn share_scale(configured: &Scores, parent: &Scores) -> f64 {
    let scale = configured.rmse * configured.rmse / (parent.rmse * parent.rmse);
    if scale.is_finite() { scale.max(1.0) } else { 1.0 }
}

/// Marks what is beyond chance with `n` candidates counted (Holm 1979).
fn holm(trials: &mut [Trial], n: usize) {
    let mut order: Vec<usize> = (0..trials.len()).collect();
    order.sort_by(|&a, &b| trials[a].gain.p_value.total_cmp(&trials[b].gain.p_value));
    for (rank, index) in order.into_iter().enumerate() {
        let left = n.saturating_sub(rank).max(1) as f64;
        if FAMILY_ERROR / left < trials[index].gain.p_value {
            return;
        }
        trials[index].is_significant = true;
    }
}
