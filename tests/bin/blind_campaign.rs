//! Measures the diagnosis on campaigns with a hidden effect of which it is told nothing, and prints the table.
//!
//! `cargo build --release --workspace && cargo run --release -p tests --bin blind-campaign -- --seeds 2`
//!
//! With `--unforeseen` the campaigns are unlike those that the diagnosis was developed on, and each answer is judged as honest,
//! uncertain or falsely certain. With `--nulls` no effect is hidden, and the noise is of several kinds. The seeds of both follow
//! from the last commit, so that every commit is measured on fresh campaigns. With `--promise` the model is extended on one half of
//! each campaign, and its promised error compared with that on the other half.
//!
//! With `--set` the campaigns are those of a set of thirty situations, and each answer is judged by what the campaign can show: right,
//! half, cannot tell, hedged or falsely certain. Of sets B and C nothing but totals is printed: their lines are in the file.
//!
//! Each campaign that is finished is a line of the file named by `--out`; called again, only those that are not there are made.

use anyhow::{Context as _, bail};
use clap::Parser;
use rayon::prelude::*;
use serde_json::{Value, json};
use std::collections::BTreeSet;
use std::fs::OpenOptions;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::Mutex;
use std::time::{Duration, Instant};
use tests::campaign::blind::{self, Cell};
use tests::campaign::promise::{self, Promise};
use tests::campaign::situations::{self, Draw, Set};
use tests::campaign::unforeseen::{Question, table};

/// Campaigns with a hidden effect, a diagnosis of each, and a table of how it did.
#[derive(Parser)]
struct Args {
    /// Campaigns of each kind and size; 25 times as many with nothing hidden [default: 40]. With --unforeseen or --nulls: campaigns
    /// of each row [default: 30]. With --set: campaigns of each situation [default: 1].
    #[arg(long)]
    seeds: Option<u64>,
    /// Run campaigns unlike those that the diagnosis was developed on, and judge how honest the answers are.
    #[arg(long, conflicts_with_all = ["nulls", "drawn", "rows"])]
    unforeseen: bool,
    /// Run null campaigns: nothing hidden, several kinds of noise.
    #[arg(long, conflicts_with_all = ["drawn", "rows"])]
    nulls: bool,
    /// Run the situations of a set, and judge the answers by what each campaign can show.
    #[arg(long, conflicts_with_all = ["unforeseen", "nulls", "promise", "drawn", "rows"])]
    set: Option<Set>,
    /// With --nulls: no search, only score tests in the model as configured. What they find beyond chance is false.
    #[arg(long, requires = "nulls")]
    scores: bool,
    /// Extend the model on one half of each campaign, and compare the error that it promises with that on the other half. One
    /// campaign of each effect and kind of other half by seed [default: 4].
    #[arg(long, conflicts_with_all = ["unforeseen", "nulls", "drawn"])]
    promise: bool,
    /// Derive the seeds of --set, --unforeseen and --nulls from this text [default: the hash of the last commit].
    #[arg(long)]
    seed_from: Option<String>,
    /// Rows of a campaign of links; of robots, four times as many.
    #[arg(long, default_value_t = 5000)]
    rows: usize,
    /// Links in layouts drawn from their seeds (nodes, extent, duration, noise, base model, walls, speeds), in place of the standard
    /// one.
    #[arg(long)]
    drawn: bool,
    /// Only those whose name has one of these texts in it, such as "medium two-ray" or "link: nothing".
    #[arg(long)]
    only: Vec<String>,
    /// File with a line for each finished campaign.
    #[arg(long, default_value = "runs/blind-campaign.jsonl")]
    out: PathBuf,
    /// Campaigns at a time.
    #[arg(long, default_value_t = 2)]
    threads: usize,
    /// How long a diagnosis may take (s).
    #[arg(long, default_value_t = 300.0)]
    limit_s: f64,
    /// Keeps the campaigns in this folder instead of a temporary one.
    #[arg(long)]
    keep: Option<PathBuf>,
    /// With --set: only write the campaigns into the folder of --keep.
    #[arg(long, requires = "set", requires = "keep")]
    write_only: bool,
}

fn main() -> anyhow::Result<()> {
    let args = Args::parse();
    if let Some(set) = args.set {
        let plan = Draw::plan(set, args.seeds.unwrap_or(1), &seed_from(&args)?);
        if let (true, Some(keep)) = (args.write_only, &args.keep) {
            return write_all(&plan, keep);
        }
        let lines = lines(&args, plan, Draw::name, draw_line)?;
        write!(std::io::stdout(), "{}", situations::table::table(&lines, set.is_open()))?;
    } else if args.unforeseen || args.nulls {
        let seed_from = seed_from(&args)?;
        let n_seeds = args.seeds.unwrap_or(30);
        let plan = if args.unforeseen {
            Question::plan(n_seeds, &seed_from)
        } else {
            Question::nulls(n_seeds, &seed_from)
        };
        let make = if args.scores { scores_line } else { question_line };
        let lines = lines(&args, plan, Question::name, make)?;
        write!(std::io::stdout(), "{}", table::tables(&lines))?;
    } else if args.promise {
        let plan = Promise::plan(args.seeds.unwrap_or(4));
        let lines = lines(&args, plan, Promise::name, promise_line)?;
        write!(std::io::stdout(), "{}", promise::table(&lines))?;
    } else {
        let plan = Cell::plan(args.seeds.unwrap_or(40), args.drawn);
        let lines = lines(&args, plan, Cell::name, cell_line)?;
        write!(std::io::stdout(), "{}", blind::tables(&lines))?;
    }
    Ok(())
}

/// The text that the seeds follow from.
fn seed_from(args: &Args) -> anyhow::Result<String> {
    let text = match &args.seed_from {
        Some(text) => text.clone(),
        None => last_commit()?,
    };
    writeln!(std::io::stderr(), "seeds follow from {}", text.trim())?;
    Ok(text)
}

/// The last commit's hash.
fn last_commit() -> anyhow::Result<String> {
    let output = Command::new("git")
        .args(["rev-parse", "HEAD"])
        .current_dir(tests::repository())
        .stderr(Stdio::inherit())
        .output()
        .context("starting git to find the last commit; give a text with --seed-from instead")?;
    if !output.status.success() {
        bail!("no commit found: give a text with --seed-from");
    }
    String::from_utf8(output.stdout).context("reading the last commit")
}

/// The lines of all campaigns of a plan: those in the file, and those of campaigns run now.
fn lines<T: Sync>(
    args: &Args,
    plan: Vec<T>,
    name: fn(&T) -> String,
    make: fn(&T, &Args) -> anyhow::Result<Value>,
) -> anyhow::Result<Vec<Value>> {
    let mut lines = finished(&args.out)?;
    let done: BTreeSet<String> =
        lines.iter().filter_map(|line| line["cell"].as_str().map(str::to_owned)).collect();
    let is_asked = |name: &str| args.only.is_empty() || args.only.iter().any(|o| name.contains(o));
    let plan: Vec<T> = plan.into_iter().filter(|one| is_asked(&name(one))).collect();
    let names: BTreeSet<String> = plan.iter().map(name).collect();
    let todo: Vec<&T> = plan.iter().filter(|one| !done.contains(&name(one))).collect();
    if let Some(folder) = args.out.parent() {
        std::fs::create_dir_all(folder).with_context(|| format!("making {}", folder.display()))?;
    }
    let file = OpenOptions::new().create(true).append(true).open(&args.out);
    let file = Mutex::new(file.with_context(|| format!("opening {}", args.out.display()))?);
    let pool = rayon::ThreadPoolBuilder::new().num_threads(args.threads).build()?;
    let begin = Instant::now();
    let n_done = Mutex::new(0_usize);
    let new: Vec<Value> = pool.install(|| {
        let each = todo.par_iter().with_max_len(1).map(|one| {
            let line = make(one, args)?;
            let mut n_done = n_done.lock().expect("no thread panics while it counts");
            *n_done += 1;
            writeln!(file.lock().expect("no thread panics while it writes"), "{line}")?;
            let left_s =
                begin.elapsed().as_secs_f64() / *n_done as f64 * (todo.len() - *n_done) as f64;
            let became = match (line["error"].as_str(), line["judgement"].as_str()) {
                (Some(error), _) => error.lines().next().unwrap_or("failed"),
                (None, Some(judgement)) => judgement,
                (None, None) if line["ratio"].is_number() => "measured",
                (None, None) if line["right_first"] == true => "right",
                (None, None) => "not right",
            };
            let became = match args.set {
                Some(set) if !set.is_open() => String::new(),
                _ => format!(": {}: {became}", name(one)),
            };
            let n_todo = todo.len();
            writeln!(std::io::stderr(), "{n_done} of {n_todo}, {left_s:.0} s left{became}")?;
            Ok(line)
        });
        each.collect::<anyhow::Result<_>>()
    })?;
    lines.extend(new);
    lines.retain(|line| line["cell"].as_str().is_some_and(|name| names.contains(name)));
    if lines.is_empty() {
        bail!("no campaign has one of {:?} in its name", args.only);
    }
    Ok(lines)
}

/// The lines of an earlier call.
fn finished(path: &Path) -> anyhow::Result<Vec<Value>> {
    if !path.exists() {
        return Ok(Vec::new());
    }
    let text = std::fs::read_to_string(path)?;
    // A line cut off by an interrupt is no line; where the diagnosis failed, it may not fail again.
    let lines = text.lines().filter_map(|line| serde_json::from_str(line).ok());
    Ok(lines.filter(|line: &Value| !line["error"].is_string()).collect())
}

/// Makes a campaign, has it diagnosed, and judges the diagnosis.
fn cell_line(cell: &Cell, args: &Args) -> anyhow::Result<Value> {
    let campaign = cell.campaign(args.rows);
    let files = [campaign.csv.as_str(), campaign.config_toml.as_str()];
    let judge = |written: &Value| cell.judged(&campaign, written);
    let mut line = judged_line(args, &cell.name(), files, "diagnose", judge)?;
    line["rows"] = json!(args.rows);
    Ok(line)
}

/// The line of a null campaign, by score tests alone.
fn scores_line(question: &Question, _: &Args) -> anyhow::Result<Value> {
    let found = tests::alarms::found(&question.case())?;
    Ok(question.line_of_scores(found))
}

/// Makes a campaign of `--unforeseen` or `--nulls`, runs its command, and judges the answer.
fn question_line(question: &Question, args: &Args) -> anyhow::Result<Value> {
    let case = question.case();
    let files = [case.csv.as_str(), case.config_toml.as_str()];
    judged_line(args, &question.name(), files, case.command(), |written| {
        question.line(&case, written)
    })
}

/// Writes campaigns into folders named by their places in the plan.
fn write_all(plan: &[Draw], keep: &Path) -> anyhow::Result<()> {
    for (place, draw) in plan.iter().enumerate() {
        let case = draw.case();
        write_files(&keep.join(format!("{place:03}")), [&case.csv, &case.config_toml])?;
    }
    Ok(())
}

/// Makes a campaign of a set, has it diagnosed, and judges the answer.
fn draw_line(draw: &Draw, args: &Args) -> anyhow::Result<Value> {
    let case = draw.case();
    let files = [case.csv.as_str(), case.config_toml.as_str()];
    judged_line(args, &draw.name(), files, "diagnose", |written| draw.line(&case, written))
}

/// Extends a model on one half of a campaign, and compares it with the other half.
fn promise_line(promise: &Promise, args: &Args) -> anyhow::Result<Value> {
    let campaign = promise.campaign(args.rows);
    let [csv, fresh] = promise.halves(&campaign);
    let temporary = tempfile::tempdir()?;
    let folder = folder_of(args, &promise.name(), &temporary);
    write_files(&folder, [&csv, &campaign.config_toml])?;
    std::fs::write(folder.join("fresh.csv"), fresh)?;
    let limit = Duration::from_secs_f64(args.limit_s);
    let asked = ["extend", "config.toml", "--data", "data.csv", "--all"];
    let extend = [&asked[..], &["--output", "extended.toml", "--replace"]].concat();
    let compare = ["compare", "extended.toml", "--data", "fresh.csv"];
    let extended =
        run_orchestrator(&folder, &extend, "extension.json", limit).and_then(|extension| {
            Ok((extension, run_orchestrator(&folder, &compare, "comparison.json", limit)?))
        });
    Ok(match extended {
        Ok((extension, comparison)) => promise.line(&extension, &comparison),
        Err(error) => {
            let mut line = promise.line(&Value::Null, &Value::Null);
            line["why"] = json!(format!("{error:#}"));
            line
        }
    })
}

/// The folder of a campaign.
fn folder_of(args: &Args, name: &str, temporary: &tempfile::TempDir) -> PathBuf {
    match &args.keep {
        Some(keep) => keep.join(name.replace([' ', ':', ',', '#', '(', ')', '+'], "_")),
        None => temporary.path().to_owned(),
    }
}

fn write_files(folder: &Path, [csv, config_toml]: [&str; 2]) -> anyhow::Result<()> {
    std::fs::create_dir_all(folder)?;
    std::fs::write(folder.join("data.csv"), csv)?;
    std::fs::write(folder.join("config.toml"), config_toml)?;
    Ok(())
}

/// Writes data and configuration into a folder, runs a command of the orchestrator there, and judges its JSON.
fn judged_line(
    args: &Args,
    name: &str,
    files: [&str; 2],
    command: &str,
    judge: impl Fn(&Value) -> Value,
) -> anyhow::Result<Value> {
    let temporary = tempfile::tempdir()?;
    let folder = folder_of(args, name, &temporary);
    write_files(&folder, files)?;
    let begin = Instant::now();
    let answer = if command == "compare" { "comparison.json" } else { "diagnosis.json" };
    let arguments = [command, "config.toml", "--data", "data.csv"];
    let limit = Duration::from_secs_f64(args.limit_s);
    let mut line = match run_orchestrator(&folder, &arguments, answer, limit) {
        Ok(written) => judge(&written),
        Err(error) => {
            let mut line = judge(&json!({}));
            line["error"] = json!(format!("{error:#}"));
            line
        }
    };
    line["wall_s"] = json!(begin.elapsed().as_secs_f64());
    Ok(line)
}

/// Runs a command of the orchestrator, built beside this program, in the folder of a campaign. Returns its JSON, which it writes to
/// `answer`.
fn run_orchestrator(
    folder: &Path,
    arguments: &[&str],
    answer: &str,
    limit: Duration,
) -> anyhow::Result<Value> {
    let orchestrator = std::env::current_exe()?.with_file_name("murmuration");
    let errors = std::fs::File::create(folder.join("errors.txt"))?;
    let mut child = Command::new(&orchestrator)
        .args(arguments)
        .args(["--json", answer])
        .current_dir(folder)
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(errors)
        .spawn()
        .with_context(|| format!("starting {}", orchestrator.display()))?;
    let begin = Instant::now();
    let status = loop {
        if let Some(status) = child.try_wait()? {
            break status;
        }
        if limit < begin.elapsed() {
            child.kill()?;
            child.wait()?;
            bail!("not done after {} s", limit.as_secs_f64());
        }
        std::thread::sleep(Duration::from_millis(20));
    };
    if !status.success() {
        let said = std::fs::read_to_string(folder.join("errors.txt"))?;
        bail!("{status}: {}", said.trim());
    }
    let text = std::fs::read_to_string(folder.join(answer))?;
    serde_json::from_str(&text).context("reading what it wrote")
}
