//! How much of their cells two motes use: RFC 9033, § 5.1.

use physics::asn::Asn;
use serde::{Deserialize, Serialize};

/// NumCellsElapsed and NumCellsUsed, for the cells of one direction with the parent.
///
/// Cells that elapse are not counted one by one: how many there were follows from the slots of the cells and the time since
/// they last changed.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct Usage {
    /// Slots of the cells, ascending; one may hold several cells.
    slots: Vec<u16>,
    /// Length of their slotframe (slots).
    length: u16,
    /// First absolute slot that is not in `elapsed`.
    since_asn: Asn,
    elapsed: u64,
    used: u64,
    /// Absolute slot after the one in which the last cell elapses; `None`: never.
    due_asn: Option<Asn>,
}

impl Usage {
    /// Replaces the cells, and keeps both counters.
    pub(super) fn set_cells(&mut self, mut slots: Vec<u16>, length: u16, asn: Asn, most: u16) {
        slots.sort_unstable();
        if (&slots, length) == (&self.slots, self.length) {
            return;
        }
        self.elapsed = self.elapsed(asn);
        (self.slots, self.length, self.since_asn) = (slots, length, asn);
        self.find_due(most);
    }

    /// Begins anew: both counters are 0.
    pub(super) fn restart(&mut self, asn: Asn, most: u16) {
        (self.elapsed, self.used, self.since_asn) = (0, 0, asn);
        self.find_due(most);
    }

    /// A frame used a cell.
    pub(super) fn count_used(&mut self) {
        self.used += 1;
    }

    /// NumCellsUsed.
    pub(super) fn used(&self) -> u64 {
        self.used
    }

    /// NumCellsElapsed: cells before `asn`.
    pub(super) fn elapsed(&self, asn: Asn) -> u64 {
        let between = |&slot: &u16| {
            below(asn, slot, self.length) - below(self.since_asn.min(asn), slot, self.length)
        };
        self.elapsed + self.slots.iter().map(between).sum::<u64>()
    }

    /// The first absolute slot at whose beginning the agreed number of cells has elapsed.
    pub(super) fn due_asn(&self) -> Option<Asn> {
        self.due_asn
    }

    fn find_due(&mut self, most: u16) {
        let n_cells = self.slots.len() as u64;
        let Some(missing) = u64::from(most).checked_sub(self.elapsed).filter(|&n| n != 0) else {
            self.due_asn = Some(self.since_asn);
            return;
        };
        if n_cells == 0 {
            self.due_asn = None;
            return;
        }
        let (length, since) = (u64::from(self.length), self.since_asn);
        let mut next: Vec<Asn> = self
            .slots
            .iter()
            .map(|&slot| since + (u64::from(slot) + length - since % length) % length)
            .collect();
        next.sort_unstable();
        let rounds = (missing - 1) / n_cells;
        let last = next[((missing - 1) % n_cells) as usize] + rounds * length;
        self.due_asn = Some(last + 1);
    }
}

/// Absolute slots below `limit` with a slot offset.
fn below(limit: Asn, slot: u16, length: u16) -> u64 {
    let (slot, length) = (u64::from(slot), u64::from(length));
    if limit.0 <= slot { 0 } else { (limit.0 - slot - 1) / length + 1 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn rfc9033_5_1_cells_elapse_as_a_walk_over_all_slots_counts(
            phases in prop::collection::vec(
                (prop::collection::vec(0u16..20, 0..5), 0u64..100), 1..5),
            length in 20u16..30,
            begin in 0u64..100,
            most in 1u16..30,
        ) {
            let (mut usage, mut asn, mut walked) = (Usage::default(), begin, 0);
            usage.restart(Asn(begin), most);
            for (slots, duration) in phases {
                usage.set_cells(slots.clone(), length, Asn(asn), most);
                let mut due = (walked >= u64::from(most)).then_some(asn);
                for offset in 0..10_000 {
                    if offset == duration {
                        prop_assert_eq!(usage.elapsed(Asn(asn + offset)), walked);
                    }
                    let at = slots.iter().filter(|&&slot| (asn + offset) % u64::from(length) == u64::from(slot));
                    let n = at.count() as u64;
                    if offset < duration {
                        walked += n;
                    }
                    // How many have elapsed once this slot is over, if cells stayed as they are.
                    let after = usage.elapsed(Asn(asn + offset + 1));
                    if due.is_none() && after >= u64::from(most) {
                        due = Some(asn + offset + 1);
                    }
                    if offset > duration && due.is_some() {
                        break;
                    }
                }
                // It may have passed unnoticed while the cells stayed as they were.
                prop_assert_eq!(usage.due_asn().map(|due| due.max(Asn(asn))), due.map(Asn));
                asn += duration;
            }
        }
    }
}
