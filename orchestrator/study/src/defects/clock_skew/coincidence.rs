//! Stamps of one receiver that coincide with those of the others only after a shift.

use super::super::evidence::binomial_p_value;
use crate::thresholds::{
    AMBIGUOUS_SHIFT_SHARE, COINCIDENCE_S, FEWEST_COINCIDENT_ROWS, LEAST_CLOCK_SHIFT_S,
    LEAST_COINCIDENT_SHARE, MOST_COINCIDENT_AS_IS, MOST_FRAME_SHIFT_S,
};
use measure::links::LinkRow;
use std::collections::BTreeMap;

/// A receiver whose stamps are shifted.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Coincidence {
    pub(super) node: u32,
    /// How late its stamps are (s), and the least and greatest of that over its rows.
    pub(super) shift_s: f64,
    pub(super) low_s: f64,
    pub(super) high_s: f64,
    pub(super) p_value: f64,
    /// For its rows a row of another receiver that has the same frame.
    pub(super) frames: BTreeMap<usize, usize>,
}

/// Rows of each run, sender and channel, by time.
type Frames = BTreeMap<(u32, u32, u8), Vec<(f64, usize)>>;

fn key(row: &LinkRow) -> (u32, u32, u8) {
    (row.run, row.tx, row.channel.unwrap_or(0))
}

/// The receiver whose stamps coincide best with those of others after a shift, if one does.
pub(super) fn best(rows: &[LinkRow]) -> Option<Coincidence> {
    let mut frames = Frames::new();
    let mut receivers: BTreeMap<u32, Vec<usize>> = BTreeMap::new();
    for (index, row) in rows.iter().enumerate().filter(|(_, row)| row.time_s.is_finite()) {
        frames.entry(key(row)).or_default().push((row.time_s, index));
        receivers.entry(row.rx).or_default().push(index);
    }
    for of_key in frames.values_mut() {
        of_key.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    }
    let n = receivers.len() as f64;
    let found = receivers.iter().filter_map(|(&node, own)| of_receiver(rows, &frames, node, own));
    let best = found.min_by(|a, b| a.p_value.total_cmp(&b.p_value))?;
    // Bonferroni over receivers.
    Some(Coincidence { p_value: (n * best.p_value).min(1.0), ..best })
}

/// Differences (s) of a receiver's stamps to frames of others: each with both rows, ascending.
fn differences(
    rows: &[LinkRow],
    frames: &Frames,
    node: u32,
    own: &[usize],
) -> Vec<(f64, usize, usize)> {
    let mut all = Vec::new();
    for &row in own {
        let Some(of_key) = frames.get(&key(&rows[row])) else { continue };
        let from =
            of_key.partition_point(|(at_s, _)| *at_s < rows[row].time_s - MOST_FRAME_SHIFT_S);
        let mut last_s = f64::NAN;
        for &(at_s, other) in &of_key[from..] {
            let late_s = rows[row].time_s - at_s;
            if late_s < -MOST_FRAME_SHIFT_S {
                break;
            }
            // Several receivers of one frame are one coincidence.
            if rows[other].rx != node && at_s != last_s {
                all.push((late_s, row, other));
                last_s = at_s;
            }
        }
    }
    all.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    all
}

fn of_receiver(rows: &[LinkRow], frames: &Frames, node: u32, own: &[usize]) -> Option<Coincidence> {
    if own.len() < FEWEST_COINCIDENT_ROWS {
        return None;
    }
    let all = differences(rows, frames, node, own);
    let n_own = own.len() as f64;
    let n_within = |at_s: f64| {
        let from = all.partition_point(|(late_s, ..)| *late_s < at_s - COINCIDENCE_S);
        let to = all.partition_point(|(late_s, ..)| *late_s <= at_s + COINCIDENCE_S);
        (from, to)
    };
    let (from, to) = n_within(0.0);
    // Stamps that coincide as they stand come from a clock that is right.
    if MOST_COINCIDENT_AS_IS * n_own < (to - from) as f64 {
        return None;
    }
    // Windows that begin at each difference.
    let window = |&(late_s, ..): &(f64, usize, usize)| {
        let at_s = late_s + COINCIDENCE_S;
        let (from, to) = n_within(at_s);
        (at_s, from, to)
    };
    let windows: Vec<(f64, usize, usize)> = all.iter().map(window).collect();
    let &(at_s, from, to) = windows.iter().max_by_key(|(_, from, to)| to - from)?;
    let n_hits = to - from;
    let is_as_good = |&(other_s, from, to): &(f64, usize, usize)| {
        4.0 * COINCIDENCE_S < (other_s - at_s).abs()
            && AMBIGUOUS_SHIFT_SHARE * n_hits as f64 <= (to - from) as f64
    };
    if (n_hits as f64) < LEAST_COINCIDENT_SHARE * n_own || windows.iter().any(is_as_good) {
        return None;
    }
    let hits = &all[from..to];
    let shift_s = hits[hits.len() / 2].0;
    if shift_s.abs() < LEAST_CLOCK_SHIFT_S {
        return None;
    }
    // Differences elsewhere are chance: so many in a window of this width, one begins at each.
    let width = 2.0 * COINCIDENCE_S / (2.0 * MOST_FRAME_SHIFT_S);
    let chance = (all.len() - n_hits) as f64 * width / n_own;
    let p_value = binomial_p_value(n_hits, own.len(), chance.max(width));
    Some(Coincidence {
        node,
        shift_s,
        low_s: hits[0].0,
        high_s: hits[hits.len() - 1].0,
        // Bonferroni over windows, of which one begins at each difference.
        p_value: (all.len() as f64 * p_value).min(1.0),
        frames: hits.iter().map(|&(_, row, other)| (row, other)).collect(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::folds::scramble;
    use crate::links::likelihood::tests::row;

    /// Frames of node 1 that 2, 3 and 4 log; the clock of 4 is late.
    fn log(late_s: f64, time_s: impl Fn(u64) -> f64) -> Vec<LinkRow> {
        let one = |k: u64, rx: u32| LinkRow {
            time_s: time_s(k) + if rx == 4 { late_s } else { 0.0 },
            rx,
            channel: Some(20),
            ..row(1.0, 1.0, -70.0)
        };
        (0..60).flat_map(|k| [one(k, 2), one(k, 3), one(k, 4)]).collect()
    }

    fn irregular(k: u64) -> f64 {
        20.0 * k as f64 + (scramble(k) % 1500) as f64 / 100.0
    }

    #[test]
    fn a_late_clock_is_told_by_the_frames_of_others() {
        let found = best(&log(6.0, irregular)).unwrap();
        assert_eq!(found.node, 4);
        assert!((found.shift_s - 6.0).abs() < 1e-9 && found.p_value < 1e-9, "{found:?}");
        assert_eq!(found.frames.len(), 60);
        let early = best(&log(-4.5, irregular)).unwrap();
        assert!((early.shift_s + 4.5).abs() < 1e-9);
    }

    #[test]
    fn clocks_that_agree_and_latencies_are_none() {
        assert_eq!(best(&log(0.0, irregular)), None);
        assert_eq!(best(&log(0.09, irregular)), None);
        assert!(best(&log(0.11, irregular)).is_some());
    }

    #[test]
    fn frames_at_equal_intervals_do_not_tell_which_is_which() {
        assert_eq!(best(&log(6.0, |k| 10.0 * k as f64)), None);
    }
}
