//! Join requests and responses of the constrained join protocol: CoAP and CBOR as RFC 9031, § 8, lays them out.
//!
//! Object security (OSCORE) is not applied: messages carry what it would protect in the clear. What it would carry
//! beside, the pledge's identifier, is the CoAP token: 8 bytes that the pledge chooses as it likes. A stateless proxy
//! keeps its state in the token of the request it passes on (RFC 8974, § 3). That state is the same address again, with the
//! group bit set, which no mote's has.

mod bytes;

use super::address::Eui64;
use serde::{Deserialize, Serialize};

/// A CoJP message, the payload of a UDP datagram to or from port 5683.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum CojpRepr {
    /// A pledge asks to join (§ 8.1.1): CoAP POST to `coap://6tisch.arpa/j`.
    Request {
        /// CoAP message identifier.
        message_id: u16,
        /// Who asks.
        pledge: Eui64,
        /// State of a stateless proxy, once it is beyond that: whom to answer on the link, which is the pledge (§ 7.1).
        proxy_state: Option<Eui64>,
        /// Identifier of the network to join.
        network_id: u16,
    },
    /// The registrar admits it (§ 8.1.2): CoAP 2.04.
    Response {
        /// Of the request.
        message_id: u16,
        /// Who is admitted.
        pledge: Eui64,
        /// Of the request.
        proxy_state: Option<Eui64>,
        /// Index of the link-layer key it shall use.
        key_index: u8,
        /// Join traffic that it may forward as a proxy, in the mean (bytes per second), if the registrar says (§ 8.4.2).
        join_rate_bytes_s: Option<u32>,
    },
}

#[cfg(test)]
mod tests;
