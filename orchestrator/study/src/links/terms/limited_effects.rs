//! Effects of the catalogue that are limited to some links, as candidates.

use super::candidates::candidate;
use super::{TermSpec, TermState};
use crate::limits::{NotLimited, limited_name};
use crate::links::LinkStudy;
use crate::links::fit::LinkFit;
use crate::links::fit::search::windows;
use crate::thresholds::LIMITED_OBSTACLE_NATS;
use crate::{Candidate, Study as _, TermId};
use physics::effect::only;
use proto::effect::{Level, Search};

impl LinkStudy {
    pub(in crate::links) fn limit(
        &mut self,
        term: TermId,
        limits: &toml::Table,
    ) -> Result<TermId, NotLimited> {
        let TermSpec::Effect(entry) = self.specs[term] else {
            return Err(NotLimited::Candidate);
        };
        let mut problems = Vec::new();
        let limits = only::checked(limits, "effect", &mut problems);
        if !problems.is_empty() {
            return Err(NotLimited::Limits(problems));
        }
        let name = limited_name(&self.candidates()[term].name, &limits);
        let only = limits.clone();
        let spec = TermSpec::Limited(entry, limits);
        let starts = TermState::starts(&spec);
        let mut effects = starts.iter().filter_map(|start| start.build(&spec));
        // Reception curve and fading belong to the instrument, which all rows share.
        if effects.any(|it| it.curve().is_some() || it.scatter().is_some()) {
            return Err(NotLimited::Candidate);
        }
        let unlimited = candidate(&spec, &self.rows, &self.catalogue);
        // What comes and goes shows on the same links at other times, whatever is behind it.
        let is_of_time = ["from_s", "until_s"].iter().any(|key| only.contains_key(*key));
        let is_sought = spec.search() == Search::Places;
        let level = if is_of_time && is_sought { Level::Time } else { unlimited.level };
        self.candidates.push(Candidate { name, only: Some(only), level, ..unlimited });
        Ok(self.specs.push(spec))
    }

    /// Another of an effect of which several may act.
    pub(in crate::links) fn another(&mut self, term: TermId) -> Option<TermId> {
        let TermSpec::Effect(entry) = self.specs[term] else { return None };
        if !entry.fit.is_repeatable {
            return None;
        }
        let another_of = Some(term);
        self.candidates.push(Candidate { another_of, ..self.candidates[term].clone() });
        Some(self.specs.push(self.specs[term].clone()))
    }

    /// The span of time in which an obstacle explains much more than always.
    pub(in crate::links) fn window_of(
        &self,
        fit: &LinkFit,
        term: TermId,
    ) -> Option<(toml::Table, f64)> {
        let is_place = self.specs[term].search() == Search::Places;
        if !is_place || !matches!(self.specs[term], TermSpec::Effect(_)) {
            return None;
        }
        let all = self.fitted_rows();
        let likelihoods = self.row_likelihoods(fit, &all);
        let found = windows::window(&self.rows, &all, &likelihoods)?;
        let limits = [("from_s", found.from_s), ("until_s", found.until_s)];
        let limits: toml::Table = limits
            .into_iter()
            .filter_map(|(key, moment_s)| Some((key.to_owned(), moment_s?.round().into())))
            .collect();
        let is_worth = !limits.is_empty() && found.always + LIMITED_OBSTACLE_NATS < found.gain;
        is_worth.then_some((limits, found.gain))
    }
}
