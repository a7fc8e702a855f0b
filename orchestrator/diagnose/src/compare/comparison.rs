//! What a comparison of links or robots found: the answer that programs read as JSON, pages draw and people read as text.

use crate::json_number;
use indexmap::IndexMap;
use measure::account::DataAccount;
use schemars::JsonSchema;
use serde::Serialize;
use study::open::Subject;

/// What the schema of a comparison is called.
pub const SCHEMA: &str = "compare/1";

/// A comparison: how large the error of a model of links or robots is on data left out, and where.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct Comparison {
    /// The format of this answer.
    #[schemars(extend("const" = SCHEMA))]
    pub schema: &'static str,
    /// What the measurements are of: links or robots.
    pub kind: Subject,
    /// What the blocks of data are that were left out together.
    pub unit: String,
    /// Held-out scores by name; a name ends in the unit of the score, if it has one.
    #[serde(serialize_with = "json_number::serialize")]
    #[schemars(with = "IndexMap<String, Option<f64>>")]
    pub scores: IndexMap<String, f64>,
    /// The ends of the 90 % interval of each score, by bootstrap over blocks.
    #[serde(serialize_with = "json_number::serialize")]
    #[schemars(with = "IndexMap<String, [Option<f64>; 2]>")]
    pub intervals: IndexMap<String, [f64; 2]>,
    /// Of links: by how much readings lie above the model, alike on all rows (dB); absent where that is not significant. Covariates
    /// are ranked by what they explain beside it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub offset_db: Option<Offset>,
    /// Covariates, by how much of the variance of the error their bins explain, most first.
    #[serde(rename = "where")]
    pub places: Vec<Place>,
    /// The file of measurements, and how much of it was used.
    #[serde(flatten)]
    pub account: DataAccount,
}

/// A constant error of all rows (dB).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Offset {
    /// The likeliest constant: negative where readings lie below the model.
    pub value: f64,
    /// Lower end of the 90 % interval.
    pub low: f64,
    /// Upper end of the 90 % interval.
    pub high: f64,
}

impl Offset {
    /// A constant whose interval does not include 0.
    #[must_use]
    pub fn significant(value: f64, low: f64, high: f64) -> Option<Self> {
        (0.0 < low || high < 0.0).then_some(Self { value, low, high })
    }
}

/// A covariate, and the error over it.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Place {
    /// Name of the covariate: a column, or a quantity computed from the rows.
    pub covariate: String,
    /// The share of the variance of the error that the means of its bins explain, less what as many bins of noise would; an
    /// offset of all rows is not counted.
    #[serde(serialize_with = "json_number::serialize")]
    #[schemars(with = "Option<f64>")]
    pub explained: f64,
    /// Probability of as much by chance (F test).
    #[serde(serialize_with = "json_number::serialize")]
    #[schemars(with = "Option<f64>")]
    pub p_value: f64,
    /// The same of the surprise of reception; null where reception is unknown.
    pub reception: Option<Explained>,
    /// The same of the error of the heading at the end of a window; absent of links and of robots whose body does not turn.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub heading: Option<Explained>,
    /// Bins with about as many rows each.
    pub bins: Vec<Bin>,
}

/// What the bins of a covariate explain of an error.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Explained {
    /// The share of the variance of the error.
    #[serde(serialize_with = "json_number::serialize")]
    #[schemars(with = "Option<f64>")]
    pub explained: f64,
    /// Probability of as much by chance (F test).
    #[serde(serialize_with = "json_number::serialize")]
    #[schemars(with = "Option<f64>")]
    pub p_value: f64,
}

/// Errors in a range of a covariate.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Bin {
    /// Least value of the covariate.
    pub from: f64,
    /// Greatest value of the covariate.
    pub to: f64,
    /// Number of rows in the bin.
    pub n: usize,
    /// Mean of measured less predicted (dB, m or a share of frames).
    #[serde(serialize_with = "json_number::serialize")]
    #[schemars(with = "Option<f64>")]
    pub bias: f64,
    /// Root mean square of measured less predicted (dB, m or a share of frames).
    #[serde(serialize_with = "json_number::serialize")]
    #[schemars(with = "Option<f64>")]
    pub rmse: f64,
}
