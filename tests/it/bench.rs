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

/// Of each row of a table of bench, the words that do not depend on the machine, by number of agents.
///
/// * `first`: how the head of the table begins. Rows begin with a number.
/// * `words`: the places of these words in a row, from 0.
fn reproducible(text: &str, first: &str, words: &[usize]) -> BTreeMap<(u32, usize), Vec<String>> {
    let is_row = |line: &&str| line.trim_start().starts_with(|first: char| first.is_ascii_digit());
    let lines = text.lines().skip_while(|line| !line.trim_start().starts_with(first));
    let rows = lines.skip_while(|line| !is_row(line)).take_while(is_row);
    let row = |(number, line): (usize, &str)| {
        let own: Vec<&str> = line.split_whitespace().collect();
        let agents = own[0].split('/').next().unwrap().parse().unwrap();
        ((agents, number), words.iter().map(|&word| own[word].to_owned()).collect())
    };
    rows.enumerate().map(row).collect()
}

/// Compares a table of the page with what bench prints, up to so many agents; all rows if the environment asks for them.
fn assert_page_is_true(table: &str, most_agents: u32, first: &str, words: &[usize]) {
    let page = tests::repository().join("docs/performance.md");
    let mut said_rows = reproducible(&std::fs::read_to_string(page).unwrap(), first, words);
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
    let printed_rows = reproducible(&printed, first, words);
    assert!(5 <= printed_rows.len(), "{printed}");
    assert_eq!(said_rows, printed_rows);
}

#[test]
fn networks_of_swarms_form_when_the_page_says() {
    assert_page_is_true("swarm", 100, "agents  formed s", &[0, 1]);
}

#[test]
fn standing_networks_form_and_deliver_as_the_page_says() {
    // Motes, scheduling function, period of the application, time of formation, and PDR.
    assert_page_is_true("standing", 100, "motes/", &[0, 1, 2, 3, 6]);
}
