//! Shows whether a change leaves recordings and answers as they were.
//!
//! `cargo run --release -p tests --bin same-results -- --before OLD/murmuration --after target/release/murmuration`
//!
//! Either side may be a folder that an earlier call filled by `--keep`, so that the old executable runs once.

use anyhow::bail;
use clap::Parser;
use rayon::prelude::*;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};
use tests::same_results::{Case, Difference, Kind, Side, cases, folders, inputs_of};

/// Runs experiments and answers with two executables of the orchestrator, and compares what they leave: recordings byte by
/// byte, answers number by number and name by name. A sentence may differ in its words
///
/// Exit status: 0 if nothing but wording differs, else 1.
#[derive(Parser)]
struct Args {
    /// The executable before the change, or a folder that an earlier call kept
    #[arg(long, value_name = "EXECUTABLE|DIR")]
    before: PathBuf,
    /// The executable after the change, or a folder that an earlier call kept
    #[arg(long, value_name = "EXECUTABLE|DIR")]
    after: PathBuf,
    /// Only cases whose name has this text in it. May be given several times
    #[arg(long, value_name = "TEXT")]
    only: Vec<String>,
    /// Keep what the executable before leaves in this folder; cases that it holds already are not run again
    #[arg(long, value_name = "DIR")]
    keep: Option<PathBuf>,
    /// Folder for what the executables leave, and for a list of all differences of each case [default: a temporary one]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Cases at a time
    #[arg(long, value_name = "N", default_value_t = 2)]
    jobs: usize,
    /// How long one command may take (s)
    #[arg(long, value_name = "S", default_value_t = 300.0)]
    limit_s: f64,
    /// List the cases, and run none
    #[arg(long)]
    list: bool,
}

fn main() -> anyhow::Result<()> {
    let args = Args::parse();
    let is_asked = |case: &Case| {
        args.only.is_empty() || args.only.iter().any(|text| case.name.contains(text.as_str()))
    };
    let cases: Vec<Case> = cases().into_iter().filter(is_asked).collect();
    if cases.is_empty() {
        bail!("no case has one of {:?} in its name", args.only);
    }
    if args.list {
        for case in &cases {
            writeln!(std::io::stdout(), "{}", case.name)?;
        }
        return Ok(());
    }
    let temporary = tempfile::tempdir()?;
    let out = args.out.clone().unwrap_or_else(|| temporary.path().to_owned());
    let keep = args.keep.clone().unwrap_or_else(|| out.join("before"));
    let before = side(&args.before, &keep, args.keep.is_some())?;
    let after = side(&args.after, &out.join("after"), false)?;
    let limit = Duration::from_secs_f64(args.limit_s);
    let pool = rayon::ThreadPoolBuilder::new().num_threads(args.jobs).build()?;
    let begin = Instant::now();
    let found: Vec<Found> = pool.install(|| {
        let each = cases.par_iter().with_max_len(1).map(|case| {
            let found = compared(case, [&before, &after], limit);
            found.tell(case, &out)?;
            Ok(found)
        });
        each.collect::<anyhow::Result<_>>()
    })?;
    let n = |is: &dyn Fn(&Found) -> bool| found.iter().filter(|found| is(found)).count();
    let [n_equal, n_wording, n_failed] = [
        n(&|found| found.worst() == Ok(None)),
        n(&|found| found.worst() == Ok(Some(Kind::Wording))),
        n(&|found| found.worst().is_err()),
    ];
    let n_differ = found.len() - n_equal - n_wording - n_failed;
    writeln!(
        std::io::stdout(),
        "{} cases in {:.0} s: {n_equal} equal, {n_wording} with other wording, {n_differ} that DIFFER, {n_failed} that failed",
        found.len(),
        begin.elapsed().as_secs_f64()
    )?;
    if 0 < n_differ + n_failed {
        std::process::exit(1);
    }
    Ok(())
}

/// A program, or the folder of an earlier call.
fn side(path: &Path, results: &Path, keeps: bool) -> anyhow::Result<Side> {
    if path.is_dir() {
        return Ok(Side::Kept(path.to_owned()));
    }
    if !path.is_file() {
        bail!("{}: neither an executable nor a folder", path.display());
    }
    let [path, results] = [std::path::absolute(path)?, std::path::absolute(results)?];
    Ok(Side::Program { path, results, keeps })
}

/// What became of a case.
struct Found {
    differences: anyhow::Result<Vec<Difference>>,
    took_s: f64,
}

/// Has both sides run a case, and compares.
fn compared(case: &Case, [before, after]: [&Side; 2], limit: Duration) -> Found {
    let begin = Instant::now();
    let differences = || {
        let before = before
            .results(case, None, limit)
            .map_err(|error| error.context("before the change"))?;
        let after = after
            .results(case, Some(&before), limit)
            .map_err(|error| error.context("after the change"))?;
        folders(&before, &after, &inputs_of(&before)?)
    };
    Found { differences: differences(), took_s: begin.elapsed().as_secs_f64() }
}

impl Found {
    /// The gravest kind of difference, if there is any.
    fn worst(&self) -> Result<Option<Kind>, ()> {
        let differences = self.differences.as_ref().map_err(|_| ())?;
        Ok(differences.iter().map(|difference| difference.kind).max())
    }

    /// Prints its line, and writes the list of differences.
    fn tell(&self, case: &Case, out: &Path) -> anyhow::Result<()> {
        let is_wording = |difference: &&Difference| difference.kind == Kind::Wording;
        let became = match &self.differences {
            Err(error) => format!("FAILED      {error:#}"),
            Ok(differences) => {
                let grave = differences.iter().find(|difference| !is_wording(difference));
                let first = grave.or(differences.first());
                let n_wording = differences.iter().filter(is_wording).count();
                let n_grave = differences.len() - n_wording;
                match first {
                    None => "equal".to_owned(),
                    Some(first) if n_grave == 0 => {
                        format!("wording     {n_wording} differ: {first}")
                    }
                    Some(first) => {
                        format!("DIFFERS     {n_grave} differ, {n_wording} in wording: {first}")
                    }
                }
            }
        };
        let mut stdout = std::io::stdout().lock();
        writeln!(stdout, "{:<50} {:6.1} s  {became}", case.name, self.took_s)?;
        let Some(differences) = self.differences.as_ref().ok().filter(|list| !list.is_empty())
        else {
            return Ok(());
        };
        let folder = out.join("differences");
        std::fs::create_dir_all(&folder)?;
        let lines: String =
            differences.iter().map(|difference| format!("{difference}\n")).collect();
        let path = folder.join(format!("{}.txt", case.name.replace([' ', ':', '/'], "-")));
        std::fs::write(path, lines)?;
        Ok(())
    }
}
