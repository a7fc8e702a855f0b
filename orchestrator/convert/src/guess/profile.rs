//! What the columns of a log are like: numbers, times, names, and how they change from row to row.

use crate::formats::{Row, Rows};
use crate::time::{self, Dates, NoTime, Time};
use crate::units::Unit;
use csv::StringRecord;
use measure::DataError;
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

/// So many rows are looked at.
pub(super) const MOST_ROWS: usize = 20_000;
/// So many different values of a column are counted.
const MOST_DISTINCT: usize = 4096;

/// The first rows of a log.
#[derive(Clone, Debug)]
pub(super) struct Sample {
    /// Names of the columns.
    pub names: Vec<String>,
    /// The rows.
    pub rows: Vec<StringRecord>,
    /// The number of the file of each row, from 0.
    pub files: Vec<usize>,
    /// Rows that the reader could not divide into fields, and why not the first of them.
    pub broken: (usize, Option<String>),
    /// The log has more rows.
    pub is_cut: bool,
}

impl Sample {
    pub(super) fn read(rows: &mut dyn Rows) -> Result<Self, DataError> {
        let mut sample = Self {
            names: rows.names().to_vec(),
            rows: Vec::new(),
            files: Vec::new(),
            broken: (0, None),
            is_cut: false,
        };
        let mut row = Row::default();
        while rows.next(&mut row)? {
            if MOST_ROWS <= sample.rows.len() {
                sample.is_cut = true;
                break;
            }
            if let Some(problem) = row.problem.take() {
                sample.broken.0 += 1;
                sample.broken.1.get_or_insert(format!("line {}: {problem}", row.line));
            } else {
                sample.rows.push(row.fields.clone());
                sample.files.push(0);
            }
        }
        Ok(sample)
    }

    /// Adds a column for each name in braces of the pattern that stands for the files.
    pub(super) fn add_fields(&mut self, pattern: &str, files: &[String]) {
        let fields: Vec<Vec<(String, String)>> =
            files.iter().map(|file| crate::files::fields(pattern, Path::new(file))).collect();
        let names = fields.iter().flatten().map(|(name, _)| name.clone());
        self.names.extend(names.take(fields.first().map_or(0, Vec::len)));
        for (row, &file) in self.rows.iter_mut().zip(&self.files) {
            fields.get(file).into_iter().flatten().for_each(|(_, text)| row.push_field(text));
        }
    }

    /// Makes a row of each field of some columns that is not empty: the name of the column, and the field.
    pub(super) fn melt(&mut self, columns: &[usize], name: &str, value: &str) {
        let kept: Vec<usize> = (0..self.names.len()).filter(|at| !columns.contains(at)).collect();
        let mut names: Vec<String> = kept.iter().map(|&at| self.names[at].clone()).collect();
        names.extend([name.to_owned(), value.to_owned()]);
        let (mut rows, mut files) = (Vec::new(), Vec::new());
        for (row, &file) in self.rows.iter().zip(&self.files) {
            let field = |at: usize| row.get(at).unwrap_or_default();
            for &column in columns.iter().filter(|&&column| !field(column).trim().is_empty()) {
                if MOST_ROWS <= rows.len() {
                    self.is_cut = true;
                    break;
                }
                let mut melted: StringRecord = kept.iter().map(|&at| field(at)).collect();
                melted.push_field(&self.names[column]);
                melted.push_field(field(column));
                rows.push(melted);
                files.push(file);
            }
        }
        (self.names, self.rows, self.files) = (names, rows, files);
    }

    /// The number of a column.
    pub(super) fn place(&self, name: &str) -> Option<usize> {
        self.names.iter().position(|known| known == name)
    }

    /// A field, without spaces around it.
    pub(super) fn field(&self, row: usize, column: usize) -> &str {
        self.rows[row].get(column).unwrap_or_default().trim()
    }

    /// The numbers of a column, NaN where a field is none.
    pub(super) fn numbers(&self, column: usize) -> Vec<f64> {
        (0..self.rows.len())
            .map(|row| number(self.field(row, column)).unwrap_or(f64::NAN))
            .collect()
    }

    /// Rows that repeat an earlier one in every field, and the first of them (from 1).
    pub(super) fn repeats(&self) -> (usize, Option<usize>) {
        let mut seen = BTreeSet::new();
        let mut repeats = (0, None);
        for (number, row) in (1..).zip(&self.rows) {
            let key: Vec<&str> = row.iter().collect();
            if !seen.insert(key) {
                repeats.0 += 1;
                repeats.1.get_or_insert(number);
            }
        }
        repeats
    }
}

/// A number, with a unit behind it or not.
pub(super) fn number(field: &str) -> Option<f64> {
    match field {
        _ if field.eq_ignore_ascii_case("true") => Some(1.0),
        _ if field.eq_ignore_ascii_case("false") => Some(0.0),
        _ => {
            let plain = field.parse::<f64>().ok();
            let number = plain.or_else(|| Unit::of_value(field).map(|(number, _)| number));
            number.filter(|number| number.is_finite())
        }
    }
}

/// What a column is like.
#[derive(Clone, Debug)]
pub(super) struct Profile {
    /// Its name.
    pub name: String,
    /// Words of the name, in small letters.
    pub words: Vec<String>,
    /// The unit in the name or behind the values.
    pub unit: Option<&'static Unit>,
    /// Rows with a field that is not empty.
    pub n: usize,
    /// Rows with a number.
    pub n_numbers: usize,
    /// Rows with a date, and with a time of day alone.
    pub n_dates: usize,
    /// Rows with a time of day alone.
    pub n_clock: usize,
    /// Rows with a date of which day and month may be either way round.
    pub n_ambiguous: usize,
    /// The least, the median and the greatest number.
    pub range: [f64; 3],
    /// All numbers are whole.
    pub is_whole: bool,
    /// Share of the steps from row to row that do not go down.
    pub rising: f64,
    /// Different values, up to a bound.
    pub n_distinct: usize,
    /// The most frequent values with their counts, most frequent first, up to ten.
    pub frequent: Vec<(String, usize)>,
    /// The first value.
    pub example: String,
}

impl Profile {
    pub(super) fn of(sample: &Sample, column: usize) -> Self {
        let name = sample.names[column].clone();
        let mut profile = Self {
            words: words(&name),
            unit: Unit::of_column(&name),
            name,
            n: 0,
            n_numbers: 0,
            n_dates: 0,
            n_clock: 0,
            n_ambiguous: 0,
            range: [f64::NAN; 3],
            is_whole: true,
            rising: 0.0,
            n_distinct: 0,
            frequent: Vec::new(),
            example: String::new(),
        };
        let mut distinct: BTreeMap<&str, usize> = BTreeMap::new();
        let mut numbers = Vec::new();
        let mut times: Vec<i64> = Vec::new();
        for row in 0..sample.rows.len() {
            let field = sample.field(row, column);
            if field.is_empty() {
                continue;
            }
            profile.n += 1;
            if profile.example.is_empty() {
                field.clone_into(&mut profile.example);
            }
            if distinct.len() < MOST_DISTINCT || distinct.contains_key(field) {
                *distinct.entry(field).or_default() += 1;
            }
            if let Some(number) = number(field) {
                numbers.push(number);
                if profile.unit.is_none() && field.parse::<f64>().is_err() {
                    profile.unit = Unit::of_value(field).map(|(_, unit)| unit);
                }
                continue;
            }
            match time::read(field, time::NS_PER_S, Dates::default()) {
                Ok(Time::Date(ns)) => {
                    profile.n_dates += 1;
                    times.push(ns);
                }
                Ok(Time::OfDay(ns)) => {
                    profile.n_clock += 1;
                    times.push(ns);
                }
                Err(NoTime::Ambiguous) => {
                    profile.n_dates += 1;
                    profile.n_ambiguous += 1;
                }
                _ => {}
            }
        }
        profile.n_numbers = numbers.len();
        profile.is_whole =
            !numbers.is_empty() && numbers.iter().all(|number| number.fract() == 0.0);
        let rises = numbers.windows(2).filter(|pair| pair[0] <= pair[1]).count()
            + times.windows(2).filter(|pair| pair[0] <= pair[1]).count();
        let n_steps = numbers.len().saturating_sub(1) + times.len().saturating_sub(1);
        profile.rising = rises as f64 / (n_steps as f64).max(1.0);
        numbers.sort_by(f64::total_cmp);
        if let (Some(&least), Some(&greatest)) = (numbers.first(), numbers.last()) {
            profile.range = [least, numbers[numbers.len() / 2], greatest];
        }
        profile.n_distinct = distinct.len();
        let mut frequent: Vec<(String, usize)> =
            distinct.into_iter().map(|(value, n)| (value.to_owned(), n)).collect();
        frequent.sort_by(|a, b| b.1.cmp(&a.1).then_with(|| a.0.cmp(&b.0)));
        frequent.truncate(10);
        profile.frequent = frequent;
        profile
    }

    /// Whether nearly all fields are numbers.
    pub(super) fn is_numeric(&self) -> bool {
        0 < self.n
            && 9 * self.n <= 10 * (self.n_numbers + self.n_missing_words())
            && 0 < self.n_numbers
    }

    /// Fields such as `NaN`, which stand for nothing.
    fn n_missing_words(&self) -> usize {
        let is_word = |text: &str| {
            ["nan", "null", "none", "na", "n/a", "-"]
                .iter()
                .any(|word| text.eq_ignore_ascii_case(word))
        };
        self.frequent.iter().filter(|(text, _)| is_word(text)).map(|(_, n)| n).sum()
    }

    /// Whether nearly all fields are dates.
    pub(super) fn is_date(&self) -> bool {
        0 < self.n && 9 * self.n <= 10 * self.n_dates
    }

    /// Whether nearly all fields are times of day without a date.
    pub(super) fn is_clock(&self) -> bool {
        0 < self.n && 9 * self.n <= 10 * self.n_clock
    }

    /// Whether the same value stands in every row.
    pub(super) fn is_constant(&self) -> bool {
        self.n_distinct == 1
    }

    /// Whether the words of the name have one of these.
    pub(super) fn has(&self, words: &[&str]) -> bool {
        words.iter().any(|word| self.words.iter().any(|own| own == word))
    }

    /// Whether values may be names or numbers of nodes: few of them, each in many rows, and no fractions.
    pub(super) fn is_label(&self) -> bool {
        let is_number = 0 < self.n_numbers;
        self.n_dates + self.n_clock == 0
            && 0 < self.n
            && (!is_number || self.is_whole && 0.0 <= self.range[0])
            && self.n_distinct < MOST_DISTINCT
            && (self.n_distinct <= 2 || 3 * self.n_distinct <= self.n)
    }
}

/// Words of a column's name: `txPower_dBm` is tx, power, dbm; digits behind letters are words of their own.
pub(super) fn words(name: &str) -> Vec<String> {
    let mut words: Vec<String> = vec![String::new()];
    let mut last = ' ';
    for c in name.chars() {
        let is_new = c.is_uppercase() && last.is_lowercase()
            || c.is_ascii_digit() && last.is_alphabetic()
            || c.is_alphabetic() && last.is_ascii_digit();
        if is_new || !c.is_alphanumeric() {
            words.push(String::new());
        }
        if c.is_alphanumeric() {
            words.last_mut().into_iter().for_each(|word| word.extend(c.to_lowercase()));
        }
        last = c;
    }
    words.retain(|word| !word.is_empty());
    words
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_divided_into_words() {
        for (name, expected) in [
            ("x_tx(cm)", "x tx cm"),
            ("txPowerDbm", "tx power dbm"),
            ("field.pose.pose.position.x", "field pose pose position x"),
            ("RSSI1", "rssi 1"),
            ("devEUI", "dev eui"),
            ("%time", "time"),
        ] {
            assert_eq!(words(name).join(" "), expected);
        }
    }

    #[test]
    fn a_column_is_described_by_its_values() {
        let rows = ["-70", "NaN", "-71.5", "73"].map(|field| StringRecord::from(vec![field]));
        let sample = Sample {
            names: vec!["Signal".into()],
            rows: rows.into(),
            files: vec![0; 4],
            broken: (0, None),
            is_cut: false,
        };
        let profile = Profile::of(&sample, 0);
        assert_eq!((profile.n, profile.n_numbers, profile.is_whole), (4, 3, false));
        assert_eq!(profile.range, [-71.5, -70.0, 73.0]);
        assert!(!profile.is_numeric() || profile.n_missing_words() == 1);
    }
}
