//! Constants of MSF: RFC 9033, § 14.

use crate::sf::{BuildContext, Config, Entry, PayloadCells};
use proto::config::{Default, Field, Kind, Problem, Variant, join, typed};
use serde::{Deserialize, Serialize};

const fn field(key: &'static str, doc: &'static str, min: i64, max: i64, default: i64) -> Field {
    Field { key, doc, kind: Kind::Integer { min, max }, default: Default::Integer(default) }
}

/// The keys of MSF, which functions that negotiate like it share.
pub const FIELDS: &[Field] = &[
    field("slotframe_slots", "Length of the slotframes (slots).", 2, 65_534, 101),
    field(
        "max_num_cells",
        "Number of elapsed cells after which their usage is evaluated (MAX_NUM_CELLS).",
        1,
        65_535,
        100,
    ),
    field(
        "lim_numcellsused_high",
        "Add a cell if more than this many of max_num_cells were used (LIM_NUMCELLSUSED_HIGH).",
        0,
        65_535,
        75,
    ),
    field(
        "lim_numcellsused_low",
        "Delete a cell if fewer than this many of max_num_cells were used (LIM_NUMCELLSUSED_LOW).",
        0,
        65_535,
        25,
    ),
    field(
        "housekeeping_s",
        "Interval at which the delivery ratios of cells are compared (s).",
        1,
        86_400,
        60,
    ),
    field(
        "relocate_pdr_percent",
        "Relocate a cell if its delivery ratio is below that of the best cell by more than this (percentage points).",
        0,
        100,
        50,
    ),
    field("quarantine_s", "Quarantine of a neighbour after failures (s).", 1, 86_400, 300),
    field("wait_min_s", "Minimum wait before a refused request is retried (s).", 0, 86_400, 30),
    field("wait_max_s", "Maximum wait before a refused request is retried (s).", 0, 86_400, 60),
    field("candidate_cells", "Minimum number of candidate cells in a request.", 1, 18, 5),
    field(
        "max_failures",
        "Number of consecutive failed requests after which the mote looks for another parent.",
        1,
        255,
        4,
    ),
    field(
        "cleanup_s",
        "Time without traffic after which a neighbour's cells are removed (s).",
        1,
        86_400,
        600,
    ),
];

/// `kind = "msf"`.
pub const ENTRY: Entry = Entry {
    variant: Variant {
        name: "msf",
        doc: "The minimal scheduling function (RFC 9033): motes negotiate cells with their parent according to their traffic.",
        fields: FIELDS,
    },
    payload_cells: PayloadCells::Shared,
    build: |table, context| read(table, context).map(Config::new),
};

/// Reads the checked keys, or adds problems.
pub(in crate::sf) fn read(
    table: &toml::Table,
    context: &mut BuildContext<'_>,
) -> Option<MsfConfig> {
    let config: MsfConfig = typed(table);
    let before = context.problems.len();
    let mut check = |is_right: bool, key: &str, message: &str| {
        if !is_right {
            context.problems.push(Problem::new(join(context.path, key), message));
        }
    };
    check(
        config.lim_numcellsused_low <= config.lim_numcellsused_high,
        "lim_numcellsused_low",
        "must be at most lim_numcellsused_high",
    );
    check(
        config.lim_numcellsused_high <= config.max_num_cells,
        "lim_numcellsused_high",
        "must be at most max_num_cells",
    );
    check(config.wait_min_s <= config.wait_max_s, "wait_min_s", "must be at most wait_max_s");
    (context.problems.len() == before).then_some(config)
}

/// Constants of MSF (§ 14). The defaults are those that RFC 9033 recommends.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct MsfConfig {
    /// SLOTFRAME_LENGTH (slots), of all three slotframes.
    pub slotframe_slots: u16,
    /// MAX_NUM_CELLS: cells that elapse before their use is judged.
    pub max_num_cells: u16,
    /// LIM_NUMCELLSUSED_HIGH, of `max_num_cells`.
    pub lim_numcellsused_high: u16,
    /// LIM_NUMCELLSUSED_LOW, of `max_num_cells`.
    pub lim_numcellsused_low: u16,
    /// HOUSEKEEPINGCOLLISION_PERIOD (s).
    pub housekeeping_s: u32,
    /// RELOCATE_PDRTHRES (percentage points).
    pub relocate_pdr_percent: u8,
    /// QUARANTINE_DURATION (s).
    pub quarantine_s: u32,
    /// WAIT_DURATION_MIN (s).
    pub wait_min_s: u32,
    /// WAIT_DURATION_MAX (s).
    pub wait_max_s: u32,
    /// Least length of lists of candidates (§ 8).
    pub candidate_cells: u8,
    /// Consecutive requests that may fail before routing is notified.
    pub max_failures: u8,
    /// Silence after which cells with a neighbour that is not the parent are removed (s). § 5.1 asks for such a mechanism.
    pub cleanup_s: u32,
}

impl std::default::Default for MsfConfig {
    fn default() -> Self {
        Self {
            slotframe_slots: 101,
            max_num_cells: 100,
            lim_numcellsused_high: 75,
            lim_numcellsused_low: 25,
            housekeeping_s: 60,
            relocate_pdr_percent: 50,
            quarantine_s: 300,
            wait_min_s: 30,
            wait_max_s: 60,
            candidate_cells: 5,
            max_failures: 4,
            cleanup_s: 600,
        }
    }
}
