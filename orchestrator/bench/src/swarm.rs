//! The full protocols under a swarm: round-robin cells, everyone hears everyone.

use super::{
    BenchOptions, Printer, begin_record, end_record, number_or_dash, step, steps, temporary_folder,
};
use drive::Wanted;
use experiment::{Overrides, Plan};
use numbers::format::wrapped;
use numbers::layout::WIDTH;
use numbers::statistics::quantile_lower;
use proto::types::{NS_PER_S, seconds};
use record::Recorder;
use run::{Processes, RunError, start};
use schemars::JsonSchema;
use serde::Serialize;
use std::fmt;
use std::path::Path;

/// A row, and the peers' figures (ms per control period, in one process, without RPC; measured elsewhere).
#[derive(Clone, Copy, Debug)]
pub(super) struct SwarmRow {
    pub(super) agents: u32,
    /// BotNet with its 6TiSCH simulator; `None`: it does not form.
    botnet_ms: Option<f64>,
    /// The BotNet paper (arXiv 2108.13606).
    paper_ms: Option<f64>,
    to_reach_ms: f64,
}

const fn row(agents: u32, peers_ms: Option<[f64; 2]>, to_reach_ms: f64) -> SwarmRow {
    let (botnet_ms, paper_ms) = match peers_ms {
        Some([botnet_ms, paper_ms]) => (Some(botnet_ms), Some(paper_ms)),
        None => (None, None),
    };
    SwarmRow { agents, botnet_ms, paper_ms, to_reach_ms }
}

pub(super) const ROWS: [SwarmRow; 6] = [
    row(5, Some([3.1, 6.26]), 0.12),
    row(10, Some([9.5, 21.5]), 0.15),
    row(25, Some([51.5, 127.0]), 0.25),
    row(50, Some([234.0, 496.0]), 0.5),
    row(100, None, 2.0),
    row(500, None, 40.0),
];

/// Rows of at most so many agents are measured where no table is asked for.
pub(super) const SMALL: u32 = 100;

/// From so many agents on motes are admitted without asking, and routes are not acknowledged.
const MANY: u32 = 500;

/// Simulated time after which a network that has not formed is given up (ns).
const LIMIT_NS: u64 = 14_400 * NS_PER_S;

fn plan(agents: u32) -> Result<Plan, RunError> {
    // The root's one frame in a slotframe does not suffice to answer so many, each by itself.
    let answers = if agents < MANY { "" } else { "join.secure = false\nrpl.dao_ack = false\n" };
    let text = format!(
        "[experiment]\nname = \"bench\"\nseed = 1\nduration_s = 1e6\nagents = {agents}\ncontrol_period = \"slotframe\"\n\
         [robotsim.scenario]\nkind = \"square\"\n\
         [robotsim.controller]\nkind = \"random-jump\"\narena = \"square\"\nside_m = 10.0\n\
         [netsim]\nmode = \"6tisch\"\n{answers}[netsim.phy]\npropagation = \"full\"\n[netsim.sf]\nkind = \"rrsf\"\n\
         [output]\nlinks = \"none\"\nmcap = false\ntransmissions = false\nschedule = false\nneighbours = false\n\
         motes_every_s = 60\nreport = false\n"
    );
    Ok(experiment::read(Path::new("bench"), text, &Overrides::default())?)
}

/// Measures the rows of so many agents.
pub(super) async fn bench(
    rows: &[SwarmRow],
    options: &BenchOptions,
    printer: &mut Printer<'_>,
) -> Result<Vec<RowAnswer>, RunError> {
    printer.heading(&heading());
    let mut cells = Vec::new();
    for &row in rows {
        let plan = plan(row.agents)?;
        let started = start(&plan, &options.start, Wanted::Record, None).await?;
        let folder = temporary_folder()?;
        let path = folder.path().join("record");
        let mut coupled = started.coupled;
        let mut recorder = Some(begin_record(&path, started.header, started.exchange)?);
        let measured = measure(&plan, &mut coupled, &mut recorder, options.steps).await;
        coupled.stop().await;
        let (formed_ns, mut times_ms) = measured?;
        recorder.map_or(Ok(()), end_record)?;
        times_ms.sort_by(f64::total_cmp);
        let cell = RowAnswer {
            agents: row.agents,
            formed_s: formed_ns.map(seconds),
            steps: times_ms.len(),
            median_ms: quantile_lower(&times_ms, 0.5),
            p90_ms: quantile_lower(&times_ms, 0.9),
            botnet_ms: row.botnet_ms,
            paper_ms: row.paper_ms,
            to_reach_ms: row.to_reach_ms,
        };
        printer.row(&cell);
        cells.push(cell);
    }
    Ok(cells)
}

/// When the network had formed, and the wall time of each control period after that (ms).
async fn measure(
    plan: &Plan,
    coupled: &mut Processes,
    recorder: &mut Option<Recorder>,
    n_steps: Option<u64>,
) -> Result<(Option<u64>, Vec<f64>), RunError> {
    let formed_ns = form(plan, coupled, recorder).await?;
    let times_ms = if formed_ns.is_some() {
        steps(plan, coupled, recorder, super::WARM_UP, n_steps).await?
    } else {
        Vec::new()
    };
    Ok((formed_ns, times_ms))
}

/// Steps with robots that stand still until the network has formed. Returns when it had.
async fn form(
    plan: &Plan,
    coupled: &mut Processes,
    recorder: &mut Option<Recorder>,
) -> Result<Option<u64>, RunError> {
    while coupled.time_ns() < LIMIT_NS {
        step(plan, coupled, recorder, true).await?;
        let formed_ns = coupled.formation().and_then(|formation| formation.formed_ns);
        if formed_ns.is_some() {
            return Ok(formed_ns);
        }
    }
    Ok(None)
}

/// A row of the answer for programs.
#[derive(Debug, Serialize, JsonSchema)]
pub(super) struct RowAnswer {
    /// Number of robots.
    agents: u32,
    /// Simulated time until the network had formed (s); null if it did not.
    formed_s: Option<f64>,
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
    /// The goal for the median (ms).
    to_reach_ms: f64,
}

/// What stands above the rows.
fn heading() -> String {
    let about = format!(
        "Wall time per control period (ms), both processes and gRPC included: 6TiSCH with round-robin cells (RRSF), everyone \
         hears everyone, 48 bytes from each robot in each period, after formation; every packet and every minute every mote's \
         energy recorded. Every robot jumps at random in a square of 10 m. From {MANY} on motes are admitted without asking \
         and DAOs not acknowledged: the root's one frame in a slotframe cannot answer so many. BotNet: one process, no RPC, \
         measured elsewhere on a 2-core machine; paper: as printed."
    );
    format!(
        "{}\n\n{:>6}  {:>8} {:>8} {:>8} {:>8} {:>13} {:>8}  times faster",
        wrapped(&about, "", WIDTH),
        "agents",
        "formed s",
        "median",
        "90 %",
        "to reach",
        "BotNet",
        "paper"
    )
}

impl fmt::Display for RowAnswer {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { agents, formed_s, median_ms, p90_ms, botnet_ms, to_reach_ms, .. } = self;
        let Some(formed_s) = formed_s else {
            return write!(f, "{agents:>6}  does not form within {} s", seconds(LIMIT_NS));
        };
        let botnet = botnet_ms.map_or_else(|| "does not form".to_owned(), |ms| ms.to_string());
        write!(
            f,
            "{agents:>6}  {formed_s:>8.1} {median_ms:>8.3} {p90_ms:>8.3} {to_reach_ms:>8} {botnet:>13} {:>8}  {}",
            number_or_dash(self.paper_ms),
            botnet_ms.map_or_else(|| "-".to_owned(), |peer| format!("{:.0}", peer / median_ms)),
        )
    }
}
