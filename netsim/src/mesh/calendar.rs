//! In which slot which mote has something to do.

use serde::{Deserialize, Serialize};
use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// The next slot of every mote, and all of them in order. Slots in which nobody acts are never looked at.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[serde(from = "Vec<u64>", into = "Vec<u64>")]
pub struct Calendar {
    /// By mote; `u64::MAX`: never.
    wake: Vec<u64>,
    /// Holds at least the entries of `wake`, and outdated ones.
    heap: BinaryHeap<Reverse<(u64, u32)>>,
}

impl From<Vec<u64>> for Calendar {
    fn from(wake: Vec<u64>) -> Self {
        let entries = (0..).zip(&wake).filter(|(_, asn)| **asn != u64::MAX);
        let heap = entries.map(|(mote, &asn)| Reverse((asn, mote))).collect();
        Self { wake, heap }
    }
}

impl From<Calendar> for Vec<u64> {
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
        Self::from(vec![u64::MAX; n])
    }

    /// The mote acts in this slot, and not before; `None`: it sleeps until something reaches it.
    pub fn set(&mut self, mote: u32, asn: Option<u64>) {
        let asn = asn.unwrap_or(u64::MAX);
        let entry = &mut self.wake[mote as usize];
        if *entry != asn {
            *entry = asn;
            if asn != u64::MAX {
                self.heap.push(Reverse((asn, mote)));
            }
        }
    }

    /// The first slot in which somebody acts.
    pub fn next_asn(&mut self) -> Option<u64> {
        loop {
            let &Reverse((asn, mote)) = self.heap.peek()?;
            if self.wake[mote as usize] == asn {
                return Some(asn);
            }
            self.heap.pop();
        }
    }

    /// Takes out those who act in a slot, in ascending order. Each is then without an entry.
    pub fn take(&mut self, asn: u64, motes: &mut Vec<u32>) {
        motes.clear();
        while let Some(&Reverse((at, mote))) = self.heap.peek() {
            if asn < at {
                break;
            }
            self.heap.pop();
            if self.wake[mote as usize] == at {
                self.wake[mote as usize] = u64::MAX;
                motes.push(mote);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn motes_come_in_order_once_and_as_last_said() {
        let mut calendar = Calendar::new(4);
        for (mote, asn) in [(2, 5), (1, 5), (0, 9), (3, 5), (0, 7), (3, 6), (3, 5)] {
            calendar.set(mote, Some(asn));
        }
        let mut motes = Vec::new();
        assert_eq!(calendar.next_asn(), Some(5));
        calendar.take(5, &mut motes);
        assert_eq!(motes, [1, 2, 3]);
        assert_eq!(calendar.next_asn(), Some(7));
        calendar.set(0, None);
        assert_eq!(calendar.next_asn(), None);
        let mut again: Calendar = Vec::from(calendar).into();
        assert_eq!(again.next_asn(), None);
    }
}
