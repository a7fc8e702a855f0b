//! The search: which term makes the model predict data that it has not seen better; then which next; until none does.

mod choice;
mod clustered;
mod selection;

use super::acceptance::{self, Verdict};
use super::gain::{Gain, Scores};
use super::progress::SearchProgress;
use proto::effect::Level;
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use study::thresholds::{FAMILY_ERROR, FEWEST_BLOCKS, HOPELESS_NATS, SPECIAL_CASE_NATS};
use study::{COMMON, Candidate, RowScore, Study, TermId};
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
    fn is_as_certain_as(&self, other: &Self) -> bool {
        self.verdict.is_acceptable()
            || self.verdict.is_plausible() && !other.verdict.is_acceptable()
    }

    /// The test as reported once its candidate is accepted: with the gain on the common split where that decided.
    fn into_accepted(self) -> Self {
        if self.verdict.is_acceptable() { self } else { self.accepted_on_common_split() }
    }

    /// The same test, judged by the gain on the common split.
    fn accepted_on_common_split(self) -> Self {
        Self { gain: self.common, verdict: Verdict::Acceptable, ..self }
    }
}

/// One model of the stepwise selection, with its held-out scores.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct LadderStep {
    /// Terms in the model, as numbers of candidates.
    pub terms: Vec<TermId>,
    /// Mean held-out scores on the common split.
    pub scores: Scores,
}

/// The result of a stepwise selection.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Ladder {
    /// Terms in the order in which they were added.
    pub accepted: Vec<TermId>,
    /// The model as configured, then with each term.
    pub rungs: Vec<LadderStep>,
    /// For each candidate the test that decided: of the round in which it was accepted, else of the last.
    pub tests: Vec<CandidateTest>,
    /// Why the measurements are too few for a search, if they are.
    pub too_little: Option<String>,
    /// The round in which the search was stopped, if so: what was accepted before stands, nothing more was looked for.
    pub stopped: Option<usize>,
}

impl Ladder {
    /// Candidates that were withheld in the last round.
    pub(crate) fn withheld(&self) -> impl Iterator<Item = TermId> + '_ {
        let withheld = self.tests.iter().filter(|test| test.verdict == Verdict::Withheld);
        withheld.map(|test| test.term)
    }

    /// Whether there was enough to tell something, and the search came to its end.
    #[must_use]
    pub(crate) fn is_complete(&self) -> bool {
        self.too_little.is_none() && self.stopped.is_none()
    }
}

/// Predictions of all rows by models that had not seen them, and fits to all rows: computed once.
pub(crate) struct Search<'a, S: Study> {
    study: &'a S,
    all: Vec<u32>,
    known: Arc<Known<S::Fit>>,
    report: &'a (dyn Fn(SearchProgress<'_>) + Sync),
}

/// What a search has computed. It holds for another search of the same study, with more candidates.
#[derive(Debug)]
pub(crate) struct Known<F> {
    held_out: Cache<Arc<Vec<RowScore>>>,
    full: Cache<Arc<F>>,
}

impl<F> Default for Known<F> {
    fn default() -> Self {
        Self { held_out: Mutex::default(), full: Mutex::default() }
    }
}

type Key = (Vec<TermId>, Level);
type Cache<T> = Mutex<BTreeMap<Key, T>>;

fn cached<T: Clone>(cache: &Cache<T>, key: &Key) -> Option<T> {
    cache.lock().unwrap_or_else(PoisonError::into_inner).get(key).cloned()
}

fn store<T: Clone>(cache: &Cache<T>, key: Key, value: &T) {
    cache.lock().unwrap_or_else(PoisonError::into_inner).insert(key, value.clone());
}

impl<'a, S: Study> Search<'a, S> {
    /// A search; it calls `report` with its progress.
    pub(crate) fn new(study: &'a S, report: &'a (dyn Fn(SearchProgress<'_>) + Sync)) -> Self {
        Self { study, all: study.fitted_rows(), known: Arc::default(), report }
    }

    /// The same search, which knows what another has computed.
    #[must_use]
    pub(crate) fn with_known(self, known: Arc<Known<S::Fit>>) -> Self {
        Self { known, ..self }
    }

    /// What it has computed.
    #[must_use]
    pub(crate) fn known(&self) -> Arc<Known<S::Fit>> {
        Arc::clone(&self.known)
    }

    /// Whether the search was stopped. Fits that were not made before are not to be used.
    pub(crate) fn is_stopped(&self) -> bool {
        self.study.is_stopped()
    }

    /// A fit to all rows, which starts from `parent` if it has not been made yet.
    pub(crate) fn full_fit(
        &self,
        terms: &[TermId],
        level: Level,
        parent: Option<&S::Fit>,
    ) -> Arc<S::Fit> {
        let key = (terms.to_vec(), self.study.judging_level(level));
        if let Some(fit) = cached(&self.known.full, &key) {
            return fit;
        }
        let fit = Arc::new(self.study.fit(terms, &self.all, level, parent));
        if !self.is_stopped() {
            store(&self.known.full, key, &fit);
        }
        fit
    }

    /// Every row predicted by a fit to the other folds, in blocks of `level`.
    pub(crate) fn held_out_scores(&self, terms: &[TermId], level: Level) -> Arc<Vec<RowScore>> {
        let level = self.study.judging_level(level);
        let key = (terms.to_vec(), level);
        if let Some(scores) = cached(&self.known.held_out, &key) {
            return scores;
        }
        let nothing = RowScore {
            log: f64::NAN,
            squared_error: f64::NAN,
            plain_squared_error: f64::NAN,
            heading_squared_error_rad2: f64::NAN,
            crps: f64::NAN,
            reception_log_loss: f64::NAN,
        };
        let mut scores = vec![nothing; self.study.n_rows()];
        if self.is_stopped() {
            return Arc::new(scores);
        }
        let start = self.full_fit(terms, level, None);
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
        for (rows, part) in parts {
            for (row, score) in rows.into_iter().zip(part) {
                scores[row as usize] = score;
            }
        }
        let scores = Arc::new(scores);
        if !self.is_stopped() {
            store(&self.known.held_out, key, &scores);
        }
        scores
    }

    /// Fits to all rows at every level, from one at some level.
    fn prepare(&self, terms: &[TermId], from: &S::Fit) {
        self.levels().into_par_iter().for_each(|level| {
            self.full_fit(terms, level, Some(from));
        });
    }

    /// Levels at which candidates are judged.
    fn levels(&self) -> Vec<Level> {
        let is_used = |level: &Level| {
            let is_judged =
                |c: &Candidate| c.is_tried() && self.study.judging_level(c.level) == *level;
            *level == COMMON
                || (self.study.candidates().iter().any(is_judged)
                    && self.study.blocks(*level).suffices())
        };
        [Level::Time, Level::Place, Level::Random].into_iter().filter(is_used).collect()
    }

    /// Gain of `terms` over `parent`, at a level.
    pub(crate) fn gain(&self, terms: &[TermId], parent: &[TermId], level: Level) -> Gain {
        let blocks = self.study.blocks(level);
        Gain::from_scores(
            &self.held_out_scores(terms, level),
            &self.held_out_scores(parent, level),
            blocks.dependent(),
        )
    }

    /// The gain of one term. For a curve, which names no physical cause, the p-value is that of Student's t without the correction for
    /// skewness.
    fn term_gain(&self, term: TermId, terms: &[TermId], parent: &[TermId], level: Level) -> Gain {
        let gain = self.gain_in_time(terms, parent, (term, level));
        let is_curve = self.study.candidates()[term].curve_over().is_some();
        if is_curve { gain.by_students_t() } else { gain }
    }

    /// A fit to all rows with one term more than `parent`; none where a quick one raises the likelihood by less than `least`
    /// (nats).
    fn fit_if_promising(
        &self,
        terms: &[TermId],
        level: Level,
        parent: &S::Fit,
        least: f64,
    ) -> Option<Arc<S::Fit>> {
        let start = self.study.screen(terms, level, parent);
        let before = self.study.log_likelihood(parent);
        if start.as_ref().is_some_and(|start| self.study.log_likelihood(start) - before < least) {
            return None;
        }
        Some(self.full_fit(terms, level, Some(start.as_ref().unwrap_or(parent))))
    }

    /// Tests a candidate on top of `accepted`: screens it, fits it, and scores it on held-out rows. A candidate that is untestable,
    /// hopeless by its likelihood, or no better than a special case of it keeps a gain of 0.
    fn test_candidate(&self, accepted: &[TermId], term: TermId) -> CandidateTest {
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
    fn is_no_better_than_special_case(
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

    /// Number of candidates that p-values are corrected for.
    fn n_tried(&self) -> usize {
        self.study.candidates().iter().filter(|candidate| candidate.is_tried()).count()
    }

    /// Judges tests by the acceptance rule. A term that was removed once is not accepted again.
    fn apply_acceptance_rule(
        &self,
        tests: &mut [CandidateTest],
        accepted: &[TermId],
        removed: &[TermId],
        floor: f64,
    ) {
        let gains: Vec<Gain> = tests.iter().map(|test| test.gain).collect();
        let terms: Vec<TermId> = tests.iter().map(|test| test.term).collect();
        let share_removed = |index: usize| self.share_removed(terms[index], accepted);
        let verdicts = acceptance::judge(&gains, self.n_tried(), floor, share_removed);
        for (test, verdict) in tests.iter_mut().zip(verdicts) {
            let is_asked_for = || self.is_asked_for(test.term, accepted) && 0.0 < test.gain.gain;
            let is_significant = verdict.is_significant() || is_asked_for();
            let is_worth = || {
                let share = || self.share_removed(test.term, accepted);
                is_asked_for() && acceptance::is_worth(test.gain.gain, floor, share)
            };
            let is_plausible =
                (verdict.is_plausible() || is_worth()) && !removed.contains(&test.term);
            test.verdict = Verdict::by_gain(is_significant, is_plausible);
            if test.verdict.is_acceptable() && !self.stands_clustered(test.term, accepted) {
                debug!(
                    name = self.study.candidates()[test.term].name,
                    "no more than what rows share"
                );
                test.verdict = Verdict::Withheld;
            }
        }
    }

    /// For a curve without a constant part the candidate that has one; any other term itself.
    fn stand_in_for(&self, term: TermId) -> TermId {
        let all = self.study.candidates();
        all.find(|candidate| candidate.stands_in_for == Some(term)).unwrap_or(term)
    }

    /// Tests every candidate on top of `accepted`, in parallel.
    fn test_all(&self, accepted: &[TermId], round: usize) -> Vec<CandidateTest> {
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

    fn too_little(&self) -> Option<String> {
        let blocks = self.study.blocks(COMMON);
        (!blocks.suffices()).then(|| {
            format!(
                "too few independent blocks: the data have {} {}, and at least {} are required",
                blocks.n_scored(),
                blocks.unit,
                FEWEST_BLOCKS
            )
        })
    }

    /// The model as configured, then with each term.
    fn rungs(&self, accepted: &[TermId]) -> Vec<LadderStep> {
        let all = self.full_fit(accepted, COMMON, None);
        let upto = |n: usize| {
            if 0 < n {
                self.prepare(&accepted[..n], &all);
            }
            self.rung(&accepted[..n])
        };
        (0..=accepted.len()).map(upto).collect()
    }

    fn rung(&self, terms: &[TermId]) -> LadderStep {
        LadderStep {
            terms: terms.to_vec(),
            scores: Scores::mean(&self.held_out_scores(terms, COMMON)),
        }
    }
}

fn with_term(accepted: &[TermId], term: TermId) -> Vec<TermId> {
    accepted.iter().copied().chain([term]).collect()
}

/// The terms without one of them.
pub(crate) fn without_term(accepted: &[TermId], term: TermId) -> Vec<TermId> {
    accepted.iter().copied().filter(|&other| other != term).collect()
}

#[cfg(test)]
mod tests;
