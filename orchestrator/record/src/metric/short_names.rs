//! The short names: each of one path. Of several paths that a question may mean, the one that counts what is lost.

/// What a short name is about.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Subject {
    /// Packets of applications.
    Packets,
    /// The network of motes.
    Network,
    /// What motes consume.
    Energy,
    /// Broadcasts between robots.
    Broadcasts,
    /// What robots do.
    Swarm,
}

impl Subject {
    /// All, in the order of the table.
    pub(super) const ALL: [Self; 5] =
        [Self::Packets, Self::Network, Self::Energy, Self::Broadcasts, Self::Swarm];

    /// The heading of its rows.
    pub(super) fn heading(self) -> &'static str {
        match self {
            Self::Packets => {
                "Packets of applications ([[netsim.app]]), from the start of the robots"
            }
            Self::Network => "Network with protocols",
            Self::Energy => "Energy of motes other than roots, once the network has formed",
            Self::Broadcasts => "Payloads that robots broadcast",
            Self::Swarm => "Swarm, from the start of the robots",
        }
    }
}

/// A short name of a figure.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ShortName {
    /// The name.
    pub name: &'static str,
    /// The path in `summary.json`.
    pub path: &'static str,
    /// What an axis calls the figure, without its unit.
    pub label: &'static str,
    /// What the figure is, in a line of the table.
    pub meaning: &'static str,
    /// What others call it. Not accepted, but answered with this name.
    pub also: &'static [&'static str],
    /// What it is about.
    pub subject: Subject,
}

use Subject::{Broadcasts, Energy, Network, Packets, Swarm};

const fn short(
    subject: Subject,
    name: &'static str,
    path: &'static str,
    label: &'static str,
    meaning: &'static str,
    also: &'static [&'static str],
) -> ShortName {
    ShortName { name, path, label, meaning, also, subject }
}

/// All short names, in the order of the table.
pub const SHORT_NAMES: &[ShortName] = &[
    short(
        Packets,
        "pdr",
        "kpis.since_start.delivered_of_expected.ratio",
        "packet delivery ratio",
        "packets delivered / packets expected",
        &["prr", "delivery", "reliability", "delivered", "packet_reception_ratio"],
    ),
    short(
        Packets,
        "latency",
        "kpis.since_start.delivery.latency_s.median",
        "median latency",
        "from creation to delivery: median",
        &["delay", "latency_median", "end_to_end_delay", "end_to_end_latency"],
    ),
    short(
        Packets,
        "latency_mean",
        "kpis.since_start.delivery.latency_s.mean",
        "mean latency",
        "from creation to delivery: mean",
        &["mean_delay", "average_latency"],
    ),
    short(
        Packets,
        "latency_p99",
        "kpis.since_start.delivery.latency_s.p99",
        "99 % latency",
        "from creation to delivery: 99 % quantile",
        &["tail_latency", "jitter"],
    ),
    short(
        Packets,
        "throughput",
        "kpis.since_start.throughput_bytes_s",
        "throughput",
        "payload delivered per second, all motes",
        &["goodput", "bandwidth", "bitrate", "data_rate"],
    ),
    short(
        Packets,
        "hops",
        "kpis.since_start.delivery.mean_hops",
        "hops",
        "hops of delivered packets: mean",
        &["hop_count", "path_length"],
    ),
    short(
        Network,
        "formation_time",
        "kpis.formation.formed_s",
        "formation time",
        "time until every mote takes part",
        &["convergence_time", "formed", "formation"],
    ),
    short(
        Network,
        "join_time",
        "kpis.joining.joined.median_s",
        "join time",
        "time until a mote joins: median over motes",
        &["joining_time", "joins"],
    ),
    short(
        Network,
        "joined",
        "kpis.since_start.joined_ratio",
        "joined motes",
        "share of motes that are joined: time mean",
        &["connectivity", "availability"],
    ),
    short(
        Network,
        "parent_changes",
        "kpis.since_start.parent_changes",
        "parent changes",
        "changes of preferred parents, all motes",
        &["parent_switches"],
    ),
    short(
        Network,
        "churn",
        "kpis.since_start.churn_per_mote_hour",
        "parent changes per mote",
        "changes of preferred parents, per mote",
        &["parent_churn", "route_changes"],
    ),
    short(
        Network,
        "acknowledged",
        "kpis.transmissions.acknowledged_ratio",
        "acknowledged frames",
        "share of unicast frames acknowledged",
        &["ack_ratio", "link_pdr", "etx", "frame_delivery_ratio"],
    ),
    short(
        Network,
        "queue_drops",
        "kpis.queue_drops.txqueue_full",
        "queue drops",
        "frames dropped because a queue was full",
        &["queue_losses", "overflows"],
    ),
    short(
        Energy,
        "duty_cycle",
        "kpis.energy_since_formation.duty_cycle.mean",
        "duty cycle",
        "share of time the radio is on: mean",
        &["radio_on", "radio_duty_cycle", "rdc"],
    ),
    short(
        Energy,
        "current",
        "kpis.energy_since_formation.mean_current_ua.mean",
        "current",
        "current that a mote draws: mean",
        &["power", "energy", "consumption", "charge"],
    ),
    short(
        Energy,
        "lifetime",
        "kpis.energy_since_formation.network_lifetime_years",
        "network lifetime",
        "time until the first battery is empty",
        &["battery_life", "battery_lifetime", "battery"],
    ),
    short(
        Broadcasts,
        "broadcast_pdr",
        "network.delivery_ratio",
        "delivery ratio",
        "receptions / receptions possible",
        &["broadcast_delivery", "reception_ratio"],
    ),
    short(
        Broadcasts,
        "broadcast_delay",
        "network.mean_delay_s",
        "mean delay",
        "from sending to reception: mean",
        &["broadcast_latency", "reception_delay"],
    ),
    short(
        Broadcasts,
        "age",
        "network.mean_age_s",
        "mean age",
        "age of what robots act on: mean",
        &["aoi", "age_of_information", "staleness"],
    ),
    short(
        Broadcasts,
        "neighbours",
        "network.mean_neighbours_heard",
        "neighbours heard",
        "robots heard in a period: mean",
        &["neighbors", "degree", "node_degree"],
    ),
    short(
        Broadcasts,
        "isolation",
        "network.isolated_ratio",
        "isolated robots",
        "share of robots that hear nobody: time mean",
        &["isolated"],
    ),
    short(
        Swarm,
        "flock_speed",
        "task.flock_speed_mps",
        "flock speed",
        "speed of the mean velocity: time mean",
        &["group_speed"],
    ),
    short(
        Swarm,
        "speed_along_leader",
        "task.speed_along_leader_mps",
        "speed along leader",
        "flock's speed in the leader's direction",
        &["following_speed"],
    ),
    short(
        Swarm,
        "speed",
        "task.mean_speed_mps",
        "mean speed",
        "speed of a robot: mean",
        &["velocity", "robot_speed"],
    ),
    short(
        Swarm,
        "polarisation",
        "task.polarisation",
        "polarisation",
        "1 if all move in one direction: time mean",
        &["polarization", "order", "order_parameter", "alignment"],
    ),
    short(
        Swarm,
        "cohesion",
        "task.cohesion_m",
        "cohesion",
        "distance from the centre: mean",
        &["compactness", "dispersion"],
    ),
    short(
        Swarm,
        "spread",
        "task.final_spread_m",
        "final spread",
        "r.m.s. distance from the centre at the end",
        &["consensus_error"],
    ),
    short(
        Swarm,
        "fragments",
        "task.fragments",
        "fragments",
        "groups that hear each other: time mean",
        &["groups", "clusters", "components"],
    ),
    short(
        Swarm,
        "collisions",
        "task.collisions",
        "collisions",
        "how often two robots collided",
        &["robot_collisions", "contacts"],
    ),
    short(
        Swarm,
        "site_collisions",
        "task.site_collisions",
        "site collisions",
        "how often a robot hit a wall or an obstacle",
        &["wall_collisions", "obstacle_collisions"],
    ),
    short(
        Swarm,
        "min_distance",
        "task.min_distance_m",
        "min distance",
        "minimum distance between two robots",
        &["clearance", "separation"],
    ),
    short(
        Swarm,
        "leader_distance",
        "task.leader_distance_m",
        "leader distance",
        "distance from the leader: mean",
        &["following_distance", "tracking_error"],
    ),
    short(
        Swarm,
        "position_error",
        "task.neighbour_error_m",
        "neighbour error",
        "error of the positions robots act on: mean",
        &["localisation_error", "localization_error"],
    ),
    short(
        Swarm,
        "completed",
        "task.complete",
        "completed",
        "whether robots consider the task done",
        &["success", "done"],
    ),
    short(
        Swarm,
        "completion_time",
        "task.completed_after_s",
        "completion time",
        "time until robots consider the task done",
        &["time_to_completion", "makespan"],
    ),
    short(
        Swarm,
        "line_error",
        "task.line_rms_m",
        "line rms",
        "r.m.s. distance from the line at the end",
        &["formation_error"],
    ),
    short(
        Swarm,
        "circle_error",
        "task.circle_rms_m",
        "circle rms",
        "r.m.s. distance from the circle at the end",
        &[],
    ),
    short(
        Swarm,
        "coverage",
        "task.mapped_ratio",
        "mapped ratio",
        "share of the cells on the base's map",
        &["mapped", "explored"],
    ),
];
