//! Apache Parquet: columns of numbers and truth values.

use super::Format;
use crate::DataError;
use crate::table::DataTable;
use parquet::file::reader::{FileReader as _, SerializedFileReader};
use parquet::record::Field;
use proto::bounds::{CELLS, ROWS, TABLE_BYTES};
use std::fs::File;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;

/// The format. It is read by place, not from beginning to end.
#[expect(clippy::disallowed_methods, reason = "the file is opened again, to be read by place")]
pub const FORMAT: Format = Format {
    name: "Parquet",
    recognises: |_, begin| begin.starts_with(b"PAR1"),
    read: |path, _| {
        let file =
            File::open(path).map_err(|source| DataError::Read { path: path.to_owned(), source })?;
        read_or_refuse(path, file)
    },
};

/// Reads a file. The library panics on some that are damaged.
fn read_or_refuse(path: &Path, file: File) -> Result<DataTable, DataError> {
    catch_unwind(AssertUnwindSafe(|| read(path, file))).unwrap_or_else(|_| {
        let message = "it is damaged: its columns cannot be decoded".to_owned();
        Err(DataError::Format { path: path.to_owned(), message })
    })
}

fn read(path: &Path, file: File) -> Result<DataTable, DataError> {
    let format = |error: parquet::errors::ParquetError| DataError::Format {
        path: path.to_owned(),
        message: error.to_string(),
    };
    let length = file.metadata().map_or(0, |about| about.len());
    let reader = SerializedFileReader::new(file).map_err(format)?;
    let schema = reader.metadata().file_metadata().schema_descr_ptr();
    let names: Vec<String> = schema.columns().iter().map(|column| column.path().string()).collect();
    let refused = |message: String| DataError::Format { path: path.to_owned(), message };
    let n_rows = u64::try_from(reader.metadata().file_metadata().num_rows());
    let n_rows = n_rows.map_err(|_| refused("has less than 0 rows: it is damaged".to_owned()))?;
    ROWS.check(n_rows).map_err(refused)?;
    CELLS.check(n_rows.saturating_mul(names.len() as u64)).map_err(refused)?;
    for column in reader.metadata().row_groups().iter().flat_map(|group| group.columns()) {
        let start = column.dictionary_page_offset().unwrap_or(column.data_page_offset());
        let place = [start, column.data_page_offset(), column.compressed_size()].map(u64::try_from);
        let is_inside = match place {
            [Ok(start), Ok(_), Ok(size)] => start.saturating_add(size) <= length,
            _ => false,
        };
        if !is_inside {
            let message = format!("the column {} lies outside the file", column.column_path());
            return Err(refused(format!("{message}: it is damaged")));
        }
    }
    let sizes = reader.metadata().row_groups().iter().flat_map(|group| group.columns());
    let size = sizes.map(|column| column.uncompressed_size().unsigned_abs());
    TABLE_BYTES.check(size.fold(0, u64::saturating_add)).map_err(refused)?;
    if let Some(nested) = schema
        .columns()
        .iter()
        .find(|column| 1 < column.path().parts().len() || 0 < column.max_rep_level())
    {
        let message = format!("the column {} is nested; columns must hold numbers", nested.path());
        return Err(refused(message));
    }
    let mut table = DataTable::with_columns(names).map_err(refused)?;
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
        table.end_row().map_err(refused)?;
    }
    Ok(table)
}
