//! A file as named columns of numbers.

use super::memory::{Memory, MemoryBudget};
use super::time_of_day::{self, TIME_OF_DAY};
use proto::bounds::{CELLS, COLUMNS, ROWS};
use std::collections::BTreeMap;
use std::path::PathBuf;

/// A table of numbers. A missing value is NaN.
#[derive(Clone, Debug)]
pub struct DataTable {
    /// Path of the file that it was read from; empty if from none.
    pub path: PathBuf,
    /// SHA-256 of the file, in hexadecimal digits.
    pub sha256: String,
    pub(crate) names: Vec<String>,
    /// Number of each column by its name.
    pub(crate) index: BTreeMap<String, usize>,
    pub(crate) columns: Vec<Vec<f64>>,
    pub(crate) strange: Strange,
    pub(crate) n_rows: usize,
    pub(crate) first_line: usize,
    /// What the table takes, out of what reading may take.
    pub(crate) memory: Memory,
}

impl DataTable {
    /// A table of columns that are at hand.
    #[must_use]
    pub fn of_columns(names: Vec<String>, columns: Vec<Vec<f64>>) -> Self {
        let n_rows = columns.first().map_or(0, Vec::len);
        // Of equal names the first.
        let numbered = names.iter().enumerate().rev();
        let index = numbered.map(|(number, name)| (name.clone(), number)).collect();
        Self {
            path: PathBuf::new(),
            sha256: String::new(),
            names,
            index,
            columns,
            strange: Strange::default(),
            n_rows,
            first_line: 2,
            memory: Memory::UNLIMITED,
        }
    }

    /// A table without rows, to be filled.
    ///
    /// # Errors
    ///
    /// It has more columns than are read.
    pub(crate) fn with_columns(names: Vec<String>, memory: Memory) -> Result<Self, String> {
        COLUMNS.check(names.len() as u64)?;
        let columns = vec![Vec::new(); names.len()];
        Ok(Self { memory, ..Self::of_columns(names, columns) })
    }

    /// Counts a row whose fields were all appended.
    ///
    /// # Errors
    ///
    /// It is one more than are read, or than there is memory for.
    pub(crate) fn end_row(&mut self) -> Result<(), String> {
        self.n_rows += 1;
        let n_columns = self.names.len();
        ROWS.check(self.n_rows as u64)?;
        CELLS.check((self.n_rows * n_columns) as u64)?;
        let what = format_args!("{} rows of {n_columns} columns", self.n_rows);
        self.memory.take((CELL_BYTES * n_columns) as u64, what)?;
        self.count_strange()
    }

    /// Counts the memory of fields that were noted as no finite numbers.
    ///
    /// # Errors
    ///
    /// There is not the memory for them.
    pub(crate) fn count_strange(&mut self) -> Result<(), String> {
        let n = self.strange.at.len();
        let bytes =
            size_of::<StrangeCell>() * (n - std::mem::replace(&mut self.strange.counted, n));
        self.memory.take(bytes as u64, format_args!("{n} fields that are not finite numbers"))
    }

    /// Refuses what would be made of the rows, so many bytes of each, if there is not the memory for it.
    pub(crate) fn check_memory(&self, bytes_per_row: usize, what: &str) -> Result<(), String> {
        let bytes = bytes_per_row.saturating_mul(self.n_rows) as u64;
        let mut memory = self.memory;
        memory.take(bytes, format_args!("{} rows as {what}", self.n_rows))
    }

    /// What to say of a table that lacks columns of a kind of measurements.
    #[must_use]
    pub fn lacking(&self, kind: &str, columns: &[String]) -> String {
        format!("not {kind}: the file lacks {}. {}", columns.join(", "), self.import_hint())
    }

    /// What to do about a table whose columns are not those of measurements.
    #[must_use]
    pub fn import_hint(&self) -> String {
        format!(
            "If its columns have other names or units, make measurements of it: murmuration import {}",
            self.path.display()
        )
    }

    /// The budget that it was read within.
    #[must_use]
    pub fn budget(&self) -> MemoryBudget {
        self.memory.budget()
    }

    /// How much memory it takes (bytes).
    pub(crate) fn n_bytes(&self) -> u64 {
        let n_cells: usize = self.columns.iter().map(Vec::len).sum();
        (CELL_BYTES * n_cells + size_of::<StrangeCell>() * self.strange.at.len()) as u64
    }

    /// Fields that are not finite numbers: row, column, and what stands there, up to some texts and length. In order of rows.
    pub fn strange(&self) -> impl DoubleEndedIterator<Item = (usize, usize, &str)> {
        let texts = &self.strange.texts;
        self.strange.at.iter().map(|at| {
            let text = texts.get(&at.column).and_then(|of| of.get(usize::from(at.text)));
            (at.row as usize, usize::from(at.column), text.map_or("", String::as_str))
        })
    }

    /// Notes a field that is not a finite number.
    pub(crate) fn add_strange(&mut self, row: usize, column: usize, text: &str) {
        let column = u16::try_from(column).expect("a table has at most 2000 columns");
        let text = self.strange.number_of(column, text);
        self.strange.at.push(StrangeCell { row: row as u32, column, text });
    }

    /// Appends a field to a column. What is no finite number is noted as strange.
    pub(crate) fn push(&mut self, column: usize, field: &str) {
        let value = if field.is_empty() {
            f64::NAN
        } else {
            match field.parse::<f64>() {
                Ok(value) if value.is_finite() => value,
                _ => {
                    self.add_strange(self.n_rows, column, field);
                    f64::NAN
                }
            }
        };
        self.columns[column].push(value);
    }

    /// Number of rows.
    #[must_use]
    pub fn n_rows(&self) -> usize {
        self.n_rows
    }

    /// Names of the columns, in their order in the file.
    #[must_use]
    pub fn names(&self) -> &[String] {
        &self.names
    }

    /// The values of a column by its name, a value per row, NaN where missing; `None`: there is no such column.
    #[must_use]
    pub fn column(&self, name: &str) -> Option<&[f64]> {
        self.index.get(name).map(|&number| &self.columns[number][..])
    }

    /// The line of the file on which a row stands; in Parquet the number of the row, from 1.
    #[must_use]
    pub fn line(&self, row: usize) -> usize {
        row + self.first_line
    }
}

/// Memory of a number (bytes).
pub(crate) const CELL_BYTES: usize = size_of::<f64>();
/// So many texts of a column are kept.
const TEXTS_OF_COLUMN: usize = 30;
/// Longer texts are cut (characters).
const LONGEST_TEXT: usize = 64;

/// Fields that are not finite numbers.
#[derive(Clone, Debug, Default)]
pub(crate) struct Strange {
    pub(crate) at: Vec<StrangeCell>,
    /// Different texts of each column.
    texts: BTreeMap<u16, Vec<String>>,
    /// How many are counted as memory.
    counted: usize,
}

/// Where such a field stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct StrangeCell {
    pub(crate) row: u32,
    pub(crate) column: u16,
    text: u16,
}

impl Strange {
    /// Puts them in the order of rows.
    pub(crate) fn sort(&mut self) {
        self.at.sort_unstable();
    }

    /// The number of a text in a column; one beyond all if it is not kept.
    fn number_of(&mut self, column: u16, text: &str) -> u16 {
        let end = text.char_indices().nth(LONGEST_TEXT).map_or(text.len(), |(end, _)| end);
        let text = &text[..end];
        let texts = self.texts.entry(column).or_default();
        let number = texts.iter().position(|known| known == text).unwrap_or(texts.len());
        if number == texts.len() && number < TEXTS_OF_COLUMN {
            texts.push(text.to_owned());
        }
        number as u16
    }
}

/// Every numeric column that says anything and is not among `known`, and the time of day where it is known: name, and a value
/// for each of `rows`. Warns of columns that say nothing.
///
/// * `ignored`: why a column is not used, by its name.
pub(crate) fn covariates(
    table: &DataTable,
    known: &[&str],
    rows: &[usize],
    warnings: &mut Vec<String>,
    ignored: impl Fn(&str) -> Option<String>,
) -> Vec<(String, Vec<f64>)> {
    let mut covariates = Vec::new();
    let others = table.names().iter().filter(|name| !known.contains(&name.as_str()));
    for (name, column) in others.filter_map(|name| Some((name, table.column(name)?))) {
        if let Some(reason) = ignored(name) {
            warnings.push(reason);
            continue;
        }
        let values: Vec<f64> = rows.iter().map(|&row| column[row]).collect();
        let mut finite = values.iter().copied().filter(|value| value.is_finite());
        match finite.next() {
            None => warnings.push(format!("{name} holds no number; the column is ignored")),
            Some(first) if finite.all(|value| value == first) => warnings
                .push(format!("{name} is {first} in every row, so its influence cannot be tested")),
            Some(_) => covariates.push((name.clone(), values)),
        }
    }
    if table.column(TIME_OF_DAY).is_none()
        && let Some(hours) = time_of_day::covariate(table)
    {
        let hours = rows.iter().map(|&row| hours[row]).collect();
        covariates.push((TIME_OF_DAY.to_owned(), hours));
    }
    covariates
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::DataError;
    use std::path::Path;

    fn csv(text: &str) -> Result<DataTable, DataError> {
        DataTable::of_csv(Path::new("data.csv"), text.as_bytes())
    }

    #[test]
    fn a_table_has_named_columns_and_missing_values() {
        let table = csv("time_s, rssi_dbm\n1,-70\n2,\n").unwrap();
        assert_eq!(table.names(), ["time_s", "rssi_dbm"]);
        assert_eq!(table.column("time_s"), Some(&[1.0, 2.0][..]));
        assert!(table.column("rssi_dbm").unwrap()[1].is_nan());
        assert_eq!(table.line(1), 3);
    }

    #[test]
    fn what_is_no_number_is_told_with_its_place() {
        let table = csv("a,b\n1,x\ninf,2\n").unwrap();
        assert_eq!(table.strange().collect::<Vec<_>>(), [(0, 1, "x"), (1, 0, "inf")]);
    }

    #[test]
    fn what_is_no_table_is_refused() {
        for (text, part) in [
            ("", "empty"),
            ("1,2\n3,4\n", "name the columns"),
            ("a,a\n", "two columns are named a"),
            ("a,b\n1\n", "line 2 has 1 fields"),
        ] {
            let error = csv(text).unwrap_err().to_string();
            assert!(error.contains(part), "{error}");
        }
    }
}
