//! Kinds of traffic against what a static schedule makes of them, computed by hand.

use super::bench::{Bench, EAGER, EXACT, Ended, LINE, OnAir, SLOT_NS, What, line, own_cells};
use physics::asn::Asn;
use proto::time::{SimDuration, SimTime};
use proto::types::MoteOrder;
use std::collections::BTreeSet;

/// Slots of the slotframe, and in which of them the root and the mote send to each other.
const SLOTS: u64 = 101;
const ROOT_SENDS: u64 = 10;
const MOTE_SENDS: u64 = 50;
/// Either end sends one message of the join protocol, which comes first.
const N_JOIN: usize = 1;

/// A root and a mote beside it, without losses.
fn two(app: &str) -> Bench {
    let sf = "[sf]\nkind = \"static\"\nslotframe_slots = 101\n\
              [[sf.cell]]\nslot = 0\nfrom = 0\nto = \"all\"\nadvertising = true\n\
              [[sf.cell]]\nslot = 1\nfrom = 1\nto = \"all\"\nadvertising = true\n\
              [[sf.cell]]\nslot = 10\nfrom = 0\nto = 1\n\
              [[sf.cell]]\nslot = 50\nfrom = 1\nto = 0\n";
    Bench::new(&line(2), &format!("{LINE}{EAGER}{EXACT}{sf}{app}"))
}

/// The first slot from `asn` on that is this one in the slotframe, and in which the mote sent nothing but CoAP: a frame of routing or
/// a keep-alive goes first.
fn next(bench: &Bench, asn: Asn, mote: u32, sends: u64) -> Asn {
    let others = bench.sent(mote, |what| *what != What::Udp(5683));
    let taken: BTreeSet<Asn> = others.iter().map(|frame| frame.asn).collect();
    (asn.0..)
        .map(Asn)
        .find(|&asn| asn % SLOTS == sends && !taken.contains(&asn))
        .expect("a slot that is free")
}

/// Frames of a mote with CoAP messages of applications.
fn coap_frames(bench: &Bench, mote: u32) -> Vec<OnAir> {
    bench.sent(mote, |what| *what == What::Udp(5683)).split_off(N_JOIN)
}

fn of_kind<'a>(bench: &'a Bench, kind: &'a str) -> impl Iterator<Item = &'a Ended> {
    bench.ended.iter().filter(move |ended| ended.kind == kind)
}

#[test]
fn the_round_trip_of_an_exchange_is_that_of_its_cells() {
    let mut bench = two("[[app]]\nkind = \"coap\"\nperiod_s = 7.77\nresponse_bytes = 20\n");
    bench.form();
    bench.run(40_000);
    let exchanges: Vec<Ended> = of_kind(&bench, "exchange").cloned().collect();
    assert!(40 < exchanges.len());
    let mut n_undisturbed = 0;
    for exchange in &exchanges {
        assert_eq!((exchange.source, exchange.destination), (0, 1));
        assert_eq!((exchange.lost.as_deref(), exchange.hops), (None, 1));
        let created_asn = exchange.created_ns / SLOT_NS;
        let request_asn = next(&bench, Asn(created_asn), 0, ROOT_SENDS);
        let response_asn = next(&bench, Asn((request_asn + 1).0), 1, MOTE_SENDS);
        assert_eq!(Asn(exchange.ended_ns / SLOT_NS), response_asn, "{exchange:?}");
        // In closed form: (10 − c) mod 101 slots to the root's cell, then 40 to the mote's, unless another frame goes first.
        let in_cells = (ROOT_SENDS + SLOTS - created_asn % SLOTS) % SLOTS + MOTE_SENDS - ROOT_SENDS;
        n_undisturbed += usize::from(response_asn - created_asn == Asn(in_cells));
        // IEEE Std 802.15.4-2015: 2.12 ms into the slot, and 32 µs for each of 6 bytes and of the frame's: 21 of the MAC header,
        // 2 of the FCS; 1 + 3 of the page and RPL's packet information (rank: a byte), 2 + 16 … of IPHC, UDP and CoAP behind.
        let air_ns = exchange.ended_ns % SLOT_NS - 2_120_000;
        assert_eq!(air_ns % 32_000, 0);
        assert!((60..=100).contains(&(air_ns / 32_000 - 6)), "{air_ns}");
    }
    assert!(9 * exchanges.len() / 10 < n_undisturbed, "{n_undisturbed} of {}", exchanges.len());
    // One every 777 slots, except while there was no route yet.
    for pair in exchanges.windows(2) {
        assert_eq!(pair[1].created_ns - pair[0].created_ns, 777 * SLOT_NS);
    }
    let frames = |mote| coap_frames(&bench, mote).len();
    assert!(exchanges.len() <= frames(0) && frames(0) <= exchanges.len() + 1);
    // Both messages of an exchange are application packets too.
    let n_open = frames(0) - exchanges.len();
    let n_packets = of_kind(&bench, "app").count();
    assert!((2 * exchanges.len()..=2 * exchanges.len() + n_open).contains(&n_packets));
}

#[test]
fn a_download_takes_an_exchange_per_block_and_stop_and_wait_bounds_its_time() {
    let mut bench =
        two("[[app]]\nkind = \"download\"\nsize_bytes = 1000\nblock_bytes = 64\nafter_s = 1.0\n");
    bench.run_until(101, 100_000, |bench| of_kind(bench, "download").count() == 1);
    let download = of_kind(&bench, "download").next().unwrap().clone();
    assert_eq!((download.source, download.destination, download.lost), (0, 1, None));
    // 16 = ⌈1000/64⌉ requests, and the answer to the trigger; 16 blocks, and the trigger.
    let frames = |mote| coap_frames(&bench, mote);
    assert_eq!([frames(0).len(), frames(1).len()], [17, 17]);
    // Request by request and block by block, each in the first cell after the one before.
    let mut asn = frames(1)[0].asn;
    assert!(asn * SimDuration::from_ns(SLOT_NS) > SimTime::from_ns(download.created_ns));
    for (request, block) in frames(1)[1..].iter().zip(&frames(0)[1..]) {
        assert_eq!(request.asn, next(&bench, asn + 1, 1, MOTE_SENDS));
        assert_eq!(block.asn, next(&bench, request.asn + 1, 0, ROOT_SENDS));
        asn = block.asn;
    }
    assert_eq!(Asn(download.ended_ns / SLOT_NS), asn);
    // In closed form: a slotframe for the answer to the trigger, which goes first, and one for each block, unless another frame of
    // either goes first.
    let others = |mote, sends| {
        let within = |frame: &&OnAir| {
            frame.asn % SLOTS == sends
                && (download.created_ns..download.ended_ns)
                    .contains(&(frame.asn * SimDuration::from_ns(SLOT_NS)).ns())
        };
        let others = bench.sent(mote, |what| *what != What::Udp(5683));
        others.iter().filter(within).count() as u64
    };
    let n_others = others(0, ROOT_SENDS) + others(1, MOTE_SENDS);
    let took_slots = (download.ended_ns - download.created_ns) / SLOT_NS;
    let bounds = 17 * SLOTS..=(17 + n_others) * SLOTS;
    assert!(bounds.contains(&took_slots), "{took_slots} {n_others}");
    let sum = |value: fn(&netsim::app::Counters) -> u64| -> u64 {
        bench
            .mesh
            .state()
            .motes
            .iter()
            .flat_map(|mote| &mote.apps)
            .map(|app| value(&app.counters()))
            .sum()
    };
    assert_eq!([sum(|sent| sent.blocks), sum(|sent| sent.block_retransmissions)], [16, 0]);
}

/// The root reboots while the mote downloads: there is one download, which the mote ends, and the root triggers nobody again. The
/// same if the mote reboots.
#[test]
fn a_download_in_which_an_end_reboots_is_one_download() {
    for mote in [0, 1] {
        let mut bench = two("[[app]]\nkind = \"download\"\nsize_bytes = 3000\nblock_bytes = 64\n");
        let blocks = |bench: &Bench| {
            let motes = bench.mesh.state().motes.iter();
            motes.flat_map(|mote| &mote.apps).map(|app| app.counters().blocks).sum::<u64>()
        };
        bench.run_until(101, 100_000, |bench| 20 <= blocks(bench));
        bench.order(MoteOrder::Kill(mote));
        bench.run(1010);
        bench.order(MoteOrder::Revive(mote));
        bench.run(100_000);
        let downloads: Vec<&Ended> = of_kind(&bench, "download").collect();
        let [download] = downloads[..] else { panic!("{downloads:?}") };
        assert!(download.created_ns < download.ended_ns);
        let counts = bench.mesh.state().packets.created(proto::types::PacketPurpose::Download);
        assert_eq!(counts, 1);
    }
}

/// RFC 7252, 4.2: requests to a mote that is off set out 0, t, 3t, 7t and 15t after the first, and the exchange fails after 31t,
/// 2 s ≤ t ≤ 3 s. Each timeout ends with the slot in which it passes.
#[test]
fn requests_to_a_mote_that_is_off_back_off_and_are_given_up() {
    let mut bench = two("[[app]]\nkind = \"coap\"\nservers = 1\nperiod_s = 100.0\n");
    bench.form();
    bench.run_until(101, 100_000, |bench| of_kind(bench, "exchange").next().is_some());
    bench.order(MoteOrder::Kill(1));
    bench.run_until(101, 100_000, |bench| {
        of_kind(bench, "exchange").any(|exchange| exchange.lost.is_some())
    });
    let failed = of_kind(&bench, "exchange").last().unwrap();
    assert_eq!(failed.lost.as_deref(), Some("max_retries"));
    let requests = of_kind(&bench, "app").filter(|ended| failed.created_ns <= ended.created_ns);
    let mut sent_asn: Vec<u64> = requests.map(|ended| ended.created_ns / SLOT_NS).collect();
    sent_asn.sort_unstable();
    let first_asn = sent_asn[0];
    let after: Vec<u64> = sent_asn.iter().map(|asn| asn - first_asn).collect();
    let ended = failed.ended_ns / SLOT_NS - first_asn;
    let t = after[1];
    assert!((200..=301).contains(&t), "{after:?}");
    for (slots, n) in after.iter().copied().chain([ended]).zip([0, 1, 3, 7, 15, 31]) {
        assert!(slots.abs_diff(n * t) <= n, "{after:?} {ended}");
    }
    assert_eq!(after.len(), 5);
}

/// With k cells per slotframe in either direction, in turn, each pair of cells carries a request and its block: k blocks of b bytes
/// per slotframe of T. A download of N blocks takes N T/k, and its goodput is k b/T, but for the frames of others that go first.
#[test]
fn the_goodput_of_a_download_is_the_cells_of_a_slotframe_times_the_block() {
    let secured = "[security]\n";
    for (n_cells, security) in [(1_u64, ""), (2, ""), (10, ""), (1, secured), (5, secured)] {
        let mut sf = "[sf]\nkind = \"static\"\nslotframe_slots = 101\n\
                      [[sf.cell]]\nslot = 99\nfrom = 0\nto = \"all\"\nadvertising = true\n\
                      [[sf.cell]]\nslot = 100\nfrom = 1\nto = \"all\"\nadvertising = true\n"
            .to_owned();
        for k in 0..n_cells {
            let slot = 2 + 9 * k;
            sf += &format!("[[sf.cell]]\nslot = {slot}\nfrom = 1\nto = 0\n");
            sf += &format!("[[sf.cell]]\nslot = {}\nfrom = 0\nto = 1\n", slot + 4);
        }
        // Frames of 64 bytes and headers fit into one cell.
        let app =
            "[[app]]\nkind = \"download\"\nsize_bytes = 20000\nblock_bytes = 64\ntargets = [1]\n";
        let mut bench = Bench::new(&line(2), &format!("{LINE}{EAGER}{EXACT}{sf}{app}{security}"));
        bench.run_until(101, 200_000, |bench| of_kind(bench, "download").count() == 1);
        let download = of_kind(&bench, "download").next().unwrap();
        assert_eq!((download.lost.as_deref(), download.hops), (None, 1));
        let took_slots = (download.ended_ns - download.created_ns) as f64 / SLOT_NS as f64;
        let n_blocks = 20_000_u64.div_ceil(64);
        let expected_slots = (n_blocks * SLOTS) as f64 / n_cells as f64;
        // The trigger's answer goes first; a keep-alive or a message of routing takes a pair of cells now and then.
        let ratio = took_slots / expected_slots;
        assert!(
            (0.995..1.03).contains(&ratio),
            "{n_cells} cells: {took_slots} of {expected_slots}"
        );
    }
}

#[test]
fn motes_within_the_radius_report_an_event_wherever_they_are_then() {
    let cells = own_cells(4, &[(1, 0), (2, 1), (3, 2)]);
    let app = "[[app]]\nkind = \"event\"\nat_s = [2000, 2100]\nplace_m = [20, 5]\nradius_m = 11.5\nn_packets = 3\n\
               spacing_s = 2.0\n";
    let config = format!("{LINE}{EAGER}{EXACT}[rpl]\nmax_rank_increase = 0\n{cells}{app}");
    let mut bench = Bench::new(&line(4), &config);
    bench.form();
    assert!(bench.asn < Asn(200_000), "formed before the first event");
    bench.run_to(Asn(205_000));
    // At 11.18 m, 5 m and 11.18 m of it: motes 1, 2 and 3, three packets each.
    let created = |bench: &Bench, of: u32| {
        let of_it = of_kind(bench, "app").filter(|ended| ended.source == of);
        of_it.map(|ended| ended.created_ns / SLOT_NS).collect::<Vec<_>>()
    };
    for mote in 1..4 {
        assert_eq!(created(&bench, mote), [200_000, 200_200, 200_400], "{mote}");
    }
    // Then mote 3 is 14.9 m away.
    bench.states.x_m[3] = 34.0;
    bench.run_to(Asn(215_000));
    for (mote, n) in [(1, 6), (2, 6), (3, 3)] {
        assert_eq!(created(&bench, mote).len(), n, "{mote}");
    }
    assert!(of_kind(&bench, "app").all(|ended| ended.lost.is_none()));
}

/// A warning is never false: with a queue that is warned of, nothing arrives. With one frame more, all do, where the datagram has no
/// headers of routing but RPL's packet information, for which its last frame has room.
#[test]
fn packets_of_more_frames_than_the_queue_holds_never_arrive() {
    for (queue_frames, arrives) in [(10, false), (11, true)] {
        let app = "[[app]]\nkind = \"burst\"\nat_s = 5.0\npayload_bytes = 1000\n";
        let queue = format!("queue_frames = {queue_frames}\n");
        let sf = "[sf]\nkind = \"minimal\"\nslotframe_slots = 11\n";
        let config = format!("{LINE}{EAGER}{EXACT}{queue}{sf}{app}");
        let setup = super::bench::set_up(2, &config, 1);
        let (.., warnings) =
            netsim::config::read(&setup, netsim::catalogue::Catalogue::built_in()).unwrap();
        assert_eq!(warnings.is_empty(), arrives, "{warnings:?}");
        let mut bench = Bench::new(&line(2), &config);
        bench.run_until(101, 200_000, |bench| of_kind(bench, "app").count() == 1);
        let packet = of_kind(&bench, "app").next().unwrap();
        let lost = (!arrives).then_some("txqueue_full");
        assert_eq!(packet.lost.as_deref(), lost);
    }
}

#[test]
fn exchanges_need_ways_down_and_two_ends() {
    let problems = |keys: &str| {
        let setup = super::bench::set_up(3, keys, 1);
        let problems = netsim::config::read(&setup, netsim::catalogue::Catalogue::built_in());
        crate::harness::text(&problems.map(|_| ()).unwrap_err())
    };
    assert_eq!(
        problems("rpl.routes_down = false\n[[app]]\nkind = \"coap\"\n"),
        "netsim.app[0].kind: needs routes from the root to motes: set netsim.rpl.routes_down = true"
    );
    assert_eq!(
        problems("[[app]]\nkind = \"download\"\ntargets = [1, 0]\n"),
        "netsim.app[0].targets[1]: must not be the first root, which is the other end of the exchange, got 0 (nearest valid: 2)"
    );
    assert_eq!(
        problems("[[app]]\nkind = \"coap\"\nservers = 0\n"),
        "netsim.app[0].servers: must not be the first root, which is the other end of the exchange, got 0 (nearest valid: 1)"
    );
    assert_eq!(
        problems("[[app]]\nkind = \"download\"\ntargets = [2, 2]\n"),
        "netsim.app[0].targets[1]: must not be listed twice, got 2 (nearest valid: 1)"
    );
    // There is no other mote.
    assert_eq!(
        problems("[[app]]\nkind = \"download\"\ntargets = [2, 1, 2]\n"),
        "netsim.app[0].targets[2]: must not be listed twice, got 2"
    );
    assert_eq!(
        problems("sf.kind = \"oracle\"\n[[app]]\nkind = \"coap\"\n"),
        "netsim.app[0].kind: needs another netsim.sf.kind than \"oracle\", which carries one-way packets only"
    );
}
