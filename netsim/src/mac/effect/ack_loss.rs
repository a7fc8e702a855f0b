//! Acknowledgments that do not come.

use super::{Burden, Effect, Entry, MOTES, Motes, Node, concerns};
use proto::config::{Default, Field, Kind, Range, Variant, typed};
use proto::effect::{About, Fit, Level, Need, Parameter};
use serde::Deserialize;

/// `kind = "ack-loss"`.
pub const ENTRY: Entry = Entry {
    variant: Variant {
        name: "ack-loss",
        doc: "Acknowledgments are lost more often than frames, so frames that have arrived are retransmitted.",
        fields: &[
            Field {
                key: "probability",
                doc: "Probability that an acknowledgment is lost, in addition to losses of the radio.",
                kind: Kind::Number(Range::FRACTION),
                default: Default::Required,
            },
            MOTES,
        ],
    },
    about: About {
        mechanism: "A receiver may switch to transmission too late, or its acknowledgment may fall outside the sender's \
                    listening window. It has the frame, but the sender does not know, retransmits it, and finally drops it.",
        equation: "P(acknowledged)' = P(acknowledged) * (1 - probability); several effects: the product",
        source: "IEEE Std 802.15.4-2015, 8.4.3.3 (macTsTxAckDelay, macTsAckWait); the asymmetry of data and acknowledgments: \
                 K. Srinivasan et al., An empirical study of low-power wireless, ACM TOSN 6(2), 2010.",
        validity: "Losses are independent of each other, of the neighbour and of the channel.",
        trace: "More retransmissions and longer latency than the signal strength explains, duplicates that the next hop \
                discards, and full queues; the delivery ratio suffers last.",
        needs: &[Need::Packets],
        example: "probability = 0.2\n",
    },
    fit: Fit {
        parameters: &[Parameter {
            key: "probability",
            unit: "",
            min: 0.0,
            max: 1.0,
            starts: &[0.1, 0.25, 0.5],
            step: 0.01,
        }],
        variants: &[],
        level: Level::Run,
        generalises: &[],
        ..Fit::PLAIN
    },
    needs_kept_time: false,
    build: |table| Some(Box::new(typed::<AckLoss>(table))),
};

/// Acknowledgments that do not come, though the frame did.
///
/// # Model
///
/// ```text
/// P(acknowledged)' = P(acknowledged) (1 − p)
/// ```
///
/// Of several effects that concern a mote the factors are multiplied: p = 1 − Π (1 − p_k). Acknowledgments are lost where the
/// receiver answers later than macTsTxAckDelay allows, or outside macTsAckWait: IEEE Std 802.15.4-2015, § 8.4.3.3.
///
/// # Arguments
///
/// * `probability` p: part of the acknowledgments that a mote sends and that are lost (1), 0 to 1.
/// * `motes`: the motes whose acknowledgments are lost; absent: all.
///
/// # Validity
///
/// Losses are independent of each other, of the neighbour and of the channel. Receivers that answer late in bursts lose several
/// acknowledgments of one frame, which costs more frames than this predicts. Not validated against hardware.
#[derive(Clone, Debug, PartialEq, Deserialize)]
pub struct AckLoss {
    /// Part that is lost.
    pub probability: f64,
    /// Whose acknowledgments; none: everybody's.
    pub motes: Motes,
}

impl Effect for AckLoss {
    fn name(&self) -> &'static str {
        ENTRY.variant.name
    }

    fn weigh(&self, node: Node, burden: &mut Burden) {
        if concerns(&self.motes, node.mote) {
            burden.ack_loss = 1.0 - (1.0 - burden.ack_loss) * (1.0 - self.probability);
        }
    }
}
