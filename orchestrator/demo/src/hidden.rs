//! The effects that a demo can hide, and the draw of one of them.

use proto::rng::{Draws, Purpose};
use serde::Deserialize;
use std::fmt::Write as _;

/// The list.
const LIST: &str = include_str!("hidden.toml");

/// What stands for no effect in `--effect`.
pub(super) const NONE: &str = "none";

/// What a demo measures.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(super) enum Measured {
    /// Received signal strength between motes.
    Links,
    /// Tracks of robots.
    Robots,
}

impl Measured {
    /// The section of a configuration that its effects stand in.
    fn section(self) -> &'static str {
        match self {
            Self::Links => "netsim.phy.effect",
            Self::Robots => "robotsim.dynamics.effect",
        }
    }
}

/// The list as it is written.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct List {
    effect: Vec<Entry>,
}

/// An effect that can be hidden.
#[derive(Clone, Deserialize)]
#[serde(deny_unknown_fields)]
struct Entry {
    kind: String,
    measured: Measured,
    /// Its keys. A table with `from` and `to` is a number that is drawn.
    settings: toml::Table,
}

/// The effect that a demo hides.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct HiddenEffect {
    /// Its name in the catalogue.
    pub kind: String,
    /// What is measured.
    pub measured: Measured,
    /// Its keys, in the order of the list.
    pub settings: toml::Table,
}

impl HiddenEffect {
    /// Its section of a configuration.
    #[must_use]
    pub(super) fn section(&self) -> String {
        let mut text = format!("[[{}]]\nkind = \"{}\"\n", self.measured.section(), self.kind);
        for (key, value) in &self.settings {
            let _ = writeln!(text, "{key} = {value}");
        }
        text
    }

    /// Its numbers by the names that a diagnosis gives them: `loss_db`, `velocity_mps[0]`.
    #[must_use]
    pub(super) fn numbers(&self) -> Vec<(String, f64)> {
        let mut numbers = Vec::new();
        for (key, value) in &self.settings {
            match value {
                toml::Value::Float(number) => numbers.push((key.clone(), *number)),
                toml::Value::Array(list) => {
                    let parts = list.iter().enumerate();
                    numbers.extend(parts.filter_map(|(place, part)| {
                        Some((format!("{key}[{place}]"), part.as_float()?))
                    }));
                }
                _ => {}
            }
        }
        numbers
    }
}

/// The list of this program.
///
/// # Panics
///
/// If the file in the source is no list, which a test excludes.
fn list() -> Vec<Entry> {
    let list: List = toml::from_str(LIST).expect("a test reads the list");
    list.effect
}

/// Names of the effects that can be hidden.
#[must_use]
pub(super) fn names() -> Vec<String> {
    list().into_iter().map(|entry| entry.kind).collect()
}

/// The effect that a seed hides; none if it hides none. `wanted`: the name of the effect, or [`NONE`], in place of a drawn one.
///
/// # Errors
///
/// The wanted effect is not in the list. The error names the nearest ones.
pub(super) fn draw(seed: u64, wanted: Option<&str>) -> Result<Option<HiddenEffect>, String> {
    let list = list();
    let draws = Draws::new(seed, Purpose::Demo);
    let entry = match wanted {
        Some(NONE) => None,
        Some(name) => match list.iter().find(|entry| entry.kind == name) {
            Some(entry) => Some(entry),
            None => {
                return Err(format!(
                    "{name:?} is not an effect that the demo can hide; choose {}, or {NONE}",
                    names().join(", ")
                ));
            }
        },
        // As likely as each effect: none.
        None => list.get((draws.uniform(0, 0, 0) * (list.len() + 1) as f64) as usize),
    };
    let mut n_drawn = 0;
    Ok(entry.map(|entry| HiddenEffect {
        kind: entry.kind.clone(),
        measured: entry.measured,
        settings: entry
            .settings
            .iter()
            .map(|(key, value)| (key.clone(), drawn(value, draws, &mut n_drawn)))
            .collect(),
    }))
}

/// A value with a number, rounded to two decimals, in place of each range.
fn drawn(value: &toml::Value, draws: Draws, n_drawn: &mut u64) -> toml::Value {
    match value {
        toml::Value::Array(parts) => {
            parts.iter().map(|part| drawn(part, draws, n_drawn)).collect::<Vec<_>>().into()
        }
        toml::Value::Table(range) => {
            let end =
                |key: &str| range.get(key).and_then(toml::Value::as_float).unwrap_or_default();
            *n_drawn += 1;
            let share = draws.uniform(*n_drawn, 0, 0);
            let number = end("from") + share * (end("to") - end("from"));
            toml::Value::Float((100.0 * number).round() / 100.0)
        }
        other => other.clone(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_effect_of_the_list_is_one_of_the_catalogue_with_valid_keys() {
        for name in names() {
            for seed in 0..20 {
                let hidden = draw(seed, Some(&name)).unwrap().unwrap();
                let text = crate::truth_text(crate::MODEL, Some(&hidden));
                let text = crate::filled(&text, seed, 10, "links.csv");
                let refusal = measure::config::Compared::of_text(
                    std::path::Path::new("truth.toml"),
                    text.clone(),
                    &[],
                )
                .err();
                assert!(refusal.is_none(), "{text}\n{}", refusal.unwrap());
                assert!(!hidden.numbers().is_empty(), "{name}");
            }
        }
    }

    #[test]
    fn seeds_hide_each_effect_and_none_about_as_often() {
        let mut counts = std::collections::BTreeMap::new();
        let n_kinds = names().len() + 1;
        let n_seeds = 200 * n_kinds as u64;
        for seed in 0..n_seeds {
            let hidden = draw(seed, None).unwrap();
            *counts.entry(hidden.map(|hidden| hidden.kind)).or_insert(0) += 1;
        }
        assert_eq!(counts.len(), n_kinds);
        for (kind, count) in counts {
            // Five standard deviations of a binomial count with mean 200.
            assert!((130..270).contains(&count), "{kind:?}: {count}");
        }
    }

    #[test]
    fn an_unknown_effect_is_refused_with_the_list() {
        let error = draw(1, Some("gremlins")).unwrap_err();
        assert!(error.contains("gremlins") && error.contains(NONE));
        assert!(names().iter().all(|name| error.contains(name)), "{error}");
    }
}
