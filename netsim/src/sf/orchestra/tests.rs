//! Facts of Contiki-NG and TSCH-Sim, and that both ends of a link agree.

use super::*;
use crate::mac::{CellRef, Slotframe};
use crate::sf::testing::{Bench, built, read};
use physics::asn::Asn;
use proptest::prelude::*;
use proto::ids::MoteId;

fn mote(n: u32) -> Eui64 {
    Eui64::of_mote(MoteId(n))
}

fn with_rules(rules: &str) -> String {
    format!("kind = \"orchestra\"\nrules = [{rules}, \"default-common\"]")
}

fn cells(bench: &Bench, handle: u8) -> Vec<Cell> {
    bench.schedule.slotframe(handle).unwrap().cells().to_vec()
}

fn place(cell: &Cell) -> (u16, u16) {
    (cell.slot, cell.channel)
}

#[test]
fn o2_the_default_rules_have_handles_in_order_and_periods_397_17_31() {
    let config = built("kind = \"orchestra\"", 20);
    let bench = Bench::start(&config, MoteId(5));
    let frames: Vec<_> =
        bench.schedule.slotframes().iter().map(|frame| (frame.handle, frame.slots())).collect();
    assert_eq!(frames, [(0, 397), (1, 17), (2, 31)]);
    let config = built("kind = \"orchestra\"\neb_slots = 299\ncommon_slots = 7", 20);
    let bench = Bench::start(&config, MoteId(5));
    let frames: Vec<_> = bench.schedule.slotframes().iter().map(Slotframe::slots).collect();
    assert_eq!(frames, [299, 17, 7]);
    assert_eq!(config.slotframe_slots(), 7);
}

#[test]
fn default_common_is_one_shared_cell_that_advertises_only_without_a_slotframe_for_beacons() {
    let common = |text: &str| {
        let bench = Bench::start(&built(text, 20), MoteId(5));
        let handle = bench.sf.slotframe_of(Traffic::Broadcast).unwrap();
        let [cell] = cells(&bench, handle)[..] else { panic!("one cell") };
        assert_eq!((cell.slot, cell.channel), (0, 1));
        assert_eq!((cell.options, cell.neighbour), (CellOptions::TX_RX_SHARED, None));
        (cell.kind, bench.sf.slotframe_of(Traffic::Beacon) == Some(handle))
    };
    assert_eq!(common("kind = \"orchestra\""), (CellKind::Normal, false));
    assert_eq!(common(&with_rules("\"unicast-non-storing\"")), (CellKind::Advertising, true));
}

#[test]
fn beacons_are_sent_in_the_own_slot_and_heard_in_that_of_the_time_source_which_moves_with_it() {
    let mut bench = Bench::start(&built("kind = \"orchestra\"", 20), MoteId(5));
    let own = Cell::new(5, 0, CellOptions::TX, None).of_kind(CellKind::AdvertisingOnly);
    assert!(cells(&bench, 0)[0].is_same(&own));
    for source in [3, 9] {
        bench.tell(|sf, cx| sf.handle_time_source(cx, Some(mote(source))));
        let heard = Cell { options: CellOptions::RX, slot: source as u16, ..own };
        let now = cells(&bench, 0);
        assert_eq!(now.len(), 2);
        assert!(now.iter().any(|cell| cell.is_same(&heard)));
        assert!(now.iter().any(|cell| cell.is_same(&own)));
    }
    bench.set_parent(Some(mote(2)));
    assert!(cells(&bench, 0).iter().any(|cell| cell.slot == 2 && cell.options.rx));
    bench.set_parent(None);
    assert!(cells(&bench, 0).iter().any(|cell| cell.slot == 2 && cell.options.rx));
    assert_eq!(bench.sf.slotframe_of(Traffic::Beacon), Some(0));
}

#[test]
fn beacon_cells_in_one_slot_are_one_cell() {
    let mut bench = Bench::start(&built("kind = \"orchestra\"\neb_slots = 10", 20), MoteId(5));
    bench.tell(|sf, cx| sf.handle_time_source(cx, Some(mote(15))));
    let [cell] = cells(&bench, 0)[..] else { panic!("one cell") };
    assert_eq!(cell.options, CellOptions { tx: true, rx: true, shared: false });
}

#[test]
fn the_default_rules_listen_in_9_of_100_slots() {
    let mut bench = Bench::start(&built("kind = \"orchestra\"", 20), MoteId(5));
    bench.tell(|sf, cx| sf.handle_time_source(cx, Some(mote(3))));
    let (all, silent) = (397 * 17 * 31, 396 * 16 * 30);
    assert_eq!(bench.schedule.n_listening(Asn(all)), all - silent);
    assert_eq!((all - silent) * 1000 / all, 91);
}

#[test]
fn unicast_non_storing_transmits_in_the_slot_of_the_receiver_while_a_frame_waits() {
    let mut bench = Bench::start(&built("kind = \"orchestra\"", 250), MoteId(21));
    let listens = Cell::new(4, 23, CellOptions::RX, None);
    assert!(matches!(cells(&bench, 1)[..], [cell] if cell.is_same(&listens)));
    assert_eq!(bench.sf.slotframe_of(Traffic::Unicast(mote(200))), Some(1));
    bench.tell(|sf, cx| sf.handle_queue(cx, mote(200), true));
    // 200 mod 17 and 200 mod 254 + 2.
    let sends = Cell::new(13, 202, CellOptions::TX_SHARED, Some(mote(200)));
    assert!(cells(&bench, 1).iter().any(|cell| cell.is_same(&sends)));
    bench.tell(|sf, cx| sf.handle_queue(cx, mote(200), false));
    assert_eq!(cells(&bench, 1).len(), 1);
}

#[test]
fn unicast_storing_receiver_based_has_cells_to_parent_and_children_only() {
    let text = with_rules("\"eb-per-time-source\", \"unicast-storing\"");
    let mut bench = Bench::start(&built(&text, 20), MoteId(5));
    assert_eq!(bench.sf.slotframe_of(Traffic::Unicast(mote(7))), Some(2));
    bench.set_parent(Some(mote(7)));
    bench.tell(|sf, cx| sf.handle_child(cx, mote(9), true));
    let places: Vec<_> =
        cells(&bench, 1).iter().map(|cell| (place(cell), cell.neighbour)).collect();
    assert_eq!(places, [((5, 7), None), ((7, 9), Some(mote(7))), ((9, 11), Some(mote(9)))]);
    for relative in [7, 9] {
        assert_eq!(bench.sf.slotframe_of(Traffic::Unicast(mote(relative))), Some(1));
    }
    bench.set_parent(Some(mote(8)));
    bench.tell(|sf, cx| sf.handle_child(cx, mote(9), false));
    let slots: Vec<_> = cells(&bench, 1).iter().map(|cell| cell.slot).collect();
    assert_eq!(slots, [5, 8]);
}

#[test]
fn unicast_storing_keeps_a_slot_that_another_neighbour_needs() {
    let text = with_rules("\"unicast-storing\"");
    let mut bench = Bench::start(&built(&text, 40), MoteId(5));
    for child in [9, 26] {
        bench.tell(|sf, cx| sf.handle_child(cx, mote(child), true));
    }
    bench.tell(|sf, cx| sf.handle_child(cx, mote(9), false));
    let in_slot = bench.schedule.slotframe(0).unwrap().at_slot(9);
    assert!(matches!(in_slot, [cell] if cell.neighbour == Some(mote(26))));
}

#[test]
fn sender_based_transmits_to_the_parent_once_it_knows_us() {
    let text = with_rules("\"unicast-storing\"") + "\nsender_based = true";
    let mut bench = Bench::start(&built(&text, 20), MoteId(5));
    bench.set_parent(Some(mote(7)));
    assert_eq!(bench.sf.slotframe_of(Traffic::Unicast(mote(7))), Some(1));
    let listens = Cell::new(7, 7, CellOptions::RX, None);
    assert!(matches!(cells(&bench, 0)[..], [cell] if cell.is_same(&listens)));
    bench.tell(|sf, cx| sf.handle_known_to_parent(cx));
    assert_eq!(bench.sf.slotframe_of(Traffic::Unicast(mote(7))), Some(0));
    let sends = Cell::new(5, 9, CellOptions::TX_SHARED, Some(mote(7)));
    assert!(cells(&bench, 0).iter().any(|cell| cell.is_same(&sends)));
    bench.set_parent(Some(mote(8)));
    assert_eq!(bench.sf.slotframe_of(Traffic::Unicast(mote(8))), Some(1));
}

#[test]
fn sender_based_cells_are_dedicated_where_every_mote_has_a_slot_of_its_own() {
    let shared = |n_motes: usize| {
        let text = with_rules("\"unicast-storing\"") + "\nsender_based = true";
        let mut bench = Bench::start(&built(&text, n_motes), MoteId(5));
        bench.tell(|sf, cx| sf.handle_child(cx, mote(7), true));
        let sends = |cell: &&Cell| cell.options.tx;
        cells(&bench, 0).iter().find(sends).unwrap().options.shared
    };
    assert!(!shared(17));
    assert!(shared(18));
}

#[test]
fn link_based_gives_each_direction_of_each_link_its_slot() {
    let text = with_rules("\"link-based\"");
    let mut bench = Bench::start(&built(&text, 20), MoteId(5));
    bench.tell(|sf, cx| sf.handle_child(cx, mote(7), true));
    // (5 + 264 * 7) mod 17 and (7 + 264 * 5) mod 17.
    let sends = Cell::new(0, 9, CellOptions::TX_SHARED, Some(mote(7)));
    let listens = Cell::new(1, 7, CellOptions::RX, None);
    assert!(matches!(cells(&bench, 0)[..], [a, b] if a.is_same(&sends) && b.is_same(&listens)));
}

#[test]
fn special_for_root_lets_roots_listen_in_every_slot_and_matches_neighbours_that_are_roots() {
    let text = with_rules("\"unicast-non-storing\", \"special-for-root\"");
    let config = built(&text, 20);
    let root = Bench::start(&config, MoteId(0));
    assert_eq!(root.schedule.slotframe(ROOT_LISTENS | 1).unwrap().slots(), 1);
    assert!((0..100).all(|asn| root.schedule.listens(Asn(asn)).is_some()));

    let mut bench = Bench::start(&config, MoteId(12));
    assert_eq!(bench.sf.slotframe_of(Traffic::Unicast(mote(0))), Some(0));
    bench.tell(|sf, cx| sf.handle_beacon(cx, mote(3), 1));
    bench.tell(|sf, cx| sf.handle_beacon(cx, mote(0), 0));
    assert_eq!(bench.sf.slotframe_of(Traffic::Unicast(mote(0))), Some(1));
    assert_eq!(bench.sf.slotframe_of(Traffic::Unicast(mote(3))), Some(0));
    let sends = Cell::new(12 % 7, 2, CellOptions::TX_SHARED, Some(mote(0)));
    assert!(matches!(cells(&bench, 1)[..], [cell] if cell.is_same(&sends)));
    assert_eq!(bench.schedule.slotframe(1).unwrap().slots(), 7);
    bench.tell(|sf, cx| sf.handle_queue(cx, mote(0), true));
    assert!(cells(&bench, 0).iter().all(|cell| !cell.options.tx));
}

#[test]
fn after_a_loss_of_synchronisation_nothing_is_remembered() {
    let text = with_rules("\"eb-per-time-source\", \"unicast-storing\", \"special-for-root\"");
    let config = built(&text, 20);
    let mut bench = Bench::start(&config, MoteId(5));
    let fresh = bench.sf.clone();
    bench.set_parent(Some(mote(7)));
    bench.tell(|sf, cx| sf.handle_child(cx, mote(9), true));
    bench.tell(|sf, cx| sf.handle_beacon(cx, mote(0), 0));
    assert_ne!(bench.sf, fresh);
    bench.sf.stop();
    assert_eq!(bench.sf, fresh);
}

#[test]
fn cells_that_stay_keep_their_counters() {
    let text = with_rules("\"unicast-storing\"");
    let mut bench = Bench::start(&built(&text, 20), MoteId(5));
    bench.tell(|sf, cx| sf.handle_child(cx, mote(9), true));
    let at = CellRef { handle: 0, cell: cells(&bench, 0)[1] };
    bench.schedule.count_tx(&at, true);
    bench.tell(|sf, cx| sf.handle_child(cx, mote(11), true));
    assert_eq!(cells(&bench, 0)[1].num_tx_ack, 1);
}

#[test]
fn rules_that_make_no_sense_are_refused_all_at_once() {
    let (config, problems, _) = read(
        "kind = \"orchestra\"\nrules = [\"default-common\", \"link-based\", \"link-based\"]\n\
         unicast_active_slots = 18\nunicast_channel_max = 1",
        5,
    );
    assert!(config.is_none());
    assert_eq!(
        problems,
        [
            "netsim.sf.rules[2]: must not be listed twice",
            "netsim.sf.rules: must end with \"default-common\", which matches all frames that no other rule matches",
            "netsim.sf.unicast_active_slots: must be at most unicast_slots, 17, got 18 (nearest valid: 17)",
            "netsim.sf.unicast_channel_max: must be at least unicast_channel_min, 2, got 1 (nearest valid: 2)",
        ]
    );
}

#[test]
fn motes_beyond_256_share_all_cells_unless_two_octets_count() {
    let (_, problems, warnings) = read("kind = \"orchestra\"", 300);
    assert!(problems.is_empty());
    assert_eq!(
        warnings,
        ["netsim.sf.hash: 44 of 300 motes have all their cells in common with another one; \
          \"last-two-octets\" tells them apart"]
    );
    let config = built("kind = \"orchestra\"\nhash = \"last-two-octets\"", 300);
    let bench = Bench::start(&config, MoteId(299));
    assert_eq!(cells(&bench, 0)[0].slot, 299);
}

proptest! {
    /// Whatever cell a mote transmits a unicast frame in, the receiver has a cell of the same slotframe, slot and channel to
    /// receive in.
    #[test]
    fn both_ends_of_a_link_agree_on_its_cells(
        child in 1u32..600,
        parent in 0u32..600,
        rule in prop::sample::select(vec!["unicast-non-storing", "unicast-storing", "link-based"]),
        sender_based in any::<bool>(),
        two_octets in any::<bool>(),
        active in 1u16..=17,
    ) {
        prop_assume!(child != parent);
        let hash = if two_octets { "last-two-octets" } else { "last-octet" };
        let text = with_rules(&format!("\"{rule}\""))
            + &format!("\nsender_based = {sender_based}\nhash = \"{hash}\"\nunicast_active_slots = {active}");
        let (config, problems, _) = read(&text, 600);
        prop_assert!(problems.is_empty());
        let config = config.unwrap();
        let (mut low, mut high) = (Bench::start(&config, MoteId(child)), Bench::start(&config, MoteId(parent)));
        low.set_parent(Some(mote(parent)));
        high.tell(|sf, cx| sf.handle_child(cx, mote(child), true));
        low.tell(|sf, cx| sf.handle_known_to_parent(cx));
        low.tell(|sf, cx| sf.handle_queue(cx, mote(parent), true));
        high.tell(|sf, cx| sf.handle_queue(cx, mote(child), true));
        for (from, to) in [(&low, &high), (&high, &low)] {
            let handle = from.sf.slotframe_of(Traffic::Unicast(to.own)).unwrap();
            prop_assert_eq!(handle, 0);
            let sent: Vec<Cell> = cells(from, handle)
                .into_iter()
                .filter(|cell| cell.options.tx && cell.neighbour == Some(to.own))
                .collect();
            prop_assert_eq!(sent.len(), 1);
            let heard = cells(to, handle);
            prop_assert!(heard.iter().any(|cell| cell.options.rx && place(cell) == place(&sent[0])));
        }
    }
}
