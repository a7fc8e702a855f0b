//! Speed through the real processes: both simulators started as children, everything over gRPC.
//!
//! | module | what |
//! |---|---|
//! | here | propagation alone |
//! | `swarm` | the full protocols under a swarm |
//! | `standing` | standing sensor networks |

mod peers;
mod standing;
mod swarm;

use drive::coupling::{StepOutcome, StepPlan};
use drive::private_folder::PrivateFolder;
use drive::{Taken, Wanted};
use experiment::{Overrides, Plan};
use numbers::format::wrapped;
use numbers::layout::WIDTH;
use numbers::statistics::quantile_lower;
use peers::{PeerFigures, ROWS};
use proto::exchange::Configured;
use proto::types::NetRecord;
use record::{Ending, Recorder, RunHeader};
use run::{Processes, RunError, StartOptions, record_of, start};
use schemars::JsonSchema;
use serde::Serialize;
use serde_json::Value;
use std::fmt;
use std::path::Path;
use std::time::{Duration, Instant};

/// What to measure.
#[derive(Clone, Debug)]
pub struct BenchOptions {
    /// Which table; `None`: that of propagation, and the small rows of the others.
    pub table: Option<Which>,
    /// Only rows of so many agents; empty: all.
    pub agents: Vec<u32>,
    /// Steps measured per row; `None`: enough for a second.
    pub steps: Option<u64>,
    /// Parallel coupling and recording as well.
    pub all: bool,
    /// How the sides are started.
    pub start: StartOptions,
}

/// A table.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Which {
    /// Control steps with propagation only
    Propagation,
    /// Control periods with the full protocol stack
    Swarm,
    /// One hour of stationary sensor networks
    Standing,
}

/// A network model of the table.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BenchModel {
    /// Every frame arrives.
    Full,
    /// Unit disk of 3 m.
    Disk,
    /// Experimental randomness.
    Randomness,
}

impl BenchModel {
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

/// What the robots of a row do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum RobotMotion {
    /// They jump at random and heed nobody.
    Jumping,
    /// Boids: each heeds those whom it hears.
    Boids,
    /// A lattice (Olfati-Saber): as boids, with more to compute for each neighbour.
    Lattice,
}

impl RobotMotion {
    const ALL: [Self; 3] = [Self::Jumping, Self::Boids, Self::Lattice];

    /// Robots that heed each other are measured where they have few neighbours of many: over the disk.
    fn act_in(self, agents: u32, model: BenchModel) -> bool {
        self == Self::Jumping || model == BenchModel::Disk && LOCAL_FROM <= agents
    }

    fn name(self) -> &'static str {
        match self {
            Self::Jumping => "random-jump",
            Self::Boids => "boids",
            Self::Lattice => "olfati-saber",
        }
    }

    /// Their controller, and how often it acts: of robots that jump nothing depends on that.
    fn config(self, model: BenchModel) -> (String, &'static str) {
        let often = "control_period.rate_hz = 10\n";
        match self {
            Self::Jumping => (model.arena().to_owned(), ""),
            Self::Boids => (String::new(), often),
            Self::Lattice => ("distance_m = 2.0\ntarget_gain_per_s2 = 0.0".to_owned(), often),
        }
    }

    /// Steps before the clock runs: those who heed each other first leave the disorder in which they begin.
    fn warm_up(self) -> u64 {
        match self {
            Self::Jumping => WARM_UP,
            Self::Boids | Self::Lattice => 10 * WARM_UP,
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

/// Where the tables go: line by line, as they are measured.
struct Printer<'a> {
    say: &'a mut dyn FnMut(&str),
    has_begun: bool,
}

impl Printer<'_> {
    /// A new table: what stands above its rows.
    fn heading(&mut self, text: &str) {
        if std::mem::replace(&mut self.has_begun, true) {
            (self.say)("");
        }
        (self.say)(text);
    }

    fn row(&mut self, row: &impl fmt::Display) {
        (self.say)(&row.to_string());
    }
}

/// Measures the tables. `say`: prints a line, or several; each row as soon as it is measured.
///
/// # Errors
///
/// A side cannot be started or fails, or the recording of a row cannot be written.
pub async fn bench(
    options: &BenchOptions,
    say: &mut dyn FnMut(&str),
) -> Result<BenchAnswer, RunError> {
    let mut printer = Printer { say, has_begun: false };
    let mut cells = Vec::new();
    let modes: &[Mode] = if options.all {
        &[Mode::Sequential, Mode::Parallel, Mode::Recording]
    } else {
        &[Mode::Sequential]
    };
    let has = |which| options.table.is_none_or(|table| table == which);
    let wanted = |agents: u32, small: u32| match (&*options.agents, options.table) {
        ([], None) => agents <= small,
        ([], Some(_)) => true,
        (listed, _) => listed.contains(&agents),
    };
    let rows: Vec<&PeerFigures> =
        ROWS.iter().filter(|figures| wanted(figures.agents, u32::MAX)).collect();
    if has(Which::Propagation) && !rows.is_empty() {
        printer.heading(&heading());
        let mut group = String::new();
        for figures in rows {
            let models = BenchModel::ALL.into_iter().filter(|&model| figures.measures(model));
            let pairs = models.flat_map(|model| RobotMotion::ALL.map(|robots| (model, robots)));
            for (model, robots) in pairs.filter(|(model, it)| it.act_in(figures.agents, *model)) {
                for &mode in modes {
                    let cell = measure(figures.agents, model, robots, mode, options).await?;
                    if cell.group() != group {
                        group = cell.group();
                        printer.row(&group);
                    }
                    printer.row(&cell);
                    cells.push(cell);
                }
            }
        }
    }
    let rows: Vec<swarm::SwarmRow> =
        swarm::ROWS.into_iter().filter(|row| wanted(row.agents, swarm::SMALL)).collect();
    let swarm = match has(Which::Swarm) && !rows.is_empty() {
        true => Some(swarm::bench(&rows, options, &mut printer).await?),
        false => None,
    };
    let rows: Vec<standing::StandingRow> =
        standing::ROWS.into_iter().filter(|row| wanted(row.motes, standing::SMALL)).collect();
    let standing = match has(Which::Standing) && !rows.is_empty() {
        true => Some(standing::bench(&rows, options, &mut printer).await?),
        false => None,
    };
    let exchange_ms = if cells.is_empty() && swarm.is_none() {
        None
    } else {
        let exchange_ms = exchange_ms(options).await?;
        let about = format!(
            "Two empty calls, one to each side, and back took {exchange_ms:.3} ms here ({EXCHANGE_MS} on the machine that the \
             column \"to reach\" was set for). Every step is two calls: rows of few robots cost little more, and scale with it."
        );
        printer.heading(&wrapped(&about, "", WIDTH));
        Some(exchange_ms)
    };
    let threads = options.start.threads;
    Ok(BenchAnswer { schema: "bench/1", threads, exchange_ms, rows: cells, swarm, standing })
}

/// Numbers of agents of the rows of a table, or of all, ascending.
#[must_use]
pub fn rows(table: Option<Which>) -> Vec<u32> {
    let has = |which| table.is_none_or(|table| table == which);
    let propagation = ROWS.iter().map(|row| row.agents).filter(|_| has(Which::Propagation));
    let swarm = swarm::ROWS.iter().map(|row| row.agents).filter(|_| has(Which::Swarm));
    let standing = standing::ROWS.iter().map(|row| row.motes).filter(|_| has(Which::Standing));
    let mut rows: Vec<u32> = propagation.chain(swarm).chain(standing).collect();
    rows.sort_unstable();
    rows.dedup();
    rows
}

fn side(error: drive::peer::SideError) -> RunError {
    RunError::Side { error, kept: None }
}

fn record_failed(error: record::RecordError) -> RunError {
    RunError::Record { error, before_start: false }
}

fn number_or_dash(value: Option<f64>) -> String {
    value.map_or_else(|| "-".to_owned(), |value| value.to_string())
}

fn plan(agents: u32, model: BenchModel, robots: RobotMotion, mode: Mode) -> Result<Plan, RunError> {
    let coupling = if mode == Mode::Parallel { "parallel" } else { "sequential" };
    let (controller, often) = robots.config(model);
    let text = format!(
        "[experiment]\nname = \"bench\"\nseed = 1\nduration_s = 1e6\nagents = {agents}\ncoupling = \"{coupling}\"\n{often}\
         [robotsim.scenario]\nkind = \"disc\"\ndensity_per_m2 = 0.22\n\
         [robotsim.controller]\nkind = \"{}\"\n{controller}\n[netsim.phy]\n{}\n\
         [output]\nlinks = \"none\"\nreport = false\n",
        robots.name(),
        model.netsim()
    );
    Ok(experiment::read(Path::new("bench"), text, &Overrides::default())?)
}

async fn measure(
    agents: u32,
    model: BenchModel,
    robots: RobotMotion,
    mode: Mode,
    options: &BenchOptions,
) -> Result<RowAnswer, RunError> {
    let plan = plan(agents, model, robots, mode)?;
    let started = start(&plan, &options.start, Wanted::Nothing, None).await?;
    let mut coupled = started.coupled;
    let folder = temporary_folder()?;
    let mut recorder = None;
    if mode == Mode::Recording {
        let path = folder.path().join("record");
        recorder = Some(begin_record(&path, started.header, started.exchange)?);
    }
    let times_ms = steps(&plan, &mut coupled, &mut recorder, robots.warm_up(), options.steps).await;
    coupled.stop().await;
    let mut times_ms = times_ms?;
    if let Some(recorder) = recorder {
        end_record(recorder)?;
    }
    times_ms.sort_by(f64::total_cmp);
    let figures = PeerFigures::for_agents(agents);
    // The robots of the peers jump.
    let peers = figures.filter(|_| robots == RobotMotion::Jumping);
    Ok(RowAnswer {
        agents,
        model: model.name(),
        controller: robots.name(),
        mode: mode.name(),
        steps: times_ms.len(),
        median_ms: quantile_lower(&times_ms, 0.5),
        p90_ms: quantile_lower(&times_ms, 0.9),
        botnet_ms: peers.and_then(|figures| figures.botnet_ms(model)),
        paper_ms: peers.and_then(|figures| figures.paper_ms(model)),
        to_reach_ms: figures.and_then(|figures| figures.goal_ms(model)),
    })
}

fn temporary_folder() -> Result<PrivateFolder, RunError> {
    PrivateFolder::for_files().map_err(|source| {
        record_failed(record::RecordError::Create { path: std::env::temp_dir(), source })
    })
}

fn begin_record(path: &Path, header: RunHeader, made: Configured) -> Result<Recorder, RunError> {
    let mut recorder = Recorder::create(path, header).map_err(record_failed)?;
    recorder.configured(made).map_err(record_failed)?;
    Ok(recorder)
}

fn end_record(recorder: Recorder) -> Result<(), RunError> {
    let ending = Ending::complete();
    recorder.finish(&ending, Value::Null, report::page).map_err(record_failed)?;
    Ok(())
}

/// A step, recorded if there is a recorder: with the motes' state when its time has come. `hold`: robots stand still.
async fn step(
    plan: &Plan,
    coupled: &mut Processes,
    recorder: &mut Option<Recorder>,
    hold: bool,
) -> Result<StepOutcome, RunError> {
    let (number, from_ns) = (coupled.step_number() + 1, coupled.time_ns());
    let until_ns = from_ns + plan.experiment.step_ns;
    // A network without protocols keeps no such record.
    let has_statistics = recorder.is_some() && coupled.formation().is_some();
    let is_time = has_statistics && plan.output.holds_motes(number, from_ns, until_ns);
    let records = is_time.then_some(NetRecord::Statistics).into_iter().collect();
    let plan = StepPlan { until_ns, hold, records, ..StepPlan::default() };
    let outcome = coupled.advance(plan).await.map_err(side)?;
    if let Some(recorder) = recorder.as_mut() {
        let taken = Taken { outcome: outcome.clone(), commands: Vec::new(), start_ns: None };
        recorder.step(record_of(taken)).map_err(record_failed)?;
    }
    Ok(outcome)
}

/// Wall time of each step (ms) after a few that warm up.
async fn steps(
    plan: &Plan,
    coupled: &mut Processes,
    recorder: &mut Option<Recorder>,
    warm_up: u64,
    n_steps: Option<u64>,
) -> Result<Vec<f64>, RunError> {
    let mut times_ms = Vec::new();
    let mut begun = Instant::now();
    for index in 0.. {
        if index == warm_up {
            begun = Instant::now();
            times_ms.clear();
        }
        let enough = match n_steps {
            Some(n_steps) => n_steps.max(1) <= times_ms.len() as u64,
            None => MIN_STEPS <= times_ms.len() && MEASURED <= begun.elapsed(),
        };
        if warm_up <= index && enough {
            break;
        }
        let step_begun = Instant::now();
        step(plan, coupled, recorder, false).await?;
        times_ms.push(step_begun.elapsed().as_secs_f64() * 1e3);
    }
    Ok(times_ms)
}

/// Median wall time of an empty call to each side and back, one after the other (ms): what this machine takes to hand
/// over, whatever is handed over.
async fn exchange_ms(options: &BenchOptions) -> Result<f64, RunError> {
    let plan = plan(1, BenchModel::Full, RobotMotion::Jumping, Mode::Sequential)?;
    let mut coupled = start(&plan, &options.start, Wanted::Nothing, None).await?.coupled;
    let times_ms = exchanges(&plan, &mut coupled).await;
    coupled.stop().await;
    let mut times_ms = times_ms?;
    times_ms.sort_by(f64::total_cmp);
    Ok(quantile_lower(&times_ms, 0.5))
}

/// Wall time of each of many barriers (ms).
async fn exchanges(plan: &Plan, coupled: &mut Processes) -> Result<Vec<f64>, RunError> {
    // A barrier confirms a step.
    step(plan, coupled, &mut None, false).await?;
    let mut times_ms = Vec::with_capacity(EXCHANGES);
    for index in 0..WARM_UP as usize + EXCHANGES {
        let begun = Instant::now();
        coupled.confirm().await.map_err(side)?;
        if WARM_UP as usize <= index {
            times_ms.push(begun.elapsed().as_secs_f64() * 1e3);
        }
    }
    Ok(times_ms)
}

/// Exchanges that are measured.
const EXCHANGES: usize = 2000;
/// What they took on the machine that the goals were set for: two empty messages of one stream and back, 27 µs each.
const EXCHANGE_MS: f64 = 0.054;
/// From so many agents on robots that heed each other are measured, too.
const LOCAL_FROM: u32 = 1000;
/// Steps before the clock runs.
const WARM_UP: u64 = 10;
/// Least number of measured steps.
const MIN_STEPS: usize = 20;
/// Least time measured.
const MEASURED: Duration = Duration::from_secs(1);

/// The measured tables.
#[derive(Debug, Serialize, JsonSchema)]
pub struct BenchAnswer {
    /// The format of this answer.
    #[schemars(extend("const" = "bench/1"))]
    schema: &'static str,
    /// Worker threads of the simulators as given by --threads; null: their default.
    threads: Option<u16>,
    /// Median time of an exchange with two empty peers (ms); null if it was not timed.
    exchange_ms: Option<f64>,
    /// Cells of the tables of propagation models and of controllers.
    rows: Vec<RowAnswer>,
    /// Swarms over a whole network; null if that table was not asked for.
    swarm: Option<Vec<swarm::RowAnswer>>,
    /// Networks of motes that stand still; null if that table was not asked for.
    standing: Option<Vec<standing::RowAnswer>>,
}

/// A cell of the table of propagation models or controllers.
#[derive(Debug, Serialize, JsonSchema)]
struct RowAnswer {
    /// Number of robots.
    agents: u32,
    /// The propagation model.
    model: &'static str,
    /// The controller of the robots.
    controller: &'static str,
    /// How the processes are coupled.
    mode: &'static str,
    /// Steps that were timed.
    steps: usize,
    /// Median time of a step (ms).
    median_ms: f64,
    /// Time (ms) that 90 % of the steps do not exceed.
    p90_ms: f64,
    /// Time of BotNet's step on the same task (ms); null where there is none.
    botnet_ms: Option<f64>,
    /// Time in BotNet's paper (ms); null where there is none.
    paper_ms: Option<f64>,
    /// The goal for the median (ms); null where there is none.
    to_reach_ms: Option<f64>,
}

/// What stands above the rows of propagation alone.
fn heading() -> String {
    let about = "Wall time per control step (ms), both processes and gRPC included. Robots that jump at random: square of \
                 10 m, for the disk a disc of 0.22 per m²; robots that react to their neighbours (boids, olfati-saber) \
                 start there and act at 10 Hz, measured from their 10th second. BotNet: robots that jump, one process, no \
                 RPC, measured elsewhere on a 2-core machine (10 m square for all models); paper: as printed, for full.";
    format!(
        "{}\n\n{:48}{:>9}{:>22}\n{:>6}  {:<23} {:>8} {:>8} {:>7} {:>7} {:>6}  faster",
        wrapped(about, "", WIDTH),
        "",
        "to",
        "times",
        "agents",
        "model",
        "median",
        "90 %",
        "reach",
        "BotNet",
        "paper"
    )
}

impl RowAnswer {
    /// What rows that follow each other have in common.
    fn group(&self) -> String {
        format!("{}, {}", self.controller, self.mode)
    }
}

impl fmt::Display for RowAnswer {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { agents, model, median_ms, p90_ms, botnet_ms, .. } = self;
        write!(
            f,
            "{agents:>6}  {model:<23} {median_ms:>8.3} {p90_ms:>8.3} {:>7} {:>7} {:>6}  {}",
            number_or_dash(self.to_reach_ms),
            number_or_dash(*botnet_ms),
            number_or_dash(self.paper_ms),
            botnet_ms.map_or_else(|| "-".to_owned(), |peer| format!("{:.1}", peer / median_ms)),
        )
    }
}
