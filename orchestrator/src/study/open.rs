//! From two files, measurements and a configuration, to a study.

use super::links::LinkStudy;
use super::links::rows::Rows;
use crate::config::Refusal;
use crate::measure::config::Compared;
use crate::measure::links;
use crate::measure::table::Table;
use crate::measure::{DataError, Rejected};
use std::path::Path;

/// Why measurements cannot be held against a configuration.
#[derive(Debug, thiserror::Error)]
pub enum OpenError {
    /// The configuration is refused.
    #[error(transparent)]
    Config(#[from] Refusal),
    /// The data cannot be read.
    #[error(transparent)]
    Data(#[from] DataError),
    /// The data can be read, but not used.
    #[error("{file}: {reason}")]
    Useless {
        /// The file.
        file: String,
        /// Why.
        reason: String,
    },
}

/// What is told of a file beside any answer.
#[derive(Clone, Debug)]
pub struct Account {
    /// The file's name.
    pub file: String,
    /// Its SHA-256.
    pub sha256: String,
    /// Rows in it.
    pub rows: usize,
    /// Rows used.
    pub used: usize,
    /// Rows that were not.
    pub rejected: Vec<Rejected>,
    /// What to check before an answer is trusted.
    pub warnings: Vec<String>,
}

/// Measured links, read and held against the radio of a configuration.
///
/// # Errors
///
/// What is wrong with either, in words for its author.
pub fn links(config: &Compared, table: &Table) -> Result<(LinkStudy, Account), OpenError> {
    let file = table.path.display().to_string();
    let useless = |reason: String| OpenError::Useless { file: file.clone(), reason };
    let links = links::read(table).map_err(useless)?;
    let n_motes = links.rows.iter().map(|row| row.tx.max(row.rx) as usize + 1).max().unwrap_or(1);
    let (model, effective) = config.radio(n_motes)?;
    let number = |key: &str| effective.get(key).and_then(toml::Value::as_float);
    let fixed_sd_db = number("noise_sd_db").filter(|sd_db| 0.0 < *sd_db);
    let height_m = number("antenna_height_m").unwrap_or_default();
    let rows = Rows::new(links, model, config.site.clone(), height_m);
    if rows.is_empty() {
        return Err(OpenError::Useless {
            file,
            reason: rows.links.rejected.iter().fold(
                "no row can be used".to_owned(),
                |text, rejected| {
                    format!(
                        "{text}; {} rows: {} (first on line {})",
                        rejected.rows, rejected.reason, rejected.first_line
                    )
                },
            ),
        });
    }
    let account = Account {
        file: table.path.file_name().map_or_else(String::new, |n| n.to_string_lossy().into_owned()),
        sha256: table.sha256.clone(),
        rows: rows.links.n_rows,
        used: rows.len(),
        rejected: rows.links.rejected.clone(),
        warnings: rows.links.warnings.clone(),
    };
    Ok((LinkStudy::new(rows, fixed_sd_db), account))
}

/// Reads both files.
///
/// # Errors
///
/// What is wrong with either.
pub fn files(config: &Path, set: &[String], data: &Path) -> Result<(Compared, Table), OpenError> {
    Ok((Compared::load(config, set)?, Table::read(data)?))
}
