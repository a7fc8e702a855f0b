//! Numbers and text for people.

/// A number with three significant digits, thousands apart; long ones whole.
pub(crate) fn number(value: f64) -> String {
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

/// A number that someone has chosen, as they would write it.
pub(crate) fn chosen(value: f64) -> String {
    // Ten digits: what decimal fractions lose on the way through binary ones is not shown.
    let rounded = format!("{value:.9e}").parse().unwrap_or(value);
    if rounded == 0.0 || (1e-4..1e9).contains(&rounded.abs()) {
        format!("{rounded}").replace('-', "−")
    } else {
        format!("{rounded:e}")
    }
}

/// A whole number, thousands apart.
pub(crate) fn count(n: u64) -> String {
    thousands(&n.to_string())
}

/// So many things: one, or several.
pub(crate) fn counted(n: u64, thing: &str) -> String {
    format!("{} {thing}{}", count(n), if n == 1 { "" } else { "s" })
}

/// A share as per cent, never rounded to 0 or 100 from within.
pub(crate) fn percent(share: f64) -> String {
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

/// Text as HTML.
pub(crate) fn escape(text: &str) -> String {
    let mut escaped = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => escaped.push_str("&amp;"),
            '<' => escaped.push_str("&lt;"),
            '>' => escaped.push_str("&gt;"),
            '"' => escaped.push_str("&quot;"),
            '\'' => escaped.push_str("&#39;"),
            c => escaped.push(c),
        }
    }
    escaped
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
    }

    #[test]
    fn chosen_numbers_are_shown_as_they_were_chosen() {
        let shown = [7.0, 0.1, 0.1 + 0.2, 2.5, -1e-9].map(chosen);
        assert_eq!(shown, ["7", "0.1", "0.3", "2.5", "-1e-9"]);
    }

    #[test]
    fn one_thing_is_not_several() {
        let shown = [0, 1, 1234].map(|n| counted(n, "cell"));
        assert_eq!(shown, ["0 cells", "1 cell", "1,234 cells"]);
    }

    #[test]
    fn a_share_is_called_all_or_nothing_only_if_it_is() {
        let shown = [0.0, 0.0001, 0.5, 0.123, 0.99999, 1.0].map(percent);
        assert_eq!(shown, ["0 %", "< 0.1 %", "50 %", "12.3 %", "> 99.9 %", "100 %"]);
    }

    #[test]
    fn markup_in_text_is_harmless() {
        assert_eq!(escape("<b a='\"'>&"), "&lt;b a=&#39;&quot;&#39;&gt;&amp;");
    }
}
