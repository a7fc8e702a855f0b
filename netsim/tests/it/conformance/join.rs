//! J1, J2: admission in a network.

use super::bench::{Bench, EAGER, FULL, LINE, OnAir, SLOT_NS, What, line, trace};
use physics::asn::Asn;
use proto::time::SimDuration;
use proto::types::MoteOrder;

/// CoAP's port.
fn is_join(what: &What) -> bool {
    *what == What::Udp(5683)
}

/// The root is heard and hears nothing.
fn unheard() -> Bench {
    let cells = "[sf]\nkind = \"static\"\nslotframe_slots = 10\nminimal_cell_slots = 10\n\
        [[sf.cell]]\nslot = 3\nfrom = 1\nto = 0\n";
    Bench::over_trace(2, trace(2, &[(0, 0, 1, 1.0)]), &format!("{EAGER}{cells}"))
}

#[test]
fn j2_unanswered_requests_are_repeated_after_t0_times_1_2_4_8_16() {
    let mut bench = unheard();
    bench.run_until(101, 200_000, |bench| bench.mote(1).mac.is_synced());
    let synced_asn = Asn(bench.mote(1).tally.first_synced.unwrap() / SimDuration::from_ns(SLOT_NS));
    bench.run_until(10, 60_000, |bench| bench.mote(1).mac.is_scanning());
    let left_asn = bench.asn;
    let mut requests: Vec<OnAir> = bench.sent(1, is_join);
    // Each of them in six attempts with one sequence number.
    assert_eq!(requests.len(), 5 * 6);
    requests.dedup_by_key(|request| request.sequence);
    let at: Vec<Asn> = requests.iter().map(|request| request.asn).collect();
    assert_eq!(at.len(), 5);
    assert!(at[0] - synced_asn <= 10, "at once");
    let t0 = at[1] - at[0];
    assert!((1000 - 10..=1500 + 10).contains(&t0), "{t0} slots");
    // Each request waits for its cell, one slotframe of ten slots at most; the end is looked for every ten slots.
    for (k, pair) in at.windows(2).enumerate() {
        let expected = t0 << k;
        assert!((pair[1] - pair[0]).abs_diff(expected) <= 10 + (10 << k), "{k}: {at:?}");
    }
    let last = left_asn - at[4];
    assert!(last.abs_diff(t0 << 4) <= 20 + (10 << 4), "{last} {t0}");
}

#[test]
fn j1_a_mote_that_is_not_admitted_looks_for_a_network_again_and_one_that_was_leaves_it() {
    let mut bench = unheard();
    bench.run_until(101, 200_000, |bench| bench.mote(1).mac.is_synced());
    bench.run_until(101, 60_000, |bench| bench.mote(1).mac.is_scanning());
    assert!(!bench.mote(1).joined);
    assert_eq!(bench.mote(1).tally.first_joined, None, "it never was");

    let mut bench = Bench::new(&line(2), &format!("{FULL}{EAGER}"));
    bench.form();
    assert!(bench.mote(1).joined && bench.mote(1).tally.first_joined.is_some());
    bench.order(MoteOrder::Kill(0));
    bench.run_until(101, 3_000, |bench| bench.mote(1).mac.is_scanning());
    assert!(!bench.mote(1).joined && !bench.mote(1).rpl.is_in_dodag());
}

#[test]
fn j1_a_request_passes_a_proxy_that_has_joined_and_comes_back_to_the_pledge() {
    let mut bench = Bench::new(&line(3), &format!("{LINE}{EAGER}"));
    bench.form();
    let ways: Vec<(u32, Option<u32>)> = bench
        .frames
        .iter()
        .filter(|frame| is_join(&frame.what))
        .map(|frame| (frame.source, frame.destination))
        .collect();
    for way in [(2, Some(1)), (1, Some(0)), (0, Some(1)), (1, Some(2))] {
        assert!(ways.contains(&way), "{way:?} in {ways:?}");
    }
}

#[test]
fn requests_and_responses_are_packets_from_pledge_to_registrar_and_back() {
    let mut bench = Bench::new(&line(3), &format!("{LINE}{EAGER}"));
    bench.form();
    let ways: Vec<(u32, u32, u32)> = (bench.ended_joins.iter())
        .filter(|ended| ended.lost.is_none())
        .map(|ended| (ended.source, ended.destination, ended.hops))
        .collect();
    for way in [(1, 0, 1), (0, 1, 1), (2, 0, 2), (0, 2, 2)] {
        assert!(ways.contains(&way), "{way:?} in {ways:?}");
    }
}

#[test]
fn rfc9031_8_4_2_requests_beyond_the_join_rate_are_drops_with_that_reason() {
    let mut bench = Bench::new(&line(3), &format!("{LINE}{EAGER}[join]\nrate_bytes_s = 0\n"));
    let is_refused = |bench: &Bench| {
        let mut ended = bench.ended_joins.iter().filter(|ended| ended.source == 2);
        ended.any(|ended| ended.lost.as_deref() == Some("join_rate_exceeded"))
    };
    bench.run_until(101, 300_000, is_refused);
    assert!(bench.mote(1).joined && !bench.mote(2).joined);
    // The root is no proxy: it answers whom it hears.
    let arrived =
        |from| bench.ended_joins.iter().any(|ended| ended.source == from && ended.lost.is_none());
    assert!(arrived(1) && !arrived(2));
}
