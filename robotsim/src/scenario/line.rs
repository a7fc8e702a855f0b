//! A line across the leader, alternating sides.

use super::{Entry, LENGTH, Place, Scenario};
use proto::config::{Section, variant};
use proto::ids::AgentId;
use proto::rng::Draws;

pub(super) const ENTRY: Entry = Entry {
    variant: variant::<Line>("line"),
    build: |table, context, problems| {
        let line = Line::read(table);
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

/// Along the y axis: agent 0 at the origin, the others on alternating sides.
///
/// Agent 0 at (0, 0), agent i + 1 at x = 0, y = (−1)^i (spacing (⌊i/2⌋ + 1) + e), e ~ U(−jitter, jitter): the start of
/// BotNet's flocking experiments (`center_line_flock`).
#[derive(Debug, Section)]
struct Line {
    /// Spacing along the line (m). Default: the BotNet paper's.
    #[key(kind = LENGTH, default = 2.0)]
    spacing_m: f64,
    /// Maximum random displacement along the line of each agent but agent 0 (m). Default: BotNet's.
    #[key(range = 0.0..=1e6, default = 0.25)]
    jitter_m: f64,
}

impl Scenario for Line {
    fn place(&self, agent: AgentId, _n_agents: usize, draws: Draws) -> Place {
        let y_m = match agent.0.checked_sub(1) {
            None => 0.0,
            Some(i) => {
                let jitter_m =
                    self.jitter_m * (2.0 * draws.uniform(u64::from(agent.0), 0, 0) - 1.0);
                let y_m = self.spacing_m * f64::from(i / 2 + 1) + jitter_m;
                if i % 2 == 0 { y_m } else { -y_m }
            }
        };
        Place { position_m: [0.0, y_m, 0.0], heading_rad: None }
    }
}
