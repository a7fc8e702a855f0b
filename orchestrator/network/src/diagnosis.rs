//! What a diagnosis of a network found: the answer that programs read as JSON, pages draw and people read as text.

use super::comparison::{AmongSeeds, Kpi};
use diagnose::diagnosis::{Parameter, Verdict};
use indexmap::IndexMap;
use measure::account::DataAccount;
use schemars::JsonSchema;
use serde::Serialize;

/// What the schema of a diagnosis of packets is called.
pub const SCHEMA: &str = "diagnose/1";

/// A diagnosis of a network: which effects it lacks, by how much more probable they make measured packets.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct NetworkDiagnosis {
    /// The format of this answer.
    #[schemars(extend("const" = SCHEMA))]
    pub schema: &'static str,
    /// What was measured.
    #[schemars(extend("const" = "network"))]
    pub kind: &'static str,
    /// The measurement among the runs of the model as configured.
    #[serde(flatten)]
    pub among: AmongSeeds,
    /// The verdict.
    pub verdict: Verdict,
    /// The verdict in a sentence.
    pub sentence: String,
    /// Names of the effects that were accepted, in the order in which they were added.
    pub missing: Vec<&'static str>,
    /// The model as configured, then with each effect added.
    pub ladder: Vec<NetworkRung>,
    /// Candidates tested, in the order of the catalogue.
    pub candidates: Vec<NetworkCandidate>,
    /// What no effect explains: the figure in which the packets are furthest from the last model.
    pub unexplained: Vec<UnexplainedFigure>,
    /// How many campaigns more would distinguish effects that these packets do not distinguish.
    pub next_measurement: Vec<NextCampaign>,
    /// The figures among the runs of the model with all that was accepted; null where nothing was.
    pub kpis_with: Option<Vec<Kpi>>,
    /// The round in which the search was interrupted, if it was; what was accepted before stands.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub stopped_in_round: Option<usize>,
    /// Whether the search came to its end. If not, a signal or a time budget ended it: the answer may still change.
    pub complete: bool,
    /// The measurements.
    #[serde(flatten)]
    pub account: DataAccount,
}

/// A model of the search.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct NetworkRung {
    /// `as configured`, or what this model has beyond the one before: `+ ack-loss`.
    pub model: String,
    /// Log density of the packets (nats).
    #[schemars(with = "Option<f64>")]
    pub log_score: f64,
    /// Chance that a run of this model lies as far out as the packets.
    #[schemars(with = "Option<f64>")]
    pub p_value: f64,
    /// Always null: only diagnoses of links and robots have it.
    pub rmse: (),
    /// Always null: only diagnoses of links and robots have it.
    pub crps: (),
    /// Always null: only diagnoses of links have it.
    pub reception_log_loss: (),
}

/// A candidate, and what became of it.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct NetworkCandidate {
    /// Name of the effect.
    pub effect: &'static str,
    /// How much more probable the packets are with it (nats); null: it was not tried.
    pub gain: Option<f64>,
    /// Standard error of the gain that comes from the choice of seeds (nats).
    pub standard_error: Option<f64>,
    /// Chance of as great a gain, of any candidate, without any effect.
    pub p_value: Option<f64>,
    /// Whether it was accepted.
    pub accepted: bool,
    /// Effects that make the packets as probable.
    pub indistinguishable_from: Vec<&'static str>,
    /// Chance that a run of the model with it lies as far out as the packets.
    pub p_value_with: Option<f64>,
    /// Its number as fitted, by key; empty where it was not fitted.
    pub parameters: IndexMap<&'static str, Parameter>,
    /// The keys of its section in a configuration; null where it was not fitted.
    #[schemars(with = "Option<serde_json::Map<String, serde_json::Value>>")]
    pub settings: Option<toml::Table>,
    /// Why it cannot be tried, if it cannot.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub untestable: Option<String>,
}

/// A figure that no effect explains.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct UnexplainedFigure {
    /// Name of the figure.
    pub covariate: &'static str,
    /// Always null: only diagnoses of links and robots have it.
    pub explained: (),
    /// Chance that a run of the last model lies as far out in it.
    pub p_value: Option<f64>,
    /// Always null: only diagnoses of links and robots have it.
    pub formula: (),
    /// Always null: only diagnoses of links and robots have it.
    pub rmse_after: (),
}

/// Campaigns that would distinguish two effects.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct NextCampaign {
    /// Names of the two effects.
    pub effects: [&'static str; 2],
    /// The figure in which they differ most.
    pub figure: &'static str,
    /// By how much they differ in it, in standard deviations of a run.
    #[schemars(with = "Option<f64>")]
    pub apart: f64,
    /// How many more campaigns like this one would do, on average.
    #[schemars(with = "Option<f64>")]
    pub campaigns: f64,
    /// The same in words.
    pub sentence: String,
}
