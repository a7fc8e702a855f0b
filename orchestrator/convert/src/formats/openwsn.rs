//! Packets that arrived at the root of an OpenWSN network, one a line: 38 bytes as a list, then a time of day.
//!
//! | bytes (from 1) | what |
//! |---|---|
//! | 1 | node that handed the packet to the root |
//! | 2–6 | absolute slot number (ASN) of the arrival, least significant byte first |
//! | 7–11 | ASN of the creation |
//! | 12–13 | sequence number, least significant byte first |
//! | 14 | padding |
//! | 15–38 | up to six hops: node, counter of transmissions, channel of the successful one, RSSI at its receiver (−dBm) |
//!
//! The counter of a hop counts down, as `l2_retriesLeft` of OpenWSN does: it is `max_transmissions` at the first transmission, and 1
//! at the last one. Copies of a packet whose acknowledgment was lost show this: each has a counter lower by one for every slotframe
//! that it came later.

use super::{Format, Row, Rows, UNCHECKED, refused};
use measure::DataError;
use measure::formats::{Content, Uncounted};
use proto::bounds::LINE_BYTES;
use proto::config::{Section, variant};
use std::io::{BufRead as _, Read as _};
use std::path::{Path, PathBuf};

/// The format.
pub const FORMAT: Format = Format {
    variant: variant::<PacketKeys>("openwsn-packets"),
    columns: COLUMNS,
    check: UNCHECKED,
    open,
};

/// Packets that arrived at the root of an OpenWSN network, one a line: 38 bytes as a list (last sender, ASN of arrival and of creation,
/// sequence number, then node, counter of transmissions, channel and −RSSI of each hop), then a time of day.
#[derive(Section)]
pub(super) struct PacketKeys {
    /// Duration of a slot (s): times are ASN times slot_s. OpenWSN's slots last 0.015 s.
    #[key(above = 0.0, most = 1.0, default = 0.015)]
    slot_s: f64,
    /// Address of the root, the destination of all packets.
    #[key(default = 1)]
    root: u8,
    /// Transmissions after which a node drops a packet. The counter of a hop counts down from here; 3 in OpenWSN (TXRETRIES).
    #[key(range = 1..=255, default = 3)]
    max_transmissions: u8,
}

/// Packets with more hops have only the first six in the log.
const MOST_HOPS: usize = 6;
const N_BYTES: usize = 38;

/// Fields that have the names that they have in the table, and those of each hop.
macro_rules! columns {
    [$($name:literal),+; hops $($hop:literal),+] => { &[
        $(($name, $name),)+
        $(
            (concat!("hop", $hop, "_node"), concat!("hop", $hop, "_node")),
            (concat!("hop", $hop, "_transmissions"), concat!("hop", $hop, "_transmissions")),
            (concat!("hop", $hop, "_channel"), concat!("hop", $hop, "_channel")),
            (concat!("hop", $hop, "_rssi_dbm"), concat!("hop", $hop, "_rssi_dbm")),
        )+
    ] };
}

const COLUMNS: &[(&str, &str)] = columns![
    "time_s", "source", "destination", "received_s", "hops", "sequence"; hops 1, 2, 3, 4, 5, 6
];

fn open<'a>(
    path: &Path,
    content: Content<'a>,
    keys: &toml::Table,
) -> Result<Box<dyn Rows + 'a>, DataError> {
    Ok(Box::new(Packets {
        lines: PacketLines::new(path, content.uncounted().0, &PacketKeys::read(keys)),
        names: COLUMNS.iter().map(|(_, name)| (*name).to_owned()).collect(),
    }))
}

/// A row for each packet.
struct Packets<'a> {
    lines: PacketLines<'a>,
    names: Vec<String>,
}

impl Rows for Packets<'_> {
    fn names(&self) -> &[String] {
        &self.names
    }

    /// The network is switched on at ASN 0.
    fn start_ns(&self) -> Option<i64> {
        Some(0)
    }

    fn next(&mut self, row: &mut Row) -> Result<bool, DataError> {
        let Some(packet) = self.lines.next()? else { return Ok(false) };
        row.line = self.lines.line;
        row.fields.clear();
        row.problem = None;
        match packet {
            Ok(packet) => self.fill(&packet, row),
            Err(problem) => row.problem = Some(problem),
        }
        Ok(true)
    }
}

impl Packets<'_> {
    fn fill(&self, packet: &Packet, row: &mut Row) {
        row.fields.push_field(&self.lines.seconds(packet.created_asn));
        row.fields.push_field(&packet.source().to_string());
        row.fields.push_field(&self.lines.root.to_string());
        row.fields.push_field(&self.lines.seconds(packet.arrived_asn));
        let hops = packet.hops.len().to_string();
        row.fields.push_field(if packet.is_complete() { &hops } else { "" });
        row.fields.push_field(&packet.sequence.to_string());
        for at in 0..MOST_HOPS {
            match packet.hops.get(at) {
                Some(hop) => {
                    row.fields.push_field(&hop.node.to_string());
                    row.fields.push_field(&hop.transmissions.to_string());
                    row.fields.push_field(&hop.channel.to_string());
                    row.fields.push_field(&(-i32::from(hop.minus_rssi)).to_string());
                }
                None => (0..4).for_each(|_| row.fields.push_field("")),
            }
        }
    }
}

/// A packet that arrived at the root.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Packet {
    /// Node that handed the packet to the root.
    pub last_sender: u8,
    /// Slot of the arrival.
    pub arrived_asn: u64,
    /// Slot of the creation.
    pub created_asn: u64,
    /// Sequence number.
    pub sequence: u64,
    /// Its hops, at least one, from the source on.
    pub hops: Vec<Hop>,
}

/// A hop of a packet.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Hop {
    /// Node that sent.
    pub node: u8,
    /// Transmissions up to the one that was received, which counts.
    pub transmissions: u8,
    /// Channel of the transmission that was received, 11 to 26.
    pub channel: u8,
    /// RSSI at the receiver (−dBm).
    pub minus_rssi: u8,
}

impl Packet {
    /// The node that created the packet.
    pub(super) fn source(&self) -> u8 {
        self.hops.first().map_or(0, |hop| hop.node)
    }

    /// Whether the record of the route is complete: then its last hop leads to the root.
    pub(super) fn is_complete(&self) -> bool {
        self.hops.last().is_some_and(|hop| hop.node == self.last_sender)
    }

    fn of_bytes(bytes: &[u8; N_BYTES], max_transmissions: u8) -> Result<Self, String> {
        let number = |from: usize, n: usize| {
            (0..n).rev().fold(0u64, |number, at| number << 8 | u64::from(bytes[from + at]))
        };
        let mut hops = Vec::new();
        for hop in bytes[14..].chunks(4).take_while(|hop| hop[0] != 0) {
            let &[node, counter, channel, minus_rssi] = hop else { break };
            if counter == 0 || !(11..=26).contains(&channel) {
                return Err("a hop has no transmissions, or a channel outside 11 to 26".to_owned());
            }
            if max_transmissions < counter {
                return Err(format!(
                    "the counter of a hop exceeds max_transmissions, {max_transmissions}"
                ));
            }
            let transmissions = max_transmissions - counter + 1;
            hops.push(Hop { node, transmissions, channel, minus_rssi });
        }
        if hops.is_empty() {
            return Err("no hop is recorded, so the source is unknown".to_owned());
        }
        Ok(Self {
            last_sender: bytes[0],
            arrived_asn: number(1, 5),
            created_asn: number(6, 5),
            sequence: number(11, 2),
            hops,
        })
    }
}

/// The lines of such a log.
pub(super) struct PacketLines<'a> {
    content: Uncounted<'a>,
    path: PathBuf,
    slot_ns: u64,
    /// Address of the root.
    pub root: u8,
    max_transmissions: u8,
    /// The line that was read last, from 1.
    pub line: usize,
    text: Vec<u8>,
}

impl<'a> PacketLines<'a> {
    /// Packets of a log, from its first line on.
    pub(super) fn new(path: &Path, content: Uncounted<'a>, keys: &PacketKeys) -> Self {
        Self {
            content,
            path: path.to_owned(),
            slot_ns: (keys.slot_s * 1e9).round() as u64,
            root: keys.root,
            max_transmissions: keys.max_transmissions,
            line: 0,
            text: Vec::new(),
        }
    }

    /// The next packet, or why its line cannot be used; `None` at the end.
    ///
    /// # Errors
    ///
    /// The log cannot be read further.
    pub(super) fn next(&mut self) -> Result<Option<Result<Packet, String>>, DataError> {
        self.text.clear();
        self.line += 1;
        let failed = |source| DataError::Read { path: self.path.clone(), source };
        let n = (&mut self.content)
            .take(LINE_BYTES.most + 1)
            .read_until(b'\n', &mut self.text)
            .map_err(failed)?;
        LINE_BYTES
            .check(n as u64)
            .map_err(|refusal| refused(&self.path, format!("line {}: {refusal}", self.line)))?;
        if n == 0 {
            return Ok(None);
        }
        let problem = || format!("the line does not begin with {N_BYTES} bytes in brackets");
        let packet = bytes(&self.text)
            .ok_or_else(problem)
            .and_then(|bytes| Packet::of_bytes(&bytes, self.max_transmissions));
        Ok(Some(packet))
    }

    /// The time at which a slot begins (s).
    pub(super) fn seconds(&self, asn: u64) -> String {
        let ns = u128::from(asn) * u128::from(self.slot_ns);
        format!("{}.{:09}", ns / 1_000_000_000, ns % 1_000_000_000)
    }
}

/// The bytes of a line: `[9, 173, …]`, whatever follows.
fn bytes(line: &[u8]) -> Option<[u8; N_BYTES]> {
    let text = std::str::from_utf8(line).ok()?;
    let (list, _) = text.trim_start().strip_prefix('[')?.split_once(']')?;
    let mut bytes = [0; N_BYTES];
    let mut n = 0;
    for text in list.split(',') {
        *bytes.get_mut(n)? = text.trim().parse().ok()?;
        n += 1;
    }
    (n == N_BYTES).then_some(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;
    use measure::memory::MemoryBudget;

    /// Rows as text, or why they cannot be used.
    fn rows(text: &str) -> Vec<(usize, String)> {
        let keys = super::super::checked::<PacketKeys>("");
        let mut rows =
            open(Path::new("x.log"), Content::new(text.as_bytes(), MemoryBudget::default()), &keys)
                .unwrap();
        let (mut row, mut found) = (Row::default(), Vec::new());
        while rows.next(&mut row).unwrap() {
            let fields: Vec<&str> = row.fields.iter().collect();
            found.push((row.line, row.problem.take().unwrap_or_else(|| fields.join(","))));
        }
        found
    }

    fn line(first: [u8; 14], hops: &[[u8; 4]]) -> String {
        let mut bytes = [first.as_slice(), &hops.concat()].concat();
        bytes.resize(N_BYTES, 0);
        format!("{bytes:?}\t0:00:01.5\n")
    }

    #[test]
    fn a_packet_has_its_times_its_route_and_its_hops() {
        // Arrived at ASN 258, created at ASN 200, sequence number 515.
        let text =
            line([4, 2, 1, 0, 0, 0, 200, 0, 0, 0, 0, 3, 2, 0], &[[7, 2, 26, 84], [4, 1, 11, 60]]);
        assert_eq!(
            rows(&text),
            [(
                1,
                format!(
                    "3.000000000,7,1,3.870000000,2,515,7,2,26,-84,4,3,11,-60{}",
                    ",".repeat(16)
                )
            )]
        );
    }

    #[test]
    fn a_damaged_line_is_named_and_the_next_one_is_read() {
        let text = "x\n[1, 2]\n[1, 300]\n\n".to_owned()
            + &line([4; 14], &[])
            + &line([4; 14], &[[4, 1, 68, 60]])
            + &line([9, 2, 0, 0, 0, 0, 1, 0, 0, 0, 0, 3, 0, 0], &[[7, 2, 26, 84]])
            + &line([7, 2, 0, 0, 0, 0, 1, 0, 0, 0, 0, 3, 0, 0], &[[7, 4, 26, 84]])
            + &line([7, 2, 0, 0, 0, 0, 1, 0, 0, 0, 0, 3, 0, 0], &[[7, 3, 26, 84]]);
        let rows = rows(&text);
        assert_eq!(rows.len(), 9);
        assert!(
            rows[..4].iter().all(|(_, problem)| problem.contains("38 bytes in brackets")),
            "{rows:?}"
        );
        assert!(rows[4].1.contains("no hop is recorded") && rows[5].1.contains("outside 11 to 26"));
        // The last sender, 9, is not the last hop: how many there were is unknown.
        assert_eq!(
            rows[6],
            (7, format!("0.015000000,7,1,0.030000000,,3,7,2,26,-84{}", ",".repeat(20)))
        );
        // 4 exceeds the most transmissions, 3; 3 is the first one.
        assert!(rows[7].1.contains("exceeds max_transmissions, 3"), "{rows:?}");
        assert!(rows[8].1.contains(",1,3,7,1,26,-84,"), "{rows:?}");
    }
}
