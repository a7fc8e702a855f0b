//! K7: traces of link quality. They begin with a line of JSON, then come comma-separated values.
//!
//! Published traces differ in what they state: of the header only `start_date` is read, columns may come in any order and with others
//! among them, dates may have a space, channels a fraction of zero. A row that cannot be used is one of the table's: whoever reads
//! links says why.

use super::Format;
use super::csv::Records;
use crate::DataError;
use crate::memory::Memory;
use crate::table::DataTable;
use proto::bounds::{COLUMNS, LINE_BYTES};
use std::collections::BTreeSet;
use std::io::{BufRead, Read as _};
use std::path::Path;

/// The format.
pub const FORMAT: Format = Format {
    name: "K7",
    recognises: |_, begin| begin.first() == Some(&b'{'),
    read: |path, content| {
        let (content, memory) = content.uncounted();
        read(path, content, memory)
    },
};

/// Nanoseconds of a day: runs of a K7 trace.
const NS_PER_DAY: i128 = 86_400_000_000_000;
/// Frames of a row, where neither the row nor the header says how many were sent.
const USUAL_FRAMES: u64 = 100;

/// Columns of the table, and the fields of the trace that they are filled from.
const FIELDS: [(&str, &str); 8] = [
    ("time_s", "datetime"),
    // Days since the first row, so that each has its own number.
    ("run", "datetime"),
    ("tx", "src"),
    ("rx", "dst"),
    ("channel", "channel"),
    ("rssi_dbm", "mean_rssi"),
    ("pdr", "pdr"),
    ("frames", "tx_count"),
];
/// What a trace may lack: it is then of all channels, or every row of as many frames.
const OPTIONAL: [&str; 2] = ["channel", "tx_count"];

fn read(path: &Path, mut content: impl BufRead, memory: Memory) -> Result<DataTable, DataError> {
    let refused = |message: String| DataError::Format { path: path.to_owned(), message };
    let mut first = String::new();
    (&mut content)
        .take(LINE_BYTES.most)
        .read_line(&mut first)
        .map_err(|source| DataError::Read { path: path.to_owned(), source })?;
    let header: serde_json::Value = serde_json::from_str(&first)
        .map_err(|error| refused(format!("line 1: must be an object of JSON: {error}")))?;
    let start = header.get("start_date").and_then(serde_json::Value::as_str);
    let start_ns = start.and_then(physics::k7::nanoseconds).ok_or_else(|| {
        let found = start.map_or_else(String::new, |start| format!(", got {start:?}"));
        refused(format!("line 1: start_date must be a date like 2018-01-11T16:32:22.0{found}"))
    })?;
    let count = |key: &str| header.get(key).and_then(serde_json::Value::as_u64);
    let frames = ["transmission_count", "tx_count"].into_iter().find_map(count);
    let frames = frames.unwrap_or(USUAL_FRAMES).to_string();

    let mut records = Records::new(path, content, b',');
    let mut record = csv::StringRecord::new();
    if !records.next_text(&mut record)? {
        return Err(refused("line 2 must name the columns, but the file ends".to_owned()));
    }
    COLUMNS.check(record.len() as u64).map_err(|message| refused(format!("line 2: {message}")))?;
    let names: Vec<&str> = record.iter().map(str::trim).collect();
    let place = |field: &str| names.iter().position(|name| *name == field);
    let places = FIELDS.map(|(_, field)| place(field));
    let lacking: Vec<&str> = FIELDS
        .iter()
        .map(|(_, field)| *field)
        .filter(|field| place(field).is_none() && !OPTIONAL.contains(field))
        .collect();
    if let Some(first) = lacking.first() {
        let message = format!("line 2 must name the columns of a K7 trace, but lacks {first}");
        return Err(refused(message));
    }
    let n_columns = names.len();
    let columns = FIELDS.iter().map(|(column, _)| (*column).to_owned()).collect();
    let mut table = DataTable::with_columns(columns, memory).map_err(refused)?;
    table.path = path.to_owned();
    table.first_line = 3;
    let mut first_rows = FirstRows::default();
    while records.next_text(&mut record)? {
        let line = 1 + record.position().map_or(0, |position| position.line() as usize);
        if record.len() != n_columns {
            let message = format!("line {line} must have {n_columns} fields, got {}", record.len());
            return Err(refused(message));
        }
        let field = |at: usize| {
            let text = places[at].and_then(|place| record.get(place)).unwrap_or_default().trim();
            if text == "None" { "" } else { text }
        };
        let time_ns = physics::k7::nanoseconds(field(0)).map(|ns| ns - start_ns);
        let is_first = first_rows.next([field(2), field(3), field(4)]);
        match time_ns {
            Some(time_ns) if 0 <= time_ns => {
                let time_ns = if is_first { 0 } else { time_ns };
                table.push(0, &(time_ns as f64 * 1e-9).to_string());
                table.push(1, &(1 + time_ns / NS_PER_DAY).to_string());
            }
            // Rows without a usable date are refused, with its text, where links are read.
            Some(_) => {
                table.push(0, &format!("{} (before start_date)", field(0)));
                table.push(1, "1");
            }
            None => {
                table.push(0, &format!("{} (no date)", field(0)));
                table.push(1, "1");
            }
        }
        for (at, (column, _)) in FIELDS.iter().enumerate().skip(2) {
            let text = field(at);
            let is_usual = *column == "frames" && text.is_empty();
            table.push(at, if is_usual { &frames } else { text });
        }
        table.end_row().map_err(|refusal| refused(format!("line {line}: {refusal}")))?;
    }
    Ok(table)
}

/// Rows before the first whose link and channel came before: they hold from the beginning.
#[derive(Default)]
struct FirstRows {
    seen: BTreeSet<[String; 3]>,
    is_over: bool,
}

impl FirstRows {
    /// Whether the next row, of a sender, a receiver and a channel, is one of them.
    fn next(&mut self, link: [&str; 3]) -> bool {
        self.is_over = self.is_over || !self.seen.insert(link.map(str::to_owned));
        if self.is_over {
            self.seen.clear();
        }
        !self.is_over
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table(text: &str) -> Result<DataTable, String> {
        let read = read(Path::new("x.k7"), text.as_bytes(), Memory::UNLIMITED);
        read.map_err(|error| error.to_string())
    }

    #[test]
    fn published_traces_are_read_whatever_else_they_state() {
        let text = "{\"location\": \"hall\", \"start_date\": \"2017-09-22 10:02:07\", \"interframe_duration\": \"null\"}\n\
                    src,dst,datetime,transctr,mean_rssi,pdr,channel,tx_count\n\
                    1,19,2017-09-22 10:02:07,5,-62.5,0.9,11.0,96\n\
                    1,19,2017-09-22 10:03:07,6,-63,0.8,11.0,\n\
                    1,19,2017-09-22 10:01:07,7,-63,0.8,None,1\n";
        let table = table(text).unwrap();
        assert_eq!(table.names(), FIELDS.map(|(column, _)| column));
        let times_s = table.column("time_s").unwrap();
        assert!(times_s[0] == 0.0 && (times_s[1] - 60.0).abs() < 1e-9 && times_s[2].is_nan());
        assert_eq!(table.column("frames"), Some(&[96.0, 100.0, 1.0][..]));
        let links = crate::links::read(&table).unwrap();
        assert_eq!((links.rows.len(), links.rejected.len()), (2, 1));
        assert_eq!(links.rejected[0].first_line, 5);
        assert!(links.rejected[0].reason.starts_with("time_s is not"), "{:?}", links.rejected);
    }

    #[test]
    fn a_mean_over_channels_beside_them_does_not_count_twice() {
        let text = "{\"start_date\": \"2017-09-22 10:02:07\"}\n\
                    datetime,src,dst,channel,mean_rssi,pdr,tx_count\n\
                    2017-09-22 10:02:07,1,2,11,-62,0.9,100\n\
                    2017-09-22 10:02:07,1,2,,-62,0.9,100\n\
                    2017-09-22 10:02:07,1,3,,-62,0.9,100\n";
        let links = crate::links::read(&table(text).unwrap()).unwrap();
        let lines: Vec<usize> = links.rows.iter().map(|row| row.line).collect();
        assert_eq!((lines, links.rejected[0].first_line), (vec![3, 5], 4));
    }

    #[test]
    fn what_is_lacking_is_named() {
        for (text, expected) in [
            ("{\"start_date\": \"x\"}\n", "start_date must be a date like"),
            ("{\n", "line 1: must be an object of JSON"),
            ("{\"start_date\": \"2017-09-22 10:02:07\"}\n", "line 2 must name the columns"),
            (
                "{\"start_date\": \"2017-09-22 10:02:07\"}\nsrc,dst,datetime,pdr\n",
                "lacks mean_rssi",
            ),
        ] {
            let said = table(text).unwrap_err();
            assert!(said.contains(expected), "{said}");
        }
    }
}
