//! What holds for every scheduling function.

use super::testing::{Bench, built};
use super::*;

/// Keys that some require, or that change what they do.
const KEYS: &[(&str, &str)] = &[
    ("emsf", "\nquantile = 0.99"),
    ("rrsf", "\nshared_slots = 2"),
    ("rrsf", " # compat.shared_slot_0"),
    ("orchestra", ""),
    (
        "orchestra",
        "\nrules = [\"eb-per-time-source\", \"unicast-storing\", \"special-for-root\", \"default-common\"]",
    ),
    ("alice", " # storing"),
    (
        "static",
        "\nslotframe_slots = 3\n[[cell]]\nslot = 1\nfrom = \"any\"\nto = \"all\"\nadvertising = true",
    ),
];

/// Every scheduling function of the list that gives motes cells: with [`KEYS`], or with its defaults.
fn of_each_kind() -> Vec<String> {
    let entries = BUILT_IN.iter().filter(|entry| entry.payload_cells != PayloadCells::None);
    let names = entries.map(|entry| entry.variant.name);
    let plain = names.filter(|name| KEYS.iter().all(|(known, _)| known != name));
    let all = plain.map(|name| (name, "")).chain(KEYS.iter().copied());
    all.map(|(name, keys)| format!("kind = {name:?}{keys}")).collect()
}

#[test]
fn every_kind_can_be_stored_and_goes_on_from_there() {
    for text in of_each_kind() {
        let config = built(&text, 9);
        for mote in 0..9 {
            let mut bench = Bench::start(&config, MoteId(mote));
            bench.tell(|sf, cx| sf.handle_beacon(cx, Eui64::of_mote(MoteId(0)), 0));
            bench.set_parent(Some(Eui64::of_mote(MoteId((mote + 1) % 9))));
            bench.tell(|sf, cx| sf.handle_child(cx, Eui64::of_mote(MoteId((mote + 8) % 9)), true));
            let stored = postcard::to_allocvec(&(&bench.sf, &bench.schedule)).unwrap();
            let (mut sf, schedule): (AnySf, Schedule) = postcard::from_bytes(&stored).unwrap();
            assert_eq!(sf, bench.sf);
            assert!(sf.resume(&config));
            assert_eq!((&sf, &schedule), (&bench.sf, &bench.schedule));
        }
    }
}

#[test]
fn every_kind_of_frame_finds_a_cell_that_transmits_it() {
    for text in of_each_kind() {
        let config = built(&text, 9);
        let mut bench = Bench::start(&config, MoteId(4));
        bench.set_parent(Some(Eui64::of_mote(MoteId(2))));
        if text.contains("sotdma") {
            // It listens before it takes a slot.
            (0..3).for_each(|_| bench.pass_time());
        }
        for neighbour in [2, 3] {
            let neighbour = Eui64::of_mote(MoteId(neighbour));
            bench.tell(|sf, cx| sf.handle_queue(cx, neighbour, true));
            for traffic in [Traffic::Beacon, Traffic::Broadcast, Traffic::Unicast(neighbour)] {
                let handle = bench.sf.slotframe_of(traffic);
                let carries = |at: &CellRef| {
                    let fits = match traffic {
                        Traffic::Beacon => at.cell.kind != crate::mac::CellKind::Normal,
                        Traffic::Broadcast | Traffic::Payload => at.cell.neighbour.is_none(),
                        Traffic::Unicast(to) => at.cell.neighbour.is_none_or(|n| n == to),
                    };
                    at.cell.options.tx && fits && handle.is_none_or(|handle| handle == at.handle)
                };
                assert!(bench.schedule.cells().any(|at| carries(&at)), "{text}: {traffic:?}");
            }
        }
    }
}
