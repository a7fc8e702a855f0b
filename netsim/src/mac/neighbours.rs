//! Whom a mote has heard, and which of their frames it has had before.

use crate::wire::Eui64;
use physics::asn::Asn;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Neighbours, ascending by address: in columns, since of most frames only the address and the number are looked at.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Neighbours {
    addresses: Vec<Eui64>,
    /// Of each, the sequence number of its newest frame, continued beyond 255.
    newest: Vec<u64>,
    /// Of each, the numbers of the latest frames for us, continued likewise, and when each was heard first (ASN).
    known: Vec<Vec<(u64, Asn)>>,
    /// Of those that were forgotten, ascending by address: what they would send again is still known.
    before: BTreeMap<Eui64, (u64, Vec<(u64, Asn)>)>,
    /// All that have sent a beacon lately, ascending by address, and when each did so last (ASN).
    with_beacons: Vec<(Eui64, Asn)>,
    #[serde(skip)]
    next: Next,
}

/// Where the neighbour stands that is probably heard next: behind the one heard last, since motes that take turns do so in
/// the order of their addresses. A guess, and so no part of the state: all are equal.
#[derive(Clone, Copy, Debug, Default)]
struct Next(usize);

impl PartialEq for Next {
    fn eq(&self, _: &Self) -> bool {
        true
    }
}

impl Eq for Next {}

/// Retransmissions of a frame come within so many newer ones for the same mote,
const N_REMEMBERED: usize = 8;
/// and within so many slots: the longest back-off, 127 shared cells, in slotframes of 101 slots. A number that comes back
/// later has been used again: there are 256 only.
const REPEATED_WITHIN_SLOTS: u64 = 127 * 101;

/// The number that a frame's 8 bits stand for: the nearest to the newest one.
fn continued(newest: u64, sequence: u8) -> u64 {
    let ahead = sequence.wrapping_sub(newest as u8).cast_signed();
    newest.saturating_add_signed(i64::from(ahead))
}

impl Neighbours {
    /// How many there are.
    #[must_use]
    pub fn len(&self) -> usize {
        self.addresses.len()
    }

    /// Whether there are none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.addresses.is_empty()
    }

    /// Number of those that have sent a beacon since then, forgotten ones included: a mote that has lost the network comes
    /// back to the same crowd. Nothing is known later of what was before.
    pub(crate) fn n_with_beacons(&mut self, since_asn: Asn) -> usize {
        self.with_beacons.retain(|(_, asn)| since_asn <= *asn);
        self.with_beacons.len()
    }

    /// Their addresses, ascending.
    pub fn addresses(&self) -> impl Iterator<Item = Eui64> + '_ {
        self.addresses.iter().copied()
    }

    /// Forgets them all, but not which of their frames it has had: the acknowledgment of the last may have been lost. So
    /// it is over a restart as well, where a secured network keeps its frame counters (IEEE Std 802.15.4-2015, 9.2).
    pub fn forget(&mut self) {
        let numbers =
            std::mem::take(&mut self.newest).into_iter().zip(std::mem::take(&mut self.known));
        let of_each = std::mem::take(&mut self.addresses).into_iter().zip(numbers);
        self.before.extend(of_each.filter(|(_, (_, known))| !known.is_empty()));
    }

    /// A frame from a neighbour, with its sequence number; `None`: a beacon, whose numbers are others. Returns whether it is new:
    /// not one for us that was received before and is sent again because the acknowledgment was lost (IEEE Std 802.15.4-2015,
    /// 6.7.2).
    #[inline]
    pub fn hear(&mut self, address: Eui64, sequence: Option<u8>, for_us: bool, asn: Asn) -> bool {
        let Next(next) = self.next;
        let is_next = self.addresses.get(next) == Some(&address);
        let place = if is_next { next } else { self.place_of(address, sequence) };
        self.next = Next(place + 1);
        let Some(sequence) = sequence else {
            match self.with_beacons.binary_search_by_key(&address, |&(other, _)| other) {
                Ok(place) => self.with_beacons[place].1 = asn,
                Err(place) => self.with_beacons.insert(place, (address, asn)),
            }
            return true;
        };
        let newest = &mut self.newest[place];
        let number = continued(*newest, sequence);
        *newest = number.max(*newest);
        if !for_us {
            return true;
        }
        let known = &mut self.known[place];
        known.retain(|&(_, since_asn)| asn - since_asn <= REPEATED_WITHIN_SLOTS);
        if known.iter().any(|&(known, _)| known == number) {
            return false;
        }
        known.insert(0, (number, asn));
        known.truncate(N_REMEMBERED);
        true
    }

    /// Where a neighbour stands, which is added if it has not been heard before.
    fn place_of(&mut self, address: Eui64, sequence: Option<u8>) -> usize {
        self.addresses.binary_search(&address).unwrap_or_else(|place| {
            let (newest, known) = self
                .before
                .remove(&address)
                .unwrap_or_else(|| (256 + u64::from(sequence.unwrap_or_default()), Vec::new()));
            self.addresses.insert(place, address);
            self.newest.insert(place, newest);
            self.known.insert(place, known);
            place
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proto::ids::MoteId;

    #[test]
    fn a_frame_sent_again_is_recognised_and_a_number_used_again_is_not() {
        let mut neighbours = Neighbours::default();
        let [a, b] = [1, 2].map(MoteId).map(Eui64::of_mote);
        assert!(neighbours.hear(a, Some(250), true, Asn(1)));
        assert!(!neighbours.hear(a, Some(250), true, Asn(2)));
        assert!(neighbours.hear(b, Some(250), true, Asn(3)));
        // A frame of higher priority in between.
        assert!(neighbours.hear(a, Some(251), true, Asn(4)));
        assert!(!neighbours.hear(a, Some(250), true, Asn(5)));
        for sequence in 0..8 {
            assert!(neighbours.hear(a, Some(sequence), true, Asn(6)));
        }
        assert!(neighbours.hear(a, Some(250), true, Asn(7)));
        assert_eq!(neighbours.len(), 2);
    }

    #[test]
    fn neighbours_that_send_beacons_are_counted_by_themselves() {
        let mut neighbours = Neighbours::default();
        let [a, b, c] = [1, 2, 3].map(MoteId).map(Eui64::of_mote);
        let heard = [(b, None), (a, Some(1)), (c, None), (b, Some(7)), (b, None)];
        for (asn, (from, sequence)) in (1..).zip(heard) {
            neighbours.hear(from, sequence, false, Asn(asn));
        }
        assert_eq!((neighbours.len(), neighbours.n_with_beacons(Asn(0))), (3, 2));
        assert_eq!(neighbours.n_with_beacons(Asn(3)), 2);
        assert_eq!(neighbours.n_with_beacons(Asn(4)), 1);
        neighbours.forget();
        assert_eq!((neighbours.len(), neighbours.n_with_beacons(Asn(0))), (0, 1));
    }

    #[test]
    fn what_was_received_before_synchronisation_was_lost_is_recognised_after_it() {
        let mut neighbours = Neighbours::default();
        let [a, b] = [1, 2].map(MoteId).map(Eui64::of_mote);
        assert!(neighbours.hear(a, Some(7), true, Asn(1)));
        assert!(neighbours.hear(b, Some(7), false, Asn(2)));
        neighbours.forget();
        assert!(neighbours.is_empty());
        assert!(!neighbours.hear(a, Some(7), true, Asn(3)));
        assert!(neighbours.hear(b, Some(7), true, Asn(4)));
        assert!(neighbours.hear(a, Some(8), true, Asn(5)));
    }

    #[test]
    fn a_number_that_comes_again_after_256_frames_is_a_new_frame() {
        let mut neighbours = Neighbours::default();
        let a = Eui64::of_mote(MoteId(1));
        // One frame in a hundred is for us; some of the others are heard, beacons without a number among them.
        for frame in 0..20_000_u64 {
            let for_us = frame % 100 == 0;
            if for_us || frame % 7 == 0 {
                let sequence = Some(frame as u8);
                assert!(neighbours.hear(a, sequence, for_us, Asn(frame)), "{frame}");
                assert_eq!(neighbours.hear(a, sequence, for_us, Asn(frame)), !for_us);
                neighbours.hear(a, None, false, Asn(frame));
            }
        }
        // Nothing was heard for long: nobody repeats a frame after that.
        assert!(neighbours.hear(a, Some(32), true, Asn(20_001)));
        assert!(neighbours.hear(a, Some(32), true, Asn(40_000)));
    }
    #[test]
    fn neighbours_are_kept_in_order_however_they_are_heard() {
        let mut neighbours = Neighbours::default();
        for mote in [5, 2, 9, 2, 5, 9, 3, 5, 2, 3, 5, 9, 9, 2] {
            neighbours.hear(Eui64::of_mote(MoteId(mote)), None, false, Asn(0));
        }
        let expected = [2, 3, 5, 9].map(MoteId).map(Eui64::of_mote);
        assert!(neighbours.addresses().eq(expected));
    }
}
