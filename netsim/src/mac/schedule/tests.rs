use super::*;
use physics::asn::Asn;
use proptest::prelude::*;
use proto::ids::MoteId;

proptest! {
    #[test]
    fn listening_slots_are_those_that_a_walk_over_all_slots_counts(
        frames in prop::collection::vec(
            (1u16..40, prop::collection::vec((0u16..40, any::<bool>()), 0..6), any::<bool>()),
            0..4,
        ),
        from in 0u64..500,
        length in 0u64..3000,
    ) {
        let mut schedule = Schedule::new();
        schedule.set_effective(Asn(from));
        for (handle, (slots, cells, background)) in (0..).zip(&frames) {
            schedule.add_slotframe(handle, *slots);
            schedule.set_background(handle, background.then_some(3)).unwrap();
            for &(slot, receives) in cells {
                let options = if receives { CellOptions::RX } else { CellOptions::TX };
                schedule.add(handle, Cell::new(slot % slots, 0, options, None)).unwrap();
            }
        }
        let walked = (from..from + length).filter(|&asn| schedule.listens(Asn(asn)).is_some()).count();
        prop_assert_eq!(schedule.n_listening(Asn(from + length)), walked as u64);
    }
}

proptest! {
    #[test]
    fn a_background_listens_like_cells_written_out(
        slots in 1u16..30,
        own in prop::collection::vec((0u16..30, any::<bool>()), 0..8),
        shadow in prop::option::of(1u16..30),
    ) {
        let own: Vec<Cell> = own
            .iter()
            .map(|&(slot, receives)| {
                let options = if receives { CellOptions::RX } else { CellOptions::TX };
                Cell::new(slot % slots, 1, options, None)
            })
            .collect();
        let mut implied = Schedule::new();
        let mut written = Schedule::new();
        for schedule in [&mut implied, &mut written] {
            if let Some(slots) = shadow {
                schedule.add_slotframe(0, slots);
                schedule.add(0, Cell::new(0, 0, CellOptions::TX_RX_SHARED, None)).unwrap();
            }
            schedule.add_slotframe(1, slots);
            schedule.add_all(1, &own).unwrap();
        }
        implied.set_background(1, Some(5)).unwrap();
        let free: Vec<u16> = written.slotframe(1).unwrap().free_slots().collect();
        for slot in free {
            written.add(1, Cell::new(slot, 5, CellOptions::RX, None)).unwrap();
        }
        for asn in 0..100 {
            prop_assert_eq!(implied.listens(Asn(asn)), written.listens(Asn(asn)));
            prop_assert!(implied.cells_at(Asn(asn)).eq(written.cells_at(Asn(asn))));
        }
        prop_assert_eq!(implied.n_listening(Asn(1000)), written.n_listening(Asn(1000)));
    }
}

#[test]
fn a_background_gives_way_to_cells_and_comes_back_when_they_go() {
    let mut schedule = Schedule::new();
    schedule.add_slotframe(1, 4);
    schedule.set_background(1, Some(0)).unwrap();
    assert_eq!(schedule.n_listening(Asn(8)), 8);
    schedule.set_effective(Asn(8));
    schedule.add(1, Cell::new(2, 0, CellOptions::TX, None)).unwrap();
    assert!(schedule.listens(Asn(10)).is_none());
    assert_eq!(schedule.n_listening(Asn(16)), 14);
    schedule.set_effective(Asn(16));
    assert_eq!(schedule.remove_where(1, |_| true), 1);
    assert!(schedule.listens(Asn(10)).is_some());
    assert_eq!(schedule.n_listening(Asn(24)), 22);
    schedule.resize(1, 6).unwrap();
    assert!(schedule.listens(Asn(5)).is_some());
    assert_eq!(schedule.set_background(2, None), Err(ScheduleError::NoSlotframe(2)));
}

#[test]
fn t17_a_slotframe_that_shrinks_loses_cells_beyond_its_end() {
    let mut schedule = Schedule::new();
    schedule.add_slotframe(0, 101);
    let cell = Cell::new(70, 0, CellOptions::TX, None);
    schedule.add(0, cell).unwrap();
    schedule.resize(0, 50).unwrap();
    assert_eq!(schedule.cells().count(), 0);
    assert_eq!(schedule.add(0, cell), Err(ScheduleError::BeyondEnd { slot: 70, slots: 50 }));
    schedule.resize(0, 150).unwrap();
    assert_eq!(schedule.cells().count(), 0);
}

#[test]
fn t20_cells_differ_by_each_of_five_attributes() {
    let cell = Cell::new(1, 2, CellOptions::TX, None);
    let neighbour = Some(Eui64::of_mote(MoteId(1)));
    for other in [
        Cell { slot: 2, ..cell },
        Cell { channel: 3, ..cell },
        Cell { neighbour, ..cell },
        Cell { options: CellOptions::RX, ..cell },
        Cell { kind: CellKind::Advertising, ..cell },
    ] {
        assert!(!cell.is_same(&other));
    }
    assert!(cell.is_same(&Cell { num_tx: 4, ..cell }));
}

#[test]
fn of_two_cells_in_a_slot_the_lower_handle_is_listened_to() {
    let mut schedule = Schedule::new();
    for (handle, slots) in [(2, 5), (1, 7)] {
        schedule.add_slotframe(handle, slots);
        schedule.add(handle, Cell::new(0, handle.into(), CellOptions::RX, None)).unwrap();
    }
    assert_eq!(schedule.listens(Asn(0)).unwrap().handle, 1);
    assert_eq!(schedule.listens(Asn(5)).unwrap().handle, 2);
    assert!(schedule.listens(Asn(1)).is_none());
}

proptest! {
    #[test]
    fn a_radio_listens_in_the_first_cell_that_receives_however_the_schedule_came_about(
        lengths in prop::collection::vec(prop_oneof![Just(7u16), 1u16..30], 1..4),
        cells in prop::collection::vec((0u8..4, 0u16..30, 0u16..3, any::<bool>()), 0..12),
        background in prop::option::of(0u8..4),
        removed in 0u8..5,
        resized in 0u8..5,
    ) {
        let mut schedule = Schedule::new();
        for (handle, slots) in (0..).zip(lengths) {
            schedule.add_slotframe(handle, slots);
        }
        for (handle, slot, channel, receives) in cells {
            let options = if receives { CellOptions::RX } else { CellOptions::TX };
            // Cells that find no place are not of interest here.
            let _ = schedule.add(handle, Cell::new(slot, channel, options, None));
        }
        if let Some(handle) = background {
            let _ = schedule.set_background(handle, Some(9));
        }
        schedule.remove_slotframe(removed);
        let _ = schedule.resize(resized, 5);
        schedule.remove_where(1, |cell| cell.channel == 1);
        for asn in 0..200 {
            let first = schedule.cells_at(Asn(asn)).find(|at| at.cell.options.rx);
            prop_assert_eq!(schedule.listens(Asn(asn)), first);
        }
    }
}
