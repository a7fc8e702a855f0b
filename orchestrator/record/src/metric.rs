//! The figures of `summary.json` that a sweep, a report or a program can name: path, short name, meaning, unit, and direction.
//!
//! Paths and meanings come from the JSON Schema of [`RunSummary`], so they cannot differ from what is written. `x-better` in it says
//! which values are better. Figures of `task` have names instead of fields; [`TASK_FIGURES`] lists them. A part of a path that depends
//! on the run, such as a kind of packets, is `*`.

mod answer;
mod short_names;
mod words;

pub use answer::{METRICS_SCHEMA, MetricAnswer, MetricsAnswer};
pub use short_names::{SHORT_NAMES, ShortName, Subject};
pub use words::{explained, paths, table, unknown};

use crate::run_summary::RunSummary;
use metrics::figures::Better;
use metrics::task_figures::TASK_FIGURES;
use numbers::format::capitalised;
use numbers::quantity;
use proto::config::most_similar;
use schemars::generate::SchemaSettings;
use serde_json::Value;
use std::sync::LazyLock;

/// Keys of `summary.json` below which the figures are that a sweep has columns of.
pub const SECTIONS: [&str; 5] = ["steps", "simulated_s", "task", "network", "kpis"];

/// A figure of `summary.json`.
#[derive(Clone, Debug, PartialEq)]
pub struct Metric {
    /// Its path: `kpis.delivery.ratio`. A part that depends on the run is `*`.
    pub path: String,
    /// Its short name, if it has one.
    pub short: Option<&'static ShortName>,
    /// What an axis calls it, without its unit.
    pub label: String,
    /// What it is, in a sentence or more.
    pub meaning: String,
    /// What each part of the path is, from the first on: path and description.
    pub parts: Vec<(String, String)>,
    /// Its unit; [`SHARE`] of a share, [`FLAG`] of a truth value, none of a number or count.
    pub unit: Option<&'static str>,
    /// Which values are better.
    pub better: Better,
    /// When it is null or absent: each what follows "null if". Empty: never.
    pub null_if: Vec<String>,
}

/// The unit of a share.
pub const SHARE: &str = "0 to 1";
/// The unit of a truth value.
pub const FLAG: &str = "yes, no";

impl Metric {
    /// The short name, or else the path.
    #[must_use]
    pub fn name(&self) -> &str {
        self.short.map_or(&self.path, |short| short.name)
    }

    /// The unit on an axis: none of shares and truth values, which are shown as per cent.
    #[must_use]
    pub fn axis_unit(&self) -> Option<&'static str> {
        self.unit.filter(|unit| ![SHARE, FLAG].contains(unit))
    }

    /// Whether a path is of this figure.
    fn covers(&self, path: &str) -> bool {
        let [own, given] = [&self.path, path].map(|path| path.split('.').collect::<Vec<&str>>());
        is_of(&own, &given)
    }

    /// Whether it stands for several figures, whose names depend on the run.
    #[must_use]
    pub fn is_open(&self) -> bool {
        self.path.split('.').any(|part| part == ANY)
    }
}

/// Whether a path is of a pattern, in which `*` stands for one part or several. No part is empty.
fn is_of(pattern: &[&str], path: &[&str]) -> bool {
    match (pattern, path) {
        ([], rest) => rest.is_empty(),
        (_, [] | ["", ..]) => false,
        ([ANY, rest @ ..], [_, after @ ..]) => is_of(rest, after) || is_of(pattern, after),
        ([part, rest @ ..], [given, after @ ..]) => part == given && is_of(rest, after),
    }
}

/// A part of a path that depends on the run.
const ANY: &str = "*";
/// The path of figures that only a robot simulator knows.
const OF_ROBOTS: &str = "task.*";

/// What is known of such a figure.
const BY_ROBOTS: &str = "A figure that the robot simulator reports by this name.";

/// Whose robot simulator a run has: only that of the program has no figures but the known ones.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Robots {
    /// That of the program.
    BuiltIn,
    /// One at a URL, or one that a command starts.
    Foreign,
}

/// All figures, in the order of `summary.json`.
#[must_use]
pub fn metrics() -> &'static [Metric] {
    static METRICS: LazyLock<Vec<Metric>> = LazyLock::new(from_types);
    &METRICS
}

/// The path of a name: that of a short name; of anything else itself.
#[must_use]
pub fn path_of(name: &str) -> &str {
    SHORT_NAMES.iter().find(|short| short.name == name).map_or(name, |short| short.path)
}

/// The figure of a short name or a path; of a path whose end depends on the run, with that path. `None`: there is none.
#[must_use]
pub fn find(name: &str, robots: Robots) -> Option<Metric> {
    let path = path_of(name);
    let of_path = |metric: &&Metric| metric.path == path && !metric.is_open();
    if let Some(metric) = metrics().iter().find(of_path) {
        return Some(metric.clone());
    }
    let is_known = |metric: &&Metric| {
        metric.is_open()
            && metric.covers(path)
            && (robots == Robots::Foreign || metric.path != OF_ROBOTS)
    };
    let family = metrics().iter().find(is_known)?;
    // Of figures of another simulator, only the name says what they are.
    let unit = family.unit.or_else(|| numbers::quantity::unit(path));
    let meaning = if family.path == OF_ROBOTS { BY_ROBOTS } else { &family.meaning }.to_owned();
    Some(Metric { path: path.to_owned(), label: words_of(path), unit, meaning, ..family.clone() })
}

/// The name that is most likely meant by one that is none.
#[must_use]
pub fn nearest(name: &str) -> Option<&'static str> {
    let lower = name.to_lowercase();
    let last = lower.rsplit('.').next().unwrap_or(&lower);
    let closed = || metrics().iter().filter(|metric| !metric.is_open());
    let spelt = |short: &&ShortName| {
        short.name == last
            || short.also.contains(&last)
            || short.label.replace([' ', '-'], "_") == last
    };
    if let Some(short) = SHORT_NAMES.iter().find(spelt) {
        return Some(short.name);
    }
    let ends_so = |metric: &&Metric| metric.path.rsplit('.').next() == Some(last);
    if let Some(metric) = closed().find(ends_so) {
        return Some(&metric.path);
    }
    let paths = || closed().map(|metric| metric.path.as_str());
    if lower.contains('.') {
        return most_similar(&lower, paths());
    }
    most_similar(&lower, SHORT_NAMES.iter().map(|short| short.name))
}

/// What is known of a place in the summary.
#[derive(Clone, Debug, Default)]
struct Trail {
    path: String,
    parts: Vec<(String, String)>,
    better: Option<Better>,
    null_if: Vec<String>,
}

impl Trail {
    /// What is known of a key below it.
    fn below(&self, key: &str, description: &str, better: Option<Better>) -> Self {
        let path = proto::config::join(&self.path, key);
        let mut trail = Self { better: better.or(self.better), path, ..self.clone() };
        if !description.is_empty() {
            trail.parts.push((trail.path.clone(), description.to_owned()));
            trail.null_if.extend(null_if(description));
        }
        trail
    }

    /// The figure that is here.
    fn metric(self, is_flag: bool) -> Metric {
        let short = SHORT_NAMES.iter().find(|short| short.path == self.path);
        let description = self.parts.last().map(|(_, text)| text.clone()).unwrap_or_default();
        Metric {
            label: short.map_or_else(|| words_of(&self.path), |short| short.label.to_owned()),
            meaning: short.map_or(description, |short| format!("{}.", capitalised(short.meaning))),
            unit: if is_flag { Some(FLAG) } else { unit_of(&self.path) },
            better: self.better.unwrap_or(Better::Neither),
            short,
            path: self.path,
            parts: self.parts,
            null_if: self.null_if,
        }
    }
}

/// What a description says of when a figure is null or absent.
fn null_if(description: &str) -> Option<String> {
    let begin = ["null if ", "absent if "]
        .iter()
        .find_map(|words| Some(description.find(words)? + words.len()))?;
    let rest = &description[begin..];
    let end = rest.find(';').into_iter().chain(rest.find(". ")).min();
    Some(rest[..end.unwrap_or(rest.len())].trim_end_matches('.').to_owned())
}

/// All figures, from the schema of `summary.json` and the list of figures of a task.
fn from_types() -> Vec<Metric> {
    let generator = SchemaSettings::draft2020_12().for_serialize().into_generator();
    let schema = generator.into_root_schema_for::<RunSummary>().to_value();
    let mut metrics = Vec::new();
    for section in SECTIONS {
        let found = schema.get("properties").and_then(|properties| properties.get(section));
        if let Some(found) = found {
            walk(&schema, found, section, &Trail::default(), &mut metrics);
        }
    }
    let place = metrics.iter().position(|metric| metric.path == OF_ROBOTS);
    if let Some(place) = place {
        let task = metrics[place].clone();
        let of_task = TASK_FIGURES.iter().map(|figure| {
            let known = Trail {
                path: "task".to_owned(),
                parts: task.parts[..task.parts.len().min(1)].to_vec(),
                better: None,
                null_if: task.null_if[..task.null_if.len().min(1)].to_vec(),
            };
            let doc = format!("{}; null if {}", capitalised(figure.doc), figure.null_if);
            known.below(figure.name, &doc, Some(figure.better)).metric(figure.is_flag)
        });
        let of_task: Vec<Metric> = of_task.collect();
        metrics.splice(place..place, of_task);
    }
    metrics
}

/// Adds the figures of a schema and of everything below it.
fn walk(root: &Value, schema: &Value, key: &str, above: &Trail, metrics: &mut Vec<Metric>) {
    let forms = forms(root, schema);
    // The lines of a description are those of the sources.
    let text = |schema: &Value, name: &str| {
        Some(schema.get(name)?.as_str()?.split_whitespace().collect::<Vec<_>>().join(" "))
    };
    let described = std::iter::once(schema).chain(forms.iter().copied());
    let description = described.clone().find_map(|form| text(form, "description"));
    let better = described.filter_map(|form| text(form, "x-better")).find_map(|text| {
        [Better::Higher, Better::Lower, Better::Neither].into_iter().find(|of| of.name() == text)
    });
    let trail = above.below(key, &description.unwrap_or_default(), better);
    let is_of = |kind: &str| {
        forms.iter().any(|form| match form.get("type") {
            Some(Value::String(only)) => only == kind,
            Some(Value::Array(kinds)) => kinds.iter().any(|one| one == kind),
            _ => false,
        })
    };
    if is_of("number") || is_of("integer") || is_of("boolean") {
        let is_flag = !is_of("number") && !is_of("integer");
        metrics.push(trail.clone().metric(is_flag));
    }
    for form in &forms {
        let properties = form.get("properties").and_then(Value::as_object);
        for (name, property) in properties.into_iter().flatten() {
            walk(root, property, name, &trail, metrics);
        }
        if let Some(any) = form.get("additionalProperties").filter(|any| any.is_object()) {
            walk(root, any, ANY, &trail, metrics);
        }
    }
}

/// The schemas that a value may satisfy: references followed, alternatives apart.
fn forms<'a>(root: &'a Value, schema: &'a Value) -> Vec<&'a Value> {
    if let Some(name) = schema.get("$ref").and_then(Value::as_str) {
        let target = name.strip_prefix('#').and_then(|pointer| root.pointer(pointer));
        return target.map_or_else(Vec::new, |target| forms(root, target));
    }
    let alternatives = ["oneOf", "anyOf"].iter().filter_map(|any| schema.get(any)?.as_array());
    let alternatives: Vec<&Value> = alternatives.flatten().collect();
    if alternatives.is_empty() {
        return vec![schema];
    }
    let mut all: Vec<&Value> =
        alternatives.into_iter().flat_map(|other| forms(root, other)).collect();
    if schema.get("properties").is_some() {
        all.push(schema);
    }
    all
}

/// Ends of names of shares.
const SHARES: [&str; 4] = ["ratio", "share", "duty_cycle", "polarisation"];

/// The unit of a path: of its last part that has one.
fn unit_of(path: &str) -> Option<&'static str> {
    let is_share = |part: &str| SHARES.iter().any(|share| part.ends_with(share));
    path.rsplit('.')
        .find_map(|part| quantity::unit(part).or_else(|| is_share(part).then_some(SHARE)))
}

/// Statistics, which stand before what they are of.
const STATISTICS: [&str; 6] = ["min", "mean", "median", "p95", "p99", "max"];

/// The words of a path in `summary.json`, without its section and without parts that the next one repeats.
fn words_of(path: &str) -> String {
    let path: Vec<&str> = path.split('.').collect();
    let parts = if 1 < path.len() { &path[1..] } else { &path };
    let mut words: Vec<String> = parts.iter().map(|part| quantity::words(part)).collect();
    let stem = |word: &str| word.chars().take(4).collect::<String>();
    let is_kept: Vec<bool> = (0..words.len())
        .map(|part| words.get(part + 1).is_none_or(|next| stem(next) != stem(&words[part])))
        .collect();
    let mut is_kept = is_kept.into_iter();
    words.retain(|_| is_kept.next().unwrap_or(true));
    if words.last().is_some_and(|last| STATISTICS.contains(&last.as_str())) {
        words.rotate_right(1);
    }
    words.join(" ")
}

#[cfg(test)]
mod tests;
