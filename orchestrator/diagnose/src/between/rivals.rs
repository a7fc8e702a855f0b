//! Explanations that no score test proposes, held against the changes that were found.

use super::contrast::Sides;
use super::search::{Found, Tie, limited, only};
use crate::gain::Gain;
use crate::ladder::Search;
use crate::progress::SearchProgress;
use std::sync::Arc;
use study::thresholds::DISTINGUISHED_LEVEL;
use study::{COMMON, Study, TermId};
use tracing::debug;

/// A score test cannot find an effect whose place, heading or node must be searched. In one campaign only, it may explain all that
/// changed: where it predicts held-out rows better than the changes do, they are only possible.
pub(super) fn at_a_place<S: Study>(
    study: &mut S,
    found: &mut Found<S::Fit>,
    sides: &Sides,
    report: &(dyn Fn(SearchProgress<'_>) + Sync),
) {
    if found.changes.is_empty() || study.is_stopped() {
        return;
    }
    let fit = {
        let search = Search::new(&*study, report).with_known(Arc::clone(&found.known));
        search.full_fit(&found.base, COMMON, None)
    };
    let is_sought = |term: &TermId| {
        study.candidates()[*term].may_be_limited() && study.columns(&fit, *term).is_empty()
    };
    let sought: Vec<TermId> = study.candidates().ids().filter(is_sought).collect();
    let mut rivals = Vec::new();
    for effect in sought {
        for (campaign, runs) in [("A", &sides.runs_a), ("B", &sides.runs_b)] {
            let term = limited(study, effect, &only(None, Some(runs)));
            let name = format!("{} in {campaign} alone", study.candidates()[effect].name);
            rivals.extend(term.map(|term| (term, name)));
        }
    }
    let search = Search::new(&*study, report).with_known(Arc::clone(&found.known));
    let changed = search.held_out_scores(&found.terms, COMMON);
    let blocks = study.blocks(COMMON).dependent();
    for (term, name) in rivals {
        let mut terms = found.base.clone();
        terms.push(term);
        search.full_fit(&terms, COMMON, Some(&fit));
        let scores = search.held_out_scores(&terms, COMMON);
        let over = Gain::from_scores(&changed, &scores, blocks);
        debug!(name, gain = over.gain, p = over.p_value, "changes over a rival at a place");
        // It has more numbers than most changes: where neither is significantly better it must be better by its score.
        let is_rival = over.gain <= 0.0 && !search.is_stopped();
        for change in &mut found.changes {
            if is_rival {
                change.ties.push(Tie::named(name.clone()));
            } else if over.p_value < DISTINGUISHED_LEVEL {
                change.ruled_out.push(name.clone());
            }
        }
    }
    found.known = search.known();
}
