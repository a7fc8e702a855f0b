//! From where a fit starts, and which start is best.

use super::LinkFit;
use super::run::FitOptions;
use super::search;
use crate::links::LinkStudy;
use crate::links::likelihood::RowLikelihood;
use crate::links::random_effects::scales::CORRELATION_S;
use crate::links::terms::{TermSpec, TermState};
use crate::{Study, TermId, span_s};
use proto::effect::{Level, Search};

/// From more starts than so many a trial goes on from the best few after its first step.
const MANY_STARTS: usize = 4;
const FINALISTS: usize = 3;
/// Rounds in which a pattern and the headings of still nodes are found in turn.
const HEADING_ROUNDS: usize = 3;

impl LinkStudy {
    /// The best of short fits from several starts.
    pub(in crate::links) fn best_of(
        &self,
        terms: &[TermId],
        starts: Vec<Vec<TermState>>,
        train: &[u32],
        from: FitOptions<'_>,
    ) -> Option<LinkFit> {
        let mut best: Option<LinkFit> = None;
        for states in self.promising(terms, starts, train, from) {
            if best.is_some() && self.is_stopped() {
                break;
            }
            let fit = self.run(terms, states, train, from);
            if best.as_ref().is_none_or(|best| best.log_likelihood < fit.log_likelihood) {
                best = Some(fit);
            }
        }
        best
    }

    /// Of many starts of trials those that are best after a step.
    pub(in crate::links) fn promising(
        &self,
        terms: &[TermId],
        starts: Vec<Vec<TermState>>,
        train: &[u32],
        from: FitOptions<'_>,
    ) -> Vec<Vec<TermState>> {
        if !from.is_trial || starts.len() <= MANY_STARTS || self.is_stopped() {
            return starts;
        }
        let from = FitOptions { most_steps: 1, ..from };
        let mut first: Vec<LinkFit> = Vec::new();
        for states in starts {
            if !first.is_empty() && self.is_stopped() {
                break;
            }
            first.push(self.run(terms, states, train, from));
        }
        first.sort_by(|a, b| b.log_likelihood.total_cmp(&a.log_likelihood));
        first.truncate(FINALISTS);
        first.into_iter().map(|fit| fit.states).collect()
    }

    /// Whether a term has random levels that change over one of several lengths or times.
    pub(in crate::links) fn asks_for_scale(&self, term: TermId) -> bool {
        self.scales_of(term).is_some()
    }

    /// The key of the length or time over which random levels of a term change, and the values that are tried.
    fn scales_of(&self, term: TermId) -> Option<(&'static str, Vec<f64>)> {
        match self.specs[term] {
            TermSpec::Shadowing(_) => Some(("decorrelation_m", self.lengths().collect())),
            TermSpec::Drift(_) | TermSpec::LinkDrift(_) => {
                Some((CORRELATION_S, self.times_s.clone()))
            }
            _ => None,
        }
    }

    /// Whether the term has places or nodes that a search finds.
    pub(in crate::links) fn is_searched(&self, term: TermId) -> bool {
        matches!(self.specs[term].search(), Search::Headings | Search::Places | Search::Nodes)
    }

    /// The log likelihoods of rows under a fit, with their derivatives over the levels.
    pub(in crate::links) fn row_likelihoods(
        &self,
        fit: &LinkFit,
        train: &[u32],
    ) -> Vec<RowLikelihood> {
        let specs = self.specs_of(&fit.terms);
        search::row_likelihoods(&self.rows, fit, &specs, &self.cells(fit.scales), train)
    }

    /// A pattern with headings of still nodes, on top of `parent`: pattern and headings are found in turn.
    pub(in crate::links) fn heading(
        &self,
        term: TermId,
        mut state: TermState,
        train: &[u32],
        level: Level,
        parent: &LinkFit,
    ) -> TermState {
        let terms: Vec<TermId> = parent.terms.iter().copied().chain([term]).collect();
        for _ in 0..HEADING_ROUNDS {
            let states = parent.states.iter().cloned().chain([state.clone()]).collect();
            let fit = self.run(&terms, states, train, FitOptions::quick(level, Some(parent)));
            let likelihoods = self.row_likelihoods(&fit, train);
            if let Some(last) = fit.states.last() {
                state = search::headings::refine(&self.rows, train, &likelihoods, last);
            }
        }
        state
    }

    /// The states from which a search for a term starts, `parent` being the fit without it.
    pub(in crate::links) fn starts_of(
        &self,
        term: TermId,
        terms: &[TermId],
        train: &[u32],
        level: Level,
        parent: Option<&LinkFit>,
    ) -> Vec<TermState> {
        let spec = &self.specs[term];
        let states = self.configured_starts(spec);
        if self.is_searched(term) {
            // Searches take turns: each is made on top of those before it.
            let place = terms.iter().position(|&other| other == term).unwrap_or_default();
            let terms: Vec<TermId> = terms
                .iter()
                .enumerate()
                .filter(|&(index, &other)| {
                    other != term && (index < place || !self.is_searched(other))
                })
                .map(|(_, &other)| other)
                .collect();
            let parent = self.fit(&terms, train, level, parent);
            let concerned = self.within_limits(spec, train);
            let train = &concerned[..];
            let likelihoods = self.row_likelihoods(&parent, train);
            return match spec.search() {
                Search::Headings => {
                    let found =
                        search::headings::patterns(&self.rows, train, &likelihoods, &states);
                    match <[TermState; 1]>::try_from(found) {
                        Ok([state]) => vec![self.heading(term, state, train, level, &parent)],
                        Err(found) => found,
                    }
                }
                Search::Places => search::obstacles(&self.rows, train, &likelihoods, &states[0]),
                _ => search::sagging(&self.rows, train, &likelihoods, &states[0]),
            };
        }
        let Some((key, scales)) = self.scales_of(term) else { return states };
        scales
            .into_iter()
            .flat_map(|scale| {
                states.iter().map(move |state| {
                    let mut state = state.clone();
                    state.table.insert(key.to_owned(), toml::Value::Float(scale));
                    state
                })
            })
            .collect()
    }

    /// The rows of the span of time and of the campaigns to which a term is limited.
    fn within_limits(&self, spec: &TermSpec, train: &[u32]) -> Vec<u32> {
        let TermSpec::Limited(_, limits) = spec else { return train.to_vec() };
        let span_s = span_s(limits);
        let runs: Option<Vec<i64>> = limits.get("runs").and_then(|runs| {
            Some(runs.as_array()?.iter().filter_map(toml::Value::as_integer).collect())
        });
        let is_within = |row: &&u32| {
            let row = &self.rows.links.rows[**row as usize];
            let is_in_run = |runs: &Vec<i64>| runs.contains(&i64::from(row.run));
            span_s.contains(&row.time_s) && runs.as_ref().is_none_or(is_in_run)
        };
        train.iter().filter(is_within).copied().collect()
    }

    /// The states from which a search for a term starts, keys that repeat a property of the configured model taken from there.
    fn configured_starts(&self, spec: &TermSpec) -> Vec<TermState> {
        let mut states = TermState::starts(spec);
        let from_model = spec.entry().map_or(&[][..], |entry| entry.fit.from_model);
        for &(key, property) in from_model {
            let Some(value) = self.rows.model.property(property) else { continue };
            match spec.parameters().iter().position(|parameter| parameter.key == key) {
                Some(k) => states.iter_mut().for_each(|state| state.values[k] = value),
                None => states.iter_mut().for_each(|state| {
                    state.table.insert(key.to_owned(), toml::Value::Float(value));
                }),
            }
        }
        states
    }
}
