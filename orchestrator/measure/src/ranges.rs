//! Plausible ranges of measured quantities: a value outside is another unit, a faulty sensor or a slip of the pen.

use crate::table::DataTable;
use proto::config::Range;
use std::collections::BTreeMap;

/// Ranges by the unit that a column's name ends in.
const BY_UNIT: [(&str, Range); 17] = [
    ("_m", Range::PLACE),
    // Unix times included, but not in milliseconds.
    ("_s", Range::closed(-1e10, 1e10)),
    ("_mps", Range::closed(-1e4, 1e4)),
    ("_mps2", Range::closed(-1e5, 1e5)),
    ("_rad", Range::closed(-1e5, 1e5)),
    ("_radps", Range::closed(-1e4, 1e4)),
    ("_c", Range::closed(-273.15, 2000.0)),
    ("_pct", Range::closed(-1000.0, 1000.0)),
    ("_db", Range::closed(-1000.0, 1000.0)),
    ("_dbm", Range::closed(-1000.0, 1000.0)),
    ("_hz", Range::closed(-1e12, 1e12)),
    ("_pa", Range::closed(-1e8, 1e8)),
    ("_hpa", Range::closed(-1e6, 1e6)),
    ("_v", Range::closed(-1e6, 1e6)),
    ("_a", Range::closed(-1e6, 1e6)),
    ("_w", Range::closed(-1e9, 1e9)),
    ("_kg", Range::closed(-1e6, 1e6)),
];

/// The range of a number without a known unit.
const ANY_UNIT: Range = Range::closed(-1e15, 1e15);

/// The plausible range of a column of measurements, by the unit in its name.
#[must_use]
pub fn of_column(name: &str) -> Range {
    BY_UNIT.iter().find(|(unit, _)| name.ends_with(unit)).map_or(ANY_UNIT, |&(_, range)| range)
}

/// Finds fields of a table that are no numbers and values outside their ranges, and keeps account of the latter.
pub(crate) struct RangeCheck<'a> {
    columns: Vec<Checked<'a>>,
    /// Of rows with a field that is no finite number: the column of the first.
    strange: BTreeMap<usize, &'a str>,
}

struct Checked<'a> {
    name: &'a str,
    values: &'a [f64],
    range: Range,
    /// Rows outside, value and line of the first.
    outside: Option<(usize, f64, usize)>,
}

impl<'a> RangeCheck<'a> {
    /// Of all columns but `others`, whose ranges are checked elsewhere.
    pub(crate) fn new(table: &'a DataTable, others: &[&str]) -> Self {
        let columns = table
            .names()
            .iter()
            .zip(&table.columns)
            .filter(|(name, _)| !others.contains(&name.as_str()))
            .map(|(name, values)| Checked { name, values, range: of_column(name), outside: None })
            // Most files have no such value: their rows are not looked at again.
            .filter(|column| column.values.iter().any(|&value| column.is_outside(value)))
            .collect();
        // Of a row with several the first.
        let strange = table.strange().rev();
        let strange = strange.map(|(row, column, _)| (row, table.names()[column].as_str()));
        Self { columns, strange: strange.collect() }
    }

    /// Why a row cannot be used, if a field of it is no number or outside its range.
    pub(crate) fn refusal(&mut self, row: usize, line: usize) -> Option<String> {
        if let Some(name) = self.strange.get(&row) {
            return Some(format!("{name} is not a finite number"));
        }
        let column =
            self.columns.iter_mut().find(|column| column.is_outside(column.values[row]))?;
        let (rows, ..) = column.outside.get_or_insert((0, column.values[row], line));
        *rows += 1;
        Some(format!("{} is not {}", column.name, column.range.describe()))
    }

    /// A warning for each column with values outside: the first value, its line and the range.
    pub(crate) fn warnings(&self) -> impl Iterator<Item = String> {
        self.columns.iter().filter_map(|column| {
            let (rows, value, line) = column.outside?;
            Some(format!(
                "{} is {value:?} on line {line}, but must be {}; rows that are not used for that: {rows}. Check the unit",
                column.name,
                column.range.describe()
            ))
        })
    }
}

impl Checked<'_> {
    fn is_outside(&self, value: f64) -> bool {
        !value.is_nan() && !self.range.contains(value)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_unit_in_a_name_gives_the_range() {
        assert!(!of_column("temperature_c").contains(1e308));
        assert!(of_column("tx_temperature_c").contains(25.0));
        assert!(!of_column("x_m").contains(1e160));
        assert!(of_column("time_s").contains(1.7e9) && !of_column("time_s").contains(1.7e12));
        assert!(of_column("load").contains(1e9) && !of_column("load").contains(1e300));
    }
}
