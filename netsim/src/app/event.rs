//! `event`: something happens at a place, and the motes around it report it.
//!
//! Events are the same for all motes: [`Events`] is a part of the network, which knows where everybody is. An event at time t
//! concerns the motes that are within the radius of its place then. Each of them sends its packets at t, t + s, t + 2s, …
//!
//! E events whose radius covers k senders each make exactly E k `n_packets` packets, if all are ready for as long.

use super::config::Largest;
use super::sender::{Sender, SenderKeys, ns};
use super::stream::exponential_ns;
use super::{Context, Host, Machine, Packet, Reading, Spec, Traffic};
use proto::config::{Problem, Range, Section, Variant, join, variant};
use proto::rng::{Draws, Purpose, uniform};
use serde::{Deserialize, Serialize};
use std::collections::VecDeque;

/// When events occur.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Times {
    /// At these times from the start of the experiment (ns), ascending.
    Listed(Vec<u64>),
    /// A Poisson process for the whole network, with this mean interval (ns).
    Poisson(u64),
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
    spacing_ns: u64,
    is_ready: bool,
    /// Bursts that have not ended: when the next packet is due (ns), and how many are left.
    bursts: VecDeque<(u64, u32)>,
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
    /// `n_packets` (at least 1) of each concerned mote, so far (ns) apart.
    #[must_use]
    pub fn new(
        sender: Sender,
        occurrence: Option<(Times, Area)>,
        n_packets: u32,
        spacing_ns: u64,
    ) -> Self {
        let bursts = VecDeque::new();
        Self { sender, occurrence, n_packets, spacing_ns, is_ready: false, bursts }
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
                let mut at_ns: Vec<u64> = at_s.into_iter().map(ns).collect();
                at_ns.sort_unstable();
                Times::Listed(at_ns)
            }
            (None, mean_s) => Times::Poisson(ns(mean_s.unwrap_or(MEAN_INTERVAL_S))),
        };
        let area = Area { place_m: keys.place_m, radius_m: keys.radius_m };
        let sender = Sender::of(keys.sender, reading)?;
        Some(Self::new(sender, Some((times, area)), keys.n_packets, ns(keys.spacing_s)))
    }

    fn assigned(&self, host: &Host) -> Option<Self> {
        Some(Self::new(self.sender.assigned(host)?, None, self.n_packets, self.spacing_ns))
    }

    fn largest(&self) -> Largest {
        self.sender.largest()
    }
}

impl Traffic for Event {
    fn set_ready(&mut self, is_ready: bool, _: &mut Context<'_>) {
        self.is_ready = is_ready;
    }

    fn poll_timeout(&self) -> Option<u64> {
        self.bursts.iter().map(|&(due_ns, _)| due_ns).min()
    }

    /// Packets that are due while the mote may not send do not exist.
    fn handle_timeout(&mut self, cx: &mut Context<'_>) -> Option<Packet> {
        let place = self.next_burst()?;
        let (due_ns, n_left) = &mut self.bursts[place];
        *due_ns += self.spacing_ns;
        *n_left -= 1;
        if *n_left == 0 {
            self.bursts.remove(place);
        }
        self.is_ready.then(|| self.sender.packet(cx.now_ns, cx.dice))
    }

    fn handle_event(&mut self, at_ns: u64) {
        self.bursts.push_back((at_ns, self.n_packets));
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
    /// When (ns).
    pub at_ns: u64,
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
    /// When the next one occurs (ns), if one does.
    next_ns: Option<u64>,
    /// How many have occurred.
    n_past: u64,
}

impl Source {
    /// When the next event occurs, after one at `since_ns`.
    fn after(&self, since_ns: u64, seed: u64) -> Option<u64> {
        match &self.times {
            Times::Listed(at_ns) => at_ns.get(usize::try_from(self.n_past).ok()?).copied(),
            Times::Poisson(mean_ns) => {
                let draws = Draws::new(seed, Purpose::TrafficEvent);
                let u = uniform(draws.words(u64::from(self.app), 0, self.n_past)[0]);
                Some(since_ns + exponential_ns(u, *mean_ns))
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
                let mut source = Source { app, times, area, next_ns: None, n_past: 0 };
                source.next_ns = source.after(0, seed);
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

    /// When the next event occurs (ns).
    #[must_use]
    pub fn next_ns(&self) -> Option<u64> {
        self.0.iter().filter_map(|source| source.next_ns).min()
    }

    /// The next event, if it has occurred by `now_ns`. Ask until there is none.
    pub fn take(&mut self, now_ns: u64, seed: u64) -> Option<Occurrence> {
        let is_due = |source: &&mut Source| source.next_ns.is_some_and(|at_ns| at_ns <= now_ns);
        let source = self.0.iter_mut().filter(is_due).min_by_key(|source| source.next_ns)?;
        let at_ns = source.next_ns?;
        let draws = Draws::new(seed, Purpose::TrafficEvent);
        let [_, x, y, _] = draws.words(u64::from(source.app), 0, source.n_past);
        source.n_past += 1;
        source.next_ns = source.after(at_ns, seed);
        let at_random = [uniform(x), uniform(y)];
        Some(Occurrence { app: source.app, at_ns, area: source.area, at_random })
    }
}
