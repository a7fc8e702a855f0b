//! Which column has the times of the rows, in which unit.

use super::profile::{Profile, Sample};
use super::words::TIME;
use super::{Asked, DraftInput, Log};
use crate::units::Unit;

/// What a table is of, for which a likely time is known.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Rate {
    /// Robots are sampled several times a second.
    Robots,
    /// Frames may be any time apart.
    Any,
}

/// A column of times, or two of them.
pub(super) struct Times {
    /// The numbers of the columns.
    pub columns: Vec<usize>,
    /// The source, as TOML.
    source: String,
    reason: String,
    /// The order of day and month.
    order: Option<String>,
}

/// Fills `column` from a column of times, if there is one. Asks for what the log leaves open.
///
/// * `fits`: whether a column may be it.
pub(super) fn fill(
    log: &Log,
    input: &mut DraftInput,
    column: &str,
    rate: Rate,
    asked: &mut Asked<'_>,
    fits: impl Fn(&Profile) -> bool,
) -> Option<Vec<usize>> {
    let times = find(log, rate, asked, fits)?;
    if input.covers_format(log, column) {
        return Some(times.columns);
    }
    let order = times.order.map(|order| ("date_order".to_owned(), quoted(&order)));
    input.top.extend(order.filter(|order| !input.top.contains(order)));
    input.add(column, times.source, times.reason);
    Some(times.columns)
}

impl DraftInput {
    /// Whether the format of a log fills a column by itself.
    fn covers_format(&self, log: &Log, column: &str) -> bool {
        let format =
            crate::formats::BUILT_IN.iter().find(|format| format.variant.name == log.form.format);
        format.is_some_and(|format| format.columns.iter().any(|(known, _)| *known == column))
    }
}

fn find(
    log: &Log,
    rate: Rate,
    asked: &mut Asked<'_>,
    fits: impl Fn(&Profile) -> bool,
) -> Option<Times> {
    if let Some(times) = seconds_and_nanoseconds(log, &fits) {
        return Some(times);
    }
    let score = |profile: &Profile| {
        if !fits(profile) {
            return 0;
        }
        let is_named = profile.has(TIME);
        let rises = 0.7 <= profile.rising && 2 < profile.n_distinct;
        if profile.is_date() {
            // The time of an event goes before that of its record.
            return 6 + 2 * i32::from(is_named) + i32::from(0.9 <= profile.rising);
        }
        if profile.is_clock() {
            return 4 + 2 * i32::from(is_named);
        }
        if !profile.is_numeric() || !rises {
            return 0;
        }
        let is_epoch = epoch_unit(profile.range[1]).is_some();
        match (is_named, is_epoch) {
            (true, true) => 9,
            (true, false) => 5 + i32::from(profile.has(&["time", "timestamp"])),
            (false, true) => 3,
            (false, false) => 0,
        }
    };
    let at = log.best(score)?;
    let profile = log.profile(at);
    if profile.is_date() && is_without_clock(&log.sample, at) {
        // A date whose time of day has a column of its own.
        let clock =
            log.best(|other| if other.is_clock() { 1 + i32::from(other.has(TIME)) } else { 0 });
        if let Some(clock) = clock {
            let order = order(profile, asked);
            let names = [&profile.name, &log.profile(clock).name];
            let source = format!("[{}, {}]", quoted(names[0]), quoted(names[1]));
            let reason = format!(
                "a date and a time of day, such as {} {}",
                profile.example,
                log.profile(clock).example
            );
            return Some(Times { columns: vec![at, clock], source, reason, order });
        }
    }
    if profile.is_date() {
        let order = order(profile, asked);
        let reason = format!("dates such as {}{}", profile.example, zone(&profile.example));
        return Some(Times { columns: vec![at], source: quoted(&profile.name), reason, order });
    }
    if profile.is_clock() {
        let reason = format!("times of day such as {}; they go on after midnight", profile.example);
        return Some(Times {
            columns: vec![at],
            source: quoted(&profile.name),
            reason,
            order: None,
        });
    }
    let (unit, reason) = unit_of(log, at, rate, asked);
    let source = match unit {
        unit if Unit::of_column(&profile.name).map_or("s", |unit| unit.name) == unit => {
            quoted(&profile.name)
        }
        unit => format!("{{ column = {}, unit = \"{unit}\" }}", quoted(&profile.name)),
    };
    Some(Times { columns: vec![at], source, reason, order: None })
}

/// Columns such as `secs` and `nsecs` of a stamp.
fn seconds_and_nanoseconds(log: &Log, fits: &impl Fn(&Profile) -> bool) -> Option<Times> {
    let is_part = |profile: &Profile, words: &[&str]| {
        fits(profile) && profile.is_numeric() && profile.is_whole && profile.has(words)
    };
    let seconds = log.best(|profile| {
        i32::from(is_part(profile, &["s", "sec", "secs", "seconds"]) && 0.9 <= profile.rising)
    })?;
    let nanoseconds = log.best(|profile| {
        i32::from(
            is_part(profile, &["ns", "nsec", "nsecs", "nanosec", "nanoseconds"])
                && profile.range[2] < 1e9,
        )
    })?;
    let names = [&log.profile(seconds).name, &log.profile(nanoseconds).name];
    Some(Times {
        columns: vec![seconds, nanoseconds],
        source: format!("[{}, {}]", quoted(names[0]), quoted(names[1])),
        reason: "whole seconds and nanoseconds".to_owned(),
        order: None,
    })
}

/// Whether dates have no time of day: many rows are of one day.
fn is_without_clock(sample: &Sample, column: usize) -> bool {
    (0..sample.rows.len().min(100)).all(|row| !sample.field(row, column).contains(':'))
}

/// The order of day and month, if dates need one: as they show it, or as the answer says.
fn order(profile: &Profile, asked: &mut Asked<'_>) -> Option<String> {
    if profile.n_ambiguous == 0 || profile.example.contains('.') {
        return None;
    }
    // 13 or more can only be a day.
    let has_days = |place: usize| {
        profile.frequent.iter().map(|(text, _)| text).chain([&profile.example]).any(|text| {
            let part = text.split(['/', '-', ' ']).nth(place);
            part.and_then(|part| part.parse::<u32>().ok()).is_some_and(|number| 12 < number)
        })
    };
    if has_days(0) != has_days(1) {
        return Some(if has_days(0) { "day-first" } else { "month-first" }.to_owned());
    }
    let text = format!("Is {} written with the day or with the month first?", profile.example);
    let choices = [("day-first", "31/12"), ("month-first", "12/31")];
    Some(asked.ask("date-order", text, &choices, 0))
}

fn zone(example: &str) -> &'static str {
    let has_zone =
        example.ends_with(['Z', 'z']) || example.contains("UTC") || example.contains("GMT");
    let has_offset = example.rfind(['+', '-']).is_some_and(|at| 10 < at);
    if has_zone || has_offset { "" } else { "; taken as UTC, see utc_offset_h" }
}

/// The unit in which a number is an epoch time of our days.
fn epoch_unit(value: f64) -> Option<&'static str> {
    // From 1995 to 2095.
    const S: std::ops::Range<f64> = 0.8e9..4.0e9;
    [("s", 1.0), ("ms", 1e3), ("us", 1e6), ("ns", 1e9)]
        .into_iter()
        .find(|(_, factor)| S.contains(&(value / factor)))
        .map(|(unit, _)| unit)
}

fn unit_of(log: &Log, at: usize, rate: Rate, asked: &mut Asked<'_>) -> (&'static str, String) {
    let profile = log.profile(at);
    if let Some(unit) = epoch_unit(profile.range[1]) {
        let words = match unit {
            "ms" => "milliseconds",
            "us" => "microseconds",
            "ns" => "nanoseconds",
            _ => "seconds",
        };
        return (unit, format!("{words} since 1970, by their size"));
    }
    let named = Unit::of_column(&profile.name).filter(|unit| unit.nanoseconds().is_some());
    if let Some(unit) = named {
        return (unit.name, format!("the name says {}", unit.name));
    }
    let step = median_step(&log.sample.numbers(at));
    if !profile.is_whole || step == 0.0 {
        return ("s", "seconds: the numbers have fractions".to_owned());
    }
    let likely = match rate {
        Rate::Robots if 1e5 <= step => 2,
        Rate::Robots if 2.0 <= step => 1,
        Rate::Any if 1e5 <= step => 2,
        Rate::Any if 100.0 <= step => 1,
        _ => 0,
    };
    // Whole seconds are what a clock without fractions counts.
    if likely == 0 && step <= 60.0 && rate == Rate::Any {
        return ("s", format!("seconds: rows are {step} apart in the median"));
    }
    let text = format!("In which unit is {}, which grows by {step} from row to row?", profile.name);
    let choices =
        [("s", "seconds"), ("ms", "milliseconds"), ("us", "microseconds"), ("ns", "nanoseconds")];
    let word = asked.ask("time-unit", text, &choices, likely);
    let unit = Unit::named(&word).map_or("s", |unit| unit.name);
    (unit, format!("rows are {step} apart in the median"))
}

fn median_step(values: &[f64]) -> f64 {
    let known: Vec<f64> = values.iter().copied().filter(|value| value.is_finite()).collect();
    let mut steps: Vec<f64> =
        known.windows(2).map(|pair| pair[1] - pair[0]).filter(|step| 0.0 < *step).collect();
    steps.sort_by(f64::total_cmp);
    steps.get(steps.len() / 2).copied().unwrap_or(0.0)
}

/// A text as TOML writes it.
pub(super) fn quoted(text: &str) -> String {
    toml::Value::from(text).to_string()
}
