//! Motes that take their time.

use super::{Burden, Concerned, Effect, Entry, Node};
use proto::config::Section;
use proto::effect::{Catalogued, Level, Need};
use proto::time::SimDuration;

/// `kind = "processing-delay"`.
pub const ENTRY: Entry = Entry::of::<ProcessingDelay>();

/// Every datagram takes processing time at each mote, so latency grows with each hop.
///
/// # Mechanism
///
/// Decompressing headers, encryption, and copying between radio and processor take time. A datagram that misses the cell for which
/// it was meant waits for the next one.
///
/// # Equation
///
/// ```text
/// latency' = latency + (hops * delay_s, each rounded up to the next cell of the mote); control messages of routing and
/// admission that are for one mote are delayed alike
/// ```
///
/// # Source
///
/// X. Vilajosana et al., A realistic energy consumption model for TSCH networks, IEEE Sensors J. 14(2), 2014 (what a mote's
/// processor does in and between slots); one constant time for it is an assumption.
///
/// # Validity
///
/// The delay is independent of the datagram's length and of the load; datagrams are processed in parallel. MAC and 6P are not
/// delayed.
///
/// # Trace
///
/// Latency too long in proportion to the number of hops, with nearly unchanged delivery ratio and join time.
#[derive(Clone, Debug, PartialEq, Catalogued, Section)]
#[effect(
    name = "processing-delay",
    needs = &[Need::Latencies],
    example = "delay_s = 0.5\n",
    level = Level::Run,
)]
pub(crate) struct ProcessingDelay {
    /// Time from the end of the slot in which a datagram arrives until it is in the queue (s).
    #[key(range = 0.0..=3600.0)]
    #[fit(unit = "s", starts = [0.25, 1.0, 4.0], step = 0.01)]
    pub delay_s: f64,
    /// The motes that it concerns.
    #[key(flatten)]
    pub concerned: Concerned,
}

impl Effect for ProcessingDelay {
    fn weigh(&self, node: Node, burden: &mut Burden) {
        if self.concerned.includes(node.mote) {
            burden.processing += SimDuration::from_seconds(self.delay_s);
        }
    }
}
