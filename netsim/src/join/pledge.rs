//! A mote that asks to be admitted.

use super::{Config, Outgoing};
use crate::dice::Dice;
use crate::wire::Eui64;
use crate::wire::cojp::CojpRepr;
use crate::wire::oscore::Context;
use proto::time::{SimDuration, SimTime};
use serde::{Deserialize, Serialize};
use std::collections::VecDeque;

/// What has become of a pledge.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Event {
    /// It is admitted.
    Joined,
    /// Nobody has answered, or the mote has given up. It shall look for a network again.
    Failed,
    /// It was admitted and is no longer in the network.
    Left,
}

/// Where a pledge stands.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
enum State {
    /// It does not ask.
    Idle,
    /// It has asked and waits for the response.
    Waiting {
        /// The neighbour through which it asks.
        proxy: Eui64,
        /// Of the request, the same for all repetitions: a late response to any of them counts.
        message_id: u16,
        /// Sender sequence number of the first request. Each repetition has the next one: the registrar does not answer a
        /// number twice (RFC 8613, § 7.4).
        first_sequence: u32,
        /// Requests sent.
        n_sent: u8,
        /// How long it waits after the last one.
        timeout: SimDuration,
        /// Until when.
        until: SimTime,
    },
    /// It is admitted.
    Joined,
}

/// The side of the join protocol that asks.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Pledge {
    config: Config,
    own: Eui64,
    state: State,
    outgoing: Option<Outgoing>,
    /// Sender sequence number of the next request under OSCORE. It is never used again, not after a restart either
    /// (RFC 9031, § 7.3.1).
    sequence: u32,
    /// The join rate from the registrar.
    join_rate_bytes_s: Option<u32>,
    events: VecDeque<Event>,
}

impl Pledge {
    /// A mote that does not ask yet.
    #[must_use]
    pub fn new(config: Config, own: Eui64) -> Self {
        let (state, outgoing, join_rate_bytes_s) = (State::Idle, None, None);
        Self {
            config,
            own,
            state,
            outgoing,
            sequence: 0,
            join_rate_bytes_s,
            events: VecDeque::new(),
        }
    }

    /// A mote that needs not ask: a root.
    #[must_use]
    pub fn admitted(config: Config, own: Eui64) -> Self {
        Self { state: State::Joined, ..Self::new(config, own) }
    }

    /// Whether it is admitted.
    #[must_use]
    pub fn is_joined(&self) -> bool {
        self.state == State::Joined
    }

    /// The mote is synchronised: ask through `proxy`, the neighbour it is synchronised to. If it is asking already, it begins
    /// anew; if it is admitted, nothing happens.
    pub fn start(&mut self, proxy: Eui64, now: SimTime, dice: &mut Dice) {
        if self.is_joined() {
            return;
        }
        if !self.config.secure {
            self.state = State::Joined;
            self.events.push_back(Event::Joined);
            return;
        }
        let Config { timeout_min, timeout_max, .. } = self.config;
        let timeout = dice.duration(timeout_min, timeout_max);
        let message_id = dice.word() as u16;
        let until = now + timeout;
        let first_sequence = self.sequence;
        self.state =
            State::Waiting { proxy, message_id, first_sequence, n_sent: 1, timeout, until };
        self.request(proxy, message_id);
    }

    /// The neighbour that the mote is synchronised to has changed: repetitions go through this one.
    pub(crate) fn handle_proxy(&mut self, new: Eui64) {
        if let State::Waiting { proxy, .. } = &mut self.state {
            *proxy = new;
        }
    }

    /// A response has come. Only one to the request that is open admits.
    pub(crate) fn handle_response(&mut self, response: &CojpRepr) {
        let State::Waiting { message_id: open, first_sequence, .. } = self.state else { return };
        let unprotected = self.config.security.map(|security| {
            let context = Context::of_pledge(&security.join_key, self.own);
            response.unprotect_response(&context, first_sequence..self.sequence, self.own)
        });
        let response = match &unprotected {
            None => response,
            Some(Some(response)) => response,
            // Not authentic.
            Some(None) => return,
        };
        let CojpRepr::Response {
            message_id,
            pledge,
            proxy_state: None,
            join_rate_bytes_s,
            keys,
            ..
        } = *response
        else {
            return;
        };
        let brings_keys = keys == self.config.security.map(|security| security.keys);
        if message_id == open && pledge == self.own && brings_keys {
            self.state = State::Joined;
            self.outgoing = None;
            self.join_rate_bytes_s = join_rate_bytes_s;
            self.events.push_back(Event::Joined);
        }
    }

    /// The join rate that the registrar sent when it admitted the mote (bytes per second); it limits the mote as a proxy.
    #[must_use]
    pub fn join_rate_bytes_s(&self) -> Option<u32> {
        self.join_rate_bytes_s
    }

    /// The mote is no longer synchronised, or is switched off.
    pub fn leave(&mut self) {
        match self.state {
            State::Idle => {}
            State::Waiting { .. } => self.events.push_back(Event::Failed),
            State::Joined => self.events.push_back(Event::Left),
        }
        self.state = State::Idle;
        self.outgoing = None;
    }

    /// When the response has not come in time.
    #[must_use]
    pub fn poll_timeout(&self) -> Option<SimTime> {
        match self.state {
            State::Waiting { until, .. } => Some(until),
            State::Idle | State::Joined => None,
        }
    }

    /// The response has not come in time: ask again and wait twice as long, or give up.
    pub fn handle_timeout(&mut self, now: SimTime) {
        let State::Waiting { proxy, message_id, n_sent, timeout, until, .. } = &mut self.state
        else {
            return;
        };
        if now < *until {
            return;
        }
        if self.config.max_retransmit < *n_sent {
            self.state = State::Idle;
            self.events.push_back(Event::Failed);
            return;
        }
        *n_sent += 1;
        *timeout = *timeout * 2;
        *until = now + *timeout;
        let (proxy, message_id) = (*proxy, *message_id);
        self.request(proxy, message_id);
    }

    /// The message to be sent, if there is one.
    pub(crate) fn poll_transmit(&mut self) -> Option<Outgoing> {
        self.outgoing.take()
    }

    /// What has happened, in order.
    pub(crate) fn poll_event(&mut self) -> Option<Event> {
        self.events.pop_front()
    }

    fn request(&mut self, proxy: Eui64, message_id: u16) {
        let network_id = self.config.network_id;
        let mut message =
            CojpRepr::Request { message_id, pledge: self.own, proxy_state: None, network_id };
        if let Some(security) = self.config.security {
            let context = Context::of_pledge(&security.join_key, self.own);
            message = message.protect(&context, self.sequence);
            self.sequence += 1;
        }
        let (source, destination) = (self.own.link_local(), proxy.link_local());
        self.outgoing = Some(Outgoing { source, destination, dscp: 0, message });
    }
}
