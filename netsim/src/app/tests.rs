use super::*;
use proptest::prelude::*;
use proto::config::{Default, Field, Kind, Lists, Node, Problem, TableSpec, check, parse};
use proto::rng::Purpose;
use proto::types::NS_PER_S;

const SLOT_NS: u64 = 10_000_000;

fn dice(mote: u32) -> Dice {
    Dice::new(7, Purpose::Application, mote)
}

fn spec(pattern: Pattern, peer: Peer) -> Spec {
    Spec { pattern, peer, payload_bytes: 90, senders: None }
}

fn periodic(period_s: u64, jitter_ns: u64) -> Pattern {
    Pattern::Periodic { period_ns: period_s * NS_PER_S, jitter_ns }
}

/// All packets until a time, the application being asked at the times it names.
fn run(app: &mut App, until_ns: u64, dice: &mut Dice) -> Vec<Packet> {
    let mut packets = Vec::new();
    while let Some(due_ns) = app.poll_timeout().filter(|&due_ns| due_ns < until_ns) {
        assert_eq!(app.handle_timeout(due_ns.saturating_sub(1), dice), None);
        packets.push(app.handle_timeout(due_ns, dice).unwrap());
    }
    packets
}

#[test]
fn p1_a_burst_of_two_is_exactly_two_packets() {
    let mut dice = dice(1);
    let pattern = Pattern::Burst { after_ns: NS_PER_S, n_packets: 2 };
    let mut app = App::new(&spec(pattern, Peer::Root), 1, false, 2, SLOT_NS).unwrap();
    assert_eq!(app.poll_timeout(), None);
    app.set_ready(true, 5 * NS_PER_S, &mut dice);
    let packets = run(&mut app, 1000 * NS_PER_S, &mut dice);
    assert_eq!(packets.len(), 2);
    assert!(packets.iter().all(|packet| packet.created_ns == 6 * NS_PER_S));
    assert_eq!(packets.iter().map(|packet| packet.counter).collect::<Vec<_>>(), [0, 1]);
    app.set_ready(false, 1000 * NS_PER_S, &mut dice);
    app.set_ready(true, 1001 * NS_PER_S, &mut dice);
    assert_eq!(run(&mut app, 2000 * NS_PER_S, &mut dice), []);
}

/// P2 asks for more than none; the period says how many.
#[test]
fn p2_a_period_of_2_s_over_1000_slotframes_is_a_packet_every_2_s() {
    let mut dice = dice(1);
    let pattern = periodic(2, NS_PER_S / 10);
    let mut app = App::new(&spec(pattern, Peer::Root), 1, false, 2, SLOT_NS).unwrap();
    app.set_ready(true, 0, &mut dice);
    let duration_ns = 1000 * 101 * SLOT_NS;
    let n = run(&mut app, duration_ns, &mut dice).len() as u64;
    // 1010 s / 2 s, the first after up to 2 s, and 505 times ±0.1 s at random: a standard deviation of 1.3 s.
    assert!((501..=508).contains(&n), "{n}");
}

#[test]
fn a_mote_that_may_not_send_makes_no_packets_and_begins_anew_afterwards() {
    let mut dice = dice(3);
    let mut app = App::new(&spec(periodic(10, 0), Peer::Root), 3, false, 4, SLOT_NS).unwrap();
    app.set_ready(true, 0, &mut dice);
    assert!(!run(&mut app, 100 * NS_PER_S, &mut dice).is_empty());
    app.set_ready(false, 100 * NS_PER_S, &mut dice);
    assert_eq!(app.poll_timeout(), None);
    assert_eq!(app.handle_timeout(500 * NS_PER_S, &mut dice), None);
    app.set_ready(true, 500 * NS_PER_S, &mut dice);
    let first_ns = app.poll_timeout().unwrap();
    assert!((500 * NS_PER_S + SLOT_NS..510 * NS_PER_S + SLOT_NS).contains(&first_ns));
    app.set_ready(true, 501 * NS_PER_S, &mut dice);
    assert_eq!(app.poll_timeout(), Some(first_ns));
}

#[test]
fn motes_that_become_ready_together_send_at_different_times() {
    let mut firsts: Vec<u64> = (1..50)
        .map(|mote| {
            let mut app =
                App::new(&spec(periodic(60, 0), Peer::Root), mote, false, 50, SLOT_NS).unwrap();
            app.set_ready(true, 0, &mut dice(mote));
            app.poll_timeout().unwrap()
        })
        .collect();
    firsts.sort_unstable();
    firsts.dedup();
    assert_eq!(firsts.len(), 49);
}

#[test]
fn nobody_sends_to_itself() {
    let pattern = periodic(1, 0);
    let new = |peer, own, is_root, n| App::new(&spec(pattern, peer), own, is_root, n, SLOT_NS);
    assert!(new(Peer::Root, 0, true, 5).is_none());
    assert!(new(Peer::Mote(3), 3, false, 5).is_none());
    assert!(new(Peer::All, 0, true, 1).is_none());
    assert!(new(Peer::Random, 0, true, 1).is_none());
    let listed = Spec { senders: Some(vec![2]), ..spec(pattern, Peer::Root) };
    assert!(App::new(&listed, 1, false, 5, SLOT_NS).is_none());
    assert!(App::new(&listed, 2, false, 5, SLOT_NS).is_some());
}

#[test]
fn a_root_that_sends_to_all_reaches_everybody_in_turn() {
    let mut dice = dice(2);
    let mut app = App::new(&spec(periodic(1, 0), Peer::All), 2, true, 5, SLOT_NS).unwrap();
    app.set_ready(true, 0, &mut dice);
    let packets = run(&mut app, 9 * NS_PER_S, &mut dice);
    let to: Vec<_> = packets.iter().map(|packet| packet.destination).collect();
    assert_eq!(to[..8], [0, 1, 3, 4, 0, 1, 3, 4].map(Destination::Mote));
}

#[test]
fn random_peers_are_all_the_others_equally_often() {
    let mut dice = dice(1);
    let mut app = App::new(&spec(periodic(1, 0), Peer::Random), 1, false, 4, SLOT_NS).unwrap();
    app.set_ready(true, 0, &mut dice);
    let mut counts = [0u32; 4];
    for packet in run(&mut app, 3001 * NS_PER_S, &mut dice) {
        let Destination::Mote(mote) = packet.destination else { unreachable!() };
        counts[mote as usize] += 1;
    }
    assert_eq!(counts[1], 0);
    // Binomial(3000, 1/3): a standard deviation of 26.
    for mote in [0, 2, 3] {
        assert!((870..1130).contains(&counts[mote]), "{counts:?}");
    }
}

#[test]
fn a_payload_has_its_length_and_begins_with_the_counter() {
    let packet = |payload_bytes| Packet {
        destination: Destination::Root,
        payload_bytes,
        counter: 258,
        created_ns: 0,
    };
    assert_eq!(packet(6).payload()[..], [0, 0, 1, 2, 0, 0]);
    assert_eq!(packet(2).payload()[..], [0, 0]);
}

proptest! {
    #[test]
    fn pauses_lie_within_the_jitter(
        period_ms in 1u64..100_000,
        jitter in 0.0f64..0.99,
        mote in 1u32..100,
    ) {
        let period_ns = period_ms * 1_000_000;
        let jitter_ns = (period_ns as f64 * jitter) as u64;
        let mut dice = dice(mote);
        let pattern = Pattern::Periodic { period_ns, jitter_ns };
        let mut app = App::new(&spec(pattern, Peer::Root), mote, false, 100, SLOT_NS).unwrap();
        app.set_ready(true, 0, &mut dice);
        let packets = run(&mut app, 50 * period_ns, &mut dice);
        for pair in packets.windows(2) {
            let pause_ns = pair[1].created_ns - pair[0].created_ns;
            prop_assert!(period_ns - jitter_ns <= pause_ns && pause_ns <= period_ns + jitter_ns);
        }
        prop_assert!(packets[0].created_ns < period_ns + SLOT_NS);
    }

    #[test]
    fn a_copy_from_bytes_sends_the_same(steps in 0usize..20) {
        let mut dice = dice(5);
        let pattern = periodic(3, NS_PER_S);
        let mut app = App::new(&spec(pattern, Peer::Random), 5, false, 9, SLOT_NS).unwrap();
        app.set_ready(true, 0, &mut dice);
        for _ in 0..steps {
            app.handle_timeout(app.poll_timeout().unwrap(), &mut dice);
        }
        let bytes = postcard::to_allocvec(&(&app, &dice)).unwrap();
        let (mut app_2, mut dice_2): (App, Dice) = postcard::from_bytes(&bytes).unwrap();
        let until_ns = 200 * NS_PER_S;
        prop_assert_eq!(run(&mut app, until_ns, &mut dice), run(&mut app_2, until_ns, &mut dice_2));
        prop_assert_eq!(app, app_2);
    }
}

const APPS: TableSpec = TableSpec {
    doc: "A section with applications.",
    fields: &[Field {
        key: "app",
        doc: "Applications.",
        kind: Kind::Tables(&config::SPEC),
        default: Default::Absent,
    }],
    tag: None,
};

fn read(text: &str) -> (Vec<Option<Spec>>, Vec<Problem>) {
    let node: Node = parse(text).unwrap();
    let mut problems = Vec::new();
    let table = check(&node, "netsim", &APPS, &Lists::NONE, &mut problems).table;
    let apps = table["app"].as_array().unwrap();
    let specs = apps
        .iter()
        .enumerate()
        .map(|(index, app)| {
            let path = format!("netsim.app[{index}]");
            Spec::read(app.as_table().unwrap(), &path, 10, &mut problems)
        })
        .collect();
    (specs, problems)
}

#[test]
fn a_configuration_says_who_sends_when_to_whom() {
    let (specs, problems) = read(
        "[[app]]\n\
         [[app]]\nkind = \"periodic\"\nperiod_s = 2\njitter = 0.5\ndestination = 4\nsenders = [1, 2]\n\
         [[app]]\nkind = \"burst\"\nat_s = 3.5\nn_packets = 7\ndestination = \"all\"\npayload_bytes = 180\n",
    );
    assert_eq!(problems, []);
    let expected = [
        Spec {
            pattern: periodic(60, 3 * NS_PER_S),
            peer: Peer::Root,
            payload_bytes: 30,
            senders: None,
        },
        Spec {
            pattern: periodic(2, NS_PER_S),
            peer: Peer::Mote(4),
            payload_bytes: 30,
            senders: Some(vec![1, 2]),
        },
        Spec {
            pattern: Pattern::Burst { after_ns: 3_500_000_000, n_packets: 7 },
            peer: Peer::All,
            payload_bytes: 180,
            senders: None,
        },
    ];
    assert_eq!(specs, expected.map(Some));
}

#[test]
fn motes_that_do_not_exist_are_refused_by_name() {
    let (specs, problems) = read("[[app]]\ndestination = 10\nsenders = [0, 11]\n");
    assert_eq!(specs, [None]);
    let paths: Vec<_> = problems.iter().map(|problem| problem.path.as_str()).collect();
    assert_eq!(paths, ["netsim.app[0].destination", "netsim.app[0].senders[1]"]);
}
