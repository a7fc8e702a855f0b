//! What a demo reads of the answers of its commands. Numbers are null where they are unknown.

use indexmap::IndexMap;
use serde::Deserialize;

/// An answer of `compare --json`.
#[derive(Deserialize)]
pub(super) struct ComparisonAnswer {
    pub(super) scores: IndexMap<String, Option<f64>>,
    /// By how much readings lie above the model (dB), alike on all rows.
    #[serde(default)]
    pub(super) offset_db: Option<OffsetAnswer>,
    #[serde(rename = "where")]
    pub(super) places: Vec<PlaceAnswer>,
}

/// A constant error of all rows.
#[derive(Deserialize)]
pub(super) struct OffsetAnswer {
    pub(super) value: f64,
}

/// A covariate, and how much of the error it explains.
#[derive(Deserialize)]
pub(super) struct PlaceAnswer {
    pub(super) covariate: String,
    pub(super) explained: Option<f64>,
    pub(super) p_value: Option<f64>,
}

impl ComparisonAnswer {
    /// The root mean squared error, whose name ends in its unit.
    pub(super) fn error(&self) -> Option<f64> {
        self.scores.iter().find(|(name, _)| name.starts_with("rmse_")).and_then(|(_, error)| *error)
    }
}

/// An answer of `diagnose --json`.
#[derive(Deserialize)]
pub(super) struct DiagnosisAnswer {
    pub(super) verdict: String,
    pub(super) sentence: String,
    pub(super) ladder: Vec<RungAnswer>,
    pub(super) candidates: Vec<CandidateAnswer>,
}

/// A model with the effects that were accepted until then.
#[derive(Deserialize)]
pub(super) struct RungAnswer {
    pub(super) model: String,
    pub(super) rmse: Option<f64>,
}

/// A candidate.
#[derive(Deserialize)]
pub(super) struct CandidateAnswer {
    pub(super) effect: String,
    pub(super) gain: Option<f64>,
    pub(super) standard_error: Option<f64>,
    pub(super) accepted: bool,
    pub(super) indistinguishable_from: Vec<String>,
    pub(super) parameters: IndexMap<String, ParameterAnswer>,
    /// Its section of a configuration; null of curves.
    pub(super) settings: Option<toml::Table>,
}

/// A fitted parameter.
#[derive(Deserialize)]
pub(super) struct ParameterAnswer {
    pub(super) value: Option<f64>,
    pub(super) unit: String,
    pub(super) low: Option<f64>,
    pub(super) high: Option<f64>,
}

impl DiagnosisAnswer {
    /// Candidates that were accepted.
    pub(super) fn accepted(&self) -> impl Iterator<Item = &CandidateAnswer> {
        self.candidates.iter().filter(|candidate| candidate.accepted)
    }
}

/// The summary of a run.
#[derive(Deserialize)]
pub(super) struct RunSummaryAnswer {
    pub(super) task: TaskAnswer,
    pub(super) network: NetworkAnswer,
}

#[derive(Deserialize)]
pub(super) struct TaskAnswer {
    pub(super) speed_along_leader_mps: f64,
    pub(super) flock_speed_mps: f64,
    pub(super) leader_speed_mps: f64,
    pub(super) flock_speed_floor_mps: f64,
}

#[derive(Deserialize)]
pub(super) struct NetworkAnswer {
    pub(super) delivery_ratio: f64,
}
