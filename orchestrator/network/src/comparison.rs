//! What a comparison of a network with measured packets found: the answer that programs read as JSON, pages draw and people
//! read as text.

use super::error_split::NetworkErrorSplit;
use indexmap::IndexMap;
use measure::account::DataAccount;
use schemars::JsonSchema;
use serde::Serialize;

pub use diagnose::compare::comparison::SCHEMA;

/// A comparison of a network: whether measured packets could be one more run of the model.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct NetworkComparison {
    /// The format of this answer.
    #[schemars(extend("const" = SCHEMA))]
    pub schema: &'static str,
    /// What was measured.
    #[schemars(extend("const" = "network"))]
    pub kind: &'static str,
    /// The measurement among the runs of the model.
    #[serde(flatten)]
    pub among: AmongSeeds,
    /// The verdict.
    pub verdict: NetworkVerdict,
    /// The result in a sentence.
    pub sentence: String,
    /// The measurements.
    #[serde(flatten)]
    pub account: DataAccount,
    /// Where the error comes from, if links were measured as well.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub error_split: Option<NetworkErrorSplit>,
}

/// What a comparison of a network came to.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
#[schemars(rename = "Verdict")]
pub enum NetworkVerdict {
    /// The seeds are too few to decide.
    TooFewSeeds,
    /// The packets could be one more run of the model.
    Agrees,
    /// The packets are inconsistent with the model.
    Differs,
}

/// Measured packets among the runs of a model under several seeds.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct AmongSeeds {
    /// What a run of the model differs in from another.
    #[schemars(extend("const" = "seed"))]
    pub unit: &'static str,
    /// How many seeds the model was run under.
    pub seeds: u64,
    /// Packets made before this time were not compared (s).
    pub from_s: f64,
    /// Measured less the mean of the seeds, by figure; figures that are unknown are left out.
    #[schemars(with = "IndexMap<String, Option<f64>>")]
    pub scores: IndexMap<String, f64>,
    /// Measured less the ends of the middle 90 % of the seeds, by figure.
    #[schemars(with = "IndexMap<String, [Option<f64>; 2]>")]
    pub intervals: IndexMap<String, [f64; 2]>,
    /// The figures that are compared.
    pub kpis: Vec<Kpi>,
    /// Delivery ratio of each mote, measured and simulated.
    pub motes: Vec<MoteDelivery>,
    /// Whether the error goes with the mote that sends: one entry.
    #[serde(rename = "where")]
    pub places: [BySource; 1],
    /// Chance that a run of the model lies as far out in some figure.
    #[schemars(with = "Option<f64>")]
    pub p_value: f64,
}

/// A figure of a measurement among those of seeds.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Kpi {
    /// Name of the figure, as answers and pages show it.
    pub name: &'static str,
    /// Its unit; empty for a number without.
    pub unit: &'static str,
    /// What the figure is, in a sentence.
    pub doc: &'static str,
    /// Its measured value; null where it is unknown.
    #[schemars(with = "Option<f64>")]
    pub measured: f64,
    /// Its values under the seeds of the model.
    pub model: KpiOfModel,
    /// Chance that a run of the model lies as far out in it, on either side; null where it is unknown.
    pub p_value: Option<f64>,
    /// How far out the measurement lies, in standard deviations.
    pub z: Option<f64>,
}

/// A figure under the seeds of a model.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct KpiOfModel {
    /// Mean of the seeds.
    #[schemars(with = "Option<f64>")]
    pub mean: f64,
    /// Lower end of the middle 90 % of the seeds.
    #[schemars(with = "Option<f64>")]
    pub low: f64,
    /// Upper end of the middle 90 % of the seeds.
    #[schemars(with = "Option<f64>")]
    pub high: f64,
    /// The value under each seed.
    #[schemars(with = "Vec<Option<f64>>")]
    pub seeds: Vec<f64>,
}

/// What became of a mote's packets, measured and in the model.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct MoteDelivery {
    /// Number of the mote that made the packets.
    pub mote: u32,
    /// Packets that it made, as measured.
    pub sent: u32,
    /// Those of them that arrived.
    pub arrived: u32,
    /// The share that arrived, as measured.
    #[schemars(with = "Option<f64>")]
    pub delivery: f64,
    /// The share that arrives in the model.
    pub model: DeliveryOfModel,
    /// Whether the measured share lies outside the middle 90 % of the seeds.
    pub is_outside: bool,
}

/// A mote's delivery under the seeds of a model.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, JsonSchema)]
pub struct DeliveryOfModel {
    /// Mean of the seeds.
    #[schemars(with = "Option<f64>")]
    pub mean: f64,
    /// Lower end of the middle 90 % of the seeds.
    #[schemars(with = "Option<f64>")]
    pub low: f64,
    /// Upper end of the middle 90 % of the seeds.
    #[schemars(with = "Option<f64>")]
    pub high: f64,
}

/// The error of delivery over the mote that sends.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct BySource {
    /// The mote that sends.
    #[schemars(extend("const" = "source"))]
    pub covariate: &'static str,
    /// Always null: a share of an error is not defined for one measured run.
    pub explained: (),
    /// Chance that a run of the model lies as far out in the delivery of some mote.
    #[schemars(with = "Option<f64>")]
    pub p_value: f64,
    /// The error of each mote, a bin per mote.
    pub bins: Vec<MoteBin>,
}

/// The error of a mote's delivery.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, JsonSchema)]
pub struct MoteBin {
    /// Number of the mote.
    pub from: u32,
    /// Number of the mote again: a bin has two ends.
    pub to: u32,
    /// Packets that it made, as measured.
    pub n: u32,
    /// Measured share that arrived less the mean of the seeds.
    #[schemars(with = "Option<f64>")]
    pub bias: f64,
    /// The magnitude of that.
    #[schemars(with = "Option<f64>")]
    pub rmse: f64,
}
