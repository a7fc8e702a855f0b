//! Robots that come together.

use super::{Controller, Demands, Entry, Goal, View};
use crate::dynamics::Command;
use proto::config::{Choice, Section, variant};
use proto::ids::AgentId;

pub(super) const ENTRY: Entry = Entry {
    variant: variant::<Consensus>("consensus"),
    demands: Demands::NONE,
    goal: Goal::Meet,
    build: |table, _, _| Some(Box::new(Consensus::read(table))),
};

/// Consensus (rendezvous): every robot moves towards the robots it knows of.
///
/// Consensus on a place.
///
/// # Model
///
/// Olfati-Saber, Fax and Murray, "Consensus and cooperation in networked multi-agent systems", Proc. IEEE 95(1), 2007,
/// § I.A: u_i = k Σ_j (x_j − x_i) over the robots j it knows of. Where knowledge is mutual the centroid stays, and with a
/// connected network all meet there. `over = "mean"` divides by how many they are; then the centroid stays only where all
/// know of equally many.
///
/// # Validity
///
/// Robots have no extent. A robot that knows of nobody stays.
#[derive(Debug, Section)]
struct Consensus {
    /// Gain: rate at which differences shrink (1/s).
    #[key(above = 0.0, most = 1e3, default = 1.0)]
    gain_per_s: f64,
    /// How differences to the neighbours are combined.
    #[key(default = Over::Mean)]
    over: Over,
    /// The task is complete when no robot would move farther than this in a control period (m).
    #[key(above = 0.0, most = 1e3, default = 1e-3)]
    threshold_m: f64,
}

#[derive(Choice, Clone, Copy, Debug, PartialEq, Eq)]
enum Over {
    /// The mean; stable for any number of robots.
    Mean,
    /// The sum (the Laplacian protocol); stable only if gain × control period × maximum number of neighbours is below 1.
    Sum,
}

impl Controller for Consensus {
    fn command(&self, view: &View<'_>, agent: AgentId) -> Command {
        let own_m = view.position_m(agent);
        let (mut sum, mut n) = ([0.0; 3], 0.0);
        view.knowledge.for_each_known_to(agent, |seen| {
            for axis in 0..3 {
                sum[axis] += seen.motion.position_m[axis] - own_m[axis];
            }
            n += 1.0;
        });
        let share = match self.over {
            Over::Mean if 0.0 < n => 1.0 / n,
            Over::Mean | Over::Sum => 1.0,
        };
        Command::Velocity(sum.map(|component| self.gain_per_s * share * component))
    }

    fn is_done(&self, view: &View<'_>, commands: &[Command]) -> bool {
        view.knowledge.is_any() && super::all_within(view, commands, self.threshold_m)
    }
}
