//! Figures over time, of any number of steps in few points.

use crate::view;
use metrics::Task;
use metrics::period::Period;
use metrics::swarm::{along_leader_mps, velocities};
use proto::types::{TaskFigure, seconds};
use record::StepRecord;
use std::borrow::Cow;

/// A series is kept in at most so many points.
const MOST_POINTS: usize = 2000;

/// A figure: its name, what people call it, its unit.
type Label = (&'static str, &'static str, &'static str);

const ALIVE: Label = ("n_alive", "Robots alive", "");
const NEIGHBOURS: Label = ("mean_neighbours", "Neighbours heard per robot", "");
const ISOLATED: Label = ("n_isolated", "Robots that heard nobody", "");
const SENT: Label = ("n_sent", "Frames sent per step", "");
const DELIVERIES: Label = ("n_deliveries", "Deliveries per step", "");
const ALONG_LEADER: Label = ("speed_along_leader_mps", "Speed along the leader's direction", "m/s");
const FLOCK_SPEED: Label = ("flock_speed_mps", "Speed of the swarm's mean motion", "m/s");
const CENTRE_DISTANCE: Label = ("centre_distance_m", "Mean distance to the swarm's centre", "m");
const JOINED: Label = ("n_joined", "Motes joined", "");
const QUEUE: Label = ("mean_queue", "Packets waiting per mote", "");
const DELIVERED: Label = ("packets_delivered", "Packets delivered per step", "");
const DROPPED: Label = ("packets_dropped", "Packets dropped per step", "");

/// A figure of a step.
#[derive(Clone, Debug)]
pub(crate) struct Figure {
    name: Cow<'static, str>,
    label: Cow<'static, str>,
    unit: &'static str,
    value: f64,
}

/// The figures of a step.
#[derive(Clone, Debug, Default)]
pub(crate) struct Figures(Vec<Figure>);

impl Figures {
    /// Those of a period, and those in which the robots report how far their task is.
    pub(crate) fn of(task: &Task, record: &StepRecord, period: &Period<'_>) -> Self {
        let mut figures = Self::default();
        figures.robots(task, period);
        figures.network(period);
        for TaskFigure { name, value } in &record.robots.figures {
            let (label, name) = (name.replace('_', " "), name.clone());
            figures.0.push(Figure {
                name: name.into(),
                label: label.into(),
                unit: "",
                value: *value,
            });
        }
        figures
    }

    fn robots(&mut self, task: &Task, period: &Period<'_>) {
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
        if task.leader.is_some() {
            let along_mps = along_leader_mps(task, &alive, &velocities);
            self.named(ALONG_LEADER, along_mps.unwrap_or(f64::NAN));
        }
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

    fn named(&mut self, (name, label, unit): Label, value: f64) {
        self.0.push(Figure { name: name.into(), label: label.into(), unit, value });
    }
}

/// Means of figures since they were last taken.
#[derive(Clone, Debug, Default)]
pub(crate) struct Means {
    n_steps: u64,
    figures: Vec<Mean>,
}

#[derive(Clone, Debug)]
struct Mean {
    /// Its value is the sum of those that are finite.
    sum: Figure,
    n: u64,
}

impl Means {
    /// Adds the figures of a step.
    pub(crate) fn add(&mut self, Figures(figures): &Figures) {
        self.n_steps += 1;
        for (place, figure) in figures.iter().enumerate() {
            // Steps have the same figures, but for few.
            let is_same = |mean: &Mean| mean.sum.name == figure.name;
            let known = match self.figures.get(place) {
                Some(mean) if is_same(mean) => Some(place),
                _ => self.figures.iter().position(is_same),
            };
            let place = known.unwrap_or_else(|| {
                self.figures.push(Mean { sum: Figure { value: 0.0, ..figure.clone() }, n: 0 });
                self.figures.len() - 1
            });
            if figure.value.is_finite() {
                self.figures[place].sum.value += figure.value;
                self.figures[place].n += 1;
            }
        }
    }

    /// The mean of each figure, NaN where no step had a value, and begins anew.
    fn take(&mut self) -> impl Iterator<Item = f64> {
        self.n_steps = 0;
        self.figures.iter_mut().map(|mean| {
            let (sum, n) = (mean.sum.value, mean.n);
            (mean.sum.value, mean.n) = (0.0, 0);
            sum / n as f64
        })
    }

    /// The means as one point of each series; none if no step was added.
    pub(crate) fn take_point(&mut self, time_ns: u64) -> Vec<view::Series> {
        if self.n_steps == 0 {
            return Vec::new();
        }
        let means: Vec<f64> = self.take().collect();
        let point =
            |(mean, value): (&Mean, f64)| mean.sum.series(vec![seconds(time_ns)], vec![value]);
        self.figures.iter().zip(means).map(point).collect()
    }
}

impl Figure {
    fn series(&self, time_s: Vec<f64>, value: Vec<f64>) -> view::Series {
        view::Series {
            name: self.name.clone().into_owned(),
            label: self.label.clone().into_owned(),
            unit: self.unit.to_owned(),
            time_s,
            value,
        }
    }
}

/// Means of figures over spans of equally many steps. When there are too many points, neighbours become one.
#[derive(Clone, Debug)]
pub(crate) struct SeriesBuilder {
    /// Steps per point.
    stride: u64,
    /// The point that is not complete.
    open: Means,
    time_s: Vec<f64>,
    /// Points of each figure, in the order of `open`.
    points: Vec<Vec<f64>>,
}

impl SeriesBuilder {
    /// Begins empty.
    pub(crate) fn new() -> Self {
        Self { stride: 1, open: Means::default(), time_s: Vec::new(), points: Vec::new() }
    }

    /// Adds the figures of the step that ended at `time_ns`.
    pub(crate) fn add(&mut self, time_ns: u64, figures: &Figures) {
        self.open.add(figures);
        if self.open.n_steps == self.stride {
            self.close_point(time_ns);
            // One more point may follow, of steps that do not fill it.
            if MOST_POINTS <= self.time_s.len() {
                self.halve();
            }
        }
    }

    /// All series so far, with a last point that covers fewer steps.
    pub(crate) fn series(&self, time_ns: u64) -> Vec<view::Series> {
        let mut whole = self.clone();
        if 0 < whole.open.n_steps {
            whole.close_point(time_ns);
        }
        let Self { time_s, open, points, .. } = whole;
        let series = open.figures.into_iter().zip(points);
        series.map(|(mean, points)| mean.sum.series(time_s.clone(), points)).collect()
    }

    fn close_point(&mut self, time_ns: u64) {
        let n_points = self.time_s.len();
        self.time_s.push(seconds(time_ns));
        // A figure that is new was not known before.
        self.points.resize_with(self.open.figures.len(), || vec![f64::NAN; n_points]);
        for (points, mean) in self.points.iter_mut().zip(self.open.take()) {
            points.push(mean);
        }
    }

    /// Makes one point of every two; an odd last one becomes the beginning of the next.
    fn halve(&mut self) {
        let odd = self.time_s.len() % 2 == 1;
        if odd {
            self.time_s.pop();
        }
        self.time_s = self.time_s.chunks_exact(2).map(|pair| pair[1]).collect();
        for (points, open) in self.points.iter_mut().zip(&mut self.open.figures) {
            if odd
                && let Some(last) = points.pop()
                && last.is_finite()
            {
                (open.sum.value, open.n) = (last * self.stride as f64, self.stride);
            }
            let means = points.chunks_exact(2).map(|pair| match (pair[0], pair[1]) {
                (a, b) if a.is_nan() => b,
                (a, b) if b.is_nan() => a,
                (a, b) => 0.5 * (a + b),
            });
            *points = means.collect();
        }
        self.open.n_steps = if odd { self.stride } else { 0 };
        self.stride *= 2;
    }
}
