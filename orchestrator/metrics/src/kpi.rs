//! Key performance indicators of a network with protocols. All of them are defined here, and nowhere else.
//!
//! | indicator | definition |
//! |---|---|
//! | delivery ratio | delivered / (delivered + dropped), application packets to one destination; those still on their way at the end count for neither |
//! | delivered of expected | delivered / packets that every mote should have sent in the time it was alive, joined or not: its time on over the period of each application, and bursts whose time had come; never less than it created. Those on their way count as not delivered |
//! | latency | from when a packet was created to when it was delivered |
//! | round trip | of a CoAP exchange: from the first transmission of the request to the arrival of the response |
//! | success ratio | of exchanges and of downloads: succeeded / (succeeded + failed); those open at the end count for neither |
//! | acknowledged ratio | unicast transmissions whose acknowledgment the sender received / unicast transmissions; each repetition counts |
//! | throughput | payload of application packets delivered / time, all motes together |
//! | goodput | size of a download / time from its begin to its last block |
//! | in flight | created less delivered and dropped: nothing is lost from the account |
//! | first join, last join | among motes that joined, roots apart |
//! | churn | changes of the preferred parent per mote and hour of being on |
//! | since the start | the same of the time in which robots were free to move: packets that ended then, and of those expected those created then, changes of parents from when the network had formed on, and the share of motes that were joined |
//! | duty cycle | time the radio sent or listened over the time the mote was on |
//! | mean current | charge over the very time during which it was drawn: scanning counts on both sides of the fraction |
//! | lifetime | charge of a new battery over the mean current; of the network: the shortest of a mote other than a root |
//!
//! Units are in the names. Quantiles are interpolated between neighbours.

mod applications;
mod energy;
pub mod kpi_summary;
mod moving;
mod packets;
mod samples;

pub use applications::Applications;
pub use packets::{MotePackets, PacketAccount};
pub use samples::Samples;

use super::period::Period;
use indexmap::IndexMap;
use kpi_summary::{
    DeliveredOfExpected, FormationSummary, FramesOfKind, JoinTimes, Joining, KpiSummary,
    QueueDrops, Routing, SinceStart, Transmissions,
};
use moving::Moving;
use numbers::format::count_of;
use proto::types::{Formation, HeardLinks, MoteStates, MoteStatistics, Schedule, seconds};
use std::cmp::Reverse;

/// Charge of two AA cells (mAh), as the 6TiSCH simulator has it: where the network says nothing else in `battery_mah`.
pub const BATTERY_MAH: f64 = 2821.5;

/// The indicators of a run so far, and the latest states that reports show.
#[derive(Clone, Debug, Default)]
pub struct Kpis {
    /// Application packets of the whole run.
    pub account: PacketAccount,
    /// What motes should send.
    applications: Applications,
    /// What happened while robots were free to move.
    moving: Moving,
    /// Formation as last reported; `None`: the network has nothing to form.
    pub formation: Option<Formation>,
    /// Statistics when the network had formed, and the latest ones, each with its time (ns).
    formed: Option<(u64, MoteStatistics)>,
    latest: Option<(u64, MoteStatistics)>,
    /// The motes as last reported.
    pub motes: MoteStates,
    /// The schedules as last reported.
    pub schedule: Option<Schedule>,
    /// Who has heard whom, as last reported.
    pub heard_links: Option<HeardLinks>,
}

impl Kpis {
    /// Begins with what the network said of itself at time 0.
    pub fn new(formation: Option<Formation>, statistics: Option<MoteStatistics>) -> Self {
        let latest = statistics.map(|statistics| (0, statistics));
        Self { formation, latest, ..Self::default() }
    }

    /// The same of a network whose motes should send this.
    #[must_use]
    pub fn with_applications(mut self, applications: Applications) -> Self {
        self.applications = applications;
        self
    }

    /// Adds what happened in one control period. Periods are added in order.
    pub fn add(&mut self, period: &Period<'_>) {
        if let Some(packets) = period.packets {
            self.account.add(packets);
        }
        self.moving.add(period);
        if let Some(statistics) = period.statistics {
            self.latest = Some((period.time_ns, statistics.clone()));
            if self.is_formed() && self.formed.is_none() {
                self.formed.clone_from(&self.latest);
            }
        }
        // Told now, taken account of from the next step on: statistics of this step may not have been asked for yet.
        self.formation = period.formation.cloned();
        self.motes.clone_from(period.motes);
        if let Some(schedule) = period.schedule {
            self.schedule = Some(schedule.clone());
        }
        if let Some(links) = period.heard_links {
            self.heard_links = Some(links.clone());
        }
    }

    fn is_formed(&self) -> bool {
        self.formation.as_ref().is_some_and(|formation| formation.formed_ns.is_some())
    }

    /// The latest statistics of all motes.
    pub fn statistics(&self) -> Option<&MoteStatistics> {
        self.latest.as_ref().map(|(_, statistics)| statistics)
    }

    /// Whether the mote is the root of a routing graph.
    pub fn is_root(&self, mote: usize) -> bool {
        let column = self.statistics().and_then(|statistics| statistics.column("is_root"));
        column.and_then(|column| column.get(mote)).is_some_and(|value| value != 0.0)
    }

    /// Whether there is anything to tell.
    pub fn is_empty(&self) -> bool {
        self.formation.is_none() && self.latest.is_none() && self.account.is_empty()
    }

    /// For `summary.json`; none of a network without protocols.
    pub fn summary(&self) -> Option<KpiSummary> {
        if self.is_empty() {
            return None;
        }
        let n = self.motes.alive.len();
        let whole = energy::summarise(self, None, n);
        let since =
            self.formed.as_ref().and_then(|(_, formed)| energy::summarise(self, Some(formed), n));
        Some(KpiSummary {
            formation: self.formation.as_ref().map(formation),
            joining: self.joining(n),
            delivery: self.account.delivery(|_| true),
            delivery_upward: self.account.delivery(|mote| self.is_root(mote)),
            delivered_of_expected: self.delivered_of_expected(n),
            packets: self.account.by_kind(),
            exchanges: self.account.exchanges(
                ["coap_requests", "coap_retransmissions", "coap_duplicates"]
                    .map(|name| self.counted(name, n)),
            ),
            downloads: self.account.downloads(
                ["blocks_requested", "blocks_retransmitted", "blocks_duplicated"]
                    .map(|name| self.counted(name, n)),
            ),
            transmissions: self.transmissions(n),
            frames_by_kind: self.frames_by_kind(None),
            routing: self.routing(None, n),
            since_start: self.since_start(n),
            queue_drops: self.queue_drops(n),
            drops_by_reason: self.drops_by_reason(n),
            energy: whole.as_ref().map(energy::Energy::summary),
            energy_since_formation: since.as_ref().map(energy::Energy::summary),
            motes: self.per_mote(n, [whole.as_ref(), since.as_ref()]),
        })
    }

    /// What should be checked before the figures are trusted.
    pub fn warnings(&self) -> Vec<String> {
        let mut warnings = self.account.warnings();
        warnings.extend(self.unequal_ratios());
        warnings.extend(self.parents_out_of_range());
        warnings.extend(self.empty_batteries());
        warnings
    }

    /// Of what was due since the robots started another share was delivered than of all that was sent.
    fn unequal_ratios(&self) -> Option<String> {
        let due = self.delivered_of_expected_since_start(self.motes.alive.len())?.ratio;
        let sent = self.account.delivery(|_| true)?.ratio;
        (MAX_APART < (due - sent).abs()).then(|| {
            format!(
                "{:.1} % of the packets expected since the robots started were delivered, but {:.1} % of those sent in the whole run: motes outside of \
                 the network send nothing, and the second counts what was sent before the start; kpis.since_start.delivered_of_expected is the first",
                100.0 * due,
                100.0 * sent
            )
        })
    }

    /// Motes that have lost their parents.
    fn parents_out_of_range(&self) -> Option<String> {
        let column = self.statistics()?.column("parent_out_of_range")?;
        let is_joined =
            |mote: &usize| self.motes.joined.as_ref().is_some_and(|joined| joined.get(*mote));
        let known: Vec<usize> = self
            .motes
            .alive
            .iter_ones()
            .filter(|mote| is_joined(mote) && column.get(*mote).is_some())
            .collect();
        let lost: Vec<usize> =
            known.iter().copied().filter(|&mote| column.get(mote) == Some(1.0)).collect();
        (MAX_LOST * (known.len() as f64) < lost.len() as f64).then(|| {
            format!(
                "at the end, {} of {} joined motes were out of range of their parents, where their packets cannot arrive ({})",
                lost.len(),
                known.len(),
                listed(&lost)
            )
        })
    }

    /// Motes that ran on with an empty battery. A network whose empty motes fail says of each whether it is empty.
    fn empty_batteries(&self) -> Option<String> {
        let statistics = self.statistics()?;
        if statistics.column("battery_empty").is_some() {
            return None;
        }
        let [charge_uc, battery_mah] =
            [statistics.column("charge_uc")?, statistics.column("battery_mah")?];
        let is_empty = |mote: &usize| {
            let held_uc = battery_mah.get(*mote).map(|mah| mah * UC_PER_MAH);
            !self.is_root(*mote)
                && held_uc.zip(charge_uc.get(*mote)).is_some_and(|(held, drawn)| held <= drawn)
        };
        let motes: Vec<usize> = (0..self.motes.alive.len()).filter(is_empty).collect();
        (!motes.is_empty()).then(|| {
            format!(
                "{} drew more charge than netsim.energy.battery_mah and ran on all the same ({}): set netsim.energy.deaths = \
                 true, and motes with an empty battery fail",
                count_of(motes.len() as u64, "mote"),
                listed(&motes)
            )
        })
    }

    /// Application packets delivered, of all that every mote should have sent while it was alive; `None` where the
    /// applications are not known.
    fn delivered_of_expected(&self, n: usize) -> Option<DeliveredOfExpected> {
        let delivered = self.account.delivery(|_| true).map_or(0, |delivery| delivery.delivered);
        self.of_expected(delivered, (0..n).filter_map(|mote| self.expected(mote, n)).sum())
    }

    /// The same of packets that motes should have sent since robots were free to move.
    fn delivered_of_expected_since_start(&self, n: usize) -> Option<DeliveredOfExpected> {
        let delivered = (0..n).map(|mote| self.moving.ended(mote)[0]).sum();
        let expected = (0..n).filter_map(|mote| self.expected_since_start(mote, n)).sum();
        self.of_expected(delivered, expected)
    }

    fn of_expected(&self, delivered: u64, expected: f64) -> Option<DeliveredOfExpected> {
        let expected = expected as u64;
        let alive: Vec<usize> = self.motes.alive.iter_ones().collect();
        let joined = self.motes.joined.as_ref();
        let n_joined = joined.map(|joined| alive.iter().filter(|&&mote| joined.get(mote)).count());
        (expected != 0).then(|| DeliveredOfExpected {
            delivered,
            expected,
            ratio: delivered as f64 / expected as f64,
            joined_at_end: n_joined,
            alive_at_end: alive.len(),
        })
    }

    /// How many application packets a mote should have sent while it was on.
    fn expected(&self, mote: usize, n: usize) -> Option<f64> {
        let on_s = in_seconds(self.statistic("up_ns", mote)?);
        let expected = self.due(mote, n, on_s)?;
        // Periods begin at random: a mote may have sent one more than fits into its time.
        Some(expected.round().max(self.statistic("packets_created", mote).unwrap_or(0.0)))
    }

    /// How many of them since robots were free to move. At least those that ended, because what some applications send does not
    /// follow from the configuration.
    fn expected_since_start(&self, mote: usize, n: usize) -> Option<f64> {
        let on_s = in_seconds(self.statistic("up_ns", mote)?);
        let before_s = (on_s - self.moving.on_s(mote)).max(0.0);
        let expected = self.due(mote, n, on_s)? - self.due(mote, n, before_s)?;
        Some(expected.round().max(self.moving.ended(mote)[1] as f64))
    }

    /// How many application packets a mote should have sent once it was on for some time (s); `None` where that is unknown.
    fn due(&self, mote: usize, n: usize, on_s: f64) -> Option<f64> {
        let id = u32::try_from(mote).ok().filter(|_| !self.applications.is_empty())?;
        Some(self.applications.expected(id, self.is_root(mote), n, on_s))
    }

    /// The latest value of a statistic of a mote.
    fn statistic(&self, name: &str, mote: usize) -> Option<f64> {
        self.statistics()?.column(name)?.get(mote)
    }

    /// The values of a statistic, of motes for which it is known.
    fn known_values(&self, name: &str, n: usize, with_roots: bool) -> Vec<f64> {
        let column = self.statistics().and_then(|statistics| statistics.column(name));
        (0..n)
            .filter(|&mote| with_roots || !self.is_root(mote))
            .filter_map(|mote| column.and_then(|column| column.get(mote)))
            .collect()
    }

    fn joining(&self, n: usize) -> Joining {
        let join_times = |name: &str| {
            let times = Samples::from_values(self.known_values(name, n, false));
            (!times.is_empty()).then(|| JoinTimes {
                motes: times.len(),
                first_s: times.quantile(0.0).map(in_seconds),
                mean_s: times.mean().map(in_seconds),
                median_s: times.quantile(0.5).map(in_seconds),
                p99_s: times.quantile(0.99).map(in_seconds),
                last_s: times.quantile(1.0).map(in_seconds),
            })
        };
        Joining { synced: join_times("first_synced_ns"), joined: join_times("first_joined_ns") }
    }

    /// What happened while robots were free to move.
    fn since_start(&self, n: usize) -> SinceStart {
        let formed = self.formed.as_ref().map(|(_, formed)| formed);
        let base = formed.filter(|_| self.moving.has_waited);
        let has_started = !self.moving.has_waited || formed.is_some();
        let routing = if has_started { self.routing(base, n) } else { Routing::default() };
        let account = &self.moving.account;
        let has_applications = !self.applications.is_empty() || account.has_applications();
        SinceStart {
            frames_by_kind: self.frames_by_kind(base).filter(|_| has_started),
            delivered_of_expected: self.delivered_of_expected_since_start(n),
            delivery: account.delivery(|_| true),
            delivery_upward: account.delivery(|mote| self.is_root(mote)),
            throughput_bytes_s: self.moving.throughput_bytes_s().filter(|_| has_applications),
            parent_changes: routing.parent_changes,
            churn_per_mote_hour: routing.churn_per_mote_hour,
            joined_ratio: self.moving.joined_ratio(),
        }
    }

    /// Changes of parents, from the beginning or since the report of `since`.
    fn routing(&self, since: Option<&MoteStatistics>, n: usize) -> Routing {
        let counted = |name: &str, with_roots: bool| -> Vec<f64> {
            let column = self.statistics().and_then(|statistics| statistics.column(name));
            let before = |mote: usize| {
                since.map_or(Some(0.0), |since| since.column(name).and_then(|all| all.get(mote)))
            };
            (0..n)
                .filter(|&mote| with_roots || !self.is_root(mote))
                .filter_map(|mote| Some(column?.get(mote)? - before(mote).unwrap_or(0.0)))
                .collect()
        };
        let changes = counted("parent_changes", true);
        let total: f64 = changes.iter().sum();
        let on_h: f64 = counted("up_ns", false).iter().map(|&ns| in_seconds(ns) / 3600.0).sum();
        Routing {
            parent_changes: (!changes.is_empty()).then_some(total),
            churn_per_mote_hour: (!changes.is_empty() && 0.0 < on_h).then(|| total / on_h),
        }
    }

    /// Unicast transmissions of all motes, and how many were acknowledged.
    fn transmissions(&self, n: usize) -> Option<Transmissions> {
        let [unicast, acknowledged] = ["tx_unicast", "tx_acked"].map(|name| self.counted(name, n));
        let (unicast, acknowledged) = unicast.filter(|&unicast| unicast != 0).zip(acknowledged)?;
        let acknowledged_ratio = acknowledged as f64 / unicast as f64;
        Some(Transmissions { unicast, acknowledged, acknowledged_ratio })
    }

    /// Transmissions by what their frames are for, from the beginning or since the report of `since`.
    fn frames_by_kind(
        &self,
        since: Option<&MoteStatistics>,
    ) -> Option<IndexMap<String, FramesOfKind>> {
        let latest = self.statistics()?;
        let sum = |prefix: &str, kind: &str| {
            let name = format!("{prefix}{kind}");
            let all = |statistics: &MoteStatistics| {
                statistics.column(&name).map_or(0.0, |column| column.values.iter().sum::<f64>())
            };
            (all(latest) - since.map_or(0.0, all)) as u64
        };
        let kinds = latest.columns.iter().filter_map(|column| column.name.strip_prefix(SENT));
        let mut of_kinds: IndexMap<String, FramesOfKind> = kinds
            .map(|kind| {
                let [unicast, acknowledged] =
                    ["tx_unicast_", "tx_acked_"].map(|name| sum(name, kind));
                let of_kind = FramesOfKind {
                    transmissions: sum(SENT, kind),
                    share: 0.0,
                    repeated: sum("retransmissions_", kind),
                    unicast,
                    acknowledged,
                    acknowledged_ratio: (unicast != 0)
                        .then(|| acknowledged as f64 / unicast as f64),
                };
                (kind.replace('_', "-"), of_kind)
            })
            .filter(|(_, of_kind)| of_kind.transmissions != 0)
            .collect();
        of_kinds.sort_by_cached_key(|_, of_kind| Reverse(of_kind.transmissions));
        let all: u64 = of_kinds.values().map(|of_kind| of_kind.transmissions).sum();
        for of_kind in of_kinds.values_mut() {
            of_kind.share = of_kind.transmissions as f64 / all as f64;
        }
        (!of_kinds.is_empty()).then_some(of_kinds)
    }

    /// What queues did not keep, of all motes, by reason: packets for which there was no room, and robots' payloads in whose
    /// place came a newer one.
    fn queue_drops(&self, n: usize) -> QueueDrops {
        QueueDrops {
            txqueue_full: self.sum_of("queue_drops", n),
            superseded: self.sum_of("payloads_superseded", n),
        }
    }

    /// The sum of a statistic over all motes; `None` where it is unknown.
    fn sum_of(&self, name: &str, n: usize) -> Option<f64> {
        let of_each = self.known_values(name, n, true);
        (!of_each.is_empty()).then(|| of_each.iter().sum::<f64>())
    }

    /// The sum of a statistic that counts.
    fn counted(&self, name: &str, n: usize) -> Option<u64> {
        self.sum_of(name, n).map(|sum| sum as u64)
    }

    /// What ended at all motes without arriving, by reason; reasons for which nothing did are left out.
    fn drops_by_reason(&self, n: usize) -> Option<IndexMap<String, f64>> {
        let columns = self.statistics().map_or(&[][..], |statistics| &statistics.columns);
        let sums = columns.iter().filter_map(|column| {
            let reason = column.name.strip_prefix(DROPS)?;
            Some((reason.to_owned(), self.known_values(&column.name, n, true).iter().sum::<f64>()))
        });
        let mut sums: IndexMap<String, f64> = sums.collect();
        if sums.is_empty() {
            return None;
        }
        sums.retain(|_, sum| *sum != 0.0);
        Some(sums)
    }

    /// Columns, one entry per mote; a column that nobody has a value in is left out.
    fn per_mote(
        &self,
        n: usize,
        [whole, since_formation]: [Option<&energy::Energy>; 2],
    ) -> IndexMap<String, Vec<Option<f64>>> {
        let mut columns = IndexMap::new();
        let mut add = |name: &str, value: &dyn Fn(usize) -> Option<f64>| {
            let values: Vec<Option<f64>> = (0..n).map(value).collect();
            if values.iter().any(Option::is_some) {
                columns.insert(name.to_owned(), values);
            }
        };
        let statistic = |name: &str, mote: usize| self.statistic(name, mote);
        let of_mote = |mote: usize| self.account.of_mote(mote);
        add("is_root", &|mote| statistic("is_root", mote));
        add("first_synced_s", &|mote| statistic("first_synced_ns", mote).map(in_seconds));
        add("first_joined_s", &|mote| statistic("first_joined_ns", mote).map(in_seconds));
        add("expected", &|mote| self.expected(mote, n));
        add("created", &|mote| statistic("packets_created", mote));
        add("delivered", &|mote| of_mote(mote).map(|packets| packets.delivered as f64));
        add("dropped", &|mote| of_mote(mote).map(|packets| packets.dropped as f64));
        add("delivery_ratio", &|mote| of_mote(mote)?.ratio());
        for reason in self.account.reasons() {
            let name = format!("dropped_{reason}");
            add(&name, &|mote| of_mote(mote).map(|packets| packets.dropped_for(reason) as f64));
        }
        add("mean_latency_s", &|mote| of_mote(mote)?.mean_latency_s());
        for (name, level) in LATENCY_QUANTILES {
            add(name, &|mote| of_mote(mote)?.latency_quantiles_s([level])[0]);
        }
        add("mean_hops", &|mote| of_mote(mote)?.mean_hops());
        add("parent_changes", &|mote| statistic("parent_changes", mote));
        add("queue_drops", &|mote| statistic("queue_drops", mote));
        add("payloads_superseded", &|mote| statistic("payloads_superseded", mote));
        add("charge_uc", &|mote| statistic("charge_uc", mote));
        add("battery_empty", &|mote| statistic("battery_empty", mote));
        for (energy, period) in [(whole, ""), (since_formation, SINCE_FORMATION)] {
            let Some(energy) = energy else { continue };
            let mut add = |name: &str, value: &dyn Fn(usize) -> Option<f64>| {
                add(&format!("{name}{period}"), value);
            };
            add("mean_current_ua", &|mote| energy.current_ua[mote]);
            add("duty_cycle", &|mote| energy.duty_cycle[mote]);
            add("lifetime_years", &|mote| {
                energy.current_ua[mote]
                    .filter(|_| !self.is_root(mote))
                    .and_then(|current_ua| energy.lifetime_years(current_ua))
            });
        }
        columns
    }
}

/// Columns of motes: the latencies of a mote's application packets.
pub const LATENCY_QUANTILES: [(&str, f64); 4] = [
    ("median_latency_s", 0.5),
    ("p95_latency_s", 0.95),
    ("p99_latency_s", 0.99),
    ("max_latency_s", 1.0),
];
/// What names of a mote's columns end with that are of the time since the network had formed.
pub const SINCE_FORMATION: &str = "_since_formation";
/// How far the two ratios of delivery may be apart without a word.
const MAX_APART: f64 = 0.05;
/// Which share of joined motes may be out of range of their parents without a word: links come and go.
const MAX_LOST: f64 = 0.05;
/// A milliampere-hour (µC).
const UC_PER_MAH: f64 = 3.6e6;
/// Most motes that a sentence lists.
const MAX_LISTED: usize = 8;
/// What names of statistics begin with that say what ended at a mote; the reason follows.
const DROPS: &str = "drops_";
/// What names of statistics begin with that count transmissions of one kind of frames; the kind follows.
const SENT: &str = "tx_frames_";

fn formation(formation: &Formation) -> FormationSummary {
    FormationSummary {
        formed: formation.formed_ns.is_some(),
        formed_s: formation.formed_ns.map(seconds),
        missing: formation.missing.len(),
        missing_by_reason: formation
            .by_reason()
            .map(|(words, motes)| (words.to_owned(), motes))
            .collect(),
    }
}

/// Numbers of motes in words: `mote 3`, `motes 3, 5`; of many the first, and how many follow.
pub fn listed(motes: &[usize]) -> String {
    let shown: Vec<String> = motes.iter().take(MAX_LISTED).map(usize::to_string).collect();
    let rest = motes.len().saturating_sub(MAX_LISTED);
    let more = if rest == 0 { String::new() } else { format!(" and {rest} more") };
    format!("mote{} {}{more}", if motes.len() == 1 { "" } else { "s" }, shown.join(", "))
}

fn in_seconds(ns: f64) -> f64 {
    ns / 1e9
}

#[cfg(test)]
mod tests;
