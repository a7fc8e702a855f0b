//! IPv6 datagrams as they travel, and their compressed form on the air: RFC 6282 (IPHC, NHC), RFC 8138 (6LoRH).
//!
//! Uncompressed, a datagram is an IPv6 header, a hop-by-hop header with the RPL option, a routing header, then ICMPv6 or
//! UDP. If the root encapsulates (see [`SourceRoute`]), the first three are the outer headers, and another IPv6 header
//! follows. Each IPv6 header has its own hop limit: on the way through the tunnel only the outer one falls (RFC 2473,
//! § 3.1 and § 6.3). The inner datagram has no RPL option of its own: RFC 9008, § 8.3.1, would let the one of the way up
//! ride along "to no avail".
//!
//! Compressed, context 0 is fd00::/64, and interface identifiers that follow from the MAC addresses of the hop are
//! left out.

mod compressed;
mod parse;
mod upper;

pub(crate) use compressed::{Compressed, Headers, Hop};
pub(crate) use upper::Tail;

use super::rpl::RplMessage;
use bytes::Bytes;
use serde::{Deserialize, Serialize};
use std::net::Ipv6Addr;

/// An IPv6 datagram: header fields, RPL options and payload.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Datagram {
    /// Identity in the simulation, for records; not on the air. 0: none.
    pub packet: u64,
    /// Address of the mote that made it.
    pub source: Ipv6Addr,
    /// Address of the mote that it is for, at the end of its route.
    pub destination: Ipv6Addr,
    /// Differentiated services code point (RFC 2474), 0 to 63; 0: best effort.
    pub dscp: u8,
    /// Hop limit: hops that it may still take. In a tunnel it stays as it was at the tunnel's entry.
    pub hop_limit: u8,
    /// RPL packet information, on datagrams within a DODAG (RFC 6550, § 11.2; RFC 6553).
    pub rpi: Option<RpiRepr>,
    /// Source route, on datagrams down a non-storing DODAG (RFC 6554).
    pub route: Option<SourceRoute>,
    /// The message of the layer above: RPL or UDP.
    pub upper: Upper,
}

/// Code points that the join protocol uses (RFC 2597, § 6).
pub mod code_points {
    /// AF42: join responses (RFC 9031, § 6.1.2).
    pub const AF42: u8 = 36;
    /// AF43: requests that proxies forward (RFC 9031, § 6.1.1).
    pub const AF43: u8 = 38;
}

/// RPL packet information, by which loops are detected (RFC 6550, § 11.2).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct RpiRepr {
    /// The 'O' flag: goes down.
    pub down: bool,
    /// The 'R' flag: a rank error was found on the way.
    pub rank_error: bool,
    /// The 'F' flag: no route further down.
    pub forwarding_error: bool,
    /// RPL instance whose route it follows (RFC 6550, § 5.1).
    pub instance: u8,
    /// Rank of the sender.
    pub sender_rank: u16,
}

/// Source route: the hops still to visit, next one first, the final destination last.
///
/// Every hop takes itself off (RFC 8138, § 5.5), so that the header shrinks on its way.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct SourceRoute {
    /// The root, which put the route into the datagram.
    pub root: Ipv6Addr,
    /// Hops still to visit.
    pub hops: Vec<Ipv6Addr>,
    /// Hop limit of the outer header, if the root encapsulated somebody else's datagram (RFC 9008, § 8.3): headers are not
    /// inserted into others' datagrams. `None`: the datagram is the root's own.
    pub tunnel_hop_limit: Option<u8>,
}

/// What a datagram carries.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Upper {
    /// ICMPv6 type 155: RPL control.
    Rpl(RplMessage),
    /// UDP.
    Udp(UdpRepr),
}

/// A UDP datagram.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct UdpRepr {
    /// UDP port of the sender.
    pub source_port: u16,
    /// UDP port of the receiver, which selects the protocol.
    pub destination_port: u16,
    /// The bytes behind the UDP header.
    pub payload: Bytes,
}

#[cfg(test)]
mod tests;
