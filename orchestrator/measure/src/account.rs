//! Which measurements an answer is about: part of every answer.

use super::Rejected;
use schemars::JsonSchema;
use serde::Serialize;

/// A file of measurements, and how many of its rows an answer rests on.
#[derive(Clone, Debug, Default, Serialize, JsonSchema)]
#[schemars(rename = "Account")]
pub struct DataAccount {
    /// The file of measurements.
    pub data: DataFile,
    /// Rows in the file, its header apart.
    pub rows: usize,
    /// Number of rows that are used.
    pub used: usize,
    /// Rows that could not be used, by reason.
    pub rejected: Vec<Rejected>,
    /// What to check before the answer is trusted.
    pub warnings: Vec<String>,
    /// Name and version of the robot simulator whose predictions are the base model; absent where the configured model is.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub predicted_by: Option<String>,
}

/// A file of measurements, identified by its content.
#[derive(Clone, Debug, Default, Serialize, JsonSchema)]
pub struct DataFile {
    /// Name of the file, without its folder.
    pub file: String,
    /// SHA-256 of its content, hexadecimal.
    pub sha256: String,
}
