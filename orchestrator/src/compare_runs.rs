//! What changed from one run, or one sweep, to another: in the configuration, in the task, in the network; seed by seed.

mod rows;

use crate::sweep::statistics::Spread;
use numbers::format::{count_of, number};
use rows::{Found, Pairing};
use serde_json::{Map, Value, json};
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

/// Why two folders cannot be compared.
#[derive(Debug, thiserror::Error)]
pub enum CompareRunsError {
    /// The folder is not one that a run or a sweep has left.
    #[error("{}: {reason}", path.display())]
    Folder {
        /// The folder.
        path: PathBuf,
        /// What is wrong with it.
        reason: String,
    },
    /// Trials of one cannot be told apart by what the other varies.
    #[error(
        "{} varies {}, which {} does not: its trials have no partners of their own",
        path.display(), keys.join(", "), other.display()
    )]
    Settings {
        /// The folder.
        path: PathBuf,
        /// The other.
        other: PathBuf,
        /// What the first alone varies.
        keys: Vec<String>,
    },
    /// No trial of one has a partner in the other.
    #[error(
        "no trial of {} has a partner in {}: the same settings with the same seeds. Its seeds are {a}, the other's {b}",
        paths[0].display(), paths[1].display()
    )]
    NoPairs {
        /// Both folders.
        paths: [PathBuf; 2],
        /// Seeds of the first.
        a: String,
        /// Seeds of the second.
        b: String,
    },
}

/// What changed.
#[derive(Clone, Debug)]
pub struct Changes {
    /// For people.
    pub text: String,
    /// For programs.
    pub json: Value,
    /// What should be checked before it is believed.
    pub warnings: Vec<String>,
}

/// Compares two folders, each of a run or of a sweep.
///
/// # Errors
///
/// See [`CompareRunsError`].
pub fn compare_runs(a: &Path, b: &Path) -> Result<Changes, CompareRunsError> {
    let (found_a, found_b) = (rows::find(a)?, rows::find(b)?);
    let Pairing { groups, warnings } = rows::pair([a, b], [&found_a, &found_b])?;
    let configuration = configuration(&found_a.config, &found_b.config);
    let mut text = format!("A {}\nB {}\n", a.display(), b.display());
    if configuration.is_empty() {
        text.push_str("\nThe configurations do not differ.\n");
    } else {
        text.push_str("\nConfiguration, A -> B\n");
        for (key, [in_a, in_b]) in &configuration {
            let _ = writeln!(text, "  {key}: {in_a} -> {in_b}");
        }
    }
    let figures = figures(&found_a, &found_b);
    let mut settings = Vec::new();
    for (id, pairs) in &groups {
        let changes: Vec<Change<'_>> =
            figures.iter().filter_map(|name| Change::of(name, pairs)).collect();
        let heading = match id.len() {
            0 => String::new(),
            _ => id.iter().map(|(k, v)| format!("{k} {v}")).collect::<Vec<_>>().join(", "),
        };
        table(&mut text, &heading, pairs.len(), &changes);
        let changes: Map<String, Value> =
            changes.iter().map(|change| (change.name.to_owned(), change.to_json())).collect();
        let seeds: Vec<u64> = pairs.iter().map(|pair| pair.seed).collect();
        settings.push(json!({ "setting": id, "seeds": seeds, "figures": changes }));
    }
    let configuration: Vec<Value> =
        configuration.iter().map(|(key, [a, b])| json!({ "key": key, "a": a, "b": b })).collect();
    let json = json!({
        "schema": "compare-runs/1",
        "a": a,
        "b": b,
        "configuration": configuration,
        "settings": settings,
        "warnings": warnings,
    });
    text.truncate(text.trim_end().len());
    Ok(Changes { text, json, warnings })
}

/// Keys whose values differ, each with both.
fn configuration(a: &toml::Table, b: &toml::Table) -> Vec<(String, [String; 2])> {
    fn leaves(value: &toml::Value, key: &str, leaves_of: &mut BTreeMap<String, String>) {
        match value {
            toml::Value::Table(table) => {
                for (name, value) in table {
                    leaves(value, &proto::config::join(key, name), leaves_of);
                }
            }
            toml::Value::Array(list) if list.iter().any(toml::Value::is_table) => {
                for (index, value) in list.iter().enumerate() {
                    leaves(value, &format!("{key}[{index}]"), leaves_of);
                }
            }
            value => {
                leaves_of.insert(key.to_owned(), value.to_string());
            }
        }
    }
    let [of_a, of_b] = [a, b].map(|table| {
        let mut found = BTreeMap::new();
        leaves(&toml::Value::Table(table.clone()), "", &mut found);
        // What a run is called and what it leaves on disk changes no figure.
        found.retain(|key, _| key != "experiment.name" && !key.starts_with("output."));
        found
    });
    let mut keys: Vec<&String> = of_a.keys().chain(of_b.keys()).collect();
    keys.sort();
    keys.dedup();
    let absent = || "absent".to_owned();
    keys.into_iter()
        .map(|key| {
            (key, [&of_a, &of_b].map(|found| found.get(key).cloned().unwrap_or_else(absent)))
        })
        .filter(|(_, [a, b])| a != b)
        .map(|(key, both)| (key.clone(), both))
        .collect()
}

/// The figures that both have, in the order of the first.
fn figures<'a>(a: &'a Found, b: &Found) -> Vec<&'a str> {
    a.figures.iter().filter(|name| b.figures.contains(name)).map(String::as_str).collect()
}

/// A trial of A and its partner of B.
#[derive(Clone, Copy, Debug)]
struct Pair<'a> {
    seed: u64,
    a: &'a BTreeMap<String, f64>,
    b: &'a BTreeMap<String, f64>,
}

/// How a figure changed.
struct Change<'a> {
    name: &'a str,
    a: Spread,
    b: Spread,
    /// Of the differences B − A, pair by pair.
    difference: Spread,
    /// Pairs in which B is greater, and in which it is less.
    signs: [usize; 2],
}

impl<'a> Change<'a> {
    /// `None` where no pair has it on both sides.
    fn of(name: &'a str, pairs: &[Pair<'_>]) -> Option<Self> {
        let both: Vec<[f64; 2]> = pairs
            .iter()
            .filter_map(|pair| Some([*pair.a.get(name)?, *pair.b.get(name)?]))
            .collect();
        let of = |f: &dyn Fn(&[f64; 2]) -> f64| Spread::of(&both.iter().map(f).collect::<Vec<_>>());
        let count = |f: &dyn Fn(&[f64; 2]) -> bool| both.iter().filter(|pair| f(pair)).count();
        Some(Self {
            name,
            a: of(&|pair| pair[0])?,
            b: of(&|pair| pair[1])?,
            difference: of(&|pair| pair[1] - pair[0])?,
            signs: [count(&|pair| pair[0] < pair[1]), count(&|pair| pair[1] < pair[0])],
        })
    }

    /// More than rounding does, in some pair.
    fn is_change(&self) -> bool {
        let size = [self.a.min, self.a.max, self.b.min, self.b.max];
        let size = size.into_iter().map(f64::abs).fold(0.0, f64::max);
        1e-9 * size < self.difference.max.max(-self.difference.min)
    }

    fn to_json(&self) -> Value {
        json!({
            "pairs": self.difference.n,
            "median_a": self.a.median,
            "median_b": self.b.median,
            "median_difference": self.difference.median,
            "median_difference_interval_95": self.difference.interval_95,
            "mean_difference": self.difference.mean,
            "min_difference": self.difference.min,
            "max_difference": self.difference.max,
            "b_greater": self.signs[0],
            "b_less": self.signs[1],
        })
    }
}

fn table(text: &mut String, heading: &str, n_pairs: usize, changes: &[Change<'_>]) {
    let pairs = count_of(n_pairs as u64, "pair");
    let heading = if heading.is_empty() { pairs.clone() } else { format!("{heading} ({pairs})") };
    let (changed, same): (Vec<_>, Vec<_>) = changes.iter().partition(|change| change.is_change());
    let _ = writeln!(text, "\n{heading}");
    if changed.is_empty() {
        let _ = writeln!(text, "  none of {} figures differs", changes.len());
        return;
    }
    let rows: Vec<[String; 6]> = changed
        .iter()
        .map(|change| {
            let interval = change.difference.interval_95.map_or_else(
                || "-".to_owned(),
                |[low, high]| format!("{} … {}", number(low), number(high)),
            );
            [
                change.name.to_owned(),
                number(change.a.median),
                number(change.b.median),
                number(change.difference.median),
                interval,
                format!("{} / {} of {}", change.signs[0], change.signs[1], change.difference.n),
            ]
        })
        .collect();
    let headings =
        ["figure", "A", "B", "B − A", "95 % interval", "B greater / less"].map(str::to_owned);
    let width = |column: usize| {
        rows.iter().chain([&headings]).map(|row| row[column].chars().count()).max().unwrap_or(0)
    };
    let widths: [usize; 6] = std::array::from_fn(width);
    for row in [&headings].into_iter().chain(&rows) {
        let _ = write!(text, "  {:<1$}", row[0], widths[0]);
        for column in 1..6 {
            let _ = write!(text, "  {:>1$}", row[column], widths[column]);
        }
        text.push('\n');
    }
    if !same.is_empty() {
        let _ = writeln!(text, "  {} do not differ", count_of(same.len() as u64, "further figure"));
    }
}
