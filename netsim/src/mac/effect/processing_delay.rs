//! Motes that take their time.

use super::{Burden, Effect, Entry, MOTES, Motes, Node, concerns};
use proto::config::{Default, Field, Kind, Range, Variant, typed};
use proto::effect::{About, Fit, Level, Need, Parameter};
use serde::Deserialize;

/// `kind = "processing-delay"`.
pub const ENTRY: Entry = Entry {
    variant: Variant {
        name: "processing-delay",
        doc: "Every datagram takes processing time at each mote, so latency grows with each hop.",
        fields: &[
            Field {
                key: "delay_s",
                doc: "Time from the end of the slot in which a datagram arrives until it is in the queue (s).",
                kind: Kind::Number(Range::closed(0.0, 3600.0)),
                default: Default::Required,
            },
            MOTES,
        ],
    },
    about: About {
        mechanism: "Decompressing headers, encryption, and copying between radio and processor take time. A datagram that \
                    misses the cell for which it was meant waits for the next one.",
        equation: "latency' = latency + (hops * delay_s, each rounded up to the next cell of the mote); control messages of routing \
                   and admission that are for one mote are delayed alike",
        source: "X. Vilajosana et al., A realistic energy consumption model for TSCH networks, IEEE Sensors J. 14(2), 2014 (what a \
                 mote's processor does in and between slots); one constant time for it is an assumption.",
        validity: "The delay is independent of the datagram's length and of the load; datagrams are processed in parallel. \
                   MAC and 6P are not delayed.",
        trace: "Latency too long in proportion to the number of hops, with nearly unchanged delivery ratio and join time.",
        needs: &[Need::Latencies],
        example: "delay_s = 0.5\n",
    },
    fit: Fit {
        parameters: &[Parameter {
            key: "delay_s",
            unit: "s",
            min: 0.0,
            max: 3600.0,
            starts: &[0.25, 1.0, 4.0],
            step: 0.01,
        }],
        variants: &[],
        level: Level::Run,
        generalises: &[],
        ..Fit::PLAIN
    },
    needs_kept_time: false,
    build: |table| Some(Box::new(typed::<ProcessingDelay>(table))),
};

/// Datagrams wait for the processor.
///
/// # Model
///
/// ```text
/// a datagram that comes in the slot that ends at t is in the queue at t + w, and is sent in the next cell after that
/// ```
///
/// Of several effects that concern a mote the times w are added. That a mote's processor works in and between slots: Vilajosana
/// et al., "A realistic energy consumption model for TSCH networks", IEEE Sensors J. 14(2), 2014; one constant time for it is an
/// assumption.
///
/// # Arguments
///
/// * `delay_s` w: from the end of the slot in which a datagram comes until it is in the queue (s), not negative.
/// * `motes`: the motes that take this time; absent: all.
///
/// # Validity
///
/// The time is the same for every datagram, whatever its length and the load, and many are worked on at once: a real processor
/// works on one after the other, so that under load this predicts too short a latency. Frames for everyone, MAC and 6P are
/// not delayed. Not validated against hardware.
#[derive(Clone, Debug, PartialEq, Deserialize)]
pub struct ProcessingDelay {
    /// How long (s).
    pub delay_s: f64,
    /// At which motes; none: at all.
    pub motes: Motes,
}

impl Effect for ProcessingDelay {
    fn name(&self) -> &'static str {
        ENTRY.variant.name
    }

    fn weigh(&self, node: Node, burden: &mut Burden) {
        if concerns(&self.motes, node.mote) {
            burden.processing_ns += (self.delay_s * 1e9).round() as u64;
        }
    }
}
