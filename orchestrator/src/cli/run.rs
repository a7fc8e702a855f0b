//! `murmuration run`.

use super::replay::Serving;
use super::{Failure, OverrideArgs, check_json, check_place, is_stdout, on_runtime, write_json};
use clap::Args;
use metrics::headline::{COLLISIONS_PATH, Shown};
use metrics::kpi::kpi_summary::{Delivery, ExchangeOutcome, KpiSummary};
use metrics::task::Goal;
use numbers::format::{count_of, number, percent};
use proto::types::seconds;
use record::ReplacePolicy;
use record::run_summary::{RunSummary, TaskSummary};
use run::dry_run::DryRun;
use run::run_answer::RunAnswer;
use run::{LiveView, ResumeOptions, RunOptions, RunReport, StartOptions};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use terminal::{Screen, say, warn_all};
use view::live::Pace;
use view::server::Shown as ShownRuns;

#[derive(Args)]
pub(super) struct RunArgs {
    /// The experiment file (TOML)
    #[arg(required_unless_present = "resume")]
    config: Option<PathBuf>,
    #[command(flatten)]
    change: OverrideArgs,
    /// Continue a run that was killed, from its latest checkpoint; give its folder, OUT/.NAME.partial-PID
    #[arg(long, value_name = "DIR", conflicts_with_all = ["config", "set", "seed", "out", "dry_run"])]
    resume: Option<PathBuf>,
    /// Save the network in this file once it has formed. Runs and sweeps with experiment.warm_start = "FILE" start from there
    #[arg(long, value_name = "FILE", conflicts_with_all = ["dry_run", "resume"])]
    save_formed: Option<PathBuf>,
    /// Write the results as JSON to this file; - for standard output
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Folder for results, relative to the current folder, not to the experiment file; the run is recorded in a subfolder
    /// with the experiment's name
    #[arg(long, value_name = "DIR", default_value = "runs")]
    out: PathBuf,
    /// Number of threads per simulator; results do not depend on it [default: one per core]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..))]
    pub(super) threads: Option<u16>,
    /// Replace an earlier result of another configuration or seed. Without it the result gets a folder of its own next to
    /// that one. A run that does not complete never replaces a complete result
    #[arg(long)]
    replace: bool,
    /// Show the run in a browser while it lasts: prints the address of a page on this machine. Afterwards the page
    /// replays the run, until Ctrl-C
    #[arg(long, conflicts_with_all = ["dry_run", "resume"])]
    live: bool,
    /// Let the page pause the run and take single steps
    #[arg(long, requires = "live")]
    live_control: bool,
    /// Slow the run down to at most X simulated seconds per second
    #[arg(long, value_name = "X", requires = "live", allow_negative_numbers = true, value_parser = live_speed)]
    live_speed: Option<f64>,
    /// Port of the page [default: any free port]
    #[arg(long, value_name = "PORT", requires = "live")]
    port: Option<u16>,
    /// Estimate time, memory and disk space from the first steps, and write nothing
    #[arg(long)]
    dry_run: bool,
}

/// `murmuration run`.
pub(super) fn run(args: &RunArgs, start: StartOptions) -> Result<(), Failure> {
    // A place that cannot be written is found before the work, not after it.
    check_json(args.json.as_deref())?;
    if let Some(path) = &args.save_formed {
        if is_stdout(path) {
            return Err(Failure::request("--save-formed -: give the path of a file"));
        }
        check_place("--save-formed", path)?;
    }
    let config = args.config.clone().unwrap_or_default();
    if args.dry_run {
        return dry_run(args, &config, &start);
    }
    let overrides = args.change.overrides();
    let replace =
        if args.replace { ReplacePolicy::AnyExperiment } else { ReplacePolicy::SameExperiment };
    let screen = &mut Screen::default();
    let shown = ShownRuns::new(Vec::new());
    let serving = args.live.then(|| Serving::begin(args.port, &shown)).transpose()?;
    let live = serving.as_ref().map(|serving| LiveView {
        shown: shown.clone(),
        url: serving.url().to_owned(),
        pace: Arc::new(Pace::new(args.live_speed)),
        controllable: args.live_control,
    });
    let report = match &args.resume {
        Some(dir) => {
            let options = ResumeOptions { dir: dir.clone(), overrides, replace, start };
            on_runtime(run::resume(&options, screen))?
        }
        None => {
            let out = args.out.clone();
            let save_formed = args.save_formed.clone();
            let options = RunOptions { config, overrides, out, replace, start, live, save_formed };
            on_runtime(run::run(&options, screen))?
        }
    };
    let report = report.map_err(Failure::of_run)?;
    describe(&report);
    write_json(args.json.as_deref(), &RunAnswer::from_report(&report))?;
    if let Some(serving) = serving
        && !report.interrupted
    {
        serving.replay(&shown, &report.finished.dir)?;
    }
    if report.interrupted {
        return Err(Failure::work(format!(
            "interrupted after step {}; the recording up to this step is kept",
            report.n_steps
        )));
    }
    Ok(())
}

/// A speed that a run can have.
fn live_speed(text: &str) -> Result<f64, String> {
    let speed: f64 = text.parse().map_err(|_| "must be a number".to_owned())?;
    if (0.001..=1e6).contains(&speed) {
        Ok(speed)
    } else {
        Err("must be from 0.001 to 1000000".to_owned())
    }
}

fn dry_run(args: &RunArgs, config: &Path, start: &StartOptions) -> Result<(), Failure> {
    let plan = experiment::load(config, &args.change.overrides());
    let plan = plan.map_err(Failure::request)?;
    let dry = on_runtime(DryRun::of_run(&plan, start, &args.out))?.map_err(Failure::of_run)?;
    show_dry_run(&dry, args.json.as_deref())
}

/// Shows what a run or a sweep would take.
pub(super) fn show_dry_run(dry: &DryRun, json: Option<&Path>) -> Result<(), Failure> {
    warn_all(&dry.warnings);
    say(dry.text());
    write_json(json, dry)
}

fn describe(report: &RunReport) {
    let summary = &report.finished.summary;
    let rate = if report.wall_s > 0.0 { report.n_steps as f64 / report.wall_s } else { 0.0 };
    say(format!(
        "{}: {} steps, {:.1} s simulated in {:.2} s ({rate:.0} steps/s)",
        summary.name,
        report.n_steps,
        seconds(report.time_ns),
        report.wall_s,
    ));
    for line in highlights(summary) {
        say(format!("  {line}"));
    }
    say(format!("results in {}", report.finished.dir.display()));
    if let Some(page) = &report.finished.report {
        say(format!("open {}", page.display()));
    }
}

/// The few numbers of a summary that a person looks for first.
fn highlights(summary: &RunSummary) -> Vec<String> {
    let mut lines = Vec::new();
    if let Some(baseline) = &summary.baseline {
        lines.push(format!("{baseline}: each robot knew the true state of all others"));
    }
    lines.extend(of_task(summary));
    lines.extend(summary.kpis.iter().flat_map(of_packets));
    if let Some(network) = &summary.network
        && let (Some(ratio), Some(heard)) = (network.delivery_ratio, network.mean_neighbours_heard)
    {
        lines.push(format!(
            "{:.1} % of frames delivered, {heard:.1} neighbours heard on average",
            ratio * 100.0
        ));
        if let Some(second) = network.second_medium_deliveries {
            let all = network.deliveries;
            let twice = if (1..all).contains(&second) {
                "; a payload that both media carry counts as two frames"
            } else {
                ""
            };
            lines.push(format!("{second} of {all} deliveries came over the second medium{twice}"));
        }
    }
    lines
}

/// What a network with protocols did.
fn of_packets(kpis: &KpiSummary) -> Vec<String> {
    let mut lines = Vec::new();
    let median = |delivery: &Delivery| {
        let latency_s = delivery.latency_s.as_ref().and_then(|latency| latency.median);
        latency_s.map(|s| format!(", after {s:.2} s (median)")).unwrap_or_default()
    };
    let since = &kpis.since_start;
    let waited = kpis.before_start();
    if let Some(expected) = &since.delivered_of_expected {
        let joined = match expected.joined_at_end {
            Some(joined) if joined < expected.alive_at_end => {
                format!("; {joined} of {} motes joined at the end", expected.alive_at_end)
            }
            _ => String::new(),
        };
        lines.push(format!(
            "{:.1} % of the packets expected{} delivered: {} of {}{}{joined}",
            expected.ratio * 100.0,
            if waited.is_some() { " since the robots started" } else { "" },
            expected.delivered,
            expected.expected,
            since.delivery.as_ref().map(median).unwrap_or_default()
        ));
    }
    if let Some(formed_s) = kpis.formation.as_ref().and_then(|formation| formation.formed_s) {
        let before = waited.filter(|_| since.delivered_of_expected.is_some());
        let before = before.map(|[delivered, ended]| {
            format!("; until the robots started {delivered} of {ended} packets were delivered")
        });
        lines.push(format!(
            "the network had formed after {formed_s:.1} s{}",
            before.unwrap_or_default()
        ));
    }
    if let (Some(delivery), None) = (&kpis.delivery, &since.delivered_of_expected) {
        lines.push(format!(
            "{:.1} % of packets delivered, {} in all{}",
            delivery.ratio * 100.0,
            delivery.delivered,
            median(delivery)
        ));
    }
    if let Some(exchanges) = &kpis.exchanges {
        let ExchangeOutcome { succeeded, started, .. } = exchanges.outcome;
        let round_trip_s = exchanges.round_trip_s.as_ref().and_then(|latency| latency.median);
        let after = round_trip_s.map(|s| format!(", after {s:.2} s (median)")).unwrap_or_default();
        lines.push(format!("{succeeded} of {started} exchanges succeeded{after}"));
    }
    if let Some(downloads) = &kpis.downloads {
        let ExchangeOutcome { succeeded, started, .. } = downloads.outcome;
        let goodput = downloads.mean_goodput_bytes_s;
        let goodput = goodput.map(|rate| format!(", at {rate:.0} B/s (mean)")).unwrap_or_default();
        lines.push(format!("{succeeded} of {started} downloads complete{goodput}"));
    }
    lines
}

/// What the robots did: their first figure and those beside it, then whether these can be trusted.
fn of_task(summary: &RunSummary) -> Vec<String> {
    let Some(task) = &summary.task else { return Vec::new() };
    let mut lines = Vec::new();
    let first = summary.first_figure().filter(|(_, first, _)| first.of_task().is_some());
    if let Some((headline, first, value)) = first {
        let is_led = headline.goals.contains(&Goal::FollowLeader);
        lines.push(if is_led {
            of_leader(task, value)
        } else {
            let beside = headline.beside.iter().filter(|shown| shown.path != COLLISIONS_PATH);
            let beside = beside.filter_map(|shown| Some((shown, summary.number(shown.path)?)));
            let figure = |(shown, value): (&Shown, f64)| {
                format!("{}: {}", uncapitalised(shown.words), shown.text(value))
            };
            std::iter::once((first, value)).chain(beside).map(figure).collect::<Vec<_>>().join("; ")
        });
        let doubts: Vec<String> =
            [thrashing(task), collisions(task).filter(|_| headline.counts_collisions())]
                .into_iter()
                .flatten()
                .collect();
        if !doubts.is_empty() {
            lines.push(doubts.join("; "));
        }
    }
    if let Some(step) = task.completed_at_step {
        let falsely = if task.is_set("false_completion") { ", but falsely" } else { "" };
        lines.push(format!("task complete at step {step}{falsely}"));
    }
    lines
}

/// How well robots follow. `ratio`: their speed along the leader's direction, as a share of the leader's.
fn of_leader(task: &TaskSummary, ratio: f64) -> String {
    let along = task.number("speed_along_leader_mps").map(number).unwrap_or_default();
    let distance = task.number("leader_distance_m");
    let distance = distance.map(|m| format!("; distance to the leader {} m", number(m)));
    format!(
        "speed along the leader's direction {along} m/s, {} of the leader's{}",
        percent(ratio),
        distance.unwrap_or_default()
    )
}

fn thrashing(task: &TaskSummary) -> Option<String> {
    let robots_mps = task.number("mean_speed_mps").filter(|_| task.is_set("thrashing"))?;
    let along_mps = task.number("speed_along_leader_mps")?;
    Some(format!(
        "the robots thrash: mean speed {} m/s, along the leader's direction {} m/s",
        number(robots_mps),
        number(along_mps)
    ))
}

fn collisions(task: &TaskSummary) -> Option<String> {
    let n = task.number("collisions").filter(|n| 0.0 < *n)?;
    Some(format!("{} between robots", count_of(n as u64, "collision")))
}

/// Words that begin a label, within a sentence.
fn uncapitalised(words: &str) -> String {
    let mut letters = words.chars();
    let first = letters.next().map(|letter| letter.to_lowercase().to_string());
    first.unwrap_or_default() + letters.as_str()
}
