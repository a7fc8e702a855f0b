//! Networks of many motes whose root can say little.

use crate::harness::{interval, setup, started};
use proto::types::{AgentStates, NS_PER_S};

/// Robots 2 m apart on a line, the root in the middle.
fn line(n: usize) -> AgentStates {
    let mut states = AgentStates::at_origin(n);
    for (place, y_m) in states.y_m.iter_mut().enumerate() {
        let side = if place % 2 == 1 { 2.0 } else { -2.0 };
        *y_m = side * place.div_ceil(2) as f64;
    }
    states
}

/// When a network has formed (s); `None`: not within `limit_s`.
fn formed_s(n: usize, config: &str, seed: u64, limit_s: u64) -> Option<u64> {
    let mut setup = setup(n, config);
    setup.experiment.seed = seed;
    let (mut network, _) = started(&setup);
    let states = line(n);
    for second in 0..limit_s {
        let output = interval(&mut network, &states, second * NS_PER_S, (second + 1) * NS_PER_S);
        if output.formation.is_some_and(|formation| formation.formed_ns.is_some()) {
            return Some(second);
        }
    }
    None
}

#[test]
fn two_hundred_and_fifty_robots_are_admitted_by_a_root_that_has_a_slot_in_250() {
    let config = "mode = \"6tisch\"\n[sf]\nkind = \"rrsf\"\n[swarm]\ntransport = \"none\"\n";
    for seed in 1..=3 {
        let formed_s = formed_s(250, config, seed, 1800);
        assert!(formed_s.is_some(), "seed {seed}");
    }
}

#[test]
fn where_everyone_hears_the_root_everyone_comes_to_be_its_child() {
    let n = 30;
    let config = "mode = \"6tisch\"\n[phy]\npropagation = \"full\"\n[sf]\nkind = \"rrsf\"\n\
                  [swarm]\ntransport = \"none\"\n";
    let (mut network, _) = started(&setup(n, config));
    let output = interval(&mut network, &line(n), 0, 3600 * NS_PER_S);
    assert_eq!(output.motes.parent[1..], vec![0; n - 1]);
}

#[test]
fn eighty_robots_in_one_shared_cell_form_beside_their_traffic() {
    let config = "mode = \"6tisch\"\n[phy]\npropagation = \"full\"\n[sf]\nkind = \"minimal\"\n[swarm]\ntransport = \"none\"\n\
                  [[app]]\nkind = \"periodic\"\nperiod_s = 60.0\npayload_bytes = 30\n";
    for seed in 1..=2 {
        let formed_s = formed_s(80, config, seed, 1200);
        assert!(formed_s.is_some(), "seed {seed}");
    }
}
