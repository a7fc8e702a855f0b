//! Applications: the traffic that motes generate.
//!
//! | module | what |
//! |---|---|
//! | [`config`] | `[[netsim.app]]`, and the one list of kinds |
//! | [`sender`] | what one-way kinds share: senders, destination, payload |
//! | [`periodic`], [`burst`], [`poisson`], [`event`] | one-way kinds |
//! | [`exchange`] | confirmable CoAP messages and their retransmission |
//! | [`coap`], [`download`] | kinds with requests and responses |
//! | [`stream`] | random draws of one application |
//! | [`packets`], [`ports`] | packets from end to end, and their UDP ports |
//!
//! An application is a state machine that decides when it sends what; the mote handles addresses, routes and frames. An
//! application sends only while the mote is ready (`App::set_ready`): packets that would fall in the time before do not exist.
//!
//! A new kind is one file that implements [`Traffic`] and [`Kind`], and one line in [`config`].

pub mod burst;
pub mod coap;
pub mod config;
pub mod download;
pub mod event;
pub mod exchange;
pub mod packets;
pub mod periodic;
pub mod poisson;
pub mod ports;
pub mod sender;
pub mod stream;

pub use config::{Machine, Spec};
pub use event::Events;
pub use sender::{Peer, Sender};

use crate::app::packets::Packets;
use crate::app::ports::APPLICATION_PORT;
use crate::dice::Dice;
use crate::join::ports::COAP;
use crate::lowpan::DropReason;
use crate::wire::coap::CoapRepr;
use crate::wire::datagram::UdpRepr;
use bytes::Bytes;
use config::Largest;
use proto::config::{Problem, Variant};
use proto::ids::MoteId;
use proto::time::{SimDuration, SimTime};
use serde::{Deserialize, Serialize};

/// For whom a packet is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Destination {
    /// The root of the sender's own DODAG.
    Root,
    /// A mote.
    Mote(MoteId),
}

/// What a packet carries.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Content {
    /// Payload of a one-way application.
    Counted {
        /// Length of the UDP payload (bytes).
        payload_bytes: u16,
        /// How many packets the application sent before.
        counter: u32,
    },
    /// A CoAP message.
    Coap(Bytes),
}

/// A packet to be sent.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Packet {
    /// Destination of the packet.
    pub destination: Destination,
    /// What it carries.
    pub content: Content,
    /// When it was created.
    pub created: SimTime,
}

impl Packet {
    /// What travels in its IPv6 datagram.
    #[must_use]
    pub fn udp(&self) -> UdpRepr {
        let port = match self.content {
            Content::Counted { .. } => APPLICATION_PORT,
            Content::Coap(_) => COAP,
        };
        UdpRepr { source_port: port, destination_port: port, payload: self.payload() }
    }

    /// UDP payload: a CoAP message; or the counter, most significant byte first, then zeros, cut to its length.
    #[must_use]
    pub fn payload(&self) -> Bytes {
        match &self.content {
            Content::Coap(message) => message.clone(),
            Content::Counted { payload_bytes, counter } => {
                let mut bytes = counter.to_be_bytes().to_vec();
                bytes.resize(usize::from(*payload_bytes), 0);
                Bytes::from(bytes)
            }
        }
    }
}

/// The mote that runs an application.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Host {
    /// Number of the mote.
    pub mote: MoteId,
    /// Whether it is a root.
    pub is_root: bool,
    /// Number of the first root.
    pub first_root: MoteId,
    /// Motes in the network.
    pub n_motes: u32,
    /// Length of a slot.
    pub slot: SimDuration,
    /// Number of the application in the configuration.
    pub app: u32,
    /// Number of applications in the configuration.
    pub n_apps: u32,
    /// Seed of the random draws.
    pub seed: u64,
}

/// What an application may use when something happens.
pub struct Context<'a> {
    /// The time.
    pub now: SimTime,
    /// When the message that is being handled had arrived in full.
    pub received: SimTime,
    /// Draws that all applications of the mote share, in sequence.
    pub dice: &'a mut Dice,
    /// Packets from end to end, among them exchanges and downloads.
    pub packets: &'a mut Packets<DropReason>,
    /// Whether the mote has a route to another mote.
    pub reaches: &'a dyn Fn(MoteId) -> bool,
}

impl std::fmt::Debug for Context<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Context").field("now", &self.now).finish_non_exhaustive()
    }
}

/// What an application does with a CoAP message.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Heard {
    /// It is for another application.
    NotMine,
    /// It is for this one, which may send an answer or the next request.
    Taken(Option<Packet>),
}

/// Numbers of CoAP messages: requests that a mote sent as a client, and duplicates that it received as a server.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Counters {
    /// Requests of `coap`, without repetitions.
    pub requests: u64,
    /// Repetitions of them.
    pub retransmissions: u64,
    /// Requests of `coap` that had been answered before.
    pub duplicates: u64,
    /// Requests for a block of `download`, without repetitions.
    pub blocks: u64,
    /// Repetitions of them.
    pub block_retransmissions: u64,
    /// Requests of `download` that had been answered before.
    pub block_duplicates: u64,
}

/// How an application of one kind behaves on one mote. Messages and events concern few kinds: the others ignore them.
pub trait Traffic {
    /// The mote may send from now on, or no longer. Calling it again with the same value changes nothing.
    fn set_ready(&mut self, is_ready: bool, cx: &mut Context<'_>);

    /// When the application wants to act next.
    fn poll_timeout(&self) -> Option<SimTime>;

    /// Time has come to `cx.now`. One packet per call: ask until the next time lies ahead or there is none.
    fn handle_timeout(&mut self, cx: &mut Context<'_>) -> Option<Packet>;

    /// An event of this application concerns the mote.
    fn handle_event(&mut self, _at: SimTime) {}

    /// A CoAP message of mote `from` arrived over so many hops.
    fn handle_message(
        &mut self,
        _from: MoteId,
        _hops: u32,
        _message: &CoapRepr,
        _cx: &mut Context<'_>,
    ) -> Heard {
        Heard::NotMine
    }

    /// The mote was switched off or rebooted: what it kept in memory is lost.
    fn reset(&mut self, _cx: &mut Context<'_>) {}

    /// Draws by another seed from here on.
    fn reseed(&mut self, _seed: u64) {}

    /// CoAP messages so far.
    fn counters(&self) -> Counters {
        Counters::default()
    }
}

/// Where keys of an application are read, and what is wrong with them.
#[derive(Debug)]
pub struct Reading<'a> {
    /// The checked table.
    pub table: &'a toml::Table,
    /// Its path.
    pub path: &'a str,
    /// Motes in the network.
    pub n_motes: u32,
    /// Problems found so far.
    pub problems: &'a mut Vec<Problem>,
}

impl Reading<'_> {
    /// A number of a mote that exists; otherwise a problem with `key`.
    pub fn mote(&mut self, key: &str, number: u32) -> Option<MoteId> {
        let valid = Some(number).filter(|&mote| mote < self.n_motes);
        if valid.is_none() {
            let last = self.n_motes.saturating_sub(1);
            let message = format!("must be the number of a mote, 0 to {last}");
            let path = proto::config::join(self.path, key);
            self.problems.push(Problem::new(path, message).value(number).nearest(last));
        }
        valid.map(MoteId)
    }

    /// The numbers of a list that are those of motes; otherwise problems with entries of `key`.
    pub fn motes(&mut self, key: &str, numbers: Vec<u32>) -> Vec<MoteId> {
        let motes = numbers.into_iter().enumerate();
        motes.filter_map(|(index, number)| self.mote(&format!("{key}[{index}]"), number)).collect()
    }
}

/// A kind of traffic: what the configuration says of it.
pub trait Kind: Traffic + Sized {
    /// Its name and its keys.
    const VARIANT: Variant;

    /// Reads the checked keys.
    fn read(reading: &mut Reading<'_>) -> Option<Self>;

    /// The application as one mote runs it; `None`: the mote takes no part.
    fn assigned(&self, host: &Host) -> Option<Self>;

    /// The largest packet that it sends.
    fn largest(&self) -> Largest;
}

/// One application of one mote.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct App {
    /// Number of the application in the configuration.
    pub number: u32,
    machine: Machine,
}

impl App {
    /// The application that `spec` gives a mote; none if the mote takes no part in it.
    #[must_use]
    pub fn new(spec: &Spec, host: &Host) -> Option<Self> {
        let machine = spec.machine.assigned(host)?;
        Some(Self { number: host.app, machine })
    }

    /// Its state machine.
    pub fn machine(&mut self) -> &mut dyn Traffic {
        self.machine.traffic_mut()
    }

    /// As [`Traffic::set_ready`].
    pub(crate) fn set_ready(&mut self, is_ready: bool, cx: &mut Context<'_>) {
        self.machine().set_ready(is_ready, cx);
    }

    /// As [`Traffic::poll_timeout`].
    #[must_use]
    pub fn poll_timeout(&self) -> Option<SimTime> {
        self.machine.traffic().poll_timeout()
    }

    /// As [`Traffic::handle_timeout`], if it is due.
    pub fn handle_timeout(&mut self, cx: &mut Context<'_>) -> Option<Packet> {
        let is_due = self.poll_timeout().is_some_and(|due| due <= cx.now);
        if is_due { self.machine().handle_timeout(cx) } else { None }
    }

    /// As [`Traffic::counters`].
    #[must_use]
    pub fn counters(&self) -> Counters {
        self.machine.traffic().counters()
    }
}

#[cfg(test)]
mod tests;
