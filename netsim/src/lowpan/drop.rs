//! Why packets end without arriving.

use serde::{Deserialize, Serialize};

/// Why a packet, or a part of one, goes no further. One list for all layers: records name the reason by [`DropReason::name`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub enum DropReason {
    /// Routing knows no next hop.
    NoRoute,
    /// The MAC's queue is full.
    TxqueueFull,
    /// No cell leads to the next hop.
    NoTxCells,
    /// The next hop did not acknowledge any of the transmissions that are allowed.
    MaxRetries,
    /// All places for reassembly are taken.
    ReassemblyBufferFull,
    /// All places for datagrams that are forwarded in parts are taken.
    VrbTableFull,
    /// A fragment belongs to nothing: its first fragment has not come, or was forgotten (RFC 8930, § 6).
    NoVrbEntry,
    /// A fragment is missing before this one, and the rest is given up.
    MissingFragment,
    /// Fragments overlap without being the same: what was collected is given up (RFC 4944, § 5.3).
    FragmentOverlap,
    /// Not all fragments came in time.
    ReassemblyTimeout,
    /// Larger than fragments can carry, or than one frame where headers do not fit into it.
    TooLarge,
    /// The hop limit has run out.
    TimeExceeded,
    /// The source route is wrong: it leads back to this mote, or to a group (RFC 6554, § 4.2).
    SourceRouteError,
    /// It went the wrong way in the DODAG twice (RFC 6550, § 11.2.2.2).
    RankError,
    /// No route further down (RFC 6550, § 11.2.2.3).
    ForwardingError,
    /// This mote has not joined the network.
    NotJoined,
    /// A proxy has forwarded as many join requests as it may (RFC 9031, join rate).
    JoinRateExceeded,
    /// The registrar does not admit the pledge.
    JoinDenied,
    /// This mote has lost synchronisation, and its queues with it.
    Desynchronised,
    /// This mote was switched off, or has rebooted.
    Killed,
    /// A newer one for the same purpose has taken its place in the queue.
    Superseded,
    /// The same has come before. Nothing is lost.
    Duplicate,
    /// It is not what it should be.
    Malformed,
    /// A sequence number has 8 bits and comes back: the next hop took it for an earlier frame that was sent again, or would
    /// take it, sent again after so many newer ones, for another (IEEE Std 802.15.4-2015, 6.7.2).
    SequenceReused,
    /// The layer that wanted it sent does so no more: its 6P transaction has ended.
    Withdrawn,
}

impl DropReason {
    /// All reasons, in the order of their [`DropReason::index`].
    pub const ALL: [Self; Self::N] = [
        Self::NoRoute,
        Self::TxqueueFull,
        Self::NoTxCells,
        Self::MaxRetries,
        Self::ReassemblyBufferFull,
        Self::VrbTableFull,
        Self::NoVrbEntry,
        Self::MissingFragment,
        Self::FragmentOverlap,
        Self::ReassemblyTimeout,
        Self::TooLarge,
        Self::TimeExceeded,
        Self::SourceRouteError,
        Self::RankError,
        Self::ForwardingError,
        Self::NotJoined,
        Self::JoinRateExceeded,
        Self::JoinDenied,
        Self::Desynchronised,
        Self::Killed,
        Self::Superseded,
        Self::Duplicate,
        Self::Malformed,
        Self::SequenceReused,
        Self::Withdrawn,
    ];
    /// How many there are.
    pub const N: usize = 25;

    /// Its name in records.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::NoRoute => "no_route",
            Self::TxqueueFull => "txqueue_full",
            Self::NoTxCells => "no_tx_cells",
            Self::MaxRetries => "max_retries",
            Self::ReassemblyBufferFull => "reassembly_buffer_full",
            Self::VrbTableFull => "vrb_table_full",
            Self::NoVrbEntry => "no_vrb_entry",
            Self::MissingFragment => "missing_fragment",
            Self::FragmentOverlap => "fragment_overlap",
            Self::ReassemblyTimeout => "reassembly_timeout",
            Self::TooLarge => "too_large",
            Self::TimeExceeded => "time_exceeded",
            Self::SourceRouteError => "source_route_error",
            Self::RankError => "rank_error",
            Self::ForwardingError => "forwarding_error",
            Self::NotJoined => "not_joined",
            Self::JoinRateExceeded => "join_rate_exceeded",
            Self::JoinDenied => "join_denied",
            Self::Desynchronised => "desynchronised",
            Self::Killed => "killed",
            Self::Superseded => "superseded",
            Self::Duplicate => "duplicate",
            Self::Malformed => "malformed",
            Self::SequenceReused => "sequence_reused",
            Self::Withdrawn => "withdrawn",
        }
    }

    /// Its place in [`DropReason::ALL`].
    #[must_use]
    pub fn index(self) -> usize {
        self as usize
    }

    /// Whether a packet is lost by it. A duplicate has been received already.
    #[must_use]
    pub fn is_loss(self) -> bool {
        self != Self::Duplicate
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_reason_stands_at_its_index_and_has_a_name_of_its_own() {
        for (index, reason) in DropReason::ALL.into_iter().enumerate() {
            assert_eq!(reason.index(), index);
            let same = DropReason::ALL.iter().filter(|other| other.name() == reason.name());
            assert_eq!(same.count(), 1, "{}", reason.name());
            let snake = |c: char| c.is_ascii_lowercase() || c == '_';
            assert!(reason.name().chars().all(snake), "{}", reason.name());
        }
    }
}
