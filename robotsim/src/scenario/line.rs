//! A line across the leader, alternating sides.

use super::{Entry, LENGTH, Place, Scenario};
use crate::context::field;
use proto::config::{Default, Kind, Range, Variant, typed};
use proto::rng::Draws;
use serde::Deserialize;

pub(super) const ENTRY: Entry = Entry {
    variant: Variant {
        name: "line",
        doc: "Along the y axis: agent 0 at the origin, the others on alternating sides.",
        fields: &[
            field(
                "spacing_m",
                "Spacing along the line (m). Default: the BotNet paper's.",
                LENGTH,
                Default::Number(2.0),
            ),
            field(
                "jitter_m",
                "Maximum random displacement along the line of each agent but agent 0 (m). Default: BotNet's.",
                Kind::Number(Range::closed(0.0, 1e6)),
                Default::Number(0.25),
            ),
        ],
    },
    build: |table, context, problems| {
        let line: Line = typed(table);
        if line.spacing_m < 2.0 * line.jitter_m {
            problems.push(
                context
                    .problem(
                        "jitter_m",
                        format!("must be at most half of spacing_m = {}", line.spacing_m),
                    )
                    .value(line.jitter_m)
                    .nearest(line.spacing_m / 2.0),
            );
        }
        Some(Box::new(line))
    },
};

/// Agent 0 at (0, 0), agent i + 1 at x = 0, y = (−1)^i (spacing (⌊i/2⌋ + 1) + e), e ~ U(−jitter, jitter): the start of
/// BotNet's flocking experiments (`center_line_flock`).
#[derive(Debug, Deserialize)]
struct Line {
    spacing_m: f64,
    jitter_m: f64,
}

impl Scenario for Line {
    fn place(&self, agent: usize, _n_agents: usize, draws: Draws) -> Place {
        let y_m = match agent.checked_sub(1) {
            None => 0.0,
            Some(i) => {
                let jitter_m = self.jitter_m * (2.0 * draws.uniform(agent as u64, 0, 0) - 1.0);
                let y_m = self.spacing_m * (i / 2 + 1) as f64 + jitter_m;
                if i % 2 == 0 { y_m } else { -y_m }
            }
        };
        Place { position_m: [0.0, y_m, 0.0], heading_rad: None }
    }
}
