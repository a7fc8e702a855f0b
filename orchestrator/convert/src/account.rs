//! Which rows were read, and which were rejected, why and where.

use schemars::JsonSchema;
use serde::Serialize;
use std::path::Path;

/// Rows of an input that could not be used, for one reason.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, JsonSchema)]
pub struct RejectedRows {
    /// Why the rows could not be used.
    pub reason: String,
    /// Number of rows rejected for this reason.
    pub rows: usize,
    /// Path of the file with the first of them.
    pub file: String,
    /// Line of the first of them in that file.
    pub first_line: usize,
}

/// Counts rows that are rejected, by reason, in the order in which the reasons first occurred.
pub(crate) fn add(rejected: &mut Vec<RejectedRows>, reason: &str, file: &Path, line: usize) {
    match rejected.iter_mut().find(|known| known.reason == reason) {
        Some(known) => known.rows += 1,
        None => rejected.push(RejectedRows {
            reason: reason.to_owned(),
            rows: 1,
            file: file.display().to_string(),
            first_line: line,
        }),
    }
}

/// The account of one file.
pub(crate) struct Account<'a> {
    /// The file.
    pub file: &'a Path,
    /// Rows that were read, of all files of the input.
    pub n_read: usize,
    /// Rows that were rejected, of all files of the input.
    pub rejected: &'a mut Vec<RejectedRows>,
}

impl Account<'_> {
    /// Counts a row that is rejected.
    pub(crate) fn reject(&mut self, reason: &str, line: usize) {
        add(self.rejected, reason, self.file, line);
    }
}
