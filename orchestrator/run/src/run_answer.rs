//! What `murmuration run --json` writes: the summary of the run, and where its results are.

use super::RunReport;
use record::run_summary::RunSummary;
use schemars::JsonSchema;
use serde::Serialize;

/// The summary of a run, as `summary.json` has it, and where its results are.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct RunAnswer {
    /// The summary.
    #[serde(flatten)]
    pub summary: RunSummary,
    /// The folder of the results.
    pub folder: String,
    /// The folder of an earlier result that kept its place; null if there was none, or it was replaced.
    pub kept_folder: Option<String>,
    /// Why the earlier result was not replaced.
    pub kept_because: Option<String>,
}

impl RunAnswer {
    /// Of a run that has ended.
    #[must_use]
    pub fn from_report(report: &RunReport) -> Self {
        let finished = &report.finished;
        let kept = finished.kept.as_ref();
        Self {
            summary: finished.summary.clone(),
            folder: finished.dir.display().to_string(),
            kept_folder: kept.map(|kept| kept.dir.display().to_string()),
            kept_because: kept.map(|kept| kept.reason.to_string()),
        }
    }
}
