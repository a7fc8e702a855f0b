//! Figures of a run over time, over distance, and of distributions.

use super::{MOST_POINTS, RunFolder};
use crate::FigureError;
use crate::content::{Axis, Figure, Mark, Panel, Point, Series};
use numbers::format::{count, number, percent};
use numbers::statistics::{quantile, range};
use parquet::record::Field;
use serde_json::Value;
use std::collections::BTreeMap;

fn line(name: &str, group: Option<usize>, points: Vec<Point>) -> Series {
    Series { name: name.to_owned(), mark: Mark::Line, group, points }
}

/// A panel over time from 0 upwards.
fn over_time(label: &str, series: Vec<Series>) -> Panel {
    let points = || series.iter().flat_map(|series| &series.points);
    let x = range(points().map(|point| point.x));
    let values = points().flat_map(|point| [point.y, point.high]).flatten();
    let [_, high] = range(values.chain([0.0]));
    Panel {
        x: Axis::linear("simulated time (s)", x),
        y: Axis::linear(label, [0.0, 1.05 * high]),
        is_map: false,
        series,
        colour: None,
    }
}

/// What was added up of a step.
#[derive(Default)]
struct Sums {
    n: f64,
    velocity_mps: [f64; 2],
    speed_mps: f64,
    heard: Vec<f64>,
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
        return Err(run.refused("steps.parquet has no step with a robot in that span of time"));
    }
    for sums in by_time.values_mut() {
        sums.heard.sort_by(f64::total_cmp);
    }
    Ok(by_time)
}

pub(super) fn speed(run: &RunFolder<'_>) -> Result<Figure, FigureError> {
    let by_time = sums(run)?;
    let points = |of: fn(&Sums) -> f64| {
        by_time.iter().map(|(&time_ns, sums)| Point::of(time_ns as f64 / 1e9, of(sums))).collect()
    };
    let flock = points(|sums| libm::hypot(sums.velocity_mps[0], sums.velocity_mps[1]) / sums.n);
    let robots = points(|sums| sums.speed_mps / sums.n);
    let task = &run.summary["task"];
    let stated = |key: &str, words: &str| {
        task[key].as_f64().map(|value| format!(" {words} {} m/s.", number(value)))
    };
    let caption = format!(
        "Speed over time: the magnitude of the mean velocity of all robots (flock), and the mean of their speeds.{}{}{}",
        stated("flock_speed_mps", "Means over the run: flock").unwrap_or_default(),
        stated("mean_speed_mps", "robots").unwrap_or_default(),
        stated("speed_along_leader_mps", "along the leader's direction").unwrap_or_default(),
    );
    let series = vec![line("robots", Some(1), robots), line("flock", Some(0), flock)];
    Ok(Figure::of_panel(
        format!("{}: speed", run.name()),
        caption,
        over_time("speed (m/s)", series),
    ))
}

pub(super) fn neighbours(run: &RunFolder<'_>) -> Result<Figure, FigureError> {
    let by_time = sums(run)?;
    let mut all: Vec<f64> = by_time.values().flat_map(|sums| sums.heard.iter().copied()).collect();
    all.sort_by(f64::total_cmp);
    let points = by_time.iter().map(|(&time_ns, sums)| {
        let at = |share: f64| quantile(&sums.heard, share);
        Point {
            low: Some(at(0.1)),
            high: Some(at(0.9)),
            interval: Some("10 % to 90 % of robots"),
            n: Some(sums.heard.len() as u64),
            ..Point::of(time_ns as f64 / 1e9, at(0.5))
        }
    });
    let series = vec![Series {
        name: "median, and 10 % to 90 % of robots".to_owned(),
        mark: Mark::Band,
        group: Some(0),
        points: points.collect(),
    }];
    let caption = format!(
        "How many others each robot heard in a control period: the median over the drawn steps is {}, 10 % to 90 % are {} to {}.",
        number(quantile(&all, 0.5)),
        number(quantile(&all, 0.1)),
        number(quantile(&all, 0.9))
    );
    let panel = over_time("neighbours heard (count)", series);
    Ok(Figure::of_panel(format!("{}: neighbours heard", run.name()), caption, panel))
}

pub(super) fn delivery(run: &RunFolder<'_>) -> Result<Figure, FigureError> {
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
    let caption = format!(
        "Share of the payloads that were delivered, over the distance between sender and receiver, with 95 % intervals that take \
         frames for independent (Wilson). n = {} frames times receivers; {overall} over all distances.",
        count(n)
    );
    let [_, farthest] = range(bins.iter().filter_map(|bin| bin["to_m"].as_f64()));
    let panel = Panel {
        x: Axis::linear("distance (m)", [0.0, farthest]),
        y: Axis::linear("delivery ratio", [0.0, 1.05]).of_shares(),
        is_map: false,
        series: vec![Series { name: String::new(), mark: Mark::Interval, group: Some(0), points }],
        colour: None,
    };
    Ok(Figure::of_panel(format!("{}: delivery over distance", run.name()), caption, panel))
}

pub(super) fn latency(run: &RunFolder<'_>) -> Result<Figure, FigureError> {
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
        return Err(run.refused("no packet was delivered in that span of time"));
    }
    let mut medians = Vec::new();
    let mut series = Vec::new();
    for (group, (kind, latencies_s)) in by_kind.iter_mut().enumerate() {
        latencies_s.sort_by(f64::total_cmp);
        let n = latencies_s.len();
        let stride = n.div_ceil(MOST_POINTS as usize);
        let points = latencies_s
            .iter()
            .enumerate()
            .filter(|(rank, _)| rank.is_multiple_of(stride) || rank + 1 == n);
        let points =
            points.map(|(rank, latency_s)| Point::of(*latency_s, (rank + 1) as f64 / n as f64));
        series.push(line(kind, Some(group), points.collect()));
        medians.push(format!(
            "{kind} {} s (95 % of packets within {} s, n = {})",
            number(quantile(latencies_s, 0.5)),
            number(quantile(latencies_s, 0.95)),
            count(n as u64)
        ));
    }
    let caption = format!(
        "Share of delivered packets whose latency from creation to delivery is at most so long. Medians: {}.",
        medians.join("; ")
    );
    let [_, longest] = range(by_kind.values().flatten().copied());
    let panel = Panel {
        x: Axis::linear("latency (s)", [0.0, longest]),
        y: Axis::linear("share of delivered packets", [0.0, 1.0]).of_shares(),
        is_map: false,
        series,
        colour: None,
    };
    Ok(Figure::of_panel(format!("{}: latency", run.name()), caption, panel))
}
