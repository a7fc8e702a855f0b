//! What a few networks do, pinned: whoever makes slots faster must not change it. A change that is meant to change what
//! motes do brings new digests.

use super::harness::setup;
use netsim::sim::Network;
use proto::digest::{hex, of_step};
use proto::side::{NetInput, NetSimulator};
use proto::types::{AgentStates, NetRecord, Payloads};

const STEP_NS: u64 = 1_000_000_000;

/// A digest of what `n` motes on a grid of 10 m report, step by step: deliveries, packets, ranks, parents, queues,
/// statistics. Each robot says 48 bytes in each step.
fn digest(n: usize, config: &str, seconds: u64) -> String {
    let mut setup = setup(n, config);
    setup.experiment.step_ns = STEP_NS;
    setup.records = vec![NetRecord::Packets, NetRecord::Statistics];
    let mut network = Network::default();
    network.configure(&setup).expect("a valid configuration");
    let side = (n as f64).sqrt().ceil() as usize;
    let mut states = AgentStates::at_origin(n);
    for mote in 0..n {
        states.x_m[mote] = 10.0 * (mote % side) as f64;
        states.y_m[mote] = 10.0 * (mote / side) as f64;
    }
    let payloads = Payloads::new(vec![48; n], vec![7; 48 * n].into()).expect("48 bytes each");
    // Disguised as positions, which the digest covers bit by bit.
    let mut read = AgentStates::default();
    for step in 1..=seconds {
        let output = network.step(&NetInput {
            step,
            from_ns: (step - 1) * STEP_NS,
            until_ns: step * STEP_NS,
            states: &states,
            payloads: &payloads,
            moved_obstacles: &[],
            commands: &[],
            stop_at_first_delivery: false,
            records: if step % 100 == 0 { &[NetRecord::Statistics] } else { &[] },
        });
        let mut say = |number: f64| read.x_m.push(number);
        let deliveries = &output.deliveries;
        deliveries.transmissions.sent_ns.iter().for_each(|&sent_ns| say(sent_ns as f64));
        for agent in 0..n {
            deliveries.heard_by(agent).for_each(|transmission| say(transmission as f64));
        }
        let packets = output.packets.expect("packets were asked for");
        packets.id.iter().chain(&packets.ended_ns).for_each(|&number| say(number as f64));
        packets.outcome.iter().chain(&packets.hops).for_each(|&number| say(f64::from(number)));
        let motes = &output.motes;
        let numbers = motes.rank.iter().chain(&motes.parent).chain(&motes.queue_length);
        numbers.for_each(|&number| say(f64::from(number)));
        let columns = output.statistics.iter().flat_map(|statistics| &statistics.columns);
        columns.flat_map(|column| &column.values).for_each(|&value| say(value));
    }
    hex(&of_step(seconds, seconds * STEP_NS, &read, None))
}

/// Motes, configuration, simulated time (s), digest.
const CASES: &[(usize, &str, u64, &str)] = &[
    (
        12,
        "phy.propagation = \"full\"\nsf.kind = \"rrsf\"",
        600,
        "f1404cb2b4544e73b1c0210e0502e937debec2221a5572dde4ad90e639a6fe0c",
    ),
    (
        25,
        "phy = { propagation = \"unit-disk\", radius_m = 25.0 }\nsf.kind = \"msf\"\nswarm.transport = \"none\"\n\
         [[app]]\nperiod_s = 20",
        1200,
        "b1efb216a751ddf19aa220f8b1120ca1b10991f105e5ef91350c3d6b263a31b9",
    ),
    (
        25,
        "phy.propagation = \"experimental-randomness\"\nsf.kind = \"orchestra\"\nmac.pending_bit = true\n\
         swarm.transport = \"none\"\n[[app]]\nperiod_s = 20\npayload_bytes = 200",
        1200,
        "90691cbc9a2df1f7a83328da0dab2cabcddd4cb2820a96f02e6d7994068f7620",
    ),
];

#[test]
fn networks_do_what_they_did_bit_for_bit() {
    let got: Vec<String> = CASES
        .iter()
        .map(|(n, config, seconds, _)| {
            digest(*n, &format!("mode = \"6tisch\"\n{config}"), *seconds)
        })
        .collect();
    let expected: Vec<&str> = CASES.iter().map(|case| case.3).collect();
    assert_eq!(got, expected);
}
