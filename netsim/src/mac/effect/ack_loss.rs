//! Acknowledgments that do not come.

use super::{Burden, Concerned, Effect, Entry, Node};
use proto::config::{Range, Section};
use proto::effect::{Catalogued, Level, Need};

/// `kind = "ack-loss"`.
pub const ENTRY: Entry = Entry::of::<AckLoss>();

/// Acknowledgments are lost more often than frames, so frames that have arrived are retransmitted.
///
/// # Mechanism
///
/// A receiver may switch to transmission too late, or its acknowledgment may fall outside the sender's listening window. It has the
/// frame, but the sender does not know, retransmits it, and finally drops it.
///
/// # Equation
///
/// ```text
/// P(acknowledged)' = P(acknowledged) * (1 - probability); several effects: the product
/// ```
///
/// # Source
///
/// IEEE Std 802.15.4-2015, 8.4.3.3 (macTsTxAckDelay, macTsAckWait); the asymmetry of data and acknowledgments: K. Srinivasan et
/// al., An empirical study of low-power wireless, ACM TOSN 6(2), 2010.
///
/// # Validity
///
/// Losses are independent of each other, of the neighbour and of the channel.
///
/// # Trace
///
/// More retransmissions and longer latency than the signal strength explains, duplicates that the next hop discards, and full
/// queues; the delivery ratio suffers last.
#[derive(Clone, Debug, PartialEq, Catalogued, Section)]
#[effect(
    name = "ack-loss",
    needs = &[Need::Packets],
    example = "probability = 0.2\n",
    level = Level::Run,
)]
pub(crate) struct AckLoss {
    /// Probability that an acknowledgment is lost, in addition to losses of the radio.
    #[key(range = Range::FRACTION)]
    #[fit(unit = "", range = 0.0..=1.0, starts = [0.1, 0.25, 0.5], step = 0.01)]
    pub probability: f64,
    /// The motes that it concerns.
    #[key(flatten)]
    pub concerned: Concerned,
}

impl Effect for AckLoss {
    fn weigh(&self, node: Node, burden: &mut Burden) {
        if self.concerned.includes(node.mote) {
            burden.ack_loss = 1.0 - (1.0 - burden.ack_loss) * (1.0 - self.probability);
        }
    }
}
