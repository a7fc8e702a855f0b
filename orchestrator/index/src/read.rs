//! A row of a run, a sweep or an answer, as its files say it.

use crate::listing::{Found, is_file};
use crate::row::{FirstFigure, Row};
use crate::settings::shown;
use crate::unfinished::MOST_JOURNAL_BYTES;
use input::Reading;
use input::result::{PROVENANCE_FILE, ResultError, ResultFolder, Trust};
use metrics::figures::Better;
use metrics::headline;
use numbers::format::rounded;
use proto::bounds::Bound;
use record::metric::{Metric, SHARE, SHORT_NAMES, metrics as all_metrics};
use record::run_summary::RunSummary;
use record::{SCHEMA_PREFIX, Status};
use serde::Deserialize;
use serde_json::Value;
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::io::ErrorKind;
use std::path::Path;
use sweep::compare_runs::values_by_key;
use sweep::{SUMMARY_SCHEMA, SweepSummary};

/// A file that describes a result and has more bytes is not read.
const MOST_BYTES: Bound =
    Bound { what: "size of a file that describes a result (bytes)", most: 16 << 20 };

/// Values of a key that a sweep varies, at most.
const MOST_VARIED: usize = 100;
/// Details of a result, at most.
const MOST_DETAILS: usize = 40;
/// Digits of a detail.
const DIGITS: usize = 4;

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
    pub(crate) settings: Settings,
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
    let (settings, wrong) = match filled(&mut row, &found.path, reading) {
        Ok((settings, wrong)) => (settings, wrong),
        Err(wrong) => (Vec::new(), Some(wrong)),
    };
    if let Some((status, words)) = wrong {
        row.status = status;
        row.words = Some(words);
    }
    Read { row, settings }
}

/// The keys of a configuration, and their values.
type Settings = Vec<(String, toml::Value)>;

/// What is wrong: the status, and why.
pub(crate) type Wrong = (&'static str, String);

/// The status of a result with a file that is not believed, and why.
pub(crate) fn unbelieved(error: &ResultError) -> Wrong {
    let status = match error {
        ResultError::Changed { .. } => "changed",
        ResultError::Unknown { .. } => "unverified",
        ResultError::Read { .. } | ResultError::Format { .. } => "damaged",
    };
    (status, error.to_string())
}

/// What the table takes from `provenance.json`, which lists the other files and has no fingerprint itself.
#[derive(Default, Deserialize)]
struct Provenance {
    started_unix_s: Option<f64>,
    #[serde(default)]
    wall_s: f64,
    #[serde(default)]
    files: BTreeMap<String, Listed>,
}

/// A file as it was written.
#[derive(Deserialize)]
struct Listed {
    bytes: u64,
}

impl Provenance {
    fn of(path: &Path) -> Self {
        let text = ResultFolder::unchecked(path).bytes(&MOST_BYTES, PROVENANCE_FILE).ok();
        text.and_then(|text| serde_json::from_slice(&text).ok()).unwrap_or_default()
    }

    /// When a run ended (Unix time, s).
    fn ended_unix_s(&self) -> Option<f64> {
        Some(self.started_unix_s? + self.wall_s)
    }

    /// The files that are missing or have another length than they were written with, and what is wrong with each. No file is
    /// read, so a file whose bytes were changed in place passes.
    fn of_other_length(&self, path: &Path) -> BTreeMap<&str, String> {
        // A list that was tampered with says nothing about files elsewhere.
        let own = self.files.iter().filter(|(name, _)| !name.contains('/'));
        own.filter_map(|(name, Listed { bytes })| {
            let words = match std::fs::metadata(path.join(name)) {
                Ok(found) if found.len() == *bytes => return None,
                Ok(found) => format!("{name} has {} bytes, but the run wrote {bytes}", found.len()),
                Err(error) if error.kind() == ErrorKind::NotFound => format!("{name} is missing"),
                Err(error) => format!("{name}: {error}"),
            };
            Some((name.as_str(), words))
        })
        .collect()
    }
}

fn filled(
    row: &mut Row,
    path: &Path,
    reading: Reading,
) -> Result<(Settings, Option<Wrong>), Wrong> {
    let unbelieved = |error: ResultError| unbelieved(&error);
    let damaged = |error: serde_json::Error| ("damaged", format!("summary.json: {error}"));
    let folder = ResultFolder::open(path, reading).map_err(unbelieved)?;
    if !folder.has(RunSummary::FILE) {
        row.kind = "run".to_owned();
        return Err(("damaged", format!("{} is missing", RunSummary::FILE)));
    }
    let provenance = Provenance::of(path);
    let others = match reading.trust {
        Trust::Checked => provenance.of_other_length(path),
        Trust::Unchecked => BTreeMap::new(),
    };
    // A file that is missing is a change as well: what is left can be read.
    let wrong = (!others.is_empty())
        .then(|| ("changed", others.values().cloned().collect::<Vec<String>>().join("; ")));
    let text = folder.bytes(&MOST_BYTES, RunSummary::FILE).map_err(unbelieved)?;
    let value: Value = serde_json::from_slice(&text).map_err(damaged)?;
    let schema = value["schema"].as_str().unwrap_or_default();
    let has = |name: &str| is_file(&path.join(name)) && !others.contains_key(name);
    row.has_report = has("report.html");
    if schema == SUMMARY_SCHEMA {
        row.kind = "sweep".to_owned();
        let summary: SweepSummary = serde_json::from_value(value).map_err(damaged)?;
        of_sweep(row, &summary);
        return Ok((Vec::new(), wrong.or_else(|| cut_journal(path, summary.trials))));
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
    row.when_unix_s = provenance.ended_unix_s().or(row.when_unix_s);
    row.seed = Some(summary.seed);
    row.simulated_s = Some(summary.simulated_s);
    row.n_warnings = summary.warnings.len();
    row.first = summary.first_figure().map(|(headline, shown, value)| FirstFigure {
        name: short_name(shown.path).to_owned(),
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
    Ok((settings_of(&config), wrong))
}

/// What a filter calls the figure of a path.
fn short_name(path: &str) -> &str {
    let short = SHORT_NAMES.iter().find(|short| short.path == path);
    short.map_or_else(|| path.rsplit('.').next().unwrap_or(path), |short| short.name)
}

/// What is wrong with the journal of a sweep, which `provenance.json` does not list because a later sweep adds to it.
fn cut_journal(path: &Path, n_trials: usize) -> Option<Wrong> {
    let name = "trials.jsonl";
    let journal = ResultFolder::unchecked(path).bytes(&MOST_JOURNAL_BYTES, name).ok()?;
    let n_lines = journal.iter().filter(|&&byte| byte == b'\n').count();
    (n_lines < n_trials).then(|| {
        let words = format!(
            "{name} holds {} of {n_trials}; start the same sweep again to run the others",
            numbers::format::count_of(n_lines as u64, "trial")
        );
        ("changed", words)
    })
}

/// The values of a configuration that can change figures, but for the seed.
pub(crate) fn settings_of(config: &str) -> Settings {
    let Ok(config) = config.parse::<toml::Table>() else { return Vec::new() };
    let is_without_effect = |key: &str| {
        key == "experiment.seed"
            || key
                .strip_prefix("experiment.")
                .is_some_and(|name| experiment::WITHOUT_EFFECT.contains(&name))
    };
    values_by_key(&config).into_iter().filter(|(key, _)| !is_without_effect(key)).collect()
}

fn of_sweep(row: &mut Row, summary: &SweepSummary) {
    let failed: usize = summary.settings.iter().map(|setting| setting.failed).sum();
    row.status = if failed == 0 { "complete" } else { "failed" };
    row.n_warnings = summary.warnings.len();
    let keys = summary.settings.first().into_iter().flat_map(|setting| setting.values.keys());
    let keys: Vec<&str> = keys.map(String::as_str).collect();
    let over = if keys.is_empty() { String::new() } else { format!(" over {}", keys.join(", ")) };
    let count = numbers::format::count_of;
    for setting in &summary.settings {
        for (key, value) in &setting.values {
            let values = row.varied.entry(key.clone()).or_default();
            let value = shown(value);
            if values.len() < MOST_VARIED && !values.contains(&value) {
                values.push(value);
            }
        }
    }
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
    let spread = |name: &str| -> Vec<(String, f64)> {
        let of_settings = summary.settings.iter().filter_map(|setting| {
            let median = setting.metrics.get(name)?.spread?.median;
            Some((words_of_setting(setting.case.as_deref(), &setting.values), median))
        });
        of_settings.collect()
    };
    let names = summary.settings.first().into_iter().flat_map(|setting| setting.metrics.keys());
    let found = names.map(|name| (name, spread(name))).find(|(_, medians)| !medians.is_empty());
    let Some((name, medians)) = found else { return };
    let metric = all_metrics().iter().find(|metric| metric.name() == name || metric.path == *name);
    let label = metric.map_or_else(|| name.clone(), |metric| metric.label.clone());
    let is_share = metric.is_some_and(|metric| metric.unit == Some(SHARE));
    let unit = metric.and_then(Metric::axis_unit).unwrap_or("1");
    let is_greater_better = metric.and_then(|metric| better_of(metric.better));
    let ascending = |a: &&(String, f64), b: &&(String, f64)| a.1.total_cmp(&b.1);
    let best = match is_greater_better {
        Some(false) => medians.iter().min_by(ascending),
        _ => medians.iter().max_by(ascending),
    };
    let Some((at, value)) = best else { return };
    let superlative = if is_greater_better.is_some() { "best" } else { "greatest" };
    let at = if at.is_empty() { String::new() } else { format!(", {superlative}: {at}") };
    row.first = Some(FirstFigure {
        name: short_name(name).to_owned(),
        words: format!("{label}{at}"),
        unit: if is_share { "%" } else { unit }.to_owned(),
        is_greater_better,
        value: *value,
    });
    row.details = medians
        .iter()
        .take(MOST_DETAILS)
        .map(|(setting, median)| (setting.clone(), rounded(*median, DIGITS).to_string()))
        .collect();
    row.spark = medians.iter().map(|(_, median)| *median).collect();
    row.spark_words = Some(format!("median of {label}, setting by setting"));
}

/// The case and the values of a setting, each key by the last part of its path.
fn words_of_setting<'a>(
    case: Option<&str>,
    values: impl IntoIterator<Item = (&'a String, &'a toml::Value)>,
) -> String {
    let values = values.into_iter().map(|(key, value)| {
        let text = value.as_str().map_or_else(|| value.to_string(), str::to_owned);
        let (above, last) = key.rsplit_once('.').unwrap_or(("", key));
        // Many sections have a kind.
        let above = above.rsplit('.').next().filter(|_| last == "kind").unwrap_or_default();
        let dot = if above.is_empty() { "" } else { "." };
        format!("{above}{dot}{last} {}", text.strip_suffix(".0").unwrap_or(&text))
    });
    case.map(str::to_owned).into_iter().chain(values).collect::<Vec<String>>().join(", ")
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
    let ladder = || value["ladder"].as_array().into_iter().flatten();
    row.spark = ladder().filter_map(|rung| rung["rmse"].as_f64()).collect();
    let of_ladder = row.spark.last().map(|&error| ("rmse".to_owned(), unit, error));
    if let Some((name, unit, error)) = of_ladder.or_else(|| error_of_scores(&value)) {
        row.first = Some(FirstFigure {
            name,
            words: "Error on held-out data (r.m.s.)".to_owned(),
            unit: unit.to_owned(),
            is_greater_better: Some(false),
            value: error,
        });
    }
    if !row.spark.is_empty() {
        row.spark_words = Some("r.m.s. error, effect by effect".to_owned());
    }
    let said = |number: f64| rounded(number, DIGITS).to_string();
    let rungs = ladder().filter_map(|rung| {
        Some((
            rung["model"].as_str()?.to_owned(),
            format!("{} {unit}", said(rung["rmse"].as_f64()?)),
        ))
    });
    let scores = value["scores"].as_object().into_iter().flatten().filter_map(|(name, score)| {
        let interval = &value["intervals"][name];
        let interval = match (interval[0].as_f64(), interval[1].as_f64()) {
            (Some(low), Some(high)) => format!(" ({} to {})", said(low), said(high)),
            _ => String::new(),
        };
        Some((name.clone(), format!("{}{interval}", said(score.as_f64()?))))
    });
    row.details = rungs.chain(scores).take(MOST_DETAILS).collect();
    Some(Read { row, settings: Vec::new() })
}

/// The error among the scores of `compare`, whose name ends in its unit: name, unit and value.
fn error_of_scores(answer: &Value) -> Option<(String, &'static str, f64)> {
    let error = |(name, unit): (&str, &'static str)| {
        Some((name.to_owned(), unit, answer["scores"][name].as_f64()?))
    };
    [("rmse_db", "dB"), ("rmse_m", "m"), ("rmse_pdr", "%")].into_iter().find_map(error)
}
