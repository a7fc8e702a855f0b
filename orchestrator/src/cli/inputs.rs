//! Reads the files that commands about measurements take.

use super::Failure;
use measure::config::Compared;
use measure::table::DataTable;
use std::path::Path;

/// The configuration that is held against measurements, with `--set` applied.
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
