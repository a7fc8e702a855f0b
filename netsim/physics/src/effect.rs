//! Physical effects that are added to a base model, each `[[netsim.phy.effect]]` of the configuration one of them.
//!
//! One file per effect, one list: `BUILT_IN`. An effect that is not configured contributes exactly nothing.

pub mod antenna_pattern;
pub mod battery_sag;
pub mod body_blocking;
pub mod diffraction;
pub mod drift;
pub mod fast_fading;
pub mod formula;
pub mod hidden_obstacle;
pub mod interference;
pub mod link_drift;
pub mod motion_fading;
pub mod multipath;
pub mod node_offset;
pub mod noise_floor;
pub mod only;
pub mod path_loss_exponent;
pub mod receiver_nonlinearity;
pub mod reception_curve;
pub mod shadowing;
pub mod system_gain;
pub mod temperature;
pub mod two_ray_ground;
pub mod vegetation;
pub mod wall_attenuation;

#[cfg(test)]
pub(crate) mod testing;

use super::link::{Link, Scene};
use super::reception::Curve;
use super::scatter::Scatter;
use proto::config::{
    Problem, Registered, Registry, Section, TableSpec, Tag, Variant, Variants, variant,
};
use proto::effect::{About, Catalogued, Fit, Named};
use std::ops::RangeInclusive;

/// One physical effect. Stateless: everything it depends on is an argument.
///
/// The contributions attach at four places: the mean power (dB), its scatter, the probability that a frame survives, and
/// what the receiver's register reads. Most effects use one of them; the others have neutral defaults.
pub trait Effect: Named + Send + Sync + std::fmt::Debug {
    /// What it adds to the received power (dB). Attenuation is negative.
    fn contribution_db(&self, _link: &Link<'_>) -> f64 {
        0.0
    }

    /// The most that [`Effect::contribution_db`] less [`Effect::curve_shift_db`] ever adds (dB): how far links may then
    /// reach is computed from it.
    fn max_gain_db(&self) -> f64 {
        0.0
    }

    /// Whether it acts on a link at all. Where it does not, its scatter and its curve do not either.
    fn acts_on(&self, _link: &Link<'_>) -> bool {
        true
    }

    /// Whether there may be links on which it does not act.
    fn is_limited(&self) -> bool {
        false
    }

    /// The frequencies of the channels on which it acts (Hz), where they are limited.
    fn band_hz(&self) -> Option<RangeInclusive<f64>> {
        None
    }

    /// Whether it acts only between antennas above the ground.
    fn needs_heights(&self) -> bool {
        false
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

    /// As [`Effect::loss`], for a frame that arrives with this power (dBm), where that matters. Never rises with the power.
    fn loss_at(&self, link: &Link<'_>, _rssi_dbm: f64) -> f64 {
        self.loss(link)
    }

    /// What the receiver's register reads (dBm) where it would have read `register_dbm`.
    fn register_dbm(&self, _link: &Link<'_>, register_dbm: f64) -> f64 {
        register_dbm
    }

    /// Computes, once per moment, what it asks of the scene.
    fn prepare(&self, _scene: &mut Scene<'_>) {}

    /// What it adds to the path loss exponent of the base model, on all links.
    fn added_exponent(&self) -> f64 {
        0.0
    }

    /// Whether its contributions and readings depend on nothing but distance and frequency, do not raise the power as
    /// distance grows, and neither shift the curve nor lose frames. Then many links can be judged by their distance alone.
    fn is_isotropic(&self) -> bool {
        false
    }
}

/// Description of one `[[netsim.phy.effect]]`.
pub const SPEC: TableSpec = Common::SPEC;

/// A physical effect added to the base propagation model.
#[derive(Section)]
#[section(tag = TAG)]
struct Common {
    #[key(doc = proto::effect::only::DOC)]
    only: Option<only::Keys>,
}

/// The key that selects an effect.
pub const TAG: Tag =
    Tag { key: "kind", doc: "The effect.", default: None, variants: Variants::List(LIST) };

/// An effect that can be configured.
#[derive(Debug)]
pub struct Entry {
    /// Its name and keys.
    pub variant: Variant,
    /// What people should know of it.
    pub about: About,
    /// How it is fitted to measurements.
    pub fit: Fit,
    /// What its keys must be like together, beside what is asked of each: [`UNCHECKED`] for nothing.
    pub check: Check,
    /// Makes it of its checked table, wherever it acts: [`build_one`] adds the limits. The number distinguishes several effects of
    /// this kind.
    pub build: fn(&toml::Table, u32) -> Option<Box<dyn Effect>>,
}

/// Adds to the problems of a checked table, which stands at a path, those of its keys together.
pub type Check = fn(&toml::Table, &str, &mut Vec<Problem>);

/// Nothing is asked of the keys together.
pub const UNCHECKED: Check = |_, _, _| {};

impl Entry {
    /// The effect of a struct whose keys have nothing to do with each other.
    pub const fn of<T: Effect + Catalogued + Section + 'static>() -> Self {
        Self::new::<T>(UNCHECKED, |table, _| Some(Box::new(T::read(table))))
    }

    /// An effect that a struct describes.
    pub const fn new<T: Catalogued + Section>(
        check: Check,
        build: fn(&toml::Table, u32) -> Option<Box<dyn Effect>>,
    ) -> Self {
        Self { variant: variant::<T>(T::NAME), about: T::ABOUT, fit: T::FIT, check, build }
    }
}

impl Registered for Entry {
    fn variant(&self) -> &Variant {
        &self.variant
    }
}

/// What descriptions call the list of effects.
pub(crate) const LIST: &str = "netsim.phy.effect";

/// The effects that are built in.
pub(crate) const BUILT_IN: &[Entry] = &[
    antenna_pattern::ENTRY,
    battery_sag::ENTRY,
    body_blocking::ENTRY,
    diffraction::ENTRY,
    drift::ENTRY,
    fast_fading::ENTRY,
    formula::ENTRY,
    hidden_obstacle::ENTRY,
    interference::ENTRY,
    link_drift::ENTRY,
    motion_fading::ENTRY,
    multipath::ENTRY,
    node_offset::ENTRY,
    noise_floor::ENTRY,
    path_loss_exponent::ENTRY,
    receiver_nonlinearity::ENTRY,
    reception_curve::ENTRY,
    shadowing::ENTRY,
    system_gain::ENTRY,
    temperature::ENTRY,
    two_ray_ground::ENTRY,
    vegetation::ENTRY,
    wall_attenuation::ENTRY,
];

/// Adds what is wrong with tables whose keys, one by one, have been checked already. They stand at `path[0]`, `path[1]`, …
pub fn check(
    tables: &[toml::Table],
    path: &str,
    known: &Registry<Entry>,
    problems: &mut Vec<Problem>,
) {
    for (index, table) in tables.iter().enumerate() {
        if let Some(entry) = known.selected(table, &TAG) {
            let path = format!("{path}[{index}]");
            (entry.check)(table, &path, problems);
            only::check(table, &path, problems);
        }
    }
}

/// Makes the effects of checked tables, in their order.
#[must_use]
pub fn build(tables: &[toml::Table], known: &Registry<Entry>) -> Vec<Box<dyn Effect>> {
    let kind = |table: &toml::Table| known.selected(table, &TAG).map(|entry| entry.variant.name);
    let mut effects = Vec::with_capacity(tables.len());
    for (index, table) in tables.iter().enumerate() {
        if let Some(entry) = known.selected(table, &TAG) {
            let earlier = tables[..index].iter().filter(|other| kind(other) == kind(table)).count();
            effects.extend(build_one(entry, table, earlier as u32));
        }
    }
    effects
}

/// Makes one effect of its checked table, limited to where its table `only` says. The number distinguishes several effects of this
/// kind.
#[must_use]
pub fn build_one(entry: &Entry, table: &toml::Table, number: u32) -> Option<Box<dyn Effect>> {
    (entry.build)(table, number).and_then(|effect| only::limited(effect, table))
}
