//! Speed through the real processes: both simulators started as children, everything over gRPC.

mod peers;

use crate::config::{self, Overrides, Plan};
use crate::coupling::Coupled;
use crate::record::{Ending, Recorder, Status, StepRecord};
use crate::run::{RunError, StartOptions, start};
use peers::{Figures, ROWS};
use serde_json::{Value, json};
use std::fmt;
use std::path::Path;
use std::time::{Duration, Instant};

/// What to measure.
#[derive(Clone, Debug)]
pub struct BenchOptions {
    /// Only rows of so many agents; empty: all.
    pub agents: Vec<u32>,
    /// Steps measured per row; `None`: enough for a second.
    pub steps: Option<u64>,
    /// Parallel coupling and recording as well.
    pub all: bool,
    /// How the sides are started.
    pub start: StartOptions,
}

/// A network model of the table.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Model {
    /// Every frame arrives.
    Full,
    /// Unit disk of 3 m.
    Disk,
    /// Experimental randomness.
    Randomness,
}

impl Model {
    const ALL: [Self; 3] = [Self::Full, Self::Disk, Self::Randomness];

    fn name(self) -> &'static str {
        match self {
            Self::Full => "full",
            Self::Disk => "unit disk 3 m",
            Self::Randomness => "experimental randomness",
        }
    }

    fn netsim(self) -> &'static str {
        match self {
            Self::Full => "propagation = \"full\"",
            Self::Disk => "propagation = \"unit-disk\"\nradius_m = 3.0",
            Self::Randomness => "propagation = \"experimental-randomness\"",
        }
    }

    /// Where the robots jump about: the peer's own square, but for the disk a disc of constant density, since in a
    /// square of fixed size its neighbours would grow with the number of robots.
    fn arena(self) -> &'static str {
        match self {
            Self::Full | Self::Randomness => "arena = \"square\"\nside_m = 10.0",
            Self::Disk => "arena = \"disc\"\ndensity_per_m2 = 0.22",
        }
    }
}

/// How a row is measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Mode {
    Sequential,
    Parallel,
    Recording,
}

impl Mode {
    fn name(self) -> &'static str {
        match self {
            Self::Sequential => "sequential",
            Self::Parallel => "parallel",
            Self::Recording => "sequential, recording",
        }
    }
}

/// One measured cell.
#[derive(Clone, Debug)]
struct Cell {
    agents: u32,
    model: Model,
    mode: Mode,
    n_steps: usize,
    median_ms: f64,
    p90_ms: f64,
}

/// The measured table.
#[derive(Clone, Debug)]
pub struct Table {
    cells: Vec<Cell>,
    threads: Option<u16>,
}

/// Measures the table.
///
/// # Errors
///
/// A side cannot be started or fails, or the recording of a row cannot be written.
pub async fn bench(options: &BenchOptions) -> Result<Table, RunError> {
    let mut cells = Vec::new();
    let modes: &[Mode] = if options.all {
        &[Mode::Sequential, Mode::Parallel, Mode::Recording]
    } else {
        &[Mode::Sequential]
    };
    for figures in &ROWS {
        if !options.agents.is_empty() && !options.agents.contains(&figures.agents) {
            continue;
        }
        for model in Model::ALL.into_iter().filter(|&model| figures.measures(model)) {
            for &mode in modes {
                cells.push(measure(figures.agents, model, mode, options).await?);
            }
        }
    }
    Ok(Table { cells, threads: options.start.threads })
}

/// Whether the table has a row of so many agents.
#[must_use]
pub fn has_row(agents: u32) -> bool {
    Figures::of(agents).is_some()
}

/// The rows of the table, in words.
#[must_use]
pub fn rows() -> String {
    ROWS.map(|figures| figures.agents.to_string()).join(", ")
}

fn plan(agents: u32, model: Model, mode: Mode) -> Result<Plan, RunError> {
    let coupling = if mode == Mode::Parallel { "parallel" } else { "sequential" };
    let text = format!(
        "[experiment]\nname = \"bench\"\nseed = 1\nduration_s = 1e6\nagents = {agents}\ncoupling = \"{coupling}\"\n\
         [robotsim.scenario]\nkind = \"disc\"\ndensity_per_m2 = 0.22\n\
         [robotsim.controller]\nkind = \"random-jump\"\n{}\n[netsim.phy]\n{}\n\
         [output]\nlinks = \"none\"\nreport = false\n",
        model.arena(),
        model.netsim()
    );
    Ok(config::read(Path::new("bench"), text, &Overrides::default())?)
}

async fn measure(
    agents: u32,
    model: Model,
    mode: Mode,
    options: &BenchOptions,
) -> Result<Cell, RunError> {
    let plan = plan(agents, model, mode)?;
    let started = start(&plan, &options.start, false).await?;
    let mut coupled = started.coupled;
    let record_error = |error| RunError::Record { error, before_start: false };
    let folder = tempfile::tempdir().map_err(|source| {
        record_error(crate::record::RecordError::Create { path: std::env::temp_dir(), source })
    })?;
    let mut recorder = None;
    if mode == Mode::Recording {
        let mut created = Recorder::create(folder.path(), started.header).map_err(record_error)?;
        created.configured(started.exchange).map_err(record_error)?;
        recorder = Some(created);
    }
    let times_ms = steps(&plan, &mut coupled, &mut recorder, options.steps).await;
    coupled.stop().await;
    let mut times_ms = times_ms?;
    if let Some(recorder) = recorder {
        let ending = Ending { status: Status::Complete, reason: None };
        recorder.finish(&ending, Value::Null).map_err(record_error)?;
    }
    times_ms.sort_by(f64::total_cmp);
    let quantile = |q: f64| times_ms[((times_ms.len() - 1) as f64 * q) as usize];
    Ok(Cell {
        agents,
        model,
        mode,
        n_steps: times_ms.len(),
        median_ms: quantile(0.5),
        p90_ms: quantile(0.9),
    })
}

/// Wall time of each step (ms) after a few that warm up.
async fn steps(
    plan: &Plan,
    coupled: &mut Coupled,
    recorder: &mut Option<Recorder>,
    n_steps: Option<u64>,
) -> Result<Vec<f64>, RunError> {
    let mut times_ms = Vec::new();
    let mut begun = Instant::now();
    for index in 0.. {
        if index == WARM_UP {
            begun = Instant::now();
            times_ms.clear();
        }
        let enough = match n_steps {
            Some(n_steps) => n_steps.max(1) <= times_ms.len() as u64,
            None => MIN_STEPS <= times_ms.len() && MEASURED <= begun.elapsed(),
        };
        if WARM_UP <= index && enough {
            break;
        }
        let step_begun = Instant::now();
        let until_ns = coupled.time_ns() + plan.experiment.step_ns;
        let outcome = coupled
            .advance(until_ns, recorder.is_some())
            .await
            .map_err(|error| RunError::Side { error, kept: None })?;
        if let (Some(recorder), Some(robots), Some(net)) =
            (recorder.as_mut(), &outcome.robots, &outcome.network)
        {
            recorder
                .step(StepRecord {
                    step: outcome.step,
                    time_ns: outcome.time_ns,
                    robots,
                    net,
                    digest: outcome.digest,
                })
                .map_err(|error| RunError::Record { error, before_start: false })?;
        }
        times_ms.push(step_begun.elapsed().as_secs_f64() * 1e3);
    }
    Ok(times_ms)
}

/// Steps before the clock runs.
const WARM_UP: u64 = 10;
/// Least number of measured steps.
const MIN_STEPS: usize = 20;
/// Least time measured.
const MEASURED: Duration = Duration::from_secs(1);

impl Table {
    /// For programs.
    #[must_use]
    pub fn to_json(&self) -> Value {
        let rows: Vec<Value> = self
            .cells
            .iter()
            .map(|cell| {
                let figures = Figures::of(cell.agents);
                json!({
                    "agents": cell.agents,
                    "model": cell.model.name(),
                    "mode": cell.mode.name(),
                    "steps": cell.n_steps,
                    "median_ms": cell.median_ms,
                    "p90_ms": cell.p90_ms,
                    "botnet_ms": figures.and_then(|figures| figures.botnet_ms(cell.model)),
                    "paper_ms": figures.and_then(|figures| figures.paper_ms(cell.model)),
                    "to_reach_ms": figures.and_then(|figures| figures.goal_ms(cell.model)),
                })
            })
            .collect();
        json!({ "schema": "bench/1", "threads": self.threads, "rows": rows })
    }
}

impl fmt::Display for Table {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "Wall time per control step (ms), both processes and gRPC included. Every robot jumps at random;"
        )?;
        writeln!(
            f,
            "square of 10 m, for the disk a disc of 0.22 robots per m². BotNet: one process, no RPC, measured"
        )?;
        writeln!(
            f,
            "elsewhere on a 2-core machine (10 m square for all models); paper: as printed, for full."
        )?;
        writeln!(f)?;
        writeln!(
            f,
            "{:>6}  {:<24} {:<22} {:>9} {:>9} {:>9} {:>8} {:>8}  times faster",
            "agents", "model", "mode", "median", "90 %", "to reach", "BotNet", "paper"
        )?;
        for cell in &self.cells {
            let figures = Figures::of(cell.agents);
            let number = |value: Option<f64>| {
                value.map_or_else(|| "-".to_owned(), |value| value.to_string())
            };
            let botnet_ms = figures.and_then(|figures| figures.botnet_ms(cell.model));
            writeln!(
                f,
                "{:>6}  {:<24} {:<22} {:>9.3} {:>9.3} {:>9} {:>8} {:>8}  {}",
                cell.agents,
                cell.model.name(),
                cell.mode.name(),
                cell.median_ms,
                cell.p90_ms,
                number(figures.and_then(|figures| figures.goal_ms(cell.model))),
                number(botnet_ms),
                number(figures.and_then(|figures| figures.paper_ms(cell.model))),
                botnet_ms
                    .map_or_else(|| "-".to_owned(), |peer| format!("{:.1}", peer / cell.median_ms)),
            )?;
        }
        Ok(())
    }
}
