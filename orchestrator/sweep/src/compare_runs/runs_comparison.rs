//! What changed from one run, or one sweep, to another: the answer that programs read as JSON and people as text.

use crate::sweep_summary::Interval;
use indexmap::IndexMap;
use schemars::JsonSchema;
use serde::Serialize;
use std::collections::BTreeMap;

/// What the schema of the answer is called.
pub(super) const SCHEMA: &str = "compare-runs/1";

/// What changed from A to B, seed by seed.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct RunsComparison {
    /// The format of this answer.
    #[schemars(extend("const" = SCHEMA))]
    pub schema: &'static str,
    /// Folder of A.
    pub a: String,
    /// Folder of B.
    pub b: String,
    /// Keys of the configuration whose values differ.
    pub configuration: Vec<ChangedKey>,
    /// The settings that both have, each with its figures.
    pub settings: Vec<SettingComparison>,
    /// What to check before it is believed.
    pub warnings: Vec<String>,
}

/// A key of the configuration whose value differs.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, JsonSchema)]
pub struct ChangedKey {
    /// The key.
    pub key: String,
    /// Its value in A, or `absent`.
    pub a: String,
    /// Its value in B, or `absent`.
    pub b: String,
}

/// A setting that both have; a run has one, without keys.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct SettingComparison {
    /// The case, and the values of what varies.
    pub setting: BTreeMap<String, String>,
    /// Seeds of the pairs of trials.
    pub seeds: Vec<u64>,
    /// The figures that both have, by name.
    pub figures: IndexMap<String, Change>,
}

/// How a figure changed.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Change {
    /// Pairs of trials that have it on both sides.
    pub pairs: usize,
    /// Median of A.
    pub median_a: f64,
    /// Median of B.
    pub median_b: f64,
    /// Median of the differences B − A, pair by pair.
    pub median_difference: f64,
    /// The 95 % interval of that median, by percentile bootstrap; null of few pairs.
    pub median_difference_interval_95: Option<[f64; 2]>,
    /// The interval that is shown with the median of the differences; null of a single pair.
    pub interval: Option<Interval>,
    /// Mean of the differences.
    pub mean_difference: f64,
    /// Least difference.
    pub min_difference: f64,
    /// Greatest difference.
    pub max_difference: f64,
    /// Pairs in which B is greater.
    pub b_greater: usize,
    /// Pairs in which B is less.
    pub b_less: usize,
    /// The figure differs in some pair by more than rounding does.
    #[serde(skip)]
    pub is_changed: bool,
}
