//! The commands that hold a model against measurements.

use super::{Failure, write_json, write_whole};
use crate::compare;
use crate::console::{say, warn};
use crate::diagnose::answer::{self, Answer, Kind};
use crate::diagnose::ladder::Search;
use crate::extend;
use crate::measure::config::Compared;
use crate::study::Study;
use crate::study::open::{self, Account, Subject};
use clap::Args;
use serde_json::{Value, json};
use std::collections::BTreeMap;
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

pub(super) fn account_json(account: &Account, json: &mut Value) {
    json["data"] = json!({ "file": account.file, "sha256": account.sha256 });
    json["rows"] = json!(account.rows);
    json["used"] = json!(account.used);
    json["rejected"] = json!(account.rejected);
    json["warnings"] = json!(account.warnings);
}

pub(super) fn account_text(account: &Account) {
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
    let (mut found, account) = match open::subject(&table).map_err(Failure::request)? {
        Subject::Links => {
            let (study, account) = open::links(&config, &table).map_err(Failure::request)?;
            (compare::links(&study, &Search::new(&study, &progress)), account)
        }
        Subject::Robots => {
            let (study, account) = open::robots(&config, &table).map_err(Failure::request)?;
            (compare::robots(&study, &Search::new(&study, &progress)), account)
        }
    };
    account_text(&account);
    account_json(&account, &mut found.json);
    say(&found.text);
    write_json(args.json.as_deref(), &found.json)
}

fn progress(line: &str) {
    tracing::info!("{line}");
}

/// `orchestrator extend`.
pub(super) fn extend(args: &ExtendArgs) -> Result<(), Failure> {
    let data = &args.data;
    let (config, table) =
        open::files(&data.config, &data.set, &data.data).map_err(Failure::request)?;
    match open::subject(&table).map_err(Failure::request)? {
        Subject::Links => {
            let (study, account) = open::links(&config, &table).map_err(Failure::request)?;
            extend_with(args, &config, &account, &study, ("netsim.phy.effect", "dB"))
        }
        Subject::Robots => {
            let (study, account) = open::robots(&config, &table).map_err(Failure::request)?;
            extend_with(args, &config, &account, &study, ("robotsim.dynamics.effect", "m"))
        }
    }
}

fn extend_with<S: Study>(
    args: &ExtendArgs,
    config: &Compared,
    account: &Account,
    study: &S,
    (section, unit): (&str, &str),
) -> Result<(), Failure> {
    account_text(account);
    let search = Search::new(study, &progress);
    let terms = if args.all {
        search.climb().accepted
    } else {
        let found: Result<Vec<usize>, _> =
            args.effect.iter().map(|name| extend::candidate(study, name)).collect();
        found.map_err(Failure::request)?
    };
    let extended =
        extend::extend(config, account, study, &search, &terms, section).map_err(Failure::work)?;
    write_whole("--output", &args.output, &extended.text)?;
    say(format!(
        "{}: added {}. Held out, log score {:.4} -> {:.4}, rmse {:.4} -> {:.4} {unit}",
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
    write_json(args.data.json.as_deref(), &json)
}

/// `orchestrator diagnose`.
pub(super) fn diagnose(args: &DataArgs) -> Result<(), Failure> {
    let (config, table) =
        open::files(&args.config, &args.set, &args.data).map_err(Failure::request)?;
    match open::subject(&table).map_err(Failure::request)? {
        Subject::Links => {
            let (study, account) = open::links(&config, &table).map_err(Failure::request)?;
            account_text(&account);
            let search = Search::new(&study, &progress);
            let ladder = search.climb();
            let left = study.left_over(&search, &ladder);
            let kind = Kind { name: "link", unit: "dB" };
            let structure = left.structure.as_ref();
            let answer = answer::answer(&study, &search, &ladder, kind, &left.formulas, structure);
            diagnosed(args, &account, answer)
        }
        Subject::Robots => {
            let (study, account) = open::robots(&config, &table).map_err(Failure::request)?;
            account_text(&account);
            let search = Search::new(&study, &progress);
            let ladder = search.climb();
            let kind = Kind { name: "robot", unit: "m" };
            let none = BTreeMap::new();
            let answer = answer::answer(&study, &search, &ladder, kind, &none, None);
            diagnosed(args, &account, answer)
        }
    }
}

fn diagnosed(args: &DataArgs, account: &Account, mut answer: Answer) -> Result<(), Failure> {
    account_json(account, &mut answer.json);
    say(&answer.text);
    write_json(args.json.as_deref(), &answer.json)
}
