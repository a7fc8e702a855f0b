//! Restoring with another seed: draws to come are those of that seed, and nothing else changes.

use crate::air::{Air, setup};
use proto::side::RobotSimulator as _;
use proto::types::AgentStates;
use robotsim::sim::Swarm;

/// Robots that draw in every step: where to go, gusts, noise on measured positions.
const RANDOM: [&str; 3] = [
    "scenario.kind = 'square'\ncontroller.kind = 'random-jump'",
    "scenario = { kind = 'disc', density_per_m2 = 0.22 }\ncontroller.kind = 'line-formation'\n\
     [[dynamics.effect]]\nkind = 'localization'\nsd_m = 0.5",
    "scenario.kind = 'line'\ncontroller = { kind = 'flocking', flock_radius_m = 10 }\n\
     [[dynamics.effect]]\nkind = 'localization'\nsd_m = 0.5",
];

#[test]
fn a_swarm_goes_on_with_its_own_seed_and_differs_with_another() {
    for toml in RANDOM {
        let setup = setup(toml, 12, 3);
        let mut air = Air::new(&setup, |_, _, _, _| true);
        for _ in 0..4 {
            air.step();
        }
        let saved = air.swarm.snapshot();
        let (step, deliveries) = (air.step, air.deliveries.clone());
        let expected: Vec<AgentStates> = (0..12).map(|_| air.step().states).collect();
        let with = |seed: Option<u64>| {
            let mut other = Air::new(&setup, |_, _, _, _| true);
            other.swarm = Swarm::default();
            other.swarm.restore(&saved).expect("the snapshot is of this swarm");
            if let Some(seed) = seed {
                other.swarm.reseed(seed);
            }
            (other.step, other.deliveries) = (step, deliveries.clone());
            let states: Vec<AgentStates> = (0..12).map(|_| other.step().states).collect();
            (states, other.swarm.snapshot())
        };
        assert!(with(None) == (expected.clone(), air.swarm.snapshot()), "{toml}");
        assert!(with(Some(3)) == (expected.clone(), air.swarm.snapshot()), "{toml}");
        assert!(with(Some(4)) == with(Some(4)), "{toml}");
        assert!(with(Some(4)).0 != expected, "{toml}");
        assert!(with(Some(4)).0 != with(Some(5)).0, "{toml}");
    }
}
