//! No scheduling function but a bound: who sends in which slot is decided in one place, by somebody who knows everything.

use super::{Config, Configured, Context, Entry, PayloadCells, SchedulingFunction};
use proto::config::Variant;
use proto::ids::MoteId;
use serde::{Deserialize, Serialize};

/// `kind = "oracle"`.
pub const ENTRY: Entry = Entry {
    variant: Variant {
        name: "oracle",
        doc: "An upper bound for protocols: a central scheduler that knows all positions and queues assigns each slot. There \
              are no beacons, joining, routing messages or routing headers.",
        fields: &[],
    },
    payload_cells: PayloadCells::None,
    build: |_, _| Some(Config::new(OracleConfig {})),
};

/// A network whose slots are shared out in one place. The scheduler itself is the mesh's: `mesh/oracle.rs`.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct OracleConfig {}

/// What a mote decides on: nothing.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Oracle {}

impl Configured for OracleConfig {
    type OfMote = Oracle;

    fn create(&self, _mote: MoteId) -> Oracle {
        Oracle {}
    }
}

impl SchedulingFunction for Oracle {
    fn start(&mut self, _cx: &mut Context<'_>) {}

    fn stop(&mut self) {}

    fn slotframe_slots(&self) -> u16 {
        1
    }

    fn minimal_cell(&self) -> Option<u16> {
        None
    }
}
