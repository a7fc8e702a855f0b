//! `summary.json` of a sweep: the settings, and what their trials came to.

use indexmap::IndexMap;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// What the schema of the summary is called.
pub const SCHEMA: &str = "murmuration/sweep/1";

/// The summary of a sweep: its trials, and figures of each setting over the seeds.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct SweepSummary {
    /// The format of this file: `murmuration/sweep/1`.
    pub schema: String,
    /// Name of the sweep.
    pub name: String,
    /// How many trials it has: settings times seeds.
    pub trials: usize,
    /// The seeds with which every setting was run.
    pub seeds: Vec<u64>,
    /// Figures of each setting, in the order of the sweep.
    pub settings: Vec<SettingSummary>,
    /// What to check before the results are trusted, a sentence each.
    pub warnings: Vec<String>,
}

impl SweepSummary {
    /// Name of the file in the folder of a sweep.
    pub(super) const FILE: &'static str = "summary.json";
}

/// A setting, and what its trials came to.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct SettingSummary {
    /// Its number, from 0.
    pub setting: usize,
    /// The case, if the sweep has cases.
    pub case: Option<String>,
    /// Values of the keys that vary.
    #[schemars(with = "IndexMap<String, serde_json::Value>")]
    pub values: IndexMap<String, toml::Value>,
    /// Trials whose network did not form in time; their figures are left out.
    pub not_formed: usize,
    /// Trials that failed, and have no figures; absent if none did.
    #[serde(default, skip_serializing_if = "is_none")]
    pub failed: usize,
    /// What the trials came to, by figure.
    pub metrics: IndexMap<String, MetricSummary>,
}

fn is_none(n: &usize) -> bool {
    *n == 0
}

/// A figure over the trials of a setting. Only `n` is present if no trial has it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct MetricSummary {
    /// Trials that have it.
    pub n: usize,
    /// What these came to.
    #[serde(flatten)]
    pub spread: Option<MetricSpread>,
}

/// A figure over trials.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct MetricSpread {
    /// Median.
    pub median: f64,
    /// The 95 % interval of the median, by percentile bootstrap; null of few trials.
    pub median_interval_95: Option<[f64; 2]>,
    /// The interval that is shown with the median; null of a single trial, absent in summaries of earlier versions.
    #[serde(default)]
    pub interval: Option<Interval>,
    /// A quarter lies below.
    pub q25: f64,
    /// Three quarters lie below.
    pub q75: f64,
    /// Least.
    pub min: f64,
    /// Greatest.
    pub max: f64,
    /// Mean.
    pub mean: f64,
    /// Standard deviation; null of a single trial.
    pub sd: Option<f64>,
}

/// An interval about the median of a figure over trials.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Interval {
    /// Its lower end.
    pub low: f64,
    /// Its upper end.
    pub high: f64,
    /// What it is.
    pub kind: IntervalKind,
}

/// What an interval is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub enum IntervalKind {
    /// The 95 % confidence interval of the median, by percentile bootstrap; of five trials or more.
    #[serde(rename = "bootstrap-95")]
    Bootstrap95,
    /// From the least to the greatest value; of two to four trials. n values cover the median with probability 1 − 2^(1−n).
    #[serde(rename = "range")]
    Range,
}
