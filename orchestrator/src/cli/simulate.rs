//! `murmuration simulate`: the campaign that a model would have measured.

use super::arguments::whole_number;
use super::inputs;
use super::{AllowFileArgs, Failure, ReadArgs, check_place, is_stdout, write_json, write_whole};
use clap::Args;
use diagnose::simulate::simulation::Simulation;
use diagnose::simulate::{self, Simulated};
use flate2::Compression;
use flate2::write::GzEncoder;
use std::io::Write as _;
use std::path::PathBuf;
use terminal::{say, warn};

#[derive(Args)]
pub(super) struct SimulateArgs {
    /// The configuration (TOML): the model to simulate
    config: PathBuf,
    /// Measurements to use as a template: times, positions, channels, commands and covariates are taken from them
    #[arg(long, value_name = "FILE")]
    like: PathBuf,
    /// Write the simulated campaign to this file (CSV; gzipped if the name ends in .gz; - for standard output)
    #[arg(long, value_name = "FILE")]
    output: PathBuf,
    /// Seed of all random draws
    #[arg(long, value_name = "N", default_value_t = 1, allow_negative_numbers = true, value_parser = whole_number::<{ u64::MAX }>)]
    seed: u64,
    /// Override a key of the configuration, as in netsim.phy.propagation=friis. Repeatable
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
    #[command(flatten)]
    read: ReadArgs,
    #[command(flatten)]
    allow: AllowFileArgs,
    /// Write a summary as JSON to this file; - for standard output
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

/// `murmuration simulate`.
pub(super) fn simulate(args: &SimulateArgs) -> Result<(), Failure> {
    let ending = args.output.extension().and_then(|ending| ending.to_str()).unwrap_or_default();
    if !["csv", "gz"].contains(&ending) && !is_stdout(&args.output) {
        return Err(Failure::request(format!(
            "--output {}: the file name must end in .csv or .csv.gz; use {}.csv",
            args.output.display(),
            args.output.with_extension("").display()
        )));
    }
    check_place("--output", &args.output)?;
    let model = (&*args.config, &*args.set, args.allow.consent());
    let (config, table) = inputs::files(model, &args.like, args.read)?;
    let simulated =
        simulate::simulate(&config, &table, args.seed, None).map_err(Failure::request)?;
    let content = content(ending, &simulated).map_err(Failure::work)?;
    write_whole("--output", &args.output, content)?;
    if simulated.is_noise_estimated {
        warn(format!(
            "the configuration does not set the noise. Used {:.4} {}, estimated from {}; this estimate includes the \
             model's own error",
            simulated.noise,
            simulated.unit,
            args.like.display()
        ));
    }
    say(format!(
        "{}: {} rows as in {}, simulated from {}, seed {}, noise {:.4} {}",
        args.output.display(),
        simulated.n_rows(),
        args.like.display(),
        args.config.display(),
        args.seed,
        simulated.noise,
        simulated.unit
    ));
    if 0 < simulated.n_left_out {
        warn(format!(
            "{} rows of the template are unusable and were left out",
            simulated.n_left_out
        ));
    }
    write_json(args.json.as_deref(), &Simulation::summarise(&simulated, args.seed))
}

/// The campaign as CSV, gzipped if the name of the file ends so.
fn content(ending: &str, simulated: &Simulated) -> std::io::Result<Vec<u8>> {
    let csv = simulated.to_csv().into_bytes();
    if ending != "gz" {
        return Ok(csv);
    }
    let mut encoder = GzEncoder::new(Vec::new(), Compression::default());
    encoder.write_all(&csv)?;
    encoder.finish()
}
