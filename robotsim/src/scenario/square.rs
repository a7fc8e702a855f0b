//! A square.

use super::{Entry, LENGTH, Place, Scenario};
use crate::context::field;
use proto::config::{Default, Variant, typed};
use proto::rng::{Draws, uniform};
use serde::Deserialize;

pub(super) const ENTRY: Entry = Entry {
    variant: Variant {
        name: "square",
        doc: "Uniformly at random in a square around the origin.",
        fields: &[field(
            "side_m",
            "Side of the square (m). Default: that of BotNet's timing task.",
            LENGTH,
            Default::Number(10.0),
        )],
    },
    build: |table, _, _| Some(Box::new(typed::<Square>(table))),
};

/// Uniform in a square.
#[derive(Debug, Deserialize)]
struct Square {
    side_m: f64,
}

impl Scenario for Square {
    fn place(&self, agent: usize, _n_agents: usize, draws: Draws) -> Place {
        let [a, b, ..] = draws.words(agent as u64, 0, 0);
        let [x_m, y_m] = [a, b].map(|word| self.side_m * (uniform(word) - 0.5));
        Place { position_m: [x_m, y_m, 0.0], heading_rad: None }
    }
}
