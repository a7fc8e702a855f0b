//! `murmuration open`.

use super::replay::Serving;
use super::{Failure, ReadArgs};
use clap::Args;
use experiment::{missing_file, program_name};
use index::{ResultsTable, site};
use std::path::PathBuf;
use view::server::Server;

#[derive(Args)]
pub(super) struct OpenArgs {
    /// Folder of results: of runs, sweeps and answers, in any folder below it
    #[arg(value_name = "DIR", default_value = "runs")]
    folder: PathBuf,
    /// Port of the page [default: any free port]
    #[arg(long, value_name = "PORT")]
    port: Option<u16>,
    #[command(flatten)]
    read: ReadArgs,
}

/// Shows the results of a folder in a browser.
pub(super) fn open(args: &OpenArgs) -> Result<(), Failure> {
    let folder = &args.folder;
    let refused = |text: &str| Failure::request(format!("{}: {text}", folder.display()));
    if !folder.exists() {
        return Err(refused(&missing_file(folder)));
    }
    if !folder.is_dir() {
        return Err(refused("is a file; give a folder of results, such as runs"));
    }
    let table = ResultsTable::new(folder, args.read.reading());
    if !table.has_any() {
        let program = program_name();
        return Err(refused(&format!(
            "holds no run, sweep or answer; `{program} run experiment.toml` makes the first one, in the folder runs"
        )));
    }
    let serving =
        Serving::of(args.port, move |port| Server::with(port, |access| site(table, access)))?;
    let words = format!("open {}\npress Ctrl-C to end", serving.url());
    serving.until_interrupted(&words)
}
