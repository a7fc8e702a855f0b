//! `[netsim.join]`.

use crate::join::Config;
use proto::config::{Default, Field, Kind, TableSpec, typed};
use serde::Deserialize;

/// Description of `[netsim.join]`.
pub(super) const SPEC: TableSpec = TableSpec {
    doc: "Admission (the constrained join protocol, RFC 9031).",
    fields: &[
        Field {
            key: "secure",
            doc: "Whether the join registrar at the root must admit motes before they take part.",
            kind: Kind::Bool,
            default: Default::Bool(true),
        },
        Field {
            key: "rate_bytes_s",
            doc: "Join rate (mean bytes per second): the limit of join traffic that a mote forwards towards the root, \
                  which the registrar announces at admission (RFC 9031, § 8.4.2). Absent: no announcement, and a mote \
                  forwards one request in 3 s (§ 6.1).",
            kind: Kind::Integer { min: 0, max: 1_000_000 },
            default: Default::Absent,
        },
        Field {
            key: "burst_bytes",
            doc: "Burst size of the join rate (bytes). Absent: the amount of 10 s at rate_bytes_s.",
            kind: Kind::Integer { min: 0, max: 1_000_000 },
            default: Default::Absent,
        },
    ],
    tag: None,
};

/// Keys of `[netsim.join]`.
#[derive(Deserialize)]
struct Keys {
    secure: bool,
    rate_bytes_s: Option<u32>,
    burst_bytes: Option<u32>,
}

/// Makes the settings of the checked table.
pub(super) fn build(table: &toml::Table) -> Config {
    let Keys { secure, rate_bytes_s, burst_bytes } = typed(table);
    Config {
        secure,
        join_rate_bytes_s: rate_bytes_s,
        join_burst_bytes: burst_bytes,
        ..Config::default()
    }
}
