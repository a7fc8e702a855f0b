//! The whole run at a glance.

use crate::events::EventFinder;
use crate::run::site_of;
use crate::series::{Figures, Means, SeriesBuilder};
use crate::view;
use metrics::Task;
use metrics::period::Period;
use proto::exchange::Configured;
use proto::types::{MoteStatistics, Packets, Schedule};
use record::StepRecord;

/// So many samples of statistics are kept.
const MOST_STATISTICS: usize = 200;
/// So many packets are listed of those that were dropped, and of those that were delivered.
const MOST_PACKETS: usize = 50_000;

/// Gathers what an overview holds.
pub struct OverviewBuilder {
    /// What the robots are to do.
    task: Task,
    events: EventFinder,
    found: Vec<view::Event>,
    series: SeriesBuilder,
    until_ns: u64,
    schedules: Vec<(u64, Schedule)>,
    statistics: Vec<(u64, MoteStatistics)>,
    /// Of so many samples, one is kept.
    statistics_stride: usize,
    n_statistics: usize,
    packets: Option<Packets>,
    n_listed: [usize; 2],
    packets_left_out: u64,
}

impl OverviewBuilder {
    /// Begins where a run does.
    #[must_use]
    pub fn new(configured: &Configured) -> Self {
        let start = &configured.network_start;
        let task = Task::from_config(&configured.robots_start.effective_toml);
        let alive = &configured.robots_start.states.alive;
        let site = site_of(configured);
        Self {
            events: EventFinder::new(task.clone(), &site, alive, start.motes.as_ref()),
            task,
            found: Vec::new(),
            series: SeriesBuilder::new(),
            until_ns: 0,
            schedules: Vec::new(),
            statistics: start.statistics.iter().map(|first| (0, first.clone())).collect(),
            statistics_stride: 1,
            n_statistics: 0,
            packets: None,
            n_listed: [0; 2],
            packets_left_out: 0,
        }
    }

    /// Adds a step and its period.
    pub fn add(&mut self, record: &StepRecord, period: &Period<'_>) {
        self.add_with(record, period, &Figures::of(&self.task, record, period));
    }

    /// [`add`](Self::add) where the figures of the step are at hand.
    pub(crate) fn add_with(&mut self, record: &StepRecord, period: &Period<'_>, figures: &Figures) {
        self.events.orders(period, &record.commands, &[]);
        let applied = &record.network.applied_commands;
        self.events.orders(period, applied, &record.robots.applied_commands);
        self.events.add(period);
        self.found.append(&mut self.events.take());
        self.series.add(period.time_ns, figures);
        self.until_ns = period.time_ns;
        if let Some(schedule) = period.schedule {
            self.schedules.push((period.time_ns, schedule.clone()));
        }
        if let Some(statistics) = period.statistics {
            self.statistics(period.time_ns, statistics);
        }
        if let Some(packets) = period.packets {
            self.packets(packets);
        }
    }

    /// All so far.
    #[must_use]
    pub fn overview(&self, complete: bool) -> view::Overview {
        view::Overview {
            events: self.found.clone(),
            series: self.series.series(self.until_ns),
            until_ns: self.until_ns,
            complete,
            schedules: self.schedules.iter().map(schedule_at).collect(),
            statistics: self.statistics.iter().map(statistics_at).collect(),
            packets: self.packets.clone().map(Into::into),
            packets_left_out: self.packets_left_out,
        }
    }

    fn statistics(&mut self, time_ns: u64, statistics: &MoteStatistics) {
        self.n_statistics += 1;
        if !self.n_statistics.is_multiple_of(self.statistics_stride) {
            return;
        }
        self.statistics.push((time_ns, statistics.clone()));
        if MOST_STATISTICS < self.statistics.len() {
            let mut index = 0;
            self.statistics.retain(|_| {
                index += 1;
                index % 2 == 1
            });
            self.statistics_stride *= 2;
        }
    }

    fn packets(&mut self, more: &Packets) {
        let packets = self.packets.get_or_insert_default();
        let is_listed = |outcome: u32, n_listed: &mut [usize; 2]| {
            let listed = &mut n_listed[usize::from(outcome != 0)];
            *listed += 1;
            *listed <= MOST_PACKETS
        };
        let kept: Vec<bool> =
            more.outcome.iter().map(|outcome| is_listed(*outcome, &mut self.n_listed)).collect();
        let n_kept = kept.iter().filter(|kept| **kept).count();
        self.packets_left_out += (kept.len() - n_kept) as u64;
        if n_kept == kept.len() {
            packets.append(more);
        } else {
            let mut kept = kept.into_iter();
            packets.append(&more.filtered(|_| kept.next().unwrap_or(false)));
        }
    }
}

/// What was added to an overview since it was last asked for.
#[derive(Default)]
pub(crate) struct Additions {
    figures: Means,
    n_events: usize,
    n_schedules: usize,
    statistics_ns: u64,
    n_packets: usize,
}

impl Additions {
    /// Adds the figures of a step, which was or will be added to the overview.
    pub(crate) fn add(&mut self, figures: &Figures) {
        self.figures.add(figures);
    }

    /// What was added to `whole` since this was last called; `None`: no step.
    pub(crate) fn take(&mut self, whole: &OverviewBuilder) -> Option<view::Overview> {
        let series = self.figures.take_point(whole.until_ns);
        if series.is_empty() {
            return None;
        }
        let is_new = |(time_ns, _): &&(u64, MoteStatistics)| self.statistics_ns < *time_ns;
        let packets = whole.packets.as_ref().filter(|packets| self.n_packets < packets.len());
        let added = view::Overview {
            events: whole.found[self.n_events..].to_vec(),
            series,
            until_ns: whole.until_ns,
            complete: false,
            schedules: whole.schedules[self.n_schedules..].iter().map(schedule_at).collect(),
            statistics: whole.statistics.iter().filter(is_new).map(statistics_at).collect(),
            packets: packets
                .map(|packets| packets.filtered(|index| self.n_packets <= index).into()),
            packets_left_out: whole.packets_left_out,
        };
        self.n_events = whole.found.len();
        self.n_schedules = whole.schedules.len();
        self.statistics_ns = whole.until_ns;
        self.n_packets = whole.packets.as_ref().map_or(0, Packets::len);
        Some(added)
    }
}

fn schedule_at((time_ns, schedule): &(u64, Schedule)) -> view::ScheduleAt {
    view::ScheduleAt { time_ns: *time_ns, schedule: Some(schedule.clone().into()) }
}

fn statistics_at((time_ns, statistics): &(u64, MoteStatistics)) -> view::StatisticsAt {
    view::StatisticsAt { time_ns: *time_ns, statistics: Some(statistics.clone().into()) }
}
