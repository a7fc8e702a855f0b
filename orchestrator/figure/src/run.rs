//! Figures of a run. To add one, write a function like those below and name it in `KINDS`.

mod maps;
mod series;

use crate::content::{Axis, Figure, Mark, Point, Series};
use crate::{FigureError, Kind, Request, kind};
use input::result::{ResultError, ResultFolder};
use numbers::statistics::range;
use parquet::record::Field;
use proto::bounds::DESCRIPTION_BYTES;
use serde_json::Value;
use std::collections::BTreeMap;

type Draw = fn(&RunFolder<'_>) -> Result<Figure, FigureError>;

/// All kinds.
pub(crate) const KINDS: &[Kind<Draw>] = &[
    Kind {
        name: "trajectories",
        shows: "where the robots went, from above",
        file: "steps.parquet",
        draw: maps::trajectories,
    },
    Kind {
        name: "links",
        shows: "who heard whom, and how many of the frames",
        file: "links.parquet",
        draw: maps::links,
    },
    Kind {
        name: "network",
        shows: "the parent of each mote at the end",
        file: "motes.parquet",
        draw: maps::network,
    },
    Kind {
        name: "speed",
        shows: "speed of the flock and of its robots over time",
        file: "steps.parquet",
        draw: series::speed,
    },
    Kind {
        name: "neighbours",
        shows: "how many others each robot hears over time",
        file: "steps.parquet",
        draw: series::neighbours,
    },
    Kind {
        name: "delivery",
        shows: "delivery ratio over distance",
        file: "summary.json",
        draw: series::delivery,
    },
    Kind {
        name: "latency",
        shows: "latency of delivered packets, cumulative",
        file: "packets.parquet",
        draw: series::latency,
    },
];

/// A run whose figure is drawn.
pub(crate) struct RunFolder<'a> {
    folder: &'a ResultFolder,
    summary: &'a Value,
    /// From where to where in simulated time (ns).
    span_ns: [u64; 2],
}

/// A figure of a run.
pub(crate) fn figure(
    folder: &ResultFolder,
    summary: &Value,
    request: &Request,
) -> Result<Figure, FigureError> {
    let kind = kind(folder.path(), KINDS, request, |file| folder.has(file))?;
    let nanoseconds = |time_s: f64| (1e9 * time_s.max(0.0)).round() as u64;
    let span_ns =
        [request.from_s.map_or(0, nanoseconds), request.until_s.map_or(u64::MAX, nanoseconds)];
    (kind.draw)(&RunFolder { folder, summary, span_ns })
}

/// Most points of a line: more are not seen.
const MOST_POINTS: u64 = 600;

impl RunFolder<'_> {
    fn name(&self) -> &str {
        self.summary["name"].as_str().unwrap_or_default()
    }

    /// Every so many steps is drawn.
    fn every(&self) -> u64 {
        self.summary["steps"].as_u64().unwrap_or(0).div_ceil(MOST_POINTS).max(1)
    }

    fn is_within(&self, time_ns: u64) -> bool {
        (self.span_ns[0]..=self.span_ns[1]).contains(&time_ns)
    }

    /// The figure lacks something: what.
    fn refused(&self, what: &str) -> FigureError {
        FigureError::Request(format!("{}: {what}", self.folder.path().display()))
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

    /// Walls and obstacles of the configuration, below everything.
    fn site(&self) -> Result<Vec<Series>, FigureError> {
        let text = self.folder.text(&DESCRIPTION_BYTES, "config.toml")?;
        let config: toml::Table = text.parse().unwrap_or_default();
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
