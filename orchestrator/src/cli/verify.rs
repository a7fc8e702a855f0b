//! `murmuration verify`.

use super::{Failure, write_json};
use clap::Args;
use std::path::PathBuf;
use terminal::{complain, say};

#[derive(Args)]
pub(super) struct VerifyArgs {
    /// Folder of the run, or of a sweep, whose kept runs are checked, too
    run: PathBuf,
    /// Also require that the whole result has this SHA-256, as a publication cites it
    #[arg(long, value_name = "SHA256")]
    root: Option<String>,
    /// Write the results as JSON to this file; - for standard output
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

/// Reports whether a recorded run is complete and consistent.
pub(super) fn verify(args: &VerifyArgs) -> Result<(), Failure> {
    let report = if sweep::verify::is_result(&args.run) {
        sweep::verify::verify(&args.run)
    } else {
        record::verify(&args.run).map_err(Failure::work)?
    };
    for problem in &report.problems {
        complain(problem);
    }
    write_json(args.json.as_deref(), &report)?;
    let (files, steps, digests) = (report.files.len(), report.steps, report.digests);
    let counted =
        format!("{files} files intact, {steps} steps, {digests} digests recomputed and equal");
    if report.problems.is_empty() {
        say(format!("{}: valid. {counted}", args.run.display()));
        say(format!("root SHA-256 {}", report.root_sha256));
        match &args.root {
            Some(root) if !root.eq_ignore_ascii_case(&report.root_sha256) => {
                let run = args.run.display();
                Err(Failure::work(format!(
                    "{run}: --root {root}: it is another result, or files of it were changed together"
                )))
            }
            _ => Ok(()),
        }
    } else {
        Err(Failure::work(format!(
            "{}: {} problems; {counted}",
            args.run.display(),
            report.problems.len()
        )))
    }
}
