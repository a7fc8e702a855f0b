//! Figures as programs read them.

use super::Metric;
use metrics::figures::Better;
use schemars::JsonSchema;
use serde::Serialize;

/// The format of the answer.
pub const METRICS_SCHEMA: &str = "metrics/1";

/// The JSON of figures of `summary.json`.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct MetricsAnswer {
    /// The format of this answer.
    #[schemars(extend("const" = METRICS_SCHEMA))]
    pub schema: &'static str,
    /// The figures.
    pub metrics: Vec<MetricAnswer>,
}

/// A figure of `summary.json`.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct MetricAnswer {
    /// Its short name; null if it has none.
    pub name: Option<&'static str>,
    /// Its path in `summary.json`. A part that depends on the run is `*`.
    pub path: String,
    /// What an axis calls it, without its unit.
    pub label: String,
    /// What it is.
    pub meaning: String,
    /// Its unit; `0 to 1` of a share, `yes, no` of a truth value, null if it has none.
    pub unit: Option<&'static str>,
    /// Which values are better.
    pub better: Better,
    /// When it is null or absent; empty: never.
    pub null_if: Vec<String>,
    /// What each part of the path is, from the first on.
    pub parts: Vec<PartAnswer>,
}

/// A part of a path.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct PartAnswer {
    /// The path up to this part.
    pub path: String,
    /// What it has.
    pub doc: String,
}

impl MetricsAnswer {
    /// The answer about these figures.
    pub fn new<'a>(metrics: impl IntoIterator<Item = &'a Metric>) -> Self {
        let metrics = metrics.into_iter().map(Metric::answer).collect();
        Self { schema: METRICS_SCHEMA, metrics }
    }
}

impl Metric {
    fn answer(&self) -> MetricAnswer {
        let part =
            |(path, doc): &(String, String)| PartAnswer { path: path.clone(), doc: doc.clone() };
        MetricAnswer {
            name: self.short.map(|short| short.name),
            path: self.path.clone(),
            label: self.label.clone(),
            meaning: self.meaning.clone(),
            unit: self.unit,
            better: self.better,
            null_if: self.null_if.clone(),
            parts: self.parts.iter().map(part).collect(),
        }
    }
}
