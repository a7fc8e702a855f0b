//! T1 to T18: which frame goes in which cell, how often, and on which channel.

use super::bench::{Bench, EAGER, EXACT, FULL, LINE, OnAir, SLOT_NS, What, line, settings};
use netsim::mac::queue::{Priority, Queued};
use netsim::mac::tsch::{Done, Outgoing, Transmission, Tsch};
use netsim::mac::{Cell, CellKind, CellOptions, Schedule};
use netsim::wire::Eui64;
use netsim::wire::frame::{Content, FrameRepr};
use netsim::wire::security::FrameSecurity;
use physics::asn::Asn;
use proto::ids::MoteId;
use proto::time::{SimDuration, SimTime};
use proto::types::MoteOrder;

/// The minimal cell once in 101 slots, as the vectors have it.
const MINIMAL_101: &str = "[sf]\nkind = \"minimal\"\nslotframe_slots = 101\n";
/// Minimal cell in slot 0 of ten, then a cell of their own from 1 to 0 and back.
const OWN_CELLS: &str = "[sf]\nkind = \"static\"\nslotframe_slots = 10\nminimal_cell_slots = 10\n\
    [[sf.cell]]\nslot = 3\nfrom = 1\nto = 0\n[[sf.cell]]\nslot = 6\nfrom = 0\nto = 1\n";
/// Nothing is sent for routing's sake once it stands, and clocks are left alone.
const QUIET: &str = "keep_alive_s = 0.0\nmax_drift_ppm = 0.0\n[rpl]\nroutes_down = false\n";

fn swarm_data(what: &What) -> bool {
    matches!(what, What::Udp(0xf0b1))
}

#[test]
fn t1_the_minimal_cell_hops_over_all_sixteen_channels() {
    let channels = [16, 15, 12, 21, 26, 11, 20, 18, 19, 14, 23, 22, 24, 17, 25, 13];
    let config =
        format!("{FULL}{MINIMAL_101}[mac]\nbeacon_period_s = 0.5\nbeacon_spacing_s = 0.0\n");
    let mut bench = Bench::new(&line(2), &config);
    bench.run(101 * 64);
    assert!(48 < bench.frames.len(), "{}", bench.frames.len());
    for frame in &bench.frames {
        assert_eq!(frame.asn % 101, 0);
        assert_eq!(frame.channel, channels[(frame.asn / 101 % 16) as usize], "{frame:?}");
    }
    let mut seen: Vec<u8> = bench.frames.iter().map(|frame| frame.channel).collect();
    seen.sort_unstable();
    seen.dedup();
    assert_eq!(seen, (11..27).collect::<Vec<u8>>());
}

/// Two motes that have formed; then the root falls silent, and mote 1 sends it a packet. Its frames from then on.
fn sends_to_nobody(config: &str) -> (Bench, Vec<OnAir>) {
    let mut bench = Bench::new(&line(2), config);
    bench.form();
    bench.run(200);
    bench.frames.clear();
    bench.order(MoteOrder::Kill(0));
    bench.send(1, 0, 20);
    bench.run_until(1000, 2_000_000, |bench| !bench.ended.is_empty());
    let frames = bench.sent(1, swarm_data);
    assert_eq!(bench.ended[0].lost.as_deref(), Some("max_retries"));
    assert!(frames.iter().all(|frame| frame.sequence == frames[0].sequence && !frame.answered));
    (bench, frames)
}

#[test]
fn t4_over_a_dead_link_a_frame_is_sent_six_times_and_dropped() {
    let (_, frames) = sends_to_nobody(&format!("{FULL}{EAGER}{QUIET}{OWN_CELLS}"));
    assert_eq!(frames.len(), 6);
}

#[test]
fn t5_a_hundred_retries_wait_in_shared_cells_and_do_not_in_others() {
    let shared = OWN_CELLS.replace("to = 0\n", "to = 0\nshared = true\n");
    let minimal = "[sf]\nkind = \"minimal\"\nslotframe_slots = 10\n";
    for (cells, slot, is_shared) in [(OWN_CELLS, 3, false), (&shared, 3, true), (minimal, 0, true)]
    {
        let config = format!("{FULL}{EAGER}max_retries = 100\n{QUIET}{cells}");
        let (_, frames) = sends_to_nobody(&config);
        assert_eq!(frames.len(), 101, "{cells}");
        assert!(frames.iter().all(|frame| frame.asn % 10 == slot), "{cells}");
        let longest = frames.windows(2).map(|pair| pair[1].asn - pair[0].asn).max().unwrap();
        assert_eq!(longest == 10, !is_shared, "{longest}");
    }
}

#[test]
fn t7_the_join_metric_is_0_at_the_root_and_dag_rank_less_1_elsewhere() {
    let mut bench = Bench::new(&line(2), &format!("{FULL}{EAGER}{QUIET}"));
    bench.form();
    bench.run(20_000);
    // Over a link not yet measured: rank 2048, DAGRank 8.
    for (mote, metric) in [(0, 0), (1, 7)] {
        let beacons = bench.sent(mote, |what| matches!(what, What::Beacon { .. }));
        assert!(10 < beacons.len());
        assert!(beacons.iter().all(|beacon| beacon.what == What::Beacon { join_metric: metric }));
    }
}

#[test]
fn ieee802154_6_3_1_each_motes_beacons_are_numbered_one_after_the_other() {
    let mut bench = Bench::new(&line(3), &format!("{LINE}{EAGER}"));
    bench.form();
    bench.run(300_000);
    for mote in 0..3 {
        let beacons = bench.sent(mote, |what| matches!(what, What::Beacon { .. }));
        assert!(256 < beacons.len(), "{mote}: {}", beacons.len());
        for pair in beacons.windows(2) {
            assert_eq!(pair[1].sequence, pair[0].sequence.wrapping_add(1), "{mote}: {pair:?}");
        }
    }
}

#[test]
fn a_capture_says_when_frames_began_by_the_clock_of_whoever_sent_them() {
    let off_grid_ns = |drift: &str| {
        let mut bench = Bench::new(&line(3), &format!("{LINE}{EAGER}{drift}"));
        bench.form();
        bench.run(10_000);
        let mut of_mote = [(0, 0); 3];
        for frame in &bench.frames {
            let off_ns = frame.begins_ns as i64
                - (frame.asn * SimDuration::from_ns(SLOT_NS)).ns() as i64
                - 2_120_000;
            let (least, most) = &mut of_mote[frame.source as usize];
            (*least, *most) = (off_ns.min(*least), off_ns.max(*most));
        }
        assert!(bench.frames.is_sorted_by_key(|frame| frame.begins_ns));
        of_mote
    };
    assert_eq!(off_grid_ns(EXACT), [(0, 0); 3]);
    let [root, others @ ..] = off_grid_ns("");
    assert_eq!(root, (0, 0), "the root's clock is the true time");
    for (least, most) in others {
        // Within the guard time, and by more than a tick of a clock.
        assert!(-1_100_000 < least && most < 1_100_000, "{least} {most}");
        assert!(30_518 < most - least, "{least} {most}");
    }
}

#[test]
fn ieee802154_6_5_4_2_an_acknowledgment_says_how_much_later_the_frame_was_expected() {
    let mut bench = Bench::new(&line(3), &format!("{LINE}{EAGER}"));
    bench.form();
    bench.run(100_000);
    let to_root = bench.frames.iter().filter(|frame| frame.destination == Some(0));
    let mut checked = 0;
    for frame in to_root {
        let Some(correction_us) = frame.correction_us else { continue };
        // The root expects it when the slot says.
        let off_ns = frame.begins_ns as i64
            - (frame.asn * SimDuration::from_ns(SLOT_NS)).ns() as i64
            - 2_120_000;
        assert_eq!(i64::from(correction_us), -off_ns / 1000, "{frame:?}");
        checked += usize::from(correction_us != 0);
    }
    assert!(5 < checked, "{checked}");
}

#[test]
fn t8_beacons_keep_to_advertising_cells() {
    let cells = "[sf]\nkind = \"static\"\nslotframe_slots = 2\n\
        [[sf.cell]]\nslot = 0\nfrom = \"any\"\nto = \"all\"\nadvertising = true\n\
        [[sf.cell]]\nslot = 1\nfrom = \"any\"\nto = \"all\"\n";
    let config = format!("{FULL}[mac]\nbeacon_period_s = 0.1\nbeacon_spacing_s = 0.0\n{cells}");
    let mut bench = Bench::new(&line(3), &config.replace("[mac]", "[mac]\nneighbours_to_wait = 1"));
    bench.form();
    bench.run(10_000);
    let is_beacon = |frame: &&OnAir| matches!(frame.what, What::Beacon { .. });
    let beacons: Vec<&OnAir> = bench.frames.iter().filter(is_beacon).collect();
    assert!(1000 < beacons.len(), "{}", beacons.len());
    assert!(beacons.iter().all(|beacon| beacon.asn % 2 == 0));
    assert!(bench.frames.iter().any(|frame| frame.asn % 2 == 1), "other frames use the other cell");
}

#[test]
fn with_the_simulators_rule_a_mote_counts_the_neighbours_it_had_before_it_lost_the_network() {
    for is_on in [false, true] {
        let config = settings(&format!("{FULL}[compat]\neb_rule = {is_on}\n")).mac;
        let [root, other, own] = [0, 1, 2].map(MoteId).map(Eui64::of_mote);
        let mut mac = Tsch::new(&config, own, MoteId(2), false, 1);
        mac.synchronise(&config, root, 0, SimTime::START);
        for from in [root, other] {
            mac.handle_frame(&config, from, None, Some(1), Asn(1), 0);
        }
        assert_eq!(mac.neighbours().len(), 2);
        mac.scan(&config);
        assert_eq!(mac.neighbours().len(), if is_on { 2 } else { 0 });
    }
}

fn frame_to(neighbour: Eui64, packet: u64) -> Queued {
    Queued {
        frame: FrameRepr {
            source: Eui64::of_mote(MoteId(0)),
            destination: Some(neighbour),
            sequence: 0,
            ack_request: true,
            pending: false,
            security: FrameSecurity::Unsecured,
            slots: None,
            blacklist: None,
            content: Content::KeepAlive,
        },
        priority: Priority::Data,
        slotframe: None,
        is_latest_only: false,
        packet,
        psdu_bytes: 30,
        n_attempts: 0,
        number: 0,
        has_arrived: false,
    }
}

fn packet_of(outgoing: &Outgoing) -> u64 {
    match outgoing {
        Outgoing::Frame(queued) => queued.packet,
        Outgoing::Beacon => panic!("beacons are off"),
    }
}

#[test]
fn of_neighbours_that_ask_for_the_time_every_second_one_is_answered_with_a_beacon_to_all() {
    let config = settings("[mac]\nbeacon_period_s = 3600.0\n").mac;
    let mut mac = Tsch::new(&config, Eui64::of_mote(MoteId(0)), MoteId(0), true, 1);
    mac.start_root(SimTime::START);
    mac.enable_beacons(&config, true, SimTime::START);
    let mut schedule = Schedule::new();
    schedule.add_slotframe(0, 10);
    let cell = Cell::new(0, 0, CellOptions::TX_RX_SHARED, None).of_kind(CellKind::Advertising);
    schedule.add(0, cell).unwrap();
    let answered = [0, 10, 20, 30, 40, 50].map(|asn| {
        mac.handle_keep_alive(&config, Asn(asn) * config.slot);
        let sent = mac.poll_slot(&config, &schedule, Asn(asn));
        matches!(sent, Some(Transmission { outgoing: Outgoing::Beacon, .. }))
    });
    assert_eq!(answered, [false, true, false, true, false, true]);
}

#[test]
fn t9_a_frame_that_is_backed_off_stays_and_another_cell_of_the_slot_is_used() {
    let config = settings("").mac;
    let [one, two] = [1, 2].map(MoteId).map(Eui64::of_mote);
    let mut n_backed_off = 0;
    for order in [[one, two], [two, one]] {
        for seed in 0..20 {
            let mut mac = Tsch::new(&config, Eui64::of_mote(MoteId(0)), MoteId(0), true, seed);
            mac.start_root(SimTime::START);
            let mut schedule = Schedule::new();
            schedule.add_slotframe(1, 10);
            for neighbour in order {
                let cell = Cell::new(0, 0, CellOptions::TX_SHARED, Some(neighbour));
                schedule.add(1, cell).unwrap();
            }
            mac.enqueue(frame_to(two, 22)).unwrap();
            let first = mac.poll_slot(&config, &schedule, Asn(0)).unwrap();
            assert_eq!(packet_of(&first.outgoing), 22);
            let done = mac.handle_done(&config, first, false, 0, Asn(0));
            assert_eq!(done, Done::Retry { destination: two, dscp: 0 });
            // The first window is 0 or 1 cells: whoever is silent now has drawn 1.
            if mac.clone().poll_slot(&config, &schedule, Asn(10)).is_some() {
                continue;
            }
            n_backed_off += 1;
            mac.enqueue(frame_to(one, 11)).unwrap();
            let other = mac.poll_slot(&config, &schedule, Asn(10)).unwrap();
            assert_eq!(packet_of(&other.outgoing), 11);
            assert_eq!(other.at.unwrap().cell.neighbour, Some(one));
            let waiting: Vec<(u64, u16)> =
                mac.queue().iter().map(|queued| (queued.packet, queued.n_attempts)).collect();
            assert_eq!(waiting, [(22, 1)]);
            mac.handle_done(&config, other, true, 0, Asn(10));
            let later = (2..4).find_map(|k| mac.poll_slot(&config, &schedule, Asn(10 * k)));
            assert_eq!(packet_of(&later.unwrap().outgoing), 22);
        }
    }
    assert!(10 < n_backed_off, "about half of 40: {n_backed_off}");
}

/// IEEE Std 802.15.4-2015, 7.2.2: the sequence number has eight bits.
#[test]
fn a_frame_is_not_sent_again_once_its_number_would_stand_for_another() {
    let config = settings("").mac;
    let [one, two] = [1, 2].map(MoteId).map(Eui64::of_mote);
    let mut mac = Tsch::new(&config, Eui64::of_mote(MoteId(0)), MoteId(0), true, 1);
    mac.start_root(SimTime::START);
    let mut schedule = Schedule::new();
    schedule.add_slotframe(1, 10);
    for (slot, neighbour) in [(0, one), (1, two)] {
        schedule.add(1, Cell::new(slot, 0, CellOptions::TX, Some(neighbour))).unwrap();
    }
    mac.enqueue(frame_to(one, 1)).unwrap();
    let waits = mac.poll_slot(&config, &schedule, Asn(0)).unwrap();
    mac.handle_done(&config, waits, false, 0, Asn(0));
    for newer in 1..=127_u64 {
        mac.enqueue(frame_to(two, 1 + newer)).unwrap();
        let sent = mac.poll_slot(&config, &schedule, Asn(10 * newer + 1)).unwrap();
        assert_eq!(packet_of(&sent.outgoing), 1 + newer);
        mac.handle_done(&config, sent, true, 0, Asn(10 * newer + 1));
        assert_eq!(mac.take_outrun(), []);
    }
    // Never sent: no matter how long it waits.
    mac.enqueue(frame_to(one, 200)).unwrap();
    mac.enqueue(frame_to(two, 300)).unwrap();
    let sent = mac.poll_slot(&config, &schedule, Asn(1281)).unwrap();
    assert_eq!(packet_of(&sent.outgoing), 300);
    mac.handle_done(&config, sent, true, 0, Asn(1281));
    let outrun: Vec<u64> = mac.take_outrun().iter().map(|queued| queued.packet).collect();
    assert_eq!(outrun, [1]);
    assert_eq!(mac.queue().iter().map(|queued| queued.packet).collect::<Vec<_>>(), [200]);
}

#[test]
fn t10_all_slots_of_a_fresh_root_but_the_first_are_free() {
    let mut bench = Bench::new(&line(1), &format!("{FULL}{MINIMAL_101}"));
    bench.run(1);
    let free = bench.mote(0).schedule.slotframe(0).unwrap().free_slots();
    assert!(free.eq(1..101));
}

/// When the two packets left that were given to mote 1 together, and on which channels.
fn pair_of_packets(pending_bit: bool) -> [(u64, u8); 2] {
    let cells = OWN_CELLS.replace("= 10\n", "= 101\n");
    let config = format!("{FULL}{EAGER}pending_bit = {pending_bit}\n{QUIET}{cells}");
    let mut bench = Bench::new(&line(2), &config);
    bench.form();
    bench.run(2020);
    bench.send(1, 0, 20);
    bench.send(1, 0, 20);
    bench.run(500);
    assert_eq!(bench.ended.iter().filter(|ended| ended.lost.is_none()).count(), 2);
    let frames = bench.sent(1, swarm_data);
    let [first, second] = &frames[..] else { panic!("{frames:?}") };
    assert!(first.answered && second.answered && first.asn % 101 == 3);
    [(first.asn.0, first.channel), (second.asn.0, second.channel)]
}

#[test]
fn t14_the_pending_bit_saves_the_second_of_two_frames_a_slotframe() {
    let [(asn, channel), (next_asn, next_channel)] = pair_of_packets(true);
    assert_eq!((next_asn, next_channel), (asn + 1, channel));
    let [(asn, channel), (next_asn, next_channel)] = pair_of_packets(false);
    assert_eq!(next_asn, asn + 101);
    assert_ne!(next_channel, channel);
}

#[test]
fn t15_frames_for_a_neighbour_with_a_cell_of_its_own_keep_to_it() {
    let app = "[[app]]\nkind = \"periodic\"\nperiod_s = 1.0\n";
    // The root stands between the two others.
    let places = [(0.0, 0.0), (10.0, 0.0), (-10.0, 0.0)];
    let mut bench = Bench::new(&places, &format!("{LINE}{EAGER}{OWN_CELLS}{app}"));
    bench.form();
    bench.frames.clear();
    bench.run(20_000);
    let (mut n_own, mut n_shared) = (0, 0);
    for frame in &bench.frames {
        let slot = match (frame.source, frame.destination) {
            (1, Some(0)) => 3,
            (0, Some(1)) => 6,
            _ => 0,
        };
        assert_eq!(frame.asn % 10, slot, "{frame:?}");
        let n = if slot == 3 { &mut n_own } else { &mut n_shared };
        *n += usize::from(frame.destination.is_some());
    }
    assert!(100 < n_own && 100 < n_shared, "{n_own} {n_shared}");
}

#[test]
fn t16_two_packets_leave_in_order_through_cells_of_two_slotframes() {
    let config = settings("").mac;
    let neighbour = Eui64::of_mote(MoteId(1));
    let mut mac = Tsch::new(&config, Eui64::of_mote(MoteId(0)), MoteId(0), true, 1);
    mac.start_root(SimTime::START);
    let mut schedule = Schedule::new();
    for (handle, slot) in [(1, 1), (2, 2)] {
        schedule.add_slotframe(handle, 10);
        schedule.add(handle, Cell::new(slot, 0, CellOptions::TX, Some(neighbour))).unwrap();
    }
    mac.enqueue(frame_to(neighbour, 5)).unwrap();
    mac.enqueue(frame_to(neighbour, 6)).unwrap();
    let mut sent = Vec::new();
    for asn in 0..10 {
        assert_eq!(
            mac.next_tx_asn(&config, &schedule, Asn(asn)),
            [1, 1, 2].map(Asn).get(asn as usize).copied()
        );
        if let Some(transmission) = mac.poll_slot(&config, &schedule, Asn(asn)) {
            let at = transmission.at.unwrap();
            sent.push((asn, at.handle, packet_of(&transmission.outgoing)));
            mac.handle_done(&config, transmission, true, 0, Asn(asn));
        }
    }
    assert_eq!(sent, [(1, 1, 5), (2, 2, 6)]);
}

#[test]
fn t18_cells_are_found_by_options_by_neighbour_and_without_neighbour() {
    let [one, two] = [1, 2].map(|mote| Some(Eui64::of_mote(MoteId(mote))));
    let mut schedule = Schedule::new();
    schedule.add_slotframe(0, 10);
    schedule.add_slotframe(1, 10);
    for (handle, slot, options, neighbour) in [
        (0, 0, CellOptions::TX_RX_SHARED, None),
        (1, 1, CellOptions::TX, one),
        (1, 2, CellOptions::RX, one),
        (1, 3, CellOptions::TX, two),
        (1, 4, CellOptions::RX, None),
        (1, 5, CellOptions::TX_SHARED, two),
    ] {
        schedule.add(handle, Cell::new(slot, 0, options, neighbour)).unwrap();
    }
    let slots = |which: &dyn Fn(&Cell) -> bool| -> Vec<u16> {
        schedule.cells().filter(|at| which(&at.cell)).map(|at| at.cell.slot).collect()
    };
    assert_eq!(slots(&|cell| cell.options == CellOptions::TX), [1, 3]);
    assert_eq!(slots(&|cell| cell.options == CellOptions::TX && cell.neighbour == two), [3]);
    assert_eq!(slots(&|cell| cell.neighbour == one), [1, 2]);
    assert_eq!(slots(&|cell| cell.neighbour.is_none()), [0, 4]);
    assert_eq!(slots(&|cell| cell.neighbour == Some(Eui64::of_mote(MoteId(3)))), [0u16; 0]);
    assert!(
        schedule.has_dedicated_tx(Eui64::of_mote(MoteId(2)))
            && schedule.has_tx_to(Eui64::of_mote(MoteId(1)))
    );
}
