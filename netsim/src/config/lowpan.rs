//! `[netsim.lowpan]`.

use crate::lowpan::{Config, Mode};
use proto::config::{Choice, Default, Field, Kind, Range, TableSpec};
use proto::types::NS_PER_S;

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

/// Makes the settings of the checked table.
pub(super) fn build(table: &toml::Table) -> Config {
    let integer = |key: &str| table.get(key).and_then(toml::Value::as_integer).unwrap_or_default();
    let flag = |key: &str| table.get(key).and_then(toml::Value::as_bool).unwrap_or_default();
    let timeout_s =
        table.get("reassembly_timeout_s").and_then(toml::Value::as_float).unwrap_or_default();
    let timeout_ns = (timeout_s * NS_PER_S as f64).round() as u64;
    let per_hop = table.get("fragmentation").and_then(toml::Value::as_str) == Some("per-hop");
    Config {
        mode: if per_hop { Mode::PerHopReassembly } else { Mode::FragmentForwarding },
        reassembly_buffers: integer("reassembly_buffers") as u16,
        reassembly_timeout_ns: timeout_ns,
        vrb_entries: integer("vrb_entries") as u16,
        vrb_timeout_ns: timeout_ns,
        discard_after_missing: flag("discard_after_missing"),
        discard_after_last: flag("discard_after_last"),
    }
}
