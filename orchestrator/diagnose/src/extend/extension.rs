//! What was added to a configuration of links or robots: the answer that programs read as JSON and people as text.

use crate::json_number;
use schemars::JsonSchema;
use serde::Serialize;

/// What the schema of an extension is called.
pub const SCHEMA: &str = "extend/1";

/// Effects added to a model of links or robots, and how much better it predicts with them.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Extension {
    /// The format of this answer.
    #[schemars(extend("const" = SCHEMA))]
    pub schema: &'static str,
    /// Names of the effects that were added.
    pub added: Vec<String>,
    /// Whether the search came to its end. If not, a signal or a time budget ended it, and further effects may be missing.
    pub complete: bool,
    /// Held-out log predictive density before and after (nats per row).
    #[serde(serialize_with = "json_number::serialize")]
    #[schemars(with = "[Option<f64>; 2]")]
    pub log_score: [f64; 2],
    /// Held-out root mean squared error before and after (dB, m or a share of frames).
    #[serde(serialize_with = "json_number::serialize")]
    #[schemars(with = "[Option<f64>; 2]")]
    pub rmse: [f64; 2],
    /// Unit of errors in words.
    #[serde(skip)]
    pub error_unit: &'static str,
}

/// An extension as a person reads it on a terminal.
#[must_use]
pub fn text(extension: &Extension) -> String {
    let Extension { added, log_score, rmse, complete, error_unit, .. } = extension;
    let partial = if *complete { "" } else { " (partial: further effects may be missing)" };
    format!(
        "added {}{partial}. Held-out log score {:.4} -> {:.4}, rmse {:.4} -> {:.4} {error_unit}",
        added.join(", "),
        log_score[0],
        log_score[1],
        rmse[0],
        rmse[1]
    )
}
