//! Negotiated and autonomous cells of a mote.

use super::policy::Policy;
use super::{AUTONOMOUS, Msf, NEGOTIATED, hash};
use crate::mac::{Cell, CellOptions, Schedule};
use crate::sf::Context;
use crate::wire::Eui64;
use crate::wire::sixp::SixpCell;

/// The cells of slotframe 2 with a neighbour.
pub(super) fn negotiated(schedule: &Schedule, peer: Eui64) -> impl Iterator<Item = &Cell> {
    let cells = schedule.slotframe(NEGOTIATED).map_or(&[][..], |frame| frame.cells());
    cells.iter().filter(move |cell| cell.neighbour == Some(peer))
}

/// Those in which we transmit to it. Few: of the cells that receive none is looked at.
pub(super) fn negotiated_tx(schedule: &Schedule, peer: Eui64) -> impl Iterator<Item = &Cell> {
    let frame = schedule.slotframe(NEGOTIATED);
    let cells = frame.into_iter().flat_map(|frame| frame.tx_cells());
    cells.filter(move |cell| cell.neighbour == Some(peer))
}

/// Negotiated cells in which we transmit to a neighbour, and those in which we receive from it.
pub(super) fn count(schedule: &Schedule, peer: Eui64) -> Cells {
    let n = |options: CellOptions| {
        negotiated(schedule, peer).filter(|cell| cell.options == options).count() as u16
    };
    Cells { tx: n(CellOptions::TX), rx: n(CellOptions::RX) }
}

/// Cells by direction.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub(super) struct Cells {
    pub(super) tx: u16,
    pub(super) rx: u16,
}

/// Slot and channel offset of a cell.
pub(super) fn place(cell: &Cell) -> SixpCell {
    SixpCell { slot: cell.slot, channel: cell.channel }
}

/// Whether a cell may be put into a slot of slotframe 2 (§ 8): not the minimal cell's, and no cell of ours there, in any
/// slotframe that is as long.
pub(super) fn is_free(schedule: &Schedule, slot: u16) -> bool {
    let Some(frame) = schedule.slotframe(NEGOTIATED) else { return false };
    let shares = |other: &&crate::mac::Slotframe| other.slots() == frame.slots();
    (1..frame.slots()).contains(&slot)
        && schedule.slotframes().iter().filter(shares).all(|other| other.at_slot(slot).is_empty())
}

/// Puts cells with a neighbour into slotframe 2.
pub(super) fn install(
    schedule: &mut Schedule,
    peer: Eui64,
    options: CellOptions,
    cells: &[SixpCell],
) {
    for cell in cells {
        let cell = Cell::new(cell.slot, cell.channel, options, Some(peer));
        // Beyond the end: such cells are neither offered nor taken.
        let _ = schedule.add(NEGOTIATED, cell);
    }
}

/// Takes cells with a neighbour from slotframe 2; returns how many there were.
pub(super) fn remove(
    schedule: &mut Schedule,
    peer: Eui64,
    options: CellOptions,
    cells: &[SixpCell],
) -> usize {
    schedule.remove_where(NEGOTIATED, |cell| {
        cell.neighbour == Some(peer) && cell.options == options && cells.contains(&place(cell))
    })
}

/// Whether all these cells are there.
pub(super) fn has_all(
    schedule: &Schedule,
    peer: Eui64,
    options: CellOptions,
    cells: &[SixpCell],
) -> bool {
    cells.iter().all(|wanted| {
        negotiated(schedule, peer).any(|own| own.options == options && place(own) == *wanted)
    })
}

impl<P: Policy> Msf<P> {
    /// Cells for a list of candidates (§ 8): free slots as the policy orders them, each once, channels at random. Fewer than
    /// asked for if there are no more.
    pub(super) fn candidates(
        &self,
        cx: &mut Context<'_>,
        options: CellOptions,
        n: usize,
    ) -> Vec<SixpCell> {
        let slots = cx.schedule.slotframe(NEGOTIATED).map_or(0, |frame| frame.slots());
        let mut free: Vec<u16> = (1..slots)
            .filter(|&slot| is_free(cx.schedule, slot) && !cx.sixtop.is_locked(slot))
            .collect();
        self.policy.order_candidates(cx, self.parent, options, &mut free);
        free.truncate(n);
        let n_channels = u64::from(cx.n_channels);
        free.into_iter()
            .map(|slot| SixpCell { slot, channel: cx.dice.below(n_channels) as u16 })
            .collect()
    }

    /// Negotiated cells have changed: counters and autonomous cells follow.
    pub(super) fn refresh(&mut self, cx: &mut Context<'_>) {
        let most = self.config.max_num_cells;
        let slots_of = |schedule: &Schedule, peer: Eui64, options: CellOptions| -> Vec<u16> {
            let cells = negotiated(schedule, peer).filter(|cell| cell.options == options);
            cells.map(|cell| cell.slot).collect()
        };
        let length = self.config.slotframe_slots;
        let (mut tx, mut rx) = (vec![], vec![]);
        if let Some(parent) = self.parent {
            tx = slots_of(cx.schedule, parent, CellOptions::TX);
            rx = slots_of(cx.schedule, parent, CellOptions::RX);
            self.receives_autonomously = rx.is_empty();
            if rx.is_empty() {
                rx.push(hash::autonomous_cell(cx.own, length, cx.n_channels).0);
            }
            self.n_sent.retain(|cell, _| {
                negotiated(cx.schedule, parent)
                    .any(|own| own.options == CellOptions::TX && place(own) == *cell)
            });
        }
        self.tx.set_cells(tx, length, cx.asn, most);
        self.rx.set_cells(rx, length, cx.asn, most);
        self.find_due(cx);
        for neighbour in self.waiting.clone() {
            self.update_autonomous_tx(cx, neighbour);
        }
    }

    /// § 3: a shared cell towards a neighbour is there while frames for it wait and no negotiated cell takes them.
    pub(super) fn update_autonomous_tx(&mut self, cx: &mut Context<'_>, neighbour: Eui64) {
        let is_wanted = self.waiting.contains(&neighbour)
            && negotiated_tx(cx.schedule, neighbour).next().is_none();
        let Some(frame) = cx.schedule.slotframe(AUTONOMOUS) else { return };
        // No other cell of this slotframe has a neighbour.
        let is_there = frame.tx_cells().any(|cell| cell.neighbour == Some(neighbour));
        if is_wanted && !is_there {
            let (slot, channel) =
                hash::autonomous_cell(neighbour, self.config.slotframe_slots, cx.n_channels);
            let cell = Cell::new(slot, channel, CellOptions::TX_SHARED, Some(neighbour));
            // The slot is one of the slotframe's.
            let _ = cx.schedule.add(AUTONOMOUS, cell);
        } else if is_there && !is_wanted {
            cx.schedule.remove_where(AUTONOMOUS, |cell| cell.neighbour == Some(neighbour));
        }
    }
}
