//! Formats on the air: every message as a value, with its true length, its bytes and the way back from bytes.
//!
//! | module | what | source |
//! |---|---|---|
//! | [`address`] | EUI-64, IPv6 addresses derived from it | RFC 4291, appendix A |
//! | [`frame`] | MAC frames, information elements, enhanced acknowledgments | IEEE Std 802.15.4-2015, clause 7 |
//! | [`slots`] | which slots are taken, as neighbours tell each other | this simulator |
//! | [`sixp`] | 6P messages | RFC 8480, § 3.2 |
//! | [`datagram`] | IPv6 datagrams and their compressed form | RFC 6282, RFC 8138 |
//! | [`fragment`] | fragments of them | RFC 4944, § 5.3 |
//! | [`rpl`] | RPL control messages | RFC 6550, § 6 |
//! | [`coap`] | CoAP messages of applications | RFC 7252, RFC 7959 |
//! | [`cojp`] | join requests and responses | RFC 9031, § 8 |
//! | [`security`] | keys, encryption and authentication of frames | IEEE Std 802.15.4-2015, clause 9; RFC 8180, § 4.6 |
//! | [`oscore`] | encryption and authentication of join messages | RFC 8613 |
//! | [`tap`] | captures of frames | pcap, link type 283 |
//!
//! Each `…Repr` has `buffer_len`, `emit` and `parse`; a [`datagram::Datagram`], whose form depends on the hop, has
//! `compressed_len`. A simulation moves the values and asks for their lengths; bytes are made where traffic is captured. A frame says
//! how it is secured; without `[netsim.security]` no frame is.

pub mod address;
pub mod coap;
pub mod cojp;
pub mod datagram;
pub mod fragment;
pub mod frame;
pub mod oscore;
pub mod rpl;
pub mod security;
mod sink;
pub mod sixp;
pub mod slots;
pub mod tap;

#[cfg(test)]
mod arbitrary;

pub use address::Eui64;

/// Bytes that are not the message they should be.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{what} at byte {at}")]
pub struct Malformed {
    /// What is malformed, in words.
    pub what: &'static str,
    /// Where, from the beginning of the part that was parsed.
    pub at: usize,
}
