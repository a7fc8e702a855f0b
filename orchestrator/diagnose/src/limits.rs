//! Effects that act on one robot, one node, in one campaign or from a time on: which of them the slopes of a fit ask for.
//!
//! Each effect is a column. Limited to a group of rows, or to the time from a moment on, it is tested beside the whole column by a
//! cluster-robust score test: it must act otherwise there than elsewhere. Of six groups or more, the one must also stand out from the spread
//! of the others: where all differ, none is named.

use crate::gate;
use crate::ladder::{Known, Ladder, Search, without_term};
use crate::progress::SearchProgress;
use crate::score_test::{ScoreTest, ScoreTests};
use proto::effect::{CONSTANT, Level};
use rayon::prelude::*;
use statrs::distribution::{ContinuousCDF as _, StudentsT};
use std::sync::Arc;
use study::linear::{Column, Dependence, Group, Linearised, Partition, on_rows};
use study::thresholds::{
    FAMILY_ERROR, FEWEST_COMPARED_GROUPS, LIMITED_NATS, LIMITED_SHARE, MOST_LIMITED,
    MOST_LIMITED_OF_A_KIND, TESTED_LIMITS, TIME_LIMIT_NATS, UNCORRECTED_LEVEL,
};
use study::{COMMON, Candidate, Study, TermId};
use tracing::debug;

/// Moments at which something may have begun or ended that are tried first: so many quantiles of the times …
const MOMENTS: usize = 12;
/// … and near the best of them so many more.
const FINE_MOMENTS: usize = 24;

/// A limited effect that the slopes ask for.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Proposal {
    /// The effect.
    pub term: TermId,
    /// Its table `only`.
    pub only: toml::Table,
    /// Its amplitude, in units of the column.
    pub amplitude: f64,
    /// What it promises to raise the log likelihood by (nats).
    pub rise: f64,
    /// P-value times the number of tests.
    pub p_value: f64,
}

/// Whether a candidate may be limited.
fn may_be_limited(candidate: &Candidate) -> bool {
    candidate.is_tried()
        && candidate.only.is_none()
        && candidate.about.is_some()
        && candidate.level != Level::Random
}

/// What is tested.
struct Asked<'a> {
    rows: &'a Linearised,
    tests: &'a ScoreTests<'a>,
    dependence: &'a Dependence,
    n_tests: f64,
    /// Rows that carry the information of one.
    design_effect: f64,
}

/// Rows to which an effect may be limited.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Span {
    Always,
    From(f64),
    Until(f64),
}

impl Span {
    fn has(self, time_s: f64) -> bool {
        match self {
            Self::Always => true,
            Self::From(from_s) => from_s <= time_s,
            Self::Until(until_s) => time_s < until_s,
        }
    }

    /// The rest of the time.
    fn rest(self) -> Option<Self> {
        match self {
            Self::Always => None,
            Self::From(moment_s) => Some(Self::Until(moment_s)),
            Self::Until(moment_s) => Some(Self::From(moment_s)),
        }
    }
}

/// The limited effects that the slopes of a model ask for, the most promising first. An effect that the model has is looked for in the
/// model without it.
#[must_use]
pub(crate) fn proposals<S: Study>(
    study: &S,
    search: &Search<'_, S>,
    accepted: &[TermId],
) -> Vec<Proposal> {
    let candidates = study.candidates();
    let may_be = |term: &TermId| may_be_limited(&candidates[*term]);
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
            let Proposal { term, only, rise, p_value, .. } = &proposal;
            debug!(name = candidates[*term].name, %only, rise, p_value, "asked for");
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
    let n_groups: usize = partitions.iter().map(|partition| partition.groups.len()).sum();
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
            found.extend(asked.of_time(term, column, None));
            found
        };
        let of_rows: Vec<Proposal> = pairs.par_iter().flat_map_iter(of_column).collect();
        found.extend(of_rows);
    }
    let in_time = |&term: &TermId| {
        let (only, rise) = study.span_of_search(&fit, term)?;
        Some(Proposal { term, only, amplitude: f64::NAN, rise, p_value: f64::NAN })
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
    let is_constant =
        |c: &Candidate| c.linear_in == Some(CONSTANT) && may_be_limited(c) && c.is_tried();
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
    (LIMITED_NATS < rise).then_some(Proposal {
        term,
        only,
        amplitude: f64::NAN,
        rise,
        p_value: f64::NAN,
    })
}

/// Rounds in which limited effects are looked for.
const MOST_ROUNDS: usize = 4;

/// Selects effects step by step, and again with the limited effects that what is left asks for, until nothing is asked for.
///
/// * `whole`: the study of all rows, where the search uses some of them only. It gets the same candidates.
///
/// Returns the selection, and what the search has computed.
pub(crate) fn selection<S: Study>(
    study: &mut S,
    mut whole: Option<&mut S>,
    report: &(dyn Fn(SearchProgress<'_>) + Sync),
) -> (Ladder, Arc<Known<S::Fit>>) {
    let mut known = Arc::<Known<S::Fit>>::default();
    let mut round = 0;
    loop {
        let search = Search::new(study, report).with_known(known);
        let ladder = search.stepwise_selection();
        known = search.known();
        round += 1;
        if !ladder.is_complete() || MOST_ROUNDS <= round {
            return (ladder, known);
        }
        let found = proposals(study, &search, &ladder.accepted);
        let n_before = study.candidates().len();
        let another =
            ladder.accepted.iter().filter_map(|&term| wanted_another(study, &ladder, term));
        for term in another.collect::<Vec<_>>() {
            if study.add_another(term).is_some()
                && let Some(whole) = &mut whole
            {
                let _ = whole.add_another(term);
            }
        }
        for proposal in found {
            let is_known = study.candidates().iter().any(|candidate| {
                candidate.only.as_ref() == Some(&proposal.only)
                    && candidate.effect() == study.candidates()[proposal.term].name
            });
            // What cannot be limited is not.
            if !is_known
                && study.add_limited(proposal.term, &proposal.only).is_ok()
                && let Some(whole) = &mut whole
            {
                let _ = whole.add_limited(proposal.term, &proposal.only);
            }
        }
        if study.candidates().len() == n_before {
            return (ladder, known);
        }
    }
}

/// The effect of which another is to be tried, where a term is such an effect and each of those there are is in the model already.
fn wanted_another<S: Study>(study: &S, ladder: &Ladder, term: TermId) -> Option<TermId> {
    let candidates = study.candidates();
    let first = candidates[term].another_of.unwrap_or(term);
    let all = candidates
        .ids()
        .filter(|&other| other == first || candidates[other].another_of == Some(first));
    let all: Vec<TermId> = all.collect();
    let is_last = all.last() == Some(&term) && all.len() < MOST_LIMITED_OF_A_KIND;
    (is_last && all.iter().all(|other| ladder.accepted.contains(other))).then_some(first)
}

/// Whether a limited effect is asked for by the slopes of a fit: its p-value, of one test.
#[must_use]
pub(crate) fn p_value<S: Study>(study: &S, fit: &S::Fit, term: TermId) -> f64 {
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

/// Quantiles of sorted values between their ends.
fn quantiles(sorted: &[f64], n: usize) -> Vec<f64> {
    let at = |k: usize| sorted[k * sorted.len() / (n + 1)];
    let mut all: Vec<f64> = (1..=n).map(at).collect();
    all.dedup();
    all.retain(|value| sorted[0] < *value);
    all
}

impl Asked<'_> {
    fn is_significant(&self, test: &ScoreTest) -> bool {
        self.n_tests * test.p_value < FAMILY_ERROR
    }

    fn during(&self, column: &Column, span: Span) -> Column {
        let rows = column.iter().zip(&self.dependence.times_s);
        rows.map(|(moved, time_s)| if span.has(*time_s) { *moved } else { [0.0; 3] }).collect()
    }

    /// The spans that promise most for a column, by sums over rows that count as independent.
    fn promising(&self, column: &Column) -> Vec<(Span, f64)> {
        let concerned: Vec<usize> =
            (0..column.len()).filter(|&row| column[row] != [0.0; 3]).collect();
        let mut times_s: Vec<f64> =
            concerned.iter().map(|&row| self.dependence.times_s[row]).collect();
        times_s.sort_by(f64::total_cmp);
        let moments_s = if times_s.iter().all(|time_s| time_s.is_finite()) && !times_s.is_empty() {
            quantiles(&times_s, MOMENTS)
        } else {
            Vec::new()
        };
        // Sums of scores and information between the moments.
        let mut sums = vec![(0.0, 0.0); moments_s.len() + 1];
        for &row in &concerned {
            let part =
                moments_s.partition_point(|moment_s| *moment_s <= self.dependence.times_s[row]);
            let slopes = self.rows.slopes[row].iter().zip(&self.rows.weights[row]);
            for ((slope, weight), x) in slopes.zip(&column[row]) {
                sums[part].0 += slope * x;
                sums[part].1 += weight * x * x;
            }
        }
        let rise = |parts: &[(f64, f64)]| {
            let (score, information) =
                parts.iter().fold((0.0, 0.0), |sum, part| (sum.0 + part.0, sum.1 + part.1));
            promised_nats(score, information, self.design_effect)
        };
        let mut spans = vec![(Span::Always, rise(&sums))];
        for (k, &moment_s) in moments_s.iter().enumerate() {
            spans.push((Span::From(moment_s), rise(&sums[k + 1..])));
            spans.push((Span::Until(moment_s), rise(&sums[..=k])));
        }
        spans.sort_by(|a, b| b.1.total_cmp(&a.1));
        spans.truncate(TESTED_LIMITS);
        if !spans.iter().any(|(span, _)| *span == Span::Always) {
            spans.push((Span::Always, rise(&sums)));
        }
        spans
    }

    /// Effects limited to one of the groups, and perhaps to a time.
    fn of_groups(&self, term: TermId, column: &Column, partition: &Partition) -> Option<Proposal> {
        let key = partition.key?;
        let of_group = |group: &Group| on_rows(column, &group.rows);
        let columns: Vec<Column> = partition.groups.iter().map(of_group).collect();
        let mut promising: Vec<(usize, f64)> = columns
            .iter()
            .map(|column| self.promising(column)[0].1)
            .enumerate()
            .filter(|(_, rise)| LIMITED_NATS < *rise)
            .collect();
        promising.sort_by(|a, b| b.1.total_cmp(&a.1));
        let found = promising.into_iter().take(TESTED_LIMITS).filter_map(|(group, _)| {
            let mut found = self.of_time(term, &columns[group], Some(column))?;
            let id = i64::from(partition.groups[group].id);
            found.only.insert(key.to_owned(), toml::Value::Array(vec![id.into()]));
            Some((group, found))
        });
        let (group, found) = found.max_by(|a, b| a.1.rise.total_cmp(&b.1.rise))?;
        let amplitude = |column: &Column| Some(self.tests.test(column, &[])?.amplitude);
        let others = (0..columns.len())
            .filter(|other| *other != group)
            .map(|other| amplitude(&columns[other]));
        let others: Vec<f64> = others.flatten().collect();
        stands_out(found.amplitude, &others).then_some(found)
    }

    /// A column as it acts always, from a moment on or until one. `beside`: what acts on all rows alike, always; none: the column.
    fn of_time(&self, term: TermId, column: &Column, beside: Option<&Column>) -> Option<Proposal> {
        let whole = beside.unwrap_or(column);
        let spans = self.promising(column);
        let test = |span: Span| self.tests.test(&self.during(column, span), &[whole]);
        let significant = spans.into_iter().filter_map(|(span, rise)| {
            // All rows always are nothing limited.
            let is_limited = beside.is_some() || span != Span::Always;
            let test = test(span).filter(|test| is_limited && self.is_significant(test))?;
            Some((span, rise, test))
        });
        let significant: Vec<(Span, f64, ScoreTest)> = significant.collect();
        let best = significant.iter().max_by(|a, b| a.1.total_cmp(&b.1))?;
        // For always speaks that a change is worth little.
        let always = significant
            .iter()
            .find(|(span, rise, _)| *span == Span::Always && best.1 < rise + TIME_LIMIT_NATS);
        let (mut span, _, found) = *always.unwrap_or(best);
        span = self.refined(column, span);
        if let Some(rest) = span.rest() {
            let [inside, outside] = [span, rest].map(|span| self.during(column, span));
            let beside_p = self.tests.test(&outside, &[&inside]);
            if beside_p.is_some_and(|test| test.p_value < UNCORRECTED_LEVEL) {
                // It is there in the rest of the time, too.
                beside?;
                span = Span::Always;
            }
        }
        let own = self.tests.test(&self.during(column, span), &[]).unwrap_or(found);
        let mut only = toml::Table::new();
        match span {
            Span::Always => {}
            Span::From(from_s) => {
                only.insert("from_s".to_owned(), rounded(from_s).into());
            }
            Span::Until(until_s) => {
                only.insert("until_s".to_owned(), rounded(until_s).into());
            }
        }
        let p_value = self.n_tests * found.p_value;
        Some(Proposal { term, only, amplitude: own.amplitude, rise: own.rise, p_value })
    }

    /// The moment of a span more exactly.
    fn refined(&self, column: &Column, span: Span) -> Span {
        let (moment_s, make): (f64, fn(f64) -> Span) = match span {
            Span::Always => return span,
            Span::From(moment_s) => (moment_s, Span::From),
            Span::Until(moment_s) => (moment_s, Span::Until),
        };
        let times_s = &self.dependence.times_s;
        let mut own_s: Vec<f64> = (0..column.len())
            .filter(|&row| column[row] != [0.0; 3])
            .map(|row| times_s[row])
            .collect();
        own_s.sort_by(f64::total_cmp);
        let at = own_s.partition_point(|time_s| *time_s < moment_s);
        let reach = own_s.len() / MOMENTS;
        let near = &own_s[at.saturating_sub(reach)..(at + reach).min(own_s.len())];
        let fine = quantiles(near, FINE_MOMENTS).into_iter().chain([moment_s]).map(|moment_s| {
            let span = make(moment_s);
            (span, self.tests.rise(&self.during(column, span), &[]))
        });
        fine.max_by(|a, b| a.1.total_cmp(&b.1)).map_or(span, |(span, _)| span)
    }
}

/// A moment in tenths of a second.
fn rounded(moment_s: f64) -> f64 {
    (10.0 * moment_s).round() / 10.0
}

/// Whether an amplitude lies outside of what the others make likely; of few groups always.
fn stands_out(own: f64, others: &[f64]) -> bool {
    let n = others.len() as f64;
    if others.len() + 1 < FEWEST_COMPARED_GROUPS {
        return true;
    }
    let mean = others.iter().sum::<f64>() / n;
    let squares: f64 = others.iter().map(|other| (other - mean) * (other - mean)).sum();
    let t = (own - mean).abs() / (squares / (n - 1.0) * (1.0 + 1.0 / n)).sqrt();
    // Of all groups the one that lies furthest.
    let p_value = StudentsT::new(0.0, 1.0, n - 1.0).map_or(1.0, |law| 2.0 * law.sf(t));
    p_value * (n + 1.0) < UNCORRECTED_LEVEL
}
