//! `[netsim.join]`.

use crate::join::Config;
use proto::config::{Default, Field, Kind, TableSpec};

/// Description of `[netsim.join]`.
pub(super) const SPEC: TableSpec = TableSpec {
    doc: "Admission (the constrained join protocol, RFC 9031).",
    fields: &[
        Field {
            key: "secure",
            doc: "Whether motes must be admitted by the registrar at the root before they take part.",
            kind: Kind::Bool,
            default: Default::Bool(true),
        },
        Field {
            key: "rate_bytes_s",
            doc: "Join traffic that a mote forwards towards the root (bytes per second in the mean): RFC 9031's join rate.",
            kind: Kind::Integer { min: 0, max: 1_000_000 },
            default: Default::Integer(127),
        },
        Field {
            key: "burst_bytes",
            doc: "How much of it a mote forwards at once (bytes).",
            kind: Kind::Integer { min: 0, max: 1_000_000 },
            default: Default::Integer(508),
        },
    ],
    tag: None,
};

/// Makes the settings of the checked table.
pub(super) fn build(table: &toml::Table) -> Config {
    let integer = |key: &str| table.get(key).and_then(toml::Value::as_integer).unwrap_or_default();
    Config {
        secure: table.get("secure").and_then(toml::Value::as_bool).unwrap_or(true),
        join_rate_bytes_s: integer("rate_bytes_s") as u32,
        join_burst_bytes: integer("burst_bytes") as u32,
        ..Config::default()
    }
}
