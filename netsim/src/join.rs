//! The constrained join protocol: RFC 9031.
//!
//! | module | what | source |
//! |---|---|---|
//! | [`pledge`] | a mote that asks to be admitted | § 4.3, 8.1.1 |
//! | [`proxy`] | a mote that passes requests and responses on, and remembers nothing | § 7 |
//! | [`registrar`] | the root, which admits | § 8.1.2 |
//!
//! In a secured network messages are protected by OSCORE (§ 7.3), and the response brings the link-layer keys. In other
//! networks who asks is believed, nothing is encrypted, and the key of the response is zeros. What is not there: later
//! changes of parameters (§ 8.2) and of keys.

pub mod pledge;
pub mod proxy;
pub mod registrar;

pub use pledge::{Event, Pledge};
pub use proxy::Proxy;
pub use registrar::Registrar;

use crate::wire::cojp::CojpRepr;
use crate::wire::datagram::{UdpRepr, Upper};
use crate::wire::frame::NETWORK_PAN;
use crate::wire::security::Keys;
use proto::time::SimDuration;
use serde::{Deserialize, Serialize};
use std::net::Ipv6Addr;

/// UDP ports of the join protocol.
pub mod ports {
    /// CoAP (RFC 7252, § 6.1).
    pub(crate) const COAP: u16 = 5683;
}

/// Settings of the join protocol, the same for all motes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Config {
    /// Whether motes must be admitted at all. If not, a pledge has joined as soon as it starts.
    pub secure: bool,
    /// Identifier of the network.
    pub network_id: u16,
    /// The first timeout is drawn from here … 10 s: TIMEOUT_BASE.
    pub timeout_min: SimDuration,
    /// … to here. 15 s: TIMEOUT_BASE · TIMEOUT_RANDOM_FACTOR, 1.5.
    pub timeout_max: SimDuration,
    /// How often a request is repeated, each time after twice the timeout. 4: MAX_RETRANSMIT.
    pub max_retransmit: u8,
    /// The join rate that the registrar sends to motes as it admits them (§ 8.4.2): how much join traffic a proxy forwards
    /// towards the root in the mean (CoAP bytes per second). `None`: it sends none, and a proxy forwards one request in 3 s
    /// (§ 6.1, after RFC 8085, § 3.1.3).
    pub join_rate_bytes_s: Option<u32>,
    /// How much of it a proxy with a join rate forwards at once (CoAP bytes). `None`: what comes together in 10 s, over which
    /// § 7.2 would have the rate measured, and one message at least.
    pub join_burst_bytes: Option<u32>,
    /// How the network is secured; `None`: it is not.
    pub security: Option<Security>,
}

/// What secures a network.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Security {
    /// Link-layer keys, which the registrar gives to motes as it admits them.
    pub keys: Keys,
    /// From which the keys follow that pledges share with the registrar (`crate::wire::oscore::pre_shared_key`).
    pub join_key: [u8; 16],
}

impl Default for Config {
    fn default() -> Self {
        Self {
            secure: true,
            network_id: NETWORK_PAN,
            timeout_min: SimDuration::from_s(10),
            timeout_max: SimDuration::from_s(15),
            max_retransmit: 4,
            join_rate_bytes_s: None,
            join_burst_bytes: None,
            security: None,
        }
    }
}

/// A message to be sent.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Outgoing {
    /// From which of the mote's addresses.
    pub source: Ipv6Addr,
    /// To whom: a neighbour's link-local address, or a global one.
    pub destination: Ipv6Addr,
    /// Its class: requests that a proxy forwards and responses to proxies are marked (§ 6.1.1 and 6.1.2).
    pub dscp: u8,
    /// The join message (CoJP, RFC 9031) to send.
    pub message: CojpRepr,
}

impl Outgoing {
    /// The UDP datagram with the message.
    #[must_use]
    pub fn upper(&self) -> Upper {
        Upper::Udp(UdpRepr {
            source_port: ports::COAP,
            destination_port: ports::COAP,
            payload: self.message.to_vec().into(),
        })
    }
}

#[cfg(test)]
mod tests;
