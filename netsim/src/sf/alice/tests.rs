//! The authors' arithmetic, and what follows from it.

use super::*;
use crate::mac::Slotframe;
use crate::sf::Config;
use crate::sf::testing::{Bench, built, read};
use physics::asn::Asn;
use proptest::prelude::*;
use proto::ids::MoteId;
use proto::time::SimTime;
use std::collections::BTreeSet;

const ALICE: &str = "kind = \"alice\" # storing";

fn mote(n: u32) -> Eui64 {
    Eui64::of_mote(MoteId(n))
}

fn keys(config: &Config) -> AliceConfig {
    config.as_kind::<AliceConfig>().unwrap().clone()
}

fn cells(bench: &Bench) -> Vec<Cell> {
    bench.schedule.slotframe(UNICAST_HANDLE).unwrap().cells().to_vec()
}

fn place(cell: &Cell) -> (u16, u16) {
    (cell.slot, cell.channel)
}

/// Two motes of which one is the other's parent, and both know.
fn link(config: &Config, child: u32, parent: u32) -> (Bench, Bench) {
    let (mut low, mut high) =
        (Bench::start(config, MoteId(child)), Bench::start(config, MoteId(parent)));
    low.set_parent(Some(mote(parent)));
    low.tell(|sf, cx| sf.handle_known_to_parent(cx));
    high.tell(|sf, cx| sf.handle_child(cx, mote(child), true));
    (low, high)
}

#[test]
fn beacons_come_before_the_common_cell_and_that_before_links_with_periods_397_31_23() {
    let bench = Bench::start(&built(ALICE, 20), MoteId(5));
    let frames: Vec<_> =
        bench.schedule.slotframes().iter().map(|frame| (frame.handle, frame.slots())).collect();
    assert_eq!(frames, [(0, 397), (1, 31), (2, 23)]);
    let [common] = bench.schedule.slotframe(1).unwrap().cells() else { panic!("one cell") };
    assert_eq!((common.slot, common.channel, common.options), (0, 1, CellOptions::TX_RX_SHARED));
    let text = "kind = \"alice\" # storing\neb_slots = 41\ncommon_slots = 19\nunicast_slots = 7";
    let config = built(text, 20);
    let bench = Bench::start(&config, MoteId(5));
    let lengths: Vec<_> = bench.schedule.slotframes().iter().map(Slotframe::slots).collect();
    assert_eq!(lengths, [41, 19, 7]);
    assert_eq!(config.slotframe_slots(), 19);
}

#[test]
fn a_cell_is_the_hash_of_both_addresses_and_the_slotframe_worked_out_by_hand() {
    let config = keys(&built(ALICE, 20));
    // From 5 to 7 in slotframe 100: x = 256 * 5 + 7 + 100 = 1387. x + (x >> 16) = 1387, x >> 9 = 2, x << 3 = 11096, x >> 5 = 43:
    // 1387 ^ 2 ^ 11096 ^ 43 = 11802. 11802 mod 23 = 3, 1 + 11802 mod 15 = 13.
    assert_eq!(config.cell(mote(5), mote(7), 100, 16), (3, 13));
    // From 7 to 5: x = 1897; 1897 ^ 3 ^ 15176 ^ 59 = 15385. 15385 mod 23 = 21, 1 + 15385 mod 15 = 11.
    assert_eq!(config.cell(mote(7), mote(5), 100, 16), (21, 11));
    assert_eq!(
        (config.asfn(Asn(22)), config.asfn(Asn(23)), config.asfn(Asn(23 * 65_536 + 1))),
        (0, 1, 0)
    );
    // Channel offset 0 is left to beacons; where there is one channel only, all offsets are the same.
    assert_eq!(config.cell(mote(5), mote(7), 100, 1).1, 1);
    let one = keys(&built("kind = \"alice\" # storing\nunicast_channels = \"one\"", 20));
    assert_eq!(one.cell(mote(5), mote(7), 100, 16), (3, 2));
}

#[test]
fn two_octets_tell_motes_apart_that_the_last_one_does_not() {
    let (_, problems, warnings) = read(ALICE, 300);
    assert!(problems.is_empty());
    assert_eq!(
        warnings,
        ["netsim.sf.hash: 44 of 300 motes have all their cells in common with another one; \
          \"last-two-octets\" tells them apart"]
    );
    let one = keys(&read(ALICE, 300).0.unwrap());
    let two = keys(&built("kind = \"alice\" # storing\nhash = \"last-two-octets\"", 300));
    let all = |config: &AliceConfig, from: u32| {
        (0..200).map(|asfn| config.cell(mote(from), mote(9), asfn, 16)).collect::<Vec<_>>()
    };
    assert_eq!(all(&one, 7), all(&one, 263));
    assert_ne!(all(&two, 7), all(&two, 263));
}

#[test]
fn without_storing_mode_it_is_refused() {
    let (config, problems, _) = read("kind = \"alice\"", 5);
    assert!(config.is_none());
    assert_eq!(
        problems,
        [
            "netsim.sf.kind: requires rpl.mode = \"storing\", in which parents know their children, got \"alice\""
        ]
    );
}

#[test]
fn every_slotframe_moves_the_cells_at_its_first_slot() {
    let config = built(ALICE, 20);
    let (mut low, _) = link(&config, 5, 7);
    let mut places = BTreeSet::new();
    for slotframe in 1..=200 {
        assert_eq!(low.sf.poll_timeout(), Some(SimTime::from_ns(slotframe * 23 * 10_000_000)));
        low.pass_time();
        let now = cells(&low);
        assert_eq!(now.len(), 2);
        let expected = keys(&config).cell(mote(5), mote(7), slotframe as u16, 16);
        assert!(now.iter().any(|cell| cell.options.tx && place(cell) == expected));
        places.insert(expected);
    }
    // A link that is 200 times in one of 345 places at random has 152 different ones, with a deviation of 5.
    assert!((120..=180).contains(&places.len()), "{}", places.len());
}

#[test]
fn links_that_collide_in_one_slotframe_part_in_the_next_ones() {
    let config = keys(&built(ALICE, 40));
    let links: Vec<(Eui64, Eui64)> = (1..40).map(|n| (mote(n), mote(n / 3))).collect();
    let collides = |a: usize, b: usize, asfn: u16| {
        let cell = |link: usize| config.cell(links[link].0, links[link].1, asfn, 16);
        cell(a) == cell(b)
    };
    let mut n_collisions = 0;
    for a in 0..links.len() {
        for b in 0..a {
            let n = (0..200).filter(|&asfn| collides(a, b, asfn)).count();
            n_collisions += n;
            assert!(n < 40, "links {a} and {b} collide in {n} of 200 slotframes");
        }
    }
    // By chance one in 345: 430 of 148,200. The hash is no random function; the order of magnitude must be right.
    assert!((200..=900).contains(&n_collisions), "{n_collisions}");
}

#[test]
fn a_frame_for_the_parent_waits_for_its_cell_once_the_parent_knows_the_mote() {
    let mut bench = Bench::start(&built(ALICE, 20), MoteId(5));
    bench.set_parent(Some(mote(7)));
    assert_eq!(bench.sf.slotframe_of(Traffic::Unicast(mote(7))), Some(1));
    bench.tell(|sf, cx| sf.handle_known_to_parent(cx));
    assert_eq!(bench.sf.slotframe_of(Traffic::Unicast(mote(7))), Some(UNICAST_HANDLE));
    bench.tell(|sf, cx| sf.handle_child(cx, mote(9), true));
    assert_eq!(bench.sf.slotframe_of(Traffic::Unicast(mote(9))), Some(UNICAST_HANDLE));
    assert_eq!(bench.sf.slotframe_of(Traffic::Unicast(mote(11))), Some(1));
    assert_eq!(bench.sf.slotframe_of(Traffic::Broadcast), Some(1));
    assert_eq!(bench.sf.slotframe_of(Traffic::Beacon), Some(0));
    bench.set_parent(Some(mote(8)));
    assert_eq!(bench.sf.slotframe_of(Traffic::Unicast(mote(8))), Some(1));
}

#[test]
fn frames_for_former_relatives_are_dropped_unless_that_is_switched_off() {
    let abandons = |text: &str| {
        let mut bench = Bench::start(&built(text, 20), MoteId(5));
        bench.set_parent(Some(mote(7)));
        bench.tell(|sf, cx| sf.handle_child(cx, mote(9), true));
        assert!(![7, 9].iter().any(|&n| bench.sf.abandons(UNICAST_HANDLE, mote(n))));
        bench.set_parent(Some(mote(8)));
        bench.tell(|sf, cx| sf.handle_child(cx, mote(9), false));
        // A frame that waits for the common cell still has one.
        assert!(![7, 9].iter().any(|&n| bench.sf.abandons(1, mote(n))));
        [7, 9].map(|n| bench.sf.abandons(UNICAST_HANDLE, mote(n)))
    };
    assert_eq!(abandons(ALICE), [true, true]);
    assert_eq!(abandons("kind = \"alice\" # storing\nearly_packet_drop = false"), [false, false]);
}

#[test]
fn after_a_loss_of_synchronisation_nothing_is_remembered() {
    let mut bench = Bench::start(&built(ALICE, 20), MoteId(5));
    let fresh = built(ALICE, 20).create(MoteId(5));
    bench.set_parent(Some(mote(7)));
    bench.tell(|sf, cx| sf.handle_child(cx, mote(9), true));
    assert_ne!(bench.sf, fresh);
    bench.sf.stop();
    assert_eq!(bench.sf, fresh);
}

#[test]
fn a_restored_mote_moves_its_cells_as_if_nothing_had_happened() {
    let config = built(ALICE, 20);
    let (mut low, _) = link(&config, 5, 7);
    low.asn = Asn(1000);
    low.tell(|sf, cx| sf.handle_timeout(cx));
    let mut other = low.restored(&config);
    for _ in 0..50 {
        low.pass_time();
        other.pass_time();
        assert_eq!((&other.sf, &other.schedule), (&low.sf, &low.schedule));
    }
}

proptest! {
    /// In every slot of every slotframe: whatever cell a mote transmits in, its relative has the same cell to receive in. And a
    /// mote has at most one cell to transmit to each relative.
    #[test]
    fn both_ends_of_a_link_agree_on_its_cells_in_every_slotframe(
        child in 1u32..600,
        parent in 0u32..600,
        asn in 0u64..1 << 40,
        two_octets in any::<bool>(),
        unicast_slots in 1u16..100,
        per_link in any::<bool>(),
    ) {
        prop_assume!(child != parent);
        let hash = if two_octets { "last-two-octets" } else { "last-octet" };
        let channels = if per_link { "per-link" } else { "one" };
        let (config, problems, _) = read(
            &format!(
                "kind = \"alice\" # storing\nunicast_slots = {unicast_slots}\nhash = \"{hash}\"\nunicast_channels = \"{channels}\""
            ),
            600,
        );
        prop_assert!(problems.is_empty());
        let (mut low, mut high) = link(&config.unwrap(), child, parent);
        for bench in [&mut low, &mut high] {
            bench.asn = Asn(asn);
            bench.tell(|sf, cx| sf.handle_timeout(cx));
        }
        for (from, to) in [(&low, &high), (&high, &low)] {
            prop_assert_eq!(from.sf.slotframe_of(Traffic::Unicast(to.own)), Some(UNICAST_HANDLE));
            let sent: Vec<Cell> = cells(from)
                .into_iter()
                .filter(|cell| cell.options.tx && cell.neighbour == Some(to.own))
                .collect();
            prop_assert_eq!(sent.len(), 1);
            prop_assert!(sent[0].channel < 16);
            prop_assert!(cells(to).iter().any(|cell| cell.options.rx && place(cell) == place(&sent[0])));
        }
    }
}
