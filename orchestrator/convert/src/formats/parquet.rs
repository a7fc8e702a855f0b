//! Apache Parquet: rows of numbers, texts and times. Columns of lists and of groups are not read.

use super::{Format, Row, Rows, UNCHECKED, refused};
use ::parquet::basic::Type;
use ::parquet::file::metadata::RowGroupMetaData;
use ::parquet::file::reader::{FileReader as _, Length as _, SerializedFileReader};
use ::parquet::record::Field;
use ::parquet::record::reader::RowIter;
use input::checked::CheckedFile;
use input::pages;
use input::table::in_words;
use measure::DataError;
use measure::formats::Content;
use measure::memory::Memory;
use proto::bounds::{CELLS, COLUMNS, ROWS, TABLE_BYTES};
use proto::config::Variant;
use std::io::{BufReader, Seek as _, SeekFrom};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};

/// The format.
pub const FORMAT: Format = Format {
    variant: Variant {
        name: "parquet",
        doc: "Apache Parquet; times become seconds since 1970, and columns of lists and groups are not read.",
        fields: &[],
    },
    columns: &[],
    check: UNCHECKED,
    open,
};

fn open<'a>(
    path: &Path,
    content: Content<'a>,
    _: &toml::Table,
) -> Result<Box<dyn Rows + 'a>, DataError> {
    let (file, memory) = content.by_place(path)?;
    // The library panics on some files that are damaged.
    let opened = catch_unwind(AssertUnwindSafe(|| ParquetRows::open(path, file, memory)));
    let opened = opened.unwrap_or_else(|_| Err(DAMAGED.to_owned()));
    Ok(Box::new(opened.map_err(|message| refused(path, message))?))
}

const DAMAGED: &str = "it is damaged: its columns cannot be decoded";

struct ParquetRows {
    path: PathBuf,
    rows: RowIter<'static>,
    /// Names of the columns that are read, and their places in a row.
    names: Vec<String>,
    places: Vec<usize>,
    line: usize,
}

impl ParquetRows {
    fn open(path: &Path, file: CheckedFile, mut memory: Memory) -> Result<Self, String> {
        let words = |error: std::io::Error| error.to_string();
        let length = file.len();
        let mut pages = BufReader::new(file.clone());
        let described = pages::memory_of_description(&mut pages, length).map_err(words)?;
        memory.take(described, "the description at its end")?;
        let reader = SerializedFileReader::new(file).map_err(|error| in_words(&error))?;
        let metadata = reader.metadata();
        let fields = metadata.file_metadata().schema().get_fields();
        COLUMNS.check(fields.len() as u64)?;
        let n_rows = metadata.file_metadata().num_rows().max(0) as u64;
        ROWS.check(n_rows)?;
        CELLS.check(n_rows.saturating_mul(fields.len() as u64))?;
        let chunks = metadata.row_groups().iter().flat_map(RowGroupMetaData::columns);
        let size = chunks.clone().map(|chunk| chunk.uncompressed_size().unsigned_abs());
        TABLE_BYTES.check(size.fold(0, u64::saturating_add))?;
        for chunk in chunks {
            pages::check_place(chunk, length)?;
        }
        // The columns of a part are read side by side.
        for group in metadata.row_groups() {
            let mut needed = 0_u64;
            for chunk in group.columns() {
                pages.seek(SeekFrom::Start(chunk.byte_range().0)).map_err(words)?;
                let is_text = chunk.column_type() == Type::BYTE_ARRAY;
                let memory = pages::memory_of(&mut pages, chunk.byte_range().1, is_text)
                    .map_err(|error| format!("the column {}: {error}", chunk.column_path()))?;
                needed = needed.saturating_add(memory.total());
            }
            memory.take(needed, "the pages of a part")?;
            memory.release(needed);
        }
        let plain = fields.iter().enumerate().filter(|(_, field)| field.is_primitive());
        let (places, names): (Vec<usize>, Vec<String>) =
            plain.map(|(place, field)| (place, field.name().to_owned())).unzip();
        let rows = RowIter::from_file_into(Box::new(reader));
        Ok(Self { path: path.to_owned(), rows, names, places, line: 0 })
    }
}

impl Rows for ParquetRows {
    fn names(&self) -> &[String] {
        &self.names
    }

    fn next(&mut self, row: &mut Row) -> Result<bool, DataError> {
        let next = catch_unwind(AssertUnwindSafe(|| self.rows.next()));
        let next = next.map_err(|_| refused(&self.path, DAMAGED))?;
        let Some(found) = next else { return Ok(false) };
        let found = found.map_err(|error| refused(&self.path, in_words(&error)))?;
        self.line += 1;
        row.line = self.line;
        row.problem = None;
        row.fields.clear();
        let fields: Vec<&Field> = found.get_column_iter().map(|(_, field)| field).collect();
        for &place in &self.places {
            let text = fields.get(place).map_or_else(String::new, |field| text(field));
            row.fields.push_field(&text);
        }
        Ok(true)
    }
}

/// A value as text; a time in seconds.
fn text(field: &Field) -> String {
    let seconds = |count: i64, per_s: i64| {
        let (whole, part) = (count.div_euclid(per_s), count.rem_euclid(per_s));
        let width = per_s.ilog10() as usize;
        if whole < 0 {
            (count as f64 / per_s as f64).to_string()
        } else {
            format!("{whole}.{part:0width$}")
        }
    };
    match field {
        Field::Null | Field::Group(_) | Field::ListInternal(_) | Field::MapInternal(_) => {
            String::new()
        }
        Field::Str(text) => text.clone(),
        Field::Bytes(bytes) => String::from_utf8_lossy(bytes.data()).into_owned(),
        Field::Float(number) => number.to_string(),
        Field::Double(number) => number.to_string(),
        Field::Date(days) => (i64::from(*days) * 86_400).to_string(),
        Field::TimeMillis(count) => seconds(i64::from(*count), 1000),
        Field::TimeMicros(count) => seconds(*count, 1_000_000),
        Field::TimestampMillis(count) => seconds(*count, 1000),
        Field::TimestampMicros(count) => seconds(*count, 1_000_000),
        other => other.to_string(),
    }
}

#[cfg(test)]
#[expect(clippy::disallowed_methods, reason = "tests write the files that they read")]
mod tests {
    use super::*;
    use ::parquet::data_type::{ByteArray, ByteArrayType, DoubleType, Int64Type};
    use ::parquet::file::properties::WriterProperties;
    use ::parquet::file::writer::SerializedFileWriter;
    use ::parquet::schema::parser::parse_message_type;
    use measure::memory::MemoryBudget;
    use std::sync::Arc;

    #[test]
    fn numbers_texts_and_times_are_fields() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("log.parquet");
        let schema = "message m { required int64 at (TIMESTAMP_MILLIS); required binary node (UTF8); optional double rssi; }";
        let schema = Arc::new(parse_message_type(schema).unwrap());
        let file = std::fs::File::create(&path).unwrap();
        let properties = Arc::new(WriterProperties::builder().build());
        let mut writer = SerializedFileWriter::new(file, schema, properties).unwrap();
        let mut group = writer.next_row_group().unwrap();
        let mut column = group.next_column().unwrap().unwrap();
        let times = [1_515_688_342_250, 1_515_688_343_005];
        column.typed::<Int64Type>().write_batch(&times, None, None).unwrap();
        column.close().unwrap();
        let mut column = group.next_column().unwrap().unwrap();
        let nodes = [ByteArray::from("a"), ByteArray::from("b")];
        column.typed::<ByteArrayType>().write_batch(&nodes, None, None).unwrap();
        column.close().unwrap();
        let mut column = group.next_column().unwrap().unwrap();
        column.typed::<DoubleType>().write_batch(&[-70.5], Some(&[0, 1]), None).unwrap();
        column.close().unwrap();
        group.close().unwrap();
        writer.close().unwrap();

        let content = measure::formats::open(&path, MemoryBudget::default()).unwrap();
        let mut rows = open(&path, content, &toml::Table::new()).unwrap();
        assert_eq!(rows.names(), ["at", "node", "rssi"]);
        let (mut row, mut read) = (Row::default(), Vec::new());
        while rows.next(&mut row).unwrap() {
            read.push(row.fields.iter().collect::<Vec<_>>().join("|"));
        }
        assert_eq!(read, ["1515688342.250|a|", "1515688343.005|b|-70.5"]);
        let content = measure::formats::open(&path, MemoryBudget(10)).unwrap();
        assert!(open(&path, content, &toml::Table::new()).is_err());
    }
}
