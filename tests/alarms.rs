//! What score tests find in a campaign, without a search: for many null campaigns in little time.

use crate::campaign::unforeseen::Case;
use diagnose::{Request, Unobserved};
use measure::config::Compared;
use measure::table::DataTable;
use std::path::Path;

/// What [`diagnose::screen`] finds in a campaign.
///
/// # Errors
///
/// The campaign cannot be read.
pub fn found(case: &Case) -> anyhow::Result<Vec<String>> {
    let config = Compared::of_text(Path::new("config.toml"), case.config_toml.clone(), &[])?;
    let table = DataTable::of_csv(Path::new("data.csv"), case.csv.as_bytes())?;
    Ok(diagnose::screen(&Request::new(&config, &table), &Unobserved)?)
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
