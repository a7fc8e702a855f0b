//! `[netsim.second_medium]`: a broadcast medium that robots have beside the main network, such as infrared light or WiFi.
//!
//! | module | what |
//! |---|---|
//! | [`infrared`], [`wifi_broadcast`] | the media, one file each |
//! | [`around`] | the robots that take part in a step, and which of them reach each other |
//! | [`carried`] | frames of a step, and who received them |
//! | `merge` | deliveries of both media as one list |
//! | `copies` | which copy of a payload a receiver takes, if both media carry it |
//!
//! A medium sends the payload of each robot once per control period. Both media work at the same time and do not disturb each
//! other. The second medium has its own power supply: an empty battery of a mote does not silence it, a failure of the mote does.

pub mod around;
pub mod carried;
mod copies;
pub mod infrared;
mod merge;
pub mod wifi_broadcast;

use crate::place::{self, Place};
use around::Around;
use carried::Carried;
use copies::Copies;
use proto::config::{
    Choice, Problem, Registered, Registry, Section, TableSpec, Tag, Variant, Variants, join,
};
use proto::ids::MoteId;
use proto::side::{NetInput, NetOutput};
use proto::site::Site;
use proto::time::{SimDuration, SimTime};
use proto::types::{DeliveryColumn, Experiment, Payloads};
use serde::{Deserialize, Serialize};

/// Description of `[netsim.second_medium]`.
pub const SPEC: TableSpec = Keys::SPEC;

/// The key that selects a medium.
pub(crate) const TAG: Tag =
    Tag { key: "kind", doc: "The medium.", default: None, variants: Variants::List(LIST) };

/// What descriptions call the list of media.
pub(crate) const LIST: &str = "netsim.second_medium";

/// The media that are built in.
pub(crate) const BUILT_IN: &[Entry] = &[infrared::ENTRY, wifi_broadcast::ENTRY];

/// A medium that can be configured.
#[derive(Debug)]
pub struct Entry {
    /// Its name and keys.
    pub variant: Variant,
    /// Makes it of its checked table, or adds problems.
    pub build: fn(&toml::Table, &mut BuildContext<'_>) -> Option<Box<dyn SecondMedium>>,
}

impl Registered for Entry {
    fn variant(&self) -> &Variant {
        &self.variant
    }
}

/// What a medium may need to be built.
#[derive(Debug)]
pub struct BuildContext<'a> {
    /// Path of `[netsim.second_medium]`, for problems.
    pub path: &'a str,
    /// Capacity of the experiment.
    pub agent_count: usize,
    /// Length of a control period.
    pub step: SimDuration,
    /// What is found wrong.
    pub problems: &'a mut Vec<Problem>,
}

/// A broadcast medium.
pub trait SecondMedium: Send + Sync + std::fmt::Debug {
    /// Carries payloads from `from` to `until`, which lie within one control period. Frames that begin from `from` on
    /// and before `until` go on the air; those that end by `until` enter `carried`.
    fn carry(&mut self, around: &Around<'_>, from: SimTime, until: SimTime, carried: &mut Carried);

    /// The same medium in the same state.
    fn boxed(&self) -> Box<dyn SecondMedium>;

    /// All that changes with time.
    fn state(&self) -> Vec<u8>;

    /// Puts such a state back. `false`: it is not one of this medium.
    fn resume(&mut self, state: &[u8]) -> bool;
}

/// Which medium carries the robots' payloads.
#[derive(Choice, Clone, Copy, Debug, PartialEq, Eq)]
pub enum Route {
    /// The main network only; the second medium is idle.
    Main,
    /// The second medium only.
    Second,
    /// Both; a receiver takes the copy that arrives first and discards the other one.
    Both,
}

impl Route {
    /// That of a checked table.
    pub(crate) fn of_table(table: &toml::Table) -> Self {
        Keys::read(table).payloads
    }
}

/// A configured second medium.
#[derive(Debug)]
pub struct Config {
    /// Which medium carries payloads.
    pub route: Route,
    /// The medium at time 0.
    pub medium: Box<dyn SecondMedium>,
}

impl Config {
    /// What should be checked if the main network carries no payloads (`main_is_silent`).
    pub(crate) fn warning(&self, path: &str, main_is_silent: bool) -> Option<String> {
        (self.route == Route::Main && main_is_silent).then(|| {
            let [payloads, transport] =
                ["second_medium.payloads", "swarm.transport"].map(|key| join(path, key));
            format!("nothing carries the robots' payloads: {payloads} = \"main\" and {transport} = \"none\"")
        })
    }
}

/// A broadcast medium beside the main network.
#[derive(Section)]
#[section(tag = TAG)]
struct Keys {
    /// Which medium carries the robots' payloads.
    #[key(default = Route::Both)]
    payloads: Route,
}

/// Makes the medium of a checked table, or adds problems.
pub(crate) fn build(
    table: &toml::Table,
    known: &Registry<Entry>,
    context: &mut BuildContext<'_>,
) -> Option<Config> {
    let entry = known.selected(table, &TAG)?;
    let medium = (entry.build)(table, context)?;
    let keys = Keys::read(table);
    Some(Config { route: keys.payloads, medium })
}

/// The second medium of a run, and what it needs to know of the robots.
#[derive(Debug)]
pub struct Second {
    agent_count: usize,
    step: SimDuration,
    seed: u64,
    columns: Vec<DeliveryColumn>,
    antenna_height_m: f64,
    route: Route,
    medium: Box<dyn SecondMedium>,
    place: Place,
    copies: Copies,
}

/// All that changes with time.
#[derive(Debug, Serialize, Deserialize)]
pub struct State {
    place: Place,
    medium: Vec<u8>,
    copies: Copies,
}

impl Second {
    /// At time 0. `absent`: motes that are left out until an order adds them.
    #[must_use]
    pub fn new(
        experiment: &Experiment,
        config: Config,
        columns: Vec<DeliveryColumn>,
        antenna_height_m: f64,
        (absent, site): (&[MoteId], Site),
    ) -> Self {
        let n = experiment.agent_count;
        Self {
            agent_count: n,
            step: SimDuration::from_ns(experiment.step_ns),
            seed: experiment.seed,
            columns,
            antenna_height_m,
            route: config.route,
            medium: config.medium,
            place: Place::new(n, absent, site),
            copies: Copies::new(n),
        }
    }

    /// Puts a state back. `None`: it is that of another medium or number of agents.
    #[must_use]
    pub fn resumed(mut self, state: State) -> Option<Self> {
        let State { place, medium, copies } = state;
        let fits = place.is_of(self.agent_count)
            && copies.is_of(self.agent_count)
            && self.medium.resume(&medium);
        self.place = place;
        self.copies = copies;
        fits.then_some(self)
    }

    /// All that changes with time.
    #[must_use]
    pub fn state(&self) -> State {
        State {
            place: self.place.clone(),
            medium: self.medium.state(),
            copies: self.copies.clone(),
        }
    }

    /// Whether the main network carries no payloads.
    #[must_use]
    pub fn carries_all(&self) -> bool {
        self.route == Route::Second
    }

    /// Draws by another seed from here on.
    pub fn reseed(&mut self, seed: u64) {
        self.seed = seed;
    }

    /// The columns that the main network must fill in, so that both lists of deliveries can be joined.
    #[must_use]
    pub(crate) fn main_columns(columns: &[DeliveryColumn]) -> Vec<DeliveryColumn> {
        let mut columns = columns.to_vec();
        if !columns.contains(&DeliveryColumn::ReceivedNs) {
            columns.push(DeliveryColumn::ReceivedNs);
        }
        columns.sort_unstable();
        columns
    }

    /// One step of both media. `main` steps the main network.
    pub fn step(
        &mut self,
        input: &NetInput<'_>,
        main: impl FnOnce(&NetInput<'_>) -> NetOutput,
    ) -> NetOutput {
        self.place.obey(input.commands);
        self.place.move_obstacles(input.moved_obstacles);
        let silence = Payloads::silence(self.agent_count);
        let payloads = if self.route == Route::Second { &silence } else { input.payloads };
        let mut of_main = NetInput { payloads, ..*input };
        let lift_m = place::lift_m(self.antenna_height_m, input.states);
        let is_idle = self.route == Route::Main;
        let spoken = if is_idle { &silence } else { input.payloads };
        let around = Around::new(&self.place, input.states, lift_m, spoken, self.step, self.seed);
        if input.stop_at_first_delivery && !is_idle {
            // Neither network may pass the first delivery of the other one.
            let mut ahead = self.medium.boxed();
            let carried = carry(
                &mut *ahead,
                &around,
                self.step,
                SimTime::from_ns(input.from_ns),
                SimTime::from_ns(input.until_ns),
            );
            if let Some(first) = carried.first() {
                of_main.until_ns = of_main.until_ns.min(first.ns());
            }
        }
        let mut output = main(&of_main);
        let carried = if is_idle {
            Carried::default()
        } else {
            carry(
                &mut *self.medium,
                &around,
                self.step,
                SimTime::from_ns(input.from_ns),
                SimTime::from_ns(output.time_ns),
            )
        };
        let copies = (self.route == Route::Both).then_some((&mut self.copies, self.step));
        output.deliveries =
            merge::merged(output.deliveries, carried, self.agent_count, &self.columns, copies);
        output
    }
}

/// Carries payloads over one or more control periods.
fn carry(
    medium: &mut dyn SecondMedium,
    around: &Around<'_>,
    step: SimDuration,
    from: SimTime,
    until: SimTime,
) -> Carried {
    let mut carried = Carried::default();
    let mut begin = from;
    while begin < until {
        let end = (SimTime::START + (begin / step + 1) * step).min(until);
        medium.carry(around, begin, end, &mut carried);
        begin = end;
    }
    carried
}

/// A problem with a key of a medium.
pub(crate) fn problem(context: &BuildContext<'_>, key: &str, message: String) -> Problem {
    Problem::new(join(context.path, key), message)
}
