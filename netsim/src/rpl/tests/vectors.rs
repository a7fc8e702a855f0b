//! Conformance vectors R3 to R11; R1, R2, R7, R9 and R12 are with what they concern.

use super::*;
use proto::ids::MoteId;
use proto::time::{SimDuration, SimTime};

#[test]
fn r3_default_ranks_on_a_line() {
    let mut bench = Bench::mote(Config::default());
    bench.hear(0, &dio_of(0, 256));
    assert_eq!(bench.rpl.rank(), 2048);
    let mut next = Bench::new(Config::default(), 10, false);
    next.hear(9, &dio_of(0, 2048));
    assert_eq!(next.rpl.rank(), 3840);
    assert_eq!(next.rpl.dag_rank(), 15);
}

#[test]
fn r4_perfect_links_give_a_hop_of_256_each_once_measured() {
    let mut rank = 256;
    for n in 1..5 {
        let mut bench = Bench::new(Config::default(), n, false);
        bench.hear(n - 1, &dio_of(0, rank));
        for _ in 0..100 {
            bench.link(n - 1, 1, true);
        }
        assert_eq!(bench.rpl.rank(), rank + 256);
        rank = bench.rpl.rank();
    }
    assert_eq!(rank, 1280);
}

#[test]
fn r5_a_gain_of_exactly_640_does_not_switch_and_one_more_does() {
    for (gain, parent) in [(640, 1), (641, 2)] {
        let mut bench = Bench::mote(Bench::perfect());
        bench.hear(1, &dio_of(0, 2000));
        assert_eq!(bench.rpl.rank(), 2256);
        bench.hear(2, &dio_of(0, 2000 - gain));
        assert_eq!(bench.rpl.parent(), Some(mote(parent)), "{gain}");
    }
}

#[test]
fn r6_an_infinite_rank_on_first_contact_leaves_rank_unknown() {
    let mut bench = Bench::mote(Config::default());
    bench.hear(1, &dio_of(0, INFINITE_RANK));
    assert_eq!(bench.rpl.rank(), INFINITE_RANK);
    assert!(!bench.rpl.is_in_dodag());
    assert_eq!(bench.events(), []);
}

#[test]
fn r7_ten_failures_in_a_row_drop_a_parent() {
    let mut bench = Bench::mote(Bench::perfect());
    bench.hear(1, &dio_of(0, 256));
    for _ in 0..100 {
        bench.link(1, 1, true);
    }
    bench.link(1, 5, false);
    bench.link(1, 4, false);
    assert_eq!(bench.rpl.parent(), Some(mote(1)));
    bench.link(1, 1, false);
    assert_eq!(bench.rpl.parent(), None);
}

#[test]
fn r8_a_parent_that_moves_down_is_followed_but_no_further_than_dag_max_rank_increase() {
    // The vector drops a parent of the same or larger rank at once, because the peer's own rank is never computed anew
    // (its Q22). RFC 6550, § 8.2.2.4: a mote may move down within its DODAG version, up to DAGMaxRankIncrease.
    let mut bench = Bench::mote(Bench::perfect());
    bench.hear(1, &dio_of(0, 512));
    assert_eq!(dio_ranks(&bench.pass(17 * SimDuration::SECOND)), [768]);
    for rank in [768, 1024, 768 + 7168 - 256] {
        bench.hear(1, &dio_of(0, rank));
        assert_eq!(bench.rpl.rank(), rank + 256);
    }
    bench.sent();
    bench.hear(1, &dio_of(0, 768 + 7168 - 255));
    assert_eq!(bench.rpl.parent(), None);
    assert!(bench.rpl.parent_set(bench.now).is_empty());
    assert_eq!(dio_ranks(&bench.sent()), [INFINITE_RANK]);
}

#[test]
fn r8_with_stale_rank_the_parent_must_stay_a_hop_nearer_to_the_root() {
    for (rank, stays) in [(512, true), (300, true), (513, false), (768, false), (900, false)] {
        let mut bench = Bench::mote(Config { stale_rank: true, ..Bench::perfect() });
        bench.hear(1, &dio_of(0, 512));
        bench.sent();
        bench.hear(1, &dio_of(0, rank));
        assert_eq!(bench.rpl.parent().is_some(), stays, "{rank}");
        assert_eq!(bench.rpl.rank(), if stays { 768 } else { INFINITE_RANK }, "{rank}");
        assert_eq!(dio_ranks(&bench.sent()).contains(&INFINITE_RANK), !stays, "{rank}");
    }
}

#[test]
fn q22_rank_follows_the_parents_rank() {
    let mut bench = Bench::mote(Bench::perfect());
    bench.hear(1, &dio_of(0, 1024));
    for rank in [512, 768, 256] {
        bench.hear(1, &dio_of(0, rank));
        assert_eq!(bench.rpl.rank(), rank + 256);
    }
}

#[test]
fn r9_the_root_routes_by_what_daos_say() {
    let mut root = Bench::new(Config::default(), 0, true);
    for (child, parent, last_hop) in [(1, 0, 1), (2, 1, 1), (3, 2, 1), (4, 7, 1)] {
        let dao = dao_of(child, parent, 240, 30);
        root.receive(last_hop, false, &RplMessage::Dao(dao));
    }
    let address = |n| mote(n).global();
    assert_eq!(root.rpl.route(address(1)), Some(Route::Down(mote(1))));
    let hops = vec![address(1), address(2), address(3)];
    let route =
        crate::wire::datagram::SourceRoute { root: address(0), hops, tunnel_hop_limit: None };
    assert_eq!(root.rpl.route(address(3)), Some(Route::Source { first_hop: mote(1), route }));
    assert_eq!(root.rpl.route(address(4)), None);
    assert_eq!(root.rpl.route(address(5)), None);
    let circle = RplMessage::Dao(dao_of(2, 3, 241, 30));
    root.receive(1, false, &circle);
    assert_eq!(root.rpl.route(address(3)), None);
    let neighbour = Route::Neighbour(mote(5));
    assert_eq!(root.rpl.route(mote(5).link_local()), Some(neighbour));
}

#[test]
fn r10_solicitations_by_mode() {
    let hour = 3600 * SimDuration::SECOND;
    for (solicitation, first) in [
        (Solicitation::Unicast, Some(mote(3).link_local())),
        (Solicitation::Multicast, Some(ALL_RPL_NODES)),
        (Solicitation::Off, None),
    ] {
        let config = Config { solicitation, ..Config::default() };
        let mut dice = Dice::new(1, Purpose::Routing, MoteId(9));
        let mut rpl = Rpl::new(config, mote(9), false);
        rpl.set_proxy(Some(mote(3)));
        rpl.start(SimTime::START, &mut dice);
        let mut bench = Bench { rpl, dice, now: SimTime::START };
        let destinations = dis_destinations(&bench.pass(hour));
        assert_eq!(destinations.first().copied(), first);
        assert!(destinations.iter().skip(1).all(|&one| one == ALL_RPL_NODES));
        assert_eq!(destinations.len(), if first.is_some() { 61 } else { 0 });
    }
}

#[test]
fn r10_a_unicast_solicitation_is_answered_alone_and_resets_nothing() {
    let mut root = Bench::new(Config::default(), 0, true);
    root.pass(100 * SimDuration::SECOND);
    root.events();
    root.receive(9, false, &RplMessage::Dis(DisRepr {}));
    let sent = root.sent();
    assert_eq!(sent.len(), 1);
    assert_eq!((sent[0].destination, sent[0].next_hop), (mote(9).link_local(), Some(mote(9))));
    let RplMessage::Dio(dio) = &sent[0].message else { panic!("{sent:?}") };
    assert!(dio.configuration.is_some(), "RFC 6550, § 8.3");
    assert_eq!(root.events(), []);
}

#[test]
fn r10_a_solicitation_of_everyone_only_resets_trickle() {
    let mut root = Bench::new(Config::default(), 0, true);
    root.pass(100 * SimDuration::SECOND);
    root.events();
    root.receive(9, true, &RplMessage::Dis(DisRepr {}));
    assert_eq!(root.sent(), []);
    assert_eq!(root.events(), [Event::TrickleReset]);
    let mut outside = Bench::mote(Config::default());
    outside.sent();
    outside.receive(8, false, &RplMessage::Dis(DisRepr {}));
    assert_eq!(outside.sent(), []);
}

#[test]
fn r11_a_diamond_in_steps() {
    // Motes 0 (root), 1 and 2, and 3 below both: links 0-1 and 1-3 are perfect, those over 2 have an ETX of 3. The peer's
    // function knows the true delivery ratio of all links; here it is measured.
    let mut one = Bench::new(Config::default(), 1, false);
    let mut two = Bench::new(Config::default(), 2, false);
    let mut three = Bench::new(Config::default(), 3, false);
    one.hear(0, &dio_of(0, 256));
    two.hear(0, &dio_of(0, 256));
    for _ in 0..60 {
        one.link(0, 1, true);
        two.link(0, 3, true);
    }
    assert_eq!((one.rpl.rank(), two.rpl.rank()), (512, 2048));
    let (dio_1, dio_2) = (dio_of(0, 512), dio_of(0, 2048));
    three.hear(2, &dio_2);
    assert_eq!(three.rpl.parent(), Some(mote(2)));
    three.hear(1, &dio_1);
    assert_eq!(three.rpl.parent(), Some(mote(1)), "1536 less");
    for _ in 0..60 {
        three.link(1, 1, true);
    }
    assert_eq!(three.rpl.rank(), 768);
    // No loop: 3 is further from the root than 1, so it is no parent for it.
    one.hear(3, &dio_of(0, 768));
    assert_eq!(one.rpl.parent(), Some(mote(0)));
    // The link 1-3 fails for good: 2 is not nearer to the root than 3 had been, so 3 leaves, tells, and comes back.
    three.link(1, 10, false);
    assert_eq!(three.rpl.parent(), None);
    three.hear(2, &dio_2);
    assert_eq!(three.rpl.parent(), None, "2 may have been below");
    three.pass(17 * SimDuration::SECOND);
    assert_eq!(three.rpl.parent(), Some(mote(2)));
    assert_eq!(three.rpl.rank(), 2048 + 1792);
    // Both links are gone, then the good one is back.
    three.link(2, 10, false);
    assert_eq!(three.rpl.parent(), None);
    three.pass(120 * SimDuration::SECOND);
    three.hear(1, &dio_1);
    assert_eq!(three.rpl.parent(), Some(mote(1)));
}

/// A DAO as a mote of a non-storing DODAG with root 0 sends it.
pub(super) fn dao_of(child: u32, parent: u32, path_sequence: u8, path_lifetime: u8) -> DaoRepr {
    DaoRepr {
        instance: 0,
        ack_request: false,
        sequence: path_sequence,
        targets: vec![mote(child).global()],
        path_sequence,
        path_lifetime,
        parent: Some(mote(parent).global()),
    }
}
