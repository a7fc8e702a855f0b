//! A comparison in words: the text of the terminal.

use super::comparison::{Comparison, Offset};
use std::fmt::Write as _;
use study::thresholds::{EVERYWHERE_SHARE, LEAST_OFFSET_DB};

/// Covariates that are shown.
const MOST_COVARIATES: usize = 8;

/// A comparison as a person reads it on a terminal.
#[must_use]
pub fn text(comparison: &Comparison) -> String {
    let mut text = String::new();
    let _ = writeln!(text, "{:<22} {:>10}   90 % interval", "score (held out)", "value");
    for ((name, value), [low, high]) in comparison.scores.iter().zip(comparison.intervals.values())
    {
        let _ = writeln!(text, "{name:<22} {value:>10.4}   {low:.4} to {high:.4}");
    }
    if let Some(offset) = offset(comparison) {
        let _ = writeln!(text, "\n{offset}");
    }
    if !comparison.places.is_empty() {
        let _ = writeln!(
            text,
            "\nerror by covariate: share of the error variance that each covariate explains"
        );
    }
    for place in comparison.places.iter().take(MOST_COVARIATES) {
        let known = |value: f64, default: f64| if value.is_finite() { value } else { default };
        let heading = place.heading.map_or_else(String::new, |heading| {
            format!("   of the heading {:.1} %", 100.0 * known(heading.explained, 0.0))
        });
        let _ = writeln!(
            text,
            "{:<22} {:>9.1} %   p = {:.2e}{heading}",
            place.covariate,
            100.0 * known(place.explained, 0.0),
            known(place.p_value, 1.0)
        );
    }
    text
}

/// The constant by which readings lie off the model, in a sentence.
fn offset(comparison: &Comparison) -> Option<String> {
    let Offset { value, low, high } = comparison.offset_db?;
    if value.abs() < LEAST_OFFSET_DB {
        return None;
    }
    let side = if value < 0.0 { "below" } else { "above" };
    let rmse_db = comparison.scores.get("rmse_received_db").copied().unwrap_or(f64::NAN);
    let is_everywhere = EVERYWHERE_SHARE * rmse_db * rmse_db <= value * value;
    let spread = if is_everywhere { "everywhere" } else { "on average" };
    let (nearest, farthest) = (low.abs().min(high.abs()), low.abs().max(high.abs()));
    Some(format!(
        "readings are {:.1} dB {side} the model {spread} (90 %: {nearest:.1} to {farthest:.1} dB)",
        value.abs()
    ))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::compare::comparison::SCHEMA;
    use indexmap::IndexMap;
    use measure::account::DataAccount;
    use study::open::Subject;

    fn said(value: f64, rmse_db: f64) -> String {
        let comparison = Comparison {
            schema: SCHEMA,
            kind: Subject::Links,
            unit: "blocks of time".to_owned(),
            scores: IndexMap::from([("rmse_received_db".to_owned(), rmse_db)]),
            intervals: IndexMap::from([("rmse_received_db".to_owned(), [rmse_db; 2])]),
            offset_db: Offset::significant(value, value - 0.2, value + 0.2),
            places: Vec::new(),
            account: DataAccount::default(),
        };
        text(&comparison)
    }

    #[test]
    fn a_constant_is_said_where_it_is_worth_it_and_everywhere_where_it_explains_half() {
        let everywhere = "readings are 15.5 dB below the model everywhere (90 %: 15.3 to 15.7 dB)";
        assert!(said(-15.5, 16.0).contains(everywhere), "{}", said(-15.5, 16.0));
        assert!(said(3.0, 4.0).contains("3.0 dB above the model everywhere"));
        assert!(said(3.0, 4.5).contains("3.0 dB above the model on average"));
        assert!(said(-1.0, 9.0).contains("1.0 dB below"));
        assert!(!said(-0.9, 9.0).contains("the model"));
        assert_eq!(Offset::significant(0.1, -0.1, 0.3), None);
    }
}
