//! The search for changes: which difference between the campaigns makes the pooled model predict held-out rows better, then which next.

use super::choice::{Choice, Explanation, What, aliases, choose};
use super::contrast::{Contrasts, Dependences, Difference, InBoth, One, RUNS, Sides, has_moved};
use super::rivals;
use crate::acceptance;
use crate::gain::{Gain, Scores};
use crate::ladder::{Known, Search, without_term};
use crate::progress::SearchProgress;
use crate::stepwise::{self, Round, Stepwise};
use std::convert::Infallible;
use std::sync::Arc;
use study::linear::{Column, Linearised};
use study::thresholds::{
    DISTINGUISHED_LEVEL, FAMILY_ERROR, IN_BOTH_SHARE, MOST_CHANGES, MOST_IN_BOTH,
};
use study::{COMMON, Candidate, RowScore, Study, TermId};
use tracing::debug;

/// An effect that a diagnosis of A accepted.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct BaseTerm {
    /// Its name, without what limits it.
    pub effect: String,
    /// What limits it, if anything does.
    pub only: Option<toml::Table>,
}

impl BaseTerm {
    /// Those of a selection.
    #[must_use]
    pub(super) fn of<S: Study>(study: &S, accepted: &[TermId]) -> Vec<Self> {
        let of_term = |&term: &TermId| {
            let candidate = &study.candidates()[term];
            Self { effect: candidate.effect().to_owned(), only: candidate.only.clone() }
        };
        accepted.iter().map(of_term).collect()
    }

    /// Whether it depends on the time since the start, which is another in the second campaign.
    fn is_of_time(&self) -> bool {
        let is_curve = self.effect.ends_with(":time_s");
        let limits =
            |only: &toml::Table| only.contains_key("from_s") || only.contains_key("until_s");
        is_curve || self.only.as_ref().is_some_and(limits)
    }
}

/// A change, as terms of the pooled study.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct FoundChange {
    /// The effect, without limits.
    pub effect: TermId,
    /// The robot or node at which it changed; none: everywhere.
    pub one: Option<One>,
    /// The term that acts in A; none where the model of A lacks it.
    pub in_a: Option<TermId>,
    /// The term that acts in B.
    pub in_b: TermId,
    /// Gain on held-out rows, over the model without the change.
    pub gain: Gain,
    /// P-value times the number of tests.
    pub p_value: f64,
    /// How many times wider intervals are than those of independent rows.
    pub widening: f64,
    /// What explains these data as well.
    pub ties: Vec<Tie>,
    /// Explanations that were fitted in its place and predict held-out rows significantly worse.
    pub ruled_out: Vec<String>,
    /// Effects that move the same rows alike at the same robot or node. They are ties, and no further changes.
    pub aliases: Vec<TermId>,
    /// P-value of the difference between recordings, times the number of tests; none where recordings are too few.
    pub recordings_p_value: Option<f64>,
}

/// What explains these data as well as a change.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Tie {
    /// What it is called.
    pub name: String,
    /// The term that stands in the place of the change; none where it is no such term.
    pub term: Option<TermId>,
}

impl Tie {
    /// What is no term in the place of a change.
    #[must_use]
    pub(super) const fn named(name: String) -> Self {
        Self { name, term: None }
    }
}

/// What a search found.
#[derive(Clone, Debug)]
pub(super) struct Found<F> {
    /// All terms of the final model.
    pub terms: Vec<TermId>,
    /// What the model of A has beyond the configuration, as terms of the pooled study.
    pub base: Vec<TermId>,
    /// Changes, in the order in which they were found.
    pub changes: Vec<FoundChange>,
    /// Terms that act in both campaigns; whether A alone shows each.
    pub common: Vec<(TermId, bool)>,
    /// Effects that were tested as changes.
    pub tested: Vec<TermId>,
    /// What A shows and cannot be carried over to B, because it depends on the time since the start of A.
    pub of_time_in_a: Vec<String>,
    /// Whether the search came to its end.
    pub is_complete: bool,
    /// What the search has computed.
    pub known: Arc<Known<F>>,
}

/// Looks for changes. `base`: what a diagnosis of A accepted.
pub(super) fn search<S: Study>(
    study: &mut S,
    base: &[BaseTerm],
    sides: &Sides,
    report: &(dyn Fn(SearchProgress<'_>) + Sync),
) -> Found<S::Fit> {
    let of_time_in_a = base
        .iter()
        .filter(|term| term.is_of_time() && term.only.is_none())
        .map(|term| term.effect.clone())
        .collect();
    let base = base_terms(study, base, sides);
    let mut found = Found {
        terms: base.clone(),
        common: base.iter().map(|&term| (term, true)).collect(),
        base,
        changes: Vec::new(),
        tested: Vec::new(),
        of_time_in_a,
        is_complete: false,
        known: Arc::default(),
    };
    let dependences = Dependences::of(study, sides);
    let mut rounds = Rounds { study, dependences, sides, report };
    let Ok(ended) = stepwise::select(&mut rounds, &mut found);
    if ended.stopped_in().is_some() {
        return found;
    }
    backward_elimination(study, &mut found, report);
    rivals::at_a_place(study, &mut found, sides, report);
    found.tested.sort_unstable();
    found.tested.dedup();
    found
}

/// The rounds of a search for changes.
struct Rounds<'a, S> {
    study: &'a mut S,
    dependences: Dependences,
    sides: &'a Sides,
    report: &'a (dyn Fn(SearchProgress<'_>) + Sync),
}

impl<S: Study> Stepwise for Rounds<'_, S> {
    type Selection = Found<S::Fit>;
    type Error = Infallible;

    fn may_go_on(&self, _found: &Found<S::Fit>, rounds: usize) -> bool {
        rounds < MOST_CHANGES
    }

    fn round(&mut self, found: &mut Found<S::Fit>, round: usize) -> Result<Round, Infallible> {
        let Self { study, dependences, sides, report } = self;
        let (study, dependences): (&mut S, &Dependences) = (study, dependences);
        let (sides, report) = (*sides, *report);
        report(SearchProgress::Round { round });
        let Some(Proposals { proposals, tested }) =
            proposals(study, found, dependences, sides, report)
        else {
            return Ok(Round::Finished);
        };
        if study.is_stopped() {
            return Ok(Round::Stopped);
        }
        found.tested.extend(tested);
        if proposals.is_empty() {
            found.is_complete = true;
            return Ok(Round::Finished);
        }
        let models: Vec<ProposedModel> = proposals
            .into_iter()
            .filter_map(|proposal| proposed_model(study, found, proposal, sides))
            .collect();
        let search = Search::new(&*study, report).with_known(Arc::clone(&found.known));
        let parent = search.held_out_scores(&found.terms, COMMON);
        let fit = search.full_fit(&found.terms, COMMON, None);
        let mut explanations = Vec::new();
        for ProposedModel { terms, proposal, in_a, term, in_both } in models {
            let with = search.full_fit(&terms, COMMON, Some(&fit));
            let scores = search.held_out_scores(&terms, COMMON);
            let gain = search.gain(&terms, &found.terms, COMMON);
            let name = study.candidates()[term].name.as_str();
            debug!(name, gain = gain.gain, p = gain.p_value, "change");
            let is_concerned = rows_of(study, &proposal, sides);
            if !is_worth(&scores, &parent, &is_concerned) || gain.gain <= 0.0 {
                continue;
            }
            if let Some(why) = search.contradiction(term, &without_term(&terms, term)) {
                debug!(name, why, "contradicted");
                continue;
            }
            let n_parameters = study.candidates()[term].n_parameters;
            let what = match proposal {
                Proposal::InBoth(InBoth { term, .. }) => What::Common(term),
                Proposal::Difference(difference) => {
                    let known = difference.p_value.map(|p_value| (p_value, difference.widening));
                    let known = known.or_else(|| {
                        let both = search.full_fit(&in_both, COMMON, Some(&fit));
                        let best = [&both, &fit].map(|fit| study.log_likelihood(fit));
                        let rise = study.log_likelihood(&with) - best[0].max(best[1]);
                        adjusted(study, [&fit, &with], &difference, rise, (dependences, sides))
                    });
                    let Some((p_value, widening)) = known else { continue };
                    What::Change(FoundChange {
                        effect: difference.term,
                        one: difference.one,
                        in_a,
                        in_b: term,
                        gain,
                        p_value,
                        widening: widening.max(difference.recordings_widening),
                        ties: Vec::new(),
                        ruled_out: Vec::new(),
                        aliases: difference.aliases,
                        recordings_p_value: difference.recordings_p_value,
                    })
                }
            };
            explanations.push(Explanation { terms, what, gain, scores, n_parameters });
        }
        let is_stopped = search.is_stopped();
        let blocks = study.blocks(COMMON).dependent().to_vec();
        found.known = search.known();
        if is_stopped {
            return Ok(Round::Stopped);
        }
        let name = |what: &What| match what {
            What::Change(change) => change_name(study, change),
            What::Common(term) => format!("{} in both", study.candidates()[*term].name),
        };
        let generalises = |general: &What, special: &What| match (general, special) {
            (What::Change(general), What::Change(special)) => {
                let candidates = study.candidates();
                general.one == special.one
                    && candidates[general.effect]
                        .generalises
                        .contains(&candidates[special.effect].name)
            }
            _ => false,
        };
        let chosen = choose(explanations, &blocks, name, generalises);
        let Some(Choice { best, mut ties, ruled_out }) = chosen else {
            found.is_complete = true;
            return Ok(Round::Finished);
        };
        let Explanation { terms, what, .. } = best;
        match what {
            What::Common(term) => found.common.push((term, false)),
            What::Change(change) => {
                if let Some(in_a) = change.in_a {
                    // The effect itself is in both no longer.
                    let replaced =
                        replaced(study, &found.terms, change.effect, change.one.as_ref());
                    found.common.retain(|(term, _)| Some(*term) != replaced && *term != in_a);
                }
                let aliases = aliases(study, found, (&change, &terms), (sides, report));
                for &(effect, term) in &aliases {
                    if ties.iter().all(|tie| tie.term != Some(term)) {
                        let name = change_of(study, effect, change.one.as_ref());
                        ties.push(Tie { name, term: Some(term) });
                    }
                }
                if let Some(one) = change.one.as_ref().filter(|one| has_moved(study, one, sides)) {
                    ties.push(Tie::named(format!("another place of node {}", one.id)));
                }
                let is_tied = |name: &String| ties.iter().any(|tie| tie.name == *name);
                let ruled_out = ruled_out.into_iter().filter(|name| !is_tied(name)).collect();
                let aliases = aliases.into_iter().map(|(effect, _)| effect).collect();
                found.changes.push(FoundChange { ties, ruled_out, aliases, ..change });
            }
        }
        if let Some(&added) = terms.last() {
            report(SearchProgress::Accepted { name: &study.candidates()[added].name });
        }
        found.terms = terms;
        Ok(Round::Changed)
    }
}

/// Drops changes that later ones made superfluous: without them held-out rows are not predicted significantly worse.
fn backward_elimination<S: Study>(
    study: &S,
    found: &mut Found<S::Fit>,
    report: &(dyn Fn(SearchProgress<'_>) + Sync),
) {
    let search = Search::new(study, report).with_known(Arc::clone(&found.known));
    while 1 < found.changes.len() && !search.is_stopped() {
        let gain_of = |change: &FoundChange| {
            let without = without_term(&found.terms, change.in_b);
            search.gain(&found.terms, &without, COMMON)
        };
        // An effect that is split in two is kept: without its part in B nothing of it would act there.
        let gains = found.changes.iter().enumerate().filter(|(_, change)| change.in_a.is_none());
        let gains = gains.map(|(place, change)| (place, gain_of(change)));
        let superfluous = gains.filter(|(_, gain)| DISTINGUISHED_LEVEL <= gain.p_value);
        let Some((place, _)) = superfluous.min_by(|a, b| a.1.gain.total_cmp(&b.1.gain)) else {
            break;
        };
        let change = found.changes.remove(place);
        let name = study.candidates()[change.in_b].name.as_str();
        report(SearchProgress::Removed { name });
        found.terms = without_term(&found.terms, change.in_b);
    }
    found.known = search.known();
}

/// What a change is called.
pub(super) fn change_name<S: Study>(study: &S, change: &FoundChange) -> String {
    change_of(study, change.effect, change.one.as_ref())
}

/// What a change of an effect is called, everywhere or at one robot or node.
fn change_of<S: Study>(study: &S, effect: TermId, one: Option<&One>) -> String {
    let effect = &study.candidates()[effect].name;
    match one {
        None => format!("{effect} changed"),
        Some(One { key, id }) => format!("{effect} changed (only {key} = [{id}])"),
    }
}

/// What A accepted, as terms of the pooled study. What acts from a time of A on, or until one, acts in A only.
fn base_terms<S: Study>(study: &mut S, base: &[BaseTerm], sides: &Sides) -> Vec<TermId> {
    let mut terms = Vec::new();
    for term in base {
        let named = |candidate: &Candidate| candidate.name == term.effect && candidate.is_tried();
        let Some(effect) = study.candidates().find(named) else { continue };
        let made = match &term.only {
            None if term.is_of_time() => None,
            None => Some(effect),
            Some(only) => {
                let mut only = only.clone();
                if term.is_of_time() {
                    only.insert(RUNS.to_owned(), runs(&sides.runs_a));
                }
                limited(study, effect, &only)
            }
        };
        terms.extend(made);
    }
    terms
}

pub(super) fn runs(numbers: &[u32]) -> toml::Value {
    toml::Value::Array(numbers.iter().map(|&run| i64::from(run).into()).collect())
}

/// The candidate of an effect with limits, which is added unless there is one.
pub(super) fn limited<S: Study>(
    study: &mut S,
    effect: TermId,
    only: &toml::Table,
) -> Option<TermId> {
    let name = study.candidates()[effect].name.clone();
    let is_known =
        |candidate: &Candidate| candidate.only.as_ref() == Some(only) && candidate.effect() == name;
    let known = study.candidates().find(is_known);
    known.or_else(|| study.add_limited(effect, only).ok())
}

/// What a round tests and fits.
struct Proposals {
    /// To be fitted, the most promising first.
    proposals: Vec<Proposal>,
    /// The effects that were tested as changes.
    tested: Vec<TermId>,
}

/// An extension of the model that is fitted.
#[derive(Clone, Debug)]
enum Proposal {
    Difference(Difference),
    InBoth(InBoth),
}

/// The extensions of the model whose score tests are promising. None where the scores cannot be computed.
fn proposals<S: Study>(
    study: &S,
    found: &Found<S::Fit>,
    dependences: &Dependences,
    sides: &Sides,
    report: &(dyn Fn(SearchProgress<'_>) + Sync),
) -> Option<Proposals> {
    let search = Search::new(study, report).with_known(Arc::clone(&found.known));
    let fit = search.full_fit(&found.terms, COMMON, None);
    let rows = sides.linearised(study, &fit)?;
    let contrasts = Contrasts::new(study, &rows, dependences, sides);
    let candidates = study.candidates();
    // A time at which something begins is another in every recording.
    let columns: Vec<(TermId, Column)> = candidates
        .ids()
        .filter(|&term| candidates[term].may_be_limited() && !study.begins_in_time(term))
        .flat_map(|term| {
            let of_term = study.columns(&fit, term).into_iter();
            of_term.map(move |column| (term, column)).collect::<Vec<_>>()
        })
        .collect();
    let is_alias = |term: TermId, one: Option<&One>| {
        let of_one = found.changes.iter().filter(|change| change.one.as_ref() == one);
        of_one.flat_map(|change| &change.aliases).any(|alias| *alias == term)
    };
    let differences = contrasts.differences(&columns, study.design_effect(), &is_alias);
    let tested = columns.iter().map(|(term, _)| *term).collect();
    let Some(best) = differences.first().map(|difference| difference.rise) else {
        return Some(Proposals { proposals: Vec::new(), tested });
    };
    let mut in_both = contrasts.in_both(&columns);
    in_both.retain(|both| IN_BOTH_SHARE * best <= both.rise && !found.terms.contains(&both.term));
    in_both.truncate(MOST_IN_BOTH);
    let differences = differences.into_iter().map(Proposal::Difference);
    let proposals = differences.chain(in_both.into_iter().map(Proposal::InBoth)).collect();
    Some(Proposals { proposals, tested })
}

/// The term of the model that is the same effect at the same robot or node, in both campaigns.
fn replaced<S: Study>(
    study: &S,
    terms: &[TermId],
    effect: TermId,
    one: Option<&One>,
) -> Option<TermId> {
    let name = study.candidates()[effect].name.as_str();
    let limits = one.map(|one| only(Some(one), None));
    let is_same = |&&term: &&TermId| {
        let candidate = &study.candidates()[term];
        candidate.effect() == name && candidate.only == limits
    };
    terms.iter().find(is_same).copied()
}

/// The table that limits an effect to a robot or node, and to campaigns.
pub(super) fn only(one: Option<&One>, campaigns: Option<&[u32]>) -> toml::Table {
    let mut table = toml::Table::new();
    if let Some(One { key, id }) = one {
        let list = toml::Value::Array(vec![i64::from(*id).into()]);
        table.insert((*key).to_owned(), list);
    }
    if let Some(campaigns) = campaigns {
        table.insert(RUNS.to_owned(), runs(campaigns));
    }
    table
}

/// The p-value of a difference, and how many times wider its intervals are, from the likelihoods of fits without and with it. None where
/// it is not significant.
fn adjusted<S: Study>(
    study: &S,
    [without, with]: [&S::Fit; 2],
    difference: &Difference,
    rise: f64,
    (dependences, sides): (&Dependences, &Sides),
) -> Option<(f64, f64)> {
    // What the fit without it estimated: the difference is not to be orthogonal to itself.
    let estimated = study.linearised(without)?.estimated;
    let rows = Linearised { estimated, ..sides.linearised(study, with)? };
    let contrasts = Contrasts::new(study, &rows, dependences, sides);
    contrasts.adjusted(difference, rise).filter(|(p_value, _)| *p_value < FAMILY_ERROR)
}

/// A model with a proposed extension.
struct ProposedModel {
    terms: Vec<TermId>,
    proposal: Proposal,
    /// The term that acts in A, if the effect is split in two.
    in_a: Option<TermId>,
    /// The term that is new: of a change the one that acts in B.
    term: TermId,
    /// The model in which the effect acts in both campaigns alike.
    in_both: Vec<TermId>,
}

/// The model with a proposed extension. An effect that it has in both campaigns is split in two, one for each.
fn proposed_model<S: Study>(
    study: &mut S,
    found: &Found<S::Fit>,
    proposal: Proposal,
    sides: &Sides,
) -> Option<ProposedModel> {
    let mut terms = found.terms.clone();
    let difference = match &proposal {
        Proposal::Difference(difference) => difference,
        Proposal::InBoth(InBoth { term, .. }) => {
            let term = *term;
            terms.push(term);
            return Some(ProposedModel {
                in_both: terms.clone(),
                terms,
                proposal,
                in_a: None,
                term,
            });
        }
    };
    let (one, effect) = (difference.one.as_ref(), difference.term);
    let mut in_both = terms.clone();
    let mut in_a = None;
    if let Some(replaced) = replaced(study, &terms, effect, one) {
        let of_a = limited(study, effect, &only(one, Some(&sides.runs_a)))?;
        terms.retain(|term| *term != replaced);
        terms.push(of_a);
        in_a = Some(of_a);
    } else {
        in_both.push(match one {
            None => effect,
            Some(_) => limited(study, effect, &only(one, None))?,
        });
        // Where A asks for it and was too small to be diagnosed alone, each campaign has its own.
        if difference.is_of_a {
            let of_a = limited(study, effect, &only(one, Some(&sides.runs_a)))?;
            if !terms.contains(&of_a) {
                terms.push(of_a);
                in_a = Some(of_a);
            }
        }
    }
    let term = limited(study, effect, &only(one, Some(&sides.runs_b)))?;
    if terms.contains(&term) {
        return None;
    }
    terms.push(term);
    Some(ProposedModel { terms, proposal, in_a, term, in_both })
}

/// The rows on which a proposed effect acts: of a change those of B at the robot or node, of an effect in both campaigns all.
fn rows_of<S: Study>(study: &S, proposal: &Proposal, sides: &Sides) -> Vec<bool> {
    let Proposal::Difference(difference) = proposal else { return vec![true; sides.is_b.len()] };
    let Some(One { key, id }) = &difference.one else { return sides.is_b.clone() };
    let mut is_concerned = vec![false; sides.is_b.len()];
    let partitions = study.partitions();
    let groups = partitions.iter().filter(|partition| partition.key == Some(*key));
    for group in groups.flat_map(|partition| &partition.groups).filter(|group| group.id == *id) {
        for &row in &group.rows {
            is_concerned[row as usize] = sides.is_b[row as usize];
        }
    }
    is_concerned
}

/// Whether an explanation is worth having on the rows that it concerns: by the acceptance rule of a diagnosis.
fn is_worth(scores: &[RowScore], parent: &[RowScore], is_concerned: &[bool]) -> bool {
    let of_concerned = |scores: &[RowScore]| -> Vec<RowScore> {
        let rows = scores.iter().zip(is_concerned).filter(|(_, concerned)| **concerned);
        rows.map(|(score, _)| *score).collect()
    };
    let (scores, parent) = (of_concerned(scores), of_concerned(parent));
    let (now, before) = (Scores::mean(&scores), Scores::mean(&parent));
    let gain = now.log_score - before.log_score;
    acceptance::is_worth(gain, 0.0, || now.share_removed(&before))
}
