//! A configuration as it was written: values with the places they stand at.

use super::{Problem, join};
use crate::bounds::{Bound, CONFIGURATION_BYTES, CONFIGURATION_VALUES, NESTING, TABLE_KEYS};
use std::borrow::Cow;
use std::ops::Range;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// A value and where it stands in the text. No span: it came from elsewhere, such as the command line.
#[derive(Clone, Debug, PartialEq)]
pub struct Node {
    /// The value.
    pub value: Value,
    /// Bytes of the text.
    pub span: Option<Range<usize>>,
}

/// What can be written.
#[derive(Clone, Debug, PartialEq)]
pub enum Value {
    /// `true` or `false`.
    Bool(bool),
    /// A whole number.
    Integer(i64),
    /// A number with a point, an exponent, or one of TOML's `nan` and `inf`.
    Number(f64),
    /// A text.
    Text(String),
    /// A date or time, or a whole number beyond 64 bits: nothing here takes one.
    Other(String),
    /// A list.
    List(Vec<Node>),
    /// A table, in the order written: key, where the key stands, value.
    Table(Vec<(String, Option<Range<usize>>, Node)>),
}

/// Reads TOML text.
///
/// # Errors
///
/// Every syntax error, with its place; or the [bound](crate::bounds) that the text exceeds.
pub fn parse(text: &str) -> Result<Node, Vec<Problem>> {
    bounded(text).map_err(|problem| vec![problem])?;
    let (table, errors) = DeTable::parse_recoverable(text);
    if errors.is_empty() {
        let span = table.span();
        let value =
            table_value(table.get_ref(), span.clone(), 0).map_err(|problem| vec![problem])?;
        Ok(Node { value, span: Some(span) })
    } else {
        Err(errors
            .into_iter()
            .map(|error| Problem {
                span: error.span(),
                ..Problem::new("", format!("is not TOML: {}", error.message().trim()))
            })
            .collect())
    }
}

impl Node {
    /// An empty table.
    #[must_use]
    pub fn empty_table() -> Self {
        Self { value: Value::Table(Vec::new()), span: None }
    }

    /// The entry of a table under `key`.
    #[must_use]
    pub fn get(&self, key: &str) -> Option<&Self> {
        match &self.value {
            Value::Table(entries) => {
                entries.iter().find(|(k, ..)| k == key).map(|(_, _, node)| node)
            }
            _ => None,
        }
    }

    /// Removes and returns the entry of a table under `key`.
    pub fn take(&mut self, key: &str) -> Option<Self> {
        match &mut self.value {
            Value::Table(entries) => {
                let index = entries.iter().position(|(k, ..)| k == key)?;
                Some(entries.remove(index).2)
            }
            _ => None,
        }
    }

    /// Sets the value at a dotted path (`netsim.phy.effect[0].sd_db`), creating tables on the way. Entries of lists must
    /// exist.
    ///
    /// # Errors
    ///
    /// Where a part of the path is not what the path takes it for.
    pub fn set(&mut self, path: &str, value: Value) -> Result<(), Problem> {
        let mut node = self;
        let mut walked = String::new();
        let mut parts = path.split('.').peekable();
        while let Some(part) = parts.next() {
            let (key, indices) = split_indices(part).ok_or_else(|| {
                Problem::new(path, "is not a path of a key; write a.b or a.b[0].c")
            })?;
            if let Value::List(_) = node.value {
                return Err(Problem::new(
                    walked,
                    "is a list; give the index of an entry, as in key[0]",
                ));
            }
            let Value::Table(entries) = &mut node.value else {
                return Err(Problem::new(walked, "is not a table"));
            };
            walked = join(&walked, key);
            let index = entries.iter().position(|(k, ..)| k == key).unwrap_or_else(|| {
                entries.push((key.to_owned(), None, Self::empty_table()));
                entries.len() - 1
            });
            // What is set from elsewhere does not stand where the text had it.
            entries[index].1 = entries[index].1.take().filter(|_| parts.peek().is_some());
            node = &mut entries[index].2;
            for index in indices {
                let Value::List(list) = &mut node.value else {
                    return Err(Problem::new(walked, "is not a list"));
                };
                let n = list.len();
                node = list.get_mut(index).ok_or_else(|| {
                    Problem::new(
                        &walked,
                        format!("has {n} entries, so entry [{index}] does not exist"),
                    )
                })?;
                walked = format!("{walked}[{index}]");
            }
        }
        *node = Self { value, span: None };
        Ok(())
    }

    /// Where the key or entry at a path stands. For a path that does not exist, where its nearest parent stands, unless
    /// that is the whole text.
    #[must_use]
    pub fn span_of(&self, path: &str) -> Option<Range<usize>> {
        let mut node = self;
        let mut found = None;
        for part in path.split('.') {
            let (key, indices) = split_indices(part)?;
            let Value::Table(entries) = &node.value else { return found };
            let Some((_, key_span, child)) = entries.iter().find(|(k, ..)| k == key) else {
                return found;
            };
            found = match (key_span, &child.span) {
                (Some(key_span), Some(value_span)) if key_span.start <= value_span.start => {
                    match child.value {
                        Value::Table(_) | Value::List(_) => Some(key_span.clone()),
                        _ => Some(key_span.start..value_span.end),
                    }
                }
                (key_span, value_span) => key_span.clone().or_else(|| value_span.clone()),
            };
            node = child;
            for index in indices {
                let Value::List(list) = &node.value else { return found };
                let Some(child) = list.get(index) else { return found };
                found = child.span.clone().or(found);
                node = child;
            }
        }
        found
    }

    /// What stands at a dotted path.
    #[must_use]
    pub fn at(&self, path: &str) -> Option<&Self> {
        let mut node = self;
        for part in path.split('.') {
            let (key, indices) = split_indices(part)?;
            node = node.get(key)?;
            for index in indices {
                let Value::List(list) = &node.value else { return None };
                node = list.get(index)?;
            }
        }
        Some(node)
    }

    /// The same without what stands at a dotted path, be it a key of a table or an entry of a list.
    #[must_use]
    pub fn without(&self, path: &str) -> Self {
        let mut node = self.clone();
        let (parent, key) = match path.rsplit_once('.') {
            Some((parent, key)) => (node.at_mut(parent), key),
            None => (Some(&mut node), path),
        };
        match (parent, key.strip_suffix(']').and_then(|key| key.rsplit_once('['))) {
            (Some(parent), None) => _ = parent.take(key),
            (Some(parent), Some((list, index))) => {
                if let (Some(Self { value: Value::List(list), .. }), Ok(index)) =
                    (parent.at_mut(list), index.parse::<usize>())
                    && index < list.len()
                {
                    list.remove(index);
                }
            }
            (None, _) => {}
        }
        node
    }

    /// What stands at a dotted path.
    pub fn at_mut(&mut self, path: &str) -> Option<&mut Self> {
        let mut node = self;
        for part in path.split('.') {
            let (key, indices) = split_indices(part)?;
            let Value::Table(entries) = &mut node.value else { return None };
            node = entries.iter_mut().find(|(k, ..)| k == key).map(|(_, _, node)| node)?;
            for index in indices {
                let Value::List(list) = &mut node.value else { return None };
                node = list.get_mut(index)?;
            }
        }
        Some(node)
    }

    /// Whether there is something at a path that does not stand in the text.
    #[must_use]
    pub fn is_set_from_elsewhere(&self, path: &str) -> bool {
        self.at(path).is_some_and(|node| node.span.is_none())
    }

    /// The value as plain TOML.
    #[must_use]
    pub fn to_toml(&self) -> toml::Value {
        match &self.value {
            Value::Bool(value) => toml::Value::Boolean(*value),
            Value::Integer(value) => toml::Value::Integer(*value),
            Value::Number(value) => toml::Value::Float(*value),
            Value::Text(value) | Value::Other(value) => toml::Value::String(value.clone()),
            Value::List(list) => toml::Value::Array(list.iter().map(Self::to_toml).collect()),
            Value::Table(entries) => toml::Value::Table(
                entries.iter().map(|(key, _, node)| (key.clone(), node.to_toml())).collect(),
            ),
        }
    }

    /// The value as a person would write it, shortened.
    #[must_use]
    pub fn show(&self) -> Cow<'static, str> {
        match &self.value {
            Value::Bool(value) => value.to_string().into(),
            Value::Integer(value) => value.to_string().into(),
            Value::Number(value) => format!("{value:?}").into(),
            Value::Text(value) => format!("{value:?}").into(),
            Value::Other(value) => value.clone().into(),
            Value::List(list) if list.len() <= 4 => {
                let entries: Vec<_> = list.iter().map(Self::show).collect();
                format!("[{}]", entries.join(", ")).into()
            }
            Value::List(list) => format!("a list of {}", list.len()).into(),
            Value::Table(_) => "a table".into(),
        }
    }
}

impl From<&toml::Value> for Value {
    fn from(value: &toml::Value) -> Self {
        let node = |value: &toml::Value| Node { value: value.into(), span: None };
        match value {
            toml::Value::Boolean(value) => Self::Bool(*value),
            toml::Value::Integer(value) => Self::Integer(*value),
            toml::Value::Float(value) => Self::Number(*value),
            toml::Value::String(value) => Self::Text(value.clone()),
            toml::Value::Datetime(value) => Self::Other(value.to_string()),
            toml::Value::Array(list) => Self::List(list.iter().map(node).collect()),
            toml::Value::Table(table) => Self::Table(
                table.iter().map(|(key, value)| (key.clone(), None, node(value))).collect(),
            ),
        }
    }
}

/// Refuses a text that would take too much memory, or too deep a recursion, to be parsed.
fn bounded(text: &str) -> Result<(), Problem> {
    let refused = |refusal: String| Problem::new("", refusal);
    CONFIGURATION_BYTES.check(text.len() as u64).map_err(refused)?;
    // Entries are separated by commas, keys stand on lines.
    let values = text.bytes().filter(|byte| matches!(byte, b',' | b'\n')).count() as u64;
    CONFIGURATION_VALUES.check(values).map_err(refused)?;
    let (mut parts, mut before) = (0, b'\n');
    for (at, byte) in text.bytes().enumerate() {
        match byte {
            b'.' if before != b'.' => parts += 1,
            b'.' | b'_' | b'-' | b' ' | b'\t' | b'"' | b'\'' => {}
            byte if byte.is_ascii_alphanumeric() => {}
            _ => parts = 0,
        }
        before = byte;
        if MOST_PARTS.most < parts {
            let refusal = MOST_PARTS.refusal(&format!("more than {}", MOST_PARTS.most));
            return Err(Problem { span: Some(at..at + 1), ..Problem::new("", refusal) });
        }
    }
    Ok(())
}

/// Parts of a dotted key. Each is a table within the one before.
const MOST_PARTS: Bound = Bound { what: "number of dots in a key", most: 16 };

fn table_value(table: &DeTable<'_>, span: Range<usize>, depth: u64) -> Result<Value, Problem> {
    let refused =
        |refusal: String| Problem { span: Some(span.clone()), ..Problem::new("", refusal) };
    NESTING.check(depth).map_err(refused)?;
    TABLE_KEYS.check(table.len() as u64).map_err(refused)?;
    let mut entries = table
        .iter()
        .map(|(key, value)| {
            Ok((key.get_ref().to_string(), Some(key.span()), node_of(value, depth + 1)?))
        })
        .collect::<Result<Vec<_>, Problem>>()?;
    entries.sort_by_key(|(_, span, _)| span.as_ref().map(|span| span.start));
    Ok(Value::Table(entries))
}

fn node_of(value: &Spanned<DeValue<'_>>, depth: u64) -> Result<Node, Problem> {
    let converted = match value.get_ref() {
        DeValue::Boolean(value) => Value::Bool(*value),
        DeValue::Integer(number) => i64::from_str_radix(number.as_str(), number.radix())
            .map_or_else(|_| Value::Other(number.as_str().to_owned()), Value::Integer),
        DeValue::Float(number) => number
            .as_str()
            .parse()
            .map_or_else(|_| Value::Other(number.as_str().to_owned()), Value::Number),
        DeValue::String(text) => Value::Text(text.to_string()),
        DeValue::Datetime(datetime) => Value::Other(datetime.to_string()),
        DeValue::Array(list) => Value::List(
            list.iter().map(|entry| node_of(entry, depth + 1)).collect::<Result<_, _>>()?,
        ),
        DeValue::Table(table) => table_value(table, value.span(), depth)?,
    };
    Ok(Node { value: converted, span: Some(value.span()) })
}

/// `effect[0][1]` → `effect`, 0, 1.
fn split_indices(part: &str) -> Option<(&str, Vec<usize>)> {
    let (key, rest) = part.split_once('[').map_or((part, None), |(key, rest)| (key, Some(rest)));
    let indices = match rest {
        None => Vec::new(),
        Some(rest) => {
            rest.strip_suffix(']')?.split("][").map(str::parse).collect::<Result<_, _>>().ok()?
        }
    };
    (!key.is_empty()).then_some((key, indices))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_value_set_by_path_is_found_by_path() {
        let mut node = parse("[a]\nb = 1\n[[a.c]]\nd = 2\n").unwrap();
        node.set("a.c[0].d", Value::Integer(3)).unwrap();
        node.set("x.y", Value::Bool(true)).unwrap();
        assert_eq!(node.get("a").unwrap().get("c").unwrap().show(), "[a table]");
        assert_eq!(node.get("x").unwrap().get("y").unwrap().value, Value::Bool(true));
        assert_eq!(node.set("a.c.d", Value::Integer(0)).unwrap_err().path, "a.c");
        assert_eq!(node.set("a.b.e", Value::Integer(0)).unwrap_err().path, "a.b");
    }

    #[test]
    fn a_key_or_an_entry_is_taken_out_by_its_path() {
        let node = parse("[a]\nb = 1\n[[a.c]]\nd = 2\n[[a.c]]\nd = 3\n").unwrap();
        assert_eq!(node.without("a.b").at("a.b"), None);
        assert_eq!(node.without("a.c[0]").at("a.c[0].d").unwrap().show(), "3");
        assert_eq!(node.without("a.c[1].d").at("a.c[1].d"), None);
        for absent in ["x", "a.x.y", "a.c[2]", "a.b[0]"] {
            assert_eq!(node.without(absent), node, "{absent}");
        }
    }

    #[test]
    fn a_text_beyond_a_bound_is_refused_before_it_takes_memory_or_stack() {
        let problem = |text: String| parse(&text).unwrap_err()[0].to_string();
        let heights = format!("h = [{}]", "1,".repeat(2_000_001));
        assert_eq!(
            problem(heights),
            "the number of values in a configuration is 2000001; at most 2000000 is read"
        );
        let keys: String = (0..40_000).map(|key| format!("k{key} = 1\n")).collect();
        assert_eq!(
            problem(format!("[netsim]\n{keys}")),
            "the number of keys in one table is 40000; at most 2000 is read"
        );
        let deep = format!("{}x = 1", "a.".repeat(100_000));
        assert!(problem(deep).contains("number of dots in a key is more than 16"));
        let dotted = "{".to_owned() + &"a.a.a.a = {".repeat(40) + &"}".repeat(41);
        assert!(problem(format!("t = {dotted}")).contains("depth of tables and lists is 65"));
        assert!(problem("[".repeat(100_000)).contains("is not TOML"));
        assert!(parse(&format!("# {}\na = [1.5, 2.5]", ".".repeat(100))).is_ok());
    }

    #[test]
    fn a_span_covers_key_and_value() {
        let text = "[a]\nb = 12\n[[a.c]]\nd = 2\n[[a.c]]\nd = 5\n";
        let node = parse(text).unwrap();
        assert_eq!(&text[node.span_of("a.b").unwrap()], "b = 12");
        assert_eq!(&text[node.span_of("a.c[1].d").unwrap()], "d = 5");
        // A key that is missing: where its table begins.
        assert!(node.span_of("a.missing").is_some());
        assert_eq!(node.span_of("missing"), None);
    }
}
