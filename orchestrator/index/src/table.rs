//! All rows, kept up to date. Each change has a number, so that a page asks for what is new.

use crate::listing::{Found, Kind, Listing, Stamp};
use crate::read::{self, Read};
use crate::row::Row;
use crate::series::{self, NoSeries, RunSeries};
use crate::settings::{Numbered, Texts};
use crate::unfinished::{self, RECORDING};
use input::Reading;
use input::result::ResultFolder;
use record::run_summary::RunSummary;
use serde_json::{Value, json};
use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// The folder is looked through at most so often.
const LOOK_EVERY: Duration = Duration::from_secs(1);
/// One look reads results for so long; the next one goes on.
const MOST_READING: Duration = Duration::from_millis(1500);
/// An answer has at most so many rows.
const MOST_ROWS: usize = 500;
/// So many rows that are gone are remembered.
const MOST_REMOVED: usize = 1000;
/// Series of so many runs are kept.
const MOST_SERIES: usize = 400;

/// The results of a folder.
#[derive(Debug)]
pub struct ResultsTable {
    folder: PathBuf,
    reading: Reading,
    state: Mutex<State>,
    series: Mutex<KeptSeries>,
}

#[derive(Debug, Default)]
struct State {
    /// By place.
    entries: BTreeMap<String, Entry>,
    texts: Texts,
    /// Keys of configurations that differ.
    differing: BTreeSet<u32>,
    /// The number of the latest change.
    change: u64,
    /// Numbers of changes, and the results that were gone then.
    removed: Vec<(u64, u32)>,
    /// What was gone up to this change is not among `removed` any more.
    forgotten: u64,
    next_id: u32,
    looked: Option<Instant>,
    is_cut: bool,
}

#[derive(Debug)]
struct Entry {
    id: u32,
    path: PathBuf,
    kind: Kind,
    /// Of what was read; `None`: nothing yet.
    stamp: Option<(Stamp, Option<u64>)>,
    /// `None`: it is no result.
    row: Option<Row>,
    settings: Numbered,
    change: u64,
}

/// The series of a run, or why there are none.
type Series = Result<Arc<RunSeries>, NoSeries>;

#[derive(Debug, Default)]
struct KeptSeries {
    by_id: BTreeMap<u32, (Stamp, Series)>,
    order: VecDeque<u32>,
}

impl ResultsTable {
    /// The results of a folder. Nothing is read yet.
    #[must_use]
    pub fn new(folder: &Path, reading: Reading) -> Self {
        Self {
            folder: folder.to_owned(),
            reading,
            state: Mutex::default(),
            series: Mutex::default(),
        }
    }

    /// Whether there is any result, or a run that will leave one. Reads what is there until one is found.
    #[must_use]
    pub fn has_any(&self) -> bool {
        let listing = Listing::of(&self.folder);
        let is_one = |found: &Found| {
            found.kind != Kind::Answer || read::answer(found, self.reading).is_some()
        };
        listing.found.iter().any(is_one)
    }

    /// The folder.
    pub(crate) fn folder(&self) -> &Path {
        &self.folder
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Looks what there is now, and returns what changed after the change `since`, at most [`MOST_ROWS`] rows. `report_of` is the
    /// path of the report of a result.
    pub(crate) fn changes(&self, since: u64, report_of: impl Fn(u32) -> String) -> Value {
        let mut state = self.state();
        let n_unread = self.refresh(&mut state);
        let is_all = since < state.forgotten || state.change < since;
        let since = if is_all { 0 } else { since };
        let mut changed: Vec<&Entry> = state
            .entries
            .values()
            .filter(|entry| entry.row.is_some() && since < entry.change)
            .collect();
        changed.sort_by_key(|entry| entry.change);
        let has_more = MOST_ROWS < changed.len();
        changed.truncate(MOST_ROWS);
        let until = match changed.last() {
            Some(last) if has_more => last.change,
            _ => state.change,
        };
        let removed =
            state.removed.iter().filter(|(change, _)| (since + 1..=until).contains(change));
        json!({
            "change": until,
            "is_all": is_all || since == 0,
            "rows": changed.iter().map(|entry| state.shown(entry, &report_of)).collect::<Vec<Value>>(),
            "removed": removed.map(|(_, id)| *id).collect::<Vec<u32>>(),
            "has_more": has_more,
            "n_unread": n_unread,
            "is_cut": state.is_cut,
        })
    }

    /// Looks what there is, and reads what is new, for a while. Returns how much it has not read yet.
    fn refresh(&self, state: &mut State) -> usize {
        let begun = Instant::now();
        let is_read = |entry: &Entry| entry.stamp.is_some();
        let is_due = state.looked.is_none_or(|looked| LOOK_EVERY <= looked.elapsed());
        if !is_due && state.entries.values().all(is_read) {
            return 0;
        }
        let listing = Listing::of(&self.folder);
        state.looked = Some(begun);
        state.is_cut = listing.is_cut;
        let mut n_unread = 0;
        let mut has_changed = false;
        let places: BTreeSet<&str> = listing.found.iter().map(|found| &*found.place).collect();
        let gone: Vec<String> =
            state.entries.keys().filter(|place| !places.contains(&***place)).cloned().collect();
        for place in gone {
            has_changed |= state.remove(&place);
        }
        for found in &listing.found {
            let is_unfinished = found.kind == Kind::Unfinished;
            let since = is_unfinished.then(|| unfinished::running_since(&found.path)).flatten();
            let stamp = (found.stamp, since);
            let entry = state.entry(found);
            if entry.stamp == Some(stamp) && entry.kind == found.kind {
                continue;
            }
            if MOST_READING < begun.elapsed() {
                n_unread += 1;
                continue;
            }
            let read = match found.kind {
                Kind::Finished => Some(read::finished(found, self.reading)),
                Kind::Unfinished => Some(unfinished::unfinished(found, since)),
                Kind::Answer => read::answer(found, self.reading),
            };
            has_changed |= state.put(found, stamp, read);
        }
        if has_changed {
            state.find_differing();
        }
        n_unread
    }

    /// Where a result is, and what kind of one.
    pub(crate) fn place(&self, id: u32) -> Option<(PathBuf, Row)> {
        let state = self.state();
        let entry = state.entries.values().find(|entry| entry.id == id)?;
        Some((entry.path.clone(), entry.row.clone()?))
    }

    /// The folder of a result, whose files are checked.
    ///
    /// # Errors
    ///
    /// In words.
    pub(crate) fn open(&self, path: &Path) -> Result<ResultFolder, String> {
        ResultFolder::open(path, self.reading).map_err(|error| error.to_string())
    }

    /// The series of a run. They are kept until its files change. A file that is found to be changed gives the row that status.
    ///
    /// # Errors
    ///
    /// In words.
    pub(crate) fn series(&self, id: u32) -> Option<Result<Arc<RunSeries>, String>> {
        let (path, row) = self.place(id)?;
        let is_unfinished = matches!(row.status, "running" | "stopped");
        let series = self.kept_series(&path, id, is_unfinished);
        Some(series.map_err(|(status, words)| {
            if let Some(status) = status {
                self.state().mark(id, status, &words);
            }
            words
        }))
    }

    fn kept_series(&self, path: &Path, id: u32, is_unfinished: bool) -> Series {
        let files = ["summary.json", "provenance.json", "steps.parquet", RECORDING];
        let files = files.map(|name| path.join(name));
        let stamp = Stamp::of(files.iter().map(PathBuf::as_path));
        let kept = || self.series.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((_, series)) = kept().by_id.get(&id).filter(|(own, _)| *own == stamp) {
            return series.clone();
        }
        let made = if is_unfinished {
            series::unfinished(path).map(Arc::new)
        } else {
            self.open(path).map_err(|words| (None, words)).and_then(|folder| {
                let summary = RunSummary::of(&folder).map_err(|error| (None, error.to_string()))?;
                series::series(&folder, &summary).map(Arc::new)
            })
        };
        let mut kept = kept();
        if kept.by_id.insert(id, (stamp, made.clone())).is_none() {
            kept.order.push_back(id);
            if MOST_SERIES < kept.order.len()
                && let Some(oldest) = kept.order.pop_front()
            {
                kept.by_id.remove(&oldest);
            }
        }
        made
    }
}

impl State {
    fn entry(&mut self, found: &Found) -> &mut Entry {
        let next_id = &mut self.next_id;
        self.entries.entry(found.place.clone()).or_insert_with(|| {
            *next_id += 1;
            Entry {
                id: *next_id,
                path: found.path.clone(),
                kind: found.kind,
                stamp: None,
                row: None,
                settings: Numbered::new(),
                change: 0,
            }
        })
    }

    /// Takes what was read. Returns whether keys may differ that did not before.
    fn put(&mut self, found: &Found, stamp: (Stamp, Option<u64>), read: Option<Read>) -> bool {
        let (row, settings) =
            read.map_or((None, Vec::new()), |read| (Some(read.row), read.settings));
        let settings = self.texts.numbered(&settings);
        let change = self.change + 1;
        let entry = self.entry(found);
        entry.stamp = Some(stamp);
        entry.kind = found.kind;
        let varied =
            |row: &Option<Row>| row.as_ref().map(|row| row.varied.clone()).unwrap_or_default();
        let has_settings = entry.settings != settings || varied(&entry.row) != varied(&row);
        if entry.row == row && !has_settings {
            return false;
        }
        let id = entry.id;
        let is_gone = row.is_none() && entry.row.is_some();
        entry.row = row;
        entry.settings = settings;
        entry.change = change;
        self.change = change;
        if is_gone {
            self.remember_removed(id);
        }
        has_settings
    }

    fn remove(&mut self, place: &str) -> bool {
        let Some(entry) = self.entries.remove(place) else { return false };
        if entry.row.is_some() {
            self.change += 1;
            self.remember_removed(entry.id);
        }
        !entry.settings.is_empty() || entry.row.is_some_and(|row| !row.varied.is_empty())
    }

    /// Gives a row the status of a file that was found to be wrong when it was opened.
    fn mark(&mut self, id: u32, status: &'static str, words: &str) {
        let change = self.change + 1;
        let Some(entry) = self.entries.values_mut().find(|entry| entry.id == id) else { return };
        if let Some(row) = entry.row.as_mut().filter(|row| row.has_series) {
            row.status = status;
            row.words = Some(words.to_owned());
            row.has_series = false;
            entry.change = change;
            self.change = change;
        }
    }

    fn remember_removed(&mut self, id: u32) {
        if self.removed.len() < MOST_REMOVED {
            self.removed.push((self.change, id));
            return;
        }
        // Whoever knows less than all of this gets all rows, which therefore have later changes.
        self.removed.clear();
        self.forgotten = self.change;
        for entry in self.entries.values_mut() {
            self.change += 1;
            entry.change = self.change;
        }
    }

    /// Finds the keys that differ. If these are others than before, all rows of runs have changed.
    fn find_differing(&mut self) {
        let rows = self.entries.values().filter_map(|entry| entry.row.as_ref());
        let varied: BTreeSet<u32> =
            rows.flat_map(|row| row.varied.keys()).map(|key| self.texts.number(key)).collect();
        let runs = self.entries.values().filter(|entry| !entry.settings.is_empty());
        let differing = self.texts.differing(runs.map(|entry| &entry.settings), &varied);
        if differing == self.differing {
            return;
        }
        self.differing = differing;
        for entry in self.entries.values_mut().filter(|entry| !entry.settings.is_empty()) {
            self.change += 1;
            entry.change = self.change;
        }
    }

    /// A row as the page gets it.
    fn shown(&self, entry: &Entry, report_of: impl Fn(u32) -> String) -> Value {
        let mut shown = json!(entry.row);
        let has_report = entry.row.as_ref().is_some_and(|row| row.has_report);
        shown["report"] = json!(has_report.then(|| report_of(entry.id)));
        shown["id"] = json!(entry.id);
        shown["path"] = json!(entry.path.display().to_string());
        let settings = self.texts.values(&entry.settings, &self.differing);
        shown["settings"] = Value::Object(settings);
        shown
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use input::result::Trust;

    fn answer(folder: &Path, name: &str, sentence: &str) {
        let text = format!("{{\"schema\": \"power/1\", \"sentence\": \"{sentence}\"}}");
        std::fs::write(folder.join(name), text).unwrap();
    }

    fn changes(table: &ResultsTable, since: u64) -> (Vec<String>, Value) {
        table.state().looked = None;
        let changes = table.changes(since, |id| id.to_string());
        let rows = changes["rows"].as_array().unwrap().iter();
        (rows.map(|row| row["name"].as_str().unwrap().to_owned()).collect(), changes)
    }

    #[test]
    fn a_page_is_told_what_is_new_and_what_is_gone() {
        let folder = tempfile::tempdir().unwrap();
        let table = ResultsTable::new(folder.path(), Trust::Checked.into());
        assert!(!table.has_any());
        answer(folder.path(), "a.json", "one");
        answer(folder.path(), "b.json", "one");
        std::fs::write(folder.path().join("c.json"), "{}").unwrap();
        assert!(table.has_any());
        let (names, first) = changes(&table, 0);
        assert_eq!(
            (names, &first["is_all"]),
            (vec!["a.json".to_owned(), "b.json".to_owned()], &json!(true))
        );
        let since = first["change"].as_u64().unwrap();
        assert!(changes(&table, since).0.is_empty());
        answer(folder.path(), "b.json", "another one");
        std::fs::remove_file(folder.path().join("a.json")).unwrap();
        let (names, second) = changes(&table, since);
        assert_eq!((names, &second["removed"]), (vec!["b.json".to_owned()], &json!([1])));
        assert_eq!(second["is_all"], false);
        // A file that is no answer any more.
        std::fs::write(folder.path().join("b.json"), "{\"schema\": \"import/1\"}").unwrap();
        let since = second["change"].as_u64().unwrap();
        let (names, third) = changes(&table, since);
        assert_eq!((names, &third["removed"]), (vec![], &json!([2])));
    }

    #[test]
    fn a_page_that_knows_too_little_gets_all_rows_once() {
        let folder = tempfile::tempdir().unwrap();
        for number in 0..=MOST_ROWS {
            answer(folder.path(), &format!("{number}.json"), "one");
        }
        let table = ResultsTable::new(folder.path(), Trust::Checked.into());
        let (_, mut first) = changes(&table, 0);
        while first["n_unread"] != 0 {
            first = changes(&table, 0).1;
        }
        assert_eq!(
            (&first["has_more"], first["rows"].as_array().unwrap().len()),
            (&json!(true), MOST_ROWS)
        );
        for id in 0..=MOST_REMOVED {
            table.state().change += 1;
            table.state().remember_removed(u32::MAX - id as u32);
        }
        let (names, all) = changes(&table, first["change"].as_u64().unwrap());
        assert_eq!(
            (names.len(), &all["is_all"], &all["has_more"]),
            (MOST_ROWS, &json!(true), &json!(true))
        );
        let (names, rest) = changes(&table, all["change"].as_u64().unwrap());
        assert_eq!(
            (names.len(), &rest["is_all"], &rest["has_more"]),
            (1, &json!(false), &json!(false))
        );
    }
}
