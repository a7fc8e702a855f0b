//! Disturbs runs at random, and says what became of each.
//!
//! `cargo build --release --workspace && cargo run --release -p tests --bin fault-campaign -- --runs 1000 --seed 1`
//!
//! Each run that has ended is a line of the journal; called again with the same journal, only those that are not there are made.

use anyhow::{Context as _, bail};
use clap::Parser;
use rayon::prelude::*;
use std::collections::{BTreeMap, BTreeSet};
use std::fs::OpenOptions;
use std::io::Write as _;
use std::path::PathBuf;
use std::sync::Mutex;
use tests::fault_campaign::{Event, Fate, Outcome, Trial, carry_out, references};

/// Disturbs runs at random: kills, stops and hang-ups, connections that are cut, delayed, duplicated or corrupted, disks that are
/// full
///
/// Exit status: 0 if every run ended with the bytes of an undisturbed one or with an error that says what failed, in time.
#[derive(Parser)]
struct Args {
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

fn main() -> anyhow::Result<()> {
    let args = Args::parse();
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
