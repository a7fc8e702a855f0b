//! Tables written as files: CSV, gzipped CSV, Parquet.

use crate::units::Unit;
use flate2::Compression;
use flate2::write::GzEncoder;
use input::table::in_words;
use measure::table::DataTable;
use parquet::basic::{Compression as ParquetCompression, ZstdLevel};
use parquet::data_type::{DoubleType, Int64Type};
use parquet::errors::ParquetError;
use parquet::file::properties::WriterProperties;
use parquet::file::writer::SerializedFileWriter;
use parquet::schema::parser::parse_message_type;
use std::io::{BufWriter, Error, Write};
use std::path::Path;
use std::sync::Arc;

/// A format of the table.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum OutputFormat {
    /// Comma-separated values.
    Csv,
    /// Comma-separated values, gzipped.
    CsvGz,
    /// Apache Parquet.
    Parquet,
}

impl OutputFormat {
    /// The format that the name of a file asks for.
    #[must_use]
    pub fn of_path(path: &Path) -> Option<Self> {
        let name = path.file_name()?.to_str()?.to_lowercase();
        let formats = [(".csv", Self::Csv), (".csv.gz", Self::CsvGz), (".parquet", Self::Parquet)];
        formats.into_iter().find(|(ending, _)| name.ends_with(ending)).map(|(_, format)| format)
    }
}

/// Writes a table. Missing values are empty fields, or null.
///
/// # Errors
///
/// It cannot be written.
pub fn write(
    table: &DataTable,
    format: OutputFormat,
    file: impl Write + Send,
) -> Result<(), Error> {
    match format {
        OutputFormat::Csv => {
            let mut file = BufWriter::new(file);
            csv(table, &mut file)?;
            file.flush()
        }
        OutputFormat::CsvGz => {
            let mut file = GzEncoder::new(BufWriter::new(file), Compression::default());
            csv(table, &mut file)?;
            file.finish()?.flush()
        }
        OutputFormat::Parquet => {
            parquet(table, BufWriter::new(file)).map_err(|error| Error::other(in_words(&error)))
        }
    }
}

fn csv(table: &DataTable, file: &mut impl Write) -> Result<(), Error> {
    writeln!(file, "{}", table.names().join(","))?;
    let columns = columns(table);
    for row in 0..table.n_rows() {
        for (at, column) in columns.iter().enumerate() {
            if 0 < at {
                file.write_all(b",")?;
            }
            if column[row].is_finite() {
                // Zero has no sign in a table.
                write!(file, "{}", column[row] + 0.0)?;
            }
        }
        file.write_all(b"\n")?;
    }
    Ok(())
}

fn columns(table: &DataTable) -> Vec<&[f64]> {
    table.names().iter().map(|name| table.column(name).unwrap_or_default()).collect()
}

/// Rows of a row group.
const GROUP_ROWS: usize = 1 << 20;

fn parquet(table: &DataTable, file: impl Write + Send) -> Result<(), ParquetError> {
    let columns = columns(table);
    // Numbers of nodes, channels and counts have no unit, and are whole.
    let is_whole: Vec<bool> = table
        .names()
        .iter()
        .zip(&columns)
        .map(|(name, column)| {
            let mut known = column.iter().filter(|value| value.is_finite());
            let is_safe = |value: &f64| value.fract() == 0.0 && value.abs() < 9e15;
            name != "pdr" && Unit::of_column(name).is_none() && known.all(is_safe)
        })
        .collect();
    let fields: Vec<String> = table
        .names()
        .iter()
        .zip(&is_whole)
        .map(|(name, &is_whole)| {
            format!("optional {} {name};", if is_whole { "int64" } else { "double" })
        })
        .collect();
    let schema = parse_message_type(&format!("message table {{ {} }}", fields.join(" ")))?;
    let compression = ParquetCompression::ZSTD(ZstdLevel::default());
    let properties = WriterProperties::builder().set_compression(compression).build();
    let mut writer = SerializedFileWriter::new(file, Arc::new(schema), Arc::new(properties))?;
    let n_rows = table.n_rows();
    for start in (0..n_rows).step_by(GROUP_ROWS) {
        let rows = start..n_rows.min(start + GROUP_ROWS);
        let mut group = writer.next_row_group()?;
        for (column, &is_whole) in columns.iter().zip(&is_whole) {
            let levels: Vec<i16> =
                column[rows.clone()].iter().map(|value| i16::from(value.is_finite())).collect();
            let known = column[rows.clone()].iter().copied().filter(|value| value.is_finite());
            let Some(mut cells) = group.next_column()? else {
                return Err(ParquetError::General(
                    "the table has fewer columns than its schema".into(),
                ));
            };
            if is_whole {
                let known: Vec<i64> = known.map(|value| value as i64).collect();
                cells.typed::<Int64Type>().write_batch(&known, Some(&levels), None)?;
            } else {
                let known: Vec<f64> = known.map(|value| value + 0.0).collect();
                cells.typed::<DoubleType>().write_batch(&known, Some(&levels), None)?;
            }
            cells.close()?;
        }
        group.close()?;
    }
    writer.close().map(|_| ())
}

#[cfg(test)]
#[expect(clippy::disallowed_methods, reason = "tests read the files that are written")]
mod tests {
    use super::*;
    use measure::memory::MemoryBudget;

    #[test]
    fn a_table_reads_as_it_was_written_in_every_format() {
        let folder = tempfile::tempdir().unwrap();
        let names = ["time_s", "agent", "rssi_dbm"].map(str::to_owned);
        let columns =
            [vec![0.25, 1.0 / 3.0, -0.0], vec![1.0, 2.0, f64::NAN], vec![-70.0, f64::NAN, -71.0]];
        let table = DataTable::of_columns(names.into(), columns.into());
        for name in ["t.csv", "t.csv.gz", "t.parquet"] {
            let path = folder.path().join(name);
            let format = OutputFormat::of_path(&path).unwrap();
            write(&table, format, std::fs::File::create(&path).unwrap()).unwrap();
            let read = DataTable::read(&path, MemoryBudget::default()).unwrap();
            assert_eq!(read.names(), table.names(), "{name}");
            for column in table.names() {
                let bits = |table: &DataTable| -> Vec<Option<f64>> {
                    let values = table.column(column).unwrap().iter();
                    values.map(|value| value.is_finite().then_some(*value)).collect()
                };
                assert_eq!(bits(&read), bits(&table), "{name}, {column}");
            }
        }
        assert_eq!(OutputFormat::of_path(Path::new("t.json")), None);
        assert_eq!(OutputFormat::of_path(Path::new("T.CSV")), Some(OutputFormat::Csv));
    }
}
