//! `orchestrator power`: how large an effect a campaign would show.

use super::measured::ChoiceArgs;
use super::{Failure, inputs, place_for, write_json};
use crate::console::say;
use clap::Args;
use diagnose::power::{self, PowerError, Question};
use std::path::PathBuf;

#[derive(Args)]
pub(super) struct PowerArgs {
    /// The configuration (TOML): the model without the effect
    config: PathBuf,
    /// Measurements: campaigns with their rows are simulated
    #[arg(long, value_name = "FILE")]
    like: PathBuf,
    /// The effect
    #[arg(long, value_name = "NAME")]
    effect: String,
    /// A key of the effect that is not its size: reference_c=18. May be given several times
    #[arg(long, value_name = "KEY=VALUE")]
    with: Vec<String>,
    /// The key that is its size [default: the first that is fitted]
    #[arg(long, value_name = "KEY")]
    vary: Option<String>,
    /// Simulated campaigns at each size
    #[arg(long, value_name = "N", default_value_t = 10, value_parser = clap::value_parser!(u64).range(2..))]
    campaigns: u64,
    /// Seed of every random draw
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// Set a key of the configuration: netsim.phy.propagation=friis. May be given several times
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
    #[command(flatten)]
    choices: ChoiceArgs,
    /// Write what was found as JSON
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

/// `orchestrator power`.
pub(super) fn power(args: &PowerArgs) -> Result<(), Failure> {
    if let Some(path) = &args.json {
        place_for("--json", path).map_err(Failure::request)?;
    }
    let (config, table) = inputs::files(&args.config, &args.set, &args.like)?;
    let question = Question {
        effect: &args.effect,
        with: &args.with,
        vary: args.vary.as_deref(),
        campaigns: args.campaigns,
        seed: args.seed,
        set: &args.set,
        choices: &args.choices.choices(),
    };
    let found = power::power(&config, &table, &question, &|line| tracing::info!("{line}"))
        .map_err(|error: PowerError| Failure::request(error))?;
    say(power::answer::text(&found));
    write_json(args.json.as_deref(), &found)
}
