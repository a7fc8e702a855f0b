//! A square.

use super::{Entry, LENGTH, Place, Scenario};
use proto::config::{Section, variant};
use proto::ids::AgentId;
use proto::rng::{Draws, uniform};

pub(super) const ENTRY: Entry = Entry {
    variant: variant::<Square>("square"),
    build: |table, _, _| Some(Box::new(Square::read(table))),
};

/// Uniformly at random in a square around the origin.
///
/// Uniform in a square.
#[derive(Debug, Section)]
struct Square {
    /// Side of the square (m). Default: that of BotNet's timing task.
    #[key(kind = LENGTH, default = 10.0)]
    side_m: f64,
}

impl Scenario for Square {
    fn place(&self, agent: AgentId, _n_agents: usize, draws: Draws) -> Place {
        let [a, b, ..] = draws.words(u64::from(agent.0), 0, 0);
        let [x_m, y_m] = [a, b].map(|word| self.side_m * (uniform(word) - 0.5));
        Place { position_m: [x_m, y_m, 0.0], heading_rad: None }
    }
}
