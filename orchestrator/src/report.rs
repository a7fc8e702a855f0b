//! stub
use crate::record::{Measures, RunHeader};
use serde_json::Value;
/// What goes into a report.
#[derive(Clone, Copy, Debug)]
pub struct Contents<'a> {
    /// What was known before the run.
    pub header: &'a RunHeader,
    /// Its `summary.json`.
    pub summary: &'a Value,
    /// Its measures; `None` of a run that was never configured.
    pub measures: Option<&'a Measures>,
    /// Its `provenance.json`.
    pub provenance: &'a Value,
}
/// page
#[must_use]
pub fn page(_contents: &Contents<'_>) -> String {
    String::new()
}
