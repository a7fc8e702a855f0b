//! Formulas that a user asks to have fitted.

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
    ) -> Result<FormulaCandidate, FormulaFitError> {
        let mut problems = Vec::new();
        let node =
            Node { value: Value::from(&toml::Value::Table(self.written(known))), span: None };
        let table = check(&node, FORMULA, spec, lists, &mut problems).table;
        rest(&table, FORMULA, &mut problems);
        let mut wrong: Vec<String> = problems.iter().map(ToString::to_string).collect();
        wrong.extend(self.strangers(known, columns));
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
