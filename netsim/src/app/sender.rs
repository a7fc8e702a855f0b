//! What one-way kinds of traffic share: who sends, to whom, and how much.

use super::config::Largest;
use super::{Content, Destination, Host, Packet, Reading};
use crate::dice::Dice;
use proto::config::{Choice, Default, Field, Kind, typed};
use proto::types::NS_PER_S;
use serde::{Deserialize, Serialize};

/// The number of a mote.
pub(super) const MOTE: Kind = Kind::Integer { min: 0, max: u32::MAX as i64 };

/// Longest UDP payload (bytes).
pub const MAX_PAYLOAD_BYTES: i64 = 1000;

/// `senders`.
pub const SENDERS: Field = Field {
    key: "senders",
    doc: "The motes that send.",
    kind: Kind::Either(&[
        Kind::Choice(&[Choice { name: "all", doc: "All motes that have a destination." }]),
        Kind::List { of: &MOTE, min: 1, max: usize::MAX },
    ]),
    default: Default::Text("all"),
};

/// `destination`.
pub const DESTINATION: Field = Field {
    key: "destination",
    doc: "The destination: one of these, or the number of a mote.",
    kind: Kind::Either(&[
        Kind::Choice(&[
            Choice { name: "root", doc: "The root of the sender's DODAG." },
            Choice { name: "peers", doc: "A random other mote for each packet." },
            Choice { name: "all", doc: "All other motes in turn." },
        ]),
        MOTE,
    ]),
    default: Default::Text("root"),
};

/// `payload_bytes`.
pub const PAYLOAD_BYTES: Field = Field {
    key: "payload_bytes",
    doc: "UDP payload of a packet. With headers it must stay below the minimum MTU of IPv6, 1280 bytes.",
    kind: Kind::Integer { min: 1, max: MAX_PAYLOAD_BYTES },
    default: Default::Integer(30),
};

/// A duration of the configuration (ns).
pub(super) fn ns(duration_s: f64) -> u64 {
    (duration_s * NS_PER_S as f64).round() as u64
}

/// To whom packets are sent.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Peer {
    /// The root of the sender's DODAG.
    Root,
    /// A mote.
    Mote(u32),
    /// Another mote, drawn for each packet.
    Random,
    /// Every other mote in turn: from a root, traffic down the network.
    All,
}

/// Who sends to whom, and how much.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Sender {
    peer: Peer,
    payload_bytes: u16,
    /// Before it is assigned to a mote: by whom; `None`: by all that have somebody to send to.
    senders: Option<Vec<u32>>,
    own: u32,
    n_motes: u32,
    counter: u32,
    /// The mote to which the next packet of [`Peer::All`] goes.
    turn: u32,
}

#[derive(Deserialize)]
struct Keys {
    senders: Senders,
    destination: DestinationKey,
    payload_bytes: u16,
}

#[derive(Deserialize)]
#[serde(untagged)]
enum Senders {
    Listed(Vec<u32>),
    All(serde::de::IgnoredAny),
}

#[derive(Deserialize)]
#[serde(untagged)]
enum DestinationKey {
    Mote(u32),
    Named(Named),
}

#[derive(Deserialize)]
#[serde(rename_all = "lowercase")]
enum Named {
    Root,
    Peers,
    All,
}

impl Sender {
    /// Senders (`None`: all that have somebody to send to) with a destination and a length of payload (bytes).
    #[must_use]
    pub fn new(senders: Option<Vec<u32>>, peer: Peer, payload_bytes: u16) -> Self {
        Self { peer, payload_bytes, senders, own: 0, n_motes: 0, counter: 0, turn: 0 }
    }

    /// Reads its keys.
    pub(super) fn read(reading: &mut Reading<'_>) -> Option<Self> {
        let keys: Keys = typed(reading.table);
        let peer = match keys.destination {
            DestinationKey::Mote(number) => reading.mote("destination", number).map(Peer::Mote),
            DestinationKey::Named(Named::Peers) => Some(Peer::Random),
            DestinationKey::Named(Named::All) => Some(Peer::All),
            DestinationKey::Named(Named::Root) => Some(Peer::Root),
        };
        let senders = match keys.senders {
            Senders::Listed(list) => Some(reading.motes("senders", list)),
            Senders::All(_) => None,
        };
        Some(Self::new(senders, peer?, keys.payload_bytes))
    }

    /// The same as one mote has it; `None`: it does not send, or would send to itself only.
    pub(super) fn assigned(&self, host: &Host) -> Option<Self> {
        let has_somebody = match self.peer {
            Peer::Root => !host.is_root,
            Peer::Mote(mote) => mote != host.mote,
            Peer::Random | Peer::All => 2 <= host.n_motes,
        };
        let sends = self.senders.as_ref().is_none_or(|senders| senders.contains(&host.mote));
        let one = Self::new(None, self.peer, self.payload_bytes);
        (sends && has_somebody).then_some(Self { own: host.mote, n_motes: host.n_motes, ..one })
    }

    /// The largest packet: all are of one length.
    pub(super) fn largest(&self) -> Largest {
        let Self { payload_bytes, .. } = *self;
        let content = Content::Counted { payload_bytes, counter: 0 };
        let packet = Packet { destination: Destination::Root, content, created_ns: 0 };
        Largest { key: PAYLOAD_BYTES.key, value: payload_bytes.into(), packet }
    }

    /// How many packets it made.
    pub(super) fn n_sent(&self) -> u32 {
        self.counter
    }

    /// The next packet.
    pub(super) fn packet(&mut self, now_ns: u64, dice: &mut Dice) -> Packet {
        let (payload_bytes, counter) = (self.payload_bytes, self.counter);
        self.counter = counter.wrapping_add(1);
        Packet {
            destination: self.next_destination(dice),
            content: Content::Counted { payload_bytes, counter },
            created_ns: now_ns,
        }
    }

    fn next_destination(&mut self, dice: &mut Dice) -> Destination {
        match self.peer {
            Peer::Root => Destination::Root,
            Peer::Mote(mote) => Destination::Mote(mote),
            Peer::Random => {
                let other = dice.below(u64::from(self.n_motes) - 1) as u32;
                Destination::Mote(if other < self.own { other } else { other + 1 })
            }
            Peer::All => {
                if self.turn == self.own {
                    self.turn = (self.turn + 1) % self.n_motes;
                }
                let mote = self.turn;
                self.turn = (self.turn + 1) % self.n_motes;
                Destination::Mote(mote)
            }
        }
    }
}
