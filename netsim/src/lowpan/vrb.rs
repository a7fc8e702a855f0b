//! A datagram that is forwarded in parts: an entry of the virtual reassembly buffer, RFC 8930, § 6.

use crate::wire::Eui64;
use crate::wire::fragment::Fragment;
use proto::time::SimTime;
use serde::{Deserialize, Serialize};

/// Where the parts of a datagram go. It holds none of them.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct Entry {
    /// Identity of the datagram, for records.
    pub(super) packet: u64,
    /// Until when it is kept.
    pub(super) until: SimTime,
    /// To whom the parts go.
    pub(super) next_hop: Eui64,
    /// Their tag on the way there.
    pub(super) tag: u16,
    size: u16,
    /// Where the part that has come last ends (bytes).
    end: u16,
    /// Bytes that have passed.
    passed: u16,
}

impl Entry {
    /// For the datagram whose first part this is.
    pub(super) fn new(first: &Fragment, next_hop: Eui64, tag: u16, until: SimTime) -> Self {
        let packet = first.datagram.packet;
        let (size, end, passed) = (first.size, first.covers, first.covers);
        Self { packet, until, next_hop, tag, size, end, passed }
    }

    /// Whether parts before this one have not come.
    pub(super) fn misses_before(&self, part: &Fragment) -> bool {
        part.offset != self.end
    }

    /// Whether a part belongs to the same datagram, as far as its header shows.
    pub(super) fn is_of(&self, part: &Fragment) -> bool {
        part.size == self.size
    }

    /// Takes note of a part that passes. Returns whether it is the end of the datagram.
    pub(super) fn pass(&mut self, part: &Fragment) -> bool {
        self.end = part.offset + part.covers;
        self.passed = self.passed.saturating_add(part.covers);
        self.end == self.size
    }

    /// Whether as much has passed as there is.
    pub(super) fn is_complete(&self) -> bool {
        self.size <= self.passed
    }
}
