//! A formula as configurations write it: `expression`, `parameters`, `columns`.

use super::{Formula, operators};
use crate::config::{Problem, Section};

/// The keys that every effect has whose equation is a formula of the user's.
#[derive(Section)]
pub struct Keys {
    /// The expression: numbers, names, + - * / ^, parentheses and functions.
    expression: String,
    /// Parameters of the expression: for each name a table with value, or with start if it is not fitted yet, and with the range min
    /// to max of the fit.
    parameters: Option<toml::Value>,
    /// Columns of the measurements whose names resemble a known name; list them to confirm that they are not typing errors. Other
    /// columns need not be listed.
    #[key(length = 1..=100)]
    columns: Vec<String>,
}

/// More names than this no expression may use.
pub const MOST_NAMES: usize = 32;

/// A formula of a configuration.
#[derive(Clone, Debug, PartialEq)]
pub struct Written {
    /// The formula.
    pub formula: Formula,
    /// Its parameters, with their values.
    pub parameters: Vec<(String, f64)>,
}

impl Written {
    /// Reads the keys of a table that stands at `path`. `known`: names that every expression may use.
    ///
    /// Nothing is returned where something is wrong, which is then among the problems.
    pub fn read(
        keys: &Keys,
        path: &str,
        known: &[&str],
        problems: &mut Vec<Problem>,
    ) -> Option<Self> {
        let before = problems.len();
        let parameters = parameters(keys, &format!("{path}.parameters"), known, problems);
        let mut names: Vec<&str> = known.to_vec();
        names.extend(parameters.iter().map(|(name, _)| name.as_str()));
        names.extend(keys.columns.iter().map(String::as_str));
        let key = format!("{path}.expression");
        match Formula::parse(&keys.expression, &names, &|_| true) {
            Ok(formula) if MOST_NAMES < formula.names().len() => {
                let message = format!("must not use more than {MOST_NAMES} names");
                problems.push(Problem::new(key, message).value(formula.names().len()));
                None
            }
            Ok(formula) => {
                for (name, _) in &parameters {
                    if !formula.names().contains(name) {
                        let key = format!("{path}.parameters.{name}");
                        problems.push(Problem::new(
                            key,
                            "must be used by the expression; remove it otherwise",
                        ));
                    }
                }
                (problems.len() == before).then_some(Self { formula, parameters })
            }
            Err(error) => {
                problems.push(Problem::new(key, error.to_string()));
                None
            }
        }
    }

    /// The formula with the source of every name's value: a parameter, what `names` reads off a situation, or a column.
    #[must_use]
    pub fn bound<R: Copy>(self, names: &[(&str, R)]) -> Bound<R> {
        let source = |name: &String| match self.parameter(name) {
            Some(value) => Source::Value(value),
            None => match names.iter().find(|(known, _)| known == name) {
                Some(&(_, read)) => Source::Read(read),
                None => Source::Column(name.clone()),
            },
        };
        let sources = self.formula.names().iter().map(source).collect();
        Bound { formula: self.formula, sources }
    }

    /// The value of a parameter, if there is one of this name.
    #[must_use]
    pub fn parameter(&self, name: &str) -> Option<f64> {
        self.parameters.iter().find(|(known, _)| known == name).map(|&(_, value)| value)
    }
}

/// Where the value of a name comes from.
#[derive(Clone, Debug)]
enum Source<R> {
    /// It is a parameter.
    Value(f64),
    /// It is read off a situation, so.
    Read(R),
    /// It is a column of this name.
    Column(String),
}

/// A formula all of whose names have a source. `R`: how a number is read off a situation.
#[derive(Clone, Debug)]
pub struct Bound<R> {
    formula: Formula,
    sources: Vec<Source<R>>,
}

impl<R> Bound<R> {
    /// Its value in a situation, of which `read` reads numbers and `column` columns. None where a name has no value, or the
    /// result is not a number.
    pub fn value(
        &self,
        read: impl Fn(&R) -> Option<f64>,
        column: impl Fn(&str) -> Option<f64>,
    ) -> Option<f64> {
        let mut values = [0.0; MOST_NAMES];
        let values = values.get_mut(..self.sources.len())?;
        for (value, source) in values.iter_mut().zip(&self.sources) {
            *value = match source {
                Source::Value(value) => *value,
                Source::Read(how) => read(how)?,
                Source::Column(name) => column(name)?,
            };
        }
        Some(self.formula.evaluate(values)).filter(|value| !value.is_nan())
    }

    /// Whether it is a condition that holds. Names without a value are not a number, so that one which decides nothing does not
    /// matter.
    pub fn is_true(
        &self,
        read: impl Fn(&R) -> Option<f64>,
        column: impl Fn(&str) -> Option<f64>,
    ) -> bool {
        let mut values = [f64::NAN; MOST_NAMES];
        let Some(values) = values.get_mut(..self.sources.len()) else { return false };
        for (value, source) in values.iter_mut().zip(&self.sources) {
            let found = match source {
                Source::Value(value) => Some(*value),
                Source::Read(how) => read(how),
                Source::Column(name) => column(name),
            };
            *value = found.unwrap_or(f64::NAN);
        }
        self.formula.evaluate(values) == 1.0
    }

    /// The names that it uses.
    #[must_use]
    pub fn names(&self) -> &[String] {
        self.formula.names()
    }
}

fn parameters(
    keys: &Keys,
    path: &str,
    known: &[&str],
    problems: &mut Vec<Problem>,
) -> Vec<(String, f64)> {
    let Some(written) = &keys.parameters else { return Vec::new() };
    let Some(written) = written.as_table() else {
        problems.push(Problem::new(path, "must be a table of parameters").value(written));
        return Vec::new();
    };
    let mut read = Vec::new();
    for (name, keys) in written {
        let path = format!("{path}.{name}");
        let mut wrong = |key: &str, message: &str| {
            problems.push(Problem::new(format!("{path}{key}"), message));
        };
        let is_name = name.starts_with(|c: char| c.is_ascii_alphabetic() || c == '_')
            && name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_');
        if !is_name {
            wrong("", "must consist of letters, digits and _, and must not start with a digit");
        } else if known.contains(&name.as_str()) || operators::is_taken(name) {
            wrong("", "must differ from the names of covariates, constants and functions");
        }
        let Some(keys) = keys.as_table() else {
            wrong("", "must be a table with value or start, and min and max");
            continue;
        };
        for key in keys.keys() {
            if !["value", "start", "min", "max"].contains(&key.as_str()) {
                wrong(
                    &format!(".{key}"),
                    "is not a known key; the keys are value, start, min, max",
                );
            }
        }
        let number = |key: &str| match keys.get(key)? {
            toml::Value::Float(number) => Some(*number),
            toml::Value::Integer(number) => Some(*number as f64),
            _ => Some(f64::NAN),
        };
        for key in ["value", "start", "min", "max"] {
            if number(key).is_some_and(|number| !number.is_finite()) {
                wrong(&format!(".{key}"), "must be a finite number");
            }
        }
        if let (Some(min), Some(max)) = (number("min"), number("max"))
            && max <= min
        {
            wrong(".max", "must be greater than min");
        }
        match number("value").or(number("start")) {
            Some(value) => read.push((name.clone(), value)),
            None => wrong("", "must have value, or start if it is not fitted yet"),
        }
    }
    read
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> (Option<Written>, String) {
        let mut problems = Vec::new();
        let written = Written::read(
            &Keys::read(&text.parse().unwrap()),
            "effect[2]",
            &["distance_m"],
            &mut problems,
        );
        (written, problems.iter().map(|problem| format!("{problem}\n")).collect())
    }

    #[test]
    fn a_value_is_used_where_there_is_one_and_the_start_otherwise() {
        let (written, problems) = read(
            "expression = \"a * distance_m + b * humidity_pct\"\n\
             parameters = { a = { start = 1, min = 0, max = 9 }, b = { start = 2.0, value = 3.0 } }",
        );
        assert_eq!(problems, "");
        let written = written.unwrap();
        assert_eq!(written.parameters, [("a".to_owned(), 1.0), ("b".to_owned(), 3.0)]);
        assert_eq!(written.parameter("b"), Some(3.0));
        assert_eq!(written.formula.names(), ["a", "distance_m", "b", "humidity_pct"]);
    }

    #[test]
    fn refusals_name_the_key_and_point_into_the_expression() {
        for (text, expected) in [
            (
                "expression = \"2 * distanc_m\"",
                "effect[2].expression: unknown name distanc_m; did you mean distance_m?\n    2 * distanc_m\n        ^\n",
            ),
            (
                "expression = \"a\"\nparameters = { a = { min = 0 } }",
                "effect[2].parameters.a: must have value, or start if it is not fitted yet\n",
            ),
            (
                "expression = \"a\"\nparameters = { a = { start = 1, min = 2, max = 2 } }",
                "effect[2].parameters.a.max: must be greater than min\n",
            ),
            (
                "expression = \"a\"\nparameters = { a = { start = \"x\", step = 1 } }",
                "effect[2].parameters.a.step: is not a known key; the keys are value, start, min, \
                 max\neffect[2].parameters.a.start: must be a finite number\n",
            ),
            (
                "expression = \"distance_m\"\nparameters = { b = { value = 1 } }",
                "effect[2].parameters.b: must be used by the expression; remove it otherwise\n",
            ),
            (
                "expression = \"sqrt(distance_m)\"\nparameters = { distance_m = { value = 1 } }",
                "effect[2].parameters.distance_m: must differ from the names of covariates, constants and functions\n",
            ),
            (
                "expression = \"distance_m\"\nparameters = 3",
                "effect[2].parameters: must be a table of parameters, got 3\n",
            ),
        ] {
            assert_eq!(read(text).1, expected, "{text}");
        }
        let listed = "expression = \"distanc_m\"\ncolumns = [\"distanc_m\"]";
        assert_eq!(read(listed).1, "");
    }
}
