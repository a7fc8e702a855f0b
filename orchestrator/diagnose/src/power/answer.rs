//! How large an effect a campaign would show: the answer that programs read as JSON and people as text.

use crate::gate::decimals;
use crate::json_number;
use schemars::JsonSchema;
use serde::Serialize;
use std::fmt::Write as _;

/// What the schema of the answer is called.
pub const SCHEMA: &str = "power/1";

/// The smallest size of an effect that a campaign would show, by simulated campaigns at several sizes.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Power {
    /// The format of this answer.
    #[schemars(extend("const" = SCHEMA))]
    pub schema: &'static str,
    /// Name of the effect in the catalogue.
    pub effect: String,
    /// The key of the effect that is its size.
    pub parameter: String,
    /// Unit of that key.
    pub unit: &'static str,
    /// The value at which the effect does nothing.
    pub neutral: f64,
    /// The probability with which the effect is to be found.
    pub power: f64,
    /// The value from which on it is found with that probability; null: not even at the greatest that was tried.
    #[serde(serialize_with = "json_number::serialize")]
    #[schemars(with = "Option<f64>")]
    pub value: Option<f64>,
    /// The result in a sentence.
    pub sentence: String,
    /// Standard deviation of the noise of all campaigns (dB or m).
    #[serde(serialize_with = "json_number::serialize")]
    #[schemars(with = "Option<f64>")]
    pub noise: f64,
    /// Candidates for which the level of significance is corrected.
    pub candidates: usize,
    /// The sizes that were simulated, the smallest first.
    pub tried: Vec<Size>,
    /// Whether all campaigns were simulated. If not, a signal or a time budget ended them: the answer may still change.
    pub complete: bool,
    /// How the answer was found.
    #[schemars(extend("const" = "simulation"))]
    pub method: &'static str,
    /// Unit of errors in words.
    #[serde(skip)]
    pub error_unit: &'static str,
}

/// A size at which campaigns were simulated.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Size {
    /// The value of the key.
    pub value: f64,
    /// Campaigns, of those simulated, in which the diagnosis found the effect.
    pub found: usize,
    /// Campaigns simulated at this size.
    pub campaigns: u64,
    /// Held-out root mean squared error without and with the effect, mean of the campaigns (dB or m).
    #[serde(serialize_with = "json_number::serialize")]
    #[schemars(with = "[Option<f64>; 2]")]
    pub rmse: [f64; 2],
}

/// The result in a sentence.
#[must_use]
pub fn sentence(power: &Power) -> String {
    let Power { effect, parameter, unit, neutral, .. } = power;
    let percent = 100.0 * power.power;
    let from = format!("it has no effect at {parameter} = {neutral}");
    if power.tried.is_empty() {
        return format!(
            "stopped before any result: no size of {effect} was simulated often enough"
        );
    }
    let found = match power.value {
        Some(value) => format!(
            "a campaign like this detects {effect} with a power of {percent} % from {parameter} = {value:.n$} {unit} on \
             ({from})",
            n = decimals(value, 4.0)
        ),
        None => {
            let last = power.tried.last().map_or(*neutral, |size| size.value);
            format!(
                "a campaign like this does not detect {effect} with a power of {percent} % even at {parameter} = {last:.n$} \
                 {unit} ({from})",
                n = decimals(last, 4.0)
            )
        }
    };
    if power.complete {
        found
    } else {
        format!("stopped early; partial result, which may still change: {found}")
    }
}

/// The answer as a person reads it on a terminal.
#[must_use]
pub fn text(power: &Power) -> String {
    let unit = power.error_unit;
    let mut text = format!(
        "{:>14} {:>10} {:>24}\n",
        power.parameter,
        "found",
        format!("rmse without, with ({unit})")
    );
    for Size { value, found, campaigns, rmse: [without, with] } in &power.tried {
        let _ = writeln!(
            text,
            "{value:>14.n$} {:>10} {:>24}",
            format!("{found} of {campaigns}"),
            format!("{without:.4}, {with:.4}"),
            n = decimals(*value, 4.0)
        );
    }
    let _ = write!(
        text,
        "\n{}\n(simulated campaigns, noise {:.4} {unit}; accepted by the rule of diagnose; tried alone, corrected for {} \
         candidates)",
        power.sentence, power.noise, power.candidates
    );
    text
}
