//! Where an error comes from: what a comparison of a network, or of a swarm's task, says of its parts.

use indexmap::IndexMap;
use schemars::JsonSchema;
use serde::Serialize;

/// The error of a network split: robots, radio, protocol.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct NetworkErrorSplit {
    /// The parts, in the order in which measurements replaced the model's.
    pub order: [&'static str; 3],
    /// What that order means for what parts bring about together.
    pub note: &'static str,
    /// How many seeds the network was run under.
    pub seeds: u64,
    /// The parts, each with its significance.
    pub parts: Vec<ErrorPart>,
    /// The parts of the error in each figure.
    pub figures: Vec<NetworkFigureSplit>,
    /// The result in a sentence.
    pub sentence: String,
}

/// A part of an error.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct ErrorPart {
    /// Name of the part: `robot`, `radio` or `protocol`; of a task's error `network` or `robot`.
    pub part: &'static str,
    /// Chance of as much in any figure if nothing is wrong with this part.
    #[schemars(with = "Option<f64>")]
    pub p_value: f64,
    /// Whether it is significant.
    pub is_distinguishable: bool,
    /// The figure in which it is furthest out; null where it does not differ.
    pub figure: Option<&'static str>,
}

/// The error of a figure of packets, split.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct NetworkFigureSplit {
    /// Name of the figure.
    pub name: &'static str,
    /// Unit of the figure; empty for a number without.
    pub unit: &'static str,
    /// Its measured value.
    #[schemars(with = "Option<f64>")]
    pub measured: f64,
    /// Mean of the runs of the model as configured.
    #[schemars(with = "Option<f64>")]
    pub whole: f64,
    /// Mean of the runs with measured tracks.
    #[schemars(with = "Option<f64>")]
    pub with_tracks: f64,
    /// Mean of the runs with measured tracks and a trace of the model's own links, sampled as the measured links are.
    #[schemars(with = "Option<f64>")]
    pub with_tracks_and_own_links: f64,
    /// Mean of the runs with measured tracks and a trace of the measured links.
    #[schemars(with = "Option<f64>")]
    pub with_tracks_and_links: f64,
    /// How much of the error each part is; null where that is unknown.
    pub parts: IndexMap<&'static str, Option<PartOfFigure>>,
}

/// How much of the error of a figure a part is, in the figure's unit.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, JsonSchema)]
pub struct PartOfFigure {
    /// The estimate.
    #[schemars(with = "Option<f64>")]
    pub value: f64,
    /// Lower end of the 90 % interval.
    #[schemars(with = "Option<f64>")]
    pub low: f64,
    /// Upper end of the 90 % interval.
    #[schemars(with = "Option<f64>")]
    pub high: f64,
    /// Of a network: how far out it is, in standard deviations.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub z: Option<f64>,
}
