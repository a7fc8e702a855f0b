//! What changed from one run, or one sweep, to another, in words: the text of the terminal.

use super::runs_comparison::{Change, RunsComparison, SettingComparison};
use crate::sweep_summary::IntervalKind;
use numbers::format::count_of;
use numbers::layout::TextTable;
use std::fmt::Write as _;

/// What changed as a person reads it on a terminal.
#[must_use]
pub fn text(comparison: &RunsComparison) -> String {
    let mut text = format!("A {}\nB {}\n", comparison.a, comparison.b);
    if comparison.configuration.is_empty() {
        text.push_str("\nThe configurations do not differ.\n");
    } else {
        text.push_str("\nConfiguration, A -> B\n");
        for changed in &comparison.configuration {
            let _ = writeln!(text, "  {}: {} -> {}", changed.key, changed.a, changed.b);
        }
    }
    for setting in &comparison.settings {
        table(&mut text, setting);
    }
    text.truncate(text.trim_end().len());
    text
}

/// A number in a column whose other numbers may be large: all have the same minus.
fn number(value: f64) -> String {
    numbers::format::number(value).replace('-', "−")
}

fn table(text: &mut String, setting: &SettingComparison) {
    let pairs = count_of(setting.seeds.len() as u64, "pair");
    let keys: Vec<String> = setting.setting.iter().map(|(k, v)| format!("{k} {v}")).collect();
    let heading =
        if keys.is_empty() { pairs.clone() } else { format!("{} ({pairs})", keys.join(", ")) };
    let changes = &setting.figures;
    let (changed, same): (Vec<_>, Vec<_>) = changes.iter().partition(|(_, it)| it.is_changed);
    let _ = writeln!(text, "\n{heading}");
    if changed.is_empty() {
        let _ = writeln!(text, "none of {} figures differs", changes.len());
        return;
    }
    let is_range = |change: &Change| {
        change.interval.is_some_and(|interval| interval.kind == IntervalKind::Range)
    };
    let has_ranges = changed.iter().any(|(_, change)| is_range(change));
    let interval = if has_ranges { "interval" } else { "95 % interval" };
    let headings = ["figure", "A", "B", "B − A", interval, "B greater / less"];
    let mut table = TextTable::new(headings);
    for (name, change) in changed {
        let interval = change.interval.map_or_else(
            || "-".to_owned(),
            |interval| {
                let ends = format!("{} … {}", number(interval.low), number(interval.high));
                match interval.kind {
                    IntervalKind::Bootstrap95 => ends,
                    IntervalKind::Range => format!("{ends} {}", interval.words(change.pairs)),
                }
            },
        );
        // Of a figure that some runs lack there are fewer pairs.
        let of = if change.pairs == setting.seeds.len() {
            String::new()
        } else {
            format!(" of {}", change.pairs)
        };
        table.row([
            name.clone(),
            number(change.median_a),
            number(change.median_b),
            number(change.median_difference),
            interval,
            format!("{} / {}{of}", change.b_greater, change.b_less),
        ]);
    }
    text.push_str(&table.text());
    if !same.is_empty() {
        let _ = writeln!(text, "{} do not differ", count_of(same.len() as u64, "further figure"));
    }
}
