//! Checks the folder of a sweep: its own files, and the runs that it keeps.

use crate::results::kept_runs;
use crate::sweep_summary::SCHEMA;
use proto::bounds::DESCRIPTION_BYTES;
use record::Tagged;
use record::bounded::read_file;
use record::run_summary::RunSummary;
use record::verify::{VerifyReport, verify_files};
use std::path::{Path, PathBuf};

/// Whether a folder is that of a finished sweep.
#[must_use]
pub fn is_result(dir: &Path) -> bool {
    let text = read_file(&DESCRIPTION_BYTES, &dir.join(RunSummary::FILE)).ok();
    let tagged = text.and_then(|text| serde_json::from_slice::<Tagged>(&text).ok());
    tagged.is_some_and(|tagged| tagged.schema == SCHEMA)
}

/// Checks the files of a sweep, and every run that it keeps. The SHA-256 of the whole result is that of the sweep's own files.
#[must_use]
pub fn verify(dir: &Path) -> VerifyReport {
    let mut report = verify_files(dir);
    let runs = kept_runs(dir);
    let entries = std::fs::read_dir(&runs).into_iter().flatten().flatten();
    let is_hidden = |path: &PathBuf| {
        path.file_name().is_some_and(|name| name.as_encoded_bytes().starts_with(b"."))
    };
    let mut runs: Vec<PathBuf> = entries
        .map(|entry| entry.path())
        .filter(|path| path.is_dir() && !is_hidden(path))
        .collect();
    runs.sort();
    for run in runs {
        let name = run.strip_prefix(dir).unwrap_or(&run).display();
        match record::verify(&run) {
            Ok(of_run) => {
                report.files.extend(of_run.files.iter().map(|file| format!("{name}/{file}")));
                report.problems.extend(of_run.problems.iter().map(|it| format!("{name}: {it}")));
                report.steps += of_run.steps;
                report.digests += of_run.digests;
            }
            Err(error) => report.problems.push(format!("{name}: {error}")),
        }
    }
    report
}
