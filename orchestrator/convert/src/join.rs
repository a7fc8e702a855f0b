//! Rows of one log joined onto those of another, by time, node or both.

use crate::frame::Frame;
use crate::mapping::{Join, JoinKind};
use schemars::JsonSchema;
use serde::Serialize;
use std::collections::BTreeMap;

/// How an input was joined.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct JoinReport {
    /// Rows with a joined row, one per end of a link.
    pub matched: usize,
    /// Rows without one.
    pub unmatched: usize,
    /// Median time between a row and what was joined onto it (s); null where time plays no part.
    pub median_age_s: Option<f64>,
    /// Greatest such time (s).
    pub greatest_age_s: Option<f64>,
}

/// What was joined so far.
#[derive(Clone, Debug, Default)]
pub(crate) struct Joined {
    matched: usize,
    unmatched: usize,
    ages_ns: Vec<i64>,
}

impl Joined {
    pub(crate) fn report(mut self) -> JoinReport {
        self.ages_ns.sort_unstable();
        let seconds = |ns: Option<&i64>| ns.map(|&ns| ns as f64 / 1e9);
        JoinReport {
            matched: self.matched,
            unmatched: self.unmatched,
            median_age_s: seconds(self.ages_ns.get(self.ages_ns.len() / 2)),
            greatest_age_s: seconds(self.ages_ns.last()),
        }
    }
}

/// A row that is joined, or two with the weight of the second.
#[derive(Clone, Copy)]
pub(crate) struct Match {
    pub row: usize,
    pub next: usize,
    pub weight: f64,
    age_ns: i64,
}

/// Joins the columns of `other` onto `base`. Returns which rows of `base` have a match.
///
/// * `keys`: the columns of `base` and of `other` that must be equal, if any.
/// * `prefix`: put before the names of the joined columns.
pub(crate) fn join(
    base: &mut Frame,
    other: &Frame,
    how: Join,
    keys: Option<(&str, &str)>,
    prefix: &str,
    joined: &mut Joined,
) -> Vec<bool> {
    let key_of = |frame: &Frame, name: Option<&str>, row: usize| {
        name.and_then(|name| frame.column(name)).map_or(0, |column| column[row] as u64)
    };
    let mut candidates: BTreeMap<u64, Vec<(i64, usize)>> = BTreeMap::new();
    let times_ns = other.time_ns();
    for row in 0..other.n_rows() {
        let time_ns = times_ns.map_or(0, |times| times[row]);
        let key = key_of(other, keys.map(|(_, name)| name), row);
        candidates.entry(key).or_default().push((time_ns, row));
    }
    candidates.values_mut().for_each(|rows| rows.sort());
    let matches: Vec<Option<Match>> = (0..base.n_rows())
        .map(|row| {
            let rows = candidates.get(&key_of(base, keys.map(|(name, _)| name), row))?;
            match (base.time_ns(), times_ns) {
                (Some(times), Some(_)) => nearest(rows, times[row], how),
                // Where time plays no part, the last row holds.
                _ => rows.last().map(|&(_, row)| Match { row, next: row, weight: 0.0, age_ns: 0 }),
            }
        })
        .collect();
    let is_key = |name: &str| keys.is_some_and(|(_, key)| key == name);
    for (name, values) in other.columns.iter().filter(|(name, _)| !is_key(name)) {
        let column = matches
            .iter()
            .map(|matched| matched.map_or(f64::NAN, |matched| value(name, values, matched)));
        let name = format!("{prefix}{name}");
        // Several inputs may have the places of different nodes.
        match base.columns.iter_mut().find(|(known, _)| *known == name) {
            Some((_, known)) => {
                let empty = known.iter_mut().zip(column).filter(|(known, _)| known.is_nan());
                empty.for_each(|(known, value)| *known = value);
            }
            None => {
                let column = column.collect();
                base.columns.push((name, column));
            }
        }
    }
    for matched in &matches {
        match matched {
            Some(matched) => {
                joined.matched += 1;
                if times_ns.is_some() {
                    joined.ages_ns.push(matched.age_ns);
                }
            }
            None => joined.unmatched += 1,
        }
    }
    matches.iter().map(Option::is_some).collect()
}

/// The row of a list of times and rows, in order of time, that goes with a time, if it is near enough.
pub(crate) fn nearest(rows: &[(i64, usize)], time_ns: i64, how: Join) -> Option<Match> {
    let n_before = rows.partition_point(|&(time, _)| time <= time_ns);
    let age = |at: usize| rows.get(at).map(|&(time, row)| (time.abs_diff(time_ns), row));
    let within = |found: Option<(u64, usize)>| {
        found.filter(|&(age_ns, _)| age_ns <= how.within_ns.unsigned_abs())
    };
    let before = within(n_before.checked_sub(1).and_then(age));
    let after = within(age(n_before));
    let one = |(age_ns, row): (u64, usize)| Match {
        row,
        next: row,
        weight: 0.0,
        age_ns: i64::try_from(age_ns).unwrap_or(i64::MAX),
    };
    match how.kind {
        JoinKind::Latest => before.map(one),
        JoinKind::Nearest => before.into_iter().chain(after).min_by_key(|(age, _)| *age).map(one),
        JoinKind::Interpolated => match (before, after) {
            (Some((0, row)), _) => Some(one((0, row))),
            (Some((early_ns, row)), Some((late_ns, next))) => Some(Match {
                next,
                weight: early_ns as f64 / (early_ns as f64 + late_ns as f64),
                ..one((early_ns.max(late_ns), row))
            }),
            _ => None,
        },
    }
}

/// The value of a column at a match; angles are interpolated along the shorter arc.
pub(crate) fn value(name: &str, values: &[f64], matched: Match) -> f64 {
    let (from, to) = (values[matched.row], values[matched.next]);
    if matched.weight == 0.0 {
        return from;
    }
    let mut step = to - from;
    if name.ends_with("_rad") {
        let turn = 2.0 * std::f64::consts::PI;
        step -= turn * (step / turn).round();
    }
    from + matched.weight * step
}

#[cfg(test)]
mod tests {
    use super::*;

    const S: i64 = 1_000_000_000;

    fn frame(times_s: &[i64], columns: &[(&str, &[f64])]) -> Frame {
        let mut frame = Frame { lines: (2..2 + times_s.len()).collect(), ..Frame::default() };
        frame.times_ns.insert("time_s".to_owned(), times_s.iter().map(|time| time * S).collect());
        let own = |(name, values): &(&str, &[f64])| ((*name).to_owned(), values.to_vec());
        frame.columns = columns.iter().map(own).collect();
        frame
    }

    fn joined(kind: JoinKind, within_s: i64) -> (Vec<f64>, JoinReport) {
        let mut base = frame(&[0, 3, 5, 9, 40], &[]);
        let commands = frame(&[1, 4, 10], &[("heading_rad", &[3.0, -3.0, 1.0])]);
        let mut report = Joined::default();
        let how = Join { kind, within_ns: within_s * S };
        join(&mut base, &commands, how, None, "", &mut report);
        (base.column("heading_rad").unwrap().to_vec(), report.report())
    }

    #[test]
    fn the_command_in_force_is_the_latest_and_not_too_old() {
        let (values, report) = joined(JoinKind::Latest, 5);
        assert!(values[0].is_nan() && values[4].is_nan());
        assert_eq!(values[1..4], [3.0, -3.0, -3.0]);
        assert_eq!((report.matched, report.unmatched), (3, 2));
        assert_eq!((report.median_age_s, report.greatest_age_s), (Some(2.0), Some(5.0)));
    }

    #[test]
    fn the_nearest_row_may_come_later_and_angles_turn_the_short_way() {
        let (values, _) = joined(JoinKind::Nearest, 5);
        assert_eq!(values[..4], [3.0, -3.0, -3.0, 1.0]);
        let (values, _) = joined(JoinKind::Interpolated, 7);
        let expected = 3.0 + 2.0 / 3.0 * (2.0 * std::f64::consts::PI - 6.0);
        assert!((values[1] - expected).abs() < 1e-12, "{values:?}");
        assert!(values[0].is_nan());
    }

    #[test]
    fn nodes_find_their_own_places_and_unknown_ones_none() {
        let mut base = frame(&[0, 0], &[("tx", &[1.0, 2.0])]);
        let mut places = frame(&[], &[("node", &[1.0, 3.0]), ("x_m", &[7.0, 8.0])]);
        places.times_ns.clear();
        places.lines = vec![2, 3];
        let how = Join { kind: JoinKind::Latest, within_ns: S };
        let found =
            join(&mut base, &places, how, Some(("tx", "node")), "tx_", &mut Joined::default());
        assert_eq!(found, [true, false]);
        let x_m = base.column("tx_x_m").unwrap();
        assert!(x_m[0] == 7.0 && x_m[1].is_nan());
        // Places of other nodes, in another file, fill what is empty.
        let mut others = frame(&[], &[("node", &[1.0, 2.0]), ("x_m", &[70.0, 9.0])]);
        others.times_ns.clear();
        others.lines = vec![2, 3];
        join(&mut base, &others, how, Some(("tx", "node")), "tx_", &mut Joined::default());
        assert_eq!(base.column("tx_x_m"), Some(&[7.0, 9.0][..]));
        assert_eq!(base.columns.iter().filter(|(name, _)| name == "tx_x_m").count(), 1);
    }
}
