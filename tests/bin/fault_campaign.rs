//! Disturbs runs at random, and says what became of each.
//!
//! `cargo build --release --workspace && cargo run --release -p tests --bin fault-campaign -- --runs 1000 --seed 1`
//!
//! Each run that has ended is a line of the journal; called again with the same journal, only those that are not there are made.

use anyhow::{Context as _, bail};
use clap::{Args as ClapArgs, Parser, Subcommand};
use rayon::prelude::*;
use std::collections::{BTreeMap, BTreeSet};
use std::fs::OpenOptions;
use std::io::Write as _;
use std::ops::RangeInclusive;
use std::path::PathBuf;
use std::sync::Mutex;
use std::time::Instant;
use tests::fault_campaign::{Event, Fate, Outcome, Trial, carry_out, references};
use tests::fault_simulation::{Simulation, Verdict};

/// Disturbs runs at random: kills, stops and hang-ups, connections that are cut, delayed, duplicated or corrupted, disks that are
/// full
///
/// Exit status: 0 if every run ended with the bytes of an undisturbed one or with an error that says what failed, in time.
#[derive(Parser)]
#[command(args_conflicts_with_subcommands = true)]
struct Args {
    #[command(subcommand)]
    command: Option<Command>,
    /// Number of runs
    #[arg(long, default_value_t = 60)]
    runs: u64,
    /// Seed from which they are drawn
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Runs at a time
    #[arg(long, default_value_t = 1)]
    jobs: usize,
    /// File with a line for each run that has ended [default: runs/fault-campaign-SEED.jsonl]
    #[arg(long)]
    journal: Option<PathBuf>,
}

#[derive(Subcommand)]
enum Command {
    /// Let an operation on a file fail, kill the program there, or let a simulator lie, as each seed says
    ///
    /// Exit status: 0 if every command that was disturbed succeeded with the files of an undisturbed one, or led to them when it was
    /// continued or repeated after an error that names the file or simulator.
    Simulate(SimulateArgs),
}

#[derive(ClapArgs)]
struct SimulateArgs {
    /// Seeds, from the first to the last
    #[arg(long, value_name = "FIRST..LAST", default_value = "1..60", value_parser = seeds)]
    seeds: RangeInclusive<u64>,
    /// Only this seed, and print what the commands said
    #[arg(long, conflicts_with_all = ["seeds", "trial"])]
    seed: Option<u64>,
    /// Only this trial, as a report prints it, and print what the commands said
    #[arg(long, conflicts_with = "seeds")]
    trial: Option<String>,
    /// Trials at a time
    #[arg(long, default_value_t = 1)]
    jobs: usize,
}

fn seeds(text: &str) -> Result<RangeInclusive<u64>, String> {
    let range = text.split_once("..").and_then(|(a, b)| Some(a.parse().ok()?..=b.parse().ok()?));
    range.ok_or_else(|| "must be FIRST..LAST, as in 1..2000".to_owned())
}

/// Carries out simulated faults.
fn simulate(args: &SimulateArgs) -> anyhow::Result<()> {
    let begun = Instant::now();
    let simulation = Simulation::new()?;
    let mut out = std::io::stdout();
    let one = match (&args.trial, args.seed) {
        (Some(text), _) => Some(simulation.parse(text)?),
        (None, seed) => seed.map(|seed| simulation.draw(seed)),
    };
    if let Some(trial) = one {
        let (verdict, said) = simulation.carry_out(&trial)?;
        writeln!(out, "{said}\n{trial}\n{verdict:?}")?;
        return if verdict.is_defect() { bail!("a defect") } else { Ok(()) };
    }
    let pool = rayon::ThreadPoolBuilder::new().num_threads(args.jobs).build()?;
    let outcomes: anyhow::Result<Vec<(Verdict, String)>> = pool.install(|| {
        args.seeds
            .clone()
            .into_par_iter()
            .map(|seed| {
                let trial = simulation.draw(seed);
                let (verdict, said) = simulation.carry_out(&trial)?;
                if verdict.is_defect() {
                    let mut out = std::io::stdout();
                    writeln!(out, "seed {seed}: {verdict:?}\n{trial}\n{said}")?;
                }
                Ok((verdict, trial.kind()))
            })
            .collect()
    });
    let outcomes = outcomes?;
    let mut counts: BTreeMap<(&String, Verdict), usize> = BTreeMap::new();
    for (verdict, kind) in &outcomes {
        *counts.entry((kind, *verdict)).or_default() += 1;
    }
    for ((kind, verdict), n) in &counts {
        writeln!(out, "{kind:24} {:20} {n:4}", format!("{verdict:?}"))?;
    }
    writeln!(out, "{} seeds in {:.0} s", outcomes.len(), begun.elapsed().as_secs_f64())?;
    match outcomes.iter().filter(|(verdict, _)| verdict.is_defect()).count() {
        0 => Ok(()),
        n => bail!("{n} seeds show a defect; repeat one with simulate --seed N"),
    }
}

fn main() -> anyhow::Result<()> {
    let args = Args::parse();
    if let Some(Command::Simulate(args)) = &args.command {
        return simulate(args);
    }
    let path = args
        .journal
        .unwrap_or_else(|| PathBuf::from(format!("runs/fault-campaign-{}.jsonl", args.seed)));
    if let Some(folder) = path.parent() {
        std::fs::create_dir_all(folder)?;
    }
    let mut outcomes = Vec::new();
    for line in std::fs::read_to_string(&path).unwrap_or_default().lines() {
        // The last line may be half a line.
        if let Ok(outcome) = serde_json::from_str::<Outcome>(line)
            && outcome.trial == Trial::draw(args.seed, outcome.trial.number)
            && outcome.trial.number < args.runs
        {
            outcomes.push(outcome);
        }
    }
    let done: BTreeSet<u64> = outcomes.iter().map(|outcome| outcome.trial.number).collect();
    let folder = tempfile::tempdir()?;
    let references = references(folder.path())?;
    let journal = OpenOptions::new().create(true).append(true).open(&path);
    let journal = Mutex::new(journal.with_context(|| format!("opening {}", path.display()))?);
    let pool = rayon::ThreadPoolBuilder::new().num_threads(args.jobs).build()?;
    let new: anyhow::Result<Vec<Outcome>> = pool.install(|| {
        (0..args.runs)
            .into_par_iter()
            .filter(|number| !done.contains(number))
            .map(|number| {
                let outcome = carry_out(&Trial::draw(args.seed, number), &references)?;
                let line = format!("{}\n", serde_json::to_string(&outcome)?);
                let mut journal = journal.lock().expect("no thread panics while it writes");
                journal.write_all(line.as_bytes())?;
                let Outcome { trial, fate, wall_s, .. } = &outcome;
                let mut out = std::io::stdout();
                writeln!(out, "{number:5}  {:18} {fate:?} {wall_s:.1} s", trial.event.to_string())?;
                Ok(outcome)
            })
            .collect()
    });
    outcomes.extend(new?);
    let mut counts: BTreeMap<(Event, Fate), usize> = BTreeMap::new();
    for outcome in &outcomes {
        *counts.entry((outcome.trial.event, outcome.fate)).or_default() += 1;
    }
    let mut out = std::io::stdout();
    writeln!(out, "\nevent                fate            runs")?;
    for ((event, fate), n) in &counts {
        writeln!(out, "{:20} {:15} {n:4}", event.to_string(), format!("{fate:?}"))?;
    }
    let longest = outcomes.iter().map(|outcome| outcome.wall_s).fold(0.0, f64::max);
    writeln!(out, "{} runs, the longest took {longest:.1} s", outcomes.len())?;
    let defects: Vec<&Outcome> =
        outcomes.iter().filter(|outcome| outcome.fate.is_defect()).collect();
    for outcome in &defects {
        writeln!(out, "\n{:?}: {:?}\n{}", outcome.fate, outcome.trial, outcome.said)?;
    }
    if defects.is_empty() { Ok(()) } else { bail!("{} runs ended as none may", defects.len()) }
}
