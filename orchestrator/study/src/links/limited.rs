//! Effects of the catalogue that are limited to some links, as candidates.

use super::LinkStudy;
use super::candidates::candidate;
use super::terms::{TermSpec, TermState};
use crate::limits::{NotLimited, limited_name};
use crate::{Candidate, Study as _};
use netsim::phy::effect::only;

impl LinkStudy {
    pub(super) fn limit(&mut self, term: usize, limits: &toml::Table) -> Result<usize, NotLimited> {
        let Some(&TermSpec::Effect(entry)) = self.specs.get(term) else {
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
        if effects.any(|it| it.curve().is_some() || it.scatter().is_some()) {
            return Err(NotLimited::Candidate);
        }
        let unlimited = candidate(&spec, &self.rows, &self.catalogue);
        self.candidates.push(Candidate { name, only: Some(only), ..unlimited });
        self.specs.push(spec);
        Ok(self.specs.len() - 1)
    }
}
