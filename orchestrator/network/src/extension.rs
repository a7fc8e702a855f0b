//! What was added to the configuration of a network: the answer that programs read as JSON.

use diagnose::diagnosis::Parameter;
use indexmap::IndexMap;
use schemars::JsonSchema;
use serde::Serialize;

pub use diagnose::extend::extension::SCHEMA;

/// Effects added to a network, and how probable measured packets are before and after.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct NetworkExtension {
    /// The format of this answer.
    #[schemars(extend("const" = SCHEMA))]
    pub schema: &'static str,
    /// What was measured.
    #[schemars(extend("const" = "network"))]
    pub kind: &'static str,
    /// Names of the effects that were added.
    pub added: Vec<&'static str>,
    /// The number of each effect as fitted: by effect, then by key.
    pub parameters: IndexMap<&'static str, IndexMap<&'static str, Parameter>>,
    /// Chance that a run of the model lies as far out as the packets, before and after.
    #[schemars(with = "[Option<f64>; 2]")]
    pub p_value: [f64; 2],
    /// Log density of the packets before and after (nats).
    #[schemars(with = "[Option<f64>; 2]")]
    pub log_score: [f64; 2],
}
