//! `[netsim.rpl]`.

use crate::mote::compat::Compat;
use crate::rpl::{Config, Mode, Objective, Solicitation};
use proto::config::{Choice, Section, TableSpec};
use proto::time::SimDuration;

/// Description of `[netsim.rpl]`.
pub(super) const SPEC: TableSpec = Keys::SPEC;

/// Routing (RPL, RFC 6550; Trickle, RFC 6206).
#[derive(Section)]
struct Keys {
    /// Which motes store downward routes (mode of operation).
    #[key(default = Mode::NonStoring)]
    mode: Mode,
    /// The objective function: how rank follows from link metrics.
    #[key(default = ObjectiveKey::Of0)]
    objective: ObjectiveKey,
    /// Shortest Trickle interval as a power of two (ms). 14: 16.384 s, the 6TiSCH simulator's.
    #[key(range = 0..=30, default = 14)]
    dio_interval_min: u8,
    /// Number of doublings of the Trickle interval. 9: to 2.33 h.
    #[key(range = 0..=20, default = 9)]
    dio_interval_doublings: u8,
    /// Redundancy constant: number of DIOs heard in an interval that suppress a mote's own; 0: no suppression.
    #[key(range = 0..=255, default = 3)]
    dio_redundancy: u8,
    /// Maximum rank increase within a version of the DODAG (RFC 6550, § 8.2.2.4); 0: unlimited.
    #[key(range = 0..=65_535, default = 7168)]
    max_rank_increase: u16,
    /// How a mote without a DODAG solicits DIOs.
    #[key(default = Solicitation::Unicast)]
    solicitation: Solicitation,
    /// Interval between solicitations (s).
    #[key(range = 1.0..=1e5, default = 60.0)]
    dis_period_s: f64,
    /// Lifetime of downward routes (s), in whole minutes.
    #[key(range = 60.0..=15_000.0, default = 1800.0)]
    route_lifetime_s: f64,
    /// Interval between advertisements (DAOs) of downward routes (s); 0: half their lifetime.
    #[key(range = 0.0..=15_000.0, default = 0.0)]
    dao_period_s: f64,
    /// Mean delay of an advertisement, in which others can be aggregated with it (s): RFC 6550's DEFAULT_DAO_DELAY.
    #[key(range = 0.0..=1000.0, default = 1.0)]
    dao_delay_s: f64,
    /// Minimum interval between advertisements of a mote that changes its parent often (s).
    #[key(range = 0.0..=15_000.0, default = 0.0)]
    dao_interval_s: f64,
    /// Time (s) for which a mote advertises changes of its downward route after a request to join has passed it; the first is always
    /// advertised. For networks in which nothing else travels downwards. 0: changes are always advertised.
    #[key(range = 0.0..=1e5, default = 0.0)]
    dao_for_joins_s: f64,
    /// Whether advertisements request an acknowledgment (DAO-ACK).
    #[key(default = true)]
    dao_ack: bool,
    /// Whether downward routes are advertised; without them packets travel only towards the root.
    #[key(default = true)]
    routes_down: bool,
    /// Time after which an unheard neighbour is removed (s).
    #[key(range = 1.0..=1e6, default = 1800.0)]
    neighbour_lifetime_s: f64,
    /// ETX that a link is assumed to have before anything was sent over it.
    #[key(range = 1.0..=3.0, default = 3.0)]
    initial_etx: f64,
    /// Number of transmissions in a row without an acknowledgment after which a neighbour is not used.
    #[key(range = 1..=1000, default = 10)]
    max_failures: u16,
    /// Time for which it is then not used (s), doubled each further time, up to sixteen-fold.
    #[key(range = 0.1..=1e5, default = 60.0)]
    unusable_hold_s: f64,
    /// Time for which a mote that has lost its last parent does not choose one that may have been below it (s).
    #[key(range = 0.0..=1e5, default = 16.0)]
    repair_hold_s: f64,
    /// Interval between versions of the DODAG (s); 0: never.
    #[key(range = 0.0..=1e6, default = 0.0)]
    global_repair_s: f64,
    /// Whether a root that was switched off remembers the version of its DODAG, and begins with the next one. Off: it begins with the
    /// first version, like a device whose memory is lost.
    #[key(default = false)]
    root_keeps_version: bool,
}

/// The values of `objective`.
#[derive(Choice)]
enum ObjectiveKey {
    /// Objective function zero over ETX (RFC 6552; RFC 8180, § 5.1.1).
    Of0,
    /// Minimum rank with hysteresis over ETX (RFC 6719).
    Mrhof,
}

/// Whether motes store routes, by the checked table of `[netsim.rpl]`.
pub(super) fn stores_routes(table: &toml::Table) -> bool {
    Keys::read(table).mode == Mode::Storing
}

/// Makes the settings of the checked table.
pub(super) fn build(table: &toml::Table, compat: Compat) -> Config {
    let keys = Keys::read(table);
    let duration = SimDuration::from_seconds;
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
        dis_period: duration(keys.dis_period_s),
        default_lifetime: (keys.route_lifetime_s / 60.0).round().clamp(1.0, 254.0) as u8,
        lifetime_unit_s: 60,
        dao_period: duration(keys.dao_period_s),
        dao_delay: duration(keys.dao_delay_s),
        dao_interval: duration(keys.dao_interval_s),
        dao_ack: keys.dao_ack,
        advertises: keys.routes_down,
        neighbour_lifetime: duration(keys.neighbour_lifetime_s),
        initial_etx_x128: (keys.initial_etx * 128.0).round() as u16,
        max_failures: keys.max_failures,
        unusable_hold: duration(keys.unusable_hold_s),
        repair_hold: duration(keys.repair_hold_s),
        global_repair_period: duration(keys.global_repair_s),
        dao_for_joins: (keys.dao_for_joins_s != 0.0).then(|| duration(keys.dao_for_joins_s)),
        root_keeps_version: keys.root_keeps_version,
        no_trickle_suppression: compat.no_trickle_suppression,
        stale_rank: compat.stale_rank,
        ..Config::default()
    }
}
