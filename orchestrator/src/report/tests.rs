//! Pages of made-up runs.

use super::*;
use crate::config::{OutputConfig, Start};
use crate::record::RunHeader;
use proto::types::Coupling;
use serde_json::json;
use std::collections::BTreeMap;

fn header(name: &str) -> RunHeader {
    RunHeader {
        name: name.to_owned(),
        seed: 7,
        agent_count: 3,
        step_ns: 100_000_000,
        coupling: Coupling::Sequential,
        config_toml: "note = \"<script>\"".to_owned(),
        labels: BTreeMap::new(),
        output: OutputConfig::default(),
        start: Start::AtOnce,
        records: Vec::new(),
        statistics: Vec::new(),
        warnings: Vec::new(),
    }
}

fn page_of(summary: &Value) -> String {
    let header = header("a<b");
    page(&Contents { header: &header, summary, measures: None, provenance: &Value::Null })
}

#[test]
fn a_page_needs_nothing_from_elsewhere() {
    let page = page_of(&json!({ "status": "complete" }));
    for reference in ["http:", "https:", "<script", "<link", "<img", "url(h", "@import"] {
        assert!(!page.contains(reference), "{reference}");
    }
}

#[test]
fn names_and_configurations_are_text_not_markup() {
    let page = page_of(&json!({ "status": "complete" }));
    assert!(page.contains("<h1>a&lt;b<"));
    assert!(page.contains("note = &quot;&lt;script&gt;&quot;"));
}

#[test]
fn warnings_and_the_reason_of_a_failure_stand_at_the_top() {
    let page = page_of(&json!({
        "status": "failed", "reason": "netsim hangs", "warnings": ["check the walls"],
    }));
    let place = |text: &str| page.find(text).unwrap();
    assert!(place("netsim hangs") < place("<h2>"));
    assert!(place("check the walls") < place("<h2>"));
    assert!(page.contains("badge alert\">failed"));
}
