//! What 6P remembers of one neighbour.

use super::request;
use crate::wire::sixp::{AnswerContent, SixpAnswer, SixpBody, SixpCell, SixpRepr, SixpRequest};
use proto::time::{SimDuration, SimTime};
use serde::{Deserialize, Serialize};

/// The number after `seqnum`: a lollipop counter, 0 comes once (§ 3.4.6).
pub(super) fn next_seqnum(seqnum: u8) -> u8 {
    if seqnum == u8::MAX { 1 } else { seqnum + 1 }
}

/// Failed transactions that are remembered: more responses than these do not wait in a neighbour's queue.
const MOST_GIVEN_UP: usize = 4;

/// A neighbour.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Peer {
    /// Number of the next transaction, in whichever direction (§ 3.4.6).
    pub(super) seqnum: u8,
    /// The transaction that we began.
    pub(super) initiated: Option<Initiated>,
    /// The transaction that it began. At the same time as one of ours only where one of the two is CLEAR.
    pub(super) answering: Option<Answering>,
    /// Its last request: the MAC repeats frames whose acknowledgment was lost (§ 3.4.6.1).
    pub(super) last_request: Option<SixpRepr>,
    /// Our last transactions that failed, the latest first: a late response to one gives more information.
    pub(super) given_up: Vec<GivenUp>,
    /// Number of its last transaction of three steps that failed on our side alone.
    pub(super) lapsed: Option<u8>,
    /// Number of our last transaction, if it was refused with RC_ERR_BUSY: a request of its with this number crossed ours.
    pub(super) crossed: Option<u8>,
    /// Number of a request that we refused with RC_ERR_BUSY and that counts once the refusal is acknowledged.
    pub(super) refused: Option<u8>,
    /// Number of our last CLEAR.
    pub(super) last_clear: Option<u8>,
}

/// A transaction that we began.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Initiated {
    pub(super) request: SixpRequest,
    pub(super) seqnum: u8,
    /// How long to wait for each message.
    pub(super) timeout: SimDuration,
    /// Until when to wait now.
    pub(super) deadline: SimTime,
    /// The request was acknowledged or answered.
    pub(super) has_arrived: bool,
    /// Three steps: the response.
    pub(super) answer: Option<SixpAnswer>,
    /// Three steps: what we have confirmed.
    pub(super) confirmation: Option<SixpAnswer>,
}

impl Initiated {
    pub(super) fn new(
        request: SixpRequest,
        seqnum: u8,
        timeout: SimDuration,
        now: SimTime,
    ) -> Self {
        Self {
            request,
            seqnum,
            timeout,
            deadline: now.saturating_add(timeout),
            has_arrived: false,
            answer: None,
            confirmation: None,
        }
    }

    pub(super) fn is_clear(&self) -> bool {
        matches!(self.request, SixpRequest::Clear { .. })
    }

    fn locked(&self) -> impl Iterator<Item = &SixpCell> {
        let confirmed = self.confirmation.as_ref().map_or(&[][..], cells_of);
        let answered = self.answer.as_ref().map_or(&[][..], cells_of);
        request::cells(&self.request).chain(answered).chain(confirmed)
    }
}

/// A transaction that a neighbour began.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Answering {
    pub(super) request: SixpRequest,
    pub(super) seqnum: u8,
    /// Until when to wait now: for the scheduling function, the MAC, or the confirmation.
    pub(super) deadline: SimTime,
    /// What we have answered.
    pub(super) answer: Option<SixpAnswer>,
}

impl Answering {
    pub(super) fn is_clear(&self) -> bool {
        matches!(self.request, SixpRequest::Clear { .. })
    }

    pub(super) fn is_three_step(&self) -> bool {
        request::is_three_step(&self.request)
    }

    /// The cells that we have offered or granted, and those of ours that the request takes away. Candidates that we have
    /// not chosen are free.
    fn locked(&self) -> impl Iterator<Item = &SixpCell> {
        let taken: &[SixpCell] = match &self.request {
            SixpRequest::Relocate { relocation, .. } => relocation,
            _ => &[],
        };
        let granted = match &self.request {
            SixpRequest::Add(_) | SixpRequest::Delete(_) | SixpRequest::Relocate { .. } => {
                self.answer.as_ref().map_or(&[][..], cells_of)
            }
            _ => &[],
        };
        taken.iter().chain(granted)
    }
}

fn cells_of(answer: &SixpAnswer) -> &[SixpCell] {
    match &answer.content {
        AnswerContent::Cells(cells) => cells,
        AnswerContent::Nothing | AnswerContent::Count(_) | AnswerContent::Payload(_) => &[],
    }
}

/// A transaction of ours that has failed.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct GivenUp {
    pub(super) seqnum: u8,
    /// Our number has grown with it.
    pub(super) has_counted: bool,
    pub(super) changes_cells: bool,
    pub(super) is_three_step: bool,
}

impl GivenUp {
    pub(super) fn new(open: &Initiated, has_counted: bool) -> Self {
        Self {
            seqnum: open.seqnum,
            has_counted,
            changes_cells: request::changes_cells(&open.request),
            is_three_step: request::is_three_step(&open.request),
        }
    }
}

impl Peer {
    /// When the first of its transactions fails.
    pub(super) fn deadline(&self) -> Option<SimTime> {
        let initiated = self.initiated.as_ref().map(|open| open.deadline);
        let answering = self.answering.as_ref().map(|open| open.deadline);
        [initiated, answering].into_iter().flatten().min()
    }

    pub(super) fn locked(&self) -> impl Iterator<Item = &SixpCell> {
        let initiated = self.initiated.iter().flat_map(Initiated::locked);
        initiated.chain(self.answering.iter().flat_map(Answering::locked))
    }

    /// The number of a CLEAR of ours. It is not checked (§ 3.3.6), and differs from that of the last one, which would make it a
    /// duplicate (§ 3.4.6.1) where nothing was agreed on between the two.
    pub(super) fn number_clear(&mut self) -> u8 {
        let is_same = self.last_clear == Some(self.seqnum);
        let seqnum = if is_same { next_seqnum(self.seqnum) } else { self.seqnum };
        self.last_clear = Some(seqnum);
        seqnum
    }

    /// A transaction of ours has failed.
    pub(super) fn remember(&mut self, failed: GivenUp) {
        self.given_up.insert(0, failed);
        self.given_up.truncate(MOST_GIVEN_UP);
    }

    /// After CLEAR: number 0, and nothing that came before it means anything (§ 3.3.6); but a CLEAR of its may still be
    /// repeated.
    pub(super) fn clear(&mut self) {
        let (initiated, answering) = (self.initiated.take(), self.answering.take());
        let is_clear = |message: &SixpRepr| {
            matches!(message.body, SixpBody::Request(SixpRequest::Clear { .. }))
        };
        let last_request = self.last_request.take().filter(is_clear);
        let last_clear = self.last_clear;
        *self = Self { initiated, answering, last_request, last_clear, ..Self::default() };
    }
}
