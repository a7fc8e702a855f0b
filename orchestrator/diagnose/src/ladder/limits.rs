//! Effects that act on one robot, one node, in one campaign or from a time on: which of them the slopes of a fit ask for.
//!
//! Each effect is a column. Limited to a group of rows, or to the time from a moment on, it is tested beside the whole column by a
//! cluster-robust score test: it must act otherwise there than elsewhere. Of six groups or more, the one must also stand out from the spread
//! of the others: where all differ, none is named.

mod column;

use super::search::{Search, without_term};
use crate::gate;
use crate::score_test::ScoreTests;
use column::{Asked, MOMENTS};
use proto::effect::CONSTANT;
use rayon::prelude::*;
use study::linear::{Column, Group, Linearised, Partition};
use study::thresholds::{
    FAMILY_ERROR, FEWEST_COMPARED_GROUPS, LIMITED_NATS, LIMITED_SHARE, MOST_LIMITED,
};
use study::{COMMON, Candidate, Study, TermId};
use tracing::debug;

/// A limited effect that the slopes ask for.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Proposal {
    /// The effect.
    pub term: TermId,
    /// Its table `only`.
    pub only: toml::Table,
    /// What it promises to raise the log likelihood by (nats).
    pub rise: f64,
}

/// The limited effects that the slopes of a model ask for, the most promising first. An effect that the model has is looked for in the
/// model without it.
#[must_use]
pub(super) fn proposals<S: Study>(
    study: &S,
    search: &Search<'_, S>,
    accepted: &[TermId],
) -> Vec<Proposal> {
    let candidates = study.candidates();
    let may_be = |term: &TermId| candidates[*term].may_be_limited();
    let others = candidates.ids().filter(|term| may_be(term) && !accepted.contains(term));
    let mut found = asked_for(study, search, accepted, &others.collect::<Vec<_>>());
    for &term in accepted.iter().filter(|term| may_be(term)) {
        found.extend(asked_for(study, search, &without_term(accepted, term), &[term]));
    }
    found.sort_by(|a, b| b.rise.total_cmp(&a.rise).then(a.term.cmp(&b.term)));
    let best = found.first().map_or(0.0, |best| best.rise);
    let mut kept: Vec<Proposal> = Vec::new();
    for proposal in found {
        let is_new = |other: &Proposal| other.term != proposal.term;
        if LIMITED_SHARE * best <= proposal.rise
            && kept.len() < MOST_LIMITED
            && kept.iter().all(is_new)
        {
            let Proposal { term, only, rise } = &proposal;
            debug!(name = candidates[*term].name, %only, rise, "asked for");
            kept.push(proposal);
        }
    }
    kept
}

/// Which of some effects the slopes of a model ask for, limited.
fn asked_for<S: Study>(
    study: &S,
    search: &Search<'_, S>,
    model: &[TermId],
    terms: &[TermId],
) -> Vec<Proposal> {
    if study.is_stopped() {
        return Vec::new();
    }
    let fit = search.full_fit(model, COMMON, None);
    let Some(rows) = study.linearised(&fit) else { return Vec::new() };
    let plain = rows.plain();
    let dependence = study.dependence();
    let mut partitions = study.partitions();
    partitions.retain(|partition| partition.key.is_some());
    let columns: Vec<(TermId, Vec<Column>)> =
        terms.iter().map(|&term| (term, study.columns(&fit, term))).collect();
    let n_columns: usize = columns.iter().map(|(_, columns)| columns.len()).sum();
    // Groups, and pairs of them.
    let n_sets = |partition: &Partition| match partition.groups.len() {
        n if n < FEWEST_COMPARED_GROUPS => n,
        n => n * (n + 1) / 2,
    };
    let n_groups: usize = partitions.iter().map(n_sets).sum();
    let pairs: Vec<(TermId, &Column)> = columns
        .iter()
        .flat_map(|(term, columns)| columns.iter().map(move |column| (*term, column)))
        .collect();
    let mut found: Vec<Proposal> = Vec::new();
    for rows in [&rows, &plain] {
        let asked = Asked {
            rows,
            tests: &ScoreTests::new(rows, &dependence),
            dependence: &dependence,
            n_tests: (2 * n_columns * (n_groups + 1) * (2 * MOMENTS + 1)) as f64,
            design_effect: study.design_effect(),
        };
        let of_column = |&(term, column): &(TermId, &Column)| {
            let of_groups = |partition| asked.of_groups(term, column, partition);
            let mut found: Vec<Proposal> = partitions.iter().filter_map(of_groups).collect();
            found.extend(asked.of_time(term, column, None).map(|(proposal, _)| proposal));
            found
        };
        let of_rows: Vec<Proposal> = pairs.par_iter().flat_map_iter(of_column).collect();
        found.extend(of_rows);
    }
    let in_time = |&term: &TermId| {
        let (only, rise) = study.span_of_search(&fit, term)?;
        Some(Proposal { term, only, rise })
    };
    let in_time: Vec<Proposal> = terms.iter().filter_map(in_time).collect();
    let rivals = in_time.iter().filter_map(|proposal| {
        let asked = (&rows, &dependence.times_s[..], study.design_effect());
        constant_of_one(study, &fit, asked, &partitions, &proposal.only)
    });
    found.extend(rivals.collect::<Vec<_>>());
    found.extend(in_time);
    found
}

/// What one step along a column promises to raise the log likelihood by (nats), from its score and information; 0 without information.
fn promised_nats(score: f64, information: f64, design_effect: f64) -> f64 {
    if 0.0 < information { 0.5 * score * score / information / design_effect } else { 0.0 }
}

/// What comes and goes at a place near one node may as well be a constant of that node: the one that promises most in the same span of
/// time.
fn constant_of_one<S: Study>(
    study: &S,
    fit: &S::Fit,
    (rows, times_s, design_effect): (&Linearised, &[f64], f64),
    partitions: &[Partition],
    span: &toml::Table,
) -> Option<Proposal> {
    let is_constant = |c: &Candidate| c.linear_in == Some(CONSTANT) && c.may_be_limited();
    let term = study.candidates().find(is_constant)?;
    let column = study.columns(fit, term).into_iter().next()?;
    let span_s = study::span_s(span);
    let promise = |group: &Group| {
        let (mut score, mut information) = (0.0, 0.0);
        for &row in group.rows.iter().filter(|&&row| span_s.contains(&times_s[row as usize])) {
            let row = row as usize;
            for ((slope, weight), x) in
                rows.slopes[row].iter().zip(&rows.weights[row]).zip(&column[row])
            {
                score += slope * x;
                information += weight * x * x;
            }
        }
        promised_nats(score, information, design_effect)
    };
    let groups = partitions.iter().filter_map(|partition| {
        let key = partition.key?;
        Some(partition.groups.iter().map(move |group| (key, group.id, promise(group))))
    });
    let (key, id, rise) = groups.flatten().max_by(|a, b| a.2.total_cmp(&b.2))?;
    let mut only = span.clone();
    only.insert(key.to_owned(), toml::Value::Array(vec![i64::from(id).into()]));
    (LIMITED_NATS < rise).then_some(Proposal { term, only, rise })
}

/// Whether a limited effect is asked for by the slopes of a fit: its p-value, of one test.
#[must_use]
pub(super) fn p_value<S: Study>(study: &S, fit: &S::Fit, term: TermId) -> f64 {
    let Some(rows) = study.linearised(fit) else { return 1.0 };
    let dependence = study.dependence();
    let columns = study.columns(fit, term);
    let plain = rows.plain();
    let least = [&rows, &plain].into_iter().flat_map(|rows| {
        let tests = ScoreTests::new(rows, &dependence);
        let p_values = columns.iter().filter_map(|column| Some(tests.test(column, &[])?.p_value));
        p_values.collect::<Vec<f64>>()
    });
    let n = 2.0 * columns.len() as f64;
    least.fold(1.0, |least: f64, p_value| least.min(n * p_value))
}

/// All that score tests find beyond chance in the model as configured ([`crate::screen`]).
pub(crate) fn screened<S: Study>(study: &S) -> Vec<String> {
    let search = Search::new(study, &|_| {});
    let fit = search.full_fit(&[], COMMON, None);
    let candidates = study.candidates();
    let mut names: Vec<String> =
        gate::gate(study, &fit).misfits.iter().map(gate::Misfit::sentence).collect();
    let limited = proposals(study, &search, &[]);
    names.extend(
        limited.iter().map(|found| format!("{} ({})", candidates[found.term].name, found.only)),
    );
    let tried: Vec<TermId> = candidates.ids().filter(|&term| candidates[term].is_tried()).collect();
    let is_found = |term: TermId| p_value(study, &fit, term) * (tried.len() as f64) < FAMILY_ERROR;
    names.extend(
        tried.iter().filter(|&&term| is_found(term)).map(|&term| candidates[term].name.clone()),
    );
    names
}
