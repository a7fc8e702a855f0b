//! What a mote does when its neighbours ask: RFC 9033, § 8; RFC 8480, § 3.3.

use super::policy::Policy;
use super::{Msf, NEGOTIATED, cells};
use crate::sf::Context;
use crate::sixtop::{query, request};
use crate::wire::Eui64;
use crate::wire::sixp::{
    AnswerContent, CellRequest, ReturnCode, SixpAnswer, SixpCell, SixpRequest,
};

impl<P: Policy> Msf<P> {
    /// Answers a request.
    pub(super) fn answer(&mut self, cx: &mut Context<'_>, peer: Eui64, asked: &SixpRequest) {
        if self.is_quarantined(peer) {
            // § 12: frames from it are dropped.
            cx.sixtop.ignore(peer);
            return;
        }
        // § 8: two steps exclusively.
        let answer = if request::is_three_step(asked) {
            refusal(ReturnCode::Error)
        } else {
            match asked {
                SixpRequest::Add(body) => {
                    let n = usize::from(body.num_cells);
                    self.choose(cx, &body.cells, n)
                }
                SixpRequest::Delete(body) => delete(cx, peer, body),
                SixpRequest::Relocate { options, num_cells, relocation, candidates, .. } => {
                    let is_there = request::options_here(*options).is_some_and(|options| {
                        cells::has_all(cx.schedule, peer, options, relocation)
                    });
                    if is_there {
                        self.choose(cx, candidates, usize::from(*num_cells))
                    } else {
                        refusal(ReturnCode::ErrorCellList)
                    }
                }
                SixpRequest::Clear { .. } => {
                    self.forget_cells(cx, peer);
                    self.clears.remove(&peer);
                    self.former.retain(|former| *former != peer);
                    SixpAnswer { code: ReturnCode::Success, content: AnswerContent::Nothing }
                }
                SixpRequest::Count { .. } | SixpRequest::List { .. } => {
                    let frame = cx.schedule.slotframe(NEGOTIATED);
                    frame
                        .and_then(|frame| query::answer(frame, peer, asked))
                        .unwrap_or_else(|| refusal(ReturnCode::Error))
                }
                // § 6: MSF has no use for it.
                SixpRequest::Signal { .. } => refusal(ReturnCode::Error),
            }
        };
        cx.sixtop.respond(peer, answer, cx.now);
    }

    /// Of the cells offered, at most `n` that are free here, as the policy orders them. None: RC_SUCCESS with an empty list (RFC 8480,
    /// § 3.3.1), or RC_ERR_LOCKED where another transaction holds one that would do (§ 3.4.3).
    fn choose(&mut self, cx: &mut Context<'_>, offered: &[SixpCell], n: usize) -> SixpAnswer {
        let is_free = |cell: &&SixpCell| {
            cell.channel < cx.n_channels && cells::is_free(cx.schedule, cell.slot)
        };
        let free: Vec<SixpCell> = offered.iter().filter(is_free).copied().collect();
        let mut usable = free.clone();
        usable.retain(|cell| !cx.sixtop.is_locked(cell.slot));
        if usable.is_empty() && !free.is_empty() && n != 0 {
            return refusal(ReturnCode::ErrorLocked);
        }
        self.policy.order_grants(cx, &mut usable);
        // One cell a slot, whatever the list says.
        let mut chosen: Vec<SixpCell> = Vec::new();
        for cell in usable {
            if chosen.len() < n && chosen.iter().all(|other| other.slot != cell.slot) {
                chosen.push(cell);
            }
        }
        SixpAnswer { code: ReturnCode::Success, content: AnswerContent::Cells(chosen) }
    }

    /// A transaction is complete: the cells that we have granted are there, or gone.
    pub(super) fn carry_out(
        &mut self,
        cx: &mut Context<'_>,
        peer: Eui64,
        asked: &SixpRequest,
        response: &SixpAnswer,
    ) {
        let AnswerContent::Cells(granted) = &response.content else { return };
        let schedule = &mut *cx.schedule;
        match asked {
            SixpRequest::Add(body) => {
                if let Some(options) = request::options_here(body.options) {
                    cells::install(schedule, peer, options, granted);
                }
            }
            SixpRequest::Delete(body) => {
                if let Some(options) = request::options_here(body.options) {
                    cells::remove(schedule, peer, options, granted);
                }
            }
            SixpRequest::Relocate { options, relocation, .. } => {
                if let Some(options) = request::options_here(*options) {
                    let n = granted.len().min(relocation.len());
                    cells::remove(schedule, peer, options, &relocation[..n]);
                    cells::install(schedule, peer, options, &granted[..n]);
                }
            }
            SixpRequest::Count { .. }
            | SixpRequest::List { .. }
            | SixpRequest::Clear { .. }
            | SixpRequest::Signal { .. } => return,
        }
        self.heard.insert(peer, cx.now);
        self.refresh(cx);
    }
}

/// RFC 8480, § 3.3.2: all cells listed must be there; as many as asked for go, at random.
fn delete(cx: &mut Context<'_>, peer: Eui64, body: &CellRequest) -> SixpAnswer {
    let is_there = request::options_here(body.options)
        .is_some_and(|options| cells::has_all(cx.schedule, peer, options, &body.cells));
    if !is_there {
        return refusal(ReturnCode::ErrorCellList);
    }
    let mut chosen = body.cells.clone();
    cx.dice.shuffle(&mut chosen);
    chosen.truncate(usize::from(body.num_cells));
    SixpAnswer { code: ReturnCode::Success, content: AnswerContent::Cells(chosen) }
}

fn refusal(code: ReturnCode) -> SixpAnswer {
    SixpAnswer { code, content: AnswerContent::Nothing }
}
