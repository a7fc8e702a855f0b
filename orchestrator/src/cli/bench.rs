//! `murmuration bench`.

use super::{Failure, on_runtime, write_json};
use bench::BenchOptions;
use clap::Args;
use run::StartOptions;
use std::path::PathBuf;
use terminal::say;

#[derive(Args)]
pub(super) struct BenchArgs {
    /// Measure all rows of this table only [default: all rows of propagation and the small rows of the others]
    #[arg(long, value_name = "TABLE")]
    table: Option<bench::Which>,
    /// Measure only rows with this number of agents. Repeatable
    #[arg(long, value_name = "N")]
    agents: Vec<u32>,
    /// Number of steps to measure per row [default: enough for one second]
    #[arg(long, value_name = "N")]
    steps: Option<u64>,
    /// Also measure with recording and with parallel coupling
    #[arg(long)]
    all: bool,
    /// Number of threads per simulator [default: one per core]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..))]
    pub(super) threads: Option<u16>,
    /// Write the results as JSON to this file; - for standard output
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

/// Measures the speed of the simulators.
pub(super) fn bench(args: &BenchArgs, start: StartOptions) -> Result<(), Failure> {
    let options = BenchOptions {
        table: args.table,
        agents: args.agents.clone(),
        steps: args.steps,
        all: args.all,
        start,
    };
    let rows = bench::rows(options.table);
    if let Some(agents) = options.agents.iter().find(|agents| !rows.contains(agents)) {
        let rows: Vec<String> = rows.iter().map(u32::to_string).collect();
        return Err(Failure::request(format!(
            "--agents {agents}: no row has this number of agents; choose from {}",
            rows.join(", ")
        )));
    }
    let mut print = |text: &str| say(text);
    let answer = on_runtime(bench::bench(&options, &mut print))?.map_err(Failure::work)?;
    write_json(args.json.as_deref(), &answer)
}
