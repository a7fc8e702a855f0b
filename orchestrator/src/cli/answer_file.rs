//! An answer of `compare --json` or `diagnose --json`, as the page that shows a run needs it.

use super::Failure;
use diagnose::{compare, diagnosis};
use indexmap::IndexMap;
use serde::Deserialize;
use std::path::Path;
use view::view;

/// What is read of the answer. Numbers are null where they are unknown.
#[derive(Deserialize)]
pub(super) struct Answer {
    schema: String,
    kind: String,
    data: Data,
    used: usize,
    searched: Option<usize>,
    #[serde(default)]
    sentence: String,
    #[serde(default)]
    ladder: Vec<Rung>,
    #[serde(default)]
    candidates: Vec<Candidate>,
    #[serde(default)]
    scores: IndexMap<String, Option<f64>>,
    #[serde(default)]
    intervals: IndexMap<String, [Option<f64>; 2]>,
}

#[derive(Deserialize)]
struct Data {
    file: String,
}

#[derive(Deserialize)]
struct Rung {
    model: String,
    rmse: Option<f64>,
    log_score: Option<f64>,
}

#[derive(Deserialize)]
struct Candidate {
    effect: String,
    gain: Option<f64>,
    standard_error: Option<f64>,
    accepted: bool,
    settings: Option<toml::Table>,
}

impl Answer {
    /// Reads the answer that `--diagnosis` names.
    pub(super) fn of_option(path: &Path) -> Result<Self, Failure> {
        Self::read(path).map_err(|problem| {
            Failure::request(format!("--diagnosis {}: {problem}", path.display()))
        })
    }

    /// Reads an answer about links or robots.
    fn read(path: &Path) -> Result<Self, String> {
        let text = experiment::text_of(path).map_err(|error| error.to_string())?;
        let value: serde_json::Value = serde_json::from_str(&text).map_err(|error| {
            format!("is not JSON: {error}; give a file that diagnose or compare wrote with --json")
        })?;
        let schema = value.get("schema").and_then(serde_json::Value::as_str).unwrap_or_default();
        let known = [diagnosis::SCHEMA, diagnosis::SCHEMA_BEFORE, compare::comparison::SCHEMA];
        if !known.contains(&schema) {
            return Err(format!(
                "is not an answer about links or robots: its schema is {schema:?}, must be {:?} or {:?}; give a file that diagnose \
                 or compare wrote with --json",
                diagnosis::SCHEMA,
                compare::comparison::SCHEMA
            ));
        }
        serde_json::from_value(value).map_err(|error| error.to_string())
    }

    /// Whether it is about links.
    pub(super) fn is_of_links(&self) -> bool {
        self.kind == "link"
    }

    /// How many rows it was found from.
    pub(super) fn n_rows(&self) -> usize {
        self.searched.unwrap_or(self.used)
    }

    /// Whether effects were accepted, or curves in their place.
    pub(super) fn has_effects(&self) -> bool {
        self.candidates.iter().any(|candidate| candidate.accepted)
    }

    /// The effects that were accepted, each as a table of the configuration.
    pub(super) fn estimates(&self) -> Vec<toml::Table> {
        let accepted = self.candidates.iter().filter(|candidate| candidate.accepted);
        accepted.filter_map(|candidate| candidate.settings.clone()).collect()
    }

    /// The answer as the page shows it, with the measured rows if they were given.
    pub(super) fn shown(&self, rows: Option<view::MeasuredRows>) -> view::Measurements {
        let or_nan = |value: Option<f64>| value.unwrap_or(f64::NAN);
        let what =
            if self.schema == compare::comparison::SCHEMA { "Comparison" } else { "Diagnosis" };
        let ladder = self.ladder.iter().map(|rung| view::Rung {
            model: rung.model.clone(),
            rmse: or_nan(rung.rmse),
            log_score: or_nan(rung.log_score),
        });
        // Of a candidate that could not be tested no gain is known.
        let tested = self.candidates.iter().filter(|candidate| candidate.gain.is_some());
        let candidates = tested.map(|candidate| view::Candidate {
            effect: candidate.effect.clone(),
            gain: or_nan(candidate.gain),
            standard_error: or_nan(candidate.standard_error),
            accepted: candidate.accepted,
        });
        let scores = self.scores.iter().map(|(name, value)| {
            let [low, high] = self.intervals.get(name).copied().unwrap_or_default().map(or_nan);
            view::Score { name: name.clone(), value: or_nan(*value), low, high }
        });
        view::Measurements {
            title: format!("{what} of {}", self.data.file),
            verdict: self.sentence.clone(),
            unit: if self.is_of_links() { "dB" } else { "m" }.to_owned(),
            ladder: ladder.collect(),
            candidates: candidates.collect(),
            scores: scores.collect(),
            rows,
        }
    }
}
