//! Parquet tables as CSV. A null is an empty field.

use super::{ExportError, Exported};
use parquet::errors::ParquetError;
use parquet::file::reader::SerializedFileReader;
use parquet::record::Field;
use record::TABLES;
use std::fs::File;
use std::path::Path;

/// Writes every table of a run.
pub(super) fn export(run: &Path, folder: &Path) -> Result<Vec<Exported>, ExportError> {
    let mut written = Vec::new();
    for table in TABLES {
        let source = run.join(table.file);
        if source.exists() {
            let path = folder.join(table.file).with_extension("csv");
            let n_entries = convert(&source, &path)?;
            written.push(Exported { path, n_entries });
        }
    }
    if written.is_empty() {
        return Err(ExportError::NoTables { path: run.to_owned() });
    }
    Ok(written)
}

fn convert(source: &Path, path: &Path) -> Result<u64, ExportError> {
    let unreadable = |error: ParquetError| ExportError::Table {
        path: source.to_owned(),
        message: error.to_string(),
    };
    let file = File::open(source).map_err(|error| unreadable(error.into()))?;
    let reader = SerializedFileReader::new(file).map_err(unreadable)?;
    let failed = |error: csv::Error| ExportError::Write {
        path: path.to_owned(),
        source: std::io::Error::other(error),
    };
    let mut out = csv::Writer::from_path(path).map_err(failed)?;
    let mut n_rows = 0;
    for row in reader {
        let row = row.map_err(unreadable)?;
        if n_rows == 0 {
            out.write_record(row.get_column_iter().map(|(name, _)| name)).map_err(failed)?;
        }
        let cells = row.get_column_iter().map(|(_, field)| text(field));
        out.write_record(cells).map_err(failed)?;
        n_rows += 1;
    }
    out.flush().map_err(ExportError::write(path))?;
    Ok(n_rows)
}

/// A value as CSV has it: numbers so that reading them gives the same again.
fn text(field: &Field) -> String {
    match field {
        Field::Null => String::new(),
        Field::Bool(value) => value.to_string(),
        Field::UInt(value) => value.to_string(),
        Field::ULong(value) => value.to_string(),
        Field::Float(value) => value.to_string(),
        Field::Double(value) => value.to_string(),
        Field::Str(value) => value.clone(),
        other => other.to_string(),
    }
}
