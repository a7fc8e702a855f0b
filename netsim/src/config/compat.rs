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
    doc: "Non-standard behaviour of the 6TiSCH simulator and of BotNet, for comparisons with their results.",
    fields: &[
        off(
            "shared_slot_0",
            "The round-robin slotframe has N slots, and slot 0 is the shared minimal cell, so mote 0 has no slot of its \
             own. In shared cells the back-off restarts with every frame, and a keep-alive misses the slot in which it is \
             due. Queues know two priorities: 6P and keep-alive frames, and all others.",
        ),
        off(
            "eb_rule",
            "A mote with an empty queue sends a beacon in an advertising cell with probability 0.33/(1 + n), instead of \
             one every beacon_period_s. n is the number of neighbours that it has ever heard, during joining included.",
        ),
        off(
            "no_frame_overhead",
            "Headers have zero length: a datagram is as long as its payload, and is fragmented only beyond 90 bytes.",
        ),
        off(
            "no_trickle_suppression",
            "Trickle never suppresses a DIO, and every DIO of a mote with a parent restarts the minimum interval.",
        ),
        off("perfect_acks", "Acknowledgments are never lost and never collide."),
        off(
            "stale_rank",
            "A mote updates its rank only when its own link changes, not when its parent announces another rank, and keeps \
             a lost parent as time source. ETX is 3 until 100 frames were sent to a neighbour in dedicated cells, and is \
             then updated every 100 frames. It looks for no other parent, and leaves its own for a gain above the \
             threshold only.",
        ),
    ],
    tag: None,
};
