//! The keys of mapping files.

use super::{JoinKind, LoggedLosses, Repeats};
use crate::formats::BUILT_IN;
use crate::tables::{COLUMNS_SPEC, TableKind};
use crate::time::DateOrder;
use proto::config::{FilePath, Lists, OneOf, Registry, Section, Tag, Variants, json_schema};

/// The key that sums up link samples.
pub(super) const AGGREGATE_S: &str = "aggregate_s";

/// The key that makes lost packets or frames of gaps.
pub(super) const LOST_FROM_GAPS: &str = "lost_from_gaps";

/// The key that says where sequence numbers begin anew.
pub(super) const SEQUENCE_MODULUS: &str = "sequence_modulus";

/// The key that says whether lost frames are in the log.
pub(super) const LOSSES: &str = "losses";

/// A mapping file: how logs become a table of measurements.
#[derive(Section)]
pub(super) struct MappingKeys {
    /// The table to write.
    #[key(required)]
    pub(super) table: Option<TableKind>,
    /// Origin of times: a date, an epoch time (s), or "as-written". By default, dates and epoch times count from the first row of each
    /// run, or from the start that the log states; smaller times stay as they are.
    pub(super) start: Option<StartKey>,
    /// Latitude and longitude (degrees) of x = 0, y = 0. By default, the first fix.
    #[key(range = -180.0..=180.0)]
    pub(super) origin_deg: Option<[f64; 2]>,
    /// Numbers of nodes or robots by their name in the log: `{ gateway = 0, "00:12" = 1 }`. Other names get the numbers that follow,
    /// in natural order. By default, whole numbers stay as they are.
    #[expect(dead_code, reason = "its entries are read with their places in the file")]
    names: Option<toml::Value>,
    /// Links: sums up link samples over periods of this length (s), by run, sender, receiver and channel, into an aggregated table: rows
    /// with frames, pdr and the mean reading, as `--given-rssi` requires them.
    #[key(range = 1e-3..=1e9)]
    pub(super) aggregate_s: Option<f64>,
    /// Adds rows for sequence numbers that are missing; requires the column sequence. Packets: a row with an empty received_s for each number
    /// between two packets of a source, created at a time interpolated between them; false by default. Links: a row with received = 0
    /// for each frame of a sender that a receiver did not log; true by default, unless losses = "logged". Where the numbers begin
    /// anew, nothing is added.
    pub(super) lost_from_gaps: Option<bool>,
    /// After the number before this one, sequence numbers begin anew at 0: 256 for numbers of 8 bits. Packets: 65536 by default. Links: by
    /// default 256, 4096 or 65536 if a sender's greatest number lies less than 33 below, otherwise 4294967296.
    #[key(range = 256..=4_294_967_296)]
    pub(super) sequence_modulus: Option<u64>,
    /// Links: whether the log has the frames that were lost, which the column losses_logged then states. By default it states that losses
    /// are logged if rows were added for missing sequence numbers, or if the column frames is filled.
    pub(super) losses: Option<LoggedLosses>,
    /// Order of day and month in dates such as 04/03/2025, whose year stands last and whose parts are not separated by points. By default,
    /// rows are rejected where both orders are possible.
    pub(super) date_order: Option<DateOrder>,
    /// Offset from UTC (h) of dates that state none: 1 for Central European Time.
    #[key(range = -14.0..=14.0, default = 0.0)]
    pub(super) utc_offset_h: f64,
    /// What becomes of rows that repeat an earlier row of their file in every field.
    #[key(default = Repeats::Keep)]
    pub(super) repeats: Repeats,
    /// The logs. Rows of the table are the rows of the first input; further inputs are joined onto them.
    #[key(required, tables = InputKeys::SPEC)]
    pub(super) input: Vec<toml::Table>,
}

/// What `start` may be.
#[derive(OneOf)]
pub(super) enum StartKey {
    /// An epoch time (s).
    Epoch(f64),
    /// A date, an epoch time (s), or `as-written`.
    Text(String),
}

/// Log files of one format.
#[derive(Section)]
#[section(tag = FORMAT)]
pub(super) struct InputKeys {
    /// Path of the log, relative to the mapping file. `*` and `?` stand for any characters, as does a name in braces, whose text becomes
    /// a column of the log: `rssi_{distance}m.csv`. Each file is then a run of its own, in natural order. Files of further inputs
    /// belong to the run in whose file name the same text stands.
    #[key(required)]
    pub(super) files: Option<FilePath>,
    /// Source of each column of the table.
    #[key(default, table = COLUMNS_SPEC)]
    pub(super) columns: toml::Table,
    /// Further columns, by the name that they get, with its unit as suffix: `{ temperature_c = "Temp" }`.
    #[expect(dead_code, reason = "its entries are read with their places in the file")]
    covariates: Option<toml::Value>,
    /// Columns that each make a row of their own, as where every access point has a column: their names, in which `*` and `?` stand for
    /// any characters. The row has the name of the column as `column`, and its value as `value`; empty fields make none.
    #[key(length = 1..=2000)]
    pub(super) melt: Option<Vec<String>>,
    /// Whether frames and received_frames count from the start of the log; each row then gets the difference from the row before of the
    /// same link and channel.
    #[key(default = false)]
    pub(super) cumulative: bool,
    /// Which row of a further input goes with a row of the first.
    #[key(default = JoinKind::Latest)]
    pub(super) join: JoinKind,
    /// How far in time the joined row may be (s). Rows of the first input without one are rejected, unless nodes are joined: then their
    /// places stay empty.
    #[key(above = 0.0, most = 1e9, default = 1.0)]
    pub(super) within_s: f64,
}

const FORMAT: Tag = Tag {
    key: "format",
    doc: "The format of the log.",
    default: Some("csv"),
    variants: Variants::List(FORMATS),
};

const FORMATS: &str = "formats";
pub(super) const AS_WRITTEN: &str = "as-written";

/// The JSON Schema of a mapping file.
#[must_use]
pub fn schema() -> serde_json::Value {
    json_schema(&MappingKeys::SPEC, &lists())
}

/// The lists that the keys of a mapping file choose from.
pub(super) fn lists() -> Lists {
    Lists::default().with(FORMATS, &Registry::new(BUILT_IN))
}
