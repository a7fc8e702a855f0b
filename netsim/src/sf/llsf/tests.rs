//! Where cells are placed, and that both ends of a link still agree.

use super::*;
use crate::mac::Cell;
use crate::sf::msf::tests::harness::Network;
use crate::sf::msf::tests::negotiated;
use crate::sf::testing::{Bench, built, read};
use proto::ids::MoteId;

const PARENT: u32 = 9;

/// A mote with a parent, which receives from children in these slots of a slotframe of 20, and transmits in others.
fn bench(receives: &[u16], transmits: &[u16]) -> Bench {
    let mut bench = Bench::start(&built("kind = \"llsf\"\nslotframe_slots = 20", 20), MoteId(5));
    bench.parent = Some(Eui64::of_mote(MoteId(PARENT)));
    let cell = |&slot: &u16, options, neighbour| {
        Cell::new(slot, 3, options, Some(Eui64::of_mote(neighbour)))
    };
    let mut cells: Vec<Cell> =
        receives.iter().map(|slot| cell(slot, CellOptions::RX, MoteId(6))).collect();
    cells.extend(transmits.iter().map(|slot| cell(slot, CellOptions::TX, MoteId(PARENT))));
    bench.schedule.add_all(NEGOTIATED, &cells).unwrap();
    bench
}

/// The order in which free slots are offered for a cell to the parent.
fn offered(receives: &[u16], transmits: &[u16], options: CellOptions) -> Vec<u16> {
    let mut bench = bench(receives, transmits);
    let mut free: Vec<u16> =
        (1..20).filter(|slot| !receives.contains(slot) && !transmits.contains(slot)).collect();
    let parent = bench.parent;
    bench.tell(|_, cx| DaisyChain.order_candidates(cx, parent, options, &mut free));
    free
}

#[test]
fn the_slot_after_the_receive_cell_with_the_longest_gap_before_it_comes_first() {
    // Gaps before 3, 5 and 12: 11, 2 and 7 slots.
    assert_eq!(offered(&[3, 5, 12], &[], CellOptions::TX)[..3], [4, 13, 6]);
    // A slot that is taken is passed over.
    assert_eq!(offered(&[3, 5, 12], &[13, 14], CellOptions::TX)[..3], [4, 15, 6]);
    // No slot is free between 3 and 4: the second of them is served, and the first with it.
    assert_eq!(offered(&[3, 4, 12], &[], CellOptions::TX)[..2], [13, 5]);
    // The slotframe begins anew: slot 0 is the minimal cell's.
    assert_eq!(offered(&[19], &[], CellOptions::TX)[..3], [1, 2, 3]);
}

#[test]
fn after_the_candidates_come_the_next_free_slots_so_that_the_parent_has_others_to_grant() {
    assert_eq!(offered(&[10], &[12], CellOptions::TX)[..5], [11, 13, 14, 15, 16]);
    let all = offered(&[3, 5, 12], &[], CellOptions::TX);
    let mut sorted = all.clone();
    sorted.sort_unstable();
    sorted.dedup();
    assert_eq!(sorted.len(), 16, "{all:?}");
}

#[test]
fn without_children_and_for_cells_from_the_parent_slots_are_drawn() {
    let by_place = |slots: &[u16]| slots.is_sorted();
    assert!(!by_place(&offered(&[], &[], CellOptions::TX)));
    let chained = offered(&[10], &[], CellOptions::TX);
    let drawn = offered(&[10], &[], CellOptions::RX);
    assert_ne!(chained, drawn);
    // A cell in which the parent sends is none to forward from.
    let mut bench = bench(&[], &[]);
    let down = Cell::new(7, 3, CellOptions::RX, bench.parent);
    bench.schedule.add(NEGOTIATED, down).unwrap();
    let (slots, length) = receive_slots(&bench.schedule, bench.parent);
    assert_eq!((slots, length), (vec![], 20));
}

#[test]
fn the_cell_that_waits_longest_after_a_receive_cell_is_given_back() {
    let spare = |receives: &[u16], transmits: &[u16]| {
        let mut bench = bench(receives, transmits);
        let mut own: Vec<SixpCell> =
            transmits.iter().map(|&slot| SixpCell { slot, channel: 3 }).collect();
        let parent = bench.parent.unwrap();
        bench.tell(|_, cx| DaisyChain.order_spare(cx, parent, CellOptions::TX, 1, &mut own));
        own.iter().map(|cell| cell.slot).collect::<Vec<_>>()
    };
    // After the receive cell before them: 1, 4 and 6 slots.
    assert_eq!(spare(&[3, 12], &[4, 7, 18]), [18]);
    // Slot 2 comes 10 slots after slot 12.
    assert_eq!(spare(&[3, 12], &[2, 4, 7]), [2]);
    assert_eq!(spare(&[], &[2, 4, 7]), [2]);
}

#[test]
fn it_has_the_keys_of_msf_and_their_checks() {
    let (config, problems, _) = read("kind = \"llsf\"\nlim_numcellsused_low = 80", 5);
    assert!(config.is_none());
    assert_eq!(problems, ["netsim.sf.lim_numcellsused_low: must be at most lim_numcellsused_high"]);
}

/// A line of motes, each the parent of the next one, whose last one sends a frame a slotframe that all others pass on.
fn line(seed: u64) -> Network<DaisyChain> {
    let config = MsfConfig {
        max_num_cells: 10,
        lim_numcellsused_high: 7,
        lim_numcellsused_low: 2,
        ..MsfConfig::default()
    };
    let mut network = Network::with_policy(4, config, seed, DaisyChain);
    for mote in 1..4 {
        network.set_parent(mote, Some(mote - 1));
        network.run_until(|network| network.is_ready(mote));
    }
    for _ in 0..60 {
        for mote in 1..4 {
            network.send_data(mote, mote - 1);
        }
        network.run(101);
    }
    network.run_until(|network| network.is_quiet());
    network
}

#[test]
fn both_ends_of_every_link_agree_and_the_cells_of_a_way_follow_one_another() {
    let network = line(1);
    network.assert_agreement();
    for mote in [1, 2] {
        assert_eq!(negotiated(&network, mote, mote - 1), (2, 0));
        let schedule = &network.motes[mote].schedule;
        let (received, length) = receive_slots(schedule, Some(network.address(mote - 1)));
        let waits: Vec<u16> = schedule
            .slotframe(NEGOTIATED)
            .unwrap()
            .tx_cells()
            .map(|cell| {
                received.iter().map(|&slot| distance(slot, cell.slot, length)).min().unwrap()
            })
            .collect();
        // One of the two was there before the child was. The other one follows a receive cell, but for slots that are taken.
        assert!(waits.iter().any(|&wait| wait <= 3), "mote {mote}: {waits:?}");
    }
}

#[test]
fn the_same_seed_gives_the_same_schedules_and_another_one_gives_others() {
    let schedules = |seed: u64| {
        let network = line(seed);
        network.motes.iter().map(|mote| mote.schedule.clone()).collect::<Vec<_>>()
    };
    assert!(schedules(1) == schedules(1));
    assert!(schedules(1) != schedules(2));
}
