//! What the page calls keys and figures. Of keys, words and units come from the names themselves, and explanations from the
//! descriptions that check configurations; of figures, all comes from the list of metrics.

use numbers::quantity;
use record::metric::{self, Robots, SHARE};
use serde_json::Value;

/// How people call a key or a figure.
#[derive(Clone, Debug, PartialEq)]
pub struct Name {
    /// In a few words, without a capital letter.
    pub words: String,
    /// Its unit; none of a share or a truth value, which are shown as per cent.
    pub unit: Option<&'static str>,
    /// Whether it is a share.
    pub is_share: bool,
    /// What it is, in one sentence or more, where that is known.
    pub explanation: Option<String>,
}

impl Name {
    /// Words and unit, as an axis shows them.
    #[must_use]
    pub fn label(&self) -> String {
        quantity::with_unit(&self.words, self.unit)
    }
}

/// The descriptions that names are looked up in.
#[derive(Debug)]
pub struct Catalogue {
    experiment: Value,
}

impl Catalogue {
    /// That of this program.
    #[must_use]
    pub fn of_program() -> Self {
        Self { experiment: experiment::schema() }
    }

    /// The name of a key of the configuration. `config`: the configuration that it is a key of, which decides between keys of the
    /// same name.
    #[must_use]
    pub fn key(&self, key: &str, config: &toml::Table) -> Name {
        let config = toml::Value::Table(config.clone());
        let path: Vec<&str> = key.split('.').map(without_index).collect();
        let found = find(&self.experiment, &self.experiment, &path, Some(&config));
        let explanation = found.and_then(explanation);
        let last = path.last().copied().unwrap_or(key);
        let short = explanation.as_deref().and_then(short_name);
        let words = short.unwrap_or_else(|| {
            let words = quantity::words(last);
            // One word alone, such as `law`, does not say whose.
            let table = path.iter().rev().nth(1).filter(|_| !words.contains(' '));
            table.map_or_else(
                || words.clone(),
                |table| format!("{} {words}", quantity::words(table)),
            )
        });
        Name { words, unit: quantity::unit(last), is_share: false, explanation }
    }

    /// How the field writes a value of a key of the configuration that is a choice, if its description begins with that: `MSF` of
    /// `msf`, which is described as "MSF, the minimal scheduling function".
    #[must_use]
    pub fn value(&self, key: &str, value: &str, config: &toml::Table) -> Option<String> {
        let config = toml::Value::Table(config.clone());
        let path: Vec<&str> = key.split('.').map(without_index).collect();
        let (last, table) = path.split_last()?;
        let at = |path: &[&str]| find(&self.experiment, &self.experiment, path, Some(&config));
        let is_value = |schema: &Value| schema.get("const").and_then(Value::as_str) == Some(value);
        // A tag chooses the table that it is in; a value of any other choice has a description of its own.
        let tables = at(table).into_iter().flat_map(alternatives).filter(|table| {
            table.get("properties").and_then(|keys| keys.get(last)).is_some_and(is_value)
        });
        let values = at(&path).into_iter().flat_map(alternatives).filter(|own| is_value(own));
        let text = tables.chain(values).find_map(explanation)?;
        let end = text.find([':', ','])?;
        let plain = |text: &str| text.replace(['-', ' '], "").to_lowercase();
        (plain(&text[..end]) == plain(value)).then(|| text[..end].to_owned())
    }
}

impl Name {
    /// That of the cases of a sweep.
    #[must_use]
    pub fn of_case() -> Self {
        Self { words: "case".to_owned(), unit: None, is_share: false, explanation: None }
    }

    /// That of a figure of a run, by short name or path in `summary.json`.
    #[must_use]
    pub fn of_figure(figure: &str) -> Self {
        let Some(metric) = metric::find(figure, Robots::Foreign) else {
            let words = quantity::words(figure);
            return Self { words, unit: None, is_share: false, explanation: None };
        };
        Self {
            unit: metric.axis_unit(),
            is_share: metric.unit == Some(SHARE),
            // Of which time a figure is stands after what it is.
            words: match metric.label.strip_prefix("since start ") {
                Some(what) => format!("{what} since the start"),
                None => metric.label,
            },
            explanation: Some(metric.meaning),
        }
    }
}

/// A part of a path without the number of an entry: `effect` of `effect[0]`.
fn without_index(part: &str) -> &str {
    part.split('[').next().unwrap_or(part)
}

fn explanation(schema: &Value) -> Option<String> {
    schema.get("description")?.as_str().map(str::to_owned)
}

/// The schemas of which a value satisfies one or several.
fn alternatives(schema: &Value) -> impl Iterator<Item = &Value> {
    let lists = ["oneOf", "anyOf"].iter().filter_map(|any| schema.get(any)?.as_array());
    lists.flatten()
}

/// The schema of what lies at a path below another.
fn find<'a>(
    root: &'a Value,
    schema: &'a Value,
    path: &[&str],
    config: Option<&toml::Value>,
) -> Option<&'a Value> {
    let Some((&first, rest)) = path.split_first() else { return Some(schema) };
    if let Some(name) = schema.get("$ref").and_then(Value::as_str) {
        return find(root, root.pointer(name.strip_prefix('#')?)?, path, config);
    }
    if let Some(items) = schema.get("items") {
        let entry = config.and_then(|config| config.as_array()?.first());
        return find(root, items, path, entry);
    }
    let mut alternatives: Vec<&Value> = alternatives(schema).collect();
    // The alternative that the configuration has chosen comes first.
    alternatives.sort_by_key(|alternative| !is_chosen(alternative, config));
    let own = schema.get("properties").and_then(|properties| properties.get(first));
    let own = own.and_then(|property| {
        find(root, property, rest, config.and_then(|config| config.get(first)))
    });
    own.or_else(|| alternatives.into_iter().find_map(|other| find(root, other, path, config)))
}

/// Whether a table is of the kind that this alternative describes.
fn is_chosen(alternative: &Value, config: Option<&toml::Value>) -> bool {
    let Some(properties) = alternative.get("properties").and_then(Value::as_object) else {
        return false;
    };
    properties.iter().any(|(key, property)| {
        let chosen = config.and_then(|config| config.get(key)?.as_str());
        property.get("const").and_then(Value::as_str).is_some_and(|kind| chosen == Some(kind))
    })
}

/// Most words of a description that are a name.
const MOST_WORDS: usize = 4;

/// The beginning of a description, if it can stand for the key: `number of robots` of "Number of robots, each with a radio."
fn short_name(description: &str) -> Option<String> {
    let end = description.find([',', ';', ':', '.', '(']).unwrap_or(description.len());
    let phrase = description[..end].trim();
    let phrase = ["The ", "A ", "An ", "Its "]
        .iter()
        .find_map(|article| phrase.strip_prefix(article))
        .unwrap_or(phrase);
    let is_plain =
        phrase.chars().all(|letter| letter.is_ascii_alphabetic() || " -'".contains(letter));
    let n_words = phrase.split_whitespace().count();
    if !is_plain || !(2..=MOST_WORDS).contains(&n_words) {
        return None;
    }
    let mut letters = phrase.chars();
    let first = letters.next()?;
    // What is written in capitals stays so: `RSSI reading`.
    let is_acronym = letters.clone().next().is_some_and(char::is_uppercase);
    let first = if is_acronym { first.to_string() } else { first.to_lowercase().to_string() };
    Some(first + letters.as_str())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_are_called_as_their_descriptions_begin_or_as_they_are_spelt() {
        let config: toml::Table = toml::from_str(
            "[robotsim.controller]\nkind = \"flocking\"\n[robotsim.scenario]\nkind = \"line\"\n",
        )
        .unwrap();
        let catalogue = Catalogue::of_program();
        let name = |key: &str| catalogue.key(key, &config).label();
        assert_eq!(name("experiment.agents"), "number of robots");
        assert_eq!(name("robotsim.controller.flock_radius_m"), "flock radius (m)");
        assert_eq!(name("robotsim.scenario.spacing_m"), "spacing along the line (m)");
        assert_eq!(name("robotsim.controller.law"), "controller law");
        // Of a simulator of a stranger nothing is known.
        assert_eq!(name("robotsim.wings.flap_rate_hz"), "flap rate (Hz)");
        assert!(catalogue.key("robotsim.wings.flap_rate_hz", &config).explanation.is_none());
    }

    #[test]
    fn values_are_spelt_as_their_descriptions_begin() {
        let config: toml::Table = toml::from_str("[netsim]\nmode = \"6tisch\"\n").unwrap();
        let catalogue = Catalogue::of_program();
        let value = |value: &str| catalogue.value("netsim.sf.kind", value, &config);
        assert_eq!(value("msf").as_deref(), Some("MSF"));
        assert_eq!(value("orchestra").as_deref(), Some("Orchestra"));
        assert_eq!(value("static"), None, "described without a name");
        assert_eq!(value("none such"), None);
    }

    #[test]
    fn figures_are_called_and_explained_by_the_list_of_metrics() {
        let label = |figure: &str| Name::of_figure(figure).label();
        assert_eq!(label("task.flock_speed_mps"), "flock speed (m/s)");
        assert_eq!(label("flock_speed"), "flock speed (m/s)");
        assert_eq!(label("kpis.delivery.latency_s.median"), "median delivery latency (s)");
        assert_eq!(label("kpis.formation.formed_s"), "formation time (s)");
        assert_eq!(label("kpis.delivery.ratio"), "delivery ratio");
        assert_eq!(label("pdr"), "packet delivery ratio");
        assert_eq!(label("kpis.since_start.delivery.ratio"), "delivery ratio since the start");
        assert_eq!(label("task.wing_beat_hz"), "wing beat (Hz)");
        let foreign = Name::of_figure("task.wing_beat_hz").explanation.unwrap();
        assert_eq!(foreign, "A figure that the robot simulator reports by this name.");
        assert!(Name::of_figure("pdr").is_share);
        for figure in ["task.flock_speed_mps", "network.delivery_ratio", "kpis.formation.formed_s"]
        {
            assert!(Name::of_figure(figure).explanation.is_some(), "{figure}");
        }
    }
}
