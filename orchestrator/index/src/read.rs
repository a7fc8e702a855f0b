//! A row of a run, a sweep or an answer, as its files say it.

use crate::listing::{Found, is_file};
use crate::row::{FirstFigure, Row};
use input::Reading;
use input::result::{PROVENANCE_FILE, ResultError, ResultFolder};
use metrics::figures::Better;
use metrics::headline;
use numbers::statistics::range;
use proto::bounds::Bound;
use record::metric::{Metric, SHARE, SHORT_NAMES, metrics as all_metrics};
use record::run_summary::RunSummary;
use record::{SCHEMA_PREFIX, Status};
use serde_json::Value;
use std::fmt::Write as _;
use std::path::Path;
use sweep::compare_runs::values_by_key;
use sweep::{SUMMARY_SCHEMA, SweepSummary};

/// A file that describes a result and has more bytes is not read.
const MOST_BYTES: Bound =
    Bound { what: "size of a file that describes a result (bytes)", most: 16 << 20 };

/// Commands whose answers are listed: what their schemas begin with.
const ANSWERS: [&str; 8] = [
    "compare",
    "diagnose",
    "extend",
    "power",
    "compare-runs",
    "diagnose-between",
    "simulate",
    "check-data",
];

/// What was read of a result.
#[derive(Debug, Default)]
pub(crate) struct Read {
    pub(crate) row: Row,
    /// The effective configuration of a run.
    pub(crate) settings: Vec<(String, toml::Value)>,
}

/// Reads what the folder of a run or a sweep holds. What is wrong with it is in its row.
pub(crate) fn finished(found: &Found, reading: Reading) -> Read {
    let mut row = Row {
        name: found.place.clone(),
        kind: "result".to_owned(),
        status: "damaged",
        when_unix_s: found.stamp.changed_unix_s(),
        ..Row::default()
    };
    let settings = filled(&mut row, &found.path, reading).unwrap_or_else(|(status, words)| {
        row.status = status;
        row.words = Some(words);
        Vec::new()
    });
    Read { row, settings }
}

/// What is wrong: the status, and why.
type Wrong = (&'static str, String);

fn unbelieved(error: ResultError) -> Wrong {
    let status = match error {
        ResultError::Changed { .. } => "changed",
        ResultError::Unknown { .. } => "unverified",
        ResultError::Read { .. } | ResultError::Format { .. } => "damaged",
    };
    (status, error.to_string())
}

fn filled(
    row: &mut Row,
    path: &Path,
    reading: Reading,
) -> Result<Vec<(String, toml::Value)>, Wrong> {
    let damaged = |error: serde_json::Error| ("damaged", format!("summary.json: {error}"));
    let folder = ResultFolder::open(path, reading).map_err(unbelieved)?;
    let text = folder.bytes(&MOST_BYTES, RunSummary::FILE).map_err(unbelieved)?;
    let value: Value = serde_json::from_slice(&text).map_err(damaged)?;
    let schema = value["schema"].as_str().unwrap_or_default();
    let has = |name: &str| is_file(&path.join(name));
    row.has_report = has("report.html");
    if schema == SUMMARY_SCHEMA {
        row.kind = "sweep".to_owned();
        of_sweep(row, &serde_json::from_value(value).map_err(damaged)?);
        return Ok(Vec::new());
    }
    if !schema.starts_with(SCHEMA_PREFIX) {
        let words = format!("summary.json has the schema {schema:?}, which is of no run or sweep");
        return Err(("damaged", words));
    }
    row.kind = "run".to_owned();
    row.has_series = has("steps.parquet");
    row.has_recording = has("run.mcap");
    for short in SHORT_NAMES {
        let number = short.path.split('.').fold(&value, |value, part| &value[part]);
        if let Some(number) = number.as_f64().or_else(|| number.as_bool().map(f64::from)) {
            row.figures.insert(short.name, number);
        }
    }
    let summary: RunSummary = serde_json::from_value(value).map_err(damaged)?;
    row.when_unix_s = ended_unix_s(path).or(row.when_unix_s);
    row.seed = Some(summary.seed);
    row.simulated_s = Some(summary.simulated_s);
    row.n_warnings = summary.warnings.len();
    row.first = summary.first_figure().map(|(headline, shown, value)| FirstFigure {
        words: shown.words.to_owned(),
        unit: shown.unit.to_owned(),
        is_greater_better: Some(headline.better == headline::Better::Greater),
        value,
    });
    row.words.clone_from(&summary.reason);
    row.status = match summary.status {
        Status::Complete => "complete",
        Status::Failed => "failed",
        Status::Interrupted => "interrupted",
    };
    let config = folder.text(&MOST_BYTES, "config.toml").map_err(unbelieved)?;
    Ok(settings_of(&config))
}

/// The values of a configuration that can change figures, but for the seed.
pub(crate) fn settings_of(config: &str) -> Vec<(String, toml::Value)> {
    let Ok(config) = config.parse::<toml::Table>() else { return Vec::new() };
    let is_without_effect = |key: &str| {
        key == "experiment.seed"
            || key
                .strip_prefix("experiment.")
                .is_some_and(|name| experiment::WITHOUT_EFFECT.contains(&name))
    };
    values_by_key(&config).into_iter().filter(|(key, _)| !is_without_effect(key)).collect()
}

/// When a run ended (Unix time, s), as its `provenance.json` has it, which lists the other files and has no fingerprint itself.
fn ended_unix_s(path: &Path) -> Option<f64> {
    let text = ResultFolder::unchecked(path).bytes(&MOST_BYTES, PROVENANCE_FILE).ok()?;
    let value: Value = serde_json::from_slice(&text).ok()?;
    Some(value["started_unix_s"].as_f64()? + value["wall_s"].as_f64().unwrap_or(0.0))
}

fn of_sweep(row: &mut Row, summary: &SweepSummary) {
    let failed: usize = summary.settings.iter().map(|setting| setting.failed).sum();
    row.status = if failed == 0 { "complete" } else { "failed" };
    row.n_warnings = summary.warnings.len();
    let keys = summary.settings.first().into_iter().flat_map(|setting| setting.values.keys());
    let keys: Vec<&str> = keys.map(String::as_str).collect();
    let over = if keys.is_empty() { String::new() } else { format!(" over {}", keys.join(", ")) };
    let count = numbers::format::count_of;
    let mut words = format!(
        "{} of {}{over}",
        count(summary.trials as u64, "trial"),
        count(summary.settings.len() as u64, "setting"),
    );
    if failed != 0 {
        let _ = write!(words, "; {} failed", count(failed as u64, "trial"));
    }
    row.words = Some(words);
    // The first figure that any setting has.
    let spread = |name: &str| {
        let settings = summary.settings.iter();
        settings.filter_map(|setting| Some(setting.metrics.get(name)?.spread?.median)).collect()
    };
    let names = summary.settings.first().into_iter().flat_map(|setting| setting.metrics.keys());
    let found = names.map(|name| (name, spread(name))).find(|(_, medians)| !Vec::is_empty(medians));
    let Some((name, medians)) = found else { return };
    let metric = all_metrics().iter().find(|metric| metric.name() == name || metric.path == *name);
    let label = metric.map_or_else(|| name.clone(), |metric| metric.label.clone());
    let is_share = metric.is_some_and(|metric| metric.unit == Some(SHARE));
    let unit = metric.and_then(Metric::axis_unit).unwrap_or("1");
    let [least, most] = range(medians.iter().copied());
    let is_greater_better = metric.and_then(|metric| better_of(metric.better));
    let best = if is_greater_better == Some(false) { least } else { most };
    row.first = Some(FirstFigure {
        words: format!("{label}, best setting"),
        unit: if is_share { "%" } else { unit }.to_owned(),
        is_greater_better,
        value: best,
    });
    row.spark = medians;
    row.spark_words = Some(format!("median of {label}, setting by setting"));
}

fn better_of(better: Better) -> Option<bool> {
    match better {
        Better::Higher => Some(true),
        Better::Lower => Some(false),
        Better::Neither => None,
    }
}

/// Reads an answer; `None`: the file is none.
pub(crate) fn answer(found: &Found, reading: Reading) -> Option<Read> {
    let mut row = Row {
        name: found.place.clone(),
        when_unix_s: found.stamp.changed_unix_s(),
        status: "complete",
        ..Row::default()
    };
    let text = match ResultFolder::holding(&found.path, reading) {
        Ok(Some((folder, name))) => folder.text(&MOST_BYTES, &name).ok()?,
        Ok(None) | Err(_) => experiment::text_of(&found.path).ok()?,
    };
    let value: Value = serde_json::from_str(&text).ok()?;
    let (command, _) = value["schema"].as_str()?.split_once('/')?;
    if !ANSWERS.contains(&command) {
        return None;
    }
    row.kind = command.to_owned();
    let text = |key: &str| value[key].as_str().filter(|text| !text.is_empty()).map(str::to_owned);
    row.words = text("sentence").or_else(|| text("verdict"));
    row.n_warnings = value["warnings"].as_array().map_or(0, Vec::len);
    let unit = match value["kind"].as_str() {
        Some("link" | "links") => "dB",
        Some("robot" | "robots") => "m",
        _ => "1",
    };
    let ladder = value["ladder"].as_array().into_iter().flatten();
    row.spark = ladder.filter_map(|rung| rung["rmse"].as_f64()).collect();
    let error = row.spark.last().copied().or_else(|| value["scores"]["rmse"].as_f64());
    if let Some(value) = error {
        row.first = Some(FirstFigure {
            words: "Error on held-out data (r.m.s.)".to_owned(),
            unit: unit.to_owned(),
            is_greater_better: Some(false),
            value,
        });
        row.spark_words = Some("r.m.s. error, effect by effect".to_owned());
    }
    Some(Read { row, settings: Vec::new() })
}
