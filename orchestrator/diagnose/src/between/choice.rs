//! Which of several explanations of one round is chosen, and which are indistinguishable from it.

use super::contrast::Sides;
use super::search::{Found, FoundChange, Tie, limited, only};
use crate::gain::Gain;
use crate::ladder::{Search, without_term};
use crate::progress::SearchProgress;
use std::sync::Arc;
use study::thresholds::{DISTINGUISHED_LEVEL, FAMILY_ERROR, WORTH_NATS};
use study::{COMMON, RowScore, Study, TermId};

/// One explanation of the residuals.
pub(super) struct Explanation {
    pub terms: Vec<TermId>,
    pub what: What,
    pub gain: Gain,
    pub scores: Arc<Vec<RowScore>>,
    pub n_parameters: usize,
}

pub(super) enum What {
    Change(FoundChange),
    Common(TermId),
}

/// The explanation that is chosen among those that were fitted.
pub(super) struct Choice {
    pub best: Explanation,
    /// Explanations that these data do not distinguish from it.
    pub ties: Vec<Tie>,
    /// Names of those that predict held-out rows significantly worse.
    pub ruled_out: Vec<String>,
}

/// Chooses the explanation that predicts held-out rows best. Of those that these data do not distinguish from it, the one with the fewest
/// parameters is chosen, and the best of these.
pub(super) fn choose(
    mut explanations: Vec<Explanation>,
    blocks: &[u32],
    name: impl Fn(&What) -> String,
    generalises: impl Fn(&What, &What) -> bool,
) -> Option<Choice> {
    explanations.sort_by(|a, b| b.gain.gain.total_cmp(&a.gain.gain));
    // Of an effect and its special case the special one, unless it predicts held-out rows clearly worse.
    let most = explanations.first()?;
    let is_preferred = |special: &&Explanation| {
        let over = Gain::from_scores(&most.scores, &special.scores, blocks);
        generalises(&most.what, &special.what) && over.gain <= 2.0 * over.standard_error
    };
    let place = explanations.iter().position(|special| is_preferred(&special)).unwrap_or(0);
    let special = explanations.remove(place);
    explanations.insert(0, special);
    let best = explanations.first()?;
    let is_tied = |other: &Explanation| {
        let gain = Gain::from_scores(&best.scores, &other.scores, blocks);
        DISTINGUISHED_LEVEL <= gain.p_value
    };
    let tied: Vec<bool> =
        explanations.iter().enumerate().map(|(k, other)| k == 0 || is_tied(other)).collect();
    let worse = explanations.iter().zip(&tied).filter(|(_, is_tied)| !**is_tied);
    let ruled_out = worse.map(|(it, _)| name(&it.what)).collect();
    let mut tied = tied.into_iter();
    explanations.retain(|_| tied.next().unwrap_or(false));
    let fewest = explanations.iter().map(|it| it.n_parameters).min()?;
    // A change is preferred to an effect that acts in both campaigns, which is listed as a tie.
    let is_change = |it: &Explanation| matches!(it.what, What::Change(_));
    let place = explanations
        .iter()
        .position(|it| it.n_parameters == fewest && is_change(it))
        .or_else(|| explanations.iter().position(is_change))
        .unwrap_or(0);
    let best = explanations.remove(place);
    let ties = explanations
        .iter()
        .map(|it| Tie { name: name(&it.what), term: it.terms.last().copied() })
        .collect();
    Some(Choice { best, ties, ruled_out })
}

/// Of the effects that move the same rows alike as a change those that these data do not distinguish from it, with the terms that stand in
/// its place: beside such a term the change gains nothing.
pub(super) fn aliases<S: Study>(
    study: &mut S,
    found: &mut Found<S::Fit>,
    (change, terms): (&FoundChange, &[TermId]),
    (sides, report): (&Sides, &(dyn Fn(SearchProgress<'_>) + Sync)),
) -> Vec<(TermId, TermId)> {
    let mut alike = Vec::new();
    for &effect in &change.aliases {
        let only = only(change.one.as_ref(), Some(&sides.runs_b));
        alike.extend(limited(study, effect, &only).map(|term| (effect, term)));
    }
    let search = Search::new(&*study, report).with_known(Arc::clone(&found.known));
    let start = search.full_fit(terms, COMMON, None);
    alike.retain(|&(_, term)| {
        let beside = [terms, &[term]].concat();
        let instead = without_term(&beside, change.in_b);
        for terms in [&instead, &beside] {
            search.full_fit(terms, COMMON, Some(&start));
        }
        let gain = search.gain(&beside, &instead, COMMON);
        !(gain.p_value < FAMILY_ERROR && WORTH_NATS / 2.0 < gain.gain)
    });
    found.known = search.known();
    alike
}
