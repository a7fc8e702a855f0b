use super::super::testing::{Bench, built, read};
use super::*;
use crate::sf::Config as AnyConfig;
use physics::asn::Asn;
use proto::ids::MoteId;
use proto::time::SimTime;

/// Ten slots for motes, two for all.
const TEXT: &str =
    "kind = \"sotdma\"\nslotframe_slots = 12\nshared_slots = 2\ncheck_slotframes = 10000";

fn small() -> AnyConfig {
    built(TEXT, 9)
}

fn sotdma(bench: &Bench) -> &Sotdma {
    bench.sf.as_kind().expect("no other function")
}

/// Neighbour `from`, in its own slot, says whom it hears where.
fn hear(bench: &mut Bench, from: u32, slot: u16, hears: &[(u16, u32)]) {
    bench.asn = Asn(bench.asn / 12 * 12 + u64::from(slot));
    let mut taken = SlotSet::default();
    hears.iter().for_each(|&(slot, _)| taken.insert(slot));
    let mut hears = hears.to_vec();
    hears.sort_unstable();
    let epoch = bench.asn / 12;
    let tags = hears.iter().map(|&(_, mote)| tag(Eui64::of_mote(MoteId(mote)), epoch)).collect();
    say(bench, from, slot, &SlotsRepr { n_slots: 10, taken, first: 0, tags });
}

fn say(bench: &mut Bench, from: u32, slot: u16, announced: &SlotsRepr) {
    let cell = Cell::new(slot, 0, CellOptions::RX, None);
    let at = CellRef { handle: OWN_HANDLE, cell };
    bench.tell(|sf, cx| sf.handle_announcement(cx, &at, Eui64::of_mote(MoteId(from)), announced));
}

/// What a mote says in a slot.
fn said(bench: &Bench, slot: u16) -> SlotsRepr {
    let at = CellRef { handle: OWN_HANDLE, cell: Cell::new(slot, 0, CellOptions::TX, None) };
    bench.sf.announcement(bench.own, &at, bench.asn).unwrap()
}

fn own_cells(bench: &Bench) -> Vec<u16> {
    bench.schedule.slotframe(OWN_HANDLE).unwrap().tx_cells().map(|cell| cell.slot).collect()
}

/// A mote that has taken a slot.
fn settled(mote: u32) -> (Bench, u16) {
    let mut bench = Bench::start(&small(), MoteId(mote));
    (0..4).for_each(|_| bench.pass_time());
    let slot = sotdma(&bench).slot().unwrap();
    assert_eq!(own_cells(&bench), [slot]);
    (bench, slot)
}

#[test]
fn a_mote_listens_for_two_slotframes_and_takes_a_slot_that_neither_it_nor_a_neighbour_hears_anybody_in()
 {
    // Ten motes with random choices; of ten slots eight are taken.
    for mote in 1..11 {
        let mut bench = Bench::start(&small(), MoteId(mote));
        assert_eq!(
            (bench.sf.poll_timeout(), own_cells(&bench)),
            (Some(SimTime::from_ns(120_000_000)), vec![])
        );
        let mut is_ready = true;
        bench.tell(|sf, cx| is_ready = sf.is_ready(cx));
        assert!(!is_ready);
        bench.pass_time();
        hear(&mut bench, 20, 4, &[(0, 30), (1, 31), (2, 32), (3, 33)]);
        hear(&mut bench, 21, 7, &[(5, 34), (4, 20), (6, 35)]);
        bench.pass_time();
        assert_eq!(sotdma(&bench).slot(), None);
        bench.pass_time();
        assert!(matches!(sotdma(&bench).slot(), Some(8 | 9)), "{:?}", sotdma(&bench).slot());
        bench.tell(|sf, cx| is_ready = sf.is_ready(cx));
        assert!(is_ready);
        assert_eq!(own_cells(&bench), [sotdma(&bench).slot().unwrap()]);
    }
}

#[test]
fn where_every_slot_is_taken_within_two_hops_one_that_few_neighbours_hear_anybody_in_is_shared() {
    let mut bench = Bench::start(&small(), MoteId(1));
    (0..2).for_each(|_| bench.pass_time());
    let all: Vec<(u16, u32)> = (0..10).filter(|&slot| slot != 4).map(|slot| (slot, 30)).collect();
    hear(&mut bench, 20, 4, &all);
    hear(&mut bench, 21, 5, &all[..7]);
    bench.pass_time();
    // 8 and 9 are heard by mote 20 alone.
    assert!(matches!(sotdma(&bench).slot(), Some(8 | 9)));
}

#[test]
fn a_neighbour_that_hears_another_mote_in_the_slot_is_believed() {
    for (who, gives_up) in [(1, false), (30, true)] {
        let (mut bench, slot) = settled(1);
        let other = (slot + 1) % 10;
        hear(&mut bench, 20, other, &[(slot, who)]);
        bench.pass_time();
        assert_eq!(sotdma(&bench).slot() != Some(slot), gives_up);
        assert_eq!(own_cells(&bench), [sotdma(&bench).slot().unwrap()]);
        assert_ne!(sotdma(&bench).slot(), Some(other));
    }
}

#[test]
fn a_slot_whose_tag_was_left_out_is_no_conflict() {
    let (mut bench, slot) = settled(1);
    let mut taken = SlotSet::default();
    taken.insert(slot);
    say(&mut bench, 20, (slot + 1) % 10, &SlotsRepr { n_slots: 10, taken, first: 0, tags: vec![] });
    bench.pass_time();
    assert_eq!(sotdma(&bench).slot(), Some(slot));
}

#[test]
fn a_mote_that_hears_another_one_in_its_slot_gives_it_up() {
    let (mut bench, slot) = settled(1);
    hear(&mut bench, 20, slot, &[]);
    bench.pass_time();
    assert_ne!(sotdma(&bench).slot(), Some(slot));
}

#[test]
fn what_is_no_mote_s_slot_and_other_networks_are_ignored() {
    let (mut bench, slot) = settled(1);
    let before = sotdma(&bench).clone();
    hear(&mut bench, 20, 11, &[(slot, 30)]);
    let mut taken = SlotSet::default();
    taken.insert(slot);
    let of_others = SlotsRepr { n_slots: 11, taken, first: 0, tags: vec![0] };
    say(&mut bench, 20, (slot + 1) % 10, &of_others);
    assert_eq!(*sotdma(&bench), before);
}

#[test]
fn of_two_motes_in_one_slot_the_one_heard_last_is_announced() {
    let (mut bench, own) = settled(1);
    let slot = (own + 1) % 10;
    let tag_of = |bench: &Bench, mote| Some(tag(Eui64::of_mote(mote), bench.asn / 12));
    for mote in [20, 21, 20] {
        hear(&mut bench, mote, slot, &[(own, 1)]);
        assert_eq!(said(&bench, own).tag_in(slot), tag_of(&bench, MoteId(mote)));
        bench.pass_time();
    }
    assert_eq!(said(&bench, own).taken.len(), 1);
    // Who changes its slot leaves the old one free.
    hear(&mut bench, 20, (own + 2) % 10, &[(own, 1)]);
    assert_eq!(said(&bench, own).tag_in(slot), tag_of(&bench, MoteId(21)));
    hear(&mut bench, 21, (own + 3) % 10, &[(own, 1)]);
    assert!(!said(&bench, own).taken.has(slot));
}

#[test]
fn who_has_not_been_heard_for_as_many_slotframes_as_are_set_is_forgotten() {
    for (key, n) in [("", 8), ("\nforget_slotframes = 3", 3)] {
        let mut bench = Bench::start(&built(&format!("{TEXT}{key}"), 9), MoteId(1));
        (0..4).for_each(|_| bench.pass_time());
        let own = sotdma(&bench).slot().unwrap();
        hear(&mut bench, 20, (own + 1) % 10, &[(own, 1)]);
        for _ in 1..n {
            bench.pass_time();
            assert_eq!(said(&bench, own).taken.len(), 1);
        }
        bench.pass_time();
        assert!(said(&bench, own).taken.is_empty());
    }
}

#[test]
fn a_frame_goes_out_in_every_slotframe_in_which_the_slot_is_not_checked() {
    for (every, heard_by, expected) in [(16, true, 16.0), (2, true, 2.0), (16, false, 4.0)] {
        let text = format!("kind = \"sotdma\"\nslotframe_slots = 12\ncheck_slotframes = {every}");
        let mut bench = Bench::start(&built(&text, 9), MoteId(1));
        (0..4).for_each(|_| bench.pass_time());
        let own = sotdma(&bench).slot().unwrap();
        let hears = if heard_by { vec![(own, 1)] } else { vec![] };
        let n = 4000;
        let mut n_checks = 0;
        for round in 0..n + 8 {
            let epoch = bench.asn / 12;
            let tags = hears.iter().map(|_| tag(bench.own, epoch)).collect();
            let mut taken = SlotSet::default();
            hears.iter().for_each(|&(slot, _)| taken.insert(slot));
            say(&mut bench, 20, (own + 1) % 6, &SlotsRepr { n_slots: 6, taken, first: 0, tags });
            bench.pass_time();
            let wants = bench.sf.poll_announcement() == Some(OWN_HANDLE);
            assert_eq!(wants, own_cells(&bench) == [own]);
            assert_eq!(bench.sf.poll_announcement(), None);
            n_checks += u32::from(8 <= round && !wants);
        }
        // Binomial: five standard deviations, beyond which lies one in two million.
        let p: f64 = 1.0 / expected;
        let n = f64::from(n);
        let got = f64::from(n_checks);
        assert!((got - n * p).abs() < 5.0 * (n * p * (1.0 - p)).sqrt(), "{got} of {n}, {expected}");
    }
}

#[test]
fn unicast_frames_have_the_shared_slots_and_take_no_place_of_what_is_for_everyone() {
    let (bench, _) = settled(1);
    let shared = bench.schedule.slotframe(SHARED_HANDLE).unwrap().tx_cells();
    let shared: Vec<_> = shared.map(|cell| (cell.slot, cell.options)).collect();
    assert_eq!(shared, [10, 11].map(|slot| (slot, CellOptions::TX_RX_SHARED)));
    assert_eq!(bench.sf.slotframe_of(Traffic::Unicast(bench.own)), Some(SHARED_HANDLE));
    assert_eq!(bench.sf.slotframe_of(Traffic::Payload), Some(OWN_HANDLE));
    assert_eq!(small().slotframe_slots(), 12);
    // It listens in all slots but its own.
    assert_eq!(
        bench.schedule.n_listening(bench.asn + 1200) - bench.schedule.n_listening(bench.asn),
        1100
    );
}

#[test]
fn a_slotframe_of_shared_slots_alone_is_refused() {
    let (config, problems, _) = read("kind = \"sotdma\"\nslotframe_slots = 4", 5);
    assert!(config.is_none());
    assert_eq!(
        problems,
        [
            "netsim.sf.shared_slots: must leave slots for motes: it must be less than sf.slotframe_slots = 4, got 6 (nearest valid: 3)"
        ]
    );
}
