//! Queues with less room than thought.

use super::{Burden, Concerned, Effect, Entry, Node};
use proto::config::Section;
use proto::effect::{Catalogued, Level, Need};

/// `kind = "queue-limit"`.
pub const ENTRY: Entry = Entry::of::<QueueLimit>();

/// Queues hold fewer frames than configured, so packets are dropped under load.
///
/// # Mechanism
///
/// Other tasks use the memory, or reception and transmission share a buffer pool. A frame that arrives at a full queue is dropped.
///
/// # Equation
///
/// ```text
/// capacity = min(queue_frames, frames)
/// ```
///
/// # Source
///
/// Contiki-NG's pool of packet buffers (QUEUEBUF_CONF_NUM), which all neighbours share; IEEE Std 802.15.4-2015 leaves the length
/// open.
///
/// # Validity
///
/// Frames to all neighbours share the capacity. A frame in transmission counts.
///
/// # Trace
///
/// Bursts of packet loss where traffic converges, and shorter latency of the remaining packets; the links are unaffected.
#[derive(Clone, Debug, PartialEq, Catalogued, Section)]
#[effect(
    name = "queue-limit",
    needs = &[Need::Packets],
    example = "frames = 4\n",
    level = Level::Run,
)]
pub(crate) struct QueueLimit {
    /// Capacity of the queue (frames). The smaller of this and netsim.mac.queue_frames applies.
    #[key(range = 1..=10_000)]
    #[fit(unit = "frames", range = 1.0..=1e4, starts = [1.0, 2.0, 4.0], step = 1.0)]
    pub frames: u16,
    /// The motes that it concerns.
    #[key(flatten)]
    pub concerned: Concerned,
}

impl Effect for QueueLimit {
    fn weigh(&self, node: Node, burden: &mut Burden) {
        if self.concerned.includes(node.mote) {
            let most = burden.queue_frames.unwrap_or(u16::MAX);
            burden.queue_frames = Some(most.min(self.frames));
        }
    }
}
