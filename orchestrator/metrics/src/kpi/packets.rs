//! The account of packets: created, delivered, dropped, on their way.

use super::kpi_summary::{Delivery, Downloads, ExchangeOutcome, Exchanges, Latency, PacketsOfKind};
use super::samples::{PacketTimeline, Samples};
use crate::DistanceBin;
use indexmap::IndexMap;
use proto::types::{EVERYONE, PacketKind, Packets, seconds};
use std::collections::{BTreeMap, BTreeSet};

/// What became of all packets so far.
#[derive(Clone, Debug, Default)]
pub struct PacketAccount {
    /// The kinds as last reported, with how many of each were created.
    kinds: Vec<PacketKind>,
    /// Delivered, and dropped by reason, of each kind.
    ended: Vec<(u64, BTreeMap<String, u64>)>,
    /// CoAP exchanges and downloads, as far as there are any.
    round_trips: RoundTrips,
    /// Application packets to one destination, by source.
    motes: BTreeMap<u32, MotePackets>,
    /// The same by destination: upward traffic is that to roots, which are known only at the end.
    to: BTreeMap<u32, Flow>,
    /// Application packets to one destination that were delivered, and dropped, by when they ended.
    pub over_time: PacketTimeline,
}

/// Kinds of packets that are a CoAP exchange, and a download, from end to end.
const EXCHANGE: &str = "exchange";
const DOWNLOAD: &str = "download";

/// CoAP exchanges and downloads that succeeded.
#[derive(Clone, Debug, Default)]
struct RoundTrips {
    /// Round-trip times (s).
    exchanges_s: Samples,
    /// Times to complete (s), and goodput (B/s).
    downloads_s: Samples,
    goodput_bytes_s: Samples,
}

impl RoundTrips {
    fn add(&mut self, kind: &str, latency_ns: u64, bytes: u32) {
        let latency_s = seconds(latency_ns);
        match kind {
            EXCHANGE => self.exchanges_s.add(latency_s),
            DOWNLOAD => {
                self.downloads_s.add(latency_s);
                if 0.0 < latency_s {
                    self.goodput_bytes_s.add(f64::from(bytes) / latency_s);
                }
            }
            _ => {}
        }
    }
}

/// Packets to a destination.
#[derive(Clone, Debug, Default)]
struct Flow {
    dropped: u64,
    reasons: BTreeMap<String, u64>,
    hops: u64,
    /// Seconds; one entry for each that was delivered.
    latency_s: Samples,
}

/// Application packets of a mote.
#[derive(Clone, Debug, Default)]
pub struct MotePackets {
    /// Packets that reached their destination.
    pub delivered: u64,
    /// Packets that were given up, for any reason.
    pub dropped: u64,
    reasons: BTreeMap<String, u64>,
    /// Seconds; one entry for each that was delivered.
    latency_s: Samples,
    hops: u64,
}

impl MotePackets {
    /// Packets delivered divided by packets delivered or dropped; `None` if there are none of either.
    pub fn ratio(&self) -> Option<f64> {
        let ended = self.delivered + self.dropped;
        (ended != 0).then(|| self.delivered as f64 / ended as f64)
    }

    /// Dropped for a reason.
    pub fn dropped_for(&self, reason: &str) -> u64 {
        self.reasons.get(reason).copied().unwrap_or_default()
    }

    /// Mean latency of those delivered (s).
    pub fn mean_latency_s(&self) -> Option<f64> {
        self.latency_s.mean()
    }

    /// Quantiles of the latencies of those delivered (s).
    pub fn latency_quantiles_s<const N: usize>(&self, levels: [f64; N]) -> [Option<f64>; N] {
        self.latency_s.quantiles(levels)
    }

    /// Mean number of hops of those delivered.
    pub fn mean_hops(&self) -> Option<f64> {
        (self.delivered != 0).then(|| self.hops as f64 / self.delivered as f64)
    }
}

impl PacketAccount {
    /// Adds the packets that ended in a step.
    pub fn add(&mut self, packets: &Packets) {
        self.kinds.clone_from(&packets.kinds);
        if self.ended.len() < self.kinds.len() {
            self.ended.resize_with(self.kinds.len(), Default::default);
        }
        for i in 0..packets.len() {
            let kind = packets.kind[i] as usize;
            let reason = packets.drop_reason(i);
            let (delivered, dropped) = &mut self.ended[kind];
            match reason {
                None => {
                    *delivered += 1;
                    let latency_ns = packets.ended_ns[i] - packets.created_ns[i];
                    let name = &self.kinds[kind].name;
                    self.round_trips.add(name, latency_ns, packets.payload_bytes[i]);
                }
                Some(reason) => count(dropped, reason),
            }
            if !self.kinds[kind].is_application || packets.destination[i] == EVERYONE {
                continue;
            }
            let latency_ns = packets.ended_ns[i] - packets.created_ns[i];
            let mote = self.motes.entry(packets.source[i]).or_default();
            let flow = self.to.entry(packets.destination[i]).or_default();
            self.over_time.add(packets.ended_ns[i], reason.is_some());
            match reason {
                None => {
                    mote.delivered += 1;
                    mote.latency_s.add(seconds(latency_ns));
                    mote.hops += u64::from(packets.hops[i]);
                    flow.latency_s.add(seconds(latency_ns));
                    flow.hops += u64::from(packets.hops[i]);
                }
                Some(reason) => {
                    mote.dropped += 1;
                    count(&mut mote.reasons, reason);
                    flow.dropped += 1;
                    count(&mut flow.reasons, reason);
                }
            }
        }
    }

    /// Whether the network reports no packets.
    pub fn is_empty(&self) -> bool {
        self.kinds.is_empty()
    }

    /// Whether applications have sent anything.
    pub fn has_applications(&self) -> bool {
        self.kinds.iter().any(|kind| kind.is_application && kind.created != 0)
    }

    /// Application packets of a mote, if any ended.
    pub fn of_mote(&self, mote: usize) -> Option<&MotePackets> {
        self.motes.get(&u32::try_from(mote).ok()?)
    }

    /// Why application packets of any mote were dropped.
    pub fn reasons(&self) -> BTreeSet<&str> {
        self.motes.values().flat_map(|mote| mote.reasons.keys()).map(String::as_str).collect()
    }

    /// Latencies of all application packets delivered to one destination (s).
    pub fn latencies_s(&self) -> Samples {
        Samples::from_values(self.to.values().flat_map(|flow| flow.latency_s.ascending()))
    }

    /// Application packets to those destinations: how many arrived, how fast, over how many hops, and why others did not.
    pub fn delivery(&self, is_meant: impl Fn(usize) -> bool) -> Option<Delivery> {
        let flows: Vec<&Flow> = self
            .to
            .iter()
            .filter(|&(&mote, _)| is_meant(mote as usize))
            .map(|(_, flow)| flow)
            .collect();
        let delivered: u64 = flows.iter().map(|flow| flow.latency_s.len()).sum();
        let dropped: u64 = flows.iter().map(|flow| flow.dropped).sum();
        if delivered + dropped == 0 {
            return None;
        }
        let mut reasons: BTreeMap<String, u64> = BTreeMap::new();
        for (reason, &n) in flows.iter().flat_map(|flow| &flow.reasons) {
            *reasons.entry(reason.clone()).or_default() += n;
        }
        // Attempts and deliveries of whatever kind have the same interval.
        let ended = DistanceBin {
            attempts: delivered + dropped,
            deliveries: delivered,
            ..DistanceBin::default()
        };
        let hops: u64 = flows.iter().map(|flow| flow.hops).sum();
        let sum_s: f64 = flows
            .iter()
            .filter_map(|flow| Some(flow.latency_s.mean()? * flow.latency_s.len() as f64))
            .sum();
        let latency_s =
            Samples::from_values(flows.iter().flat_map(|flow| flow.latency_s.ascending()));
        let [least, median, p95, p99] = latency_s.quantiles([0.0, 0.5, 0.95, 0.99]);
        let longest_s = flows.iter().filter_map(|flow| flow.latency_s.quantile(1.0));
        Some(Delivery {
            delivered,
            dropped,
            ratio: ended.ratio(),
            ratio_interval_95: ended.interval(),
            drops_by_reason: reasons,
            latency_s: (delivered != 0).then(|| Latency {
                min: least,
                mean: sum_s / delivered as f64,
                median,
                p95,
                p99,
                max: longest_s.fold(0.0, f64::max),
            }),
            mean_hops: (delivered != 0).then(|| hops as f64 / delivered as f64),
        })
    }

    /// The account of every kind.
    pub fn by_kind(&self) -> Option<IndexMap<String, PacketsOfKind>> {
        let kinds: IndexMap<String, PacketsOfKind> = self
            .kinds
            .iter()
            .zip(&self.ended)
            .map(|(kind, (delivered, reasons))| {
                let dropped: u64 = reasons.values().sum();
                let account = PacketsOfKind {
                    is_application: kind.is_application,
                    created: kind.created,
                    delivered: *delivered,
                    dropped,
                    in_flight: kind.created.saturating_sub(delivered + dropped),
                    drops_by_reason: reasons.clone(),
                };
                (kind.name.clone(), account)
            })
            .collect();
        (!kinds.is_empty()).then_some(kinds)
    }

    /// CoAP exchanges; the numbers of requests, of their retransmissions and of duplicates that arrived. `None`: there are none.
    pub fn exchanges(
        &self,
        [requests, retransmissions, duplicates]: [Option<u64>; 3],
    ) -> Option<Exchanges> {
        let outcome = self.outcome(EXCHANGE)?;
        let round_trip_s = latency(&self.round_trips.exchanges_s);
        Some(Exchanges { outcome, round_trip_s, requests, retransmissions, duplicates })
    }

    /// Downloads; the numbers of requests for blocks, of their retransmissions and of duplicates that arrived. `None`: there are
    /// none.
    pub fn downloads(
        &self,
        [blocks, retransmissions, duplicates]: [Option<u64>; 3],
    ) -> Option<Downloads> {
        let outcome = self.outcome(DOWNLOAD)?;
        let time_s = latency(&self.round_trips.downloads_s);
        let mean_goodput_bytes_s = self.round_trips.goodput_bytes_s.mean();
        Some(Downloads {
            outcome,
            time_s,
            mean_goodput_bytes_s,
            blocks,
            retransmissions,
            duplicates,
        })
    }

    fn outcome(&self, name: &str) -> Option<ExchangeOutcome> {
        let at = self.kinds.iter().position(|kind| kind.name == name && kind.created != 0)?;
        let (succeeded, reasons) = &self.ended[at];
        let failed: u64 = reasons.values().sum();
        let started = self.kinds[at].created;
        let ended = succeeded + failed;
        Some(ExchangeOutcome {
            started,
            succeeded: *succeeded,
            failed,
            open: started.saturating_sub(ended),
            success_ratio: (ended != 0).then(|| *succeeded as f64 / ended as f64),
        })
    }

    /// Where the account does not come out even.
    pub fn warnings(&self) -> Vec<String> {
        let kinds = self.kinds.iter().zip(&self.ended);
        kinds
            .filter_map(|(kind, (delivered, reasons))| {
                let ended = delivered + reasons.values().sum::<u64>();
                (kind.created < ended).then(|| {
                    format!(
                        "of {} packets of kind {} that the network says it created {ended} ended: its account is wrong",
                        kind.created, kind.name
                    )
                })
            })
            .collect()
    }
}

/// Figures of latencies (s); `None` without any.
fn latency(samples: &Samples) -> Option<Latency> {
    let [min, median, p95, p99, max] = samples.quantiles([0.0, 0.5, 0.95, 0.99, 1.0]);
    Some(Latency { min, mean: samples.mean()?, median, p95, p99, max: max? })
}

fn count(reasons: &mut BTreeMap<String, u64>, reason: &str) {
    match reasons.get_mut(reason) {
        Some(n) => *n += 1,
        None => {
            reasons.insert(reason.to_owned(), 1);
        }
    }
}
