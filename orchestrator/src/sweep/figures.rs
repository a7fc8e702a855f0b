//! The figures of a run's summary, each under its path.

use serde_json::{Map, Value};

/// Adds them all: steps and time, then task, network and the network's own.
pub(crate) fn of_summary(values: &mut Map<String, Value>, summary: &Value) {
    for name in ["steps", "simulated_s"] {
        values.insert(name.to_owned(), summary[name].clone());
    }
    for name in ["task", "network", "kpis"] {
        below(values, name, &summary[name]);
    }
}

/// Every number and truth value below `name`; nulls as well, so that what is missing can be told from what is not there.
fn below(values: &mut Map<String, Value>, name: &str, value: &Value) {
    match value {
        Value::Object(entries) => {
            for (key, entry) in entries {
                below(values, &format!("{name}.{key}"), entry);
            }
        }
        Value::Number(_) | Value::Bool(_) | Value::Null => {
            values.insert(name.to_owned(), value.clone());
        }
        // Words, and one entry per mote or distance: the kept runs have them.
        Value::String(_) | Value::Array(_) => {}
    }
}
