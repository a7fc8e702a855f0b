//! Checks a configuration as written against its description.

use super::{
    ClusterLine, Default, Field, FilePath, Key as _, Kind, Lists, Node, Problem, Program,
    TableSpec, Url, Value, Variant, join, most_similar,
};

/// A table that was checked.
#[derive(Clone, Debug, PartialEq)]
pub struct Checked {
    /// The effective table: defaults filled in, keys in the order of their description. Where there were problems,
    /// something valid stands in their place, so that checks across keys can still be made.
    pub table: toml::Table,
    /// What it names outside of itself, in the order in which it was checked.
    pub touches: Vec<Touch>,
}

/// Something outside a configuration that one of its keys names.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Touch {
    /// Path of the key.
    pub key: String,
    /// What it names, as written.
    pub target: TouchTarget,
}

/// What a key may name outside its configuration.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum TouchTarget {
    /// A file that is read.
    File(FilePath),
    /// A program that is started.
    Program(Program),
    /// A program elsewhere that is called.
    Url(Url),
    /// A line that a batch system executes or obeys.
    ClusterLine(ClusterLine),
}

impl TouchTarget {
    /// What a checked value of a kind names; `None`: nothing.
    fn of(kind: &Kind, value: &toml::Value) -> Option<Self> {
        match kind {
            Kind::File => FilePath::from_value(value).map(Self::File),
            Kind::Program => Program::from_value(value).map(Self::Program),
            Kind::Url => Url::from_value(value).map(Self::Url),
            Kind::ClusterLine => ClusterLine::from_value(value).map(Self::ClusterLine),
            _ => None,
        }
    }
}

impl Checked {
    /// The files that it names.
    #[must_use]
    pub fn files(&self) -> Vec<FileReference> {
        let file = |touch: &Touch| match &touch.target {
            TouchTarget::File(file) => {
                Some(FileReference { key: touch.key.clone(), path: file.0.clone() })
            }
            _ => None,
        };
        self.touches.iter().filter_map(file).collect()
    }
}

/// A file that a configuration names.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FileReference {
    /// Path of the key.
    pub key: String,
    /// The file's path as written.
    pub path: String,
}

/// Checks the table `node`, which stands at `path`, against `spec`, adding every problem to `problems`.
///
/// * `lists`: those that tags of `spec` name; [`Lists::NONE`] where they name none.
///
/// # Panics
///
/// If `lists` lacks one of them.
pub fn check(
    node: &Node,
    path: &str,
    spec: &TableSpec,
    lists: &Lists,
    problems: &mut Vec<Problem>,
) -> Checked {
    let mut walk = Walk { problems, lists, touches: Vec::new() };
    let table = match &node.value {
        Value::Table(_) => walk.table(Some(node), path, spec),
        _ => {
            walk.problems.push(Problem::new(path, "must be a table").value(node.show()));
            walk.table(None, path, spec)
        }
    };
    Checked { table, touches: walk.touches }
}

struct Walk<'a> {
    problems: &'a mut Vec<Problem>,
    lists: &'a Lists,
    touches: Vec<Touch>,
}

impl Walk<'_> {
    fn table(&mut self, node: Option<&Node>, path: &str, spec: &TableSpec) -> toml::Table {
        let lists = self.lists;
        let variants = spec.tag.map_or(&[][..], |tag| tag.variants(lists));
        let mut table = toml::Table::new();
        let mut selected: Option<Variant> = None;
        if let Some(tag) = spec.tag {
            let names = || variants.iter().map(|variant| variant.name);
            let listed = || names().map(|name| format!("{name:?}")).collect::<Vec<_>>().join(", ");
            let tag_path = join(path, tag.key);
            let written = node.and_then(|node| node.get(tag.key));
            let name = match written.map(|node| (&node.value, node)) {
                None => tag.default.or_else(|| {
                    self.problems
                        .push(Problem::new(tag_path, format!("is missing: one of {}", listed())));
                    None
                }),
                Some((Value::Text(name), node)) => {
                    let known = names().find(|known| known == name);
                    if known.is_none() {
                        let mut problem =
                            Problem::new(tag_path, format!("must be one of {}", listed()))
                                .value(node.show());
                        problem.nearest =
                            most_similar(name, names()).map(|name| format!("{name:?}"));
                        self.problems.push(problem);
                    }
                    known
                }
                Some((_, node)) => {
                    let message = format!("must be one of {}", listed());
                    self.problems.push(Problem::new(tag_path, message).value(node.show()));
                    None
                }
            };
            selected = variants.iter().find(|variant| Some(variant.name) == name).copied();
            if let Some(variant) = selected {
                table.insert(tag.key.to_owned(), toml::Value::String(variant.name.to_owned()));
            }
        }
        // Where the variant is not known, its keys cannot be judged.
        let unjudged = spec.tag.is_some() && selected.is_none();
        let own = selected.map_or(&[][..], |variant| variant.fields);
        for field in own.iter().chain(spec.fields) {
            let written = node.and_then(|node| node.get(field.key));
            if let Some(value) = self.field(written, &join(path, field.key), field, unjudged) {
                table.insert(field.key.to_owned(), value);
            }
        }
        if let Some(Value::Table(entries)) = node.map(|node| &node.value) {
            for (key, ..) in entries {
                let known = spec.tag.is_some_and(|tag| tag.key == key)
                    || own.iter().chain(spec.fields).any(|field| field.key == key);
                if !known {
                    self.unknown_key(key, path, spec, variants, selected.as_ref(), unjudged);
                }
            }
        }
        table
    }

    fn unknown_key(
        &mut self,
        key: &str,
        path: &str,
        spec: &TableSpec,
        variants: &[Variant],
        selected: Option<&Variant>,
        unjudged: bool,
    ) {
        let with: Vec<&str> = variants
            .iter()
            .filter(|variant| variant.fields.iter().any(|field| field.key == key))
            .map(|variant| variant.name)
            .collect();
        if unjudged && !with.is_empty() {
            return;
        }
        let problem = if let (Some(tag), Some(selected), false) =
            (spec.tag, selected, with.is_empty())
        {
            let with: Vec<String> = with.iter().map(|name| format!("{name:?}")).collect();
            Problem::new(
                join(path, key),
                format!(
                    "does not apply with {} = {:?}, only with {}",
                    tag.key,
                    selected.name,
                    with.join(", ")
                ),
            )
        } else {
            let known: Vec<&str> = spec
                .tag
                .map(|tag| tag.key)
                .into_iter()
                .chain(
                    selected
                        .map_or(&[][..], |variant| variant.fields)
                        .iter()
                        .map(|field| field.key),
                )
                .chain(spec.fields.iter().map(|field| field.key))
                .collect();
            let mut problem = Problem::new(join(path, key), "is not a known key");
            let nearest = synonym(key, &known).or_else(|| most_similar(key, known.iter().copied()));
            problem.nearest = nearest.map(str::to_owned);
            if problem.nearest.is_none() {
                problem.message = if known.is_empty() {
                    "is not a known key; this table has no keys".to_owned()
                } else {
                    format!("is not a known key; the keys are {}", known.join(", "))
                };
            }
            problem
        };
        self.problems.push(problem);
    }

    fn field(
        &mut self,
        written: Option<&Node>,
        path: &str,
        field: &Field,
        lenient: bool,
    ) -> Option<toml::Value> {
        let Some(node) = written else {
            return match field.default {
                Default::Required | Default::RequiredOrNone => {
                    if !lenient {
                        self.problems.push(Problem::new(
                            path,
                            format!("is missing: must be {}", field.kind.describe()),
                        ));
                    }
                    matches!(field.default, Default::Required).then(|| stand_in(&field.kind))?
                }
                Default::Absent => None,
                Default::Bool(value) => Some(toml::Value::Boolean(value)),
                Default::Integer(value) => Some(toml::Value::Integer(value)),
                Default::Number(value) => Some(toml::Value::Float(value)),
                Default::Text(value) => Some(toml::Value::String(value.to_owned())),
                Default::Table => match field.kind {
                    Kind::Table(spec) => Some(toml::Value::Table(self.table(None, path, spec))),
                    _ => unreachable!("{path}: only a table can have a table as default"),
                },
            };
        };
        match self.value(node, path, &field.kind) {
            Ok(value) => Some(value),
            Err(problem) => {
                self.problems.push(problem);
                // Stand-in, so that other checks go on.
                self.field(None, path, field, true)
            }
        }
    }

    fn value(&mut self, node: &Node, path: &str, kind: &Kind) -> Result<toml::Value, Problem> {
        let value = self.value_of_kind(node, path, kind)?;
        if let Some(target) = TouchTarget::of(kind, &value) {
            self.touches.push(Touch { key: path.to_owned(), target });
        }
        Ok(value)
    }

    fn value_of_kind(
        &mut self,
        node: &Node,
        path: &str,
        kind: &Kind,
    ) -> Result<toml::Value, Problem> {
        let wrong =
            || Problem::new(path, format!("must be {}", kind.describe())).value(node.show());
        match (kind, &node.value) {
            (Kind::Bool, Value::Bool(value)) => Ok(toml::Value::Boolean(*value)),
            (Kind::Integer { min, max }, Value::Integer(value)) => {
                if (min..=max).contains(&value) {
                    Ok(toml::Value::Integer(*value))
                } else {
                    Err(wrong().nearest(value.clamp(min, max)))
                }
            }
            (Kind::Number(range), Value::Integer(_) | Value::Number(_)) => {
                let number = match node.value {
                    Value::Integer(value) => value as f64,
                    Value::Number(value) => value,
                    _ => unreachable!("matched above"),
                };
                if range.contains(number) {
                    Ok(toml::Value::Float(number))
                } else {
                    let mut problem = Problem::new(
                        path,
                        if number.is_finite() {
                            format!("must be {}", range.describe())
                        } else {
                            format!(
                                "must be {}",
                                kind.describe().replace("a number", "a finite number")
                            )
                        },
                    )
                    .value(node.show());
                    problem.nearest =
                        range.nearest(number).filter(|n| n.is_finite()).map(|n| n.to_string());
                    Err(problem)
                }
            }
            (Kind::Text | Kind::File | Kind::Url | Kind::ClusterLine, Value::Text(text))
                if !text.is_empty() =>
            {
                Ok(toml::Value::String(text.clone()))
            }
            (Kind::Program, Value::List(_)) => self.value_of_kind(node, path, &Program::WORDS),
            (Kind::Choice(choices), Value::Text(text)) => {
                if choices.iter().any(|choice| choice.name == text) {
                    Ok(toml::Value::String(text.clone()))
                } else {
                    let mut problem = wrong();
                    problem.nearest = most_similar(text, choices.iter().map(|choice| choice.name))
                        .map(|name| format!("{name:?}"));
                    Err(problem)
                }
            }
            (Kind::List { of, min, max }, Value::List(list)) => {
                if !(min..=max).contains(&&list.len()) {
                    let entries = match (*min, *max) {
                        (1, 1) => "1 entry".to_owned(),
                        (1, usize::MAX) => "at least 1 entry".to_owned(),
                        (min, max) if min == max => format!("{min} entries"),
                        (min, usize::MAX) => format!("at least {min} entries"),
                        (min, max) => format!("{min} to {max} entries"),
                    };
                    return Err(
                        Problem::new(path, format!("must have {entries}")).value(node.show())
                    );
                }
                let mut converted = Vec::with_capacity(list.len());
                let mut last = None;
                for (index, entry) in list.iter().enumerate() {
                    match self.value(entry, &format!("{path}[{index}]"), of) {
                        Ok(value) => converted.push(value),
                        Err(problem) => self.problems.extend(last.replace(problem)),
                    }
                }
                last.map_or(Ok(toml::Value::Array(converted)), Err)
            }
            (Kind::Table(spec), Value::Table(_)) => {
                Ok(toml::Value::Table(self.table(Some(node), path, spec)))
            }
            (Kind::Tables(spec), Value::List(list)) => {
                let mut converted = Vec::with_capacity(list.len());
                for (index, entry) in list.iter().enumerate() {
                    let entry_path = format!("{path}[{index}]");
                    match entry.value {
                        Value::Table(_) => converted.push(toml::Value::Table(self.table(
                            Some(entry),
                            &entry_path,
                            spec,
                        ))),
                        _ => self
                            .problems
                            .push(Problem::new(entry_path, "must be a table").value(entry.show())),
                    }
                }
                Ok(toml::Value::Array(converted))
            }
            (Kind::Either(kinds), value) => {
                match kinds.iter().find(|kind| fits_by_type(kind, value)) {
                    Some(Kind::Choice(_)) => {
                        // A text that is no choice: all alternatives are named.
                        let fit = kinds.iter().filter(|kind| fits_by_type(kind, value));
                        let mut first = None;
                        for kind in fit {
                            match self.value(node, path, kind) {
                                Ok(value) => return Ok(value),
                                Err(problem) => first = first.or(Some(problem)),
                            }
                        }
                        Err(first.unwrap_or_else(wrong))
                    }
                    Some(kind) => self.value(node, path, kind),
                    None => Err(wrong()),
                }
            }
            (Kind::Anything, _) => Ok(node.to_toml()),
            _ => Err(wrong()),
        }
    }
}

/// Keys that say the same in different sections.
const SYNONYMS: [[&str; 2]; 1] = [["agents", "nodes"]];

/// The known key that says what an unknown one says elsewhere.
fn synonym<'a>(key: &str, known: &[&'a str]) -> Option<&'a str> {
    let pair = SYNONYMS.iter().find(|pair| pair.contains(&key))?;
    known.iter().copied().find(|other| pair.contains(other))
}

/// Some value of a kind, for a required key that has none: checks across keys can then still be made.
fn stand_in(kind: &Kind) -> Option<toml::Value> {
    match kind {
        Kind::Bool => Some(toml::Value::Boolean(false)),
        Kind::Integer { min, .. } => Some(toml::Value::Integer(*min)),
        Kind::Number(range) => [1.0, range.min, range.max, 0.0]
            .into_iter()
            .find(|&n| range.contains(n))
            .map(toml::Value::Float),
        Kind::Text | Kind::Url | Kind::ClusterLine => Some(toml::Value::String("?".to_owned())),
        Kind::Program => stand_in(&Program::WORDS),
        Kind::Choice(choices) => {
            choices.first().map(|choice| toml::Value::String(choice.name.to_owned()))
        }
        Kind::List { of, min, .. } => std::iter::repeat_n(stand_in(of), *min)
            .collect::<Option<Vec<_>>>()
            .map(toml::Value::Array),
        Kind::Either(kinds) => kinds.first().and_then(stand_in),
        Kind::File | Kind::Table(_) | Kind::Tables(_) | Kind::Anything => None,
    }
}

fn fits_by_type(kind: &Kind, value: &Value) -> bool {
    matches!(
        (kind, value),
        (Kind::Bool, Value::Bool(_))
            | (Kind::Integer { .. }, Value::Integer(_))
            | (Kind::Number(_), Value::Integer(_) | Value::Number(_))
            | (
                Kind::Text | Kind::File | Kind::Url | Kind::ClusterLine | Kind::Choice(_),
                Value::Text(_)
            )
            | (Kind::List { .. } | Kind::Program | Kind::Tables(_), Value::List(_))
            | (Kind::Table(_), Value::Table(_))
            | (Kind::Anything, _)
    )
}

#[cfg(test)]
mod tests;
