//! Confirmable CoAP messages: RFC 7252, § 4.2 (messages that are transmitted reliably), 4.5 (duplicates) and 4.8 (parameters).

use super::stream::Stream;
use super::{Content, Destination, Host, Packet};
use crate::wire::coap::{CoapRepr, Token};
use bytes::Bytes;
use proto::config::Section;
use proto::ids::MoteId;
use proto::rng::{Draws, Purpose};
use proto::time::{SimDuration, SimTime};
use serde::{Deserialize, Serialize};
use std::collections::{BTreeSet, VecDeque};

/// Parameters of retransmission (RFC 7252, § 4.8).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Timers {
    /// ACK_TIMEOUT.
    pub least: SimDuration,
    /// ACK_TIMEOUT · ACK_RANDOM_FACTOR.
    pub most: SimDuration,
    /// MAX_RETRANSMIT.
    pub max_retransmit: u8,
}

/// Keys of [`Timers`].
#[derive(Clone, Copy, Debug, Section)]
pub(super) struct TimerKeys {
    /// The first timeout is at least this long (s). 2: ACK_TIMEOUT of RFC 7252, section 4.8.
    #[key(range = 1e-2..=1e3, default = 2.0)]
    ack_timeout_s: f64,
    /// The first timeout is uniform from ack_timeout_s to this many times as much. 1.5: ACK_RANDOM_FACTOR of RFC 7252, section 4.8.
    #[key(range = 1.0..=10.0, default = 1.5)]
    ack_random_factor: f64,
    /// How often a request is retransmitted, each time after twice the timeout. 4: MAX_RETRANSMIT of RFC 7252, section 4.8.
    #[key(range = 0..=16, default = 4)]
    max_retransmit: u8,
}

impl From<TimerKeys> for Timers {
    fn from(keys: TimerKeys) -> Self {
        let TimerKeys { ack_timeout_s, ack_random_factor, max_retransmit } = keys;
        let most = SimDuration::from_seconds(ack_timeout_s * ack_random_factor);
        Self { least: SimDuration::from_seconds(ack_timeout_s), most, max_retransmit }
    }
}

impl Timers {
    /// MAX_TRANSMIT_WAIT (RFC 7252, § 4.8.2): from the first transmission to when the sender gives up, at most. 93 s with the
    /// RFC's parameters.
    #[must_use]
    pub(crate) fn max_transmit_wait(&self) -> SimDuration {
        self.most * ((1 << (u32::from(self.max_retransmit) + 1)) - 1)
    }

    /// EXCHANGE_LIFETIME (§ 4.8.2): MAX_TRANSMIT_SPAN + 2 MAX_LATENCY + PROCESSING_DELAY, from the first transmission to when its
    /// message ID may be used again. 247 s with the RFC's parameters.
    #[must_use]
    pub(crate) fn exchange_lifetime(&self) -> SimDuration {
        let max_transmit_span = self.most * ((1 << u32::from(self.max_retransmit)) - 1);
        max_transmit_span + 2 * MAX_LATENCY + self.least
    }
}

/// MAX_LATENCY (RFC 7252, § 4.8.2; ns): how long a datagram may be on its way.
const MAX_LATENCY: SimDuration = SimDuration::from_s(100);

/// Message IDs of the requests that a server has answered within EXCHANGE_LIFETIME: it acts upon a request once, and only answers
/// its duplicates (RFC 7252, § 4.5).
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Answered {
    /// Clients and message IDs.
    known: BTreeSet<(MoteId, u16)>,
    /// The same in the order in which they came, with when each is forgotten.
    ends: VecDeque<(SimTime, MoteId, u16)>,
}

impl Answered {
    /// Notes a request of mote `from`. Returns whether it is a duplicate of one before.
    pub fn is_duplicate(
        &mut self,
        from: MoteId,
        request: &CoapRepr,
        timers: &Timers,
        now: SimTime,
    ) -> bool {
        while let Some(&(end, from, id)) = self.ends.front()
            && end <= now
        {
            self.ends.pop_front();
            self.known.remove(&(from, id));
        }
        let is_new = self.known.insert((from, request.message_id));
        if is_new {
            let end = now + timers.exchange_lifetime();
            self.ends.push_back((end, from, request.message_id));
        }
        !is_new
    }
}

/// One end of CoAP exchanges: an application of a mote. It numbers its messages and its tokens.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Endpoint {
    /// Number of the application, which is in paths of resources and in tokens.
    pub app: u32,
    /// How many applications share the mote's message IDs.
    n_apps: u32,
    /// The mote's first message ID: random (RFC 7252, § 4.4).
    first_id: u16,
    n_messages: u32,
    /// Draws of timeouts, and of what else the application draws.
    pub stream: Stream,
}

impl Endpoint {
    /// That of an application of a mote.
    #[must_use]
    pub fn new(host: &Host) -> Self {
        let draws = Draws::new(host.seed, Purpose::Traffic);
        Self {
            app: host.app,
            n_apps: host.n_apps,
            first_id: draws.words(u64::from(host.mote.0), u64::MAX, 0)[0] as u16,
            n_messages: 0,
            stream: Stream::new(host.seed, host.mote, host.app),
        }
    }

    /// The path of one of its resources: a letter, and the number of the application.
    #[must_use]
    pub fn path(&self, resource: char) -> String {
        format!("{resource}{}", self.app)
    }

    /// A message ID and a token that no other open exchange of the mote has: message IDs of the applications of a mote interleave,
    /// and the first byte of a token is the application.
    fn next_ids(&mut self) -> (u16, u32) {
        let n = self.n_messages;
        self.n_messages = n.wrapping_add(1);
        let step = n.wrapping_mul(self.n_apps).wrapping_add(self.app);
        (self.first_id.wrapping_add(step as u16), self.app << 24 | n & 0x00ff_ffff)
    }
}

/// A confirmable message to a mote that has not been answered.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Exchange {
    /// The other end.
    pub peer: MoteId,
    message: Bytes,
    message_id: u16,
    token: u32,
    due: SimTime,
    timeout: SimDuration,
    n_retransmitted: u8,
}

/// What a timeout of an [`Exchange`] brings.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Timeout {
    /// The message again.
    Again(Packet),
    /// MAX_RETRANSMIT retransmissions were not answered.
    GivenUp,
}

impl Exchange {
    /// Begins: `request` gets its message ID and its token. Returns the packet to be sent.
    pub fn begin(
        peer: MoteId,
        request: CoapRepr,
        timers: &Timers,
        endpoint: &mut Endpoint,
        now: SimTime,
    ) -> (Self, Packet) {
        let (message_id, token) = endpoint.next_ids();
        let timeout = endpoint.stream.duration(timers.least, timers.most);
        let message: Bytes =
            CoapRepr { message_id, token: token.into(), ..request }.to_vec().into();
        let due = now + timeout;
        let exchange = Self { peer, message, message_id, token, due, timeout, n_retransmitted: 0 };
        let packet = exchange.packet(now);
        (exchange, packet)
    }

    /// When the answer is given up waiting for.
    #[must_use]
    pub fn due(&self) -> SimTime {
        self.due
    }

    /// Whether a message of `from` answers it.
    #[must_use]
    pub(crate) fn is_answered_by(&self, from: MoteId, message: &CoapRepr) -> bool {
        from == self.peer && message.answers(self.message_id, Token::from(self.token))
    }

    /// The answer has not come in time.
    pub fn handle_timeout(&mut self, timers: &Timers, now: SimTime) -> Timeout {
        if timers.max_retransmit <= self.n_retransmitted {
            return Timeout::GivenUp;
        }
        self.n_retransmitted += 1;
        self.timeout = self.timeout * 2;
        self.due = now + self.timeout;
        Timeout::Again(self.packet(now))
    }

    fn packet(&self, created: SimTime) -> Packet {
        coap_packet(self.peer, self.message.clone(), created)
    }
}

/// A packet with a CoAP message to a mote.
pub(super) fn coap_packet(to: MoteId, message: Bytes, created: SimTime) -> Packet {
    Packet { destination: Destination::Mote(to), content: Content::Coap(message), created }
}
