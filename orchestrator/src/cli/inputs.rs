//! Reads the files that commands about measurements take, and prints what was read.

use super::Failure;
use crate::console::{say, warn};
use measure::config::Compared;
use measure::table::DataTable;
use std::path::Path;
use study::open::DataAccount;

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
) -> Result<(Compared, DataTable), Failure> {
    Ok((compared(config, set)?, DataTable::read(data).map_err(Failure::request)?))
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
    for warning in &account.warnings {
        warn(warning);
    }
}
