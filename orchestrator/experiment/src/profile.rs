//! What the robots of an experiment are like, for the network's profile.

use crate::reach;
use netsim::catalogue::Catalogue;
use netsim::config::profile::{Motes, resolve};
use proto::config::{self, Node};
use std::path::Path;

/// The motes of robots that are ours. Where they are drawn at random, those of one seed stand for all, so that trials of a sweep have the same
/// network.
pub(super) fn motes(config: &robotsim::config::Config, n_agents: usize) -> Motes {
    let states = robotsim::scenario::states(config.scenario.as_ref(), n_agents, 0);
    let positions_m =
        (0..n_agents).map(|agent| [states.x_m[agent], states.y_m[agent], states.z_m[agent]]);
    let team = &config.behaviour.team;
    Motes {
        positions_m: positions_m.collect(),
        moves: team.moving(n_agents),
        scatter_mps: team.scatter_mps(),
    }
}

/// How fast robots of another simulator are taken to move (m/s): as a person walks.
const UNKNOWN_MPS: f64 = 1.4;

/// The motes of another simulator's robots, whose positions and controllers are unknown: all are taken to move, in range of each other.
pub(super) fn unknown_motes(n_agents: usize) -> Motes {
    Motes {
        positions_m: vec![[0.0; 3]; n_agents],
        moves: vec![true; n_agents],
        scatter_mps: Some(UNKNOWN_MPS),
    }
}

/// The network's section with its profile resolved, and what to say of the choice. A section with keys that netsim does not know stays,
/// wherever the simulator runs: another one has keys of its own, and netsim refuses them.
pub(super) fn resolved(
    section: &Node,
    motes: Option<&Motes>,
    catalogue: &Catalogue,
) -> (Node, Option<String>) {
    let mut resolved = section.clone();
    let said = motes
        .filter(|_| is_of_netsim(section, catalogue))
        .and_then(|motes| resolve(&mut resolved, motes, catalogue));
    (resolved, said)
}

/// Whether netsim knows every key of a section, apart from those that say how the simulator is reached.
fn is_of_netsim(section: &Node, catalogue: &Catalogue) -> bool {
    let mut own = section.clone();
    _ = reach::take(&mut own, "", None, Path::new(""), &mut Vec::new());
    let mut problems = Vec::new();
    config::check(&own, "", &netsim::config::SPEC, &catalogue.lists(), &mut problems);
    problems.is_empty()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The scheduling function in a resolved section of an experiment with two robots that move.
    fn chosen(section: &str) -> Option<String> {
        let section = config::parse(section).unwrap();
        let (resolved, said) = resolved(&section, Some(&unknown_motes(2)), Catalogue::built_in());
        let kind =
            resolved.get("sf").and_then(|sf| sf.get("kind")).map(|node| node.show().into_owned());
        assert_eq!(said.is_some(), kind.is_some());
        kind
    }

    #[test]
    fn a_network_elsewhere_has_the_settings_that_it_would_have_here() {
        let own = "mode = \"6tisch\"\nphy = { propagation = \"unit-disk\", radius_m = 15.0 }\n";
        let elsewhere = format!("{own}url = \"http://127.0.0.1:1\"\n");
        assert!(chosen(own).is_some());
        assert_eq!(chosen(own), chosen(&elsewhere));
        let command = ["command = [\"./sim\"]\n", own].concat();
        assert_eq!(chosen(own), chosen(&command));
    }

    #[test]
    fn a_network_with_keys_of_its_own_keeps_its_section() {
        for section in ["", "mode = \"6tisch\"\nloss = 0.1\n", "loss = 0.1\n"] {
            assert_eq!(chosen(&format!("{section}command = [\"./sim\"]\n")), None, "{section}");
            // Its address may be on the command line.
            assert_eq!(chosen(section), None, "{section}");
        }
    }
}
