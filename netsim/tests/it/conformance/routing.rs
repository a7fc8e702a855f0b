//! R3, R4, R10, R11: ranks, solicitations and parents in whole networks.

use super::bench::{Bench, EAGER, LINE, NO_KEEP_ALIVES, OnAir, What, line, own_cells, trace};
use netsim::wire::rpl::RplMessage;
use physics::asn::Asn;

#[test]
fn r3_on_a_line_without_any_measurement_ranks_are_256_2048_3840() {
    // Nothing is ever acknowledged: no admission, no routes down, no keep-alives.
    let config = format!(
        "{LINE}{EAGER}{NO_KEEP_ALIVES}[join]\nsecure = false\n\
         [rpl]\nroutes_down = false\nsolicitation = \"multicast\"\n"
    );
    let mut bench = Bench::new(&line(3), &config);
    bench.form();
    bench.run(50_000);
    assert_eq!([0, 1, 2].map(|mote| bench.rank(mote)), [256, 2048, 3840]);
    assert!(bench.frames.iter().all(|frame| frame.destination.is_none()));
}

#[test]
fn r4_over_perfect_links_ranks_rise_by_256_with_msf() {
    let app = "[sf]\nkind = \"msf\"\n[[app]]\nkind = \"periodic\"\nperiod_s = 5.0\n";
    let mut bench = Bench::new(&line(5), &format!("{LINE}{EAGER}{app}"));
    bench.form();
    // 100 frames of each mote's own, 5 s apart, and those that come through it.
    bench.run(60_000);
    assert_eq!([0, 1, 2, 3, 4].map(|mote| bench.rank(mote)), [256, 512, 768, 1024, 1280]);
    assert_eq!([1, 2, 3, 4].map(|mote| bench.parent(mote)), [0, 1, 2, 3].map(Some));
}

fn is_dis(what: &What) -> bool {
    matches!(what, What::Rpl(RplMessage::Dis(_)))
}

fn is_dio(what: &What) -> bool {
    matches!(what, What::Rpl(RplMessage::Dio(_)))
}

/// Frames of the root and of mote 1 until it has a parent, and a little longer.
fn solicits(mode: &str) -> Bench {
    let rpl = format!("[rpl]\nroutes_down = false\nsolicitation = \"{mode}\"\n");
    let mut bench = Bench::new(&line(2), &format!("{LINE}{EAGER}{rpl}"));
    bench.form();
    bench.run(200);
    bench
}

#[test]
fn r10_a_solicitation_to_the_proxy_is_answered_to_the_asker_alone() {
    let bench = solicits("unicast");
    let [asked] = &bench.sent(1, is_dis)[..] else { panic!("{:?}", bench.sent(1, is_dis)) };
    assert_eq!(asked.destination, Some(0));
    let answers: Vec<OnAir> =
        bench.sent(0, is_dio).into_iter().filter(|dio| dio.destination == Some(1)).collect();
    assert_eq!(answers.len(), 1);
    assert!(asked.asn < answers[0].asn);
}

#[test]
fn r10_a_solicitation_to_everyone_brings_dios_to_everyone_soon() {
    let bench = solicits("multicast");
    let asked = bench.sent(1, is_dis);
    assert!(!asked.is_empty() && asked.iter().all(|dis| dis.destination.is_none()));
    let dios = bench.sent(0, is_dio);
    assert!(dios.iter().all(|dio| dio.destination.is_none()));
    // Trickle was reset: within the least interval, 16.384 s, and the slotframe after it.
    let next = dios.iter().find(|dio| asked[0].asn < dio.asn).unwrap();
    assert!(next.asn - asked[0].asn <= 1638 + 2 * 101, "{} {}", asked[0].asn, next.asn);
}

#[test]
fn r10_without_solicitation_nobody_asks() {
    let bench = solicits("off");
    assert_eq!(bench.sent(1, is_dis), []);
    assert!(bench.sent(0, is_dio).iter().all(|dio| dio.destination.is_none()));
}

#[test]
fn r11_in_a_diamond_the_better_side_is_kept_left_when_it_fails_and_taken_again() {
    // 0-1-3 is perfect; 0-2-3 loses two of five frames up, and is there from 1000 s on. 1-3 fails at 3000 s, then 2-3 as
    // well; from 8000 s on 1-3 is perfect again.
    let both = |at_s: u32, one: u32, other: u32, down: f64, up: f64| {
        [(at_s, one, other, down), (at_s, other, one, up)]
    };
    let rows = [
        both(0, 0, 1, 1.0, 1.0),
        both(0, 1, 3, 1.0, 1.0),
        both(0, 0, 2, 1.0, 0.6),
        both(0, 2, 3, 0.0, 0.0),
        both(1000, 2, 3, 1.0, 0.6),
        both(3000, 1, 3, 0.0, 0.0),
        both(6000, 2, 3, 0.0, 0.0),
        both(8000, 1, 3, 1.0, 1.0),
    ]
    .concat();
    let config = format!(
        "{EAGER}[rpl]\ndio_interval_doublings = 1\n[[app]]\nkind = \"periodic\"\nperiod_s = 10.0\n{}",
        own_cells(4, &[(0, 1), (0, 2), (1, 3), (2, 3)])
    );
    let mut bench = Bench::over_trace(4, trace(4, &rows), &config);
    let mut parents = Vec::new();
    while bench.asn < Asn(1_000_000) {
        bench.run(500);
        parents.push((bench.asn, bench.parent(3)));
        // Nobody is below itself.
        for mote in 1..4 {
            let mut way = vec![mote];
            while let Some(parent) = bench.parent(way[way.len() - 1]) {
                assert!(!way.contains(&(parent as usize)), "{}: {way:?} {parent}", bench.asn);
                way.push(parent as usize);
            }
        }
    }
    // How much of a time (s) mote 3 has had which parent.
    let share = |from_s: u64, until_s: u64, parent: Option<u32>| {
        let of = parents.iter().filter(|(asn, _)| (from_s * 100..until_s * 100).contains(&asn.0));
        let (n, n_with) =
            of.fold((0, 0), |(n, with), (_, of)| (n + 1, with + u32::from(*of == parent)));
        f64::from(n_with) / f64::from(n)
    };
    assert_eq!(share(800, 3000, Some(1)), 1.0, "the better side, alone and then with the other");
    // Ten failures in a row, one in ten thousand attempts, end even a link that is usable.
    assert!(0.8 < share(4000, 6000, Some(2)), "{parents:?}");
    assert_eq!(share(3500, 6000, Some(1)), 0.0);
    assert_eq!(share(6500, 8000, None), 1.0, "nobody is left");
    assert_eq!(share(9500, 10_000, Some(1)), 1.0, "it is back");
}
