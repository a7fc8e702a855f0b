//! In which slot which mote has something to do.

use physics::asn::Asn;
use proto::ids::MoteId;
use serde::{Deserialize, Serialize};
use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// The next slot of every mote, and all of them in order. Slots in which nobody acts are never looked at.
///
/// Most motes act again within a slotframe: what is that near stands in a list for each slot, and only what is later in a heap
/// (Varghese and Lauck: "Hashed and Hierarchical Timing Wheels", SOSP 1987, scheme 4).
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(from = "Vec<Asn>", into = "Vec<Asn>")]
pub struct Calendar {
    /// By mote; [`Asn::NEVER`]: it sleeps until something reaches it.
    wake: Vec<Asn>,
    /// The slot after the latest one that was taken.
    begin_asn: Asn,
    /// By slot modulo [`NEAR_SLOTS`], of those from `begin_asn` on: who acts there, and outdated entries.
    near: Vec<Vec<MoteId>>,
    /// By list, a bit: it has entries.
    has_entries: [u64; NEAR_SLOTS as usize / 64],
    /// Entries of other slots, and outdated ones. With those of `near` at least the entries of `wake`.
    heap: BinaryHeap<Reverse<(Asn, MoteId)>>,
}

/// Slots that have lists: more than most slotframes have.
const NEAR_SLOTS: u64 = 256;

impl From<Vec<Asn>> for Calendar {
    fn from(wake: Vec<Asn>) -> Self {
        let entries = (0..).zip(&wake).filter(|(_, asn)| **asn != Asn::NEVER);
        let heap = entries.map(|(mote, &asn)| Reverse((asn, MoteId(mote)))).collect();
        Self {
            wake,
            begin_asn: Asn::FIRST,
            near: vec![Vec::new(); NEAR_SLOTS as usize],
            has_entries: [0; NEAR_SLOTS as usize / 64],
            heap,
        }
    }
}

impl From<Calendar> for Vec<Asn> {
    fn from(calendar: Calendar) -> Self {
        calendar.wake
    }
}

impl PartialEq for Calendar {
    fn eq(&self, other: &Self) -> bool {
        self.wake == other.wake
    }
}

impl Calendar {
    /// Nothing to do for `n` motes.
    #[must_use]
    pub fn new(n: usize) -> Self {
        Self::from(vec![Asn::NEVER; n])
    }

    /// The mote acts in this slot, and not before; `None`: it sleeps until something reaches it.
    pub fn set(&mut self, mote: MoteId, asn: Option<Asn>) {
        let asn = asn.unwrap_or(Asn::NEVER);
        let entry = &mut self.wake[mote.index()];
        if *entry == asn {
            return;
        }
        *entry = asn;
        if self.is_near(asn) {
            let list = (asn % NEAR_SLOTS) as usize;
            self.near[list].push(mote);
            self.has_entries[list / 64] |= 1 << (list % 64);
        } else if asn != Asn::NEVER {
            self.heap.push(Reverse((asn, mote)));
        }
    }

    fn is_near(&self, asn: Asn) -> bool {
        self.begin_asn <= asn && asn - self.begin_asn < NEAR_SLOTS
    }

    /// The first slot in which somebody acts.
    pub fn next_asn(&mut self) -> Option<Asn> {
        let near = self.next_near();
        loop {
            let Some(&Reverse((asn, mote))) = self.heap.peek() else { return near };
            if near.is_some_and(|near| near <= asn) {
                return near;
            }
            if self.wake[mote.index()] == asn {
                return Some(asn);
            }
            self.heap.pop();
        }
    }

    /// The first slot with a list in which somebody acts. Lists before it are emptied: their entries are outdated.
    fn next_near(&mut self) -> Option<Asn> {
        let first = self.begin_asn % NEAR_SLOTS;
        let mut ahead = 0;
        while ahead < NEAR_SLOTS {
            let list = (first + ahead) % NEAR_SLOTS;
            let word = self.has_entries[list as usize / 64] >> (list % 64);
            if word == 0 {
                // None up to the end of the word.
                ahead += 64 - list % 64;
                continue;
            }
            let skipped = u64::from(word.trailing_zeros());
            ahead += skipped;
            if NEAR_SLOTS <= ahead {
                break;
            }
            let (asn, list) = (self.begin_asn + ahead, (list + skipped) as usize);
            if self.near[list].iter().any(|&mote| self.wake[mote.index()] == asn) {
                return Some(asn);
            }
            self.near[list].clear();
            self.has_entries[list / 64] &= !(1 << (list % 64));
        }
        None
    }

    /// Takes out those who act in the first slot in which somebody does, in ascending order. Each is then without an entry.
    pub fn take(&mut self, asn: Asn, motes: &mut Vec<MoteId>) {
        motes.clear();
        let is_near = self.is_near(asn);
        let wake = &mut self.wake;
        let mut take = |mote: MoteId, at: Asn| {
            let entry = &mut wake[mote.index()];
            if *entry == at {
                *entry = Asn::NEVER;
                motes.push(mote);
            }
        };
        if is_near {
            let list = (asn % NEAR_SLOTS) as usize;
            self.near[list].drain(..).for_each(|mote| take(mote, asn));
            self.has_entries[list / 64] &= !(1 << (list % 64));
        }
        while let Some(&Reverse((at, mote))) = self.heap.peek() {
            if asn < at {
                break;
            }
            self.heap.pop();
            take(mote, at);
        }
        motes.sort_unstable();
        self.begin_asn = self.begin_asn.max(asn + 1);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dice::Dice;
    use proto::rng::Purpose;

    #[test]
    fn motes_come_in_order_once_and_as_last_said() {
        let mut calendar = Calendar::new(4);
        for (mote, asn) in [(2, 5), (1, 5), (0, 9), (3, 5), (0, 7), (3, 6), (3, 5)] {
            calendar.set(MoteId(mote), Some(Asn(asn)));
        }
        let mut motes = Vec::new();
        assert_eq!(calendar.next_asn(), Some(Asn(5)));
        calendar.take(Asn(5), &mut motes);
        assert_eq!(motes, [1, 2, 3].map(MoteId));
        assert_eq!(calendar.next_asn(), Some(Asn(7)));
        calendar.set(MoteId(0), None);
        assert_eq!(calendar.next_asn(), None);
        let mut again: Calendar = Vec::from(calendar).into();
        assert_eq!(again.next_asn(), None);
    }

    #[test]
    fn motes_act_when_they_last_said_near_or_far() {
        let mut dice = Dice::new(1, Purpose::Mac, MoteId(0));
        let mut calendar = Calendar::new(40);
        let mut wake = [Asn::NEVER; 40];
        let mut motes = Vec::new();
        let mut asn = Asn::FIRST;
        for round in 0..20_000 {
            for _ in 0..dice.below(4) {
                let mote = dice.below(40) as usize;
                // From the next slot on, mostly within the lists; some never.
                let most = [10, 300, 5000][dice.below(3) as usize];
                let ahead = dice.below(most);
                wake[mote] = if dice.below(20) == 0 { Asn::NEVER } else { asn + ahead };
                calendar
                    .set(MoteId(mote as u32), Some(wake[mote]).filter(|&asn| asn != Asn::NEVER));
            }
            let next = wake.iter().copied().min().filter(|&asn| asn != Asn::NEVER);
            assert_eq!(calendar.next_asn(), next, "{round}");
            // Time may also pass without anybody who acts.
            let Some(next) = next.filter(|_| dice.below(4) != 0) else { continue };
            calendar.take(next, &mut motes);
            let expected: Vec<MoteId> =
                MoteId::first(40).filter(|mote| wake[mote.index()] == next).collect();
            assert_eq!(motes, expected, "{round}");
            wake.iter_mut().filter(|asn| **asn == next).for_each(|asn| *asn = Asn::NEVER);
            asn = next + 1;
        }
    }
}
