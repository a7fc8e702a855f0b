//! Join requests and responses of the constrained join protocol: CoAP and CBOR as RFC 9031, § 8, lays them out.
//!
//! In a secured network messages are protected by OSCORE (`CojpRepr::protect`), whose option names the pledge (RFC 9031,
//! § 7.3). The pledge's token is then empty. In other networks messages carry in the clear what OSCORE would protect, and
//! the pledge's address is the CoAP token: 8 bytes that it chooses as it likes. A stateless proxy keeps its state in the
//! token of the request it passes on (RFC 8974, § 3). That state is the same address again, with the group bit set, which
//! no mote's has.

mod bytes;
mod protected;

use super::address::Eui64;
use super::security::Keys;
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
        /// Index of the link-layer key it shall use, in a network whose frames are not secured: the key itself is zeros.
        key_index: u8,
        /// The link-layer keys of a secured network (§ 8.4.3), in place of that one.
        keys: Option<Keys>,
        /// Join traffic that it may forward as a proxy, in the mean (bytes per second), if the registrar says (§ 8.4.2).
        join_rate_bytes_s: Option<u32>,
    },
    /// A request under OSCORE.
    ProtectedRequest {
        /// CoAP message identifier.
        message_id: u16,
        /// Who asks: the ID context of the OSCORE option.
        pledge: Eui64,
        /// Sender sequence number of the pledge: the Partial IV of the OSCORE option.
        sequence: u32,
        /// State of a stateless proxy, once it is beyond that.
        proxy_state: Option<Eui64>,
        /// The request as only the registrar can read it.
        ciphertext: Vec<u8>,
    },
    /// A response under OSCORE.
    ProtectedResponse {
        /// Of the request.
        message_id: u16,
        /// Of the request.
        proxy_state: Option<Eui64>,
        /// The response as only the pledge can read it.
        ciphertext: Vec<u8>,
    },
}

#[cfg(test)]
mod tests;
