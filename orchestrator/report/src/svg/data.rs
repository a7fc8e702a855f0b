//! What a chart has drawn, as numbers: for the table that the page offers, for values where the reader points, and for zoom.

use super::Axis;
use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use flate2::{Compression, GzBuilder};
use maud::{Markup, html};
use numbers::format::rounded;
use serde_json::{Value, json};
use std::io::Write as _;

/// How the numbers of a series are drawn, and what its columns are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kind {
    /// Points joined by lines: x, y; not a number where the line is interrupted.
    Line,
    /// The area between two lines: x, low, high.
    Band,
    /// Points: x, y.
    Dots,
    /// Lines between two points each: x and y of one end, x and y of the other.
    Segments,
    /// Rectangles: x and y of a corner, x and y of the opposite one.
    Rectangles,
    /// Points with intervals: x, y, low, high.
    Intervals,
    /// Levels across the plane: y.
    Levels,
    /// Moments, as lines from top to bottom: x.
    Moments,
    /// Spans from top to bottom: from, to.
    Spans,
}

impl Kind {
    /// What the script of a page calls it.
    fn name(self) -> &'static str {
        match self {
            Self::Line => "line",
            Self::Band => "band",
            Self::Dots => "dots",
            Self::Segments => "segments",
            Self::Rectangles => "rectangles",
            Self::Intervals => "intervals",
            Self::Levels => "levels",
            Self::Moments => "moments",
            Self::Spans => "spans",
        }
    }
}

/// Marks that belong together.
#[derive(Clone, Debug)]
pub(crate) struct Series {
    /// Their class in the picture; the key says in words what it is.
    class: String,
    kind: Kind,
    /// Whose they are, where several series have one class; else empty.
    item: String,
    /// Pixels to the right of their place, by which points beside each other are told apart.
    shift: f64,
    /// Columns of numbers, of the same length.
    columns: Vec<Vec<f64>>,
    /// What each point is, in words; empty if that says nothing.
    names: Vec<String>,
}

/// What a chart has drawn.
#[derive(Clone, Debug, Default)]
pub(crate) struct ChartData {
    series: Vec<Series>,
    /// Whose the next marks are.
    pub(super) item: String,
    /// What the points of the next marks are.
    pub(super) names: Vec<String>,
    /// Pixels to the right by which the next marks are drawn beside their place.
    pub(super) shift: f64,
    /// Words of classes that the key does not have.
    pub(crate) words: Vec<(String, String)>,
    /// What a reader of the table has to know, such as that each point stands for several steps.
    pub(super) note: String,
    /// Both axes have one scale.
    pub(super) is_map: bool,
    /// The first axis runs from top to bottom, the second from left to right.
    pub(crate) is_transposed: bool,
}

impl ChartData {
    /// Adds marks: a row of numbers for each. Lines are each a series; other marks join those of their class.
    pub(crate) fn add<const N: usize>(
        &mut self,
        class: &str,
        kind: Kind,
        rows: impl IntoIterator<Item = [f64; N]>,
    ) {
        let mut columns = vec![Vec::new(); N];
        for row in rows {
            for (column, number) in columns.iter_mut().zip(row) {
                column.push(number);
            }
        }
        let names = std::mem::take(&mut self.names);
        if columns.iter().all(Vec::is_empty) {
            return;
        }
        let (item, shift) = (self.item.clone(), self.shift);
        let same = self.series.iter_mut().find(|known| {
            let is_own = known.class == class && known.kind == kind && known.item == item;
            is_own && ![Kind::Line, Kind::Band].contains(&kind) && known.shift == shift
        });
        match same {
            Some(known) => {
                known.names.resize(known.columns[0].len(), String::new());
                known.names.extend(names);
                for (known, column) in known.columns.iter_mut().zip(columns) {
                    known.extend(column);
                }
            }
            None => self.series.push(Series {
                class: class.to_owned(),
                kind,
                item,
                shift,
                columns,
                names,
            }),
        }
    }

    /// Whether there are so many numbers that they would make the page large.
    fn is_rounded(&self) -> bool {
        MOST_EXACT < self.series.iter().flat_map(|series| &series.columns).map(Vec::len).sum()
    }

    /// The data for the script of the page. `plane`: left, top, right and bottom of the plane (pixels).
    pub(crate) fn json(&self, plane: [f64; 4], x: &Axis, y: &Axis) -> Value {
        let is_rounded = self.is_rounded();
        let number = |&value: &f64| if is_rounded { rounded(value, DIGITS) } else { value };
        let series = self.series.iter().map(|series| {
            let columns = series.columns.iter().map(|column| column.iter().map(number).collect());
            let mut value = json!({
                "class": series.class,
                "kind": series.kind.name(),
                "columns": columns.collect::<Vec<Vec<f64>>>(),
            });
            if !series.item.is_empty() {
                value["item"] = json!(series.item);
            }
            if series.names.iter().any(|name| !name.is_empty()) {
                value["names"] = json!(series.names);
            }
            if series.shift != 0.0 {
                value["shift"] = json!(series.shift);
            }
            value
        });
        let words = self.words.iter().map(|(class, words)| (class.clone(), json!(words)));
        json!({
            "plane": plane,
            "x": axis(x),
            "y": axis(y),
            "series": series.collect::<Vec<_>>(),
            "words": words.collect::<serde_json::Map<_, _>>(),
            "map": self.is_map,
            "transposed": self.is_transposed,
        })
    }

    /// The data as a part of a page, after its picture; nothing if nothing has been drawn.
    pub(crate) fn markup(&self, plane: [f64; 4], x: &Axis, y: &Axis) -> Markup {
        if self.series.is_empty() {
            return Markup::default();
        }
        let rounding = format!("Numbers are rounded to {DIGITS} digits");
        let notes = [self.note.as_str(), if self.is_rounded() { &rounding } else { "" }];
        let notes: Vec<&str> = notes.into_iter().filter(|note| !note.is_empty()).collect();
        let note = (!notes.is_empty()).then(|| notes.join(". "));
        let packed = packed(self.json(plane, x, y).to_string().as_bytes());
        html! { script.figure-data type="text/plain" data-note=[note] { (packed) } }
    }
}

fn axis(axis: &Axis) -> Value {
    json!({
        "label": axis.label,
        "min": axis.min,
        "max": axis.max,
        "percent": axis.is_percent,
        "log": axis.is_log,
        "names": axis.names,
    })
}

/// Compressed by gzip and written in base64. The same bytes give the same text.
fn packed(bytes: &[u8]) -> String {
    let mut gzip = GzBuilder::new().write(Vec::new(), Compression::best());
    // Into memory nothing fails.
    let packed = gzip.write_all(bytes).and_then(|()| gzip.finish()).unwrap_or_default();
    STANDARD.encode(packed)
}

/// Of a picture of more numbers than this, such as one of many paths, each is rounded.
const MOST_EXACT: usize = 20_000;
/// Significant digits that are left then: more than the picture shows.
const DIGITS: usize = 7;

/// What a page has in it if it has data of figures.
pub(crate) const DATA_TAG: &str = "<script class=\"figure-data\"";
