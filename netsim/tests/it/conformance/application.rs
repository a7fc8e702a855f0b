//! KPI1, KPI2 and the end-to-end vector: packets of whole networks.

use super::bench::{Bench, EAGER, EXACT, FULL, LINE, SLOT_NS, What, line, own_cells};
use netsim::mac::CellOptions;
use netsim::rpl::routes::Via;
use netsim::sf::msf::NEGOTIATED;
use netsim::wire::Eui64;
use netsim::wire::rpl::RplMessage;
use proto::ids::MoteId;
use proto::time::SimDuration;
use proto::types::MoteOrder;

#[test]
fn kpi1_a_packet_from_the_end_of_a_line_of_ten_takes_nine_hops() {
    let links: Vec<(usize, usize)> = (1..10).map(|mote| (mote, mote - 1)).collect();
    // DAGMaxRankIncrease is off: nine links not yet measured are beyond its default.
    let config = format!("{LINE}{EAGER}[rpl]\nmax_rank_increase = 0\n{}", own_cells(10, &links));
    for fragmentation in ["forwarding", "per-hop"] {
        let lowpan = format!("[lowpan]\nfragmentation = \"{fragmentation}\"\n");
        for bytes in [90, 180] {
            let mut bench = Bench::new(&line(10), &format!("{config}{lowpan}"));
            bench.form();
            bench.send(9, 0, bytes);
            bench.run(2_000);
            let [ended] = &bench.ended[..] else { panic!("{:?}", bench.ended) };
            assert_eq!((ended.lost.as_deref(), ended.hops), (None, 9), "{fragmentation} {bytes}");
            assert!(ended.created_ns < ended.ended_ns);
            // A second one is lost on its way: the hops of the first are what they were.
            bench.order(MoteOrder::Kill(4));
            bench.send(9, 0, bytes);
            bench.run_until(101, 50_000, |bench| bench.ended.len() == 2);
            assert!(bench.ended[1].lost.is_some());
            assert_eq!(bench.ended[1].hops, 0);
        }
    }
}

#[test]
fn a_packet_that_goes_in_the_slot_it_was_made_in_arrives_when_its_frame_has_ended() {
    let config = format!("{LINE}{EAGER}{EXACT}{}", own_cells(2, &[(1, 0)]));
    let mut bench = Bench::new(&line(2), &config);
    bench.form();
    // Each slot of the slotframe in turn.
    for _ in 0..20 {
        bench.send(1, 0, 20);
        bench.run(101);
    }
    assert_eq!(bench.ended.len(), 20);
    let latencies_ns: Vec<u64> =
        bench.ended.iter().map(|ended| ended.ended_ns - ended.created_ns).collect();
    // 2.12 ms into the slot the frame begins: 32 µs for each of its 6 and 23 to 127 bytes.
    assert!(latencies_ns.iter().all(|ns| (3_048_000..=6_376_000).contains(&(ns % SLOT_NS))));
    assert!(latencies_ns.iter().any(|&ns| ns < SLOT_NS), "{latencies_ns:?}");
}

#[test]
fn kpi2_figures_before_anybody_keeps_time_are_unknown_or_nothing() {
    let mut bench = Bench::new(&line(3), FULL);
    bench.run(50);
    let statistics = bench.mesh.statistics(bench.asn * SimDuration::from_ns(10_000_000));
    for name in ["first_synced_ns", "first_joined_ns", "first_ready_ns"] {
        let column = statistics.column(name).unwrap();
        assert_eq!([1, 2].map(|mote| column.get(mote)), [None, None], "{name}");
    }
    let scanned = statistics.column("scan_slots").unwrap();
    assert_eq!([0, 1, 2].map(|mote| scanned.get(mote)), [0.0, 50.0, 50.0].map(Some));
    assert!(statistics.column("charge_uc").unwrap().values.iter().all(|charge| charge.is_finite()));
}

/// A line of three for 120,000 slots, with packets that need two frames.
fn end_to_end(sf: &str) -> Bench {
    let app = "[[app]]\nkind = \"periodic\"\nperiod_s = 60.0\npayload_bytes = 100\n";
    // Acknowledgments as in the vector: they always arrive.
    let compat = "[compat]\nperfect_acks = true\n";
    let config = format!("{LINE}{EAGER}[sf]\nkind = \"{sf}\"\n{app}{compat}");
    let mut bench = Bench::new(&line(3), &config);
    bench.run(120_000);
    // In one run of ten the shared cell has just cost a mote its synchronisation: it finds back.
    let address = |mote: u32| Eui64::of_mote(MoteId(mote)).global();
    let expected = [(address(1), Via::Parent(address(0))), (address(2), Via::Parent(address(1)))];
    bench.run_until(101, 60_000, |bench| {
        let root = &bench.mote(0).rpl;
        let routes = root.routes().iter().map(|(target, entry)| (*target, entry.via));
        (0..3).all(|mote| bench.mote(mote).ready) && routes.eq(expected)
    });
    for mote in 0..3 {
        let of = bench.mote(mote);
        assert!(of.mac.is_synced() && of.joined && of.ready, "{mote}");
        let has_sent = |which: &dyn Fn(&What) -> bool| !bench.sent(mote as u32, which).is_empty();
        assert!(has_sent(&|what| matches!(what, What::Beacon { .. })), "{mote}");
        assert!(has_sent(&|what| matches!(what, What::Rpl(RplMessage::Dio(_)))), "{mote}");
    }
    assert_eq!([1, 2].map(|mote| bench.parent(mote)), [0, 1].map(Some));
    bench
}

/// Packets that arrived, and those that did not.
fn arrived(bench: &Bench) -> (usize, usize) {
    let n = bench.ended.iter().filter(|ended| ended.lost.is_none()).count();
    (n, bench.ended.len() - n)
}

#[test]
fn end_to_end_three_motes_on_the_minimal_cell() {
    let bench = end_to_end("minimal");
    let (n_arrived, n_lost) = arrived(&bench);
    // Some 15 minutes of two motes; shared cells may lose a few.
    assert!(15 <= n_arrived && n_lost <= 3, "{n_arrived} {n_lost}");
}

#[test]
fn end_to_end_three_motes_with_msf_have_cells_of_their_own() {
    let bench = end_to_end("msf");
    for (mote, parent) in [(1, 0), (2, 1)] {
        let own = bench.cells(mote, NEGOTIATED).into_iter().any(|at| {
            at.cell.options == CellOptions::TX
                && at.cell.neighbour == Some(Eui64::of_mote(MoteId(parent)))
        });
        assert!(own, "{mote}");
    }
    let (n_arrived, n_lost) = arrived(&bench);
    assert!(15 <= n_arrived && n_lost <= 1, "{n_arrived} {n_lost}");
}
