//! The trials of a folder, and which trial of one belongs to which of another.

use super::{CompareRunsError, Pair};
use crate::sweep_summary::SCHEMA;
use crate::table::{CASE, SEED, SETTING, STATUS};
use crate::{TABLE_FILE, figures};
use input::Reading;
use input::table::Table;
use metrics::figures::FigureValue;
use parquet::record::Field;
use proto::bounds::DESCRIPTION_BYTES;
use record::metric::path_of;
use record::result::{ResultError, ResultFolder};
use record::run_summary::RunSummary;
use record::{SCHEMA_PREFIX, Status, Tagged};
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Display;
use std::path::Path;

/// What a folder holds.
pub(super) struct RunFolder {
    /// The configuration.
    pub(super) config: toml::Table,
    /// Names of the figures, in order.
    pub(super) figures: Vec<String>,
    /// The trials.
    rows: Vec<RunRow>,
    /// It is a single run.
    is_run: bool,
}

struct RunRow {
    /// Case and what varies.
    id: BTreeMap<String, String>,
    seed: u64,
    is_complete: bool,
    values: BTreeMap<String, f64>,
}

/// Reads a folder.
pub(super) fn find(path: &Path, reading: Reading) -> Result<RunFolder, CompareRunsError> {
    let wrong = |reason: String| CompareRunsError::Folder { path: path.to_owned(), reason };
    let foreign = |error: &dyn Display| {
        let hint = "is not the folder of a run or of a finished sweep";
        wrong(format!("{hint} (summary.json: {error})"))
    };
    std::fs::metadata(path.join(RunSummary::FILE)).map_err(|error| foreign(&error))?;
    let folder = ResultFolder::open(path, reading)?;
    let text = folder.bytes(&DESCRIPTION_BYTES, RunSummary::FILE).map_err(|error| match error {
        ResultError::Read { source, .. } => foreign(&source),
        error => CompareRunsError::Unbelieved(error),
    })?;
    let Tagged { schema } = serde_json::from_slice(&text).map_err(|error| foreign(&error))?;
    if schema != SCHEMA && !schema.starts_with(SCHEMA_PREFIX) {
        return Err(wrong(format!(
            "summary.json has the schema {schema:?}, which is neither that of a run nor that of a sweep"
        )));
    }
    let config = |name: &str| -> Result<toml::Table, CompareRunsError> {
        let text = folder.text(&DESCRIPTION_BYTES, name)?;
        text.parse().map_err(|error: toml::de::Error| wrong(format!("{name}: {error}")))
    };
    if schema == SCHEMA {
        let (figures, rows) = rows_of(&folder.table(TABLE_FILE)?, &folder)?;
        Ok(RunFolder { config: config("sweep.toml")?, figures, rows, is_run: false })
    } else {
        let summary: RunSummary = serde_json::from_slice(&text).map_err(|error| foreign(&error))?;
        let number = |value: FigureValue| match value {
            FigureValue::Flag(is) => f64::from(u8::from(is)),
            FigureValue::Count(n) => n as f64,
            FigureValue::Number(number) => number,
        };
        let values: Vec<(String, f64)> = figures::of_summary(&summary)
            .into_iter()
            .filter_map(|(name, value)| Some((name, number(value?))))
            .collect();
        let row = RunRow {
            id: BTreeMap::new(),
            seed: summary.seed,
            is_complete: summary.status == Status::Complete,
            values: values.iter().cloned().collect(),
        };
        let figures = values.into_iter().map(|(name, _)| name).collect();
        Ok(RunFolder { config: config("config.toml")?, figures, rows: vec![row], is_run: true })
    }
}

/// Memory of a field of a trial beside its name and text: its place in a map (bytes).
const BYTES_OF_FIELD: usize = 64;

/// The figures and the rows of the table of a sweep.
fn rows_of(
    table: &Table,
    folder: &ResultFolder,
) -> Result<(Vec<String>, Vec<RunRow>), ResultError> {
    let mut names = Vec::new();
    let mut rows = Vec::new();
    let mut memory = table.memory();
    table.each_row(|row| {
        let mut found =
            RunRow { id: BTreeMap::new(), seed: 0, is_complete: false, values: BTreeMap::new() };
        let mut is_figure = false;
        for (name, field) in row.get_column_iter() {
            let text = if let Field::Str(text) = field { text.len() } else { 0 };
            let what = format_args!("{} trials", rows.len() + 1);
            memory.take((BYTES_OF_FIELD + name.len() + text) as u64, what).map_err(|message| {
                ResultError::Format { path: folder.path().join(TABLE_FILE), message }
            })?;
            match (name.as_str(), field) {
                (SEED, Field::ULong(seed)) => found.seed = *seed,
                (STATUS, Field::Str(status)) => {
                    found.is_complete = status == "complete";
                    is_figure = true;
                }
                (SETTING, _) | (_, Field::Null) => {}
                (_, Field::Double(number)) if is_figure => {
                    found.values.insert(path_of(name).to_owned(), *number);
                }
                (_, Field::Bool(is)) if is_figure => {
                    found.values.insert(path_of(name).to_owned(), f64::from(u8::from(*is)));
                }
                (_, Field::Str(text)) => {
                    found.id.insert(name.clone(), text.clone());
                }
                (_, field) => {
                    found.id.insert(name.clone(), field.to_string());
                }
            }
        }
        rows.push(found);
        Ok::<(), ResultError>(())
    })?;
    let mut is_figure = false;
    for column in table.columns() {
        if is_figure {
            // One sweep may have a short name where the other has the path.
            names.push(path_of(column).to_owned());
        }
        is_figure |= column == STATUS;
    }
    Ok((names, rows))
}

/// Trials with their partners, by setting.
pub(super) struct Pairing<'a> {
    pub(super) groups: Vec<(BTreeMap<String, String>, Vec<Pair<'a>>)>,
    pub(super) warnings: Vec<String>,
}

/// Pairs the trials of two folders: the same setting of what both vary, the same seed.
pub(super) fn pair<'a>(
    paths: [&Path; 2],
    found: [&'a RunFolder; 2],
) -> Result<Pairing<'a>, CompareRunsError> {
    let mut warnings = Vec::new();
    let [a, b] = found;
    if a.is_run && b.is_run {
        let (row_a, row_b) = (&a.rows[0], &b.rows[0]);
        if row_a.seed != row_b.seed {
            warnings.push(format!(
                "the seeds differ ({} and {}), so the differences are partly random; compare runs with the same seed, or \
                 sweeps",
                row_a.seed, row_b.seed
            ));
        } else {
            warnings.push(
                "only one run each, so the differences may depend on the seed; compare sweeps for confidence intervals"
                    .to_owned(),
            );
        }
        for (path, row) in [(paths[0], row_a), (paths[1], row_b)] {
            if !row.is_complete {
                warnings.push(format!("{} did not run to its end", path.display()));
            }
        }
        let pair = Pair { seed: row_a.seed, a: &row_a.values, b: &row_b.values };
        return Ok(Pairing { groups: vec![(BTreeMap::new(), vec![pair])], warnings });
    }
    let keys = |found: &RunFolder| -> BTreeSet<String> {
        found.rows.iter().flat_map(|row| row.id.keys().cloned()).collect()
    };
    let (keys_a, keys_b) = (keys(a), keys(b));
    let common: BTreeSet<String> = keys_a.intersection(&keys_b).cloned().collect();
    let mut indexed = Vec::new();
    for (place, keys) in [(0, &keys_a), (1, &keys_b)] {
        let mut index: BTreeMap<(Vec<Option<String>>, u64), &RunRow> = BTreeMap::new();
        for row in &found[place].rows {
            let id = common.iter().map(|key| row.id.get(key).cloned()).collect();
            if index.insert((id, row.seed), row).is_some() {
                return Err(CompareRunsError::Settings {
                    path: paths[place].to_owned(),
                    other: paths[1 - place].to_owned(),
                    keys: keys.difference(&common).filter(|key| *key != CASE).cloned().collect(),
                });
            }
        }
        indexed.push(index);
    }
    let (index_a, index_b) = (&indexed[0], &indexed[1]);
    let mut groups: Vec<(BTreeMap<String, String>, Vec<Pair<'a>>)> = Vec::new();
    let (mut n_pairs, mut n_incomplete) = (0, 0);
    // In the order of the first table.
    for row_a in &a.rows {
        let id: Vec<Option<String>> = common.iter().map(|key| row_a.id.get(key).cloned()).collect();
        let Some(row_b) = index_b.get(&(id, row_a.seed)) else { continue };
        n_pairs += 1;
        if !row_a.is_complete || !row_b.is_complete {
            n_incomplete += 1;
            continue;
        }
        let setting: BTreeMap<String, String> =
            row_a.id.iter().filter(|(key, _)| common.contains(*key)).map(own).collect();
        let pair = Pair { seed: row_a.seed, a: &row_a.values, b: &row_b.values };
        match groups.iter_mut().find(|(known, _)| *known == setting) {
            Some((_, pairs)) => pairs.push(pair),
            None => groups.push((setting, vec![pair])),
        }
    }
    if n_pairs == 0 {
        let [seeds_a, seeds_b] = [a, b].map(seeds);
        let paths = paths.map(Path::to_owned);
        return Err(CompareRunsError::NoPairs { paths, a: seeds_a, b: seeds_b });
    }
    for (path, index) in [(paths[0], index_a), (paths[1], index_b)] {
        if n_pairs < index.len() {
            warnings.push(format!(
                "ignored {} of {} trials of {}, which have no partner",
                index.len() - n_pairs,
                index.len(),
                path.display()
            ));
        }
    }
    if n_incomplete != 0 {
        warnings.push(format!(
            "ignored {n_incomplete} of {n_pairs} pairs in which a network had not formed"
        ));
    }
    Ok(Pairing { groups, warnings })
}

fn own((key, value): (&String, &String)) -> (String, String) {
    (key.clone(), value.clone())
}

/// The seeds of a folder, the first few.
fn seeds(found: &RunFolder) -> String {
    let seeds: BTreeSet<u64> = found.rows.iter().map(|row| row.seed).collect();
    let first: Vec<String> = seeds.iter().take(5).map(u64::to_string).collect();
    let rest = if seeds.len() <= 5 { "" } else { ", …" };
    format!("{}{rest}", first.join(", "))
}
