//! A register that reads no less, or no more, than a certain reading.
//!
//! Weaker frames then read as the floor, so that readings pile up at the least of all. The pile is a defect if it is significant by
//! two binomial tests: against the share that the predictive distribution gives to this reading, and against the readings of the
//! next step, whatever the model. The second holds where the model is wrong: a smooth distribution does not end in a spike.
//! Both are made without the receiver that contributes most, so that one stuck receiver or one short link is no floor.

use super::evidence::{Evidence, binomial_p_value};
use super::{Correction, Defect};
use crate::Estimate;
use crate::thresholds::{FEWEST_LIMITED_LINKS, SMOOTH_END_SHARE};
use std::collections::{BTreeMap, BTreeSet};

/// Names of these kinds.
pub const FLOOR: &str = "register-floor";
/// The other end.
pub const CEILING: &str = "register-ceiling";
/// The step of readings that are not rounded (dB).
const STEP_DB: f64 = 1.0;
/// Readings lie between these (dBm).
const READINGS_DBM: [f64; 2] = [-300.0, 100.0];

/// Looks for a pile of readings at the least.
#[must_use]
pub fn floor(evidence: &Evidence<'_>) -> Option<Defect> {
    test(evidence, FLOOR, -1.0)
}

/// Looks for a pile of readings at the greatest.
#[must_use]
pub fn ceiling(evidence: &Evidence<'_>) -> Option<Defect> {
    test(evidence, CEILING, 1.0)
}

/// What one receiver contributes: readings, those at the end, those in the next step, and the sum of their shares by the model.
#[derive(Clone, Copy, Default)]
struct Counts {
    n: usize,
    n_end: usize,
    n_next: usize,
    by_model: f64,
}

impl Counts {
    fn and(self, other: &Self) -> Self {
        Self {
            n: self.n + other.n,
            n_end: self.n_end + other.n_end,
            n_next: self.n_next + other.n_next,
            by_model: self.by_model + other.by_model,
        }
    }

    /// The greater of the p-values of both tests.
    fn p_value(&self) -> f64 {
        let by_model = binomial_p_value(self.n_end, self.n, self.by_model / self.n as f64);
        by_model.max(binomial_p_value(self.n_end, self.n_end + self.n_next, SMOOTH_END_SHARE))
    }
}

/// `sign`: -1 for the least reading, 1 for the greatest.
fn test(evidence: &Evidence<'_>, name: &'static str, sign: f64) -> Option<Defect> {
    let rows = evidence.rows();
    // A register that the model bends piles readings up itself.
    if !evidence.has_single_frames() || evidence.study.has_bent_register(evidence.fit) {
        return None;
    }
    let end_dbm = evidence.received().map(|row| sign * rows[row].rssi_dbm).fold(f64::MIN, f64::max);
    let end_dbm = sign * end_dbm;
    let quantum_db = evidence.modelled().links.readings.quantum_db;
    let step_db = if 0.0 < quantum_db { quantum_db } else { STEP_DB };
    let mut receivers: BTreeMap<u32, Counts> = BTreeMap::new();
    let (mut at_end, mut links) = (Vec::new(), BTreeSet::new());
    for row in evidence.received() {
        let inward_db = sign * (end_dbm - rows[row].rssi_dbm);
        let counts = receivers.entry(rows[row].rx).or_default();
        counts.n += 1;
        if inward_db == 0.0 {
            counts.n_end += 1;
            at_end.push(row);
            links.insert((rows[row].tx, rows[row].rx));
        } else if inward_db <= step_db {
            counts.n_next += 1;
        }
        let (low, high) = (end_dbm - 0.5 * step_db, end_dbm + 0.5 * step_db);
        counts.by_model += evidence.probability_between(row, low, high);
    }
    if links.len() < FEWEST_LIMITED_LINKS {
        return None;
    }
    let all = receivers.values().fold(Counts::default(), Counts::and);
    let (&most, _) = receivers.iter().max_by_key(|(_, counts)| counts.n_end)?;
    // One stuck receiver, or one short link, is no limit of all registers.
    receivers.remove(&most);
    let rest = receivers.values().fold(Counts::default(), Counts::and);
    // A single receiver shows no limit that registers have in common.
    if rest.n == 0 {
        return None;
    }
    let share = all.n_end as f64 / all.n as f64;
    let (end, key, limits_dbm) = if sign < 0.0 {
        ("less", "floor_dbm", [end_dbm, READINGS_DBM[1]])
    } else {
        ("more", "ceiling_dbm", [READINGS_DBM[0], end_dbm])
    };
    Some(Defect {
        name,
        p_value: all.p_value().max(rest.p_value()),
        share,
        estimates: vec![Estimate::new(key, "dBm", end_dbm, (end_dbm, end_dbm))],
        nodes: Vec::new(),
        runs: Vec::new(),
        n_rows: at_end.len(),
        first_line: at_end.iter().map(|&row| rows[row].line).min()?,
        clause: format!(
            "registers read no {end} than {end_dbm} dBm ({:.1} % of the readings are {end_dbm})",
            100.0 * share
        ),
        correction: Correction {
            limits_dbm: Some(limits_dbm),
            refusal: Some(
                "readings at the end of the register say only how strong a frame is at least or at most; a file cannot hold that",
            ),
            ..Correction::default()
        },
    })
}

impl Counts {
    #[cfg(test)]
    fn of(n: usize, n_end: usize, n_next: usize, by_model: f64) -> Self {
        Self { n, n_end, n_next, by_model }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pile_must_exceed_the_model_and_the_next_step() {
        // 60 at the end where the model gives 20 of 1000, and 5 in the next step: both tests are clear.
        assert!(Counts::of(1000, 60, 5, 20.0).p_value() < 1e-4);
        // The model gives as many.
        assert!(0.1 < Counts::of(1000, 60, 20, 60.0).p_value());
        // The distribution is smooth: the next step has as many.
        assert!(0.1 < Counts::of(1000, 60, 60, 20.0).p_value());
    }
}
