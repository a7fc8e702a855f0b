//! The commands that hold a model against measurements.

use super::{Failure, write_json, write_whole};
use crate::compare;
use crate::console::{say, warn};
use crate::diagnose::answer::{self, Kind};
use crate::diagnose::ladder::Search;
use crate::extend;
use crate::study::open::{self, Account};
use clap::Args;
use serde_json::{Value, json};
use std::path::PathBuf;

/// A configuration and measurements.
#[derive(Args)]
pub(super) struct DataArgs {
    /// The configuration (TOML): the part that is compared, everything else may be missing
    config: PathBuf,
    /// The measurements: link samples as CSV, gzipped CSV or Parquet
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

#[derive(Args)]
pub(super) struct ExtendArgs {
    #[command(flatten)]
    data: DataArgs,
    /// The effect to add. May be given several times
    #[arg(long, value_name = "NAME", required_unless_present = "all")]
    effect: Vec<String>,
    /// Add every effect that diagnose accepts
    #[arg(long, conflicts_with = "effect")]
    all: bool,
    /// The new configuration
    #[arg(long, value_name = "FILE")]
    output: PathBuf,
}

/// `orchestrator compare`.
pub(super) fn compare(args: &DataArgs) -> Result<(), Failure> {
    let (config, table) =
        open::files(&args.config, &args.set, &args.data).map_err(Failure::request)?;
    let (study, account) = open::links(&config, &table).map_err(Failure::request)?;
    account_text(&account);
    let report = |line: &str| tracing::info!("{line}");
    let search = Search::new(&study, &report);
    let mut found = compare::links(&study, &search);
    account_json(&account, &mut found.json);
    say(&found.text);
    write_json(args.json.as_deref(), &found.json)
}

/// `orchestrator extend`.
pub(super) fn extend(args: &ExtendArgs) -> Result<(), Failure> {
    let data = &args.data;
    let (config, table) =
        open::files(&data.config, &data.set, &data.data).map_err(Failure::request)?;
    let (study, account) = open::links(&config, &table).map_err(Failure::request)?;
    account_text(&account);
    let report = |line: &str| tracing::info!("{line}");
    let search = Search::new(&study, &report);
    let terms = if args.all {
        search.climb().accepted
    } else {
        let found: Result<Vec<usize>, _> =
            args.effect.iter().map(|name| extend::candidate(&study, name)).collect();
        found.map_err(Failure::request)?
    };
    let extended = extend::extend(&config, &account, &study, &search, &terms, "netsim.phy.effect")
        .map_err(Failure::work)?;
    write_whole("--output", &args.output, &extended.text)?;
    say(format!(
        "{}: added {}. Held out, log score {:.4} -> {:.4}, rmse {:.4} -> {:.4} dB",
        args.output.display(),
        extended.names.join(", "),
        extended.before.log_score,
        extended.after.log_score,
        extended.before.rmse,
        extended.after.rmse
    ));
    let json = json!({
        "schema": "extend/1",
        "added": extended.names,
        "log_score": [extended.before.log_score, extended.after.log_score],
        "rmse": [extended.before.rmse, extended.after.rmse],
    });
    write_json(data.json.as_deref(), &json)
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
