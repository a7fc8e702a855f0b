//! What became of messages that went out.

use super::peer::{Answering, next_seqnum};
use super::{Event, Failure, Sixtop, request};
use crate::wire::Eui64;
use crate::wire::sixp::{ReturnCode, SixpBody, SixpRepr, SixpRequest};
use proto::time::SimTime;

impl Sixtop {
    /// The MAC's last word on a message: `acknowledged`, or given up, or not even queued.
    pub(crate) fn handle_sent(
        &mut self,
        to: Eui64,
        message: &SixpRepr,
        acknowledged: bool,
        now: SimTime,
    ) {
        match &message.body {
            SixpBody::Request(sent) => {
                self.handle_request_sent(to, sent, message.seqnum, acknowledged, now);
            }
            SixpBody::Response(answer) => {
                let code = answer.code;
                self.handle_response_sent(to, code, message.seqnum, acknowledged);
            }
            SixpBody::Confirmation(_) => {
                self.handle_confirmation_sent(to, message.seqnum, acknowledged);
            }
        }
        self.note_ended();
    }

    fn handle_request_sent(
        &mut self,
        to: Eui64,
        sent: &SixpRequest,
        seqnum: u8,
        acknowledged: bool,
        now: SimTime,
    ) {
        let Some(state) = self.peers.get_mut(&to) else { return };
        let Some(open) = state.initiated.as_mut() else { return };
        if open.seqnum != seqnum || open.has_arrived || open.request != *sent {
            return;
        }
        if acknowledged {
            open.has_arrived = true;
            open.deadline = now.saturating_add(open.timeout);
        } else if let Some(open) = state.initiated.take() {
            self.give_up(to, open, Failure::NotSent);
        }
    }

    pub(super) fn handle_response_sent(
        &mut self,
        to: Eui64,
        code: ReturnCode,
        seqnum: u8,
        acknowledged: bool,
    ) {
        let Some(state) = self.peers.get_mut(&to) else { return };
        if code == ReturnCode::ErrorBusy && state.refused.take_if(|it| *it == seqnum).is_some() {
            if acknowledged {
                state.seqnum = next_seqnum(state.seqnum);
            }
            return;
        }
        // Of three steps the confirmation decides, and tells that the response arrived even if no acknowledgment did.
        let ends = |open: &mut Answering| {
            let answers = open.answer.as_ref().is_some_and(|answer| answer.code == code);
            let decides = !open.is_three_step() || request::is_error(code);
            open.seqnum == seqnum && answers && decides
        };
        let Some(open) = state.answering.take_if(ends) else { return };
        if !acknowledged {
            return self.lapse(to, open, Failure::NotSent);
        }
        // § 3.4.6: the number grows with the acknowledgment; not after CLEAR, nor after what was reset.
        if !open.is_clear() && code != ReturnCode::Reset {
            state.seqnum = next_seqnum(state.seqnum);
        }
        if let Answering { request, answer: Some(response), .. } = open
            && !request::is_error(code)
        {
            let confirmation = None;
            self.events.push_back(Event::Completed { peer: to, request, response, confirmation });
        }
    }

    fn handle_confirmation_sent(&mut self, to: Eui64, seqnum: u8, acknowledged: bool) {
        let Some(state) = self.peers.get_mut(&to) else { return };
        let is_ours = state
            .initiated
            .as_ref()
            .is_some_and(|open| open.seqnum == seqnum && open.confirmation.is_some());
        if !is_ours {
            return;
        }
        let Some(mut open) = state.initiated.take() else { return };
        if !acknowledged {
            return self.give_up(to, open, Failure::NotSent);
        }
        state.seqnum = next_seqnum(state.seqnum);
        let Some(confirmation) = open.confirmation.take() else { return };
        let (peer, request) = (to, open.request);
        self.events.push_back(if request::is_error(confirmation.code) {
            let why = Failure::Refused;
            Event::Failed { peer, request, is_initiator: true, why }
        } else {
            Event::Confirmed { peer, request, confirmation }
        });
    }
}
