//! Effects of the catalogue that are limited to some robots or times, as candidates.

use super::RobotStudy;
use super::terms::Term;
use crate::Candidate;
use crate::limits::{NotLimited, limited_name};
use robotsim::dynamics::effect::only;

impl RobotStudy {
    /// Adds an effect that may be added to the model as one that is limited to some robots or times, and returns the number of the
    /// new candidate.
    ///
    /// * `term`: the number of the effect among the candidates.
    /// * `limits`: the table `only` of the effect.
    ///
    /// # Errors
    ///
    /// The limits are wrong, or the candidate is none that can be limited.
    pub fn add_limited(&mut self, term: usize, limits: &toml::Table) -> Result<usize, NotLimited> {
        let Some(Term::Effect(effect)) = self.model.terms.get(term) else {
            return Err(NotLimited::Candidate);
        };
        let mut problems = Vec::new();
        let limits = only::checked(limits, "effect", &mut problems);
        if !problems.is_empty() {
            return Err(NotLimited::Limits(problems));
        }
        let unlimited = self.candidates[term].clone();
        let name = limited_name(&unlimited.name, &limits);
        let limited = effect.clone().limited(limits);
        self.candidates.push(Candidate { name, stands_in_for: None, ..unlimited });
        self.model.terms.push(Term::Effect(limited));
        Ok(self.model.terms.len() - 1)
    }
}
