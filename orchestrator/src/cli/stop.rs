//! What ends a search of measurements early: Ctrl-C, SIGTERM, or a time budget. Fits under way end early, and partial results are
//! printed.

use super::Failure;
use clap::Args;
use run::interrupt::on_signal;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};
use study::StopFlag;
use terminal::warn;

/// Longest budget (s): a year.
const LONGEST_S: f64 = 365.0 * 86_400.0;

/// How long a search may take.
#[derive(Args, Clone, Copy)]
pub(super) struct BudgetArgs {
    /// Stop after this wall time (s), and print the partial answer. It depends on the speed of the machine [default:
    /// no limit]
    #[arg(long, value_name = "S", value_parser = budget_s)]
    budget: Option<f64>,
}

fn budget_s(text: &str) -> Result<f64, String> {
    let seconds: Option<f64> = text.parse().ok();
    seconds.filter(|seconds| 0.0 < *seconds && *seconds <= LONGEST_S).ok_or_else(|| {
        format!("must be a number of seconds greater than 0 and at most {LONGEST_S}")
    })
}

/// Listens for what ends a search early.
pub(super) struct Stopper {
    flag: StopFlag,
    begun: Instant,
    budget: Option<Duration>,
    is_interrupted: Arc<AtomicBool>,
}

impl Stopper {
    /// Listens from now on: the flag is set with the first signal, or when the time is over. A second signal ends the process.
    pub(super) fn listen(args: BudgetArgs) -> Result<Self, Failure> {
        let begun = Instant::now();
        let budget = args.budget.map(Duration::from_secs_f64);
        let flag = StopFlag::default();
        let is_interrupted = Arc::new(AtomicBool::new(false));
        let (of_signal, interrupted) = (flag.clone(), is_interrupted.clone());
        let interrupt = move |name| {
            interrupted.store(true, Ordering::Relaxed);
            of_signal.set();
            warn(format!("{name}: partial results follow; press Ctrl-C again to abort"));
        };
        on_signal(interrupt).map_err(Failure::work)?;
        if let Some(budget) = budget {
            let of_clock = flag.clone();
            let clock = move || {
                std::thread::sleep(budget);
                of_clock.set();
            };
            let thread = std::thread::Builder::new().name("budget".to_owned());
            thread.spawn(clock).map_err(Failure::work)?;
        }
        Ok(Self { flag, begun, budget, is_interrupted })
    }

    /// The flag that is set.
    pub(super) fn flag(&self) -> &StopFlag {
        &self.flag
    }

    /// When the work began.
    pub(super) fn begun(&self) -> Instant {
        self.begun
    }

    /// How long it may take.
    pub(super) fn budget(&self) -> Option<Duration> {
        self.budget
    }

    /// Why the work was stopped.
    fn reason(&self) -> String {
        match self.budget {
            Some(budget) if !self.is_interrupted.load(Ordering::Relaxed) => {
                format!("the time budget of {} s is over", budget.as_secs_f64())
            }
            _ => "interrupted".to_owned(),
        }
    }

    /// Reports that an answer, which was printed and written, is partial: as a failure after a signal, and as a warning where the
    /// budget was asked for.
    pub(super) fn require_complete(&self, is_complete: bool) -> Result<(), Failure> {
        if is_complete {
            return Ok(());
        }
        let text = format!(
            "{}: the search did not finish, and any results printed above are partial",
            self.reason()
        );
        if self.is_interrupted.load(Ordering::Relaxed) {
            return Err(Failure::work(text));
        }
        warn(text);
        Ok(())
    }

    /// Refuses to write a configuration from a search that did not finish.
    pub(super) fn refuse_partial(&self, hint: &str) -> Failure {
        Failure::work(format!(
            "{}: the search did not finish, and nothing was written. {hint}",
            self.reason()
        ))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_budget_is_a_positive_number_of_seconds() {
        assert_eq!(budget_s("0.5"), Ok(0.5));
        assert_eq!(budget_s("31536000"), Ok(LONGEST_S));
        for text in ["0", "-1", "inf", "NaN", "soon", "31536001"] {
            let error = budget_s(text).unwrap_err();
            assert!(error.contains("at most 31536000"), "{text}: {error}");
        }
    }
}
