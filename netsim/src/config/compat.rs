//! `[netsim.compat]`: behaviour of the 6TiSCH simulator and of BotNet that the standards do not have, for comparisons
//! with their figures. All off by default. These and no others.

use proto::config::{Default, Field, Kind, TableSpec};
use serde::{Deserialize, Serialize};

/// What is done as the peers do it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Compat {
    /// Slot 0 of the round robin is the minimal cell, shared by all, in which motes contend as in the
    /// 6TiSCH simulator.
    pub shared_slot_0: bool,
    /// Beacons by chance in idle cells.
    pub eb_rule: bool,
    /// Headers have no length.
    pub no_frame_overhead: bool,
    /// Trickle never suppresses, and begins anew with every DIO.
    pub no_trickle_suppression: bool,
    /// Acknowledgments always arrive.
    pub perfect_acks: bool,
    /// A parent's new rank does not change one's own, and ETX is counted by hundreds.
    pub stale_rank: bool,
}

const fn off(key: &'static str, doc: &'static str) -> Field {
    Field { key, doc, kind: Kind::Bool, default: Default::Bool(false) }
}

/// Description of `[netsim.compat]`.
pub const SPEC: TableSpec = TableSpec {
    doc: "Behaviour of the 6TiSCH simulator and of BotNet that the standards do not have, for comparisons with their \
          figures.",
    fields: &[
        off(
            "shared_slot_0",
            "The round robin's slotframe has N slots, and slot 0 is the minimal cell that all share: mote 0 has no slot of \
             its own. In shared cells back-off begins anew with every frame, \
             and a keep-alive comes too late for the slot in which it falls due.",
        ),
        off(
            "eb_rule",
            "A mote whose queue is empty sends a beacon in an advertising cell with probability 0.33/(1 + n), n being the \
             neighbours it has ever heard, be it while it looked for a network, in place of one every beacon_period_s.",
        ),
        off(
            "no_frame_overhead",
            "Headers have no length: a datagram is as long as its payload, and is sent in parts only beyond 90 bytes.",
        ),
        off(
            "no_trickle_suppression",
            "Trickle's counter never suppresses a DIO, and every DIO that leaves a mote with a parent begins the mote's \
             shortest interval anew.",
        ),
        off("perfect_acks", "Acknowledgments are never lost and never collide."),
        off(
            "stale_rank",
            "A mote computes its rank anew only when its own link changes, not when its parent announces another rank, and \
             keeps the time of a parent that it has lost. ETX is \
             3 until 100 frames have gone to a neighbour in cells for it alone, and then theirs until the next 100 have.",
        ),
    ],
    tag: None,
};
