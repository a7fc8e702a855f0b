//! The clock of a receiver that is late or early, so that its readings stand with the positions of another time.
//!
//! Two tests, of which the first counts where it applies. Where several receivers log each frame, the stamps of one whose clock is
//! wrong coincide with those of the others only after a shift: the number of coincidences at the best shift is compared with chance by
//! the binomial law. Else, where the tracks of nodes are dense enough to be interpolated, the likelihood with positions of a
//! shifted time is compared with that of the rows as they stand, for each receiver and shift.

use super::evidence::Evidence;
use super::{Correction, Defect};
use crate::Estimate;
use crate::thresholds::{
    FEWEST_TRACKED_ROWS, LEAST_CLOCK_SHIFT_S, LEAST_TRACKED_SHARE, MOST_TRACK_SHIFT_S, STILL_M,
};
use measure::links::LinkRow;
use numbers::normal::FALL_90_NATS;
use std::collections::BTreeMap;

mod coincidence;
pub(super) mod tracks;

use coincidence::Coincidence;
use tracks::Tracks;

/// The name of this kind.
pub const NAME: &str = "clock-skew";
/// Shifts are tried in these steps (s), and about the best in finer steps.
const STEP_S: f64 = 0.5;
const FINE_S: f64 = 0.1;

/// Looks for a receiver whose clock is wrong.
#[must_use]
pub fn test(evidence: &Evidence<'_>) -> Option<Defect> {
    let rows = evidence.rows();
    if rows.iter().all(|row| row.time_s.is_nan()) {
        return None;
    }
    let tracks = Tracks::new(rows, STILL_M);
    match coincidence::best(rows) {
        Some(found) => by_coincidence(evidence, &tracks, &found),
        None => by_likelihood(evidence, &tracks),
    }
}

/// The defect that coincidences show, if positions are of the wrong time.
fn by_coincidence(evidence: &Evidence<'_>, tracks: &Tracks, found: &Coincidence) -> Option<Defect> {
    let rows = evidence.rows();
    let mut changed = rows.to_vec();
    let (mut replaced, mut left_out) = (Vec::new(), Vec::new());
    let mut is_moved = false;
    for (index, row) in rows.iter().enumerate().filter(|(_, row)| row.rx == found.node) {
        let frame = found.frames.get(&index).map(|&frame| &rows[frame]);
        let time_s = frame.map_or(row.time_s - found.shift_s, |frame| frame.time_s);
        let tx_m = frame.map(|frame| frame.tx_m).or_else(|| tracks.place(row.run, row.tx, time_s));
        let rx_m = tracks.place(row.run, row.rx, time_s);
        let (Some(tx_m), Some(rx_m)) = (tx_m, rx_m) else {
            left_out.push(index as u32);
            continue;
        };
        is_moved |= tracks::is_apart(tx_m, row.tx_m) || tracks::is_apart(rx_m, row.rx_m);
        changed[index] = LinkRow { time_s, tx_m, rx_m, ..*row };
        if frame.is_some() {
            changed[index].tx_heading_rad = rows[found.frames[&index]].tx_heading_rad;
        }
        replaced.push((index as u32, changed[index]));
    }
    // A clock error of nodes that all stand still changes no prediction.
    if !is_moved && left_out.is_empty() {
        return None;
    }
    let other = evidence.alternative(&changed, false)?;
    let removed = evidence.share_removed(&other, &|row| rows[row].rx == found.node);
    let share = removed.max(left_out.len() as f64 / rows.len() as f64);
    let interval = (found.low_s, found.high_s);
    let correction = Correction { replaced, left_out, ..Correction::default() };
    defect(rows, found.node, (found.shift_s, interval), (found.p_value, share), correction)
}

/// The defect of a node's clock. `shift`: how late it is (s), with its interval; `judged`: p-value and share.
fn defect(
    rows: &[LinkRow],
    node: u32,
    (shift_s, interval): (f64, (f64, f64)),
    (p_value, share): (f64, f64),
    correction: Correction,
) -> Option<Defect> {
    let concerned = || rows.iter().filter(|row| row.rx == node);
    let (late, size_s) = (if 0.0 < shift_s { "late" } else { "early" }, shift_s.abs());
    Some(Defect {
        name: NAME,
        p_value,
        share,
        estimates: vec![Estimate::new("shift_s", "s", shift_s, interval)],
        nodes: vec![node],
        runs: Vec::new(),
        n_rows: concerned().count(),
        first_line: concerned().map(|row| row.line).min()?,
        clause: format!("the clock of node {node} is {late} by {size_s:.2} s"),
        correction,
    })
}

/// The rows of all receivers at positions of a time so much earlier (s), where those can be interpolated, and which these are.
fn shifted(rows: &[LinkRow], tracks: &Tracks, shift_s: f64) -> (Vec<LinkRow>, Vec<bool>) {
    let one = |row: &LinkRow| {
        let time_s = row.time_s - shift_s;
        let place = |node| tracks.place(row.run, node, time_s);
        match (place(row.tx), place(row.rx)) {
            (Some(tx_m), Some(rx_m)) => (LinkRow { tx_m, rx_m, ..*row }, true),
            _ => (*row, false),
        }
    };
    rows.iter().map(one).unzip()
}

/// A shift with what it gains for each receiver (nats), and the p-value of that.
struct Shift {
    shift_s: f64,
    gains: BTreeMap<u32, (f64, f64)>,
}

/// What a shift gains for each receiver that has enough rows at known positions.
fn gains(evidence: &Evidence<'_>, tracks: &Tracks, shift_s: f64) -> Option<Shift> {
    let rows = evidence.rows();
    let (changed, is_known) = shifted(rows, tracks, shift_s);
    let other = evidence.alternative(&changed, false)?;
    let mut counts: BTreeMap<u32, (usize, usize)> = BTreeMap::new();
    for (row, &is_known) in rows.iter().zip(&is_known) {
        let count = counts.entry(row.rx).or_default();
        count.0 += 1;
        count.1 += usize::from(is_known);
    }
    let is_enough = |&(n, n_known): &(usize, usize)| {
        FEWEST_TRACKED_ROWS <= n_known && LEAST_TRACKED_SHARE * n as f64 <= n_known as f64
    };
    let gains = counts.iter().filter(|(_, count)| is_enough(count)).map(|(&node, _)| {
        (node, evidence.gain(&other, &|row| rows[row].rx == node && is_known[row]))
    });
    Some(Shift { shift_s, gains: gains.collect() })
}

/// The defect that the likelihood shows.
fn by_likelihood(evidence: &Evidence<'_>, tracks: &Tracks) -> Option<Defect> {
    if !tracks.can_shift() {
        return None;
    }
    let rows = evidence.rows();
    let n = (MOST_TRACK_SHIFT_S / STEP_S) as i32;
    let coarse = (-n..=n).filter(|&step| step != 0).map(|step| f64::from(step) * STEP_S);
    let coarse: Vec<Shift> = coarse.filter_map(|s| gains(evidence, tracks, s)).collect();
    let of = |shift: &Shift| {
        let best = shift.gains.iter().max_by(|a, b| a.1.0.total_cmp(&b.1.0));
        best.map(|(&node, &(gain, p_value))| (shift.shift_s, node, gain, p_value))
    };
    let (at_s, node, ..) = coarse.iter().filter_map(of).max_by(|a, b| a.2.total_cmp(&b.2))?;
    let fine = (-5..=5).map(|step| at_s + f64::from(step) * FINE_S);
    let fine: Vec<Shift> = fine.filter_map(|s| gains(evidence, tracks, s)).collect();
    let own = |shift: &Shift| Some((shift.shift_s, *shift.gains.get(&node)?));
    let (shift_s, (gain, p_value)) =
        fine.iter().filter_map(own).max_by(|a, b| a.1.0.total_cmp(&b.1.0))?;
    if gain <= 0.0 || shift_s.abs() < LEAST_CLOCK_SHIFT_S {
        return None;
    }
    // The shifts whose likelihood is within the fall of a 90 % interval, and half a step beyond.
    let near =
        coarse.iter().chain(&fine).filter_map(own).filter(|(_, (g, _))| gain - FALL_90_NATS <= *g);
    let (low, high) =
        near.fold((shift_s, shift_s), |(low, high), (s, _)| (low.min(s), high.max(s)));
    let interval = (low - FINE_S, high + FINE_S);
    let n_receivers = coarse.iter().map(|shift| shift.gains.len()).max().unwrap_or(1);
    // Bonferroni: each receiver was tested at each shift.
    let n_tests = (n_receivers * (coarse.len() + fine.len())) as f64;
    let (changed, is_known) = shifted(rows, tracks, shift_s);
    let other = evidence.alternative(&changed, false)?;
    let is_in = |row: usize| rows[row].rx == node;
    let share = evidence.share_removed(&other, &|row| is_in(row) && is_known[row]);
    let all = || (0..rows.len()).filter(|&row| is_in(row));
    let late = |row: usize| LinkRow { time_s: rows[row].time_s - shift_s, ..changed[row] };
    let correction = Correction {
        replaced: all().filter(|&row| is_known[row]).map(|row| (row as u32, late(row))).collect(),
        left_out: all().filter(|&row| !is_known[row]).map(|row| row as u32).collect(),
        ..Correction::default()
    };
    let judged = ((n_tests * p_value).min(1.0), share);
    defect(rows, node, (shift_s, interval), judged, correction)
}
