//! What score tests find in a campaign, without a search: for many null campaigns in little time.

use crate::campaign::unforeseen::Case;
use anyhow::Context as _;
use diagnose::acceptance::FAMILY_ERROR;
use diagnose::ladder::Search;
use diagnose::{gate, limits};
use measure::config::Compared;
use measure::table::DataTable;
use study::choices::Choices;
use study::open::{self, Subject};
use study::{COMMON, Study};

/// Names of all that score tests find beyond chance in the model as configured: constants by which rows are off, effects, and effects on
/// some rows only. Each kind has the error probability of a family of its own.
///
/// # Errors
///
/// The campaign cannot be written or read.
pub fn found(case: &Case) -> anyhow::Result<Vec<String>> {
    let folder = tempfile::tempdir().context("making a folder")?;
    let [config, data] = ["config.toml", "data.csv"].map(|name| folder.path().join(name));
    std::fs::write(&data, &case.csv).context("writing the campaign")?;
    let compared = Compared::of_text(&config, case.config_toml.clone(), &[])?;
    let table = DataTable::read(&data)?;
    let choices = Choices::default();
    Ok(match open::subject(&table)? {
        Subject::Links => found_in(&open::links(&compared, &table, &choices)?.0),
        Subject::Robots => found_in(&open::robots(&compared, &table, &choices)?.0),
    })
}

fn found_in<S: Study>(study: &S) -> Vec<String> {
    let report = |_: diagnose::progress::SearchProgress<'_>| {};
    let search = Search::new(study, &report);
    let fit = search.full_fit(&[], COMMON, None);
    let candidates = study.candidates();
    let mut names: Vec<String> =
        gate::gate(study, &fit).misfits.iter().map(gate::Misfit::sentence).collect();
    let limited = limits::proposals(study, &search, &[]);
    names.extend(
        limited.iter().map(|found| format!("{} ({})", candidates[found.term].name, found.only)),
    );
    let tried: Vec<usize> =
        (0..candidates.len()).filter(|&term| candidates[term].is_tried()).collect();
    let is_found =
        |term: usize| limits::p_value(study, &fit, term) * (tried.len() as f64) < FAMILY_ERROR;
    names.extend(
        tried.iter().filter(|&&term| is_found(term)).map(|&term| candidates[term].name.clone()),
    );
    names
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::campaign::unforeseen::nulls::{Noise, links};

    #[test]
    fn a_constant_is_found_and_white_noise_is_not() {
        let mut case = links(3, Noise::White);
        assert_eq!(found(&case).unwrap(), Vec::<String>::new());
        // The model sends with 5 dB more than the campaign did.
        let power = |line: &str| -> String {
            match line.strip_prefix("tx_power_dbm = ") {
                Some(dbm) => {
                    format!("tx_power_dbm = {:.2}", dbm.trim().parse::<f64>().unwrap() + 5.0)
                }
                None => line.to_owned(),
            }
        };
        case.config_toml = case.config_toml.lines().map(power).collect::<Vec<_>>().join("\n");
        let names = found(&case).unwrap();
        assert!(names.iter().any(|name| name.contains("readings are off")), "{names:?}");
        assert!(names.iter().any(|name| name == "system-gain"), "{names:?}");
    }
}
