//! Robots that jump at random within an arena: a workload for the network, not a behaviour.

use super::{Controller, Demands, Entry, Goal, View};
use crate::dynamics::Command;
use proto::config::{Choice, Section, variant};
use proto::ids::AgentId;
use proto::rng::uniform;

pub(super) const ENTRY: Entry = Entry {
    variant: variant::<Raw>("random-jump"),
    demands: Demands { jumps: true, ..Demands::NONE },
    goal: Goal::Carry,
    build: |table, context, problems| {
        let raw = Raw::read(table);
        let (own, foreign, given, default) = match raw.arena {
            ArenaKind::Disc => ("density_per_m2", "side_m", raw.density_per_m2, 0.22),
            ArenaKind::Square => ("side_m", "density_per_m2", raw.side_m, 10.0),
        };
        if table.contains_key(foreign) {
            problems.push(
                context.problem(foreign, format!("does not apply with arena = {}", table["arena"])),
            );
        }
        let size = given.unwrap_or(default);
        table.insert(own.to_owned(), size.into());
        let arena = match raw.arena {
            ArenaKind::Disc => {
                Arena::Disc { radius_m: crate::scenario::disc_radius_m(context.n_agents, size) }
            }
            ArenaKind::Square => Arena::Square { half_m: size / 2.0 },
        };
        Some(Box::new(RandomJump { jump_m: raw.jump_m, arena }))
    },
};

/// Every robot jumps at random each step, within an arena around the origin; a workload for benchmarks.
#[derive(Section)]
struct Raw {
    /// Maximum jump along each axis (m). Default: that of BotNet's timing task.
    #[key(above = 0.0, most = 1e6, default = 2.5)]
    jump_m: f64,
    /// Shape of the arena.
    #[key(default = ArenaKind::Square)]
    arena: ArenaKind,
    /// Side of the square (m). Default: 10.
    #[key(above = 0.0, most = 1e6)]
    side_m: Option<f64>,
    /// Agents per m² of the disc. Default: 0.22.
    #[key(range = 1e-9..=1e9)]
    density_per_m2: Option<f64>,
}

#[derive(Choice, Clone, Copy)]
enum ArenaKind {
    /// A disc whose size follows from `density_per_m2`.
    Disc,
    /// A square of `side_m`.
    Square,
}

/// Uniform jumps that keep a uniform density uniform.
///
/// # Model
///
/// Δ ~ U(−jump, jump) on x and y, independent. In the square a jump is reflected at the walls. In the disc one that would
/// end outside is not made, unless it comes closer to the centre. Both leave the uniform distribution as it is: the first
/// by symmetry, the second since a symmetric proposal that is refused outside satisfies detailed balance.
#[derive(Debug)]
struct RandomJump {
    jump_m: f64,
    arena: Arena,
}

#[derive(Debug)]
enum Arena {
    Disc { radius_m: f64 },
    Square { half_m: f64 },
}

impl Controller for RandomJump {
    fn command(&self, view: &View<'_>, agent: AgentId) -> Command {
        let [x, y, _] = view.position_m(agent);
        let [a, b, ..] = view.draws.words(u64::from(agent.0), view.step, 0);
        let [to_x, to_y] =
            [(x, a), (y, b)].map(|(from, word)| from + self.jump_m * (2.0 * uniform(word) - 1.0));
        Command::Jump(match self.arena {
            Arena::Square { half_m } => [reflect(to_x, half_m) - x, reflect(to_y, half_m) - y, 0.0],
            Arena::Disc { radius_m } => {
                let square = to_x * to_x + to_y * to_y;
                if square <= radius_m * radius_m || square < x * x + y * y {
                    [to_x - x, to_y - y, 0.0]
                } else {
                    [0.0; 3]
                }
            }
        })
    }
}

/// `x` folded into −half..half at the walls, however far out it is.
fn reflect(x: f64, half: f64) -> f64 {
    let folded = (x + half).rem_euclid(4.0 * half);
    if folded <= 2.0 * half { folded - half } else { 3.0 * half - folded }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_wall_reflects() {
        assert_eq!(reflect(4.0, 5.0), 4.0);
        assert_eq!(reflect(6.0, 5.0), 4.0);
        assert_eq!(reflect(-7.0, 5.0), -3.0);
        assert_eq!(reflect(16.0, 5.0), -4.0);
    }
}
