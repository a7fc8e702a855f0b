//! A row of a run or a sweep that is being recorded, or was killed.

use crate::listing::Found;
use crate::read::{Read, settings_of};
use crate::row::{Progress, Row};
use input::result::ResultFolder;
use proto::bounds::Bound;
use record::lock::{LockHolder, writer_of};
use record::run_log;
use std::path::Path;

/// More of a log or a configuration is not read.
const MOST_BYTES: Bound =
    Bound { what: "size of a file of an unfinished run (bytes)", most: 4 << 20 };

/// The trials of a longer journal of a sweep are not counted.
const MOST_JOURNAL_BYTES: Bound = Bound {
    what: "size of the journal of a sweep whose trials are counted (bytes)",
    most: 64 << 20,
};

/// What is between the name of a run and the number of its process, in the folder in which it is being recorded.
const PARTIAL: &str = ".partial-";

/// The name of the run that is recorded in a folder of this name, and the number of the process that does; `None`: it is no such
/// folder.
pub(crate) fn name_of_partial(folder: &str) -> Option<(&str, u32)> {
    let (name, process) = folder.strip_prefix('.')?.rsplit_once(PARTIAL)?;
    let process = process.split('-').next()?.parse().ok()?;
    (!name.is_empty()).then_some((name, process))
}

/// Whether someone is writing there.
pub(crate) fn is_running(path: &Path) -> bool {
    let (Some(out), Some(folder)) =
        (path.parent(), path.file_name().and_then(|name| name.to_str()))
    else {
        return false;
    };
    match name_of_partial(folder) {
        Some((name, process)) => {
            writer_of(out, name).is_some_and(|LockHolder { process: own, .. }| own == process)
        }
        None => writer_of(out, folder).is_some(),
    }
}

/// Reads how far it is.
pub(crate) fn unfinished(found: &Found, is_running: bool) -> Read {
    let folder_name = found.path.file_name().and_then(|name| name.to_str()).unwrap_or_default();
    let partial = name_of_partial(folder_name).map(|(name, _)| name);
    let name = partial.map_or_else(
        || found.place.clone(),
        |name| match found.place.rsplit_once('/') {
            Some((before, _)) => format!("{before}/{name}"),
            None => name.to_owned(),
        },
    );
    let mut row = Row {
        name,
        kind: if partial.is_some() { "run" } else { "sweep" }.to_owned(),
        status: if is_running { "running" } else { "stopped" },
        when_unix_s: found.stamp.changed_unix_s(),
        ..Row::default()
    };
    // It is being written, or nobody has finished it: there is nothing yet to check it against.
    let folder = ResultFolder::unchecked(&found.path);
    let log = folder.text(&MOST_BYTES, run_log::FILE).unwrap_or_default();
    if partial.is_none() {
        let journal = folder.text(&MOST_JOURNAL_BYTES, "trials.jsonl").ok();
        let done = journal.map(|journal| journal.lines().count() as u64);
        row.progress = done.zip(trials(&log)).map(|(done, of)| Progress { done, of });
    }
    let settings = if partial.is_some() {
        let config = folder.text(&MOST_BYTES, "config.toml").unwrap_or_default();
        let table: toml::Table = config.parse().unwrap_or_default();
        let seed = table.get("experiment").and_then(|section| section.get("seed"));
        row.seed = seed.and_then(toml::Value::as_integer).and_then(|seed| seed.try_into().ok());
        let (progress, words) = latest(&log);
        row.progress = progress;
        row.words = words;
        settings_of(&config)
    } else {
        Vec::new()
    };
    if !is_running {
        let what = if partial.is_some() {
            format!("was killed; `murmuration recover {}` makes results of it", found.place)
        } else {
            "was stopped; start the same sweep again to finish it".to_owned()
        };
        row.words = Some(what);
    }
    Read { row, settings }
}

/// What the orchestrator said, line by line, the latest first.
fn said(log: &str) -> impl Iterator<Item = &str> {
    log.lines().rev().filter_map(|line| Some(line.split_once(" orchestrator: ")?.1))
}

/// How far a run is by its log, and what it does.
fn latest(log: &str) -> (Option<Progress>, Option<String>) {
    for line in said(log) {
        let step = line.strip_prefix("step ").and_then(|rest| {
            let (numbers, time) = rest.split_once(", ")?;
            let (done, of) = numbers.split_once(" of ")?;
            let progress = Progress { done: done.parse().ok()?, of: of.parse().ok()? };
            Some((Some(progress), Some(time.to_owned())))
        });
        let begun = line.strip_prefix("at most ").and_then(|rest| {
            let of = rest.strip_suffix(" steps follow")?.parse().ok()?;
            Some((Some(Progress { done: 0, of }), None))
        });
        let forming = line.strip_prefix("network formation: ");
        let forming = forming.map(|_| (None, Some(line.to_owned())));
        if let Some(found) = step.or(begun).or(forming) {
            return found;
        }
    }
    (None, None)
}

/// How many trials a sweep has by its log.
fn trials(log: &str) -> Option<u64> {
    said(log).find_map(|line| {
        line.strip_prefix("sweep of ")?.split_once(" trials")?.0.replace(',', "").parse().ok()
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_progress_is_the_latest_that_the_log_has() {
        let log = "2026-01-01T00:00:00.000Z orchestrator: at most 200 steps follow\n\
            2026-01-01T00:00:01.000Z orchestrator: step 20 of 200, 2.0 s simulated\n\
            2026-01-01T00:00:01.500Z netsim: step 99 of 99, 9.0 s simulated\n\
            2026-01-01T00:00:02.000Z orchestrator: warning: low on space\n\
            2026-01-01T00:00:03.000Z orch";
        let (progress, words) = latest(log);
        assert_eq!(progress, Some(Progress { done: 20, of: 200 }));
        assert_eq!(words.as_deref(), Some("2.0 s simulated"));
        let first = log.lines().next().unwrap();
        assert_eq!(latest(first), (Some(Progress { done: 0, of: 200 }), None));
        assert_eq!(latest(""), (None, None));
        assert_eq!(trials("… orchestrator: sweep of 9 trials, 2 at a time"), Some(9));
    }

    #[test]
    fn a_folder_of_a_run_that_is_recorded_names_the_run_and_the_process() {
        assert_eq!(name_of_partial(".a.partial-b.partial-12"), Some(("a.partial-b", 12)));
        assert_eq!(name_of_partial(".walk.partial-7-1"), Some(("walk", 7)));
        for other in ["walk", ".walk.lock", ".walk.partial-", "..partial-7", "walk.partial-7"] {
            assert_eq!(name_of_partial(other).map(|(name, _)| name), None, "{other}");
        }
    }
}
