//! Mutates the inputs of a corpus and hands them to the function that takes them.
//!
//! `cargo run --release -p tests --bin mutate -- --target csv --minutes 10`
//!
//! The inputs follow from the seed alone. Each is taken by a child process with bounds on memory and time, so that an abort or a
//! hang is a finding as well as a panic. What failed is kept in a folder, and the next input is tried.

use anyhow::{Context as _, bail};
use clap::Parser;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};
use tests::fuzz::mutation::Mutator;
use tests::fuzz::{TARGETS, Target, corpus, seeds, target};

/// Mutates the inputs of a corpus and hands them to the function that takes them
///
/// Exit status: 0 if no input made it panic, abort, hang or take too much memory, else 1.
#[derive(Parser)]
struct Args {
    /// What is tried: a folder of fuzz/corpus. Default: every target, one after the other
    #[arg(long, value_name = "NAME")]
    target: Option<String>,
    /// How long each target is tried (min)
    #[arg(long, value_name = "M", default_value_t = 1.0)]
    minutes: f64,
    /// Seed of the mutations
    #[arg(long, value_name = "S", default_value_t = 1)]
    seed: u64,
    /// Number of the first input
    #[arg(long, value_name = "N", default_value_t = 0)]
    from: u64,
    /// Address space of the process that takes the inputs (MiB)
    #[arg(long, value_name = "MIB", default_value_t = 4096)]
    memory_mib: u64,
    /// Time that one input may take (s)
    #[arg(long, value_name = "S", default_value_t = 10)]
    limit_s: u64,
    /// Folder for inputs that failed
    #[arg(long, value_name = "DIR", default_value = "fuzz/findings")]
    findings: PathBuf,
    /// Write the corpora that are made by the program itself, and try nothing
    #[arg(long)]
    write_seeds: bool,
    /// Take the inputs in this process, and write the number of the latest to this file
    #[arg(long, value_name = "FILE", hide = true)]
    child: Option<PathBuf>,
}

fn main() -> anyhow::Result<()> {
    let args = Args::parse();
    if args.write_seeds {
        return seeds::write();
    }
    let targets: Vec<&Target> = match &args.target {
        None => TARGETS.iter().collect(),
        Some(name) => vec![target(name).with_context(|| format!("there is no target {name}"))?],
    };
    if let (Some(progress), [target]) = (&args.child, &targets[..]) {
        return take(&args, target, progress);
    }
    let mut n_findings = 0;
    for target in targets {
        n_findings += parent(&args, target)?;
    }
    if n_findings != 0 {
        bail!("{n_findings} findings in {}", args.findings.display());
    }
    Ok(())
}

fn inputs(target: &str) -> anyhow::Result<Vec<Vec<u8>>> {
    let folder = corpus(target);
    let entries = std::fs::read_dir(&folder).with_context(|| folder.display().to_string())?;
    let mut paths: Vec<PathBuf> =
        entries.map(|entry| Ok(entry?.path())).collect::<std::io::Result<_>>()?;
    paths.sort();
    let inputs = paths.iter().map(std::fs::read).collect::<std::io::Result<Vec<_>>>()?;
    if inputs.is_empty() {
        bail!("{} is empty", folder.display());
    }
    Ok(inputs)
}

/// Starts a process that takes inputs, and another one after each finding, until the time is over.
fn parent(args: &Args, target: &Target) -> anyhow::Result<u64> {
    let corpus = inputs(target.name)?;
    let folder = tempfile::tempdir()?;
    let progress = folder.path().join("progress");
    let begin = Instant::now();
    let (mut number, mut n_findings) = (args.from, 0);
    while begin.elapsed().as_secs_f64() < 60.0 * args.minutes {
        let left_min = args.minutes - begin.elapsed().as_secs_f64() / 60.0;
        let status = Command::new("sh")
            .args([
                "-c",
                &format!("ulimit -v {}; ulimit -c 0; exec \"$@\"", args.memory_mib << 10),
                "sh",
            ])
            .arg(std::env::current_exe()?)
            .args(["--target", target.name, "--minutes", &left_min.to_string()])
            .args(["--seed", &args.seed.to_string(), "--from", &number.to_string()])
            .args(["--limit-s", &args.limit_s.to_string(), "--child"])
            .arg(&progress)
            .env("TMPDIR", folder.path())
            .stdin(Stdio::null())
            .status()?;
        let latest: u64 = std::fs::read_to_string(&progress)?.trim().parse()?;
        number = latest + 1;
        if !status.success() {
            n_findings += 1;
            std::fs::create_dir_all(&args.findings)?;
            let file = format!("{}-{}-{latest}", target.name, args.seed);
            let file = args.findings.join(file);
            std::fs::write(&file, Mutator::new(args.seed, latest).mutated(&corpus))?;
            writeln!(std::io::stdout(), "{}: {status}: {}", target.name, file.display())?;
        }
    }
    writeln!(
        std::io::stdout(),
        "{}: {} inputs, {n_findings} findings, {:.0} s",
        target.name,
        number - args.from,
        begin.elapsed().as_secs_f64()
    )?;
    Ok(n_findings)
}

/// Takes inputs until the time is over.
fn take(args: &Args, target: &Target, progress: &Path) -> anyhow::Result<()> {
    static SINCE_MS: AtomicU64 = AtomicU64::new(u64::MAX);
    let corpus = inputs(target.name)?;
    let begin = Instant::now();
    let limit_ms = 1000 * args.limit_s;
    std::thread::spawn(move || {
        loop {
            std::thread::sleep(Duration::from_millis(100));
            let now_ms = begin.elapsed().as_millis() as u64;
            if limit_ms < now_ms.saturating_sub(SINCE_MS.load(Ordering::Relaxed)) {
                // The input hangs, and no stack can be unwound from here.
                std::process::abort();
            }
        }
    });
    let mut number = args.from;
    while begin.elapsed().as_secs_f64() < 60.0 * args.minutes {
        std::fs::write(progress, number.to_string())?;
        let input = Mutator::new(args.seed, number).mutated(&corpus);
        SINCE_MS.store(begin.elapsed().as_millis() as u64, Ordering::Relaxed);
        (target.run)(&input);
        SINCE_MS.store(u64::MAX, Ordering::Relaxed);
        number += 1;
    }
    Ok(())
}
