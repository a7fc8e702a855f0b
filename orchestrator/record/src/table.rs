//! A Parquet file that grows row by row, in bounded row groups.

use super::RecordError;
use super::hashed_file::WholeFile;
use input::fingerprint::Fingerprint;
use parquet::basic::{Compression, Encoding, ZstdLevel};
use parquet::data_type::{
    BoolType, ByteArray, ByteArrayType, DataType, DoubleType, FloatType, Int32Type, Int64Type,
};
use parquet::errors::ParquetError;
use parquet::file::properties::{EnabledStatistics, WriterProperties, WriterPropertiesPtr};
use parquet::file::writer::{SerializedFileWriter, SerializedRowGroupWriter};
use parquet::schema::parser::parse_message_type;
use parquet::schema::types::ColumnPath;
use proto::config::Choice;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// What a table is.
#[derive(Debug)]
pub struct TableShape {
    /// Its file.
    pub file: &'static str,
    /// What a row is, one sentence.
    pub row: &'static str,
    /// Its columns, in order.
    pub columns: &'static [ColumnShape],
}

/// What a column is.
#[derive(Debug)]
pub struct ColumnShape {
    /// Its name, with the unit as suffix.
    pub name: &'static str,
    /// Its type.
    pub kind: ColumnKind,
    /// When it is null. Empty: never.
    pub null_when: &'static str,
    /// What it means, one sentence.
    pub doc: &'static str,
}

/// A column of a table.
#[derive(Clone, Copy, Debug)]
pub struct Heading<'a> {
    /// Its name.
    pub name: &'a str,
    /// Its type.
    pub kind: ColumnKind,
    /// It may be null.
    pub is_nullable: bool,
}

/// The type of a column, by its name in the data dictionary.
#[derive(Choice, Clone, Copy, Debug, PartialEq, Eq)]
pub enum ColumnKind {
    /// `BOOLEAN`.
    Bool,
    /// `FLOAT`.
    F32,
    /// `DOUBLE`.
    F64,
    /// `INT32`, unsigned.
    U32,
    /// `INT64`, unsigned.
    U64,
    /// `BYTE_ARRAY`, UTF-8.
    Text,
}

/// A value on its way into a row.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Cell<'a> {
    /// No value.
    Null,
    /// True or false.
    Bool(bool),
    /// A number in single precision.
    F32(f32),
    /// A number in double precision.
    F64(f64),
    /// An unsigned number of 32 bits.
    U32(u32),
    /// An unsigned number of 64 bits.
    U64(u64),
    /// A text.
    Text(&'a str),
}

impl Cell<'_> {
    /// The value, or null.
    pub fn or_null<T>(value: Option<T>, cell: impl Fn(T) -> Self) -> Self {
        value.map_or(Self::Null, cell)
    }
}

/// A table being written.
pub struct Table {
    path: PathBuf,
    writer: SerializedFileWriter<WholeFile>,
    columns: Vec<ColumnBuffer>,
    n_rows: usize,
    n_written: u64,
}

impl Table {
    /// Begins the file in `dir`.
    pub fn create(dir: &Path, shape: &'static TableShape) -> Result<Self, RecordError> {
        Self::create_with(dir, shape, &[])
    }

    /// Begins the file in `dir`, with further columns of numbers that may be null.
    pub fn create_with(
        dir: &Path,
        shape: &'static TableShape,
        further: &[String],
    ) -> Result<Self, RecordError> {
        let own = shape.columns.iter().map(|column| Heading {
            name: column.name,
            kind: column.kind,
            is_nullable: !column.null_when.is_empty(),
        });
        let further =
            further.iter().map(|name| Heading { name, kind: ColumnKind::F64, is_nullable: true });
        Self::create_of(dir.join(shape.file), &own.chain(further).collect::<Vec<_>>())
    }

    /// Begins a file with these columns, of which there is at least one.
    pub fn create_of(path: PathBuf, headings: &[Heading<'_>]) -> Result<Self, RecordError> {
        let file = WholeFile::create(path.clone())?;
        let failed = |source| RecordError::Table { path: path.clone(), source };
        let name = path.file_stem().map(|name| name.to_string_lossy()).unwrap_or_default();
        let schema = parse_message_type(&schema_text(&name, headings)).map_err(failed)?;
        let writer = SerializedFileWriter::new(
            file,
            Arc::new(schema),
            properties(headings).map_err(failed)?,
        )
        .map_err(failed)?;
        let columns = headings
            .iter()
            .map(|heading| ColumnBuffer::new(heading.kind, heading.is_nullable))
            .collect();
        Ok(Self { path, writer, columns, n_rows: 0, n_written: 0 })
    }

    /// Adds a row: one cell per column.
    pub fn push<'a>(&mut self, row: impl IntoIterator<Item = Cell<'a>>) -> Result<(), RecordError> {
        let mut n_cells = 0;
        for cell in row {
            self.columns[n_cells].push(cell);
            n_cells += 1;
        }
        assert_eq!(n_cells, self.columns.len(), "{}: cells in a row", self.path.display());
        self.n_rows += 1;
        if self.n_rows == MAX_GROUP_ROWS { self.write_group() } else { Ok(()) }
    }

    /// Ends the file. Returns how many rows it has.
    pub fn finish(mut self) -> Result<(u64, Fingerprint), RecordError> {
        self.write_group()?;
        let Self { path, writer, n_written, .. } = self;
        let failed = |source| RecordError::Table { path, source };
        let file = writer.into_inner().map_err(failed)?;
        Ok((n_written, file.finish()?))
    }

    fn write_group(&mut self) -> Result<(), RecordError> {
        if self.n_rows == 0 {
            return Ok(());
        }
        let mut write = || -> Result<(), ParquetError> {
            let mut group = self.writer.next_row_group()?;
            for column in &mut self.columns {
                column.write(&mut group)?;
            }
            group.close()?;
            Ok(())
        };
        write().map_err(|source| RecordError::Table { path: self.path.clone(), source })?;
        self.n_written += self.n_rows as u64;
        self.n_rows = 0;
        Ok(())
    }
}

/// The values of a column that are not written yet.
struct ColumnBuffer {
    values: Values,
    /// 1 where there is a value, 0 where it is null; `None` for a column that is never null.
    levels: Option<Vec<i16>>,
}

enum Values {
    Bool(Vec<bool>),
    F32(Vec<f32>),
    F64(Vec<f64>),
    U32(Vec<i32>),
    U64(Vec<i64>),
    Text(Vec<ByteArray>),
}

impl ColumnBuffer {
    fn new(kind: ColumnKind, nullable: bool) -> Self {
        let values = match kind {
            ColumnKind::Bool => Values::Bool(Vec::new()),
            ColumnKind::F32 => Values::F32(Vec::new()),
            ColumnKind::F64 => Values::F64(Vec::new()),
            ColumnKind::U32 => Values::U32(Vec::new()),
            ColumnKind::U64 => Values::U64(Vec::new()),
            ColumnKind::Text => Values::Text(Vec::new()),
        };
        Self { values, levels: nullable.then(Vec::new) }
    }

    fn push(&mut self, cell: Cell<'_>) {
        if let Some(levels) = &mut self.levels {
            levels.push(i16::from(cell != Cell::Null));
        }
        match (&mut self.values, cell) {
            (Values::Bool(values), Cell::Bool(value)) => values.push(value),
            (Values::F32(values), Cell::F32(value)) => values.push(value),
            (Values::F64(values), Cell::F64(value)) => values.push(value),
            // Parquet stores unsigned numbers in signed ones of the same bits.
            (Values::U32(values), Cell::U32(value)) => values.push(value.cast_signed()),
            (Values::U64(values), Cell::U64(value)) => values.push(value.cast_signed()),
            (Values::Text(values), Cell::Text(value)) => values.push(value.into()),
            (_, Cell::Null) if self.levels.is_some() => {}
            (_, cell) => panic!("{cell:?} does not belong in this column"),
        }
    }

    fn write(
        &mut self,
        group: &mut SerializedRowGroupWriter<'_, WholeFile>,
    ) -> Result<(), ParquetError> {
        fn write<T: DataType>(
            group: &mut SerializedRowGroupWriter<'_, WholeFile>,
            values: &mut Vec<T::T>,
            levels: Option<&mut Vec<i16>>,
        ) -> Result<(), ParquetError> {
            let mut column = group
                .next_column()?
                .ok_or_else(|| ParquetError::General("too few columns".to_owned()))?;
            column.typed::<T>().write_batch(values, levels.as_ref().map(|l| &l[..]), None)?;
            column.close()?;
            values.clear();
            if let Some(levels) = levels {
                levels.clear();
            }
            Ok(())
        }
        let levels = self.levels.as_mut();
        match &mut self.values {
            Values::Bool(values) => write::<BoolType>(group, values, levels),
            Values::F32(values) => write::<FloatType>(group, values, levels),
            Values::F64(values) => write::<DoubleType>(group, values, levels),
            Values::U32(values) => write::<Int32Type>(group, values, levels),
            Values::U64(values) => write::<Int64Type>(group, values, levels),
            Values::Text(values) => write::<ByteArrayType>(group, values, levels),
        }
    }
}

fn schema_text(name: &str, headings: &[Heading<'_>]) -> String {
    let columns: String = headings
        .iter()
        .map(|heading| {
            let presence = if heading.is_nullable { "optional" } else { "required" };
            let (kind, annotation) = match heading.kind {
                ColumnKind::Bool => ("boolean", ""),
                ColumnKind::F32 => ("float", ""),
                ColumnKind::F64 => ("double", ""),
                ColumnKind::U32 => ("int32", " (INTEGER(32,false))"),
                ColumnKind::U64 => ("int64", " (INTEGER(64,false))"),
                ColumnKind::Text => ("binary", " (STRING)"),
            };
            format!("{presence} {kind} {}{annotation};\n", heading.name)
        })
        .collect();
    format!("message {name} {{\n{columns}}}")
}

fn properties(headings: &[Heading<'_>]) -> Result<WriterPropertiesPtr, ParquetError> {
    let mut properties = WriterProperties::builder()
        .set_created_by("murmuration".to_owned())
        .set_compression(Compression::ZSTD(ZstdLevel::try_new(1)?))
        .set_dictionary_enabled(false)
        .set_statistics_enabled(EnabledStatistics::Chunk)
        .set_offset_index_disabled(true);
    for heading in headings {
        let encoding = match heading.kind {
            ColumnKind::U32 | ColumnKind::U64 => Encoding::DELTA_BINARY_PACKED,
            ColumnKind::Bool | ColumnKind::F32 | ColumnKind::F64 | ColumnKind::Text => {
                Encoding::PLAIN
            }
        };
        properties = properties.set_column_encoding(ColumnPath::from(heading.name), encoding);
    }
    Ok(Arc::new(properties.build()))
}

/// Most rows of a row group: 16 MB of the widest table.
const MAX_GROUP_ROWS: usize = 1 << 18;
