//! The files that a pattern stands for.

use std::cmp::Ordering;
use std::path::{Path, PathBuf};

/// A file, and what the wildcards of the pattern stand for in its path.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Found {
    /// The file.
    pub path: PathBuf,
    /// One text for each `*`, `?` and name in braces.
    pub wildcards: Vec<String>,
}

/// Most files of one pattern.
pub const MOST_FILES: usize = 10_000;
/// Longest pattern and name (bytes) that are compared: patterns with many `*` take time.
const LONGEST: usize = 4096;

/// Whether a pattern may stand for several files.
#[must_use]
pub fn is_pattern(pattern: &str) -> bool {
    let is_wild = |part: &Part<'_>| !matches!(part, Part::Literal(_));
    pattern.split('/').any(|part| choices(part).is_some() || parts(part).iter().any(is_wild))
}

/// What a part of a path with `{name:one|two}` stands for: each text, and the part with it. Nothing else in the part is a wildcard.
fn choices(part: &str) -> Option<Vec<(&str, String)>> {
    let (_, before, texts, after) = with_choices(part)?;
    Some(texts.split('|').map(|text| (text, format!("{before}{text}{after}"))).collect())
}

/// The name, what stands before it, the texts, and what stands behind them, of a part with `{name:one|two}`.
fn with_choices(part: &str) -> Option<(&str, &str, &str, &str)> {
    let (before, rest) = part.split_once('{')?;
    let (name, rest) = rest.split_once(':')?;
    let (texts, after) = rest.rsplit_once('}')?;
    is_name(name).then_some((name, before, texts, after))
}

fn is_name(name: &str) -> bool {
    !name.is_empty() && name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_')
}

/// What the names in braces of a pattern stand for in the path of a file, in order.
///
/// * `path`: of a file that the pattern stands for.
#[must_use]
pub fn fields(pattern: &str, path: &Path) -> Vec<(String, String)> {
    let path: Vec<String> = path.iter().map(|part| part.to_string_lossy().into_owned()).collect();
    let pattern: Vec<&str> = pattern.split('/').filter(|part| !part.is_empty()).collect();
    let mut fields = Vec::new();
    // A pattern is relative to a folder, so its parts are the last ones of the path.
    for (part, name) in pattern.iter().rev().zip(path.iter().rev()).rev() {
        if let Some((field, ..)) = with_choices(part) {
            let found = choices(part).into_iter().flatten().find(|(_, own)| own == name);
            fields.extend(found.map(|(text, _)| (field.to_owned(), text.to_owned())));
            continue;
        }
        let names = parts(part).into_iter().filter_map(|part| match part {
            Part::Literal(_) => None,
            Part::Any | Part::One => Some(None),
            Part::Named(name) => Some(Some(name)),
        });
        let texts = matched(part, name).unwrap_or_default();
        let named = names.zip(texts).filter_map(|(name, text)| Some((name?.to_owned(), text)));
        fields.extend(named);
    }
    fields
}

/// A part of a pattern.
#[derive(Clone, Copy)]
enum Part<'a> {
    Literal(char),
    Any,
    One,
    Named(&'a str),
}

fn parts(pattern: &str) -> Vec<Part<'_>> {
    let mut parts = Vec::new();
    let mut rest = pattern;
    while let Some(first) = rest.chars().next() {
        let named = rest.strip_prefix('{').and_then(|inner| inner.split_once('}'));
        if let Some((name, after)) = named.filter(|(name, _)| is_name(name)) {
            parts.push(Part::Named(name));
            rest = after;
            continue;
        }
        parts.push(match first {
            '*' => Part::Any,
            '?' => Part::One,
            other => Part::Literal(other),
        });
        rest = &rest[first.len_utf8()..];
    }
    parts
}

/// Files that a pattern stands for, in natural order: `ds2` before `ds10`.
///
/// * `folder`: what the pattern is relative to.
///
/// # Errors
///
/// There are none, or too many: in words that follow the name of the key.
pub fn find(folder: &Path, pattern: &str) -> Result<Vec<Found>, String> {
    if LONGEST < pattern.len() {
        return Err(format!("must have at most {LONGEST} bytes"));
    }
    let mut found = vec![Found { path: folder.to_owned(), wildcards: Vec::new() }];
    if Path::new(pattern).is_absolute() {
        found[0].path = PathBuf::from("/");
    }
    for part in pattern.split('/').filter(|part| !part.is_empty()) {
        let mut next = Vec::new();
        for at in found {
            if let Some(choices) = choices(part) {
                next.extend(choices.into_iter().map(|(text, name)| Found {
                    path: at.path.join(name),
                    wildcards: at.wildcards.iter().cloned().chain([text.to_owned()]).collect(),
                }));
            } else if is_pattern(part) {
                entries(&at, part, &mut next)?;
            } else {
                next.push(Found { path: at.path.join(part), wildcards: at.wildcards });
            }
        }
        found = next;
    }
    found.retain(|found| found.path.is_file());
    if found.is_empty() {
        let has_wildcards = is_pattern(pattern);
        let base = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
        return Err(if has_wildcards {
            format!("matches no file (relative to {})", base.display())
        } else {
            format!("does not exist (relative to {})", base.display())
        });
    }
    found.sort_by(|a, b| natural_order(&a.path.to_string_lossy(), &b.path.to_string_lossy()));
    Ok(found)
}

/// Adds the entries of a folder whose name matches a part of the pattern.
#[expect(clippy::disallowed_methods, reason = "a pattern stands for files")]
fn entries(at: &Found, part: &str, next: &mut Vec<Found>) -> Result<(), String> {
    let folder = if at.path.as_os_str().is_empty() { Path::new(".") } else { &at.path };
    let Ok(entries) = std::fs::read_dir(folder) else { return Ok(()) };
    for entry in entries.flatten() {
        let name = entry.file_name();
        let Some(name) = name.to_str() else { continue };
        // As in a shell, hidden files are not meant.
        if name.starts_with('.') && !part.starts_with('.') {
            continue;
        }
        if let Some(wildcards) = matched(part, name) {
            let wildcards = at.wildcards.iter().cloned().chain(wildcards).collect();
            next.push(Found { path: at.path.join(name), wildcards });
        }
        if MOST_FILES < next.len() {
            return Err(format!("matches more than {MOST_FILES} files"));
        }
    }
    Ok(())
}

/// Whether a name is one that a pattern stands for.
#[must_use]
pub fn is_match(pattern: &str, name: &str) -> bool {
    matched(pattern, name).is_some()
}

/// What each `*`, `?` and name in braces of a pattern stands for in a name, if it matches: as little as possible.
fn matched(pattern: &str, name: &str) -> Option<Vec<String>> {
    let pattern = parts(pattern);
    let name: Vec<char> = name.chars().collect();
    // From the last `*` on, the match is tried again with one character more.
    let (mut at, mut read) = (0, 0);
    let mut starts: Vec<(usize, usize, usize)> = Vec::new();
    let mut retry: Option<usize> = None;
    loop {
        match pattern.get(at) {
            Some(Part::Any | Part::Named(_)) => {
                retry = Some(starts.len());
                starts.push((at, read, read));
                at += 1;
                continue;
            }
            Some(Part::One) if read < name.len() => {
                starts.push((at, read, read + 1));
                (at, read) = (at + 1, read + 1);
                continue;
            }
            Some(Part::Literal(expected)) if name.get(read) == Some(expected) => {
                (at, read) = (at + 1, read + 1);
                continue;
            }
            None if read == name.len() => break,
            _ => {}
        }
        let last = retry?;
        starts.truncate(last + 1);
        let (star, _, end) = &mut starts[last];
        *end += 1;
        if name.len() < *end {
            return None;
        }
        (at, read) = (*star + 1, *end);
    }
    Some(starts.iter().map(|&(_, start, end)| name[start..end].iter().collect()).collect())
}

/// Compares texts with numbers in them: digits by their value, everything else by character.
#[must_use]
pub fn natural_order(a: &str, b: &str) -> Ordering {
    let (mut a_rest, mut b_rest) = (a, b);
    loop {
        let (a_number, b_number) = (leading_digits(a_rest), leading_digits(b_rest));
        if !a_number.is_empty() && !b_number.is_empty() {
            let (a_value, b_value) =
                (a_number.trim_start_matches('0'), b_number.trim_start_matches('0'));
            let order = a_value.len().cmp(&b_value.len()).then_with(|| a_value.cmp(b_value));
            if order.is_ne() {
                return order;
            }
            (a_rest, b_rest) = (&a_rest[a_number.len()..], &b_rest[b_number.len()..]);
            continue;
        }
        let (mut a_chars, mut b_chars) = (a_rest.chars(), b_rest.chars());
        match (a_chars.next(), b_chars.next()) {
            (None, None) => return a.cmp(b),
            (a_char, b_char) if a_char != b_char => return a_char.cmp(&b_char),
            _ => (a_rest, b_rest) = (a_chars.as_str(), b_chars.as_str()),
        }
    }
}

fn leading_digits(text: &str) -> &str {
    let end = text.bytes().take_while(u8::is_ascii_digit).count();
    &text[..end]
}

#[cfg(test)]
#[expect(clippy::disallowed_methods, reason = "tests write the files that they read")]
mod tests {
    use super::*;

    #[test]
    fn a_pattern_says_what_its_wildcards_stand_for() {
        let matched = |pattern, name| matched(pattern, name).map(|texts| texts.join("|"));
        assert_eq!(matched("ds*_pose.csv", "ds12_pose.csv").as_deref(), Some("12"));
        assert_eq!(matched("ds*_pose.csv", "ds1_command.csv"), None);
        assert_eq!(matched("*a*b", "xaabab").as_deref(), Some("x|aba"));
        assert_eq!(matched("a?c*", "abc").as_deref(), Some("b|"));
        assert_eq!(matched("a*", "b"), None);
        assert_eq!(matched("a?", "a"), None);
        assert_eq!(matched("d{distance}m_*.csv", "d12m_3.csv").as_deref(), Some("12|3"));
        let fields = fields("{site}/d{distance}m_*.csv", Path::new("/logs/hall/d12m_3.csv"));
        let field = |name: &str, text: &str| (name.to_owned(), text.to_owned());
        assert_eq!(fields, [field("site", "hall"), field("distance", "12")]);
        let chosen = super::fields("x/d{distance:12|20}m.csv", Path::new("x/d20m.csv"));
        assert_eq!(chosen, [field("distance", "20")]);
        assert!(is_pattern("d{distance:12|20}m.csv") && with_choices("d{distance}m.csv").is_none());
        assert!(is_pattern("a/{b}.csv") && !is_pattern("a{b c}.csv") && !is_pattern("a{}"));
    }

    #[test]
    fn numbers_in_names_are_ordered_by_their_value() {
        let mut names = ["ds10", "ds2", "node b", "ds02", "node a", "ds"];
        names.sort_by(|a, b| natural_order(a, b));
        assert_eq!(names, ["ds", "ds02", "ds2", "ds10", "node a", "node b"]);
    }

    #[test]
    fn files_are_found_in_folders_with_wildcards() {
        let folder = tempfile::tempdir().unwrap();
        for name in ["run2", "run10", "other"] {
            std::fs::create_dir(folder.path().join(name)).unwrap();
            std::fs::write(folder.path().join(name).join("pose.csv"), "").unwrap();
        }
        let found = find(folder.path(), "run*/pose.csv").unwrap();
        let wildcards: Vec<&str> = found.iter().map(|found| &*found.wildcards[0]).collect();
        assert_eq!(wildcards, ["2", "10"]);
        assert!(find(folder.path(), "*.csv").unwrap_err().contains("matches no file"));
        assert!(find(folder.path(), "pose.csv").unwrap_err().contains("does not exist"));
        assert_eq!(find(folder.path(), "other/pose.csv").unwrap()[0].wildcards, [""; 0]);
    }
}
