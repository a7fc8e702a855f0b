//! Measures the diagnosis on campaigns with a hidden effect of which it is told nothing, and prints the table.
//!
//! `cargo build --release --workspace && cargo run --release -p tests --bin blind-campaign -- --seeds 2`
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
use tests::campaign::blind::{Cell, tables};

/// Campaigns with a hidden effect, a diagnosis of each, and a table of how it did.
#[derive(Parser)]
struct Args {
    /// Campaigns of each kind and size; 25 times as many with nothing hidden.
    #[arg(long, default_value_t = 40)]
    seeds: u64,
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
}

fn main() -> anyhow::Result<()> {
    let args = Args::parse();
    let mut lines = finished(&args.out)?;
    let done: BTreeSet<String> =
        lines.iter().filter_map(|line| line["cell"].as_str().map(str::to_owned)).collect();
    let is_asked = |name: &str| args.only.is_empty() || args.only.iter().any(|o| name.contains(o));
    let plan: Vec<Cell> = Cell::plan(args.seeds, args.drawn)
        .into_iter()
        .filter(|cell| is_asked(&cell.name()))
        .collect();
    let names: BTreeSet<String> = plan.iter().map(Cell::name).collect();
    let todo: Vec<&Cell> = plan.iter().filter(|cell| !done.contains(&cell.name())).collect();
    if let Some(folder) = args.out.parent() {
        std::fs::create_dir_all(folder).with_context(|| format!("making {}", folder.display()))?;
    }
    let file = OpenOptions::new().create(true).append(true).open(&args.out);
    let file = Mutex::new(file.with_context(|| format!("opening {}", args.out.display()))?);
    let pool = rayon::ThreadPoolBuilder::new().num_threads(args.threads).build()?;
    let begin = Instant::now();
    let n_done = Mutex::new(0_usize);
    let new: Vec<Value> = pool.install(|| {
        let each = todo.par_iter().with_max_len(1).map(|cell| {
            let line = line(cell, &args)?;
            let mut n_done = n_done.lock().expect("no thread panics while it counts");
            *n_done += 1;
            writeln!(file.lock().expect("no thread panics while it writes"), "{line}")?;
            let left_s =
                begin.elapsed().as_secs_f64() / *n_done as f64 * (todo.len() - *n_done) as f64;
            let became = match line["error"].as_str() {
                Some(error) => error.lines().next().unwrap_or("failed"),
                None if line["right_first"] == true => "right",
                None => "not right",
            };
            writeln!(
                std::io::stderr(),
                "{} of {}, {left_s:.0} s left: {}: {became}",
                *n_done,
                todo.len(),
                cell.name()
            )?;
            Ok(line)
        });
        each.collect::<anyhow::Result<_>>()
    })?;
    lines.extend(new);
    lines.retain(|line| line["cell"].as_str().is_some_and(|name| names.contains(name)));
    if lines.is_empty() {
        bail!("no campaign has one of {:?} in its name", args.only);
    }
    write!(std::io::stdout(), "{}", tables(&lines))?;
    Ok(())
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

/// Makes a campaign, has it diagnosed, and judges that.
fn line(cell: &Cell, args: &Args) -> anyhow::Result<Value> {
    let campaign = cell.campaign(args.rows);
    let temporary = tempfile::tempdir()?;
    let folder = match &args.keep {
        Some(keep) => keep.join(cell.name().replace([' ', ':', '#', '(', ')', '+'], "_")),
        None => temporary.path().to_owned(),
    };
    std::fs::create_dir_all(&folder)?;
    std::fs::write(folder.join("data.csv"), &campaign.csv)?;
    std::fs::write(folder.join("config.toml"), &campaign.config_toml)?;
    let begin = Instant::now();
    let mut line = match diagnosed(&folder, Duration::from_secs_f64(args.limit_s)) {
        Ok(diagnosis) => cell.judged(&campaign, &diagnosis),
        Err(error) => {
            let mut line = cell.judged(&campaign, &json!({}));
            line["error"] = json!(format!("{error:#}"));
            line
        }
    };
    line["wall_s"] = json!(begin.elapsed().as_secs_f64());
    line["rows"] = json!(args.rows);
    Ok(line)
}

/// Runs the diagnosis in a folder that holds a campaign: `orchestrator`, built beside this program.
fn diagnosed(folder: &Path, limit: Duration) -> anyhow::Result<Value> {
    let orchestrator = std::env::current_exe()?.with_file_name("orchestrator");
    let errors = std::fs::File::create(folder.join("errors.txt"))?;
    let mut child = Command::new(&orchestrator)
        .args(["diagnose", "config.toml", "--data", "data.csv", "--json", "diagnosis.json"])
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
    let text = std::fs::read_to_string(folder.join("diagnosis.json"))?;
    serde_json::from_str(&text).context("reading what it wrote")
}
