//! What the command line puts over an experiment file.

use super::{Refusal, Tls};
use proto::config::{self, Node, Problem, Value};
use std::path::Path;

/// What the command line puts over the file.
#[derive(Clone, Debug, std::default::Default)]
pub struct Overrides {
    /// `--set key=value`, in order.
    pub set: Vec<String>,
    /// `--seed`.
    pub seed: Option<u64>,
    /// `--netsim`.
    pub netsim_url: Option<String>,
    /// `--robotsim`.
    pub robotsim_url: Option<String>,
    /// `--tls-ca`, `--tls-cert`, `--tls-key`.
    pub tls: Option<Tls>,
}

/// Parses the text of an experiment file and puts the overrides over it. Returns it with what is wrong with those.
pub(crate) fn opened(
    path: &Path,
    text: &str,
    overrides: &Overrides,
) -> Result<(Node, Vec<Problem>), Refusal> {
    let mut tree = config::parse(text)
        .map_err(|problems| Refusal::new(path, text, &Node::empty_table(), problems))?;
    let mut problems = Vec::new();
    for assignment in &overrides.set {
        if let Err(problem) = set(&mut tree, assignment) {
            problems.push(problem);
        }
    }
    if let Some(seed) = overrides.seed {
        match i64::try_from(seed) {
            Ok(seed) => {
                if let Err(problem) = tree.set("experiment.seed", Value::Integer(seed)) {
                    problems.push(problem);
                }
            }
            Err(_) => problems.push(
                Problem::new("--seed", format!("must be at most {}", i64::MAX))
                    .value(seed)
                    .nearest(i64::MAX),
            ),
        }
    }
    Ok((tree, problems))
}

/// `--set key=value`: the value is TOML, or a bare word taken as a text.
pub(crate) fn set(tree: &mut Node, assignment: &str) -> Result<(), Problem> {
    let (key, value) = assignment.split_once('=').ok_or_else(|| {
        Problem::new(format!("--set {assignment}"), "must be key=value, such as experiment.seed=2")
    })?;
    let (key, value) = (key.trim(), value.trim());
    let parsed: toml::Value = toml::from_str::<toml::Table>(&format!("v = {value}"))
        .ok()
        .and_then(|mut table| table.remove("v"))
        .unwrap_or_else(|| toml::Value::String(value.to_owned()));
    tree.set(key, Value::from(&parsed)).map_err(|problem| Problem {
        message: format!("{} (in --set {assignment})", problem.message),
        ..problem
    })
}
