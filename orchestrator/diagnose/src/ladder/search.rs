//! The state of a search: fits of models and their predictions of rows that they have not seen, each computed once.

use crate::gain::Gain;
use crate::progress::SearchProgress;
use proto::effect::Level;
use rayon::prelude::*;
use statrs::distribution::{ChiSquared, ContinuousCDF as _};
use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, PoisonError};
use study::{COMMON, Candidate, RowScore, Study, TermId};

/// Predictions of all rows by models that had not seen them, and fits to all rows: computed once.
pub(crate) struct Search<'a, S: Study> {
    pub(super) study: &'a S,
    /// The rows that fits may see.
    pub(super) all: Vec<u32>,
    known: Arc<Known<S::Fit>>,
    pub(super) report: &'a (dyn Fn(SearchProgress<'_>) + Sync),
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

    /// What is searched.
    pub(crate) fn study(&self) -> &'a S {
        self.study
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
            log_of_position: f64::NAN,
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
    pub(super) fn prepare(&self, terms: &[TermId], from: &S::Fit) {
        self.levels().into_par_iter().for_each(|level| {
            self.full_fit(terms, level, Some(from));
        });
    }

    /// Levels at which candidates are judged.
    pub(super) fn levels(&self) -> Vec<Level> {
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
        let gain = Gain::from_scores(
            &self.held_out_scores(terms, level),
            &self.held_out_scores(parent, level),
            blocks.dependent(),
        );
        // The skewness of a few sums is mostly chance.
        if blocks.are_many() { gain } else { gain.by_students_t() }
    }

    /// A fit to all rows with one term more than `parent`; none where a quick one raises the likelihood by less than `least`
    /// (nats). Beside random levels that take up what an effect explains a quick fit is far from its end, and is not asked.
    pub(super) fn fit_if_promising(
        &self,
        terms: &[TermId],
        level: Level,
        parent: &S::Fit,
        least: f64,
    ) -> Option<Arc<S::Fit>> {
        let candidates = self.study.candidates();
        let start = self.study.screen(terms, level, parent);
        let before = self.study.log_likelihood(parent);
        let has_levels = level == Level::Place
            || terms.iter().any(|&term| candidates[term].level == Level::Random);
        let is_effect = terms.last().is_some_and(|&new| candidates[new].curve_over().is_none());
        let is_quick = !(has_levels && is_effect);
        let rise = |start: &S::Fit| self.study.log_likelihood(start) - before;
        if is_quick && start.as_ref().is_some_and(|start| rise(start) < least) {
            return None;
        }
        Some(self.full_fit(terms, level, Some(start.as_ref().unwrap_or(parent))))
    }

    /// P-value of the likelihood-ratio test of a fit against a nested one with `more` parameters fewer, by the chi-squared
    /// distribution. Rows count as independent.
    pub(super) fn likelihood_ratio_p_value(
        &self,
        general: &S::Fit,
        within: &S::Fit,
        more: usize,
    ) -> f64 {
        let [high, low] = [general, within].map(|fit| self.study.log_likelihood(fit));
        let law = ChiSquared::new(more as f64);
        law.map_or(1.0, |law| law.sf(2.0 * (high - low).max(0.0)))
    }
}

/// The terms with one more.
pub(super) fn with_term(accepted: &[TermId], term: TermId) -> Vec<TermId> {
    accepted.iter().copied().chain([term]).collect()
}

/// The terms without one of them.
pub(crate) fn without_term(accepted: &[TermId], term: TermId) -> Vec<TermId> {
    accepted.iter().copied().filter(|&other| other != term).collect()
}
