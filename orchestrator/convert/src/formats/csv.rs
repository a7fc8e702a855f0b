//! Text with a row on each line, its fields between commas, semicolons, tabs or spaces: what most programs write.

use super::{Format, Row, Rows, refused};
use ::csv::ByteRecord;
use measure::DataError;
use measure::formats::csv::Records;
use measure::formats::{Content, Uncounted};
use proto::bounds::{COLUMNS, LINE_BYTES};
use proto::config::{Choice, Problem, Section, variant};
use std::borrow::Cow;
use std::collections::BTreeSet;
use std::io::{BufRead as _, Read as _};
use std::path::Path;

/// The format.
pub const FORMAT: Format = Format { variant: variant::<Keys>("csv"), columns: &[], check, open };

/// Comma-separated values, plain or gzipped; the first line names the columns.
#[derive(Section)]
struct Keys {
    /// The character between two fields; "\t" for tabs. A space stands for any number of spaces and tabs.
    #[key(default = ",")]
    delimiter: String,
    /// What stands between the whole part and the fraction of a number.
    #[key(default = DecimalMark::Point)]
    decimal: DecimalMark,
    /// Lines before the one that names the columns, which are not read.
    #[key(range = 0..=10_000, default = 0)]
    skip_lines: u16,
    /// Names of the columns of a file that has no line of them, in order.
    #[key(length = 1..=2000)]
    names: Option<Vec<String>>,
    /// Lines that begin with this character are not read.
    comment: Option<String>,
}

/// What stands between the whole part and the fraction of a number.
#[derive(Choice, Clone, Copy, Debug, PartialEq, Eq)]
enum DecimalMark {
    /// 1234.5
    Point,
    /// 1234,5 or 1.234,5
    Comma,
}

fn check(keys: &toml::Table, path: &str, problems: &mut Vec<Problem>) {
    let Keys { delimiter, decimal, comment, names, .. } = Keys::read(keys);
    if delimiter.len() != 1 || ["\n", "\r", "\""].contains(&&*delimiter) {
        let message = "must be one character, such as \",\", \";\", \" \" or \"\\t\"";
        problems.push(Problem::new(format!("{path}.delimiter"), message).value(&delimiter));
    }
    if delimiter == "," && decimal == DecimalMark::Comma {
        let message = "excludes delimiter = \",\", which would divide numbers; state the delimiter";
        problems.push(Problem::new(format!("{path}.decimal"), message));
    }
    if let Some(comment) = comment.filter(|comment| comment.len() != 1) {
        let message = "must be one character, such as \"#\"";
        problems.push(Problem::new(format!("{path}.comment"), message).value(comment));
    }
    if let Some(twice) = names.as_deref().and_then(repeated) {
        let message = format!("has {twice:?} twice; every column needs a name of its own");
        problems.push(Problem::new(format!("{path}.names"), message));
    }
}

/// A name that occurs again. Columns without a name cannot be asked for.
fn repeated(names: &[String]) -> Option<&String> {
    let mut seen = BTreeSet::new();
    names.iter().find(|name| !name.is_empty() && !seen.insert(*name))
}

fn open<'a>(
    path: &Path,
    content: Content<'a>,
    keys: &toml::Table,
) -> Result<Box<dyn Rows + 'a>, DataError> {
    let keys = Keys::read(keys);
    let delimiter = keys.delimiter.bytes().next().unwrap_or(b',');
    let mut content = content.uncounted().0;
    let mut skipped = Vec::new();
    for _ in 0..keys.skip_lines {
        skipped.clear();
        let read = (&mut content).take(LINE_BYTES.most).read_until(b'\n', &mut skipped);
        read.map_err(|source| DataError::Read { path: path.to_owned(), source })?;
    }
    // Fields between spaces are told apart here: there may be several, also at the beginning of a line.
    let records = Records::new(path, content, if delimiter == b' ' { b'\0' } else { delimiter });
    let mut rows = CsvRows {
        records,
        names: keys.names.clone().unwrap_or_default(),
        record: ByteRecord::new(),
        skipped: keys.skip_lines.into(),
        is_spaced: delimiter == b' ',
        has_decimal_comma: keys.decimal == DecimalMark::Comma,
        comment: keys.comment.and_then(|comment| comment.bytes().next()),
    };
    if keys.names.is_some() {
        return Ok(Box::new(rows));
    }
    let first = rows.skipped + 1;
    if !rows.next_record()? {
        return Err(refused(path, "the file is empty: its first line must name the columns"));
    }
    let mut header = Row::default();
    rows.fill(&mut header);
    COLUMNS
        .check(header.fields.len() as u64)
        .map_err(|refusal| refused(path, format!("line {first}: {refusal}")))?;
    let names = header.fields.iter();
    rows.names = names.map(|name| name.trim_start_matches('\u{feff}').trim().to_owned()).collect();
    if rows.names.iter().all(|name| name.parse::<f64>().is_ok()) {
        let message = format!(
            "line {first} must name the columns, but holds numbers; add a header, or write names = [\"time\", …]"
        );
        return Err(refused(path, message));
    }
    // Pandas writes the index of a table as a column without a name.
    if let Some(twice) = repeated(&rows.names) {
        let message = format!("line {first}: two columns are named {twice}; rename one");
        return Err(refused(path, message));
    }
    Ok(Box::new(rows))
}

struct CsvRows<'a> {
    records: Records<Uncounted<'a>>,
    names: Vec<String>,
    record: ByteRecord,
    /// Lines before the first record.
    skipped: usize,
    is_spaced: bool,
    has_decimal_comma: bool,
    comment: Option<u8>,
}

impl CsvRows<'_> {
    /// Reads the next record that is no comment.
    fn next_record(&mut self) -> Result<bool, DataError> {
        while self.records.next_bytes(&mut self.record)? {
            let begin = self.record.get(0).and_then(|field| field.trim_ascii_start().first());
            if self.comment.is_none() || begin.copied() != self.comment {
                return Ok(true);
            }
        }
        Ok(false)
    }

    /// The fields of the record.
    fn fill(&self, row: &mut Row) {
        row.line = self.record.position().map_or(0, |at| at.line() as usize + self.skipped);
        row.fields.clear();
        for field in &self.record {
            let field = text(field);
            if self.is_spaced {
                field.split_ascii_whitespace().for_each(|part| self.push(row, part));
            } else {
                self.push(row, &field);
            }
        }
    }

    fn push(&self, row: &mut Row, field: &str) {
        match Some(field).filter(|_| self.has_decimal_comma).and_then(with_point) {
            Some(number) => row.fields.push_field(&number),
            None => row.fields.push_field(field),
        }
    }
}

impl Rows for CsvRows<'_> {
    fn names(&self) -> &[String] {
        &self.names
    }

    fn next(&mut self, row: &mut Row) -> Result<bool, DataError> {
        if !self.next_record()? {
            return Ok(false);
        }
        self.fill(row);
        row.problem = (row.fields.len() != self.names.len())
            .then(|| format!("the number of fields is not {}, as in the header", self.names.len()));
        Ok(true)
    }
}

/// A text. What is not UTF-8 is taken for Latin-1 (ISO 8859-1), so that different names stay different.
pub(crate) fn text(bytes: &[u8]) -> Cow<'_, str> {
    match std::str::from_utf8(bytes) {
        Ok(text) => Cow::Borrowed(text),
        Err(_) => Cow::Owned(bytes.iter().copied().map(char::from).collect()),
    }
}

/// A number with a decimal comma as one with a point, if the text is one: `1.234,5` is 1234.5.
pub(crate) fn with_point(text: &str) -> Option<String> {
    let (whole, fraction) = text.trim().split_once(',')?;
    let digits = |text: &str| text.bytes().all(|byte| byte.is_ascii_digit());
    let (mantissa, exponent) = fraction.split_once(['e', 'E']).unwrap_or((fraction, ""));
    let unsigned = whole.trim_start_matches(['-', '+']);
    let mut groups = unsigned.split('.');
    let is_grouped =
        groups.next().is_some_and(digits) && groups.all(|group| group.len() == 3 && digits(group));
    let is_number = is_grouped
        && !mantissa.is_empty()
        && digits(mantissa)
        && digits(exponent.trim_start_matches(['-', '+']));
    is_number.then(|| format!("{}.{fraction}", whole.replace('.', "")))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::formats::checked;
    use measure::memory::MemoryBudget;

    /// Names of the fields; and of each row its line, and its fields or why it has none.
    type Read = (Vec<String>, Vec<(usize, String)>);

    fn rows(text: &str, keys: &str) -> Result<Read, String> {
        let keys = checked::<Keys>(keys);
        let content = Content::new(text.as_bytes(), MemoryBudget::default());
        let mut rows =
            open(Path::new("log.csv"), content, &keys).map_err(|error| error.to_string())?;
        let (mut row, mut read) = (Row::default(), Vec::new());
        while rows.next(&mut row).map_err(|error| error.to_string())? {
            let fields: Vec<&str> = row.fields.iter().collect();
            read.push((row.line, row.problem.take().unwrap_or_else(|| fields.join("|"))));
        }
        Ok((rows.names().to_vec(), read))
    }

    #[test]
    fn lines_keep_their_numbers_behind_skipped_ones_and_comments() {
        let text = "made by a logger\n\n# units\n,t,x\n0,1,2\n# pause\n1,3,4\n";
        let (names, read) = rows(text, "skip_lines = 2\ncomment = \"#\"").unwrap();
        assert_eq!(names, ["", "t", "x"]);
        assert_eq!(read, [(5, "0|1|2".to_owned()), (7, "1|3|4".to_owned())]);
        let (_, read) = rows(",t,x\n0,1,2\n1,3\n", "").unwrap();
        assert_eq!(read[0], (2, "0|1|2".to_owned()));
        assert_eq!(read[1].0, 3);
    }

    #[test]
    fn files_without_a_header_and_fields_between_spaces_are_read() {
        let (names, read) =
            rows("1  2 -70\n 2\t3 -71\n", "delimiter = \" \"\nnames = [\"t\", \"tx\", \"rssi\"]")
                .unwrap();
        assert_eq!(names, ["t", "tx", "rssi"]);
        assert_eq!(read, [(1, "1|2|-70".to_owned()), (2, "2|3|-71".to_owned())]);
        assert!(rows("1,2\n", "").unwrap_err().contains("line 1 must name the columns"));
    }

    #[test]
    fn text_in_latin_1_keeps_its_letters() {
        assert_eq!(text(b"Kn\xf6ten"), "Knöten");
        assert_eq!(text("Knöten".as_bytes()), "Knöten");
    }

    #[test]
    fn a_decimal_comma_becomes_a_point_in_numbers_only() {
        let (_, read) =
            rows("t;x;n\n1.234,5;-0,25;a,b\n", "delimiter = \";\"\ndecimal = \"comma\"").unwrap();
        assert_eq!(read, [(2, "1234.5|-0.25|a,b".to_owned())]);
        assert_eq!(with_point("1,5e-3").as_deref(), Some("1.5e-3"));
        for text in ["1.5", "1,2,3", "12.3,4", ",", "1,"] {
            assert_eq!(with_point(text), None, "{text}");
        }
        let mut problems = Vec::new();
        check(&checked::<Keys>("decimal = \"comma\""), "input[0]", &mut problems);
        assert_eq!(problems.len(), 1);
    }
}
