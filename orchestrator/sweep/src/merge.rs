//! Merges the journals of all shards of a sweep, and writes what one machine that runs the whole sweep would.

use super::journal::{self, Journal, TrialRow};
use super::plan::{self, Machines, SweepPlan, SweepTrial};
use super::results::{self, FinishedSweep};
use super::shard::{self, Shard, ShardError};
use super::{JOURNAL_FILE, SweepError, SweepOptions, SweepReport};
use experiment::Acts;
use numbers::format::count_of;
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// A sweep whose shards were merged.
#[derive(Debug)]
pub struct MergeReport {
    /// The sweep.
    pub sweep: SweepReport,
    /// Number of shards.
    pub n_shards: u32,
    /// Shards that have trials that failed, in order.
    pub failed_shards: Vec<Shard>,
}

/// A message lists at most so many shards that lack trials.
const MOST_LISTED: usize = 20;

/// A row, and the journal that it stands in.
type Found = (TrialRow, PathBuf);

/// Merges all shards of a sweep. Runs no trial.
///
/// # Errors
///
/// Trials are missing, or journals disagree or belong to another sweep; see [`SweepError`].
pub fn merge(options: &SweepOptions) -> Result<MergeReport, SweepError> {
    let begun = Instant::now();
    let plan = plan::load(&options.config, &options.overrides.acting(Acts::Reads), Machines::This)?;
    terminal::warn_all(&plan.warnings);
    let dir = options.out.join(&plan.name);
    let shards = shard::shards_in(&dir)?;
    let Some(n_shards) = shards.first().map(|shard| shard.count()) else {
        return Err(ShardError::NoShards { dir, command: options.command() }.into());
    };
    let found = read_all(&plan, &dir, &shards)?;
    let owners = shard::owners(&plan, n_shards);
    if let Some(missing) = missing(&plan, &dir, &shards, &owners, &found, &options.command()) {
        return Err(ShardError::Missing(missing).into());
    }
    let (mut journal, known) = Journal::open(&dir, JOURNAL_FILE, false)?;
    terminal::warn_all(&known.warnings);
    // A later sweep without shards resumes from the journal of the whole sweep, so that it gets all rows.
    let mut rows: BTreeMap<SweepTrial, TrialRow> = BTreeMap::new();
    let mut new_rows = Vec::new();
    for trial in plan.trials() {
        let key = plan.key(trial);
        let Some((row, path)) = found.get(&key) else { continue };
        let row = match known.rows.get(&key).filter(|known| !known.has_failed()) {
            Some(known) if row.has_failed() || known.has_same_result(row) => known,
            Some(_) => {
                let (trial, a, b) = (plan.trial_name(trial), path.clone(), dir.join(JOURNAL_FILE));
                return Err(ShardError::Conflict { trial, a, b }.into());
            }
            None => {
                new_rows.push(row);
                row
            }
        };
        rows.insert(trial, row.clone());
    }
    system::point("in a merge");
    journal.add_all(new_rows.into_iter())?;
    warn_of_programs(&rows);
    results::write_config(&dir, &plan)?;
    let log = &options.start.run_log;
    log.open(&dir)?;
    let wall_s = begun.elapsed().as_secs_f64();
    let done = FinishedSweep { plan: &plan, rows: &rows, jobs: 0, n_now: 0, n_starts: 0, wall_s };
    let (summary, text) = results::write(&dir, &done)?;
    let n_trials = plan.n_trials();
    let failures = || rows.iter().filter(|(_, row)| row.has_failed());
    let failed: Vec<(String, String)> = failures()
        .map(|(trial, row)| (plan.trial_name(*trial), row.reason.clone().unwrap_or_default()))
        .collect();
    let failed_shards: BTreeSet<Shard> =
        failures().filter_map(|(trial, _)| owners.get(trial)).copied().collect();
    log.end(&format!("{n_trials} trials of {n_shards} shards merged, {} failed", failed.len()));
    let (n_before, n_starts) = (n_trials, 0);
    let sweep = SweepReport { dir, summary, text, n_trials, n_before, failed, n_starts, wall_s };
    Ok(MergeReport { sweep, n_shards, failed_shards: failed_shards.into_iter().collect() })
}

/// Reads the journals of all shards: the rows by key. Of a trial that failed and was run again, the row that did not fail.
fn read_all(
    plan: &SweepPlan,
    dir: &Path,
    shards: &[Shard],
) -> Result<BTreeMap<String, Found>, SweepError> {
    let names: BTreeMap<String, SweepTrial> =
        plan.trials().map(|trial| (plan.key(trial), trial)).collect();
    let mut found: BTreeMap<String, Found> = BTreeMap::new();
    for shard in shards {
        let path = dir.join(shard.journal_name());
        let (rows, warnings) = journal::read_rows(&path)?;
        terminal::warn_all(warnings);
        let keys = rows.iter().map(|row| row.key.as_str());
        check_keys(&path, keys, |key| names.contains_key(key))?;
        for row in rows {
            if let Some((known, other)) = found.get(&row.key).filter(|(row, _)| !row.has_failed()) {
                if row.has_failed() || known.has_same_result(&row) {
                    continue;
                }
                let trial = names.get(&row.key).map(|trial| plan.trial_name(*trial));
                let (trial, a, b) = (trial.unwrap_or_default(), other.clone(), path);
                return Err(ShardError::Conflict { trial, a, b }.into());
            }
            found.insert(row.key.clone(), (row, path.clone()));
        }
    }
    Ok(found)
}

/// Refuses the journal of a shard, `path`, if it has keys that are not among those of the sweep.
///
/// # Errors
///
/// It has.
fn check_keys<'a>(
    path: &Path,
    keys: impl Iterator<Item = &'a str>,
    is_of_sweep: impl Fn(&str) -> bool,
) -> Result<(), ShardError> {
    let keys: BTreeSet<&str> = keys.collect();
    let n_foreign = keys.iter().filter(|key| !is_of_sweep(key)).count();
    match n_foreign {
        0 => Ok(()),
        _ => Err(ShardError::AnotherSweep { path: path.to_owned(), n_foreign, n: keys.len() }),
    }
}

/// Refuses the journal of a shard, `path`, if it has trials of another sweep.
///
/// # Errors
///
/// It has.
pub(super) fn check_journal(
    plan: &SweepPlan,
    path: &Path,
    rows: &BTreeMap<String, TrialRow>,
) -> Result<(), ShardError> {
    let of_sweep: BTreeSet<String> = plan.trials().map(|trial| plan.key(trial)).collect();
    check_keys(path, rows.keys().map(String::as_str), |key| of_sweep.contains(key))
}

/// What a shard lacks.
#[derive(Default)]
struct Lack {
    /// Number of its trials.
    n: u64,
    /// Trials that no journal has.
    n_trials: u64,
    /// Trials that have a row, but not the recording that `sweep.keep` asks for.
    n_recordings: u64,
}

/// Which trials are missing of which shards, and the commands that run them; none: nothing is missing.
fn missing(
    plan: &SweepPlan,
    dir: &Path,
    shards: &[Shard],
    owners: &BTreeMap<SweepTrial, Shard>,
    found: &BTreeMap<String, Found>,
    command: &str,
) -> Option<String> {
    let mut lacks: BTreeMap<Shard, Lack> = BTreeMap::new();
    for (&trial, &shard) in owners {
        let lack = lacks.entry(shard).or_default();
        lack.n += 1;
        match found.get(&plan.key(trial)) {
            None => lack.n_trials += 1,
            Some((row, _)) if !row.has_failed() && plan.keeps(trial) => {
                lack.n_recordings += u64::from(!results::is_kept(dir, plan, trial, row));
            }
            Some(_) => {}
        }
    }
    lacks.retain(|_, lack| lack.n_trials + lack.n_recordings != 0);
    if lacks.is_empty() {
        return None;
    }
    let n_trials: u64 = lacks.values().map(|lack| lack.n_trials).sum();
    let n_recordings: u64 = lacks.values().map(|lack| lack.n_recordings).sum();
    let all = count_of(plan.n_trials() as u64, "trial");
    let things: Vec<String> = [(n_trials, ""), (n_recordings, "the recordings of ")]
        .into_iter()
        .filter(|(n, _)| *n != 0)
        .map(|(n, what)| format!("{what}{n} of {all}"))
        .collect();
    let mut text = format!("{}: nothing was merged. Missing: {}", dir.display(), things.join(", "));
    for (shard, lack) in lacks.iter().take(MOST_LISTED) {
        let Lack { n, n_trials, n_recordings } = lack;
        let what = if !shards.contains(shard) {
            format!(
                "has no journal here and lacks {n_trials} of its {}; copy the journal, or",
                count_of(*n, "trial")
            )
        } else if *n_trials != 0 {
            format!("lacks {n_trials} of its {};", count_of(*n, "trial"))
        } else {
            format!(
                "lacks the recordings of {n_recordings} of its {}; copy their folders in runs/, or",
                count_of(*n, "trial")
            )
        };
        let _ = write!(text, "\n  shard {shard} {what} run {command} --shard {shard}");
    }
    if MOST_LISTED < lacks.len() {
        let _ = write!(text, "\n  and {} more shards", lacks.len() - MOST_LISTED);
    }
    Some(text)
}

/// Warns if programs of different code ran the trials.
fn warn_of_programs(rows: &BTreeMap<SweepTrial, TrialRow>) {
    let programs: BTreeSet<&str> = rows.values().map(|row| row.program.as_str()).collect();
    if 1 < programs.len() {
        terminal::warn(format!(
            "programs with {} versions of the code ran the trials; their results may differ for that reason",
            programs.len()
        ));
    }
}
