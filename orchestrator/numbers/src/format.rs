//! Numbers, shares and counts as people read them.
//!
//! Large numbers have commas between thousands and the minus sign U+2212; where a rule below says so, small ones keep the
//! ASCII hyphen, as they are written in configuration files.

/// A number with about three significant digits.
///
/// | size | written as | example |
/// |---|---|---|
/// | not finite | `–` | |
/// | below 5·10⁻⁷ | `0` | |
/// | below 10⁻³, or 10¹⁵ and above | two decimals and an exponent | `1.25e-5` |
/// | below 0.1 | four decimals | `0.0123` |
/// | below 0.995 | three decimals | `0.500` |
/// | below 9.995 | two decimals | `6.60` |
/// | below 99.95 | one decimal | `12.3` |
/// | others | whole, thousands apart, with U+2212 for a minus | `1,234,568` |
#[must_use]
pub fn number(value: f64) -> String {
    let size = value.abs();
    if !value.is_finite() {
        "–".to_owned()
    } else if size < 5e-7 {
        "0".to_owned()
    } else if !(1e-3..1e15).contains(&size) {
        format!("{value:.2e}")
    } else if 99.95 <= size {
        thousands(&format!("{value:.0}"))
    } else {
        let decimals = if size < 0.1 {
            4
        } else if size < 0.995 {
            3
        } else if size < 9.995 {
            2
        } else {
            1
        };
        format!("{value:.decimals$}")
    }
}

/// A number as its author would write it: rounded to ten significant digits, then in the shortest form. Decimal fractions lose
/// their last digits on the way through binary ones, and these are not shown.
///
/// 0 and sizes from 10⁻⁴ to below 10⁹ are written without an exponent, and with U+2212 for a minus.
#[must_use]
pub fn shortest(value: f64) -> String {
    let rounded = rounded(value, 10);
    if rounded == 0.0 || (1e-4..1e9).contains(&rounded.abs()) {
        format!("{rounded}").replace('-', "−")
    } else {
        format!("{rounded:e}")
    }
}

/// The nearest number that has so many significant decimal digits (at least one).
#[must_use]
pub fn rounded(value: f64, significant: usize) -> f64 {
    let decimals = significant.saturating_sub(1);
    format!("{value:.decimals$e}").parse().unwrap_or(value)
}

/// A number with at most so many decimals: rounded to them, zeros at the end left out. `-0` is written `0`.
#[must_use]
pub fn trimmed(value: f64, decimals: usize) -> String {
    let text = format!("{value:.decimals$}");
    let text = if text.contains('.') { text.trim_end_matches('0') } else { &text };
    let text = text.trim_end_matches('.');
    if text == "-0" { "0".to_owned() } else { text.to_owned() }
}

/// A number known up to `half`, which is half the width of its interval: with two significant digits of `half`, at most nine
/// decimals, and U+2212 for a minus. As [`number`] does if `half` is not positive and finite, or the number not finite.
#[must_use]
pub fn number_within(value: f64, half: f64) -> String {
    if !(value.is_finite() && half.is_finite() && 0.0 < half) {
        return number(value);
    }
    let decimals = (1.0 - libm::log10(half).floor()).clamp(0.0, 9.0) as usize;
    format!("{value:.decimals$}").replace('-', "−")
}

/// A number with its unit: none where that is `1` or empty.
#[must_use]
pub fn with_unit(number: &str, unit: &str) -> String {
    if ["", "1"].contains(&unit) { number.to_owned() } else { format!("{number} {unit}") }
}

/// A whole number, thousands apart: `1,234`.
#[must_use]
pub fn count(n: u64) -> String {
    thousands(&n.to_string())
}

/// So many things: `1 cell`, `1,234 cells`. The plural is formed by an `s`.
#[must_use]
pub fn count_of(n: u64, thing: &str) -> String {
    format!("{} {thing}{}", count(n), if n == 1 { "" } else { "s" })
}

/// A share as per cent: whole if it is whole up to 10⁻⁹, else with one decimal. A share between 0 and 1 is never written as
/// 0 % or 100 %, but as `< 0.1 %` or `> 99.9 %`.
#[must_use]
pub fn percent(share: f64) -> String {
    let percent = 100.0 * share;
    if 0.0 < percent && percent < 0.1 {
        "< 0.1 %".to_owned()
    } else if 99.9 < percent && percent < 100.0 {
        "> 99.9 %".to_owned()
    } else if (percent - percent.round()).abs() < 1e-9 {
        format!("{percent:.0} %")
    } else {
        format!("{percent:.1} %")
    }
}

/// A time given in years of 365 days, in the largest of years, days, hours, minutes and seconds of which there is at least a
/// tenth of a year, or one. Only a time of 0 is written as 0.
#[must_use]
pub fn years(value: f64) -> (String, &'static str) {
    const UNITS: [(f64, f64, &str); 4] = [
        (1.0, 0.1, "years"),
        (365.0, 1.0, "days"),
        (365.0 * 24.0, 1.0, "hours"),
        (365.0 * 24.0 * 60.0, 1.0, "minutes"),
    ];
    let fits = |&&(per_year, least, _): &&(f64, f64, &str)| least <= value * per_year;
    let (per_year, unit) = UNITS
        .iter()
        .find(fits)
        .map_or((365.0 * 24.0 * 3600.0, "s"), |&(per_year, _, unit)| (per_year, unit));
    (number(value * per_year), unit)
}

/// Words in lines of at most `width` characters, each after `indent`. A word that is longer has a line of its own.
#[must_use]
pub fn wrapped(text: &str, indent: &str, width: usize) -> String {
    let mut lines = String::new();
    let mut line = indent.to_owned();
    for word in text.split_whitespace() {
        if line.len() > indent.len() {
            if width < line.chars().count() + 1 + word.chars().count() {
                lines.push_str(&line);
                lines.push('\n');
                indent.clone_into(&mut line);
            } else {
                line.push(' ');
            }
        }
        line.push_str(word);
    }
    lines + &line
}

/// A sentence with a capital letter at its beginning.
#[must_use]
pub fn capitalised(sentence: &str) -> String {
    let mut chars = sentence.chars();
    chars.next().map_or_else(String::new, |first| first.to_uppercase().chain(chars).collect())
}

fn thousands(digits: &str) -> String {
    let (sign, digits) = digits.strip_prefix('-').map_or(("", digits), |rest| ("−", rest));
    let mut grouped = sign.to_owned();
    for (index, digit) in digits.chars().enumerate() {
        if index != 0 && (digits.len() - index) % 3 == 0 {
            grouped.push(',');
        }
        grouped.push(digit);
    }
    grouped
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_three_significant_digits() {
        let shown = [0.0, 0.01234, 0.5, 6.6049, 12.34, 999.6, 1_234_567.8, -2500.0].map(number);
        assert_eq!(shown, ["0", "0.0123", "0.500", "6.60", "12.3", "1,000", "1,234,568", "−2,500"]);
        let shown = [1.2549e-5, 1e-7, -0.5, 2e15, f64::NAN].map(number);
        assert_eq!(shown, ["1.25e-5", "0", "-0.500", "2.00e15", "–"]);
    }

    #[test]
    fn chosen_numbers_are_shown_as_they_were_chosen() {
        let shown = [7.0, 0.1, 0.1 + 0.2, 2.5, -2.5, -1e-9].map(shortest);
        assert_eq!(shown, ["7", "0.1", "0.3", "2.5", "−2.5", "-1e-9"]);
    }

    #[test]
    fn rounding_keeps_so_many_significant_digits() {
        let kept = [1234.56, 0.012_345_6, 0.0, -99.96].map(|value| rounded(value, 3).to_string());
        assert_eq!(kept, ["1230", "0.0123", "0", "-100"]);
    }

    #[test]
    fn zeros_at_the_end_are_left_out() {
        let shown = [0.5, 12.0, 1.0 / 3.0, -0.0001, 100.0].map(|value| trimmed(value, 3));
        assert_eq!(shown, ["0.5", "12", "0.333", "0", "100"]);
        assert_eq!(trimmed(100.0, 0), "100");
    }

    #[test]
    fn an_uncertain_number_has_two_digits_of_its_uncertainty() {
        let shown = [(3.24159, 0.02), (3.24159, 2.0), (-3.24159, 0.1), (314.159, 20.0)]
            .map(|(value, half)| number_within(value, half));
        assert_eq!(shown, ["3.242", "3.2", "−3.24", "314"]);
        assert_eq!(number_within(3.24159, 0.0), "3.24");
    }

    #[test]
    fn one_thing_is_not_several() {
        let shown = [0, 1, 1234].map(|n| count_of(n, "cell"));
        assert_eq!(shown, ["0 cells", "1 cell", "1,234 cells"]);
    }

    #[test]
    fn a_share_is_called_all_or_nothing_only_if_it_is() {
        let shown = [0.0, 0.0001, 0.5, 0.123, 0.99999, 1.0].map(percent);
        assert_eq!(shown, ["0 %", "< 0.1 %", "50 %", "12.3 %", "> 99.9 %", "100 %"]);
    }

    #[test]
    fn a_short_lifetime_is_not_0_years() {
        let shown = [4.33, 0.83, 0.05, 1e-3, 1e-5, 3e-6, 1e-7].map(|value| {
            let (number, unit) = years(value);
            format!("{number} {unit}")
        });
        let expected =
            "4.33 years, 0.830 years, 18.2 days, 8.76 hours, 5.26 minutes, 1.58 minutes, 3.15 s";
        assert_eq!(shown.join(", "), expected);
    }

    #[test]
    fn lines_are_as_long_as_their_width_allows() {
        assert_eq!(wrapped("a quick  brown fox", "  ", 9), "  a quick\n  brown\n  fox");
        assert_eq!(wrapped("unbreakable é", "", 4), "unbreakable\né");
        assert_eq!(wrapped("", "  ", 4), "  ");
    }

    #[test]
    fn sentences_begin_with_a_capital_letter() {
        assert_eq!(["émile is here", ""].map(capitalised), ["Émile is here", ""]);
    }

    #[test]
    fn a_number_without_a_unit_leaves_no_space_for_it() {
        assert_eq!(with_unit("0.5", "dB"), "0.5 dB");
        assert_eq!([with_unit("0.5", "1"), with_unit("0.5", "")], ["0.5", "0.5"]);
    }
}
