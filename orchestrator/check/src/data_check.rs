//! What a file of measurements holds: the answer that programs read as JSON and people as text.

use diagnose::defects::MeasurementDefect;
use diagnose::identifiability::Identifiability;
use diagnose::json_number;
use indexmap::IndexMap;
use measure::account::DataAccount;
use schemars::JsonSchema;
use serde::Serialize;
use std::collections::BTreeSet;

/// What the schema of the answer is called.
pub(super) const SCHEMA: &str = "check-data/1";

/// What a file of measurements holds, and which effects it can show.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct DataCheck {
    /// The format of this answer.
    #[schemars(extend("const" = SCHEMA))]
    pub schema: &'static str,
    /// What the rows are.
    pub kind: RowKind,
    /// What is in them.
    #[serde(flatten)]
    pub facts: Facts,
    /// The blocks of data that are left out together: how many, and what they are.
    pub blocks: [String; 2],
    /// Names of the effects that these data can show.
    pub testable: Vec<String>,
    /// The others, each with the reason.
    pub not_testable: Vec<NotTestable>,
    /// Of links, with a configuration: defects of the measurement under the model as configured, its level and noise fitted. Absent
    /// where they are not looked for.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub measurement_defects: Option<Vec<MeasurementDefect>>,
    /// With a configuration: what these data can tell, before any search. Absent where no level is predicted.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub identifiability: Option<Identifiability>,
    /// The measurements.
    #[serde(flatten)]
    pub account: DataAccount,
    /// No configuration was given, so that effects that need one cannot be tested.
    #[serde(skip)]
    pub is_without_configuration: bool,
}

/// What a row of measurements is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum RowKind {
    /// A frame and a possible receiver.
    Link,
    /// The frames of a link, summed.
    AggregatedLink,
    /// A robot at an instant.
    Robot,
}

/// An effect that the data cannot show.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, JsonSchema)]
pub struct NotTestable {
    /// Its name.
    pub effect: String,
    /// The reason.
    pub because: String,
}

/// What rows hold.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
#[serde(untagged)]
pub enum Facts {
    /// Rows about links.
    Links(LinkFacts),
    /// Rows about robots.
    Robots(RobotFacts),
}

/// What rows about links hold. A range is null where no value is known.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct LinkFacts {
    /// Range of times (s).
    pub time_s: Option<[f64; 2]>,
    /// How many campaigns.
    pub runs: usize,
    /// The motes.
    pub motes: Motes,
    /// The links.
    pub links: LinkCounts,
    /// IEEE 802.15.4 channels.
    pub channels: BTreeSet<u8>,
    /// Range of distances between sender and receiver (m).
    pub distance_m: Option<[f64; 2]>,
    /// Range of readings of received signal strength (dBm).
    pub rssi_dbm: Option<[f64; 2]>,
    /// The share of frames that were received; null where that is unknown.
    #[serde(serialize_with = "json_number::serialize")]
    #[schemars(with = "Option<f64>")]
    pub delivery: Option<f64>,
    /// Covariates by name; absent if there are none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub covariates: Option<IndexMap<String, CovariateFacts>>,
    /// The place of each mote is known.
    #[serde(skip)]
    pub is_placed: bool,
    /// How many readings there are.
    #[serde(skip)]
    pub n_readings: usize,
    /// Readings are rounded to whole dB.
    #[serde(skip)]
    pub is_rounded: bool,
    /// Frames of which is known whether they were received.
    #[serde(skip)]
    pub n_frames: f64,
}

/// Motes of link measurements.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, JsonSchema)]
pub struct Motes {
    /// Their numbers.
    pub all: BTreeSet<u32>,
    /// How many of them stand still.
    pub still: usize,
}

/// How many links were measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, JsonSchema)]
pub struct LinkCounts {
    /// Each direction counted by itself.
    pub directed: usize,
    /// Pairs of motes.
    pub pairs: usize,
}

/// What rows about robots hold. A range is null where no value is known.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct RobotFacts {
    /// Range of times (s).
    pub time_s: Option<[f64; 2]>,
    /// How many campaigns.
    pub runs: usize,
    /// Numbers of the robots.
    pub agents: BTreeSet<u32>,
    /// Median time between samples (s).
    #[serde(serialize_with = "json_number::serialize")]
    #[schemars(with = "Option<f64>")]
    pub spacing_s: f64,
    /// What robots were commanded.
    pub commands: &'static str,
    /// Range of places along x (m).
    pub x_m: Option<[f64; 2]>,
    /// Range of places along y (m).
    pub y_m: Option<[f64; 2]>,
    /// Range of places along z (m); absent where robots move in a plane.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(with = "Option<Option<[f64; 2]>>")]
    pub z_m: Option<Option<[f64; 2]>>,
    /// Speeds that 1 % and 99 % of the samples stay below (m/s).
    pub speed_mps: Option<[f64; 2]>,
    /// How many windows of motion are predicted.
    pub windows: usize,
    /// Covariates by name; absent if there are none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub covariates: Option<IndexMap<String, CovariateFacts>>,
    /// Length of a window (s).
    #[serde(skip)]
    pub window_s: f64,
}

/// What is known of a covariate.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, JsonSchema)]
pub struct CovariateFacts {
    /// Least and greatest value.
    pub range: [f64; 2],
    /// Rows in which it is missing.
    pub missing: usize,
}
