//! `murmuration power`: how large an effect a campaign would show.

use super::arguments::{ThreadsArgs, whole_number};
use super::choice::ChoiceArgs;
use super::inputs::{self, Watching};
use super::stop::{BudgetArgs, Stopper};
use super::{AllowFileArgs, Failure, ReadArgs, check_json, write_json};
use clap::Args;
use diagnose::Request;
use diagnose::power::{self, Question};
use std::path::PathBuf;
use terminal::say;

#[derive(Args)]
pub(super) struct PowerArgs {
    /// The configuration (TOML): the model without the effect
    config: PathBuf,
    /// Measurements to use as a template: every simulated campaign has the same rows
    #[arg(long, value_name = "FILE")]
    like: PathBuf,
    /// Name of the effect to detect
    #[arg(long, value_name = "NAME")]
    effect: String,
    /// Fix a key of the effect other than its size, as in reference_c=18. Repeatable
    #[arg(long, value_name = "KEY=VALUE")]
    with: Vec<String>,
    /// The key that sets the effect's size [default: the first fitted key]
    #[arg(long, value_name = "KEY")]
    vary: Option<String>,
    /// Number of simulated campaigns per size
    #[arg(long, value_name = "N", default_value_t = 10, value_parser = clap::value_parser!(u64).range(2..))]
    campaigns: u64,
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
    #[command(flatten)]
    choices: ChoiceArgs,
    #[command(flatten)]
    budget: BudgetArgs,
    #[command(flatten)]
    pub(super) threads: ThreadsArgs,
    /// Write the results as JSON to this file; - for standard output
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

/// `murmuration power`.
pub(super) fn power(args: &PowerArgs) -> Result<(), Failure> {
    check_json(args.json.as_deref())?;
    let stopper = Stopper::listen(args.budget)?;
    let model = (&*args.config, &*args.set, args.allow.consent());
    let (config, table) = inputs::files(model, &args.like, args.read)?;
    let request = Request::new(&config, &table).with_choices(args.choices.choices());
    let question = Question {
        effect: &args.effect,
        with: &args.with,
        vary: args.vary.as_deref(),
        campaigns: args.campaigns,
        seed: args.seed,
    };
    let watching = Watching::new(Some(&stopper));
    let found = diagnose::power(&request, &question, &watching);
    watching.clear();
    let found = found.map_err(Failure::request)?;
    say(power::answer::text(&found));
    write_json(args.json.as_deref(), &found)?;
    stopper.require_complete(found.complete)
}
