//! A campaign that was simulated: the answer that programs read as JSON.

use super::Simulated;
use crate::json_number;
use schemars::JsonSchema;
use serde::Serialize;

/// What the schema of the answer is called.
pub const SCHEMA: &str = "simulate/1";

/// A campaign that a model would have measured.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Simulation {
    /// The format of this answer.
    #[schemars(extend("const" = SCHEMA))]
    pub schema: &'static str,
    /// Number of rows written to the file.
    pub rows: usize,
    /// Rows of the file that cannot be used, and are not written.
    pub left_out: usize,
    /// Seed of every random draw.
    pub seed: u64,
    /// Standard deviation of the noise.
    #[serde(serialize_with = "json_number::serialize")]
    #[schemars(with = "Option<f64>")]
    pub noise: f64,
    /// Unit of the noise: dB of readings, m of positions.
    pub unit: &'static str,
    /// Whether the noise was estimated from the file, because the configuration does not say it.
    pub noise_is_estimated: bool,
}

impl Simulation {
    /// Of a campaign that was simulated under a seed.
    #[must_use]
    pub fn summarise(simulated: &Simulated, seed: u64) -> Self {
        Self {
            schema: SCHEMA,
            rows: simulated.n_rows(),
            left_out: simulated.n_left_out,
            seed,
            noise: simulated.noise,
            unit: simulated.unit,
            noise_is_estimated: simulated.is_noise_estimated,
        }
    }
}
