//! `murmuration check`: an experiment file, or a file of measurements, without running or fitting anything.

use super::choice::ChoiceArgs;
use super::inputs::{self, print_account};
use super::{Failure, OverrideArgs, ReadArgs, write_json};
use check::{AskedPermission, CHECK_SCHEMA, ExperimentCheck, SweepCheck};
use clap::Args;
use experiment::{Acts, Capability};
use measure::packets;
use run::FormedFiles;
use std::path::{Path, PathBuf};
use terminal::{say, warn_all};

#[derive(Args)]
pub(super) struct CheckArgs {
    /// The experiment file (TOML); with --data, the sections that describe the measured part suffice
    #[arg(required_unless_present = "data")]
    config: Option<PathBuf>,
    /// Check measurements instead (CSV, Parquet, K7 or the folder of a run; CSV and K7 may be gzipped): list their
    /// contents, anomalies, and the effects that they can reveal
    #[arg(long, value_name = "FILE")]
    data: Option<PathBuf>,
    #[command(flatten)]
    read: ReadArgs,
    #[command(flatten)]
    choices: ChoiceArgs,
    #[command(flatten)]
    change: OverrideArgs,
    /// Write the results as JSON to this file; - for standard output
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

/// `murmuration check`.
pub(super) fn check(args: &CheckArgs) -> Result<(), Failure> {
    match (&args.data, &args.config) {
        (Some(data), _) => check_data(args, data),
        (None, Some(config)) if sweep::is_sweep(config) => check_sweep(args, config),
        (None, Some(config)) => check_experiment(args, config),
        (None, None) => Ok(()),
    }
}

fn check_data(args: &CheckArgs, data: &Path) -> Result<(), Failure> {
    let config = args
        .config
        .as_deref()
        .map(|path| inputs::compared(path, &args.change.set, args.change.allow.consent()));
    let config = config.transpose()?;
    let table = inputs::table(data, args.read)?;
    if packets::has_shape(&table).is_ok() {
        let checked = check::packets(&table).map_err(Failure::request)?;
        print_account(&checked.account);
        say(checked.text().trim_end());
        return write_json(args.json.as_deref(), &checked);
    }
    let checked = check::data(config, &table, &args.choices.choices()).map_err(Failure::request)?;
    print_account(&checked.account);
    say(check::text(&checked).trim_end());
    write_json(args.json.as_deref(), &checked)
}

fn check_sweep(args: &CheckArgs, config: &Path) -> Result<(), Failure> {
    let sweep::Checked { settings, trials, capabilities, warnings } =
        sweep::check(config, &args.change.overrides()).map_err(Failure::request)?;
    warn_all(&warnings);
    say(format!("{}: valid. A sweep of {settings} settings, {trials} trials", config.display()));
    let capabilities = listed(&capabilities);
    let found = SweepCheck { schema: CHECK_SCHEMA, settings, trials, capabilities, warnings };
    write_json(args.json.as_deref(), &found)
}

fn check_experiment(args: &CheckArgs, config: &Path) -> Result<(), Failure> {
    let overrides = args.change.overrides().acting(Acts::Nothing);
    let mut plan = experiment::load(config, &overrides).map_err(Failure::request)?;
    if plan.capabilities.iter().all(|asked| overrides.consent.covers(&asked.action)) {
        FormedFiles::default().open(&mut plan).map_err(Failure::request)?;
    }
    let n_steps = plan.duration_ns.div_ceil(plan.experiment.step_ns);
    warn_all(&plan.warnings);
    say(format!(
        "{}: valid. {} agents, seed {}, {n_steps} steps of {} ms",
        config.display(),
        plan.experiment.agent_count,
        plan.experiment.seed,
        plan.experiment.step_ns as f64 / 1e6
    ));
    if let Some(profile) = &plan.profile {
        say(profile);
    }
    for (section, side) in [("robotsim", &plan.robotsim), ("netsim", &plan.netsim)] {
        if let Some(url) = &side.url {
            say(format!(
                "[{section}] is not checked: the simulator at {url} checks it when the experiment runs"
            ));
        }
        if let Some(command) = &side.command {
            say(format!(
                "[{section}] is not checked: the simulator that {} starts checks it when the experiment runs",
                command.shown()
            ));
        }
    }
    let capabilities = listed(&plan.capabilities);
    let found = ExperimentCheck {
        schema: CHECK_SCHEMA,
        name: plan.name,
        agents: plan.experiment.agent_count,
        seed: plan.experiment.seed,
        steps: n_steps,
        step_ns: plan.experiment.step_ns,
        capabilities,
        warnings: plan.warnings,
    };
    write_json(args.json.as_deref(), &found)
}

/// Says what a file asks for outside of its own folder, each with the option that allows it.
fn listed(capabilities: &[Capability]) -> Vec<AskedPermission> {
    let asked = capabilities.iter().map(|Capability { key, action }| AskedPermission {
        key: key.clone(),
        would: action.to_string(),
        option: action.option(),
    });
    let asked: Vec<AskedPermission> = asked.collect();
    for AskedPermission { key, would, option } in &asked {
        say(format!("{key} would {would} ({option})"));
    }
    asked
}
