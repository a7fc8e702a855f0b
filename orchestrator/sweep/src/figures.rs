//! The figures of a run's summary, each under its path.

use metrics::figures::{FigureValue, FiguresByName};
use record::metric::SECTIONS;
use record::run_summary::RunSummary;
use serde_json::{Value, json};

/// All of them: steps and time, then task, network and the network's own.
pub(crate) fn of_summary(summary: &RunSummary) -> FiguresByName {
    let mut figures = FiguresByName::new();
    let summary = json!(summary);
    for section in SECTIONS {
        below(&mut figures, section, &summary[section]);
    }
    figures
}

/// Every number and truth value below `name`; nulls as well, so that a missing value is distinguishable from an absent key.
fn below(figures: &mut FiguresByName, name: &str, value: &Value) {
    let mut add = |value| figures.insert(name.to_owned(), value);
    match value {
        Value::Object(entries) => {
            for (key, entry) in entries {
                below(figures, &format!("{name}.{key}"), entry);
            }
        }
        Value::Null => {
            add(None);
        }
        Value::Bool(flag) => {
            add(Some(FigureValue::Flag(*flag)));
        }
        Value::Number(number) => {
            let count = number.as_u64().map(FigureValue::Count);
            add(count.or_else(|| number.as_f64().map(FigureValue::Number)));
        }
        // Words, and one entry per mote or distance: the kept runs have them.
        Value::String(_) | Value::Array(_) => {}
    }
}
