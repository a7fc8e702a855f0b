//! Parents by beacons.

use super::*;
use proto::time::SimDuration;

fn moving() -> Config {
    let handover = Handover { least_mdbm: Some(-65_000), ahead: 2 * SimDuration::SECOND };
    Config {
        handover: Some(handover),
        initial_etx_x128: 128,
        dao_ack: false,
        neighbour_lifetime: 6 * SimDuration::SECOND,
        repair_hold: 2 * SimDuration::SECOND,
        ..Config::default()
    }
}

/// A beacon of a neighbour so many hops from the root.
fn beacon(bench: &mut Bench, from: u32, join_metric: u8, rssi_dbm: f64) {
    let now = bench.now;
    bench.rpl.handle_rank(mote(from), join_metric, rssi_dbm, now, &mut bench.dice);
}

#[test]
fn a_neighbour_whose_beacon_is_nearer_to_the_root_becomes_the_parent_at_once() {
    let mut bench = Bench::mote(moving());
    bench.hear(1, &dio_of(0, 768));
    assert_eq!((bench.rpl.parent(), bench.rpl.rank()), (Some(mote(1)), 1024));
    beacon(&mut bench, 2, 1, -50.0);
    assert_eq!((bench.rpl.parent(), bench.rpl.rank()), (Some(mote(2)), 768));
    // An equal one is no reason to change, however strong.
    beacon(&mut bench, 3, 1, -30.0);
    assert_eq!(bench.rpl.parent(), Some(mote(2)));
    assert!(bench.rpl.is_nearer(1) && !bench.rpl.is_nearer(2) && !bench.rpl.is_nearer(255));
}

#[test]
fn a_parent_that_fades_is_left_before_it_is_gone_and_one_that_comes_nearer_is_not() {
    for (step_db, parent) in [(-1.0, 3), (1.0, 2)] {
        let mut bench = Bench::mote(moving());
        bench.hear(1, &dio_of(0, 768));
        for second in 0..5 {
            beacon(&mut bench, 2, 1, -60.0 + step_db * f64::from(second));
            beacon(&mut bench, 3, 1, -58.0);
            bench.pass(SimDuration::SECOND);
        }
        assert_eq!(bench.rpl.parent(), Some(mote(parent)), "{step_db}");
    }
}

#[test]
fn a_fading_parent_is_kept_where_there_is_no_other() {
    let mut bench = Bench::mote(moving());
    bench.hear(1, &dio_of(0, 768));
    for _ in 0..3 {
        beacon(&mut bench, 2, 1, -80.0);
        bench.pass(SimDuration::SECOND);
    }
    // Two hops and one for the strength: as far as through the other, which is stronger.
    assert!(bench.rpl.parent().is_some());
    bench.pass(8 * SimDuration::SECOND);
    beacon(&mut bench, 2, 1, -80.0);
    assert_eq!(bench.rpl.parent(), Some(mote(2)));
}

#[test]
fn of_two_ways_that_are_as_long_with_what_fading_costs_the_one_that_holds_is_taken() {
    let mut bench = Bench::mote(moving());
    bench.hear(1, &dio_of(0, 768));
    beacon(&mut bench, 2, 0, -50.0);
    assert_eq!(bench.rpl.parent(), Some(mote(2)));
    for _ in 0..3 {
        beacon(&mut bench, 2, 0, -80.0);
        beacon(&mut bench, 3, 1, -50.0);
        bench.pass(SimDuration::SECOND);
    }
    assert_eq!(bench.rpl.parent(), Some(mote(3)));
}

#[test]
fn a_neighbour_that_says_that_it_has_no_way_is_no_parent() {
    let mut bench = Bench::mote(moving());
    bench.hear(1, &dio_of(0, 768));
    beacon(&mut bench, 1, 255, -50.0);
    assert_eq!(bench.rpl.parent(), None);
    beacon(&mut bench, 4, 3, -50.0);
    bench.pass(3 * SimDuration::SECOND);
    beacon(&mut bench, 4, 3, -50.0);
    assert_eq!(bench.rpl.parent(), Some(mote(4)));
}

#[test]
fn without_the_option_a_beacon_is_no_dio() {
    let mut bench = Bench::mote(Config { handover: None, ..moving() });
    bench.hear(1, &dio_of(0, 768));
    beacon(&mut bench, 2, 0, -50.0);
    assert_eq!(bench.rpl.parent(), Some(mote(1)));
}

#[test]
fn advertisements_of_a_mote_that_changes_its_parent_often_keep_their_distance() {
    let interval = 10 * SimDuration::SECOND;
    let mut bench = Bench::mote(Config { dao_interval: interval, ..moving() });
    bench.hear(1, &dio_of(0, 768));
    let mut n_daos = 0;
    for second in 0..60_u32 {
        // Two neighbours in turn are the nearer one.
        let (near, far) = if second % 2 == 0 { (2, 3) } else { (3, 2) };
        beacon(&mut bench, near, 0, -50.0);
        beacon(&mut bench, far, 2, -50.0);
        let sent = bench.pass(SimDuration::SECOND);
        n_daos += sent.iter().filter(|one| matches!(one.message, RplMessage::Dao(_))).count();
    }
    assert!((5..=7).contains(&n_daos), "{n_daos}");
}
