//! A circle.

use super::{Entry, LENGTH, Place, Scenario};
use proto::config::{Section, variant};
use proto::ids::AgentId;
use proto::rng::Draws;
use std::f64::consts::TAU;

pub(super) const ENTRY: Entry = Entry {
    variant: variant::<Circle>("circle"),
    build: |table, _, _| Some(Box::new(Circle::read(table))),
};

/// Evenly spaced on a circle around the origin, counter-clockwise from agent 0 in the east.
///
/// Agent i at the angle 2 π i / n.
#[derive(Debug, Section)]
struct Circle {
    /// Radius of the circle (m).
    #[key(kind = LENGTH)]
    radius_m: f64,
}

impl Scenario for Circle {
    fn place(&self, agent: AgentId, n_agents: usize, _draws: Draws) -> Place {
        let angle_rad = TAU * f64::from(agent.0) / n_agents as f64;
        Place {
            position_m: [
                self.radius_m * libm::cos(angle_rad),
                self.radius_m * libm::sin(angle_rad),
                0.0,
            ],
            heading_rad: None,
        }
    }
}
