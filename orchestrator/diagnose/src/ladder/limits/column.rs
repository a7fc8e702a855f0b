//! What an effect does limited to a group of rows, or to a part of the time, by its column.

use super::{Proposal, promised_nats};
use crate::score_test::{ScoreTest, ScoreTests};
use statrs::distribution::{ContinuousCDF as _, StudentsT};
use study::TermId;
use study::linear::{Column, Dependence, Group, Linearised, Partition, on_rows};
use study::thresholds::{
    FAMILY_ERROR, FEWEST_COMPARED_GROUPS, FEWEST_OTHERS_PER_GROUP, LIMITED_NATS, TESTED_LIMITS,
    TIME_LIMIT_NATS, UNCORRECTED_LEVEL,
};

/// Moments at which something may have begun or ended that are tried first: so many quantiles of the times …
pub(super) const MOMENTS: usize = 12;
/// … and near the best of them so many more.
const FINE_MOMENTS: usize = 24;

/// What is tested.
pub(super) struct Asked<'a> {
    pub(super) rows: &'a Linearised,
    pub(super) tests: &'a ScoreTests<'a>,
    pub(super) dependence: &'a Dependence,
    pub(super) n_tests: f64,
    /// Rows that carry the information of one.
    pub(super) design_effect: f64,
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
    pub(super) fn of_groups(
        &self,
        term: TermId,
        column: &Column,
        partition: &Partition,
    ) -> Option<Proposal> {
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
        let mut sets: Vec<Vec<usize>> =
            promising.iter().take(TESTED_LIMITS).map(|(group, _)| vec![*group]).collect();
        if let ([(first, _), (second, _), ..], true) =
            (&promising[..], FEWEST_COMPARED_GROUPS <= columns.len())
        {
            // Two that are alike may have too few rows to be tested one by one.
            sets.push(vec![*first.min(second), *first.max(second)]);
        }
        let found = sets.into_iter().filter_map(|set| {
            let groups = || set.iter().map(|&group| &partition.groups[group]);
            let rows: Vec<u32> = groups().flat_map(|group| group.rows.iter().copied()).collect();
            let (mut found, amplitude) =
                self.of_time(term, &on_rows(column, &rows), Some(column))?;
            let ids = groups().map(|group| toml::Value::from(i64::from(group.id))).collect();
            found.only.insert(key.to_owned(), toml::Value::Array(ids));
            Some((set, found, amplitude))
        });
        let (set, found, own) = found.max_by(|a, b| a.1.rise.total_cmp(&b.1.rise))?;
        let amplitude = |column: &Column| Some(self.tests.test(column, &[])?.amplitude);
        let others = (0..columns.len())
            .filter(|other| !set.contains(other))
            .map(|other| amplitude(&columns[other]));
        let others: Vec<f64> = others.flatten().collect();
        stands_out(own, &others).then_some(found)
    }

    /// A column as it acts always, from a moment on or until one, with its amplitude. `beside`: what acts on all rows alike, always; none:
    /// the column.
    pub(super) fn of_time(
        &self,
        term: TermId,
        column: &Column,
        beside: Option<&Column>,
    ) -> Option<(Proposal, f64)> {
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
        Some((Proposal { term, only, rise: own.rise }, own.amplitude))
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

/// Whether an amplitude lies outside of what the others make likely, alone or together with few that lie nearest to it; of few groups
/// always.
fn stands_out(own: f64, others: &[f64]) -> bool {
    let n_groups = others.len() + 1;
    if n_groups < FEWEST_COMPARED_GROUPS {
        return true;
    }
    let mut others = others.to_vec();
    others.sort_by(|a, b| (b - own).abs().total_cmp(&(a - own).abs()));
    // Sets of so many groups of which this may be the one that lies furthest.
    let mut n_sets = 1.0;
    for n_alike in 0..(n_groups / FEWEST_OTHERS_PER_GROUP).max(1) {
        n_sets *= (n_groups - n_alike) as f64 / (n_alike + 1) as f64;
        let rest = &others[..others.len() - n_alike];
        let n = rest.len() as f64;
        let mean = rest.iter().sum::<f64>() / n;
        let squares: f64 = rest.iter().map(|other| (other - mean) * (other - mean)).sum();
        let t = (own - mean).abs() / (squares / (n - 1.0) * (1.0 + 1.0 / n)).sqrt();
        let p_value = StudentsT::new(0.0, 1.0, n - 1.0).map_or(1.0, |law| 2.0 * law.sf(t));
        if p_value * n_sets < UNCORRECTED_LEVEL {
            return true;
        }
    }
    false
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_or_two_of_seven_stand_out_and_one_of_many_that_differ_does_not() {
        let alike = [0.01, -0.02, 0.0, 0.03, -0.01];
        let with = |more: f64| [&alike[..], &[more]].concat();
        assert!(stands_out(1.0, &with(0.02)) && stands_out(1.0, &with(0.9)));
        assert!(!stands_out(0.04, &with(0.02)));
        assert!(!stands_out(1.0, &[-0.9, 0.7, 0.1, -0.3, 0.5, 0.8]));
    }
}
