//! `[netsim.lowpan]`.

use crate::lowpan::{Config, Mode};
use proto::config::{Choice, Section, TableSpec};
use proto::time::SimDuration;

/// Description of `[netsim.lowpan]`.
pub(super) const SPEC: TableSpec = Keys::SPEC;

/// Fragmentation of datagrams that do not fit into a frame (RFC 4944, RFC 8930).
#[derive(Section)]
struct Keys {
    /// How a mote forwards fragments of a datagram.
    #[key(default = Fragmentation::Forwarding)]
    fragmentation: Fragmentation,
    /// Maximum number of datagrams that a mote reassembles at the same time; unlimited at roots.
    #[key(range = 0..=1000, default = 1)]
    reassembly_buffers: u16,
    /// Reassembly timeout (s). 60: RFC 4944, § 5.3.
    #[key(range = 0.01..=1e4, default = 60.0)]
    reassembly_timeout_s: f64,
    /// Maximum number of datagrams whose fragments a mote forwards at the same time; unlimited at roots.
    #[key(range = 0..=10_000, default = 50)]
    vrb_entries: u16,
    /// Whether the remaining fragments are dropped once a fragment is missing.
    #[key(default = false)]
    discard_after_missing: bool,
    /// Whether the forwarding state of a datagram is removed with its last fragment instead of by timeout.
    #[key(default = false)]
    discard_after_last: bool,
}

/// The values of `fragmentation`.
#[derive(Choice)]
enum Fragmentation {
    /// It forwards each fragment as it arrives (RFC 8930).
    Forwarding,
    /// It reassembles and fragments the datagram again at each hop.
    PerHop,
}

/// Makes the settings of the checked table.
pub(super) fn build(table: &toml::Table) -> Config {
    let keys = Keys::read(table);
    let timeout = SimDuration::from_seconds(keys.reassembly_timeout_s);
    Config {
        mode: match keys.fragmentation {
            Fragmentation::Forwarding => Mode::FragmentForwarding,
            Fragmentation::PerHop => Mode::PerHopReassembly,
        },
        reassembly_buffers: keys.reassembly_buffers,
        reassembly_timeout: timeout,
        vrb_entries: keys.vrb_entries,
        vrb_timeout: timeout,
        discard_after_missing: keys.discard_after_missing,
        discard_after_last: keys.discard_after_last,
    }
}
