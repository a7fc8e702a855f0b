//! `murmuration metrics`.

use super::{Failure, is_stdout, write_json};
use clap::Args;
use record::metric::{self, MetricsAnswer, Robots};
use std::path::PathBuf;
use terminal::say;

#[derive(Args)]
pub(super) struct MetricsArgs {
    /// The metric to explain, by short name or path of summary.json [default: list the short names]
    name: Option<String>,
    /// List the paths of all metrics
    #[arg(long, conflicts_with = "name")]
    all: bool,
    /// Write the list or the explanation as JSON to this file; - for standard output
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

/// `murmuration metrics`: the list, or what a metric is.
pub(super) fn metrics(args: &MetricsArgs) -> Result<(), Failure> {
    let (answer, text) = match &args.name {
        Some(name) => {
            let found = metric::find(name, Robots::BuiltIn)
                .ok_or_else(|| Failure::request(metric::unknown(name)))?;
            (MetricsAnswer::new([&found]), metric::explained(&found))
        }
        None if args.all => (MetricsAnswer::new(metric::metrics()), metric::paths()),
        None => {
            let short = metric::metrics().iter().filter(|metric| metric.short.is_some());
            (MetricsAnswer::new(short), metric::table())
        }
    };
    let json = args.json.as_deref();
    if !json.is_some_and(is_stdout) {
        say(text);
    }
    write_json(json, &answer)
}
