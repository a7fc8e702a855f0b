//! Keys that are written and have no influence, because of what other keys say.
//!
//! A simulator declares one list of [`Relation`]s beside the descriptions of its keys. [`idle_keys`] applies the list to a
//! configuration.

use super::{Node, Value, join};
use std::cell::OnceCell;

/// A relation between keys: where a condition holds, some keys influence no result.
#[derive(Clone, Copy, Debug)]
pub struct Relation<F> {
    /// The keys, as paths within the section. `a.*` stands for each key of the table `a`, `a[*]` for each entry of the list `a`.
    pub keys: &'static [&'static str],
    /// Those of them that keep their influence.
    pub except: &'static [&'static str],
    /// Why a key, given by its path, has no influence; `None`: it may have some.
    pub reason: fn(&F, &str) -> Option<Reason>,
}

/// Why a key has no influence, and what to do about it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Reason {
    /// The reason, a clause: `second_medium.payloads = "second" carries all payloads`.
    pub why: String,
    /// What to do, an imperative: `set second_medium.payloads = "both"`.
    pub instead: String,
}

impl Reason {
    /// A reason, and what to do about it.
    #[must_use]
    pub fn new(why: impl Into<String>, instead: impl Into<String>) -> Self {
        Self { why: why.into(), instead: instead.into() }
    }
}

/// A key that is written and has no influence.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct IdleKey {
    /// Its path, with that of the section.
    pub key: String,
    /// The warning about it.
    pub warning: String,
}

/// The keys of a section that are written and have no influence, in the order of the relations.
///
/// A key that the section cannot do without is not listed. Nor is a key at its default in a section that spells out all defaults: that
/// is the effective configuration of a run, in which nobody asked for the default.
///
/// * `written`: the section as written; `path`: where it stands.
/// * `effective`: fills in the defaults of a section, and lists the paths of the keys with problems.
pub fn idle_keys<F>(
    relations: &[Relation<F>],
    facts: &F,
    (written, path): (&Node, &str),
    effective: impl Fn(&Node) -> (toml::Table, Vec<String>),
) -> Vec<IdleKey> {
    let mut found: Vec<IdleKey> = Vec::new();
    // Of most sections nothing is idle, and reading one may take long.
    let as_written = OnceCell::new();
    let as_written = || {
        as_written.get_or_init(|| {
            let table = effective(written).0;
            let is_spelled_out = is_contained(&table.clone().into(), &written.to_toml());
            (table, is_spelled_out)
        })
    };
    for relation in relations {
        let keys = relation.keys.iter().flat_map(|pattern| written_keys(written, pattern));
        for key in keys.filter(|key| !relation.except.contains(&key.as_str())) {
            let full = join(path, &key);
            if found.iter().any(|idle| idle.key == full) {
                continue;
            }
            let Some(Reason { why, instead }) = (relation.reason)(facts, &key) else { continue };
            let (without, problems) = effective(&written.without(&key));
            if problems.contains(&key) {
                continue;
            }
            let (with, is_spelled_out) = as_written();
            let value = toml_at(with, &key);
            let is_default = value.is_some() && toml_at(&without, &key) == value;
            if is_default && *is_spelled_out {
                continue;
            }
            let kind = written.at(&key).filter(|_| key.ends_with(']')).and_then(kind_of);
            let kind = kind.map_or_else(String::new, |kind| format!(" ({kind})"));
            let warning = format!("{full}{kind} has no influence: {why}; {instead}");
            found.push(IdleKey { key: full, warning });
        }
    }
    found
}

/// The paths of what is written and a pattern stands for.
fn written_keys(written: &Node, pattern: &str) -> Vec<String> {
    let list = pattern.strip_suffix("[*]");
    let table = pattern.strip_suffix(".*");
    let value = |key: Option<&str>| key.and_then(|key| written.at(key)).map(|node| &node.value);
    match (value(list), value(table)) {
        (Some(Value::List(entries)), _) => {
            (0..entries.len()).map(|i| format!("{}[{i}]", list.unwrap_or_default())).collect()
        }
        (_, Some(Value::Table(entries))) => {
            let is_empty =
                |node: &Node| matches!(&node.value, Value::List(list) if list.is_empty());
            let written = entries.iter().filter(|(.., node)| !is_empty(node));
            written.map(|(key, ..)| join(table.unwrap_or_default(), key)).collect()
        }
        _ => written.at(pattern).map(|_| pattern.to_owned()).into_iter().collect(),
    }
}

fn kind_of(entry: &Node) -> Option<&str> {
    match &entry.get("kind")?.value {
        Value::Text(kind) => Some(kind),
        _ => None,
    }
}

fn toml_at<'a>(table: &'a toml::Table, path: &str) -> Option<&'a toml::Value> {
    let mut parts = path.split('.');
    let mut value = table.get(parts.next()?)?;
    for part in parts {
        value = value.get(part)?;
    }
    Some(value)
}

/// Whether all keys of `part` are in `whole`.
fn is_contained(part: &toml::Value, whole: &toml::Value) -> bool {
    match (part, whole) {
        (toml::Value::Table(part), toml::Value::Table(whole)) => part
            .iter()
            .all(|(key, part)| whole.get(key).is_some_and(|whole| is_contained(part, whole))),
        _ => true,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::{Lists, Section, TableSpec, check, parse};

    /// A section of a test.
    #[derive(Section)]
    #[expect(dead_code, reason = "read as a description only")]
    struct Keys {
        /// The mode.
        #[key(default = "plain")]
        mode: String,
        /// A power.
        #[key(default = 1.0)]
        power: f64,
        /// A name.
        #[key(required)]
        name: Option<String>,
    }

    const SPEC: TableSpec = Keys::SPEC;

    const RELATIONS: &[Relation<()>] = &[Relation {
        keys: &["power", "name", "mode"],
        except: &["mode"],
        reason: |(), _| Some(Reason::new("it is a test", "stop")),
    }];

    fn idle(text: &str) -> Vec<String> {
        let effective = |node: &Node| {
            let mut problems = Vec::new();
            let table = check(node, "", &SPEC, &Lists::NONE, &mut problems).table;
            (table, problems.into_iter().map(|problem| problem.path).collect())
        };
        let found = idle_keys(RELATIONS, &(), (&parse(text).unwrap(), "s"), effective);
        found.into_iter().map(|idle| idle.warning).collect()
    }

    #[test]
    fn a_key_is_named_if_it_is_written_and_can_be_left_out() {
        let warning = "s.power has no influence: it is a test; stop";
        assert_eq!(idle("name = \"a\"\npower = 2"), [warning]);
        // Its default, but somebody wrote it.
        assert_eq!(idle("name = \"a\"\npower = 1"), [warning]);
        assert_eq!(idle("name = \"a\"\nmode = \"plain\""), [""; 0]);
    }

    #[test]
    fn defaults_that_an_effective_configuration_spells_out_are_not_named() {
        assert_eq!(idle("mode = \"plain\"\npower = 1.0\nname = \"a\""), [""; 0]);
        assert_eq!(idle("mode = \"plain\"\npower = 2.0\nname = \"a\"").len(), 1);
    }
}
