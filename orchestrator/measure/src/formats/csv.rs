//! Comma-separated values: the first line names the columns. The format of every text that is no other.

use super::{Content, Format};
use crate::DataError;
use crate::table::DataTable;
use std::io::Read;
use std::path::Path;

/// The format.
pub const FORMAT: Format = Format {
    name: "CSV",
    recognises: |_, _| true,
    read: |path, content: Content<'_>| read(path, content),
};

pub(crate) fn read(path: &Path, content: impl Read) -> Result<DataTable, DataError> {
    let format = |message: String| DataError::Format { path: path.to_owned(), message };
    let mut reader =
        csv::ReaderBuilder::new().flexible(true).has_headers(false).from_reader(content);
    let mut record = csv::StringRecord::new();
    let mut next = |record: &mut csv::StringRecord| {
        reader.read_record(record).map_err(|error| match error.kind() {
            csv::ErrorKind::Utf8 { err, .. } => {
                format(format!("line {}: not text: {err}", reader_line(&error)))
            }
            _ => format(error.to_string()),
        })
    };
    if !next(&mut record)? {
        return Err(format("the file is empty: its first line must name the columns".into()));
    }
    let names: Vec<String> =
        record.iter().map(|name| name.trim_start_matches('\u{feff}').trim().to_owned()).collect();
    for (index, name) in names.iter().enumerate() {
        if name.is_empty() {
            return Err(format(format!("line 1: column {} has no name", index + 1)));
        }
        if names[..index].contains(name) {
            return Err(format(format!("line 1: two columns are named {name}; rename one")));
        }
    }
    if names.iter().all(|name| name.parse::<f64>().is_ok()) {
        return Err(format("line 1 must name the columns, but holds numbers; add a header".into()));
    }
    let mut table = DataTable::of_columns(names, Vec::new());
    table.columns = vec![Vec::new(); table.names.len()];
    table.path = path.to_owned();
    while next(&mut record)? {
        let line = record.position().map_or(0, |position| position.line() as usize);
        if record.len() != table.names.len() {
            return Err(format(format!(
                "line {line} has {} fields, but line 1 names {} columns",
                record.len(),
                table.names.len()
            )));
        }
        for (column, field) in record.iter().enumerate() {
            table.push(column, field.trim());
        }
        table.n_rows += 1;
    }
    Ok(table)
}

fn reader_line(error: &csv::Error) -> u64 {
    error.position().map_or(0, csv::Position::line)
}
