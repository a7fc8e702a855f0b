//! Effects that move what levels of nodes could move as well.

use super::search::{Search, with_term, without_term};
use crate::gain::Gain;
use crate::score_test::{ScoreTests, upper_tail};
use proto::effect::{CONSTANT, Level, Need};
use std::collections::{BTreeMap, BTreeSet};
use study::defects::node_place::NodeLevel;
use study::thresholds::{
    CATALOGUE_SHARE, FAMILY_ERROR, LEFT_BESIDE_NODES, TIED_ERRORS, TIED_NATS, WITHIN_RUNS,
};
use study::{COMMON, Study, TermId};

impl<S: Study> Search<'_, S> {
    /// The effect of a level for each node, if these data can hardly tell a term of a selection from it: of the information about the term
    /// less than [`LEFT_BESIDE_NODES`] is left beside a level for each sender and each receiver. None of a level of all links, which goes
    /// first.
    pub(super) fn levels_of_nodes(&self, term: TermId, accepted: &[TermId]) -> Option<TermId> {
        let candidates = self.study.candidates();
        let (levels, nodes) = self.nodes()?;
        let is_other = candidates[levels].is_tried()
            && levels != term
            && !accepted.contains(&levels)
            && candidates[term].linear_in != Some(CONSTANT);
        let columns = |others: &[TermId]| {
            let fit = self.full_fit(others, COMMON, None);
            Some((self.study.linearised(&fit)?, self.study.columns(&fit, term)))
        };
        let (rows, columns) = is_other.then(|| columns(&without_term(accepted, term)))??;
        let dependence = self.study.dependence();
        let tests = ScoreTests::new(&rows, &dependence);
        let left = columns.iter().filter_map(|column| tests.left_beside_nodes(column, &nodes));
        let most = left.max_by(f64::total_cmp)?;
        (most < LEFT_BESIDE_NODES).then_some(levels)
    }

    /// The effect of a level for each node, and sender and receiver of each row. None: rows are not of links.
    fn nodes(&self) -> Option<(TermId, Vec<[u32; 2]>)> {
        let of_levels = |term: TermId| Some((term, self.study.nodes_with_levels(term)?));
        self.study.candidates().ids().find_map(of_levels)
    }

    /// Terms with random levels and, about which they are, a level of all rows.
    pub(super) fn with_levels(&self, levels: TermId, others: &[TermId]) -> Vec<TermId> {
        let candidates = self.study.candidates();
        let is_of_all = |term: &TermId| {
            candidates[*term].linear_in == Some(CONSTANT)
                && candidates[*term].is_tried_beside(others)
                && !others.contains(term)
        };
        let of_all = candidates.ids().find(is_of_all);
        let terms = of_all.map_or_else(|| others.to_vec(), |term| with_term(others, term));
        with_term(&terms, levels)
    }

    /// The terms that are no random effects.
    pub(crate) fn without_random(&self, terms: &[TermId]) -> Vec<TermId> {
        let is_law = |term: &TermId| self.study.candidates()[*term].level != Level::Random;
        terms.iter().copied().filter(is_law).collect()
    }

    /// The node that has nearly all in common that a term of a selection moves, though most rows are of others: its own place or antenna
    /// may be the cause. None of what changes in time, is limited to nodes, or has a level of each.
    pub(crate) fn only_node_of(&self, term: TermId, accepted: &[TermId]) -> Option<u32> {
        let candidate = &self.study.candidates()[term];
        let (levels, nodes) = self.nodes()?;
        if candidate.level == Level::Time || candidate.only.is_some() || term == levels {
            return None;
        }
        // In a fit without the term, another random effect would absorb a part of what the term explains. Both fits are without any.
        let laws = self.without_random(&without_term(accepted, term));
        let [with, without] =
            [with_term(&laws, term), laws].map(|terms| self.full_fit(&terms, COMMON, None));
        let moved = self.study.prediction_difference(&with, &without)?.by_row;
        mostly_of_one(&nodes, &moved)
    }

    /// Whether nearly all that a term of places moves are rows at the beginnings of tracks, though most rows are elsewhere: what the state of
    /// a robot was before its log is not known.
    pub(crate) fn is_of_beginnings(&self, term: TermId, accepted: &[TermId]) -> bool {
        if self.study.candidates()[term].level != Level::Place {
            return false;
        }
        let moved = || {
            let is_first = self.study.beginnings()?;
            let [with, without] = [accepted.to_vec(), without_term(accepted, term)]
                .map(|terms| self.full_fit(&terms, COMMON, None));
            Some((is_first, self.study.prediction_difference(&with, &without)?.by_row))
        };
        moved().is_some_and(|(is_first, moved)| mostly_at(&is_first, &moved))
    }

    /// Whether a term of a selection follows the time or acts in a part of it, and yet has one value for each of several runs, in which more
    /// than the time may differ: another device, another bearing. None that acts in a part of the runs whose level stands out from the
    /// levels of the others.
    pub(crate) fn is_between_runs(&self, term: TermId, accepted: &[TermId]) -> bool {
        let candidate = &self.study.candidates()[term];
        let needs = candidate.about.map_or(&[][..], |about| about.needs);
        let is_limited = candidate.only.as_ref().is_some_and(|only| {
            ["runs", "from_s", "until_s"].iter().any(|key| only.contains_key(*key))
        });
        let follows_time = candidate.curve_over() == Some("time_s")
            || (needs.contains(&Need::Time)
                && !needs.iter().any(|it| matches!(it, Need::Column(_))));
        if !follows_time && !is_limited {
            return false;
        }
        // Another random effect would absorb a part of what the term explains.
        let laws = self.without_random(&without_term(accepted, term));
        let [with, without] =
            [with_term(&laws, term), laws].map(|terms| self.full_fit(&terms, COMMON, None));
        let Some(moved) = self.study.prediction_difference(&with, &without) else { return false };
        let runs = self.study.dependence().campaigns;
        let stands_out = || {
            let residuals = self.study.scanned_residuals(&without).components;
            let of_error = residuals.iter().find(|component| component.is_of_error);
            of_error.is_some_and(|it| stands_out(&runs, &it.standardised, &moved.by_row))
        };
        has_one_value(&runs, &moved.by_row) && (follows_time || !stands_out())
    }

    /// The other place of a node that explains as much as a term of a selection, as a clause: rows left out are predicted as well with the
    /// node there and without the term. None: no place does.
    pub(crate) fn place_instead_of(&self, term: TermId, accepted: &[TermId]) -> Option<String> {
        let candidates = self.study.candidates();
        // Random effects take the place of a level of all links, wherever a node stands.
        let accepted = if candidates[term].linear_in == Some(CONSTANT) {
            self.without_random(accepted)
        } else {
            accepted.to_vec()
        };
        let rest = without_term(&accepted, term);
        let laws = self.without_random(&rest);
        // What levels of nodes explain, a place must explain without them.
        let is_of_levels = self.study.nodes_with_levels(term).is_some();
        let level = if is_of_levels { NodeLevel::Zero } else { NodeLevel::Free };
        let (clause, study) = self.study.resurveyed(&self.full_fit(&laws, COMMON, None), level)?;
        let others = study.candidates();
        // What is limited to some rows has no other number there.
        let is_there = |other: &TermId| {
            others.ids().any(|id| id == *other && others[id].name == candidates[id].name)
        };
        if !rest.iter().all(is_there) {
            return None;
        }
        let elsewhere = Search::new(&study, self.report).held_out_scores(&rest, COMMON);
        let blocks = self.study.blocks(COMMON);
        let as_surveyed = self.held_out_scores(&accepted, COMMON);
        let gain = Gain::from_scores(&as_surveyed, &elsewhere, blocks.dependent());
        let is_better = TIED_ERRORS * gain.standard_error < gain.gain && TIED_NATS < gain.total();
        tracing::debug!(name = candidates[term].name, clause, ?gain, "or a place");
        (!is_better).then_some(clause)
    }

    /// Whether a term is a random effect that follows any curve of so many numbers. One of nodes that has no more levels than that does not:
    /// it is as simple.
    pub(super) fn follows_any_curve(&self, term: TermId, n_numbers: usize) -> bool {
        // Of two nodes, what one sends the other receives.
        let n_levels = |nodes: Vec<[u32; 2]>| {
            let of_end = |end: usize| nodes.iter().map(|ends| ends[end]).collect::<BTreeSet<u32>>();
            let n_ends = (0..2).map(|end| of_end(end).len()).sum::<usize>();
            n_ends.min(nodes.iter().collect::<BTreeSet<_>>().len())
        };
        self.study.candidates()[term].level == Level::Random
            && self.study.nodes_with_levels(term).is_none_or(|nodes| n_numbers < n_levels(nodes))
    }
}

/// The node at an end of rows that have [`CATALOGUE_SHARE`] of the squares of these numbers, and are fewer than half of all.
fn mostly_of_one(nodes: &[[u32; 2]], moved: &[f64]) -> Option<u32> {
    let mut of_node: BTreeMap<u32, [f64; 2]> = BTreeMap::new();
    let mut all = [0.0; 2];
    for (ends, moved) in nodes.iter().zip(moved).filter(|(_, moved)| moved.is_finite()) {
        let row = [moved * moved, 1.0];
        for node in ends {
            let sum = of_node.entry(*node).or_default();
            *sum = [sum[0] + row[0], sum[1] + row[1]];
        }
        all = [all[0] + row[0], all[1] + row[1]];
    }
    let is_alone = |sum: &[f64; 2]| CATALOGUE_SHARE * all[0] < sum[0] && 2.0 * sum[1] < all[1];
    of_node.into_iter().find(|(_, sum)| is_alone(sum)).map(|(node, _)| node)
}

/// Whether the rows marked have [`CATALOGUE_SHARE`] of the squares of these numbers, and are fewer than half of all.
fn mostly_at(is_marked: &[bool], moved: &[f64]) -> bool {
    let known = || is_marked.iter().zip(moved).filter(|(_, moved)| moved.is_finite());
    let add = |[sum, n]: [f64; 2], (_, moved): (&bool, &f64)| [sum + moved * moved, n + 1.0];
    let [all, n_all] = known().fold([0.0; 2], add);
    let [own, n_own] = known().filter(|(is_marked, _)| **is_marked).fold([0.0; 2], add);
    CATALOGUE_SHARE * all < own && 2.0 * n_own < n_all
}

/// Whether less than [`WITHIN_RUNS`] of the variation of these numbers is within runs, of which there are several.
fn has_one_value(runs: &[u32], moved: &[f64]) -> bool {
    let mut of_run: BTreeMap<u32, [f64; 3]> = BTreeMap::new();
    for (run, moved) in runs.iter().zip(moved).filter(|(_, moved)| moved.is_finite()) {
        let sums = of_run.entry(*run).or_default();
        *sums = [sums[0] + 1.0, sums[1] + moved, sums[2] + moved * moved];
    }
    let about_mean = |[n, sum, squares]: [f64; 3]| squares - sum * sum / n;
    let add = |all: [f64; 3], one: &[f64; 3]| [all[0] + one[0], all[1] + one[1], all[2] + one[2]];
    let all = about_mean(of_run.values().fold([0.0; 3], add));
    let within: f64 = of_run.values().map(|sums| about_mean(*sums)).sum();
    1 < of_run.len() && within < WITHIN_RUNS * all
}

/// Whether the mean residual of the runs that an effect moves differs from that of the others by more than runs differ by chance: Student's t
/// over the means of runs, with the spread within both groups in common, corrected for every run or moment that could have been chosen.
fn stands_out(runs: &[u32], residuals: &[f64], moved: &[f64]) -> bool {
    let mut of_run: BTreeMap<u32, [f64; 3]> = BTreeMap::new();
    let rows = runs.iter().zip(residuals).zip(moved);
    for ((run, residual), moved) in rows.filter(|((_, it), moved)| (**it + **moved).is_finite()) {
        let sums = of_run.entry(*run).or_default();
        *sums = [sums[0] + 1.0, sums[1] + residual, sums[2] + moved];
    }
    let means: Vec<[f64; 2]> =
        of_run.values().map(|[n, sum, moved]| [sum / n, moved / n]).collect();
    let most = means.iter().fold(0.0_f64, |most, [_, moved]| most.max(*moved));
    let group = |is_moved: bool| -> Vec<f64> {
        let own = means.iter().filter(|[_, moved]| (most < 2.0 * moved) == is_moved);
        own.map(|[mean, _]| *mean).collect()
    };
    let sums = |levels: &[f64]| {
        let n = levels.len() as f64;
        let mean = levels.iter().sum::<f64>() / n;
        [n, mean, levels.iter().map(|level| (level - mean) * (level - mean)).sum()]
    };
    let [[n_moved, moved, within_moved], [n_others, others, within_others]] =
        [true, false].map(|is_moved| sums(&group(is_moved)));
    let freedom = n_moved + n_others - 2.0;
    let variance = (within_moved + within_others) / freedom * (1.0 / n_moved + 1.0 / n_others);
    let t = (moved - others).abs() / variance.sqrt();
    let n_choices = 2.0 * (n_moved + n_others);
    t.is_finite() && 2.0 * n_choices * upper_tail(t, freedom) < FAMILY_ERROR
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_differs_between_runs_alone_is_told_from_what_varies_within_them() {
        let runs: Vec<u32> = (0..300).map(|row| row / 60).collect();
        let line: Vec<f64> = (0..300).map(f64::from).collect();
        assert!(!has_one_value(&runs, &line), "a line over five runs without pauses");
        let days: Vec<f64> =
            (0..300).map(|row| f64::from(row % 60 + 86_400 * (row / 60))).collect();
        assert!(has_one_value(&runs, &days), "a minute on each of five days");
        assert!(!has_one_value(&[0; 300], &line), "one run");
    }

    #[test]
    fn a_run_stands_out_where_the_others_are_alike_and_not_where_all_differ() {
        let runs: Vec<u32> = (0..240).map(|row| row / 20).collect();
        let moved: Vec<f64> = runs.iter().map(|run| if *run == 7 { 3.0 } else { 0.0 }).collect();
        let residuals = |spread: f64| -> Vec<f64> {
            let level = |run: u32| if run == 7 { 3.0 } else { spread * f64::from(run * 5 % 7) };
            (0..240).map(|row| level(row / 20) + if row % 2 == 0 { 1.0 } else { -1.0 }).collect()
        };
        assert!(stands_out(&runs, &residuals(0.05), &moved));
        assert!(!stands_out(&runs, &residuals(0.5), &moved));
        assert!(
            !stands_out(&runs[..140], &residuals(0.05)[..140], &moved[..140]),
            "not among them"
        );
        assert!(!stands_out(&[0; 240], &residuals(0.05), &moved), "one run");
    }

    #[test]
    fn what_moves_beginnings_alone_is_told_from_what_moves_others_too() {
        let is_first: Vec<bool> = (0..100).map(|row| row % 10 == 0).collect();
        let moved = |other: f64| -> Vec<f64> {
            is_first.iter().map(|is_first| if *is_first { 3.0 } else { other }).collect()
        };
        assert!(mostly_at(&is_first, &moved(0.1)));
        assert!(!mostly_at(&is_first, &moved(2.0)));
        assert!(!mostly_at(&[true; 100], &moved(0.1)));
    }

    #[test]
    fn what_moves_rows_of_one_node_alone_is_told_from_what_moves_others_too() {
        let nodes: Vec<[u32; 2]> = (0..600).map(|row| [row % 6, (row / 6 + 1 + row) % 6]).collect();
        let moved = |other: f64| -> Vec<f64> {
            nodes.iter().map(|ends| if ends.contains(&4) { 3.0 } else { other }).collect()
        };
        assert_eq!(mostly_of_one(&nodes, &moved(0.1)), Some(4));
        assert_eq!(mostly_of_one(&nodes, &moved(2.0)), None);
        // A node that has an end of each row.
        let star: Vec<[u32; 2]> = (0..600).map(|row| [4, row % 4]).collect();
        assert_eq!(mostly_of_one(&star, &moved(0.1)), None);
    }
}
