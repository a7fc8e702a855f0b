//! Reads the files that commands about measurements take, and prints what was read.

use super::Failure;
use super::search_log::SearchLog;
use super::stop::Stopper;
use clap::Args;
use diagnose::Observer;
use diagnose::defects::MeasurementDefect;
use diagnose::progress::SearchProgress;
use measure::DataError;
use measure::config::Compared;
use measure::memory::MemoryBudget;
use measure::table::DataTable;
use std::io::ErrorKind;
use std::path::Path;
use study::StopFlag;
use study::open::DataAccount;
use terminal::{say, warn, warn_all};

/// How much memory measurements may take while they are read.
#[derive(Args, Clone, Copy)]
pub(super) struct MemoryArgs {
    /// Refuse a file of measurements that needs more memory than this to be read, as in 2GiB or 500MB
    #[arg(long, value_name = "SIZE", default_value = "1GiB")]
    pub(super) memory_budget: MemoryBudget,
}

/// The configuration that is compared with measurements, with `--set` applied.
pub(super) fn compared(path: &Path, set: &[String]) -> Result<Compared, Failure> {
    let text = experiment::text_of(path).map_err(Failure::request)?;
    Compared::of_text(path, text, set).map_err(Failure::request)
}

/// A configuration and a file of measurements.
pub(super) fn files(
    config: &Path,
    set: &[String],
    data: &Path,
    memory: MemoryArgs,
) -> Result<(Compared, DataTable), Failure> {
    Ok((compared(config, set)?, table(data, memory)?))
}

/// A file of measurements.
pub(super) fn table(path: &Path, memory: MemoryArgs) -> Result<DataTable, Failure> {
    DataTable::read(path, memory.memory_budget).map_err(|error| match error {
        DataError::Read { path: read, source }
            if source.kind() == ErrorKind::NotFound && read == path =>
        {
            Failure::request(format!("{}: {}", path.display(), experiment::missing_file(path)))
        }
        error => Failure::request(error),
    })
}

/// Prints how many rows are used, and why others are not.
pub(super) fn print_account(account: &DataAccount) {
    say(format!("{}: {} rows, {} used", account.data.file, account.rows, account.used));
    if let Some(by) = &account.predicted_by {
        say(format!("base model: predictions of {by}; effects are added to first order"));
    }
    for rejected in &account.rejected {
        warn(format!(
            "{} rows not used: {} (first on line {})",
            rejected.rows, rejected.reason, rejected.first_line
        ));
    }
    warn_all(&account.warnings);
}

/// Prints what is read and found while a question about measurements is answered, shows the progress, and stops the work.
pub(super) struct Watching<'a> {
    log: SearchLog,
    stopper: Option<&'a Stopper>,
}

impl<'a> Watching<'a> {
    /// `None`: nobody stops the work, and no progress is shown on a terminal.
    pub(super) fn new(stopper: Option<&'a Stopper>) -> Self {
        Self { log: SearchLog::new(stopper), stopper }
    }

    /// Removes the progress from the terminal.
    pub(super) fn clear(&self) {
        self.log.clear();
    }
}

impl Observer for Watching<'_> {
    fn opened(&self, account: &DataAccount) {
        self.log.hide_during(|| print_account(account));
    }

    fn defects(&self, defects: &[MeasurementDefect]) {
        self.log.hide_during(|| defects.iter().for_each(|defect| say(defect.text())));
    }

    fn progress(&self, progress: SearchProgress<'_>) {
        self.log.log(progress);
    }

    fn stop_flag(&self) -> Option<&StopFlag> {
        self.stopper.map(Stopper::flag)
    }
}
