//! `murmuration export`.

use super::{Failure, ReadArgs};
use clap::Args;
use export::{ExportError, ExportFormat};
use std::path::PathBuf;
use terminal::say;

#[derive(Args)]
pub(super) struct ExportArgs {
    /// Folder of a recorded run
    run: PathBuf,
    /// Format to write
    #[arg(long, value_name = "FORMAT")]
    format: ExportFormat,
    /// Folder to write; it must not exist [default: RUN-FORMAT, next to the run]
    #[arg(long, value_name = "DIR", alias = "output")]
    out: Option<PathBuf>,
    #[command(flatten)]
    read: ReadArgs,
}

/// Writes a run in the format of another program.
pub(super) fn export(args: &ExportArgs) -> Result<(), Failure> {
    let output = args.out.clone().unwrap_or_else(|| {
        let name = args.run.file_name().unwrap_or_default().to_string_lossy().into_owned();
        args.run.with_file_name(format!("{name}-{}", args.format.name()))
    });
    let run = args.read.open(&args.run)?;
    let written = export::export(&run, args.format, &output).map_err(|error| match error {
        ExportError::NoTables { .. } | ExportError::Exists { .. } => Failure::request(error),
        ExportError::Recording(error) => Failure::of_reading(&error),
        other => Failure::work(other),
    })?;
    let entries = match args.format {
        ExportFormat::Csv => "rows",
        ExportFormat::Rosbag2 => "messages",
    };
    for file in written {
        say(format!("{}: {} {entries}", file.path.display(), file.n_entries));
    }
    Ok(())
}
