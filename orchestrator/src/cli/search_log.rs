//! The progress of a search for missing effects: a line on a terminal, and the log.

use super::stop::Stopper;
use diagnose::progress::SearchProgress;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::io::IsTerminal as _;
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

/// How often a search logs how many candidates it has tried.
const LOG_EVERY: Duration = Duration::from_secs(5);
/// How often the line on a terminal is drawn.
const FRAME_EVERY: Duration = Duration::from_millis(200);

/// A line on a terminal with what is being done, the time used, and what is left of the budget.
struct ProgressLine(Option<ProgressBar>);

impl ProgressLine {
    /// For work that a stopper watches. Where standard error is no terminal, nothing is shown.
    fn new(stopper: Option<&Stopper>) -> Self {
        let Some(stopper) = stopper.filter(|_| std::io::stderr().is_terminal()) else {
            return Self(None);
        };
        let (begun, budget) = (stopper.begun(), stopper.budget());
        let times = move |_: &indicatif::ProgressState, text: &mut dyn std::fmt::Write| {
            let _ = text.write_str(&times(begun.elapsed(), budget));
        };
        let style = ProgressStyle::with_template("{msg}  {times}")
            .unwrap_or_else(|_| ProgressStyle::default_spinner())
            .with_key("times", times);
        let bar = ProgressBar::with_draw_target(None, ProgressDrawTarget::stderr_with_hz(10));
        bar.set_style(style);
        bar.enable_steady_tick(FRAME_EVERY);
        Self(Some(bar))
    }

    /// Shows what is being done.
    fn show(&self, what: String) {
        if let Some(bar) = &self.0 {
            bar.set_message(what);
        }
    }

    /// Hides the line while something else is printed.
    fn hide_during(&self, print: impl FnOnce()) {
        match &self.0 {
            Some(bar) => bar.suspend(print),
            None => print(),
        }
    }

    /// Removes the line.
    fn clear(&self) {
        if let Some(bar) = &self.0 {
            bar.finish_and_clear();
        }
    }
}

impl Drop for ProgressLine {
    fn drop(&mut self) {
        self.clear();
    }
}

/// Time used, and what is left of the budget, in words.
fn times(used: Duration, budget: Option<Duration>) -> String {
    let used_s = used.as_secs();
    match budget {
        None => format!("{used_s} s used"),
        Some(budget) => {
            let left_s = budget.saturating_sub(used).as_secs();
            format!("{used_s} s used, {left_s} s of the budget left")
        }
    }
}

/// Shows and logs the progress of a search, with the time left in a round.
pub(super) struct SearchLog {
    /// When the round began, and when a count was logged last.
    times: Mutex<(Instant, Instant)>,
    line: ProgressLine,
}

impl SearchLog {
    /// For a search that a stopper watches; `None`: nothing is shown on a terminal.
    pub(super) fn new(stopper: Option<&Stopper>) -> Self {
        let now = Instant::now();
        Self { times: Mutex::new((now, now)), line: ProgressLine::new(stopper) }
    }

    /// Removes the line from the terminal.
    pub(super) fn clear(&self) {
        self.line.clear();
    }

    /// Hides the line while something else is printed.
    pub(super) fn hide_during(&self, print: impl FnOnce()) {
        self.line.hide_during(print);
    }

    /// Shows and logs one step.
    pub(super) fn log(&self, progress: SearchProgress<'_>) {
        let mut times = self.times.lock().unwrap_or_else(PoisonError::into_inner);
        match progress {
            SearchProgress::Round { round } => {
                *times = (Instant::now(), Instant::now());
                self.line.show(format!("round {round}"));
                tracing::info!("round {round}: fitting candidate effects");
            }
            SearchProgress::Tried { round, done, of, name } => {
                let left_s = times.0.elapsed().as_secs_f64() * (of - done) as f64 / done as f64;
                self.line.show(format!(
                    "round {round}: {done} of {of} candidates, about {left_s:.0} s left in the round, last {name}"
                ));
                if times.1.elapsed() < LOG_EVERY {
                    return;
                }
                times.1 = Instant::now();
                tracing::info!(
                    "round {round}: {done} of {of} candidates fitted, about {left_s:.0} s left"
                );
            }
            SearchProgress::Accepted { name } => tracing::info!("+ {name}"),
            SearchProgress::Exchanged { new, old } => {
                tracing::info!("{new} replaces {}", old.join(", "));
            }
            SearchProgress::Removed { name } => tracing::info!("- {name}"),
            SearchProgress::Ties => {
                self.line.show("collecting indistinguishable candidates".to_owned());
                tracing::info!("collecting indistinguishable candidates");
            }
            // The crate `network` logs this itself.
            SearchProgress::Simulating { what } => self.line.show(what.to_owned()),
            SearchProgress::Campaigns { parameter, value, campaigns } => {
                let text = format!("{parameter} = {value:.4}: {campaigns} campaigns");
                tracing::info!("{text}");
                self.line.show(text);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_time_left_of_a_budget_never_falls_below_zero() {
        let seconds = Duration::from_secs;
        assert_eq!(times(seconds(12), None), "12 s used");
        assert_eq!(times(seconds(12), Some(seconds(60))), "12 s used, 48 s of the budget left");
        assert_eq!(times(seconds(61), Some(seconds(60))), "61 s used, 0 s of the budget left");
    }
}
