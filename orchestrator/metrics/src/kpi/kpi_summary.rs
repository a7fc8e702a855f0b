//! The figures of a network with protocols in `summary.json`. The module above defines what they mean.

use indexmap::IndexMap;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// The figures of a network with protocols. A part is null where nothing was counted.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct KpiSummary {
    /// Whether and when the network formed; null if the network has nothing to form.
    pub formation: Option<FormationSummary>,
    /// How many motes joined the network, and when.
    pub joining: Joining,
    /// Application packets to one destination; null if none ended.
    pub delivery: Option<Delivery>,
    /// Application packets to roots; null if none ended.
    pub delivery_upward: Option<Delivery>,
    /// Application packets delivered, of all that every mote should have sent while it was alive; null if it is unknown what they
    /// should send, as without `[[netsim.app]]`.
    pub delivered_of_expected: Option<DeliveredOfExpected>,
    /// Counts of packets by kind, for instance those of applications; null if they are not recorded.
    pub packets: Option<IndexMap<String, PacketsOfKind>>,
    /// CoAP exchanges of applications; absent if there are none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub exchanges: Option<Exchanges>,
    /// Block-wise downloads; absent if there are none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub downloads: Option<Downloads>,
    /// Unicast frames and their acknowledgments; absent if nothing was sent, or if that is unknown.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub transmissions: Option<Transmissions>,
    /// Transmissions by what their frames are for, most first; absent if that is unknown.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub frames_by_kind: Option<IndexMap<String, FramesOfKind>>,
    /// Changes of preferred parents.
    pub routing: Routing,
    /// The same of the time in which robots were free to move.
    pub since_start: SinceStart,
    /// What the queues of all motes did not keep.
    pub queue_drops: QueueDrops,
    /// What ended at motes without arriving, by reason, zeros left out; null if that is unknown.
    #[schemars(extend("x-better" = "lower"))]
    pub drops_by_reason: Option<IndexMap<String, f64>>,
    /// Energy from the beginning; null if the network does not count charge.
    pub energy: Option<EnergySummary>,
    /// Energy from the first step after formation on; null if the network did not form, or does not count charge.
    pub energy_since_formation: Option<EnergySummary>,
    /// Figures of motes: columns by name, with an entry per mote; null where a mote has none.
    pub motes: IndexMap<String, Vec<Option<f64>>>,
}

/// Whether and when a network formed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct FormationSummary {
    /// Whether every mote has taken part.
    #[schemars(extend("x-better" = "higher"))]
    pub formed: bool,
    /// When every mote took part for the first time (s); null if the network did not form.
    #[schemars(extend("x-better" = "lower"))]
    pub formed_s: Option<f64>,
    /// How many motes do not take part.
    #[schemars(extend("x-better" = "lower"))]
    pub missing: usize,
    /// Their numbers by what they lack.
    pub missing_by_reason: IndexMap<String, Vec<u32>>,
}

/// When motes joined, roots apart.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Joining {
    /// When they were first synchronised; null if none was.
    pub synced: Option<JoinTimes>,
    /// When they first joined; null if none did.
    pub joined: Option<JoinTimes>,
}

/// Times at which motes reached something (s).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct JoinTimes {
    /// How many motes reached it.
    #[schemars(extend("x-better" = "higher"))]
    pub motes: u64,
    /// When the first mote joined (s).
    #[schemars(extend("x-better" = "lower"))]
    pub first_s: Option<f64>,
    /// Mean over the motes that joined (s).
    #[schemars(extend("x-better" = "lower"))]
    pub mean_s: Option<f64>,
    /// Median over the motes that joined (s).
    #[schemars(extend("x-better" = "lower"))]
    pub median_s: Option<f64>,
    /// 99 % quantile.
    #[schemars(extend("x-better" = "lower"))]
    pub p99_s: Option<f64>,
    /// When the last of them joined (s).
    #[schemars(extend("x-better" = "lower"))]
    pub last_s: Option<f64>,
}

/// Application packets that ended.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Delivery {
    /// Packets that reached their destination.
    pub delivered: u64,
    /// Packets that were dropped on the way.
    #[schemars(extend("x-better" = "lower"))]
    pub dropped: u64,
    /// Delivered / (delivered + dropped).
    #[schemars(extend("x-better" = "higher"))]
    pub ratio: f64,
    /// The 95 % interval of that ratio, taking packets for independent (Wilson 1927).
    pub ratio_interval_95: [f64; 2],
    /// Packets dropped, by reason.
    #[schemars(extend("x-better" = "lower"))]
    pub drops_by_reason: BTreeMap<String, u64>,
    /// From creation to delivery; null if none was delivered.
    #[schemars(extend("x-better" = "lower"))]
    pub latency_s: Option<Latency>,
    /// Hops that those delivered took, mean; null if none was delivered.
    pub mean_hops: Option<f64>,
}

/// Application packets delivered, of all that every mote should have sent while it was alive, joined or not.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct DeliveredOfExpected {
    /// Packets delivered.
    pub delivered: u64,
    /// Packets that motes should have sent: their time on over the period of each application, and bursts whose time had
    /// come; of each mote never less than it created.
    pub expected: u64,
    /// Delivered / expected. Packets on their way at the end count as not delivered.
    #[schemars(extend("x-better" = "higher"))]
    pub ratio: f64,
    /// Living motes that were joined at the end; null if that is unknown.
    #[schemars(extend("x-better" = "higher"))]
    pub joined_at_end: Option<usize>,
    /// Living motes at the end.
    #[schemars(extend("x-better" = "higher"))]
    pub alive_at_end: usize,
}

/// Latencies of packets (s).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Latency {
    /// Least latency (s).
    pub min: Option<f64>,
    /// Mean latency (s).
    pub mean: f64,
    /// Median latency (s).
    pub median: Option<f64>,
    /// 95 % quantile.
    pub p95: Option<f64>,
    /// 99 % quantile.
    pub p99: Option<f64>,
    /// Greatest latency (s).
    pub max: f64,
}

/// The account of a kind of packets.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct PacketsOfKind {
    /// Whether applications sent them.
    pub is_application: bool,
    /// Packets that were created at their source.
    pub created: u64,
    /// Packets that reached their destination, of this kind.
    pub delivered: u64,
    /// Packets that were dropped on the way, of this kind.
    #[schemars(extend("x-better" = "lower"))]
    pub dropped: u64,
    /// Packets that were still on their way at the end.
    pub in_flight: u64,
    /// Packets dropped, by reason.
    #[schemars(extend("x-better" = "lower"))]
    pub drops_by_reason: BTreeMap<String, u64>,
}

/// How exchanges or downloads ended.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ExchangeOutcome {
    /// How many began.
    pub started: u64,
    /// How many succeeded.
    #[schemars(extend("x-better" = "higher"))]
    pub succeeded: u64,
    /// How many failed: a message was retransmitted as often as it may be, or the client was switched off.
    #[schemars(extend("x-better" = "lower"))]
    pub failed: u64,
    /// How many were open at the end.
    pub open: u64,
    /// Succeeded / (succeeded + failed); null if none ended.
    #[schemars(extend("x-better" = "higher"))]
    pub success_ratio: Option<f64>,
}

/// CoAP exchanges: a confirmable request and its response.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Exchanges {
    /// How they ended.
    #[serde(flatten)]
    pub outcome: ExchangeOutcome,
    /// From the first transmission of the request to the response; null if none succeeded.
    #[schemars(extend("x-better" = "lower"))]
    pub round_trip_s: Option<Latency>,
    /// Requests sent, without retransmissions; null if that is unknown.
    pub requests: Option<u64>,
    /// Retransmissions of them; null if that is unknown.
    #[schemars(extend("x-better" = "lower"))]
    pub retransmissions: Option<u64>,
    /// Requests that a mote received although it had answered them before; null if that is unknown.
    #[schemars(extend("x-better" = "lower"))]
    pub duplicates: Option<u64>,
}

/// Block-wise downloads.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Downloads {
    /// How they ended.
    #[serde(flatten)]
    pub outcome: ExchangeOutcome,
    /// From the begin of a download to its last block; null if none was completed.
    #[schemars(extend("x-better" = "lower"))]
    pub time_s: Option<Latency>,
    /// Mean over completed downloads of size / time (bytes per second); null if none was completed.
    #[schemars(extend("x-better" = "higher"))]
    pub mean_goodput_bytes_s: Option<f64>,
    /// Requests for a block sent, without retransmissions; null if that is unknown.
    pub blocks: Option<u64>,
    /// Retransmissions of them; null if that is unknown.
    #[schemars(extend("x-better" = "lower"))]
    pub retransmissions: Option<u64>,
    /// Requests that were received although they had been answered before; null if that is unknown.
    #[schemars(extend("x-better" = "lower"))]
    pub duplicates: Option<u64>,
}

/// Unicast frames of all motes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Transmissions {
    /// Transmissions, each repetition counted.
    pub unicast: u64,
    /// Those whose acknowledgment the sender received.
    pub acknowledged: u64,
    /// Acknowledged / unicast.
    #[schemars(extend("x-better" = "higher"))]
    pub acknowledged_ratio: f64,
}

/// Transmissions of frames that are for one purpose. Each took a cell.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct FramesOfKind {
    /// Transmissions, each repetition counted.
    pub transmissions: u64,
    /// Share of the transmissions of all kinds.
    pub share: f64,
    /// Transmissions that repeat a frame that was not acknowledged.
    #[schemars(extend("x-better" = "lower"))]
    pub repeated: u64,
    /// Transmissions that asked for an acknowledgment.
    pub unicast: u64,
    /// Those of these whose acknowledgment the sender received.
    pub acknowledged: u64,
    /// Acknowledged / unicast; null if none was unicast.
    #[schemars(extend("x-better" = "higher"))]
    pub acknowledged_ratio: Option<f64>,
}

/// Changes of preferred parents; null where unknown.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Routing {
    /// Changes of preferred parents, all motes together; null if that is unknown.
    #[schemars(extend("x-better" = "lower"))]
    pub parent_changes: Option<f64>,
    /// Changes per mote and hour of being on; null if that is unknown.
    #[schemars(extend("x-better" = "lower"))]
    pub churn_per_mote_hour: Option<f64>,
}

/// What happened while robots were free to move.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct SinceStart {
    /// Application packets created and delivered then, of all that every mote should have sent then while it was alive; null if it
    /// is unknown what they should send, as without `[[netsim.app]]`.
    #[serde(default)]
    pub delivered_of_expected: Option<DeliveredOfExpected>,
    /// Application packets to one destination that ended then; null if none did.
    pub delivery: Option<Delivery>,
    /// Application packets to roots that ended then; null if none did.
    pub delivery_upward: Option<Delivery>,
    /// Payload of application packets to one destination that were delivered then, of all motes, over that time (bytes per second); null
    /// if the network has no application, or robots were never free to move.
    #[serde(default)]
    #[schemars(extend("x-better" = "higher"))]
    pub throughput_bytes_s: Option<f64>,
    /// Transmissions by what their frames are for, since the first report after the network had formed if robots waited for it; absent
    /// if that is unknown.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub frames_by_kind: Option<IndexMap<String, FramesOfKind>>,
    /// Changes of preferred parents of all motes; null if that is unknown.
    #[schemars(extend("x-better" = "lower"))]
    pub parent_changes: Option<f64>,
    /// Changes per mote and hour of being on; null if that is unknown.
    #[schemars(extend("x-better" = "lower"))]
    pub churn_per_mote_hour: Option<f64>,
    /// Time mean of the share of living motes that are joined; null if motes have no such state.
    #[schemars(extend("x-better" = "higher"))]
    pub joined_ratio: Option<f64>,
}

/// What queues did not keep; null where unknown.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct QueueDrops {
    /// Frames for which there was no room; null if that is unknown.
    #[schemars(extend("x-better" = "lower"))]
    pub txqueue_full: Option<f64>,
    /// Robots' payloads that a newer one replaced before they were sent; null if that is unknown.
    #[schemars(extend("x-better" = "lower"))]
    pub superseded: Option<f64>,
}

/// Energy of motes; roots count for the total charge alone.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct EnergySummary {
    /// Charge of all motes (µC).
    #[schemars(extend("x-better" = "lower"))]
    pub charge_uc: f64,
    /// Charge of a mote over the time during which it was drawn (µA).
    #[schemars(extend("x-better" = "lower"))]
    pub mean_current_ua: MoteSpread,
    /// Time the radio of a mote sent or listened over the time the mote was on.
    #[schemars(extend("x-better" = "lower"))]
    pub duty_cycle: MoteSpread,
    /// Charge of a new battery (mAh).
    pub battery_mah: f64,
    /// How long that lasts the mote that draws most (years); null if no mote draws any.
    #[schemars(extend("x-better" = "higher"))]
    pub network_lifetime_years: Option<f64>,
    /// How long it lasts the median mote (years); null if that draws none.
    #[schemars(extend("x-better" = "higher"))]
    pub median_lifetime_years: Option<f64>,
}

impl KpiSummary {
    /// Application packets that were delivered, and those that ended, before robots were free to move; `None` if none ended then.
    #[must_use]
    pub fn before_start(&self) -> Option<[u64; 2]> {
        let counted = |delivery: &Option<Delivery>| {
            delivery.as_ref().map_or([0, 0], |of| [of.delivered, of.delivered + of.dropped])
        };
        let [whole, since] = [&self.delivery, &self.since_start.delivery].map(counted);
        let before = [0, 1].map(|which| whole[which].saturating_sub(since[which]));
        (before[1] != 0).then_some(before)
    }

    /// The energy that reports show, and its period: since the network formed if it has run on from there, because motes scan
    /// before; else the whole run.
    #[must_use]
    pub fn energy_shown(&self) -> Option<(&EnergySummary, EnergyPeriod)> {
        let since = self.energy_since_formation.as_ref();
        let known = |energy: &&EnergySummary| energy.mean_current_ua.mean.is_some();
        since
            .filter(known)
            .map(|energy| (energy, EnergyPeriod::SinceFormation))
            .or_else(|| self.energy.as_ref().map(|energy| (energy, EnergyPeriod::Whole)))
    }
}

/// The time over which energy is summed up.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EnergyPeriod {
    /// From the beginning.
    Whole,
    /// From when the network had formed.
    SinceFormation,
}

impl EnergyPeriod {
    /// What names of motes' columns of that time end with.
    #[must_use]
    pub fn suffix(self) -> &'static str {
        match self {
            Self::Whole => "",
            Self::SinceFormation => super::SINCE_FORMATION,
        }
    }

    /// In words.
    #[must_use]
    pub fn words(self) -> &'static str {
        match self {
            Self::Whole => "whole run",
            Self::SinceFormation => "since formation",
        }
    }
}

/// A figure over motes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct MoteSpread {
    /// Mean over motes, in the unit of the figure; null if there are roots only.
    pub mean: Option<f64>,
    /// Median over motes; null if there are roots only.
    pub median: Option<f64>,
    /// 99 % quantile over motes; null if there are roots only.
    pub p99: Option<f64>,
    /// The greatest of all motes; null if there are roots only.
    pub max: Option<f64>,
}
