//! What a sweep leaves: its file, its table, its summary, its report and the runs that were kept.

use super::journal::TrialRow;
use super::metric_names;
use super::plan::{SweepPlan, SweepTrial};
use super::setting_figures::SettingFigures;
use super::sweep_summary::{IntervalKind, MetricSummary, SCHEMA, SettingSummary, SweepSummary};
use super::table::{self, TableColumn};
use super::{TABLE_FILE, report};
use metrics::figures::FigureValue;
use metrics::headline::THRASHING_PATH;
use numbers::format::number;
use numbers::layout::TextTable;
use numbers::statistics::range;
use record::metric::{self, Robots};
use record::result::{PROVENANCE_FILE, ResultFolder, Trust};
use record::run_summary::RunSummary;
use record::{RecordError, fingerprint, forget_progress, pretty};
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};

/// A sweep whose trials are all done.
pub(super) struct FinishedSweep<'a> {
    pub(super) plan: &'a SweepPlan,
    pub(super) rows: &'a BTreeMap<SweepTrial, TrialRow>,
    pub(super) jobs: usize,
    /// Trials run just now.
    pub(super) n_now: usize,
    pub(super) n_starts: u64,
    pub(super) wall_s: f64,
}

/// Where the runs are that are kept.
pub(super) fn kept_runs(dir: &Path) -> PathBuf {
    dir.join("runs")
}

/// Whether all is there that a trial left: it is the run of which the row is.
pub(super) fn is_kept(dir: &Path, plan: &SweepPlan, trial: SweepTrial, row: &TrialRow) -> bool {
    let run = kept_runs(dir).join(plan.trial_name(trial));
    let summary = ResultFolder::open(&run, Trust::Checked).and_then(|run| RunSummary::of(&run));
    summary.is_ok_and(|summary| summary.final_digest == row.digest)
}

/// Writes the sweep's file.
pub(super) fn write_config(dir: &Path, plan: &SweepPlan) -> Result<(), RecordError> {
    write_whole(dir, "sweep.toml", plan.written.as_bytes())
}

/// Removes what a program that was killed has left of runs, of trials whose name `is_own` accepts.
pub(super) fn remove_partial_runs(
    dir: &Path,
    is_own: impl Fn(&str) -> bool,
) -> Result<(), RecordError> {
    let runs = kept_runs(dir);
    let Ok(entries) = fs::read_dir(&runs) else { return Ok(()) };
    for entry in entries.flatten() {
        let name = entry.file_name();
        let name = name.to_string_lossy();
        if is_own(&name) {
            // A program that was killed had a whole run here. That a file stays does no harm to it.
            let _ = forget_progress(&entry.path());
        }
        // As in `.setting-0-seed-1.partial-4711`.
        let of_trial = name.strip_prefix('.').and_then(|name| name.split('.').next());
        if of_trial.is_some_and(&is_own) {
            let path = entry.path();
            let removed = if path.is_dir() {
                system::remove_dir_all(&path)
            } else {
                system::remove_file(&path)
            };
            removed.map_err(|source| RecordError::Write { path, source })?;
        }
    }
    Ok(())
}

/// Writes everything that is made of all trials. Returns the summary, and what to tell.
pub(super) fn write(
    dir: &Path,
    done: &FinishedSweep<'_>,
) -> Result<(SweepSummary, String), RecordError> {
    let FinishedSweep { plan, rows, .. } = done;
    let columns = table::columns(plan, rows);
    let partial = dir.join(format!(".{TABLE_FILE}"));
    // Of a program that was killed.
    let _ = system::remove_file(&partial);
    table::write(&partial, &columns)?;
    rename(&partial, &dir.join(TABLE_FILE))?;
    let (shown, mut warnings) = shown(plan, &columns);
    let has_formed: Vec<bool> = rows.values().map(TrialRow::has_formed).collect();
    let unformed = not_formed(plan, rows);
    let thrashing = thrashing(plan, rows);
    warnings.extend(unformed.iter().chain(&thrashing).cloned());
    let failed = failed(plan, rows);
    warnings.extend(failed);
    let figures: Vec<SettingFigures<'_>> =
        shown.iter().map(|column| SettingFigures::from_trials(plan, column, &has_formed)).collect();
    let summary = summary(done, &figures, warnings);
    write_whole(dir, SweepSummary::FILE, pretty(&summary).as_bytes())?;
    let page = report::page(plan, &figures, &summary);
    write_whole(dir, "report.html", page.as_bytes())?;
    let mut provenance = provenance(done);
    for name in ["sweep.toml", TABLE_FILE, SweepSummary::FILE, "report.html"] {
        let path = dir.join(name);
        let found = fingerprint(&path).map_err(|source| RecordError::Write { path, source })?;
        provenance["files"][name] = json!(found);
    }
    write_whole(dir, PROVENANCE_FILE, pretty(&provenance).as_bytes())?;
    let mut told = text(plan, &figures);
    for warning in unformed.into_iter().chain(thrashing) {
        let _ = write!(told, "\nwarning: {warning}");
    }
    Ok((summary, told))
}

/// Different reasons of failures that a warning quotes.
const MOST_REASONS: usize = 3;

/// That some trials failed, and why, equal reasons together; none: none did.
fn failed(plan: &SweepPlan, rows: &BTreeMap<SweepTrial, TrialRow>) -> Option<String> {
    let mut by_reason: Vec<(&str, Vec<SweepTrial>)> = Vec::new();
    for (trial, row) in rows.iter().filter(|(_, row)| row.has_failed()) {
        let reason = row.reason.as_deref().unwrap_or_default();
        match by_reason.iter_mut().find(|(earlier, _)| *earlier == reason) {
            Some((_, trials)) => trials.push(*trial),
            None => by_reason.push((reason, vec![*trial])),
        }
    }
    if by_reason.is_empty() {
        return None;
    }
    let mut text = format!(
        "{} of {} trials failed and have no figures; {TABLE_FILE} says why in column {}",
        by_reason.iter().map(|(_, trials)| trials.len()).sum::<usize>(),
        rows.len(),
        table::ERROR,
    );
    by_reason.sort_by_key(|(_, trials)| std::cmp::Reverse(trials.len()));
    for (reason, trials) in by_reason.iter().take(MOST_REASONS) {
        let name = plan.trial_name(trials[0]);
        let _ = match trials.len() {
            1 => write!(text, "\n{name}: {reason}"),
            n => write!(text, "\n{n} trials, {name} the first of them: {reason}"),
        };
    }
    let n_others = by_reason.len().saturating_sub(MOST_REASONS);
    if 0 < n_others {
        let _ = write!(text, "\nand {n_others} other reasons");
    }
    Some(text)
}

/// Which settings have trials whose network did not form; none: all have formed.
fn not_formed(plan: &SweepPlan, rows: &BTreeMap<SweepTrial, TrialRow>) -> Option<String> {
    let (n, named) = by_setting(plan, rows, |row| !row.has_formed() && !row.has_failed())?;
    Some(format!(
        "in {n} of {} trials the network did not form in time, and robots that wait for it never started: {named}. \
         Their figures are left out here; {TABLE_FILE} has them, {} why",
        rows.len(),
        super::JOURNAL_FILE
    ))
}

/// Which settings have trials whose robots thrash; none: there are none.
fn thrashing(plan: &SweepPlan, rows: &BTreeMap<SweepTrial, TrialRow>) -> Option<String> {
    let thrashes =
        |row: &TrialRow| row.values.get(THRASHING_PATH) == Some(&Some(FigureValue::Flag(true)));
    let (n, named) = by_setting(plan, rows, |row| row.has_formed() && thrashes(row))?;
    Some(format!(
        "in {n} of {} trials the robots thrash, each much faster than the flock gets on: {named}. \
         Figures of speed count oscillation there; task.leader_speed_ratio does not",
        rows.len()
    ))
}

/// How many trials are such, and of which settings: named with their numbers of trials. `None`: none is.
fn by_setting(
    plan: &SweepPlan,
    rows: &BTreeMap<SweepTrial, TrialRow>,
    is_such: impl Fn(&TrialRow) -> bool,
) -> Option<(usize, String)> {
    const MOST_NAMED: usize = 5;
    let such: Vec<bool> = rows.values().map(is_such).collect();
    let n_seeds = plan.seeds.len();
    let counts = such.chunks(n_seeds).map(|own| own.iter().filter(|is_such| **is_such).count());
    let settings: Vec<String> = plan
        .settings
        .iter()
        .zip(counts)
        .filter(|(_, n)| 0 < *n)
        .map(|(setting, n)| format!("{n} of {n_seeds} of {}", setting.describe()))
        .collect();
    if settings.is_empty() {
        return None;
    }
    let more = settings.len().saturating_sub(MOST_NAMED);
    let mut named = settings[..settings.len() - more].join("; ");
    if 0 < more {
        named.push_str(&format!("; and of {more} more settings"));
    }
    Some((such.iter().filter(|is_such| **is_such).count(), named))
}

/// The columns that the report shows.
fn shown<'a>(plan: &SweepPlan, columns: &'a [TableColumn]) -> (Vec<&'a TableColumn>, Vec<String>) {
    let first_figure = columns
        .iter()
        .rposition(|column| [table::STATUS, table::ERROR].contains(&&*column.name))
        .map_or(0, |i| i + 1);
    let figures = &columns[first_figure..];
    let mut warnings = Vec::new();
    let shown = match &plan.sweep.metrics {
        Some(names) => names
            .iter()
            .filter_map(|name| {
                let found = figures.iter().find(|column| column.name == *name);
                // Without protocols the plan says so before anything runs.
                let is_said = plan.is_without_protocols && metric_names::is_of_protocols(name);
                if found.is_none() && !is_said {
                    warnings.push(format!(
                        "sweep.metrics: no trial has a figure {name}{}",
                        when_null(name)
                    ));
                }
                found
            })
            .collect(),
        None => {
            let leading = plan.leading_figures();
            let place = |name: &str| leading.iter().position(|leading| *leading == name);
            let is_shown = |column: &&TableColumn| {
                let name = column.name.as_str();
                name.starts_with("task.") || OF_DELIVERY.contains(&name) || place(name).is_some()
            };
            let mut shown: Vec<&TableColumn> =
                figures.iter().filter(is_shown).filter(|column| differs(column)).collect();
            shown.sort_by_key(|column| place(&column.name).unwrap_or(leading.len()));
            shown
        }
    };
    (shown, warnings)
}

/// When a figure is null or absent.
fn when_null(name: &str) -> String {
    let found = metric::find(name, Robots::Foreign);
    let reasons = found.map(|metric| metric.null_if).unwrap_or_default();
    if reasons.is_empty() {
        return String::new();
    }
    format!("; it is null if {}", reasons.join(", or if "))
}

/// Whether a figure is not the same in all trials, but for what rounding does.
fn differs(column: &TableColumn) -> bool {
    let [low, high] = range(column.numbers().into_iter().flatten());
    1e-9 * low.abs().max(high.abs()) < high - low
}

/// What is shown of the network where nobody says what.
const OF_DELIVERY: [&str; 6] = [
    "network.delivery_ratio",
    "network.mean_neighbours_heard",
    "network.mean_delay_s",
    "kpis.formation.formed_s",
    "kpis.delivery.ratio",
    "kpis.delivery.latency_s.median",
];

fn summary(
    done: &FinishedSweep<'_>,
    figures: &[SettingFigures<'_>],
    warnings: Vec<String>,
) -> SweepSummary {
    let FinishedSweep { plan, rows, .. } = done;
    let settings = plan.settings.iter().enumerate().map(|(number, setting)| {
        let rows = || rows.iter().filter(|(trial, _)| trial.setting == number).map(|(_, row)| row);
        let metrics = figures.iter().map(|figures| {
            let (n, spread) = (figures.values[number].len(), figures.spreads[number]);
            (figures.column.name.clone(), MetricSummary { n, spread })
        });
        SettingSummary {
            setting: number,
            case: setting.case.clone(),
            values: setting
                .values
                .iter()
                .map(|(key, node)| (key.clone(), node.to_toml()))
                .collect(),
            not_formed: rows().filter(|row| !row.has_formed() && !row.has_failed()).count(),
            failed: rows().filter(|row| row.has_failed()).count(),
            metrics: metrics.collect(),
        }
    });
    SweepSummary {
        schema: SCHEMA.to_owned(),
        name: plan.name.clone(),
        trials: plan.n_trials(),
        seeds: plan.seeds.clone(),
        settings: settings.collect(),
        warnings: plan.warnings.iter().cloned().chain(warnings).collect(),
    }
}

fn provenance(done: &FinishedSweep<'_>) -> Value {
    let FinishedSweep { plan, rows, jobs, n_now, n_starts, wall_s } = done;
    let mut programs: Vec<&str> = rows.values().map(|row| row.program.as_str()).collect();
    programs.sort_unstable();
    programs.dedup();
    json!({
        "schema": "sweep-provenance/1",
        "orchestrator": { "version": env!("CARGO_PKG_VERSION") },
        "programs": programs,
        "command_line": std::env::args().collect::<Vec<_>>(),
        "config_file": plan.path,
        "cores": proto_host::cores(),
        "jobs": jobs,
        "trials_now": n_now,
        "simulator_pairs_started": n_starts,
        "wall_s": wall_s,
        "trials_wall_s": rows.values().map(|row| row.wall_s).sum::<f64>(),
    })
}

/// The settings and their first figures, for the terminal.
fn text(plan: &SweepPlan, figures: &[SettingFigures<'_>]) -> String {
    const MOST_FIGURES: usize = 4;
    const MOST_SETTINGS: usize = 60;
    let figures = &figures[..figures.len().min(MOST_FIGURES)];
    let headings = figures.iter().map(|figures| figures.column.name.clone());
    let mut table = TextTable::new(std::iter::once("setting".to_owned()).chain(headings));
    for (number, setting) in plan.settings.iter().take(MOST_SETTINGS).enumerate() {
        let cells = figures.iter().map(|figures| cell(figures, number));
        table.row(std::iter::once(setting.describe()).chain(cells));
    }
    let mut text = table.text().trim_end().to_owned();
    if MOST_SETTINGS < plan.settings.len() {
        let _ = write!(text, "\n… and {} more settings", plan.settings.len() - MOST_SETTINGS);
    }
    text
}

fn cell(figures: &SettingFigures<'_>, setting: usize) -> String {
    let Some(spread) = &figures.spreads[setting] else { return "-".to_owned() };
    let n = figures.values[setting].len();
    if figures.is_share() {
        return format!("{} of {n}", libm::round(spread.mean * n as f64));
    }
    let Some(interval) = spread.interval else {
        return format!("{} [n {n}]", number(spread.median));
    };
    let [median, low, high] = interval.short_digits(spread.median);
    // What is not said to be a range is the 95 % interval.
    let range = match interval.kind {
        IntervalKind::Bootstrap95 => String::new(),
        IntervalKind::Range => format!(" {}", interval.words(n)),
    };
    format!("{median} [{low} … {high}]{range}")
}

fn write_whole(dir: &Path, name: &str, content: &[u8]) -> Result<(), RecordError> {
    let partial = dir.join(format!(".{name}"));
    system::write(&partial, content)
        .map_err(|source| RecordError::Write { path: partial.clone(), source })?;
    rename(&partial, &dir.join(name))
}

fn rename(from: &Path, to: &Path) -> Result<(), RecordError> {
    system::rename(from, to).map_err(|source| RecordError::Rename {
        from: from.to_owned(),
        to: to.to_owned(),
        source,
    })
}
