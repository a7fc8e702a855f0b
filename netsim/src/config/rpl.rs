//! `[netsim.rpl]`.

use super::compat::Compat;
use crate::rpl::{Config, Mode, Objective, Solicitation};
use proto::config::{Choice, Default, Field, Kind, Range, TableSpec, typed};
use proto::types::NS_PER_S;
use serde::Deserialize;

/// Description of `[netsim.rpl]`.
pub(super) const SPEC: TableSpec = TableSpec {
    doc: "Routing (RPL, RFC 6550; Trickle, RFC 6206).",
    fields: &[
        Field {
            key: "mode",
            doc: "Which motes store downward routes (mode of operation).",
            kind: Kind::Choice(&[
                Choice {
                    name: "non-storing",
                    doc: "Only the root: downward datagrams use source routes (RFC 8180, § 5.2).",
                },
                Choice {
                    name: "storing",
                    doc: "Every router stores the next hop to all motes below it.",
                },
            ]),
            default: Default::Text("non-storing"),
        },
        Field {
            key: "objective",
            doc: "The objective function: how rank follows from link metrics.",
            kind: Kind::Choice(&[
                Choice {
                    name: "of0",
                    doc: "Objective function zero over ETX (RFC 6552; RFC 8180, § 5.1.1).",
                },
                Choice { name: "mrhof", doc: "Minimum rank with hysteresis over ETX (RFC 6719)." },
            ]),
            default: Default::Text("of0"),
        },
        Field {
            key: "dio_interval_min",
            doc: "Shortest Trickle interval as a power of two (ms). 14: 16.384 s, the 6TiSCH simulator's.",
            kind: Kind::Integer { min: 0, max: 30 },
            default: Default::Integer(14),
        },
        Field {
            key: "dio_interval_doublings",
            doc: "Number of doublings of the Trickle interval. 9: to 2.33 h.",
            kind: Kind::Integer { min: 0, max: 20 },
            default: Default::Integer(9),
        },
        Field {
            key: "dio_redundancy",
            doc: "Redundancy constant: number of DIOs heard in an interval that suppress a mote's own; 0: no suppression.",
            kind: Kind::Integer { min: 0, max: 255 },
            default: Default::Integer(3),
        },
        Field {
            key: "max_rank_increase",
            doc: "Maximum rank increase within a version of the DODAG (RFC 6550, § 8.2.2.4); 0: unlimited.",
            kind: Kind::Integer { min: 0, max: 65_535 },
            default: Default::Integer(7168),
        },
        Field {
            key: "solicitation",
            doc: "How a mote without a DODAG solicits DIOs.",
            kind: Kind::Choice(&[
                Choice {
                    name: "unicast",
                    doc: "By unicast to the mote through which it joined, later by broadcast.",
                },
                Choice { name: "multicast", doc: "Everyone." },
                Choice { name: "off", doc: "Not at all." },
            ]),
            default: Default::Text("unicast"),
        },
        Field {
            key: "dis_period_s",
            doc: "Interval between solicitations (s).",
            kind: Kind::Number(Range::closed(1.0, 1e5)),
            default: Default::Number(60.0),
        },
        Field {
            key: "route_lifetime_s",
            doc: "Lifetime of downward routes (s), in whole minutes.",
            kind: Kind::Number(Range::closed(60.0, 15_000.0)),
            default: Default::Number(1800.0),
        },
        Field {
            key: "dao_period_s",
            doc: "Interval between advertisements (DAOs) of downward routes (s); 0: half their lifetime.",
            kind: Kind::Number(Range::closed(0.0, 15_000.0)),
            default: Default::Number(0.0),
        },
        Field {
            key: "dao_delay_s",
            doc: "Mean delay of an advertisement, in which others can be aggregated with it (s): RFC 6550's \
                  DEFAULT_DAO_DELAY.",
            kind: Kind::Number(Range::closed(0.0, 1000.0)),
            default: Default::Number(1.0),
        },
        Field {
            key: "dao_interval_s",
            doc: "Minimum interval between advertisements of a mote that changes its parent often (s).",
            kind: Kind::Number(Range::closed(0.0, 15_000.0)),
            default: Default::Number(0.0),
        },
        Field {
            key: "dao_ack",
            doc: "Whether advertisements request an acknowledgment (DAO-ACK).",
            kind: Kind::Bool,
            default: Default::Bool(true),
        },
        Field {
            key: "routes_down",
            doc: "Whether downward routes are advertised; without them packets travel only towards the root.",
            kind: Kind::Bool,
            default: Default::Bool(true),
        },
        Field {
            key: "neighbour_lifetime_s",
            doc: "Time after which an unheard neighbour is removed (s).",
            kind: Kind::Number(Range::closed(1.0, 1e6)),
            default: Default::Number(1800.0),
        },
        Field {
            key: "initial_etx",
            doc: "ETX that a link is assumed to have before anything was sent over it.",
            kind: Kind::Number(Range::closed(1.0, 3.0)),
            default: Default::Number(3.0),
        },
        Field {
            key: "max_failures",
            doc: "Number of transmissions in a row without an acknowledgment after which a neighbour is not used.",
            kind: Kind::Integer { min: 1, max: 1000 },
            default: Default::Integer(10),
        },
        Field {
            key: "unusable_hold_s",
            doc: "Time for which it is then not used (s), doubled each further time, up to sixteen-fold.",
            kind: Kind::Number(Range::closed(0.1, 1e5)),
            default: Default::Number(60.0),
        },
        Field {
            key: "repair_hold_s",
            doc: "Time for which a mote that has lost its last parent does not choose one that may have been below it (s).",
            kind: Kind::Number(Range::closed(0.0, 1e5)),
            default: Default::Number(16.0),
        },
        Field {
            key: "global_repair_s",
            doc: "Interval between versions of the DODAG (s); 0: never.",
            kind: Kind::Number(Range::closed(0.0, 1e6)),
            default: Default::Number(0.0),
        },
    ],
    tag: None,
};

/// Keys of `[netsim.rpl]`.
#[derive(Deserialize)]
struct Keys {
    mode: Mode,
    objective: ObjectiveKey,
    dio_interval_min: u8,
    dio_interval_doublings: u8,
    dio_redundancy: u8,
    max_rank_increase: u16,
    solicitation: Solicitation,
    dis_period_s: f64,
    route_lifetime_s: f64,
    dao_period_s: f64,
    dao_delay_s: f64,
    dao_interval_s: f64,
    dao_ack: bool,
    routes_down: bool,
    neighbour_lifetime_s: f64,
    initial_etx: f64,
    max_failures: u16,
    unusable_hold_s: f64,
    repair_hold_s: f64,
    global_repair_s: f64,
}

/// The values of `objective`.
#[derive(Deserialize)]
#[serde(rename_all = "lowercase")]
enum ObjectiveKey {
    Of0,
    Mrhof,
}

/// Whether motes store routes, by the checked table of `[netsim.rpl]`.
pub(super) fn stores_routes(table: &toml::Table) -> bool {
    table.get("mode").and_then(toml::Value::as_str) == Some("storing")
}

/// Makes the settings of the checked table.
pub(super) fn build(table: &toml::Table, compat: Compat) -> Config {
    let keys: Keys = typed(table);
    let ns = |duration_s: f64| (duration_s * NS_PER_S as f64).round() as u64;
    Config {
        mode: keys.mode,
        objective: match keys.objective {
            ObjectiveKey::Of0 => Objective::of0(),
            ObjectiveKey::Mrhof => Objective::mrhof(),
        },
        dio_interval_min: keys.dio_interval_min,
        dio_interval_doublings: keys.dio_interval_doublings,
        dio_redundancy: keys.dio_redundancy,
        max_rank_increase: keys.max_rank_increase,
        solicitation: keys.solicitation,
        dis_period_ns: ns(keys.dis_period_s),
        default_lifetime: (keys.route_lifetime_s / 60.0).round().clamp(1.0, 254.0) as u8,
        lifetime_unit_s: 60,
        dao_period_ns: ns(keys.dao_period_s),
        dao_delay_ns: ns(keys.dao_delay_s),
        dao_interval_ns: ns(keys.dao_interval_s),
        dao_ack: keys.dao_ack,
        advertises: keys.routes_down,
        neighbour_lifetime_ns: ns(keys.neighbour_lifetime_s),
        initial_etx_x128: (keys.initial_etx * 128.0).round() as u16,
        max_failures: keys.max_failures,
        unusable_hold_ns: ns(keys.unusable_hold_s),
        repair_hold_ns: ns(keys.repair_hold_s),
        global_repair_period_ns: ns(keys.global_repair_s),
        no_trickle_suppression: compat.no_trickle_suppression,
        stale_rank: compat.stale_rank,
        ..Config::default()
    }
}
