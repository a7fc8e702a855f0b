//! Queues with less room than thought.

use super::{Burden, Effect, Entry, MOTES, Motes, Node, concerns};
use proto::config::{Default, Field, Kind, Variant, typed};
use proto::effect::{About, Fit, Level, Need, Parameter};
use serde::Deserialize;

/// `kind = "queue-limit"`.
pub const ENTRY: Entry = Entry {
    variant: Variant {
        name: "queue-limit",
        doc: "Queues hold fewer frames than configured, so packets are dropped under load.",
        fields: &[
            Field {
                key: "frames",
                doc: "Capacity of the queue (frames). The smaller of this and netsim.mac.queue_frames applies.",
                kind: Kind::Integer { min: 1, max: 10_000 },
                default: Default::Required,
            },
            MOTES,
        ],
    },
    about: About {
        mechanism: "Other tasks use the memory, or reception and transmission share a buffer pool. A frame that arrives at \
                    a full queue is dropped.",
        equation: "capacity = min(queue_frames, frames)",
        source: "Contiki-NG's pool of packet buffers (QUEUEBUF_CONF_NUM), which all neighbours share; IEEE Std 802.15.4-2015 leaves \
                 the length open.",
        validity: "Frames to all neighbours share the capacity. A frame in transmission counts.",
        trace: "Bursts of packet loss where traffic converges, and shorter latency of the remaining packets; the links are \
                unaffected.",
        needs: &[Need::Packets],
        example: "frames = 4\n",
    },
    fit: Fit {
        parameters: &[Parameter {
            key: "frames",
            unit: "frames",
            min: 1.0,
            max: 1e4,
            starts: &[1.0, 2.0, 4.0],
            step: 1.0,
        }],
        variants: &[],
        level: Level::Run,
        generalises: &[],
        ..Fit::PLAIN
    },
    needs_kept_time: false,
    build: |table| Some(Box::new(typed::<QueueLimit>(table))),
};

/// Queues with less room.
///
/// # Model
///
/// ```text
/// capacity = min(queue_frames, n)
/// ```
///
/// Of several effects that concern a mote the least n holds. IEEE Std 802.15.4-2015 leaves the length of queues open; in
/// Contiki-NG all neighbours share a pool of packet buffers (`QUEUEBUF_CONF_NUM`).
///
/// # Arguments
///
/// * `frames` n: frames for which a mote has room, at least 1; the lesser of this and `netsim.mac.queue_frames` holds.
/// * `motes`: the motes with less room; absent: all.
///
/// # Validity
///
/// Frames for all neighbours share the room, whatever their length, and a frame that is being sent takes a place. Buffers that
/// receiving shares with sending, or that are counted in bytes, fill in another order. Not validated against hardware.
#[derive(Clone, Debug, PartialEq, Deserialize)]
pub struct QueueLimit {
    /// Frames for which there is room.
    pub frames: u16,
    /// Whose; none: everybody's.
    pub motes: Motes,
}

impl Effect for QueueLimit {
    fn name(&self) -> &'static str {
        ENTRY.variant.name
    }

    fn weigh(&self, node: Node, burden: &mut Burden) {
        if concerns(&self.motes, node.mote) {
            let most = burden.queue_frames.unwrap_or(u16::MAX);
            burden.queue_frames = Some(most.min(self.frames));
        }
    }
}
