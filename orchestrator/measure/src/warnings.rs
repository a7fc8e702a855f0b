//! Warnings about measurements that can be used: what the warnings of links and of robots have in common. Each says what is
//! odd in the file, and what it does to an answer.

use super::{Rejected, TWICE};
use std::collections::BTreeSet;

/// A mote that is seen to go faster than this (m/s) between two moments has jumped.
pub(crate) const GREATEST_MPS: f64 = 150.0;
/// Jumps of less than this (m) are errors of positions.
pub(crate) const LEAST_JUMP_M: f64 = 2.0;
/// More rejected rows than this share are worth a warning.
const MANY_REJECTED: f64 = 0.1;

/// What rejected rows do to an answer.
#[must_use]
pub fn rejection_warnings(rejected: &[Rejected], n_rows: usize) -> Vec<String> {
    let mut warnings = Vec::new();
    if let Some(twice) = rejected.iter().find(|rejected| rejected.reason == TWICE) {
        warnings.push(format!(
            "{} rows are duplicates, the first on line {}. Each is counted once, because duplicates would make confidence \
             intervals too narrow",
            twice.rows, twice.first_line
        ));
    }
    let others: usize = rejected.iter().filter(|r| r.reason != TWICE).map(|r| r.rows).sum();
    if MANY_REJECTED * (n_rows as f64) < others as f64 {
        warnings.push(format!(
            "{others} of {n_rows} rows are unusable. If they have a common cause (weak frames, one robot, one day), the \
             answer applies to the remaining rows only"
        ));
    }
    warnings
}

/// The first few of a list, and how many there are beside.
pub(crate) fn first_few(motes: &BTreeSet<u32>) -> String {
    let mut text: Vec<String> = motes.iter().take(5).map(u32::to_string).collect();
    if text.len() < motes.len() {
        text.push(format!("{} more", motes.len() - text.len()));
    }
    text.join(", ")
}

/// Distance in the plane (m).
pub(crate) fn way_m(a: [f64; 3], b: [f64; 3]) -> f64 {
    libm::hypot(a[0] - b[0], a[1] - b[1])
}
