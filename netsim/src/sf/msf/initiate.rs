//! What a mote asks its parent for, and what it makes of the answers: RFC 9033, § 4.6, § 5, § 12.

use super::cells::{self, Cells};
use super::policy::Policy;
use super::{Msf, seconds};
use crate::mac::CellOptions;
use crate::sf::Context;
use crate::sixtop::{Failure, request};
use crate::wire::Eui64;
use crate::wire::sixp::{
    AnswerContent, CellRequest, ReturnCode, SixpAnswer, SixpCell, SixpRequest,
};
use proto::time::SimDuration;

/// Cells asked for, moved or offered for deletion in one request.
const BATCH: usize = 5;

impl<P: Policy> Msf<P> {
    /// Sends whatever is to be asked next and may be asked now.
    pub(super) fn drive(&mut self, cx: &mut Context<'_>) {
        let pending: Vec<Eui64> = self.clears.keys().copied().collect();
        for peer in pending {
            if !cx.sixtop.is_busy(peer) {
                self.ask(cx, peer, SixpRequest::Clear { metadata: 0 });
            }
        }
        let Some(parent) = self.parent else { return };
        let is_held = self.hold_until.is_some_and(|until| cx.now < until);
        if is_held || self.is_quarantined(parent) || cx.sixtop.is_busy(parent) {
            return;
        }
        self.hold_until = None;
        if self.missing.tx != 0 {
            self.ask_to_add(cx, parent, CellOptions::TX, self.missing.tx);
        } else if self.missing.rx != 0 {
            self.ask_to_add(cx, parent, CellOptions::RX, self.missing.rx);
        } else if !self.former.is_empty() {
            // § 5.2: the new parent has given what the old one had.
            for old in std::mem::take(&mut self.former) {
                self.clear(cx, old);
            }
            self.drive(cx);
        } else if !self.to_relocate.is_empty() {
            self.ask_to_relocate(cx, parent);
        } else if self.spare.tx != 0 {
            self.ask_to_delete(cx, parent, CellOptions::TX, self.spare.tx);
        } else if self.spare.rx != 0 {
            self.ask_to_delete(cx, parent, CellOptions::RX, self.spare.rx);
        }
    }

    fn ask(&mut self, cx: &mut Context<'_>, peer: Eui64, what: SixpRequest) {
        // § 9. Its factors are the MAC's.
        let (config, slots) = (cx.sixtop.config(), u64::from(self.config.slotframe_slots));
        let backoff_slotframes = (1u64 << config.max_be.min(16)) - 1;
        let slotframes = backoff_slotframes * u64::from(config.max_retries);
        let timeout = cx.slot.saturating_mul(slotframes.saturating_mul(slots));
        let sent = cx.sixtop.request(peer, what, Some(timeout), cx.now);
        debug_assert!(sent.is_ok(), "nobody is asked who is busy");
    }

    fn ask_to_add(&mut self, cx: &mut Context<'_>, parent: Eui64, options: CellOptions, n: u16) {
        let n = usize::from(n).min(BATCH);
        let listed = (n + BATCH - 1).max(usize::from(self.config.candidate_cells));
        let offered = self.candidates(cx, options, listed);
        let n = n.min(offered.len());
        if n == 0 {
            return self.handle_full(cx, parent, options);
        }
        let body = CellRequest {
            metadata: 0,
            options: request::bitmap(options),
            num_cells: n as u8,
            cells: offered,
        };
        self.ask(cx, parent, SixpRequest::Add(body));
    }

    /// No slot is free: the wish is dropped; that for the first cell rests for a while.
    fn handle_full(&mut self, cx: &mut Context<'_>, parent: Eui64, options: CellOptions) {
        self.n_full += 1;
        if options == CellOptions::RX {
            self.missing.rx = 0;
        } else if cells::count(cx.schedule, parent).tx != 0 {
            self.missing.tx = 0;
        } else {
            self.hold(cx);
            return;
        }
        self.drive(cx);
    }

    fn ask_to_relocate(&mut self, cx: &mut Context<'_>, parent: Eui64) {
        let own = |cell: &SixpCell| {
            cells::has_all(cx.schedule, parent, CellOptions::TX, std::slice::from_ref(cell))
        };
        self.to_relocate.retain(own);
        let n = self.to_relocate.len().min(BATCH);
        if n == 0 {
            return;
        }
        let listed = (n + BATCH - 1).max(usize::from(self.config.candidate_cells));
        let candidates = self.candidates(cx, CellOptions::TX, listed);
        let n = n.min(candidates.len());
        if n == 0 {
            self.n_full += 1;
            self.to_relocate.clear();
            return;
        }
        let relocation = self.to_relocate[..n].to_vec();
        let options = request::bitmap(CellOptions::TX);
        let num_cells = n as u8;
        let what =
            SixpRequest::Relocate { metadata: 0, options, num_cells, relocation, candidates };
        self.ask(cx, parent, what);
    }

    fn ask_to_delete(&mut self, cx: &mut Context<'_>, parent: Eui64, options: CellOptions, n: u16) {
        let mut own: Vec<SixpCell> = cells::negotiated(cx.schedule, parent)
            .filter(|cell| cell.options == options)
            .map(cells::place)
            .collect();
        // One cell to transmit in stays (§ 4.8).
        let least = usize::from(options == CellOptions::TX);
        if own.len() <= least {
            self.spare = Cells::default();
            return;
        }
        let n = usize::from(n).min(BATCH).min(own.len() - least);
        self.policy.order_spare(cx, parent, options, n, &mut own);
        own.truncate(BATCH);
        let options = request::bitmap(options);
        let body = CellRequest { metadata: 0, options, num_cells: n as u8, cells: own };
        self.ask(cx, parent, SixpRequest::Delete(body));
    }

    /// A neighbour has answered.
    pub(super) fn handle_answer(
        &mut self,
        cx: &mut Context<'_>,
        peer: Eui64,
        asked: &SixpRequest,
        answer: &SixpAnswer,
    ) {
        if matches!(asked, SixpRequest::Clear { .. }) {
            self.clears.remove(&peer);
            return;
        }
        // Table 1.
        match answer.code {
            ReturnCode::Success | ReturnCode::EndOfList => {
                self.handle_agreement(cx, peer, asked, answer);
            }
            ReturnCode::Error
            | ReturnCode::Reset
            | ReturnCode::ErrorVersion
            | ReturnCode::ErrorSfid => self.quarantine(cx, peer),
            ReturnCode::ErrorSeqnum | ReturnCode::ErrorCellList => self.clear(cx, peer),
            ReturnCode::ErrorBusy | ReturnCode::ErrorLocked => self.hold(cx),
        }
    }

    fn handle_agreement(
        &mut self,
        cx: &mut Context<'_>,
        peer: Eui64,
        asked: &SixpRequest,
        answer: &SixpAnswer,
    ) {
        let AnswerContent::Cells(agreed) = &answer.content else { return };
        let is_parent = self.parent == Some(peer);
        let is_sound = match asked {
            SixpRequest::Add(body) => self.handle_added(cx, peer, body, agreed),
            SixpRequest::Delete(body) => {
                let is_sound = is_part(agreed, &body.cells, body.num_cells);
                if let Some(options) = request::options_there(body.options) {
                    cells::remove(cx.schedule, peer, options, agreed);
                    if is_parent {
                        self.settle_spare(options, agreed.len());
                    }
                }
                is_sound
            }
            SixpRequest::Relocate { options, num_cells, relocation, candidates, .. } => {
                if is_parent {
                    // Those that found no place are looked at again at the next housekeeping (§ 5.3).
                    self.to_relocate.retain(|cell| !relocation.contains(cell));
                }
                let is_sound = is_part(agreed, candidates, *num_cells);
                if let Some(options) = request::options_there(*options)
                    && is_sound
                {
                    // As many as were granted, in the order of the list (RFC 8480, § 3.3.3).
                    let moved = &relocation[..agreed.len()];
                    cells::remove(cx.schedule, peer, options, moved);
                    cells::install(cx.schedule, peer, options, agreed);
                }
                is_sound
            }
            SixpRequest::Count { .. }
            | SixpRequest::List { .. }
            | SixpRequest::Clear { .. }
            | SixpRequest::Signal { .. } => return,
        };
        if !is_sound {
            // It grants what was not offered: the ends differ.
            self.clear(cx, peer);
            return;
        }
        if is_parent {
            if !agreed.is_empty() {
                self.n_failures = 0;
            }
        } else if !self.former.contains(&peer) && !self.clears.contains_key(&peer) {
            // It was the parent when it was asked.
            self.former.push(peer);
        }
        self.refresh(cx);
    }

    fn handle_added(
        &mut self,
        cx: &mut Context<'_>,
        peer: Eui64,
        body: &CellRequest,
        agreed: &[SixpCell],
    ) -> bool {
        let Some(options) = request::options_there(body.options) else { return false };
        if !is_part(agreed, &body.cells, body.num_cells) {
            return false;
        }
        cells::install(cx.schedule, peer, options, agreed);
        if self.parent != Some(peer) {
            return true;
        }
        let missing =
            if options == CellOptions::TX { &mut self.missing.tx } else { &mut self.missing.rx };
        *missing = missing.saturating_sub(agreed.len() as u16);
        if agreed.is_empty() {
            // The parent has no room in any of these slots: others are tried for the first cell (§ 4.6); cells beyond it wait
            // until they are missed again.
            if options == CellOptions::TX && cells::count(cx.schedule, peer).tx == 0 {
                self.count_failure(cx, peer);
            } else {
                *missing = 0;
            }
        }
        true
    }

    /// Some of the cells that were too many have gone. If the parent keeps all, one fewer is asked for.
    fn settle_spare(&mut self, options: CellOptions, n: usize) {
        let spare =
            if options == CellOptions::TX { &mut self.spare.tx } else { &mut self.spare.rx };
        *spare = spare.saturating_sub(n.max(1) as u16);
    }

    /// A request of ours came to nothing.
    pub(super) fn handle_failure(
        &mut self,
        cx: &mut Context<'_>,
        peer: Eui64,
        asked: &SixpRequest,
        why: Failure,
    ) {
        if matches!(asked, SixpRequest::Clear { .. }) {
            // § 12: it may fail. A parent that has not heard it tells so when it is asked next (RFC 8480, § 3.4.6.2); another
            // neighbour would listen in vain, and is told again.
            if why == Failure::Aborted {
                return;
            }
            if self.parent == Some(peer) {
                self.clears.remove(&peer);
            } else if let Some(n_failed) = self.clears.get_mut(&peer) {
                *n_failed += 1;
                if *n_failed >= self.config.max_failures {
                    self.clears.remove(&peer);
                }
            }
            return;
        }
        if why == Failure::Aborted || self.parent != Some(peer) {
            return;
        }
        match asked {
            SixpRequest::Delete(_) => self.spare = Cells::default(),
            SixpRequest::Relocate { .. } => self.to_relocate.clear(),
            _ => {}
        }
        self.count_failure(cx, peer);
        // Cells in which nothing arrives may not be there any more at the other end; without them, the autonomous cell
        // takes the next message.
        let is_deaf = why == Failure::NotSent && self.n_failures == 2;
        if is_deaf && cells::negotiated(cx.schedule, peer).next().is_some() {
            self.clear(cx, peer);
        }
    }

    /// After too many consecutive failures routing is asked to find another parent; if it keeps this one, we try again
    /// later.
    fn count_failure(&mut self, cx: &mut Context<'_>, parent: Eui64) {
        self.n_failures += 1;
        if self.n_failures >= self.config.max_failures {
            self.n_failures = 0;
            cx.unusable.push(parent);
            self.hold(cx);
        }
    }

    /// § 12, waitretry.
    pub(super) fn hold(&mut self, cx: &mut Context<'_>) {
        let (low_s, high_s) = (self.config.wait_min_s, self.config.wait_max_s);
        let wait = cx.dice.duration(seconds(low_s), seconds(high_s) + SimDuration::from_ns(1));
        self.hold_until = Some(cx.now + wait);
    }

    /// § 12, clear: call off what runs, remove all cells, tell the neighbour.
    pub(super) fn clear(&mut self, cx: &mut Context<'_>, peer: Eui64) {
        cx.sixtop.abort(peer);
        self.forget_cells(cx, peer);
        self.former.retain(|former| *former != peer);
        self.clears.insert(peer, 0);
    }

    /// § 12, quarantine.
    fn quarantine(&mut self, cx: &mut Context<'_>, peer: Eui64) {
        self.clear(cx, peer);
        let until = cx.now + seconds(self.config.quarantine_s);
        self.quarantined.insert(peer, until);
        cx.unusable.push(peer);
    }

    /// Removes all negotiated cells with a neighbour. Those with the parent are missed from then on.
    pub(super) fn forget_cells(&mut self, cx: &mut Context<'_>, peer: Eui64) {
        let had = cells::count(cx.schedule, peer);
        if cells::negotiated(cx.schedule, peer).next().is_some() {
            cx.schedule.remove_where(super::NEGOTIATED, |cell| cell.neighbour == Some(peer));
        }
        self.heard.remove(&peer);
        if self.parent == Some(peer) {
            self.missing.tx = (self.missing.tx + had.tx).max(1);
            self.missing.rx += had.rx;
            self.spare = Cells::default();
            self.to_relocate.clear();
        }
        self.refresh(cx);
    }
}

/// Whether what was agreed on is among what was offered, and not more than asked for.
fn is_part(agreed: &[SixpCell], offered: &[SixpCell], most: u8) -> bool {
    agreed.len() <= usize::from(most) && agreed.iter().all(|cell| offered.contains(cell))
}
