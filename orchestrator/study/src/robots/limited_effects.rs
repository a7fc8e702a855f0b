//! Effects of the catalogue that are limited to some robots or times, as candidates.

use super::RobotStudy;
use super::terms::Term;
use crate::limits::{NotLimited, limited_name};
use crate::{Candidate, TermId};
use robotsim::dynamics::effect::only;

impl RobotStudy {
    pub(super) fn limit(
        &mut self,
        term: TermId,
        limits: &toml::Table,
    ) -> Result<TermId, NotLimited> {
        let Term::Effect(effect) = &self.model.terms[term] else {
            return Err(NotLimited::Candidate);
        };
        let is_timed = limits.contains_key("from_s") || limits.contains_key("until_s");
        if effect.has_beginning() && is_timed {
            return Err(NotLimited::Candidate);
        }
        let mut problems = Vec::new();
        let limits = only::checked(limits, "effect", &mut problems);
        if !problems.is_empty() {
            return Err(NotLimited::Limits(problems));
        }
        let unlimited = self.candidates[term].clone();
        let name = limited_name(&unlimited.name, &limits);
        let limited = effect.clone().limited(limits.clone());
        self.candidates.push(Candidate {
            name,
            only: Some(limits.clone()),
            another_of: None,
            stands_in_for: None,
            ..unlimited
        });
        Ok(self.model.terms.push(Term::Effect(limited)))
    }
}
