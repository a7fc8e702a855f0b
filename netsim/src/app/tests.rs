use super::*;
use crate::wire::coap::{Block, Code, Type};
use proptest::prelude::*;
use proto::config::{Default, Field, Lists, Node, TableSpec, check, parse};
use proto::ids::MoteId;
use proto::rng::Purpose;
use proto::time::{SimDuration, SimTime};
use proto::types::NS_PER_S;

mod exchanges;
mod random;

const SLOT: SimDuration = SimDuration::from_ms(10);

/// The surroundings of an application: draws of its mote, and the account of packets.
pub(super) struct World {
    pub(super) dice: Dice,
    pub(super) packets: Packets<DropReason>,
}

impl World {
    pub(super) fn of(mote: u32) -> Self {
        Self { dice: Dice::new(7, Purpose::Application, MoteId(mote)), packets: Packets::default() }
    }

    pub(super) fn at(&mut self, now: SimTime) -> Context<'_> {
        let reaches = &|_| true;
        let Self { dice, packets } = self;
        Context { now, received: now, dice, packets, reaches }
    }
}

fn sender(peer: Peer) -> Sender {
    Sender::new(None, peer, 90)
}

fn periodic(peer: Peer, period_s: u64, jitter: SimDuration) -> Spec {
    let machine = periodic::Periodic::new(sender(peer), SimDuration::from_s(period_s), jitter);
    Spec { machine: Machine::Periodic(machine) }
}

pub(super) fn host(mote: u32, is_root: bool, n_motes: u32) -> Host {
    let slot = SLOT;
    Host {
        mote: MoteId(mote),
        is_root,
        first_root: MoteId(0),
        n_motes,
        slot,
        app: 0,
        n_apps: 1,
        seed: 7,
    }
}

pub(super) fn app(spec: &Spec, mote: u32, is_root: bool, n_motes: u32) -> App {
    App::new(spec, &host(mote, is_root, n_motes)).unwrap()
}

/// All packets until a time, the application being asked at the times it names.
pub(super) fn run(app: &mut App, until: SimTime, world: &mut World) -> Vec<Packet> {
    let mut packets = Vec::new();
    while let Some(due) = app.poll_timeout().filter(|&due| due < until) {
        assert_eq!(
            app.handle_timeout(&mut world.at(due.saturating_sub(SimDuration::from_ns(1)))),
            None
        );
        packets.extend(app.handle_timeout(&mut world.at(due)));
    }
    packets
}

fn counter(packet: &Packet) -> u32 {
    match packet.content {
        Content::Counted { counter, .. } => counter,
        Content::Coap(_) => panic!("a one-way packet"),
    }
}

#[test]
fn p1_a_burst_of_two_is_exactly_two_packets() {
    let mut world = World::of(1);
    let burst = burst::Burst::new(sender(Peer::Root), SimDuration::SECOND, 2);
    let mut app = app(&Spec { machine: Machine::Burst(burst) }, 1, false, 2);
    assert_eq!(app.poll_timeout(), None);
    app.set_ready(true, &mut world.at(SimTime::START + SimDuration::from_s(5)));
    let packets = run(&mut app, SimTime::START + SimDuration::from_s(1000), &mut world);
    assert_eq!(packets.len(), 2);
    assert!(packets.iter().all(|packet| packet.created == SimTime::START + SimDuration::from_s(6)));
    assert_eq!(packets.iter().map(counter).collect::<Vec<_>>(), [0, 1]);
    app.set_ready(false, &mut world.at(SimTime::START + SimDuration::from_s(1000)));
    app.set_ready(true, &mut world.at(SimTime::START + SimDuration::from_s(1001)));
    assert_eq!(run(&mut app, SimTime::START + SimDuration::from_s(2000), &mut world), []);
}

/// P2 asks for more than none; the period says how many.
#[test]
fn p2_a_period_of_2_s_over_1000_slotframes_is_a_packet_every_2_s() {
    let mut world = World::of(1);
    let mut app = app(&periodic(Peer::Root, 2, SimDuration::SECOND / 10), 1, false, 2);
    app.set_ready(true, &mut world.at(SimTime::START));
    let duration = 1000 * 101 * SLOT;
    let n = run(&mut app, SimTime::START + duration, &mut world).len() as u64;
    // 1010 s / 2 s, the first after up to 2 s, and 505 times ±0.1 s at random: a standard deviation of 1.3 s.
    assert!((501..=508).contains(&n), "{n}");
}

#[test]
fn a_mote_that_may_not_send_makes_no_packets_and_begins_anew_afterwards() {
    let mut world = World::of(3);
    let mut app = app(&periodic(Peer::Root, 10, SimDuration::ZERO), 3, false, 4);
    app.set_ready(true, &mut world.at(SimTime::START));
    assert!(!run(&mut app, SimTime::START + SimDuration::from_s(100), &mut world).is_empty());
    app.set_ready(false, &mut world.at(SimTime::START + SimDuration::from_s(100)));
    assert_eq!(app.poll_timeout(), None);
    assert_eq!(app.handle_timeout(&mut world.at(SimTime::START + SimDuration::from_s(500))), None);
    app.set_ready(true, &mut world.at(SimTime::START + SimDuration::from_s(500)));
    let first = app.poll_timeout().unwrap();
    let [from, until] = [500, 510].map(|s| SimTime::START + SimDuration::from_s(s) + SLOT);
    assert!((from..until).contains(&first));
    app.set_ready(true, &mut world.at(SimTime::START + SimDuration::from_s(501)));
    assert_eq!(app.poll_timeout(), Some(first));
}

#[test]
fn motes_that_become_ready_together_send_at_different_times() {
    let mut firsts: Vec<SimTime> = (1..50)
        .map(|mote| {
            let mut app = app(&periodic(Peer::Root, 60, SimDuration::ZERO), mote, false, 50);
            app.set_ready(true, &mut World::of(mote).at(SimTime::START));
            app.poll_timeout().unwrap()
        })
        .collect();
    firsts.sort_unstable();
    firsts.dedup();
    assert_eq!(firsts.len(), 49);
}

#[test]
fn nobody_sends_to_itself() {
    let new = |peer, own, is_root, n| {
        App::new(&periodic(peer, 1, SimDuration::ZERO), &host(own, is_root, n))
    };
    assert!(new(Peer::Root, 0, true, 5).is_none());
    assert!(new(Peer::Mote(MoteId(3)), 3, false, 5).is_none());
    assert!(new(Peer::All, 0, true, 1).is_none());
    assert!(new(Peer::Random, 0, true, 1).is_none());
    let listed = Sender::new(Some(vec![MoteId(2)]), Peer::Root, 90);
    let machine =
        Machine::Periodic(periodic::Periodic::new(listed, SimDuration::SECOND, SimDuration::ZERO));
    let listed = Spec { machine };
    assert!(App::new(&listed, &host(1, false, 5)).is_none());
    assert!(App::new(&listed, &host(2, false, 5)).is_some());
}

#[test]
fn a_root_that_sends_to_all_reaches_everybody_in_turn() {
    let mut world = World::of(2);
    let mut app = app(&periodic(Peer::All, 1, SimDuration::ZERO), 2, true, 5);
    app.set_ready(true, &mut world.at(SimTime::START));
    let packets = run(&mut app, SimTime::START + SimDuration::from_s(9), &mut world);
    let to: Vec<_> = packets.iter().map(|packet| packet.destination).collect();
    assert_eq!(to[..8], [0, 1, 3, 4, 0, 1, 3, 4].map(MoteId).map(Destination::Mote));
}

#[test]
fn random_peers_are_all_the_others_equally_often() {
    let mut world = World::of(1);
    let mut app = app(&periodic(Peer::Random, 1, SimDuration::ZERO), 1, false, 4);
    app.set_ready(true, &mut world.at(SimTime::START));
    let mut counts = [0u32; 4];
    for packet in run(&mut app, SimTime::START + SimDuration::from_s(3001), &mut world) {
        let Destination::Mote(mote) = packet.destination else { unreachable!() };
        counts[mote.index()] += 1;
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
        content: Content::Counted { payload_bytes, counter: 258 },
        created: SimTime::START,
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
        let period = period_ms * 1_000_000;
        let jitter = (period as f64 * jitter) as u64;
        let mut world = World::of(mote);
        let machine = periodic::Periodic::new(sender(Peer::Root), SimDuration::from_ns(period), SimDuration::from_ns(jitter));
        let mut app = app(&Spec { machine: Machine::Periodic(machine) }, mote, false, 100);
        app.set_ready(true, &mut world.at(SimTime::START));
        let packets = run(&mut app, SimTime::from_ns(50 * period), &mut world);
        for pair in packets.windows(2) {
            let pause = pair[1].created - pair[0].created;
            prop_assert!(period - jitter <= pause.ns() && pause <= SimDuration::from_ns(period + jitter));
        }
        prop_assert!(packets[0].created < SimTime::from_ns(period) + SLOT);
    }

    #[test]
    fn a_copy_from_bytes_sends_the_same(steps in 0usize..20) {
        let poisson = poisson::Poisson::new(sender(Peer::Random), SimDuration::from_s(3));
        for spec in [periodic(Peer::Random, 3, SimDuration::SECOND), Spec { machine: Machine::Poisson(poisson) }] {
            let mut world = World::of(5);
            let mut app = app(&spec, 5, false, 9);
            app.set_ready(true, &mut world.at(SimTime::START));
            for _ in 0..steps {
                app.handle_timeout(&mut world.at(app.poll_timeout().unwrap()));
            }
            let bytes = postcard::to_allocvec(&(&app, &world.dice, &world.packets)).unwrap();
            let (mut app_2, dice, packets): (App, Dice, Packets<DropReason>) = postcard::from_bytes(&bytes).unwrap();
            let mut world_2 = World { dice, packets };
            let until = SimDuration::from_s(200);
            prop_assert_eq!(run(&mut app, SimTime::START + until, &mut world), run(&mut app_2, SimTime::START + until, &mut world_2));
            prop_assert_eq!(app, app_2);
        }
    }
}

const APPS: TableSpec = TableSpec {
    doc: "A section with applications.",
    fields: &[Field {
        key: "app",
        doc: "Applications.",
        kind: proto::config::Kind::Tables(&config::SPEC),
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
         [[app]]\nkind = \"burst\"\nat_s = 3.5\nn_packets = 7\ndestination = \"all\"\npayload_bytes = 180\n\
         [[app]]\nkind = \"poisson\"\nmean_interval_s = 0.5\n\
         [[app]]\nkind = \"event\"\nat_s = [2, 1]\nplace_m = [3, 4]\nradius_m = 5\nn_packets = 2\n\
         [[app]]\nkind = \"coap\"\nservers = 3\ninterval = \"exponential\"\n\
         [[app]]\nkind = \"download\"\ntargets = [7, 2]\n",
    );
    assert_eq!(problems, []);
    let expected = [
        Machine::Periodic(periodic::Periodic::new(
            Sender::new(None, Peer::Root, 30),
            SimDuration::from_s(60),
            SimDuration::from_s(3),
        )),
        Machine::Periodic(periodic::Periodic::new(
            Sender::new(Some(vec![MoteId(1), MoteId(2)]), Peer::Mote(MoteId(4)), 30),
            SimDuration::from_s(2),
            SimDuration::SECOND,
        )),
        Machine::Burst(burst::Burst::new(
            Sender::new(None, Peer::All, 180),
            SimDuration::from_ns(3_500_000_000),
            7,
        )),
        Machine::Poisson(poisson::Poisson::new(
            Sender::new(None, Peer::Root, 30),
            SimDuration::SECOND / 2,
        )),
        Machine::Event(event::Event::new(
            Sender::new(None, Peer::Root, 30),
            Some((
                event::Times::Listed(vec![
                    SimTime::from_ns(NS_PER_S),
                    SimTime::START + SimDuration::from_s(2),
                ]),
                event::Area { place_m: Some([3.0, 4.0]), radius_m: Some(5.0) },
            )),
            2,
            SimDuration::SECOND,
        )),
        Machine::Coap(coap::Coap::new(coap::Settings {
            servers: coap::Servers::One(MoteId(3)),
            period: SimDuration::from_s(10),
            is_poisson: true,
            response_bytes: 16,
            timers: exchanges::TIMERS,
        })),
        Machine::Download(download::Download::new(
            download::Settings {
                after: SimDuration::ZERO,
                size_bytes: 10_000,
                szx: 2,
                timers: exchanges::TIMERS,
            },
            Some(vec![MoteId(7), MoteId(2)]),
        )),
    ];
    assert_eq!(specs, expected.map(|machine| Some(Spec { machine })));
}

#[test]
fn motes_that_do_not_exist_are_refused_by_name() {
    let (specs, problems) = read("[[app]]\ndestination = 10\nsenders = [0, 11]\n");
    assert_eq!(specs, [None]);
    let paths: Vec<_> = problems.iter().map(|problem| problem.path.as_str()).collect();
    assert_eq!(paths, ["netsim.app[0].destination", "netsim.app[0].senders[1]"]);
}

#[test]
fn what_cannot_be_is_refused_with_the_nearest_choice() {
    let (specs, problems) = read(
        "[[app]]\nkind = \"download\"\nblock_bytes = 100\n\
         [[app]]\nkind = \"event\"\nat_s = [1]\nmean_interval_s = 5\n\
         [[app]]\nkind = \"coap\"\nservers = 10\n",
    );
    assert_eq!(specs, [None, None, None]);
    let texts: Vec<_> = problems.iter().map(ToString::to_string).collect();
    assert_eq!(
        texts,
        [
            "netsim.app[0].block_bytes: must be a power of two from 16 to 1024, got 100 (nearest valid: 128)",
            "netsim.app[1].mean_interval_s: must be absent where at_s lists the times of the events, got 5",
            "netsim.app[2].servers: must be the number of a mote, 0 to 9, got 10 (nearest valid: 9)",
        ]
    );
}
