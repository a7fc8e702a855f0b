//! What limits a candidate to some rows.

use proto::config::Problem;

/// Why a candidate cannot be limited.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum NotLimited {
    /// It is no effect of the catalogue whose parameters are fitted, or one that acts on all rows alike.
    #[error("the candidate cannot be limited to some rows")]
    Candidate,
    /// The limits are wrong.
    #[error("{}", listed(.0))]
    Limits(Vec<Problem>),
}

fn listed(problems: &[Problem]) -> String {
    problems.iter().map(ToString::to_string).collect::<Vec<_>>().join("\n")
}

/// The name of a candidate that is limited: `slip (only agents = [3], from_s = 10.0)`.
pub(crate) fn limited_name(name: &str, limits: &toml::Table) -> String {
    format!("{name}{}", suffix(limits))
}

/// What such a name has beyond that of the effect.
pub(crate) fn suffix(limits: &toml::Table) -> String {
    let keys: Vec<String> = limits.iter().map(|(key, value)| format!("{key} = {value}")).collect();
    format!(" (only {})", keys.join(", "))
}
