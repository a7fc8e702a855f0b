//! The table of judgements.

use crate::campaign::blind::{percent, texts};
use serde_json::Value;
use std::collections::BTreeMap;
use std::fmt::Write as _;

/// The tables as Markdown, from the lines kept: by row, and by variant for rows with several.
#[must_use]
pub fn tables(lines: &[Value]) -> String {
    let judged = || lines.iter().filter(|line| line["judgement"].is_string());
    let mut rows: BTreeMap<String, Vec<&Value>> = BTreeMap::new();
    let mut variants: BTreeMap<String, Vec<&Value>> = BTreeMap::new();
    for line in judged() {
        let [row, variant] = ["row", "variant"].map(|key| line[key].as_str().unwrap_or_default());
        rows.entry(row.to_owned()).or_default().push(line);
        variants.entry(format!("{row}: {variant}")).or_default().push(line);
    }
    // A row with one variant needs no second line.
    variants.retain(|_, lines| {
        let row = &rows[lines[0]["row"].as_str().unwrap_or_default()];
        lines.len() < row.len()
    });
    let mut text = table("row", &rows);
    let all: Vec<&Value> = judged().collect();
    if 1 < rows.len() {
        let _ = writeln!(text, "{}", table_row("all", &all));
    }
    if !variants.is_empty() {
        text.push('\n');
        text.push_str(&table("variant", &variants));
    }
    let n_failed = lines.iter().filter(|line| line["error"].is_string()).count();
    let _ = writeln!(text, "\nCampaigns without an answer: {n_failed} of {}.", lines.len());
    text
}

fn table(of: &str, groups: &BTreeMap<String, Vec<&Value>>) -> String {
    let mut text = format!(
        "| {of} | campaigns | honest | uncertain | false certain | most frequent wrong names |\n\
         |---|---|---|---|---|---|\n"
    );
    for (name, lines) in groups {
        let _ = writeln!(text, "{}", table_row(name, lines));
    }
    text
}

fn table_row(name: &str, lines: &[&Value]) -> String {
    let count =
        |judgement: &str| lines.iter().filter(|line| line["judgement"] == judgement).count();
    format!(
        "| {name} | {} | {} | {} | {} | {} |",
        lines.len(),
        percent(count("honest"), lines.len()),
        count("uncertain"),
        count("false-certain"),
        wrong_names(lines),
    )
}

/// The four most frequent wrong names.
fn wrong_names(lines: &[&Value]) -> String {
    let mut counts: BTreeMap<&str, usize> = BTreeMap::new();
    for name in lines.iter().flat_map(|line| texts(&line["wrong"])) {
        *counts.entry(name).or_default() += 1;
    }
    let mut counts: Vec<(&str, usize)> = counts.into_iter().collect();
    counts.sort_by_key(|&(name, n)| (std::cmp::Reverse(n), name));
    let named: Vec<String> =
        counts.iter().take(4).map(|(name, n)| format!("{name} ({n})")).collect();
    if named.is_empty() { "–".to_owned() } else { named.join(", ") }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    fn line(row: &str, variant: &str, judgement: &str, wrong: &[&str]) -> Value {
        json!({"row": row, "variant": variant, "judgement": judgement, "wrong": wrong})
    }

    #[test]
    fn a_table_counts_judgements_and_wrong_names() {
        let lines = [
            line("04 drift", "drift", "honest", &[]),
            line("04 drift", "drift", "false-certain", &["temperature", "humidity_pct"]),
            line("04 drift", "drift", "uncertain", &["temperature"]),
            json!({"row": "04 drift", "variant": "drift", "error": "not done after 300 s",
                "judgement": "uncertain"}),
        ];
        let text = tables(&lines);
        let row = "| 04 drift | 4 | 25 % (1 to 81) | 2 | 1 | temperature (2), humidity_pct (1) |";
        assert!(text.contains(row), "{text}");
        assert!(text.contains("without an answer: 1 of 4"), "{text}");
        assert!(!text.contains("| all |") && !text.contains("| variant |"), "{text}");
    }

    #[test]
    fn variants_have_a_table_of_their_own() {
        let lines = [
            line("01 robots", "slip", "honest", &[]),
            line("01 robots", "veer", "honest", &[]),
            line("null links: white", "", "honest", &[]),
        ];
        let text = tables(&lines);
        assert!(text.contains("| all | 3 | 100 % (29 to 100) | 0 | 0 | – |"), "{text}");
        assert!(text.contains("| 01 robots: slip | 1 |"), "{text}");
        assert!(!text.contains("null links: white: "), "{text}");
    }
}
