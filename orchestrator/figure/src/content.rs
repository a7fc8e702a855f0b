//! What a figure holds: numbers, and what they are called. A drawing adds nothing but places and colours.

use schemars::JsonSchema;
use serde::Serialize;
use std::collections::BTreeMap;

/// What the schema of a figure is called.
pub const SCHEMA: &str = "figure/1";

/// A figure of one or several panels.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct Figure {
    /// The format: `figure/1`.
    #[schemars(extend("const" = SCHEMA))]
    pub schema: &'static str,
    /// What it is called.
    pub title: String,
    /// What it shows, with medians, intervals and numbers of trials, for the text below it.
    pub caption: String,
    /// What its marks are, in a line below the panels; empty where they need no words.
    pub note: String,
    /// The runs that are drawn over each other; empty of one run, and of anything else.
    pub runs: Vec<DrawnRun>,
    /// Its panels, from left to right and from top to bottom.
    pub panels: Vec<Panel>,
}

/// A run of a figure of several.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct DrawnRun {
    /// What its curves are called: its folder, and the keys of the configuration in which the runs differ.
    pub name: String,
    /// Its folder, as it was given.
    pub path: String,
    /// When its robots started (simulated seconds).
    pub robots_started_s: f64,
    /// Values of the keys of the configuration in which the runs differ; null where the run lacks the key.
    pub differs: BTreeMap<String, Option<String>>,
}

/// A plane with axes.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct Panel {
    /// Its horizontal axis.
    pub x: Axis,
    /// Its vertical axis.
    pub y: Axis,
    /// Both axes are lengths of the same scale: a map.
    pub is_map: bool,
    /// What is drawn, the first below.
    pub series: Vec<Series>,
    /// What colours of points stand for, if they stand for a number.
    pub colour: Option<Axis>,
}

/// An axis.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct Axis {
    /// Words and unit.
    pub label: String,
    /// Its scale.
    pub scale: Scale,
    /// From where to where, in the units of the points.
    pub range: [f64; 2],
    /// Of a scale of categories: what stands at 0, 1, 2, …
    pub categories: Vec<String>,
    /// Values are shares from 0 to 1, and are shown as per cent.
    pub is_share: bool,
    /// Values with ticks, if these are not round numbers.
    pub ticks: Vec<f64>,
}

/// How values are placed along an axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Scale {
    /// Evenly.
    Linear,
    /// By their logarithms.
    Log,
    /// One after another.
    Category,
}

/// Points that belong together.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct Series {
    /// What they are; empty of a series without an entry in the legend.
    pub name: String,
    /// How they are drawn.
    pub mark: Mark,
    /// The colour, by its number; series with the same number have the same one. `None`: that of text.
    pub group: Option<usize>,
    /// The points, in order.
    pub points: Vec<Point>,
}

/// How points are drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Mark {
    /// A line through them.
    Line,
    /// A line through them, with the area from `low` to `high`.
    Band,
    /// A dot each, with its interval; on an axis of numbers joined by a line.
    Interval,
    /// A bar each from 0, with its interval.
    Bar,
    /// A dot each.
    Dot,
    /// A small faint dot each.
    FaintDot,
    /// A line from each to its end.
    Segment,
    /// An arrow from each to its end.
    Arrow,
}

/// A point.
#[derive(Clone, Debug, Default, Serialize, JsonSchema)]
pub struct Point {
    /// Along the horizontal axis.
    pub x: f64,
    /// Along the vertical axis; null: none, so that a line is broken there.
    pub y: Option<f64>,
    /// The lower end of its interval.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub low: Option<f64>,
    /// The upper end.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub high: Option<f64>,
    /// What the interval is: `bootstrap 95 %`, `range`, …
    #[serde(skip_serializing_if = "Option::is_none")]
    pub interval: Option<&'static str>,
    /// Of how many trials or frames.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub n: Option<u64>,
    /// What `y` is of several values: `median`, `trial` of one of them, `share of trials`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub statistic: Option<&'static str>,
    /// The seed of the trial.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub seed: Option<u64>,
    /// Where a segment or an arrow ends.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub end: Option<[f64; 2]>,
    /// The number that its colour shows.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub value: Option<f64>,
    /// What it is called, such as the number of a robot.
    #[serde(skip_serializing_if = "String::is_empty")]
    pub name: String,
}

impl Point {
    /// A point without anything else.
    #[must_use]
    pub fn of(x: f64, y: f64) -> Self {
        Self { x, y: Some(y), ..Self::default() }
    }
}

impl Axis {
    /// An even axis from `low` to `high`, or further where these are the same.
    #[must_use]
    pub fn linear(label: impl Into<String>, [low, high]: [f64; 2]) -> Self {
        let least = 1e-9 * low.abs().max(high.abs()).max(1e-300);
        let range = if least < high - low {
            [low, high]
        } else {
            let half = (0.05 * low.abs()).max(1e-3);
            [low - half, high + half]
        };
        Self {
            label: label.into(),
            scale: Scale::Linear,
            range,
            categories: Vec::new(),
            is_share: false,
            ticks: Vec::new(),
        }
    }

    /// An axis of categories.
    #[must_use]
    pub fn of_categories(label: impl Into<String>, categories: Vec<String>) -> Self {
        let range = [-0.5, categories.len() as f64 - 0.5];
        Self { scale: Scale::Category, categories, ..Self::linear(label, range) }
    }

    /// The same for shares, which are shown as per cent.
    #[must_use]
    pub fn of_shares(self) -> Self {
        Self { is_share: true, ..self }
    }
}

impl Figure {
    /// A figure of one panel.
    #[must_use]
    pub fn of_panel(title: impl Into<String>, caption: impl Into<String>, panel: Panel) -> Self {
        Self {
            schema: SCHEMA,
            title: title.into(),
            caption: caption.into(),
            note: String::new(),
            runs: Vec::new(),
            panels: vec![panel],
        }
    }
}
