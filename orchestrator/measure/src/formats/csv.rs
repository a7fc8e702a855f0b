//! Comma-separated values: the first line names the columns. The format of every text that is no other.

use super::{Content, Format};
use crate::DataError;
use crate::memory::Memory;
use crate::table::DataTable;
use proto::bounds::{COLUMNS, LINE_BYTES};
use std::cell::Cell;
use std::collections::BTreeSet;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::rc::Rc;

/// The format.
pub const FORMAT: Format = Format {
    name: "CSV",
    recognises: |_, _| true,
    read: |path, content: Content<'_>| {
        let (content, memory) = content.uncounted();
        read(path, content, memory)
    },
};

/// Records of a CSV text, header included, each at most [`LINE_BYTES`] long.
#[derive(Debug)]
pub struct Records<R> {
    reader: csv::Reader<BoundedLines<R>>,
    path: PathBuf,
    record_start: Rc<Cell<u64>>,
}

impl<R: Read> Records<R> {
    /// Records of `content`, whose fields end at `delimiter`; `path` is named in errors.
    pub fn new(path: &Path, content: R, delimiter: u8) -> Self {
        let record_start = Rc::new(Cell::new(0));
        let content = BoundedLines {
            content,
            n_read: 0,
            is_held: false,
            record_start: Rc::clone(&record_start),
        };
        let reader = csv::ReaderBuilder::new()
            .flexible(true)
            .has_headers(false)
            .delimiter(delimiter)
            .from_reader(content);
        Self { reader, path: path.to_owned(), record_start }
    }

    /// Reads the next record as text; returns whether there is one.
    ///
    /// # Errors
    ///
    /// It cannot be read, is too long, or is not UTF-8: the line is named.
    pub fn next_text(&mut self, record: &mut csv::StringRecord) -> Result<bool, DataError> {
        self.next_by(|reader| reader.read_record(record))
    }

    /// Reads the next record as bytes; returns whether there is one.
    ///
    /// # Errors
    ///
    /// It cannot be read or is too long: the line is named.
    pub fn next_bytes(&mut self, record: &mut csv::ByteRecord) -> Result<bool, DataError> {
        self.next_by(|reader| reader.read_byte_record(record))
    }

    fn next_by(
        &mut self,
        read: impl FnOnce(&mut csv::Reader<BoundedLines<R>>) -> csv::Result<bool>,
    ) -> Result<bool, DataError> {
        let format = |message: String| DataError::Format { path: self.path.clone(), message };
        let (line, start) = (self.reader.position().line(), self.reader.position().byte());
        self.record_start.set(start);
        let found = read(&mut self.reader).map_err(|error| match error.kind() {
            csv::ErrorKind::Utf8 { err, .. } => {
                format(format!("line {}: not text: {err}", reader_line(&error)))
            }
            csv::ErrorKind::Io(error) => format(format!("line {line}: {error}")),
            _ => format(error.to_string()),
        })?;
        LINE_BYTES
            .check(self.reader.position().byte() - start)
            .map_err(|refusal| format(format!("line {line}: {refusal}")))?;
        Ok(found)
    }
}

pub(crate) fn read(
    path: &Path,
    content: impl Read,
    memory: Memory,
) -> Result<DataTable, DataError> {
    let format = |message: String| DataError::Format { path: path.to_owned(), message };
    let mut records = Records::new(path, content, b',');
    let mut record = csv::StringRecord::new();
    let mut next = |record: &mut csv::StringRecord| records.next_text(record);
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
    let mut table = DataTable::with_columns(names, memory).map_err(format)?;
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
/// Lines that end with CR LF end with LF behind it, by which the reader counts them.
#[derive(Debug)]
struct BoundedLines<R> {
    content: R,
    n_read: u64,
    /// Whether a CR is held back because what follows it was not yet read.
    is_held: bool,
    /// Where the record begins that is being read.
    record_start: Rc<Cell<u64>>,
}

/// How much is read ahead of the record (bytes).
const AHEAD_BYTES: u64 = 1 << 16;

impl<R: Read> Read for BoundedLines<R> {
    fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
        let length = self.n_read.saturating_sub(self.record_start.get());
        if LINE_BYTES.most + AHEAD_BYTES < length {
            let refusal = LINE_BYTES.refusal(&format!("more than {}", LINE_BYTES.most));
            return Err(std::io::Error::other(refusal));
        }
        let n = self.fill(buffer)?;
        self.n_read += n as u64;
        Ok(n)
    }
}

impl<R: Read> BoundedLines<R> {
    /// Reads without the CRs of line ends.
    fn fill(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
        loop {
            let start = usize::from(std::mem::take(&mut self.is_held));
            buffer[..start].fill(b'\r');
            let n = self.content.read(&mut buffer[start..])?;
            let filled = &mut buffer[..start + n];
            if n == 0 || !filled.contains(&b'\r') {
                return Ok(filled.len());
            }
            self.is_held = filled.last() == Some(&b'\r');
            let mut n_kept = 0;
            for at in 0..filled.len() {
                let is_line_end = filled[at] == b'\r'
                    && filled.get(at + 1).is_none_or(|following| *following == b'\n');
                if !is_line_end {
                    filled[n_kept] = filled[at];
                    n_kept += 1;
                }
            }
            if 0 < n_kept {
                return Ok(n_kept);
            }
        }
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
        read(Path::new("data.csv"), content, Memory::UNLIMITED).unwrap_err().to_string()
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
    fn rows_keep_their_lines_whatever_ends_these() {
        // Line ends that fall between two reads, alone in a read, and within a field.
        let parts: [&[u8]; 6] = [b"a,b\r", b"\n1,\"x\ry\"\r\n", b"\r", b"\n2", b",3\r", b"\n4,5"];
        let content =
            parts.into_iter().rfold(Box::new(std::io::empty()) as Box<dyn Read>, |rest, part| {
                Box::new(part.chain(rest))
            });
        let mut records = Records::new(Path::new("data.csv"), content, b',');
        let (mut record, mut read) = (csv::StringRecord::new(), Vec::new());
        while records.next_text(&mut record).unwrap() {
            let line = record.position().unwrap().line();
            read.push((line, record.iter().collect::<Vec<_>>().join("|")));
        }
        // The empty line is counted with the row behind it.
        let expected = [(1, "a|b"), (2, "1|x\ry"), (3, "2|3"), (5, "4|5")];
        assert_eq!(read, expected.map(|(line, text)| (line, text.to_owned())));
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
