//! The scheduler that decides for all: what it delivers, how fast, and that a saved one goes on.

use crate::harness::{interval, network, payloads, setup, standing_at, started, text};
use netsim::sim::Network;
use proto::side::{NetInput, NetOutput, NetSimulator as _, Setup};
use proto::types::{NS_PER_S, NetRecord};

/// A line of five motes, each in reach of the next, the root at one end.
const LINE: [(f64, f64); 5] = [(0.0, 0.0), (8.0, 0.0), (16.0, 0.0), (24.0, 0.0), (32.0, 0.0)];

fn text_of(phy: &str, more: &str) -> String {
    format!("mode = \"6tisch\"\n[phy]\n{phy}\n[sf]\nkind = \"oracle\"\n{more}")
}

fn recorded(n: usize, config: &str) -> Setup {
    Setup { records: vec![NetRecord::Packets, NetRecord::Statistics], ..setup(n, config) }
}

/// Source, hops, outcome and latency (ns) of each packet that ended while the first `n` motes of the line stood there, and the
/// last output.
fn run(
    network: &mut Network,
    n: usize,
    seconds: std::ops::Range<u64>,
) -> (Vec<[u64; 4]>, NetOutput) {
    let states = standing_at(&LINE[..n]);
    let mut ended = Vec::new();
    let mut last = None;
    for second in seconds {
        let output = interval(network, &states, second * NS_PER_S, (second + 1) * NS_PER_S);
        let packets = output.packets.as_ref().expect("packets are recorded");
        for place in 0..packets.id.len() {
            let latency_ns = packets.ended_ns[place] - packets.created_ns[place];
            let numbers = [packets.source[place], packets.hops[place], packets.outcome[place]];
            ended.push([numbers[0].into(), numbers[1].into(), numbers[2].into(), latency_ns]);
        }
        last = Some(output);
    }
    (ended, last.expect("at least a second"))
}

#[test]
fn each_packet_takes_the_shortest_way_a_slot_for_each_hop() {
    let config = text_of(
        "propagation = \"unit-disk\"\nradius_m = 10",
        "[[app]]\nperiod_s = 3\npayload_bytes = 72",
    );
    let (mut network, _) = started(&recorded(5, &config));
    let (ended, last) = run(&mut network, 5, 0..60);
    assert_eq!(last.formation.expect("a full network").formed_ns, Some(10_000_000));
    let count = |source: u64| ended.iter().filter(|packet| packet[0] == source).count();
    for source in 1..5 {
        // Twenty periods of three seconds; where they begin is random.
        assert!((18..=22).contains(&count(source)), "{source}: {}", count(source));
    }
    let mut n_at_once = 0;
    for [source, hops, outcome, latency_ns] in &ended {
        assert_eq!((hops, *outcome), (source, 0));
        // Nobody waits for longer than the few others take.
        assert!(*latency_ns < (source + 12) * 10_000_000, "{source}: {latency_ns}");
        n_at_once += u64::from(*latency_ns < source * 10_000_000);
    }
    // Most find the way free: a slot for each hop, the last of which ends before its slot does.
    assert!(ended.len() as u64 / 2 < n_at_once, "{n_at_once} of {}", ended.len());
}

#[test]
fn over_a_link_of_probability_p_the_attempts_are_geometric() {
    let config = text_of(
        "propagation = \"gaussian\"\nsigma_m = 8",
        "[[app]]\nsenders = [1]\nperiod_s = 1\npayload_bytes = 40",
    );
    let (mut network, _) = started(&recorded(2, &config));
    let (ended, _) = run(&mut network, 2, 0..4000);
    let mut of_attempts = [0.0; 64];
    for [_, _, _, latency_ns] in ended {
        of_attempts[(latency_ns / 10_000_000) as usize] += 1.0;
    }
    // The distance is the width of the well.
    let p = (-0.5_f64).exp();
    let n: f64 = of_attempts.iter().sum();
    assert!(3990.0 < n, "{n}");
    for (n_failed, found) in (0..6).zip(of_attempts) {
        let expected = p * (1.0 - p).powi(n_failed);
        let error = (expected * (1.0 - expected) / n).sqrt();
        assert!((found / n - expected).abs() < 4.0 * error, "{n_failed}: {found} of {n}");
    }
}

#[test]
fn a_datagram_of_several_frames_arrives_when_the_last_of_them_does() {
    let config = text_of(
        "propagation = \"unit-disk\"\nradius_m = 10",
        "[[app]]\nsenders = [4]\nperiod_s = 2\npayload_bytes = 300",
    );
    let (mut network, _) = started(&recorded(5, &config));
    let (ended, _) = run(&mut network, 5, 0..40);
    assert!(18 <= ended.len());
    // Four hops with four frames each: 300 bytes, and less than a hundred to a frame.
    for [_, hops, outcome, latency_ns] in ended {
        assert_eq!((hops, outcome), (4, 0));
        assert!((150_000_000..160_000_000).contains(&latency_ns), "{latency_ns}");
    }
}

#[test]
fn with_security_frames_and_acknowledgments_keep_both_radios_on_for_six_bytes_more() {
    let on_ns = |security: &str| {
        let config = text_of(
            "propagation = \"unit-disk\"\nradius_m = 10",
            &format!("[[app]]\nsenders = [1]\nperiod_s = 1\npayload_bytes = 40\n{security}"),
        );
        let (mut network, _) = started(&recorded(2, &config));
        let (ended, _) = run(&mut network, 2, 0..100);
        let output = network.step(&NetInput {
            step: 1,
            from_ns: 100 * NS_PER_S,
            until_ns: 100 * NS_PER_S + 100_000_000,
            states: &standing_at(&LINE[..2]),
            payloads: &payloads(2),
            moved_obstacles: &[],
            commands: &[],
            stop_at_first_delivery: false,
            records: &[NetRecord::Statistics],
        });
        let columns = output.statistics.expect("statistics are recorded").columns;
        let column = columns.iter().find(|column| column.name == "radio_on_ns");
        (ended.len(), column.expect("a column").values.iter().sum::<f64>())
    };
    let (n, plain) = on_ns("");
    let (n_secured, secured) = on_ns("[security]\nenabled = true\n");
    assert!(80 < n && n == n_secured, "{n} {n_secured}");
    // A byte lasts 32 µs.
    assert_eq!(secured - plain, n as f64 * 4.0 * 6.0 * 32_000.0);
}

#[test]
fn saved_with_packets_on_their_way_it_goes_on() {
    let config = text_of(
        "propagation = \"unit-disk\"\nradius_m = 10",
        "[[app]]\nperiod_s = 0.2\npayload_bytes = 200",
    );
    let (mut network, _) = started(&recorded(5, &config));
    run(&mut network, 5, 0..5);
    let saved = network.snapshot();
    let mut twin = Network::default();
    twin.restore(&saved).expect("what was just saved");
    assert_eq!(run(&mut network, 5, 5..10).0, run(&mut twin, 5, 5..10).0);
    assert!(network.snapshot() == twin.snapshot());
}

#[test]
fn it_carries_no_payloads_for_everyone() {
    let config = text_of("propagation = \"full\"", "[swarm]\ntransport = \"own-cell\"");
    let problems = Network::default().configure(&setup(3, &config)).expect_err("refused");
    assert_eq!(
        text(&problems),
        "netsim.swarm.transport: does not apply with sf.kind = \"oracle\", because it carries no payloads for everyone, got \"own-cell\" (nearest valid: \"none\")"
    );
    network(3, &text_of("propagation = \"full\"", ""));
}
