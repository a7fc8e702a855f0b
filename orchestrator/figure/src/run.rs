//! Figures of a run. To add one, write a function like those below and name it in `KINDS`.

mod curves;
mod maps;
mod series;
mod several;

use crate::content::{Axis, Figure, Mark, Point, Series};
use crate::{FigureError, Kind, Request, Wanted, kind};
use curves::Curves;
use input::result::{ResultError, ResultFolder};
use metrics::Task;
use numbers::format::number as in_words;
use numbers::statistics::range;
use parquet::record::Field;
use proto::bounds::DESCRIPTION_BYTES;
use serde_json::Value;
pub(crate) use several::figure as figure_of_several;
use std::collections::BTreeMap;

/// What draws a kind of figures.
#[derive(Clone, Copy)]
pub(crate) enum Draw {
    /// A map of one run.
    Map(fn(&RunFolder<'_>) -> Result<Figure, FigureError>),
    /// Curves, which several runs have over each other. Those over time begin where the robots start.
    OverTime(fn(&RunFolder<'_>) -> Result<Curves, FigureError>),
    /// Curves over something else.
    Curves(fn(&RunFolder<'_>) -> Result<Curves, FigureError>),
}

/// All kinds.
pub(crate) const KINDS: &[Kind<Draw>] = &[
    Kind {
        name: "trajectories",
        shows: "where the robots went, from above",
        file: "steps.parquet",
        draw: Draw::Map(maps::trajectories),
    },
    Kind {
        name: "links",
        shows: "who heard whom, and how many of the frames",
        file: "links.parquet",
        draw: Draw::Map(maps::links),
    },
    Kind {
        name: "network",
        shows: "the parent of each mote at the end",
        file: "motes.parquet",
        draw: Draw::Map(maps::network),
    },
    Kind {
        name: "speed",
        shows: "flock speed, and mean speed of the robots, over time",
        file: "steps.parquet",
        draw: Draw::OverTime(series::speed),
    },
    Kind {
        name: "flock_speed",
        shows: "flock speed over time",
        file: "steps.parquet",
        draw: Draw::OverTime(series::flock_speed),
    },
    Kind {
        name: "neighbours",
        shows: "how many others each robot hears over time",
        file: "steps.parquet",
        draw: Draw::OverTime(series::neighbours),
    },
    Kind {
        name: "delivery",
        shows: "delivery ratio over distance",
        file: "summary.json",
        draw: Draw::Curves(series::delivery),
    },
    Kind {
        name: "latency",
        shows: "latency of delivered packets, cumulative",
        file: "packets.parquet",
        draw: Draw::Curves(series::latency),
    },
];

/// A run whose figure is drawn.
pub(crate) struct RunFolder<'a> {
    folder: &'a ResultFolder,
    summary: &'a Value,
    /// From where to where in simulated time (ns).
    span_ns: [u64; 2],
    /// A part of the run was asked for.
    is_part: bool,
    /// Times on the axis count from when the robots started.
    is_since_start: bool,
}

/// A figure of a run.
pub(crate) fn figure(
    folder: &ResultFolder,
    summary: &Value,
    request: &Request,
) -> Result<Figure, FigureError> {
    let draw = |kind: &Kind<Draw>| {
        let run = RunFolder::new(folder, summary, request, kind.draw, false);
        match kind.draw {
            Draw::Map(draw) => draw(&run),
            Draw::OverTime(draw) | Draw::Curves(draw) => Ok(curves::of_one(&run, &draw(&run)?)),
        }
    };
    let wanted = Wanted {
        what: folder.path().display().to_string(),
        has: &|file| folder.has(file),
        // A damaged table is listed, so that whoever asks for the kind learns of it.
        can_draw: &|kind| !matches!(draw(kind), Err(FigureError::Request(_))),
    };
    draw(kind(&wanted, KINDS, request)?)
}

/// Most points of a line: more are not seen.
const MOST_POINTS: u64 = 600;

const NANOSECONDS: f64 = 1e9;

impl<'a> RunFolder<'a> {
    /// * `is_since_start`: times, those of the request as well, count from when the robots started.
    fn new(
        folder: &'a ResultFolder,
        summary: &'a Value,
        request: &Request,
        draw: Draw,
        is_since_start: bool,
    ) -> Self {
        let started_s = started_s(summary);
        let zero_s = if is_since_start { started_s } else { 0.0 };
        let nanoseconds = |time_s: f64| (NANOSECONDS * time_s.max(0.0)).round() as u64;
        let from_s = match request.from_s {
            Some(from_s) => zero_s + from_s,
            // Before, robots stand and wait for the network.
            None if matches!(draw, Draw::OverTime(_)) => started_s,
            None => 0.0,
        };
        let until_ns = request.until_s.map_or(u64::MAX, |until_s| nanoseconds(zero_s + until_s));
        Self {
            folder,
            summary,
            span_ns: [nanoseconds(from_s), until_ns],
            is_part: request.from_s.is_some() || request.until_s.is_some(),
            is_since_start,
        }
    }

    fn name(&self) -> &str {
        self.summary["name"].as_str().unwrap_or_default()
    }

    /// When the run ended (simulated seconds).
    fn end_s(&self) -> f64 {
        self.summary["simulated_s"].as_f64().unwrap_or(0.0)
    }

    /// Every so many steps is drawn: so many that the span has enough points.
    fn every(&self) -> u64 {
        let end_s = self.end_s();
        let [from_s, until_s] = self.span_ns.map(|time_ns| time_ns as f64 / NANOSECONDS);
        let part = if 0.0 < end_s { (until_s.min(end_s) - from_s).max(0.0) / end_s } else { 1.0 };
        let steps = self.summary["steps"].as_u64().unwrap_or(0);
        ((steps as f64 * part).ceil() as u64).div_ceil(MOST_POINTS).max(1)
    }

    fn is_within(&self, time_ns: u64) -> bool {
        (self.span_ns[0]..=self.span_ns[1]).contains(&time_ns)
    }

    /// Where a time is on an axis of time (s).
    fn axis_s(&self, time_ns: u64) -> f64 {
        let zero_s = if self.is_since_start { started_s(self.summary) } else { 0.0 };
        // Without what is left of the difference of two numbers that are not decimal.
        let time_s = time_ns as f64 / NANOSECONDS - zero_s;
        (time_s * NANOSECONDS).round() / NANOSECONDS
    }

    /// The figure lacks something: what.
    fn refused(&self, what: &str) -> FigureError {
        FigureError::Request(format!("{}: {what}", self.folder.path().display()))
    }

    /// The figure lacks something in the span that was asked for: what, and which span the run has; of a whole run, why it may be.
    fn refused_span(&self, what: &str, why: &str) -> FigureError {
        if !self.is_part {
            return self.refused(&format!("{what}{why}"));
        }
        let started_s = started_s(self.summary);
        let started = if 0.0 < started_s {
            format!(", and its robots started at {} s", in_words(started_s))
        } else {
            String::new()
        };
        let end = in_words(self.end_s());
        self.refused(&format!(
            "{what} in that span of time; the run reaches from 0 to {end} s{started}"
        ))
    }

    /// Gives the numbers of some columns of each row of a table to `visit`; of a null NaN.
    fn each<const N: usize>(
        &self,
        file: &str,
        columns: [&str; N],
        mut visit: impl FnMut([f64; N]),
    ) -> Result<(), FigureError> {
        let table = self.folder.table(file)?;
        let mut in_order: Vec<&str> =
            table.columns().filter(|name| columns.contains(name)).collect();
        in_order.dedup();
        let places: Vec<Option<usize>> =
            columns.iter().map(|name| in_order.iter().position(|own| own == name)).collect();
        table.each_row_with(&columns, |row| {
            let fields: Vec<f64> = row.get_column_iter().map(|(_, field)| number(field)).collect();
            visit(std::array::from_fn(|at| places[at].map_or(f64::NAN, |place| fields[place])));
            Ok::<(), ResultError>(())
        })?;
        Ok(())
    }

    /// Where each robot was at the last step within the span (m).
    fn last_places(&self) -> Result<BTreeMap<u32, [f64; 2]>, FigureError> {
        let mut last = (0, BTreeMap::new());
        let columns = ["step", "time_ns", "agent", "alive", "x_m", "y_m"];
        self.each("steps.parquet", columns, |[step, time_ns, agent, alive, x_m, y_m]| {
            if !self.is_within(time_ns as u64) || alive != 1.0 {
                return;
            }
            if last.0 != step as u64 {
                last = (step as u64, BTreeMap::new());
            }
            last.1.insert(agent as u32, [x_m, y_m]);
        })?;
        Ok(last.1)
    }

    fn config(&self) -> Result<toml::Table, FigureError> {
        let text = self.folder.text(&DESCRIPTION_BYTES, "config.toml")?;
        Ok(text.parse().unwrap_or_default())
    }

    /// The number of the leader, if the robots have one.
    fn leader(&self) -> Result<Option<u32>, FigureError> {
        let config = self.config()?;
        let robots = config.get("robotsim").and_then(toml::Value::as_table);
        let task = robots.map(|robots| Task::from_config(&robots.to_string()));
        Ok(task.and_then(|task| u32::try_from(task.leader?).ok()))
    }

    /// Walls and obstacles of the configuration, below everything.
    fn site(&self) -> Result<Vec<Series>, FigureError> {
        let config = self.config()?;
        let list = |key: &str| {
            let site = config.get("site").and_then(|site| site.get(key));
            site.and_then(toml::Value::as_array).cloned().unwrap_or_default()
        };
        let point = |of: &toml::Value, key: &str| {
            let numbers = of.get(key)?.as_array()?.iter();
            let numbers: Vec<f64> = numbers
                .filter_map(|number| {
                    number.as_float().or_else(|| number.as_integer().map(|whole| whole as f64))
                })
                .collect();
            <[f64; 2]>::try_from(numbers.get(..2)?).ok()
        };
        let mut series = Vec::new();
        let walls: Vec<Point> = list("wall")
            .iter()
            .filter_map(|wall| {
                let [x, y] = point(wall, "from_m")?;
                Some(Point { end: Some(point(wall, "to_m")?), ..Point::of(x, y) })
            })
            .collect();
        if !walls.is_empty() {
            series.push(Series {
                name: "walls".to_owned(),
                mark: Mark::Segment,
                group: None,
                points: walls,
            });
        }
        let mut edges = Vec::new();
        for disc in list("obstacle") {
            let (Some([x, y]), Some(radius_m)) =
                (point(&disc, "centre_m"), disc.get("radius_m").and_then(toml::Value::as_float))
            else {
                continue;
            };
            const CORNERS: u32 = 48;
            edges.extend((0..=CORNERS).map(|corner| {
                let angle = std::f64::consts::TAU * f64::from(corner) / f64::from(CORNERS);
                Point::of(x + radius_m * libm::cos(angle), y + radius_m * libm::sin(angle))
            }));
            edges.push(Point { x, ..Point::default() });
        }
        if !edges.is_empty() {
            series.push(Series {
                name: "obstacles".to_owned(),
                mark: Mark::Line,
                group: None,
                points: edges,
            });
        }
        Ok(series)
    }
}

/// When the robots of a run started (simulated seconds).
fn started_s(summary: &Value) -> f64 {
    summary["robots_started_s"].as_f64().unwrap_or(0.0)
}

fn number(field: &Field) -> f64 {
    match field {
        Field::Bool(is) => f64::from(u8::from(*is)),
        Field::UInt(number) => f64::from(*number),
        Field::ULong(number) => *number as f64,
        Field::Int(number) => f64::from(*number),
        Field::Long(number) => *number as f64,
        Field::Float(number) => f64::from(*number),
        Field::Double(number) => *number,
        _ => f64::NAN,
    }
}

/// Axes of a map around points, with a margin.
fn map_axes(series: &[Series]) -> [Axis; 2] {
    let points = || series.iter().flat_map(|series| &series.points);
    let ends = || points().filter_map(|point| point.end);
    let xs = points().filter(|point| point.y.is_some()).map(|point| point.x);
    let ys = points().filter_map(|point| point.y);
    let [x, y] =
        [range(xs.chain(ends().map(|end| end[0]))), range(ys.chain(ends().map(|end| end[1])))];
    let margin = 0.05 * (x[1] - x[0]).max(y[1] - y[0]).max(1.0);
    let around = |[low, high]: [f64; 2]| [low - margin, high + margin];
    [Axis::linear("east (m)", around(x)), Axis::linear("north (m)", around(y))]
}
