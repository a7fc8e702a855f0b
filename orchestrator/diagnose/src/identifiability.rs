//! What the design of measurements can tell before any search: from which size on each effect would be found, and from which on it is
//! told apart from the other effects that come nearest to it.
//!
//! | module | what |
//! |---|---|
//! | `noise` | what no effect of the catalogue explains |
//! | `detection` | from which amplitude on an effect would be accepted and be certain |
//! | `rival_sets` | which other effects explain most of what it moves |
//! | `words` | the table as people read it |
//!
//! [`power`](mod@crate::power) answers the first question for one effect by simulated campaigns. The bounds of a diagnosis
//! ([`Tested::detectable`](crate::diagnosis::Tested::detectable)) are by score tests beside all that a search accepted.

pub(crate) mod detection;
pub(crate) mod noise;
mod rival_sets;
mod words;

use crate::bounds::moved;
use crate::certainty::of_few_blocks;
use crate::ladder::Search;
use crate::measured::Measured;
use crate::score_test::{Products, ScoreTests};
use detection::{Amplitudes, Detection};
use proto::effect::{CONSTANT, Level, Parameter};
use rayon::prelude::*;
use rival_sets::{Group, RivalSet, nearest};
use schemars::JsonSchema;
use serde::Serialize;
use study::linear::{Column, Linearised, Signature, SignatureSize};
use study::links::LinkStudy;
use study::robots::RobotStudy;
use study::thresholds::{LEFT_BESIDE_NODES, SAME_COLUMNS};
use study::{COMMON, TermId};
pub use words::text;

/// What measurements can tell before any search.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Identifiability {
    /// Root mean square of the errors that no effect of the catalogue explains, in `unit`.
    pub noise: f64,
    /// Unit of all sizes: dB or m.
    pub unit: &'static str,
    /// Effects that move means, by descending `explained`.
    pub effects: Vec<EffectSize>,
    /// Effects of which no size can be stated, each group with the reason.
    pub without_size: Vec<WithoutSize>,
}

/// How large an effect must be for these measurements to show it.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct EffectSize {
    /// Its name.
    pub effect: String,
    /// From this size on it would be accepted and be certain in 9 of 10 such campaigns, by itself or as one of several that these data do
    /// not tell apart (root mean square over the rows). Absent if there is none; `without_size` has the reason.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub found_from: Option<f64>,
    /// The parameter of the effect at that size, where one parameter makes it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub parameter: Option<SizeOfParameter>,
    /// The least size, likewise, at which the data distinguish it from its nearest rivals. Absent if they explain nearly all that it moves.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub told_apart_from: Option<f64>,
    /// The nearest set of rivals: effects that together explain most of what it moves.
    pub rivals: Vec<String>,
    /// The share of its information that these explain (R²). With the effect at t standard errors, the expected difference of the log
    /// likelihoods is ½ t² (1 − R²).
    pub explained: f64,
}

/// The parameter of an effect at the size that would be found.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct SizeOfParameter {
    /// Its key.
    pub key: String,
    /// Its unit; `1` or empty for a number without one.
    pub unit: String,
    /// How far it is from the value at which the effect does nothing.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub by: Option<f64>,
    /// Its value, of a limit, which does nothing at no particular value.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub value: Option<f64>,
}

/// Effects of which no size can be stated for one reason.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, JsonSchema)]
pub struct WithoutSize {
    /// Their names.
    pub effects: Vec<String>,
    /// The reason.
    pub because: String,
}

/// The table of measured links under the model as configured; none where no level is predicted.
#[must_use]
pub fn of_links(study: &LinkStudy) -> Option<Identifiability> {
    of_rows(study)
}

/// The table of measured robots under the model as configured.
#[must_use]
pub fn of_robots(study: &RobotStudy) -> Option<Identifiability> {
    of_rows(study)
}

/// The table by as many rows as a search needs.
fn of_rows<S: Measured>(study: &S) -> Option<Identifiability> {
    let thin = study.some_rows();
    table(&Search::new(thin.as_ref().unwrap_or(study), &|_| {}))
}

/// The table by the rows of a search. None where there are no slopes, or the search was stopped.
pub(crate) fn table<S: Measured>(search: &Search<'_, S>) -> Option<Identifiability> {
    let study = search.study();
    let fit = search.full_fit(&[], COMMON, None);
    let rows = study.linearised(&fit).filter(|_| !search.is_stopped())?;
    let candidates = study.candidates();
    let effects = candidates.ids().filter(|&term| {
        let candidate = &candidates[term];
        candidate.is_tried_beside(&[]) && candidate.curve_over().is_none()
    });
    let effects: Vec<TermId> = effects.collect();
    let of_term = |&term: &TermId| (term, study.signatures(&fit, term));
    let signatures: Vec<(TermId, Vec<Signature>)> = effects.par_iter().map(of_term).collect();
    let columns: Vec<&Column> =
        signatures.iter().flat_map(|(_, all)| all.iter().map(|it| &it.column)).collect();
    let noise = noise::beside(&rows, &columns);
    let dependence = study.dependence();
    let products = ScoreTests::new(&noise.rows, &dependence).products(&columns);
    let design = Design {
        search,
        detection: Detection::new(search, &noise),
        products,
        groups: groups(&signatures),
        rows: &noise.rows,
    };
    let mut first = 0;
    let moving: Vec<(TermId, usize, &[Signature])> = signatures
        .iter()
        .map(|(term, all)| {
            let place = first;
            first += all.len();
            (*term, place, &all[..])
        })
        .filter(|(.., all)| !all.is_empty())
        .collect();
    let of_effect = |&(term, first, all): &(TermId, usize, &[Signature])| {
        design.effect(term, first, all).map(|effect| (term, effect))
    };
    let sized: Vec<(TermId, EffectSize)> = moving.par_iter().filter_map(of_effect).collect();
    let without_size = without_size(study, &effects, &sized);
    let mut sized: Vec<EffectSize> = sized.into_iter().map(|(_, effect)| effect).collect();
    sized.sort_by(|a, b| b.explained.total_cmp(&a.explained));
    Some(Identifiability {
        noise: noise.rms,
        unit: study.error_unit(),
        effects: sized,
        without_size,
    })
}

/// The columns of each effect at each of its starts.
fn groups(signatures: &[(TermId, Vec<Signature>)]) -> Vec<Group> {
    let mut groups: Vec<Group> = Vec::new();
    let mut column = 0;
    for (term, all) in signatures {
        for _ in all {
            groups.push(Group { term: *term, columns: vec![column] });
            column += 1;
        }
        let is_stepped = |it: &Signature| matches!(it.size, SignatureSize::By(..));
        let mut shapes: Vec<usize> = all.iter().map(|it| it.shape).collect();
        shapes.dedup();
        // Directions in which an effect may act, such as those of a wind, act together.
        if 1 < shapes.len() && all.iter().all(is_stepped) {
            groups.push(Group { term: *term, columns: (column - all.len()..column).collect() });
        }
    }
    groups
}

/// Effects without a size, by the reason.
fn without_size<S: Measured>(
    study: &S,
    effects: &[TermId],
    sized: &[(TermId, EffectSize)],
) -> Vec<WithoutSize> {
    let mut all: Vec<WithoutSize> = Vec::new();
    for &term in effects {
        let candidate = &study.candidates()[term];
        let size = sized.iter().find(|(other, _)| *other == term).map(|(_, effect)| effect);
        let because = match size {
            Some(EffectSize { found_from: Some(_), .. }) => continue,
            Some(_) => why_not_found(study, candidate.level),
            None if candidate.level == Level::Random || candidate.is_spread => {
                "random effects, which the search estimates".to_owned()
            }
            None if study.is_searched_for(term) => "where it acts is searched for".to_owned(),
            None => "moves no mean, or nothing in these data sets it off".to_owned(),
        };
        let name = candidate.name.clone();
        match all.iter_mut().find(|other| other.because == because) {
            Some(other) => other.effects.push(name),
            None => all.push(WithoutSize { effects: vec![name], because }),
        }
    }
    all
}

/// Why an effect that moves means is certain at no size.
fn why_not_found<S: Measured>(study: &S, level: Level) -> String {
    if let Some(why) = study.sizes_by_simulation() {
        return why.to_owned();
    }
    let blocks = study.blocks(level);
    if !blocks.suffices() {
        return format!(
            "these data are {} {}, and at least {} are required",
            blocks.n_scored(),
            blocks.unit,
            blocks.fewest()
        );
    }
    of_few_blocks(study).unwrap_or_else(|| "at no size within its range".to_owned())
}

/// What all effects of a table share.
struct Design<'a, S: Measured> {
    search: &'a Search<'a, S>,
    detection: Detection<'a, S>,
    products: Products,
    groups: Vec<Group>,
    rows: &'a Linearised,
}

/// A signature of an effect with the amplitudes from which on it is found and told apart.
struct Start<'a> {
    signature: &'a Signature,
    /// What an amplitude of 1 moves (root mean square over the rows).
    moved: f64,
    found: Option<f64>,
    told_apart: Option<f64>,
    rivals: RivalSet,
}

impl<S: Measured> Design<'_, S> {
    /// The sizes of an effect; none where it moves nothing beside what is estimated anyway. `first`: the number of its first column.
    fn effect(&self, term: TermId, first: usize, all: &[Signature]) -> Option<EffectSize> {
        let candidates = self.search.study().candidates();
        let starts = all.iter().enumerate();
        let starts: Vec<Start<'_>> =
            starts.filter_map(|(place, it)| self.start(term, first + place, it)).collect();
        let start = representative(&starts)?;
        let is_limit = matches!(start.signature.size, SignatureSize::At(..));
        // A limit has the size that it has; what would be found below it is another limit.
        let size = |amplitude: f64| start.moved * if is_limit { 1.0 } else { amplitude };
        let told_apart = if is_limit {
            let told = |it: &&Start<'_>| it.found.is_some() && it.told_apart.is_some();
            starts.iter().filter(told).map(|it| it.moved).min_by(f64::total_cmp)
        } else {
            start.found.and(start.told_apart).map(size)
        };
        let names = start.rivals.terms.iter().map(|&rival| candidates[rival].name.clone());
        Some(EffectSize {
            effect: candidates[term].name.clone(),
            found_from: start.found.map(size),
            parameter: start
                .found
                .and_then(|amplitude| parameter(&start.signature.size, amplitude)),
            told_apart_from: told_apart,
            rivals: names.collect(),
            explained: start.rivals.explained,
        })
    }

    fn start<'s>(
        &self,
        term: TermId,
        column: usize,
        signature: &'s Signature,
    ) -> Option<Start<'s>> {
        let study = self.search.study();
        let Amplitudes { found, apart } = self.detection.amplitudes(term, &signature.column)?;
        let suffice = study.blocks(study.candidates()[term].level).suffices();
        let is_known = suffice && study.sizes_by_simulation().is_none();
        let found = found.filter(|&it| is_known && is_in_range(&signature.size, it));
        let (rivals, is_tied) = self.rivals(term, column, signature);
        let told_apart = (!is_tied).then(|| apart / (1.0 - rivals.explained).sqrt());
        let told_apart = told_apart.zip(found).map(|(told_apart, found)| told_apart.max(found));
        let told_apart = told_apart.filter(|&it| is_in_range(&signature.size, it));
        let moved = moved(&signature.column, self.rows);
        Some(Start { signature, moved, found, told_apart, rivals })
    }

    /// The nearest rivals of a column of an effect, and whether it is tied with one of them whatever its size is.
    fn rivals(&self, term: TermId, column: usize, signature: &Signature) -> (RivalSet, bool) {
        let study = self.search.study();
        let candidates = study.candidates();
        if let Some((levels, left)) = self.levels_of_nodes(term, signature)
            && left < LEFT_BESIDE_NODES
        {
            return (RivalSet { terms: vec![levels], explained: 1.0 - left }, true);
        }
        let name = &candidates[term].name;
        let is_rival = |group: &&Group| {
            group.term != term && !candidates[group.term].generalises.contains(name)
        };
        let groups: Vec<&Group> = self.groups.iter().filter(is_rival).collect();
        let is_same =
            |other: &usize| SAME_COLUMNS <= self.products.correlation(column, *other).abs();
        let is_tied = groups.iter().any(|group| group.columns.iter().any(&is_same));
        (nearest(&self.products, column, &groups), is_tied)
    }

    /// The random effects per node, and the share of the information about an effect that is left beside them.
    fn levels_of_nodes(&self, term: TermId, signature: &Signature) -> Option<(TermId, f64)> {
        let study = self.search.study();
        let candidates = study.candidates();
        let of_levels = |term: TermId| Some((term, study.nodes_with_levels(term)?));
        let (levels, nodes) = candidates.ids().find_map(of_levels)?;
        let is_other = levels != term
            && candidates[levels].is_tried()
            && candidates[term].linear_in != Some(CONSTANT);
        let dependence = study.dependence();
        let left =
            || ScoreTests::new(self.rows, &dependence).left_beside_nodes(&signature.column, &nodes);
        Some((levels, is_other.then(left)??))
    }
}

/// The signature that says how large an effect must be. Of those that differ by size only, it is the one whose own size is nearest to
/// the size found; of different shapes and directions, the one that must be largest; of limits the weakest that is found.
fn representative<'s, 'a>(starts: &'s [Start<'a>]) -> Option<&'s Start<'a>> {
    let is_limit = |it: &&Start<'_>| matches!(it.signature.size, SignatureSize::At(..));
    if starts.iter().all(|it| is_limit(&it)) {
        let found = starts.iter().filter(|it| it.found.is_some());
        let weakest = found.min_by(|a, b| a.moved.total_cmp(&b.moved));
        return weakest.or_else(|| starts.iter().max_by(|a, b| a.moved.total_cmp(&b.moved)));
    }
    let size = |it: &Start<'_>| it.found.map_or(f64::INFINITY, |amplitude| amplitude * it.moved);
    let distance = |it: &Start<'_>| it.found.map_or(f64::INFINITY, |it| libm::log(it).abs());
    let of_shape = |shape: usize| {
        let same = starts.iter().filter(move |it| it.signature.shape == shape);
        same.min_by(|a, b| distance(a).total_cmp(&distance(b)))
    };
    starts
        .iter()
        .filter_map(|it| of_shape(it.signature.shape))
        .max_by(|a, b| size(a).total_cmp(&size(b)))
}

/// Whether a parameter may be as far from no effect as an amplitude says; a limit cannot move more than it does.
fn is_in_range(size: &SignatureSize, amplitude: f64) -> bool {
    match size {
        SignatureSize::By(Parameter { min, max, null, .. }, change) => null.is_none_or(|null| {
            let room = if 0.0 < *change { max - null } else { null - min };
            amplitude * change.abs() <= room
        }),
        SignatureSize::At(..) => amplitude <= 1.0,
        SignatureSize::Unknown => true,
    }
}

/// The parameter of an effect at an amplitude.
fn parameter(size: &SignatureSize, amplitude: f64) -> Option<SizeOfParameter> {
    let of = |parameter: &Parameter, by, value| SizeOfParameter {
        key: parameter.key.to_owned(),
        unit: parameter.unit.to_owned(),
        by,
        value,
    };
    match size {
        SignatureSize::By(parameter, change) => {
            Some(of(parameter, Some(amplitude * change.abs()), None))
        }
        SignatureSize::At(parameter, value) => Some(of(parameter, None, Some(*value))),
        SignatureSize::Unknown => None,
    }
}
