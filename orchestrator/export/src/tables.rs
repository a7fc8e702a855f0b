//! Parquet tables as CSV. A null is an empty field.

use super::{ExportError, Exported};
use parquet::record::Field;
use record::TABLES;
use record::result::ResultFolder;
use std::path::Path;

/// Writes every table of a run.
pub(super) fn export(run: &ResultFolder, folder: &Path) -> Result<Vec<Exported>, ExportError> {
    let mut written = Vec::new();
    for table in TABLES {
        if run.has(table.file) {
            let path = folder.join(table.file).with_extension("csv");
            let n_entries = convert(run, table.file, &path)?;
            written.push(Exported { path, n_entries });
        }
    }
    if written.is_empty() {
        return Err(ExportError::NoTables { path: run.path().to_owned() });
    }
    Ok(written)
}

fn convert(run: &ResultFolder, name: &str, path: &Path) -> Result<u64, ExportError> {
    let table = run.table(name)?;
    let failed = |error: csv::Error| ExportError::Write {
        path: path.to_owned(),
        source: std::io::Error::other(error),
    };
    let file = system::File::create(path).map_err(ExportError::write(path))?;
    let mut out = csv::Writer::from_writer(file);
    let mut n_rows = 0;
    table.each_row(|row| {
        if n_rows == 0 {
            out.write_record(row.get_column_iter().map(|(name, _)| name)).map_err(failed)?;
        }
        let cells = row.get_column_iter().map(|(_, field)| text(field));
        out.write_record(cells).map_err(failed)?;
        n_rows += 1;
        Ok::<(), ExportError>(())
    })?;
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
