//! Defects of measured links: what is wrong with the measurement rather than with the model.
//!
//! Each kind of defect has a file, and a test of its own against what a fitted model predicts. [`KINDS`] lists them.
//!
//! | module | what is wrong |
//! |---|---|
//! | [`channel_shift`] | labels of channels are shifted |
//! | [`clock_rate`] | places of a moving node are those of a clock that is late, or runs fast or slow |
//! | [`clock_skew`] | the clock of a receiver is late or early |
//! | [`duplicates`] | rows stand in the file twice |
//! | [`heading_convention`] | headings count from north, or clockwise |
//! | [`node_place`] | a node that stands still is elsewhere |
//! | [`outliers`] | some readings are grossly wrong |
//! | [`position_noise`] | positions of moving nodes are off |
//! | [`register_limits`] | the register reads no less, or no more, than a certain reading |
//! | [`stuck_node`] | a receiver reports one reading, whoever sends |
//! | [`swapped_ends`] | sender and receiver are exchanged |

pub mod channel_shift;
pub mod clock_rate;
pub mod clock_skew;
pub mod duplicates;
pub mod evidence;
pub mod heading_convention;
pub mod node_place;
pub mod outliers;
pub mod position_noise;
pub mod register_limits;
pub mod stuck_node;
pub mod swapped_ends;

use super::Estimate;
use crate::thresholds::{DEFECT_FAMILY_ERROR, DEFECT_WORTH_SHARE};
use evidence::Evidence;
use measure::links::LinkRow;

/// The name of a candidate begins with this where it is a defect of the measurement.
pub const PREFIX: &str = "measurement:";

/// A kind of defect.
#[derive(Clone, Copy, Debug)]
pub struct Kind {
    /// Its name: `register-floor`.
    pub name: &'static str,
    /// Looks for it. `None`: these measurements cannot show it, or show nothing of it.
    pub test: Test,
}

/// How a kind of defect is looked for.
#[derive(Clone, Copy, Debug)]
pub enum Test {
    /// In all rows.
    AllRows(fn(&Evidence<'_>) -> Option<Defect>),
    /// In the rows that no other defect concerns: whether each row is such a one is the second argument.
    UnaffectedRows(fn(&Evidence<'_>, &[bool]) -> Option<Defect>),
}

/// The kinds of defects.
pub const KINDS: &[Kind] = &[
    Kind { name: duplicates::NAME, test: Test::AllRows(duplicates::test) },
    Kind { name: register_limits::FLOOR, test: Test::AllRows(register_limits::floor) },
    Kind { name: register_limits::CEILING, test: Test::AllRows(register_limits::ceiling) },
    Kind { name: stuck_node::NAME, test: Test::AllRows(stuck_node::test) },
    Kind { name: clock_skew::NAME, test: Test::AllRows(clock_skew::test) },
    Kind { name: clock_rate::NAME, test: Test::AllRows(clock_rate::test) },
    Kind { name: heading_convention::NAME, test: Test::AllRows(heading_convention::test) },
    Kind { name: channel_shift::NAME, test: Test::AllRows(channel_shift::test) },
    Kind { name: swapped_ends::NAME, test: Test::AllRows(swapped_ends::test) },
    Kind { name: node_place::NAME, test: Test::AllRows(node_place::test) },
    Kind { name: position_noise::NAME, test: Test::AllRows(position_noise::test) },
    Kind { name: outliers::NAME, test: Test::UnaffectedRows(outliers::test) },
];

/// A defect of the measurement.
#[derive(Clone, Debug, PartialEq)]
pub struct Defect {
    /// The kind: `register-floor`.
    pub name: &'static str,
    /// Probability of as strong a sign without the defect, corrected for all nodes, runs and values that were tried.
    pub p_value: f64,
    /// The greater of two shares: of the rows concerned, and of the squared error of readings that the correction removes.
    pub share: f64,
    /// Its numbers with 90 % intervals, such as the floor (dBm) or the error of a clock (s).
    pub estimates: Vec<Estimate>,
    /// Nodes that it concerns; empty: all.
    pub nodes: Vec<u32>,
    /// Runs that it concerns; empty: all.
    pub runs: Vec<u32>,
    /// Number of rows concerned.
    pub n_rows: usize,
    /// Line of the first of them in the file.
    pub first_line: usize,
    /// What is wrong, as a clause: `the clock of node 4 is late by 6.0 s`.
    pub clause: String,
    /// How the measurements are corrected.
    pub correction: Correction,
}

/// How measurements are corrected.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Correction {
    /// Rows that are left out, ascending.
    pub left_out: Vec<u32>,
    /// Rows with other contents, ascending.
    pub replaced: Vec<(u32, LinkRow)>,
    /// The least and the greatest reading (dBm) of registers: what reads as these is taken for at most, or at least, as strong.
    pub limits_dbm: Option<[f64; 2]>,
    /// Why no corrected file can be written, if so.
    pub refusal: Option<&'static str>,
}

impl Correction {
    /// Whether nothing changes.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.left_out.is_empty() && self.replaced.is_empty() && self.limits_dbm.is_none()
    }

    /// Rows that are left out.
    #[must_use]
    pub fn leaving_out(mut rows: Vec<u32>) -> Self {
        rows.sort_unstable();
        rows.dedup();
        Self { left_out: rows, ..Self::default() }
    }

    /// Both corrections. Of a row that both replace, the second counts; a row that either leaves out is left out.
    #[must_use]
    pub fn and(&self, other: &Self) -> Self {
        let left_out = self.left_out.iter().chain(&other.left_out).copied().collect();
        let mut both = Self::leaving_out(left_out);
        let is_new = |row: u32| other.replaced.binary_search_by_key(&row, |(at, _)| *at).is_err();
        both.replaced = self.replaced.iter().filter(|(row, _)| is_new(*row)).copied().collect();
        both.replaced.extend(&other.replaced);
        both.replaced.sort_by_key(|(row, _)| *row);
        both.limits_dbm = match (self.limits_dbm, other.limits_dbm) {
            (Some([a, b]), Some([c, d])) => Some([a.max(c), b.min(d)]),
            (one, another) => one.or(another),
        };
        both.refusal = self.refusal.or(other.refusal);
        both
    }
}

/// The defects that are significant at [`DEFECT_FAMILY_ERROR`] after Holm's correction for all kinds, and that matter, in the order of
/// [`KINDS`]. `before`: what was corrected already; its rows are no outliers.
#[must_use]
pub fn found(evidence: &Evidence<'_>, before: &Correction) -> Vec<Defect> {
    let in_all = |kind: &Kind| match kind.test {
        Test::AllRows(test) => test(evidence),
        Test::UnaffectedRows(_) => None,
    };
    let mut tested: Vec<Defect> = KINDS.iter().filter_map(in_all).collect();
    let mut is_unaffected = vec![true; evidence.rows().len()];
    let significant_now = significant(tested.clone());
    let corrections = significant_now.iter().map(|defect| &defect.correction).chain([before]);
    for Correction { left_out, replaced, .. } in corrections {
        let concerned = left_out.iter().chain(replaced.iter().map(|(row, _)| row));
        concerned.for_each(|&row| is_unaffected[row as usize] = false);
    }
    let in_rest = |kind: &Kind| match kind.test {
        Test::AllRows(_) => None,
        Test::UnaffectedRows(test) => test(evidence, &is_unaffected),
    };
    tested.extend(KINDS.iter().filter_map(in_rest));
    for defect in &tested {
        let Defect { name, p_value, share, .. } = defect;
        tracing::debug!(name, p_value, share, clause = defect.clause, "tested");
    }
    one_clock_of_a_node(significant(tested))
}

/// Of two errors of one node's clock, the one that explains more: the other follows from it.
fn one_clock_of_a_node(found: Vec<Defect>) -> Vec<Defect> {
    let is_clock = |defect: &Defect| [clock_rate::NAME, clock_skew::NAME].contains(&defect.name);
    let is_beaten = |defect: &Defect| {
        is_clock(defect)
            && found.iter().any(|other| {
                is_clock(other) && other.nodes == defect.nodes && defect.share < other.share
            })
    };
    found.iter().filter(|defect| !is_beaten(defect)).cloned().collect()
}

/// Those of the tested defects that are significant and matter. A kind that was not testable counts as one that was tested.
fn significant(tested: Vec<Defect>) -> Vec<Defect> {
    let mut order: Vec<usize> = (0..tested.len()).collect();
    order.sort_by(|&a, &b| tested[a].p_value.total_cmp(&tested[b].p_value));
    let mut is_significant = vec![false; tested.len()];
    for (rank, &index) in order.iter().enumerate() {
        let n_left = (KINDS.len() - rank) as f64;
        // Holm's procedure steps down, and stops at the first test that fails.
        if DEFECT_FAMILY_ERROR / n_left < tested[index].p_value {
            break;
        }
        is_significant[index] = true;
    }
    let all = tested.into_iter().zip(is_significant);
    all.filter(|(defect, significant)| *significant && DEFECT_WORTH_SHARE <= defect.share)
        .map(|(defect, _)| defect)
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn defect(p_value: f64, share: f64) -> Defect {
        Defect {
            name: "register-floor",
            p_value,
            share,
            estimates: Vec::new(),
            nodes: Vec::new(),
            runs: Vec::new(),
            n_rows: 1,
            first_line: 2,
            clause: String::new(),
            correction: Correction::default(),
        }
    }

    #[test]
    fn defects_are_significant_by_holm_with_all_kinds_counted() {
        let n = KINDS.len() as f64;
        let found = |p_values: &[f64]| {
            significant(p_values.iter().map(|&p| defect(p, 1.0)).collect()).len()
        };
        assert_eq!(found(&[0.99 * DEFECT_FAMILY_ERROR / n]), 1);
        assert_eq!(found(&[1.01 * DEFECT_FAMILY_ERROR / n]), 0);
        // The second is compared with one kind less.
        assert_eq!(found(&[1.01 * DEFECT_FAMILY_ERROR / n, 0.99 * DEFECT_FAMILY_ERROR / n]), 2);
    }

    #[test]
    fn defects_matter_from_one_per_cent_on() {
        assert_eq!(significant(vec![defect(1e-9, 0.0101)]).len(), 1);
        assert_eq!(significant(vec![defect(1e-9, 0.0099)]).len(), 0);
    }

    #[test]
    fn of_two_errors_of_one_clock_the_one_that_explains_more_remains() {
        let of = |name, share, node| Defect { name, nodes: vec![node], ..defect(1e-9, share) };
        let (rate, skew) = (of(clock_rate::NAME, 0.4, 3), of(clock_skew::NAME, 0.2, 3));
        let elsewhere = of(clock_skew::NAME, 0.1, 5);
        let found = one_clock_of_a_node(vec![rate.clone(), skew, elsewhere.clone()]);
        assert_eq!(found, [rate, elsewhere]);
    }

    #[test]
    fn of_two_corrections_each_is_made() {
        let one =
            Correction { limits_dbm: Some([-90.0, 20.0]), ..Correction::leaving_out(vec![4, 2]) };
        let two =
            Correction { limits_dbm: Some([-200.0, -30.0]), ..Correction::leaving_out(vec![4]) };
        let both = one.and(&two);
        assert_eq!(both.left_out, [2, 4]);
        assert_eq!(both.limits_dbm, Some([-90.0, -30.0]));
        assert!(!both.is_empty() && Correction::default().is_empty());
    }
}
