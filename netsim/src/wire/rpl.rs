//! RPL control messages: RFC 6550, § 6.

mod bytes;

use serde::{Deserialize, Serialize};
use std::net::Ipv6Addr;

/// A RPL control message.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum RplMessage {
    /// DODAG information solicitation (§ 6.2).
    Dis(DisRepr),
    /// DODAG information object (§ 6.3).
    Dio(DioRepr),
    /// Destination advertisement object (§ 6.4).
    Dao(DaoRepr),
    /// Its acknowledgment (§ 6.5).
    DaoAck(DaoAckRepr),
}

/// DODAG information solicitation (RFC 6550, § 6.2): asks neighbours for a DIO.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct DisRepr {}

/// DODAG information object (RFC 6550, § 6.3): the root's parameters and the sender's rank, from which neighbours choose parents.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct DioRepr {
    /// RPL instance that the DODAG belongs to (§ 5.1).
    pub instance: u8,
    /// DODAG version, a lollipop counter (§ 7.2).
    pub version: u8,
    /// Rank of the sender; 0xffff: infinite.
    pub rank: u16,
    /// Whether the DODAG is grounded: its root satisfies the goal of the application (the 'G' flag).
    pub grounded: bool,
    /// Mode of operation: 1 non-storing, 2 storing without multicast.
    pub mode: u8,
    /// DODAG preference, 0 to 7.
    pub preference: u8,
    /// Destination advertisement trigger sequence number, a lollipop counter.
    pub dtsn: u8,
    /// DODAG identifier: the root's address.
    pub dodag_id: Ipv6Addr,
    /// DODAG configuration option, if present (§ 6.7.6).
    pub configuration: Option<DodagConfiguration>,
    /// Prefix information option, if present (§ 6.7.10): a /64.
    pub prefix: Option<u64>,
}

/// DODAG configuration option (RFC 6550, § 6.7.6).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct DodagConfiguration {
    /// Doublings of the Trickle interval.
    pub dio_interval_doublings: u8,
    /// log2 of the least interval (ms).
    pub dio_interval_min: u8,
    /// Redundancy constant; 0: no suppression.
    pub dio_redundancy: u8,
    /// Greatest rise of rank within a version.
    pub max_rank_increase: u16,
    /// Least rise of rank per hop.
    pub min_hop_rank_increase: u16,
    /// Objective code point: 0 OF0 (RFC 6552), 1 MRHOF (RFC 6719).
    pub objective: u16,
    /// Default lifetime of routes, in units of `lifetime_unit_s`.
    pub default_lifetime: u8,
    /// Unit of lifetimes (s).
    pub lifetime_unit_s: u16,
}

/// Destination advertisement object: one target with its transit information (§ 6.7.7, 6.7.8).
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct DaoRepr {
    /// RPL instance of the routes (§ 5.1).
    pub instance: u8,
    /// Asks for an acknowledgment (the 'K' flag).
    pub ack_request: bool,
    /// Sequence number, which the acknowledgment repeats.
    pub sequence: u8,
    /// Addresses that can be reached through the sender.
    pub targets: Vec<Ipv6Addr>,
    /// Path sequence, a lollipop counter.
    pub path_sequence: u8,
    /// Lifetime of the routes, in units of [`DodagConfiguration::lifetime_unit_s`]; 0: the routes end (a No-Path).
    pub path_lifetime: u8,
    /// The parent, in non-storing mode.
    pub parent: Option<Ipv6Addr>,
}

/// Acknowledgment of a DAO.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct DaoAckRepr {
    /// RPL instance of the DAO (§ 5.1).
    pub instance: u8,
    /// Sequence number of the DAO.
    pub sequence: u8,
    /// 0: accepted; 1 to 127: accepted, with reservations; 128 and more: rejected.
    pub status: u8,
}

#[cfg(test)]
mod tests;
