//! `murmuration conformance`.

use super::{Failure, TlsArgs, on_runtime, write_json};
use clap::Args;
use conformance::ConformanceOptions;
use std::path::PathBuf;
use terminal::say;

#[derive(Args)]
pub(super) struct ConformanceArgs {
    /// Which kind of simulator to test
    side: ConformanceSide,
    /// URL of the simulator
    url: String,
    /// Configuration of the simulator (TOML), with its keys at the top level [default: empty]
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,
    /// Number of robots in the test
    #[arg(long, value_name = "N", default_value_t = 5, value_parser = clap::value_parser!(u32).range(1..=1000))]
    agents: u32,
    #[command(flatten)]
    tls: TlsArgs,
    /// Write the results as JSON to this file; - for standard output
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

#[derive(Clone, Copy, clap::ValueEnum)]
enum ConformanceSide {
    /// A robot simulator
    Robotsim,
    /// A network simulator
    Netsim,
}

/// Tests a running simulator.
pub(super) fn conformance(args: &ConformanceArgs) -> Result<(), Failure> {
    let config_toml = match &args.config {
        Some(path) => experiment::text_of(path)
            .map_err(|error| Failure::request(format!("--config {error}")))?,
        None => String::new(),
    };
    let options = ConformanceOptions {
        url: args.url.clone(),
        tls: args.tls.tls(),
        config_toml,
        agents: args.agents,
    };
    let found = match args.side {
        ConformanceSide::Robotsim => on_runtime(conformance::robots(&options))?,
        ConformanceSide::Netsim => on_runtime(conformance::network(&options))?,
    }
    .map_err(Failure::request)?;
    say(&found);
    write_json(args.json.as_deref(), &found.answer())?;
    if found.is_good() {
        Ok(())
    } else {
        Err(Failure::work(format!(
            "{} violates the contract; see the checks marked BROKEN",
            found.name
        )))
    }
}
