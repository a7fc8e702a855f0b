//! Measured packets: from end to end, sent and received.

use super::table::{CELL_BYTES, DataTable};
use super::{Rejected, Rejections, TWICE, time_of_day};
use proto::bounds::{LATENCY_S, PACKET_TIME_S};
use proto::types::PacketPurpose;
use std::collections::BTreeSet;

/// A packet from end to end.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MeasuredPacket {
    /// Line of the file that the row stands on, for messages; 0: it is simulated.
    pub line: usize,
    /// When it was made (s), from when the network was switched on.
    pub time_s: f64,
    /// The mote that made it.
    pub source: u32,
    /// The mote it was for.
    pub destination: u32,
    /// When it arrived (s); `None`: it was lost.
    pub received_s: Option<f64>,
    /// Hops it took; `None`: not known, or it was lost.
    pub hops: Option<u32>,
    /// Its payload (bytes); `None`: not known.
    pub payload_bytes: Option<u32>,
}

/// Measured packets, in the order of their times.
#[derive(Clone, Debug)]
pub struct MeasuredPackets {
    /// Those that can be used.
    pub packets: Vec<MeasuredPacket>,
    /// What could not be used.
    pub rejected: Vec<Rejected>,
    /// What was seen in the file, and what it does to an answer.
    pub warnings: Vec<String>,
    /// Rows in the file, but for packets that a run's network sent by itself, to come into being.
    pub n_rows: usize,
}

/// Kinds that nobody measured: packets that a network sends by itself to form, and exchanges and downloads, whose messages are packets
/// of their own.
pub const NOT_MEASURED: [&str; 3] =
    [PacketPurpose::Join.name(), PacketPurpose::Exchange.name(), PacketPurpose::Download.name()];

/// Columns of packets as people write them.
const COLUMNS: [&str; 4] = ["time_s", "source", "destination", "received_s"];
/// Columns of packets as a run leaves them.
const OF_RUN: [&str; 5] = ["created_ns", "source", "destination", "ended_ns", "delivered"];
/// The column of what packets of a run are for, in words.
pub const KIND: &str = "kind";
/// Columns with a meaning.
pub const KNOWN: [&str; 7] =
    ["time_s", time_of_day::START, "source", "destination", "received_s", "hops", "payload_bytes"];
/// Fewer usable packets carry nothing.
const FEWEST: usize = 20;

/// Whether a table has packets.
///
/// # Errors
///
/// The columns it lacks.
pub fn has_shape(table: &DataTable) -> Result<(), Vec<String>> {
    let lacking = |names: &[&str]| -> Vec<String> {
        let is_lacking = |name: &&&str| table.column(name).is_none();
        names.iter().filter(is_lacking).map(|name| (*name).to_owned()).collect()
    };
    let as_written = lacking(&COLUMNS);
    if as_written.is_empty() || lacking(&OF_RUN).is_empty() { Ok(()) } else { Err(as_written) }
}

/// Reads packets.
///
/// # Errors
///
/// What makes the whole file useless, in words for its author.
pub fn read(table: &DataTable) -> Result<MeasuredPackets, String> {
    has_shape(table).map_err(|lacking| table.lacking("packets", &lacking))?;
    // Each is kept, and looked up among the others by what it is.
    table.check_memory(2 * size_of::<MeasuredPacket>() + 4 * CELL_BYTES, "packets")?;
    let cell = |name: &str, row: usize| table.column(name).map_or(f64::NAN, |column| column[row]);
    let is_of_run = table.column("time_s").is_none();
    let mut runs: Vec<f64> = table.column("run").unwrap_or_default().to_vec();
    runs.sort_by(f64::total_cmp);
    runs.dedup();
    if 1 < runs.len() {
        return Err(format!(
            "holds {} campaigns (column run), and a network is compared with one at a time; split the file by run",
            runs.len()
        ));
    }
    let strange: BTreeSet<(usize, &str)> =
        table.strange().map(|(row, column, _)| (row, table.names()[column].as_str())).collect();
    let late = format!(
        "received_s is more than {} s after time_s, the longest latency that is read",
        LATENCY_S.most
    );
    let mut rejections = Rejections::default();
    let mut seen = BTreeSet::new();
    let mut packets = Vec::with_capacity(table.n_rows());
    let mut n_early = 0;
    // Text is written with quotation marks.
    let own: BTreeSet<usize> = table
        .strange()
        .filter(|(_, column, text)| {
            is_of_run
                && table.names()[*column] == KIND
                && NOT_MEASURED.contains(&text.trim_matches('"'))
        })
        .map(|(row, ..)| row)
        .collect();
    let others: Vec<usize> = (0..table.n_rows()).filter(|row| !own.contains(row)).collect();
    for &row in &others {
        let line = table.line(row);
        let (time_s, received_s) = if is_of_run {
            let arrived = cell("delivered", row) != 0.0;
            let ended_s = cell("ended_ns", row) * 1e-9;
            (cell("created_ns", row) * 1e-9, if arrived { ended_s } else { f64::NAN })
        } else {
            (cell("time_s", row), cell("received_s", row))
        };
        let mote = |name: &str| {
            let number = cell(name, row);
            let is_whole = number.fract() == 0.0 && (0.0..f64::from(u32::MAX)).contains(&number);
            is_whole.then_some(number as u32)
        };
        if (PACKET_TIME_S.most as f64) < time_s && time_s.is_finite() {
            return Err(format!(
                "line {line}: {} (7 days). Times count from when the network was switched on: if they are Unix times, \
                 subtract the time at which it was; if they are milliseconds, divide them by 1000",
                PACKET_TIME_S.refusal(&time_s.to_string())
            ));
        }
        let why = match (mote("source"), mote("destination")) {
            _ if !time_s.is_finite() || time_s < 0.0 => {
                "time_s is not a finite number of at least 0"
            }
            // A lost packet has an empty field there, not a word.
            _ if strange.contains(&(row, "received_s")) => "received_s is not a finite number",
            (None, _) => "source is not a mote number",
            (_, None) => "destination is not a mote number",
            (Some(source), Some(destination)) if source == destination => {
                "source and destination are the same mote"
            }
            _ if received_s < time_s => {
                n_early += 1;
                "received_s is earlier than time_s"
            }
            _ if LATENCY_S.most as f64 + time_s < received_s => &late,
            (Some(source), Some(destination)) => {
                let key = (time_s.to_bits(), received_s.to_bits(), source, destination);
                // A run numbers its packets: two alike are two.
                if is_of_run || seen.insert(key) {
                    let if_received = |name| mote(name).filter(|_| received_s.is_finite());
                    packets.push(MeasuredPacket {
                        line,
                        time_s,
                        source,
                        destination,
                        received_s: Some(received_s).filter(|at_s| at_s.is_finite()),
                        hops: if_received("hops").filter(|&hops| hops != 0),
                        payload_bytes: mote("payload_bytes").filter(|&bytes| bytes != 0),
                    });
                    continue;
                }
                TWICE
            }
        };
        rejections.add(why, line);
    }
    if others.len() < 2 * n_early {
        return Err("most packets have a received_s earlier than time_s; both must be times of the same clock, in s"
            .to_owned());
    }
    if packets.len() < FEWEST {
        return Err(format!(
            "only {} packets are usable; at least {FEWEST} are required",
            packets.len()
        ));
    }
    packets.sort_by(|a, b| a.time_s.total_cmp(&b.time_s).then(a.source.cmp(&b.source)));
    let warnings = warnings(&packets);
    Ok(MeasuredPackets {
        packets,
        rejected: rejections.into_list(),
        warnings,
        n_rows: others.len(),
    })
}

/// What to check before an answer is trusted.
fn warnings(packets: &[MeasuredPacket]) -> Vec<String> {
    let mut warnings = Vec::new();
    let arrived: Vec<&MeasuredPacket> =
        packets.iter().filter(|packet| packet.received_s.is_some()).collect();
    if arrived.is_empty() {
        warnings.push(
            "no packet arrived, so latency and hops cannot be compared; check whether received_s is empty in every row"
                .to_owned(),
        );
    } else if arrived.iter().all(|packet| packet.hops.is_none()) {
        warnings.push(
            "hops are unknown, so the routes of packets cannot be compared; add a column hops if you can"
                .to_owned(),
        );
    }
    let times_s = packets.iter().map(|packet| packet.time_s);
    let span_s = times_s.clone().fold(0.0, f64::max) - times_s.fold(f64::INFINITY, f64::min);
    let late = arrived.iter().filter(|p| p.received_s.is_some_and(|at| span_s < at - p.time_s));
    if 2 * late.count() > arrived.len() {
        warnings.push(
            "most packets have a latency longer than the time over which all packets were sent; check that times are in s"
                .to_owned(),
        );
    }
    warnings
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fmt::Write as _;
    use std::path::Path;

    fn table(rows: impl Fn(usize) -> String) -> DataTable {
        let mut text = "time_s,source,destination,received_s,hops\n".to_owned();
        for row in 0..30 {
            writeln!(text, "{}", rows(row)).unwrap();
        }
        DataTable::of_csv(Path::new("packets.csv"), text.as_bytes()).unwrap()
    }

    #[test]
    fn packets_are_read_and_what_cannot_be_used_is_counted() {
        let read = read(&table(|row| match row {
            3 => "3,1,0,,".to_owned(),
            4 => "4,1,0,3.5,1".to_owned(),
            5 => "5,1,1,6,1".to_owned(),
            6 => "6,x,0,7,1".to_owned(),
            8 => "7,1,0,7.5,2".to_owned(),
            9 => "9,1,0,lost,".to_owned(),
            _ => format!("{row},1,0,{},2", row as f64 + 0.5),
        }))
        .unwrap();
        assert_eq!(read.packets.len(), 25);
        assert_eq!(read.packets[3].received_s, None);
        assert_eq!((read.packets[0].received_s, read.packets[0].hops), (Some(0.5), Some(2)));
        let rejected: Vec<(&str, usize)> =
            read.rejected.iter().map(|one| (one.reason.as_str(), one.first_line)).collect();
        assert_eq!(
            rejected,
            [
                ("received_s is earlier than time_s", 6),
                ("source and destination are the same mote", 7),
                ("source is not a mote number", 8),
                (TWICE, 10),
                ("received_s is not a finite number", 11),
            ]
        );
    }

    #[test]
    fn one_arrival_far_in_the_future_is_rejected_with_its_line() {
        for received_s in [1e6, 1.7e9] {
            let read = read(&table(|row| {
                let at_s = if row == 4 { received_s } else { row as f64 + 0.5 };
                format!("{row},1,0,{at_s},2")
            }))
            .unwrap();
            assert_eq!((read.packets.len(), read.rejected[0].first_line), (29, 6));
            assert!(read.rejected[0].reason.contains("more than 3600 s"), "{:?}", read.rejected);
        }
    }

    #[test]
    fn a_campaign_of_unix_times_is_refused() {
        let start_s = 1_700_000_000;
        let error = read(&table(|row| format!("{},1,0,,", start_s + row))).unwrap_err();
        assert!(
            error.contains("line 2: the time of a packet (s) is 1700000000; at most 604800"),
            "{error}"
        );
    }

    #[test]
    fn files_that_cannot_carry_an_answer_are_refused() {
        let early = read(&table(|row| format!("{},1,0,{row},1", row + 7))).unwrap_err();
        assert!(early.contains("the same clock"), "{early}");
        let few = read(&table(|row| format!("{0},1,0,{0}.5,1", row % 4))).unwrap_err();
        assert!(few.contains("at least 20 are required"), "{few}");
        let other =
            DataTable::of_csv(Path::new("x.csv"), "time_s,source\n0,1\n".as_bytes()).unwrap();
        assert_eq!(has_shape(&other).unwrap_err(), ["destination", "received_s"]);
    }
}
