//! What changed from one run, or one sweep, to another: in the configuration, in the task, in the network; seed by seed.

mod rows;
mod runs_comparison;
mod words;

pub use runs_comparison::RunsComparison;
pub use words::text;

use crate::sweep_summary::MetricSpread;
use input::Reading;
use record::result::ResultError;
use rows::{Pairing, RunFolder};
use runs_comparison::{Change, ChangedKey, SCHEMA, SettingComparison};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Why two folders cannot be compared.
#[derive(Debug, thiserror::Error)]
pub enum CompareRunsError {
    /// A file is not what the run or the sweep wrote.
    #[error(transparent)]
    Unbelieved(#[from] ResultError),
    /// The folder is not one that a run or a sweep has left.
    #[error("{}: {reason}", path.display())]
    Folder {
        /// The folder.
        path: PathBuf,
        /// What is wrong with it.
        reason: String,
    },
    /// The keys that one sweep varies do not identify the trials of the other.
    #[error(
        "{} varies {}, which {} does not vary, so its trials cannot be paired one to one; compare sweeps over the same keys",
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
        "no trial of {} has a partner in {} with the same setting and seed. The seeds are {a} in the first and {b} in the \
         second; run both with common seeds",
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

/// Compares two folders, each of a run or of a sweep.
///
/// # Errors
///
/// See [`CompareRunsError`].
pub fn compare_runs(
    a: &Path,
    b: &Path,
    reading: impl Into<Reading>,
) -> Result<RunsComparison, CompareRunsError> {
    let reading = reading.into();
    let (found_a, found_b) = (rows::find(a, reading)?, rows::find(b, reading)?);
    let Pairing { groups, warnings } = rows::pair([a, b], [&found_a, &found_b])?;
    let figures = figures(&found_a, &found_b);
    let settings = groups.iter().map(|(id, pairs)| SettingComparison {
        setting: id.clone(),
        seeds: pairs.iter().map(|pair| pair.seed).collect(),
        figures: figures
            .iter()
            .filter_map(|name| Some(((*name).to_owned(), change(name, pairs)?)))
            .collect(),
    });
    let configuration = configuration(&found_a.config, &found_b.config);
    Ok(RunsComparison {
        schema: SCHEMA,
        a: a.display().to_string(),
        b: b.display().to_string(),
        configuration: configuration
            .into_iter()
            .map(|(key, [a, b])| ChangedKey { key, a, b })
            .collect(),
        settings: settings.collect(),
        warnings,
    })
}

/// The values of a configuration by the path of their key, such as `netsim.phy.radius_m` or `site.wall[0].from_m`. What a run is
/// called and what it leaves on disk changes no figure, and is left out.
#[must_use]
pub fn values_by_key(config: &toml::Table) -> BTreeMap<String, toml::Value> {
    fn below(value: &toml::Value, key: &str, found: &mut BTreeMap<String, toml::Value>) {
        match value {
            toml::Value::Table(table) => {
                for (name, value) in table {
                    below(value, &proto::config::join(key, name), found);
                }
            }
            toml::Value::Array(list) if list.iter().any(toml::Value::is_table) => {
                for (index, value) in list.iter().enumerate() {
                    below(value, &format!("{key}[{index}]"), found);
                }
            }
            value => {
                found.insert(key.to_owned(), value.clone());
            }
        }
    }
    let mut found = BTreeMap::new();
    for (name, value) in config {
        below(value, &proto::config::join("", name), &mut found);
    }
    found.retain(|key, _| key != "experiment.name" && !key.starts_with("output."));
    found
}

/// Keys whose values differ, each with both.
fn configuration(a: &toml::Table, b: &toml::Table) -> Vec<(String, [String; 2])> {
    let [of_a, of_b] = [a, b].map(|table| {
        let values = values_by_key(table).into_iter();
        values.map(|(key, value)| (key, value.to_string())).collect::<BTreeMap<String, String>>()
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
fn figures<'a>(a: &'a RunFolder, b: &RunFolder) -> Vec<&'a str> {
    a.figures.iter().filter(|name| b.figures.contains(name)).map(String::as_str).collect()
}

/// A trial of A and its partner of B.
#[derive(Clone, Copy, Debug)]
struct Pair<'a> {
    seed: u64,
    a: &'a BTreeMap<String, f64>,
    b: &'a BTreeMap<String, f64>,
}

/// How a figure changed; none where no pair has it on both sides.
fn change(name: &str, pairs: &[Pair<'_>]) -> Option<Change> {
    let both: Vec<[f64; 2]> =
        pairs.iter().filter_map(|pair| Some([*pair.a.get(name)?, *pair.b.get(name)?])).collect();
    let summary_of = |f: &dyn Fn(&[f64; 2]) -> f64| {
        MetricSpread::from_values(&both.iter().map(f).collect::<Vec<_>>())
    };
    let count = |f: &dyn Fn(&[f64; 2]) -> bool| both.iter().filter(|pair| f(pair)).count();
    let (a, b) = (summary_of(&|pair| pair[0])?, summary_of(&|pair| pair[1])?);
    let difference = summary_of(&|pair| pair[1] - pair[0])?;
    let size = [a.min, a.max, b.min, b.max].into_iter().map(f64::abs).fold(0.0, f64::max);
    Some(Change {
        pairs: both.len(),
        median_a: a.median,
        median_b: b.median,
        median_difference: difference.median,
        median_difference_interval_95: difference.median_interval_95,
        interval: difference.interval,
        mean_difference: difference.mean,
        min_difference: difference.min,
        max_difference: difference.max,
        b_greater: count(&|pair| pair[0] < pair[1]),
        b_less: count(&|pair| pair[1] < pair[0]),
        is_changed: 1e-9 * size < difference.max.max(-difference.min),
    })
}
