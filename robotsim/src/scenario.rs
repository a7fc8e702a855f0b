//! Where the robots begin: one file per scenario, one list, `BUILT_IN`.
//!
//! Draws are keyed by the agent: robot i begins in the same place whatever the number of robots, as far as the scenario's
//! own shape does not depend on it. To add one: write its file, and add its entry to the list.

mod circle;
mod csv;
mod disc;
mod grid;
mod line;
mod spaced;
mod square;

use crate::context::Context;
use proto::config::{Kind, Problem, Range, Registered, TableSpec, Tag, Variant, Variants};
use proto::ids::AgentId;
use proto::rng::{Draws, Purpose};
use proto::types::AgentStates;

pub use disc::radius_m as disc_radius_m;

/// What descriptions call the list of scenarios.
pub(crate) const LIST: &str = "robotsim.scenario";

/// The scenarios that are built in.
pub(crate) const BUILT_IN: &[Entry] = &[
    line::ENTRY,
    disc::ENTRY,
    square::ENTRY,
    circle::ENTRY,
    grid::ENTRY,
    spaced::ENTRY,
    csv::ENTRY,
];

/// Description of `[robotsim.scenario]`.
pub(crate) const SPEC: TableSpec =
    TableSpec { doc: "The initial positions of the robots.", fields: &[], tag: Some(&TAG) };

/// The key that selects a scenario.
pub(crate) const TAG: Tag =
    Tag { key: "kind", doc: "The arrangement.", default: None, variants: Variants::List(LIST) };

/// A scenario that can be configured.
#[derive(Debug)]
pub struct Entry {
    /// Its name and keys.
    pub variant: Variant,
    /// Makes it of its checked table. Adds what is wrong across keys and in files. `None`: something is wrong that leaves
    /// nothing to build.
    pub build: Build,
}

impl Registered for Entry {
    fn variant(&self) -> &Variant {
        &self.variant
    }
}

/// Makes a scenario of its checked table, or adds problems.
pub type Build = fn(&toml::Table, &Context<'_>, &mut Vec<Problem>) -> Option<Box<dyn Scenario>>;

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
    fn place(&self, agent: AgentId, n_agents: usize, draws: Draws) -> Place;

    /// Where all begin, for arrangements in which each depends on the others.
    fn places(&self, n_agents: usize, draws: Draws) -> Vec<Place> {
        AgentId::first(n_agents).map(|agent| self.place(agent, n_agents, draws)).collect()
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

/// A length (m).
const LENGTH: Kind = Kind::Number(Range::above(0.0, 1e6));
