//! A disc of given density.

use super::{Entry, Place, Scenario};
use proto::config::{Section, variant};
use proto::ids::AgentId;
use proto::rng::{Draws, uniform};
use std::f64::consts::{PI, TAU};

pub(super) const ENTRY: Entry = Entry {
    variant: variant::<Disc>("disc"),
    build: |table, _, _| Some(Box::new(Disc::read(table))),
};

/// Uniformly at random in a disc around the origin, whose size follows from the density.
///
/// Uniform in a disc of radius √(n / (π density)).
#[derive(Debug, Section)]
struct Disc {
    /// Agents per m²: about 5 in the BotNet paper, 0.22 in its code.
    #[key(range = 1e-9..=1e9)]
    density_per_m2: f64,
}

/// Radius (m) of a disc with `n_agents` at `density_per_m2` (positive).
#[must_use]
pub fn radius_m(n_agents: usize, density_per_m2: f64) -> f64 {
    libm::sqrt(n_agents as f64 / (density_per_m2 * PI))
}

impl Scenario for Disc {
    fn place(&self, agent: AgentId, n_agents: usize, draws: Draws) -> Place {
        let [a, b, ..] = draws.words(u64::from(agent.0), 0, 0);
        let radius_m = radius_m(n_agents, self.density_per_m2) * libm::sqrt(uniform(a));
        let angle_rad = TAU * uniform(b);
        Place {
            position_m: [radius_m * libm::cos(angle_rad), radius_m * libm::sin(angle_rad), 0.0],
            heading_rad: None,
        }
    }
}
