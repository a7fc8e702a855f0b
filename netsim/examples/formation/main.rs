//! How long a network takes to form, and what it then looks like, for every scheduling function over every propagation
//! model: `cargo run --release -p netsim --example formation -- [--motes 5,10,25] [--seeds 10] [--sf msf] [--model full]
//! [--limit-s 3600]`.
//!
//! Motes stand 2 m apart on a line, mote 0, the root, in the middle, and say nothing of their own. Prints two Markdown
//! tables, medians (and ranges) over seeds 1, 2, …: the time of formation (s); degree · depth · betweenness.

#![expect(clippy::disallowed_methods, reason = "a program reads its arguments")]

mod cases;
mod structure;

use cases::{Case, MODELS, schedulers};
use proto::types::seconds;
use std::io::{self, Write};
use structure::Structure;

struct Options {
    motes: Vec<usize>,
    n_seeds: u64,
    /// A network that has not formed by then (s) is counted as not formed.
    limit_s: u64,
    scheduler: Option<String>,
    model: Option<String>,
}

fn options() -> Result<Options, String> {
    let mut options = Options {
        motes: vec![5, 10, 25, 50, 100],
        n_seeds: 10,
        limit_s: 3600,
        scheduler: None,
        model: None,
    };
    let mut args = std::env::args().skip(1);
    while let Some(key) = args.next() {
        let value = args.next().ok_or_else(|| format!("{key} needs a value"))?;
        let wrong = |what: &str| format!("{key} must be {what}, got {value}");
        match key.as_str() {
            "--motes" => {
                let numbers = value.split(',').map(str::parse).collect::<Result<_, _>>();
                options.motes = numbers.map_err(|_| wrong("numbers, as 5,10"))?;
            }
            "--seeds" => options.n_seeds = value.parse().map_err(|_| wrong("a number"))?,
            "--limit-s" => options.limit_s = value.parse().map_err(|_| wrong("a number"))?,
            "--sf" => options.scheduler = Some(value),
            "--model" => options.model = Some(value),
            _ => {
                return Err(format!(
                    "{key}: there are --motes, --seeds, --limit-s, --sf and --model"
                ));
            }
        }
    }
    Ok(options)
}

fn main() -> io::Result<()> {
    let options = match options() {
        Ok(options) => options,
        Err(reason) => {
            writeln!(io::stderr(), "error: {reason}")?;
            std::process::exit(2);
        }
    };
    let wanted = |only: &Option<String>, name: &str| only.as_ref().is_none_or(|only| only == name);
    let mut times = Vec::new();
    let mut structures = Vec::new();
    for scheduler in schedulers().filter(|name| wanted(&options.scheduler, name)) {
        for (model, keys) in MODELS.iter().filter(|(name, _)| wanted(&options.model, name)) {
            let (mut of_time, mut of_structure) = (Vec::new(), Vec::new());
            for &n in &options.motes {
                let formed = all_seeds(&Case { scheduler, model: keys, n }, &options);
                of_time.push(time(&formed, options.n_seeds));
                of_structure.push(structure(&formed));
            }
            writeln!(io::stderr(), "{scheduler} over {model}: {}", of_time.join(", "))?;
            times.push(row(scheduler, model, &of_time));
            structures.push(row(scheduler, model, &of_structure));
        }
    }
    let columns: Vec<String> = options.motes.iter().map(|n| format!("{n} motes")).collect();
    for rows in [times, structures] {
        writeln!(io::stdout(), "| scheduling | model | {} |", columns.join(" | "))?;
        writeln!(io::stdout(), "|---|---|{}", "---|".repeat(columns.len()))?;
        writeln!(io::stdout(), "{}\n", rows.join("\n"))?;
    }
    Ok(())
}

fn row(scheduler: &str, model: &str, cells: &[String]) -> String {
    format!("| `{scheduler}` | `{model}` | {} |", cells.join(" | "))
}

/// When each seed's network had formed (ns), and what it looked like; those that had not are left out.
fn all_seeds(case: &Case<'_>, options: &Options) -> Vec<(u64, Structure)> {
    (1..=options.n_seeds).filter_map(|seed| case.form(seed, options.limit_s)).collect()
}

/// Median, least and greatest time (s), and how many formed if not all did.
fn time(formed: &[(u64, Structure)], n_seeds: u64) -> String {
    let mut times_s: Vec<f64> = formed.iter().map(|&(formed_ns, _)| seconds(formed_ns)).collect();
    times_s.sort_by(f64::total_cmp);
    let (Some(least), Some(greatest)) = (times_s.first(), times_s.last()) else {
        return "–".to_owned();
    };
    let spread = format!("{:.0} ({least:.0}–{greatest:.0})", median(&times_s));
    let n = formed.len();
    if n as u64 == n_seeds { spread } else { format!("{spread}, {n} of {n_seeds}") }
}

/// Medians of degree, depth and betweenness.
fn structure(formed: &[(u64, Structure)]) -> String {
    let median_of = |value: fn(&Structure) -> f64| {
        let mut values: Vec<f64> = formed.iter().map(|(_, structure)| value(structure)).collect();
        values.sort_by(f64::total_cmp);
        median(&values)
    };
    if formed.is_empty() {
        return "–".to_owned();
    }
    format!(
        "{:.1} · {:.1} · {:.2}",
        median_of(|structure| structure.mean_degree),
        median_of(|structure| structure.mean_depth),
        median_of(|structure| structure.greatest_betweenness)
    )
}

/// Of sorted values, at least one.
fn median(sorted: &[f64]) -> f64 {
    let (low, high) = (sorted[(sorted.len() - 1) / 2], sorted[sorted.len() / 2]);
    (low + high) / 2.0
}
