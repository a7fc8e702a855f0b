//! What a file that describes an experiment or a sweep would run: the answers that programs read as JSON.

use schemars::JsonSchema;
use serde::Serialize;

/// What the schema of the answers is called.
pub const CHECK_SCHEMA: &str = "check/1";

/// An experiment that can be run.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, JsonSchema)]
pub struct ExperimentCheck {
    /// The format of this answer.
    #[schemars(extend("const" = CHECK_SCHEMA))]
    pub schema: &'static str,
    /// Name of the experiment.
    pub name: String,
    /// How many agents it has.
    pub agents: usize,
    /// Its seed.
    pub seed: u64,
    /// Steps that it takes.
    pub steps: u64,
    /// The control period (ns).
    pub step_ns: u64,
    /// What the file asks for outside of its own folder: each needs a permission when it is run.
    pub capabilities: Vec<AskedPermission>,
    /// What to check before the experiment is run.
    pub warnings: Vec<String>,
}

/// A sweep that can be run.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, JsonSchema)]
pub struct SweepCheck {
    /// The format of this answer.
    #[schemars(extend("const" = CHECK_SCHEMA))]
    pub schema: &'static str,
    /// How many settings it has.
    pub settings: usize,
    /// How many trials: settings times seeds.
    pub trials: usize,
    /// What the file asks for outside of its own folder: each needs a permission when it is run.
    pub capabilities: Vec<AskedPermission>,
    /// What to check before the sweep is run.
    pub warnings: Vec<String>,
}

/// Something that a file asks for outside of its own folder.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, JsonSchema)]
pub struct AskedPermission {
    /// Path of the key that asks for it.
    pub key: String,
    /// What it would do.
    pub would: String,
    /// The option that allows it.
    pub option: String,
}
