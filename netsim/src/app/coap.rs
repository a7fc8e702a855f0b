//! `coap`: the root asks motes, and they answer (RFC 7252).
//!
//! The client is the first root. It sends a confirmable GET to one mote after another; the mote answers with an acknowledgment that
//! has the response (piggybacked, § 5.2.1). A mote has one open exchange at most (NSTART, § 4.7): the client passes over motes whose
//! last exchange is open, and motes to which it has no route.
//!
//! The mote counts duplicates of requests, which it answers like the first (§ 4.5).
//!
//! An exchange succeeds if its response comes, to whichever transmission. Its round-trip time is that from the first transmission.

use super::config::Largest;
use super::exchange::{Answered, Endpoint, Exchange, Timeout, TimerKeys, Timers, coap_packet};
use super::sender::MAX_PAYLOAD_BYTES;
use super::{Context, Counters, Heard, Host, Packet, Reading, Traffic};
use crate::lowpan::DropReason;
use crate::wire::coap::{CoapRepr, Code, Token, Type};
use proto::config::{Choice, OneOf, Section, Variant, variant};
use proto::ids::MoteId;
use proto::time::{SimDuration, SimTime};
use proto::types::PacketPurpose;
use serde::{Deserialize, Serialize};

/// First letter of the path of the resource that is asked for; the number of the application follows.
const RESOURCE: char = 's';

/// Whom the client asks.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Servers {
    /// All other motes in turn.
    InTurn,
    /// A random other mote each time.
    Random,
    /// One mote.
    One(MoteId),
}

/// What is the same for all motes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Settings {
    /// Whom the client asks.
    pub servers: Servers,
    /// Mean time between two requests.
    pub period: SimDuration,
    /// Whether intervals are exponential.
    pub is_poisson: bool,
    /// Payload of a response (bytes).
    pub response_bytes: u16,
    /// Parameters of retransmission.
    pub timers: Timers,
}

/// CoAP request and response: the client at the first root, a server at all other motes.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Coap {
    settings: Settings,
    host: Option<Host>,
    endpoint: Endpoint,
    is_client: bool,
    is_ready: bool,
    next: Option<SimTime>,
    /// Whom the next request in turn goes to, unless that cannot be.
    turn: u32,
    /// Open exchanges, each with its number in the account of packets.
    open: Vec<(Exchange, u64)>,
    /// Requests that the mote has answered.
    answered: Answered,
    counters: Counters,
}

/// CoAP request and response (RFC 7252): the first root sends confirmable requests to motes, which answer with a piggybacked
/// response.
#[derive(Section)]
struct Keys {
    /// Whom the root asks: one of these, or the number of a mote. Motes without a route and motes whose last exchange is open are
    /// passed over.
    #[key(default = Named::InTurn)]
    servers: ServersKey,
    /// Mean time between two requests of the root (s).
    #[key(range = 1e-2..=1e6, default = 10.0)]
    period_s: f64,
    /// Distribution of the time between two requests.
    #[key(default = Interval::Fixed)]
    interval: Interval,
    /// Payload of a response (bytes), without the CoAP header.
    #[key(range = 0..=MAX_PAYLOAD_BYTES, default = 16)]
    response_bytes: u16,
    #[key(flatten)]
    timers: TimerKeys,
}

#[derive(OneOf)]
enum ServersKey {
    Named(Named),
    One(u32),
}

#[derive(Choice)]
enum Named {
    /// All other motes in turn.
    InTurn,
    /// A random other mote for each request.
    Random,
}

#[derive(Choice, PartialEq)]
enum Interval {
    /// Always period_s.
    Fixed,
    /// Exponential with mean period_s: a Poisson process.
    Exponential,
}

impl Coap {
    /// Not assigned to a mote.
    #[must_use]
    pub fn new(settings: Settings) -> Self {
        Self {
            settings,
            host: None,
            endpoint: Endpoint::default(),
            is_client: false,
            is_ready: false,
            next: None,
            turn: 0,
            open: Vec::new(),
            answered: Answered::default(),
            counters: Counters::default(),
        }
    }

    /// The only mote that is asked, if it is one.
    pub(super) fn one_server(&self) -> Option<MoteId> {
        match self.settings.servers {
            Servers::One(mote) => Some(mote),
            Servers::InTurn | Servers::Random => None,
        }
    }

    fn pause(&mut self) -> SimDuration {
        let Settings { period, is_poisson, .. } = self.settings;
        if is_poisson { self.endpoint.stream.exponential(period) } else { period }
    }

    /// Whom the next request goes to; `None`: nobody can be asked now.
    fn next_server(&mut self, cx: &Context<'_>) -> Option<MoteId> {
        let Host { mote: own, n_motes, .. } = self.host?;
        let open = &self.open;
        let can_be_asked = |mote: MoteId| {
            mote != own
                && !open.iter().any(|(exchange, _)| exchange.peer == mote)
                && (cx.reaches)(mote)
        };
        match self.settings.servers {
            Servers::One(mote) => Some(mote).filter(|&mote| can_be_asked(mote)),
            Servers::InTurn => {
                let in_turn = (0..n_motes).map(|k| (self.turn + k) % n_motes);
                let mote = in_turn.into_iter().find(|&mote| can_be_asked(MoteId(mote)))?;
                self.turn = (mote + 1) % n_motes;
                Some(MoteId(mote))
            }
            Servers::Random => {
                let free: Vec<MoteId> =
                    (0..n_motes).map(MoteId).filter(|&mote| can_be_asked(mote)).collect();
                let n = free.len() as u64;
                (n != 0).then(|| free[self.endpoint.stream.below(n) as usize])
            }
        }
    }

    fn request(&mut self, cx: &mut Context<'_>) -> Option<Packet> {
        let server = self.next_server(cx)?;
        let own = self.host?.mote;
        let get = CoapRepr::request(Code::GET, &self.endpoint.path(RESOURCE));
        let timers = &self.settings.timers;
        let (exchange, packet) = Exchange::begin(server, get, timers, &mut self.endpoint, cx.now);
        let bytes = u32::from(self.settings.response_bytes);
        let number = cx.packets.begin(PacketPurpose::Exchange, own, server, cx.now, bytes);
        self.open.push((exchange, number));
        self.counters.requests += 1;
        Some(packet)
    }

    /// The mote's answer to a request.
    fn response(&self, request: &CoapRepr) -> CoapRepr {
        let payload = vec![0; usize::from(self.settings.response_bytes)].into();
        CoapRepr { payload, ..request.response(Code::CONTENT) }
    }

    fn first_due(&self) -> Option<usize> {
        (0..self.open.len()).min_by_key(|&place| self.open[place].0.due())
    }
}

impl super::Kind for Coap {
    const VARIANT: Variant = variant::<Keys>("coap");

    fn read(reading: &mut Reading<'_>) -> Option<Self> {
        let keys = Keys::read(reading.table);
        let servers = match keys.servers {
            ServersKey::One(number) => Servers::One(MoteId(reading.mote("servers", number)?.0)),
            ServersKey::Named(Named::InTurn) => Servers::InTurn,
            ServersKey::Named(Named::Random) => Servers::Random,
        };
        Some(Self::new(Settings {
            servers,
            period: SimDuration::from_seconds(keys.period_s),
            is_poisson: keys.interval == Interval::Exponential,
            response_bytes: keys.response_bytes,
            timers: keys.timers.into(),
        }))
    }

    fn assigned(&self, host: &Host) -> Option<Self> {
        let is_client = host.mote == host.first_root;
        let endpoint = Endpoint::new(host);
        Some(Self { host: Some(*host), endpoint, is_client, ..Self::new(self.settings) })
    }

    fn largest(&self) -> Largest {
        let request = CoapRepr { token: Token::from(0), ..CoapRepr::request(Code::GET, "") };
        let packet =
            coap_packet(MoteId(0), self.response(&request).to_vec().into(), SimTime::START);
        Largest { key: "response_bytes", value: self.settings.response_bytes.into(), packet }
    }
}

impl Traffic for Coap {
    /// The first request follows a period after the root has become ready.
    fn set_ready(&mut self, is_ready: bool, cx: &mut Context<'_>) {
        if is_ready && !self.is_ready && self.is_client {
            self.next = Some(cx.now + self.pause());
        }
        self.is_ready = is_ready;
    }

    fn poll_timeout(&self) -> Option<SimTime> {
        if !self.is_client || !self.is_ready {
            return None;
        }
        let retransmission = self.first_due().map(|place| self.open[place].0.due());
        [self.next, retransmission].into_iter().flatten().min()
    }

    fn handle_timeout(&mut self, cx: &mut Context<'_>) -> Option<Packet> {
        if let Some(place) = self.first_due()
            && self.open[place].0.due() <= cx.now
        {
            let (exchange, number) = &mut self.open[place];
            return match exchange.handle_timeout(&self.settings.timers, cx.now) {
                Timeout::Again(packet) => {
                    self.counters.retransmissions += 1;
                    Some(packet)
                }
                Timeout::GivenUp => {
                    cx.packets.lose(*number, cx.now, DropReason::MaxRetries);
                    self.open.remove(place);
                    None
                }
            };
        }
        let pause = self.pause();
        self.next = self.next.map(|next| next + pause);
        self.request(cx)
    }

    fn handle_message(
        &mut self,
        from: MoteId,
        hops: u32,
        message: &CoapRepr,
        cx: &mut Context<'_>,
    ) -> Heard {
        match message.kind {
            Type::Confirmable => {
                if message.path.as_deref() != Some(&*self.endpoint.path(RESOURCE)) {
                    return Heard::NotMine;
                }
                if !self.is_ready {
                    return Heard::Taken(None);
                }
                let timers = &self.settings.timers;
                let is_again = self.answered.is_duplicate(from, message, timers, cx.now);
                self.counters.duplicates += u64::from(is_again);
                let answer = self.response(message).to_vec();
                let answer = coap_packet(from, answer.into(), cx.now);
                Heard::Taken(Some(answer))
            }
            Type::Acknowledgment => {
                let answered =
                    |(exchange, _): &(Exchange, u64)| exchange.is_answered_by(from, message);
                let Some(place) = self.open.iter().position(answered) else {
                    return Heard::NotMine;
                };
                let (_, number) = self.open.remove(place);
                cx.packets.deliver(number, cx.received, hops);
                Heard::Taken(None)
            }
        }
    }

    fn reset(&mut self, cx: &mut Context<'_>) {
        self.answered = Answered::default();
        for (_, number) in std::mem::take(&mut self.open) {
            cx.packets.lose(number, cx.now, DropReason::Killed);
        }
    }

    fn reseed(&mut self, seed: u64) {
        self.endpoint.stream.reseed(seed);
    }

    fn counters(&self) -> Counters {
        self.counters
    }
}
