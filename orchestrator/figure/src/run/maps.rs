//! Figures of a run that are maps.

use super::{RunFolder, map_axes};
use crate::FigureError;
use crate::content::{Axis, Figure, Mark, Panel, Point, Series};
use numbers::format::{count, count_of, percent};
use numbers::statistics::quantile;
use std::collections::{BTreeMap, BTreeSet};

/// The group of the leader: another colour than that of the others, and another mark.
const LEADER: usize = 5;
/// Most robots whose paths are drawn.
const MOST_PATHS: usize = 200;

fn map(
    run: &RunFolder<'_>,
    what: &str,
    caption: String,
    series: Vec<Series>,
    colour: Option<Axis>,
) -> Figure {
    let [x, y] = map_axes(&series);
    let panel = Panel { x, y, is_map: true, series, colour };
    Figure::of_panel(format!("{}: {what}", run.name()), caption, panel)
}

pub(super) fn trajectories(run: &RunFolder<'_>) -> Result<Figure, FigureError> {
    let every = run.every();
    let mut paths: BTreeMap<u32, Vec<Point>> = BTreeMap::new();
    let columns = ["step", "time_ns", "agent", "alive", "x_m", "y_m"];
    let mut latest: BTreeMap<u32, (u64, Point)> = BTreeMap::new();
    run.each("steps.parquet", columns, |[step, time_ns, agent, alive, x_m, y_m]| {
        if !run.is_within(time_ns as u64) {
            return;
        }
        let path = paths.entry(agent as u32).or_default();
        let point =
            if alive == 1.0 { Point::of(x_m, y_m) } else { Point { x: x_m, ..Point::default() } };
        if (step as u64).is_multiple_of(every) || path.is_empty() {
            path.push(point.clone());
        }
        latest.insert(agent as u32, (step as u64, point));
    })?;
    for (agent, (step, point)) in latest {
        if !step.is_multiple_of(every) {
            paths.entry(agent).or_default().push(point);
        }
    }
    let n = paths.len();
    if n == 0 {
        return Err(run.refused_span("steps.parquet has no step", ""));
    }
    let stride = n.div_ceil(MOST_PATHS);
    let mut series = run.site()?;
    let (mut lines, mut starts, mut ends) = (Vec::new(), Vec::new(), Vec::new());
    let leader = run.leader()?;
    let (mut leader_path, mut leader_end) = (Vec::new(), Vec::new());
    for (place, (agent, path)) in paths.iter().enumerate() {
        starts.extend(path.first().filter(|point| point.y.is_some()).cloned());
        let last = path.last().filter(|point| point.y.is_some()).cloned();
        let end = last.map(|point| Point { name: agent.to_string(), ..point });
        if Some(*agent) == leader {
            leader_path.clone_from(path);
            leader_end.extend(end);
            continue;
        }
        ends.extend(end);
        if place.is_multiple_of(stride) {
            lines.extend(path.iter().cloned());
            lines.push(Point::default());
        }
    }
    let of =
        |name: &str, mark, group, points| Series { name: name.to_owned(), mark, group, points };
    series.push(of("path", Mark::Line, Some(0), lines));
    series.push(of("start", Mark::FaintDot, None, starts));
    series.push(of("end", Mark::Dot, Some(0), ends));
    if !leader_end.is_empty() {
        series.push(of("", Mark::Line, Some(LEADER), leader_path));
        series.push(of("leader", Mark::Dot, Some(LEADER), leader_end));
    }
    let drawn = if stride == 1 {
        String::new()
    } else {
        format!(" Paths of {} are drawn.", n.div_ceil(stride))
    };
    let caption =
        format!("Where the {} went, seen from above.{drawn}", count_of(n as u64, "robot"));
    Ok(map(run, "trajectories", caption, series, None))
}

/// Frames of a sender that a receiver heard.
type Heard = BTreeMap<(u32, u32), u64>;

pub(super) fn links(run: &RunFolder<'_>) -> Result<Figure, FigureError> {
    let mut heard = Heard::new();
    // A frame has a row for each receiver.
    let mut sent: BTreeMap<u32, BTreeSet<u64>> = BTreeMap::new();
    let columns = ["time_ns", "sender", "receiver", "sent_ns", "received"];
    run.each("links.parquet", columns, |[time_ns, sender, receiver, sent_ns, received]| {
        if run.is_within(time_ns as u64) {
            sent.entry(sender as u32).or_default().insert(sent_ns as u64);
            *heard.entry((sender as u32, receiver as u32)).or_default() +=
                u64::from(received == 1.0);
        }
    })?;
    // Rows are there of frames that were heard: how many were sent, another table says.
    let has_sent = run.folder.has("transmissions.parquet");
    if has_sent {
        let mut all: BTreeMap<u32, BTreeSet<u64>> = BTreeMap::new();
        let columns = ["sender", "sent_ns", "end_ns", "destination"];
        run.each("transmissions.parquet", columns, |[sender, sent_ns, end_ns, destination]| {
            if run.is_within(end_ns as u64) && destination.is_nan() {
                all.entry(sender as u32).or_default().insert(sent_ns as u64);
            }
        })?;
        for (sender, frames) in all {
            sent.entry(sender).or_default().extend(frames);
        }
    }
    heard.retain(|_, n| 0 < *n);
    let places = run.last_places()?;
    let mut shares = Vec::new();
    let arrows: Vec<Point> = heard
        .iter()
        .filter_map(|(&(sender, receiver), &n)| {
            let [x, y] = *places.get(&sender)?;
            let n_sent = sent.get(&sender).map_or(0, |frames| frames.len() as u64);
            let share = (n as f64 / (n_sent.max(1)) as f64).min(1.0);
            shares.push(share);
            Some(Point {
                end: Some(*places.get(&receiver)?),
                value: has_sent.then_some(share),
                n: Some(n_sent),
                name: format!("{sender} to {receiver}"),
                ..Point::of(x, y)
            })
        })
        .collect();
    if arrows.is_empty() {
        return Err(run.refused_span(
            "links.parquet has no frame that another robot heard",
            ": it has messages between robots, and these robots sent none",
        ));
    }
    shares.sort_by(f64::total_cmp);
    let n_pairs = places.len() * places.len().saturating_sub(1);
    let of_frames = if has_sent {
        format!(
            ", each in the median {} of the frames of the sender (middle half {} to {})",
            percent(quantile(&shares, 0.5)),
            percent(quantile(&shares, 0.25)),
            percent(quantile(&shares, 0.75))
        )
    } else {
        String::new()
    };
    let caption = format!(
        "Who heard whom: an arrow from each sender to each receiver, where they were at the end. {} of {} pairs heard each \
         other in that direction{of_frames}.",
        count(arrows.len() as u64),
        count(n_pairs as u64)
    );
    let dots =
        places.iter().map(|(agent, [x, y])| Point { name: agent.to_string(), ..Point::of(*x, *y) });
    let mut series = run.site()?;
    let of =
        |name: &str, mark, group, points| Series { name: name.to_owned(), mark, group, points };
    series.push(of("", Mark::Arrow, Some(0), arrows));
    series.push(of("robot", Mark::Dot, None, dots.collect()));
    let colour =
        has_sent.then(|| Axis::linear("frames heard, of those sent", [0.0, 1.0]).of_shares());
    Ok(map(run, "who heard whom", caption, series, colour))
}

pub(super) fn network(run: &RunFolder<'_>) -> Result<Figure, FigureError> {
    // Of each mote at its latest row: parent, and whether it has a rank.
    let mut motes: BTreeMap<u32, (f64, bool, bool)> = BTreeMap::new();
    let columns = ["time_ns", "mote", "alive", "rank", "parent"];
    run.each("motes.parquet", columns, |[time_ns, mote, alive, rank, parent]| {
        if run.is_within(time_ns as u64) {
            motes.insert(mote as u32, (parent, rank.is_finite(), alive == 1.0));
        }
    })?;
    motes.retain(|_, (.., is_alive)| *is_alive);
    let places = run.last_places()?;
    let dot = |mote: u32| {
        places.get(&mote).map(|[x, y]| Point { name: mote.to_string(), ..Point::of(*x, *y) })
    };
    let (mut lines, mut roots, mut joined, mut lone) =
        (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    for (&mote, &(parent, has_rank, _)) in &motes {
        if parent.is_finite() {
            let end = places.get(&(parent as u32)).copied();
            let line = dot(mote).zip(end).map(|(point, end)| Point {
                end: Some(end),
                name: format!("{mote} to {parent}"),
                ..point
            });
            lines.extend(line);
            joined.extend(dot(mote));
        } else if has_rank {
            roots.extend(dot(mote));
        } else {
            lone.extend(dot(mote));
        }
    }
    if lines.is_empty() {
        return Err(run.refused_span(
            "motes.parquet has no mote with a parent",
            ": a network without routes, such as one of broadcasts, has none",
        ));
    }
    let caption = format!(
        "Whom each mote has chosen as parent at the end: {} of {} motes other than roots have one.",
        count(joined.len() as u64),
        count((joined.len() + lone.len()) as u64)
    );
    let mut series = run.site()?;
    let mut add = |name: &str, mark, group, points: Vec<Point>| {
        if !points.is_empty() {
            series.push(Series { name: name.to_owned(), mark, group, points });
        }
    };
    add("to the parent", Mark::Segment, Some(0), lines);
    add("mote", Mark::Dot, Some(0), joined);
    add("root", Mark::Dot, Some(1), roots);
    add("mote without parent", Mark::Dot, None, lone);
    Ok(map(run, "network", caption, series, None))
}
