//! What a comparison of a swarm's task found: the answer that programs read as JSON, pages draw and people read as text.

use crate::comparison::Kpi;
use crate::error_split::{ErrorPart, PartOfFigure};
use indexmap::IndexMap;
use measure::account::DataAccount;
use schemars::JsonSchema;
use serde::Serialize;

pub use diagnose::compare::comparison::SCHEMA;

/// A comparison of a swarm's task: whether what robots did could be one more run of the model, and where the error comes from.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct TaskComparison {
    /// The format of this answer.
    #[schemars(extend("const" = SCHEMA))]
    pub schema: &'static str,
    /// What was measured.
    #[schemars(extend("const" = "task"))]
    pub kind: &'static str,
    /// What a run of the model differs in from another.
    #[schemars(extend("const" = "seed"))]
    pub unit: &'static str,
    /// How many seeds the model was run under.
    pub seeds: u64,
    /// When the task began (s).
    pub from_s: f64,
    /// Measured less the mean of the seeds, by figure; figures that are unknown are left out.
    #[schemars(with = "IndexMap<String, Option<f64>>")]
    pub scores: IndexMap<String, f64>,
    /// Measured less the ends of the middle 90 % of the seeds, by figure.
    #[schemars(with = "IndexMap<String, [Option<f64>; 2]>")]
    pub intervals: IndexMap<String, [f64; 2]>,
    /// The figures that are compared.
    pub kpis: Vec<Kpi>,
    /// Always empty: the error is not looked for over covariates.
    #[serde(rename = "where")]
    pub places: [(); 0],
    /// Chance that a run of the model lies as far out in some figure.
    #[schemars(with = "Option<f64>")]
    pub p_value: f64,
    /// The verdict.
    pub verdict: TaskVerdict,
    /// The result in a sentence.
    pub sentence: String,
    /// Where the error comes from.
    pub error_split: TaskErrorSplit,
    /// The measurements: where robots were.
    #[serde(flatten)]
    pub account: DataAccount,
    /// The measurements: who heard whom.
    pub heard: HeardFile,
}

/// Whose the error of a task is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum TaskVerdict {
    /// The network's.
    Network,
    /// The robots'.
    Robot,
    /// Both the network's and the robots'.
    Both,
    /// What robots did is inconsistent with the model, and neither part is significant by itself.
    Open,
    /// What robots did could be one more run of the model.
    Agrees,
}

/// The error of a task split: network, robots, and what belongs to neither.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct TaskErrorSplit {
    /// The parts that can be significant.
    pub order: [&'static str; 2],
    /// What belongs to neither.
    pub note: &'static str,
    /// The result in a sentence.
    pub sentence: String,
    /// The parts, each with its significance.
    pub parts: [ErrorPart; 2],
    /// The parts of the error in each figure.
    pub figures: Vec<TaskFigureSplit>,
    /// Root mean square distance of robots from where they were measured, mean of the runs (m).
    pub places_off_m: PlacesOff,
}

/// The error of a figure of a task, split.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct TaskFigureSplit {
    /// Name of the figure.
    pub name: &'static str,
    /// Its unit; empty for a number without.
    pub unit: &'static str,
    /// Its measured value.
    #[schemars(with = "Option<f64>")]
    pub measured: f64,
    /// Mean of the runs of the model as configured.
    #[schemars(with = "Option<f64>")]
    pub whole: f64,
    /// Mean of the runs in which robots hear what the model's network delivers along the measured tracks.
    #[schemars(with = "Option<f64>")]
    pub own_network_along_tracks: f64,
    /// Mean of the runs in which robots hear what was heard.
    #[schemars(with = "Option<f64>")]
    pub with_what_was_heard: f64,
    /// How much of the error each part is, `neither` among them; null where that is unknown.
    pub parts: IndexMap<&'static str, Option<PartOfFigure>>,
}

/// How far the robots of each kind of run are from where they were measured (m).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, JsonSchema)]
pub struct PlacesOff {
    /// Of the model as configured.
    #[schemars(with = "Option<f64>")]
    pub whole: f64,
    /// Of robots that hear what the model's network delivers along the measured tracks.
    #[schemars(with = "Option<f64>")]
    pub own_network_along_tracks: f64,
    /// Of robots that hear what was heard.
    #[schemars(with = "Option<f64>")]
    pub with_what_was_heard: f64,
}

/// A file that says who heard whom.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, JsonSchema)]
pub struct HeardFile {
    /// Path of the file, as given.
    pub file: String,
    /// Number of receptions in the file.
    pub deliveries: usize,
}
