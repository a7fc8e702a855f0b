//! Reads the files that commands about measurements take, and prints what was read.

use super::search_log::SearchLog;
use super::stop::Stopper;
use super::{Failure, ReadArgs};
use diagnose::Observer;
use diagnose::defects::MeasurementDefect;
use diagnose::identifiability::{self, Identifiability};
use diagnose::progress::SearchProgress;
use experiment::{Consent, Overrides};
use measure::DataError;
use measure::config::Compared;
use measure::table::DataTable;
use std::io::ErrorKind;
use std::path::Path;
use study::StopFlag;
use study::open::DataAccount;
use terminal::{say, warn, warn_all};

/// The configuration that is compared with measurements, with `--set` applied and the files that its radio names.
pub(super) fn compared(path: &Path, set: &[String], consent: Consent) -> Result<Compared, Failure> {
    let text = experiment::text_of(path).map_err(Failure::request)?;
    let compared = Compared::of_text(path, text, set).map_err(Failure::request)?;
    let overrides = Overrides { set: set.to_vec(), consent, ..Overrides::default() };
    let base = path.parent().unwrap_or(Path::new(""));
    let files = experiment::named_files(base, &compared.tree, "netsim.phy", &overrides)
        .map_err(|problems| Failure::request(compared.refuse(problems)))?;
    Ok(compared.with_files(files))
}

/// A configuration and a file of measurements.
pub(super) fn files(
    (config, set, consent): (&Path, &[String], Consent),
    data: &Path,
    read: ReadArgs,
) -> Result<(Compared, DataTable), Failure> {
    Ok((compared(config, set, consent)?, table(data, read)?))
}

/// A file of measurements.
pub(super) fn table(path: &Path, read: ReadArgs) -> Result<DataTable, Failure> {
    DataTable::read(path, read.reading()).map_err(|error| match error {
        DataError::Read { path: read, source }
            if source.kind() == ErrorKind::NotFound && read == path =>
        {
            Failure::request(format!("{}: {}", path.display(), experiment::missing_file(path)))
        }
        error => Failure::of_data(&error),
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

    fn identifiability(&self, table: &Identifiability) {
        self.log.hide_during(|| say(identifiability::text(table)));
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
