//! A comparison in words: the text of the terminal.

use super::comparison::Comparison;
use std::fmt::Write as _;

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
    if !comparison.places.is_empty() {
        let _ = writeln!(
            text,
            "\nerror by covariate: share of the error variance that each covariate explains"
        );
    }
    for place in comparison.places.iter().take(MOST_COVARIATES) {
        let known = |value: f64, default: f64| if value.is_finite() { value } else { default };
        let _ = writeln!(
            text,
            "{:<22} {:>9.1} %   p = {:.2e}",
            place.covariate,
            100.0 * known(place.explained, 0.0),
            known(place.p_value, 1.0)
        );
    }
    text
}
