//! Physical effects between command and motion, each `[[robotsim.dynamics.effect]]` of the configuration one of them.
//!
//! One file per effect, one list: `BUILT_IN`. An effect that is not configured contributes exactly nothing.

mod acceleration_limit;
mod actuator_lag;
mod attitude_bias;
mod dead_band;
mod dead_time;
mod downwash;
mod formula;
mod ground_effect;
mod heading_bias;
mod linear_drag;
mod localization;
pub mod only;
mod payload;
mod push;
mod quadratic_drag;
mod rotor_loss;
mod rough_ground;
mod slip;
mod slope;
mod speed_limit;
mod steering_bias;
mod swinging_load;
#[cfg(test)]
pub(super) mod testing;
mod thrust_scale;
mod thrust_voltage;
mod turn_slowdown;
mod wind;
mod yaw_coupling;

pub use formula::NAMES;
pub use localization::Localization;
pub use swinging_load::Pendulum;
pub(super) use swinging_load::check as check_loads;

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
/// follow with lag and limits ([`Effect::lag_s`], [`Effect::limit_per_s`]); their thrust is changed ([`Effect::thrust_gain`],
/// [`Effect::tilt_rad`]); the ground and the air add theirs ([`Effect::ground_scale`], [`Effect::drift_mps`], and to bodies that keep
/// their velocity [`Effect::force_mps2`] and [`Effect::load`]); and at last the position is measured ([`Effect::localization`]).
/// Most effects use one of these; the others have neutral defaults.
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

    /// Velocity (m/s) that is added to the own one of a robot that does not keep its velocity.
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

    /// By how much (rad) the thrust of a body that keeps its velocity is tilted, beside its attitude: roll and pitch.
    fn tilt_rad(&self) -> [f64; 2] {
        [0.0; 2]
    }

    /// What a force beside the thrust accelerates a body by (m/s²) that keeps its velocity. Where nothing else is said, that is the number
    /// which is added to the velocity (m/s) of other robots.
    fn force_mps2(&self, at: &Situation<'_>) -> [f64; 3] {
        self.drift_mps(at)
    }

    /// The greatest of [`Effect::force_mps2`] on a body at rest (m/s²).
    fn most_force_mps2(&self) -> f64 {
        0.0
    }

    /// What hangs below a body that keeps its velocity.
    fn load(&self) -> Option<Pendulum> {
        None
    }

    /// Whether there is a drift at all.
    fn drifts(&self) -> bool {
        false
    }

    /// Whether what it does to the motion changes as the robot moves or time passes.
    fn varies_on_the_way(&self) -> bool {
        false
    }

    /// Of an effect that varies on the way: whether it does the same everywhere within a distance of a place. The distance is what a robot
    /// may go without it.
    fn is_uniform(&self, _position_m: [f64; 3], _reach_m: f64) -> bool {
        false
    }

    /// The same of bodies that keep their velocity.
    fn force_varies(&self) -> bool {
        self.varies_on_the_way()
    }

    /// Whether it depends on other robots.
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
    attitude_bias::ENTRY,
    dead_band::ENTRY,
    dead_time::ENTRY,
    downwash::ENTRY,
    formula::ENTRY,
    ground_effect::ENTRY,
    heading_bias::ENTRY,
    linear_drag::ENTRY,
    localization::ENTRY,
    payload::ENTRY,
    push::ENTRY,
    quadratic_drag::ENTRY,
    rotor_loss::ENTRY,
    rough_ground::ENTRY,
    slip::ENTRY,
    slope::ENTRY,
    speed_limit::ENTRY,
    steering_bias::ENTRY,
    swinging_load::ENTRY,
    thrust_scale::ENTRY,
    thrust_voltage::ENTRY,
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
