//! Where nodes were at any time, between the rows that tell.

use crate::thresholds::{MOST_TRACK_GAP_S, STILL_M};
use measure::links::LinkRow;
use std::collections::BTreeMap;

type Track = Vec<(f64, [f64; 3])>;

/// The track of each node in each run.
#[derive(Debug)]
pub(in crate::defects) struct Tracks {
    of_node: BTreeMap<(u32, u32), Track>,
    /// Between two rows that are further apart in time than [`MOST_TRACK_GAP_S`], a place is known if they are no further apart (m).
    most_gap_m: f64,
}

/// Whether two places differ.
pub(in crate::defects) fn is_apart(a: [f64; 3], b: [f64; 3]) -> bool {
    (0..3).any(|axis| STILL_M < (a[axis] - b[axis]).abs())
}

impl Tracks {
    pub(in crate::defects) fn new(rows: &[LinkRow], most_gap_m: f64) -> Self {
        let mut tracks: BTreeMap<(u32, u32), Track> = BTreeMap::new();
        for row in rows.iter().filter(|row| row.time_s.is_finite()) {
            for (node, place) in [(row.tx, row.tx_m), (row.rx, row.rx_m)] {
                if place[0].is_finite() && place[1].is_finite() {
                    tracks.entry((row.run, node)).or_default().push((row.time_s, place));
                }
            }
        }
        for track in tracks.values_mut() {
            track.sort_by(|a, b| a.0.total_cmp(&b.0));
            track.dedup_by(|a, b| a.0.total_cmp(&b.0).is_eq());
        }
        Self { of_node: tracks, most_gap_m }
    }

    /// Where a node was at a time, on the straight line between two rows; `None`: nobody tells.
    pub(in crate::defects) fn place(&self, run: u32, node: u32, time_s: f64) -> Option<[f64; 3]> {
        let track = self.of_node.get(&(run, node))?;
        let index = track.partition_point(|(at_s, _)| *at_s < time_s);
        // Before the first row and after the last a node is known only if it never moves.
        let (before, after) = if index == 0 || index == track.len() {
            let first = track.first()?;
            let is_still = track.iter().all(|(_, place)| !is_apart(*place, first.1));
            return is_still.then_some(first.1);
        } else {
            (&track[index - 1], &track[index])
        };
        let gap_s = after.0 - before.0;
        let gap_m = libm::hypot(after.1[0] - before.1[0], after.1[1] - before.1[1]);
        if MOST_TRACK_GAP_S < gap_s && self.most_gap_m < gap_m {
            return None;
        }
        let part = (time_s - before.0) / gap_s;
        Some(std::array::from_fn(|axis| before.1[axis] + part * (after.1[axis] - before.1[axis])))
    }

    /// The mean speed of a node between its rows (m/s); none where it never moves.
    pub(in crate::defects) fn speed_mps(&self, node: u32) -> Option<f64> {
        let own = self.of_node.iter().filter(|((_, of), _)| *of == node);
        let steps = own.flat_map(|(_, track)| track.windows(2));
        let (way_m, time_s) = steps.fold((0.0, 0.0), |(way_m, time_s), pair| {
            let [(from_s, from), (to_s, to)] = [pair[0], pair[1]];
            (way_m + libm::hypot(to[0] - from[0], to[1] - from[1]), time_s + to_s - from_s)
        });
        (0.0 < way_m).then(|| way_m / time_s)
    }

    /// Whether some node moves whose places at other times are known.
    pub(in crate::defects) fn can_shift(&self) -> bool {
        self.of_node.values().any(|track| {
            let near = |pair: &&[(f64, [f64; 3])]| {
                pair[1].0 - pair[0].0 <= MOST_TRACK_GAP_S && is_apart(pair[0].1, pair[1].1)
            };
            track.len() < 4 * track.windows(2).filter(near).count()
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::links::likelihood::tests::row;

    #[test]
    fn places_are_known_between_rows_that_are_near_in_time() {
        let at = |time_s: f64, x_m: f64| LinkRow {
            time_s,
            tx_m: [x_m, 0.0, 1.0],
            rx_m: [0.0; 3],
            ..row(1.0, 1.0, -70.0)
        };
        let rows = [at(0.0, 0.0), at(1.5, 3.0), at(3.1, 6.0)];
        let tracks = Tracks::new(&rows, STILL_M);
        assert_eq!(tracks.place(0, 1, 0.5), Some([1.0, 0.0, 1.0]));
        // The next gap is longer, the end of the track is past, the receiver stands still.
        assert_eq!(tracks.place(0, 1, 2.0), None);
        assert!(Tracks::new(&rows, 3.0).place(0, 1, 2.0).is_some());
        assert_eq!(tracks.place(0, 1, 3.2), None);
        assert_eq!(tracks.place(0, 2, 2.0), Some([0.0; 3]));
        assert_eq!(tracks.place(0, 2, 9.0), Some([0.0; 3]));
    }
}
