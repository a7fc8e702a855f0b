//! What a physical effect says about itself: for people who read about it, and for the fit that tries it on measurements.
//!
//! Both simulators describe their effects in these words, so that one catalogue lists them and one search tries them. Where and when
//! an effect acts, [`only`] reads for both.

pub mod only;

pub use proto_derive::Catalogued;

/// What has a name in configurations, records and reports. `#[derive(Catalogued)]` makes an effect's.
pub trait Named {
    /// That name.
    fn name(&self) -> &'static str;
}

/// An effect of the catalogue, whose struct is its description. `#[derive(Catalogued)]` makes all three of documentation and attributes.
pub trait Catalogued {
    /// Its name in configurations, records and reports.
    const NAME: &'static str;
    /// What people should know of it.
    const ABOUT: About;
    /// How it is fitted to measurements.
    const FIT: Fit;
}

/// What people should know of an effect.
#[derive(Clone, Copy, Debug)]
pub struct About {
    /// What happens, in plain words.
    pub mechanism: &'static str,
    /// The equation, as text.
    pub equation: &'static str,
    /// Where the equation comes from.
    pub source: &'static str,
    /// Where it holds, and where not.
    pub validity: &'static str,
    /// What it looks like in the residuals of a model that lacks it.
    pub trace: &'static str,
    /// What measurements must have for it to be tested.
    pub needs: &'static [Need],
    /// Keys of an example that shows something, as lines of TOML. Empty: where a fit of the effect starts.
    pub example: &'static str,
}

/// What measurements, or the site, must have for an effect to be tested.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Need {
    /// Positions of both ends.
    Positions,
    /// Positive antenna heights.
    Heights,
    /// Channels, more than one.
    Channels,
    /// Headings at one end at least, that vary, or nodes that stand still.
    Headings,
    /// Nodes that move.
    Movement,
    /// Nodes that all stand still.
    Still,
    /// Times that vary.
    Time,
    /// `[[site.wall]]`.
    Walls,
    /// `[[site.foliage]]`.
    Foliage,
    /// Walls or obstacles of `[site]` with a height.
    Edges,
    /// `[site]` terrain.
    Terrain,
    /// Other agents at the same time.
    OtherAgents,
    /// Frames that were lost.
    Losses,
    /// Readings of the strength of received frames.
    Readings,
    /// A column of this name, or with `tx_` or `rx_` before it.
    Column(&'static str),
    /// Commands of speed with yaw rate or steering.
    TurningCommands,
    /// Commands of steering.
    Steering,
    /// Commands of velocity or speed.
    VelocityCommands,
    /// Commands of acceleration, or of thrust and attitude.
    ThrustCommands,
    /// The mass of the robots.
    Mass,
    /// Packets from end to end, sent and received.
    Packets,
    /// As [`Need::Packets`], with the times at which they arrived.
    Latencies,
}

impl Need {
    /// `positive antenna heights`, …
    #[must_use]
    pub fn describe(self) -> String {
        match self {
            Self::Positions => "positions of both ends".to_owned(),
            Self::Heights => "positive antenna heights".to_owned(),
            Self::Channels => "more than one channel".to_owned(),
            Self::Headings => "headings, or stationary nodes".to_owned(),
            Self::Movement => "mobile nodes".to_owned(),
            Self::Still => "stationary nodes only".to_owned(),
            Self::Time => "more than one time".to_owned(),
            Self::Walls => "walls in [site]".to_owned(),
            Self::Foliage => "foliage in [site]".to_owned(),
            Self::Edges => "walls or obstacles with a height in [site]".to_owned(),
            Self::Terrain => "terrain in [site]".to_owned(),
            Self::OtherAgents => "positions of other agents at the same time".to_owned(),
            Self::Losses => "lost frames".to_owned(),
            Self::Readings => "RSSI readings".to_owned(),
            Self::Column(name) => format!("a column {name}"),
            Self::TurningCommands => "commands of speed and of yaw rate or steering".to_owned(),
            Self::Steering => "commands of steering".to_owned(),
            Self::VelocityCommands => "commands of velocity or speed".to_owned(),
            Self::ThrustCommands => {
                "commands of acceleration, or of thrust and attitude".to_owned()
            }
            Self::Mass => "mass_kg in [robotsim.dynamics]".to_owned(),
            Self::Packets => "end-to-end packets".to_owned(),
            Self::Latencies => "end-to-end packets with arrival times".to_owned(),
        }
    }
}

/// How an effect is fitted.
#[derive(Clone, Copy, Debug)]
pub struct Fit {
    /// The keys that are fitted, numbers all.
    pub parameters: &'static [Parameter],
    /// Sets of further keys, each of which is tried: empty where the defaults will do.
    pub variants: &'static [&'static [(&'static str, Fixed)]],
    /// At which level its covariate varies: there its gain is judged.
    pub level: Level,
    /// Effects of which it is a generalisation. Where one of these explains as much, that one is preferred.
    pub generalises: &'static [&'static str],
    /// The covariate in which it is linear, alike for all nodes: a curve over that, with a level, does what it does and more.
    pub linear_in: Option<&'static str>,
    /// What a fit estimates of it.
    pub role: Role,
    /// Where a search for its parameters starts.
    pub search: Search,
    /// Of a radio effect that packets from end to end can show: its further keys when whole networks are simulated with it. `None`:
    /// it is not tried on such packets. Effects on motes always are.
    pub in_runs: Option<&'static [(&'static str, Fixed)]>,
    /// Keys of parameters that only one kind of body has.
    pub of_body: &'static [(&'static str, Body)],
    /// Keys that repeat a property of the configured model. A fitted one starts there; the others are taken from there.
    pub from_model: &'static [(&'static str, FromModel)],
    /// It spreads single frames, independently of each other, and moves no mean.
    pub is_spread: bool,
    /// Several of it may act at once, each with its own keys.
    pub is_repeatable: bool,
    /// Of a robot effect that has directions or places of the plane: positions of all campaigns must be in one frame.
    pub needs_one_frame: bool,
    /// Of a robot effect: what measured motion may contradict, such as a bound that the first parameter sets and robots pass.
    pub bounds: Option<Bounds>,
}

impl Fit {
    /// Nothing to be fitted, judged in time. An entry names what is different about its effect: `..Fit::PLAIN` is the rest.
    pub const PLAIN: Self = Self {
        parameters: &[],
        variants: &[],
        level: Level::Time,
        generalises: &[],
        linear_in: None,
        role: Role::Effect,
        search: Search::Starts,
        in_runs: None,
        of_body: &[],
        from_model: &[],
        is_spread: false,
        is_repeatable: false,
        needs_one_frame: false,
        bounds: None,
    };
}

/// What an effect on robots says of motion by its first parameter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Bounds {
    /// Robots are no faster.
    Speed,
    /// Robots are accelerated no more.
    Acceleration,
    /// Robots that are commanded to be slower stand still.
    Standstill,
    /// The course is turned by this angle, as it is by the mean error of measured headings.
    Course,
}

/// What a fit estimates of an effect.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    /// Its parameters.
    Effect,
    /// A radio effect that is a random level per node: keys `tx_sd_db` and `rx_sd_db` are estimated from levels.
    RandomPerNode,
    /// A radio effect that is a random level per link and place: keys `sd_db` and `decorrelation_m`.
    RandomPerLink,
    /// A radio effect that is a random level per link, channel and place as small as half a wave: keys `sd_db` and `coherence_mhz`.
    RandomPerChannel,
    /// A radio effect that is a random level of all links, which changes in time: keys `sd_db` and `correlation_s`.
    RandomInTime,
    /// A radio effect that is a random level of each link, which changes in time: keys `sd_db` and `correlation_s`.
    RandomPerLinkInTime,
    /// A robot effect that is the noise of measured positions, key `sd_m`, which every model of robots has.
    Noise,
}

/// Where a search for the parameters of an effect starts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Search {
    /// At all products of [`Parameter::starts`].
    Starts,
    /// Radio: at headings of nodes that stand still, found in turn with the parameters.
    Headings,
    /// Radio: at the ends of an obstacle that is on no map.
    Places,
    /// Radio: at the nodes and times that it concerns.
    Nodes,
    /// Robots: at discs of the plane. Parameters are x and y of the centre, the radius, and the scale in it.
    Discs,
    /// Robots: at thresholds of commands that the measurements can tell apart.
    Thresholds {
        /// It changes commands below its threshold and no others.
        only_below: bool,
    },
    /// Robots: as thresholds, of how fast commands change.
    ThresholdsOfChanges,
    /// Robots: at times spread over the measurements, of the last parameter, each with the starts of the others.
    Times,
}

/// A property of a configured radio, its base model and effects together, or of a configured robot.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FromModel {
    /// Path loss exponent: 2 in free space.
    PathLossExponent,
    /// The distance (m) up to which free space applies.
    ReferenceDistance,
    /// Mass of a robot (kg).
    Mass,
}

/// A kind of body that turns.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Body {
    /// Commanded by speed and yaw rate.
    Unicycle,
    /// Commanded by speed and steering angle.
    Car,
    /// Commanded by an acceleration, or by thrust and attitude.
    Inertial,
}

/// The covariate of what is the same in every row.
pub const CONSTANT: &str = "constant";

/// A parameter that is fitted.
#[derive(Clone, Copy, Debug)]
pub struct Parameter {
    /// Its key.
    pub key: &'static str,
    /// Its unit.
    pub unit: &'static str,
    /// Least value.
    pub min: f64,
    /// Greatest value.
    pub max: f64,
    /// Where a search starts: several, where the likelihood may have several peaks. For several parameters the products of
    /// all starts are tried.
    pub starts: &'static [f64],
    /// A small step: what changes predictions a little.
    pub step: f64,
    /// The value at which the effect does nothing, of a parameter that is the size of its effect.
    pub null: Option<f64>,
    /// Which values are physically plausible, where that is known. A fit is not held within them.
    pub plausible: Option<Plausible>,
}

/// The values of a parameter that are physically plausible.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Plausible {
    /// Least value, in the parameter's unit.
    pub min: f64,
    /// Greatest value, in the parameter's unit.
    pub max: f64,
    /// Who reports such values, or what they follow from.
    pub source: &'static str,
}

impl Parameter {
    /// A parameter of a formula that a user wrote. `range`: its start, least and greatest value.
    ///
    /// Name and start stay in memory until the program ends: a program is asked for few.
    #[must_use]
    pub fn of_formula(name: &str, [start, min, max]: [f64; 3]) -> Self {
        let around = if start == 0.0 { 1.0 } else { start.abs() };
        Self {
            key: name.to_owned().leak(),
            unit: "",
            min,
            max,
            starts: vec![start].leak(),
            step: (0.1 * around).min(0.1 * (max - min)),
            null: None,
            plausible: None,
        }
    }
}

/// The value of a key that is not fitted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Fixed {
    /// A text.
    Text(&'static str),
    /// A number.
    Number(f64),
    /// A truth value.
    Bool(bool),
}

impl Fixed {
    /// As a value of a configuration.
    #[must_use]
    pub fn value(self) -> toml::Value {
        match self {
            Self::Text(text) => toml::Value::String(text.to_owned()),
            Self::Number(number) => toml::Value::Float(number),
            Self::Bool(truth) => toml::Value::Boolean(truth),
        }
    }
}

/// At which level an effect varies, and so which rows are independent evidence for it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Level {
    /// In time: judged on blocks of time left out.
    Time,
    /// From place to place: judged on pairs of nodes, or places, left out.
    Place,
    /// Drawn at random for each node, link or frame: judged on blocks of time, with shrinkage.
    Random,
    /// In a whole run of the network: judged by runs under many seeds.
    Run,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::Section;

    /// A loss.
    ///
    /// # Mechanism
    ///
    /// A cable.
    ///
    /// # Equation
    ///
    /// RSSI' = RSSI - loss_db
    ///
    /// # Source
    ///
    /// None.
    ///
    /// # Validity
    ///
    /// Of tests only.
    ///
    /// # Trace
    ///
    /// Weak links.
    #[derive(Catalogued, Section)]
    #[effect(name = "loss")]
    #[expect(dead_code, reason = "only its declaration is read")]
    struct Loss {
        /// The loss (dB).
        #[key(range = 0.0..=60.0)]
        #[fit(unit = "dB", starts = [3.0], step = 0.05, null = 0.0, plausible = 0.5..=20.0, source = "a book")]
        loss_db: f64,
        /// Length of the cable (m).
        #[key(range = 0.0..=9.0)]
        #[fit(unit = "m", starts = [1.0], step = 0.01)]
        length_m: f64,
    }

    #[test]
    fn a_declaration_carries_the_null_and_the_plausible_range_of_a_parameter() {
        let [loss, length] = Loss::FIT.parameters else { panic!("two parameters") };
        assert_eq!((loss.min, loss.max, loss.null), (0.0, 60.0, Some(0.0)));
        assert_eq!(loss.plausible, Some(Plausible { min: 0.5, max: 20.0, source: "a book" }));
        assert_eq!((length.null, length.plausible), (None, None));
    }
}
