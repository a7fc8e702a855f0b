//! What a run or a sweep would take, without making it: trials, steps, time, memory and disk space.
//!
//! Time, memory and space come from the first steps of the experiment itself, which are taken and recorded in a temporary
//! folder, and are extrapolated in proportion to steps. A simulator that runs elsewhere is not disturbed: then only the least
//! space is known.

use crate::disk_space::{bytes, free_bytes, least_bytes, n_steps, size_of};
use crate::{FormedFiles, RunError, StartOptions, record_of, start};
use drive::private_folder::PrivateFolder;
use drive::{Driver, Failure, Observer, Schedule, Taken, Uninterrupted, Wanted};
use experiment::Plan;
use numbers::format::{count, count_of};
use proto::types::seconds;
use record::{RecordError, Recorder};
use schemars::JsonSchema;
use serde::Serialize;
use std::fmt::Write as _;
use std::fs;
use std::path::Path;
use std::time::{Duration, Instant};

/// What the schema of the answer is called.
const SCHEMA: &str = "dry-run/1";
/// How long steps are taken for the estimate.
const MEASURED: Duration = Duration::from_secs(2);
/// What a report takes (bytes).
const REPORT_BYTES: u64 = 100_000;

/// What a run or a sweep would take.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct DryRun {
    /// The format of this answer.
    #[schemars(extend("const" = SCHEMA))]
    pub schema: &'static str,
    /// Name of the experiment.
    pub name: String,
    /// Trials: 1 of a run; those of a sweep that are yet to be run.
    pub trials: u64,
    /// The most agents of a trial.
    pub agents: u64,
    /// The most steps of a trial, after the network has formed.
    pub steps: u64,
    /// Wall time (s); null if unknown.
    pub wall_s: Option<f64>,
    /// Memory of all processes (bytes); null if unknown.
    pub memory_bytes: Option<u64>,
    /// Space that the results take (bytes); null if unknown.
    pub disk_bytes: Option<u64>,
    /// The least that they take (bytes).
    pub least_disk_bytes: u64,
    /// Free space where results go (bytes); null if unknown.
    pub free_bytes: Option<u64>,
    /// The folder of the results.
    pub folder: String,
    /// What the estimates are based on.
    pub basis: String,
    /// What was chosen for a network whose profile is `auto` and whose robots move, in the longest trial; null if nothing.
    pub chosen: Option<String>,
    /// What to check before it is run.
    pub warnings: Vec<String>,
}

impl DryRun {
    /// A run of this plan, whose results go to `out`.
    ///
    /// # Errors
    ///
    /// The experiment cannot be started, or a side fails in its first steps.
    pub async fn of_run(plan: &Plan, options: &StartOptions, out: &Path) -> Result<Self, RunError> {
        let elsewhere = plan.robotsim.url.as_ref().or(plan.netsim.url.as_ref());
        let taken = match elsewhere {
            None => Some(FirstSteps::take(plan, options).await?),
            Some(_) => None,
        };
        let basis = match (&taken, elsewhere) {
            (Some(taken), _) => taken.basis(),
            (None, Some(url)) => format!("the simulator at {url} runs elsewhere and is not asked"),
            (None, None) => String::new(),
        };
        let mut dry = Self {
            schema: SCHEMA,
            name: plan.name.clone(),
            trials: 1,
            agents: plan.experiment.agent_count as u64,
            steps: n_steps(plan),
            wall_s: taken.as_ref().map(|taken| taken.wall_s(n_steps(plan))),
            memory_bytes: taken.as_ref().and_then(|taken| taken.memory_bytes),
            disk_bytes: taken.as_ref().map(|taken| taken.disk_bytes(plan)),
            least_disk_bytes: least_bytes(plan),
            free_bytes: free_bytes(out),
            folder: out.join(&plan.name).display().to_string(),
            basis,
            chosen: plan.profile.clone(),
            warnings: plan.warnings.clone(),
        };
        if taken.as_ref().is_some_and(|taken| taken.is_forming) {
            dry.warnings.push(format!(
                "the network had not formed in these steps: the time until it has, at most {} s simulated, comes in addition",
                seconds(plan.formation_limit_ns)
            ));
        }
        dry.check_space();
        Ok(dry)
    }

    /// Warns of too little space.
    pub fn check_space(&mut self) {
        let expected = self.disk_bytes.unwrap_or(self.least_disk_bytes);
        if let Some(free) = self.free_bytes.filter(|&free| free < expected) {
            self.warnings.push(format!(
                "results of {} do not fit into the {} that are free at {}",
                bytes(expected),
                bytes(free),
                self.folder
            ));
        }
    }

    /// For people.
    #[must_use]
    pub fn text(&self) -> String {
        let or_unknown = |value: Option<String>| value.unwrap_or_else(|| "unknown".to_owned());
        let mut text = format!(
            "{}: {} of {}, {}",
            self.name,
            count_of(self.trials, "trial"),
            count_of(self.agents, "agent"),
            count_of(self.steps, "step")
        );
        let wall = self
            .wall_s
            .map(|wall_s| if wall_s < 120.0 { format!("{wall_s:.2} s") } else { duration(wall_s) });
        let free = self.free_bytes.map(|free| format!(" of {} free", bytes(free)));
        let disk = self.disk_bytes.map_or_else(
            || format!("at least {}", bytes(self.least_disk_bytes)),
            |disk| format!("about {}", bytes(disk)),
        );
        let _ = write!(text, "\n  time    {}", or_unknown(wall.map(|w| format!("about {w}"))));
        let memory = self.memory_bytes.map(|memory| format!("about {}", bytes(memory)));
        let _ = write!(text, "\n  memory  {}", or_unknown(memory));
        let _ = write!(text, "\n  disk    {disk}{}, in {}", free.unwrap_or_default(), self.folder);
        let _ = write!(text, "\n  estimated from: {}", self.basis);
        if let Some(chosen) = &self.chosen {
            let _ = write!(text, "\n  {chosen}");
        }
        text
    }
}

/// The first steps of an experiment, and what they took.
pub(crate) struct FirstSteps {
    n: u64,
    wall_s: f64,
    record_bytes: u64,
    pub(crate) memory_bytes: Option<u64>,
    pub(crate) is_forming: bool,
}

impl FirstSteps {
    /// Takes them, recorded in a folder that is removed.
    pub(crate) async fn take(plan: &Plan, options: &StartOptions) -> Result<Self, RunError> {
        let record_failed = |error| RunError::Record { error, before_start: true };
        let folder = PrivateFolder::for_files().map_err(|source| {
            record_failed(RecordError::Create { path: std::env::temp_dir(), source })
        })?;
        let formed = FormedFiles::default().open(&mut plan.clone())?;
        let started = start(plan, options, Wanted::Record, formed.as_deref()).await?;
        let mut coupled = started.coupled;
        let recorder = Recorder::create(folder.path(), started.header).and_then(|mut recorder| {
            recorder.configured(started.exchange)?;
            started.formed_steps.into_iter().try_for_each(|step| recorder.step(step))?;
            Ok(recorder)
        });
        let recorder = match recorder {
            Ok(recorder) => recorder,
            Err(error) => {
                coupled.stop().await;
                return Err(record_failed(error));
            }
        };
        let mut measuring = Measuring { recorder, n: 0, begun: Instant::now(), is_forming: false };
        let driver =
            Driver::new(Schedule::from_plan(plan, started.waits), &started.records, &mut coupled)
                .after(started.past);
        let driven = driver.drive(&mut measuring, &mut Uninterrupted, &mut ()).await;
        let wall_s = measuring.begun.elapsed().as_secs_f64();
        let memory_bytes = memory_bytes();
        coupled.stop().await;
        match driven {
            Ok(_) | Err(Failure::Observer(Enough::Measured) | Failure::NotFormed(_)) => {}
            Err(Failure::Observer(Enough::Unrecorded(error))) => return Err(record_failed(error)),
            Err(Failure::Side(error)) => return Err(RunError::Side { error, kept: None }),
        }
        let Measuring { recorder, n, is_forming, .. } = measuring;
        // Whole files, under their temporary name.
        drop(recorder);
        Ok(Self { n, wall_s, record_bytes: size_of(folder.path()), memory_bytes, is_forming })
    }

    pub(crate) fn basis(&self) -> String {
        format!(
            "the first {}, taken and recorded in {:.1} s on this machine; memory as they took it",
            count_of(self.n, "step"),
            self.wall_s
        )
    }

    fn per_step(&self) -> f64 {
        1.0 / self.n.max(1) as f64
    }

    pub(crate) fn wall_s(&self, n_steps: u64) -> f64 {
        self.wall_s * self.per_step() * n_steps as f64
    }

    pub(crate) fn disk_bytes(&self, plan: &Plan) -> u64 {
        let in_steps = self.record_bytes as f64 * self.per_step() * n_steps(plan) as f64;
        in_steps as u64 + if plan.output.report { REPORT_BYTES } else { 0 }
    }
}

/// Records steps for a while.
struct Measuring {
    recorder: Recorder,
    n: u64,
    begun: Instant,
    is_forming: bool,
}

/// Why no further step is measured.
#[derive(Debug, thiserror::Error)]
enum Enough {
    #[error("enough steps were measured")]
    Measured,
    #[error(transparent)]
    Unrecorded(RecordError),
}

impl Observer for Measuring {
    type Error = Enough;

    fn step(&mut self, taken: Taken) -> Result<(), Enough> {
        self.is_forming = taken.start_ns.is_none();
        self.recorder.step(record_of(taken)).map_err(Enough::Unrecorded)?;
        self.n += 1;
        if self.begun.elapsed() < MEASURED { Ok(()) } else { Err(Enough::Measured) }
    }
}

/// The most memory that this process and its children have held at a time.
fn memory_bytes() -> Option<u64> {
    let this = std::process::id().to_string();
    let status = |process: &str| fs::read_to_string(format!("/proc/{process}/status")).ok();
    let field = |status: &str, name: &str| {
        let line = status.lines().find_map(|line| line.strip_prefix(name))?;
        line.split_whitespace().next().map(str::to_owned)
    };
    let most = |status: &str| field(status, "VmHWM:")?.parse::<u64>().ok();
    let mut kib = most(&status("self")?)?;
    for entry in fs::read_dir("/proc").ok()?.flatten() {
        let name = entry.file_name();
        let Some(status) = name.to_str().and_then(status) else { continue };
        if field(&status, "PPid:").as_ref() == Some(&this) {
            kib += most(&status).unwrap_or(0);
        }
    }
    kib.checked_mul(1024)
}

/// A time of minutes and more, for people.
fn duration(s: f64) -> String {
    let minutes = (s / 60.0).ceil() as u64;
    match (minutes / 60, minutes % 60) {
        (0, minutes) => format!("{minutes} min"),
        (hours, minutes) => format!("{} h {minutes} min", count(hours)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_and_times_are_short() {
        let sizes = [999, 1000, 12_345, 999_499, 999_500, 5 << 40].map(bytes);
        assert_eq!(sizes, ["999 bytes", "1.00 kB", "12.3 kB", "999 kB", "1.00 MB", "5.50 TB"]);
        assert_eq!([150.0, 7200.0, 1e7].map(duration), ["3 min", "2 h 0 min", "2,777 h 47 min"]);
    }
}
