//! Figures as people read them: in lines of at most 80 characters.

use super::short_names::Subject;
use super::{Metric, SHORT_NAMES, metrics, nearest};
use experiment::program_name;
use metrics::figures::Better;
use numbers::format::wrapped;
use std::fmt::Write as _;

/// Width of text for people.
const WIDTH: usize = 80;
/// What stands for a unit where there is none.
const NO_UNIT: &str = "–";

/// The short names with meaning, unit and direction.
#[must_use]
pub fn table() -> String {
    let known = |path: &str| metrics().iter().find(|metric| metric.path == path);
    let width = SHORT_NAMES.iter().map(|short| short.name.len()).max().unwrap_or_default();
    let meaning = SHORT_NAMES.iter().map(|short| short.meaning.chars().count()).max();
    let meaning = meaning.unwrap_or_default();
    let mut text = format!("{:width$}  {:meaning$}  {:7}  better", "name", "meaning", "unit");
    for subject in Subject::ALL {
        let _ = write!(text, "\n\n{}", subject.heading());
        for short in SHORT_NAMES.iter().filter(|short| short.subject == subject) {
            let Some(metric) = known(short.path) else { continue };
            let line = format!(
                "{:width$}  {:meaning$}  {:7}  {}",
                short.name,
                short.meaning,
                metric.unit.unwrap_or(NO_UNIT),
                mark(metric.better)
            );
            let _ = write!(text, "\n{}", line.trim_end());
        }
    }
    let program = program_name();
    let _ = write!(
        text,
        "\n\n`{program} metrics NAME` explains one.\n`{program} metrics --all` lists the paths of all metrics."
    );
    text
}

/// The direction in a table.
fn mark(better: Better) -> &'static str {
    if better == Better::Neither { NO_UNIT } else { better.name() }
}

/// The paths of all figures with short name, unit and direction.
#[must_use]
pub fn paths() -> String {
    let width = metrics().iter().map(|metric| metric.path.len()).max().unwrap_or_default();
    let lines = metrics().iter().map(|metric| {
        let unit = metric.unit.unwrap_or(NO_UNIT);
        let short = metric.short.map_or("", |short| short.name);
        let line = format!("{:width$}  {unit:7}  {:6}  {short}", metric.path, mark(metric.better));
        line.trim_end().to_owned()
    });
    let lines: Vec<String> = lines.collect();
    let program = program_name();
    format!(
        "{:width$}  {:7}  better  short name\n{}\n\n* stands for what depends on the run, such as a kind of packets.\n\
         `{program} metrics PATH` explains one.",
        "path",
        "unit",
        lines.join("\n")
    )
}

/// What a figure is.
#[must_use]
pub fn explained(metric: &Metric) -> String {
    let mut text = metric.name().to_owned();
    let _ = write!(text, "\n{}\n", wrapped(&metric.meaning, "  ", WIDTH));
    let mut row = |title: &str, body: &str| {
        let indent = " ".repeat(12);
        let _ = write!(text, "\n  {title:8}  {}", wrapped(body, &indent, WIDTH).trim_start());
    };
    row("path", &metric.path);
    row("unit", metric.unit.unwrap_or("none"));
    row("better", metric.better.name());
    if metric.null_if.is_empty() {
        row("null if", "never");
    }
    for (place, reason) in metric.null_if.iter().enumerate() {
        row(if place == 0 { "null if" } else { "or if" }, reason);
    }
    let _ = write!(text, "\n\nWhere it is in summary.json");
    for (path, doc) in &metric.parts {
        let _ = write!(text, "\n  {path}\n{}", wrapped(doc, "    ", WIDTH));
    }
    text
}

/// Why a name cannot be used, and which one is most likely meant.
#[must_use]
pub fn unknown(name: &str) -> String {
    let nearest = nearest(name).map(|known| format!("; did you mean {known}?")).unwrap_or_default();
    let program = program_name();
    format!(
        "unknown metric {name:?}{nearest}\n`{program} metrics` lists the short names, `{program} metrics --all` all paths"
    )
}
