//! `extend --corrected-data`: measurements without their defects.

use super::measured::ExtendArgs;
use super::search_log::SearchLog;
use super::stop::Stopper;
use super::{Failure, write_whole};
use crate::console::say;
use diagnose::corrected_data::corrected_data;
use diagnose::defects::{self, MeasurementDefect};
use diagnose::progress::SearchProgress;
use measure::table::DataTable;
use study::links::LinkStudy;
use study::open::DataAccount;

/// The measurements that are fitted to: corrected, where all that diagnose accepts is added or corrected data are asked for. Writes the
/// corrected data.
pub(super) fn corrected(
    args: &ExtendArgs,
    table: &DataTable,
    study: LinkStudy,
    account: DataAccount,
    stopper: &Stopper,
) -> Result<(LinkStudy, DataAccount), Failure> {
    if !args.all && args.corrected_data.is_none() {
        return Ok((study, account));
    }
    let log = SearchLog::new(Some(stopper));
    let report = |progress: SearchProgress<'_>| log.log(progress);
    let found = defects::find(&study, &report);
    log.clear();
    if let (Some(path), true) = (&args.corrected_data, stopper.flag().is_set()) {
        return Err(Failure::request(format!(
            "--corrected-data {}: the search was stopped before it told which defects there are; nothing is written",
            path.display()
        )));
    }
    for defect in &found {
        say(MeasurementDefect::of(defect).text());
    }
    if let Some(path) = &args.corrected_data {
        let written = corrected_data(table, &study, &found).map_err(|refused| {
            Failure::request(format!("--corrected-data {}: {refused}", path.display()))
        })?;
        write_whole("--corrected-data", path, &written.csv)?;
        say(format!(
            "{}: {} rows, {} of them corrected; {} rows with defects and {} that cannot be used are left out",
            path.display(),
            written.n_rows,
            written.n_changed,
            written.n_left_out,
            written.n_rejected
        ));
    }
    let account = defects::corrected_account(&account, &found);
    let changed = defects::corrected(&study, &found).map_err(Failure::request)?;
    Ok((changed.unwrap_or(study), account))
}
