//! Datagrams in one frame or several: RFC 4944, § 5.3, forwarded in parts as RFC 8930.

mod bytes;

pub(crate) use bytes::Payload;
pub use bytes::{FragmentHeader, reassemble};

use super::datagram::Datagram;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// 6LoWPAN payload of a frame.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum LowpanRepr {
    /// A whole datagram.
    Whole(Arc<Datagram>),
    /// The first part of one: the compressed headers and what follows them.
    First(Fragment),
    /// A later part.
    Next(Fragment),
}

/// A part of a datagram.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Fragment {
    /// Size (bytes) of the datagram before compression (§ 5.3: datagram_size, 11 bits).
    pub size: u16,
    /// Tag, unique per sender (datagram_tag).
    pub tag: u16,
    /// Where this part begins in the uncompressed datagram (bytes, a multiple of 8). 0 in the first.
    pub offset: u16,
    /// How many bytes of the uncompressed datagram it covers. A multiple of 8 except in the last.
    pub covers: u16,
    /// The datagram it is a part of. Receivers may use it only when all parts have arrived, except that the first part
    /// shows its headers.
    pub datagram: Arc<Datagram>,
}

#[cfg(test)]
mod tests;
