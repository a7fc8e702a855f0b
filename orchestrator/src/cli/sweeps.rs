//! The commands that run many experiments.

use super::run::show_dry_run;
use super::{
    Failure, FileArgs, ReadArgs, check_json, check_place, is_stdout, on_runtime, write_json,
    write_whole,
};
use clap::Args;
use clap::builder::PossibleValuesParser;
use numbers::format::count_of;
use run::StartOptions;
use std::path::PathBuf;
use std::time::Duration;
use sweep::compare_runs::{self, CompareRunsError};
use sweep::engine::{self, EngineOptions, EngineReport, quoted};
use sweep::{MergeReport, Shard, SweepError, SweepOptions, SweepReport};
use terminal::{say, warn, warn_all};

#[derive(Args)]
pub(super) struct SweepArgs {
    #[command(flatten)]
    file: FileArgs,
    /// Folder for results, relative to the current folder, not to the experiment file; the sweep is recorded in a subfolder
    /// with the experiment's name, and resumes if that has finished trials
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
    /// Estimate time, memory and disk space of the remaining trials, and write nothing
    #[arg(long)]
    dry_run: bool,
    /// Run only shard I of N disjoint parts of the trials, as in 2/3; for sweeps on several machines. Once all shards
    /// are finished, run the sweep with --merge to write the table
    #[arg(long, value_name = "I/N")]
    shard: Option<Shard>,
    /// Run no trials: check that all shards are finished, and write the table, the summary and the report of the whole sweep
    #[arg(long, conflicts_with_all = ["shard", "jobs", "threads", "restart", "dry_run"])]
    merge: bool,
    /// Run the shards as tasks of this batch system, with the resources that [sweep.slurm] or [sweep.hyperqueue]
    /// requests. With slurm, the command follows the tasks, resubmits lost ones and merges the results; if jobs exist
    /// already, it follows them. With hyperqueue, it only submits. All machines must share the folder of results
    #[arg(
        long,
        value_name = "NAME",
        conflicts_with_all = ["shard", "merge", "restart", "dry_run"],
        value_parser = PossibleValuesParser::new(engine::names())
    )]
    engine: Option<String>,
    /// Number of shards, one per task of the batch system [default: one per trial, at most 100]
    #[arg(long, value_name = "N", requires = "engine", value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    shards: Option<u32>,
    /// Print what would be submitted, or write it to --emit-to; submit nothing
    #[arg(long, value_name = "WHAT", requires = "engine", conflicts_with = "json")]
    emit: Option<Emit>,
    /// File for --emit; - for standard output
    #[arg(
        long,
        value_name = "FILE",
        requires = "emit",
        default_value = "-",
        hide_default_value = true
    )]
    emit_to: PathBuf,
    /// Wait up to S seconds if another program writes the journal of this shard, for instance a task on a machine that has just
    /// failed
    #[arg(long, value_name = "S", requires = "shard", default_value_t = 0, value_parser = clap::value_parser!(u32).range(..=86_400))]
    wait_for_lock: u32,
}

/// What `--emit` writes.
#[derive(Clone, Copy, Debug, clap::ValueEnum)]
enum Emit {
    /// The job script
    Script,
}

/// Options that choose what a sweep runs and how: name, and whether a value follows. The command that messages show has none of
/// them.
const WORK_OPTIONS: [(&str, bool); 12] = [
    ("--shard", true),
    ("--merge", false),
    ("--jobs", true),
    ("--threads", true),
    ("--restart", false),
    ("--dry-run", false),
    ("--json", true),
    ("--engine", true),
    ("--shards", true),
    ("--emit", true),
    ("--emit-to", true),
    ("--wait-for-lock", true),
];

/// The arguments of the program without its name and without [`WORK_OPTIONS`], as a shell takes them.
fn base_arguments(arguments: impl Iterator<Item = String>) -> Vec<String> {
    let mut words = Vec::new();
    let mut arguments = arguments.skip(1);
    while let Some(argument) = arguments.next() {
        if argument == "--" {
            // What follows are files. Further options come after them: none may look like one.
            let file =
                |word: String| if word.starts_with('-') { format!("./{word}") } else { word };
            words.extend(arguments.map(|word| quoted(&file(word))));
            break;
        }
        let name = argument.split('=').next().unwrap_or_default();
        match WORK_OPTIONS.iter().find(|(option, _)| *option == name) {
            Some((_, has_value)) => {
                if *has_value && !argument.contains('=') {
                    arguments.next();
                }
            }
            None => words.push(quoted(&argument)),
        }
    }
    words
}

/// `murmuration sweep`.
pub(super) fn sweep(args: &SweepArgs, start: StartOptions) -> Result<(), Failure> {
    check_json(args.file.json.as_deref())?;
    let options = SweepOptions {
        config: args.file.config.clone(),
        overrides: args.file.change.overrides(),
        out: args.out.clone(),
        start: StartOptions { is_busy: true, ..start },
        jobs: args.jobs.map(usize::from),
        restart: args.restart,
        lock_wait: Duration::from_secs(args.wait_for_lock.into()),
        arguments: base_arguments(
            std::env::args_os().map(|word| word.to_string_lossy().into_owned()),
        ),
    };
    let of_engine = args.engine.as_deref();
    if let Some(of_engine) =
        of_engine.and_then(|name| EngineOptions::new(name, args.shards, args.threads))
    {
        return run_engine(&options, of_engine, args);
    }
    if args.dry_run {
        let dry = on_runtime(sweep::dry_run(&options, args.shard))?.map_err(failed)?;
        return show_dry_run(&dry, args.file.json.as_deref());
    }
    if let Some(shard) = args.shard {
        if args.file.json.is_some() {
            return Err(Failure::request(
                "--json: a shard has no results of the sweep; use --json with --merge, or --dry-run",
            ));
        }
        return run_shard(&options, shard);
    }
    if args.merge {
        let merged = sweep::merge(&options).map_err(failed)?;
        let shards: Vec<String> =
            merged.failed_shards.iter().map(|shard| format!("--shard {shard}")).collect();
        let retry = format!("Run {} again to retry them, then --merge", shards.join(", "));
        return show_merged(&merged, &retry, args);
    }
    let report = sweep::sweep(&options).map_err(failed)?;
    let before = finished_earlier(report.n_before);
    let done = format!(
        "{before} in {:.1} s, {} of simulators started",
        report.wall_s,
        count_of(report.n_starts, "pair")
    );
    show(&report, &done, "Run the same command again to retry them", args)
}

/// Runs the shards of a sweep by a batch system, or writes the script that would.
fn run_engine(
    options: &SweepOptions,
    of_engine: EngineOptions,
    args: &SweepArgs,
) -> Result<(), Failure> {
    if args.emit.is_some() {
        if !is_stdout(&args.emit_to) {
            check_place("--emit-to", &args.emit_to)?;
        }
        let script = engine::emit(options, of_engine).map_err(failed)?;
        return write_whole("--emit-to", &args.emit_to, script);
    }
    match engine::run(options, of_engine).map_err(failed)? {
        EngineReport::Merged(merged) => {
            show_merged(&merged, "Run the same command again to retry them", args)
        }
        EngineReport::Submitted(next) => {
            if args.file.json.is_some() {
                warn("--json: there are no results of the sweep yet; use --json with --merge");
            }
            say(next);
            Ok(())
        }
    }
}

fn finished_earlier(n_trials: usize) -> String {
    if n_trials == 0 { String::new() } else { format!(", {n_trials} of them finished earlier") }
}

fn show_merged(merged: &MergeReport, retry: &str, args: &SweepArgs) -> Result<(), Failure> {
    let done = format!(" of {} merged", count_of(merged.n_shards.into(), "shard"));
    show(&merged.sweep, &done, retry, args)
}

fn failed(error: SweepError) -> Failure {
    Failure { status: error.exit_status(), text: error.to_string() }
}

/// Shows the results of a whole sweep: what was done, and what to do about trials that failed.
fn show(report: &SweepReport, done: &str, retry: &str, args: &SweepArgs) -> Result<(), Failure> {
    warn_all(&report.summary.warnings);
    say(format!("{}: {}{done}", report.summary.name, count_of(report.n_trials as u64, "trial")));
    say(&report.text);
    say(format!("results in {}", report.dir.display()));
    say(format!("open {}", report.dir.join("report.html").display()));
    write_json(args.file.json.as_deref(), &report.summary)?;
    if report.failed.is_empty() {
        return Ok(());
    }
    Err(Failure::work(format!(
        "{} of {} trials failed; the table has all others. {retry}",
        report.failed.len(),
        report.n_trials
    )))
}

/// Runs one shard of a sweep.
fn run_shard(options: &SweepOptions, shard: Shard) -> Result<(), Failure> {
    let report = sweep::run_shard(options, shard).map_err(failed)?;
    let before = finished_earlier(report.n_before);
    say(format!(
        "{}: shard {shard} has {} of {}{before}; {:.1} s, {} of simulators started",
        report.name,
        report.n_trials,
        count_of(report.n_of_sweep as u64, "trial"),
        report.wall_s,
        count_of(report.n_starts, "pair")
    ));
    say(format!("journal in {}", report.journal.display()));
    say(format!("once all shards are finished, run {} --merge", options.command()));
    if report.failed.is_empty() {
        return Ok(());
    }
    Err(Failure::work(format!(
        "{} of {} trials of the shard failed. Run the same command again to retry them",
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
    #[command(flatten)]
    read: ReadArgs,
    /// Write the results as JSON to this file; - for standard output
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

/// `murmuration compare-runs`.
pub(super) fn compare_runs(args: &CompareRunsArgs) -> Result<(), Failure> {
    let changes =
        compare_runs::compare_runs(&args.a, &args.b, args.read.reading()).map_err(|error| {
            match error {
                CompareRunsError::Unbelieved(_) => Failure::work(error),
                other => Failure::request(other),
            }
        })?;
    warn_all(&changes.warnings);
    say(compare_runs::text(&changes));
    write_json(args.json.as_deref(), &changes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_command_in_messages_is_the_one_that_was_given_without_what_it_runs() {
        let command = |text: &str| base_arguments(text.split('|').map(str::to_owned)).join(" ");
        assert_eq!(
            command("/bin/orchestrator|sweep|s.toml|--merge|--out|a b|--set=x.y=[1, 2]"),
            "sweep s.toml --out 'a b' '--set=x.y=[1, 2]'"
        );
        assert_eq!(
            command("o|sweep|--shard=1/3|it's.toml|--jobs|2|--restart|--seed|4"),
            "sweep 'it'\\''s.toml' --seed 4"
        );
        assert_eq!(
            command("o|sweep|--engine=slurm|s.toml|--shards|8|--emit|script"),
            "sweep s.toml"
        );
    }
}
