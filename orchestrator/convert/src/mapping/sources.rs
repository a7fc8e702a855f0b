//! What the columns of a table are filled from, as a mapping states it.

use super::{MOST_NUMBER, Target};
use crate::tables::{self, Content, Sign, SourceKey, SourceKeys};
use crate::units::{self, Unit};
use measure::links::LOSSES_LOGGED;
use proto::config::{Lists, Node, Problem, Section as _, Value, check, most_similar};

/// What a column is filled from.
#[derive(Clone, Debug)]
pub enum Source {
    /// The same number in every row.
    Constant(f64),
    /// A column of the log.
    Column {
        /// Its name.
        name: String,
        /// Its unit; `None`: that of the table.
        unit: Option<&'static Unit>,
        /// How its values become those of the table.
        change: Change,
    },
    /// Columns of whole seconds and of nanoseconds, or of a date and of the time of day.
    TimeParts([String; 2]),
    /// Columns of a unit quaternion: x, y, z, w.
    Quaternion([String; 4]),
}

/// How values of a log become those of the table, after their unit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Change {
    /// The value is multiplied by this,
    pub scale: f64,
    /// and this is added.
    pub offset: f64,
    /// The sign of the result.
    pub sign: Sign,
    /// The least and the greatest result; others are missing.
    pub within: Option<[f64; 2]>,
}

impl Change {
    /// Values stay as they are.
    pub const NONE: Self = Self { scale: 1.0, offset: 0.0, sign: Sign::AsWritten, within: None };

    /// The value of the table, NaN where it is missing.
    #[must_use]
    pub fn apply(&self, value: f64) -> f64 {
        let value = value * self.scale + self.offset;
        let value = if self.sign == Sign::Negative { -value.abs() } else { value };
        let is_outside =
            self.within.is_some_and(|[least, greatest]| !(least..=greatest).contains(&value));
        if is_outside { f64::NAN } else { value }
    }
}

/// What a column is filled from, if that is possible.
pub(super) fn target(
    name: &str,
    content: Content,
    key: SourceKey,
    path: &str,
    problems: &mut Vec<Problem>,
) -> Option<Target> {
    let source = match key {
        SourceKey::Constant(number) => Source::Constant(number),
        SourceKey::Column(column) => {
            let unit = Unit::of_column(&column).filter(|unit| unit.fits(name));
            Source::Column { name: column, unit, change: Change::NONE }
        }
        SourceKey::Columns(list) => {
            let written = toml::Value::from(list.clone());
            let (expected, source) = match content {
                Content::Time => (
                    "must be the name of a column, or a list of two: [seconds, nanoseconds] or [date, time of day]",
                    <[String; 2]>::try_from(list).map(Source::TimeParts).ok(),
                ),
                Content::Heading => (
                    "must be the name of a column, or a list of four, a quaternion: [x, y, z, w]",
                    <[String; 4]>::try_from(list).map(Source::Quaternion).ok(),
                ),
                _ => ("must be the name of a column, a number or a table, not a list", None),
            };
            if source.is_none() {
                problems.push(Problem::new(path, expected).value(written));
            }
            source?
        }
        SourceKey::Table(keys) => {
            let unit = match &keys.unit {
                Some(unit) => {
                    let found = Unit::named(unit).filter(|unit| unit.fits(name));
                    if found.is_none() {
                        let message = format!("must be one of {}", units::allowed(name));
                        let mut problem = Problem::new(format!("{path}.unit"), message)
                            .value(format!("{unit:?}"));
                        problem.nearest =
                            most_similar(unit, units::allowed(name).split(", ")).map(str::to_owned);
                        problems.push(problem);
                    }
                    found
                }
                None => Unit::of_column(&keys.column).filter(|unit| unit.fits(name)),
            };
            let change = Change {
                scale: keys.scale,
                offset: keys.offset,
                sign: keys.sign,
                within: keys.within,
            };
            if content == Content::Label && change != Change::NONE {
                let message = "is a number or name, without scale, offset, sign and within";
                problems.push(Problem::new(path, message));
            }
            if content == Content::Time
                && (change.within.is_some() || change.sign != Change::NONE.sign)
            {
                problems.push(Problem::new(path, "is a time, without sign and within"));
            }
            if let Some([least, greatest]) =
                change.within.filter(|[least, greatest]| greatest < least)
            {
                let message = "must be the least and the greatest value, in this order";
                let value = format!("[{least}, {greatest}]");
                problems.push(Problem::new(format!("{path}.within"), message).value(value));
            }
            Source::Column { name: keys.column, unit, change }
        }
    };
    if let Source::Constant(number) = source
        && content == Content::Label
        && !(number.fract() == 0.0 && (0.0..=MOST_NUMBER as f64).contains(&number))
    {
        let message = format!("must be a whole number from 0 to {MOST_NUMBER}");
        problems.push(Problem::new(path, message).value(number));
        return None;
    }
    Some(Target { name: name.to_owned(), content, source, is_stated: true })
}

pub(super) fn covariates(
    node: Option<&Node>,
    path: &str,
    columns: &mut Vec<Target>,
    problems: &mut Vec<Problem>,
) {
    let Some(node) = node else { return };
    let Value::Table(entries) = &node.value else {
        let message = "must be a table of columns by name, such as { temperature_c = \"Temp\" }";
        problems.push(Problem::new(path, message).value(node.show()));
        return;
    };
    for (name, _, node) in entries {
        let path = format!("{path}.{name}");
        let is_plain = name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_')
            && name.starts_with(|c: char| c.is_ascii_alphabetic());
        if !is_plain {
            let message = "must be a name of letters, digits and _ that begins with a letter";
            problems.push(Problem::new(path, message).value(format!("{name:?}")));
            continue;
        }
        if tables::known(name).is_some() {
            problems.push(Problem::new(path, "is no covariate; move it to columns"));
            continue;
        }
        if name == LOSSES_LOGGED {
            let message = "is no covariate; write losses = \"logged\" or \"not-logged\" at the top";
            problems.push(Problem::new(path, message));
            continue;
        }
        let key = match &node.value {
            Value::Table(_) => {
                let checked = check(node, &path, &SourceKeys::SPEC, &Lists::NONE, problems);
                SourceKey::Table(SourceKeys::read(&checked.table))
            }
            Value::Integer(number) => SourceKey::Constant(*number as f64),
            Value::Number(number) => SourceKey::Constant(*number),
            Value::Text(column) => SourceKey::Column(column.clone()),
            _ => {
                let message =
                    "must be the name of a column, a number, or a table with column and unit";
                problems.push(Problem::new(path, message).value(node.show()));
                continue;
            }
        };
        columns.extend(target(name, Content::Number, key, &path, problems));
    }
}
