//! Physical effects that are added to a base model, each `[[netsim.phy.effect]]` of the configuration one of them.
//!
//! One file per effect, one list: [`LIST`]. An effect that is not configured contributes exactly nothing.

pub mod shadowing;
pub mod system_gain;

use super::link::Link;
use super::reception::Curve;
use super::scatter::Scatter;
use proto::config::{TableSpec, Tag, Variant};
use proto::effect::{About, Fit};

/// One physical effect. Stateless: everything it depends on is an argument.
///
/// The contributions attach at four places: the mean power (dB), its scatter, the probability that a frame survives, and
/// what the receiver's register reads. Most effects use one of them; the others have neutral defaults.
pub trait Effect: Send + Sync + std::fmt::Debug {
    /// Its name in configurations, records and reports.
    fn name(&self) -> &'static str;

    /// What it adds to the received power (dB). Attenuation is negative.
    fn contribution_db(&self, _link: &Link<'_>) -> f64 {
        0.0
    }

    /// The most that [`Effect::contribution_db`] less [`Effect::curve_shift_db`] ever adds (dB): how far links may then
    /// reach is computed from it.
    fn max_gain_db(&self) -> f64 {
        0.0
    }

    /// What varies at random about the mean, if anything does.
    fn scatter(&self) -> Option<Scatter> {
        None
    }

    /// By how much (dB) frames must be stronger to be received as well as without it.
    fn curve_shift_db(&self, _link: &Link<'_>) -> f64 {
        0.0
    }

    /// The receiver's own curve from power to reception, in place of the configured one. The last effect that has one
    /// decides.
    fn curve(&self) -> Option<&dyn Curve> {
        None
    }

    /// The probability, 0 to 1, that a frame is lost for this reason, independently of all others.
    fn loss(&self, _link: &Link<'_>) -> f64 {
        0.0
    }

    /// What the receiver's register reads (dBm) where it would have read `register_dbm`.
    fn register_dbm(&self, _link: &Link<'_>, register_dbm: f64) -> f64 {
        register_dbm
    }

    /// Whether its contributions and readings depend on nothing but distance and frequency, do not raise the power as
    /// distance grows, and neither shift the curve nor lose frames. Then many links can be judged by their distance alone.
    fn is_isotropic(&self) -> bool {
        false
    }
}

/// Description of one `[[netsim.phy.effect]]`.
pub const SPEC: TableSpec = TableSpec {
    doc: "A physical effect that is added to the base model.",
    fields: &[],
    tag: Some(&Tag {
        key: "kind",
        doc: "Which effect.",
        default: None,
        variants: || LIST.iter().map(|entry| entry.variant).collect(),
    }),
};

/// An effect that can be configured.
#[derive(Debug)]
pub struct Entry {
    /// Its name and keys.
    pub variant: Variant,
    /// What people should know of it.
    pub about: About,
    /// How it is fitted to measurements.
    pub fit: Fit,
    /// Makes it of its checked table. The number tells several effects of this kind apart.
    pub build: fn(&toml::Table, u32) -> Option<Box<dyn Effect>>,
}

/// All effects.
pub const LIST: &[Entry] = &[shadowing::ENTRY, system_gain::ENTRY];

/// Makes the effects of checked tables, in their order.
#[must_use]
pub fn build(tables: &[toml::Value]) -> Vec<Box<dyn Effect>> {
    let kind =
        |value: &toml::Value| value.get("kind").and_then(|kind| kind.as_str().map(str::to_owned));
    let mut effects = Vec::with_capacity(tables.len());
    for (index, table) in tables.iter().enumerate() {
        let Some(name) = kind(table) else { continue };
        let entry = LIST.iter().find(|entry| entry.variant.name == name);
        if let (Some(entry), Some(keys)) = (entry, table.as_table()) {
            let earlier = tables[..index].iter().filter(|other| kind(other) == kind(table)).count();
            effects.extend((entry.build)(keys, earlier as u32));
        }
    }
    effects
}
