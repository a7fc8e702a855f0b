//! Clauses of RFC 6550, 6206 and 6552 that need a whole machine.

use super::vectors::dao_of;
use super::*;
use crate::wire::rpl::DodagConfiguration;
use proto::time::{SimDuration, SimTime};

/// A mote 9 below mote 1 with rank 768, which it has advertised; timers of its DODAG run.
pub(super) fn joined(config: Config) -> Bench {
    let mut bench = Bench::mote(config);
    bench.hear(1, &dio_of(0, 512));
    assert_eq!(dio_ranks(&bench.pass(17 * SimDuration::SECOND)), [768]);
    bench.events();
    bench
}

/// The same with a storing DODAG.
pub(super) fn joined_storing(config: Config) -> Bench {
    let mut bench = Bench::mote(config);
    bench.hear(1, &DioRepr { mode: 2, ..dio_of(0, 512) });
    bench
}

pub(super) fn storing_dao(target: u32, path_sequence: u8, path_lifetime: u8) -> DaoRepr {
    DaoRepr { parent: None, ack_request: true, ..dao_of(target, 0, path_sequence, path_lifetime) }
}

/// Waits for the next interval of Trickle, and returns what was sent until then.
fn to_next_interval(bench: &mut Bench) -> Vec<Outgoing> {
    let interval = bench.rpl.trickle.interval();
    let mut sent = vec![];
    while bench.rpl.trickle.interval() == interval {
        sent.extend(bench.pass(SimDuration::SECOND));
    }
    sent
}

#[test]
fn q19_rfc6550_8_3_dios_from_above_that_change_nothing_suppress_ones_own() {
    for (no_trickle_suppression, n_heard, n_sent) in [(false, 2, 1), (false, 3, 0), (true, 3, 1)] {
        let mut bench = joined(Config { no_trickle_suppression, ..Bench::perfect() });
        to_next_interval(&mut bench);
        for _ in 0..n_heard {
            bench.hear(1, &dio_of(0, 512));
        }
        assert_eq!(dio_ranks(&to_next_interval(&mut bench)).len(), n_sent, "{n_heard}");
    }
}

#[test]
fn q19_the_peer_puts_its_dio_off_with_every_one_it_hears() {
    for no_trickle_suppression in [false, true] {
        let mut bench = joined(Config { no_trickle_suppression, ..Bench::perfect() });
        to_next_interval(&mut bench);
        let mut sent = vec![];
        for _ in 0..20 {
            // From beside, within half the shortest interval of the one before.
            bench.hear(2, &dio_of(0, 768));
            sent.extend(bench.pass(4 * SimDuration::SECOND));
        }
        assert_eq!(dio_ranks(&sent).is_empty(), no_trickle_suppression);
    }
}

#[test]
fn rfc6550_8_3_dios_from_below_or_beside_do_not_suppress() {
    let mut bench = joined(Bench::perfect());
    to_next_interval(&mut bench);
    for from in 2..20 {
        bench.hear(from, &dio_of(0, 768));
        bench.hear(from, &dio_of(0, 1024));
    }
    assert_eq!(dio_ranks(&to_next_interval(&mut bench)).len(), 1);
}

#[test]
fn rfc6550_8_3_a_rank_that_rises_by_a_hop_is_told_at_once() {
    let mut bench = joined(Bench::perfect());
    to_next_interval(&mut bench);
    bench.events();
    bench.hear(1, &dio_of(0, 767));
    assert_eq!(bench.events(), [Event::RankChanged]);
    bench.hear(1, &dio_of(0, 768));
    assert_eq!(bench.events(), [Event::RankChanged, Event::TrickleReset]);
}

#[test]
fn rfc6550_8_2_1_motes_no_nearer_to_the_root_are_no_parents() {
    let mut bench = joined(Bench::perfect());
    for (from, rank) in [(2, 768), (3, 800), (4, 1023), (5, 1024)] {
        bench.hear(from, &dio_of(0, rank));
    }
    assert_eq!(bench.rpl.parent_set(bench.now), [mote(1)]);
    bench.hear(6, &dio_of(0, 767));
    assert_eq!(bench.rpl.parent_set(bench.now), [mote(1), mote(6)]);
}

#[test]
fn rfc8180_6_4_q24_of_two_equal_parents_the_stronger_one_is_better() {
    let mut bench = joined(Bench::perfect());
    bench.hear(2, &dio_of(0, 600));
    bench.hear(3, &dio_of(0, 600));
    bench.rpl.handle_rssi(mote(2), -85.0, bench.now);
    bench.rpl.handle_rssi(mote(3), -70.0, bench.now);
    bench.rpl.handle_unusable(mote(1), bench.now, &mut bench.dice);
    assert_eq!(bench.rpl.parent(), Some(mote(3)));
}

#[test]
fn rfc6550_6_7_6_the_roots_configuration_is_adopted() {
    let mut bench = Bench::mote(Bench::perfect());
    let dio = dio_of(0, 512);
    let configuration = DodagConfiguration {
        dio_interval_min: 10,
        min_hop_rank_increase: 128,
        objective: 1,
        ..dio.configuration.unwrap()
    };
    bench.hear(1, &DioRepr { configuration: Some(configuration), ..dio });
    // MRHOF: ETX 1 is 128, and so is the least rise.
    assert_eq!(bench.rpl.rank(), 640);
    assert_eq!(bench.rpl.dag_rank(), 5);
    assert_eq!(bench.rpl.trickle.interval(), Some(SimDuration::from_ns(1_024_000_000)));
}

#[test]
fn rfc6550_8_5_a_leaf_offers_nothing_and_answers_with_infinite_rank() {
    let unknown = DodagConfiguration { objective: 77, ..dio_of(0, 0).configuration.unwrap() };
    for (is_leaf, dio) in [
        (true, dio_of(0, 512)),
        (false, DioRepr { configuration: Some(unknown), ..dio_of(0, 512) }),
        (false, DioRepr { mode: 3, ..dio_of(0, 512) }),
    ] {
        let mut bench = Bench::mote(Config { is_leaf, ..Bench::perfect() });
        bench.hear(1, &dio);
        assert_eq!(bench.rpl.parent(), Some(mote(1)));
        let sent = bench.pass(3600 * SimDuration::SECOND);
        assert!(dio_ranks(&sent).is_empty());
        bench.hear(1, &dio);
        bench.receive(5, true, &RplMessage::Dis(DisRepr {}));
        assert!(dio_ranks(&bench.pass(100 * SimDuration::SECOND)).is_empty());
        bench.receive(5, false, &RplMessage::Dis(DisRepr {}));
        assert_eq!(dio_ranks(&bench.sent()), [INFINITE_RANK]);
    }
}

#[test]
fn rfc6550_8_2_2_2_a_newer_version_is_joined_and_an_older_one_is_not() {
    let mut bench = joined(Bench::perfect());
    let version = |version, rank| DioRepr { version, ..dio_of(0, rank) };
    bench.hear(2, &version(239, 256));
    assert_eq!(bench.rpl.parent(), Some(mote(1)));
    bench.hear(2, &version(241, 2000));
    assert_eq!((bench.rpl.parent(), bench.rpl.version()), (Some(mote(2)), Some(241)));
    assert_eq!(bench.rpl.rank(), 2256);
    bench.hear(1, &version(240, 256));
    assert_eq!(bench.rpl.parent(), Some(mote(2)));
}

#[test]
fn rfc6550_8_2_2_4_the_bound_on_rank_ends_with_the_version() {
    let mut bench = joined(Bench::perfect());
    let far = DioRepr { version: 241, ..dio_of(0, 9000) };
    bench.hear(1, &far);
    assert_eq!(bench.rpl.rank(), 9256);
}

#[test]
fn rfc6550_8_2_2_4_the_bound_on_rank_holds_over_a_time_outside() {
    let mut bench = joined(Bench::perfect());
    let now = bench.now;
    bench.rpl.handle_unusable(mote(1), now, &mut bench.dice);
    assert!(!bench.rpl.is_in_dodag());
    bench.pass(20 * SimDuration::SECOND);
    bench.hear(2, &dio_of(0, 768 + 7168 - 255));
    assert!(!bench.rpl.is_in_dodag(), "beyond L + DAGMaxRankIncrease");
    bench.hear(3, &dio_of(0, 768 + 7168 - 256));
    assert_eq!(bench.rpl.parent(), Some(mote(3)));
    assert_eq!(bench.rpl.dodag.as_ref().unwrap().lowest_rank, 768);
    bench.rpl.handle_unusable(mote(3), bench.now, &mut bench.dice);
    bench.pass(301 * SimDuration::SECOND);
    bench.hear(2, &dio_of(0, 768 + 7168 - 255));
    assert_eq!(bench.rpl.parent(), Some(mote(2)), "forgotten, as by a restart");
}

#[test]
fn rfc6550_8_2_2_5_a_mote_that_leaves_poisons_and_repeats_it_for_neighbours_that_missed_it() {
    let mut bench = joined(Bench::perfect());
    bench.hear(2, &dio_of(0, 1024));
    bench.sent();
    bench.hear(1, &dio_of(0, INFINITE_RANK));
    assert_eq!(dio_ranks(&bench.sent()), [INFINITE_RANK]);
    assert_eq!(
        bench.events(),
        [
            Event::ParentChanged { old: Some(mote(1)), new: None },
            Event::Detached,
            Event::LocalRepair
        ]
    );
    bench.hear(2, &dio_of(0, 1024));
    assert_eq!(bench.rpl.parent(), None, "it may be below");
    assert_eq!(dio_ranks(&bench.sent()), [INFINITE_RANK]);
    // A mote that was nearer to the root is safe at once.
    bench.hear(3, &dio_of(0, 600));
    assert_eq!(bench.rpl.parent(), Some(mote(3)));
    assert_eq!(bench.rpl.trickle.interval(), Some(SimDuration::from_ns(16_384_000_000)));
}

#[test]
fn a_dodag_of_higher_preference_is_joined_and_rank_decides_between_equal_ones() {
    let mut bench = joined(Bench::perfect());
    bench.hear(2, &DioRepr { preference: 0, ..dio_of(7, 256) });
    assert_eq!(bench.rpl.dodag_id(), Some(mote(0).global()), "256 better: within the hysteresis");
    bench.hear(3, &DioRepr { preference: 1, ..dio_of(8, 5000) });
    assert_eq!(bench.rpl.dodag_id(), Some(mote(8).global()));
    assert!(bench.events().contains(&Event::Joined { dodag: mote(8).global() }));
    bench.hear(1, &dio_of(0, 256));
    assert_eq!(bench.rpl.dodag_id(), Some(mote(8).global()));
}

#[test]
fn other_instances_are_ignored() {
    let mut bench = Bench::mote(Bench::perfect());
    bench.hear(1, &DioRepr { instance: 1, ..dio_of(0, 256) });
    assert!(bench.rpl.neighbours().is_empty());
}

#[test]
fn a_neighbour_of_whom_nothing_is_heard_is_forgotten() {
    let lifetime = Config::default().neighbour_lifetime;
    let mut bench = joined(Bench::perfect());
    bench.hear(2, &dio_of(0, 500));
    while bench.now < SimTime::START + 3 * lifetime {
        bench.pass(60 * SimDuration::SECOND);
        bench.rpl.handle_rssi(mote(2), -70.0, bench.now);
    }
    let known: Vec<Eui64> = bench.rpl.neighbours().iter().map(|one| one.address).collect();
    assert_eq!(known, [mote(2)]);
    assert_eq!(bench.rpl.parent(), Some(mote(2)));
}

#[test]
fn of_too_many_neighbours_the_worst_gives_way_but_never_the_parent() {
    let mut bench = Bench::mote(Config { max_neighbours: 3, ..Bench::perfect() });
    bench.hear(1, &dio_of(0, 512));
    for (from, rank) in [(2, 900), (3, 700), (4, 600), (5, 1200)] {
        bench.hear(from, &dio_of(0, rank));
    }
    bench.hear(1, &dio_of(0, 1300));
    let known: Vec<Eui64> = bench.rpl.neighbours().iter().map(|one| one.address).collect();
    assert_eq!(known, [mote(1), mote(3), mote(4)]);
}

#[test]
fn an_unusable_neighbour_gets_another_chance_and_each_time_later() {
    let mut bench = joined(Bench::perfect());
    for hold_s in [60, 120, 240] {
        bench.rpl.handle_unusable(mote(1), bench.now, &mut bench.dice);
        bench.pass((hold_s - 1) * SimDuration::SECOND);
        bench.hear(1, &dio_of(0, 512));
        assert_eq!(bench.rpl.parent(), None, "{hold_s}");
        bench.pass(2 * SimDuration::SECOND);
        bench.hear(1, &dio_of(0, 512));
        assert_eq!(bench.rpl.parent(), Some(mote(1)), "{hold_s}");
    }
}

#[test]
fn rfc9033_12_a_neighbour_in_quarantine_is_no_parent_until_that_ends() {
    let mut bench = joined(Bench::perfect());
    for _ in 0..2 {
        let until = bench.now + 300 * SimDuration::SECOND;
        bench.rpl.handle_quarantine(mote(1), until, bench.now, &mut bench.dice);
        for (wait_s, parent) in [(61, None), (238, None), (2, Some(mote(1)))] {
            bench.pass(wait_s * SimDuration::SECOND);
            bench.hear(1, &dio_of(0, 512));
            assert_eq!(bench.rpl.parent(), parent, "{wait_s}");
        }
    }
}

#[test]
fn q21_rfc6550_9_5_the_first_dao_follows_the_join_and_is_repeated_until_acknowledged() {
    let config =
        Config { dao_ack_wait: 10 * SimDuration::SECOND, dao_max_retries: 3, ..Bench::perfect() };
    let mut bench = Bench::mote(config);
    bench.hear(1, &dio_of(0, 512));
    let sent = bench.pass(2 * SimDuration::SECOND);
    let first = daos(&sent);
    assert_eq!(first.len(), 1);
    let (destination, dao) = &first[0];
    assert_eq!(*destination, mote(0).global());
    assert_eq!(dao.targets, [mote(9).global()]);
    assert_eq!(dao.parent, Some(mote(1).global()));
    assert!(dao.ack_request);
    // Waits of 10, 20 and 40 s.
    assert_eq!(daos(&bench.pass(30 * SimDuration::SECOND)), [first[0].clone(), first[0].clone()]);
    bench.receive(1, false, &ack(dao.sequence, 0));
    assert_eq!(daos(&bench.pass(120 * SimDuration::SECOND)), []);
}

#[test]
fn a_dao_that_is_never_acknowledged_is_tried_anew_later() {
    let config =
        Config { dao_ack_wait: SimDuration::SECOND, dao_max_retries: 2, ..Bench::perfect() };
    let mut bench = Bench::mote(config);
    bench.hear(1, &dio_of(0, 512));
    let sequences: Vec<u8> =
        daos(&bench.pass(30 * SimDuration::SECOND)).iter().map(|(_, dao)| dao.sequence).collect();
    assert_eq!(sequences[..4], [241, 241, 241, 242]);
}

#[test]
fn routes_are_refreshed_at_about_half_of_their_lifetime() {
    let mut bench = Bench::mote(Config { dao_ack: false, ..Bench::perfect() });
    bench.hear(1, &dio_of(0, 512));
    bench.pass(2 * SimDuration::SECOND);
    for n in 1..=10u8 {
        let mut waited_s = 0;
        let dao = loop {
            bench.rpl.handle_rssi(mote(1), -60.0, bench.now);
            waited_s += 10;
            if let Some((_, dao)) = daos(&bench.pass(10 * SimDuration::SECOND)).pop() {
                break dao;
            }
        };
        assert!((710..=1090).contains(&waited_s), "{waited_s}");
        assert_eq!((dao.path_lifetime, dao.path_sequence), (30, 241 + n));
    }
}

#[test]
fn a_route_that_was_acknowledged_is_refreshed_without_asking_again() {
    let mut bench = Bench::mote(Bench::perfect());
    bench.hear(1, &dio_of(0, 512));
    let first = daos(&bench.pass(2 * SimDuration::SECOND));
    assert!(first[0].1.ack_request);
    bench.receive(1, false, &ack(first[0].1.sequence, 0));
    let mut refresh = || loop {
        bench.rpl.handle_rssi(mote(1), -60.0, bench.now);
        if let Some((_, dao)) = daos(&bench.pass(10 * SimDuration::SECOND)).pop() {
            break dao;
        }
    };
    assert!(!refresh().ack_request);
    assert!(!refresh().ack_request);
    // Another parent is news.
    bench.hear(2, &dio_of(0, 256));
    bench.link(1, 10, false);
    assert_eq!(bench.rpl.parent(), Some(mote(2)));
    assert!(daos(&bench.pass(2 * SimDuration::SECOND))[0].1.ack_request);
}

#[test]
fn rfc6550_9_6_a_newer_dtsn_of_the_parent_asks_for_a_dao_and_goes_on_below() {
    let mut bench = joined(Config { dao_ack: false, ..Bench::perfect() });
    bench.hear(1, &DioRepr { dtsn: 241, ..dio_of(0, 512) });
    let sent = bench.pass(17 * SimDuration::SECOND);
    assert_eq!(daos(&sent).len(), 1);
    let RplMessage::Dio(dio) = &sent.last().unwrap().message else { panic!("{sent:?}") };
    assert_eq!(dio.dtsn, 241);
    bench.hear(1, &DioRepr { dtsn: 241, ..dio_of(0, 512) });
    assert_eq!(daos(&bench.pass(17 * SimDuration::SECOND)), []);
}

#[test]
fn rfc6550_9_3_the_root_acknowledges_to_the_source() {
    let mut root = Bench::new(Config::default(), 0, true);
    let dao = DaoRepr { ack_request: true, ..dao_of(3, 2, 240, 30) };
    let source = mote(3).global();
    let message = RplMessage::Dao(dao);
    root.rpl.handle_message(mote(1), source, false, &message, SimTime::START, &mut root.dice);
    let sent = root.sent();
    assert_eq!(sent.len(), 1);
    assert_eq!((sent[0].destination, sent[0].next_hop), (source, None));
    assert_eq!(sent[0].message, ack(240, 0));
    assert_eq!(root.rpl.routes().len(), 1);
}

#[test]
fn rfc6550_9_8_a_storing_router_keeps_routes_acknowledges_and_passes_them_on() {
    let mut bench = joined_storing(Config { dao_ack: false, ..Bench::perfect() });
    bench.pass(2 * SimDuration::SECOND);
    bench.events();
    bench.receive(20, false, &RplMessage::Dao(storing_dao(20, 240, 30)));
    bench.receive(20, false, &RplMessage::Dao(storing_dao(21, 240, 30)));
    assert_eq!(bench.events(), [Event::ChildAdded(mote(20))]);
    let sent = bench.sent();
    let up = daos(&sent);
    assert_eq!(up.len(), 2);
    assert!(up.iter().all(|(to, dao)| *to == mote(1).link_local() && dao.parent.is_none()));
    assert_eq!(up[1].1.targets, [mote(21).global()]);
    assert_eq!((up[1].1.path_sequence, up[1].1.path_lifetime), (240, 30));
    let is_ack = |one: &&Outgoing| matches!(one.message, RplMessage::DaoAck(_));
    assert_eq!(sent.iter().filter(is_ack).count(), 2);
    assert_eq!(bench.rpl.route(mote(21).global()), Some(Route::Down(mote(20))));
    assert_eq!(bench.rpl.route(mote(30).global()), Some(Route::Up(mote(1))));
    // The same word again is no news.
    bench.receive(20, false, &RplMessage::Dao(storing_dao(21, 240, 30)));
    assert_eq!(daos(&bench.sent()), []);
}

#[test]
fn rfc6550_9_2_2_a_storing_mote_that_changes_parent_tells_the_new_one_then_the_old_one() {
    let mut bench = joined_storing(Config { dao_ack: false, ..Bench::perfect() });
    bench.pass(2 * SimDuration::SECOND);
    bench.receive(20, false, &RplMessage::Dao(storing_dao(20, 100, 30)));
    bench.sent();
    bench.hear(2, &DioRepr { mode: 2, ..dio_of(0, 500) });
    bench.rpl.handle_unusable(mote(1), bench.now, &mut bench.dice);
    assert_eq!(bench.rpl.parent(), Some(mote(2)));
    let sent = daos(&bench.pass(2 * SimDuration::SECOND));
    let told: Vec<_> = (sent.iter())
        .map(|(to, dao)| (Eui64::of_ip(*to), dao.targets[0], dao.path_sequence, dao.path_lifetime))
        .collect();
    let (own, child) = (mote(9).global(), mote(20).global());
    assert_eq!(
        told,
        [
            (mote(2), child, 100, 30),
            (mote(2), own, 242, 30),
            (mote(1), child, 100, 0),
            (mote(1), own, 241, 0)
        ]
    );
}

#[test]
fn rfc6550_9_2_2_a_no_path_removes_the_route_and_goes_on_up() {
    let mut bench = joined_storing(Config { dao_ack: false, ..Bench::perfect() });
    bench.pass(2 * SimDuration::SECOND);
    bench.receive(20, false, &RplMessage::Dao(storing_dao(20, 240, 30)));
    bench.sent();
    bench.events();
    bench.receive(20, false, &RplMessage::Dao(storing_dao(20, 240, 0)));
    assert_eq!(bench.events(), [Event::ChildRemoved(mote(20))]);
    let up = daos(&bench.sent());
    assert_eq!((up.len(), up[0].1.path_lifetime), (1, 0));
    assert_eq!(bench.rpl.route(mote(20).global()), Some(Route::Up(mote(1))));
}

#[test]
fn rfc6550_9_3_a_rejected_dao_sends_a_storing_mote_elsewhere_and_a_full_router_rejects() {
    let mut bench = joined_storing(Config { max_routes: 1, ..Bench::perfect() });
    let dao = daos(&bench.pass(2 * SimDuration::SECOND)).remove(0).1;
    bench.receive(20, false, &RplMessage::Dao(storing_dao(20, 240, 30)));
    bench.receive(21, false, &RplMessage::Dao(storing_dao(21, 240, 30)));
    let statuses: Vec<u8> = (bench.sent().iter())
        .filter_map(|one| match &one.message {
            RplMessage::DaoAck(ack) => Some(ack.status),
            _ => None,
        })
        .collect();
    assert_eq!(statuses, [0, 128]);
    bench.hear(2, &DioRepr { mode: 2, ..dio_of(0, 512) });
    bench.receive(1, false, &ack(dao.sequence, 130));
    assert_eq!(bench.rpl.parent(), Some(mote(2)));
}

#[test]
fn q20_a_storing_router_forgets_routes_that_were_not_refreshed() {
    let mut bench = joined_storing(Config { dao_ack: false, ..Bench::perfect() });
    bench.receive(20, false, &RplMessage::Dao(storing_dao(20, 240, 5)));
    for _ in 0..31 {
        bench.pass(10 * SimDuration::SECOND);
        bench.rpl.handle_rssi(mote(1), -60.0, bench.now);
    }
    assert!(bench.rpl.routes().is_empty());
}

#[test]
fn rfc6550_7_2_a_root_whose_dodag_is_known_in_a_newer_version_goes_on_from_there() {
    let mut root = Bench::new(Config::default(), 0, true);
    root.hear(1, &DioRepr { version: 245, ..dio_of(0, 512) });
    assert_eq!(root.rpl.version(), Some(246));
}

#[test]
fn the_whole_state_survives_a_snapshot() {
    let mut bench = joined_storing(Bench::perfect());
    bench.pass(60 * SimDuration::SECOND);
    bench.receive(20, false, &RplMessage::Dao(storing_dao(20, 240, 30)));
    bench.rpl.handle_rssi(mote(1), -71.5, bench.now);
    let bytes = postcard::to_allocvec(&bench.rpl).unwrap();
    let restored: Rpl = postcard::from_bytes(&bytes).unwrap();
    assert_eq!(restored, bench.rpl);
}

#[test]
fn stopped_it_is_silent_and_forgets() {
    let mut bench = joined(Bench::perfect());
    bench.rpl.stop();
    assert_eq!(bench.rpl.poll_timeout(), None);
    bench.hear(1, &dio_of(0, 256));
    assert!(!bench.rpl.is_in_dodag());
    assert!(bench.rpl.neighbours().is_empty());
    assert_eq!(bench.sent(), []);
    let old = Some(mote(1));
    assert_eq!(bench.events(), [Event::ParentChanged { old, new: None }, Event::Detached]);
}
