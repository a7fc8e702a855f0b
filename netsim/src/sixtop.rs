//! 6P, the 6top protocol: RFC 8480. A state machine per neighbour: transactions of two or three steps, sequence numbers,
//! timeouts.
//!
//! | module | what |
//! |---|---|
//! | [`request`] | what a request asks for: steps, cells, what makes it invalid |
//! | [`query`] | COUNT and LIST, answered from a slotframe |
//! | [`timeout`] | how long a transaction may take where the scheduling function does not say |
//!
//! Between two neighbours one transaction runs at a time. § 3.4.3 lets an implementation run one in each direction; but
//! both would count with the one number that § 3.4.6 keeps for a neighbour, and a transaction begun before the other ended
//! would look like an inconsistency. Who is asked while it asks itself answers RC_ERR_BUSY.
//!
//! CLEAR is the exception: it is always taken, and ends whatever else was going on with that neighbour (§ 3.3.6).

mod peer;
pub mod query;
mod receive;
pub mod request;
mod sent;
pub mod timeout;

#[cfg(test)]
mod tests;

use crate::wire::Eui64;
use crate::wire::sixp::{
    AnswerContent, ReturnCode, SixpAnswer, SixpBody, SixpCell, SixpRepr, SixpRequest,
};
use peer::{Answering, GivenUp, Initiated, Peer, next_seqnum};
use proto::time::{SimDuration, SimTime};
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, VecDeque};
use timeout::Role;

/// The only version of 6P there is (§ 3.2.2).
pub const VERSION: u8 = 0;

/// What 6P reports to the scheduling function.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Event {
    /// A neighbour asks for something: answer with [`Sixtop::respond`], or not at all with [`Sixtop::ignore`]. The request
    /// is sound in itself: lists are as long as they must be, options exist (§ 3.3).
    Request {
        /// Who asks.
        peer: Eui64,
        /// What.
        request: SixpRequest,
    },
    /// Our request was answered. In a transaction of three steps, [`Sixtop::confirm`] follows.
    Answered {
        /// By whom.
        peer: Eui64,
        /// What we had asked.
        request: SixpRequest,
        /// The answer.
        answer: SixpAnswer,
        /// A confirmation is expected.
        awaits_confirmation: bool,
    },
    /// As responder: the transaction is complete, both ends agree. Of two steps: our response was acknowledged by the
    /// MAC. Of three: the confirmation has come. Not reported of answers that refuse: nothing was agreed.
    Completed {
        /// With whom.
        peer: Eui64,
        /// What it had asked.
        request: SixpRequest,
        /// What we had answered.
        response: SixpAnswer,
        /// What it confirmed, in a transaction of three steps.
        confirmation: Option<SixpAnswer>,
    },
    /// As initiator of three steps: our confirmation was acknowledged by the MAC.
    Confirmed {
        /// By whom.
        peer: Eui64,
        /// What we had asked.
        request: SixpRequest,
        /// What we confirmed.
        confirmation: SixpAnswer,
    },
    /// The transaction has failed. Nothing was agreed.
    Failed {
        /// With whom.
        peer: Eui64,
        /// What was asked.
        request: SixpRequest,
        /// We had asked.
        is_initiator: bool,
        /// Why.
        why: Failure,
    },
    /// Sequence numbers disagree, or one end may have completed what the other gave up: the ends may hold different cells
    /// (RFC 8480, § 3.4.6.2).
    Inconsistent {
        /// With whom.
        peer: Eui64,
    },
}

/// Why a transaction has failed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Failure {
    /// No answer in time.
    Timeout,
    /// The message was never acknowledged, or found no place in the queue.
    NotSent,
    /// It was called off: by us, by a CLEAR, or because the neighbour has lost its state.
    Aborted,
    /// The third step carries an error (§ 3.4.5, § 3.4.7).
    Refused,
}

/// A transaction with this neighbour is open already (§ 3.4.3).
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("a transaction with {0} is open")]
pub struct Busy(
    /// Address of the neighbour with which the transaction is open.
    pub Eui64,
);

/// The settings of 6P.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Config {
    /// Whose transactions these are: the scheduling function's identifier (§ 3.4.2). MSF: 0.
    pub sfid: u8,
    /// Length of the slotframe, for `timeout::default_for`.
    pub slotframe: SimDuration,
    /// How often the MAC repeats a frame, for `timeout::default_for`. Of one that never gives up: as often as must do.
    pub max_retries: u16,
    /// The largest back-off exponent, for `timeout::default_for`.
    pub max_be: u8,
}

impl Default for Config {
    fn default() -> Self {
        Self { sfid: 0, slotframe: SimDuration::from_ns(1_010_000_000), max_retries: 5, max_be: 7 }
    }
}

/// 6P of one mote.
///
/// What comes in: `Sixtop::handle_message`, and `Sixtop::handle_sent` with the MAC's last word on every message that
/// `Sixtop::poll_transmit` gave it. After each call: purge what `Sixtop::poll_purge` names, send what
/// `Sixtop::poll_transmit` gives, pass on what `Sixtop::poll_event` reports; in this order, for a purge is older than the
/// messages that wait.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Sixtop {
    config: Config,
    peers: BTreeMap<Eui64, Peer>,
    /// Neighbours with an open transaction: whose deadlines count.
    busy: Vec<Eui64>,
    outgoing: VecDeque<(Eui64, SixpRepr)>,
    purges: VecDeque<Eui64>,
    events: VecDeque<Event>,
}

impl Sixtop {
    /// No transaction, no neighbour known.
    #[must_use]
    pub fn new(config: Config) -> Self {
        Self { config, ..Self::default() }
    }

    /// Its settings.
    #[must_use]
    pub fn config(&self) -> &Config {
        &self.config
    }

    /// Asks a neighbour for something. `timeout`: how long to wait for each message of its; `None`:
    /// `timeout::default_for`. The clock starts anew when the request is acknowledged (§ 3.4.4).
    ///
    /// # Errors
    ///
    /// A transaction with it is open.
    pub fn request(
        &mut self,
        peer: Eui64,
        request: SixpRequest,
        timeout: Option<SimDuration>,
        now: SimTime,
    ) -> Result<(), Busy> {
        if self.is_busy(peer) {
            return Err(Busy(peer));
        }
        let role = Role::Initiator;
        let timeout = timeout.unwrap_or_else(|| {
            timeout::default_for(&self.config, role, request::is_three_step(&request))
        });
        let state = self.peers.entry(peer).or_default();
        let seqnum = match request {
            SixpRequest::Clear { .. } => state.number_clear(),
            _ => state.seqnum,
        };
        state.crossed = None;
        state.initiated = Some(Initiated::new(request.clone(), seqnum, timeout, now));
        self.send(peer, seqnum, SixpBody::Request(request));
        self.note_busy(peer);
        Ok(())
    }

    /// A transaction with a neighbour has begun.
    fn note_busy(&mut self, peer: Eui64) {
        if !self.busy.contains(&peer) {
            self.busy.push(peer);
        }
    }

    /// Transactions may have ended: neighbours without an open one are no longer busy.
    fn note_ended(&mut self) {
        let Self { busy, peers, .. } = self;
        let is_open = |peer: &Eui64| peers.get(peer).is_some_and(|peer| peer.deadline().is_some());
        busy.retain(is_open);
    }

    /// Answers the request that [`Event::Request`] reported. Without one it does nothing.
    pub fn respond(&mut self, peer: Eui64, answer: SixpAnswer, now: SimTime) {
        let config = self.config;
        let Some(state) = self.peers.get_mut(&peer) else { return };
        let Some(open) = state.answering.as_mut().filter(|open| open.answer.is_none()) else {
            return;
        };
        let takes = timeout::default_for(&config, Role::Responder, open.is_three_step());
        open.deadline = now.saturating_add(takes);
        open.answer = Some(answer.clone());
        let seqnum = open.seqnum;
        self.send(peer, seqnum, SixpBody::Response(answer));
    }

    /// Leaves the request that [`Event::Request`] reported without an answer, as if it had not been heard.
    pub fn ignore(&mut self, peer: Eui64) {
        if let Some(state) = self.peers.get_mut(&peer)
            && state.answering.as_ref().is_some_and(|open| open.answer.is_none())
        {
            state.answering = None;
            self.note_ended();
        }
    }

    /// Confirms what [`Event::Answered`] reported in a transaction of three steps. Without one it does nothing.
    pub fn confirm(&mut self, peer: Eui64, confirmation: SixpAnswer, now: SimTime) {
        let Some(state) = self.peers.get_mut(&peer) else { return };
        let Some(open) = state.initiated.as_mut() else { return };
        if open.answer.is_none() || open.confirmation.is_some() {
            return;
        }
        open.deadline = now.saturating_add(open.timeout);
        open.confirmation = Some(confirmation.clone());
        let seqnum = open.seqnum;
        self.send(peer, seqnum, SixpBody::Confirmation(confirmation));
    }

    /// Calls off whatever runs with a neighbour. Its messages leave the queues; it receives RC_RESET where § 3.4.5 has a
    /// message for that.
    pub fn abort(&mut self, peer: Eui64) {
        let Some(state) = self.peers.get(&peer) else { return };
        // A request that was not answered yet, or an answer that was not confirmed yet, is answered with RC_RESET.
        let response = state.answering.as_ref().filter(|open| open.answer.is_none());
        let confirmation =
            state.initiated.as_ref().filter(|o| o.answer.is_some() && o.confirmation.is_none());
        let reset = SixpAnswer { code: ReturnCode::Reset, content: AnswerContent::Nothing };
        let farewell = match (response, confirmation) {
            (Some(open), _) => Some((open.seqnum, SixpBody::Response(reset))),
            (None, Some(open)) => Some((open.seqnum, SixpBody::Confirmation(reset))),
            (None, None) => None,
        };
        self.call_off(peer);
        self.note_ended();
        if let Some((seqnum, body)) = farewell {
            self.send(peer, seqnum, body);
        }
    }

    /// The next message for the MAC, with its destination.
    pub(crate) fn poll_transmit(&mut self) -> Option<(Eui64, SixpRepr)> {
        self.outgoing.pop_front()
    }

    /// The next thing to report.
    pub(crate) fn poll_event(&mut self) -> Option<Event> {
        self.events.pop_front()
    }

    /// The next neighbour whose 6P messages are to leave the MAC's queue. No [`Sixtop::handle_sent`] need follow for them.
    pub(crate) fn poll_purge(&mut self) -> Option<Eui64> {
        self.purges.pop_front()
    }

    /// When [`Sixtop::handle_timeout`] wants to be called.
    #[must_use]
    pub fn poll_timeout(&self) -> Option<SimTime> {
        self.busy.iter().filter_map(|peer| self.peers.get(peer)?.deadline()).min()
    }

    /// Ends the transactions whose time has come (§ 3.4.4).
    pub fn handle_timeout(&mut self, now: SimTime) {
        let due = |peer: &Peer| peer.deadline().is_some_and(|deadline| deadline <= now);
        let late: Vec<Eui64> =
            self.peers.iter().filter(|(_, state)| due(state)).map(|(&peer, _)| peer).collect();
        for peer in late {
            self.purge(peer);
            let Some(state) = self.peers.get_mut(&peer) else { continue };
            if let Some(open) = state.initiated.take_if(|open| open.deadline <= now) {
                self.give_up(peer, open, Failure::Timeout);
            }
            let Some(state) = self.peers.get_mut(&peer) else { continue };
            if let Some(open) = state.answering.take_if(|open| open.deadline <= now) {
                self.lapse(peer, open, Failure::Timeout);
            }
        }
        self.note_ended();
    }

    /// Whether a transaction with a neighbour is open.
    #[must_use]
    pub fn is_busy(&self, peer: Eui64) -> bool {
        self.peers
            .get(&peer)
            .is_some_and(|state| state.initiated.is_some() || state.answering.is_some())
    }

    /// What we have asked a neighbour and is not complete.
    #[must_use]
    pub(crate) fn open_request(&self, peer: Eui64) -> Option<&SixpRequest> {
        Some(&self.peers.get(&peer)?.initiated.as_ref()?.request)
    }

    /// The sequence number of the next transaction with a neighbour (§ 3.4.6); 0 of one that is new.
    #[must_use]
    pub fn seqnum(&self, peer: Eui64) -> u8 {
        self.peers.get(&peer).map_or(0, |state| state.seqnum)
    }

    /// Whether an open transaction may yet put a cell into a slot or take one from it (§ 3.4.3: locked).
    #[must_use]
    pub(crate) fn is_locked(&self, slot: u16) -> bool {
        self.locked().any(|(_, cell)| cell.slot == slot)
    }

    /// Cells of open transactions, with the neighbour (§ 3.4.3). Nothing but the transactions themselves says what is
    /// locked: what ends one unlocks.
    pub fn locked(&self) -> impl Iterator<Item = (Eui64, SixpCell)> + '_ {
        self.peers.iter().flat_map(|(&peer, state)| state.locked().map(move |&cell| (peer, cell)))
    }

    /// The mote has lost its state (§ 3.4.6): no transactions, all sequence numbers 0, nothing waits.
    pub fn reset(&mut self) {
        *self = Self::new(self.config);
    }

    fn send(&mut self, peer: Eui64, seqnum: u8, body: SixpBody) {
        let message = SixpRepr { version: VERSION, sfid: self.config.sfid, seqnum, body };
        self.outgoing.push_back((peer, message));
    }

    fn purge(&mut self, peer: Eui64) {
        self.outgoing.retain(|(to, _)| *to != peer);
        self.purges.push_back(peer);
    }

    /// Ends both transactions that may be open with a neighbour.
    fn call_off(&mut self, peer: Eui64) {
        let Some(state) = self.peers.get_mut(&peer) else { return };
        let (initiated, answering) = (state.initiated.take(), state.answering.take());
        if initiated.is_none() && answering.is_none() {
            return;
        }
        self.purge(peer);
        if let Some(open) = initiated {
            self.give_up(peer, open, Failure::Aborted);
        }
        if let Some(open) = answering {
            self.lapse(peer, open, Failure::Aborted);
        }
    }

    /// A transaction of ours fails.
    fn give_up(&mut self, peer: Eui64, open: Initiated, why: Failure) {
        let Some(state) = self.peers.get_mut(&peer) else { return };
        // § 3.4.6: the number grows when a transaction ends whose request was acknowledged.
        if open.is_clear() {
            state.clear();
        } else if open.has_arrived {
            state.seqnum = next_seqnum(state.seqnum);
        }
        // § 3.4.6.2, second case: the confirmation may have arrived, and the cells with it.
        let is_half_done =
            open.confirmation.as_ref().is_some_and(|answer| !request::is_error(answer.code));
        if !open.is_clear() {
            state.remember(GivenUp::new(&open, open.has_arrived));
        }
        let Initiated { request, .. } = open;
        self.events.push_back(Event::Failed { peer, request, is_initiator: true, why });
        if is_half_done {
            self.events.push_back(Event::Inconsistent { peer });
        }
    }

    /// A transaction of a neighbour's fails here.
    fn lapse(&mut self, peer: Eui64, open: Answering, why: Failure) {
        let Some(state) = self.peers.get_mut(&peer) else { return };
        let agreed = open.answer.as_ref().is_some_and(|answer| !request::is_error(answer.code));
        // § 3.4.6.2, second case: the response may have arrived, and the cells with it. Of three steps, the confirmation
        // decides; it may yet come.
        let is_half_done = agreed && request::changes_cells(&open.request) && !open.is_three_step();
        if agreed && open.is_three_step() {
            state.lapsed = Some(open.seqnum);
        }
        self.events.push_back(Event::Failed {
            peer,
            request: open.request,
            is_initiator: false,
            why,
        });
        if is_half_done {
            self.events.push_back(Event::Inconsistent { peer });
        }
    }
}
