//! A formula of the user's on the command line.

use clap::Args;
use study::formula::FormulaRequest;

/// A formula to be fitted.
#[derive(Args)]
pub(super) struct FormulaArgs {
    /// Fit and add your own expression of covariates and parameters, as in '-a * max(temperature_c - onset_c, 0)'
    #[arg(long, value_name = "EXPRESSION", allow_hyphen_values = true, conflicts_with = "all")]
    formula: Option<String>,
    /// A parameter of the formula with its initial value and, optionally, its range, as in a=0.1 or a=0.1:0:1. Repeatable
    #[arg(
        long,
        value_name = "NAME=START[:MIN:MAX]",
        value_parser = parameter,
        requires = "formula"
    )]
    parameter: Vec<(String, [f64; 3])>,
    /// Quantity that the formula is added to: mean, noise or loss for links; ahead, left, east, north or up for robots
    /// [default: mean for links, ahead for robots]
    #[arg(long, value_name = "TARGET", requires = "formula")]
    target: Option<String>,
}

impl FormulaArgs {
    /// The formula, if there is one.
    pub(super) fn wanted(&self) -> Option<FormulaRequest> {
        Some(FormulaRequest {
            expression: self.formula.clone()?,
            parameters: self.parameter.clone(),
            target: self.target.clone(),
        })
    }
}

/// How far a parameter may go from its start where no range is given: so many times the start, or 1 where that is 0.
const FAR: f64 = 1e3;

/// Reads `a=0.1` or `a=0.1:0:1`.
fn parameter(text: &str) -> Result<(String, [f64; 3]), String> {
    let form = "expected NAME=START or NAME=START:MIN:MAX, such as a=0.1:0:1";
    let (name, numbers) = text.split_once('=').ok_or(form)?;
    let numbers: Vec<f64> = numbers
        .split(':')
        .map(|number| {
            let read = number.trim().parse::<f64>().ok().filter(|number| number.is_finite());
            read.ok_or_else(|| format!("{number:?} is not a number; {form}"))
        })
        .collect::<Result<_, _>>()?;
    let range = match numbers[..] {
        [start] => {
            let reach = FAR * if start == 0.0 { 1.0 } else { start.abs() };
            [start, -reach, reach]
        }
        [start, min, max] if min < max && (min..=max).contains(&start) => [start, min, max],
        [start, min, max] if min < max => {
            let nearest = start.clamp(min, max);
            return Err(format!(
                "START must be from {min} to {max}, got {start}; nearest valid: {nearest}"
            ));
        }
        [_, min, max] => return Err(format!("MAX ({max}) must be greater than MIN ({min})")),
        _ => return Err(form.to_owned()),
    };
    Ok((name.trim().to_owned(), range))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_parameter_has_a_start_and_may_have_a_range() {
        assert_eq!(parameter("a=0.5:0:2"), Ok(("a".to_owned(), [0.5, 0.0, 2.0])));
        assert_eq!(parameter("b = -2"), Ok(("b".to_owned(), [-2.0, -2000.0, 2000.0])));
        assert_eq!(parameter("c=0"), Ok(("c".to_owned(), [0.0, -1000.0, 1000.0])));
        for (text, part) in [
            ("a", "NAME=START"),
            ("a=", "\"\" is not a number"),
            ("a=1:2", "NAME=START:MIN:MAX"),
            ("a=1:2:2", "MAX (2) must be greater than MIN (2)"),
            ("a=5:0:1", "from 0 to 1, got 5; nearest valid: 1"),
            ("a=inf", "\"inf\" is not a number"),
        ] {
            let error = parameter(text).unwrap_err();
            assert!(error.contains(part), "{text}: {error}");
        }
    }
}
