//! Constants of MSF: RFC 9033, § 14.

use crate::sf::{BuildContext, Config, Entry, PayloadCells};
use proto::config::{Problem, Section, join, variant};
use serde::{Deserialize, Serialize};

/// `kind = "msf"`.
pub const ENTRY: Entry = Entry {
    variant: variant::<MsfConfig>("msf"),
    payload_cells: PayloadCells::Shared,
    build: |table, context| read(table, context).map(Config::new),
};

/// Reads the checked keys, or adds problems.
pub(in crate::sf) fn read(
    table: &toml::Table,
    context: &mut BuildContext<'_>,
) -> Option<MsfConfig> {
    let config = MsfConfig::read(table);
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

/// MSF, the minimal scheduling function (RFC 9033): motes negotiate cells with their parent according to their traffic.
///
/// Constants of MSF (§ 14). The defaults are those that RFC 9033 recommends.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, Section)]
pub struct MsfConfig {
    /// Length of the slotframes (slots).
    #[key(range = 2..=65_534, default = 101)]
    pub slotframe_slots: u16,
    /// Number of elapsed cells after which their usage is evaluated (MAX_NUM_CELLS).
    #[key(range = 1..=65_535, default = 100)]
    pub max_num_cells: u16,
    /// Add a cell if more than this many of max_num_cells were used (LIM_NUMCELLSUSED_HIGH).
    #[key(range = 0..=65_535, default = 75)]
    pub lim_numcellsused_high: u16,
    /// Delete a cell if fewer than this many of max_num_cells were used (LIM_NUMCELLSUSED_LOW).
    #[key(range = 0..=65_535, default = 25)]
    pub lim_numcellsused_low: u16,
    /// Interval at which the delivery ratios of cells are compared (s).
    #[key(range = 1..=86_400, default = 60)]
    pub housekeeping_s: u32,
    /// Relocate a cell if its delivery ratio is below that of the best cell by more than this (percentage points).
    #[key(range = 0..=100, default = 50)]
    pub relocate_pdr_percent: u8,
    /// Quarantine of a neighbour after failures (s).
    #[key(range = 1..=86_400, default = 300)]
    pub quarantine_s: u32,
    /// Minimum wait before a refused request is retried (s).
    #[key(range = 0..=86_400, default = 30)]
    pub wait_min_s: u32,
    /// Maximum wait before a refused request is retried (s).
    #[key(range = 0..=86_400, default = 60)]
    pub wait_max_s: u32,
    /// Minimum number of candidate cells in a request.
    #[key(range = 1..=18, default = 5)]
    pub candidate_cells: u8,
    /// Number of consecutive failed requests after which the mote looks for another parent.
    #[key(range = 1..=255, default = 4)]
    pub max_failures: u8,
    /// Time without traffic after which a neighbour's cells are removed (s).
    #[key(range = 1..=86_400, default = 600)]
    pub cleanup_s: u32,
}

impl Default for MsfConfig {
    fn default() -> Self {
        Self::defaults()
    }
}
