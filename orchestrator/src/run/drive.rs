//! Step after step: first, where the robots wait for it, until the network has formed; then for the experiment's time.

use super::interrupt::Interrupt;
use crate::console::Progress;
use crate::coupling::{Coupled, StepOutcome, StepPlan};
use crate::peer::SideError;
use experiment::Plan;
use proto::types::{Formation, NetRecord, seconds};
use record::{RecordError, StepRecord, Steps};
use std::fmt::Write as _;

/// Why no further step is taken.
pub(super) enum Stopped {
    /// The time is up, or the robots are done.
    Complete,
    /// Someone said stop.
    Interrupted(&'static str),
}

/// Why no further step can be taken.
#[derive(Debug, thiserror::Error)]
pub(super) enum Failure {
    #[error(transparent)]
    Side(#[from] SideError),
    #[error(transparent)]
    Record(#[from] RecordError),
    /// Who is missing, and why.
    #[error("{0}")]
    NotFormed(String),
}

/// Takes the steps of a run.
pub(super) struct Driver<'a> {
    plan: &'a Plan,
    coupled: &'a mut Coupled,
    recorder: &'a mut dyn Steps,
    /// How far it is, is shown.
    is_shown: bool,
    /// The robots stand still until the network has formed.
    waits: bool,
    /// Records of a state that the network keeps.
    states: Vec<NetRecord>,
    /// The network had formed after the latest step.
    has_formed: bool,
    /// It had not after the one before: how it formed is not recorded yet.
    has_just_formed: bool,
}

/// What a step came to.
enum Stepped {
    Done(Box<StepOutcome>),
    Interrupted(&'static str),
}

impl<'a> Driver<'a> {
    pub(super) fn new(
        plan: &'a Plan,
        waits: bool,
        records: Vec<NetRecord>,
        coupled: &'a mut Coupled,
        recorder: &'a mut dyn Steps,
    ) -> Self {
        let states = records.into_iter().filter(|record| record.is_state()).collect();
        let has_formed = is_formed(coupled);
        let is_shown = true;
        Self {
            plan,
            coupled,
            recorder,
            is_shown,
            waits,
            states,
            has_formed,
            has_just_formed: false,
        }
    }

    /// Without showing how far it is.
    pub(super) fn quiet(self) -> Self {
        Self { is_shown: false, ..self }
    }

    fn progress(&self, n_steps: u64) -> Progress {
        if self.is_shown { Progress::new(n_steps) } else { Progress::hidden() }
    }

    /// Steps until the time is up, the robots are done, or someone says stop.
    pub(super) async fn drive(mut self, interrupt: &mut Interrupt) -> Result<Stopped, Failure> {
        if self.waits
            && let Some(signal) = self.form(interrupt).await?
        {
            return Ok(Stopped::Interrupted(signal));
        }
        self.run(interrupt).await
    }

    /// Steps, with robots that stand still, until the network has formed. Returns the signal that came first, if one did.
    async fn form(&mut self, interrupt: &mut Interrupt) -> Result<Option<&'static str>, Failure> {
        let limit_ns = self.plan.formation_limit_ns;
        let step_ns = self.plan.experiment.step_ns;
        let mut progress = self.progress(limit_ns.div_ceil(step_ns));
        while !self.has_formed {
            if limit_ns <= self.coupled.time_ns() {
                progress.finish();
                let formation = self.coupled.formation().cloned().unwrap_or_default();
                return Err(Failure::NotFormed(account(&formation, self.coupled.time_ns())));
            }
            match self.step(true, 0, limit_ns, interrupt).await? {
                Stepped::Done(_) => {}
                Stepped::Interrupted(signal) => {
                    progress.finish();
                    return Ok(Some(signal));
                }
            }
            if let Some(formation) = self.coupled.formation() {
                let (step, time_ns) = (self.coupled.step_number(), self.coupled.time_ns());
                let n = self.plan.experiment.agent_count;
                progress.forming(step, time_ns, limit_ns, formation, n);
            }
        }
        progress.finish();
        Ok(None)
    }

    /// Steps for the experiment's time.
    async fn run(&mut self, interrupt: &mut Interrupt) -> Result<Stopped, Failure> {
        let start_ns = self.coupled.time_ns();
        let end_ns = start_ns.saturating_add(self.plan.duration_ns);
        let step_ns = self.plan.experiment.step_ns;
        let first_step = self.coupled.step_number();
        let mut progress = self.progress(self.plan.duration_ns.div_ceil(step_ns));
        while self.coupled.time_ns() < end_ns {
            let outcome = match self.step(false, start_ns, end_ns, interrupt).await? {
                Stepped::Done(outcome) => outcome,
                Stepped::Interrupted(signal) => {
                    progress.finish();
                    return Ok(Stopped::Interrupted(signal));
                }
            };
            progress.at(outcome.step - first_step, outcome.time_ns);
            if outcome.task_complete && self.plan.stop_when_complete {
                break;
            }
        }
        progress.finish();
        Ok(Stopped::Complete)
    }

    /// Takes and records one step of a phase that ends at `end_ns`, for robots that start at `start_ns`.
    async fn step(
        &mut self,
        hold: bool,
        start_ns: u64,
        end_ns: u64,
        interrupt: &mut Interrupt,
    ) -> Result<Stepped, Failure> {
        if let Some(signal) = interrupt.seen() {
            return Ok(Stepped::Interrupted(signal));
        }
        let from_ns = self.coupled.time_ns();
        let until_ns = from_ns + self.plan.experiment.step_ns;
        let commands = if hold {
            Vec::new()
        } else {
            self.plan.timeline.commands(start_ns, from_ns, until_ns)
        };
        let step_plan = StepPlan {
            until_ns,
            keep: true,
            hold,
            commands: commands.clone(),
            records: self.records(from_ns, until_ns, end_ns <= until_ns),
            records_if_complete: if self.plan.stop_when_complete {
                self.states.clone()
            } else {
                self.records(from_ns, until_ns, false)
            },
        };
        // A side that never answers must not keep the user from stopping.
        let mut outcome = tokio::select! {
            biased;
            outcome = self.coupled.advance(step_plan) => outcome?,
            signal = interrupt.lasting() => return Ok(Stepped::Interrupted(signal)),
        };
        let has_formed = is_formed(self.coupled);
        self.has_just_formed = has_formed && !self.has_formed;
        self.has_formed = has_formed;
        if let (Some(robots), Some(net)) = (outcome.robots.take(), outcome.network.take()) {
            self.recorder.step(StepRecord {
                step: outcome.step,
                time_ns: outcome.time_ns,
                robots: &robots,
                net: &net,
                commands: &commands,
                digest: outcome.digest,
            })?;
        }
        Ok(Stepped::Done(Box::new(outcome)))
    }

    /// The records of a state that a step is to bring: all of them in the last step and in the first after formation.
    fn records(&self, from_ns: u64, until_ns: u64, is_last: bool) -> Vec<NetRecord> {
        let step = self.coupled.step_number() + 1;
        let all = is_last || self.has_just_formed;
        let is_wanted = |record: &NetRecord| {
            let is_statistics = *record == NetRecord::Statistics;
            all || is_statistics && self.plan.output.holds_motes(step, from_ns, until_ns)
        };
        self.states.iter().copied().filter(is_wanted).collect()
    }
}

fn is_formed(coupled: &Coupled) -> bool {
    coupled.formation().is_some_and(|formation| formation.formed_ns.is_some())
}

/// Who is missing when time is up, and why: one line per reason.
fn account(formation: &Formation, time_ns: u64) -> String {
    let mut text = format!(
        "the network had not formed after {} s of simulated time (experiment.formation_limit_s): {}",
        seconds(time_ns),
        match formation.missing.len() {
            1 => "1 mote is missing".to_owned(),
            n => format!("{n} motes are missing"),
        }
    );
    for (words, motes) in formation.by_reason() {
        let shown: Vec<String> = motes.iter().take(MAX_NAMED).map(u32::to_string).collect();
        let more = motes.len().saturating_sub(MAX_NAMED);
        let _ = write!(text, "\n  {words}: {}", shown.join(", "));
        if more != 0 {
            let _ = write!(text, " and {more} more");
        }
    }
    text
}

/// Motes named for each reason; the record has them all.
const MAX_NAMED: usize = 20;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_account_names_the_motes_by_reason_and_counts_those_left_out() {
        let mut missing: Vec<u32> = (1..=30).collect();
        missing.push(77);
        let mut reason = vec![1; 30];
        reason.push(0);
        let reasons = vec!["has not joined".to_owned(), "hears no enhanced beacon".to_owned()];
        let formation = Formation { formed_ns: None, missing, reason, reasons };
        assert_eq!(
            account(&formation, 2_500_000_000),
            "the network had not formed after 2.5 s of simulated time (experiment.formation_limit_s): 31 motes are \
             missing\n  has not joined: 77\n  hears no enhanced beacon: 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, \
             15, 16, 17, 18, 19, 20 and 10 more"
        );
    }
}
