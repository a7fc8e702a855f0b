//! Which copy of a payload a receiver takes, if both media carry it.
//!
//! A copy is known by its sender and by the control period in which it was sent, as by a sequence number.

use proto::ids::MoteId;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// The payloads that each receiver has taken.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Copies(Vec<BTreeMap<u32, Window>>);

/// Control periods whose payload was taken from one sender.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
struct Window {
    /// The latest one.
    latest: u64,
    /// Bit i: the one i before it.
    taken: u64,
}

impl Copies {
    pub(super) fn new(agent_count: usize) -> Self {
        Self(vec![BTreeMap::new(); agent_count])
    }

    pub(super) fn is_of(&self, agent_count: usize) -> bool {
        self.0.len() == agent_count
    }

    /// Whether a copy is the first one; it is taken then. Copies that are 64 periods late count as first.
    pub(super) fn is_first(&mut self, receiver: MoteId, sender: MoteId, period: u64) -> bool {
        let window =
            self.0[receiver.index()].entry(sender.0).or_insert(Window { latest: period, taken: 0 });
        if window.latest < period {
            window.taken = window.taken.checked_shl((period - window.latest) as u32).unwrap_or(0);
            if 64 <= period - window.latest {
                window.taken = 0;
            }
            window.latest = period;
        }
        let age = window.latest - period;
        if 64 <= age {
            return true;
        }
        let is_first = window.taken & (1 << age) == 0;
        window.taken |= 1 << age;
        is_first
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_period_of_each_sender_is_taken_once_in_whatever_order_copies_come() {
        let mut copies = Copies::new(3);
        let mut first = |receiver, sender, period| copies.is_first(receiver, sender, period);
        assert!(first(MoteId(0), MoteId(1), 5));
        assert!(!first(MoteId(0), MoteId(1), 5));
        assert!(first(MoteId(0), MoteId(2), 5), "of another sender");
        assert!(first(MoteId(2), MoteId(1), 5), "at another receiver");
        assert!(first(MoteId(0), MoteId(1), 8));
        assert!(first(MoteId(0), MoteId(1), 7), "late, and the first of its period");
        assert!(!first(MoteId(0), MoteId(1), 5));
        assert!(!first(MoteId(0), MoteId(1), 7));
        assert!(first(MoteId(0), MoteId(1), 8 + 64), "all before are forgotten");
        assert!(first(MoteId(0), MoteId(1), 9));
        assert!(!first(MoteId(0), MoteId(1), 9));
        assert!(first(MoteId(0), MoteId(1), u64::MAX));
        assert!(!first(MoteId(0), MoteId(1), u64::MAX));
    }
}
