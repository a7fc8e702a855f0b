//! Rows that stand in the file twice.
//!
//! The reader leaves out every row that equals an earlier one in time, ends, channel, positions and outcome. Such a row is a duplicate
//! unless two frames of the same moment merely had the same outcome. How often two frames have the same outcome by chance is known
//! from the model, and from rows of one link that follow each other. The number of equal rows among all rows of the same
//! moment and link is compared with that chance by the binomial law.

use super::evidence::{Evidence, binomial_p_value};
use super::{Correction, Defect};
use crate::thresholds::{EQUAL_OUTCOME_CHANCES, FEWEST_CONSECUTIVE_PAIRS, UNROUNDED_STEP_DB};
use measure::TWICE;
use measure::links::LinkRow;
use std::collections::BTreeMap;

/// The name of this kind.
pub const NAME: &str = "duplicates";

/// Looks for rows that stand in the file twice.
#[must_use]
pub fn test(evidence: &Evidence<'_>) -> Option<Defect> {
    let links = &evidence.modelled().links;
    let twice = links.rejected.iter().find(|rejected| rejected.reason == TWICE)?;
    let n_equal = twice.rows;
    // The greater of both: the test errs towards finding nothing.
    let chance = chance_by_model(evidence).max(chance_by_rows(&links.rows).unwrap_or(0.0));
    let chance = chance.clamp(EQUAL_OUTCOME_CHANCES.0, EQUAL_OUTCOME_CHANCES.1);
    let n_trials = n_equal + n_of_same_moment(&links.rows);
    let share = n_equal as f64 / links.n_rows as f64;
    Some(Defect {
        name: NAME,
        p_value: binomial_p_value(n_equal, n_trials, chance),
        share,
        estimates: Vec::new(),
        nodes: Vec::new(),
        runs: Vec::new(),
        n_rows: n_equal,
        first_line: twice.first_line,
        clause: format!(
            "{n_equal} rows are duplicates of earlier rows ({:.1} % of the file)",
            100.0 * share
        ),
        // The reader has left them out.
        correction: Correction::default(),
    })
}

/// Where and when a row was measured, its outcome apart.
fn moment(row: &LinkRow) -> Vec<u64> {
    let place = [row.tx_m, row.rx_m].concat().into_iter().map(f64::to_bits);
    let ends = [row.run, row.tx, row.rx, u32::from(row.channel.unwrap_or(0))].map(u64::from);
    [row.time_s.to_bits(), row.frames.to_bits()].into_iter().chain(ends).chain(place).collect()
}

/// How many rows have an earlier row of the same moment and link, with another outcome.
fn n_of_same_moment(rows: &[LinkRow]) -> usize {
    let mut moments: BTreeMap<Vec<u64>, usize> = BTreeMap::new();
    for row in rows.iter().filter(|row| row.time_s.is_finite()) {
        *moments.entry(moment(row)).or_insert(0) += 1;
    }
    moments.values().map(|n| n - 1).sum()
}

/// The mean probability that two frames of a row have the same outcome, by the model. Two readings with normal noise lie within a step of
/// each other with a density of 1 / (2 sd √π).
fn chance_by_model(evidence: &Evidence<'_>) -> f64 {
    let quantum_db = evidence.modelled().links.readings.quantum_db.max(UNROUNDED_STEP_DB);
    let root = std::f64::consts::PI.sqrt();
    let one = |row: usize| {
        let passes = evidence.instrument.reception(&evidence.levels[row], evidence.intercept_db);
        let same_reading = (quantum_db / (2.0 * evidence.sd_db[row] * root)).min(1.0);
        passes * passes * same_reading + (1.0 - passes) * (1.0 - passes)
    };
    let n = evidence.levels.len();
    (0..n).map(one).sum::<f64>() / n as f64
}

/// How often two rows of a link that follow each other have the same outcome at the same places and on the same channel.
fn chance_by_rows(rows: &[LinkRow]) -> Option<f64> {
    let mut last: BTreeMap<Vec<u64>, (u64, u64)> = BTreeMap::new();
    let (mut n_pairs, mut n_same) = (0_usize, 0_usize);
    for row in rows {
        let key = moment(&LinkRow { time_s: 0.0, ..*row });
        let outcome = (row.rssi_dbm.to_bits(), row.received.to_bits());
        if let Some(before) = last.insert(key, outcome) {
            n_pairs += 1;
            n_same += usize::from(before == outcome);
        }
    }
    (FEWEST_CONSECUTIVE_PAIRS <= n_pairs).then(|| n_same as f64 / n_pairs as f64)
}
