//! Questions about measurements, asked by the functions that the program calls.

use diagnose::compare::comparison::Comparison;
use diagnose::diagnosis::{Diagnosis, Parameter, Tested};
use diagnose::extend::ExtendedConfig;
use diagnose::{DiagnoseError, Extending, Request, Unobserved};
use measure::config::Compared;
use measure::table::DataTable;
use std::path::Path;

/// A model with this text.
///
/// # Panics
///
/// The text is no configuration.
#[must_use]
pub fn model(text: &str) -> Compared {
    Compared::of_text(Path::new("model.toml"), text.to_owned(), &[]).expect("a configuration")
}

/// Measurements with this text.
///
/// # Panics
///
/// The text is no table.
#[must_use]
pub fn measurements(csv: &str) -> DataTable {
    DataTable::of_csv(Path::new("data.csv"), csv.as_bytes()).expect("a table")
}

/// The diagnosis of a request.
///
/// # Panics
///
/// There is none.
#[must_use]
pub fn diagnosed(request: &Request<'_>) -> Diagnosis {
    diagnose::diagnose(request, &Unobserved).expect("an answer").answer
}

/// The comparison of a request.
///
/// # Panics
///
/// There is none.
#[must_use]
pub fn compared(request: &Request<'_>) -> Comparison {
    diagnose::compare(request, &Unobserved).expect("an answer").answer
}

/// The configuration of a request extended by these effects.
///
/// # Errors
///
/// An effect cannot be added.
pub fn extended(request: &Request<'_>, effects: &[&str]) -> Result<ExtendedConfig, DiagnoseError> {
    let extended = diagnose::extend(request, &Extending::named(effects), &Unobserved)?;
    Ok(extended.config.unwrap_or_else(|| unreachable!("nothing was corrected")))
}

/// What a diagnosis accepted, curves among it, in the order in which it was added.
#[must_use]
pub fn accepted(found: &Diagnosis) -> Vec<String> {
    let added = found.ladder.iter().filter_map(|rung| rung.model.strip_prefix("+ "));
    added.map(str::to_owned).collect()
}

/// An accepted candidate, by its number among them.
///
/// # Panics
///
/// There are fewer.
#[must_use]
pub fn accepted_candidate(found: &Diagnosis, number: usize) -> &Tested {
    found
        .candidates
        .iter()
        .filter(|candidate| candidate.accepted)
        .nth(number)
        .expect("as many candidates")
}

/// The standard error of an estimate, from its 90 % interval.
#[must_use]
pub fn standard_error(parameter: &Parameter) -> f64 {
    (parameter.high - parameter.low) / (2.0 * 1.645)
}
