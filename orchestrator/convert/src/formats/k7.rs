//! K7 traces of link quality, as they are published.
//!
//! The 6TiSCH simulator, and this program's other commands, read K7 files strictly. Published ones deviate: dates with a space, rows
//! from before `start_date`, channels written as `11.0`, rows for all channels together beside those of each.

use super::{Format, Row, Rows, UNCHECKED, refused};
use crate::time;
use measure::DataError;
use measure::formats::csv::Records;
use measure::formats::{Content, Uncounted};
use proto::bounds::{COLUMNS, LINE_BYTES};
use proto::config::Variant;
use std::io::{BufRead as _, Read as _};
use std::path::Path;

/// The format.
pub const FORMAT: Format = Format {
    variant: Variant {
        name: "k7",
        doc: "A K7 trace of link quality, plain or gzipped: a line of JSON, then comma-separated values.",
        fields: &[],
    },
    columns: &[
        ("time_s", "datetime"),
        ("tx", "src"),
        ("rx", "dst"),
        ("channel", "channel"),
        ("rssi_dbm", "mean_rssi"),
        ("pdr", "pdr"),
        ("frames", "tx_count"),
    ],
    check: UNCHECKED,
    open,
};

fn open<'a>(
    path: &Path,
    content: Content<'a>,
    _: &toml::Table,
) -> Result<Box<dyn Rows + 'a>, DataError> {
    let (mut content, _) = content.uncounted();
    let mut line = String::new();
    (&mut content)
        .take(LINE_BYTES.most)
        .read_line(&mut line)
        .map_err(|source| DataError::Read { path: path.to_owned(), source })?;
    let header: serde_json::Value = serde_json::from_str(&line)
        .map_err(|error| refused(path, format!("line 1 must be a JSON object: {error}")))?;
    let start = header.get("start_date").and_then(serde_json::Value::as_str);
    let start_ns = start.and_then(|start| time::parse(start, time::NS_PER_S));
    let start_ns = start_ns.ok_or_else(|| {
        refused(path, "line 1: start_date must be a date such as 2018-01-11T16:32:22")
    })?;
    let mut records = Records::new(path, content, b',');
    let mut record = ::csv::ByteRecord::new();
    if !records.next_bytes(&mut record)? {
        return Err(refused(path, "line 2 must name the columns, but the file ends"));
    }
    COLUMNS
        .check(record.len() as u64)
        .map_err(|refusal| refused(path, format!("line 2: {refusal}")))?;
    let names = record.iter().map(|name| String::from_utf8_lossy(name).trim().to_owned()).collect();
    Ok(Box::new(K7Rows { records, names, record, start_ns }))
}

struct K7Rows<'a> {
    records: Records<Uncounted<'a>>,
    names: Vec<String>,
    record: ::csv::ByteRecord,
    start_ns: i64,
}

impl Rows for K7Rows<'_> {
    fn names(&self) -> &[String] {
        &self.names
    }

    fn start_ns(&self) -> Option<i64> {
        Some(self.start_ns)
    }

    fn next(&mut self, row: &mut Row) -> Result<bool, DataError> {
        if !self.records.next_bytes(&mut self.record)? {
            return Ok(false);
        }
        // The line of JSON stands before what is read as CSV.
        row.line = self.record.position().map_or(0, |position| position.line() as usize + 1);
        row.fields.clear();
        for field in &self.record {
            let field = String::from_utf8_lossy(field);
            row.fields.push_field(if field.trim() == "None" { "" } else { &field });
        }
        row.problem = (self.record.len() != self.names.len())
            .then(|| format!("the number of fields is not {}, as in the header", self.names.len()));
        Ok(true)
    }
}
