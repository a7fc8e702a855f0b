//! Batteries that run empty.

use super::harness::{STEP_NS, setup, standing_at, started, step_with};
use netsim::sim::Network;
use proto::side::{NetOutput, NetSimulator as _};
use proto::types::{AgentStates, MoteCommand, MoteOrder, NetRecord};

/// Mote 0 is the root. The others scan, for which 0.002 mAh last 2.5 s, and then draw little.
fn network(deaths: &str) -> (Network, AgentStates) {
    let config = format!(
        "mode = \"6tisch\"\nswarm.transport = \"none\"\nsf.kind = \"minimal\"\n[phy]\npropagation = \"full\"\n\
         [mac]\nbeacon_wait_s = 2.0\n[energy]\nbattery_mah = 0.002\n{deaths}"
    );
    let mut setup = setup(4, &config);
    setup.records = vec![NetRecord::Statistics];
    (started(&setup).0, standing_at(&[(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0)]))
}

/// The state of the network after so many periods.
fn run(network: &mut Network, states: &AgentStates, periods: std::ops::Range<u64>) -> NetOutput {
    let mut last = None;
    for k in periods {
        last = Some(step_with(network, states, k * STEP_NS, (k + 1) * STEP_NS, &[], false));
    }
    last.expect("the run has steps")
}

#[test]
fn battery_mah_of_next_to_nothing_kills_where_batteries_may_kill() {
    let (mut network_with, states) = network("deaths = true");
    let alive = |output: &NetOutput| output.motes.alive.iter_ones().collect::<Vec<_>>();
    // Motes that have joined live longer; nobody lives for ever but the root.
    assert_eq!(alive(&run(&mut network_with, &states, 0..10)), [0, 1, 2, 3]);
    let output = run(&mut network_with, &states, 10..3000);
    assert_eq!(alive(&output), [0]);
    // A new robot does not bring a new battery.
    let revive = MoteCommand { source: "test".to_owned(), order: MoteOrder::Revive(2) };
    let from_ns = 3000 * STEP_NS;
    let output =
        step_with(&mut network_with, &states, from_ns, from_ns + STEP_NS, &[revive], false);
    assert_eq!(alive(&output), [0]);
}

#[test]
fn battery_mah_alone_only_reports() {
    for deaths in ["", "deaths = false"] {
        let (mut network, states) = network(deaths);
        let output = run(&mut network, &states, 0..1000);
        assert_eq!(output.motes.alive.count(), 4, "{deaths}");
    }
}

#[test]
fn a_battery_runs_empty_at_the_same_time_whatever_the_steps_and_after_restoring() {
    let (mut whole, states) = network("deaths = true");
    let (mut parts, _) = network("deaths = true");
    let mut n_dead = 0;
    for k in 0..600 {
        let expected = step_with(&mut whole, &states, k * STEP_NS, (k + 1) * STEP_NS, &[], false);
        let middle_ns = k * STEP_NS + (1 + k % 9) * 10_000_000;
        step_with(&mut parts, &states, k * STEP_NS, middle_ns, &[], false);
        let saved = parts.snapshot();
        parts = Network::default();
        parts.restore(&saved).unwrap();
        let got = step_with(&mut parts, &states, middle_ns, (k + 1) * STEP_NS, &[], false);
        assert_eq!(got.motes, expected.motes, "period {k}");
        n_dead = 4 - got.motes.alive.count();
    }
    assert!(0 < n_dead, "nobody died: nothing was compared");
}
