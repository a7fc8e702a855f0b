//! Effects that both campaigns have, with their own numbers in each: whether they stayed the same.

use super::contrast::{RUNS, Sides};
use super::search::{Found, limited, runs};
use proto::effect::Level;
use study::{Candidate, Study, TermId};

/// An effect that both campaigns have, with a model in which each has its own.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Pair {
    /// The term that acts in both.
    pub of: TermId,
    /// The model with it.
    pub parent: Vec<TermId>,
    /// The model with one for each campaign in its place.
    pub terms: Vec<TermId>,
    /// The term that acts in A.
    pub in_a: TermId,
    /// The term that acts in B.
    pub in_b: TermId,
    /// How many times wider intervals are than those of independent rows.
    pub widening: f64,
}

/// The effects that both campaigns have and that can be fitted to each.
pub(super) fn pairs<S: Study>(study: &mut S, found: &Found<S::Fit>, sides: &Sides) -> Vec<Pair> {
    let mut pairs = Vec::new();
    for &(of, _) in &found.common {
        let candidate = &study.candidates()[of];
        let effect = candidate.effect().to_owned();
        let only = candidate.only.clone().unwrap_or_default();
        if candidate.about.is_none()
            || candidate.level == Level::Random
            || only.contains_key(RUNS)
            || !found.terms.contains(&of)
        {
            continue;
        }
        let named = |candidate: &Candidate| candidate.name == effect;
        let Some(effect) = study.candidates().find(named) else { continue };
        let mut of_side = |runs_of: &[u32]| {
            let mut only = only.clone();
            only.insert(RUNS.to_owned(), runs(runs_of));
            limited(study, effect, &only)
        };
        let (Some(in_a), Some(in_b)) = (of_side(&sides.runs_a), of_side(&sides.runs_b)) else {
            continue;
        };
        let mut terms = found.terms.clone();
        terms.retain(|term| *term != of);
        terms.extend([in_a, in_b]);
        let widening = study.design_effect().max(1.0).sqrt();
        pairs.push(Pair { of, parent: found.terms.clone(), terms, in_a, in_b, widening });
    }
    pairs
}
