//! T11, T12, T19: synchronisation, its loss, and clocks.

use super::bench::{
    Bench, EAGER, FULL, LINE, NO_KEEP_ALIVES, SLOT_NS, What, line, own_cells, settings,
};
use netsim::mac::Schedule;
use netsim::mac::tsch::{Config, Due, State, Tsch, channel_of};
use netsim::wire::Eui64;
use physics::asn::Asn;
use proto::ids::MoteId;
use proto::time::{SimDuration, SimTime};
use proto::types::MoteOrder;
use std::collections::BTreeSet;

/// How many beacons mote `mote` has heard while scanning, and when it will choose among them.
fn heard(bench: &Bench, mote: usize) -> (usize, Option<SimTime>) {
    match bench.mote(mote).mac.state() {
        State::Scanning { heard, decide } => (heard.len(), *decide),
        State::Off | State::Synced { .. } => (0, None),
    }
}

#[test]
fn t11_a_single_neighbour_is_followed_after_18000_slots() {
    let config = format!("{FULL}[mac]\nbeacon_period_s = 1.0\nbeacon_spacing_s = 0.0\n");
    let mut bench = Bench::new(&line(2), &config);
    bench.run_until(1, 100_000, |bench| heard(bench, 1).0 == 1);
    let heard_asn = bench.asn - 1;
    assert_eq!(bench.frames.last().unwrap().asn, heard_asn);
    bench.run_to(heard_asn + 18_000);
    assert!(bench.mote(1).mac.is_scanning(), "after slot +17999");
    bench.run(1);
    assert!(bench.mote(1).mac.is_synced(), "in slot +18000");
    assert_eq!(
        bench.mote(1).tally.first_synced,
        Some((heard_asn + 18_000) * SimDuration::from_ns(SLOT_NS))
    );
}

#[test]
fn t11_a_second_neighbour_ends_the_wait_at_once() {
    let mac = "[mac]\nbeacon_period_s = 1.0\nbeacon_spacing_s = 0.0\n";
    // Slots of their own: the beacons of the two roots never meet.
    let cells = own_cells(3, &[(0, 1)]);
    let mut bench = Bench::new(&line(3), &format!("roots = [0, 1]\n{FULL}{mac}{cells}"));
    bench.run_until(1, 100_000, |bench| heard(bench, 2).0 == 1);
    let (_, decide) = heard(&bench, 2);
    bench.run_until(1, 17_900, |bench| bench.mote(2).mac.is_synced());
    let synced = bench.mote(2).tally.first_synced.unwrap();
    assert!(synced < decide.unwrap());
    assert_eq!(
        bench.frames.last().unwrap().asn,
        Asn(synced / SimDuration::from_ns(SLOT_NS)),
        "in the slot of a beacon"
    );
}

#[test]
fn t11_the_lower_join_metric_wins_and_lists_are_emptied() {
    let config = settings("").mac;
    for metrics in [[100, 1], [1, 100]] {
        let mut mac = Tsch::new(&config, Eui64::of_mote(MoteId(9)), MoteId(9), false, 1);
        mac.scan(&config);
        assert_eq!(
            mac.handle_beacon(&config, Eui64::of_mote(MoteId(3)), metrics[0], SimTime::START),
            None
        );
        // The same neighbour again is no second one.
        assert_eq!(
            mac.handle_beacon(&config, Eui64::of_mote(MoteId(3)), metrics[0], SimTime::from_ns(5)),
            None
        );
        let best = if metrics[0] == 1 { 3 } else { 4 };
        let choice =
            mac.handle_beacon(&config, Eui64::of_mote(MoteId(4)), metrics[1], SimTime::from_ns(9));
        assert_eq!(choice, Some(Eui64::of_mote(MoteId(best))));
        assert_eq!(*mac.state(), State::Scanning { heard: Vec::new(), decide: None });
    }
}

#[test]
fn t12_a_source_that_is_not_heard_is_lost_after_1750_slots() {
    // Keep-alives beyond the end of the run.
    let mut config = settings("").mac;
    config.keep_alive = SimDuration::from_ns(1_000_000 * SLOT_NS);
    let mut mac = Tsch::new(&config, Eui64::of_mote(MoteId(1)), MoteId(1), false, 1);
    mac.synchronise(&config, Eui64::of_mote(MoteId(0)), 0, SimTime::START);
    assert_eq!(mac.poll_timeout(&config), Some(SimTime::from_ns(1750 * SLOT_NS)));
    assert_eq!(mac.handle_timeout(&config, SimTime::from_ns(1750 * SLOT_NS - 1)), None);
    assert_eq!(
        mac.handle_timeout(&config, SimTime::from_ns(1750 * SLOT_NS)),
        Some(Due::Desynchronised)
    );
}

#[test]
fn t12_a_mote_without_a_way_to_the_root_keeps_nobodys_time_and_looks_for_a_network_again() {
    let config = settings("").mac;
    let mut mac = Tsch::new(&config, Eui64::of_mote(MoteId(1)), MoteId(1), false, 1);
    mac.synchronise(&config, Eui64::of_mote(MoteId(0)), 0, SimTime::START);
    mac.lose_time_source(&config);
    assert_eq!(mac.poll_timeout(&config), Some(SimTime::START + config.desynchronise));
    assert_eq!(
        mac.handle_timeout(
            &config,
            SimTime::START + config.desynchronise - SimDuration::from_ns(1)
        ),
        None
    );
    let mut found = mac.clone();
    found.set_time_source(&config, Eui64::of_mote(MoteId(2)), SimTime::from_ns(5_000_000_000));
    assert_eq!(found.time_source(), Some(Eui64::of_mote(MoteId(2))));
    assert_eq!(
        mac.handle_timeout(&config, SimTime::START + config.desynchronise),
        Some(Due::Desynchronised)
    );
    // The root keeps its own.
    let mut root = Tsch::new(&config, Eui64::of_mote(MoteId(0)), MoteId(0), true, 1);
    root.start_root(SimTime::START);
    root.lose_time_source(&config);
    assert_eq!(root.handle_timeout(&config, SimTime::START + 100 * config.desynchronise), None);
}

#[test]
fn a_mote_that_lost_its_time_follows_the_channels_of_beacons_for_as_long_as_its_clock_tells_the_slot()
 {
    let mut config = settings("").mac;
    (config.scans_hopping, config.max_drift_ppm) = (true, 40.0);
    let schedule = Schedule::new();
    let mut mac = Tsch::new(&config, Eui64::of_mote(MoteId(1)), MoteId(1), false, 1);
    let follows = |mac: &Tsch, slots: std::ops::Range<u64>| {
        let heard = |asn| mac.listening(&config, &schedule, 1, asn).unwrap().channel;
        slots.clone().filter(|&asn| heard(Asn(asn)) == channel_of(&config, Asn(asn), 0)).count()
    };
    mac.scan(&config);
    // One of sixteen channels, each for a second: some of ten thousand slots agree, far from all.
    assert!((300..1_200).contains(&follows(&mac, 0..10_000)), "{}", follows(&mac, 0..10_000));
    mac.synchronise(&config, Eui64::of_mote(MoteId(0)), 0, SimTime::from_ns(10_000 * SLOT_NS));
    mac.scan(&config);
    // Half a slot of 10 ms over twice 40 ppm: 62.5 s, or 6,250 slots.
    assert_eq!(follows(&mac, 10_000..16_250), 6_250);
    assert!(follows(&mac, 16_250..26_250) < 1_200);
    let config = Config { scans_hopping: false, ..config.clone() };
    mac.synchronise(&config, Eui64::of_mote(MoteId(0)), 0, SimTime::from_ns(10_000 * SLOT_NS));
    mac.scan(&config);
    let heard = |asn| mac.listening(&config, &schedule, 1, asn).unwrap().channel;
    assert!(
        10_000
            < (10_000..20_000)
                .filter(|&asn| heard(Asn(asn)) != channel_of(&config, Asn(asn), 0))
                .count()
                + 1_200
    );
}

#[test]
fn t12_a_keep_alive_that_comes_to_nothing_is_asked_for_again_before_time_is_lost() {
    let config = settings("").mac;
    let mut mac = Tsch::new(&config, Eui64::of_mote(MoteId(1)), MoteId(1), false, 1);
    mac.synchronise(&config, Eui64::of_mote(MoteId(0)), 0, SimTime::START);
    let mut asked = Vec::new();
    while let Some(at) = mac.poll_timeout(&config) {
        match mac.handle_timeout(&config, at) {
            Some(Due::KeepAlive(source)) => {
                assert_eq!(source, Eui64::of_mote(MoteId(0)));
                asked.push(at);
            }
            Some(Due::Desynchronised) => break,
            other => panic!("{other:?}"),
        }
    }
    // At random in the last quarter of 10 s, and then after half to all of a third of the rest.
    assert!((7_500_000_000..10_000_000_000).contains(&asked[0].ns()), "{asked:?}");
    assert!(3 <= asked.len(), "{asked:?}");
    let waits = asked.windows(2).map(|pair| pair[1] - pair[0]);
    assert!(waits.into_iter().all(|wait| (1_250_000_000..3_333_333_333).contains(&wait.ns())));
}

#[test]
fn t12_motes_that_hear_the_same_beacon_do_not_ask_in_the_same_slots() {
    let config = settings("").mac;
    let asks_in = |mote: u32| {
        let mut mac = Tsch::new(&config, Eui64::of_mote(MoteId(mote)), MoteId(mote), false, 1);
        mac.synchronise(&config, Eui64::of_mote(MoteId(0)), 0, SimTime::START);
        mac.poll_timeout(&config).unwrap() / SimDuration::from_ns(SLOT_NS)
    };
    let slots: BTreeSet<u64> = (1..=20).map(asks_in).collect();
    // Of 250 slots: 20 draws at random take less than 15 different ones in one of ten thousand seeds.
    assert!(15 <= slots.len(), "{slots:?}");
}

/// A mote that has heard mote 0, whose clock is right, every 5 s for so long.
fn heard_for(config: &Config, seconds: u64) -> Tsch {
    let source = Eui64::of_mote(MoteId(0));
    let mut mac = Tsch::new(config, Eui64::of_mote(MoteId(1)), MoteId(1), false, 1);
    mac.synchronise(config, source, 0, SimTime::START);
    for asn in (500..=seconds * 100).step_by(500) {
        mac.handle_frame(config, source, None, Some(asn as u8), Asn(asn), 0);
    }
    mac
}

#[test]
fn a_mote_that_has_learned_its_clock_does_without_its_source_for_longer_and_not_for_ever() {
    let s = 1_000_000_000;
    let config = settings("").mac;
    let mut mac = heard_for(&config, 200);
    let (mut asked, mut worst_ns) = (Vec::new(), 0);
    let lost = loop {
        let at = mac.poll_timeout(&config).unwrap();
        worst_ns = worst_ns.max(mac.deviation_ns(at).abs());
        match mac.handle_timeout(&config, at) {
            Some(Due::KeepAlive(_)) => asked.push(at),
            Some(Due::SourceLost(source)) => {
                assert_eq!(source, Eui64::of_mote(MoteId(0)));
                break at;
            }
            _ => {}
        }
    };
    // Three times 10 s and 17.5 s, whatever the clock; half of the guard time is not used up by then.
    assert!((222 * s + s / 2..=230 * s).contains(&asked[0].ns()), "{asked:?}");
    assert!(3 <= asked.len(), "{asked:?}");
    assert_eq!(lost, SimTime::from_ns(252 * s + s / 2));
    assert!(worst_ns < 550_000, "{worst_ns}");
    // It may be told to ask as often as before.
    let config = settings("[mac]\nmax_keep_alive_s = 10.0\n").mac;
    assert!(heard_for(&config, 200).poll_timeout(&config).unwrap() <= SimTime::from_ns(210 * s));
    // Without, all is as set, and the clock has left the guard time before another minute is over.
    let config = settings("[mac]\nadaptive_synchronization = false\nmax_drift_ppm = 100.0\n").mac;
    let mac = heard_for(&config, 200);
    assert!(mac.poll_timeout(&config).unwrap() <= SimTime::from_ns(210 * s));
    assert!(
        1_100_000 < mac.deviation_ns(SimTime::from_ns(260 * s)).abs(),
        "{}",
        mac.deviation_ns(SimTime::from_ns(260 * s))
    );
}

#[test]
fn a_mote_that_has_no_source_any_more_runs_free_as_long_as_its_clock_holds() {
    let config = settings("").mac;
    let s = 1_000_000_000;
    let mut mac = heard_for(&config, 400);
    mac.lose_time_source(&config);
    let lost = mac.poll_timeout(&config).unwrap();
    assert!((500 * s..=700 * s).contains(&lost.ns()), "{lost:?}");
    assert!(mac.deviation_ns(lost).abs() < 550_000, "{}", mac.deviation_ns(lost));
    // One that knows nothing of its clock looks for a network when it would have lost its source.
    let mut mac = heard_for(&config, 5);
    mac.lose_time_source(&config);
    assert_eq!(
        mac.poll_timeout(&config),
        Some(SimTime::from_ns(5 * s + config.desynchronise.ns()))
    );
}

#[test]
fn t12_a_mote_whose_source_dies_scans_1750_slots_after_it_last_heard_it() {
    // One that does not learn its clock; else as long as its clock holds, at most 300 s.
    for (learns, [least, most]) in [(false, [1750, 1750]), (true, [1750, 30_000])] {
        let learning = format!("adaptive_synchronization = {learns}\n");
        let mut bench = Bench::new(&line(2), &format!("{FULL}{EAGER}{learning}"));
        bench.form();
        bench.run(1000);
        bench.order(MoteOrder::Kill(0));
        bench.run(1);
        let State::Synced { heard, .. } = *bench.mote(1).mac.state() else {
            panic!("synchronised")
        };
        let heard_asn = heard / SimDuration::from_ns(SLOT_NS);
        bench.run_to(Asn(heard_asn + least));
        assert!(bench.mote(1).mac.is_synced());
        bench.run(1 + most - least);
        assert!(bench.mote(1).mac.is_scanning());
        assert!(!bench.mote(1).joined && bench.mote(1).schedule.slotframes().is_empty());
    }
}

#[test]
fn t12_keep_alives_or_beacons_keep_a_mote_synchronised() {
    // Beacons come every 100 s only, or every 5 s; none is lost.
    for (beacon_period_s, asks) in [(100, true), (5, false)] {
        let config = format!(
            "{FULL}[mac]\nneighbours_to_wait = 1\nbeacon_period_s = {beacon_period_s}\n\
             beacon_spacing_s = 0.0\n[rpl]\nroutes_down = false\n{}",
            own_cells(2, &[(0, 1)])
        );
        let mut bench = Bench::new(&line(2), &config);
        bench.run_until(101, 3_000_000, |bench| bench.mote(1).ready);
        bench.frames.clear();
        bench.run(60_000);
        assert_eq!(bench.mote(1).tally.n_desynchronised, 0);
        let n_asked = bench.sent(1, |what| *what == What::KeepAlive).len();
        // 600 s: one every 22.5 to 30 s if nothing else is heard, once the clock is known, and at first more often; none
        // between beacons 5 s apart, give or take a quarter.
        assert_eq!(asks, (18..=32).contains(&n_asked), "{n_asked}");
        assert_eq!(!asks, n_asked == 0, "{n_asked}");
    }
}

#[test]
fn t19_neighbours_stay_within_the_guard_time_and_ask_only_if_they_shall() {
    // The guard time less a tick at either end.
    let bound_ns = 1_110_000 - 2 * 1_000_000_000 / 32_768;
    let mut worst_ns = 0;
    for seed in 0..5 {
        let mut bench = Bench::seeded(&line(3), &format!("{LINE}{EAGER}"), seed);
        bench.form();
        bench.frames.clear();
        for _ in 0..400 {
            bench.run(25);
            let now = bench.asn * SimDuration::from_ns(SLOT_NS);
            let deviation_ns = |mote: usize| bench.mote(mote).mac.deviation_ns(now);
            for [one, other] in [[0, 1], [1, 2]] {
                worst_ns = worst_ns.max((deviation_ns(one) - deviation_ns(other)).abs());
            }
        }
        assert!((0..3).all(|mote| bench.mote(mote).tally.n_desynchronised == 0));
    }
    assert!((1000..bound_ns).contains(&worst_ns), "{worst_ns} ns");
    // Beacons every 16 s leave room for keep-alives of 10 s; without them nobody asks.
    for (keep_alives, asks) in [("", true), (NO_KEEP_ALIVES, false)] {
        let mac = format!("beacon_period_s = 16.0\n{keep_alives}");
        let config = format!("{LINE}[mac]\nneighbours_to_wait = 1\n{mac}");
        let mut bench = Bench::new(&line(3), &config);
        bench.form();
        bench.run(101 * 100);
        let n_asked = [1, 2].map(|mote| bench.sent(mote, |what| *what == What::KeepAlive).len());
        assert_eq!(asks, n_asked[0] + n_asked[1] != 0, "{n_asked:?}");
    }
}
