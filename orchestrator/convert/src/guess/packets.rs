//! Logs of packets from end to end.

use super::profile::Profile;
use super::times::{self, Rate, quoted};
use super::words::{self, RX, RX_DEVICE, TX, TX_DEVICE};
use super::{Asked, Draft, DraftInput, Log};
use crate::tables::TableKind;

/// Words for the time of an arrival.
const ARRIVAL: &[&str] = &["arrival", "arrived", "received", "recv", "rx"];

/// What a table of packets can be made of.
///
/// # Errors
///
/// What is lacking; empty if the logs have nothing of packets.
pub(super) fn draft(logs: &[Log], asked: &mut Asked<'_>) -> Result<Draft, String> {
    let of_format =
        |log: &Log| log.is_made_of("openwsn-packets") || log.is_made_of("contiki-packets");
    if let Some(at) = logs.iter().position(of_format) {
        let mut input = DraftInput::new(at);
        input.keys.push(("format".to_owned(), quoted(logs[at].form.format)));
        return Ok(Draft {
            table: TableKind::Packets,
            inputs: vec![input],
            top: Vec::new(),
            findings: Vec::new(),
            unknown: Vec::new(),
            model: super::write::model_of_packets(&logs[at]),
        });
    }
    for (at, log) in logs.iter().enumerate() {
        if log.best(super::readings::score).is_some() {
            continue;
        }
        let source = log.best(|p| words::end(p, TX, TX_DEVICE, RX));
        let destination = log.best(|p| words::end(p, RX, RX_DEVICE, TX));
        let is_time = |p: &Profile| p.is_numeric() || p.is_date() || p.is_clock();
        let is_arrival = |p: &Profile| is_time(p) && p.has(ARRIVAL) && p.has(words::TIME);
        let (Some(source), Some(arrival)) = (source, log.best(|p| i32::from(is_arrival(p)))) else {
            continue;
        };
        let mut input = DraftInput::new(at);
        let Some(columns) =
            times::fill(log, &mut input, "time_s", Rate::Any, asked, |p| !is_arrival(p))
        else {
            continue;
        };
        if columns.contains(&arrival) {
            continue;
        }
        times::fill(log, &mut input, "received_s", Rate::Any, asked, |p| is_arrival(p));
        input.add("source", quoted(&log.profile(source).name), "created the packet");
        match destination.filter(|destination| *destination != source) {
            Some(destination) => input.add(
                "destination",
                quoted(&log.profile(destination).name),
                "the packet is for",
            ),
            None => input.add("destination", "0", "no column names it: one, number 0"),
        }
        let whole = |p: &Profile| p.is_numeric() && p.is_whole && 0.0 <= p.range[0];
        for (column, words) in [
            ("hops", &["hops", "hop"][..]),
            ("sequence", &["seq", "sequence", "seqno", "counter"]),
            ("payload_bytes", &["payload", "size", "length", "bytes"]),
        ] {
            if let Some(found) = log.best(|p| i32::from(whole(p) && p.has(words))) {
                input.add(column, quoted(&log.profile(found).name), "");
            }
        }
        return Ok(Draft {
            table: TableKind::Packets,
            inputs: vec![input],
            top: Vec::new(),
            findings: Vec::new(),
            unknown: Vec::new(),
            model: super::write::model_of_packets(log),
        });
    }
    Err(String::new())
}

/// How many nodes a log has: the greatest number, or the number of names.
pub(super) fn nodes(log: &Log) -> usize {
    let columns = ["source", "destination"].into_iter().filter_map(|name| {
        log.sample.place(name).or_else(|| log.best(|p| words::end(p, TX, TX_DEVICE, RX)))
    });
    let n = columns.map(|column| {
        let profile = log.profile(column);
        let is_numbered = profile.n_numbers == profile.n;
        if is_numbered { profile.range[2] as usize + 1 } else { profile.n_distinct + 1 }
    });
    n.max().unwrap_or(2).min(4096)
}
