//! The part of a source file that ships: without comments, and without what only tests compile.

/// The attribute of items that only tests compile.
const OF_TESTS: &str = "#[cfg(test)]";

/// The text of a source file with comments, and items under `#[cfg(test)]`, replaced by spaces.
///
/// Line breaks stay, so that lines have the same numbers as in the file. String literals stay as well.
///
/// # Panics
///
/// If an item under `#[cfg(test)]` does not end.
#[must_use]
pub fn product_code(source: &str) -> String {
    let mut code = source.as_bytes().to_vec();
    let tokens = tokens(source);
    for &(kind, start, end) in &tokens {
        if kind == Kind::Comment {
            blank(&mut code[start..end]);
        }
    }
    let mut next = 0;
    while next < tokens.len() {
        let (kind, start, _) = tokens[next];
        if kind != Kind::Code || !source[start..].starts_with(OF_TESTS) {
            next += 1;
            continue;
        }
        let first = tokens[next..].iter().position(|token| start + OF_TESTS.len() <= token.1);
        let last = next + first.expect("an attribute stands before an item");
        let last = last + end_of_item(source, &tokens[last..]);
        blank(&mut code[start..tokens[last].2]);
        next = last + 1;
    }
    String::from_utf8(code).expect("whole tokens are replaced")
}

/// Index of the token that ends an item: its semicolon, its closing brace or, of a field, a variant or a match arm, its comma.
fn end_of_item(source: &str, tokens: &[(Kind, usize, usize)]) -> usize {
    let code: Vec<(usize, u8)> = (tokens.iter().enumerate())
        .filter(|(_, token)| token.0 == Kind::Code)
        .map(|(index, token)| (index, source.as_bytes()[token.1]))
        .collect();
    let text: String = code.iter().map(|&(_, byte)| char::from(byte)).collect();
    let ends_at_comma = !is_statement(&text);
    let (mut n_open, mut n_generics, mut is_value) = (0, 0, false);
    for (place, &(index, byte)) in code.iter().enumerate() {
        match byte {
            b'{' | b'(' | b'[' => n_open += 1,
            b'}' | b')' | b']' => {
                n_open -= 1;
                assert!(0 <= n_open, "line {}: no item", line(source, tokens[index].1));
                if n_open == 0 && byte == b'}' {
                    return index;
                }
            }
            b';' if n_open == 0 => return index,
            b',' if n_open == 0 && n_generics == 0 && ends_at_comma => return index,
            b'=' if n_open == 0 => is_value = true,
            b'<' if n_open == 0 && !is_value => n_generics += 1,
            b'>' if n_open == 0 && !is_value && code[place - 1].1 != b'-' => n_generics -= 1,
            _ => {}
        }
    }
    panic!("line {}: an item that does not end", line(source, tokens[0].1));
}

/// Whether an item is one of a module or a block, as its first word after attributes and visibility says.
fn is_statement(mut item: &str) -> bool {
    const WORDS: [&str; 15] = [
        "async",
        "const",
        "enum",
        "extern",
        "fn",
        "impl",
        "let",
        "macro_rules",
        "mod",
        "static",
        "struct",
        "trait",
        "type",
        "unsafe",
        "use",
    ];
    loop {
        item = item.trim_start();
        if let Some(attribute) = item.strip_prefix("#[") {
            item = attribute.split_once(']').map_or("", |(_, rest)| rest);
        } else if let Some(rest) = item.strip_prefix("pub(") {
            item = rest.split_once(')').map_or("", |(_, rest)| rest);
        } else if let Some(rest) = item.strip_prefix("pub ") {
            item = rest;
        } else {
            let word = item.split(|c: char| !c.is_alphanumeric() && c != '_').next();
            return word.is_some_and(|word| WORDS.contains(&word));
        }
    }
}

fn line(source: &str, at: usize) -> usize {
    1 + source[..at].matches('\n').count()
}

#[derive(Clone, Copy, PartialEq)]
enum Kind {
    /// One character outside comments and literals.
    Code,
    Comment,
    /// A string or a character.
    Literal,
}

/// Splits a source file into tokens: kind, first byte, byte after the last.
fn tokens(source: &str) -> Vec<(Kind, usize, usize)> {
    let mut tokens = Vec::new();
    let mut at = 0;
    while let Some(first) = source[at..].chars().next() {
        let rest = &source[at..];
        let is_in_word = source[..at].ends_with(|c: char| c.is_alphanumeric() || c == '_');
        let (kind, length) = if rest.starts_with("//") {
            (Kind::Comment, rest.find('\n').unwrap_or(rest.len()))
        } else if rest.starts_with("/*") {
            (Kind::Comment, block_comment(rest))
        } else if let Some(length) = raw_string(rest).filter(|_| !is_in_word) {
            (Kind::Literal, length)
        } else if first == '"' {
            (Kind::Literal, quoted(rest, '"'))
        } else if is_character(rest) {
            (Kind::Literal, quoted(rest, '\''))
        } else {
            (Kind::Code, first.len_utf8())
        };
        tokens.push((kind, at, at + length));
        at += length;
    }
    tokens
}

/// Length of a block comment with the comments in it.
fn block_comment(rest: &str) -> usize {
    let mut depth = 0;
    let mut at = 0;
    while at < rest.len() {
        if rest[at..].starts_with("/*") {
            depth += 1;
            at += 2;
        } else if rest[at..].starts_with("*/") {
            depth -= 1;
            at += 2;
            if depth == 0 {
                return at;
            }
        } else {
            at += rest[at..].chars().next().map_or(1, char::len_utf8);
        }
    }
    at
}

/// Length of a raw string, if one begins here.
fn raw_string(rest: &str) -> Option<usize> {
    let hashes = rest.strip_prefix("br").or_else(|| rest.strip_prefix('r'))?;
    let n_hashes = hashes.len() - hashes.trim_start_matches('#').len();
    let content = hashes[n_hashes..].strip_prefix('"')?;
    let end = format!("\"{}", "#".repeat(n_hashes));
    let length = content.find(&end).map_or(content.len(), |found| found + end.len());
    Some(rest.len() - content.len() + length)
}

/// Length of a literal that begins and ends with a quote, and in which a backslash escapes the next character.
fn quoted(rest: &str, quote: char) -> usize {
    let mut is_escaped = false;
    for (at, c) in rest.char_indices().skip(1) {
        if is_escaped {
            is_escaped = false;
        } else if c == '\\' {
            is_escaped = true;
        } else if c == quote {
            return at + c.len_utf8();
        }
    }
    rest.len()
}

/// Whether a character begins here, rather than a lifetime or a label.
fn is_character(rest: &str) -> bool {
    let mut rest = rest.chars();
    rest.next() == Some('\'') && (rest.next() == Some('\\') || rest.next() == Some('\''))
}

fn blank(code: &mut [u8]) {
    code.iter_mut().filter(|byte| **byte != b'\n').for_each(|byte| *byte = b' ');
}

#[cfg(test)]
mod tests {
    use super::product_code;

    /// The words that are left.
    fn words(source: &str) -> String {
        let code = product_code(source);
        assert_eq!(code.lines().count(), source.lines().count(), "{code}");
        code.split_whitespace().collect::<Vec<_>>().join(" ")
    }

    #[test]
    fn code_after_an_item_of_tests_is_product_code() {
        let source =
            "fn a() {}\n#[cfg(test)]\nmod tests {\n    fn b() { if c { d } }\n}\nfn e() {}\n";
        assert_eq!(words(source), "fn a() {} fn e() {}");
        assert_eq!(words("#[cfg(test)]\nmod tests;\nfn a() {}"), "fn a() {}");
        assert_eq!(
            words("#[cfg(test)]\n#[path = \"x;\"]\npub(super) mod t;\nfn a() {}"),
            "fn a() {}"
        );
        assert_eq!(words("#[cfg(test)]\nfn of(x: [u8; 3]) -> u8 { 1 }\nfn a() {}"), "fn a() {}");
        assert_eq!(
            words("struct A { #[cfg(test)] b: M<u8, (u8, u8)>, c: u8 }"),
            "struct A { c: u8 }"
        );
        let generic =
            "#[cfg(test)]\npub(crate) fn of<A, B>(a: A) -> B where A: C, B: C { a.into() }";
        assert_eq!(words(&format!("{generic}\nfn a() {{}}")), "fn a() {}");
        assert_eq!(words("#[cfg(test)]\nconst A: u8 = 1 << 3;\nfn a() {}"), "fn a() {}");
    }

    #[test]
    fn comments_are_no_code_and_literals_are() {
        assert_eq!(words("a // b\n/* c /* d */ e */ f"), "a f");
        assert_eq!(words("\"// a\" // b"), "\"// a\"");
        assert_eq!(words("r#\"\" // a\"# // b"), "r#\"\" // a\"#");
        assert_eq!(words("('\"', b'\\'', '/') // a"), "('\"', b'\\'', '/')");
        assert_eq!(words("fn a<'b>(c: &'b str) {} // '"), "fn a<'b>(c: &'b str) {}");
    }

    #[test]
    fn braces_in_literals_and_comments_of_an_item_do_not_end_it() {
        let item = "#[cfg(test)]\nmod tests { a(\"}\"); b('}'); c(r\"}\"); /* } */ }";
        assert_eq!(words(&format!("{item} d")), "d");
        // An attribute in a comment or a string is none.
        assert_eq!(
            words("// #[cfg(test)]\nfn a() {}\nlet b = \"#[cfg(test)]\";"),
            "fn a() {} let b = \"#[cfg(test)]\";"
        );
    }
}
