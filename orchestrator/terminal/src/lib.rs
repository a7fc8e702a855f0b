//! What a person reads while it works: results on standard output, progress and errors on standard error.

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use proto::types::{Formation, seconds};
use record::run_log::RunLog;
use run::Audience;
use std::ffi::OsString;
use std::fmt::{Display, Write as _};
use std::io::{ErrorKind, IsTerminal as _, Write as _};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, OnceLock, PoisonError};
use std::time::{Duration, Instant};

/// The log of the run or sweep that this program makes.
pub fn run_log() -> &'static RunLog {
    static LOG: OnceLock<RunLog> = OnceLock::new();
    LOG.get_or_init(RunLog::default)
}

/// Standard error, whose lines go to the log of the run, too.
pub struct LoggedStderr;

impl std::io::Write for LoggedStderr {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        // The logger hands over whole lines.
        run_log().add("orchestrator", String::from_utf8_lossy(bytes).trim_end());
        std::io::stderr().write(bytes)
    }

    fn flush(&mut self) -> std::io::Result<()> {
        std::io::stderr().flush()
    }
}

/// Standard output belongs to an answer: what people read goes to standard error.
static IS_ANSWER_ON_STDOUT: AtomicBool = AtomicBool::new(false);

/// Leaves standard output to the answer of a command, if an option says so.
pub fn leave_stdout_to_answers(arguments: impl Iterator<Item = OsString>) {
    const OPTIONS: [&str; 5] = ["--json", "--report", "--output", "--svg", "--emit-to"];
    let mut value_is_next = false;
    for argument in arguments {
        let text = argument.to_string_lossy();
        let is_dash = value_is_next && text == "-"
            || OPTIONS.iter().any(|option| text.strip_prefix(option) == Some("=-"));
        if is_dash {
            IS_ANSWER_ON_STDOUT.store(true, Ordering::Relaxed);
        }
        value_is_next = OPTIONS.contains(&&*text);
    }
}

/// The first error of standard output, other than that nobody reads it.
static STDOUT_ERROR: Mutex<Option<std::io::Error>> = Mutex::new(None);

/// A line on standard output, or on standard error where that holds an answer. That nobody reads it is no failure; any other error is
/// kept for [`stdout_error`].
pub fn say(line: impl Display) {
    let line = readable(line);
    if IS_ANSWER_ON_STDOUT.load(Ordering::Relaxed) {
        let _ = writeln!(std::io::stderr(), "{line}");
        return;
    }
    let written = writeln!(std::io::stdout(), "{line}");
    if let Err(error) = written
        && error.kind() != ErrorKind::BrokenPipe
    {
        let mut first = STDOUT_ERROR.lock().unwrap_or_else(PoisonError::into_inner);
        first.get_or_insert(error);
    }
}

/// Why not all lines could be written to standard output, such as a full disk. `None`: they were, or nobody reads them.
pub fn stdout_error() -> Option<std::io::Error> {
    let flushed = std::io::stdout().flush().err();
    let flushed = flushed.filter(|error| error.kind() != ErrorKind::BrokenPipe);
    STDOUT_ERROR.lock().unwrap_or_else(PoisonError::into_inner).take().or(flushed)
}

/// Text in which what a terminal obeys is written out, as in `\u{1b}`: control characters but ends of lines and tabs, and marks that
/// change the direction of text. Names of columns and files may hold them.
#[must_use]
pub fn readable(text: impl Display) -> String {
    let text = text.to_string();
    let is_obeyed = |letter: char| {
        letter.is_control() && !matches!(letter, '\n' | '\t')
            || matches!(letter, '\u{200e}' | '\u{200f}' | '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}')
    };
    if !text.contains(is_obeyed) {
        return text;
    }
    let mut shown = String::with_capacity(text.len());
    for letter in text.chars() {
        if is_obeyed(letter) {
            shown.extend(letter.escape_unicode());
        } else {
            shown.push(letter);
        }
    }
    shown
}

/// An error on standard error.
pub fn complain(error: impl Display) {
    let _ = writeln!(std::io::stderr(), "error: {}", readable(error));
}

/// A warning on standard error: something to check before the results are trusted.
pub fn warn(warning: impl Display) {
    let warning = readable(warning);
    run_log().add("orchestrator", &format!("warning: {warning}"));
    let _ = writeln!(std::io::stderr(), "warning: {warning}");
}

/// Warnings on standard error, a line each.
pub fn warn_all(warnings: impl IntoIterator<Item = impl Display>) {
    warnings.into_iter().for_each(warn);
}

/// Something that happened, on standard error.
pub fn note(text: impl Display) {
    let text = readable(text);
    run_log().add("orchestrator", &text);
    let _ = writeln!(std::io::stderr(), "{text}");
}

/// A run as a person sees it: its warnings, and how far it is.
#[derive(Default)]
pub struct Screen {
    progress: Option<ProgressDisplay>,
}

impl Audience for Screen {
    fn warn(&mut self, warning: &str) {
        warn(warning);
    }

    fn note(&mut self, note: &str) {
        let _ = writeln!(std::io::stderr(), "{}", readable(note));
    }
}

impl drive::ProgressObserver for Screen {
    fn begin(&mut self, n_steps: u64) {
        self.progress = Some(ProgressDisplay::new(n_steps));
    }

    fn step_done(&mut self, step: u64, time_ns: u64) {
        if let Some(progress) = &mut self.progress {
            progress.step_done(step, time_ns);
        }
    }

    fn forming(&mut self, step: u64, time_ns: u64, limit_ns: u64, formation: &Formation, n: usize) {
        if let Some(progress) = &mut self.progress {
            progress.forming(step, time_ns, limit_ns, formation, n);
        }
    }

    fn end(&mut self) {
        if let Some(progress) = self.progress.take() {
            progress.finish();
        }
    }
}

/// Step, simulated time, rate and time left: a bar on a terminal, a line every few seconds elsewhere.
pub struct ProgressDisplay {
    bar: Option<ProgressBar>,
    n_steps: u64,
    begun: Instant,
    shown: Instant,
}

/// How often a line is printed where there is no terminal.
const LINE_EVERY: Duration = Duration::from_secs(5);
/// How often the bar is drawn.
const FRAME_EVERY: Duration = Duration::from_millis(100);

impl ProgressDisplay {
    /// For a run of at most `n_steps`.
    #[must_use]
    pub fn new(n_steps: u64) -> Self {
        Self::with_template(n_steps, "{bar:30} {msg}")
    }

    /// For work of `n` stages, of which nobody knows how long they take. On a terminal the time used is shown.
    #[must_use]
    pub fn stages(n: u64) -> Self {
        let display = Self::with_template(n, "{bar:30} {msg}  {elapsed}");
        if let Some(bar) = &display.bar {
            bar.enable_steady_tick(FRAME_EVERY);
        }
        display
    }

    fn with_template(n_steps: u64, template: &str) -> Self {
        let bar = std::io::stderr().is_terminal().then(|| {
            let style = ProgressStyle::with_template(template)
                .unwrap_or_else(|_| ProgressStyle::default_bar());
            ProgressBar::with_draw_target(Some(n_steps), ProgressDrawTarget::stderr_with_hz(10))
                .with_style(style)
        });
        let now = Instant::now();
        Self { bar, n_steps, begun: now, shown: now }
    }

    /// Stage `number`, from 1, begins.
    pub fn stage(&mut self, number: u64, what: &str) {
        let line = format!("step {number} of {}: {what}", self.n_steps);
        self.show(number.saturating_sub(1), line);
    }

    /// `done` of `n` trials are done, `n_now` of them since this began.
    pub fn trials(&mut self, done: u64, n: u64, n_now: u64) {
        if self.is_due() || n <= done {
            self.show(done, format!("{done} of {n} trials{}", self.speed(done, n, n_now)));
        }
    }

    /// `done` of `n` trials are done on other machines, `n_now` of them since this began; `activity` says what tasks are doing.
    pub fn shards(&mut self, done: u64, n: u64, n_now: u64, activity: &str) {
        if activity.is_empty() || !self.is_due() {
            return;
        }
        let speed = if n_now == 0 { String::new() } else { self.speed(done, n, n_now) };
        self.show(done, format!("{done} of {n} trials{speed}  ({activity})"));
    }

    /// Writes to standard error while the bar is away.
    pub fn aside(&self, write: impl FnOnce()) {
        match &self.bar {
            Some(bar) => bar.suspend(write),
            None => write(),
        }
    }

    /// `done` of `n` frames of a video are drawn.
    pub fn frames(&mut self, done: u64, n: u64) {
        if self.is_due() {
            self.show(done, format!("{done} of {n} frames{}", self.speed(done, n, done)));
        }
    }

    /// How many of `n` are done a second, and how long the rest takes. `n_now`: those that were done since this began.
    fn speed(&self, done: u64, n: u64, n_now: u64) -> String {
        let rate = n_now as f64 / self.begun.elapsed().as_secs_f64();
        let left_s = n.saturating_sub(done) as f64 / rate;
        format!("  {rate:.1} a second  {left_s:.0} s left")
    }

    /// Step `step` is done and stands at `time_ns`.
    fn step_done(&mut self, step: u64, time_ns: u64) {
        if !self.is_time(step) {
            return;
        }
        let rate = step as f64 / self.begun.elapsed().as_secs_f64();
        let left_s = self.n_steps.saturating_sub(step) as f64 / rate;
        let line = format!(
            "step {step}/{}  {:.1} s simulated  {rate:.0} steps/s  {left_s:.0} s left",
            self.n_steps,
            seconds(time_ns)
        );
        self.show(step, line);
    }

    /// Step `step` of `formation` is done and stands at `time_ns` of at most `limit_ns`; there are `n` motes.
    fn forming(&mut self, step: u64, time_ns: u64, limit_ns: u64, formation: &Formation, n: usize) {
        if !self.is_time(step) {
            return;
        }
        let mut line = format!(
            "network formation: {} of {n} motes ready  {:.1} s simulated of at most {} s",
            n.saturating_sub(formation.missing.len()),
            seconds(time_ns),
            seconds(limit_ns)
        );
        for (words, motes) in formation.by_reason() {
            let _ = write!(line, "; {words}: {}", motes.len());
        }
        self.show(step, line);
    }

    fn is_time(&mut self, step: u64) -> bool {
        // The clock is not looked at more often than a person could tell.
        (self.bar.is_some() || step.is_multiple_of(16)) && self.is_due()
    }

    /// Whether it is time for the next line.
    fn is_due(&mut self) -> bool {
        let every = if self.bar.is_some() { FRAME_EVERY } else { LINE_EVERY };
        let is_due = every <= self.shown.elapsed();
        if is_due {
            self.shown = Instant::now();
        }
        is_due
    }

    fn show(&self, step: u64, line: String) {
        let line = readable(line);
        match &self.bar {
            Some(bar) => {
                bar.set_position(step);
                bar.set_message(line);
            }
            None => {
                let _ = writeln!(std::io::stderr(), "{line}");
            }
        }
    }

    /// Removes the bar.
    pub fn finish(self) {
        if let Some(bar) = self.bar {
            bar.finish_and_clear();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_terminal_obeys_is_written_out() {
        let name = "a\u{1b}[2J\rb\u{9b}31m\u{202e}c\u{7f}";
        assert_eq!(readable(name), "a\\u{1b}[2J\\u{d}b\\u{9b}31m\\u{202e}c\\u{7f}");
        assert_eq!(readable("ä\tb\n−3 ±"), "ä\tb\n−3 ±");
    }
}
