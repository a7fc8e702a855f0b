//! What the trials of a sweep would take, without running them.

use super::journal;
use super::plan::{self, Machines, SweepTrial};
use super::shard::Shard;
use super::{SweepError, SweepOptions, jobs, least_bytes, selected};
use run::RunError;
use run::dry_run::DryRun;
use std::collections::BTreeSet;

/// What a line of the journal takes (bytes).
const JOURNAL_LINE_BYTES: u64 = 4000;

/// Estimates the time and space of the trials of a sweep, or of one shard of it, that have not been run.
///
/// # Errors
///
/// The sweep cannot be run, or its longest trial fails in its first steps.
pub async fn dry_run(options: &SweepOptions, shard: Option<Shard>) -> Result<DryRun, SweepError> {
    let plan = plan::load(&options.config, &options.overrides, Machines::This)?;
    let jobs = jobs(options, &plan)?;
    let (trials, journal_name) = selected(&plan, shard)?;
    let done = if options.restart {
        BTreeSet::new()
    } else {
        journal::keys(&options.out.join(&plan.name).join(journal_name))
    };
    let trials: Vec<SweepTrial> =
        trials.into_iter().filter(|trial| !done.contains(&plan.key(*trial))).collect();
    // The longest trial is measured, the others are taken to be shorter in proportion.
    let longest = trials.iter().copied().max_by(|&a, &b| plan.effort(a).total_cmp(&plan.effort(b)));
    let longest = longest.or_else(|| plan.trials().next());
    let Some(longest) = longest else { unreachable!("a sweep has a setting and a seed") };
    let failed = |error: RunError| SweepError::Run {
        trial: plan.trial_name(longest),
        error: Box::new(error),
    };
    let trial = plan.plan(longest)?;
    let dry = DryRun::of_run(&trial, &options.start, &options.out).await.map_err(failed)?;
    let share = |trial: SweepTrial| plan.effort(trial) / plan.effort(longest);
    let shares: f64 = trials.iter().map(|&trial| share(trial)).sum();
    let kept: Vec<SweepTrial> = trials.iter().copied().filter(|&t| plan.keeps(t)).collect();
    let kept_shares: f64 = kept.iter().map(|&trial| share(trial)).sum();
    let n_trials = trials.len() as u64;
    let lines = JOURNAL_LINE_BYTES.saturating_mul(n_trials);
    let n_jobs = jobs.min(trials.len().max(1)) as u64;
    let mut dry = DryRun {
        name: plan.name.clone(),
        trials: n_trials,
        wall_s: dry.wall_s.filter(|_| n_trials != 0).map(|wall_s| wall_s * shares / n_jobs as f64),
        memory_bytes: dry.memory_bytes.map(|bytes| bytes.saturating_mul(n_jobs)),
        disk_bytes: dry.disk_bytes.map(|bytes| (bytes as f64 * kept_shares) as u64 + lines),
        least_disk_bytes: least_bytes(&plan, &trials)?,
        folder: options.out.join(&plan.name).display().to_string(),
        basis: format!(
            "of its longest trial, {}, {}; shorter trials in proportion, {n_jobs} at a time",
            plan.trial_name(longest),
            dry.basis
        ),
        warnings: plan.warnings.clone(),
        ..dry
    };
    dry.check_space();
    Ok(dry)
}
