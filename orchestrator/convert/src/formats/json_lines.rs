//! JSON: an object on each line, or a list of objects. Fields of objects within objects have the names of both, with a point between.

use super::{Format, Row, Rows, UNCHECKED, refused};
use measure::DataError;
use measure::formats::{Content, Uncounted};
use measure::memory::Memory;
use proto::bounds::{COLUMNS, LINE_BYTES, TABLE_BYTES};
use proto::config::{Section, variant};
use serde_json::{Map, Value};
use std::collections::{BTreeMap, VecDeque};
use std::io::{BufRead as _, Read as _};
use std::path::{Path, PathBuf};

/// The format.
pub const FORMAT: Format =
    Format { variant: variant::<Keys>("json-lines"), columns: &[], check: UNCHECKED, open };

/// An object of JSON on each line, or one list of objects, plain or gzipped; `a.b` is the field b of the object a.
#[derive(Section)]
struct Keys {
    /// A list in each object: every entry makes a row, with the fields of the object beside those of the entry.
    each: Option<String>,
}

/// So many objects are looked at for the names of their fields. Fields that only later ones have are not read.
const NAMING: usize = 1000;
/// What a byte of JSON takes once it is read (bytes).
const BYTES_OF_BYTE: u64 = 8;

fn open<'a>(
    path: &Path,
    content: Content<'a>,
    keys: &toml::Table,
) -> Result<Box<dyn Rows + 'a>, DataError> {
    let (mut content, memory) = content.uncounted();
    let failed = |source| DataError::Read { path: path.to_owned(), source };
    let begin = content.fill_buf().map_err(failed)?.trim_ascii_start().first().copied();
    let mut rows = JsonRows {
        content,
        path: path.to_owned(),
        memory,
        line: 0,
        text: Vec::new(),
        ahead: VecDeque::new(),
        names: Vec::new(),
        each: Keys::read(keys).each,
    };
    if begin == Some(b'[') {
        rows.read_list()?;
    }
    let mut places: BTreeMap<String, usize> = BTreeMap::new();
    for number in 0..NAMING {
        while rows.ahead.len() <= number {
            if begin == Some(b'[') || !rows.read_ahead()? {
                break;
            }
        }
        if rows.ahead.len() <= number {
            break;
        }
        if let Some((_, Ok(fields))) = rows.ahead.get(number) {
            for name in fields.keys() {
                let next = places.len();
                places.entry(name.clone()).or_insert(next);
            }
        }
        COLUMNS.check(places.len() as u64).map_err(|refusal| refused(path, refusal))?;
    }
    if places.is_empty() {
        return Err(refused(path, "has no object of JSON, whose fields would be the columns"));
    }
    let mut names: Vec<(usize, String)> =
        places.into_iter().map(|(name, place)| (place, name)).collect();
    names.sort_unstable();
    rows.names = names.into_iter().map(|(_, name)| name).collect();
    Ok(Box::new(rows))
}

/// The fields of an object, as text; or why it has none.
type Fields = Result<BTreeMap<String, String>, String>;

struct JsonRows<'a> {
    content: Uncounted<'a>,
    path: PathBuf,
    memory: Memory,
    line: usize,
    text: Vec<u8>,
    /// Lines that were read ahead.
    ahead: VecDeque<(usize, Fields)>,
    names: Vec<String>,
    each: Option<String>,
}

impl JsonRows<'_> {
    /// Reads the next line that is not empty. Returns whether there is one.
    fn read_ahead(&mut self) -> Result<bool, DataError> {
        loop {
            self.text.clear();
            let n = (&mut self.content)
                .take(LINE_BYTES.most + 1)
                .read_until(b'\n', &mut self.text)
                .map_err(|source| DataError::Read { path: self.path.clone(), source })?;
            if n == 0 {
                return Ok(false);
            }
            self.line += 1;
            LINE_BYTES
                .check(n as u64)
                .map_err(|refusal| refused(&self.path, format!("line {}: {refusal}", self.line)))?;
            if self.text.trim_ascii().is_empty() {
                continue;
            }
            match serde_json::from_slice::<Map<String, Value>>(&self.text) {
                Ok(object) => self.add(self.line, object),
                Err(_) => {
                    let problem = "the line is no object of JSON".to_owned();
                    self.ahead.push_back((self.line, Err(problem)));
                }
            }
            if !self.ahead.is_empty() {
                return Ok(true);
            }
        }
    }

    /// Reads a list of objects. Its rows are counted from 1: they may stand on any lines.
    fn read_list(&mut self) -> Result<(), DataError> {
        let content = (&mut self.content).take(self.memory.left().0 / BYTES_OF_BYTE + 1);
        let text = TABLE_BYTES
            .read(content)
            .map_err(|source| DataError::Read { path: self.path.clone(), source })?;
        let failed = |message: String| refused(&self.path, message);
        let what = format_args!("{} bytes of JSON", text.len());
        self.memory.take(BYTES_OF_BYTE * text.len() as u64, what).map_err(failed)?;
        let list: Vec<Value> = serde_json::from_slice(&text).map_err(|error| {
            let place = format!("line {}, column {}", error.line(), error.column());
            refused(&self.path, format!("{place}: is no list of objects of JSON"))
        })?;
        for (number, value) in (1..).zip(list) {
            match value {
                Value::Object(object) => self.add(number, object),
                _ => self.ahead.push_back((number, Err("the entry is no object".to_owned()))),
            }
        }
        Ok(())
    }

    /// Adds the row of an object, or those of the entries of its list.
    fn add(&mut self, line: usize, mut object: Map<String, Value>) {
        let Some(name) = &self.each else {
            self.ahead.push_back((line, Ok(flat(&object))));
            return;
        };
        let Some(Value::Array(entries)) = object.remove(name) else { return };
        let shared = flat(&object);
        for entry in entries {
            let mut fields = shared.clone();
            let entry = Map::from_iter([(name.clone(), entry)]);
            fields.extend(flat(&entry));
            self.ahead.push_back((line, Ok(fields)));
        }
    }
}

/// Fields of an object and of the objects in it, as text.
fn flat(object: &Map<String, Value>) -> BTreeMap<String, String> {
    fn add(prefix: &str, value: &Value, fields: &mut BTreeMap<String, String>) {
        let text = match value {
            Value::Object(object) => {
                for (name, value) in object {
                    add(&format!("{prefix}.{name}"), value, fields);
                }
                return;
            }
            Value::Array(list) => {
                for (number, value) in list.iter().enumerate() {
                    add(&format!("{prefix}.{number}"), value, fields);
                }
                return;
            }
            Value::Null => String::new(),
            Value::String(text) => text.clone(),
            Value::Bool(_) | Value::Number(_) => value.to_string(),
        };
        fields.insert(prefix.to_owned(), text);
    }
    let mut fields = BTreeMap::new();
    for (name, value) in object {
        add(name, value, &mut fields);
    }
    fields
}

impl Rows for JsonRows<'_> {
    fn names(&self) -> &[String] {
        &self.names
    }

    fn next(&mut self, row: &mut Row) -> Result<bool, DataError> {
        if self.ahead.is_empty() && !self.read_ahead()? {
            return Ok(false);
        }
        let Some((line, fields)) = self.ahead.pop_front() else { return Ok(false) };
        row.line = line;
        row.fields.clear();
        row.problem = None;
        match fields {
            Ok(fields) => {
                let field = |name| fields.get(name).map_or("", String::as_str);
                self.names.iter().for_each(|name| row.fields.push_field(field(name)));
            }
            Err(problem) => row.problem = Some(problem),
        }
        Ok(true)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use measure::memory::MemoryBudget;

    /// Names of the fields; and of each row its line, and its fields or why it has none.
    type Read = (Vec<String>, Vec<(usize, String)>);

    fn rows(text: &str) -> Result<Read, String> {
        rows_of(text, None)
    }

    fn rows_of(text: &str, each: Option<&str>) -> Result<Read, String> {
        let keys = each.map(|each| ("each".to_owned(), each.into()));
        let content = Content::new(text.as_bytes(), MemoryBudget::default());
        let mut rows = open(Path::new("log.jsonl"), content, &toml::Table::from_iter(keys))
            .map_err(|error| error.to_string())?;
        let (mut row, mut read) = (Row::default(), Vec::new());
        while rows.next(&mut row).map_err(|error| error.to_string())? {
            let fields: Vec<&str> = row.fields.iter().collect();
            read.push((row.line, row.problem.take().unwrap_or_else(|| fields.join("|"))));
        }
        Ok((rows.names().to_vec(), read))
    }

    #[test]
    fn lines_and_lists_of_objects_are_rows_with_flat_names() {
        let text = "{\"t\": 1.5, \"pose\": {\"x\": 2, \"q\": [0, 1]}}\n\nnonsense\n{\"t\": 2, \"id\": \"a\"}\n";
        let (names, read) = rows(text).unwrap();
        assert_eq!(names, ["pose.q.0", "pose.q.1", "pose.x", "t", "id"]);
        let expected = [
            (1, "0|1|2|1.5|".to_owned()),
            (3, "the line is no object of JSON".to_owned()),
            (4, "|||2|a".to_owned()),
        ];
        assert_eq!(read, expected);
        let (names, read) = rows("[{\"t\": 1},\n {\"t\": null}]").unwrap();
        assert_eq!(names, ["t"]);
        assert_eq!(read, [(1, "1".to_owned()), (2, String::new())]);
    }

    #[test]
    fn each_entry_of_a_list_makes_a_row() {
        let text = "{\"f\": 1, \"rx\": [{\"id\": \"a\", \"rssi\": -70}, {\"id\": \"b\", \"rssi\": -80}]}\n{\"f\": 2, \"rx\": []}\n\
                    {\"f\": 3, \"rx\": [{\"id\": \"a\", \"rssi\": -71}]}\n";
        let (names, read) = rows_of(text, Some("rx")).unwrap();
        assert_eq!(names, ["f", "rx.id", "rx.rssi"]);
        let expected =
            [(1, "1|a|-70".to_owned()), (1, "1|b|-80".to_owned()), (3, "3|a|-71".to_owned())];
        assert_eq!(read, expected);
    }

    #[test]
    fn what_has_no_object_is_refused() {
        assert!(rows("1\n2\n").unwrap_err().contains("no object of JSON"));
        assert!(rows("[{\"t\": 1}, ").unwrap_err().contains("line 1, column"));
    }
}
