//! What can be set about routing.

use super::objective::Objective;
use crate::wire::address::GLOBAL_PREFIX;
use crate::wire::rpl::DodagConfiguration;
use proto::config::Choice;
use proto::time::SimDuration;
use serde::{Deserialize, Serialize};

/// Who keeps routes down: RFC 6550, § 6.3.1.
#[derive(Choice, Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Mode {
    /// Only the root: downward datagrams use source routes (RFC 8180, § 5.2).
    NonStoring,
    /// Every router stores the next hop to all motes below it.
    Storing,
}

impl Mode {
    /// The largest mode of operation that a router here can honour; 0 has no routes down.
    pub(super) const LAST_CODE: u8 = 2;

    /// The mode of operation's number in a DIO.
    #[must_use]
    pub fn code(self) -> u8 {
        match self {
            Self::NonStoring => 1,
            Self::Storing => 2,
        }
    }
}

/// How a mote without a DODAG asks for one.
#[derive(Choice, Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Solicitation {
    /// By unicast to the mote through which it joined, later by broadcast.
    Unicast,
    /// Everyone.
    Multicast,
    /// Not at all.
    Off,
}

/// How parents are chosen by beacons.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Handover {
    /// A neighbour of which less than this will be received counts as a hop farther (mdBm); `None`: strength decides between equals
    /// alone.
    pub least_mdbm: Option<i32>,
    /// How far ahead the trend of its strength is followed.
    pub ahead: SimDuration,
}

/// Settings of one mote. A root imposes those in [`Config::configuration`] on its DODAG.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Config {
    /// RPL instance. DIOs of others are ignored.
    pub instance: u8,
    /// Who keeps routes down.
    pub mode: Mode,
    /// How rank follows from links.
    pub objective: Objective,
    /// Takes part without offering itself as parent: RFC 6550, § 8.5.
    pub is_leaf: bool,
    /// As root: preference of the DODAG, 0 to 7, larger is better.
    pub preference: u8,
    /// As root: the DODAG leads to the outside (RFC 6550, § 3.2.4).
    pub grounded: bool,
    /// As root: the /64 prefix of the mesh.
    pub prefix: u64,
    /// As root: shortest interval between DIOs, as a power of two (ms). 14: 16.384 s.
    pub dio_interval_min: u8,
    /// As root: how often that may double. 9: to 2.33 h.
    pub dio_interval_doublings: u8,
    /// As root: DIOs heard in an interval that make one's own superfluous; 0: none do.
    pub dio_redundancy: u8,
    /// As root: least rise of rank per hop; RFC 6550, § 17: 256.
    pub min_hop_rank_increase: u16,
    /// As root: how far rank may rise within a version of the DODAG before the mote must leave it (RFC 6550, § 8.2.2.4);
    /// 0: without bound. The standard leaves the value open: 7168 are four hops over links not yet measured.
    pub max_rank_increase: u16,
    /// As root: how long routes down live, in units.
    pub default_lifetime: u8,
    /// As root: the unit of lifetimes (s).
    pub lifetime_unit_s: u16,
    /// As root: time between versions, which is global repair; 0: only when asked.
    pub global_repair_period: SimDuration,
    /// Downward routes are advertised by motes over which a request to join came within this time; `None`: by all, always.
    pub dao_for_joins: Option<SimDuration>,
    /// A root that was off begins with the next version.
    pub root_keeps_version: bool,
    /// ETX × 128 of a link over which nothing was sent yet.
    pub initial_etx_x128: u16,
    /// Transmissions in a row without an acknowledgment after which a neighbour is unusable.
    pub max_failures: u16,
    /// How long an unusable neighbour stays so. Each further time doubles it, up to sixteen-fold.
    pub unusable_hold: SimDuration,
    /// A neighbour of whom nothing was heard for so long is forgotten.
    pub neighbour_lifetime: SimDuration,
    /// How many neighbours are kept; the worst give way.
    pub max_neighbours: u16,
    /// How many motes can be parents at a time (PARENT_SET_SIZE: RFC 6719, § 5; RFC 6552, § 4.2).
    pub parent_set_size: u8,
    /// A parent is left for one that is better by a hop of rank, but not by the threshold of the objective function, once there
    /// has been such a one for so long. 5 min; Contiki-NG waits for 10.
    pub outdone: SimDuration,
    /// Time between frames that a mote sends to a neighbour that could be a better parent, but over whose link it has sent too
    /// little to know that. 90 s: Contiki-NG's.
    pub probe_period: SimDuration,
    /// After leaving a DODAG, motes of no lower rank than one's own had been are not joined for so long: they may
    /// have been below, and have not heard of it.
    pub repair_hold: SimDuration,
    /// After so long outside, a version of a DODAG is joined as if for the first time: like a mote that restarts.
    pub forget: SimDuration,
    /// How a mote without a DODAG asks for one.
    pub solicitation: Solicitation,
    /// Time between solicitations.
    pub dis_period: SimDuration,
    /// Whether routes down are advertised at all.
    pub advertises: bool,
    /// Time between advertisements, with a fifth more or less at random; 0: half the lifetime of routes.
    pub dao_period: SimDuration,
    /// An advertisement waits so long for others to go with it (DEFAULT_DAO_DELAY, 1 s; ns).
    pub dao_delay: SimDuration,
    /// No sooner after one is the next sent because of another parent.
    pub dao_interval: SimDuration,
    /// Whether advertisements ask for acknowledgment.
    pub dao_ack: bool,
    /// How long to wait for it the first time; then twice as long, and so on.
    pub dao_ack_wait: SimDuration,
    /// How often an advertisement is repeated.
    pub dao_max_retries: u8,
    /// Targets in one advertisement, so that it fits a frame.
    pub max_dao_targets: u8,
    /// Routes that a router keeps; 0: any number. Beyond, advertisements are rejected.
    pub max_routes: u32,
    /// Parents are chosen by beacons, too; `None`: by DIOs alone.
    pub handover: Option<Handover>,
    /// For comparison with a peer (its Q19): DIOs heard never make one's own superfluous, but put it off.
    pub no_trickle_suppression: bool,
    /// For comparison with a peer (its Q22): rank stays when the parent's changes.
    pub stale_rank: bool,
}
impl Default for Config {
    fn default() -> Self {
        Self {
            instance: 0,
            mode: Mode::NonStoring,
            objective: Objective::of0(),
            is_leaf: false,
            preference: 0,
            grounded: true,
            prefix: GLOBAL_PREFIX,
            dio_interval_min: 14,
            dio_interval_doublings: 9,
            dio_redundancy: 3,
            min_hop_rank_increase: 256,
            max_rank_increase: 7168,
            default_lifetime: 30,
            lifetime_unit_s: 60,
            global_repair_period: SimDuration::ZERO,
            dao_for_joins: None,
            root_keeps_version: false,
            initial_etx_x128: 3 * 128,
            max_failures: 10,
            unusable_hold: 60 * SimDuration::SECOND,
            neighbour_lifetime: 1800 * SimDuration::SECOND,
            max_neighbours: 32,
            parent_set_size: 3,
            outdone: 300 * SimDuration::SECOND,
            probe_period: 90 * SimDuration::SECOND,
            repair_hold: 16 * SimDuration::SECOND,
            forget: 300 * SimDuration::SECOND,
            solicitation: Solicitation::Unicast,
            dis_period: 60 * SimDuration::SECOND,
            advertises: true,
            dao_period: SimDuration::ZERO,
            dao_delay: SimDuration::SECOND,
            dao_interval: SimDuration::ZERO,
            dao_ack: true,
            dao_ack_wait: 20 * SimDuration::SECOND,
            dao_max_retries: 4,
            max_dao_targets: 3,
            max_routes: 0,
            handover: None,
            no_trickle_suppression: false,
            stale_rank: false,
        }
    }
}

impl Config {
    /// Waits for acknowledgments as long as it takes to send what can stand before one at the root, if that is longer.
    pub(crate) fn wait_for_dao_acks(&mut self, backlog: SimDuration) {
        self.dao_ack_wait = self.dao_ack_wait.max(backlog);
    }

    /// What a root announces to its DODAG (RFC 6550, § 6.7.6).
    #[must_use]
    pub fn configuration(&self) -> DodagConfiguration {
        DodagConfiguration {
            dio_interval_doublings: self.dio_interval_doublings,
            dio_interval_min: self.dio_interval_min,
            dio_redundancy: self.dio_redundancy,
            max_rank_increase: self.max_rank_increase,
            min_hop_rank_increase: self.min_hop_rank_increase.max(1),
            objective: self.objective.code(),
            default_lifetime: self.default_lifetime,
            lifetime_unit_s: self.lifetime_unit_s,
        }
    }
}
