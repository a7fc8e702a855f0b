//! Formats of logs: one file each, and the one list [`BUILT_IN`].
//!
//! A format turns a file into rows of named text fields. What the fields mean is the mapping's; a format whose fields always mean
//! the same states their columns, so that a mapping need not.

pub mod contiki;
pub mod csv;
pub mod json_lines;
pub mod k7;
pub mod openwsn;
pub mod openwsn_transmissions;
pub mod parquet;

use ::csv::StringRecord;
use measure::DataError;
use measure::formats::Content;
use proto::config::{Problem, Registered, Variant};
use std::path::Path;

/// Opens a log. The path is named in errors; the table has the format's keys.
pub type Open =
    for<'a> fn(&Path, Content<'a>, &toml::Table) -> Result<Box<dyn Rows + 'a>, DataError>;

/// Checks the keys of a format further, in the table at a path.
pub type Check = fn(&toml::Table, &str, &mut Vec<Problem>);

/// Nothing more is asked of the keys.
pub const UNCHECKED: Check = |_, _, _| {};

/// A format of logs.
#[derive(Clone, Copy, Debug)]
pub struct Format {
    /// Its name in mapping files, and its keys.
    pub variant: Variant,
    /// Columns of the table, and the fields that they are filled from unless the mapping says otherwise.
    /// Further columns whose name ends in `_node` hold nodes, by number or name.
    pub columns: &'static [(&'static str, &'static str)],
    /// What its keys must be like beyond their descriptions: [`UNCHECKED`] for nothing.
    pub check: Check,
    /// Opens a log.
    pub open: Open,
}

impl Registered for Format {
    fn variant(&self) -> &Variant {
        &self.variant
    }
}

/// The formats that are known.
pub const BUILT_IN: &[Format] = &[
    csv::FORMAT,
    json_lines::FORMAT,
    parquet::FORMAT,
    k7::FORMAT,
    openwsn::FORMAT,
    openwsn_transmissions::FORMAT,
    contiki::FORMAT,
];

/// The rows of a log.
pub trait Rows {
    /// Names of the fields.
    fn names(&self) -> &[String];

    /// From when times count (ns), if the log states it.
    fn start_ns(&self) -> Option<i64> {
        None
    }

    /// Reads the next row. Returns whether there is one.
    ///
    /// # Errors
    ///
    /// The log cannot be read further: the place is named.
    fn next(&mut self, row: &mut Row) -> Result<bool, DataError>;
}

/// A row of a log.
#[derive(Clone, Debug, Default)]
pub struct Row {
    /// The line that it stands on, from 1.
    pub line: usize,
    /// Its fields.
    pub fields: StringRecord,
    /// Why it cannot be used, if it cannot.
    pub problem: Option<String>,
}

/// Rows with further fields, the same in each.
pub(crate) struct WithFields<'a> {
    rows: Box<dyn Rows + 'a>,
    names: Vec<String>,
    values: Vec<String>,
}

impl<'a> WithFields<'a> {
    /// * `fields`: names and values, which come after those of the rows.
    pub(crate) fn new(rows: Box<dyn Rows + 'a>, fields: Vec<(String, String)>) -> Self {
        let mut names = rows.names().to_vec();
        let (further, values): (Vec<String>, Vec<String>) = fields.into_iter().unzip();
        names.extend(further);
        Self { rows, names, values }
    }
}

impl Rows for WithFields<'_> {
    fn names(&self) -> &[String] {
        &self.names
    }

    fn start_ns(&self) -> Option<i64> {
        self.rows.start_ns()
    }

    fn next(&mut self, row: &mut Row) -> Result<bool, DataError> {
        let is_there = self.rows.next(row)?;
        self.values.iter().for_each(|value| row.fields.push_field(value));
        Ok(is_there)
    }
}

/// Names of the fields that a row of one melted column has: the name of the column, and its value.
pub const MELTED: [&str; 2] = ["column", "value"];

/// Rows with several columns, of each of which a row is made.
pub(crate) struct Melted<'a> {
    rows: Box<dyn Rows + 'a>,
    names: Vec<String>,
    /// Columns that stay, and those that are melted.
    kept: Vec<usize>,
    melted: Vec<(usize, String)>,
    /// The row that is melted, and the next of the columns.
    row: Row,
    next: usize,
}

impl<'a> Melted<'a> {
    /// * `patterns`: names of the columns to melt; `*` and `?` stand for any characters.
    pub(crate) fn new(rows: Box<dyn Rows + 'a>, patterns: &[String]) -> Self {
        let is_melted =
            |name: &String| patterns.iter().any(|pattern| crate::files::is_match(pattern, name));
        let (melted, kept): (Vec<usize>, Vec<usize>) =
            (0..rows.names().len()).partition(|&at| is_melted(&rows.names()[at]));
        let names = kept.iter().map(|&at| rows.names()[at].clone());
        let names = names.chain(MELTED.map(str::to_owned)).collect();
        let melted: Vec<(usize, String)> =
            melted.into_iter().map(|at| (at, rows.names()[at].clone())).collect();
        let next = melted.len();
        Self { rows, names, kept, melted, row: Row::default(), next }
    }
}

impl Rows for Melted<'_> {
    fn names(&self) -> &[String] {
        &self.names
    }

    fn start_ns(&self) -> Option<i64> {
        self.rows.start_ns()
    }

    fn next(&mut self, row: &mut Row) -> Result<bool, DataError> {
        loop {
            let Some((at, name)) = self.melted.get(self.next) else {
                if self.melted.is_empty() || !self.rows.next(&mut self.row)? {
                    return Ok(false);
                }
                self.next = 0;
                continue;
            };
            self.next += 1;
            let value = self.row.fields.get(*at).unwrap_or_default();
            if value.trim().is_empty() && self.row.problem.is_none() {
                continue;
            }
            row.line = self.row.line;
            row.problem = self.row.problem.take();
            if row.problem.is_some() {
                self.next = self.melted.len();
            }
            row.fields.clear();
            for &at in &self.kept {
                row.fields.push_field(self.row.fields.get(at).unwrap_or_default());
            }
            row.fields.push_field(name);
            row.fields.push_field(value);
            return Ok(true);
        }
    }
}

/// An error of a file, in the words of `message`.
pub(crate) fn refused(path: &Path, message: impl Into<String>) -> DataError {
    DataError::Format { path: path.to_owned(), message: message.into() }
}

/// The checked table of a format's keys.
#[cfg(test)]
fn checked<T: proto::config::Section>(keys: &str) -> toml::Table {
    let node = proto::config::parse(keys).unwrap();
    let lists = proto::config::Lists::NONE;
    proto::config::check(&node, "", &T::SPEC, &lists, &mut Vec::new()).table
}
