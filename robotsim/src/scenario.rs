//! Where the robots begin: one file per scenario, one list.
//!
//! Draws are keyed by the agent: robot i begins in the same place whatever the number of robots, as far as the scenario's
//! own shape does not depend on it. To add one: write its file, and add its registration to the list.

mod circle;
mod csv;
mod disc;
mod grid;
mod line;
mod spaced;
mod square;

use crate::config::Context;
use proto::config::{Field, Kind, Problem, Range, TableSpec, Tag, Variant};
use proto::rng::{Draws, Purpose};
use proto::types::AgentStates;

pub use disc::radius_m as disc_radius_m;

/// The one list.
const ALL: &[Registration] = &[
    line::REGISTRATION,
    disc::REGISTRATION,
    square::REGISTRATION,
    circle::REGISTRATION,
    grid::REGISTRATION,
    spaced::REGISTRATION,
    csv::REGISTRATION,
];

/// Description of `[robotsim.scenario]`.
pub(crate) const SPEC: TableSpec = TableSpec {
    doc: "Where the robots begin.",
    fields: &[],
    tag: Some(&Tag {
        key: "kind",
        doc: "The arrangement.",
        default: None,
        variants: || ALL.iter().map(Registration::variant).collect(),
    }),
};

/// A kind of scenario.
struct Registration {
    name: &'static str,
    doc: &'static str,
    fields: &'static [Field],
    /// From a table with the fields checked. Adds what is wrong across keys and in files. `None`: a field had no valid
    /// value.
    build: Build,
}

type Build = fn(&toml::Table, &Context<'_>, &mut Vec<Problem>) -> Built;
type Built = Option<Box<dyn Scenario>>;

impl Registration {
    fn variant(&self) -> Variant {
        Variant { name: self.name, doc: self.doc, fields: self.fields }
    }
}

/// Where one robot begins.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Place {
    /// Position (m).
    pub position_m: [f64; 3],
    /// Direction it faces (rad), where the scenario says so: for all robots or for none.
    pub heading_rad: Option<f64>,
}

/// An arrangement of robots.
pub trait Scenario: std::fmt::Debug + Send + Sync {
    /// Where robot `agent` of `n_agents` begins.
    fn place(&self, agent: usize, n_agents: usize, draws: Draws) -> Place;

    /// Where all begin, for arrangements in which each depends on the others.
    fn places(&self, n_agents: usize, draws: Draws) -> Vec<Place> {
        (0..n_agents).map(|agent| self.place(agent, n_agents, draws)).collect()
    }
}

/// The states at time 0: everyone alive and at rest.
#[must_use]
pub fn states(scenario: &dyn Scenario, n_agents: usize, seed: u64) -> AgentStates {
    let draws = Draws::new(seed, Purpose::Scenario);
    let mut states = AgentStates::at_origin(n_agents);
    for (agent, place) in scenario.places(n_agents, draws).into_iter().enumerate() {
        [states.x_m[agent], states.y_m[agent], states.z_m[agent]] = place.position_m;
        states.heading_rad.extend(place.heading_rad);
    }
    states
}

/// The scenario described by a checked table.
pub(crate) fn build(
    table: &toml::Table,
    context: &Context<'_>,
    problems: &mut Vec<Problem>,
) -> Option<Box<dyn Scenario>> {
    let name = table.get("kind")?.as_str()?;
    let registration = ALL.iter().find(|registration| registration.name == name)?;
    (registration.build)(table, context, problems)
}

/// A length (m).
const LENGTH: Kind = Kind::Number(Range::above(0.0, 1e6));
