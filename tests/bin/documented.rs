//! Runs the commands of pages and compares the numbers that they print with those on the pages: see `tests::documented`.
//!
//! `documented docs/missing-physics.md …`; without a page, those whose commands take minutes.

use clap::Parser;
use std::io::Write as _;
use std::path::PathBuf;
use std::process::ExitCode;
use tests::documented::{LONG, deviations_of_page};

/// Compare the numbers on pages of the guide with what the commands on them print.
#[derive(Parser)]
struct Args {
    /// Pages, from the top folder of the repository. Absent: those whose commands take minutes
    pages: Vec<String>,
    /// The folder to run in, which must be empty. Absent: a temporary one
    #[arg(long)]
    folder: Option<PathBuf>,
}

fn main() -> anyhow::Result<ExitCode> {
    let args = Args::parse();
    let programs = std::env::current_exe()?.parent().map(PathBuf::from).unwrap_or_default();
    let pages = if args.pages.is_empty() { LONG.map(str::to_owned).to_vec() } else { args.pages };
    let mut is_wrong = false;
    for page in pages {
        let temporary = tests::folder();
        let folder = args.folder.clone().unwrap_or_else(|| temporary.path().to_owned());
        for deviation in deviations_of_page(&page, &folder, &programs)? {
            is_wrong = true;
            writeln!(std::io::stdout(), "{deviation}")?;
        }
    }
    Ok(if is_wrong { ExitCode::FAILURE } else { ExitCode::SUCCESS })
}
