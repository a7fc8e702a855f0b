//! Comma-separated values: the first line names the columns. The format of every text that is no other.

use super::{Content, Format};
use crate::DataError;
use crate::table::DataTable;
use proto::bounds::{COLUMNS, LINE_BYTES};
use std::cell::Cell;
use std::collections::BTreeSet;
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
    let record_start = Cell::new(0);
    let content = BoundedLines { content, n_read: 0, record_start: &record_start };
    let mut reader =
        csv::ReaderBuilder::new().flexible(true).has_headers(false).from_reader(content);
    let mut record = csv::StringRecord::new();
    let mut next = |record: &mut csv::StringRecord| {
        let (line, start) = (reader.position().line(), reader.position().byte());
        record_start.set(start);
        let found = reader.read_record(record).map_err(|error| match error.kind() {
            csv::ErrorKind::Utf8 { err, .. } => {
                format(format!("line {}: not text: {err}", reader_line(&error)))
            }
            csv::ErrorKind::Io(error) => format(format!("line {line}: {error}")),
            _ => format(error.to_string()),
        })?;
        LINE_BYTES
            .check(reader.position().byte() - start)
            .map_err(|refusal| format(format!("line {line}: {refusal}")))?;
        Ok::<bool, DataError>(found)
    };
    if !next(&mut record)? {
        return Err(format("the file is empty: its first line must name the columns".into()));
    }
    let names: Vec<String> =
        record.iter().map(|name| name.trim_start_matches('\u{feff}').trim().to_owned()).collect();
    COLUMNS.check(names.len() as u64).map_err(|refusal| format(format!("line 1: {refusal}")))?;
    let mut seen = BTreeSet::new();
    for (index, name) in names.iter().enumerate() {
        if name.is_empty() {
            return Err(format(format!("line 1: column {} has no name", index + 1)));
        }
        if !seen.insert(name) {
            return Err(format(format!("line 1: two columns are named {name}; rename one")));
        }
    }
    if names.iter().all(|name| name.parse::<f64>().is_ok()) {
        return Err(format("line 1 must name the columns, but holds numbers; add a header".into()));
    }
    let mut table = DataTable::with_columns(names).map_err(format)?;
    table.path = path.to_owned();
    while next(&mut record)? {
        let line = record.position().map_or(0, |position| position.line() as usize);
        if record.len() != table.names().len() {
            return Err(format(format!(
                "line {line} has {} fields, but line 1 names {} columns",
                record.len(),
                table.names().len()
            )));
        }
        for (column, field) in record.iter().enumerate() {
            table.push(column, field.trim());
        }
        table.end_row().map_err(|refusal| format(format!("line {line}: {refusal}")))?;
    }
    Ok(table)
}

/// Stops a line that never ends before it fills memory: a quotation mark that is not closed, or a file without line breaks.
struct BoundedLines<'a, R> {
    content: R,
    n_read: u64,
    /// Where the record begins that is being read.
    record_start: &'a Cell<u64>,
}

/// How much is read ahead of the record (bytes).
const AHEAD_BYTES: u64 = 1 << 16;

impl<R: Read> Read for BoundedLines<'_, R> {
    fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
        let length = self.n_read.saturating_sub(self.record_start.get());
        if LINE_BYTES.most + AHEAD_BYTES < length {
            let refusal = LINE_BYTES.refusal(&format!("more than {}", LINE_BYTES.most));
            return Err(std::io::Error::other(refusal));
        }
        let n = self.content.read(buffer)?;
        self.n_read += n as u64;
        Ok(n)
    }
}

fn reader_line(error: &csv::Error) -> u64 {
    error.position().map_or(0, csv::Position::line)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Cursor;

    fn refusal(content: impl Read) -> String {
        read(Path::new("data.csv"), content).unwrap_err().to_string()
    }

    #[test]
    fn a_line_without_end_is_refused() {
        let bound = "the length of a line (bytes) is more than 1048576; at most 1048576 is read";
        assert_eq!(refusal(std::io::repeat(0)), format!("data.csv: line 1: {bound}"));
        let unclosed = "a,b\n1,\"2\n".as_bytes().chain(Cursor::new("3,4\n".repeat(600_000)));
        assert_eq!(refusal(unclosed), format!("data.csv: line 2: {bound}"));
        let long = format!("a,b\n1,{}\n", "2".repeat(LINE_BYTES.most as usize));
        assert!(
            refusal(long.as_bytes()).contains("line 2: the length of a line (bytes) is 1048579")
        );
    }

    #[test]
    fn forty_thousand_columns_are_refused() {
        let header: Vec<String> = (0..40_000).map(|column| format!("c{column}")).collect();
        assert_eq!(
            refusal(header.join(",").as_bytes()),
            "data.csv: line 1: the number of columns is 40000; at most 2000 is read"
        );
    }
}
