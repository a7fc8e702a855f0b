//! A file as named columns of numbers.

use super::DataError;
use flate2::read::MultiGzDecoder;
use parquet::file::reader::{FileReader as _, SerializedFileReader};
use parquet::record::Field;
use sha2::{Digest as _, Sha256};
use std::fs::File;
use std::io::{BufRead as _, BufReader, Read};
use std::path::{Path, PathBuf};

/// Nanoseconds of a day: runs of a K7 trace.
const NS_PER_DAY: u64 = 86_400_000_000_000;

/// A table of numbers. A missing value is NaN.
#[derive(Clone, Debug)]
pub struct Table {
    /// The file.
    pub path: PathBuf,
    /// SHA-256 of the file, in hexadecimal digits.
    pub sha256: String,
    names: Vec<String>,
    columns: Vec<Vec<f64>>,
    /// Rows with a field that is not a finite number: row, column, what stands there. In order of rows.
    pub strange: Vec<(usize, usize, String)>,
    n_rows: usize,
    first_line: usize,
}

impl Table {
    /// Reads a file: Parquet if it says so at its beginning, else CSV, gzipped or not. Of the folder of a run, its links.
    ///
    /// # Errors
    ///
    /// It cannot be read, or is no table: the place is named.
    pub fn read(path: &Path) -> Result<Self, DataError> {
        let read = |source| DataError::Read { path: path.to_owned(), source };
        if path.is_dir() {
            return super::run::links(path);
        }
        let mut file = File::open(path).map_err(read)?;
        let sha256 = digest(&mut file).map_err(read)?;
        let mut magic = [0u8; 4];
        let mut begin = File::open(path).map_err(read)?;
        let n = begin.read(&mut magic).map_err(read)?;
        let file = File::open(path).map_err(read)?;
        let mut table = match &magic[..n] {
            b"PAR1" => Self::of_parquet(path, file)?,
            [0x1f, 0x8b, ..] => Self::of_text(path, MultiGzDecoder::new(BufReader::new(file)))?,
            _ => Self::of_text(path, file)?,
        };
        table.sha256 = sha256;
        Ok(table)
    }

    /// A table of columns that are at hand.
    #[must_use]
    pub fn of_columns(names: Vec<String>, columns: Vec<Vec<f64>>) -> Self {
        let n_rows = columns.first().map_or(0, Vec::len);
        Self {
            path: PathBuf::new(),
            sha256: String::new(),
            names,
            columns,
            strange: Vec::new(),
            n_rows,
            first_line: 2,
        }
    }

    /// Reads CSV, or a K7 trace: that begins with a line of JSON.
    fn of_text(path: &Path, content: impl Read) -> Result<Self, DataError> {
        let mut content = BufReader::new(content);
        let read = |source| DataError::Read { path: path.to_owned(), source };
        if content.fill_buf().map_err(read)?.first() != Some(&b'{') {
            return Self::of_csv(path, content);
        }
        let mut bytes = Vec::new();
        content.read_to_end(&mut bytes).map_err(read)?;
        let trace = netsim::k7::read(&bytes).map_err(|complaints| DataError::Format {
            path: path.to_owned(),
            message: complaints.first().map_or_else(String::new, ToString::to_string),
        })?;
        Ok(Self { path: path.to_owned(), first_line: 3, ..Self::of_k7(&trace) })
    }

    /// The rows of a K7 trace as an aggregated link table.
    fn of_k7(trace: &netsim::k7::K7) -> Self {
        let of = |value: &dyn Fn(&netsim::k7::Row) -> f64| trace.rows.iter().map(value).collect();
        let columns: [(&str, Vec<f64>); 8] = [
            ("time_s", of(&|row| row.from_ns as f64 * 1e-9)),
            // Days from the first row on, so that one can be told from another.
            ("run", of(&|row| 1.0 + (row.from_ns / NS_PER_DAY) as f64)),
            ("tx", of(&|row| f64::from(row.src))),
            ("rx", of(&|row| f64::from(row.dst))),
            ("channel", of(&|row| row.channel.map_or(f64::NAN, f64::from))),
            ("rssi_dbm", of(&|row| row.rssi_dbm.unwrap_or(f64::NAN))),
            ("pdr", of(&|row| row.pdr)),
            ("frames", of(&|row| row.tx_count.map_or(100.0, f64::from))),
        ];
        let (names, columns) =
            columns.into_iter().map(|(name, column)| (name.to_owned(), column)).unzip();
        Self::of_columns(names, columns)
    }

    /// Reads CSV: the first line names the columns.
    ///
    /// # Errors
    ///
    /// See [`Table::read`].
    pub fn of_csv(path: &Path, content: impl Read) -> Result<Self, DataError> {
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
        let names: Vec<String> = record
            .iter()
            .map(|name| name.trim_start_matches('\u{feff}').trim().to_owned())
            .collect();
        for (index, name) in names.iter().enumerate() {
            if name.is_empty() {
                return Err(format(format!("line 1: column {} has no name", index + 1)));
            }
            if names[..index].contains(name) {
                return Err(format(format!("line 1: two columns are named {name}")));
            }
        }
        if names.iter().all(|name| name.parse::<f64>().is_ok()) {
            return Err(format("line 1 must name the columns, but holds numbers".into()));
        }
        let mut table = Self::of_columns(names, Vec::new());
        table.columns = vec![Vec::new(); table.names.len()];
        table.path = path.to_owned();
        while next(&mut record)? {
            let line = record.position().map_or(0, |position| position.line() as usize);
            if record.len() != table.names.len() {
                return Err(format(format!(
                    "line {line} has {} fields, the first line names {} columns",
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

    fn push(&mut self, column: usize, field: &str) {
        let value = if field.is_empty() {
            f64::NAN
        } else {
            match field.parse::<f64>() {
                Ok(value) if value.is_finite() => value,
                _ => {
                    self.strange.push((self.n_rows, column, field.to_owned()));
                    f64::NAN
                }
            }
        };
        self.columns[column].push(value);
    }

    fn of_parquet(path: &Path, file: File) -> Result<Self, DataError> {
        let format = |error: parquet::errors::ParquetError| DataError::Format {
            path: path.to_owned(),
            message: error.to_string(),
        };
        let reader = SerializedFileReader::new(file).map_err(format)?;
        let schema = reader.metadata().file_metadata().schema_descr_ptr();
        let names: Vec<String> =
            schema.columns().iter().map(|column| column.path().string()).collect();
        let mut table = Self::of_columns(names, Vec::new());
        table.columns = vec![Vec::new(); table.names.len()];
        table.path = path.to_owned();
        table.first_line = 1;
        for row in reader.get_row_iter(None).map_err(format)? {
            let row = row.map_err(format)?;
            for (column, (_, field)) in row.get_column_iter().enumerate() {
                match field {
                    Field::Null => table.columns[column].push(f64::NAN),
                    field => {
                        let number = match field {
                            Field::Bool(truth) => Some(f64::from(u8::from(*truth))),
                            Field::Byte(n) => Some(f64::from(*n)),
                            Field::Short(n) => Some(f64::from(*n)),
                            Field::Int(n) => Some(f64::from(*n)),
                            Field::Long(n) => Some(*n as f64),
                            Field::UByte(n) => Some(f64::from(*n)),
                            Field::UShort(n) => Some(f64::from(*n)),
                            Field::UInt(n) => Some(f64::from(*n)),
                            Field::ULong(n) => Some(*n as f64),
                            Field::Float(n) => Some(f64::from(*n)),
                            Field::Double(n) => Some(*n),
                            _ => None,
                        };
                        match number.filter(|number| number.is_finite()) {
                            Some(number) => table.columns[column].push(number),
                            None => {
                                table.strange.push((table.n_rows, column, field.to_string()));
                                table.columns[column].push(f64::NAN);
                            }
                        }
                    }
                }
            }
            table.n_rows += 1;
        }
        Ok(table)
    }

    /// Number of rows.
    #[must_use]
    pub fn n_rows(&self) -> usize {
        self.n_rows
    }

    /// Names of the columns.
    #[must_use]
    pub fn names(&self) -> &[String] {
        &self.names
    }

    /// A column by name.
    #[must_use]
    pub fn column(&self, name: &str) -> Option<&[f64]> {
        self.names.iter().position(|other| other == name).map(|index| &self.columns[index][..])
    }

    /// The line of the file on which a row stands; in Parquet the number of the row, from 1.
    #[must_use]
    pub fn line(&self, row: usize) -> usize {
        row + self.first_line
    }
}

fn reader_line(error: &csv::Error) -> u64 {
    error.position().map_or(0, csv::Position::line)
}

fn digest(file: &mut File) -> std::io::Result<String> {
    let mut hash = Sha256::new();
    let mut buffer = vec![0u8; 1 << 16];
    loop {
        match file.read(&mut buffer)? {
            0 => break,
            n => hash.update(&buffer[..n]),
        }
    }
    Ok(hash.finalize().iter().map(|byte| format!("{byte:02x}")).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn csv(text: &str) -> Result<Table, DataError> {
        Table::of_csv(Path::new("data.csv"), text.as_bytes())
    }

    #[test]
    fn a_table_has_named_columns_and_missing_values() {
        let table = csv("time_s, rssi_dbm\n1,-70\n2,\n").unwrap();
        assert_eq!(table.names(), ["time_s", "rssi_dbm"]);
        assert_eq!(table.column("time_s"), Some(&[1.0, 2.0][..]));
        assert!(table.column("rssi_dbm").unwrap()[1].is_nan());
        assert_eq!(table.line(1), 3);
    }

    #[test]
    fn what_is_no_number_is_told_with_its_place() {
        let table = csv("a,b\n1,x\ninf,2\n").unwrap();
        assert_eq!(table.strange, [(0, 1, "x".to_owned()), (1, 0, "inf".to_owned())]);
    }

    #[test]
    fn what_is_no_table_is_refused() {
        for (text, part) in [
            ("", "empty"),
            ("1,2\n3,4\n", "name the columns"),
            ("a,a\n", "two columns are named a"),
            ("a,b\n1\n", "line 2 has 1 fields"),
        ] {
            let error = csv(text).unwrap_err().to_string();
            assert!(error.contains(part), "{error}");
        }
    }
}
