//! LLSF: negotiated cells that follow one another along the way to the root.
//!
//! Chang, Watteyne, Wang, Vilajosana: "LLSF: Low Latency Scheduling Function for 6TiSCH Networks", DCOSS 2016. The rules are those of
//! the authors' code in OpenWSN.

use super::msf::policy::Policy;
use super::msf::{self, Msf, MsfConfig, NEGOTIATED};
use super::{Config, Configured, Context, Entry, PayloadCells};
use crate::mac::{CellOptions, Schedule};
use crate::wire::Eui64;
use crate::wire::sixp::SixpCell;
use proto::config::{Section, Variant};
use proto::ids::MoteId;
use serde::{Deserialize, Serialize};

/// `kind = "llsf"`.
pub const ENTRY: Entry = Entry {
    variant: Variant {
        name: "llsf",
        doc: "LLSF: cells are negotiated as with msf, but a cell to the parent is placed right after a cell from a child, \
              so that frames are forwarded at once (Chang et al., DCOSS 2016).",
        fields: MsfConfig::SPEC.fields,
    },
    payload_cells: PayloadCells::Shared,
    build: |table, context| msf::read(table, context).map(LlsfConfig).map(Config::new),
};

/// Keys of `[netsim.sf]`: those of MSF.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct LlsfConfig(pub MsfConfig);

impl Configured for LlsfConfig {
    type OfMote = Msf<DaisyChain>;

    fn create(&self, _mote: MoteId) -> Msf<DaisyChain> {
        Msf::with_policy(&self.0, DaisyChain)
    }

    fn has_dedicated_cells(&self) -> bool {
        true
    }
}

/// LLSF's choice of slots: the cells of a way follow one another like a daisy chain.
///
/// # Rules
///
/// 1. A frame of a child most likely arrives in the receive cell that comes after the longest time without one: whatever was
///    made in that time waits for it. For every receive cell, ordered by the time since the one before it, longest first, the
///    candidate is the first free slot after it.
/// 2. Without receive cells slots are chosen at random.
/// 3. The parent grants the first of the offered cells that it has free, too.
/// 4. The cell that is deleted is the one that comes longest after the receive cell before it.
///
/// # Differences
///
/// LLSF was made for SF0, an expired draft, which decided how many cells there are. Here MSF decides that, which replaced SF0.
/// The authors' code offers no more slots than there are receive cells. Here the next free slots follow in the list, so that a parent
/// has others to grant. Receive cells are those of children: a frame of the parent is not for the parent. The authors' code has channel
/// offset 0 for all cells; here it is drawn, as with MSF.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct DaisyChain;

/// Slots of negotiated cells in which a mote receives from others than its parent, ascending, and the slotframe's length.
fn receive_slots(schedule: &Schedule, parent: Option<Eui64>) -> (Vec<u16>, u16) {
    let Some(frame) = schedule.slotframe(NEGOTIATED) else { return (Vec::new(), 1) };
    let cells = frame.cells().iter();
    let mut slots: Vec<u16> = cells
        .filter(|cell| cell.options == CellOptions::RX && cell.neighbour != parent)
        .map(|cell| cell.slot)
        .collect();
    slots.dedup();
    (slots, frame.slots())
}

/// Slots from one to another, which is a later one: at least one, at most the whole slotframe.
fn distance(from: u16, to: u16, length: u16) -> u16 {
    if from < to { to - from } else { length - (from - to) }
}

impl Policy for DaisyChain {
    fn order_candidates(
        &self,
        cx: &mut Context<'_>,
        parent: Option<Eui64>,
        options: CellOptions,
        free: &mut [u16],
    ) {
        let (received, length) = receive_slots(cx.schedule, parent);
        if received.is_empty() || options != CellOptions::TX {
            return cx.dice.shuffle(free);
        }
        let before = received.iter().cycle().skip(received.len() - 1);
        let after = received.iter().cycle().skip(1);
        // Receive cells with the time since the one before and the time to the one after.
        let mut by_gap: Vec<(u16, u16, u16)> = before
            .zip(&received)
            .zip(after)
            .map(|((&before, &slot), &after)| {
                (distance(before, slot, length), slot, distance(slot, after, length))
            })
            .collect();
        by_gap.sort_by_key(|&(gap, slot, _)| (std::cmp::Reverse(gap), slot));
        let firsts: Vec<u16> = by_gap
            .iter()
            .filter_map(|&(_, slot, reach)| {
                let first =
                    free.iter().copied().min_by_key(|&next| distance(slot, next, length))?;
                (distance(slot, first, length) < reach).then_some(first)
            })
            .collect();
        let longest = by_gap[0].1;
        free.sort_by_key(|&slot| {
            let rank = firsts.iter().position(|&first| first == slot).unwrap_or(firsts.len());
            (rank, distance(longest, slot, length))
        });
    }

    fn order_grants(&self, _cx: &mut Context<'_>, _usable: &mut [SixpCell]) {}

    fn order_spare(
        &self,
        cx: &mut Context<'_>,
        parent: Eui64,
        options: CellOptions,
        n: usize,
        own: &mut Vec<SixpCell>,
    ) {
        let (received, length) = receive_slots(cx.schedule, Some(parent));
        if options == CellOptions::TX {
            let wait = |cell: &SixpCell| {
                received.iter().map(|&slot| distance(slot, cell.slot, length)).min().unwrap_or(0)
            };
            own.sort_by_key(|cell| (std::cmp::Reverse(wait(cell)), cell.slot));
        } else {
            cx.dice.shuffle(own);
        }
        own.truncate(n);
    }
}

#[cfg(test)]
mod tests;
