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

/// The span of time to which a table `only` limits an effect: from its first moment up to its last (s), infinite where there is none.
#[must_use]
pub fn span_s(limits: &toml::Table) -> std::ops::Range<f64> {
    let moment = |key: &str| {
        let value = limits.get(key)?;
        value.as_float().or_else(|| value.as_integer().map(|whole| whole as f64))
    };
    moment("from_s").unwrap_or(f64::NEG_INFINITY)..moment("until_s").unwrap_or(f64::INFINITY)
}

/// The name of a candidate that is limited: `slip (only agents = [3], from_s = 10.0)`.
#[must_use]
pub fn limited_name(name: &str, limits: &toml::Table) -> String {
    format!("{name}{}", suffix(limits))
}

/// What such a name has beyond that of the effect.
pub(crate) fn suffix(limits: &toml::Table) -> String {
    let keys: Vec<String> = limits.iter().map(|(key, value)| format!("{key} = {value}")).collect();
    format!(" (only {})", keys.join(", "))
}
