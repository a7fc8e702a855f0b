//! Columns that follow from others: times from the start, differences of counters, delivery ratios; and rows that say nothing new.

use crate::account::Account;
use crate::frame::{Frame, NO_TIME};
use crate::mapping::{Mapping, Start};
use crate::sequence::{self, Counting, Gap, Gaps, MODULUS_OF_PACKETS, Numbered, SequenceGaps};
use crate::tables::TableKind;
use measure::table::DataTable;
use measure::time_of_day;
use proto::bounds::ROWS;
use std::collections::{BTreeMap, BTreeSet};

/// Times from here on (ns) are taken for epoch times: March 1973. No campaign lasts that long.
const EPOCH_NS: i64 = 100_000_000_000_000_000;

/// Makes times count from the start. The epoch time of the start (s) goes into a column, NaN where the log does not state it.
pub(crate) fn start_at_zero(frame: &mut Frame, start: Start, account: &mut Account<'_>) {
    let start_ns = subtract_start(frame, start, account).filter(|start_ns| EPOCH_NS <= *start_ns);
    if frame.column(time_of_day::START).is_none() {
        // The fraction apart: all nanoseconds since 1970 are more than a double holds.
        const NS_PER_S: i64 = 1_000_000_000;
        let seconds = |ns: i64| (ns / NS_PER_S) as f64 + (ns % NS_PER_S) as f64 / 1e9;
        let start_s = start_ns.map_or(f64::NAN, seconds);
        frame.columns.push((time_of_day::START.to_owned(), vec![start_s; frame.n_rows()]));
    }
}

/// Makes times count from the start, and returns it (ns). None where times stay as they are.
fn subtract_start(frame: &mut Frame, start: Start, account: &mut Account<'_>) -> Option<i64> {
    let start_ns = match (start, frame.start_ns) {
        (Start::AsWritten, _) => return None,
        (Start::At(start_ns), _) | (Start::Automatic, Some(start_ns)) => start_ns,
        (Start::Automatic, None) => {
            if !reject_unset_clock(frame, account) && !frame.is_of_day {
                return None;
            }
            frame.time_ns()?.iter().copied().min().unwrap_or(0)
        }
    };
    frame.reject(account, |frame, row| {
        (frame.time_ns()?[row] < start_ns).then(|| "time_s is before the start".to_owned())
    });
    for times in frame.times_ns.values_mut() {
        for time_ns in times.iter_mut().filter(|time_ns| **time_ns != NO_TIME) {
            *time_ns = time_ns.saturating_sub(start_ns);
        }
    }
    Some(start_ns)
}

/// Rejects times before the epoch if most are epoch times. Returns whether they are.
pub(crate) fn reject_unset_clock(frame: &mut Frame, account: &mut Account<'_>) -> bool {
    let mut sorted = frame.time_ns().map_or_else(Vec::new, <[i64]>::to_vec);
    sorted.sort_unstable();
    let is_epoch = sorted.get(sorted.len() / 2).is_some_and(|&median| EPOCH_NS <= median);
    if is_epoch {
        frame.reject(account, |frame, row| {
            let is_early = frame.time_ns()?[row] < EPOCH_NS;
            is_early.then(|| {
                "time_s is before 1973, while most times are later: the clock was not set"
                    .to_owned()
            })
        });
    }
    is_epoch
}

/// Sender, receiver and channel of a row.
fn link_of(frame: &Frame, row: usize) -> [u64; 3] {
    ["tx", "rx", "channel"].map(|name| frame.column(name).map_or(0, |column| column[row].to_bits()))
}

/// Replaces counters that count from the start of the log by their differences from row to row of a link and channel.
pub(crate) fn differences(frame: &mut Frame, account: &mut Account<'_>) {
    let mut last: BTreeMap<[u64; 3], usize> = BTreeMap::new();
    let mut order: Vec<usize> = (0..frame.n_rows()).collect();
    if let Some(times_ns) = frame.time_ns() {
        order.sort_by_key(|&row| times_ns[row]);
    }
    let mut before: Vec<Option<usize>> = vec![None; frame.n_rows()];
    for row in order {
        before[row] = last.insert(link_of(frame, row), row);
    }
    const COUNTERS: [&str; 2] = ["frames", "received_frames"];
    let counters: Vec<(&str, Vec<f64>)> =
        COUNTERS.iter().filter_map(|name| Some((*name, frame.column(name)?.to_vec()))).collect();
    for (name, counts) in &counters {
        let difference =
            |row: usize| before[row].map_or(f64::NAN, |last| counts[row] - counts[last]);
        let differences = (0..counts.len()).map(difference).collect();
        frame.take(name);
        frame.columns.push(((*name).to_owned(), differences));
    }
    frame.reject(account, |frame, row| {
        if before[row].is_none() {
            return Some(
                "it is the first count of its link, from which the next one is subtracted"
                    .to_owned(),
            );
        }
        let values = COUNTERS.map(|name| frame.column(name).map_or(0.0, |column| column[row]));
        if values.iter().any(|value| *value < 0.0) {
            return Some(
                "a counter decreased: the node restarted, or the counter is full".to_owned(),
            );
        }
        (values[0] == 0.0).then(|| "no frame was sent since the row before".to_owned())
    });
}

/// Computes the delivery ratio from counts.
pub(crate) fn delivery_ratio(frame: &mut Frame, account: &mut Account<'_>) {
    let Some(received) = frame.take("received_frames") else { return };
    let Some(sent) = frame.column("frames") else { return };
    let ratio = |(received, sent): (&f64, &f64)| received / sent;
    let pdr: Vec<f64> = received.iter().zip(sent).map(ratio).collect();
    frame.columns.push(("pdr".to_owned(), pdr));
    frame.reject(account, |frame, row| {
        let is_more = 1.0 < frame.column("pdr")?[row];
        is_more.then(|| "more frames were received than sent".to_owned())
    });
}

/// Rejects rows whose sequence number is none.
///
/// * `modulus`: numbers are below it, if the mapping states it.
pub(crate) fn reject_numbers(frame: &mut Frame, modulus: Option<u64>, account: &mut Account<'_>) {
    frame.reject(account, |frame, row| {
        let sequence = frame.column("sequence")?[row];
        let is_count = sequence.fract() == 0.0 && (0.0..=f64::from(u32::MAX)).contains(&sequence);
        if sequence.is_finite() && !is_count {
            return Some("sequence is not a whole number".to_owned());
        }
        let is_above = modulus.is_some_and(|modulus| modulus as f64 <= sequence);
        is_above.then(|| "sequence is not below sequence_modulus".to_owned())
    });
}

/// The numbered packet or frame of a row.
pub(crate) fn numbered(frame: &Frame, sequence: &[f64], row: usize) -> Numbered {
    Numbered {
        created_ns: frame.time_ns().map_or(0, |times| times[row]),
        sequence: sequence[row] as u32,
        row,
        line: frame.lines[row],
    }
}

/// Rejects packets that arrived before, and finds gaps in the sequence numbers of each source.
///
/// * `modulus`: as the mapping states it.
pub(crate) fn sequence_gaps(
    frame: &mut Frame,
    run: u32,
    modulus: Option<u64>,
    account: &mut Account<'_>,
) -> Vec<(SequenceGaps, Gaps)> {
    let mut seen = BTreeSet::new();
    let is_new: Vec<bool> = (0..frame.n_rows())
        .map(|row| {
            let number = |name: &str| frame.column(name).map_or(f64::NAN, |column| column[row]);
            let time_ns = frame.time_ns().map_or(0, |times| times[row]);
            let key = (number("source").to_bits(), number("sequence").to_bits(), time_ns);
            number("sequence").is_nan() || seen.insert(key)
        })
        .collect();
    frame.reject(account, |_, row| {
        (!is_new[row]).then(|| {
            "the packet arrived before: source, sequence number and creation time are equal"
                .to_owned()
        })
    });
    reject_numbers(frame, modulus, account);
    let mut by_source: BTreeMap<u32, Vec<Numbered>> = BTreeMap::new();
    let sequence = frame.column("sequence").unwrap_or_default();
    for row in (0..sequence.len()).filter(|&row| sequence[row].is_finite()) {
        let source = frame.column("source").map_or(f64::NAN, |column| column[row]);
        by_source.entry(source as u32).or_default().push(numbered(frame, sequence, row));
    }
    let counting = Counting { modulus: modulus.unwrap_or(MODULUS_OF_PACKETS), period_ns: None };
    let of_source = |(source, mut packets): (u32, Vec<Numbered>)| {
        packets.sort_by_key(|packet| (packet.created_ns, packet.sequence));
        let found = sequence::gaps(&packets, counting);
        let counts = SequenceGaps {
            run,
            source,
            receiver: None,
            arrived: packets.len(),
            missing: found.n_missing(),
            restarts: found.restarts,
            first_line: found.gaps.first().map_or(0, |gap| gap.after.line),
        };
        (counts, found)
    };
    by_source.into_iter().map(of_source).collect()
}

/// Adds a row for every packet that is missing in a gap: a lost packet.
///
/// It has the source, the destination and the sequence number of the packets around it, and an interpolated creation time. Every other
/// column is empty. Its line is that of the packet after the gap.
///
/// # Errors
///
/// The table would have more rows than a table may have.
pub(crate) fn add_lost_packets(
    frame: &mut Frame,
    gaps: &[(SequenceGaps, Gaps)],
) -> Result<usize, String> {
    let n_lost: usize = gaps.iter().map(|(counts, _)| counts.missing).sum();
    ROWS.check((frame.n_rows() + n_lost) as u64)?;
    for (counts, found) in gaps {
        for packet in found.gaps.iter().flat_map(Gap::missing) {
            frame.lines.push(packet.line);
            for (name, times_ns) in &mut frame.times_ns {
                times_ns.push(if name == "time_s" { packet.created_ns } else { NO_TIME });
            }
            for (name, values) in &mut frame.columns {
                values.push(match name.as_str() {
                    "source" => f64::from(counts.source),
                    "destination" => values[packet.row],
                    "sequence" => f64::from(packet.sequence),
                    _ => f64::NAN,
                });
            }
        }
    }
    Ok(n_lost)
}

/// Removes the channels if some rows have none: periods of a link would otherwise have one row for each channel, and one for the lost
/// frames whose channel is unknown. Returns a warning about it.
pub(crate) fn drop_partial_channels(frame: &mut Frame) -> Option<String> {
    let channels = frame.column("channel")?;
    let n_unknown = channels.iter().filter(|channel| channel.is_nan()).count();
    (0 < n_unknown && n_unknown < channels.len()).then(|| {
        frame.take("channel");
        format!(
            "the channels of {n_unknown} frames are not known, so the rows of each period are sums over all channels"
        )
    })
}

/// Whether the frames that were lost are in a table of links; `None`: unknown, or another table.
pub(crate) fn losses_logged(
    columns: &[(String, Vec<f64>)],
    mapping: &Mapping,
    warnings: &mut Vec<String>,
) -> Option<bool> {
    let stated = mapping.are_losses_logged();
    let is_lost = |(name, values): &(String, Vec<f64>)| match name.as_str() {
        "received" => values.contains(&0.0),
        "pdr" => values.iter().any(|&pdr| pdr < 1.0),
        _ => false,
    };
    let has_lost = columns.iter().any(is_lost);
    match stated {
        Some(false) if has_lost => {
            warnings.push(
                "losses = \"not-logged\", but the table has lost frames, so it does not state it"
                    .to_owned(),
            );
            None
        }
        None if mapping.table == TableKind::Links && !has_lost => {
            warnings.push(
                "every frame was received, and neither sequence numbers nor counts show what was sent. State losses = \"not-logged\" if only \
                 frames that were received are in the log, otherwise losses = \"logged\""
                    .to_owned(),
            );
            None
        }
        stated => stated,
    }
}

/// A warning if delivery ratios look like a fraction of a fraction.
pub(crate) fn small_ratios(table: &DataTable) -> Option<String> {
    /// Fewer rows may have been unlucky.
    const FEWEST: usize = 100;
    let pdr = table.column("pdr")?;
    let most = pdr.iter().copied().filter(|pdr| pdr.is_finite()).fold(0.0, f64::max);
    (FEWEST <= pdr.len() && 0.0 < most && most < 0.011).then(|| {
        format!(
            "pdr is at most {most} in {} rows; if they are fractions of percentages, write pdr = {{ column = \"…\", scale = 100 }}",
            pdr.len()
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    const S: i64 = 1_000_000_000;

    fn frame(times_s: &[i64], columns: &[(&str, &[f64])]) -> Frame {
        let mut frame = Frame { lines: (2..2 + times_s.len()).collect(), ..Frame::default() };
        frame.times_ns.insert("time_s".to_owned(), times_s.iter().map(|time| time * S).collect());
        let own = |(name, values): &(&str, &[f64])| ((*name).to_owned(), values.to_vec());
        frame.columns = columns.iter().map(own).collect();
        frame
    }

    /// What `change` rejects: reason, rows, first line.
    fn rejected(
        frame: &mut Frame,
        change: impl Fn(&mut Frame, &mut Account<'_>),
    ) -> Vec<(String, usize, usize)> {
        let mut list = Vec::new();
        let mut account = Account { file: Path::new("x"), n_read: 0, rejected: &mut list };
        change(frame, &mut account);
        list.into_iter().map(|r| (r.reason, r.rows, r.first_line)).collect()
    }

    #[test]
    fn epoch_times_count_from_the_first_and_a_clock_that_was_not_set_is_rejected() {
        let mut log = frame(&[7, 1_600_000_002, 1_600_000_001, 1_600_000_005], &[]);
        let found =
            rejected(&mut log, |frame, account| start_at_zero(frame, Start::Automatic, account));
        assert_eq!(log.time_ns().unwrap(), [S, 0, 4 * S]);
        assert_eq!(log.column(time_of_day::START), Some(&[1_600_000_001.0; 3][..]));
        assert!(
            found.len() == 1 && found[0].0.contains("the clock was not set") && found[0].2 == 2
        );
        let mut relative = frame(&[3, 4], &[]);
        assert!(
            rejected(&mut relative, |frame, account| start_at_zero(
                frame,
                Start::Automatic,
                account
            ))
            .is_empty()
        );
        assert_eq!(relative.time_ns().unwrap(), [3 * S, 4 * S]);
        assert!(relative.take(time_of_day::START).unwrap().iter().all(|start_s| start_s.is_nan()));
        let found = rejected(&mut relative, |frame, account| {
            start_at_zero(frame, Start::At(4 * S), account)
        });
        assert_eq!(found, [("time_s is before the start".to_owned(), 1, 2)]);
        assert_eq!(relative.time_ns().unwrap(), [0]);
        // Four seconds since the log began are no epoch time.
        assert!(relative.take(time_of_day::START).unwrap()[0].is_nan());
    }

    #[test]
    fn the_start_is_written_where_the_mapping_or_the_log_states_it_and_kept_where_a_column_does() {
        let of = |stated: &[(&str, &[f64])], start, start_ns| {
            let mut log = frame(&[1_600_000_002, 1_600_000_005], stated);
            log.start_ns = start_ns;
            assert!(
                rejected(&mut log, |frame, account| start_at_zero(frame, start, account))
                    .is_empty()
            );
            let start_s = log.take(time_of_day::START).unwrap();
            (start_s, log.time_ns().unwrap().to_vec())
        };
        let [first, second] = [1_600_000_000 * S, 1_600_000_001 * S];
        assert_eq!(of(&[], Start::At(first), None), (vec![1.6e9; 2], vec![2 * S, 5 * S]));
        let (start_s, times_ns) = of(&[], Start::Automatic, Some(second));
        assert_eq!((start_s, times_ns), (vec![1_600_000_001.0; 2], vec![S, 4 * S]));
        let stated: &[(&str, &[f64])] = &[(time_of_day::START, &[7.0; 2])];
        assert_eq!(of(stated, Start::Automatic, Some(second)).0, [7.0; 2]);
        let (start_s, times_ns) = of(&[], Start::AsWritten, None);
        assert!(start_s[0].is_nan() && times_ns[0] == 1_600_000_002 * S);
    }

    #[test]
    fn counters_become_differences_and_ratios() {
        let link: &[f64] = &[1.0, 1.0, 1.0, 1.0, 1.0];
        let mut log = frame(
            &[0, 10, 20, 30, 40],
            &[
                ("tx", link),
                ("rx", link),
                ("frames", &[5.0, 15.0, 15.0, 2.0, 6.0]),
                ("received_frames", &[5.0, 13.0, 13.0, 1.0, 4.0]),
            ],
        );
        let found = rejected(&mut log, |frame, account| {
            differences(frame, account);
            delivery_ratio(frame, account);
        });
        assert_eq!(log.column("frames").unwrap(), [10.0, 4.0]);
        assert_eq!(log.column("pdr").unwrap(), [0.8, 0.75]);
        let reasons: Vec<(&str, usize)> =
            found.iter().map(|(reason, _, line)| (&reason[..9], *line)).collect();
        assert_eq!(reasons, [("it is the", 2), ("no frame ", 4), ("a counter", 5)]);
    }
}
