//! One cell for everything: RFC 8180.

use super::{Config, Configured, Context, Entry, MAX_SLOTS, PayloadCells, SchedulingFunction};
use crate::mac::{Cell, CellKind, CellOptions, Schedule};
use proto::config::{Section, variant};
use proto::ids::MoteId;
use serde::{Deserialize, Serialize};

/// `kind = "minimal"`.
pub const ENTRY: Entry = Entry {
    variant: variant::<Minimal>("minimal"),
    payload_cells: PayloadCells::Shared,
    build: |table, _| Some(Config::new(Minimal::read(table))),
};

/// Handle of the slotframe that holds the minimal cell.
pub const HANDLE: u8 = 0;

/// The minimal cell: slot 0, channel offset 0, with anyone, and beacons are sent in it (RFC 8180, § 4.1 and § 4.2).
#[must_use]
pub fn minimal_cell() -> Cell {
    Cell::new(0, 0, CellOptions::TX_RX_SHARED, None).of_kind(CellKind::Advertising)
}

/// Makes slotframe 0 of nothing but the minimal cell.
pub fn install(schedule: &mut Schedule, slotframe_slots: u16) {
    schedule.add_slotframe(HANDLE, slotframe_slots);
    schedule.add(HANDLE, minimal_cell()).expect("a slotframe has a slot 0");
}

/// The minimal configuration (RFC 8180): one shared cell at the beginning of the slotframe carries all frames.
///
/// Everybody contends for one slot of a slotframe, broadcast frames without back-off: right for a network that forms, and the
/// yardstick for anything better.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, Section)]
pub struct Minimal {
    /// Length of the slotframe (slots). RFC 8180 leaves it open. 7: Contiki-NG's; with 101, the 6TiSCH simulator's, one cell per
    /// second is too few for the keep-alives of ten motes.
    #[key(range = 1..=MAX_SLOTS, default = 7)]
    pub slotframe_slots: u16,
}

impl Configured for Minimal {
    type OfMote = Self;

    fn create(&self, _mote: MoteId) -> Self {
        self.clone()
    }
}

impl SchedulingFunction for Minimal {
    fn start(&mut self, _cx: &mut Context<'_>) {}

    fn stop(&mut self) {}

    fn slotframe_slots(&self) -> u16 {
        self.slotframe_slots
    }

    fn minimal_cell(&self) -> Option<u16> {
        Some(self.slotframe_slots)
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::{Bench, built};
    use super::*;
    use physics::asn::Asn;

    #[test]
    fn rfc8180_4_1_the_only_cell_is_shared_advertises_and_lies_at_slot_0() {
        let config = built("kind = \"minimal\"", 3);
        let bench = Bench::start(&config, MoteId(1));
        let cells: Vec<_> = bench.schedule.cells().collect();
        let [at] = cells[..] else { panic!("one cell, not {}", cells.len()) };
        assert_eq!((at.handle, at.cell.slot, at.cell.channel), (0, 0, 0));
        assert_eq!(at.cell.options, CellOptions::TX_RX_SHARED);
        assert_eq!((at.cell.neighbour, at.cell.kind), (None, CellKind::Advertising));
        assert_eq!(bench.schedule.slotframe(0).unwrap().slots(), 7);
        assert_eq!(bench.schedule.n_listening(Asn(70)), 10);
    }

    #[test]
    fn its_slotframe_is_as_long_as_configured() {
        let config = built("kind = \"minimal\"\nslotframe_slots = 101", 3);
        assert_eq!(config.slotframe_slots(), 101);
        assert_eq!(config.create(MoteId(0)).minimal_cell(), Some(101));
    }
}
