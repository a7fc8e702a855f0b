//! Measurements: files of what was really sent, received and driven.
//!
//! | module | what |
//! |---|---|
//! | [`account`] | which measurements an answer is about |
//! | [`table`] | a file as named columns of numbers |
//! | [`formats`] | file formats: CSV, Parquet, K7, the folder of a run |
//! | [`memory`] | how much memory reading may take (crate `input`) |
//! | [`links`] | link samples and aggregated link tables |
//! | [`ranges`] | plausible ranges of measured quantities |
//! | [`warnings`] | warnings about measurements that can be used |
//! | [`packets`] | packets from end to end |
//! | [`pooled`] | two files as one table |
//! | [`robots`] | robot samples |
//! | [`time_of_day`] | when rows were measured, where that is known |
//! | [`config`] | the part of a configuration that is compared with them |

pub mod account;
pub mod config;
pub mod formats;
pub mod links;
pub mod packets;
pub mod pooled;
pub mod ranges;
pub mod robots;
pub mod table;
pub mod time_of_day;
pub mod warnings;

pub use input::memory;

use input::result::ResultError;
use schemars::JsonSchema;
use serde::Serialize;
use std::path::PathBuf;

/// Why measurements cannot be used at all.
#[derive(Debug, thiserror::Error)]
pub enum DataError {
    /// The file cannot be opened or read.
    #[error("cannot read {}: {source}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// What the system says.
        source: std::io::Error,
    },
    /// The file is not a table.
    #[error("{}: {message}", path.display())]
    Format {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        message: String,
    },
    /// The file is of a result, and is not what the run wrote, or cannot be checked.
    #[error(transparent)]
    Unbelieved(#[from] ResultError),
}

/// Rows that could not be used, for one reason.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, JsonSchema)]
pub struct Rejected {
    /// Why the rows could not be used, in words.
    pub reason: String,
    /// Number of rows rejected for this reason.
    pub rows: usize,
    /// Line of the first in the file, the header being line 1.
    pub first_line: usize,
}

/// Why a row is rejected that stands in the file before.
pub const TWICE: &str = "duplicate of an earlier row";

/// The first reason for which rows were rejected, as an addition to an error.
pub(crate) fn first_rejection(rejected: &[Rejected]) -> String {
    rejected.first().map_or_else(String::new, |Rejected { reason, rows, first_line }| {
        format!(" ({rows} rows rejected: {reason}, first on line {first_line})")
    })
}

/// A whole number that fits.
pub(crate) fn to_u32(number: f64) -> Option<u32> {
    (number.fract() == 0.0 && (0.0..=f64::from(u32::MAX)).contains(&number))
        .then_some(number as u32)
}

/// Counts rejected rows by reason, in the order in which the reasons first occurred.
#[derive(Clone, Debug, std::default::Default)]
pub struct Rejections(Vec<Rejected>);

impl Rejections {
    /// Counts a row that is rejected for this reason; `line`: where it stands in the file.
    pub fn add(&mut self, reason: &str, line: usize) {
        match self.0.iter_mut().find(|rejected| rejected.reason == reason) {
            Some(rejected) => rejected.rows += 1,
            None => {
                self.0.push(Rejected { reason: reason.to_owned(), rows: 1, first_line: line });
            }
        }
    }

    /// The counts, in the order in which the reasons first occurred.
    #[must_use]
    pub fn into_list(self) -> Vec<Rejected> {
        self.0
    }

    /// How many rows in all.
    #[must_use]
    pub fn total(&self) -> usize {
        self.0.iter().map(|rejected| rejected.rows).sum()
    }
}
