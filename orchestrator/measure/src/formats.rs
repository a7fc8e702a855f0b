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
use crate::table::DataTable;
use flate2::read::MultiGzDecoder;
use proto::bounds::TABLE_BYTES;
use sha2::{Digest as _, Sha256};
use std::fs::File;
use std::io::{BufRead, BufReader, Read};
use std::path::Path;

/// What a file holds, from its beginning on.
pub type Content<'a> = Box<dyn BufRead + 'a>;

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
    /// It cannot be read, or is no table: the place is named.
    pub fn read(path: &Path) -> Result<Self, DataError> {
        read(path, BUILT_IN)
    }

    /// Reads CSV: the first line names the columns. `path` is named in errors.
    ///
    /// # Errors
    ///
    /// See [`DataTable::read`].
    pub fn of_csv(path: &Path, content: impl Read) -> Result<Self, DataError> {
        csv::read(path, content)
    }
}

/// How gzip files begin (RFC 1952, section 2.3.1).
const GZIP: [u8; 2] = [0x1f, 0x8b];

/// Reads a file, or the folder of a run, by the first of `formats` that recognises it. The table has the file's path and SHA-256.
///
/// # Errors
///
/// It cannot be read, no format recognises it, or it is no table: the place is named.
#[expect(clippy::disallowed_methods, reason = "measurements are files")]
pub fn read(path: &Path, formats: &[Format]) -> Result<DataTable, DataError> {
    let failed = |source| DataError::Read { path: path.to_owned(), source };
    if path.is_dir() {
        return read_content(path, Box::new(std::io::empty()), formats);
    }
    let sha256 = digest(&mut File::open(path).map_err(failed)?).map_err(failed)?;
    let content = open(path)?;
    let table = read_content(path, content, formats)?;
    Ok(DataTable { sha256, ..table })
}

/// Opens a file; one that gzip has compressed is decompressed, up to the size that a table may have.
///
/// # Errors
///
/// It cannot be read.
#[expect(clippy::disallowed_methods, reason = "measurements are files")]
pub fn open(path: &Path) -> Result<Content<'static>, DataError> {
    let failed = |source| DataError::Read { path: path.to_owned(), source };
    let mut content = BufReader::new(File::open(path).map_err(failed)?);
    let is_gzip = content.fill_buf().map_err(failed)?.starts_with(&GZIP);
    Ok(if is_gzip {
        let bounded = BoundedSize { content: MultiGzDecoder::new(content), n_read: 0 };
        Box::new(BufReader::new(bounded))
    } else {
        Box::new(content)
    })
}

fn read_content(
    path: &Path,
    mut content: Content<'_>,
    formats: &[Format],
) -> Result<DataTable, DataError> {
    let begin =
        content.fill_buf().map_err(|source| DataError::Read { path: path.to_owned(), source })?;
    match formats.iter().find(|format| (format.recognises)(path, begin)) {
        Some(format) => (format.read)(path, content),
        None => {
            let names: Vec<&str> = formats.iter().map(|format| format.name).collect();
            Err(DataError::Format {
                path: path.to_owned(),
                message: format!("is in no known format: these are {}", names.join(", ")),
            })
        }
    }
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
            let table = read(path, &formats).unwrap();
            assert_eq!(table.column("rssi_dbm"), Some(&[-70.5, -71.0][..]));
            assert_eq!((table.path.as_path(), table.sha256.len()), (path.as_path(), 64));
            assert!(read(path, BUILT_IN).unwrap().column("rssi_dbm").is_none());
        }
        std::fs::write(&plain, "1 2 -70.5\n2 1\n").unwrap();
        let error = read(&plain, &formats).unwrap_err().to_string();
        let expected = "plain.readings: line 2: expected the numbers tx rx rssi_dbm, got \"2 1\"";
        assert!(error.ends_with(expected), "{error}");
    }

    #[test]
    fn a_file_in_no_format_is_refused_with_the_formats_that_there_are() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("data");
        std::fs::write(&path, "a\n1\n").unwrap();
        let error = read(&path, &[parquet::FORMAT, k7::FORMAT]).unwrap_err().to_string();
        assert!(error.contains("no known format: these are Parquet, K7"), "{error}");
    }
}
