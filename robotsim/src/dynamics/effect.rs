//! Physical effects between command and motion, each `[[robotsim.dynamics.effect]]` of the configuration one of them.
//!
//! One file per effect, one list: `BUILT_IN`. An effect that is not configured contributes exactly nothing.

mod acceleration_limit;
mod actuator_lag;
mod dead_band;
mod dead_time;
mod downwash;
mod formula;
mod ground_effect;
mod heading_bias;
mod localization;
pub mod only;
mod payload;
mod quadratic_drag;
mod rough_ground;
mod slip;
mod slope;
mod speed_limit;
mod steering_bias;
#[cfg(test)]
pub(super) mod testing;
mod thrust_scale;
mod turn_slowdown;
mod wind;
mod yaw_coupling;

pub use formula::NAMES;
pub use localization::Localization;

use super::body::{Drive, Part, Shape};
use super::surroundings::Surroundings;
use proto::config::{
    Problem, Registered, Registry, Section, TableSpec, Tag, Variant, Variants, variant,
};
use proto::effect::{About, Catalogued, Fit, Named};

/// One physical effect. Stateless: everything it depends on is an argument.
///
/// A command passes through effects in this order, whatever their order in the configuration: it comes late
/// ([`Effect::delay_s`]); what it asks for is changed ([`Effect::shape`], in the order of the configuration); the actuators
/// follow with lag and limits ([`Effect::lag_s`], [`Effect::limit_per_s`]); their thrust is changed ([`Effect::thrust_gain`]); the ground and the air add theirs
/// ([`Effect::ground_scale`], [`Effect::drift_mps`]); and at last the position is measured ([`Effect::localization`]). Most
/// effects use one of these; the others have neutral defaults.
pub trait Effect: Named + Send + Sync + std::fmt::Debug {
    /// What limits it to some robots or times, if anything does. Nothing else of it depends on that.
    fn limits(&self) -> Option<&only::Limits> {
        None
    }

    /// How much later (s) commands act.
    fn delay_s(&self, _part: Part) -> f64 {
        0.0
    }

    /// What the actuators come to where the command asks for `demand`.
    fn shape(&self, _shape: Shape, demand: Drive) -> Drive {
        demand
    }

    /// Time constant (s) with which actuators follow.
    fn lag_s(&self, _part: Part) -> f64 {
        0.0
    }

    /// How fast actuators may change, per second.
    fn limit_per_s(&self, _part: Part) -> f64 {
        f64::INFINITY
    }

    /// By how much (rad) a turning body moves to the left of its heading.
    fn course_rad(&self) -> f64 {
        0.0
    }

    /// Sideways velocity per ω × v (s) of a turning body.
    fn sideways_s(&self) -> f64 {
        0.0
    }

    /// Fraction of the speed that a turning body loses per yaw rate (s).
    fn slowdown_s(&self) -> f64 {
        0.0
    }

    /// By what the speed over ground is multiplied between two places that are close to each other.
    fn ground_scale(&self, _from_m: [f64; 3], _to_m: [f64; 3]) -> f64 {
        1.0
    }

    /// Velocity (m/s) that is added to the robot's own.
    fn drift_mps(&self, _at: &Situation<'_>) -> [f64; 3] {
        [0.0; 3]
    }

    /// By what the thrust of a body that keeps its velocity is multiplied: the thrust that its actuators would give by themselves.
    fn thrust_gain(&self, _at: &Situation<'_>) -> f64 {
        1.0
    }

    /// Least and greatest value of [`Effect::thrust_gain`].
    fn thrust_gains(&self) -> [f64; 2] {
        [1.0; 2]
    }

    /// Whether there is a drift at all.
    fn drifts(&self) -> bool {
        false
    }

    /// Whether [`Effect::ground_scale`], [`Effect::drift_mps`] or [`Effect::thrust_gain`] change as the robot moves or time passes.
    fn varies_on_the_way(&self) -> bool {
        false
    }

    /// Whether [`Effect::drift_mps`] depends on other robots.
    fn heeds_others(&self) -> bool {
        false
    }

    /// How positions are measured.
    fn localization(&self) -> Option<Localization> {
        None
    }
}

/// Where a robot is when an effect is asked for its drift.
#[derive(Clone, Copy, Debug)]
pub struct Situation<'a> {
    /// When (s).
    pub time_s: f64,
    /// Where (m).
    pub position_m: [f64; 3],
    /// With which velocity (m/s), drift apart.
    pub velocity_mps: [f64; 3],
    /// Direction it faces (rad).
    pub heading_rad: f64,
    /// What is around it.
    pub surroundings: &'a Surroundings<'a>,
}

/// Description of one `[[robotsim.dynamics.effect]]`.
pub const SPEC: TableSpec = Common::SPEC;

/// A physical effect between command and motion.
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
    /// How it is fitted to measurements. A key `name[i]` is entry i of a list.
    pub fit: Fit,
    /// What its keys must be like together, beside what is asked of each: [`UNCHECKED`] for nothing.
    pub check: Check,
    /// Makes it of its checked table, wherever it acts: [`build_one`] adds the limits.
    pub build: fn(&toml::Table) -> Option<Box<dyn Effect>>,
}

/// Adds to the problems of a checked table, which stands at a path, those of its keys together.
pub type Check = fn(&toml::Table, &str, &mut Vec<Problem>);

/// Nothing is asked of the keys together.
pub const UNCHECKED: Check = |_, _, _| {};

impl Entry {
    /// The effect of a struct whose keys have nothing to do with each other.
    pub const fn of<T: Effect + Catalogued + Section + 'static>() -> Self {
        Self::new::<T>(UNCHECKED, |table| Some(Box::new(T::read(table))))
    }

    /// An effect that a struct describes.
    pub const fn new<T: Catalogued + Section>(
        check: Check,
        build: fn(&toml::Table) -> Option<Box<dyn Effect>>,
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
pub(crate) const LIST: &str = "robotsim.dynamics.effect";

/// The effects that are built in.
pub(crate) const BUILT_IN: &[Entry] = &[
    acceleration_limit::ENTRY,
    actuator_lag::ENTRY,
    dead_band::ENTRY,
    dead_time::ENTRY,
    downwash::ENTRY,
    formula::ENTRY,
    ground_effect::ENTRY,
    heading_bias::ENTRY,
    localization::ENTRY,
    payload::ENTRY,
    quadratic_drag::ENTRY,
    rough_ground::ENTRY,
    slip::ENTRY,
    slope::ENTRY,
    speed_limit::ENTRY,
    steering_bias::ENTRY,
    thrust_scale::ENTRY,
    turn_slowdown::ENTRY,
    wind::ENTRY,
    yaw_coupling::ENTRY,
];

/// Makes the effects of checked tables, in their order, and adds what is wrong with them together with the rest: they stand at
/// `path[0]`, `path[1]`, …
pub fn build(
    tables: &[toml::Table],
    path: &str,
    known: &Registry<Entry>,
    problems: &mut Vec<Problem>,
) -> Vec<Box<dyn Effect>> {
    let mut one = |(index, table): (usize, &toml::Table)| {
        let entry = known.selected(table, &TAG)?;
        let path = format!("{path}[{index}]");
        (entry.check)(table, &path, problems);
        only::check(table, &path, problems);
        build_one(entry, table)
    };
    tables.iter().enumerate().filter_map(&mut one).collect()
}

/// Makes one effect of its checked table, limited to where its table `only` says.
#[must_use]
pub fn build_one(entry: &Entry, table: &toml::Table) -> Option<Box<dyn Effect>> {
    (entry.build)(table).and_then(|effect| only::limited(effect, table))
}

/// The actuator that an effect concerns.
#[derive(Clone, Debug, PartialEq, Section)]
struct Actuator {
    /// The actuator that the effect acts on. Point masses have only one.
    #[key(default = Part::Speed)]
    on: Part,
}

/// A demand whose speed (the norm, or the speed along the heading) is changed, direction and turning as they are.
fn with_speed(shape: Shape, demand: Drive, speed_mps: impl Fn(f64) -> f64) -> Drive {
    if shape.is_turning() {
        let sign = if demand[0] < 0.0 { -1.0 } else { 1.0 };
        return [sign * speed_mps(demand[0].abs()), demand[1], demand[2]];
    }
    let [x, y, z] = demand;
    let norm = libm::sqrt(x * x + y * y + z * z);
    if norm == 0.0 { demand } else { demand.map(|part| part / norm * speed_mps(norm)) }
}
