//! Link samples summed up over periods: frames sent, share received, mean reading, by run, sender, receiver and channel.

use crate::account::Account;
use crate::frame::Frame;
use crate::tables::{Content, known};
use libm::{atan2, cos, sin};
use std::collections::BTreeMap;

/// Sums up the rows of a frame over periods.
///
/// * `period_ns`: at least 1. Without times, everything is one period.
///
/// A row's time is the mean over its frames, its reading the mean over those received, and any further column the mean over the rows
/// that have it; of headings, the direction of the mean vector.
pub(crate) fn aggregate(frame: &mut Frame, period_ns: i64, account: &mut Account<'_>) {
    frame.reject(account, |frame, row| {
        let received = frame.column("received")?[row];
        (received != 0.0 && received != 1.0).then(|| "received is not 0 or 1".to_owned())
    });
    let Some(received) = frame.take("received") else { return };
    frame.take("sequence");
    let times_ns = frame.time_ns().map_or_else(Vec::new, <[i64]>::to_vec);
    let key = |row: usize| {
        let bits = |name: &str| frame.column(name).map_or(0, |column| column[row].to_bits());
        let period = times_ns.get(row).map_or(0, |time_ns| time_ns.div_euclid(period_ns.max(1)));
        (bits("run"), period, bits("tx"), bits("rx"), bits("channel"))
    };
    let mut groups: BTreeMap<(u64, i64, u64, u64, u64), Vec<usize>> = BTreeMap::new();
    for row in 0..frame.n_rows() {
        groups.entry(key(row)).or_default().push(row);
    }
    let groups: Vec<Vec<usize>> = groups.into_values().collect();
    let mut columns: Vec<(String, Vec<f64>)> = Vec::new();
    for (name, values) in &frame.columns {
        let is_heading = known(name).is_some_and(|column| column.content == Content::Heading);
        let of_group = |rows: &Vec<usize>| {
            let counts = |row: &&usize| name != "rssi_dbm" || received[**row] == 1.0;
            let values = rows.iter().filter(counts).map(|&row| values[row]);
            let values: Vec<f64> = values.filter(|value| value.is_finite()).collect();
            if is_heading { direction(&values) } else { mean(&values) }
        };
        columns.push((name.clone(), groups.iter().map(of_group).collect()));
    }
    let count = |rows: &Vec<usize>| rows.len() as f64;
    let share =
        |rows: &Vec<usize>| rows.iter().map(|&row| received[row]).sum::<f64>() / count(rows);
    columns.push(("frames".to_owned(), groups.iter().map(count).collect()));
    columns.push(("pdr".to_owned(), groups.iter().map(share).collect()));
    for times in frame.times_ns.values_mut() {
        let of_group = |rows: &Vec<usize>| {
            let sum: i128 = rows.iter().map(|&row| i128::from(times[row])).sum();
            (sum / rows.len() as i128) as i64
        };
        *times = groups.iter().map(of_group).collect();
    }
    frame.lines = groups.iter().map(|rows| frame.lines[rows[0]]).collect();
    frame.columns = columns;
}

/// The mean; NaN of nothing. Of equal values it is that value: labels and channels stay as they are.
fn mean(values: &[f64]) -> f64 {
    match values.first() {
        Some(first) if values.iter().all(|value| value == first) => *first,
        _ => values.iter().sum::<f64>() / values.len() as f64,
    }
}

/// The direction of the mean vector (rad); NaN of nothing.
fn direction(angles: &[f64]) -> f64 {
    if angles.is_empty() {
        return f64::NAN;
    }
    let sums = angles.iter().fold((0.0, 0.0), |(s, c), &angle| (s + sin(angle), c + cos(angle)));
    atan2(sums.0, sums.1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    #[test]
    fn frames_of_a_link_and_channel_in_a_period_become_one_row() {
        const S: i64 = 1_000_000_000;
        let nan = f64::NAN;
        let columns: [(&str, [f64; 7]); 6] = [
            ("tx", [1.0, 1.0, 1.0, 1.0, 2.0, 1.0, 1.0]),
            ("rx", [0.0; 7]),
            ("channel", [11.0, 11.0, 11.0, 12.0, 11.0, 11.0, 11.0]),
            // A reading of a frame that was lost does not count.
            ("rssi_dbm", [-70.0, -73.0, -20.0, -80.0, nan, -60.0, -60.0]),
            ("received", [1.0, 1.0, 0.0, 1.0, 0.0, 1.0, 0.5]),
            ("tx_heading_rad", [3.1, -3.1, nan, 1.0, 1.0, 1.0, 1.0]),
        ];
        let mut frame = Frame { lines: (2..9).collect(), ..Frame::default() };
        let times_s = [0, 4, 5, 9, 1, 10, 11];
        frame.times_ns.insert("time_s".to_owned(), times_s.map(|time| time * S).to_vec());
        frame.columns =
            columns.iter().map(|(name, values)| ((*name).to_owned(), values.to_vec())).collect();
        let mut list = Vec::new();
        let mut account = Account { file: Path::new("x"), n_read: 0, rejected: &mut list };
        aggregate(&mut frame, 10 * S, &mut account);
        assert_eq!((list[0].rows, list[0].first_line), (1, 8));
        assert_eq!(frame.lines, [2, 5, 6, 7]);
        assert_eq!(frame.time_ns().unwrap(), [3 * S, 9 * S, S, 10 * S]);
        assert_eq!(frame.column("tx").unwrap(), [1.0, 1.0, 2.0, 1.0]);
        assert_eq!(frame.column("channel").unwrap(), [11.0, 12.0, 11.0, 11.0]);
        assert_eq!(frame.column("frames").unwrap(), [3.0, 1.0, 1.0, 1.0]);
        assert_eq!(frame.column("pdr").unwrap(), [2.0 / 3.0, 1.0, 0.0, 1.0]);
        let readings = frame.column("rssi_dbm").unwrap();
        assert!(readings[2].is_nan());
        assert_eq!([readings[0], readings[1], readings[3]], [-71.5, -80.0, -60.0]);
        // The mean of 3.1 and −3.1 rad points backwards.
        let heading = frame.column("tx_heading_rad").unwrap()[0];
        assert!((heading.abs() - std::f64::consts::PI).abs() < 1e-12, "{heading}");
        assert!(frame.column("received").is_none());
    }
}
