//! Transmissions of the packets that arrived at the root of an OpenWSN network: the log of [`super::openwsn`], link by link.
//!
//! The log states the channel of the transmission that was received. If a node has one cell in a slotframe, its transmissions are one
//! slotframe apart, so the hopping sequence gives the channels of those before, which failed (IEEE Std 802.15.4-2015, § 6.2.6.3:
//! the channel of a cell is `sequence[(ASN + channel offset) mod length]`). Whether log, slotframe and sequence agree is checked on
//! the last hops, the only ones whose slot is known.

use super::openwsn::{Packet, PacketKeys, PacketLines};
use super::{Format, Row, Rows, UNCHECKED, refused};
use measure::DataError;
use measure::formats::Content;
use proto::bounds::ROWS;
use proto::config::{Section, variant};
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

/// The format.
pub const FORMAT: Format = Format {
    variant: variant::<Keys>("openwsn-transmissions"),
    columns: COLUMNS,
    check: UNCHECKED,
    open,
};

/// The log of openwsn-packets as link samples: a row for every transmission of every hop. Channels of failed transmissions follow from
/// slotframe and hopping sequence, for networks in which each node has one cell in a slotframe.
#[derive(Section)]
struct Keys {
    #[key(flatten)]
    packets: PacketKeys,
    /// Length of the slotframe, in slots: how far apart the transmissions of a packet by one node are.
    #[key(range = 1..=65535)]
    slotframe_slots: u64,
    /// Channels by absolute slot number. By default that of IEEE 802.15.4 for 16 channels: 16, 17, 23, 18, 26, 15, 25, 22, 19, 11, 12, 13,
    /// 24, 14, 20, 21.
    #[key(range = 11..=26, length = 1..=16)]
    hopping_sequence: Option<Vec<u8>>,
}

const SEQUENCE: [u8; 16] = [16, 17, 23, 18, 26, 15, 25, 22, 19, 11, 12, 13, 24, 14, 20, 21];

const COLUMNS: &[(&str, &str)] = &[
    ("time_s", "time_s"),
    ("tx", "tx"),
    ("rx", "rx"),
    ("channel", "channel"),
    ("rssi_dbm", "rssi_dbm"),
    ("received", "received"),
];

/// Share of the packets whose last hop must fit slotframe and hopping sequence. A sequence in which two of 16 channels are exchanged
/// fits 14 of 16 packets.
const FITTING_SHARE: f64 = 0.95;

/// What a transmission takes: its fields as text, and where each ends (bytes).
const BYTES_OF_ROW: u64 = 512;

fn open<'a>(
    path: &Path,
    content: Content<'a>,
    keys: &toml::Table,
) -> Result<Box<dyn Rows + 'a>, DataError> {
    let keys = Keys::read(keys);
    let hopping = Hopping {
        slotframe_slots: keys.slotframe_slots,
        sequence: keys.hopping_sequence.unwrap_or_else(|| SEQUENCE.to_vec()),
    };
    let (content, mut memory) = content.uncounted();
    let mut lines = PacketLines::new(path, content, &keys.packets);
    let mut transmissions = Transmissions {
        names: COLUMNS.iter().map(|(_, name)| (*name).to_owned()).collect(),
        rows: Vec::new(),
        at: 0,
    };
    let (mut seen, mut last_hops) = (BTreeSet::new(), Vec::new());
    while let Some(packet) = lines.next()? {
        let added = packet.and_then(|packet| {
            let rows = transmissions_of(&packet, &hopping, &mut seen, &lines)?;
            last_hops.extend(packet.hops.last().map(|hop| LastHop {
                node: hop.node,
                asn: packet.arrived_asn,
                channel: hop.channel,
            }));
            Ok(rows)
        });
        let n_rows = transmissions.rows.len();
        match added {
            Ok(rows) => transmissions.rows.extend(rows),
            Err(problem) => transmissions.rows.push(Row {
                line: lines.line,
                problem: Some(problem),
                ..Row::default()
            }),
        }
        let n_added = (transmissions.rows.len() - n_rows) as u64;
        let what = format_args!("{} transmissions", transmissions.rows.len());
        ROWS.check(transmissions.rows.len() as u64)
            .and_then(|()| memory.take(BYTES_OF_ROW * n_added, what))
            .map_err(|refusal| refused(path, format!("line {}: {refusal}", lines.line)))?;
    }
    hopping.check(&last_hops).map_err(|message| refused(path, message))?;
    Ok(Box::new(transmissions))
}

/// The rows of a packet, or why it cannot be used.
fn transmissions_of(
    packet: &Packet,
    hopping: &Hopping,
    seen: &mut BTreeSet<(u8, u64, u64)>,
    lines: &PacketLines<'_>,
) -> Result<Vec<Row>, String> {
    if !packet.is_complete() {
        return Err("the record of the route is incomplete, so a receiver is unknown".to_owned());
    }
    let channels: Vec<Vec<u8>> =
        packet.hops.iter().map(|hop| hopping.channels(hop.channel, hop.transmissions)).collect();
    if channels.iter().any(Vec::is_empty) {
        return Err("a hop was on a channel that is not in hopping_sequence".to_owned());
    }
    if !seen.insert((packet.source(), packet.sequence, packet.created_asn)) {
        return Err(
            "the packet arrived before: source, sequence number and creation time are equal"
                .to_owned(),
        );
    }
    let time_s = lines.seconds(packet.created_asn);
    let receivers = packet.hops[1..].iter().map(|hop| hop.node).chain(std::iter::once(lines.root));
    let mut rows = Vec::new();
    for ((hop, receiver), channels) in packet.hops.iter().zip(receivers).zip(channels) {
        let last = channels.len() - 1;
        for (at, channel) in channels.into_iter().enumerate() {
            let mut row = Row { line: lines.line, ..Row::default() };
            let reading = -i32::from(hop.minus_rssi);
            row.fields.push_field(&time_s);
            row.fields.push_field(&hop.node.to_string());
            row.fields.push_field(&receiver.to_string());
            row.fields.push_field(&channel.to_string());
            row.fields.push_field(&if at == last { reading.to_string() } else { String::new() });
            row.fields.push_field(if at == last { "1" } else { "0" });
            rows.push(row);
        }
    }
    Ok(rows)
}

/// The hop of a packet to the root.
#[derive(Clone, Copy, Debug)]
struct LastHop {
    node: u8,
    asn: u64,
    channel: u8,
}

/// How channels follow each other.
struct Hopping {
    slotframe_slots: u64,
    sequence: Vec<u8>,
}

impl Hopping {
    /// Channels of the transmissions up to the one on `channel`, one slotframe apart; empty if `channel` is not in the sequence.
    fn channels(&self, channel: u8, transmissions: u8) -> Vec<u8> {
        let n = self.sequence.len() as u64;
        let Some(last) = self.sequence.iter().position(|&known| known == channel) else {
            return Vec::new();
        };
        let step = self.slotframe_slots % n;
        (0..u64::from(transmissions))
            .rev()
            .map(|before| self.sequence[((last as u64 + n - before * step % n) % n) as usize])
            .collect()
    }

    /// Whether the last hops of the packets fit: those of a node have one slot in the slotframe, and one channel offset.
    ///
    /// # Errors
    ///
    /// What does not fit, and how many packets do.
    fn check(&self, hops: &[LastHop]) -> Result<(), String> {
        let n = self.sequence.len() as u64;
        let slots = fitting_share(hops, |hop| Some(hop.asn % self.slotframe_slots));
        if slots < FITTING_SHARE {
            return Err(format!(
                "{:.1} % of the packets arrived in the most frequent slot of their last sender in a slotframe of {} slots; at least \
                 {:.0} % must, or the channels of failed transmissions are unknown: state another slotframe_slots, or use the format \
                 openwsn-packets",
                100.0 * slots,
                self.slotframe_slots,
                100.0 * FITTING_SHARE
            ));
        }
        let offsets = fitting_share(hops, |hop| {
            let at = self.sequence.iter().position(|&channel| channel == hop.channel)?;
            Some((at as u64 + n - hop.asn % n) % n)
        });
        if offsets < FITTING_SHARE {
            return Err(format!(
                "{:.1} % of the packets arrived on the channel that hopping_sequence gives for their slot; at least {:.0} % must: state \
                 the network's hopping_sequence",
                100.0 * offsets,
                100.0 * FITTING_SHARE
            ));
        }
        Ok(())
    }
}

/// Share of hops that have the most frequent value of their node; 1 of none.
fn fitting_share(hops: &[LastHop], value: impl Fn(&LastHop) -> Option<u64>) -> f64 {
    let mut counts: BTreeMap<u8, BTreeMap<u64, usize>> = BTreeMap::new();
    for hop in hops {
        if let Some(value) = value(hop) {
            *counts.entry(hop.node).or_default().entry(value).or_default() += 1;
        }
    }
    let fitting: usize = counts.values().filter_map(|values| values.values().max()).sum();
    if hops.is_empty() { 1.0 } else { fitting as f64 / hops.len() as f64 }
}

struct Transmissions {
    names: Vec<String>,
    rows: Vec<Row>,
    at: usize,
}

impl Rows for Transmissions {
    fn names(&self) -> &[String] {
        &self.names
    }

    /// The network is switched on at ASN 0.
    fn start_ns(&self) -> Option<i64> {
        Some(0)
    }

    fn next(&mut self, row: &mut Row) -> Result<bool, DataError> {
        let Some(next) = self.rows.get_mut(self.at) else { return Ok(false) };
        *row = std::mem::take(next);
        self.at += 1;
        Ok(true)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use measure::memory::MemoryBudget;

    /// Packets of nodes 7 and 4 to the root 1: ASN of arrival, sequence number, channel offset, hops.
    fn line(asn: u64, sequence: u8, hops: &[[u8; 4]]) -> String {
        let mut bytes = vec![hops.last().unwrap()[0], asn as u8, (asn >> 8) as u8, 0, 0, 0];
        bytes.extend([sequence, 0, 0, 0, 0, sequence, 0, 0]);
        bytes.extend(hops.concat());
        bytes.resize(38, 0);
        format!("{bytes:?}\t0:00:01.5\n")
    }

    fn read(text: &str, keys: &str) -> Result<Vec<String>, String> {
        let keys = super::super::checked::<Keys>(keys);
        let mut rows =
            open(Path::new("x.log"), Content::new(text.as_bytes(), MemoryBudget::default()), &keys)
                .map_err(|error| error.to_string())?;
        let (mut row, mut found) = (Row::default(), Vec::new());
        while rows.next(&mut row).unwrap() {
            let fields: Vec<&str> = row.fields.iter().collect();
            found.push(row.problem.take().unwrap_or_else(|| fields.join(",")));
        }
        Ok(found)
    }

    const KEYS: &str = "slotframe_slots = 17\nhopping_sequence = [11, 12, 13, 14]";

    #[test]
    fn failed_transmissions_were_on_the_channels_before() {
        // The hop to the root needed three transmissions: the counter is down to 1. A slotframe of 17 slots moves the channel by one.
        let hops = [[7, 3, 14, 84], [4, 1, 11, 60]];
        let text = line(16, 5, &hops) + &line(16, 5, &hops) + &line(33, 6, &[[4, 3, 15, 60]]);
        let rows = read(&text, KEYS).unwrap();
        assert_eq!(
            rows[..4],
            [
                "0.075000000,7,4,14,-84,1",
                "0.075000000,4,1,13,,0",
                "0.075000000,4,1,14,,0",
                "0.075000000,4,1,11,-60,1",
            ]
        );
        assert!(rows[4].contains("arrived before") && rows[5].contains("not in hopping_sequence"));
        let incomplete = read(&line(16, 5, &[[7, 3, 14, 84]]).replacen("[7", "[9", 1), KEYS);
        assert!(incomplete.unwrap()[0].contains("incomplete"));
    }

    /// 100 packets of node 4, of which `n_other` come `slots` later in the slotframe, on the channel of that slot.
    fn packets(n_other: u64, slots: u64, sequence: [u8; 4]) -> String {
        (0..100)
            .map(|at| {
                let asn = 17 * at + if at < n_other { slots } else { 0 };
                line(asn, at as u8, &[[4, 3, sequence[asn as usize % 4], 60]])
            })
            .collect()
    }

    #[test]
    fn a_log_that_does_not_fit_slotframe_and_sequence_is_refused() {
        const SEQUENCE: [u8; 4] = [11, 12, 13, 14];
        assert!(read(&packets(5, 3, SEQUENCE), KEYS).is_ok());
        let refusal = read(&packets(6, 3, SEQUENCE), KEYS).unwrap_err();
        assert!(refusal.contains("94.0 % of the packets arrived in the most frequent slot"));
        // Two channels exchanged fit half of the packets.
        let refusal = read(&packets(0, 0, [11, 13, 12, 14]), KEYS).unwrap_err();
        assert!(refusal.contains("50.0 % of the packets arrived on the channel"), "{refusal}");
    }
}
