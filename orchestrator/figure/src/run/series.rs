//! Curves of a run over time, over distance, and of distributions.

use super::curves::{Curve, Curves};
use super::{MOST_POINTS, RunFolder};
use crate::FigureError;
use crate::content::{Mark, Point};
use numbers::format::{count, number, percent};
use numbers::statistics::{quantile, range};
use parquet::record::Field;
use serde_json::Value;
use std::collections::BTreeMap;

/// What was added up of a step.
#[derive(Default)]
struct Sums {
    n: f64,
    velocity_mps: [f64; 2],
    speed_mps: f64,
    heard: Vec<f64>,
}

impl Sums {
    fn flock_mps(&self) -> f64 {
        libm::hypot(self.velocity_mps[0], self.velocity_mps[1]) / self.n
    }

    fn mean_mps(&self) -> f64 {
        self.speed_mps / self.n
    }
}

/// Sums over the robots that are alive, by time (ns) of the steps that are drawn.
fn sums(run: &RunFolder<'_>) -> Result<BTreeMap<u64, Sums>, FigureError> {
    let every = run.every();
    let mut by_time: BTreeMap<u64, Sums> = BTreeMap::new();
    let columns = ["step", "time_ns", "alive", "vx_mps", "vy_mps", "vz_mps", "n_heard"];
    run.each("steps.parquet", columns, |[step, time_ns, alive, vx, vy, vz, n_heard]| {
        if step == 0.0
            || !(step as u64).is_multiple_of(every)
            || alive != 1.0
            || !run.is_within(time_ns as u64)
        {
            return;
        }
        let sums = by_time.entry(time_ns as u64).or_default();
        let [vx, vy, vz] = [vx, vy, vz].map(|speed| if speed.is_finite() { speed } else { 0.0 });
        sums.n += 1.0;
        sums.velocity_mps = [sums.velocity_mps[0] + vx, sums.velocity_mps[1] + vy];
        sums.speed_mps += libm::sqrt(vx * vx + vy * vy + vz * vz);
        sums.heard.push(n_heard);
    })?;
    if by_time.is_empty() {
        return Err(run.refused_span("steps.parquet has no step with a robot", ""));
    }
    for sums in by_time.values_mut() {
        sums.heard.sort_by(f64::total_cmp);
    }
    Ok(by_time)
}

/// What all curves over time have in common: the axis, which begins where the span does, and not at the first point.
fn over_time(run: &RunFolder<'_>, by_time: &BTreeMap<u64, Sums>) -> (String, Option<[f64; 2]>) {
    let label =
        if run.is_since_start { "time since the robots started (s)" } else { "simulated time (s)" };
    let last_ns = by_time.last_key_value().map_or(0, |(time_ns, _)| *time_ns);
    (label.to_owned(), Some([run.span_ns[0], last_ns].map(|time_ns| run.axis_s(time_ns))))
}

/// The flock's speed alone.
pub(super) fn flock_speed(run: &RunFolder<'_>) -> Result<Curves, FigureError> {
    let by_time = sums(run)?;
    let (x_label, x) = over_time(run, &by_time);
    let (curve, mean) = flock_curve(run, &by_time);
    Ok(Curves {
        what: "flock speed",
        explains: "Flock speed over time: the magnitude of the mean velocity of all robots."
            .to_owned(),
        numbers: format!("mean over the steps shown {mean} m/s"),
        note: "",
        x_label,
        x,
        y_label: "flock speed (m/s)",
        share_up_to: None,
        curves: vec![curve],
    })
}

/// The flock's speed, and its mean over the steps.
fn flock_curve(run: &RunFolder<'_>, by_time: &BTreeMap<u64, Sums>) -> (Curve, String) {
    curve_of(run, by_time, "flock speed", "flock speed (m/s)", Sums::flock_mps)
}

fn curve_of(
    run: &RunFolder<'_>,
    by_time: &BTreeMap<u64, Sums>,
    name: &str,
    y_label: &str,
    of: fn(&Sums) -> f64,
) -> (Curve, String) {
    let points: Vec<Point> =
        by_time.iter().map(|(&time_ns, sums)| Point::of(run.axis_s(time_ns), of(sums))).collect();
    let mean = numbers::statistics::mean(points.iter().filter_map(|point| point.y));
    let curve =
        Curve { name: name.to_owned(), y_label: y_label.to_owned(), mark: Mark::Line, points };
    (curve, number(mean))
}

pub(super) fn speed(run: &RunFolder<'_>) -> Result<Curves, FigureError> {
    let by_time = sums(run)?;
    let (x_label, x) = over_time(run, &by_time);
    let (flock, flock_mean) = flock_curve(run, &by_time);
    let (robots, robots_mean) =
        curve_of(run, &by_time, "mean speed of the robots", "mean speed (m/s)", Sums::mean_mps);
    Ok(Curves {
        what: "speed",
        explains: "Speed over time. Flock speed is the magnitude of the mean velocity of all robots; the mean speed is the mean \
             of the magnitudes of their velocities."
            .to_owned(),
        numbers: format!(
            "mean over the steps shown: flock speed {flock_mean} m/s, mean speed {robots_mean} m/s"
        ),
        note: "",
        x_label,
        x,
        y_label: "speed (m/s)",
        share_up_to: None,
        curves: vec![flock, robots],
    })
}

pub(super) fn neighbours(run: &RunFolder<'_>) -> Result<Curves, FigureError> {
    let by_time = sums(run)?;
    let (x_label, x) = over_time(run, &by_time);
    let mut all: Vec<f64> = by_time.values().flat_map(|sums| sums.heard.iter().copied()).collect();
    all.sort_by(f64::total_cmp);
    let points = by_time.iter().map(|(&time_ns, sums)| {
        let at = |share: f64| quantile(&sums.heard, share);
        Point {
            low: Some(at(0.1)),
            high: Some(at(0.9)),
            interval: Some("10 % to 90 % of robots"),
            n: Some(sums.heard.len() as u64),
            statistic: Some("median"),
            ..Point::of(run.axis_s(time_ns), at(0.5))
        }
    });
    let y_label = "neighbours heard (count)";
    Ok(Curves {
        what: "neighbours heard",
        explains: "How many others each robot hears in a control period.".to_owned(),
        numbers: format!(
            "median over the steps shown {} (10 % to 90 % of robots: {} to {})",
            number(quantile(&all, 0.5)),
            number(quantile(&all, 0.1)),
            number(quantile(&all, 0.9))
        ),
        note: "Line: median of the robots. Area: 10 % to 90 % of the robots.",
        x_label,
        x,
        y_label,
        share_up_to: None,
        curves: vec![Curve {
            name: String::new(),
            y_label: y_label.to_owned(),
            mark: Mark::Band,
            points: points.collect(),
        }],
    })
}

pub(super) fn delivery(run: &RunFolder<'_>) -> Result<Curves, FigureError> {
    let network = &run.summary["network"];
    let bins: &[Value] = network["by_distance"].as_array().map_or(&[], Vec::as_slice);
    let points: Vec<Point> = bins
        .iter()
        .filter_map(|bin| {
            let middle_m = (bin["from_m"].as_f64()? + bin["to_m"].as_f64()?) / 2.0;
            Some(Point {
                low: bin["ratio_interval_95"][0].as_f64(),
                high: bin["ratio_interval_95"][1].as_f64(),
                interval: Some("Wilson 95 %"),
                n: bin["attempts"].as_u64(),
                ..Point::of(middle_m, bin["ratio"].as_f64()?)
            })
        })
        .collect();
    if points.is_empty() {
        return Err(run.refused(
            "no payload was sent to everybody, so that there is no delivery over distance",
        ));
    }
    let n: u64 = points.iter().filter_map(|point| point.n).sum();
    let overall = network["delivery_ratio"].as_f64().map(percent).unwrap_or_default();
    let [_, farthest] = range(bins.iter().filter_map(|bin| bin["to_m"].as_f64()));
    let y_label = "delivery ratio";
    Ok(Curves {
        what: "delivery over distance",
        explains: "Share of the payloads that were delivered, over the distance between sender and receiver, with 95 % intervals \
             that take frames for independent (Wilson)."
            .to_owned(),
        numbers: format!("{overall} over all distances, n = {} frames times receivers", count(n)),
        note: "Bars: 95 % interval of the share (Wilson).",
        x_label: "distance (m)".to_owned(),
        x: Some([0.0, farthest]),
        y_label,
        share_up_to: Some(1.05),
        curves: vec![Curve {
            name: String::new(),
            y_label: y_label.to_owned(),
            mark: Mark::Interval,
            points,
        }],
    })
}

/// Packets with which motes join, in `packets.parquet`.
const JOIN: &str = "join";

pub(super) fn latency(run: &RunFolder<'_>) -> Result<Curves, FigureError> {
    let mut by_kind: BTreeMap<String, Vec<f64>> = BTreeMap::new();
    let table = run.folder.table("packets.parquet")?;
    let columns = ["kind", "created_ns", "ended_ns", "delivered"];
    table.each_row_with(&columns, |row| {
        let (mut kind, mut created, mut ended, mut delivered) = (String::new(), 0, 0, false);
        for (name, field) in row.get_column_iter() {
            match (name.as_str(), field) {
                ("kind", Field::Str(text)) => kind.clone_from(text),
                ("created_ns", Field::ULong(time)) => created = *time,
                ("ended_ns", Field::ULong(time)) => ended = *time,
                ("delivered", Field::Bool(is)) => delivered = *is,
                _ => {}
            }
        }
        if delivered && run.is_within(ended) {
            by_kind.entry(kind).or_default().push(ended.saturating_sub(created) as f64 / 1e9);
        }
        Ok::<(), FigureError>(())
    })?;
    if by_kind.is_empty() {
        return Err(run.refused_span("packets.parquet has no packet that was delivered", ""));
    }
    let mut medians = Vec::new();
    let mut curves = Vec::new();
    for (kind, latencies_s) in &mut by_kind {
        latencies_s.sort_by(f64::total_cmp);
        let n = latencies_s.len();
        let stride = n.div_ceil(MOST_POINTS as usize);
        let points = latencies_s
            .iter()
            .enumerate()
            .filter(|(rank, _)| rank.is_multiple_of(stride) || rank + 1 == n);
        let points =
            points.map(|(rank, latency_s)| Point::of(*latency_s, (rank + 1) as f64 / n as f64));
        curves.push(Curve {
            name: kind.clone(),
            y_label: format!("share of {kind} packets"),
            mark: Mark::Line,
            points: points.collect(),
        });
        medians.push(format!(
            "{kind} {} s (95 % of packets within {} s, n = {})",
            number(quantile(latencies_s, 0.5)),
            number(quantile(latencies_s, 0.95)),
            count(n as u64)
        ));
    }
    // Broadcasts between robots are no packets: without applications all that is left is how motes joined.
    let without = if by_kind.keys().all(|kind| kind == JOIN) {
        " Only the packets with which motes join were delivered; broadcasts of robots are no packets."
    } else {
        ""
    };
    Ok(Curves {
        what: "latency",
        explains: format!(
            "Share of the delivered packets of a kind whose latency from creation to delivery is at most so long.{without}"
        ),
        numbers: format!("medians: {}", medians.join(", ")),
        note: "",
        x_label: "latency (s)".to_owned(),
        x: None,
        y_label: "share of delivered packets",
        share_up_to: Some(1.0),
        curves,
    })
}
