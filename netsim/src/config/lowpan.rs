//! `[netsim.lowpan]`.

use crate::lowpan::{Config, Mode};
use proto::config::{Choice, Default, Field, Kind, Range, TableSpec, typed};
use proto::types::NS_PER_S;
use serde::Deserialize;

/// Description of `[netsim.lowpan]`.
pub(super) const SPEC: TableSpec = TableSpec {
    doc: "Fragmentation of datagrams that do not fit into a frame (RFC 4944, RFC 8930).",
    fields: &[
        Field {
            key: "fragmentation",
            doc: "How a mote forwards fragments of a datagram.",
            kind: Kind::Choice(&[
                Choice {
                    name: "forwarding",
                    doc: "It forwards each fragment as it arrives (RFC 8930).",
                },
                Choice {
                    name: "per-hop",
                    doc: "It reassembles and fragments the datagram again at each hop.",
                },
            ]),
            default: Default::Text("forwarding"),
        },
        Field {
            key: "reassembly_buffers",
            doc: "Maximum number of datagrams that a mote reassembles at the same time; unlimited at roots.",
            kind: Kind::Integer { min: 0, max: 1000 },
            default: Default::Integer(1),
        },
        Field {
            key: "reassembly_timeout_s",
            doc: "Reassembly timeout (s). 60: RFC 4944, § 5.3.",
            kind: Kind::Number(Range::closed(0.01, 1e4)),
            default: Default::Number(60.0),
        },
        Field {
            key: "vrb_entries",
            doc: "Maximum number of datagrams whose fragments a mote forwards at the same time; unlimited at roots.",
            kind: Kind::Integer { min: 0, max: 10_000 },
            default: Default::Integer(50),
        },
        Field {
            key: "discard_after_missing",
            doc: "Whether the remaining fragments are dropped once a fragment is missing.",
            kind: Kind::Bool,
            default: Default::Bool(false),
        },
        Field {
            key: "discard_after_last",
            doc: "Whether the forwarding state of a datagram is removed with its last fragment instead of by timeout.",
            kind: Kind::Bool,
            default: Default::Bool(false),
        },
    ],
    tag: None,
};

/// Keys of `[netsim.lowpan]`.
#[derive(Deserialize)]
struct Keys {
    fragmentation: Fragmentation,
    reassembly_buffers: u16,
    reassembly_timeout_s: f64,
    vrb_entries: u16,
    discard_after_missing: bool,
    discard_after_last: bool,
}

/// The values of `fragmentation`.
#[derive(Deserialize)]
#[serde(rename_all = "kebab-case")]
enum Fragmentation {
    Forwarding,
    PerHop,
}

/// Makes the settings of the checked table.
pub(super) fn build(table: &toml::Table) -> Config {
    let keys: Keys = typed(table);
    let timeout_ns = (keys.reassembly_timeout_s * NS_PER_S as f64).round() as u64;
    Config {
        mode: match keys.fragmentation {
            Fragmentation::Forwarding => Mode::FragmentForwarding,
            Fragmentation::PerHop => Mode::PerHopReassembly,
        },
        reassembly_buffers: keys.reassembly_buffers,
        reassembly_timeout_ns: timeout_ns,
        vrb_entries: keys.vrb_entries,
        vrb_timeout_ns: timeout_ns,
        discard_after_missing: keys.discard_after_missing,
        discard_after_last: keys.discard_after_last,
    }
}
