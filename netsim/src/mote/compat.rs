//! `[netsim.compat]`: behaviour of the 6TiSCH simulator and of BotNet that the standards do not have, for comparisons
//! with their figures. All off by default. These and no others.

use proto::config::Section;
use serde::{Deserialize, Serialize};

/// Non-standard behaviour of the 6TiSCH simulator and of BotNet, for comparisons with their results.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, Section)]
pub struct Compat {
    /// The round-robin slotframe has N slots, and slot 0 is the shared minimal cell, so mote 0 has no slot of its own. In shared
    /// cells the back-off restarts with every frame, and a keep-alive misses the slot in which it is due. Queues know two
    /// priorities: 6P and keep-alive frames, and all others.
    #[key(default = false)]
    pub shared_slot_0: bool,
    /// A mote with an empty queue sends a beacon in an advertising cell with probability 0.33/(1 + n), instead of one every
    /// beacon_period_s. n is the number of neighbours that it has ever heard, during joining included.
    #[key(default = false)]
    pub eb_rule: bool,
    /// Headers have zero length: a datagram is as long as its payload, and is fragmented only beyond 90 bytes.
    #[key(default = false)]
    pub no_frame_overhead: bool,
    /// Trickle never suppresses a DIO, and every DIO of a mote with a parent restarts the minimum interval.
    #[key(default = false)]
    pub no_trickle_suppression: bool,
    /// Acknowledgments are never lost and never collide.
    #[key(default = false)]
    pub perfect_acks: bool,
    /// A mote updates its rank only when its own link changes, not when its parent announces another rank, and keeps a lost parent
    /// as time source. ETX is 3 until 100 frames were sent to a neighbour in dedicated cells, and is then updated every 100 frames.
    /// It looks for no other parent, and leaves its own for a gain above the threshold only.
    #[key(default = false)]
    pub stale_rank: bool,
}
