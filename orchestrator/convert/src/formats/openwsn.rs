//! Packets that arrived at the root of an OpenWSN network, one a line: 38 bytes as a list, then a time of day.
//!
//! | bytes (from 1) | what |
//! |---|---|
//! | 1 | node that handed the packet to the root |
//! | 2–6 | absolute slot number (ASN) of the arrival, least significant byte first |
//! | 7–11 | ASN of the creation |
//! | 12–13 | sequence number, least significant byte first |
//! | 14 | padding |
//! | 15–38 | up to six hops: node, transmissions that it needed, channel of the successful one, RSSI at its receiver (−dBm) |

use super::{Format, Row, Rows, refused};
use measure::DataError;
use measure::formats::Content;
use proto::bounds::LINE_BYTES;
use proto::config::{Default, Field, Kind, Range, Variant};
use std::io::{BufRead as _, Read as _};
use std::path::{Path, PathBuf};

/// The format.
pub const FORMAT: Format = Format {
    variant: Variant {
        name: "openwsn-packets",
        doc: "Packets that arrived at the root of an OpenWSN network, one a line: 38 bytes as a list (last sender, ASN of arrival and \
              of creation, sequence number, then node, transmissions, channel and −RSSI of each hop), then a time of day.",
        fields: &[
            Field {
                key: "slot_s",
                doc: "Duration of a slot (s): times are ASN times slot_s. OpenWSN's slots last 0.015 s.",
                kind: Kind::Number(Range::above(0.0, 1.0)),
                default: Default::Number(0.015),
            },
            Field {
                key: "root",
                doc: "Address of the root, the destination of all packets.",
                kind: Kind::Integer { min: 0, max: 255 },
                default: Default::Integer(1),
            },
        ],
    },
    columns: COLUMNS,
    open,
};

/// Packets with more hops have only the first six in the log.
const MOST_HOPS: usize = 6;
const N_BYTES: usize = 38;

/// The columns: fields have the names that they have in the table.
const COLUMNS: &[(&str, &str)] = &[
    ("time_s", "time_s"),
    ("source", "source"),
    ("destination", "destination"),
    ("received_s", "received_s"),
    ("hops", "hops"),
    ("sequence", "sequence"),
    ("hop1_node", "hop1_node"),
    ("hop1_transmissions", "hop1_transmissions"),
    ("hop1_channel", "hop1_channel"),
    ("hop1_rssi_dbm", "hop1_rssi_dbm"),
    ("hop2_node", "hop2_node"),
    ("hop2_transmissions", "hop2_transmissions"),
    ("hop2_channel", "hop2_channel"),
    ("hop2_rssi_dbm", "hop2_rssi_dbm"),
    ("hop3_node", "hop3_node"),
    ("hop3_transmissions", "hop3_transmissions"),
    ("hop3_channel", "hop3_channel"),
    ("hop3_rssi_dbm", "hop3_rssi_dbm"),
    ("hop4_node", "hop4_node"),
    ("hop4_transmissions", "hop4_transmissions"),
    ("hop4_channel", "hop4_channel"),
    ("hop4_rssi_dbm", "hop4_rssi_dbm"),
    ("hop5_node", "hop5_node"),
    ("hop5_transmissions", "hop5_transmissions"),
    ("hop5_channel", "hop5_channel"),
    ("hop5_rssi_dbm", "hop5_rssi_dbm"),
    ("hop6_node", "hop6_node"),
    ("hop6_transmissions", "hop6_transmissions"),
    ("hop6_channel", "hop6_channel"),
    ("hop6_rssi_dbm", "hop6_rssi_dbm"),
];

fn open<'a>(
    path: &Path,
    content: Content<'a>,
    keys: &toml::Table,
) -> Result<Box<dyn Rows + 'a>, DataError> {
    let slot_s = keys.get("slot_s").and_then(toml::Value::as_float).unwrap_or(0.015);
    let root = keys.get("root").and_then(toml::Value::as_integer).unwrap_or(1);
    Ok(Box::new(PacketLines {
        content,
        path: path.to_owned(),
        names: COLUMNS.iter().map(|(_, name)| (*name).to_owned()).collect(),
        slot_ns: (slot_s * 1e9).round() as u64,
        root: root.to_string(),
        line: 0,
        text: Vec::new(),
    }))
}

struct PacketLines<'a> {
    content: Content<'a>,
    path: PathBuf,
    names: Vec<String>,
    slot_ns: u64,
    root: String,
    line: usize,
    text: Vec<u8>,
}

impl Rows for PacketLines<'_> {
    fn names(&self) -> &[String] {
        &self.names
    }

    /// The network is switched on at ASN 0.
    fn start_ns(&self) -> Option<i64> {
        Some(0)
    }

    fn next(&mut self, row: &mut Row) -> Result<bool, DataError> {
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
            return Ok(false);
        }
        row.line = self.line;
        row.fields.clear();
        row.problem = None;
        match bytes(&self.text) {
            Some(bytes) => row.problem = self.packet(&bytes, row).err(),
            None => {
                row.problem =
                    Some(format!("the line does not begin with {N_BYTES} bytes in brackets"))
            }
        }
        Ok(true)
    }
}

impl PacketLines<'_> {
    /// The fields of a packet.
    fn packet(&self, bytes: &[u8; N_BYTES], row: &mut Row) -> Result<(), String> {
        let number = |from: usize, n: usize| {
            (0..n).rev().fold(0u64, |number, at| number << 8 | u64::from(bytes[from + at]))
        };
        let seconds = |asn: u64| {
            let ns = u128::from(asn) * u128::from(self.slot_ns);
            format!("{}.{:09}", ns / 1_000_000_000, ns % 1_000_000_000)
        };
        let hops: Vec<&[u8]> = bytes[14..].chunks(4).take_while(|hop| hop[0] != 0).collect();
        let source = hops.first().ok_or("no hop is recorded, so the source is unknown")?[0];
        if hops.iter().any(|hop| hop[1] == 0 || !(11..=26).contains(&hop[2])) {
            return Err("a hop has no transmissions, or a channel outside 11 to 26".to_owned());
        }
        // The last hop leads to the root, unless the record of the route is incomplete.
        let is_complete = hops.last().is_some_and(|hop| hop[0] == bytes[0]);
        row.fields.push_field(&seconds(number(6, 5)));
        row.fields.push_field(&source.to_string());
        row.fields.push_field(&self.root);
        row.fields.push_field(&seconds(number(1, 5)));
        row.fields.push_field(&if is_complete { hops.len().to_string() } else { String::new() });
        row.fields.push_field(&number(11, 2).to_string());
        for at in 0..MOST_HOPS {
            match hops.get(at) {
                Some(&[node, transmissions, channel, rssi]) => {
                    row.fields.push_field(&node.to_string());
                    row.fields.push_field(&transmissions.to_string());
                    row.fields.push_field(&channel.to_string());
                    row.fields.push_field(&(-i32::from(*rssi)).to_string());
                }
                _ => (0..4).for_each(|_| row.fields.push_field("")),
            }
        }
        Ok(())
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

    /// Rows as text, or why they cannot be used.
    fn rows(text: &str) -> Vec<(usize, String)> {
        let mut rows =
            open(Path::new("x.log"), Box::new(text.as_bytes()), &toml::Table::new()).unwrap();
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
                    "3.000000000,7,1,3.870000000,2,515,7,2,26,-84,4,1,11,-60{}",
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
            + &line([9, 2, 0, 0, 0, 0, 1, 0, 0, 0, 0, 3, 0, 0], &[[7, 2, 26, 84]]);
        let rows = rows(&text);
        assert_eq!(rows.len(), 7);
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
    }
}
