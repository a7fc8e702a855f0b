//! Tests of differences between two campaigns at one fit: does a column act otherwise on rows of B than on those of A?
//!
//! The column on rows of B is tested beside the column on all rows, by the cluster-robust score tests of the search for limited effects.
//! What is common to both campaigns, and how exactly A determines it, so takes part in the test.
//!
//! The difference at one node is tested twice: rows of a block of time may depend on each other, and rows of a pair of nodes, of which
//! the node has one with each of the others. The greater p-value counts.

use super::recordings::Recordings;
use super::{Confounded, Shared, SidesOf, Spans};
use crate::gate::Misfit;
use crate::score_test::{ScoreTest, ScoreTests};
use measure::time_of_day::TIME_OF_DAY;
use numbers::normal::Z_90;
use rayon::prelude::*;
use statrs::distribution::{ContinuousCDF as _, StudentsT};
use std::collections::{BTreeMap, BTreeSet};
use study::linear::{Column, Dependence, Direction, Linearised, on_rows};
use study::thresholds::{
    DIFFERENCE_NATS, DIFFERENCE_SHARE, FAMILY_ERROR, FEWEST_REPLICATES, LIKE_RANGES,
    MOST_FITTED_DIFFERENCES, MOST_INSIGNIFICANT_DIFFERENCES, MOST_TESTED_DIFFERENCES, OF_A_SHARE,
    RANGE_TAIL, SAME_COLUMNS, SHARED_RANGE, WORTH_SHARE,
};
use study::{Study, TermId, linear::Partition};

/// The key that limits an effect to campaigns.
pub(super) const RUNS: &str = "runs";

/// The rows of two campaigns, A and B.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Sides {
    /// Numbers of the campaigns of A.
    pub runs_a: Vec<u32>,
    /// Numbers of the campaigns of B.
    pub runs_b: Vec<u32>,
    /// Whether each row is of B.
    pub is_b: Vec<bool>,
    /// Whether each row was measured under conditions that both campaigns share.
    pub is_shared: Vec<bool>,
    /// Covariates of which the campaigns share hardly a value.
    pub apart: Vec<Confounded>,
    /// The recordings of both.
    pub recordings: Recordings,
}

impl Sides {
    /// Whether both campaigns have enough of the replicates to which rows belong.
    fn have_replicates(&self, of_row: &[u32]) -> bool {
        [false, true].into_iter().all(|is_b| {
            let of_side = of_row.iter().zip(&self.is_b).filter(|(_, side)| **side == is_b);
            let distinct: BTreeSet<u32> = of_side.map(|(replicate, _)| *replicate).collect();
            FEWEST_REPLICATES <= distinct.len()
        })
    }

    /// Which rows of a study are of the campaigns of B. None where all rows are of one side.
    #[must_use]
    pub(super) fn of<S: Study>(study: &S, runs_b: &[u32]) -> Option<Self> {
        let partitions = study.partitions();
        let campaigns = partitions.iter().find(|partition| partition.key == Some(RUNS))?;
        let mut sides = Self { is_b: vec![false; study.n_rows()], ..Self::default() };
        for group in &campaigns.groups {
            if runs_b.contains(&group.id) {
                sides.runs_b.push(group.id);
                for &row in &group.rows {
                    sides.is_b[row as usize] = true;
                }
            } else {
                sides.runs_a.push(group.id);
            }
        }
        sides.share(&study.scanned_covariates());
        sides.recordings = Recordings::of(study, &sides);
        (!sides.runs_a.is_empty() && !sides.runs_b.is_empty()).then_some(sides)
    }

    /// Finds the rows that were measured under conditions that both campaigns share: within the common range of each covariate, but of
    /// those that would leave only few. The time of day has a place of its own in the answer.
    fn share(&mut self, covariates: &[(String, Vec<f64>)]) {
        self.is_shared = vec![true; self.is_b.len()];
        for (name, values) in covariates.iter().filter(|(name, _)| name != TIME_OF_DAY) {
            let of = |side: bool| -> Vec<f64> {
                let rows = values.iter().zip(&self.is_b).filter(|(_, is_b)| **is_b == side);
                rows.map(|(value, _)| *value).collect()
            };
            let (a, b) = (of(false), of(true));
            let Some(ranges) = Spans::within(&a, &b, RANGE_TAIL) else { continue };
            let common = [ranges.a[0].max(ranges.b[0]), ranges.a[1].min(ranges.b[1])];
            let is_in = |value: f64| !(value < common[0] || common[1] < value);
            let share = |values: &[f64]| {
                let n = values.iter().filter(|value| is_in(**value)).count();
                n as f64 / values.len() as f64
            };
            let least = share(&a).min(share(&b));
            if SHARED_RANGE <= least {
                if LIKE_RANGES <= least {
                    continue;
                }
                for (is_shared, value) in self.is_shared.iter_mut().zip(values) {
                    *is_shared &= is_in(*value);
                }
            } else if let Some(spans) = Spans::of(&a, &b).filter(Spans::are_apart) {
                self.apart.push(Confounded { covariate: name.clone(), spans });
            }
        }
    }

    /// How many rows of A and of B were measured under shared conditions, and how many there are.
    #[must_use]
    pub(super) fn shared(&self) -> SidesOf<Shared> {
        let of = |side: bool| {
            let of_side = || self.is_b.iter().zip(&self.is_shared).filter(|it| *it.0 == side);
            let rows = of_side().filter(|(_, is_shared)| **is_shared).count();
            Shared { rows, of: of_side().count() }
        };
        SidesOf { a: of(false), b: of(true) }
    }

    /// Slopes of a fit on the rows that count.
    #[must_use]
    pub(super) fn linearised<S: Study>(&self, study: &S, fit: &S::Fit) -> Option<Linearised> {
        Some(study.linearised(fit)?.of_rows(&self.is_shared))
    }

    /// A column on rows of B only.
    fn in_b(&self, column: &Column) -> Column {
        let rows = column.iter().zip(&self.is_b);
        rows.map(|(moved, is_b)| if *is_b { *moved } else { [0.0; 3] }).collect()
    }
}

/// One robot or one node.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct One {
    /// The key of a table `only` that limits an effect to it: `agents`, `nodes`.
    pub key: &'static str,
    /// Its number.
    pub id: u32,
}

/// A difference between the campaigns that a test found.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Difference {
    /// The effect, by the number of its candidate.
    pub term: TermId,
    /// The robot or node at which it differs; none: everywhere.
    pub one: Option<One>,
    /// What the difference promises to raise the log likelihood by (nats).
    pub rise: f64,
    /// P-value times the number of tests; none where the score test is uninformative or not significant.
    pub p_value: Option<f64>,
    /// How many times wider the clustered standard error is than that of independent rows, at least 1.
    pub widening: f64,
    /// The number of tests.
    pub n_tests: f64,
    /// What the effect moves on all rows.
    pub column: Column,
    /// Effects that move the same rows of B alike.
    pub aliases: Vec<TermId>,
    /// P-value of the difference between recordings, times the number of tests; none where recordings are too few.
    pub recordings_p_value: Option<f64>,
    /// How many times wider the interval by recordings is than that of independent rows, at least 1.
    pub recordings_widening: f64,
    /// Whether rows of A ask for the effect more than those of B do.
    pub is_of_a: bool,
}

/// An effect in both campaigns whose score test is significant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct InBoth {
    /// The effect, by the number of its candidate.
    pub term: TermId,
    /// What it promises to raise the log likelihood by (nats).
    pub rise: f64,
}

/// Tests of differences at one fit.
pub(super) struct Contrasts<'a> {
    sides: &'a Sides,
    rows: &'a Linearised,
    tests: ScoreTests<'a>,
    /// Of links: tests in which rows depend on each other in time only, and in which those of a pair of nodes do.
    of_nodes: Option<[ScoreTests<'a>; 2]>,
    pairs: Vec<u32>,
    partitions: Vec<Partition>,
}

/// Which rows depend on each other: of links also in time only, and those of a pair of nodes only.
pub(super) struct Dependences {
    all: Dependence,
    of_nodes: Option<[Dependence; 2]>,
    pairs: Vec<u32>,
}

impl Dependences {
    /// Of a study.
    #[must_use]
    pub(super) fn of<S: Study>(study: &S, sides: &Sides) -> Self {
        let mut all = study.dependence();
        // What changed must exceed what replicates of either campaign differ by.
        all.replicates = all.replicates.filter(|of_row| sides.have_replicates(of_row));
        let Some(nodes) = &all.nodes else {
            return Self { all, of_nodes: None, pairs: Vec::new() };
        };
        let mut numbers: BTreeMap<[u32; 2], u32> = BTreeMap::new();
        let pairs: Vec<u32> = nodes
            .iter()
            .map(|&[a, b]| {
                let next = numbers.len() as u32;
                *numbers.entry([a.min(b), a.max(b)]).or_insert(next)
            })
            .collect();
        let in_time = Dependence { nodes: None, ..all.clone() };
        // Every pair has two nodes of its own: pairs do not depend on each other.
        let apart = pairs.iter().map(|pair| [2 * pair, 2 * pair + 1]).collect();
        let in_pairs = Dependence { nodes: Some(apart), ..all.clone() };
        Self { of_nodes: Some([in_time, in_pairs]), all, pairs }
    }
}

impl<'a> Contrasts<'a> {
    /// Score tests at a fit.
    #[must_use]
    pub(super) fn new<S: Study>(
        study: &S,
        rows: &'a Linearised,
        dependences: &'a Dependences,
        sides: &'a Sides,
    ) -> Self {
        Self {
            sides,
            rows,
            tests: ScoreTests::new(rows, &dependences.all),
            of_nodes: dependences
                .of_nodes
                .as_ref()
                .map(|[in_time, in_pairs]| [in_time, in_pairs].map(|it| ScoreTests::new(rows, it))),
            pairs: dependences.pairs.clone(),
            partitions: study.partitions(),
        }
    }

    /// The differences of some effects between the campaigns, everywhere and at one robot or node: those that are significant after
    /// correction for all tests, and those that promise more than the best of these, were rows independent. A great change makes
    /// the scores of rows at a fit without it depend on each other, so that the test has no power; a fit with it decides. `columns`: of
    /// each effect. `is_alias`: whether a change that was found before moves the same as an effect does, there.
    #[must_use]
    pub(super) fn differences(
        &self,
        columns: &[(TermId, Column)],
        design_effect: f64,
        is_alias: &(dyn Fn(TermId, Option<&One>) -> bool + Sync),
    ) -> Vec<Difference> {
        let groups = || {
            let limiting = self.partitions.iter().filter_map(|partition| {
                let key = partition.key.filter(|key| *key != RUNS)?;
                Some((key, &partition.groups))
            });
            limiting.flat_map(|(key, groups)| groups.iter().map(move |group| (key, group)))
        };
        let n_tests = (columns.len() * (1 + groups().count())) as f64;
        let of_column = |(term, column): &(TermId, Column)| -> Vec<Difference> {
            let difference = |one: Option<One>, there: &Column, beside: &[&Column]| {
                let rise = self.tests.rise(there, beside) / design_effect;
                let is_new = DIFFERENCE_NATS < rise && !is_alias(*term, one.as_ref());
                is_new.then(|| Difference {
                    term: *term,
                    one,
                    rise,
                    p_value: None,
                    widening: 1.0,
                    n_tests,
                    column: column.clone(),
                    aliases: Vec::new(),
                    recordings_p_value: None,
                    recordings_widening: 1.0,
                    is_of_a: false,
                })
            };
            let everywhere = difference(None, &self.sides.in_b(column), &[column]);
            let at_one = groups().filter_map(|(key, group)| {
                let of_one = on_rows(column, &group.rows);
                let there = self.sides.in_b(&of_one);
                difference(Some(One { key, id: group.id }), &there, &[column, &of_one])
            });
            everywhere.into_iter().chain(at_one).collect()
        };
        let mut found: Vec<Difference> = columns.par_iter().flat_map_iter(of_column).collect();
        found.sort_by(|a, b| {
            b.rise.total_cmp(&a.rise).then((a.term, &a.one).cmp(&(b.term, &b.one)))
        });
        // Of several starts of one effect the most promising.
        let mut seen = Vec::new();
        found.retain(|difference| {
            let key = (difference.term, difference.one.clone());
            let is_new = !seen.contains(&key);
            seen.push(key);
            is_new
        });
        let best = found.first().map_or(0.0, |best| best.rise);
        found.retain(|difference| DIFFERENCE_SHARE * best <= difference.rise);
        found.truncate(MOST_TESTED_DIFFERENCES);
        found.par_iter_mut().for_each(|difference| {
            if let Some((test, p_value)) = self.test(&difference.column, difference.one.as_ref()) {
                let p_value = n_tests * p_value;
                difference.p_value = Some(p_value).filter(|p_value| *p_value < FAMILY_ERROR);
                difference.widening = widening(&test);
            }
        });
        let is_significant = |difference: &&Difference| difference.p_value.is_some();
        let best = found.iter().find(is_significant).map_or(0.0, |best| best.rise);
        let mut n_others = 0;
        found.retain(|difference| {
            let is_other = difference.p_value.is_none();
            n_others += usize::from(is_other);
            !is_other || best < difference.rise && n_others <= MOST_INSIGNIFICANT_DIFFERENCES
        });
        found.truncate(MOST_FITTED_DIFFERENCES);
        found.par_iter_mut().for_each(|difference| self.complete(difference, columns));
        found
    }

    /// Adds what moves the same, and what recordings tell.
    fn complete(&self, difference: &mut Difference, columns: &[(TermId, Column)]) {
        let rows = difference.one.as_ref().and_then(|one| self.rows_of(one));
        let there = |column: &Column| rows.map_or_else(|| column.clone(), |it| on_rows(column, it));
        let column = there(&difference.column);
        let others = columns.iter().filter(|(term, _)| *term != difference.term);
        let alike = others.filter(|(_, other)| self.move_alike(&column, &there(other)));
        difference.aliases = alike.map(|(term, _)| *term).collect();
        difference.aliases.dedup();
        let recordings = &self.sides.recordings;
        let there = self.sides.in_b(&column);
        let all = &difference.column;
        let beside: &[&Column] = if rows.is_some() { &[all, &column] } else { &[all] };
        let by_group = self.tests.by_group(&column, (&there, beside), &recordings.of_row);
        let Some((totals, information)) = by_group else { return };
        let [a, b] = recordings.by_side(&totals).map(|total| total.amplitude().abs());
        difference.is_of_a = b < OF_A_SHARE * a;
        if let Some(test) = recordings.difference(&totals) {
            difference.recordings_p_value = Some(difference.n_tests * test.two_sided());
            let independent = Z_90 / information.sqrt();
            difference.recordings_widening = (test.half_width() / independent).max(1.0);
        }
    }

    /// The test of a difference, everywhere or at one robot or node, and its p-value, of one test.
    fn test(&self, column: &Column, one: Option<&One>) -> Option<(ScoreTest, f64)> {
        let Some(one) = one else {
            let test = self.tests.test(&self.sides.in_b(column), &[column])?;
            return Some((test, test.p_value));
        };
        self.at_one(column, self.rows_of(one)?)
    }

    /// P-value, times the number of tests, of a difference that raises the log likelihood by so much (nats) over the fit without it. The tests
    /// are those at the fit with it: how much rows depend on each other there adjusts the likelihood ratio (R. E. Chandler and
    /// S. Bate, Inference for clustered data using the independence loglikelihood, Biometrika 94, 2007). Beside it, how many times wider
    /// intervals are. None where the data are too few.
    #[must_use]
    pub(super) fn adjusted(&self, difference: &Difference, rise: f64) -> Option<(f64, f64)> {
        let (test, _) = self.test(&difference.column, difference.one.as_ref())?;
        let widening = widening(&test);
        let t = (2.0 * rise.max(0.0)).sqrt() / widening;
        let law = StudentsT::new(0.0, 1.0, test.freedom).ok()?;
        let least = libm::exp2(1.0 - test.n_clusters as f64);
        Some((difference.n_tests * (2.0 * law.sf(t)).max(least), widening))
    }

    fn rows_of(&self, One { key, id }: &One) -> Option<&[u32]> {
        let of_key = self.partitions.iter().find(|partition| partition.key == Some(*key))?;
        let group = of_key.groups.iter().find(|group| group.id == *id)?;
        Some(&group.rows)
    }

    /// Whether two effects move rows of B alike, beside all that was estimated: what errors of covariates decide between.
    #[must_use]
    pub(super) fn move_alike(&self, one: &Column, other: &Column) -> bool {
        let [one, other] = [one, other].map(|column| self.sides.in_b(column));
        self.tests.correlation(&one, &other).is_some_and(|it| SAME_COLUMNS <= it.abs())
    }

    /// The difference of a column on some rows, beside what the column does on all; and its p-value, of one test.
    fn at_one(&self, column: &Column, rows: &[u32]) -> Option<(ScoreTest, f64)> {
        let of_one = on_rows(column, rows);
        let there = self.sides.in_b(&of_one);
        let beside = [column, &of_one];
        let Some([in_time, in_pairs]) = &self.of_nodes else {
            let test = self.tests.test(&there, &beside)?;
            return Some((test, test.p_value));
        };
        let (in_time, in_pairs) = (in_time.test(&there, &beside)?, in_pairs.test(&there, &beside)?);
        let mut pairs: Vec<u32> = rows
            .iter()
            .filter(|row| self.sides.is_b[**row as usize])
            .map(|row| self.pairs[*row as usize])
            .collect();
        pairs.sort_unstable();
        pairs.dedup();
        let p_value = in_time.p_value.max(with_freedom(&in_pairs, pairs.len() as f64 - 1.0));
        let wider = [in_time, in_pairs];
        let wider = wider.into_iter().max_by(|a, b| a.standard_error.total_cmp(&b.standard_error));
        wider.map(|test| (test, p_value))
    }

    /// Effects that both campaigns together ask for, the most promising first.
    #[must_use]
    pub(super) fn in_both(&self, columns: &[(TermId, Column)]) -> Vec<InBoth> {
        let n_tests = columns.len() as f64;
        let of_column = |(term, column): &(TermId, Column)| {
            let test = self.tests.test(column, &[])?;
            (n_tests * test.p_value < FAMILY_ERROR)
                .then_some(InBoth { term: *term, rise: test.rise })
        };
        let mut found: Vec<InBoth> = columns.par_iter().filter_map(of_column).collect();
        found.sort_by(|a, b| b.rise.total_cmp(&a.rise).then(a.term.cmp(&b.term)));
        found.dedup_by_key(|both| both.term);
        found
    }

    /// Constants by which rows of B are off beyond those of A.
    #[must_use]
    pub(super) fn constants(&self, directions: &[Direction]) -> Constants {
        let n_rows = self.sides.is_b.len() as f64;
        let square = mean_square(self.rows);
        let n_groups: usize = self.partitions.iter().map(|partition| partition.groups.len()).sum();
        let n_tests = (directions.len() * (1 + n_groups)) as f64;
        let mut found = Constants::default();
        for direction in directions {
            let Direction { name, unit, column } = direction;
            let misfit = |of: Option<String>, test: &ScoreTest, p_value: f64| {
                (p_value < FAMILY_ERROR).then(|| Misfit {
                    what: (*name).to_owned(),
                    of,
                    off: test.amplitude,
                    unit,
                    standard_error: test.standard_error,
                    p_value,
                })
            };
            let n_b = self.sides.is_b.iter().filter(|is_b| **is_b).count() as f64;
            if let Some(test) = self.tests.test(&self.sides.in_b(column), &[column]) {
                let margin = (WORTH_SHARE * square * n_rows / n_b).sqrt();
                let p_value = 2.0 * directions.len() as f64 * test.p_value_beyond(margin);
                found.misfits.extend(misfit(None, &test, p_value.min(1.0)));
                found.everywhere.push((name, unit, test));
            }
            for partition in self.partitions.iter().filter(|it| it.key != Some(RUNS)) {
                for group in &partition.groups {
                    let there = group.rows.iter().filter(|row| self.sides.is_b[**row as usize]);
                    let margin = (WORTH_SHARE * square * n_rows / there.count() as f64).sqrt();
                    let Some((test, _)) = self.at_one(column, &group.rows) else { continue };
                    let p_value = 2.0 * n_tests * test.p_value_beyond(margin);
                    let of = format!("{} {}", partition.of, group.id);
                    found.misfits.extend(misfit(Some(of), &test, p_value.min(1.0)));
                }
            }
        }
        found.sd = (square / parts(self.rows)).sqrt();
        found.misfits.sort_by(|a, b| a.p_value.total_cmp(&b.p_value));
        found
    }
}

/// Constants by which B is off beyond A.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Constants {
    /// Beyond what is worth mentioning, the surest first.
    pub misfits: Vec<Misfit>,
    /// Of all rows of B: what is off, its unit, and the test.
    pub everywhere: Vec<(&'static str, &'static str, ScoreTest)>,
    /// Standard deviation of the residuals.
    pub sd: f64,
}

/// Whether a node stands in B where A has no measurements of it: most of its rows in B have an end at a new place. The level of a node
/// differs from place to place by shadowing, so that a change of the node is then not identifiable.
#[must_use]
pub(super) fn has_moved<S: Study>(study: &S, One { key, id }: &One, sides: &Sides) -> bool {
    let Some(ends) = study.dependence().nodes else { return false };
    let partitions = study.partitions();
    let of_key = partitions.iter().filter(|partition| partition.key == Some(*key));
    let mut groups = of_key.flat_map(|partition| &partition.groups);
    groups
        .find(|group| group.id == *id)
        .is_some_and(|group| is_mostly_new(&ends, &sides.is_b, &group.rows))
}

/// Whether most of these rows that are of B have an end that no row of A has. `ends`: the numbers of both ends of every row, of a node
/// that moves another number at each place.
fn is_mostly_new(ends: &[[u32; 2]], is_b: &[bool], rows: &[u32]) -> bool {
    let of_a = ends.iter().zip(is_b).filter(|(_, is_b)| !**is_b);
    let known: BTreeSet<u32> = of_a.flat_map(|(ends, _)| *ends).collect();
    let of_b: Vec<&[u32; 2]> =
        rows.iter().filter(|row| is_b[**row as usize]).map(|row| &ends[*row as usize]).collect();
    let is_new = |ends: &&&[u32; 2]| ends.iter().any(|end| !known.contains(end));
    of_b.len() < 2 * of_b.iter().filter(is_new).count()
}

/// How many times wider the standard error is than that of independent rows, at least 1. The rise of a step is half the square of the
/// amplitude in standard errors of independent rows.
fn widening(test: &ScoreTest) -> f64 {
    let independent = test.amplitude.abs() / (2.0 * test.rise).sqrt();
    let ratio = test.standard_error / independent;
    if ratio.is_finite() { ratio.max(1.0) } else { 1.0 }
}

/// The two-sided p-value of a test with at most so many degrees of freedom.
fn with_freedom(test: &ScoreTest, freedom: f64) -> f64 {
    if freedom < 1.0 {
        return 1.0;
    }
    let t = test.amplitude.abs() / test.standard_error;
    let law = StudentsT::new(0.0, 1.0, freedom.min(test.freedom));
    law.map_or(1.0, |law| 2.0 * law.sf(t)).max(test.p_value)
}

/// Mean squared error of all parts.
fn mean_square(rows: &Linearised) -> f64 {
    let squares = rows.errors.iter().flatten().filter(|error| error.is_finite());
    let n = rows.errors.iter().filter(|error| error[0].is_finite()).count() as f64;
    squares.map(|error| error * error).sum::<f64>() / n
}

/// Parts of which errors are known.
fn parts(rows: &Linearised) -> f64 {
    let known = |errors: &&[f64; 3]| errors[0].is_finite();
    let first = rows.errors.iter().find(known);
    first.map_or(1.0, |errors| errors.iter().filter(|error| error.is_finite()).count() as f64)
}

#[cfg(test)]
mod tests {
    use super::is_mostly_new;

    #[test]
    fn a_node_has_moved_where_most_of_its_rows_in_b_have_an_end_that_a_lacks() {
        // Nodes 0 to 3 in A; in B node 3 is at another place, which has the number 4.
        let ends = [[0, 1], [1, 2], [2, 3], [0, 1], [1, 2], [2, 4], [0, 4]];
        let is_b = [false, false, false, true, true, true, true];
        assert!(is_mostly_new(&ends, &is_b, &[2, 5, 6]));
        // Of node 2 one row of two is new, of node 1 none.
        assert!(!is_mostly_new(&ends, &is_b, &[1, 2, 4, 5]));
        assert!(!is_mostly_new(&ends, &is_b, &[0, 1, 3, 4]));
        assert!(!is_mostly_new(&ends, &is_b, &[0, 1]));
    }
}
