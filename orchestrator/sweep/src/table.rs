//! The table of a sweep: one row per trial.

use super::journal::TrialRow;
use super::metric_names;
use super::plan::{SweepPlan, SweepTrial};
use indexmap::IndexMap;
use metrics::figures::FigureValue;
use proto::config::Value as Written;
use record::table::{Cell, Heading, Table};
use record::{ColumnKind, RecordError};
use std::collections::BTreeMap;
use std::path::Path;

/// What is in a cell.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum TableEntry {
    Null,
    Bool(bool),
    Count(u64),
    Number(f64),
    Text(String),
}

/// A column with its entries, one per trial.
#[derive(Clone, Debug)]
pub(crate) struct TableColumn {
    /// Its name.
    pub(crate) name: String,
    /// Its type.
    pub(crate) kind: ColumnKind,
    /// One per trial.
    pub(crate) entries: Vec<TableEntry>,
}

impl TableColumn {
    /// The entries as numbers; of truth values 1 and 0.
    pub(crate) fn numbers(&self) -> Vec<Option<f64>> {
        let number = |entry: &TableEntry| match entry {
            TableEntry::Number(number) => Some(*number),
            TableEntry::Count(n) => Some(*n as f64),
            TableEntry::Bool(is) => Some(f64::from(u8::from(*is))),
            TableEntry::Null | TableEntry::Text(_) => None,
        };
        self.entries.iter().map(number).collect()
    }
}

/// Which columns say what the trial is; the others say what came of it.
pub(crate) const SETTING: &str = "setting";
/// The case.
pub(crate) const CASE: &str = "case";
/// The seed.
pub(crate) const SEED: &str = "experiment.seed";
/// Whether it ran to its end.
pub(crate) const STATUS: &str = "status";
/// Why a trial failed; the column is there if some trial did.
pub(crate) const ERROR: &str = "error";

/// The columns, in order: number of the setting, case, keys that vary, seed, status, error if a trial failed; then the figures, in the order in
/// which they come up. A figure has the name that `sweep.metrics` gives it, or else its path.
pub(crate) fn columns(plan: &SweepPlan, rows: &BTreeMap<SweepTrial, TrialRow>) -> Vec<TableColumn> {
    let trials: Vec<SweepTrial> = plan.trials().collect();
    let column_of = |name: &str, kind, entry: &dyn Fn(SweepTrial) -> TableEntry| TableColumn {
        name: name.to_owned(),
        kind,
        entries: trials.iter().map(|&trial| entry(trial)).collect(),
    };
    let mut columns =
        vec![column_of(SETTING, ColumnKind::U64, &|trial| TableEntry::Count(trial.setting as u64))];
    if !plan.sweep.cases.is_empty() {
        columns.push(column_of(CASE, ColumnKind::Text, &|trial| {
            plan.settings[trial.setting].case.clone().map_or(TableEntry::Null, TableEntry::Text)
        }));
    }
    for key in plan.keys() {
        let kind = kind_of(plan, key);
        columns.push(column_of(key, kind, &|trial| {
            let Some(node) = plan.settings[trial.setting].get(key) else { return TableEntry::Null };
            match (&node.value, kind) {
                (Written::Bool(is), ColumnKind::Bool) => TableEntry::Bool(*is),
                (Written::Integer(n), ColumnKind::F64) => TableEntry::Number(*n as f64),
                (Written::Number(number), ColumnKind::F64) => TableEntry::Number(*number),
                (Written::Text(text), _) => TableEntry::Text(text.clone()),
                (_, _) => TableEntry::Text(node.to_toml().to_string()),
            }
        }));
    }
    columns
        .push(column_of(SEED, ColumnKind::U64, &|trial| TableEntry::Count(plan.seeds[trial.seed])));
    let row = |trial: SweepTrial| rows.get(&trial);
    columns.push(column_of(STATUS, ColumnKind::Text, &|trial| {
        row(trial).map_or(TableEntry::Null, |row| TableEntry::Text(row.status.clone()))
    }));
    if rows.values().any(TrialRow::has_failed) {
        columns.push(column_of(ERROR, ColumnKind::Text, &|trial| {
            let failed = row(trial).filter(|row| row.has_failed());
            failed.and_then(|row| row.reason.clone()).map_or(TableEntry::Null, TableEntry::Text)
        }));
    }
    for name in figures(&trials, rows) {
        let value = |trial: SweepTrial| row(trial)?.values.get(name).copied().flatten();
        let mut values = trials.iter().filter_map(|&trial| value(trial));
        let is_bool = values.any(|value| matches!(value, FigureValue::Flag(_)));
        let kind = if is_bool { ColumnKind::Bool } else { ColumnKind::F64 };
        columns.push(column_of(
            metric_names::column(&plan.sweep, name),
            kind,
            &|trial| match value(trial) {
                Some(FigureValue::Flag(is)) => TableEntry::Bool(is),
                Some(FigureValue::Count(n)) => TableEntry::Number(n as f64),
                Some(FigureValue::Number(number)) => TableEntry::Number(number),
                None => TableEntry::Null,
            },
        ));
    }
    columns
}

/// The type that takes all values of a key.
fn kind_of(plan: &SweepPlan, key: &str) -> ColumnKind {
    let values = || plan.settings.iter().filter_map(|setting| setting.get(key));
    if values().all(|node| matches!(node.value, Written::Bool(_))) {
        ColumnKind::Bool
    } else if values().all(|node| matches!(node.value, Written::Integer(_) | Written::Number(_))) {
        ColumnKind::F64
    } else {
        ColumnKind::Text
    }
}

/// Names of all figures that are a number or a truth value in some trial.
fn figures<'a>(trials: &[SweepTrial], rows: &'a BTreeMap<SweepTrial, TrialRow>) -> Vec<&'a str> {
    let mut known: IndexMap<&str, bool> = IndexMap::new();
    for row in trials.iter().filter_map(|trial| rows.get(trial)) {
        for (name, value) in &row.values {
            *known.entry(name).or_default() |= value.is_some();
        }
    }
    known.into_iter().filter_map(|(name, has_value)| has_value.then_some(name)).collect()
}

/// Writes the table.
pub(crate) fn write(path: &Path, columns: &[TableColumn]) -> Result<(), RecordError> {
    let headings: Vec<Heading<'_>> = columns
        .iter()
        .map(|column| Heading { name: &column.name, kind: column.kind, is_nullable: true })
        .collect();
    let mut table = Table::create_of(path.to_owned(), &headings)?;
    let n_rows = columns.first().map_or(0, |column| column.entries.len());
    for row in 0..n_rows {
        table.push(columns.iter().map(|column| match &column.entries[row] {
            TableEntry::Null => Cell::Null,
            TableEntry::Bool(is) => Cell::Bool(*is),
            TableEntry::Count(n) => Cell::U64(*n),
            TableEntry::Number(number) => Cell::F64(*number),
            TableEntry::Text(text) => Cell::Text(text),
        }))?;
    }
    table.finish().map(|_| ())
}
