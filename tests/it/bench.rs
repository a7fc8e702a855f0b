//! Speed through the real processes: that it is measured, and that the page shows what does not depend on the machine.

use serde_json::Value;
use std::collections::{BTreeMap, BTreeSet};
use tests::{folder, orchestrator, said};

#[test]
fn rows_come_with_what_two_empty_calls_take() {
    let folder = folder();
    let args =
        ["bench", "--table", "propagation", "--agents", "5", "--steps", "20", "--json", "b.json"];
    let output = orchestrator(&args, folder.path());
    let said = said(&output);
    assert!(output.status.success(), "{said}");
    assert!(said.contains("unit disk 3 m"), "{said}");
    assert!(said.contains("Two empty calls"), "{said}");
    let text = std::fs::read_to_string(folder.path().join("b.json")).unwrap();
    let json: Value = serde_json::from_str(&text).unwrap();
    let exchange_ms = json["exchange_ms"].as_f64().unwrap();
    assert!(0.0 < exchange_ms, "{json:#}");
    let rows = json["rows"].as_array().unwrap();
    assert_eq!(rows.len(), 3, "{json:#}");
    for row in rows {
        assert_eq!(row["steps"], 20, "{json:#}");
        assert!(0.0 < row["median_ms"].as_f64().unwrap(), "{json:#}");
    }
}

/// Of each row of a table of bench, the columns that do not depend on the machine, by number of agents. `columns`: the head
/// after which a range of columns begins, empty for the beginning of the line, and the head at which it ends.
fn reproducible(text: &str, first: &str, columns: &[[&str; 2]]) -> BTreeMap<(u32, usize), String> {
    let is_head = |line: &str| line.trim_start().starts_with(first) && line.contains("formed s");
    let mut lines = text.lines().skip_while(|line| !is_head(line));
    let head = lines.next().unwrap();
    let end = |name: &str| head.find(name).unwrap() + name.len();
    let rows = lines.take_while(|line| line.starts_with(' ')).enumerate().map(|(number, line)| {
        let agents = line.split_whitespace().next().unwrap().parse().unwrap();
        let ranges = columns.iter().map(|[after, last]| &line[end(after)..end(last)]);
        ((agents, number), ranges.collect())
    });
    rows.collect()
}

/// Compares a table of the page with what bench prints, up to so many agents; all rows if the environment asks for them.
fn assert_page_is_true(table: &str, most_agents: u32, first: &str, columns: &[[&str; 2]]) {
    let page = tests::repository().join("docs/performance.md");
    let mut said_rows = reproducible(&std::fs::read_to_string(page).unwrap(), first, columns);
    if std::env::var_os("MURMURATION_ALL_ROWS").is_none() {
        said_rows.retain(|(agents, _), _| *agents <= most_agents);
    }
    let agents: BTreeSet<String> =
        said_rows.keys().map(|(agents, _)| format!("--agents={agents}")).collect();
    let mut args = vec!["bench", "--table", table, "--steps", "1"];
    args.extend(agents.iter().map(String::as_str));
    let folder = folder();
    let output = orchestrator(&args, folder.path());
    let printed = said(&output);
    assert!(output.status.success(), "{printed}");
    let printed_rows = reproducible(&printed, first, columns);
    assert!(5 <= printed_rows.len(), "{printed}");
    assert_eq!(said_rows, printed_rows);
}

#[test]
fn networks_of_swarms_form_when_the_page_says() {
    assert_page_is_true("swarm", 100, "agents", &[["", "formed s"]]);
}

#[test]
fn standing_networks_form_and_deliver_as_the_page_says() {
    assert_page_is_true("standing", 100, "motes", &[["", "formed s"], ["hour", "PDR %"]]);
}
