//! Times as logs write them, as whole nanoseconds: epoch times in double precision would be rounded to a quarter of a microsecond.

use chrono::NaiveDate;

/// Nanoseconds of a second.
pub const NS_PER_S: i128 = 1_000_000_000;

/// A time in nanoseconds: since 1970 (UTC) for dates, since whatever the log counts from for numbers.
///
/// * `unit_ns`: what one unit of a plain number is (ns).
///
/// Dates are `2018-01-11T16:32:22.5`, with a space in place of the T, with `/` between the parts of the date, with `Z` or an
/// offset such as `+02:00` (ISO 8601); without an offset they are UTC. A time of day such as `0:00:58.690955` counts from midnight.
#[must_use]
pub fn parse(text: &str, unit_ns: i128) -> Option<i64> {
    let text = text.trim();
    let ns = if text.contains(':') { date_and_time(text)? } else { number(text, unit_ns)? };
    i64::try_from(ns).ok()
}

/// A plain number; digits after the point count exactly, as far as nanoseconds go.
fn number(text: &str, unit_ns: i128) -> Option<i128> {
    let (sign, digits) = match text.strip_prefix('-') {
        Some(digits) => (-1, digits),
        None => (1, text),
    };
    let (whole, fraction) = digits.split_once('.').unwrap_or((digits, ""));
    let is_plain = |digits: &str| digits.bytes().all(|byte| byte.is_ascii_digit());
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

fn date_and_time(text: &str) -> Option<i128> {
    let Some((date, time)) = text.split_once(['T', 't', ' ']) else {
        return time_of_day(text);
    };
    let (time, offset_s) = without_offset(time.trim())?;
    let separator = if date.contains('/') { '/' } else { '-' };
    let mut parts = date.split(separator);
    let (year, month, day) =
        (digits(parts.next()?, 4)?, digits(parts.next()?, 2)?, digits(parts.next()?, 2)?);
    let date = NaiveDate::from_ymd_opt(year as i32, month as u32, day as u32)?;
    if parts.next().is_some() {
        return None;
    }
    let time_ns = time_of_day(time).filter(|&time_ns| time_ns < 86_401 * NS_PER_S)?;
    Some((i128::from(date.to_epoch_days()) * 86_400 - offset_s) * NS_PER_S + time_ns)
}

/// A time without its offset from UTC, and the offset (s).
fn without_offset(time: &str) -> Option<(&str, i128)> {
    if let Some(time) = time.strip_suffix(['Z', 'z']) {
        return Some((time.trim_end(), 0));
    }
    let Some(at) = time.rfind(['+', '-']) else {
        return Some((time, 0));
    };
    let (time, offset) = time.split_at(at);
    let sign = if offset.starts_with('-') { -1 } else { 1 };
    let offset = offset.get(1..)?.replace(':', "");
    let (hours, minutes) = (digits(offset.get(..2)?, 2)?, offset.get(2..)?);
    let minutes = if minutes.is_empty() { 0 } else { digits(minutes, 2)? };
    Some((time.trim_end(), sign * (hours * 3600 + minutes * 60)))
}

/// Hours, minutes, and seconds with a fraction, as nanoseconds.
fn time_of_day(text: &str) -> Option<i128> {
    let mut parts = text.split(':');
    let (hours, minutes) = (parts.next()?, digits(parts.next()?, 2)?);
    let seconds = parts.next().unwrap_or("0");
    let hours: i128 =
        Some(hours).filter(|h| (1..=6).contains(&h.len()))?.parse::<u32>().ok()?.into();
    let is_plain = seconds.starts_with(|c: char| c.is_ascii_digit());
    let seconds_ns = number(seconds, NS_PER_S).filter(|_| is_plain)?;
    let is_valid = parts.next().is_none() && minutes < 60 && seconds_ns < 61 * NS_PER_S;
    is_valid.then_some((hours * 3600 + minutes * 60) * NS_PER_S + seconds_ns)
}

/// A number of at most `n` digits.
fn digits(text: &str, n: usize) -> Option<i128> {
    let is_plain = (1..=n).contains(&text.len()) && text.bytes().all(|byte| byte.is_ascii_digit());
    if is_plain { text.parse().ok() } else { None }
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
            "2018-01-11T18:32:22.25+02:00",
            "2018-01-11 11:02:22.25 -0530",
        ] {
            assert_eq!(parse(text, 1), expected, "{text}");
        }
        assert_eq!(parse("2000-03-01 00:00", 1), Some(951_868_800_000_000_000));
        assert_eq!(parse("1:33:46.298643", 1), Some(5_626_298_643_000));
        for wrong in
            ["2018-02-29 00:00:00", "2018-13-01T00:00:00", "2018-01-01 00:61:00", ":", "T:"]
        {
            assert_eq!(parse(wrong, 1), None, "{wrong}");
        }
    }
}
