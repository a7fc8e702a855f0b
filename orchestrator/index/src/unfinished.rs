//! A row of a run or a sweep that is being recorded, or was killed.

use crate::listing::{Found, is_file};
use crate::read::{Read, settings_of};
use crate::row::{Progress, Row};
use experiment::program_name;
use input::result::ResultFolder;
use proto::bounds::Bound;
use record::leftover::Leftover;
use record::lock::{LockHolder, writer_of};
use record::run_log;
use std::fs::File;
use std::io::{self, Read as _, Seek as _, SeekFrom};
use std::path::Path;

/// More of a log or a configuration is not read.
const MOST_BYTES: Bound =
    Bound { what: "size of a file of an unfinished run (bytes)", most: 4 << 20 };

/// The trials of a longer journal of a sweep are not counted.
pub(crate) const MOST_JOURNAL_BYTES: Bound = Bound {
    what: "size of the journal of a sweep whose trials are counted (bytes)",
    most: 64 << 20,
};

/// What a run records while it lasts.
pub(crate) const RECORDING: &str = "run.mcap";

/// What is between the name of a run and the number of its process, in the folder in which it is being recorded.
const PARTIAL: &str = ".partial-";

/// The name of the run that is recorded in a folder of this name, and the number of the process that does; `None`: it is no such
/// folder.
pub(crate) fn name_of_partial(folder: &str) -> Option<(&str, u32)> {
    let (name, process) = folder.strip_prefix('.')?.rsplit_once(PARTIAL)?;
    let process = process.split('-').next()?.parse().ok()?;
    (!name.is_empty()).then_some((name, process))
}

/// Steps are counted in a recording of so many bytes; those of a longer one follow from the time that it reaches.
const MOST_COUNTED_BYTES: u64 = 4 << 20;
/// Records of a recording that are passed over, at most.
const MOST_RECORDS: usize = 100_000;
/// The first bytes of an MCAP file.
const MAGIC_BYTES: u64 = 8;
/// What a record of an MCAP file begins with: its kind, and its length.
const RECORD_HEAD_BYTES: usize = 9;
/// The kind of a record that is a chunk: the times of its first and last message come first in it.
const CHUNK: u8 = 6;

/// Since when someone is writing there (Unix time, s); `None`: nobody is.
pub(crate) fn running_since(path: &Path) -> Option<u64> {
    let (out, folder) = (path.parent()?, path.file_name()?.to_str()?);
    let holder = match name_of_partial(folder) {
        Some((name, process)) => {
            writer_of(out, name).filter(|LockHolder { process: own, .. }| *own == process)
        }
        None => writer_of(out, folder),
    };
    Some(holder?.since_unix_s)
}

/// How many steps a recording holds.
fn recorded_steps(path: &Path) -> Option<u64> {
    let recording = path.join(RECORDING);
    let length = std::fs::metadata(&recording).ok()?.len();
    let mut leftover = Leftover::open(path).ok()?;
    leftover.configured().ok()?;
    let first = leftover.next_step()?;
    if MOST_COUNTED_BYTES < length {
        let step_ns = first.time_ns / first.step.max(1);
        return recorded_until_ns(&recording).ok()?.checked_div(step_ns);
    }
    let mut n_steps = first.step;
    while let Some(step) = leftover.next_step() {
        n_steps = step.step;
    }
    Some(n_steps)
}

/// The time that a recording reaches (ns), from the heads of its chunks.
fn recorded_until_ns(recording: &Path) -> io::Result<u64> {
    let mut file = File::open(recording)?;
    file.seek(SeekFrom::Start(MAGIC_BYTES))?;
    let mut until_ns = 0;
    for _ in 0..MOST_RECORDS {
        let mut head = [0; RECORD_HEAD_BYTES];
        if file.read_exact(&mut head).is_err() {
            break;
        }
        let [kind, length @ ..] = head;
        let Ok(length) = i64::try_from(u64::from_le_bytes(length)) else { break };
        let mut times = [0; 16];
        let is_chunk = kind == CHUNK && times.len() as i64 <= length;
        if is_chunk && file.read_exact(&mut times).is_err() {
            break;
        }
        let [.., a, b, c, d, e, f, g, h] = times;
        until_ns = until_ns.max(u64::from_le_bytes([a, b, c, d, e, f, g, h]));
        file.seek_relative(if is_chunk { length - times.len() as i64 } else { length })?;
    }
    Ok(until_ns)
}

/// Reads how far it is.
pub(crate) fn unfinished(found: &Found, since_unix_s: Option<u64>) -> Read {
    let is_running = since_unix_s.is_some();
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
        when_unix_s: since_unix_s.map(|since| since as f64).or(found.stamp.changed_unix_s()),
        has_series: partial.is_some() && is_file(&found.path.join(RECORDING)),
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
        row.progress = progress.map(|Progress { done, of }| {
            let counted = recorded_steps(&found.path).unwrap_or(0);
            Progress { done: done.max(counted), of }
        });
        row.words = words;
        settings_of(&config)
    } else {
        Vec::new()
    };
    if !is_running {
        let what = if partial.is_some() {
            let folder = in_shell(&found.path.display().to_string());
            row.command = Some(format!("{} recover {folder}", program_name()));
            "was killed; recover it to get its results"
        } else {
            "was stopped; start the same sweep again to finish it"
        };
        row.words = Some(what.to_owned());
    }
    Read { row, settings }
}

/// A word as a shell takes it.
fn in_shell(word: &str) -> String {
    let is_plain = |c: char| c.is_alphanumeric() || "/._-+=:@,%".contains(c);
    if !word.is_empty() && word.chars().all(is_plain) {
        return word.to_owned();
    }
    format!("'{}'", word.replace('\'', "'\\''"))
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
    fn the_time_that_a_recording_reaches_is_that_of_its_last_chunk() {
        let folder = tempfile::tempdir().unwrap();
        let recording = folder.path().join(RECORDING);
        let record = |kind: u8, content: &[u8]| {
            [&[kind][..], &(content.len() as u64).to_le_bytes(), content].concat()
        };
        let chunk = |from_ns: u64, until_ns: u64| {
            record(CHUNK, &[&from_ns.to_le_bytes()[..], &until_ns.to_le_bytes(), &[0; 50]].concat())
        };
        let mut content = [0; MAGIC_BYTES as usize].to_vec();
        content.extend(record(1, &[7; 30]));
        content.extend([chunk(0, 500), record(7, &[9; 5]), chunk(600, 900)].concat());
        // The last one is being written.
        content.extend(&chunk(1000, 2000)[..20]);
        std::fs::write(&recording, &content).unwrap();
        assert_eq!(recorded_until_ns(&recording).unwrap(), 900);
    }

    #[test]
    fn a_word_is_one_word_of_a_shell() {
        assert_eq!(in_shell("runs/.walk.partial-7"), "runs/.walk.partial-7");
        assert_eq!(in_shell("my runs/it's"), "'my runs/it'\\''s'");
        assert_eq!(in_shell(""), "''");
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
