//! `[netsim.join]`.

use crate::join::Config;
use proto::config::{Section, TableSpec};

/// Description of `[netsim.join]`.
pub(super) const SPEC: TableSpec = Keys::SPEC;

/// Admission (the constrained join protocol, RFC 9031).
#[derive(Section)]
struct Keys {
    /// Whether the join registrar at the root must admit motes before they take part.
    #[key(default = true)]
    secure: bool,
    /// Join rate (mean bytes per second): the limit of join traffic that a mote forwards towards the root, which the registrar
    /// announces at admission (RFC 9031, § 8.4.2). Absent: no announcement, and a mote forwards one request in 3 s (§ 6.1).
    #[key(range = 0..=1_000_000)]
    rate_bytes_s: Option<u32>,
    /// Burst size of the join rate (bytes). Absent: the amount of 10 s at rate_bytes_s.
    #[key(range = 0..=1_000_000)]
    burst_bytes: Option<u32>,
}

/// Makes the settings of the checked table.
pub(super) fn build(table: &toml::Table) -> Config {
    let Keys { secure, rate_bytes_s, burst_bytes } = Keys::read(table);
    Config {
        secure,
        join_rate_bytes_s: rate_bytes_s,
        join_burst_bytes: burst_bytes,
        ..Config::default()
    }
}
