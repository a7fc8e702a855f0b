//! Texts for people: the numbers in them, and what a page shows.

/// A number in a text.
#[derive(Clone, Copy, Debug)]
pub(super) struct Number<'a> {
    /// The line that it stands in.
    pub(super) line: &'a str,
    /// Where its first digit stands in the line (bytes).
    pub(super) at: usize,
    /// It as it is written, with its sign.
    pub(super) text: &'a str,
}

/// The numbers of a text, in order.
///
/// Digits that follow a letter or an underscore belong to a name, such as `p90`.
pub(super) fn numbers(text: &str) -> Vec<Number<'_>> {
    text.lines().flat_map(numbers_of_line).collect()
}

fn numbers_of_line(line: &str) -> impl Iterator<Item = Number<'_>> {
    let mut rest = 0;
    std::iter::from_fn(move || {
        loop {
            let at = rest + line[rest..].find(|c: char| c.is_ascii_digit())?;
            let end = end_of_number(line.as_bytes(), at);
            let mut before = line[..at].char_indices().rev();
            let last = before.next();
            rest = end;
            if last.is_some_and(|(_, c)| is_of_name(c)) {
                continue;
            }
            // A sign, unless it stands between two: 10-20 has no negative number.
            let sign = match last {
                Some((sign, '-' | '−' | '+')) => {
                    let is_between = before.next().is_some_and(|(_, c)| is_of_name(c) || c == ')');
                    (!is_between).then_some(sign)
                }
                _ => None,
            };
            return Some(Number { line, at, text: &line[sign.unwrap_or(at)..end] });
        }
    })
}

fn is_of_name(c: char) -> bool {
    c.is_alphanumeric() || c == '_'
}

/// Where the number ends whose first digit stands at `at`.
fn end_of_number(line: &[u8], at: usize) -> usize {
    let is_digit = |at: usize| line.get(at).is_some_and(u8::is_ascii_digit);
    let mut end = at;
    while is_digit(end) || (line.get(end) == Some(&b'.') && is_digit(end + 1)) {
        end += 1;
    }
    if matches!(line.get(end), Some(b'e' | b'E')) {
        let sign = usize::from(matches!(line.get(end + 1), Some(b'+' | b'-')));
        if is_digit(end + 1 + sign) {
            end += 1 + sign;
            while is_digit(end) {
                end += 1;
            }
        }
    }
    end
}

/// What a page shows: its text without tags, styles and scripts, each run of white space one space. What it repeats of
/// `provenance.json` is left out.
pub(super) fn visible(page: &str) -> String {
    let text = without(page, ("<style", "</style>"), "");
    let text = without(&text, ("<script", "</script>"), "");
    let text = without(&text, ("<pre", "</pre>"), "started_unix_s");
    let mut shown = String::with_capacity(text.len());
    let mut is_tag = false;
    for c in text.chars() {
        match c {
            '<' => is_tag = true,
            '>' if is_tag => {
                is_tag = false;
                shown.push(' ');
            }
            c if !is_tag => shown.push(c),
            _ => {}
        }
    }
    let shown = ENTITIES.iter().fold(shown, |text, (entity, c)| text.replace(entity, c));
    shown.split_whitespace().collect::<Vec<_>>().join(" ")
}

/// The ampersand last, since it begins the others.
const ENTITIES: [(&str, &str); 7] = [
    ("&lt;", "<"),
    ("&gt;", ">"),
    ("&quot;", "\""),
    ("&#39;", "'"),
    ("&#x27;", "'"),
    ("&nbsp;", " "),
    ("&amp;", "&"),
];

/// The pictures of a page, one a line, without the letters: a path's coordinates follow letters.
pub(super) fn pictures(page: &str) -> String {
    let mut pictures = String::new();
    for picture in page.split("<svg").skip(1) {
        let picture = picture.split("</svg>").next().unwrap_or_default();
        let bare = |c: char| if c.is_ascii_alphabetic() || c.is_whitespace() { ' ' } else { c };
        pictures.extend(picture.chars().map(bare));
        pictures.push('\n');
    }
    pictures
}

/// A text without what stands from one mark to the other with this word in it.
fn without(text: &str, (from, to): (&str, &str), word: &str) -> String {
    let mut pieces = text.split(from);
    let mut kept = pieces.next().unwrap_or_default().to_owned();
    for piece in pieces {
        let (inside, rest) = piece.split_once(to).unwrap_or((piece, ""));
        if inside.contains(word) {
            kept.push(' ');
        } else {
            kept.extend([from, inside, to]);
        }
        kept.push_str(rest);
    }
    kept
}

#[cfg(test)]
mod tests {
    use super::*;

    fn texts(text: &str) -> Vec<&str> {
        numbers(text).into_iter().map(|number| number.text).collect()
    }

    #[test]
    fn numbers_are_found_and_names_are_none() {
        assert_eq!(texts("rmse 2.31 -> 1.9e-3 dB, p90 of k7 and x_2"), ["2.31", "1.9e-3"]);
        assert_eq!(
            texts("-80 dBm, +2, 10-20, (a)-3, 10^-3; −4"),
            ["-80", "+2", "10", "20", "3", "10", "-3", "−4"]
        );
        assert_eq!(texts("IEEE 802.15.4. In 12 s."), ["802.15.4", "12"]);
        let second = numbers("a 1\nb -2")[1];
        assert_eq!((second.line, second.at, second.text), ("b -2", 3, "-2"));
    }

    #[test]
    fn what_a_page_shows_is_its_text() {
        let page = "<style>p { margin: 3px }</style><h1 id=\"a1\">5 &lt; 6\n &amp;lt;</h1><td>1</td><td>2</td>";
        assert_eq!(visible(page), "5 < 6 &lt; 1 2");
        let origin = "<pre>a 3</pre>b<pre>{\n &quot;started_unix_s&quot;: 17\n}</pre>c";
        assert_eq!(visible(origin), "a 3 b c");
        let drawn = pictures("<p>7</p><svg width=\"3\"><path d=\"M1.5,2L-3,4\"/></svg><p>8</p>");
        assert_eq!(texts(&drawn), ["3", "1.5", "2", "-3", "4"]);
    }
}
