//! From received power to the probability that a frame is received.
//!
//! One file per curve, one list: [`LIST`].

pub mod o_qpsk;
pub mod table;

use proto::config::{Problem, TableSpec, Tag, Variant};

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
    doc: "How the strength of a frame decides whether it is received.",
    fields: &[],
    tag: Some(&Tag {
        key: "kind",
        doc: "The curve from RSSI to the probability of reception.",
        default: Some("table"),
        variants: || LIST.iter().map(|entry| entry.variant).collect(),
    }),
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

/// All curves.
pub const LIST: &[Entry] = &[table::ENTRY, o_qpsk::ENTRY];

/// Makes the curve of a checked table.
pub fn build(
    table: &toml::Table,
    path: &str,
    problems: &mut Vec<Problem>,
) -> Option<Box<dyn Curve>> {
    let kind = table.get("kind")?.as_str()?;
    let entry = LIST.iter().find(|entry| entry.variant.name == kind)?;
    (entry.build)(table, path, problems)
}
