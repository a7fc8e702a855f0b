//! Keys that the command line sets over a file.

use super::{Node, Problem, Value};

/// Applies `--set key=value` to a tree: the value is TOML, or a bare word taken as a text.
///
/// # Errors
///
/// It is no assignment, or there can be no such key.
pub fn set(tree: &mut Node, assignment: &str) -> Result<(), Problem> {
    let (key, value) = assignment.split_once('=').ok_or_else(|| {
        Problem::new(format!("--set {assignment}"), "must be KEY=VALUE, such as experiment.seed=2")
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
