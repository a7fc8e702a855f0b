//! A Parquet table of a result, read within a memory budget.
//!
//! A stranger may have written the table, and a few bytes of it can stand for gigabytes: before a part of it is decoded, the headers of
//! its pages say what memory that takes.

use crate::checked::CheckedFile;
use crate::memory::{Memory, MemoryBudget};
use crate::pages;
use crate::result::ResultError;
use parquet::basic::Type as PhysicalType;
use parquet::errors::ParquetError;
use parquet::file::reader::{FileReader as _, RowGroupReader, SerializedFileReader};
use parquet::record::Row;
use parquet::schema::types::Type;
use std::io::{BufReader, Seek as _, SeekFrom};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};

/// A table of a result.
pub struct Table {
    path: PathBuf,
    file: CheckedFile,
    length: u64,
    reader: SerializedFileReader<CheckedFile>,
    memory: Memory,
}

/// How often a text is held beside its page: in a row, and in what is made of the row.
const COPIES_OF_TEXT: u64 = 2;

impl Table {
    /// Reads what describes a table.
    pub(crate) fn open(
        path: PathBuf,
        mut file: CheckedFile,
        budget: MemoryBudget,
    ) -> Result<Self, ResultError> {
        let length = parquet::file::reader::Length::len(&file);
        let described = pages::memory_of_description(&mut file, length)
            .map_err(|source| ResultError::of_reading(&path, source))?;
        let refused = |message| ResultError::Format { path: path.clone(), message };
        let mut memory = Memory::new(budget);
        memory.take(described, "the description at its end").map_err(refused)?;
        let reader = decoded(&path, || SerializedFileReader::new(file.clone()))?;
        let groups = reader.metadata().row_groups().iter();
        for column in groups.flat_map(|group| group.columns()) {
            pages::check_place(column, length).map_err(refused)?;
        }
        Ok(Self { path, file, length, reader, memory })
    }

    /// The budget, of which the description of the table is taken: for an account of what is made of the rows.
    #[must_use]
    pub fn memory(&self) -> Memory {
        self.memory
    }

    /// Names of its columns, in order.
    pub fn columns(&self) -> impl Iterator<Item = &str> {
        let schema = self.reader.metadata().file_metadata().schema_descr();
        schema.columns().iter().map(|column| column.name())
    }

    /// Gives every row to `visit`, in order, until that fails.
    ///
    /// # Errors
    ///
    /// The table was changed, is damaged, or takes more memory than there is; or what `visit` says.
    pub fn each_row<E: From<ResultError>>(
        &self,
        visit: impl FnMut(&Row) -> Result<(), E>,
    ) -> Result<(), E> {
        self.each_row_of(None, visit)
    }

    /// Gives some columns of every row to `visit`, in the order of the table, until that fails. Others are not decoded.
    ///
    /// # Errors
    ///
    /// See [`Self::each_row`]; and the table lacks a column.
    pub fn each_row_with<E: From<ResultError>>(
        &self,
        columns: &[&str],
        visit: impl FnMut(&Row) -> Result<(), E>,
    ) -> Result<(), E> {
        let schema = self.reader.metadata().file_metadata().schema_descr().root_schema();
        let lacking = columns.iter().find(|name| !self.columns().any(|own| own == **name));
        if let Some(lacking) = lacking {
            let message = format!("has no column {lacking}");
            return Err(ResultError::Format { path: self.path.clone(), message }.into());
        }
        let fields = schema.get_fields().iter().filter(|field| columns.contains(&field.name()));
        let chosen = Type::group_type_builder(schema.name()).with_fields(fields.cloned().collect());
        let chosen = decoded(&self.path, || chosen.build())?;
        self.each_row_of(Some(chosen), visit)
    }

    fn each_row_of<E: From<ResultError>>(
        &self,
        columns: Option<Type>,
        mut visit: impl FnMut(&Row) -> Result<(), E>,
    ) -> Result<(), E> {
        for number in 0..self.reader.num_row_groups() {
            let group = decoded(&self.path, || self.reader.get_row_group(number))?;
            self.check_memory(&*group)?;
            let mut rows = decoded(&self.path, || group.get_row_iter(columns.clone()))?;
            while let Some(row) = decoded(&self.path, || rows.next().transpose())? {
                visit(&row)?;
            }
        }
        Ok(())
    }

    /// Refuses a part of the table whose pages take more memory than there is. A page of every column is held at a time.
    fn check_memory(&self, group: &dyn RowGroupReader) -> Result<(), ResultError> {
        let mut memory = self.memory;
        let mut content = BufReader::new(self.file.clone());
        for column in group.metadata().columns() {
            let name = column.column_path().string();
            let (start, size) = column.byte_range();
            let is_text = matches!(column.column_type(), PhysicalType::BYTE_ARRAY);
            let needed = content
                .seek(SeekFrom::Start(start))
                .and_then(|_| pages::memory_of(&mut content, size.min(self.length), is_text))
                .map_err(|source| ResultError::of_reading(&self.path, source))?;
            let copies = if is_text { COPIES_OF_TEXT * needed.page } else { 0 };
            memory
                .take(
                    needed.total().saturating_add(copies),
                    format_args!("a page of the column {name}"),
                )
                .map_err(|message| ResultError::Format { path: self.path.clone(), message })?;
        }
        Ok(())
    }
}

impl std::fmt::Debug for Table {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        formatter.debug_struct("Table").field("path", &self.path).finish_non_exhaustive()
    }
}

/// What the library makes of a table. It panics on some that are damaged.
fn decoded<T>(
    path: &Path,
    read: impl FnOnce() -> Result<T, ParquetError>,
) -> Result<T, ResultError> {
    let damaged = "it is damaged: its columns cannot be decoded";
    catch_unwind(AssertUnwindSafe(read))
        .unwrap_or_else(|_| Err(ParquetError::General(damaged.to_owned())))
        .map_err(|error| ResultError::of_table(path, error))
}

/// What is wrong with a table. The library's own words of an error of the system begin with the name of its variant.
#[must_use]
pub fn in_words(error: &ParquetError) -> String {
    match error {
        ParquetError::External(inner) => inner.to_string(),
        error => error.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Reading;
    use crate::result::{ResultFolder, Trust};
    use parquet::basic::Compression;
    use parquet::data_type::{ByteArray, ByteArrayType};
    use parquet::file::properties::{EnabledStatistics, WriterProperties};
    use parquet::file::writer::SerializedFileWriter;
    use parquet::schema::parser::parse_message_type;
    use std::sync::Arc;

    /// A table of one text of so many bytes, which is a few when it is compressed.
    fn table_of_text(path: &Path, n_bytes: usize) {
        let schema = parse_message_type("message m { required binary note (UTF8); }").unwrap();
        let properties = WriterProperties::builder()
            .set_compression(Compression::ZSTD(Default::default()))
            .set_dictionary_enabled(false)
            .set_statistics_enabled(EnabledStatistics::None)
            .build();
        let file = tempfile::NamedTempFile::new().unwrap();
        let to = file.reopen().unwrap();
        let mut writer =
            SerializedFileWriter::new(to, Arc::new(schema), Arc::new(properties)).unwrap();
        let mut group = writer.next_row_group().unwrap();
        let mut column = group.next_column().unwrap().unwrap();
        let text = ByteArray::from(vec![b'x'; n_bytes]);
        column.typed::<ByteArrayType>().write_batch(&[text], None, None).unwrap();
        column.close().unwrap();
        group.close().unwrap();
        writer.close().unwrap();
        std::fs::copy(file.path(), path).unwrap();
    }

    #[test]
    fn a_table_whose_pages_exceed_the_budget_is_refused_before_they_are_decoded() {
        let folder = tempfile::tempdir().unwrap();
        table_of_text(&folder.path().join("t.parquet"), 30 << 20);
        let read = |budget: u64| {
            let reading = Reading { budget: MemoryBudget(budget), trust: Trust::Unchecked };
            let table = ResultFolder::open(folder.path(), reading)?.table("t.parquet")?;
            let mut n_rows = 0;
            table.each_row(|_| {
                n_rows += 1;
                Ok::<(), ResultError>(())
            })?;
            Ok::<usize, ResultError>(n_rows)
        };
        assert_eq!(read(200 << 20).unwrap(), 1);
        let refused = read(1 << 20).unwrap_err().to_string();
        let expected = "needs more than 1 MiB of memory for a page of the column note; allow more";
        assert!(refused.contains("t.parquet: ") && refused.contains(expected), "{refused}");
    }
}
