//! `demo`: the loop from measurements to a better model, on a hidden effect.

use super::arguments::whole_number;
use super::{Failure, check_json, on_runtime, write_json};
use clap::Args;
use demo::{DemoError, DemoObserver, DemoOptions, STEPS, demo};
use numbers::format::{number_within, shortest};
use std::path::{Path, PathBuf};
use terminal::{ProgressDisplay, say};

/// The folder of a demo, if no other is asked for.
const FOLDER: &str = "demo";
/// Folders that are tried before a name has to be given.
const MOST_FOLDERS: u32 = 1000;

#[derive(Args)]
pub(super) struct DemoArgs {
    /// Seed that chooses the hidden effect and draws the measurements
    #[arg(long, value_name = "N", default_value_t = 1, allow_negative_numbers = true, value_parser = whole_number::<{ u64::MAX }>)]
    seed: u64,
    /// Hide this effect instead of one that the seed chooses; none: hide no effect
    #[arg(long, value_name = "NAME")]
    effect: Option<String>,
    /// Number of robots of the swarm
    #[arg(long, value_name = "N", default_value_t = 10, value_parser = clap::value_parser!(u32).range(2..=100))]
    robots: u32,
    /// Folder to make [default: demo, or the first of demo-2, demo-3 and so on that does not exist]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Write the results as JSON to this file; - for standard output
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Open the page in a browser
    #[arg(long)]
    open: bool,
}

/// Runs the demo, and prints what it shows step by step.
pub(super) fn run(args: &DemoArgs) -> Result<(), Failure> {
    check_json(args.json.as_deref())?;
    let folder = match &args.out {
        Some(folder) => folder.clone(),
        None => free_folder()?,
    };
    let options = DemoOptions {
        program: std::env::current_exe().map_err(Failure::work)?,
        seed: args.seed,
        effect: args.effect.clone(),
        robots: args.robots,
        folder,
    };
    let mut screen = DemoScreen { progress: ProgressDisplay::stages(STEPS) };
    let answer = on_runtime(demo(&options, &mut screen))?;
    screen.progress.finish();
    let answer = answer.map_err(|error| match error {
        DemoError::Request(_) => Failure::request(error),
        _ => Failure::work(error),
    })?;
    say("");
    say(answer.outcome_sentence());
    for estimate in &answer.estimates {
        let shown = |value: f64| number_within(value, (estimate.high - estimate.low) / 2.0);
        let text = format!(
            "  {}: hidden {}, estimated {} (90 %: {} to {}) {}",
            estimate.name,
            shortest(estimate.hidden),
            shown(estimate.value),
            shown(estimate.low),
            shown(estimate.high),
            estimate.unit
        );
        say(text.trim_end());
    }
    if args.open {
        super::docs::open(Path::new(&answer.page));
    } else {
        say(format!("open {}", answer.page));
    }
    write_json(args.json.as_deref(), &answer)
}

/// A demo as a person sees it: what the steps found on standard output, and the progress on standard error.
struct DemoScreen {
    progress: ProgressDisplay,
}

impl DemoObserver for DemoScreen {
    fn begin(&mut self, step: u64, what: &str) {
        self.progress.stage(step, what);
    }

    fn report(&mut self, line: String) {
        self.progress.aside(|| say(line));
    }
}

/// The first folder of its kind that does not exist.
fn free_folder() -> Result<PathBuf, Failure> {
    let first = std::iter::once(PathBuf::from(FOLDER));
    let others = (2..=MOST_FOLDERS).map(|number| PathBuf::from(format!("{FOLDER}-{number}")));
    first
        .chain(others)
        .find(|folder| folder.symlink_metadata().is_err())
        .ok_or_else(|| Failure::request("demo: give a folder that does not exist with --out"))
}
