//! Configuration as data.
//!
//! A section is described once, as a [`TableSpec`]: its keys, their meaning, unit, range and default. From that one
//! description come the checks ([`check`], which collects every problem instead of stopping at the first), the
//! effective configuration with defaults filled in, and the JSON Schema ([`json_schema`]).
//!
//! What can be chosen by name, such as the effects of a simulator, is a list that is open: whoever runs the simulator may
//! add to it. A description therefore only names the list, and the lists themselves ([`Lists`]) are passed to the check.
//!
//! The check fills in defaults, so a default is written in the description and nowhere else: [`Section::read`] reads the section's
//! struct, which is its description, from the checked table, and cannot fail.

mod assignment;
mod check;
mod idle;
mod refusal;
mod registry;
mod schema;
mod section;
mod spec;
mod tree;

pub use assignment::set;
pub use check::{Checked, FileReference, Touch, TouchTarget, check};
pub use idle::{IdleKey, Reason, Relation, idle_keys};
pub use proto_derive::{Choice, OneOf, Section};
pub use refusal::Refusal;
pub use registry::{Lists, Registered, Registry};
pub use schema::json_schema;
pub use section::{
    Alternatives, CheckedTable, CheckedValue, ClusterLine, FilePath, Key, Program, Section, Url,
    greatest, has_variant, is_same_text, joined, key, may_be, tag, variant,
};
pub use spec::{Choice, Default, Field, Kind, Range, TableSpec, Tag, Variant, Variants};
pub use tree::{Node, Value, parse};

/// Something wrong with a configuration.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Problem {
    /// Path of the key: `netsim.phy.radius_m`, `site.wall[2].to_m`. Empty if the text is not TOML.
    pub path: String,
    /// What is wrong and what is allowed, starting with a verb: `must be greater than 0 m`.
    pub message: String,
    /// The offending value as written, if there is one.
    pub value: Option<String>,
    /// The nearest valid choice, if there is one.
    pub nearest: Option<String>,
    /// Bytes of the text, where no path can tell (syntax errors).
    pub span: Option<std::ops::Range<usize>>,
}

impl Problem {
    /// A problem with the key at `path`.
    pub fn new(path: impl Into<String>, message: impl Into<String>) -> Self {
        Self { path: path.into(), message: message.into(), value: None, nearest: None, span: None }
    }

    /// Adds the offending value.
    #[must_use]
    pub fn value(mut self, value: impl ToString) -> Self {
        self.value = Some(value.to_string());
        self
    }

    /// Adds the nearest valid choice.
    #[must_use]
    pub fn nearest(mut self, nearest: impl ToString) -> Self {
        self.nearest = Some(nearest.to_string());
        self
    }

    /// Puts a prefix before the path: `netsim` makes `netsim.phy` of `phy`.
    #[must_use]
    pub fn within(mut self, prefix: &str) -> Self {
        self.path = join(prefix, &self.path);
        self
    }
}

impl std::fmt::Display for Problem {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        if !self.path.is_empty() {
            write!(f, "{}: ", self.path)?;
        }
        f.write_str(&self.message)?;
        if let Some(value) = &self.value {
            write!(f, ", got {value}")?;
        }
        if let Some(nearest) = &self.nearest {
            write!(f, " (nearest valid: {nearest})")?;
        }
        Ok(())
    }
}

/// Joins a prefix and a key into a path.
#[must_use]
pub fn join(prefix: &str, key: &str) -> String {
    match (prefix.is_empty(), key.is_empty()) {
        (true, _) => key.to_owned(),
        (_, true) => prefix.to_owned(),
        _ => format!("{prefix}.{key}"),
    }
}

/// The most similar of `choices`, if any is similar enough to have been meant.
#[must_use]
pub fn most_similar<'a>(
    given: &str,
    choices: impl IntoIterator<Item = &'a str>,
) -> Option<&'a str> {
    let given = given.to_lowercase();
    choices
        .into_iter()
        .filter_map(|choice| Some((similarity(&given, choice)?, choice)))
        .max_by(|a, b| a.0.total_cmp(&b.0))
        .map(|(_, choice)| choice)
}

/// How similar two words are, from 0 to 1; `None`: too different for one to have been meant by the other. In short words the exchange of
/// two letters makes a great difference by Jaro and Winkler, so the number of edits counts, too.
fn similarity(given: &str, choice: &str) -> Option<f64> {
    let by_letters = strsim::jaro_winkler(given, choice);
    if 0.7 <= by_letters {
        return Some(by_letters);
    }
    let n_letters = given.chars().count().max(choice.chars().count());
    let n_edits = strsim::osa_distance(given, choice);
    (1 < n_letters && 3 * n_edits <= n_letters).then(|| 0.7 - n_edits as f64 / n_letters as f64)
}

#[cfg(test)]
mod tests {
    use super::most_similar;

    #[test]
    fn a_word_is_near_by_its_letters_or_by_few_edits() {
        let commands = ["new", "run", "render", "replay", "sweep"];
        for (given, nearest) in [
            ("rnu", Some("run")),
            ("nwe", Some("new")),
            ("swep", Some("sweep")),
            ("SWEEP", Some("sweep")),
            ("x", None),
            ("xyz", None),
        ] {
            assert_eq!(most_similar(given, commands), nearest, "{given}");
        }
    }
}
