//! What the parts of `[robotsim]` are described with and checked against.

use bytes::Bytes;
use proto::config::{Problem, join};
use std::collections::BTreeMap;

/// What a part of a configuration is checked against.
#[derive(Clone, Debug)]
pub struct Context<'a> {
    /// Path of the part.
    pub path: String,
    /// How many agents there are.
    pub n_agents: usize,
    /// The greatest speed (m/s).
    pub speed_cap_mps: f64,
    /// The files that the configuration names.
    pub files: &'a BTreeMap<String, Bytes>,
}

impl Context<'_> {
    /// A problem with a key of the part.
    #[must_use]
    pub fn problem(&self, key: &str, message: impl Into<String>) -> Problem {
        Problem::new(join(&self.path, key), message)
    }
}
