//! What differs between two folders of results: numbers, names and bytes, or wording alone.

use super::recorded;
use super::text::{self, Number};
use anyhow::Context as _;
use serde_json::Value;
use std::collections::BTreeSet;
use std::fmt;
use std::path::Path;

/// Something that differs.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Difference {
    /// File and place in it.
    pub place: String,
    /// What differs.
    pub kind: Kind,
    /// What stood there before, shortened.
    pub before: String,
    /// What stands there after, shortened.
    pub after: String,
}

/// What differs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Kind {
    /// A sentence, with the same numbers in it: the only difference that is allowed.
    Wording,
    /// A number.
    Number,
    /// A name, an identifier, a truth value, or the type of a value.
    Name,
    /// Something is there on one side only.
    Missing,
    /// A byte of a recording.
    Byte,
}

impl fmt::Display for Difference {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let what = match self.kind {
            Kind::Wording => "wording",
            Kind::Number => "number",
            Kind::Name => "name",
            Kind::Missing => "missing",
            Kind::Byte => "byte",
        };
        write!(f, "{} ({what}): {} -> {}", self.place, self.before, self.after)
    }
}

/// When, where and how something ran: outside the promise.
const UNPROMISED: [&str; 4] = ["provenance.json", "run.log", "trials.jsonl", super::MANIFEST];

/// Lines on standard output with one of these tell how long something took.
const TIMED: [&str; 2] = ["steps/s", "of simulators started"];

/// Lines on standard error that do not begin with one of these tell how far it is, every few seconds.
const LASTING: [&str; 2] = ["error", "warning"];

/// Values of these keys are formulas, not sentences.
const FORMULAS: [&str; 2] = ["formula", "expression"];

/// As much of a value as is told.
const MOST_CHARS: usize = 200;

/// What differs between the results in two folders, in the order of file names.
///
/// * `inputs`: files that are not results.
///
/// # Errors
///
/// A file cannot be read.
pub fn folders(
    before: &Path,
    after: &Path,
    inputs: &BTreeSet<String>,
) -> anyhow::Result<Vec<Difference>> {
    let homes = [super::home_of(before)?, super::home_of(after)?];
    let mut found = Found { homes, differences: Vec::new() };
    let [was, is] = [files(before)?, files(after)?];
    for name in was.union(&is) {
        let file = name.rsplit('/').next().unwrap_or_default();
        if inputs.contains(name) || UNPROMISED.contains(&file) {
            continue;
        }
        if !(was.contains(name) && is.contains(name)) {
            let told = |is: bool| if is { "a file" } else { "no file" }.to_owned();
            found.add(name, Kind::Missing, &told(was.contains(name)), &told(is.contains(name)));
            continue;
        }
        let [old, new] = [before, after].map(|folder| std::fs::read(folder.join(name)));
        let (old, new) = (old?, new?);
        if old != new {
            // A folder that says where it comes from is a recording: promised to the byte.
            let folder = name.strip_suffix(file).unwrap_or_default();
            let is_recording = was.contains(&format!("{folder}provenance.json"));
            found.file(name, old, new, is_recording).with_context(|| name.clone())?;
        }
    }
    Ok(found.differences)
}

/// All files below a folder, by their paths from there, with `/` between the parts.
pub(super) fn files(folder: &Path) -> anyhow::Result<BTreeSet<String>> {
    let mut names = BTreeSet::new();
    let entries = std::fs::read_dir(folder).with_context(|| folder.display().to_string())?;
    for entry in entries {
        let entry = entry?;
        let name = entry.file_name().to_string_lossy().into_owned();
        if entry.path().is_dir() {
            names.extend(files(&entry.path())?.into_iter().map(|below| format!("{name}/{below}")));
        } else {
            names.insert(name);
        }
    }
    Ok(names)
}

struct Found {
    /// Where the two folders were when they were filled.
    homes: [String; 2],
    differences: Vec<Difference>,
}

impl Found {
    fn add(&mut self, place: &str, kind: Kind, before: &str, after: &str) {
        let short = |text: &str| match text.char_indices().nth(MOST_CHARS) {
            Some((end, _)) => format!("{}…", &text[..end]),
            None => text.to_owned(),
        };
        let (place, before, after) = (place.to_owned(), short(before), short(after));
        self.differences.push(Difference { place, kind, before, after });
    }

    /// Two files that are not the same bytes.
    fn file(
        &mut self,
        name: &str,
        before: Vec<u8>,
        after: Vec<u8>,
        is_recording: bool,
    ) -> anyhow::Result<()> {
        let ending = name.rsplit('.').next().unwrap_or_default();
        match ending {
            "mcap" => {
                if let Some((was, is)) = recorded::first_message(&before, &after)? {
                    self.add(name, Kind::Byte, &was, &is);
                }
                return Ok(());
            }
            "parquet" => {
                match recorded::first_cell(before, after)? {
                    Some((place, was, is)) => {
                        self.add(&format!("{name} {place}"), Kind::Byte, &was, &is);
                    }
                    None => self.add(name, Kind::Byte, "the same rows", "in other bytes"),
                }
                return Ok(());
            }
            _ => {}
        }
        let [Ok(before), Ok(after)] = [String::from_utf8(before), String::from_utf8(after)] else {
            self.add(name, Kind::Byte, "bytes", "other bytes");
            return Ok(());
        };
        let [before, after] = [(before, &self.homes[0]), (after, &self.homes[1])]
            .map(|(text, home)| text.replace(home.as_str(), "FOLDER"));
        if before == after {
            return Ok(());
        }
        let n_before = self.differences.len();
        match ending {
            "html" | "svg" => {
                self.text(name, &text::visible(&before), &text::visible(&after));
                let drawn = [text::pictures(&before), text::pictures(&after)];
                self.numbers(&format!("{name} pictures"), &drawn[0], &drawn[1]);
                return Ok(());
            }
            "json" => self.json(name, &before, &after)?,
            "toml" if !is_recording => self.toml(name, &before, &after)?,
            "txt" if !is_recording => self.printed(name, &before, &after)?,
            _ => {}
        }
        let is_explained = if is_recording {
            self.differences[n_before..].iter().any(|difference| difference.kind != Kind::Wording)
        } else {
            ["json", "toml", "txt"].contains(&ending)
        };
        if !is_explained {
            self.line(name, Kind::Byte, &before, &after);
        } else if ending == "json" && self.differences.len() == n_before {
            self.add(name, Kind::Wording, "the same values", "in another order or spacing");
        }
        Ok(())
    }

    /// The first line that differs.
    fn line(&mut self, name: &str, kind: Kind, before: &str, after: &str) {
        let n_lines = 1 + before.lines().count().max(after.lines().count());
        let pad = |text| std::iter::Iterator::chain(str::lines(text), std::iter::repeat("no line"));
        let mut lines = pad(before).zip(pad(after)).take(n_lines).enumerate();
        match lines.find(|(_, (was, is))| was != is) {
            Some((at, (was, is))) => self.add(&format!("{name}:{}", at + 1), kind, was, is),
            None => self.add(name, kind, "the same lines", "with other ends"),
        }
    }

    fn json(&mut self, name: &str, before: &str, after: &str) -> anyhow::Result<()> {
        let [was, is] = [before, after].map(serde_json::from_str::<Value>);
        self.values(&format!("{name} "), "", &was?, &is?);
        Ok(())
    }

    fn toml(&mut self, name: &str, before: &str, after: &str) -> anyhow::Result<()> {
        let read = |text: &str| -> anyhow::Result<Value> {
            Ok(serde_json::to_value(text.parse::<toml::Table>()?)?)
        };
        self.values(&format!("{name} "), "", &read(before)?, &read(after)?);
        let comments = |text: &str| {
            let each = text.lines().filter_map(|line| line.split_once('#'));
            each.map(|(_, comment)| comment).collect::<Vec<_>>().join("\n")
        };
        self.text(&format!("{name} comments"), &comments(before), &comments(after));
        Ok(())
    }

    /// What a program printed: JSON, or text.
    fn printed(&mut self, name: &str, before: &str, after: &str) -> anyhow::Result<()> {
        if before.starts_with('{') && after.starts_with('{') {
            return self.json(name, before, after);
        }
        let untimed = |text: &str| {
            let is_untimed = |line: &&str| {
                if name.ends_with("stderr.txt") {
                    LASTING.iter().any(|mark| line.starts_with(mark))
                } else {
                    !TIMED.iter().any(|mark| line.contains(mark))
                }
            };
            text.lines().filter(is_untimed).collect::<Vec<_>>().join("\n")
        };
        self.text(name, &untimed(before), &untimed(after));
        Ok(())
    }

    /// Two texts, whose numbers must be the same.
    fn text(&mut self, name: &str, before: &str, after: &str) {
        if before != after && !self.numbers(name, before, after) {
            if before.lines().count() <= 1 && after.lines().count() <= 1 {
                // Of one long line, where it begins to differ.
                let same = before.chars().zip(after.chars()).take_while(|(a, b)| a == b).count();
                let from =
                    |text: &str| text.chars().skip(same.saturating_sub(40)).collect::<String>();
                self.add(name, Kind::Wording, &from(before), &from(after));
            } else {
                self.line(name, Kind::Wording, before, after);
            }
        }
    }

    /// The first number that differs, told with the text around it; whether there is one.
    fn numbers(&mut self, name: &str, before: &str, after: &str) -> bool {
        let [was, is] = [text::numbers(before), text::numbers(after)];
        let value =
            |list: &[Number<'_>], k: usize| list.get(k).map(|number| number.text.to_owned());
        let n = was.len().max(is.len());
        let Some(first) = (0..n).find(|&k| value(&was, k) != value(&is, k)) else { return false };
        let told = |number: Option<&Number<'_>>| match number {
            Some(number) => format!("{} in {:?}", number.text, around(number)),
            None => "no number".to_owned(),
        };
        let place = format!("{name} number {}", first + 1);
        self.add(&place, Kind::Number, &told(was.get(first)), &told(is.get(first)));
        true
    }

    /// Two values of JSON; `key`: under which they stand.
    fn values(&mut self, place: &str, key: &str, before: &Value, after: &Value) {
        match (before, after) {
            (Value::Object(was), Value::Object(is)) => {
                let added = is.keys().filter(|key| !was.contains_key(*key));
                for key in was.keys().chain(added) {
                    let below = format!("{place}/{key}");
                    match (was.get(key), is.get(key)) {
                        (Some(was), Some(is)) => self.values(&below, key, was, is),
                        (was, is) => self.one_sided(&below, was, is),
                    }
                }
            }
            (Value::Array(was), Value::Array(is)) => {
                for index in 0..was.len().max(is.len()) {
                    let below = format!("{place}/{index}");
                    match (was.get(index), is.get(index)) {
                        (Some(was), Some(is)) => self.values(&below, key, was, is),
                        (was, is) => self.one_sided(&below, was, is),
                    }
                }
            }
            // As printed: 1, 1.0 and -0.0 are not the same digits.
            (Value::Number(was), Value::Number(is)) => {
                let (was, is) = (was.to_string(), is.to_string());
                if was != is {
                    self.add(place, Kind::Number, &was, &is);
                }
            }
            (Value::String(was), Value::String(is)) if was != is => {
                if is_sentence(key, was) && is_sentence(key, is) {
                    self.text(place, was, is);
                } else {
                    self.add(place, Kind::Name, was, is);
                }
            }
            (was, is) if was != is => {
                self.add(place, Kind::Name, &was.to_string(), &is.to_string());
            }
            _ => {}
        }
    }

    fn one_sided(&mut self, place: &str, before: Option<&Value>, after: Option<&Value>) {
        let told = |value: Option<&Value>| value.map_or("absent".to_owned(), Value::to_string);
        self.add(place, Kind::Missing, &told(before), &told(after));
    }
}

/// Whether a value may be worded otherwise: names have no spaces in them.
fn is_sentence(key: &str, value: &str) -> bool {
    value.trim().contains(char::is_whitespace) && !FORMULAS.contains(&key)
}

/// Some of the text around a number.
fn around<'a>(number: &Number<'a>) -> &'a str {
    let (line, at) = (number.line, number.at);
    let begin = line[..at].char_indices().rev().nth(40).map_or(0, |(at, _)| at);
    let end = line[at..].char_indices().nth(40).map_or(line.len(), |(end, _)| at + end);
    &line[begin..end]
}

#[cfg(test)]
mod tests;
