//! Times as logs write them, as whole nanoseconds: epoch times in double precision would be rounded to a quarter of a microsecond.
//!
//! | what | forms |
//! |---|---|
//! | numbers | seconds, or the unit that the column has; digits after the point count exactly |
//! | dates | `2018-01-11`, `2018/01/11`, `11.01.2018`, `11 Jan 2018`, `Jan 11, 2018`, `20180111`, and with an order `11/01/2018` |
//! | times of day | `16:32`, `16:32:22.5`, `16:32:22,5`, `4:32:22 PM`, after a date also `163222` |
//! | offsets from UTC | `Z`, `UTC`, `GMT`, `+02:00`, `-0530`, `+02` (ISO 8601); without one, the offset that the mapping states |

use chrono::NaiveDate;
use proto::config::Choice;

/// Nanoseconds of a second.
pub const NS_PER_S: i128 = 1_000_000_000;
const S_PER_DAY: i128 = 86_400;

/// How dates are written.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Dates {
    /// Order of day and month in dates such as `11/01/2018`; `None`: they are refused where both orders are possible.
    pub order: Option<DateOrder>,
    /// Offset from UTC (s) of dates that state none.
    pub offset_s: i64,
}

/// Order of day and month in dates of numbers whose year stands last.
#[derive(Choice, Clone, Copy, Debug, PartialEq, Eq)]
pub enum DateOrder {
    /// 31/12/2018.
    DayFirst,
    /// 12/31/2018.
    MonthFirst,
}

/// A time (ns), by what it counts from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Time {
    /// A number: since whatever the log counts from.
    Counted(i64),
    /// A date: since 1970 (UTC).
    Date(i64),
    /// A time of day: since midnight.
    OfDay(i64),
}

impl Time {
    /// The time (ns).
    #[must_use]
    pub fn ns(self) -> i64 {
        match self {
            Self::Counted(ns) | Self::Date(ns) | Self::OfDay(ns) => ns,
        }
    }
}

/// Why a text is no time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NoTime {
    /// It has none of the forms.
    Unknown,
    /// Day and month may be either way round.
    Ambiguous,
}

/// Reads a time.
///
/// * `unit_ns`: what one unit of a plain number is (ns).
///
/// # Errors
///
/// It has none of the forms, or its date may be read in two ways.
pub fn read(text: &str, unit_ns: i128, dates: Dates) -> Result<Time, NoTime> {
    let text = text.trim().trim_matches(['[', ']', '"', '\'']).trim();
    let whole = |ns: i128| i64::try_from(ns).map_err(|_| NoTime::Unknown);
    if let Some(ns) = number(text, unit_ns) {
        return whole(ns).map(Time::Counted);
    }
    let (date, clock, tail) = split(text);
    let (half_day, tail) = half_day(tail);
    let (offset_s, tail) = offset_s(tail).ok_or(NoTime::Unknown)?;
    let time_ns = match clock {
        Some(clock) => Some(time_of_day(clock, half_day).ok_or(NoTime::Unknown)?),
        None if half_day.is_none() && offset_s.is_none() => None,
        None => return Err(NoTime::Unknown),
    };
    // As the C library's ctime writes it, the year stands behind the time.
    let date = if tail.is_empty() { date.to_owned() } else { format!("{date} {tail}") };
    match (date.trim(), time_ns) {
        ("", Some(time_ns)) => whole(time_ns).map(Time::OfDay),
        ("", None) => Err(NoTime::Unknown),
        (date, time_ns) => {
            let days = i128::from(day(date, dates.order)?.to_epoch_days());
            let time_ns = time_ns.unwrap_or(0);
            if 86_401 * NS_PER_S <= time_ns {
                return Err(NoTime::Unknown);
            }
            let offset_s = offset_s.unwrap_or_else(|| dates.offset_s.into());
            whole((days * S_PER_DAY - offset_s) * NS_PER_S + time_ns).map(Time::Date)
        }
    }
}

/// A time (ns) in any form; see [`read`].
#[must_use]
pub fn parse(text: &str, unit_ns: i128) -> Option<i64> {
    read(text, unit_ns, Dates::default()).ok().map(Time::ns)
}

/// Times of day, one after the other, which go on after midnight.
#[derive(Clone, Copy, Debug, Default)]
pub struct DayClock {
    last_ns: Option<i64>,
    days: i64,
    /// Whether there was a time of day.
    pub is_used: bool,
}

impl DayClock {
    /// The time since the midnight before the first time (ns). A step of more than half a day passes midnight.
    pub fn elapsed_ns(&mut self, time_ns: i64) -> i64 {
        const DAY_NS: i64 = 86_400_000_000_000;
        let step_ns = self.last_ns.map_or(0, |last_ns| time_ns.saturating_sub(last_ns));
        // Hours that count on past 24 are no times of day.
        if step_ns < -DAY_NS / 2 && time_ns < DAY_NS {
            self.days += 1;
        } else if DAY_NS / 2 < step_ns && time_ns < DAY_NS && 0 < self.days {
            self.days -= 1;
        }
        self.last_ns = Some(time_ns);
        time_ns.saturating_add(self.days * DAY_NS)
    }
}

/// A plain number; digits after the point count exactly, as far as nanoseconds go.
fn number(text: &str, unit_ns: i128) -> Option<i128> {
    let (sign, digits) = match text.strip_prefix('-') {
        Some(digits) => (-1, digits),
        None => (1, text),
    };
    let (whole, fraction) = digits.split_once('.').unwrap_or((digits, ""));
    if !whole.is_empty()
        && whole.len() <= 20
        && fraction.len() <= 18
        && is_plain(whole)
        && is_plain(fraction)
    {
        let scale = 10i128.pow(fraction.len() as u32);
        let parts: i128 = if fraction.is_empty() { 0 } else { fraction.parse().ok()? };
        let whole: i128 = whole.parse().ok()?;
        let ns = whole.checked_mul(unit_ns)?.checked_add((parts * unit_ns + scale / 2) / scale)?;
        return Some(sign * ns);
    }
    let value = text.parse::<f64>().ok().filter(|value| value.is_finite())?;
    let ns = (value * unit_ns as f64).round();
    (ns.abs() < 9e18).then_some(ns as i128)
}

fn is_plain(digits: &str) -> bool {
    digits.bytes().all(|byte| byte.is_ascii_digit())
}

/// A text as its date, its time of day, and what follows.
fn split(text: &str) -> (&str, Option<&str>, &str) {
    const BETWEEN: [char; 5] = ['T', 't', ' ', '_', ','];
    let is_of_clock = |c: char| c.is_ascii_digit() || [':', '.', ','].contains(&c);
    if let Some(colon) = text.find(':') {
        let before = &text[..colon];
        let hours = before.len() - before.trim_end_matches(|c: char| c.is_ascii_digit()).len();
        let start = colon - hours;
        let length = text[start..].find(|c| !is_of_clock(c)).unwrap_or(text.len() - start);
        let (clock, tail) = text[start..].split_at(length);
        return (text[..start].trim_end_matches(BETWEEN), Some(clock), tail.trim());
    }
    // Hours, minutes and seconds without colons, behind a date.
    if let Some(at) = text.find(['T', 't', ' ', '_']) {
        let (date, rest) = (&text[..at], &text[at + 1..]);
        let length = rest.find(|c| !is_of_clock(c)).unwrap_or(rest.len());
        let (clock, tail) = rest.split_at(length);
        let digits = clock.split(['.', ',']).next().unwrap_or_default();
        if digits.len() == 6 && is_plain(digits) && date.starts_with(|c: char| c.is_ascii_digit()) {
            return (date, Some(clock), tail.trim());
        }
    }
    (text, None, "")
}

/// Whether a time is of the second half of the day, if that is stated, and what follows.
fn half_day(tail: &str) -> (Option<bool>, &str) {
    for (word, is_after_noon) in [("am", false), ("pm", true)] {
        if tail.get(..2).is_some_and(|begin| begin.eq_ignore_ascii_case(word)) {
            return (Some(is_after_noon), tail[2..].trim_start());
        }
    }
    (None, tail)
}

/// The offset from UTC (s) at the beginning of a text, if it states one, and what follows. `None`: it begins like one and is none.
fn offset_s(tail: &str) -> Option<(Option<i128>, &str)> {
    for word in ["UTC", "GMT", "Z"] {
        if tail.get(..word.len()).is_some_and(|begin| begin.eq_ignore_ascii_case(word)) {
            return Some((Some(0), tail[word.len()..].trim_start()));
        }
    }
    let sign = match tail.bytes().next() {
        Some(b'+') => 1,
        Some(b'-') => -1,
        _ => return Some((None, tail)),
    };
    let end = tail.find(' ').unwrap_or(tail.len());
    let offset = tail[1..end].replace(':', "");
    let (hours, minutes) = (digits(offset.get(..2)?, 2)?, offset.get(2..)?);
    let minutes = if minutes.is_empty() { 0 } else { digits(minutes, 2)? };
    Some((Some(sign * (hours * 3600 + minutes * 60)), tail[end..].trim_start()))
}

/// The months, by the first three letters of their English names.
const MONTHS: [&str; 12] =
    ["jan", "feb", "mar", "apr", "may", "jun", "jul", "aug", "sep", "oct", "nov", "dec"];
const WEEKDAYS: [&str; 7] = ["mon", "tue", "wed", "thu", "fri", "sat", "sun"];

fn day(text: &str, order: Option<DateOrder>) -> Result<NaiveDate, NoTime> {
    let begins =
        |part: &str, name: &str| part.get(..3).is_some_and(|b| b.eq_ignore_ascii_case(name));
    let mut parts: Vec<&str> =
        text.split(['-', '/', '.', ' ', ',']).filter(|part| !part.is_empty()).collect();
    parts.retain(|part| !WEEKDAYS.iter().any(|name| begins(part, name)));
    let named = |part: &str| MONTHS.iter().position(|name| begins(part, name));
    let at = parts.iter().position(|part| named(part).is_some());
    let month = at.and_then(|at| named(parts.remove(at)));
    let number = |part: &str| digits(part, 4).ok_or(NoTime::Unknown);
    // Of two digits, years are of this century.
    let year = |part: &str| match part.len() {
        2 => number(part).map(|year| 2000 + year),
        4 => number(part),
        _ => Err(NoTime::Unknown),
    };
    let [y, m, d] = match (&parts[..], month) {
        ([y, d] | [d, y], Some(month)) if y.len() == 4 && d.len() <= 2 => {
            [year(y)?, month as i128 + 1, number(d)?]
        }
        ([d, y], Some(month)) => [year(y)?, month as i128 + 1, number(d)?],
        ([one], None) if one.len() == 8 && is_plain(one) => {
            [number(&one[..4])?, number(&one[4..6])?, number(&one[6..])?]
        }
        ([y, m, d], None) if y.len() == 4 => [number(y)?, number(m)?, number(d)?],
        ([a, b, y], None) => {
            let (a, b) = (number(a)?, number(b)?);
            let is_day_first = match order {
                _ if text.contains('.') => true,
                Some(order) => order == DateOrder::DayFirst,
                None if 12 < a => true,
                None if 12 < b => false,
                None => return Err(NoTime::Ambiguous),
            };
            let (d, m) = if is_day_first { (a, b) } else { (b, a) };
            [year(y)?, m, d]
        }
        _ => return Err(NoTime::Unknown),
    };
    NaiveDate::from_ymd_opt(y as i32, m as u32, d as u32).ok_or(NoTime::Unknown)
}

/// Hours, minutes, and seconds with a fraction, as nanoseconds.
///
/// * `half_day`: whether it is after noon, if that is stated.
fn time_of_day(text: &str, half_day: Option<bool>) -> Option<i128> {
    let text = text.replace(',', ".");
    let spaced;
    let text = match text.split('.').next() {
        Some(digits) if digits.len() == 6 && is_plain(digits) => {
            spaced = format!("{}:{}:{}", &text[..2], &text[2..4], &text[4..]);
            &spaced
        }
        _ => &text,
    };
    let mut parts = text.split(':');
    let (hours, minutes) = (parts.next()?, digits(parts.next()?, 2)?);
    let seconds = parts.next().unwrap_or("0");
    let mut hours: i128 =
        Some(hours).filter(|h| (1..=6).contains(&h.len()))?.parse::<u32>().ok()?.into();
    if let Some(is_after_noon) = half_day {
        if !(1..=12).contains(&hours) {
            return None;
        }
        hours = hours % 12 + if is_after_noon { 12 } else { 0 };
    }
    let is_number = seconds.starts_with(|c: char| c.is_ascii_digit());
    let seconds_ns = number(seconds, NS_PER_S).filter(|_| is_number)?;
    let is_valid = parts.next().is_none() && minutes < 60 && seconds_ns < 61 * NS_PER_S;
    is_valid.then_some((hours * 3600 + minutes * 60) * NS_PER_S + seconds_ns)
}

/// A number of at most `n` digits.
fn digits(text: &str, n: usize) -> Option<i128> {
    if (1..=n).contains(&text.len()) && is_plain(text) { text.parse().ok() } else { None }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_exact_to_the_nanosecond() {
        let ns = NS_PER_S;
        assert_eq!(parse("1650775094.781591240", ns), Some(1_650_775_094_781_591_240));
        assert_eq!(parse("1650775094781591240", 1), Some(1_650_775_094_781_591_240));
        assert_eq!(parse("-1.5", ns), Some(-1_500_000_000));
        assert_eq!(parse("2.5e3", 1_000_000), Some(2_500_000_000));
        for wrong in ["", "x", "inf", "NaN", "1e300", "99999999999999999999"] {
            assert_eq!(parse(wrong, ns), None, "{wrong}");
        }
    }

    #[test]
    fn dates_are_read_in_every_common_spelling() {
        // From `date -u -d 2018-01-11T16:32:22 +%s`.
        let expected = Some(1_515_688_342_250_000_000);
        for text in [
            "2018-01-11T16:32:22.25",
            "2018-01-11 16:32:22.250000",
            "2018/01/11 16:32:22.25",
            "2018-01-11T16:32:22.25Z",
            "2018-01-11 16:32:22.25 UTC",
            "2018-01-11T18:32:22.25+02:00",
            "2018-01-11 11:02:22.25 -0530",
            "11.01.2018 16:32:22,25",
            "11.1.18 16:32:22.25",
            "2018.01.11 16:32:22.25",
            "20180111T163222.25Z",
            "2018-01-11_16:32:22.25",
            "Jan 11, 2018 4:32:22.25 PM",
            "11-Jan-2018 16:32:22.25",
            "[Thu Jan 11 16:32:22.25 2018]",
        ] {
            assert_eq!(parse(text, 1), expected, "{text}");
        }
        assert_eq!(parse("2000-03-01 00:00", 1), Some(951_868_800_000_000_000));
        assert_eq!(parse("2000-03-01", 1), Some(951_868_800_000_000_000));
        assert_eq!(parse("1:33:46.298643", 1), Some(5_626_298_643_000));
        assert_eq!(parse("12:00:01 am", 1), Some(1_000_000_000));
        for wrong in [
            "2018-02-29 00:00:00",
            "2018-13-01T00:00:00",
            "2018-01-01 00:61:00",
            "2018-01-01 13:00 PM",
            "2018-01",
            "node 1",
            "1-2",
            ":",
            "T:",
            "é:00:00",
            "01:02:03:04",
        ] {
            assert_eq!(parse(wrong, 1), None, "{wrong}");
        }
    }

    #[test]
    fn day_and_month_of_numbers_are_told_apart_or_refused() {
        let date = |text: &str, order| read(text, 1, Dates { order, ..Dates::default() });
        let fourth_of_march = Ok(Time::Date(1_741_046_400_000_000_000));
        assert_eq!(date("04/03/2025", None), Err(NoTime::Ambiguous));
        assert_eq!(date("04/03/2025", Some(DateOrder::DayFirst)), fourth_of_march);
        assert_eq!(date("03/04/2025", Some(DateOrder::MonthFirst)), fourth_of_march);
        assert_eq!(date("04.03.2025", Some(DateOrder::MonthFirst)), fourth_of_march);
        assert!(date("13/03/2025", None).is_ok() && date("03/13/2025", None).is_ok());
        let dates = Dates { offset_s: 3600, order: None };
        let noon = read("2025-03-04 01:00", 1, dates);
        assert_eq!(noon, fourth_of_march);
        assert_eq!(read("2025-03-04T00:00Z", 1, dates), fourth_of_march);
    }

    #[test]
    fn times_of_day_go_on_after_midnight() {
        let mut clock = DayClock::default();
        let hours = |hours: i64| hours * 3_600_000_000_000;
        let elapsed: Vec<i64> =
            [22, 23, 0, 23, 1, 12, 2].map(|hour| clock.elapsed_ns(hours(hour))).into();
        assert_eq!(elapsed, [22, 23, 24, 23, 25, 36, 26].map(hours));
        let mut uptime = DayClock::default();
        assert_eq!(
            [23, 24, 40].map(|hour| uptime.elapsed_ns(hours(hour))),
            [23, 24, 40].map(hours)
        );
    }
}
