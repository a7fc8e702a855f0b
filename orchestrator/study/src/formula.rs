//! Formulas that a user asks to have fitted.

use crate::thresholds::FORMULA_SAMPLE_ROWS;
use proto::config::{Lists, Node, Problem, TableSpec, Value, check, most_similar};
use proto::effect::Parameter;
use proto::formula::Formula;

/// The kind of effect that a formula is, of links and of robots.
pub const FORMULA: &str = "formula";

/// A formula as the user writes it.
#[derive(Clone, Debug, PartialEq)]
pub struct FormulaRequest {
    /// The expression, in the language of [`proto::formula`].
    pub expression: String,
    /// Its parameters: each with its start, least and greatest value.
    pub parameters: Vec<(String, [f64; 3])>,
    /// What it is added to; none: what the effect says.
    pub target: Option<String>,
}

/// Values of names in the rows of measurements.
pub struct RowValues<'a> {
    /// Number of rows.
    pub n_rows: usize,
    /// The value of a name in a row; none where it is not known.
    pub of: &'a dyn Fn(&str, usize) -> Option<f64>,
}

/// A formula that suits the measurements: an effect whose parameters are to be fitted.
#[derive(Clone, Debug)]
pub struct FormulaCandidate {
    /// Its checked table, parameters at their starts.
    pub table: toml::Table,
    /// Its parameters that are fitted, with ranges and starts, in the order in which the user gave them.
    pub parameters: Vec<Parameter>,
}

/// Sets a number of an effect: a parameter of a formula, the key, or a place of a list (`velocity_mps[1]`).
pub fn set(table: &mut toml::Table, key: &str, value: f64) {
    let parameters = table.get_mut("parameters").and_then(toml::Value::as_table_mut);
    if let Some(own) =
        parameters.and_then(|all| all.get_mut(key)).and_then(toml::Value::as_table_mut)
    {
        own.insert("value".to_owned(), value.into());
        return;
    }
    let Some((name, index)) = key.strip_suffix(']').and_then(|key| key.split_once('[')) else {
        table.insert(key.to_owned(), value.into());
        return;
    };
    let index: usize = index.parse().unwrap_or_default();
    let list = table.entry(name.to_owned()).or_insert_with(|| toml::Value::Array(Vec::new()));
    if let Some(list) = list.as_array_mut() {
        while list.len() <= index {
            list.push(0.0.into());
        }
        list[index] = value.into();
    }
}

/// A formula cannot be fitted: all that is wrong with it, a line each.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the formula cannot be fitted to these data\n{0}")]
pub struct FormulaFitError(String);

impl FormulaRequest {
    /// The effect that it is.
    ///
    /// * `spec`, `lists`, `rest`: what is asked of the table of an effect, key by key and together.
    /// * `known`: names that every formula may use.
    /// * `columns`: further names that have values in these measurements.
    /// * `value`: a name's value in a row, where it is known. The expression must vary with them.
    ///
    /// # Errors
    ///
    /// All that is wrong.
    pub fn checked(
        &self,
        spec: &TableSpec,
        lists: &Lists,
        rest: fn(&toml::Table, &str, &mut Vec<Problem>),
        known: &[&str],
        columns: &[&str],
        value: &RowValues<'_>,
    ) -> Result<FormulaCandidate, FormulaFitError> {
        let mut problems = Vec::new();
        let node =
            Node { value: Value::from(&toml::Value::Table(self.written(known))), span: None };
        let table = check(&node, FORMULA, spec, lists, &mut problems).table;
        rest(&table, FORMULA, &mut problems);
        let mut wrong: Vec<String> = problems.iter().map(ToString::to_string).collect();
        wrong.extend(self.strangers(known, columns));
        wrong.extend(self.shadows(columns));
        if wrong.is_empty() {
            wrong.extend(self.says_nothing(value));
        }
        if !wrong.is_empty() {
            return Err(FormulaFitError(wrong.join("\n")));
        }
        let parameters = self
            .parameters
            .iter()
            .map(|(name, range)| Parameter::of_formula(name, *range))
            .collect();
        Ok(FormulaCandidate { table, parameters })
    }

    /// The table of an effect as a configuration has it.
    fn written(&self, known: &[&str]) -> toml::Table {
        let mut table = toml::Table::new();
        let mut put = |key: &str, value: toml::Value| table.insert(key.to_owned(), value);
        put("kind", FORMULA.into());
        put("expression", self.expression.as_str().into());
        if let Some(target) = &self.target {
            put("target", target.as_str().into());
        }
        let parameters: toml::Table = self
            .parameters
            .iter()
            .map(|(name, [start, min, max])| {
                let keys = [("start", *start), ("min", *min), ("max", *max)];
                let keys: toml::Table =
                    keys.into_iter().map(|(key, number)| (key.to_owned(), number.into())).collect();
                (name.clone(), keys.into())
            })
            .collect();
        if !parameters.is_empty() {
            put("parameters", parameters.into());
        }
        // Slips among them are found by themselves.
        let used: Vec<toml::Value> = self.columns_used(known).into_iter().map(Into::into).collect();
        if !used.is_empty() {
            put("columns", used.into());
        }
        table
    }

    /// Names of the expression that are neither known nor parameters.
    fn columns_used(&self, known: &[&str]) -> Vec<String> {
        let Ok(formula) = Formula::parse(&self.expression, &[], &|_| true) else {
            return Vec::new();
        };
        let is_known = |name: &String| {
            known.contains(&name.as_str()) || self.parameters.iter().any(|(own, _)| own == name)
        };
        formula.names().iter().filter(|name| !is_known(name)).cloned().collect()
    }

    /// The refusal of parameters that have the name of a column.
    fn shadows(&self, columns: &[&str]) -> Vec<String> {
        let both = self.parameters.iter().filter(|(name, _)| columns.contains(&name.as_str()));
        both.map(|(name, _)| {
            format!(
                "the parameter {name} has the name of a column of these data; rename the parameter"
            )
        })
        .collect()
    }

    /// Why the expression says nothing about these measurements, if that is so: its value is never a finite number, or it names
    /// columns and is nevertheless the same in every row, whatever its parameters are.
    fn says_nothing(&self, value: &RowValues<'_>) -> Option<String> {
        let formula = Formula::parse(&self.expression, &[], &|_| true).ok()?;
        let names = formula.names();
        let of_parameter = |name: &String| self.parameters.iter().position(|(own, _)| own == name);
        let step = value.n_rows / FORMULA_SAMPLE_ROWS + 1;
        let rows: Vec<Vec<f64>> = (0..value.n_rows)
            .step_by(step)
            .filter_map(|row| {
                let of_name = |name: &String| match of_parameter(name) {
                    Some(_) => Some(0.0),
                    None => (value.of)(name, row).filter(|value| value.is_finite()),
                };
                names.iter().map(of_name).collect()
            })
            .collect();
        if rows.is_empty() {
            // Not one row has all names: nothing can be said of the expression.
            return None;
        }
        let mut is_finite = false;
        for parameters in self.settings() {
            let mut first = None;
            for row in &rows {
                let values: Vec<f64> = names
                    .iter()
                    .zip(row)
                    .map(|(name, value)| of_parameter(name).map_or(*value, |at| parameters[at]))
                    .collect();
                let result = formula.evaluate(&values);
                if !result.is_finite() {
                    continue;
                }
                is_finite = true;
                if *first.get_or_insert(result) != result {
                    return None;
                }
            }
        }
        if !is_finite {
            return Some(format!(
                "the expression {} is not a finite number in any of the {} rows looked at, at the start of its parameters \
                 or elsewhere in their ranges",
                self.expression,
                rows.len()
            ));
        }
        let must_vary = names.iter().any(|name| of_parameter(name).is_none());
        (must_vary || self.parameters.is_empty()).then(|| {
            format!(
                "the expression {} has the same value in every row, so there is nothing to fit; use a column that varies, or \
                 fit system-gain for an offset",
                self.expression
            )
        })
    }

    /// Settings of the parameters at which the expression is looked at: the starts, the ends and the middle of each range.
    fn settings(&self) -> Vec<Vec<f64>> {
        let starts: Vec<f64> = self.parameters.iter().map(|(_, [start, ..])| *start).collect();
        let mut settings = vec![starts.clone()];
        for (at, (_, [_, min, max])) in self.parameters.iter().enumerate() {
            for value in [*min, 0.5 * min + 0.5 * max, *max] {
                let mut setting = starts.clone();
                setting[at] = value;
                settings.push(setting);
            }
        }
        for share in [0.31, 0.77] {
            let inside = |(_, [_, min, max]): &(String, [f64; 3])| min + share * (max - min);
            settings.push(self.parameters.iter().map(inside).collect());
        }
        settings
    }

    /// What is said of columns that are not there.
    fn strangers(&self, known: &[&str], columns: &[&str]) -> Vec<String> {
        let used = self.columns_used(known);
        let strangers = used.iter().filter(|name| !columns.contains(&name.as_str()));
        strangers
            .map(|name| {
                let nearest = most_similar(name, known.iter().chain(columns).copied())
                    .map_or_else(String::new, |known| format!("; did you mean {known}?"));
                format!(
                    "{name} is neither a covariate of these data nor a parameter; declare a parameter with --parameter \
                     {name}=START:MIN:MAX{nearest}"
                )
            })
            .collect()
    }
}

impl FormulaCandidate {
    /// Where a fit starts.
    #[must_use]
    pub fn starts(&self) -> Vec<f64> {
        self.parameters.iter().map(|parameter| parameter.starts[0]).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn says_nothing(expression: &str, parameters: &[(&str, [f64; 3])]) -> Option<String> {
        let parameters =
            parameters.iter().map(|(name, range)| ((*name).to_owned(), *range)).collect();
        let expression = expression.to_owned();
        let of = |name: &str, row: usize| match name {
            "x" => Some(row as f64),
            "still" => Some(3.0),
            _ => None,
        };
        FormulaRequest { expression, parameters, target: None }
            .says_nothing(&RowValues { n_rows: 1200, of: &of })
    }

    #[test]
    fn an_expression_that_is_never_finite_or_never_varies_says_nothing() {
        let a = [("a", [0.0, 0.0, 1.0])];
        for (expression, parameters, part) in [
            ("1/0", &[][..], "is not a finite number in any of the 400 rows"),
            ("a / (x - x)", &a, "is not a finite number"),
            ("ln(-1 - x) * a", &a, "is not a finite number"),
            ("3", &[], "the same value in every row"),
            ("a * still", &a, "the same value in every row"),
            ("x - x", &[], "the same value in every row"),
        ] {
            let said = says_nothing(expression, parameters).unwrap();
            assert!(said.contains(part), "{expression}: {said}");
        }
        // At the start of a it is 0 in every row, and elsewhere it varies; an offset is a parameter alone; of a name without
        // values nothing is known.
        for (expression, parameters) in
            [("a * x", &a[..]), ("a", &a), ("sqrt(x - 5)", &[]), ("x / y", &[])]
        {
            assert_eq!(says_nothing(expression, parameters), None, "{expression}");
        }
    }

    #[test]
    fn a_parameter_may_not_shadow_a_column() {
        let request = FormulaRequest {
            expression: "air_c * 2".to_owned(),
            parameters: vec![("air_c".to_owned(), [0.0, 0.0, 1.0])],
            target: None,
        };
        assert_eq!(request.shadows(&["air_c"]).len(), 1);
        assert!(
            request.shadows(&["air_c"])[0].contains("the parameter air_c has the name of a column")
        );
        assert_eq!(request.shadows(&["load_kg"]), [""; 0]);
    }
}
