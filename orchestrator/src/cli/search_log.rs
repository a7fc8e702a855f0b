//! The log of a search for missing effects.

use diagnose::progress::SearchProgress;
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

/// How often a search logs how many candidates it has tried.
const LOG_EVERY: Duration = Duration::from_secs(5);

/// Logs the progress of a search, with the time left.
pub(super) struct SearchLog {
    /// When the round began, and when a count was logged last.
    times: Mutex<(Instant, Instant)>,
}

impl SearchLog {
    pub(super) fn new() -> Self {
        let now = Instant::now();
        Self { times: Mutex::new((now, now)) }
    }

    pub(super) fn log(&self, progress: SearchProgress<'_>) {
        let mut times = self.times.lock().unwrap_or_else(PoisonError::into_inner);
        match progress {
            SearchProgress::Round { round } => {
                *times = (Instant::now(), Instant::now());
                tracing::info!("round {round}: fitting candidate effects");
            }
            SearchProgress::Tried { round, done, of } => {
                if times.1.elapsed() < LOG_EVERY {
                    return;
                }
                times.1 = Instant::now();
                let left_s = times.0.elapsed().as_secs_f64() * (of - done) as f64 / done as f64;
                tracing::info!(
                    "round {round}: {done} of {of} candidates fitted, about {left_s:.0} s left"
                );
            }
            SearchProgress::Accepted { name } => tracing::info!("+ {name}"),
            SearchProgress::Exchanged { new, old } => {
                tracing::info!("{new} replaces {}", old.join(", "));
            }
            SearchProgress::Removed { name } => tracing::info!("- {name}"),
            SearchProgress::Ties => tracing::info!("collecting indistinguishable candidates"),
        }
    }
}
