//! `run.log`: what happened while a run was made, line by line with the wall time. Outside the promise of identical bytes.

use super::RecordError;
use super::lock::{now, utc};
use std::io::{ErrorKind, Write as _};
use std::path::Path;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use system::File;

/// The file, in the folder of a result.
pub const FILE: &str = "run.log";
/// A log ends here (bytes), but for how the run ended.
const MOST_BYTES: usize = 1 << 20;
/// A line is cut off here (bytes).
const MOST_LINE_BYTES: usize = 4000;
/// Lines are kept for a file that is yet to come, but no more than this (bytes).
const MOST_WAITING_BYTES: usize = 1 << 16;

/// A log that any thread may write. What is written before it has a file is kept for the file. Clones write the same log.
#[derive(Clone, Debug, Default)]
pub struct RunLog {
    state: Arc<Mutex<State>>,
    /// Gets the same lines.
    whole: Option<Box<Self>>,
}

#[derive(Debug, Default)]
struct State {
    file: Option<File>,
    waiting: String,
    n_bytes: usize,
    is_full: bool,
}

/// Copies the log of an earlier part of a run into the folder in which it goes on; there may be none.
///
/// # Errors
///
/// It cannot be read, or not be written.
pub fn carry_over(from: &Path, to: &Path) -> Result<(), RecordError> {
    let path = to.join(FILE);
    match system::copy(&from.join(FILE), &path) {
        Err(source) if source.kind() != ErrorKind::NotFound => {
            Err(RecordError::Write { path, source })
        }
        _ => Ok(()),
    }
}

impl RunLog {
    /// Writes into the folder of a result from now on, first what waits. A log that is there is continued.
    ///
    /// # Errors
    ///
    /// The file cannot be written.
    pub fn open(&self, dir: &Path) -> Result<(), RecordError> {
        let path = dir.join(FILE);
        let opened = File::append(&path).and_then(|file| {
            let mut state = self.state();
            let waiting = std::mem::take(&mut state.waiting);
            state.n_bytes = usize::try_from(file.metadata()?.len()).unwrap_or(MOST_BYTES);
            state.is_full = false;
            state.file.insert(file).write_all(waiting.as_bytes())?;
            state.n_bytes += waiting.len();
            Ok(())
        });
        opened.map_err(|source| RecordError::Create { path, source })
    }

    /// Nothing more is written into the folder; what follows waits for the next one.
    pub fn close(&self) {
        *self.state() = State::default();
    }

    /// A log of a part of the work, whose lines go to this log, too.
    #[must_use]
    pub fn within(&self) -> Self {
        Self { state: Arc::default(), whole: Some(Box::new(self.clone())) }
    }

    /// Writes lines that `who` said. That a line cannot be written is no reason to end a run.
    pub fn add(&self, who: &str, text: &str) {
        self.write(who, text, MOST_BYTES);
        if let Some(whole) = &self.whole {
            whole.add(who, text);
        }
    }

    /// Writes how the run ended, for which there is room in a full log.
    pub fn end(&self, text: &str) {
        self.write("orchestrator", text, usize::MAX);
    }

    fn write(&self, who: &str, text: &str, most_bytes: usize) {
        let now = now();
        let stamp = utc(now.as_secs());
        let stamp = stamp.trim_end_matches(" UTC").replace(' ', "T");
        let mut state = self.state();
        for line in text.lines() {
            let mut cut = line.len().min(MOST_LINE_BYTES);
            while !line.is_char_boundary(cut) {
                cut -= 1;
            }
            let more = if cut < line.len() { "…" } else { "" };
            let millis = now.subsec_millis();
            let line = format!("{stamp}.{millis:03}Z {who}: {}{more}\n", &line[..cut]);
            state.push(&line, most_bytes);
        }
    }

    fn state(&self) -> MutexGuard<'_, State> {
        // A thread that panicked while it wrote has left nothing but an unfinished line.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl State {
    fn push(&mut self, line: &str, most_bytes: usize) {
        let Some(file) = &mut self.file else {
            if self.waiting.len() + line.len() <= MOST_WAITING_BYTES {
                self.waiting.push_str(line);
            }
            return;
        };
        if most_bytes < self.n_bytes + line.len() {
            if !self.is_full {
                self.is_full = true;
                let _ = file.write_all(b"(the log is full: further lines are left out)\n");
            }
            return;
        }
        self.n_bytes += line.len();
        let _ = file.write_all(line.as_bytes());
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_log_is_bounded_and_still_says_how_the_run_ended() {
        let dir = tempfile::tempdir().unwrap();
        let log = RunLog::default();
        log.add("orchestrator", "before there was a folder");
        log.open(dir.path()).unwrap();
        for _ in 0..2000 {
            log.add("netsim", &"ä".repeat(3000));
        }
        log.end("complete");
        log.close();
        log.add("netsim", "of the next run");
        let text = std::fs::read_to_string(dir.path().join(FILE)).unwrap();
        assert!(text.len() < MOST_BYTES + 200, "{}", text.len());
        let lines: Vec<&str> = text.lines().collect();
        assert!(lines[0].ends_with("Z orchestrator: before there was a folder"), "{}", lines[0]);
        assert!(lines[1].ends_with('…') && lines[1].len() < 4100, "{}", lines[1]);
        assert!(lines[lines.len() - 2].contains("the log is full"));
        assert!(lines[lines.len() - 1].ends_with("Z orchestrator: complete"));
        // A run that is continued continues its log.
        log.open(dir.path()).unwrap();
        let longer = std::fs::read_to_string(dir.path().join(FILE)).unwrap();
        assert!(longer.starts_with(&text) && longer.ends_with("netsim: of the next run\n"));
    }
}
