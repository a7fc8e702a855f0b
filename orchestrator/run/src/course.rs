//! The course of a run: steps, new attempts when a side is lost, and the end of the record.

use super::attempt::{Attempt, Origin, is_lost};
use super::interrupt::Interrupt;
use super::milestones::Milestones;
use super::provenance::Provenance;
use super::start::StartOptions;
use super::{Audience, RunError, RunReport, ended_by, next_to};
use drive::{Driver, Failure, Schedule, Stopped};
use experiment::Plan;
use record::{Ending, Status};
use std::time::Instant;

/// Takes all steps that are still to be taken, as often anew as the plan allows, and makes the record whole.
pub(super) async fn carry_out(
    plan: &Plan,
    start: &StartOptions,
    mut attempt: Attempt,
    mut origin: Origin,
    mut interrupt: Interrupt,
    audience: &mut dyn Audience,
) -> Result<RunReport, RunError> {
    // Before the work: whoever sees them may wish to stop it.
    for warning in &attempt.warnings {
        audience.warn(warning);
    }
    let log = &start.run_log;
    let warnings = attempt.warnings.clone();
    let mut provenance = Provenance::gather(plan, [&attempt.robots, &attempt.network], start);
    let begun = Instant::now();
    loop {
        let Attempt { mut coupled, mut recording, waits, records, past, orders, .. } = attempt;
        for (side, orders) in &orders {
            let (url, token) = (&orders.url, &orders.token);
            audience
                .note(&format!("{side} takes orders at {url} with authorization: Bearer {token}"));
        }
        let schedule = Schedule::from_plan(plan, waits);
        let driver = Driver::new(schedule, &records, &mut coupled).after(past);
        let mut milestones = Milestones::new(audience, log.clone(), recording.recorder.path());
        let result = driver.drive(&mut recording, &mut interrupt, &mut milestones).await;
        let (n_steps, time_ns) = (coupled.step_number(), coupled.time_ns());
        let formed_ns = coupled.formation().and_then(|formation| formation.formed_ns);
        let result = match result {
            Ok(Stopped::Complete) => {
                coupled.close().await.map(|()| Stopped::Complete).map_err(Failure::Side)
            }
            other => {
                coupled.stop().await;
                other
            }
        };
        if let (Err(Failure::Side(error)), Some(step)) = (&result, recording.latest)
            && is_lost(error)
            && (origin.resumed.len() as u64) < plan.restarts
        {
            let loss = format!("{error}; the run goes on from its checkpoint after step {step}");
            audience.warn(&loss);
            let dir = recording.recorder.path();
            let live = recording.live.take();
            let saver = recording.saver.take();
            drop(recording);
            let next = Attempt::go_on(plan, start, &origin, &dir, &mut interrupt).await;
            attempt = next
                .map_err(|error| RunError::NotEnded { error: Box::new(error), dir: dir.clone() })?;
            attempt.recording.live = live;
            attempt.recording.saver = saver;
            origin.left.push(dir);
            origin.resumed.push(step);
            continue;
        }
        system::point("after the last step");
        let (ending, failure) = match result {
            Ok(Stopped::Complete) => (Ending::complete(), None),
            Ok(Stopped::Interrupted(signal)) => {
                let reason = format!("stopped by {signal} after step {n_steps}");
                (Ending::early(Status::Interrupted, reason), None)
            }
            Err(failure) => (ended_by(&failure), Some(failure)),
        };
        let interrupted = ending.status == Status::Interrupted;
        if let Some(saver) = recording.saver.as_ref().filter(|saver| !saver.is_saved()) {
            audience.warn(&format!(
                "--save-formed: {} was not written, since the network had not formed when the run ended",
                saver.path().display()
            ));
        }
        let reason = ending.reason.iter().map(|reason| format!(": {reason}")).collect::<String>();
        log.end(&format!("{} after step {n_steps}{reason}", ending.status.name()));
        let wall_s = begun.elapsed().as_secs_f64();
        let dir = recording.recorder.path();
        let unwritten = |error| RunError::NotEnded {
            error: Box::new(RunError::Record { error, before_start: false }),
            dir: dir.clone(),
        };
        provenance.resumed(&origin.resumed);
        let finished = recording
            .recorder
            .finish(&ending, provenance.finish(n_steps, time_ns, wall_s), report::page)
            .map_err(unwritten)?;
        for dir in &origin.left {
            if let Err(error) = system::remove_dir_all(dir) {
                tracing::warn!(%error, "cannot remove {}", dir.display());
            }
        }
        finished
            .warnings
            .iter()
            .chain(&next_to(&finished))
            .for_each(|warning| audience.warn(warning));
        return match failure {
            None => Ok(RunReport { finished, n_steps, time_ns, wall_s, interrupted, formed_ns }),
            Some(Failure::Side(error)) => {
                Err(RunError::Side { error, kept: Some(Box::new(finished)) })
            }
            Some(Failure::NotFormed(mut account)) => {
                for warning in &warnings {
                    account.push_str("\n  before it began: ");
                    account.push_str(warning);
                }
                Err(RunError::NotFormed { account, kept: Box::new(finished) })
            }
            Some(Failure::Observer(error)) => Err(unwritten(error)),
        };
    }
}
