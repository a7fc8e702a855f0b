//! What the robots of an experiment are like, for the network's profile.

use netsim::catalogue::Catalogue;
use netsim::config::profile::{Motes, resolve};
use proto::config::Node;

/// The motes of robots that are ours. Where they are drawn at random, those of one seed stand for all, so that trials of a sweep have the same
/// network.
pub(super) fn motes(config: &robotsim::config::Config, n_agents: usize) -> Motes {
    let states = robotsim::scenario::states(config.scenario.as_ref(), n_agents, 0);
    let positions_m =
        (0..n_agents).map(|agent| [states.x_m[agent], states.y_m[agent], states.z_m[agent]]);
    Motes { positions_m: positions_m.collect(), moves: config.behaviour.team.moving(n_agents) }
}

/// The motes of another simulator's robots, whose positions and controllers are unknown: all are taken to move, in range of each other.
pub(super) fn unknown_motes(n_agents: usize) -> Motes {
    Motes { positions_m: vec![[0.0; 3]; n_agents], moves: vec![true; n_agents] }
}

/// The network's section with its profile resolved, and what to say of the choice.
pub(super) fn resolved(
    section: &Node,
    motes: Option<&Motes>,
    is_foreign: bool,
    catalogue: &Catalogue,
) -> (Node, Option<String>) {
    let mut section = section.clone();
    let said =
        motes.filter(|_| !is_foreign).and_then(|motes| resolve(&mut section, motes, catalogue));
    (section, said)
}
