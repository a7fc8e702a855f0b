//! Rows of a log, in the columns of the table.

use crate::ConvertError;
use crate::account::Account;
use crate::formats::{Row, Rows};
use crate::geodesy::{FARTHEST_M, TangentPlane};
use crate::labels::Labels;
use crate::mapping::{Change, Input, Source, Target};
use crate::tables::Content;
use crate::time::{self, Dates, DayClock, NS_PER_S, NoTime, Time};
use crate::units::Unit;
use csv::StringRecord;
use measure::memory::Memory;
use proto::bounds::{CELLS, ROWS};
use proto::config::{Problem, most_similar};
use sha2::{Digest as _, Sha256};
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

/// What a field takes (bytes): in its frame, in the table of all frames, in the table that its reader checks, and in its rows.
pub(crate) const BYTES_OF_CELL: usize = 4 * size_of::<f64>();

/// A time that a row does not have.
pub(crate) const NO_TIME: i64 = i64::MIN;

/// Columns of one file, a value per row.
#[derive(Clone, Debug, Default)]
pub(crate) struct Frame {
    /// Line of each row in its file.
    pub lines: Vec<usize>,
    /// Times (ns), as the log counts them.
    pub times_ns: BTreeMap<String, Vec<i64>>,
    /// Everything else: numbers, NaN where missing; of names their occurrence.
    pub columns: Vec<(String, Vec<f64>)>,
    /// From when times count (ns), if the log states it.
    pub start_ns: Option<i64>,
    /// Times of the rows are times of day.
    pub is_of_day: bool,
}

impl Frame {
    pub(crate) fn n_rows(&self) -> usize {
        self.lines.len()
    }

    /// The values of a column.
    pub(crate) fn column(&self, name: &str) -> Option<&[f64]> {
        self.columns.iter().find(|(known, _)| known == name).map(|(_, values)| &values[..])
    }

    /// Times of the rows (ns).
    pub(crate) fn time_ns(&self) -> Option<&[i64]> {
        self.times_ns.get("time_s").map(|times| &times[..])
    }

    /// Removes a column.
    pub(crate) fn take(&mut self, name: &str) -> Option<Vec<f64>> {
        let at = self.columns.iter().position(|(known, _)| known == name)?;
        Some(self.columns.remove(at).1)
    }

    /// Keeps the rows for which `keep` has true.
    pub(crate) fn retain(&mut self, keep: &[bool]) {
        retain(&mut self.lines, keep);
        self.times_ns.values_mut().for_each(|times| retain(times, keep));
        self.columns.iter_mut().for_each(|(_, values)| retain(values, keep));
    }

    /// Puts rows in another order: row `order[k]` becomes row k.
    pub(crate) fn reorder(&mut self, order: &[usize]) {
        self.lines = order.iter().map(|&row| self.lines[row]).collect();
        for times in self.times_ns.values_mut() {
            *times = order.iter().map(|&row| times[row]).collect();
        }
        for (_, values) in &mut self.columns {
            *values = order.iter().map(|&row| values[row]).collect();
        }
    }

    /// Keeps the rows for which `problem` finds nothing, and counts the others.
    pub(crate) fn reject(
        &mut self,
        account: &mut Account<'_>,
        problem: impl Fn(&Self, usize) -> Option<String>,
    ) {
        let keep: Vec<bool> = (0..self.n_rows())
            .map(|row| match problem(self, row) {
                Some(reason) => {
                    account.reject(&reason, self.lines[row]);
                    false
                }
                None => true,
            })
            .collect();
        self.retain(&keep);
    }
}

fn retain<T>(values: &mut Vec<T>, keep: &[bool]) {
    let mut keep = keep.iter();
    values.retain(|_| keep.next().copied().unwrap_or(false));
}

/// What a column is filled from, the fields of the log being found.
enum Filling {
    Constant(f64),
    Number { field: usize, factor: f64, change: Change },
    Label(usize),
    Quaternion([usize; 4]),
    Time { field: usize, unit_ns: i128, change: Change },
    TimeParts([usize; 2]),
}

/// Finds the fields that an input's columns are filled from.
///
/// * `path`: of the input in the mapping file.
///
/// # Errors
///
/// Every field that the log lacks.
pub(crate) fn check_fields(
    input: &Input,
    path: &str,
    names: &[String],
    file: &Path,
) -> Result<(), Vec<Problem>> {
    let file = file.file_name().map_or_else(String::new, |name| name.to_string_lossy().into());
    let mut problems = Vec::new();
    for target in &input.columns {
        for field in fields(target).into_iter().filter(|field| !names.contains(field)) {
            let section = match crate::tables::known(&target.name) {
                _ if !target.is_stated => String::new(),
                Some(_) => format!(".columns.{}", target.name),
                None => format!(".covariates.{}", target.name),
            };
            let columns: Vec<&str> =
                names.iter().map(String::as_str).filter(|name| !name.is_empty()).collect();
            let mut problem = Problem::new(
                format!("{path}{section}"),
                format!(
                    "must be a column of {file}, which are {}",
                    crate::listed(columns.iter().copied())
                ),
            )
            .value(format!("{field:?}"));
            let same = columns.iter().find(|name| name.eq_ignore_ascii_case(field)).copied();
            let nearest = same.or_else(|| most_similar(field, columns));
            problem.nearest = nearest.map(|name| format!("{name:?}"));
            problems.push(problem);
        }
    }
    if problems.is_empty() { Ok(()) } else { Err(problems) }
}

fn fields(target: &Target) -> Vec<&String> {
    match &target.source {
        Source::Constant(_) => Vec::new(),
        Source::Column { name, .. } => vec![name],
        Source::TimeParts(names) => names.iter().collect(),
        Source::Quaternion(names) => names.iter().collect(),
    }
}

/// Reads the rows of a file.
///
/// # Errors
///
/// The file cannot be read, has more rows than are read, or needs more memory than there is.
pub(crate) fn read(
    input: &Input,
    rows: &mut dyn Rows,
    reading: Fields,
    labels: &mut Labels,
    account: &mut Account<'_>,
    memory: &mut Memory,
) -> Result<Frame, ConvertError> {
    let fillings = fillings(input, rows.names(), account.file)?;
    let mut frame = Frame { start_ns: rows.start_ns(), ..Frame::default() };
    let mut numbers: Vec<Vec<f64>> = vec![Vec::new(); fillings.len()];
    let mut times: Vec<Vec<i64>> = vec![Vec::new(); fillings.len()];
    let mut row = Row::default();
    let mut cells: Vec<Cell> = Vec::with_capacity(fillings.len());
    let mut clocks = vec![DayClock::default(); fillings.len()];
    let mut seen: BTreeSet<[u8; 32]> = BTreeSet::new();
    while rows.next(&mut row)? {
        account.n_read += 1;
        let refused = |refusal: String| {
            crate::formats::refused(account.file, format!("line {}: {refusal}", row.line))
        };
        ROWS.check(account.n_read as u64).map_err(refused)?;
        CELLS.check((account.n_read * fillings.len().max(1)) as u64).map_err(refused)?;
        let labels_before = labels.n_bytes();
        let mut problem = row.problem.take();
        if problem.is_none() && reading.is_without_repeats {
            memory.take(BYTES_OF_SEEN, "rows that were read").map_err(refused)?;
            problem = (!seen.insert(digest(&row.fields))).then(|| REPEATED.to_owned());
        }
        let problem = problem.or_else(|| {
            cells.clear();
            let mut columns = input.columns.iter().zip(&fillings).zip(&mut clocks);
            columns.find_map(|((target, filling), clock)| {
                let cell = filling.cell(target, &row.fields, labels, reading, clock);
                cell.map(|cell| cells.push(cell)).err()
            })
        });
        memory.take(labels.n_bytes() - labels_before, "names").map_err(refused)?;
        if let Some(reason) = problem {
            account.reject(&reason, row.line);
            continue;
        }
        let what = format_args!("{} rows of {} columns", frame.lines.len() + 1, cells.len());
        memory.take((BYTES_OF_CELL * (cells.len() + 1)) as u64, what).map_err(refused)?;
        frame.lines.push(row.line);
        for (at, cell) in cells.iter().enumerate() {
            match *cell {
                Cell::Number(number) => numbers[at].push(number),
                Cell::Time(time_ns) => times[at].push(time_ns),
            }
        }
    }
    let mut of_rows = input.columns.iter().zip(&clocks);
    frame.is_of_day = of_rows.any(|(target, clock)| target.name == "time_s" && clock.is_used);
    for ((target, numbers), times) in input.columns.iter().zip(numbers).zip(times) {
        if target.content == Content::Time {
            frame.times_ns.insert(target.name.clone(), times);
        } else {
            frame.columns.push((target.name.clone(), numbers));
        }
    }
    Ok(frame)
}

/// Why a row is rejected that the file has twice.
const REPEATED: &str = "it repeats an earlier row of the file in every field";
/// What is kept of a row to recognise its repetition (bytes).
const BYTES_OF_SEEN: u64 = 64;

/// The SHA-256 of the fields of a row.
fn digest(fields: &StringRecord) -> [u8; 32] {
    let mut hash = Sha256::new();
    for field in fields {
        hash.update((field.len() as u64).to_le_bytes());
        hash.update(field.as_bytes());
    }
    hash.finalize().into()
}

fn fillings(input: &Input, names: &[String], file: &Path) -> Result<Vec<Filling>, ConvertError> {
    let mut fillings = Vec::with_capacity(input.columns.len());
    for target in &input.columns {
        let find = |name: &String| {
            names.iter().position(|known| known == name).ok_or_else(|| {
                crate::formats::refused(
                    file,
                    format!("lacks the column {name}, from which {} is filled", target.name),
                )
            })
        };
        fillings.push(match &target.source {
            Source::Constant(number) => Filling::Constant(*number),
            Source::TimeParts([first, second]) => Filling::TimeParts([find(first)?, find(second)?]),
            Source::Quaternion([x, y, z, w]) => {
                Filling::Quaternion([find(x)?, find(y)?, find(z)?, find(w)?])
            }
            Source::Column { name, unit, change } => match target.content {
                Content::Label => Filling::Label(find(name)?),
                Content::Time => {
                    let unit_ns = unit.and_then(|unit| unit.nanoseconds()).unwrap_or(NS_PER_S);
                    Filling::Time { field: find(name)?, unit_ns, change: *change }
                }
                Content::Number | Content::Heading => Filling::Number {
                    field: find(name)?,
                    factor: unit.map_or(1.0, |unit| unit.factor(&target.name)),
                    change: *change,
                },
            },
        });
    }
    Ok(fillings)
}

/// A value of a row.
#[derive(Clone, Copy)]
enum Cell {
    Number(f64),
    Time(i64),
}

impl Filling {
    /// The value of a row, or why the row cannot be used.
    fn cell(
        &self,
        target: &Target,
        fields: &StringRecord,
        labels: &mut Labels,
        reading: Fields,
        clock: &mut DayClock,
    ) -> Result<Cell, String> {
        let field = |at: usize| fields.get(at).unwrap_or_default().trim();
        let name = &target.name;
        let is_missing = || format!("{name} is missing");
        match *self {
            Self::Constant(number) if target.content == Content::Label => {
                Ok(Cell::Number(f64::from(labels.occurrence(&number.to_string()))))
            }
            Self::Constant(number) if target.content == Content::Time => {
                let ns = number * 1e9;
                let is_time = ns.abs() < 9e18;
                is_time
                    .then_some(Cell::Time(ns as i64))
                    .ok_or_else(|| format!("{name} is too large"))
            }
            Self::Constant(number) => Ok(Cell::Number(number)),
            Self::Label(at) if is_empty(field(at)) => {
                // A route may be shorter than its columns; a row without its sender is useless.
                if crate::tables::known(name).is_some() {
                    Err(is_missing())
                } else {
                    Ok(Cell::Number(f64::NAN))
                }
            }
            Self::Label(at) => Ok(Cell::Number(f64::from(labels.occurrence(field(at))))),
            Self::Number { field: at, factor, change } => {
                Ok(Cell::Number(change.apply(number(name, field(at), factor)?)))
            }
            Self::Quaternion(at) => {
                let mut parts = [0.0; 4];
                for (part, at) in parts.iter_mut().zip(at) {
                    *part = number(name, field(at), 1.0)?;
                }
                heading(parts).map(Cell::Number).ok_or_else(|| {
                    format!(
                        "the quaternion of {name} does not have the length 1, or faces up or down"
                    )
                })
            }
            Self::Time { field: at, .. } if is_empty(field(at)) => {
                if name == "time_s" {
                    Err(is_missing())
                } else {
                    Ok(Cell::Time(NO_TIME))
                }
            }
            Self::Time { field: at, unit_ns, change } => {
                // A time that is only another unit keeps all its digits.
                if change == Change::NONE {
                    return reading.time(name, field(at), unit_ns, clock).map(Cell::Time);
                }
                let Change { scale, offset, .. } = change;
                let ns = number(name, field(at), scale * unit_ns as f64)? + offset * 1e9;
                let time_ns = (ns.abs() < 9e18).then_some(ns as i64);
                time_ns.map(Cell::Time).ok_or_else(|| format!("{name} is not a number"))
            }
            Self::TimeParts([first, second]) => {
                let (first, second) = (field(first), field(second));
                if let Some(s) = time::parse(first, NS_PER_S).filter(|_| !is_date(first)) {
                    let parts = time::parse(second, 1).and_then(|ns| s.checked_add(ns));
                    return parts.map(Cell::Time).ok_or_else(|| {
                        format!("{name} is not two numbers, seconds and nanoseconds")
                    });
                }
                let text = format!("{first} {second}");
                reading.time(name, &text, NS_PER_S, clock).map(Cell::Time)
            }
        }
    }
}

/// How the fields of a log are read.
#[derive(Clone, Copy)]
pub(crate) struct Fields {
    /// How dates are written.
    pub dates: Dates,
    /// Rows that repeat an earlier one in every field are rejected.
    pub is_without_repeats: bool,
}

impl Fields {
    fn time(
        self,
        name: &str,
        text: &str,
        unit_ns: i128,
        clock: &mut DayClock,
    ) -> Result<i64, String> {
        match time::read(text, unit_ns, self.dates) {
            Ok(Time::OfDay(time_ns)) => {
                clock.is_used = true;
                Ok(clock.elapsed_ns(time_ns))
            }
            Ok(time) => Ok(time.ns()),
            Err(NoTime::Unknown) => Err(format!("{name} is not a number or a date")),
            Err(NoTime::Ambiguous) => Err(format!(
                "{name} is a date in which day and month may be either way round; state date_order in the mapping"
            )),
        }
    }
}

/// Whether a text is a date, as a column beside one of times of day holds it. Eight digits are one.
fn is_date(text: &str) -> bool {
    let is_compact = text.len() == 8 && text.bytes().all(|byte| byte.is_ascii_digit());
    is_compact
        && matches!(time::read(&format!("{text}T000000"), 1, Dates::default()), Ok(Time::Date(_)))
        || matches!(
            time::read(text, 1, Dates::default()),
            Ok(Time::Date(_)) | Err(NoTime::Ambiguous)
        )
}

fn is_empty(field: &str) -> bool {
    const EMPTY: [&str; 6] = ["nan", "null", "none", "na", "n/a", "-"];
    field.is_empty() || EMPTY.iter().any(|word| field.eq_ignore_ascii_case(word))
}

/// A number in the unit of the table, NaN where the field is empty.
///
/// * `factor`: what one unit of a number is that has no unit of its own.
fn number(name: &str, field: &str, factor: f64) -> Result<f64, String> {
    if is_empty(field) {
        return Ok(f64::NAN);
    }
    if field.eq_ignore_ascii_case("true") {
        return Ok(1.0);
    }
    if field.eq_ignore_ascii_case("false") {
        return Ok(0.0);
    }
    if let Ok(number) = field.parse::<f64>()
        && number.is_finite()
    {
        return Ok(number * factor);
    }
    let with_unit = Unit::of_value(field).filter(|(_, unit)| unit.fits(name));
    with_unit
        .map(|(number, unit)| number * unit.factor(name))
        .ok_or_else(|| format!("{name} is not a number"))
}

/// The heading (rad) of a body: the angle from +x to where its x axis points, seen from above. NaN where a part is missing.
///
/// * `[x, y, z, w]`: the rotation from the body to the world, as ROS writes it (REP 103).
fn heading([x, y, z, w]: [f64; 4]) -> Option<f64> {
    let norm = x * x + y * y + z * z + w * w;
    if norm.is_nan() {
        return Some(f64::NAN);
    }
    let (sin, cos) = (2.0 * (w * z + x * y), w * w + x * x - y * y - z * z);
    let is_level = 1e-6 < sin * sin + cos * cos;
    ((0.8..=1.25).contains(&norm) && is_level).then(|| libm::atan2(sin, cos))
}

/// Replaces latitude and longitude by metres in the plane, whose origin is the first fix if none is stated.
pub(crate) fn project(
    frame: &mut Frame,
    plane: &mut Option<TangentPlane>,
    account: &mut Account<'_>,
) {
    frame.reject(account, |frame, row| {
        let (lat, lon) = (frame.column("latitude_deg")?[row], frame.column("longitude_deg")?[row]);
        if lat == 0.0 && lon == 0.0 {
            return Some("latitude and longitude are 0: there was no fix".to_owned());
        }
        let is_outside = 90.0 < lat.abs() || 180.0 < lon.abs();
        is_outside
            .then(|| "latitude is not from -90 to 90, or longitude not from -180 to 180".to_owned())
    });
    let Some((latitude, longitude)) = frame.take("latitude_deg").zip(frame.take("longitude_deg"))
    else {
        return;
    };
    let fixes = latitude.into_iter().zip(longitude);
    let (mut x_m, mut y_m) = (Vec::new(), Vec::new());
    for (lat, lon) in fixes {
        let fix = [lat, lon];
        let is_known = lat.is_finite() && lon.is_finite();
        let [x, y] = if is_known {
            plane.get_or_insert_with(|| TangentPlane::at(fix)).east_north_m(fix)
        } else {
            [f64::NAN; 2]
        };
        x_m.push(x);
        y_m.push(y);
    }
    frame.columns.extend([("x_m".to_owned(), x_m), ("y_m".to_owned(), y_m)]);
    frame.reject(account, |frame, row| {
        let (x, y) = (frame.column("x_m")?[row], frame.column("y_m")?[row]);
        (FARTHEST_M < libm::hypot(x, y))
            .then(|| format!("the fix is more than {} km from the origin", FARTHEST_M / 1000.0))
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_quaternion_becomes_a_heading() {
        let close = |found: Option<f64>, expected: f64| (found.unwrap() - expected).abs() < 1e-12;
        let half = std::f64::consts::FRAC_1_SQRT_2;
        assert!(close(heading([0.0, 0.0, 0.0, 1.0]), 0.0));
        assert!(close(heading([0.0, 0.0, half, half]), std::f64::consts::FRAC_PI_2));
        assert!(close(heading([0.0, 0.0, -half, half]), -std::f64::consts::FRAC_PI_2));
        // Rolled by a quarter, facing east.
        assert!(close(heading([half, 0.0, 0.0, half]), 0.0));
        // Facing up.
        assert_eq!(heading([0.0, -half, 0.0, half]), None);
        assert_eq!(heading([0.0; 4]), None);
        assert!(heading([0.0, 0.0, f64::NAN, 1.0]).unwrap().is_nan());
    }

    #[test]
    fn words_for_nothing_are_missing_and_other_words_are_no_numbers() {
        assert!(
            number("x_m", "NaN", 1.0).unwrap().is_nan() && number("x_m", "", 1.0).unwrap().is_nan()
        );
        assert_eq!(number("received", "True", 1.0), Ok(1.0));
        assert_eq!(number("x_m", "120 cm", 1.0), Ok(1.2));
        assert_eq!(number("rssi_dbm", "-70dBm", -1.0), Ok(-70.0));
        for wrong in ["x", "inf", "1,5", "3 deg", "m"] {
            assert_eq!(number("x_m", wrong, 1.0), Err("x_m is not a number".to_owned()));
        }
    }
}
