//! The keys of the configurations that differ between the runs.
//!
//! Thousands of runs have nearly the same keys and values: each text is held once.

use serde_json::{Map, Value};
use std::collections::{BTreeMap, BTreeSet};

/// Keys of one configuration that are looked at: of a swarm whose robots have a table each there are more.
const MOST_KEYS: usize = 1000;
/// Keys that differ, at most, in the order of their names.
pub(crate) const MOST_COLUMNS: usize = 200;
/// A list or a text that is longer is cut off (characters).
const MOST_CHARACTERS: usize = 120;

/// Numbers of keys and of their values.
pub(crate) type Numbered = Vec<(u32, u32)>;

/// The texts, each with a number.
#[derive(Debug, Default)]
pub(crate) struct Texts {
    numbers: BTreeMap<String, u32>,
    texts: Vec<String>,
    values: BTreeMap<u32, Value>,
}

impl Texts {
    pub(crate) fn number(&mut self, text: &str) -> u32 {
        if let Some(&number) = self.numbers.get(text) {
            return number;
        }
        let number = u32::try_from(self.texts.len()).unwrap_or(u32::MAX);
        self.numbers.insert(text.to_owned(), number);
        self.texts.push(text.to_owned());
        number
    }

    /// The numbers of the keys and values of a run.
    pub(crate) fn numbered(&mut self, settings: &[(String, toml::Value)]) -> Numbered {
        let settings = settings.iter().take(MOST_KEYS);
        settings
            .map(|(key, value)| {
                let number = self.number(&value.to_string());
                self.values.entry(number).or_insert_with(|| shown(value));
                (self.number(key), number)
            })
            .collect()
    }

    /// The keys that some runs have with different values, or some have and others lack.
    ///
    /// `varied` are the keys that sweeps vary, which differ as well.
    pub(crate) fn differing<'a>(
        &self,
        runs: impl IntoIterator<Item = &'a Numbered>,
        varied: &BTreeSet<u32>,
    ) -> BTreeSet<u32> {
        let mut n_runs = 0;
        // Of each key: how many runs have it, one of its values, and whether there is another.
        let mut by_key: BTreeMap<u32, (usize, u32, bool)> = BTreeMap::new();
        for settings in runs {
            n_runs += 1;
            for &(key, value) in settings {
                let (n, one, differs) = by_key.entry(key).or_insert((0, value, false));
                *n += 1;
                *differs |= *one != value;
            }
        }
        let differ = by_key
            .into_iter()
            .filter(|(key, (n, _, differs))| *differs || *n < n_runs || varied.contains(key));
        let mut keys: Vec<u32> = differ.map(|(key, _)| key).collect();
        keys.sort_by_key(|&key| self.text(key));
        keys.into_iter().take(MOST_COLUMNS).collect()
    }

    /// The values of some keys.
    pub(crate) fn values(&self, settings: &Numbered, keys: &BTreeSet<u32>) -> Map<String, Value> {
        let chosen = settings.iter().filter(|(key, _)| keys.contains(key));
        chosen
            .map(|(key, value)| {
                (self.text(*key).to_owned(), self.values.get(value).cloned().unwrap_or_default())
            })
            .collect()
    }

    fn text(&self, number: u32) -> &str {
        self.texts.get(number as usize).map_or("", String::as_str)
    }
}

/// A value as the page has it: numbers and truth values as such, of the rest the text.
pub(crate) fn shown(value: &toml::Value) -> Value {
    let cut = |text: &str| {
        let mut cut: String = text.chars().take(MOST_CHARACTERS).collect();
        if cut.len() < text.len() {
            cut.push('…');
        }
        Value::String(cut)
    };
    match value {
        toml::Value::Integer(number) => Value::from(*number),
        toml::Value::Float(number) if number.is_finite() => Value::from(*number),
        toml::Value::Boolean(is) => Value::from(*is),
        toml::Value::String(text) => cut(text),
        other => cut(&other.to_string()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_differ_that_have_several_values_or_that_some_runs_lack() {
        let mut texts = Texts::default();
        let mut runs = Vec::new();
        for config in [
            "a.x = 1\na.y = 2.5\nb = \"one\"\nlist = [1, 2]",
            "a.x = 1\na.y = 3\nb = \"one\"\nlist = [1, 2]",
            "a.x = 1\na.y = 2.5\nb = \"one\"\nlist = [1, 3]\nc = true",
        ] {
            let settings: toml::Table = config.parse().unwrap();
            let settings: Vec<_> =
                sweep::compare_runs::values_by_key(&settings).into_iter().collect();
            runs.push(texts.numbered(&settings));
        }
        let keys = texts.differing(&runs, &BTreeSet::new());
        let values: Vec<String> =
            runs.iter().map(|run| Value::Object(texts.values(run, &keys)).to_string()).collect();
        assert_eq!(values[0], "{\"a.y\":2.5,\"list\":\"[1, 2]\"}");
        assert_eq!(values[1], "{\"a.y\":3,\"list\":\"[1, 2]\"}");
        assert_eq!(values[2], "{\"a.y\":2.5,\"c\":true,\"list\":\"[1, 3]\"}");
        assert!(texts.differing(&runs[..1], &BTreeSet::new()).is_empty());
        // A key that a sweep varies.
        let key = texts.number("b");
        assert_eq!(texts.differing(&runs[..1], &BTreeSet::from([key])), BTreeSet::from([key]));
    }
}
