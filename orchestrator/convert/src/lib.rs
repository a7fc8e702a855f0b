//! Import: logs become tables of measurements, as a mapping file says.
//!
//! | module | what |
//! |---|---|
//! | [`mapping`] | mapping files: their keys, and every problem of one |
//! | [`formats`] | formats of logs, one file each |
//! | [`files`] | the files that a pattern stands for |
//! | [`guess`] | which columns of logs are what, where no mapping says it |
//! | [`units`], [`time`], [`geodesy`] | units, dates and positions, in the units of the tables |
//! | [`tables`] | the tables and their columns |
//! | [`sequence`] | gaps in sequence numbers |
//! | [`channels`] | on which channels hops were received |
//! | [`output`] | tables written as CSV or Parquet |
//!
//! A row that the commands' own readers would reject is rejected here, with its line in the log.

mod account;
mod aggregate;
mod assemble;
pub mod channels;
mod derive;
pub mod files;
pub mod formats;
mod frame;
pub mod geodesy;
pub mod guess;
mod join;
mod labels;
mod lost;
pub mod mapping;
pub mod output;
pub mod sequence;
pub mod tables;
pub mod time;
pub mod units;

pub use account::RejectedRows;
pub use assemble::{convert, files_of};
pub use join::JoinReport;

use channels::ChannelShare;
use measure::DataError;
use measure::table::DataTable;
use proto::config::Refusal;
use schemars::JsonSchema;
use sequence::SequenceGaps;
use serde::Serialize;
use std::collections::BTreeMap;
use tables::TableKind;

/// Why logs cannot be converted.
#[derive(Debug, thiserror::Error)]
pub enum ConvertError {
    /// The mapping does not fit the logs.
    #[error(transparent)]
    Mapping(#[from] Refusal),
    /// A log cannot be read.
    #[error(transparent)]
    Log(#[from] DataError),
}

/// Names, in a text of bounded length: long ones are cut, and of many only the first stand there.
pub fn listed<'a>(names: impl IntoIterator<Item = &'a str>) -> String {
    const MOST: usize = 40;
    const MOST_LETTERS: usize = 40;
    let mut names = names.into_iter();
    let cut = |name: &str| match name.char_indices().nth(MOST_LETTERS) {
        Some((at, _)) => format!("{}…", &name[..at]),
        None => name.to_owned(),
    };
    let mut text = names.by_ref().take(MOST).map(cut).collect::<Vec<_>>().join(", ");
    let n_more = names.count();
    if 0 < n_more {
        text.push_str(&format!(" and {n_more} more"));
    }
    text
}

/// What the schema of the answer is called.
pub const SCHEMA: &str = "convert/1";

/// A table, and how it came about.
#[derive(Clone, Debug)]
pub struct Converted {
    /// The table.
    pub table: DataTable,
    /// How it came about.
    pub answer: Conversion,
    /// Why the commands can use none of its rows, if they cannot.
    pub refusal: Option<String>,
}

/// How logs became a table.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct Conversion {
    /// The format of this answer.
    #[schemars(extend("const" = SCHEMA))]
    pub schema: &'static str,
    /// The table.
    pub table: TableKind,
    /// Its columns, in order.
    pub columns: Vec<String>,
    /// Rows of the first input that were read.
    pub read: usize,
    /// Rows of the table.
    pub written: usize,
    /// Rows that were added to those of the first input, with `lost_from_gaps`: packets or frames missing in the sequence numbers.
    pub lost_from_gaps: usize,
    /// Whether frames that were lost are in a table of links, as its column `losses_logged` states it; null if that is unknown.
    pub losses_logged: Option<bool>,
    /// The inputs, in the order of the mapping.
    pub inputs: Vec<InputReport>,
    /// Numbers of nodes or robots by name; empty where the log has numbers, which stay as they are.
    pub names: BTreeMap<String, u32>,
    /// Latitude and longitude (degrees) of x = 0, y = 0; null where the log has no geographic coordinates.
    pub origin_deg: Option<[f64; 2]>,
    /// Gaps in sequence numbers, by run, source and receiver; empty where rows have no sequence numbers.
    pub gaps: Vec<SequenceGaps>,
    /// On which channels the hops of packets were received, by run; empty where the log has no channels of hops, or too few hops.
    pub channels: Vec<ChannelShare>,
    /// What to check before the table is used.
    pub warnings: Vec<String>,
}

/// What was read of an input.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct InputReport {
    /// The files, in order; of the first input, those of run 1, 2, ….
    pub files: Vec<String>,
    /// Name of the format.
    pub format: &'static str,
    /// Rows that were read.
    pub read: usize,
    /// Rows that could not be used, by reason.
    pub rejected: Vec<RejectedRows>,
    /// How it was joined onto the first input; null for the first.
    pub join: Option<JoinReport>,
}

impl InputReport {
    /// Rows that could not be used.
    #[must_use]
    pub fn n_rejected(&self) -> usize {
        self.rejected.iter().map(|rejected| rejected.rows).sum()
    }
}
