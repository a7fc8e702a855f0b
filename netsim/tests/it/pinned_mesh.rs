//! What a few networks do, pinned: whoever makes slots faster must not change it. A change that is meant to change what
//! motes do brings a new snapshot.
//!
//! The snapshot has, for each network, its configuration, a table of what the motes did, and a digest of every bit of it. A digest
//! that changes alone is a difference below the digits of the table.

use super::harness::setup;
use netsim::sim::Network;
use proto::digest::{hex, of_step};
use proto::side::{NetInput, NetSimulator};
use proto::types::{AgentStates, MoteStates, NetRecord, Payloads};

const STEP_NS: u64 = 1_000_000_000;

/// What `n` motes on a grid of 10 m report, step by step: deliveries, packets, ranks, parents, queues, statistics. A line for each
/// sixth of the time, and a digest of all of it. Each robot says 48 bytes in each step.
fn pinned(n: usize, config: &str, seconds: u64) -> String {
    let mut setup = setup(n, &format!("mode = \"6tisch\"\n{config}"));
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
    let (mut lines, mut counts) = (String::new(), Counts::default());
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
        counts.frames += deliveries.transmissions.sent_ns.len();
        counts.deliveries += (0..n).map(|agent| deliveries.heard_by(agent).count()).sum::<usize>();
        counts.ended += packets.len();
        counts.arrived +=
            (0..packets.len()).filter(|&packet| packets.drop_reason(packet).is_none()).count();
        counts.hops += packets.hops.iter().map(|&hops| hops as usize).sum::<usize>();
        if step % (seconds / 6) == 0 {
            lines += &line(step, &counts, motes);
        }
    }
    let digest = hex(&of_step(seconds, seconds * STEP_NS, &read, None));
    format!("{n} motes\n{config}\n{HEADING}{lines}{digest}\n")
}

/// What was counted from the begin on.
#[derive(Default)]
struct Counts {
    frames: usize,
    deliveries: usize,
    ended: usize,
    arrived: usize,
    hops: usize,
}

/// RFC 6550, 17: INFINITE_RANK.
const INFINITE_RANK: u32 = 0xffff;

/// The columns of [`line`].
const HEADING: &str = "  time (s) | frames | deliveries | packets ended | arrived | hops | joined | ranks | queued | parents\n";

/// What was counted up to a time, and how the motes stand then. Queues and ranks are sums, of ranks without those that are infinite.
fn line(time_s: u64, counts: &Counts, motes: &MoteStates) -> String {
    let Counts { frames, deliveries, ended, arrived, hops } = counts;
    let n_joined = motes.joined.as_ref().map_or(0, |joined| joined.iter_ones().count());
    let ranks: u32 = motes.rank.iter().filter(|&&rank| rank < INFINITE_RANK).sum();
    let queued: u64 = motes.queue_length.iter().map(|&length| u64::from(length)).sum();
    let parents: Vec<String> = motes
        .parent
        .iter()
        .map(|&parent| if parent == u32::MAX { "-".to_owned() } else { parent.to_string() })
        .collect();
    format!(
        "  {time_s:8} | {frames:6} | {deliveries:10} | {ended:13} | {arrived:7} | {hops:4} | {n_joined:6} | {ranks:5} | {queued:6} | {}\n",
        parents.join(" ")
    )
}

/// Motes, configuration, simulated time (s).
const CASES: &[(usize, &str, u64)] = &[
    (12, "phy.propagation = \"full\"\nsf.kind = \"rrsf\"", 600),
    (
        25,
        "phy = { propagation = \"unit-disk\", radius_m = 25.0 }\nsf.kind = \"msf\"\nswarm.transport = \"none\"\n\
         [[app]]\nperiod_s = 20",
        1200,
    ),
    (
        25,
        "phy.propagation = \"experimental-randomness\"\nsf.kind = \"orchestra\"\nmac.pending_bit = true\n\
         swarm.transport = \"none\"\n[[app]]\nperiod_s = 20\npayload_bytes = 200",
        1200,
    ),
];

#[test]
fn networks_do_what_they_did_bit_for_bit() {
    let all: Vec<String> =
        CASES.iter().map(|&(n, config, seconds)| pinned(n, config, seconds)).collect();
    insta::assert_snapshot!(all.join("\n"));
}
