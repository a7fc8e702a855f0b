//! What changed from one run, or one sweep, to another, in words: the text of the terminal.

use super::runs_comparison::{RunsComparison, SettingComparison};
use numbers::format::{count_of, number};
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

fn table(text: &mut String, setting: &SettingComparison) {
    let pairs = count_of(setting.seeds.len() as u64, "pair");
    let keys: Vec<String> = setting.setting.iter().map(|(k, v)| format!("{k} {v}")).collect();
    let heading =
        if keys.is_empty() { pairs.clone() } else { format!("{} ({pairs})", keys.join(", ")) };
    let changes = &setting.figures;
    let (changed, same): (Vec<_>, Vec<_>) = changes.iter().partition(|(_, it)| it.is_changed);
    let _ = writeln!(text, "\n{heading}");
    if changed.is_empty() {
        let _ = writeln!(text, "  none of {} figures differs", changes.len());
        return;
    }
    let headings = ["figure", "A", "B", "B − A", "95 % interval", "B greater / less"];
    let mut rows = vec![headings.map(str::to_owned).to_vec()];
    rows.extend(changed.iter().map(|(name, change)| {
        let interval = change.median_difference_interval_95.map_or_else(
            || "-".to_owned(),
            |[low, high]| format!("{} … {}", number(low), number(high)),
        );
        vec![
            (*name).clone(),
            number(change.median_a),
            number(change.median_b),
            number(change.median_difference),
            interval,
            format!("{} / {} of {}", change.b_greater, change.b_less, change.pairs),
        ]
    }));
    for line in terminal::aligned(&rows) {
        let _ = writeln!(text, "  {line}");
    }
    if !same.is_empty() {
        let _ = writeln!(text, "  {} do not differ", count_of(same.len() as u64, "further figure"));
    }
}
