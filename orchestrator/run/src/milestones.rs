//! How far a run is, as its log has it: a line for each tenth of the steps, and for each minute.

use super::Audience;
use super::disk_space::outgrows;
use drive::ProgressObserver;
use proto::types::{Formation, seconds};
use record::run_log::RunLog;
use std::path::PathBuf;
use std::time::{Duration, Instant};

/// How often a run that is slow has a line.
const LINE_EVERY: Duration = Duration::from_secs(60);
/// Steps between looks at the clock.
const LOOK_EVERY: u64 = 64;

/// Passes everything on to an audience, and writes milestones into a log.
pub(super) struct Milestones<'a> {
    audience: &'a mut dyn Audience,
    log: RunLog,
    n_steps: u64,
    next_step: u64,
    written: Instant,
    /// The recording, whose size is looked at, until it was warned of.
    dir: Option<PathBuf>,
}

impl<'a> Milestones<'a> {
    /// `dir`: where the run is recorded.
    pub(super) fn new(audience: &'a mut dyn Audience, log: RunLog, dir: PathBuf) -> Self {
        let written = Instant::now();
        Self { audience, log, n_steps: 0, next_step: 0, written, dir: Some(dir) }
    }

    fn is_time(&mut self, step: u64) -> bool {
        let is_milestone = self.next_step <= step;
        let is_look = step.is_multiple_of(LOOK_EVERY) && LINE_EVERY <= self.written.elapsed();
        if is_milestone || is_look {
            self.next_step = step + self.n_steps.div_ceil(10).max(1);
            self.written = Instant::now();
        }
        is_milestone || is_look
    }
}

impl ProgressObserver for Milestones<'_> {
    fn begin(&mut self, n_steps: u64) {
        self.audience.begin(n_steps);
        self.n_steps = n_steps;
        self.next_step = n_steps.div_ceil(10).max(1);
        self.written = Instant::now();
        self.log.add("orchestrator", &format!("at most {n_steps} steps follow"));
    }

    fn step_done(&mut self, step: u64, time_ns: u64) {
        self.audience.step_done(step, time_ns);
        if self.is_time(step) {
            let n_steps = self.n_steps;
            let line = format!("step {step} of {n_steps}, {:.1} s simulated", seconds(time_ns));
            self.log.add("orchestrator", &line);
            let outgrown = self.dir.as_deref().and_then(|dir| outgrows(dir, step, n_steps));
            if let Some(warning) = outgrown {
                self.dir = None;
                self.audience.warn(&warning);
            }
        }
    }

    fn forming(&mut self, step: u64, time_ns: u64, limit_ns: u64, formation: &Formation, n: usize) {
        self.audience.forming(step, time_ns, limit_ns, formation, n);
        if self.is_time(step) || formation.formed_ns.is_some() {
            let ready = n.saturating_sub(formation.missing.len());
            let line = format!(
                "network formation: {ready} of {n} motes ready, {:.1} s simulated",
                seconds(time_ns)
            );
            self.log.add("orchestrator", &line);
        }
    }

    fn end(&mut self) {
        self.audience.end();
    }
}
