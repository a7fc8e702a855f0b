//! Files of results, read up to their bounds.

use proto::bounds::Bound;
use std::fs::File;
use std::io;
use std::path::Path;

/// Reads a file.
///
/// # Errors
///
/// It has more bytes than `bound` allows, or cannot be read.
pub fn read_file(bound: &Bound, path: &Path) -> io::Result<Vec<u8>> {
    bound.read(File::open(path)?)
}

/// Reads a file as text.
///
/// # Errors
///
/// See [`read_file`]; and it is not UTF-8.
pub fn read_text_file(bound: &Bound, path: &Path) -> io::Result<String> {
    bound.read_text(File::open(path)?)
}
