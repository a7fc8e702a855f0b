//! Measures `diagnose --between` on pairs of campaigns of which is known what changed, and prints the table.
//!
//! `cargo build --release -p orchestrator -p tests && target/release/between-campaign --seeds 7`
//!
//! Each pair that is finished is a line of the file named by `--out`; called again, only those that are not there are made.

use anyhow::{Context as _, bail};
use clap::Parser;
use rayon::prelude::*;
use serde_json::{Value, json};
use std::collections::BTreeSet;
use std::fmt::Write as _;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::Mutex;
use tests::campaign::repeated::{Between, Repeated, Verdict};
use tests::statistics::binomial_interval;

/// Pairs of campaigns of which is known what changed, an answer about each, and a table of how right the answers are.
#[derive(Parser)]
struct Args {
    /// Pairs of each kind.
    #[arg(long, default_value_t = 7)]
    seeds: u64,
    /// The first seed.
    #[arg(long, default_value_t = 1)]
    first_seed: u64,
    /// Only kinds whose name has one of these texts in it, such as "moved".
    #[arg(long)]
    only: Vec<String>,
    /// File with a line for each finished pair.
    #[arg(long, default_value = "runs/between-campaign.jsonl")]
    out: PathBuf,
    /// Pairs at a time.
    #[arg(long, default_value_t = 2)]
    threads: usize,
    /// Keep the campaigns in this folder instead of a temporary one.
    #[arg(long)]
    keep: Option<PathBuf>,
}

fn main() -> anyhow::Result<()> {
    let args = Args::parse();
    let is_asked = |kind: &Between| {
        args.only.is_empty() || args.only.iter().any(|text| kind.name().contains(text))
    };
    let seeds = args.first_seed..args.first_seed + args.seeds;
    let plan: Vec<(u64, Between)> = seeds
        .flat_map(|seed| Between::ALL.into_iter().filter(is_asked).map(move |kind| (seed, kind)))
        .collect();
    let mut lines = finished(&args.out)?;
    let done: BTreeSet<String> =
        lines.iter().filter_map(|line| Some(line["cell"].as_str()?.to_owned())).collect();
    let todo: Vec<(u64, Between)> =
        plan.iter().copied().filter(|pair| !done.contains(&name(*pair))).collect();
    if let Some(folder) = args.out.parent() {
        std::fs::create_dir_all(folder).with_context(|| format!("making {}", folder.display()))?;
    }
    let file = std::fs::OpenOptions::new().create(true).append(true).open(&args.out);
    let file = Mutex::new(file.with_context(|| format!("opening {}", args.out.display()))?);
    let pool = rayon::ThreadPoolBuilder::new().num_threads(args.threads).build()?;
    let new: Vec<Value> = pool.install(|| {
        let each = todo.par_iter().with_max_len(1).map(|pair| {
            let line = line(*pair, args.keep.as_deref())?;
            writeln!(file.lock().expect("no thread panics while it writes"), "{line}")?;
            let [cell, judged] = ["cell", "judgement"].map(|key| line[key].as_str().unwrap_or(""));
            writeln!(std::io::stderr(), "{cell}: {judged}: {}", line["sentence"])?;
            Ok(line)
        });
        each.collect::<anyhow::Result<_>>()
    })?;
    lines.extend(new);
    let names: BTreeSet<String> = plan.iter().map(|pair| name(*pair)).collect();
    lines.retain(|line| line["cell"].as_str().is_some_and(|name| names.contains(name)));
    write!(std::io::stdout(), "{}", table(&lines))?;
    Ok(())
}

fn name((seed, kind): (u64, Between)) -> String {
    format!("{}, seed {seed}", kind.name())
}

/// The lines of an earlier call. A line cut off by an interrupt is no line.
fn finished(path: &Path) -> anyhow::Result<Vec<Value>> {
    if !path.exists() {
        return Ok(Vec::new());
    }
    let text = std::fs::read_to_string(path)?;
    Ok(text.lines().filter_map(|line| serde_json::from_str(line).ok()).collect())
}

/// Makes a pair of campaigns, asks the orchestrator built beside this program what changed, and judges the answer.
fn line((seed, kind): (u64, Between), keep: Option<&Path>) -> anyhow::Result<Value> {
    let pair = Repeated::new(kind, seed);
    let temporary = tempfile::tempdir()?;
    let cell = name((seed, kind));
    let folder = keep.map_or_else(
        || temporary.path().to_owned(),
        |keep| keep.join(cell.replace([' ', ':', ','], "_")),
    );
    std::fs::create_dir_all(&folder)?;
    let [a, b] = &pair.csv;
    for (file, text) in [("a.csv", a), ("b.csv", b), ("model.toml", &pair.config_toml)] {
        std::fs::write(folder.join(file), text)?;
    }
    let orchestrator = std::env::current_exe()?.with_file_name("murmuration");
    let output = Command::new(&orchestrator)
        .args(["diagnose", "model.toml", "--between", "a.csv", "b.csv", "--json", "answer.json"])
        .current_dir(&folder)
        .stdin(Stdio::null())
        .output()
        .with_context(|| format!("starting {}", orchestrator.display()))?;
    if !output.status.success() {
        bail!("{cell}: {}", String::from_utf8_lossy(&output.stderr).trim());
    }
    let text = std::fs::read_to_string(folder.join("answer.json"))?;
    let answer: Value = serde_json::from_str(&text).context("reading what it wrote")?;
    Ok(json!({
        "cell": cell,
        "kind": kind.name(),
        "judgement": pair.judged(&answer).name(),
        "verdict": answer["verdict"],
        "sentence": answer["sentence"],
    }))
}

/// The table as Markdown: of each kind, how many answers are judged how, and the 95 % Clopper-Pearson interval of each share.
fn table(lines: &[Value]) -> String {
    const VERDICTS: [Verdict; 5] = [
        Verdict::Right,
        Verdict::SomethingChanged,
        Verdict::Undecided,
        Verdict::FalseAlarm,
        Verdict::FalseCertain,
    ];
    let mut text = "| what changed | pairs".to_owned();
    for verdict in VERDICTS {
        let _ = write!(text, " | {}", verdict.name());
    }
    text.push_str(" |\n|---|---|---|---|---|---|---|\n");
    let mut row = |name: &str, is_of: &dyn Fn(&Value) -> bool| {
        let of: Vec<&Value> = lines.iter().filter(|line| is_of(line)).collect();
        if of.is_empty() {
            return;
        }
        let _ = write!(text, "| {name} | {}", of.len());
        for verdict in VERDICTS {
            let n = of.iter().filter(|line| line["judgement"] == verdict.name()).count();
            let [low, high] = binomial_interval(n, of.len(), 0.05).map(|share| 100.0 * share);
            let _ = write!(text, " | {n} ({low:.0} to {high:.0} %)");
        }
        text.push_str(" |\n");
    };
    for kind in Between::ALL {
        row(kind.name(), &|line| line["kind"] == kind.name());
    }
    for (name, is_null) in [("all where nothing changed", true), ("all changes", false)] {
        let kinds = Between::ALL.into_iter().filter(|kind| kind.is_null() == is_null);
        let kinds: Vec<&str> = kinds.map(Between::name).collect();
        row(name, &|line| line["kind"].as_str().is_some_and(|kind| kinds.contains(&kind)));
    }
    text
}
