//! Figures over time, of any number of steps in few points.

use crate::view;
use metrics::period::Period;
use metrics::swarm::velocities;
use proto::types::seconds;
use std::collections::BTreeMap;

/// A series is kept in at most so many points.
pub(crate) const MOST_POINTS: usize = 2000;

/// A figure: its name, what people call it, its unit.
type Figure = (&'static str, &'static str, &'static str);

const ALIVE: Figure = ("n_alive", "Robots alive", "");
const NEIGHBOURS: Figure = ("mean_neighbours", "Neighbours heard per robot", "");
const ISOLATED: Figure = ("n_isolated", "Robots that heard nobody", "");
const SENT: Figure = ("n_sent", "Frames sent per step", "");
const DELIVERIES: Figure = ("n_deliveries", "Deliveries per step", "");
const FLOCK_SPEED: Figure = ("flock_speed_mps", "Speed of the swarm's mean motion", "m/s");
const CENTRE_DISTANCE: Figure = ("centre_distance_m", "Mean distance to the swarm's centre", "m");
const JOINED: Figure = ("n_joined", "Motes joined", "");
const QUEUE: Figure = ("mean_queue", "Packets waiting per mote", "");
const DELIVERED: Figure = ("packets_delivered", "Packets delivered per step", "");
const DROPPED: Figure = ("packets_dropped", "Packets dropped per step", "");

/// Means of figures over spans of equally many steps. When there are too many points, neighbours become one.
#[derive(Clone, Debug)]
pub(crate) struct SeriesBuilder {
    most: usize,
    /// Steps per point.
    stride: u64,
    n_in_point: u64,
    time_s: Vec<f64>,
    figures: BTreeMap<String, Mean>,
    order: Vec<(String, String, &'static str)>,
}

/// The means of a figure, and the sum of the point that is not complete.
#[derive(Clone, Debug, Default)]
struct Mean {
    points: Vec<f64>,
    sum: f64,
    n: u64,
}

impl SeriesBuilder {
    /// Begins empty.
    pub(crate) fn new(most: usize) -> Self {
        Self {
            most,
            stride: 1,
            n_in_point: 0,
            time_s: Vec::new(),
            figures: BTreeMap::new(),
            order: Vec::new(),
        }
    }

    /// Adds the figures of a period.
    pub(crate) fn add(&mut self, period: &Period<'_>, task: &[(String, f64)]) {
        self.robots(period);
        self.network(period);
        for (name, value) in task {
            self.figure(name, || (name.replace('_', " "), ""), *value);
        }
        self.n_in_point += 1;
        if self.n_in_point == self.stride && self.most != usize::MAX {
            self.close_point(period.time_ns);
            // One more point may follow, of steps that do not fill it.
            if self.most <= self.time_s.len() {
                self.halve();
            }
        }
    }

    /// All series so far, with a last point that covers fewer steps.
    pub(crate) fn series(&self, time_ns: u64) -> Vec<view::Series> {
        let mut whole = self.clone();
        if 0 < whole.n_in_point {
            whole.close_point(time_ns);
        }
        let Self { time_s, figures, order, .. } = whole;
        let series = order.into_iter().map(|(name, label, unit)| view::Series {
            value: figures[&name].points.clone(),
            name,
            label,
            unit: unit.to_owned(),
            time_s: time_s.clone(),
        });
        series.collect()
    }

    /// Takes one point over all that was added since one was last taken; for series of which points are taken in no other way.
    pub(crate) fn take_point(&mut self, time_ns: u64) -> Vec<view::Series> {
        if self.n_in_point == 0 {
            return Vec::new();
        }
        self.time_s.clear();
        self.figures.values_mut().for_each(|figure| figure.points.clear());
        self.close_point(time_ns);
        self.series(time_ns)
    }

    fn robots(&mut self, period: &Period<'_>) {
        let states = period.states;
        let alive: Vec<usize> = states.alive.iter_ones().collect();
        let n = alive.len();
        self.named(ALIVE, n as f64);
        let heard = alive.iter().map(|&agent| period.counts.neighbours[agent]);
        self.named(NEIGHBOURS, heard.clone().map(f64::from).sum::<f64>() / n as f64);
        self.named(ISOLATED, heard.filter(|n| *n == 0).count() as f64);
        self.named(SENT, period.deliveries.transmissions.len() as f64);
        self.named(DELIVERIES, period.counts.n_deliveries as f64);
        let mean = |of: &dyn Fn(usize) -> [f64; 3]| -> [f64; 3] {
            let mut sum = [0.0; 3];
            for place in 0..n {
                let value = of(place);
                for axis in 0..3 {
                    sum[axis] += value[axis] / n as f64;
                }
            }
            sum
        };
        let norm = |[x, y, z]: [f64; 3]| libm::sqrt(x * x + y * y + z * z);
        let velocities = velocities(period, &alive);
        self.named(FLOCK_SPEED, norm(mean(&|place| velocities[place])));
        let centre = mean(&|place| states.position_m(alive[place]));
        let away = alive.iter().map(|&agent| {
            let at = states.position_m(agent);
            norm([at[0] - centre[0], at[1] - centre[1], at[2] - centre[2]])
        });
        self.named(CENTRE_DISTANCE, away.sum::<f64>() / n as f64);
    }

    fn network(&mut self, period: &Period<'_>) {
        let motes = period.motes;
        if let Some(joined) = &motes.joined {
            self.named(JOINED, joined.count() as f64);
        }
        if !motes.queue_length.is_empty() {
            let working = motes.alive.iter_ones();
            let waiting = working.map(|mote| f64::from(motes.queue_length[mote])).sum::<f64>();
            self.named(QUEUE, waiting / motes.alive.count() as f64);
        }
        if let Some(packets) = period.packets {
            let n_dropped = packets.outcome.iter().filter(|outcome| **outcome != 0).count();
            self.named(DELIVERED, (packets.outcome.len() - n_dropped) as f64);
            self.named(DROPPED, n_dropped as f64);
        }
    }

    fn named(&mut self, (name, label, unit): Figure, value: f64) {
        self.figure(name, || (label.to_owned(), unit), value);
    }

    fn figure(&mut self, name: &str, words: impl FnOnce() -> (String, &'static str), value: f64) {
        if !self.figures.contains_key(name) {
            let (label, unit) = words();
            self.order.push((name.to_owned(), label, unit));
            // It was not known before.
            let points = vec![f64::NAN; self.time_s.len()];
            self.figures.insert(name.to_owned(), Mean { points, ..Mean::default() });
        }
        if value.is_finite()
            && let Some(figure) = self.figures.get_mut(name)
        {
            figure.sum += value;
            figure.n += 1;
        }
    }

    fn close_point(&mut self, time_ns: u64) {
        self.time_s.push(seconds(time_ns));
        for figure in self.figures.values_mut() {
            figure.points.push(figure.sum / figure.n as f64);
            (figure.sum, figure.n) = (0.0, 0);
        }
        self.n_in_point = 0;
    }

    /// Makes one point of every two; an odd last one becomes the beginning of the next.
    fn halve(&mut self) {
        let odd = self.time_s.len() % 2 == 1;
        if odd {
            self.time_s.pop();
        }
        self.time_s = self.time_s.chunks_exact(2).map(|pair| pair[1]).collect();
        for figure in self.figures.values_mut() {
            if odd
                && let Some(last) = figure.points.pop()
                && last.is_finite()
            {
                figure.sum = last * self.stride as f64;
                figure.n = self.stride;
            }
            let means = figure.points.chunks_exact(2).map(|pair| match (pair[0], pair[1]) {
                (a, b) if a.is_nan() => b,
                (a, b) if b.is_nan() => a,
                (a, b) => 0.5 * (a + b),
            });
            figure.points = means.collect();
        }
        self.n_in_point = if odd { self.stride } else { 0 };
        self.stride *= 2;
    }
}
