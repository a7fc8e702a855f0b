//! The commands that run many experiments.

use super::{Failure, FileArgs, check_place, on_runtime, write_json};
use crate::compare_runs;
use crate::console::{say, warn};
use crate::run::StartOptions;
use crate::sweep::{self, SweepError, SweepOptions};
use clap::Args;
use numbers::format::count_of;
use std::path::PathBuf;

#[derive(Args)]
pub(super) struct SweepArgs {
    #[command(flatten)]
    file: FileArgs,
    /// Folder for results; the sweep is recorded in a subfolder with the experiment's name, and resumes if trials are found
    /// there
    #[arg(long, alias = "output", value_name = "DIR", default_value = "runs")]
    out: PathBuf,
    /// Number of trials that run at the same time [default: one per core]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..))]
    jobs: Option<u16>,
    /// Number of threads per simulator; results do not depend on it
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u16).range(1..))]
    pub(super) threads: u16,
    /// Discard finished trials and run all of them again
    #[arg(long)]
    restart: bool,
    /// Estimate time, memory and disk space of the trials that are left, and leave nothing
    #[arg(long)]
    dry_run: bool,
}

/// `orchestrator sweep`.
pub(super) fn sweep(args: &SweepArgs, start: StartOptions) -> Result<(), Failure> {
    if let Some(path) = &args.file.json {
        check_place("--json", path)?;
    }
    let options = SweepOptions {
        config: args.file.config.clone(),
        overrides: args.file.change.overrides(),
        out: args.out.clone(),
        start: StartOptions { is_busy: true, ..start },
        jobs: args.jobs.map(usize::from),
        restart: args.restart,
    };
    let failed =
        |error: SweepError| Failure { status: error.exit_status(), text: error.to_string() };
    if args.dry_run {
        let dry = on_runtime(sweep::dry_run(&options))?.map_err(failed)?;
        for warning in &dry.warnings {
            warn(warning);
        }
        say(dry.text());
        return write_json(args.file.json.as_deref(), &dry);
    }
    let report = sweep::sweep(&options).map_err(failed)?;
    for warning in &report.summary.warnings {
        warn(warning);
    }
    let before = match report.n_before {
        0 => String::new(),
        n => format!(", {n} of them finished earlier"),
    };
    say(format!(
        "{}: {}{before} in {:.1} s, {} of simulators started",
        report.summary.name,
        count_of(report.n_trials as u64, "trial"),
        report.wall_s,
        count_of(report.n_starts, "pair")
    ));
    say(&report.text);
    say(format!("results in {}", report.dir.display()));
    say(format!("open {}", report.dir.join("report.html").display()));
    write_json(args.file.json.as_deref(), &report.summary)?;
    if report.failed.is_empty() {
        return Ok(());
    }
    Err(Failure::work(format!(
        "{} of {} trials failed; the table has all others. Run the same command again to retry them",
        report.failed.len(),
        report.n_trials
    )))
}

#[derive(Args)]
pub(super) struct CompareRunsArgs {
    /// Folder of the first run or sweep
    a: PathBuf,
    /// Folder of the second run or sweep
    b: PathBuf,
    /// Write the results as JSON to this file; - for standard output
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

/// `orchestrator compare-runs`.
pub(super) fn compare_runs(args: &CompareRunsArgs) -> Result<(), Failure> {
    let changes = compare_runs::compare_runs(&args.a, &args.b).map_err(Failure::request)?;
    for warning in &changes.warnings {
        warn(warning);
    }
    say(compare_runs::words::text(&changes));
    write_json(args.json.as_deref(), &changes)
}
