//! What one-way kinds of traffic share: who sends, to whom, and how much.

use super::config::Largest;
use super::{Content, Destination, Host, Packet, Reading};
use crate::dice::Dice;
use proto::config::{Choice, OneOf, Section};
use proto::ids::MoteId;
use proto::time::SimTime;
use serde::{Deserialize, Serialize};

/// Longest UDP payload (bytes).
pub(crate) const MAX_PAYLOAD_BYTES: i64 = 1000;

/// To whom packets are sent.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Peer {
    /// The root of the sender's DODAG.
    Root,
    /// A mote.
    Mote(MoteId),
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
    senders: Option<Vec<MoteId>>,
    own: MoteId,
    n_motes: u32,
    counter: u32,
    /// The mote to which the next packet of [`Peer::All`] goes.
    turn: MoteId,
}

/// Who sends to whom, and how much.
#[derive(Section)]
pub(super) struct SenderKeys {
    /// The motes that send.
    #[key(default = All::All)]
    senders: Senders,
    /// The destination: one of these, or the number of a mote.
    #[key(default = Named::Root)]
    destination: DestinationKey,
    /// UDP payload of a packet. With headers it must stay below the minimum MTU of IPv6, 1280 bytes.
    #[key(range = 1..=MAX_PAYLOAD_BYTES, default = 30)]
    payload_bytes: u16,
}

#[derive(OneOf)]
enum Senders {
    All(All),
    Listed(#[key(length = 1..)] Vec<u32>),
}

#[derive(OneOf)]
enum DestinationKey {
    Named(Named),
    Mote(u32),
}

#[derive(Choice)]
enum All {
    /// All motes that have a destination.
    All,
}

#[derive(Choice)]
enum Named {
    /// The root of the sender's DODAG.
    Root,
    /// A random other mote for each packet.
    Peers,
    /// All other motes in turn.
    All,
}

impl Sender {
    /// Senders (`None`: all that have somebody to send to) with a destination and a length of payload (bytes).
    #[must_use]
    pub fn new(senders: Option<Vec<MoteId>>, peer: Peer, payload_bytes: u16) -> Self {
        Self {
            peer,
            payload_bytes,
            senders,
            own: MoteId(0),
            n_motes: 0,
            counter: 0,
            turn: MoteId(0),
        }
    }

    /// The sender that keys describe; `None`: the destination is no mote, which has been said.
    pub(super) fn of(keys: SenderKeys, reading: &mut Reading<'_>) -> Option<Self> {
        let peer = match keys.destination {
            DestinationKey::Named(Named::Root) => Some(Peer::Root),
            DestinationKey::Named(Named::Peers) => Some(Peer::Random),
            DestinationKey::Named(Named::All) => Some(Peer::All),
            DestinationKey::Mote(number) => reading.mote("destination", number).map(Peer::Mote),
        };
        let senders = match keys.senders {
            Senders::All(All::All) => None,
            Senders::Listed(list) => Some(reading.motes("senders", list)),
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
        let packet = Packet { destination: Destination::Root, content, created: SimTime::START };
        Largest { key: "payload_bytes", value: payload_bytes.into(), packet }
    }

    /// How many packets it made.
    pub(super) fn n_sent(&self) -> u32 {
        self.counter
    }

    /// The next packet.
    pub(super) fn packet(&mut self, now: SimTime, dice: &mut Dice) -> Packet {
        let (payload_bytes, counter) = (self.payload_bytes, self.counter);
        self.counter = counter.wrapping_add(1);
        Packet {
            destination: self.next_destination(dice),
            content: Content::Counted { payload_bytes, counter },
            created: now,
        }
    }

    fn next_destination(&mut self, dice: &mut Dice) -> Destination {
        match self.peer {
            Peer::Root => Destination::Root,
            Peer::Mote(mote) => Destination::Mote(mote),
            Peer::Random => {
                let other = dice.below(u64::from(self.n_motes) - 1) as u32;
                Destination::Mote(if other < self.own.0 {
                    MoteId(other)
                } else {
                    MoteId(other + 1)
                })
            }
            Peer::All => {
                if self.turn == self.own {
                    self.turn = MoteId((self.turn.0 + 1) % self.n_motes);
                }
                let mote = self.turn;
                self.turn = MoteId((self.turn.0 + 1) % self.n_motes);
                Destination::Mote(mote)
            }
        }
    }
}
