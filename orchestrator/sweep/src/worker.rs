//! A thread that runs trials one after another, on two simulators of its own.

use super::journal::{FAILED, TrialRow};
use super::plan::{SweepPlan, SweepTrial};
use super::results;
use super::{Work, figures};
use drive::peer::SideError;
use metrics::figures::FiguresByName;
use run::{self, RunError, Sides, TrialResult};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc::Sender;
use std::time::Instant;

/// What a worker says.
pub(super) enum Said {
    /// A trial is done, or failed twice, each time with its simulators.
    Done(SweepTrial, Box<TrialRow>),
    /// A trial cannot be run, and no other could.
    Fatal(SweepTrial, Box<RunError>),
    /// Someone said stop.
    Interrupted(&'static str),
    /// The worker has ended.
    Ended {
        /// How often it started a pair of simulators.
        n_starts: u64,
    },
}

/// Trials to be run, the longest first, so that no core is left with a long one at the end.
pub(super) struct TrialQueue {
    trials: Vec<SweepTrial>,
    next: AtomicUsize,
}

impl TrialQueue {
    pub(super) fn new(plan: &SweepPlan, trials: impl Iterator<Item = SweepTrial>) -> Self {
        let mut trials: Vec<SweepTrial> = trials.collect();
        // Stable: of equals those come first that stand first in the table.
        trials.sort_by(|&a, &b| plan.effort(b).total_cmp(&plan.effort(a)));
        Self { trials, next: AtomicUsize::new(0) }
    }

    pub(super) fn len(&self) -> usize {
        self.trials.len()
    }

    pub(super) fn is_empty(&self) -> bool {
        self.trials.is_empty()
    }

    /// Nothing more is given out.
    pub(super) fn close(&self) {
        self.next.store(self.trials.len(), Ordering::Relaxed);
    }

    fn take(&self) -> Option<SweepTrial> {
        self.trials.get(self.next.fetch_add(1, Ordering::Relaxed)).copied()
    }
}

/// Works until nothing is left. That nobody listens any more is no failure.
pub(super) fn work(work: &Work<'_>, queue: &TrialQueue, said: &Sender<Said>) {
    let n_starts = match run::on_runtime(trials(work, queue, said)) {
        Ok(n_starts) => n_starts,
        Err(source) => {
            let error = SideError::Start { side: "a worker", reason: source.to_string() };
            if let Some(trial) = queue.take() {
                let error = Box::new(RunError::Side { error, kept: None });
                let _ = said.send(Said::Fatal(trial, error));
            }
            0
        }
    };
    let _ = said.send(Said::Ended { n_starts });
}

async fn trials(work: &Work<'_>, queue: &TrialQueue, said: &Sender<Said>) -> u64 {
    let mut sides = Sides::new(work.start.clone(), work.plan.formed.clone());
    while let Some(trial) = queue.take() {
        let mut begun = Instant::now();
        let mut result = one(work, &mut sides, trial).await;
        if matches!(&result, Err(error) if is_worth_another(error)) {
            begun = Instant::now();
            result = one(work, &mut sides, trial).await;
        }
        let message = match result {
            Ok(outcome) => {
                let row = row(work, trial, outcome, begun.elapsed().as_secs_f64());
                Said::Done(trial, Box::new(row))
            }
            Err(RunError::Interrupted { signal }) => Said::Interrupted(signal),
            Err(error) if is_worth_another(&error) => {
                let row = failed_row(work, trial, error.to_string(), begun.elapsed().as_secs_f64());
                Said::Done(trial, Box::new(row))
            }
            Err(error) => Said::Fatal(trial, Box::new(error)),
        };
        let goes_on = matches!(message, Said::Done(..));
        if said.send(message).is_err() || !goes_on {
            break;
        }
    }
    let n_starts = sides.n_starts();
    sides.stop().await;
    n_starts
}

async fn one(
    work: &Work<'_>,
    sides: &mut Sides,
    trial: SweepTrial,
) -> Result<TrialResult, RunError> {
    let plan = work.plan.plan(trial)?;
    let kept = results::kept_runs(work.dir);
    let keep_in = work.plan.keeps(trial).then_some(&*kept);
    sides.run(&run::TrialPlan { plan: &plan, keep_in }).await
}

/// A simulator died, hung or erred while it ran the trial. That may have had a reason outside the trial; if not, it says
/// nothing about other trials. What keeps simulators from being started or reached does.
fn is_worth_another(error: &RunError) -> bool {
    let RunError::Side { error, .. } = error else { return false };
    match error {
        SideError::Both(robots, network) => {
            [robots, network].iter().all(|error| is_of_trial(error))
        }
        error => is_of_trial(error),
    }
}

fn is_of_trial(error: &SideError) -> bool {
    matches!(
        error,
        SideError::Exited { .. }
            | SideError::Lost { .. }
            | SideError::Hangs { .. }
            | SideError::TooSlow { .. }
            | SideError::Refused { .. }
            | SideError::Garbage { .. }
            | SideError::WrongStep { .. }
            | SideError::WrongTime { .. }
            | SideError::WrongDigest { .. }
    )
}

fn failed_row(work: &Work<'_>, trial: SweepTrial, reason: String, wall_s: f64) -> TrialRow {
    TrialRow {
        key: work.plan.key(trial),
        program: crate::PROGRAM.to_owned(),
        status: FAILED.to_owned(),
        reason: Some(reason),
        digest: None,
        wall_s,
        values: FiguresByName::new(),
    }
}

fn row(work: &Work<'_>, trial: SweepTrial, outcome: TrialResult, wall_s: f64) -> TrialRow {
    let TrialResult { summary, not_formed } = outcome;
    TrialRow {
        key: work.plan.key(trial),
        program: crate::PROGRAM.to_owned(),
        status: if not_formed.is_some() { "not-formed" } else { "complete" }.to_owned(),
        reason: not_formed,
        values: figures::of_summary(&summary),
        digest: summary.final_digest,
        wall_s,
    }
}
