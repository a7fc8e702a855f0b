//! The commands that hold a model against measurements.

use super::{Failure, write_json};
use crate::console::{say, warn};
use crate::diagnose::answer::{self, Kind};
use crate::diagnose::ladder::Search;
use crate::study::open::{self, Account};
use clap::Args;
use serde_json::{Value, json};
use std::path::PathBuf;

/// A configuration and measurements.
#[derive(Args)]
pub(super) struct DataArgs {
    /// The configuration (TOML): the part that is compared, everything else may be missing
    config: PathBuf,
    /// The measurements: CSV, gzipped CSV, Parquet or K7
    #[arg(long, value_name = "FILE")]
    data: PathBuf,
    /// Set a key of the configuration: netsim.phy.propagation=friis. May be given several times
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// Write what was found as JSON
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

fn account_json(account: &Account, json: &mut Value) {
    json["data"] = json!({ "file": account.file, "sha256": account.sha256 });
    json["rows"] = json!(account.rows);
    json["used"] = json!(account.used);
    json["rejected"] = json!(account.rejected);
    json["warnings"] = json!(account.warnings);
}

fn account_text(account: &Account) {
    say(format!("{}: {} rows, {} used", account.file, account.rows, account.used));
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

/// `orchestrator diagnose`.
pub(super) fn diagnose(args: &DataArgs) -> Result<(), Failure> {
    let (config, table) =
        open::files(&args.config, &args.set, &args.data).map_err(Failure::request)?;
    let (study, account) = open::links(&config, &table).map_err(Failure::request)?;
    account_text(&account);
    let report = |line: &str| tracing::info!("{line}");
    let search = Search::new(&study, &report);
    let ladder = search.climb();
    let kind = Kind { name: "link", unit: "dB" };
    let mut answer = answer::answer(&study, &search, &ladder, kind, &[]);
    account_json(&account, &mut answer.json);
    say(&answer.text);
    write_json(args.json.as_deref(), &answer.json)
}
