//! From received power to the probability that a frame is received.
//!
//! One file per curve, one list: `BUILT_IN`.

pub mod fsk;
pub mod o_qpsk;
pub mod table;

use proto::config::{Problem, Registered, Registry, TableSpec, Tag, Variant, Variants};

/// Probability of reception as a function of received power. Never falls as power rises.
pub trait Curve: Send + Sync + std::fmt::Debug {
    /// Probability that a frame received with `rssi_dbm` (the power at the receiver, without interference) is received.
    fn reception_probability(&self, rssi_dbm: f64) -> f64;

    /// Below this power (dBm) the probability is exactly 0.
    fn floor_dbm(&self) -> f64;

    /// From this power (dBm) on the probability is what it is at any higher power.
    fn ceiling_dbm(&self) -> f64;
}

/// Description of `[netsim.phy.reception]`.
pub const SPEC: TableSpec = TableSpec {
    doc: "Reception model: how the RSSI of a frame determines whether it is received.",
    fields: &[],
    tag: Some(&TAG),
};

/// The key that selects a curve.
pub const TAG: Tag = Tag {
    key: "kind",
    doc: "The curve from RSSI to the probability of reception.",
    default: Some(table::ENTRY.variant.name),
    variants: Variants::List(LIST),
};

/// A curve that can be configured.
#[derive(Debug)]
pub struct Entry {
    /// Its name and keys.
    pub variant: Variant,
    /// Makes it of its checked table, or adds problems with keys under the given path.
    pub build: Build,
}

/// Makes a curve of its checked table, or adds problems with keys under the given path.
pub type Build = fn(&toml::Table, &str, &mut Vec<Problem>) -> Option<Box<dyn Curve>>;

impl Registered for Entry {
    fn variant(&self) -> &Variant {
        &self.variant
    }
}

/// What descriptions call the list of curves.
pub(crate) const LIST: &str = "netsim.phy.reception";

/// The curves that are built in.
pub(crate) const BUILT_IN: &[Entry] = &[table::ENTRY, o_qpsk::ENTRY, fsk::ENTRY];

/// Makes the curve of a checked table.
pub fn build(
    table: &toml::Table,
    path: &str,
    known: &Registry<Entry>,
    problems: &mut Vec<Problem>,
) -> Option<Box<dyn Curve>> {
    (known.selected(table, &TAG)?.build)(table, path, problems)
}
