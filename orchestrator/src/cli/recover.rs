//! `murmuration recover` and `murmuration reproduce`.

use super::{
    AllowArgs, Failure, ReadArgs, StartOptions, TlsArgs, check_json, on_runtime, write_json,
};
use clap::Args;
use drive::private_folder::PrivateFolder;
use experiment::Overrides;
use run::Reproduction;
use std::path::PathBuf;
use terminal::{Screen, say, warn_all};

#[derive(Args)]
pub(super) struct RecoverArgs {
    /// Folder of a run that was killed: OUT/.NAME.partial-PID
    folder: PathBuf,
    /// Write the summary as JSON to this file; - for standard output
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

#[derive(Args)]
pub(super) struct ReproduceArgs {
    /// Folder of the recorded run
    run: PathBuf,
    /// Use the network simulator at this URL instead of the recorded one or starting one
    #[arg(long, value_name = "URL")]
    netsim: Option<String>,
    /// Use the robot simulator at this URL instead of the recorded one or starting one
    #[arg(long, value_name = "URL")]
    robotsim: Option<String>,
    #[command(flatten)]
    tls: TlsArgs,
    #[command(flatten)]
    allow: AllowArgs,
    #[command(flatten)]
    read: ReadArgs,
    /// Keep the results of the new run in this folder [default: a temporary one]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Number of threads per simulator; results do not depend on it [default: one per core]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..))]
    pub(super) threads: Option<u16>,
    /// Write the comparison as JSON to this file; - for standard output
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

/// Makes a result of what a killed run had recorded.
pub(super) fn recover(args: &RecoverArgs) -> Result<(), Failure> {
    check_json(args.json.as_deref())?;
    let finished = run::recover(&args.folder).map_err(Failure::of_run)?;
    warn_all(&finished.warnings);
    let summary = &finished.summary;
    say(format!(
        "{}: {} steps recovered, {:.1} s simulated",
        summary.name, summary.steps, summary.simulated_s
    ));
    say(format!("results in {}", finished.dir.display()));
    if let Some(page) = &finished.report {
        say(format!("open {}", page.display()));
    }
    write_json(args.json.as_deref(), summary)
}

/// Runs a recorded experiment again and compares.
pub(super) fn reproduce(args: &ReproduceArgs, start: StartOptions) -> Result<(), Failure> {
    check_json(args.json.as_deref())?;
    let temporary = PrivateFolder::for_files().map_err(Failure::work)?;
    let out = args.out.as_deref().unwrap_or(temporary.path());
    let overrides = Overrides {
        netsim_url: args.netsim.clone(),
        robotsim_url: args.robotsim.clone(),
        tls: args.tls.tls(),
        consent: args.allow.consent(),
        ..Overrides::default()
    };
    let screen = &mut Screen::default();
    let folder = args.read.open(&args.run)?;
    let answer = on_runtime(run::reproduce(&folder, out, &start, &overrides, screen))?
        .map_err(Failure::of_run)?;
    write_json(args.json.as_deref(), &answer)?;
    let Reproduction { equal, different, first_different_step, versions, .. } = &answer;
    if different.is_empty() {
        say(format!(
            "{}: reproduced. {} files are equal, byte for byte",
            args.run.display(),
            equal.len()
        ));
        return Ok(());
    }
    let mut text =
        format!("{}: not reproduced; different: {}", args.run.display(), different.join(", "));
    if let Some(step) = first_different_step {
        text.push_str(&format!("; the first difference is in step {step}"));
    }
    if versions[0] != versions[1] {
        text.push_str(&format!(
            "; version {} recorded the run, and this is version {}",
            versions[0], versions[1]
        ));
    }
    Err(Failure::work(text))
}
