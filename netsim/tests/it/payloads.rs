//! The longest payload that a broadcast carries.

use super::harness::{setup, standing_at, started};
use netsim::sim::Network;
use netsim::wire::frame::MAX_PSDU;
use proto::side::{NetInput, NetSimulator as _};
use proto::types::{NetRecord, Payloads};

/// The lengths of the frames (bytes) that two motes sent for payloads of so many bytes.
fn lengths_of_frames(config: &str, payload_bytes: u32) -> Vec<u32> {
    let mut setup = setup(2, config);
    setup.records = vec![NetRecord::Frames];
    let mut network = Network::default();
    network.configure(&setup).expect("a valid configuration");
    let data = vec![5; 2 * payload_bytes as usize];
    let payloads = Payloads::new(vec![payload_bytes; 2], data.into()).expect("two payloads");
    let states = standing_at(&[(0.0, 0.0), (1.0, 0.0)]);
    let mut lengths = Vec::new();
    for step in 1..=300 {
        let output = network.step(&NetInput {
            step,
            from_ns: (step - 1) * 1_000_000_000,
            until_ns: step * 1_000_000_000,
            states: &states,
            payloads: &payloads,
            moved_obstacles: &[],
            commands: &[],
            stop_at_first_delivery: false,
            records: &[],
        });
        let frames = output.frames.expect("they are recorded");
        for (&kind, &length) in frames.kind.iter().zip(&frames.length_bytes) {
            if frames.kinds[kind as usize] == "swarm" {
                lengths.push(length);
            }
        }
    }
    lengths
}

#[test]
fn the_longest_payload_fills_a_frame() {
    for (config, expected) in [
        ("sf.kind = \"rrsf\"", 103),
        ("sf.kind = \"msf\"", 103),
        ("sf.kind = \"orchestra\"\nswarm.transport = \"shared-cell\"", 103),
        ("sf.kind = \"rrsf\"\n[security]", 97),
    ] {
        let config = format!("mode = \"6tisch\"\nphy.propagation = \"full\"\n{config}");
        let most = started(&setup(2, &config)).1.max_payload_bytes;
        assert_eq!(most, Some(expected), "{config}");
        let lengths = lengths_of_frames(&config, expected);
        assert!(!lengths.is_empty(), "{config}");
        assert!(lengths.iter().all(|&length| length as usize == MAX_PSDU), "{config}: {lengths:?}");
    }
}

#[test]
fn fragments_carry_what_a_neighbour_acknowledges_and_other_networks_carry_any_length() {
    for (config, most) in [
        ("mode = \"6tisch\"\nswarm.transport = \"unicast-neighbours\"", Some(1232)),
        ("mode = \"6tisch\"\nswarm.transport = \"none\"", None),
        (
            "mode = \"6tisch\"\n[second_medium]\nkind = \"wifi-broadcast\"\npayloads = \"second\"",
            None,
        ),
        ("mode = \"propagation-only\"", None),
    ] {
        assert_eq!(started(&setup(2, config)).1.max_payload_bytes, most, "{config}");
    }
}
