//! One trial after another on the same two simulators.

use super::interrupt::Interrupt;
use super::provenance::opening;
use super::start::{Processes, StartOptions, Started, connect, ready};
use super::warm_start::FormedFiles;
use super::{RunError, Work, ended_by, record_of};
use drive::peer::{NetworkSide, Peer as _, Remote, RobotSide};
use drive::{Driver, Failure, Observer, Schedule, Stopped, Taken, Wanted};
use experiment::{Plan, SideCommand, Tls, Transport};
use record::run_summary::RunSummary;
use record::{Ending, Measurer, RecordError, Recorder, ReplacePolicy, Reservation, StepRecord};
use serde_json::Value;
use std::path::Path;

/// Two simulators that stay from trial to trial: each is configured anew, none is started anew.
pub struct Sides {
    options: StartOptions,
    interrupt: Interrupt,
    peers: Option<(Connection, Remote<RobotSide>, Remote<NetworkSide>)>,
    n_starts: u64,
    formed: FormedFiles,
}

/// What a connection depends on.
#[derive(Clone, Debug, PartialEq)]
struct Connection {
    urls: [Option<String>; 2],
    commands: [Option<SideCommand>; 2],
    tls: Option<Tls>,
    transport: Transport,
    step_deadline_s: f64,
    accept_commands: bool,
}

impl Connection {
    fn from_plan(plan: &Plan) -> Self {
        Self {
            urls: [plan.robotsim.url.clone(), plan.netsim.url.clone()],
            commands: [plan.robotsim.command.clone(), plan.netsim.command.clone()],
            tls: plan.tls.clone(),
            transport: plan.transport,
            step_deadline_s: plan.step_deadline_s,
            accept_commands: plan.accept_commands,
        }
    }
}

/// What is to be run.
#[derive(Clone, Copy, Debug)]
pub struct TrialPlan<'a> {
    /// The experiment.
    pub plan: &'a Plan,
    /// Where all that a run leaves is to be kept; `None`: only its measures.
    pub keep_in: Option<&'a Path>,
}

/// What came of a trial.
#[derive(Clone, Debug)]
pub struct TrialResult {
    /// Its summary.
    pub summary: RunSummary,
    /// Why the network had not formed in time: who is missing.
    pub not_formed: Option<String>,
}

impl Sides {
    /// Nothing is started yet. `formed`: files that trials may start from. Within a runtime only: signals are listened for from here on.
    #[must_use]
    pub fn new(options: StartOptions, formed: FormedFiles) -> Self {
        // The simulators of each have a log of their own: of the trial that they are in.
        let run_log = options.run_log.within();
        let options = StartOptions { run_log, ..options };
        Self { options, interrupt: Interrupt::listen(), peers: None, n_starts: 0, formed }
    }

    /// How often simulators were started or connected to.
    #[must_use]
    pub fn n_starts(&self) -> u64 {
        self.n_starts
    }

    /// Runs a trial.
    ///
    /// # Errors
    ///
    /// See [`RunError`]; that the network has not formed is an outcome. Simulators that failed are started anew for the
    /// next trial.
    pub fn run<'a>(
        &'a mut self,
        trial: &'a TrialPlan<'a>,
    ) -> Work<'a, Result<TrialResult, RunError>> {
        Box::pin(self.run_here(trial))
    }

    async fn run_here(&mut self, trial: &TrialPlan<'_>) -> Result<TrialResult, RunError> {
        let log = self.options.run_log.clone();
        log.close();
        log.add("orchestrator", &opening(trial.plan));
        let mut plan = trial.plan.clone();
        let formed = self.formed.open(&mut plan)?;
        let trial = &TrialPlan { plan: &plan, ..*trial };
        let reached = Connection::from_plan(trial.plan);
        let (robots, network) = match self.peers.take() {
            Some((now, robots, network)) if now == reached => (robots, network),
            other => {
                if let Some((_, robots, network)) = other {
                    tokio::join!(robots.stop(), network.stop());
                }
                self.n_starts += 1;
                connect(trial.plan, &self.options).await?
            }
        };
        let wanted = if trial.keep_in.is_some() { Wanted::Record } else { Wanted::Measures };
        let Started { mut coupled, exchange, header, waits, records, formed_steps, past, .. } =
            ready(trial.plan, robots, network, wanted, formed.as_deref()).await?;
        let sink = match trial.keep_in {
            Some(out) => Reservation::new(out, &header.name)
                // What a trial left before is of an earlier form of the sweep.
                .and_then(|place| Recorder::create_in(place, ReplacePolicy::Always, header))
                .and_then(|mut recorder| {
                    log.open(&recorder.path())?;
                    recorder.configured(exchange)?;
                    Ok(Sink::Record(Box::new(recorder)))
                }),
            None => {
                Measurer::new(header, exchange).map(|measurer| Sink::Measure(Box::new(measurer)))
            }
        };
        let sink = sink.and_then(|mut sink| {
            formed_steps.into_iter().try_for_each(|step| sink.record(step))?;
            Ok(sink)
        });
        let mut sink = match sink {
            Ok(sink) => sink,
            Err(error) => {
                coupled.stop().await;
                return Err(RunError::Record { error, before_start: true });
            }
        };
        let driver =
            Driver::new(Schedule::from_plan(trial.plan, waits), &records, &mut coupled).after(past);
        let stopped = match driver.drive(&mut sink, &mut self.interrupt, &mut ()).await {
            Ok(Stopped::Complete) => {
                coupled.confirm().await.map(|()| Stopped::Complete).map_err(Failure::Side)
            }
            // In the middle of a step, maybe: nobody stands anywhere.
            other => other,
        };
        let (ending, not_formed) = match stopped {
            Ok(Stopped::Complete) => (Ending::complete(), None),
            Err(Failure::NotFormed(account)) => {
                (ended_by(&Failure::NotFormed(account.clone())), Some(account))
            }
            Ok(Stopped::Interrupted(signal)) => {
                return Err(abandoned(coupled, RunError::Interrupted { signal }).await);
            }
            Err(Failure::Side(error)) => {
                return Err(abandoned(coupled, RunError::Side { error, kept: None }).await);
            }
            Err(Failure::Observer(error)) => {
                return Err(abandoned(coupled, unrecorded(error)).await);
            }
        };
        let reason = ending.reason.iter().map(|reason| format!(": {reason}")).collect::<String>();
        log.end(&format!("{}{reason}", ending.status.name()));
        log.close();
        let (robots, network) = coupled.into_peers();
        self.peers = Some((reached, robots, network));
        Ok(TrialResult { summary: sink.finish(&ending).map_err(unrecorded)?, not_formed })
    }

    /// Ends the simulators.
    pub async fn stop(self) {
        if let Some((_, robots, network)) = self.peers {
            tokio::join!(robots.stop(), network.stop());
        }
    }
}

async fn abandoned(coupled: Processes, error: RunError) -> RunError {
    coupled.stop().await;
    error
}

fn unrecorded(error: RecordError) -> RunError {
    RunError::Record { error, before_start: false }
}

/// Where the steps go.
enum Sink {
    Record(Box<Recorder>),
    Measure(Box<Measurer>),
}

impl Observer for Sink {
    type Error = RecordError;

    fn step(&mut self, taken: Taken) -> Result<(), RecordError> {
        self.record(record_of(taken))
    }
}

impl Sink {
    fn record(&mut self, step: StepRecord) -> Result<(), RecordError> {
        match self {
            Self::Record(recorder) => recorder.step(step),
            Self::Measure(measurer) => measurer.step(step),
        }
    }

    fn finish(self, ending: &Ending) -> Result<RunSummary, RecordError> {
        match self {
            Self::Record(recorder) => {
                let finished = recorder.finish(ending, Value::Null, report::page)?;
                finished.warnings.iter().for_each(|warning| tracing::warn!("{warning}"));
                Ok(finished.summary)
            }
            Self::Measure(measurer) => measurer.finish(ending),
        }
    }
}
