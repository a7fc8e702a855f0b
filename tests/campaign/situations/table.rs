//! The table of outcomes.

use super::truth::Outcome;
use crate::campaign::blind::{percent, texts};
use serde_json::Value;
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;

/// The table as Markdown, from the lines kept: of each situation if `is_open`, and of all.
#[must_use]
pub fn table(lines: &[Value], is_open: bool) -> String {
    let mut situations: BTreeMap<&str, Vec<&Value>> = BTreeMap::new();
    for line in lines {
        situations.entry(line["situation"].as_str().unwrap_or_default()).or_default().push(line);
    }
    let names = Outcome::ALL.map(Outcome::name).join(" | ");
    let mut text = format!(
        "| situation | campaigns | {names} | no answer | intervals that cover | median s | false claims |\n\
         |---|---|---|---|---|---|---|---|---|---|---|\n"
    );
    if is_open {
        for (name, lines) in &situations {
            let _ = writeln!(text, "{}", row(name, lines, true));
        }
    }
    let all: Vec<&Value> = lines.iter().collect();
    let _ = writeln!(text, "{}", row("all", &all, is_open));
    for outcome in [Outcome::Right, Outcome::FalselyCertain] {
        let _ = writeln!(
            text,
            "\n{}: {} of {}, {} (95 % interval); by situation, {} of {} at least once",
            outcome.name(),
            count(&all, outcome),
            all.len(),
            percent(count(&all, outcome), all.len()),
            situations.values().filter(|lines| 0 < count(lines, outcome)).count(),
            situations.len(),
        );
    }
    text
}

fn count(lines: &[&Value], outcome: Outcome) -> usize {
    lines.iter().filter(|line| line["judgement"] == outcome.name() && !has_failed(line)).count()
}

fn has_failed(line: &Value) -> bool {
    line["error"].is_string()
}

fn row(name: &str, lines: &[&Value], is_open: bool) -> String {
    let mut text = format!("| {name} | {}", lines.len());
    for outcome in Outcome::ALL {
        let _ = write!(text, " | {}", count(lines, outcome));
    }
    let covered = lines.iter().flat_map(|line| line["covered"].as_array().into_iter().flatten());
    let covered: Vec<bool> = covered.map(|covers| covers == true).collect();
    let mut seconds: Vec<f64> = lines.iter().filter_map(|line| line["wall_s"].as_f64()).collect();
    seconds.sort_by(f64::total_cmp);
    let wrong: BTreeSet<&str> = lines.iter().flat_map(|line| texts(&line["wrong"])).collect();
    let wrong: Vec<&str> = wrong.into_iter().filter(|_| is_open).collect();
    let _ = write!(
        text,
        " | {} | {} of {} | {} | {} |",
        lines.iter().filter(|line| has_failed(line)).count(),
        covered.iter().filter(|covers| **covers).count(),
        covered.len(),
        seconds.get(seconds.len() / 2).map_or_else(|| "–".to_owned(), |s| format!("{s:.1}")),
        if wrong.is_empty() { "–".to_owned() } else { wrong.join(", ") },
    );
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn a_table_counts_outcomes_and_hides_situations_that_are_not_open() {
        let line = |situation: &str, judgement: &str, wrong: &[&str]| {
            json!({"situation": situation, "judgement": judgement, "wrong": wrong, "wall_s": 2.0,
                "covered": [true, false]})
        };
        let lines = [
            line("A01 null", "right", &[]),
            line("A01 null", "falsely certain", &["drift"]),
            line("A02 drift", "hedged", &[]),
            json!({"situation": "A02 drift", "judgement": "cannot tell", "error": "not done"}),
        ];
        let text = table(&lines, true);
        assert!(text.contains("| A01 null | 2 | 1 | 0 | 0 | 0 | 1 | 0 | 2 of 4 | 2.0 | drift |"));
        assert!(text.contains("| all | 4 | 1 | 0 | 0 | 1 | 1 | 1 | 3 of 6 | 2.0 | drift |"));
        assert!(text.contains("falsely certain: 1 of 4, 25 % (1 to 81)"), "{text}");
        let text = table(&lines, false);
        assert!(!text.contains("A0") && !text.contains("drift |"), "{text}");
    }
}
