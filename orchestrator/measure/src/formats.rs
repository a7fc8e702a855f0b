//! File formats of measurements: one file each, and the one list [`BUILT_IN`].
//!
//! A format says by the beginning of a file whether it can read it, and makes a [`DataTable`] of it; [`DataTable::of_columns`] is enough for
//! that. Files that gzip has compressed are decompressed before a format sees them. [`read`] takes the list as an argument, so that
//! another program adds formats of its own by the same call.

pub mod csv;
pub mod k7;
pub mod parquet;
pub mod run;

use crate::DataError;
use crate::memory::{Memory, MemoryBudget, UNCOUNTED};
use crate::table::DataTable;
use flate2::read::MultiGzDecoder;
use input::Reading;
use input::checked::CheckedFile;
use input::result::{ResultError, ResultFolder};
use proto::bounds::TABLE_BYTES;
use sha2::{Digest as _, Sha256};
use std::fs::File;
use std::io::{BufRead, BufReader, Read};
use std::path::Path;

/// A source of bytes that nobody counts.
pub type Uncounted<'a> = Box<dyn BufRead + 'a>;

/// What a file holds, from its beginning on.
///
/// A reader is charged for what it reads as if it kept it, several times its size. One that counts what it keeps takes it
/// [uncounted](Self::uncounted).
pub struct Content<'a> {
    source: Uncounted<'a>,
    memory: Memory,
    reading: Reading,
    /// The file of a result, of which each part is checked before it is read.
    file: Option<CheckedFile>,
}

impl<'a> Content<'a> {
    /// From a source, to be read within a budget.
    pub fn new(source: impl BufRead + 'a, reading: impl Into<Reading>) -> Self {
        let reading = reading.into();
        let memory = Memory::new(reading.budget);
        Self { source: Box::new(source), memory, reading, file: None }
    }

    /// The source, and the account in which its reader counts what it keeps.
    #[must_use]
    pub fn uncounted(self) -> (Uncounted<'a>, Memory) {
        (self.source, self.memory)
    }

    /// How the files of a folder are read.
    #[must_use]
    pub fn reading(&self) -> Reading {
        self.reading
    }

    /// The file at `path` that this is the content of, to be read by place, and the account in which its reader counts what it keeps.
    ///
    /// # Errors
    ///
    /// It cannot be opened.
    pub fn by_place(self, path: &Path) -> Result<(CheckedFile, Memory), DataError> {
        let file = self.file.map_or_else(|| CheckedFile::unchecked(path), Ok);
        let file = file.map_err(|source| DataError::Read { path: path.to_owned(), source })?;
        Ok((file, self.memory))
    }
}

impl std::fmt::Debug for Content<'_> {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        formatter.debug_struct("Content").field("memory", &self.memory).finish_non_exhaustive()
    }
}

impl Read for Content<'_> {
    fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
        let n = self.fill_buf()?.read(buffer)?;
        self.consume(n);
        Ok(n)
    }
}

impl BufRead for Content<'_> {
    fn fill_buf(&mut self) -> std::io::Result<&[u8]> {
        self.memory.take(0, "the text that was read").map_err(std::io::Error::other)?;
        self.source.fill_buf()
    }

    fn consume(&mut self, n: usize) {
        // What is too much is refused when more is asked for.
        let _ = self.memory.take(UNCOUNTED * n as u64, "");
        self.source.consume(n);
    }
}

/// A file format of measurements: how it is recognised, and how it is read.
#[derive(Clone, Copy, Debug)]
pub struct Format {
    /// Its name, for messages that list the formats.
    pub name: &'static str,
    /// Whether it reads a file, by its path and its first bytes: up to 64 KiB of it, none of a folder.
    pub recognises: fn(&Path, &[u8]) -> bool,
    /// Reads a file that it recognises; the content of a folder is empty.
    pub read: fn(&Path, Content<'_>) -> Result<DataTable, DataError>,
}

/// The formats that are known, the first that recognises a file reading it.
pub const BUILT_IN: &[Format] = &[run::FORMAT, parquet::FORMAT, k7::FORMAT, csv::FORMAT];

impl DataTable {
    /// Reads a file in one of the [built-in formats](BUILT_IN), or the links of a run from its folder.
    ///
    /// # Errors
    ///
    /// It cannot be read, is no table, needs more memory than the budget, or is of a result and not what the run wrote: the place is
    /// named.
    pub fn read(path: &Path, reading: impl Into<Reading>) -> Result<Self, DataError> {
        read(path, BUILT_IN, reading)
    }

    /// Reads a table of a result.
    ///
    /// # Errors
    ///
    /// See [`DataTable::read`].
    pub fn of_result(
        run: &ResultFolder,
        name: &str,
        budget: MemoryBudget,
    ) -> Result<Self, DataError> {
        let path = run.path().join(name);
        let reading = Reading { budget, ..run.reading() };
        read_file(&path, Some(run.file(name)?), BUILT_IN, reading)
    }

    /// Reads CSV: the first line names the columns. `path` is named in errors.
    ///
    /// # Errors
    ///
    /// See [`DataTable::read`].
    pub fn of_csv(path: &Path, content: impl Read) -> Result<Self, DataError> {
        csv::read(path, content, Memory::UNLIMITED)
    }
}

/// How gzip files begin (RFC 1952, section 2.3.1).
const GZIP: [u8; 2] = [0x1f, 0x8b];

/// Reads a file, or the folder of a run, by the first of `formats` that recognises it. The table has the file's path and SHA-256.
///
/// # Errors
///
/// It cannot be read, no format recognises it, it is no table, needs more memory than the budget, or is of a result and not what the run
/// wrote: the place is named.
pub fn read(
    path: &Path,
    formats: &[Format],
    reading: impl Into<Reading>,
) -> Result<DataTable, DataError> {
    let reading = reading.into();
    if path.is_dir() {
        return read_content(path, Content::new(std::io::empty(), reading), formats);
    }
    read_file(path, file_of_result(path, reading)?, formats, reading)
}

/// Reads a file; `file`: the same, if it is of a result.
#[expect(clippy::disallowed_methods, reason = "measurements are files")]
fn read_file(
    path: &Path,
    file: Option<CheckedFile>,
    formats: &[Format],
    reading: Reading,
) -> Result<DataTable, DataError> {
    let failed = |source| DataError::Read { path: path.to_owned(), source };
    let sha256 = match &file {
        Some(file) => file.sha256().map_err(|source| ResultError::of_reading(path, source))?,
        None => digest(&mut File::open(path).map_err(failed)?).map_err(failed)?,
    };
    let table = read_content(path, content(path, file, reading)?, formats)?;
    Ok(DataTable { sha256, ..table })
}

/// The file, if it is of a result.
fn file_of_result(path: &Path, reading: Reading) -> Result<Option<CheckedFile>, DataError> {
    let found = ResultFolder::holding(path, reading)?;
    Ok(found.map(|(run, name)| run.file(&name)).transpose()?)
}

/// Opens a file; one that gzip has compressed is decompressed, up to the size that a table may have.
///
/// # Errors
///
/// It cannot be read, or is of a result and not what the run wrote.
pub fn open(path: &Path, reading: impl Into<Reading>) -> Result<Content<'static>, DataError> {
    let reading = reading.into();
    let file = file_of_result(path, reading)?;
    if let Some(file) = &file {
        file.sha256().map_err(|source| ResultError::of_reading(path, source))?;
    }
    content(path, file, reading)
}

/// The content of a file, decompressed; `file`: the same, if it is of a result.
#[expect(clippy::disallowed_methods, reason = "measurements are files")]
fn content(
    path: &Path,
    file: Option<CheckedFile>,
    reading: Reading,
) -> Result<Content<'static>, DataError> {
    let failed = |source| DataError::Read { path: path.to_owned(), source };
    let mut source: Uncounted<'static> = match &file {
        Some(file) => Box::new(BufReader::new(file.clone())),
        None => Box::new(BufReader::new(File::open(path).map_err(failed)?)),
    };
    let is_gzip = source.fill_buf().map_err(failed)?.starts_with(&GZIP);
    let content = if is_gzip {
        let bounded = BoundedSize { content: MultiGzDecoder::new(source), n_read: 0 };
        Content::new(BufReader::new(bounded), reading)
    } else {
        Content::new(source, reading)
    };
    Ok(Content { file, ..content })
}

fn read_content(
    path: &Path,
    mut content: Content<'_>,
    formats: &[Format],
) -> Result<DataTable, DataError> {
    let begin =
        content.fill_buf().map_err(|source| DataError::Read { path: path.to_owned(), source })?;
    let refused = |message| DataError::Format { path: path.to_owned(), message };
    let Some(format) = formats.iter().find(|format| (format.recognises)(path, begin)) else {
        let names: Vec<&str> = formats.iter().map(|format| format.name).collect();
        return Err(refused(format!("is in no known format: these are {}", names.join(", "))));
    };
    let mut memory = Memory::new(content.memory.budget());
    let table = (format.read)(path, content)?;
    // Of a reader that did not count as well.
    let what = format_args!("{} rows of {} columns", table.n_rows(), table.names().len());
    memory.take(table.n_bytes(), what).map_err(refused)?;
    Ok(DataTable { memory, ..table })
}

/// Stops a compressed file that decompresses to more than any table has.
struct BoundedSize<R> {
    content: R,
    n_read: u64,
}

impl<R: Read> Read for BoundedSize<R> {
    fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
        let n = self.content.read(buffer)?;
        self.n_read += n as u64;
        TABLE_BYTES.check(self.n_read).map_err(std::io::Error::other)?;
        Ok(n)
    }
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
#[expect(clippy::disallowed_methods, reason = "tests write the files that they read")]
mod tests {
    use super::*;
    use std::io::Write as _;

    /// A format from outside, as CONTRIBUTING.md shows it: one reading a line.
    const READINGS: Format = Format {
        name: "readings",
        recognises: |path, _| path.extension().is_some_and(|extension| extension == "readings"),
        read: read_readings,
    };

    fn read_readings(path: &Path, content: Content<'_>) -> Result<DataTable, DataError> {
        let names = ["tx", "rx", "rssi_dbm"];
        let mut columns = vec![Vec::new(); names.len()];
        for (line, text) in (1..).zip(content.lines()) {
            let text = text.map_err(|source| DataError::Read { path: path.to_owned(), source })?;
            let fields: Result<Vec<f64>, _> = text.split_whitespace().map(str::parse).collect();
            let fields = fields.ok().filter(|fields| fields.len() == names.len());
            let fields = fields.ok_or_else(|| DataError::Format {
                path: path.to_owned(),
                message: format!("line {line}: expected the numbers tx rx rssi_dbm, got {text:?}"),
            })?;
            for (column, value) in columns.iter_mut().zip(fields) {
                column.push(value);
            }
        }
        let table = DataTable::of_columns(names.map(str::to_owned).into(), columns);
        Ok(DataTable { path: path.to_owned(), first_line: 1, ..table })
    }

    #[test]
    fn a_format_from_outside_reads_what_it_recognises_compressed_or_not() {
        let folder = tempfile::tempdir().unwrap();
        let formats: Vec<Format> = [READINGS].iter().chain(BUILT_IN).copied().collect();
        let plain = folder.path().join("plain.readings");
        std::fs::write(&plain, "1 2 -70.5\n2 1 -71\n").unwrap();
        let compressed = folder.path().join("compressed.readings");
        let file = File::create(&compressed).unwrap();
        let mut encoder = flate2::write::GzEncoder::new(file, flate2::Compression::fast());
        encoder.write_all(b"1 2 -70.5\n2 1 -71\n").unwrap();
        encoder.finish().unwrap();
        for path in [&plain, &compressed] {
            let table = read(path, &formats, MemoryBudget::default()).unwrap();
            assert_eq!(table.column("rssi_dbm"), Some(&[-70.5, -71.0][..]));
            assert_eq!((table.path.as_path(), table.sha256.len()), (path.as_path(), 64));
            assert!(
                DataTable::read(path, MemoryBudget::default())
                    .unwrap()
                    .column("rssi_dbm")
                    .is_none()
            );
        }
        std::fs::write(&plain, "1 2 -70.5\n2 1\n").unwrap();
        let error = read(&plain, &formats, MemoryBudget::default()).unwrap_err().to_string();
        let expected = "plain.readings: line 2: expected the numbers tx rx rssi_dbm, got \"2 1\"";
        assert!(error.ends_with(expected), "{error}");
    }

    #[test]
    fn a_file_in_no_format_is_refused_with_the_formats_that_there_are() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("data");
        std::fs::write(&path, "a\n1\n").unwrap();
        let known = [parquet::FORMAT, k7::FORMAT];
        let error = read(&path, &known, MemoryBudget::default()).unwrap_err().to_string();
        assert!(error.contains("no known format: these are Parquet, K7"), "{error}");
    }

    #[test]
    fn a_reader_that_forgets_the_budget_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("data.readings");
        std::fs::write(&path, "1 2 -70.5\n".repeat(10_000)).unwrap();
        // 240 kB of numbers from 100 kB of text.
        for (bytes, is_enough) in [(1 << 20, true), (300_000, false), (1000, false)] {
            let read = read(&path, &[READINGS], MemoryBudget(bytes));
            assert_eq!(read.is_ok(), is_enough, "{bytes}");
            let error = read.map_or_else(|error| error.to_string(), |_| String::new());
            assert!(is_enough || error.contains("--memory-budget"), "{error}");
        }
        const SILENT: Format = Format {
            name: "silent",
            recognises: |_, _| true,
            read: |_, _| Ok(DataTable::of_columns(vec!["a".to_owned()], vec![vec![0.0; 1000]])),
        };
        assert!(read(&path, &[SILENT], MemoryBudget(8000)).is_ok());
        let refused = read(&path, &[SILENT], MemoryBudget(7999)).unwrap_err().to_string();
        let expected = "needs more than 7999 bytes of memory for 1000 rows of 1 columns; allow more with --memory-budget";
        assert!(refused.ends_with(expected), "{refused}");
    }

    #[test]
    fn every_format_refuses_what_needs_more_memory_than_the_budget() {
        let folder = tempfile::tempdir().unwrap();
        let csv = format!("time_s,tx\n{}", "1,2\n".repeat(10_000));
        let text = format!("time_s,tx\n{}", "x,y\n".repeat(10_000));
        let k7 = format!(
            "{{\"start_date\":\"2018-01-11T16:32:22\",\"stop_date\":\"2018-01-12T16:32:22\",\"location\":\"x\",\"channels\":[11],\
             \"transmission_count\":100,\"node_count\":2}}\ndatetime,src,dst,channel,mean_rssi,pdr,tx_count\n{}",
            "2018-01-11T16:32:22,0,1,11,-70,1.0,100\n".repeat(3000)
        );
        for (name, content) in [("a.csv", &csv), ("b.csv", &text), ("c.k7", &k7)] {
            let path = folder.path().join(name);
            std::fs::write(&path, content).unwrap();
            assert!(DataTable::read(&path, MemoryBudget(1 << 20)).is_ok(), "{name}");
            let error = DataTable::read(&path, MemoryBudget(150_000)).unwrap_err().to_string();
            assert!(error.contains("needs more than 150 kB of memory"), "{error}");
        }
    }

    #[test]
    fn a_small_gzip_of_many_rows_is_refused_while_it_is_read() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("data.csv.gz");
        let file = File::create(&path).unwrap();
        let mut encoder = flate2::write::GzEncoder::new(file, flate2::Compression::fast());
        encoder.write_all(b"time_s,tx,rx,rssi_dbm,received\n").unwrap();
        for _ in 0..1000 {
            encoder.write_all(&b"1,1,2,-70,1\n".repeat(1000)).unwrap();
        }
        encoder.finish().unwrap();
        assert!(std::fs::metadata(&path).unwrap().len() < 100_000);
        let error = DataTable::read(&path, MemoryBudget(1 << 20)).unwrap_err().to_string();
        let expected = "line 26216: needs more than 1 MiB of memory for 26215 rows of 5 columns";
        assert!(error.contains(expected), "{error}");
    }
}
