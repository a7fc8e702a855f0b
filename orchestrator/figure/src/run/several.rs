//! A figure of several runs: their curves over each other, named by the folder and by the keys in which the runs differ.

use super::{Draw, KINDS, RunFolder, curves, started_s};
use crate::content::{DrawnRun, Figure};
use crate::{FigureError, Kind, Request, Wanted, is_run, kind};
use ::sweep::compare_runs::values_by_key;
use ::sweep::names::Catalogue;
use input::result::ResultFolder;
use numbers::format::shortest;
use proto::bounds::DESCRIPTION_BYTES;
use serde_json::Value;
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

/// More runs cannot be told apart in a figure.
const MOST_RUNS: usize = 8;
/// The key of the seed.
const SEED: &str = "experiment.seed";
/// Most keys in the name of a run: the caption has those of all.
const MOST_KEYS: usize = 3;

/// A figure of several runs.
pub(crate) fn figure(
    results: &[(ResultFolder, Value)],
    request: &Request,
) -> Result<Figure, FigureError> {
    let refused = |text: String| Err(FigureError::Request(text));
    if let Some((folder, _)) = results.iter().find(|(_, summary)| !is_run(summary)) {
        return refused(format!(
            "{}: is a sweep; only runs are drawn over each other, so give one RESULT",
            folder.path().display()
        ));
    }
    if MOST_RUNS < results.len() {
        let n = results.len();
        return refused(format!("{n} runs are too many for a figure; give at most {MOST_RUNS}"));
    }
    let (runs, differing) = drawn(results)?;
    let starts: Vec<f64> = runs.iter().map(|run| run.robots_started_s).collect();
    let differ_in_start = starts.iter().any(|start_s| (start_s - starts[0]).abs() > 1e-9);
    let of_each = |kind: &Kind<Draw>| match kind.draw {
        Draw::Map(_) => Err(FigureError::Request(format!(
            "{} is a map of one run; give one RESULT, or a KIND of curves",
            kind.name
        ))),
        Draw::OverTime(draw) | Draw::Curves(draw) => results
            .iter()
            .map(|(folder, summary)| {
                draw(&RunFolder::new(folder, summary, request, kind.draw, differ_in_start))
            })
            .collect::<Result<Vec<_>, _>>(),
    };
    let wanted = Wanted {
        what: "a figure of several runs".to_owned(),
        has: &|file| results.iter().all(|(folder, _)| folder.has(file)),
        can_draw: &|kind| !matches!(of_each(kind), Err(FigureError::Request(_))),
    };
    let kind = kind(&wanted, KINDS, request)?;
    let figure = curves::of_several(&runs, &of_each(kind)?);
    let caption = format!("{} {differing}", figure.caption);
    Ok(Figure { caption, ..figure })
}

/// The runs with the names of their curves, and in what their configurations differ, in a sentence.
fn drawn(results: &[(ResultFolder, Value)]) -> Result<(Vec<DrawnRun>, String), FigureError> {
    let mut configs: Vec<toml::Table> = Vec::new();
    for (folder, _) in results {
        let text = folder.text(&DESCRIPTION_BYTES, "config.toml")?;
        configs.push(text.parse().unwrap_or_default());
    }
    let values: Vec<BTreeMap<String, toml::Value>> = configs.iter().map(values_by_key).collect();
    let all: BTreeSet<&String> = values.iter().flat_map(BTreeMap::keys).collect();
    let mut keys: Vec<&String> = all
        .into_iter()
        .filter(|key| values.iter().any(|of_run| of_run.get(*key) != values[0].get(*key)))
        .collect();
    // Keys that all runs have say more than those that come with another choice, and the seed says least.
    keys.sort_by_key(|key| {
        let n_absent = values.iter().filter(|of_run| !of_run.contains_key(*key)).count();
        (*key == SEED, n_absent)
    });
    let catalogue = Catalogue::of_program();
    let paths: Vec<&Path> = results.iter().map(|(folder, _)| folder.path()).collect();
    let in_words = |run: usize, key: &str| {
        let name = catalogue.key(key, &configs[run]);
        let value = match values[run].get(key)? {
            toml::Value::String(text) => {
                catalogue.value(key, text, &configs[run]).unwrap_or_else(|| text.clone())
            }
            toml::Value::Float(number) => shortest(*number),
            other => other.to_string(),
        };
        if key == SEED {
            return Some(format!("seed {value}"));
        }
        let unit = name.unit.map(|unit| format!(" {unit}")).unwrap_or_default();
        Some(format!("{} {value}{unit}", name.words))
    };
    let runs = results.iter().enumerate().map(|(run, (folder, summary))| {
        let words: Vec<String> =
            keys.iter().filter_map(|key| in_words(run, key)).take(MOST_KEYS).collect();
        let folder_name = folder_name(folder.path(), &paths);
        let name = if words.is_empty() {
            folder_name
        } else {
            format!("{folder_name}: {}", words.join(", "))
        };
        let text = |key: &&String| values[run].get(*key).map(toml::Value::to_string);
        DrawnRun {
            name,
            path: folder.path().display().to_string(),
            robots_started_s: started_s(summary),
            differs: keys.iter().map(|key| ((*key).clone(), text(key))).collect(),
        }
    });
    Ok((runs.collect(), differing(&keys)))
}

/// Most keys that the caption names.
const MOST_NAMED: usize = 8;

fn differing(keys: &[&String]) -> String {
    if keys.is_empty() {
        return "The configurations of the runs do not differ.".to_owned();
    }
    let named: Vec<&str> = keys.iter().take(MOST_NAMED).map(|key| key.as_str()).collect();
    let more = match keys.len().saturating_sub(MOST_NAMED) {
        0 => String::new(),
        n => format!(", and in {n} further keys"),
    };
    format!("The configurations of the runs differ in {}{more}.", named.join(", "))
}

/// The name of a folder; its path where another run has the same name.
fn folder_name(path: &Path, paths: &[&Path]) -> String {
    let is_alone = paths.iter().filter(|other| other.file_name() == path.file_name()).count() < 2;
    let name = path.file_name().filter(|_| is_alone).unwrap_or(path.as_os_str());
    name.to_string_lossy().into_owned()
}
