//! Comma-separated values with a header: what most programs write.

use super::{Format, Row, Rows, refused};
use ::csv::ByteRecord;
use measure::DataError;
use measure::formats::csv::Records;
use measure::formats::{Content, Uncounted};
use proto::bounds::COLUMNS;
use proto::config::{Problem, Section, variant};
use std::collections::BTreeSet;
use std::path::Path;

/// The format.
pub const FORMAT: Format = Format { variant: variant::<Keys>("csv"), columns: &[], check, open };

/// Comma-separated values, plain or gzipped; the first line names the columns.
#[derive(Section)]
struct Keys {
    /// The character between two fields; "\t" for tabs.
    #[key(default = ",")]
    delimiter: String,
}

fn check(keys: &toml::Table, path: &str, problems: &mut Vec<Problem>) {
    let Keys { delimiter } = Keys::read(keys);
    if delimiter.len() != 1 || ["\n", "\r", "\""].contains(&&*delimiter) {
        let message = "must be one character, such as \",\", \";\" or \"\\t\"";
        problems.push(Problem::new(format!("{path}.delimiter"), message).value(delimiter));
    }
}

fn open<'a>(
    path: &Path,
    content: Content<'a>,
    keys: &toml::Table,
) -> Result<Box<dyn Rows + 'a>, DataError> {
    let delimiter = Keys::read(keys).delimiter.bytes().next().unwrap_or(b',');
    let mut records = Records::new(path, content.uncounted().0, delimiter);
    let mut record = ByteRecord::new();
    if !records.next_bytes(&mut record)? {
        return Err(refused(path, "the file is empty: its first line must name the columns"));
    }
    COLUMNS
        .check(record.len() as u64)
        .map_err(|refusal| refused(path, format!("line 1: {refusal}")))?;
    let names: Vec<String> = record
        .iter()
        .map(|name| String::from_utf8_lossy(name).trim_start_matches('\u{feff}').trim().to_owned())
        .collect();
    if names.iter().all(|name| name.parse::<f64>().is_ok()) {
        return Err(refused(path, "line 1 must name the columns, but holds numbers; add a header"));
    }
    let mut seen = BTreeSet::new();
    // Pandas writes the index of a table as a column without a name; columns without a name cannot be asked for.
    if let Some(twice) = names.iter().find(|name| !name.is_empty() && !seen.insert(*name)) {
        return Err(refused(path, format!("line 1: two columns are named {twice}; rename one")));
    }
    Ok(Box::new(CsvRows { records, names, record }))
}

struct CsvRows<'a> {
    records: Records<Uncounted<'a>>,
    names: Vec<String>,
    record: ByteRecord,
}

impl Rows for CsvRows<'_> {
    fn names(&self) -> &[String] {
        &self.names
    }

    fn next(&mut self, row: &mut Row) -> Result<bool, DataError> {
        if !self.records.next_bytes(&mut self.record)? {
            return Ok(false);
        }
        row.line = self.record.position().map_or(0, |position| position.line() as usize);
        row.fields.clear();
        for field in &self.record {
            // What is not UTF-8 is not a number either.
            row.fields.push_field(&String::from_utf8_lossy(field));
        }
        row.problem = (self.record.len() != self.names.len())
            .then(|| format!("the number of fields is not {}, as in the header", self.names.len()));
        Ok(true)
    }
}
