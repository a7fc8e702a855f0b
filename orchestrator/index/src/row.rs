//! What the table has of a result.

use serde::Serialize;
use serde_json::Value;
use std::collections::BTreeMap;

/// What the table has of a result.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub(crate) struct Row {
    /// Its name.
    pub(crate) name: String,
    /// `run`, `sweep`, or the command that wrote the answer.
    pub(crate) kind: String,
    /// `complete`, `failed`, `interrupted`; `running`, `stopped` of one that was killed; `changed` where a file is not the one that
    /// was written, `unverified` where nothing says what was written, `damaged` where it cannot be read.
    pub(crate) status: &'static str,
    /// What there is to say of the status, or the sentence of an answer.
    pub(crate) words: Option<String>,
    /// A command that goes on with it, for the folder in which this program was started.
    pub(crate) command: Option<String>,
    /// When it ended; of one that lasts, when it began (Unix time, s).
    pub(crate) when_unix_s: Option<f64>,
    /// The seed of a run.
    pub(crate) seed: Option<u64>,
    /// Simulated time (s).
    pub(crate) simulated_s: Option<f64>,
    /// The figure to look at first.
    pub(crate) first: Option<FirstFigure>,
    /// Other figures by their short names.
    pub(crate) figures: BTreeMap<&'static str, f64>,
    /// How many warnings it has.
    pub(crate) n_warnings: usize,
    /// Values that a sweep gives to keys, by key.
    pub(crate) varied: BTreeMap<String, Vec<Value>>,
    /// Names and values that a dialog lists, such as the scores of an answer.
    pub(crate) details: Vec<(String, String)>,
    /// A few numbers of a sweep or an answer in their order, such as the median of each setting.
    pub(crate) spark: Vec<f64>,
    /// What these are.
    pub(crate) spark_words: Option<String>,
    /// It has a table, or a recording that grows, from which series over time can be made.
    pub(crate) has_series: bool,
    /// It has a report.
    #[serde(skip)]
    pub(crate) has_report: bool,
    /// It has a recording that can be played.
    pub(crate) has_recording: bool,
    /// How far one is that runs, or was killed.
    pub(crate) progress: Option<Progress>,
}

/// The figure to look at first.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub(crate) struct FirstFigure {
    /// Its name in filters, such as `leader_speed_ratio`.
    pub(crate) name: String,
    /// What it is.
    pub(crate) words: String,
    /// Its unit; `%` of a share from 0 to 1, `1` of another number without a unit, empty of a count.
    pub(crate) unit: String,
    /// Whether greater values are better; null where it depends on the question.
    pub(crate) is_greater_better: Option<bool>,
    /// Its value.
    pub(crate) value: f64,
}

/// How far a run or a sweep is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub(crate) struct Progress {
    /// Steps, or trials, that are done.
    pub(crate) done: u64,
    /// How many there are at most.
    pub(crate) of: u64,
}
