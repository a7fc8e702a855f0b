//! `[netsim.lowpan]`.

use crate::lowpan::{Config, Mode};
use proto::config::{Choice, Default, Field, Kind, Range, TableSpec, typed};
use proto::types::NS_PER_S;
use serde::Deserialize;

/// Description of `[netsim.lowpan]`.
pub(super) const SPEC: TableSpec = TableSpec {
    doc: "Datagrams that do not fit a frame (RFC 4944, RFC 8930).",
    fields: &[
        Field {
            key: "fragmentation",
            doc: "What a mote does with parts of a datagram that is not for itself.",
            kind: Kind::Choice(&[
                Choice { name: "forwarding", doc: "It forwards each part as it comes (RFC 8930)." },
                Choice { name: "per-hop", doc: "It puts them together and cuts them again." },
            ]),
            default: Default::Text("forwarding"),
        },
        Field {
            key: "reassembly_buffers",
            doc: "Datagrams that a mote puts together at the same time; roots have no limit.",
            kind: Kind::Integer { min: 0, max: 1000 },
            default: Default::Integer(1),
        },
        Field {
            key: "reassembly_timeout_s",
            doc: "How long one may take (s). 60: RFC 4944, § 5.3.",
            kind: Kind::Number(Range::closed(0.01, 1e4)),
            default: Default::Number(60.0),
        },
        Field {
            key: "vrb_entries",
            doc: "Datagrams that a mote forwards in parts at the same time; roots have no limit.",
            kind: Kind::Integer { min: 0, max: 10_000 },
            default: Default::Integer(50),
        },
        Field {
            key: "discard_after_missing",
            doc: "If a part is missing, the following ones are not forwarded.",
            kind: Kind::Bool,
            default: Default::Bool(false),
        },
        Field {
            key: "discard_after_last",
            doc: "The way of a datagram is forgotten with its last part, not with time.",
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
