//! `event`: something happens at a place, and the motes around it report it.
//!
//! Events are the same for all motes: [`Events`] is a part of the network, which knows where everybody is. An event at time t
//! concerns the motes that are within the radius of its place then. Each of them sends its packets at t, t + s, t + 2s, …
//!
//! E events whose radius covers k senders each make exactly E k `n_packets` packets, if all are ready for as long.

use super::config::Largest;
use super::sender::{Sender, SenderKeys};
use super::stream::exponential;
use super::{Context, Host, Machine, Packet, Reading, Spec, Traffic};
use proto::config::{Problem, Range, Section, Variant, join, variant};
use proto::rng::{Draws, Purpose, uniform};
use proto::time::{SimDuration, SimTime};
use serde::{Deserialize, Serialize};
use std::collections::VecDeque;

/// When events occur.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Times {
    /// At these times from the start of the experiment, ascending.
    Listed(Vec<SimTime>),
    /// A Poisson process for the whole network, with this mean interval.
    Poisson(SimDuration),
}

/// Where events occur, and whom they concern.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Area {
    /// Place of all events (m); `None`: uniform in the rectangle around all motes.
    pub place_m: Option<[f64; 2]>,
    /// Motes within this horizontal distance (m) report; `None`: all senders.
    pub radius_m: Option<f64>,
}

/// Bursts of packets at events.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Event {
    sender: Sender,
    /// Before it is assigned to a mote; after that, the network has it: see [`Events`].
    occurrence: Option<(Times, Area)>,
    /// At least 1.
    n_packets: u32,
    spacing: SimDuration,
    is_ready: bool,
    /// Bursts that have not ended: when the next packet is due, and how many are left.
    bursts: VecDeque<(SimTime, u32)>,
}

/// Bursts on events: at each event, the motes near its place report it. Event times are the same for all motes.
#[derive(Section)]
struct Keys {
    /// Times of the events from the start of the experiment (s). Excludes mean_interval_s.
    #[key(range = 0.0..=1e6, length = 1..=100_000)]
    at_s: Option<Vec<f64>>,
    /// Mean time between two events (s), a Poisson process for the whole network. Absent without at_s: 600 s.
    #[key(range = 1e-3..=1e6)]
    mean_interval_s: Option<f64>,
    /// Place of all events, x and y (m). Absent: for each event a random place, uniform in the rectangle around all motes at that
    /// time.
    #[key(range = Range::PLACE)]
    place_m: Option<[f64; 2]>,
    /// Senders within this horizontal distance of the event report it (m). Absent: all senders.
    #[key(range = Range::LENGTH)]
    radius_m: Option<f64>,
    /// Packets that each mote sends per event.
    #[key(range = 1..=10_000, default = 1)]
    n_packets: u32,
    /// Time between two of these packets (s).
    #[key(range = 0.0..=1e6, default = 1.0)]
    spacing_s: f64,
    #[key(flatten)]
    sender: SenderKeys,
}

/// Mean time between two events by default (s).
const MEAN_INTERVAL_S: f64 = 600.0;

impl Event {
    /// `n_packets` (at least 1) of each concerned mote, so far apart.
    #[must_use]
    pub fn new(
        sender: Sender,
        occurrence: Option<(Times, Area)>,
        n_packets: u32,
        spacing: SimDuration,
    ) -> Self {
        let bursts = VecDeque::new();
        Self { sender, occurrence, n_packets, spacing, is_ready: false, bursts }
    }

    fn next_burst(&self) -> Option<usize> {
        (0..self.bursts.len()).min_by_key(|&place| self.bursts[place].0)
    }
}

impl super::Kind for Event {
    const VARIANT: Variant = variant::<Keys>("event");

    fn read(reading: &mut Reading<'_>) -> Option<Self> {
        let keys = Keys::read(reading.table);
        let times = match (keys.at_s, keys.mean_interval_s) {
            (Some(_), Some(mean_s)) => {
                let path = join(reading.path, "mean_interval_s");
                let message = "must be absent where at_s lists the times of the events";
                reading.problems.push(Problem::new(path, message).value(mean_s));
                return None;
            }
            (Some(at_s), None) => {
                let mut at: Vec<SimTime> = at_s
                    .into_iter()
                    .map(|at_s| SimTime::START + SimDuration::from_seconds(at_s))
                    .collect();
                at.sort_unstable();
                Times::Listed(at)
            }
            (None, mean_s) => {
                Times::Poisson(SimDuration::from_seconds(mean_s.unwrap_or(MEAN_INTERVAL_S)))
            }
        };
        let area = Area { place_m: keys.place_m, radius_m: keys.radius_m };
        let sender = Sender::of(keys.sender, reading)?;
        Some(Self::new(
            sender,
            Some((times, area)),
            keys.n_packets,
            SimDuration::from_seconds(keys.spacing_s),
        ))
    }

    fn assigned(&self, host: &Host) -> Option<Self> {
        Some(Self::new(self.sender.assigned(host)?, None, self.n_packets, self.spacing))
    }

    fn largest(&self) -> Largest {
        self.sender.largest()
    }
}

impl Traffic for Event {
    fn set_ready(&mut self, is_ready: bool, _: &mut Context<'_>) {
        self.is_ready = is_ready;
    }

    fn poll_timeout(&self) -> Option<SimTime> {
        self.bursts.iter().map(|&(due, _)| due).min()
    }

    /// Packets that are due while the mote may not send do not exist.
    fn handle_timeout(&mut self, cx: &mut Context<'_>) -> Option<Packet> {
        let place = self.next_burst()?;
        let (due, n_left) = &mut self.bursts[place];
        *due += self.spacing;
        *n_left -= 1;
        if *n_left == 0 {
            self.bursts.remove(place);
        }
        self.is_ready.then(|| self.sender.packet(cx.now, cx.dice))
    }

    fn handle_event(&mut self, at: SimTime) {
        self.bursts.push_back((at, self.n_packets));
    }

    fn reset(&mut self, _: &mut Context<'_>) {
        self.bursts.clear();
    }
}

/// An event that occurs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Occurrence {
    /// Number of the application.
    pub app: u32,
    /// When.
    pub at: SimTime,
    /// Whom it concerns.
    pub area: Area,
    /// Two uniform numbers in [0, 1), for a random place.
    pub at_random: [f64; 2],
}

impl Occurrence {
    /// Which of the motes at these places it concerns: `concerns[i]` for `places_m[i]`; a mote without a place is not concerned,
    /// unless everybody is.
    #[must_use]
    pub fn concerned(&self, places_m: &[Option<[f64; 3]>]) -> Vec<bool> {
        let Some(radius_m) = self.area.radius_m else { return vec![true; places_m.len()] };
        let place_m = self.area.place_m.unwrap_or_else(|| self.random_place_m(places_m));
        let is_near = |at: &Option<[f64; 3]>| {
            at.is_some_and(|[x, y, _]| {
                let [dx, dy] = [x - place_m[0], y - place_m[1]];
                dx * dx + dy * dy <= radius_m * radius_m
            })
        };
        places_m.iter().map(is_near).collect()
    }

    fn random_place_m(&self, places_m: &[Option<[f64; 3]>]) -> [f64; 2] {
        [0, 1].map(|axis| {
            let along = places_m.iter().flatten().map(|place| place[axis]);
            let (low, high) =
                along.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| (l.min(x), h.max(x)));
            if low < high { low + (high - low) * self.at_random[axis] } else { low }
        })
    }
}

/// The events of all applications of kind `event` to come.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Events(Vec<Source>);

/// The events of one application.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct Source {
    app: u32,
    times: Times,
    area: Area,
    /// When the next one occurs, if one does.
    next: Option<SimTime>,
    /// How many have occurred.
    n_past: u64,
}

impl Source {
    /// When the next event occurs, after one at `since`.
    fn after(&self, since: SimTime, seed: u64) -> Option<SimTime> {
        match &self.times {
            Times::Listed(at) => at.get(usize::try_from(self.n_past).ok()?).copied(),
            Times::Poisson(mean) => {
                let draws = Draws::new(seed, Purpose::TrafficEvent);
                let u = uniform(draws.words(u64::from(self.app), 0, self.n_past)[0]);
                Some(since + exponential(u, *mean))
            }
        }
    }
}

impl Events {
    /// The events of these applications.
    #[must_use]
    pub fn new(specs: &[Spec], seed: u64) -> Self {
        let sources = (0..).zip(specs).filter_map(|(app, spec)| match &spec.machine {
            Machine::Event(Event { occurrence: Some((times, area)), .. }) => {
                let (times, area) = (times.clone(), *area);
                let mut source = Source { app, times, area, next: None, n_past: 0 };
                source.next = source.after(SimTime::START, seed);
                Some(source)
            }
            _ => None,
        });
        Self(sources.collect())
    }

    /// Whether they are those of these applications.
    #[must_use]
    pub(crate) fn is_of(&self, specs: &[Spec]) -> bool {
        let apps = |events: &Self| events.0.iter().map(|source| source.app).collect::<Vec<_>>();
        apps(self) == apps(&Self::new(specs, 0))
    }

    /// When the next event occurs.
    #[must_use]
    pub fn next(&self) -> Option<SimTime> {
        self.0.iter().filter_map(|source| source.next).min()
    }

    /// The next event, if it has occurred by `now`. Ask until there is none.
    pub fn take(&mut self, now: SimTime, seed: u64) -> Option<Occurrence> {
        let is_due = |source: &&mut Source| source.next.is_some_and(|at| at <= now);
        let source = self.0.iter_mut().filter(is_due).min_by_key(|source| source.next)?;
        let at = source.next?;
        let draws = Draws::new(seed, Purpose::TrafficEvent);
        let [_, x, y, _] = draws.words(u64::from(source.app), 0, source.n_past);
        source.n_past += 1;
        source.next = source.after(at, seed);
        let at_random = [uniform(x), uniform(y)];
        Some(Occurrence { app: source.app, at, area: source.area, at_random })
    }
}
