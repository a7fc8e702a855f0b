//! An experiment over two configured simulators, step after step: first, where the robots wait for it, until the network has
//! formed; then for the experiment's time.
//!
//! Runs, trials and re-simulations differ in the peers that they couple, in who observes the steps, and in when it ends.

mod configure;
pub mod coupling;
pub mod peer;
pub mod private_folder;

pub use configure::{ConfigureRequests, Unfit, Wanted, announced, configure, starts};

use crate::coupling::{Coupled, StepOutcome, StepPlan};
use crate::peer::{NetworkSide, Peer, RobotSide, SideError};
use bytes::Bytes;
use experiment::Plan;
use proto::types::{Formation, MoteCommand, NetRecord, seconds};
use std::fmt::Write as _;
use std::future::Future;
use std::time::Duration;

/// Who is given the steps of an experiment, one after the other.
pub trait Observer {
    /// Why no further step is wanted.
    type Error: std::error::Error;

    /// Orders to the network for the step that ends at `until_ns`, after those of the timeline.
    fn orders(&mut self, _until_ns: u64) -> Vec<MoteCommand> {
        Vec::new()
    }

    /// Whether the next step may be taken, after those until `time_ns`. If not, it is asked again a little later.
    fn may_go_on(&mut self, _time_ns: u64) -> bool {
        true
    }

    /// Takes a step.
    ///
    /// # Errors
    ///
    /// The experiment ends with it.
    fn step(&mut self, taken: Taken) -> Result<(), Self::Error>;

    /// Whether both sides' states are wanted, now that the network has formed and the robots start.
    fn wants_formed(&mut self) -> bool {
        false
    }

    /// Takes both sides' states where the network has formed; `None` of a side that keeps no snapshots.
    ///
    /// # Errors
    ///
    /// The experiment ends with it.
    fn formed(
        &mut self,
        _robots: Option<Bytes>,
        _network: Option<Bytes>,
    ) -> Result<(), Self::Error> {
        Ok(())
    }

    /// Whether both sides' states are wanted, after the step just taken.
    fn wants_checkpoint(&mut self) -> bool {
        false
    }

    /// Takes both sides' states after the latest step; `None` of a side that keeps no snapshots.
    ///
    /// # Errors
    ///
    /// The experiment ends with it.
    fn checkpoint(
        &mut self,
        _robots: Option<Bytes>,
        _network: Option<Bytes>,
    ) -> Result<(), Self::Error> {
        Ok(())
    }
}

/// A step that both sides have answered and agree on.
#[derive(Clone, Debug)]
pub struct Taken {
    /// What it brought.
    pub outcome: StepOutcome,
    /// The orders to the network that took effect in it, beside those in its reply and the robots' messages.
    pub commands: Vec<MoteCommand>,
    /// When the robots started (ns); `None`: they stand still until the network has formed.
    pub start_ns: Option<u64>,
}

/// Who is shown how far an experiment is.
pub trait ProgressObserver {
    /// A phase of at most `n_steps` begins.
    fn begin(&mut self, n_steps: u64);

    /// Step `step` of the phase is done and stands at `time_ns`.
    fn step_done(&mut self, step: u64, time_ns: u64);

    /// Step `step`, in which the network of `n` motes forms, is done and stands at `time_ns` of at most `limit_ns`.
    fn forming(&mut self, step: u64, time_ns: u64, limit_ns: u64, formation: &Formation, n: usize);

    /// The phase has ended.
    fn end(&mut self);
}

/// Shows nothing.
impl ProgressObserver for () {
    fn begin(&mut self, _n_steps: u64) {}

    fn step_done(&mut self, _step: u64, _time_ns: u64) {}

    fn forming(
        &mut self,
        _step: u64,
        _time_ns: u64,
        _limit_ns: u64,
        _formation: &Formation,
        _n: usize,
    ) {
    }

    fn end(&mut self) {}
}

/// Who may stop an experiment from outside.
pub trait Interrupts {
    /// The signal that came, if one did.
    fn seen(&self) -> Option<&'static str>;

    /// Completes when a signal came and its step has been under way for too long since.
    fn lasting(&mut self) -> impl Future<Output = &'static str>;
}

/// Nobody stops it.
#[derive(Clone, Copy, Debug)]
pub struct Uninterrupted;

impl Interrupts for Uninterrupted {
    fn seen(&self) -> Option<&'static str> {
        None
    }

    fn lasting(&mut self) -> impl Future<Output = &'static str> {
        std::future::pending()
    }
}

/// Why no further step is taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stopped {
    /// The time is up, or the robots are done.
    Complete,
    /// A signal came.
    Interrupted(&'static str),
}

/// Why no further step can be taken.
#[derive(Debug, thiserror::Error)]
pub enum Failure<E: std::error::Error> {
    /// A side failed.
    #[error(transparent)]
    Side(#[from] SideError),
    /// The observer wants none.
    #[error(transparent)]
    Observer(E),
    /// The network has not formed in time: who is missing, and why.
    #[error("{0}")]
    NotFormed(String),
}

/// When an experiment ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum End {
    /// So long after the robots have started (ns).
    AfterStart(u64),
    /// So long after the network was switched on (ns).
    At(u64),
}

/// When the steps of an experiment begin and end.
#[derive(Clone, Copy, Debug)]
pub struct Schedule<'a> {
    /// The experiment: its period, its timeline, what it leaves.
    pub plan: &'a Plan,
    /// The robots stand still until the network has formed.
    pub waits: bool,
    /// By when it must have (ns).
    pub formation_limit_ns: u64,
    /// When the run ends.
    pub end: End,
    /// Whether the run ends earlier once the robots have completed their task.
    pub stop_when_complete: bool,
}

impl<'a> Schedule<'a> {
    /// The schedule that a plan asks for. `waits`: whether the robots wait until the network has formed.
    #[must_use]
    pub fn from_plan(plan: &'a Plan, waits: bool) -> Self {
        Self {
            plan,
            waits,
            formation_limit_ns: plan.formation_limit_ns,
            end: End::AfterStart(plan.duration_ns),
            stop_when_complete: plan.stop_when_complete,
        }
    }
}

/// What a driver that goes on after some step has to know of the steps up to it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Past {
    /// When the robots started (ns), and after which step; `None`: they stand still until the network has formed.
    pub started: Option<(u64, u64)>,
    /// The network had formed after the latest step, and not after the one before.
    pub has_just_formed: bool,
}

impl Past {
    /// Of robots that wait for the network if `waits`, before the first step.
    #[must_use]
    pub fn begin(waits: bool) -> Self {
        Self { started: (!waits).then_some((0, 0)), has_just_formed: false }
    }
}

/// Takes the steps of an experiment.
pub struct Driver<'a, R, N> {
    schedule: Schedule<'a>,
    coupled: &'a mut Coupled<R, N>,
    /// Records of a state that the network keeps.
    states: Vec<NetRecord>,
    /// The network had formed after the latest step.
    has_formed: bool,
    /// It had not after the one before: how it formed is not recorded yet.
    has_just_formed: bool,
    /// When the robots started (ns), and after which step.
    started: Option<(u64, u64)>,
}

/// What a step came to.
enum Stepped {
    Done { task_complete: bool },
    Interrupted(&'static str),
}

/// Who follows the steps.
struct Audience<'a, O, I> {
    observer: &'a mut O,
    interrupts: &'a mut I,
    progress: &'a mut dyn ProgressObserver,
}

impl<'a, R: Peer<RobotSide>, N: Peer<NetworkSide>> Driver<'a, R, N> {
    /// Over sides that have just been configured; `records`: what the network keeps.
    pub fn new(
        schedule: Schedule<'a>,
        records: &[NetRecord],
        coupled: &'a mut Coupled<R, N>,
    ) -> Self {
        let states = records.iter().copied().filter(|record| record.is_state()).collect();
        let has_formed = is_formed(coupled);
        Self { schedule, coupled, states, has_formed, has_just_formed: false, started: None }
    }

    /// The same after the steps that the sides have taken already.
    #[must_use]
    pub fn after(mut self, past: Past) -> Self {
        self.started = past.started;
        self.has_just_formed = past.has_just_formed;
        self
    }

    /// Steps until the time is up, the robots are done, or a signal comes.
    ///
    /// # Errors
    ///
    /// See [`Failure`].
    pub async fn drive<O: Observer, I: Interrupts>(
        mut self,
        observer: &mut O,
        interrupts: &mut I,
        progress: &mut dyn ProgressObserver,
    ) -> Result<Stopped, Failure<O::Error>> {
        let mut audience = Audience { observer, interrupts, progress };
        if self.schedule.waits && self.started.is_none() {
            let stopped = self.form(&mut audience).await;
            audience.progress.end();
            if let Some(signal) = stopped? {
                return Ok(Stopped::Interrupted(signal));
            }
            if audience.observer.wants_formed() {
                let [robots, network] = tokio::select! {
                    biased;
                    states = self.coupled.snapshots() => states?,
                    signal = audience.interrupts.lasting() => return Ok(Stopped::Interrupted(signal)),
                };
                audience.observer.formed(robots, network).map_err(Failure::Observer)?;
            }
        }
        let stopped = self.run(&mut audience).await;
        audience.progress.end();
        stopped
    }

    /// Steps, with robots that stand still, until the network has formed. Returns the signal that came first, if one did.
    async fn form<O: Observer, I: Interrupts>(
        &mut self,
        audience: &mut Audience<'_, O, I>,
    ) -> Result<Option<&'static str>, Failure<O::Error>> {
        let Schedule { plan, formation_limit_ns: limit_ns, .. } = self.schedule;
        audience.progress.begin(limit_ns.div_ceil(plan.experiment.step_ns));
        while !self.has_formed {
            if limit_ns <= self.coupled.time_ns() {
                let formation = self.coupled.formation().cloned().unwrap_or_default();
                return Err(Failure::NotFormed(account(&formation, self.coupled.time_ns())));
            }
            if let Stepped::Interrupted(signal) = self.step(None, limit_ns, audience).await? {
                return Ok(Some(signal));
            }
            if let Some(formation) = self.coupled.formation() {
                let (step, time_ns) = (self.coupled.step_number(), self.coupled.time_ns());
                let n = plan.experiment.agent_count;
                audience.progress.forming(step, time_ns, limit_ns, formation, n);
            }
        }
        Ok(None)
    }

    /// Steps for the experiment's time.
    async fn run<O: Observer, I: Interrupts>(
        &mut self,
        audience: &mut Audience<'_, O, I>,
    ) -> Result<Stopped, Failure<O::Error>> {
        let here = (self.coupled.time_ns(), self.coupled.step_number());
        let (start_ns, first_step) = self.started.unwrap_or(here);
        let end_ns = match self.schedule.end {
            End::AfterStart(duration_ns) => start_ns.saturating_add(duration_ns),
            End::At(end_ns) => end_ns,
        };
        let step_ns = self.schedule.plan.experiment.step_ns;
        audience.progress.begin(end_ns.saturating_sub(start_ns).div_ceil(step_ns));
        while self.coupled.time_ns() < end_ns {
            match self.step(Some(start_ns), end_ns, audience).await? {
                Stepped::Interrupted(signal) => return Ok(Stopped::Interrupted(signal)),
                Stepped::Done { task_complete } => {
                    let step = self.coupled.step_number() - first_step;
                    audience.progress.step_done(step, self.coupled.time_ns());
                    if task_complete && self.schedule.stop_when_complete {
                        break;
                    }
                }
            }
        }
        Ok(Stopped::Complete)
    }

    /// Takes one step of a phase that ends at `end_ns`, for robots that started at `start_ns`, or stand still.
    async fn step<O: Observer, I: Interrupts>(
        &mut self,
        start_ns: Option<u64>,
        end_ns: u64,
        audience: &mut Audience<'_, O, I>,
    ) -> Result<Stepped, Failure<O::Error>> {
        loop {
            if let Some(signal) = audience.interrupts.seen() {
                return Ok(Stepped::Interrupted(signal));
            }
            if audience.observer.may_go_on(self.coupled.time_ns()) {
                break;
            }
            // Connections to both sides stay alive meanwhile, and signals are heard.
            tokio::select! {
                () = tokio::time::sleep(PAUSE) => {}
                signal = audience.interrupts.lasting() => return Ok(Stepped::Interrupted(signal)),
            }
        }
        if 0 < self.coupled.step_number() && audience.observer.wants_checkpoint() {
            let [robots, network] = tokio::select! {
                biased;
                states = self.coupled.snapshots() => states?,
                signal = audience.interrupts.lasting() => return Ok(Stepped::Interrupted(signal)),
            };
            audience.observer.checkpoint(robots, network).map_err(Failure::Observer)?;
        }
        let plan = self.schedule.plan;
        let from_ns = self.coupled.time_ns();
        let until_ns = from_ns + plan.experiment.step_ns;
        let mut commands = match start_ns {
            Some(start_ns) => plan.timeline.commands(start_ns, from_ns, until_ns),
            None => Vec::new(),
        };
        commands.append(&mut audience.observer.orders(until_ns));
        let step_plan = StepPlan {
            until_ns,
            hold: start_ns.is_none(),
            commands: commands.clone(),
            records: self.records(from_ns, until_ns, end_ns <= until_ns),
            records_if_complete: if self.schedule.stop_when_complete {
                self.states.clone()
            } else {
                self.records(from_ns, until_ns, false)
            },
        };
        // A side that never answers must not keep the user from stopping.
        let outcome = tokio::select! {
            biased;
            outcome = self.coupled.advance(step_plan) => outcome?,
            signal = audience.interrupts.lasting() => return Ok(Stepped::Interrupted(signal)),
        };
        let has_formed = is_formed(self.coupled);
        self.has_just_formed = has_formed && !self.has_formed;
        self.has_formed = has_formed;
        let task_complete = outcome.task_complete();
        let taken = Taken { outcome, commands, start_ns };
        audience.observer.step(taken).map_err(Failure::Observer)?;
        Ok(Stepped::Done { task_complete })
    }

    /// The records of a state that a step is to bring: all of them in the last step and in the first after formation.
    fn records(&self, from_ns: u64, until_ns: u64, is_last: bool) -> Vec<NetRecord> {
        let step = self.coupled.step_number() + 1;
        let all = is_last || self.has_just_formed;
        let is_wanted = |record: &NetRecord| {
            let is_statistics = *record == NetRecord::Statistics;
            let output = &self.schedule.plan.output;
            all || is_statistics && output.holds_motes(step, from_ns, until_ns)
        };
        self.states.iter().copied().filter(is_wanted).collect()
    }
}

fn is_formed<R: Peer<RobotSide>, N: Peer<NetworkSide>>(coupled: &Coupled<R, N>) -> bool {
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

/// How long to wait before asking again whether a run that is paused may go on.
const PAUSE: Duration = Duration::from_millis(5);
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
