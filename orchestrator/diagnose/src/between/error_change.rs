//! Whether the model of A predicts B as well as A itself: rows of A by fits to other blocks of A, rows of B by a fit to all of A.
//!
//! Means over blocks of rows are compared by Welch's t test: of log scores, whether B is predicted worse, and of squared errors, whether
//! they differ at all. Both together have the probability of the smaller p-value doubled.

use super::contrast::Sides;
use super::welch::{WeightedMean, WelchTest, welch};
use crate::json_number;
use crate::ladder::Search;
use proto::effect::Level;
use schemars::JsonSchema;
use serde::Serialize;
use std::collections::{BTreeMap, BTreeSet};
use study::folds::Blocks;
use study::thresholds::{FEWEST_CHANGE_BLOCKS, NEW_PLACES_SHARE};
use study::{COMMON, RowScore, Study, TermId};

/// How well the model of A predicts both campaigns.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct ErrorChange {
    /// Root mean squared error of A, on held-out rows (dB or m).
    #[serde(serialize_with = "json_number::serialize")]
    #[schemars(with = "Option<f64>")]
    pub rmse_a: f64,
    /// Root mean squared error of B, predicted by a fit to A (dB or m).
    #[serde(serialize_with = "json_number::serialize")]
    #[schemars(with = "Option<f64>")]
    pub rmse_b: f64,
    /// Log predictive density of A, on held-out rows (nats per row).
    #[serde(serialize_with = "json_number::serialize")]
    #[schemars(with = "Option<f64>")]
    pub log_score_a: f64,
    /// Log predictive density of B, predicted by a fit to A (nats per row).
    #[serde(serialize_with = "json_number::serialize")]
    #[schemars(with = "Option<f64>")]
    pub log_score_b: f64,
    /// Root mean squared error of B on held-out rows, by the model with all changes that were found (dB or m); null where none was.
    pub rmse_b_with_changes: Option<f64>,
    /// Log predictive density of the same (nats per row); null where no change was found.
    pub log_score_b_with_changes: Option<f64>,
    /// Probability of as great a change by chance: of B being predicted worse, or with another error.
    pub p_value: f64,
    /// The same where A is predicted at held-out places, if B was measured at places that A lacks; absent otherwise.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub p_value_new_places: Option<f64>,
}

impl ErrorChange {
    /// The greater p-value: below a level, the error changed whatever A is compared by.
    #[must_use]
    pub fn certain_p_value(&self) -> f64 {
        self.p_value_new_places.map_or(self.p_value, |places| places.max(self.p_value))
    }

    /// The smaller p-value: above a level, the error is the same whatever A is compared by.
    #[must_use]
    pub fn doubtful_p_value(&self) -> f64 {
        self.p_value_new_places.map_or(self.p_value, |places| places.min(self.p_value))
    }
}

/// Predicts held-out rows of B by a model with the changes that were found, beside the model of A.
pub(super) fn with_changes<S: Study>(
    error: &mut ErrorChange,
    search: &Search<'_, S>,
    terms: &[TermId],
    is_b: &[bool],
) {
    let scores = search.held_out_scores(terms, COMMON);
    let of_b = || scores.iter().zip(is_b).filter(|(_, is_b)| **is_b).map(|(score, _)| score);
    let mean = |value: fn(&RowScore) -> f64| {
        let known: Vec<f64> = of_b().map(value).filter(|value| value.is_finite()).collect();
        (!known.is_empty()).then(|| known.iter().sum::<f64>() / known.len() as f64)
    };
    error.rmse_b_with_changes = mean(|score| score.squared_error).map(f64::sqrt);
    error.log_score_b_with_changes = mean(|score| score.log);
}

/// Compares how a model that is fitted to A predicts A and B, of rows under conditions that both share. None where there are too few
/// blocks.
///
/// A model with random effects of places predicts known places better than new ones. Where B has new places, A is predicted at held-out
/// places, too.
pub(super) fn error_change<S: Study>(
    study: &S,
    search: &Search<'_, S>,
    terms: &[TermId],
    sides: &Sides,
) -> Option<ErrorChange> {
    let start = search.full_fit(terms, COMMON, None);
    let [all_a, all_b] = [false, true].map(|side| {
        let of_side =
            |row: &u32| sides.is_shared[*row as usize] && sides.is_b[*row as usize] == side;
        (0..study.n_rows() as u32).filter(of_side).collect::<Vec<u32>>()
    });
    let fit = study.fit(terms, &all_a, COMMON, Some(&start));
    let scores_b = study.scores(&fit, &all_b);
    let compared = |blocks: &Blocks, is_two_sided: bool| -> Option<ErrorChange> {
        let mut in_blocks = [BTreeMap::new(), BTreeMap::new()];
        let mut add = |campaign: usize, rows: &[u32], scores: &[RowScore]| {
            for (row, score) in rows.iter().zip(scores) {
                let block = blocks.dependent()[*row as usize];
                let of_block: &mut Vec<RowScore> = in_blocks[campaign].entry(block).or_default();
                of_block.push(*score);
            }
        };
        add(1, &all_b, &scores_b);
        for fold in 0..blocks.n_folds() {
            let (train, test) = blocks.split(fold);
            let [train, test] = [train, test].map(|rows| of_a(rows, sides));
            if !train.is_empty() && !test.is_empty() {
                let fit = study.fit(terms, &train, COMMON, Some(&fit));
                add(0, &test, &study.scores(&fit, &test));
            }
        }
        changed(&in_blocks, is_two_sided)
    };
    let mut error = compared(study.blocks(COMMON), true)?;
    let places = places(study);
    if has_new_places(places.dependent(), &sides.is_b) {
        // Some places of B are known from A: that it is predicted better there is no change. Without enough places, no change is certain.
        let of_places = compared(&places, false);
        error.p_value_new_places = Some(of_places.map_or(1.0, |places| places.p_value));
    }
    (!search.is_stopped()).then_some(error)
}

/// Blocks of places: of links the pairs of nodes, of which one that moves is another in every square of the plane.
fn places<S: Study>(study: &S) -> Blocks {
    let Some(nodes) = study.dependence().nodes else { return study.blocks(Level::Place).clone() };
    let key = |&[a, b]: &[u32; 2]| (u64::from(a.min(b)) << 32) | u64::from(a.max(b));
    Blocks::of_keys("places", &nodes.iter().map(key).collect::<Vec<_>>())
}

fn of_a(rows: Vec<u32>, sides: &Sides) -> Vec<u32> {
    let is_of_a = |row: &u32| sides.is_shared[*row as usize] && !sides.is_b[*row as usize];
    rows.into_iter().filter(is_of_a).collect()
}

/// Whether many rows of B lie in blocks without a row of A.
fn has_new_places(blocks: &[u32], is_b: &[bool]) -> bool {
    let of_a: BTreeSet<u32> =
        blocks.iter().zip(is_b).filter(|(_, is_b)| !**is_b).map(|(block, _)| *block).collect();
    let of_b = || blocks.iter().zip(is_b).filter(|(_, is_b)| **is_b).map(|(block, _)| block);
    let n_new = of_b().filter(|block| !of_a.contains(block)).count();
    NEW_PLACES_SHARE * (of_b().count() as f64) < n_new as f64
}

/// The scores of both campaigns by block, compared. `is_two_sided`: whether a smaller error of B counts, too.
fn changed(
    in_blocks: &[BTreeMap<u32, Vec<RowScore>>; 2],
    is_two_sided: bool,
) -> Option<ErrorChange> {
    let of = |value: fn(&RowScore) -> f64| {
        [0, 1].map(|campaign: usize| means(in_blocks[campaign].values(), value))
    };
    let [logs_a, logs_b] = of(|score| score.log);
    let [squares_a, squares_b] = of(|score| score.squared_error);
    let worse = welch(&logs_b, &logs_a, FEWEST_CHANGE_BLOCKS).map(WelchTest::lower_tail);
    let differs = if is_two_sided {
        welch(&squares_b, &squares_a, FEWEST_CHANGE_BLOCKS).map(WelchTest::two_sided)
    } else {
        welch(&squares_a, &squares_b, FEWEST_CHANGE_BLOCKS).map(WelchTest::lower_tail)
    };
    let p_value = [worse, differs].into_iter().flatten().fold(f64::NAN, f64::min);
    let mean = |means: &[WeightedMean]| {
        let n: f64 = means.iter().map(|mean| mean.n).sum();
        means.iter().map(|mean| mean.n * mean.value).sum::<f64>() / n
    };
    (!p_value.is_nan()).then(|| ErrorChange {
        rmse_a: mean(&squares_a).sqrt(),
        rmse_b: mean(&squares_b).sqrt(),
        log_score_a: mean(&logs_a),
        log_score_b: mean(&logs_b),
        rmse_b_with_changes: None,
        log_score_b_with_changes: None,
        p_value: (2.0 * p_value).min(1.0),
        p_value_new_places: None,
    })
}

fn means<'a>(
    blocks: impl Iterator<Item = &'a Vec<RowScore>>,
    value: fn(&RowScore) -> f64,
) -> Vec<WeightedMean> {
    let of_block = |scores: &Vec<RowScore>| {
        let known: Vec<f64> = scores.iter().map(value).filter(|v| v.is_finite()).collect();
        let n = known.len() as f64;
        (!known.is_empty()).then(|| WeightedMean { value: known.iter().sum::<f64>() / n, n })
    };
    blocks.filter_map(of_block).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_are_new_where_more_than_two_in_a_hundred_rows_are_elsewhere() {
        let of = |n_new: u32| {
            // A hundred rows of A at one place, a hundred of B, some of them at others.
            let blocks: Vec<u32> =
                (0..200).map(|row| if row < 200 - n_new { 0 } else { row }).collect();
            let is_b: Vec<bool> = (0..200).map(|row| 100 <= row).collect();
            has_new_places(&blocks, &is_b)
        };
        assert!(!of(0) && !of(2) && of(3));
    }

    #[test]
    fn an_error_is_certain_by_the_greater_p_value_and_doubtful_by_the_smaller() {
        let error = |p_value: f64, p_value_new_places: Option<f64>| ErrorChange {
            rmse_a: 1.0,
            rmse_b: 1.0,
            log_score_a: 0.0,
            log_score_b: 0.0,
            rmse_b_with_changes: None,
            log_score_b_with_changes: None,
            p_value,
            p_value_new_places,
        };
        let both = error(0.001, Some(0.2));
        assert_eq!((both.certain_p_value(), both.doubtful_p_value()), (0.2, 0.001));
        let one = error(0.001, None);
        assert_eq!((one.certain_p_value(), one.doubtful_p_value()), (0.001, 0.001));
    }

    #[test]
    fn a_smaller_error_of_b_counts_where_it_is_asked_for() {
        let score = |square: f64| RowScore {
            log: f64::NAN,
            squared_error: square,
            heading_squared_error_rad2: f64::NAN,
            log_of_position: f64::NAN,
            plain_squared_error: f64::NAN,
            crps: f64::NAN,
            reception_log_loss: f64::NAN,
        };
        let campaign = |more: f64| -> BTreeMap<u32, Vec<RowScore>> {
            (0..20).map(|block| (block, vec![score(more + f64::from(block % 5))])).collect()
        };
        let p_value = |a, b, is_two_sided| {
            changed(&[campaign(a), campaign(b)], is_two_sided).unwrap().p_value
        };
        assert!(p_value(3.0, 0.0, true) < 0.001 && p_value(0.0, 3.0, true) < 0.001);
        assert!(p_value(0.0, 3.0, false) < 0.001);
        assert_eq!(p_value(3.0, 0.0, false), 1.0);
    }
}
