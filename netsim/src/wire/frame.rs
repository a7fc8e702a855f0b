//! MAC frames: IEEE Std 802.15.4-2015, clause 7.

mod bytes;
mod parse;

pub use bytes::{MAX_PSDU, NETWORK_PAN, fcs, payload_room};
pub use parse::{Envelope, unsecure};

use super::address::Eui64;
use super::fragment::LowpanRepr;
use super::security::FrameSecurity;
use super::sixp::SixpRepr;
use super::slots::SlotsRepr;
use physics::asn::Asn;
use serde::{Deserialize, Serialize};

/// A MAC frame of IEEE 802.15.4, the fields that the simulation uses.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FrameRepr {
    /// Link-layer address of the sender.
    pub source: Eui64,
    /// For whom; `None`: everyone.
    pub destination: Option<Eui64>,
    /// Sequence number, by which repetitions are recognised.
    pub sequence: u8,
    /// Whether the receiver shall acknowledge it.
    pub ack_request: bool,
    /// Whether another frame follows in the next slot (the pending bit).
    pub pending: bool,
    /// How it is secured.
    pub security: FrameSecurity,
    /// What it announces of slots, in an information element.
    pub slots: Option<Box<SlotsRepr>>,
    /// Channels that the link from its sender skips, in an information element; bit 0 is channel 11.
    pub blacklist: Option<u16>,
    /// Contents of the frame, by kind.
    pub content: Content,
}

/// What a frame carries.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Content {
    /// An enhanced beacon.
    Beacon(BeaconRepr),
    /// Nothing: a data frame that keeps clocks together.
    KeepAlive,
    /// A 6P message in an IETF information element.
    Sixp(SixpRepr),
    /// A 6LoWPAN datagram, or a part of one.
    Lowpan(LowpanRepr),
}

impl Content {
    /// Differentiated services code point of the datagram that it is or is a part of (RFC 2474); 0 where there is none.
    #[must_use]
    pub fn dscp(&self) -> u8 {
        match self {
            Self::Lowpan(part) => part.datagram().dscp,
            Self::Beacon(_) | Self::KeepAlive | Self::Sixp(_) => 0,
        }
    }
}

/// What an enhanced beacon says in its information elements (RFC 8180, § 4.5; IEEE Std 802.15.4-2015, 7.4.4).
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct BeaconRepr {
    /// Absolute slot number in which it is sent.
    pub asn: Asn,
    /// How far the sender is from the root, in hops of rank: DAGRank − 1. The lower, the better to join through.
    pub join_metric: u8,
    /// Which template times its slots: 0, the standard's; others are agreed on beforehand.
    pub timeslot_id: u8,
    /// Which sequence its channels follow: 0, the standard's; others are agreed on beforehand.
    pub hopping_sequence_id: u8,
    /// Slotframes that a joining mote shall install.
    pub slotframes: Vec<BeaconSlotframe>,
}

/// A slotframe as a beacon announces it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct BeaconSlotframe {
    /// Handle of the slotframe.
    pub handle: u8,
    /// Length of the slotframe (slots).
    pub slots: u16,
    /// Its links: slot offset, channel offset, options (bit 0 TX, 1 RX, 2 shared, 3 timekeeping).
    pub links: Vec<(u16, u16, u8)>,
}

/// An enhanced acknowledgment.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct AckRepr {
    /// Link-layer address of the mote whose frame is acknowledged.
    pub destination: Eui64,
    /// Sequence number of the frame it answers.
    pub sequence: u8,
    /// When the frame was expected, less when it came (µs), −2048 to 2047: what its sender adds to its time (IEEE Std
    /// 802.15.4-2015, 6.5.4.2).
    pub time_correction_us: i16,
    /// How it is secured: as the frame that it answers (IEEE Std 802.15.4-2015, 6.7.4.2).
    pub security: FrameSecurity,
}

#[cfg(test)]
mod tests;
