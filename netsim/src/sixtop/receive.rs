//! Messages that come in.

use super::peer::{Answering, GivenUp, Initiated, next_seqnum};
use super::timeout::{self, Role};
use super::{Event, Failure, Sixtop, VERSION, request};
use crate::wire::Eui64;
use crate::wire::sixp::{AnswerContent, ReturnCode, SixpAnswer, SixpBody, SixpRepr, SixpRequest};
use proto::time::SimTime;

impl Sixtop {
    /// A message has come from a neighbour.
    pub(crate) fn handle_message(&mut self, from: Eui64, message: &SixpRepr, now: SimTime) {
        let is_request = matches!(message.body, SixpBody::Request(_));
        let unsupported = if message.version != VERSION {
            Some(ReturnCode::ErrorVersion)
        } else if message.sfid != self.config.sfid {
            Some(ReturnCode::ErrorSfid)
        } else {
            None
        };
        if let Some(code) = unsupported {
            // § 3.4.1: in version 0. § 3.4.2: with the SFID of the request. Answers to answers would never end.
            if is_request {
                let body = SixpBody::Response(error(code));
                let answer = SixpRepr { version: VERSION, body, ..*message };
                self.outgoing.push_back((from, answer));
            }
            return;
        }
        match &message.body {
            SixpBody::Request(request) => self.handle_request(from, request, message, now),
            SixpBody::Response(answer) => {
                self.handle_response(from, answer, message.seqnum, now);
            }
            SixpBody::Confirmation(answer) => {
                self.handle_confirmation(from, answer, message.seqnum);
            }
        }
        self.note_ended();
    }

    fn handle_request(
        &mut self,
        from: Eui64,
        request: &SixpRequest,
        message: &SixpRepr,
        now: SimTime,
    ) {
        let seqnum = message.seqnum;
        let state = self.peers.entry(from).or_default();
        let is_repeated = state.last_request.as_ref() == Some(message);
        // § 3.4.6.1: duplicates are ignored; a CLEAR, too, for the cells that have been added since are not meant.
        if is_repeated {
            return;
        }
        if matches!(request, SixpRequest::Clear { .. }) {
            return self.handle_clear(from, request, message, now);
        }
        if self.is_settled_by(from, seqnum) {
            self.settle(from);
        }
        // § 3.4.6: who counts from 0 again has lost its state; whatever ran before is void.
        let state = self.peers.entry(from).or_default();
        let has_lost_state = seqnum == 0 && state.seqnum != 0;
        if let Some(open) = &state.answering
            && !has_lost_state
        {
            let open_seqnum = open.seqnum;
            let is_unsent = open.answer.is_none() || self.has_unsent_response(from, open_seqnum);
            let state = self.peers.entry(from).or_default();
            if is_unsent {
                // § 3.4.3: discarded as though it had never been; may come again as it is.
                self.send(from, seqnum, SixpBody::Response(error(ReturnCode::Reset)));
            } else {
                state.last_request = Some(message.clone());
                state.refused = Some(seqnum);
                self.send(from, seqnum, SixpBody::Response(error(ReturnCode::ErrorBusy)));
            }
            return;
        }
        state.last_request = Some(message.clone());
        if has_lost_state {
            return self.handle_inconsistency(from, seqnum);
        }
        // Requests that cross: both are refused, and each end counts its own only.
        let own = state.initiated.as_ref().map(|open| (open.seqnum, open.is_clear()));
        let crosses = own.is_some_and(|(own, is_clear)| own == seqnum || is_clear);
        if crosses || (state.crossed == Some(seqnum) && seqnum != state.seqnum) {
            state.crossed = None;
            self.send(from, seqnum, SixpBody::Response(error(ReturnCode::ErrorBusy)));
            return;
        }
        if seqnum != state.seqnum {
            return self.handle_inconsistency(from, seqnum);
        }
        self.open(from, request, seqnum, now);
        match request::fault(request) {
            Some(code) => self.respond(from, error(code), now),
            None => self.events.push_back(Event::Request { peer: from, request: request.clone() }),
        }
    }

    /// § 3.3.6: the number is not checked, and is 0 afterwards.
    fn handle_clear(
        &mut self,
        from: Eui64,
        request: &SixpRequest,
        message: &SixpRepr,
        now: SimTime,
    ) {
        let state = self.peers.entry(from).or_default();
        // Both clear: ours is done as well.
        let own = state.initiated.take_if(|open| open.is_clear());
        if let Some(Initiated { request, .. }) = own {
            let answer = SixpAnswer { code: ReturnCode::Success, content: AnswerContent::Nothing };
            let awaits_confirmation = false;
            self.events.push_back(Event::Answered {
                peer: from,
                request,
                answer,
                awaits_confirmation,
            });
        }
        self.call_off(from);
        self.purge(from);
        // What the end of those transactions made doubtful, CLEAR settles.
        self.events.retain(|event| *event != Event::Inconsistent { peer: from });
        let state = self.peers.entry(from).or_default();
        state.clear();
        state.last_request = Some(message.clone());
        self.open(from, request, message.seqnum, now);
        self.events.push_back(Event::Request { peer: from, request: request.clone() });
    }

    /// Whether the next request shows that the last one is over, before the MAC knows that our response arrived: the
    /// neighbour counts on, and whether it has the response or not makes no difference to cells.
    fn is_settled_by(&self, from: Eui64, seqnum: u8) -> bool {
        let Some(state) = self.peers.get(&from) else { return false };
        let Some(open) = &state.answering else { return false };
        let Some(answer) = &open.answer else { return false };
        let is_harmless = request::is_error(answer.code) || !request::changes_cells(&open.request);
        let expected = if open.is_clear() { 0 } else { next_seqnum(state.seqnum) };
        is_harmless && seqnum == expected && !self.has_unsent_response(from, open.seqnum)
    }

    /// Ends the transaction that we answer, as its response's acknowledgment would.
    fn settle(&mut self, from: Eui64) {
        let Some(open) = self.peers.get(&from).and_then(|state| state.answering.as_ref()) else {
            return;
        };
        let (seqnum, code) = (open.seqnum, open.answer.as_ref().map(|answer| answer.code));
        if let Some(code) = code {
            self.handle_response_sent(from, code, seqnum, true);
        }
    }

    fn open(&mut self, from: Eui64, request: &SixpRequest, seqnum: u8, now: SimTime) {
        let is_three_step = request::is_three_step(request);
        let takes = timeout::default_for(&self.config, Role::Responder, is_three_step);
        let deadline = now.saturating_add(takes);
        let state = self.peers.entry(from).or_default();
        state.answering =
            Some(Answering { request: request.clone(), seqnum, deadline, answer: None });
        self.note_busy(from);
    }

    /// § 3.4.6.2: a request with a number that is not the expected one. The answer's number is ours, but 0 to a
    /// neighbour that begins anew (§ 3.4.6, figure 32).
    fn handle_inconsistency(&mut self, from: Eui64, seqnum: u8) {
        let state = self.peers.entry(from).or_default();
        let own = if seqnum == 0 { 0 } else { state.seqnum };
        if let Some(open) = state.answering.take() {
            self.purge(from);
            self.events.push_back(Event::Failed {
                peer: from,
                request: open.request,
                is_initiator: false,
                why: Failure::Aborted,
            });
        }
        self.send(from, own, SixpBody::Response(error(ReturnCode::ErrorSeqnum)));
        self.events.push_back(Event::Inconsistent { peer: from });
    }

    fn handle_response(&mut self, from: Eui64, answer: &SixpAnswer, seqnum: u8, now: SimTime) {
        let Some(state) = self.peers.get_mut(&from) else { return };
        // RC_ERR_SEQNUM carries the number of who sends it (§ 3.4.6.2).
        let is_ours = |open: &Initiated| {
            open.seqnum == seqnum || (answer.code == ReturnCode::ErrorSeqnum && !open.is_clear())
        };
        let Some(open) = state.initiated.as_mut().filter(|open| is_ours(open)) else {
            return self.handle_late_response(from, answer, seqnum);
        };
        // § 3.4.6.1, figure 30. A second response to CLEAR may carry the number of the transaction after it.
        let is_of_clear = !open.is_clear()
            && (answer.code, &answer.content) == (ReturnCode::Success, &AnswerContent::Nothing);
        if open.answer.is_some() || is_of_clear {
            return;
        }
        open.has_arrived = true;
        let peer = from;
        let awaits_confirmation =
            request::is_three_step(&open.request) && !request::is_error(answer.code);
        if awaits_confirmation {
            open.answer = Some(answer.clone());
            open.deadline = now.saturating_add(open.timeout);
            let (request, answer) = (open.request.clone(), answer.clone());
            self.events.push_back(Event::Answered { peer, request, answer, awaits_confirmation });
            return;
        }
        let Some(open) = state.initiated.take() else { return };
        if open.is_clear() {
            state.clear();
            // Numbers begin anew: what still waits carries old ones.
            self.purge(from);
        } else {
            state.crossed = (answer.code == ReturnCode::ErrorBusy).then_some(open.seqnum);
            // RC_RESET: as though it had never been (§ 3.4.3). RC_ERR_SEQNUM: numbers disagree until CLEAR.
            if !matches!(answer.code, ReturnCode::Reset | ReturnCode::ErrorSeqnum) {
                state.seqnum = next_seqnum(state.seqnum);
                if request::is_error(answer.code) {
                    // Should an agreement follow the refusal, it was another request that was refused.
                    state.remember(GivenUp::new(&open, true));
                }
            }
        }
        let (request, answer) = (open.request, answer.clone());
        self.events.push_back(Event::Answered { peer, request, answer, awaits_confirmation });
    }

    /// A response to a transaction that has failed here already: duplicates are ignored, but the first one shows that the
    /// neighbour has gone on with it.
    fn handle_late_response(&mut self, from: Eui64, answer: &SixpAnswer, seqnum: u8) {
        let Some(state) = self.peers.get_mut(&from) else { return };
        let Some(place) = state.given_up.iter().position(|late| late.seqnum == seqnum) else {
            return;
        };
        let late = &mut state.given_up[place];
        if matches!(answer.code, ReturnCode::Reset | ReturnCode::ErrorSeqnum) {
            return;
        }
        if !late.has_counted && state.initiated.is_none() {
            state.seqnum = next_seqnum(state.seqnum);
            late.has_counted = true;
        }
        if request::is_error(answer.code) || !late.changes_cells {
            return;
        }
        let late = state.given_up.remove(place);
        if late.is_three_step {
            // § 3.4.5: whoever cannot complete it says so.
            self.send(from, seqnum, SixpBody::Confirmation(error(ReturnCode::Reset)));
        } else {
            self.events.push_back(Event::Inconsistent { peer: from });
        }
    }

    fn handle_confirmation(&mut self, from: Eui64, answer: &SixpAnswer, seqnum: u8) {
        let Some(state) = self.peers.get_mut(&from) else { return };
        let awaits = |open: &mut Answering| {
            open.seqnum == seqnum && open.is_three_step() && open.answer.is_some()
        };
        let Some(open) = state.answering.take_if(awaits) else {
            // Confirmed after all, when we had given up: the neighbour has the cells.
            if state.lapsed.take_if(|lapsed| *lapsed == seqnum).is_some()
                && !request::is_error(answer.code)
            {
                self.events.push_back(Event::Inconsistent { peer: from });
            }
            return;
        };
        // § 3.4.6: the number grows with the confirmation.
        state.seqnum = next_seqnum(state.seqnum);
        let Answering { request, answer: Some(response), .. } = open else { return };
        self.events.push_back(if request::is_error(answer.code) {
            let why = Failure::Refused;
            Event::Failed { peer: from, request, is_initiator: false, why }
        } else {
            let confirmation = Some(answer.clone());
            Event::Completed { peer: from, request, response, confirmation }
        });
    }

    /// Whether the response has not been handed to the MAC.
    fn has_unsent_response(&self, to: Eui64, seqnum: u8) -> bool {
        self.outgoing.iter().any(|(peer, message)| {
            *peer == to && message.seqnum == seqnum && matches!(message.body, SixpBody::Response(_))
        })
    }
}

/// An answer that refuses.
pub(super) fn error(code: ReturnCode) -> SixpAnswer {
    SixpAnswer { code, content: AnswerContent::Nothing }
}
