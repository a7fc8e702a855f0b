//! Apache Parquet: columns of numbers and truth values.
//!
//! A column is read by itself, and before it is the headers of its pages, which say what memory it needs. A column that holds no numbers
//! is read only if its name has a meaning.

use super::Format;
use crate::DataError;
use crate::memory::Memory;
use crate::table::{CELL_BYTES, DataTable};
use crate::{links, packets, robots};
use input::checked::CheckedFile;
use input::pages;
use input::table::in_words;
use parquet::basic::{ConvertedType, Type};
use parquet::column::reader::{ColumnReader, ColumnReaderImpl};
use parquet::data_type::{ByteArray, DataType};
use parquet::file::reader::{FileReader as _, Length as _, SerializedFileReader};
use parquet::schema::types::ColumnDescriptor;
use proto::bounds::{CELLS, ROWS, TABLE_BYTES};
use std::io::{BufReader, Seek as _, SeekFrom};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;

/// The format. It is read by place, not from beginning to end.
pub const FORMAT: Format = Format {
    name: "Parquet",
    recognises: |_, begin| begin.starts_with(b"PAR1"),
    read: |path, content| {
        let (file, memory) = content.by_place(path)?;
        read_or_refuse(path, file, memory)
    },
};

/// Reads a file. The library panics on some that are damaged.
fn read_or_refuse(path: &Path, file: CheckedFile, memory: Memory) -> Result<DataTable, DataError> {
    let refused = |message: String| DataError::Format { path: path.to_owned(), message };
    let table = catch_unwind(AssertUnwindSafe(|| read(file, memory).map_err(refused)));
    let table = table.unwrap_or_else(|_| {
        Err(refused("it is damaged: its columns cannot be decoded".to_owned()))
    })?;
    Ok(DataTable { path: path.to_owned(), first_line: 1, ..table })
}

/// So many values are decoded at a time.
const BATCH: usize = 1024;

fn read(file: CheckedFile, mut memory: Memory) -> Result<DataTable, String> {
    let words = |error: std::io::Error| error.to_string();
    let length = file.len();
    let mut pages = BufReader::new(file.clone());
    let described = pages::memory_of_description(&mut pages, length).map_err(words)?;
    memory.take(described, "the description at its end")?;
    let reader = SerializedFileReader::new(file).map_err(|error| in_words(&error))?;
    let schema = reader.metadata().file_metadata().schema_descr_ptr();
    let names: Vec<String> = schema.columns().iter().map(|column| column.path().string()).collect();
    let n_all = u64::try_from(reader.metadata().file_metadata().num_rows())
        .map_err(|_| "has less than 0 rows: it is damaged")?;
    ROWS.check(n_all)?;
    let n_cells = n_all.saturating_mul(names.len() as u64);
    CELLS.check(n_cells)?;
    for column in reader.metadata().row_groups().iter().flat_map(|group| group.columns()) {
        pages::check_place(column, length)?;
    }
    let nested =
        |column: &&ColumnDescriptor| 1 < column.path().parts().len() || 0 < column.max_rep_level();
    if let Some(nested) = schema.columns().iter().map(AsRef::as_ref).find(nested) {
        return Err(format!("the column {} is nested; columns must hold numbers", nested.path()));
    }
    let is_read = |column: &ColumnDescriptor| is_number(column) || has_meaning(column.name());
    let asked: Vec<usize> =
        (0..names.len()).filter(|&column| is_read(&schema.column(column))).collect();
    let chunks = reader.metadata().row_groups().iter().flat_map(|group| group.columns());
    let chunks = chunks.filter(|chunk| is_read(chunk.column_descr()));
    let size = chunks.map(|chunk| chunk.uncompressed_size().unsigned_abs());
    TABLE_BYTES.check(size.fold(0, u64::saturating_add))?;
    let what = format!("{n_all} rows of {} columns", names.len());
    memory.take(n_cells.saturating_mul(CELL_BYTES as u64), what)?;

    let mut table = DataTable::with_columns(names, memory)?;
    for group in 0..reader.num_row_groups() {
        let group = reader.get_row_group(group).map_err(|error| in_words(&error))?;
        let n_rows = usize::try_from(group.metadata().num_rows());
        let n_rows = n_rows.map_err(|_| "has less than 0 rows in a part: it is damaged")?;
        if n_all < (table.n_rows as u64).saturating_add(n_rows as u64) {
            return Err(format!("has more rows than the {n_all} that it says: it is damaged"));
        }
        for &column in &asked {
            let chunk = group.metadata().column(column);
            let name = chunk.column_path().string();
            let failed = |error: String| format!("the column {name}: {error}");
            pages.seek(SeekFrom::Start(chunk.byte_range().0)).map_err(words)?;
            let is_text = chunk.column_type() == Type::BYTE_ARRAY;
            let needed = pages::memory_of(&mut pages, chunk.byte_range().1, is_text);
            let needed = needed.map_err(|error| failed(error.to_string()))?;
            table.memory.take(needed.total(), format_args!("a page of the column {name}"))?;
            let reader = group.get_column_reader(column).map_err(|error| in_words(&error))?;
            add(&mut table, column, n_rows, reader, chunk.column_descr()).map_err(failed)?;
            table.memory.release(needed.total());
        }
        table.n_rows += n_rows;
    }
    if table.n_rows as u64 != n_all {
        return Err(format!("has {} rows, but says {n_all}: it is damaged", table.n_rows));
    }
    for column in &mut table.columns {
        column.resize(table.n_rows, f64::NAN);
    }
    table.strange.sort();
    Ok(table)
}

/// Whether a column has numbers or truth values.
fn is_number(column: &ColumnDescriptor) -> bool {
    use ConvertedType as Of;
    match column.physical_type() {
        Type::BOOLEAN | Type::FLOAT | Type::DOUBLE => true,
        Type::INT32 => matches!(
            column.converted_type(),
            Of::NONE | Of::INT_8 | Of::INT_16 | Of::INT_32 | Of::UINT_8 | Of::UINT_16 | Of::UINT_32
        ),
        Type::INT64 => matches!(column.converted_type(), Of::NONE | Of::INT_64 | Of::UINT_64),
        _ => false,
    }
}

/// Whether measurements have a column of this name.
fn has_meaning(name: &str) -> bool {
    name == packets::KIND
        || [&links::KNOWN[..], &robots::KNOWN, &packets::KNOWN].iter().any(|of| of.contains(&name))
}

/// Adds the values of a column to a table. Of values that are no numbers, text alone is kept.
fn add(
    table: &mut DataTable,
    column: usize,
    n_rows: usize,
    reader: ColumnReader,
    about: &ColumnDescriptor,
) -> Result<(), String> {
    use ColumnReader as Of;
    let to = (table, column, n_rows, about);
    let is_unsigned =
        matches!(about.converted_type(), ConvertedType::UINT_32 | ConvertedType::UINT_64);
    match reader {
        Of::BoolColumnReader(from) => add_values(to, from, |it| Ok(u8::from(*it).into())),
        Of::FloatColumnReader(from) => add_values(to, from, |it| Ok((*it).into())),
        Of::DoubleColumnReader(from) => add_values(to, from, |it| Ok(*it)),
        Of::Int32ColumnReader(from) if !is_number(about) => add_values(to, from, |_| Err("")),
        Of::Int64ColumnReader(from) if !is_number(about) => add_values(to, from, |_| Err("")),
        Of::Int32ColumnReader(from) if is_unsigned => {
            add_values(to, from, |it| Ok((*it as u32).into()))
        }
        Of::Int64ColumnReader(from) if is_unsigned => {
            add_values(to, from, |it| Ok(*it as u64 as f64))
        }
        Of::Int32ColumnReader(from) => add_values(to, from, |it| Ok((*it).into())),
        Of::Int64ColumnReader(from) => add_values(to, from, |it| Ok(*it as f64)),
        Of::Int96ColumnReader(from) => add_values(to, from, |_| Err("")),
        Of::FixedLenByteArrayColumnReader(from) => add_values(to, from, |_| Err("")),
        Of::ByteArrayColumnReader(from) => {
            add_values(to, from, |it: &ByteArray| Err(it.as_utf8().unwrap_or_default()))
        }
    }
}

/// Adds values. `number_of`: the number that a value is, or the text that it is instead.
fn add_values<T: DataType>(
    (table, column, n_rows, about): (&mut DataTable, usize, usize, &ColumnDescriptor),
    mut from: ColumnReaderImpl<T>,
    number_of: impl Fn(&T::T) -> Result<f64, &str>,
) -> Result<(), String> {
    let (mut values, mut levels) = (Vec::with_capacity(BATCH), Vec::with_capacity(BATCH));
    let (mut row, end) = (table.n_rows, table.n_rows + n_rows);
    while row < end {
        values.clear();
        levels.clear();
        let most = BATCH.min(end - row);
        let read = from.read_records(most, Some(&mut levels), None, &mut values);
        let (n_read, n_values, _) = read.map_err(|error| in_words(&error))?;
        if n_read == 0 {
            return Err("has fewer rows than the file: it is damaged".to_owned());
        }
        let mut present = values.iter().take(n_values);
        // Of a column without nulls there are no levels.
        let level_of = |k: usize| levels.get(k).copied().unwrap_or(about.max_def_level());
        for k in 0..n_read {
            let is_there = level_of(k) == about.max_def_level();
            let value = if is_there { present.next() } else { None };
            let number = match value.map(&number_of) {
                None => f64::NAN,
                Some(Ok(number)) if number.is_finite() => number,
                Some(other) => {
                    let number = other.map(|number| number.to_string());
                    let text = number.as_deref().unwrap_or_else(|text| text);
                    table.add_strange(row + k, column, text);
                    f64::NAN
                }
            };
            table.columns[column].push(number);
        }
        row += n_read;
        table.count_strange()?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::memory::MemoryBudget;
    use parquet::basic::Compression;
    use parquet::data_type::{ByteArrayType, DoubleType, Int64Type};
    use parquet::file::properties::WriterProperties;
    use parquet::file::writer::SerializedFileWriter;
    use parquet::schema::parser::parse_message_type;
    use std::sync::Arc;

    /// A file of one row with a number `time_s`, and text of so many bytes in a column of that name.
    fn with_text(path: &Path, name: &str, n_bytes: usize) {
        let schema =
            format!("message m {{ required double time_s; required binary {name} (UTF8); }}");
        let schema = Arc::new(parse_message_type(&schema).unwrap());
        let properties = WriterProperties::builder()
            .set_compression(Compression::ZSTD(Default::default()))
            .set_dictionary_enabled(false)
            .set_statistics_enabled(parquet::file::properties::EnabledStatistics::None)
            .build();
        let file = tempfile::NamedTempFile::new().unwrap();
        let to = file.reopen().unwrap();
        let mut writer = SerializedFileWriter::new(to, schema, Arc::new(properties)).unwrap();
        let mut group = writer.next_row_group().unwrap();
        let mut column = group.next_column().unwrap().unwrap();
        column.typed::<DoubleType>().write_batch(&[1.0], None, None).unwrap();
        column.close().unwrap();
        let mut column = group.next_column().unwrap().unwrap();
        let text = ByteArray::from(vec![b'x'; n_bytes]);
        column.typed::<ByteArrayType>().write_batch(&[text], None, None).unwrap();
        column.close().unwrap();
        group.close().unwrap();
        writer.close().unwrap();
        file.persist(path).unwrap();
    }

    #[test]
    fn text_that_nobody_asks_for_takes_no_memory_and_other_text_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("bomb.parquet");
        with_text(&path, "note", 30 << 20);
        assert!(path.metadata().unwrap().len() < 10_000);
        let table = DataTable::read(&path, MemoryBudget(1 << 20)).unwrap();
        assert_eq!(table.names(), ["time_s", "note"]);
        assert_eq!(table.column("time_s"), Some(&[1.0][..]));
        assert!(table.column("note").unwrap()[0].is_nan());
        assert_eq!(table.strange().count(), 0);

        with_text(&path, "tx", 30 << 20);
        let error = DataTable::read(&path, MemoryBudget(1 << 20)).unwrap_err().to_string();
        let expected =
            "needs more than 1 MiB of memory for a page of the column tx; allow more with";
        assert!(error.contains(expected), "{error}");
        let table = DataTable::read(&path, MemoryBudget::default()).unwrap();
        let strange: Vec<_> = table.strange().collect();
        assert_eq!(strange, [(0, 1, &*"x".repeat(64))]);
    }

    #[test]
    fn rows_and_groups_keep_their_order_their_gaps_and_their_text() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("data.parquet");
        let schema =
            "message m { optional int64 tx; optional binary kind (UTF8); required boolean b;
                      optional int64 at (TIMESTAMP_MILLIS); }";
        let schema = Arc::new(parse_message_type(schema).unwrap());
        let file = tempfile::NamedTempFile::new().unwrap();
        let mut writer =
            SerializedFileWriter::new(file.reopen().unwrap(), schema, Arc::default()).unwrap();
        for _ in 0..2 {
            let mut group = writer.next_row_group().unwrap();
            let mut column = group.next_column().unwrap().unwrap();
            column.typed::<Int64Type>().write_batch(&[7, -1], Some(&[1, 0, 1]), None).unwrap();
            column.close().unwrap();
            let mut column = group.next_column().unwrap().unwrap();
            let text = [ByteArray::from("join")];
            column.typed::<ByteArrayType>().write_batch(&text, Some(&[0, 1, 0]), None).unwrap();
            column.close().unwrap();
            let mut column = group.next_column().unwrap().unwrap();
            let truths = [true, false, true];
            column
                .typed::<parquet::data_type::BoolType>()
                .write_batch(&truths, None, None)
                .unwrap();
            column.close().unwrap();
            let mut column = group.next_column().unwrap().unwrap();
            column.typed::<Int64Type>().write_batch(&[1, 2, 3], Some(&[1, 1, 1]), None).unwrap();
            column.close().unwrap();
            group.close().unwrap();
        }
        writer.close().unwrap();
        file.persist(&path).unwrap();
        let table = DataTable::read(&path, MemoryBudget::default()).unwrap();
        let shown = |name: &str| format!("{:?}", table.column(name).unwrap());
        assert_eq!(shown("tx"), "[7.0, NaN, -1.0, 7.0, NaN, -1.0]");
        assert_eq!(shown("b"), "[1.0, 0.0, 1.0, 1.0, 0.0, 1.0]");
        assert_eq!(shown("at"), "[NaN, NaN, NaN, NaN, NaN, NaN]");
        assert_eq!(table.strange().collect::<Vec<_>>(), [(1, 1, "join"), (4, 1, "join")]);
    }
}
