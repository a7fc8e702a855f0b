//! Slurm: one job array, one task per shard. <https://slurm.schedmd.com/job_array.html>
//!
//! Slurm does not requeue tasks of these jobs by itself (`--no-requeue`): a lost shard is submitted again by [`super::follow`], which
//! counts and names the losses.

use super::command::{CommandError, job_number, output};
use super::script::{ShardScript, quoted};
use super::stop::StopSignal;
use super::{Engine, Queue, Task, TaskState};
use crate::plan::SweepPlan;
use proto::config::ClusterLine;
use std::fmt::Write as _;
use std::path::Path;

/// Runs shards as tasks of Slurm.
pub(super) struct Slurm;

/// What squeue prints of a task: job, number in the array, state, reason, machines.
const SQUEUE_FORMAT: &str = "%F|%K|%T|%r|%N";
/// What sacct prints of a task.
const SACCT_FORMAT: &str = "JobID,State,ExitCode,NodeList";

impl Engine for Slurm {
    fn name(&self) -> &'static str {
        "slurm"
    }

    fn title(&self) -> &'static str {
        "Slurm"
    }

    fn script(&self, job: &ShardScript<'_>) -> String {
        let options = &job.plan.sweep.slurm;
        let mut text = format!(
            "#!/bin/bash\n#SBATCH --job-name={}\n#SBATCH --array={}",
            job.job_name(),
            job.ranges()
        );
        if let Some(most) = options.max_running {
            let _ = write!(text, "%{most}");
        }
        // Each task writes its log by itself: Slurm expands % and backslashes in names of files.
        let _ = writeln!(text, "\n#SBATCH --nodes=1\n#SBATCH --ntasks=1");
        let _ = writeln!(text, "#SBATCH --no-requeue\n#SBATCH --output=/dev/null");
        let _ = writeln!(text, "#SBATCH --cpus-per-task={}", options.cpus_per_task);
        let texts = [
            ("partition", &options.partition),
            ("account", &options.account),
            ("qos", &options.qos),
        ];
        for (name, value) in texts {
            if let Some(value) = value {
                let _ = writeln!(text, "#SBATCH --{name}={}", quoted_value(value));
            }
        }
        for (name, value) in [("time", options.time_limit_min), ("mem", options.memory_mib)] {
            if let Some(value) = value {
                let unit = if name == "mem" { "M" } else { "" };
                let _ = writeln!(text, "#SBATCH --{name}={value}{unit}");
            }
        }
        for ClusterLine(option) in &options.options {
            let _ = match option.split_once('=') {
                Some((name, value)) => writeln!(text, "#SBATCH {name}={}", quoted_value(value)),
                None => writeln!(text, "#SBATCH {option}"),
            };
        }
        let modules = options.modules.iter().map(|ClusterLine(module)| {
            ClusterLine(format!("module load {} || exit", quoted(module)))
        });
        let setup: Vec<ClusterLine> = modules.chain(options.commands.iter().cloned()).collect();
        text + &job.body("SLURM_ARRAY_JOB_ID", "SLURM_ARRAY_TASK_ID", &setup)
    }

    fn submit(&self, script: &Path) -> Result<String, CommandError> {
        let said = output("sbatch", &["--parsable", &script.to_string_lossy()], None)?;
        // `job`, or `job;cluster`.
        job_number("sbatch", &said, said.split(';').next().unwrap_or_default())
    }

    fn cancel_command(&self, jobs: &[String]) -> String {
        format!("scancel {}", jobs.join(" "))
    }

    fn wait_command(&self, job: &str) -> String {
        format!("squeue --jobs={job}")
    }

    fn queue(&self) -> Option<&dyn Queue> {
        Some(self)
    }

    fn max_resubmissions(&self, plan: &SweepPlan) -> u32 {
        plan.sweep.slurm.max_resubmissions
    }
}

impl Queue for Slurm {
    fn tasks(
        &self,
        wanted: &[(String, u32)],
        stop: &StopSignal,
    ) -> Result<Vec<Task>, CommandError> {
        let mut jobs: Vec<&str> = wanted.iter().map(|(job, _)| job.as_str()).collect();
        jobs.dedup();
        let jobs = format!("--jobs={}", jobs.join(","));
        // Tasks that ended stay for some minutes (MinJobAge).
        let arguments =
            ["--noheader", "--array", "--states=all", &jobs, &format!("--format={SQUEUE_FORMAT}")];
        let mut tasks = match output("squeue", &arguments, Some(stop)) {
            Ok(said) => read_all("squeue", &said, of_squeue)?,
            // All of them ended long ago.
            Err(CommandError::Failed { said, .. }) if said.contains("Invalid job id") => Vec::new(),
            Err(error) => return Err(error),
        };
        let is_known = |tasks: &[Task], (job, shard): &(String, u32)| {
            tasks.iter().any(|task| task.job == *job && task.shard == *shard)
        };
        if wanted.iter().any(|wanted| !is_known(&tasks, wanted)) {
            let arguments = [
                "--noheader",
                "--allocations",
                "--parsable2",
                &jobs,
                &format!("--format={SACCT_FORMAT}"),
            ];
            // A cluster without accounting has none; then nothing more is known.
            if let Ok(said) = output("sacct", &arguments, Some(stop)) {
                let of_accounting = read_all("sacct", &said, of_sacct)?;
                let new = |task: &Task| !is_known(&tasks, &(task.job.clone(), task.shard));
                let new: Vec<Task> = of_accounting.into_iter().filter(new).collect();
                tasks.extend(new);
            }
        }
        Ok(tasks)
    }
}

/// The value of an option in a script. sbatch takes a backslash before quotation marks and backslashes.
fn quoted_value(value: &str) -> String {
    format!("\"{}\"", value.replace('\\', "\\\\").replace('"', "\\\""))
}

/// Reads all lines. `read`: the task of a line, `Some(None)` if it is of none, `None` if it has another form.
fn read_all(
    program: &str,
    said: &str,
    read: fn(&str) -> Option<Option<Task>>,
) -> Result<Vec<Task>, CommandError> {
    let mut tasks = Vec::new();
    for line in said.lines().map(str::trim).filter(|line| !line.is_empty()) {
        let task = read(line).ok_or_else(|| CommandError::Output {
            program: program.to_owned(),
            text: line.to_owned(),
        })?;
        tasks.extend(task);
    }
    Ok(tasks)
}

fn of_squeue(line: &str) -> Option<Option<Task>> {
    let mut fields = line.splitn(5, '|');
    let (job, shard, state) = (fields.next()?, fields.next()?, fields.next()?);
    let (reason, machines) = (fields.next()?, fields.next()?);
    Some(Some(Task {
        job: job.to_owned(),
        shard: shard.parse().ok()?,
        state: state_of(state),
        words: words(state, reason, machines),
    }))
}

fn of_sacct(line: &str) -> Option<Option<Task>> {
    let mut fields = line.splitn(4, '|');
    let (id, state) = (fields.next()?, fields.next()?);
    let (exit, machines) = (fields.next()?, fields.next()?);
    // Tasks that were never started stand together, as in `12_[3-8]`; squeue knows them if they still wait.
    let (job, shard) = id.split_once('_')?;
    let Ok(shard) = shard.parse() else { return Some(None) };
    // `CANCELLED by 1000`
    let word = state.split(' ').next().unwrap_or_default();
    let reason = format!("exit code {exit}");
    let reason = if state_of(word) == TaskState::Lost || exit == "0:0" { "None" } else { &reason };
    Some(Some(Task {
        job: job.to_owned(),
        shard,
        state: state_of(word),
        words: words(state, reason, machines),
    }))
}

/// The job states of Slurm. <https://slurm.schedmd.com/job_state_codes.html>
fn state_of(name: &str) -> TaskState {
    match name {
        "PENDING" | "REQUEUED" | "REQUEUE_FED" | "REQUEUE_HOLD" | "SPECIAL_EXIT"
        | "RESV_DEL_HOLD" => TaskState::Pending,
        "COMPLETED" => TaskState::Ended { is_success: true },
        "FAILED" => TaskState::Ended { is_success: false },
        "CANCELLED" => TaskState::Cancelled,
        "BOOT_FAIL" | "DEADLINE" | "LAUNCH_FAILED" | "NODE_FAIL" | "OUT_OF_MEMORY"
        | "PREEMPTED" | "RECONFIG_FAIL" | "REVOKED" | "TIMEOUT" => TaskState::Lost,
        // CONFIGURING, RUNNING, COMPLETING, SUSPENDED, and what later versions add: it has not ended.
        _ => TaskState::Running,
    }
}

fn words(state: &str, reason: &str, machines: &str) -> String {
    let mut words = state.to_owned();
    if !reason.is_empty() && reason != "None" {
        let _ = write!(words, " ({reason})");
    }
    if !machines.is_empty() && machines != "None assigned" {
        let _ = write!(words, " on {machines}");
    }
    words
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tasks_are_read_from_what_squeue_and_sacct_print() {
        let task = |shard, state, words: &str| Task {
            job: "12".to_owned(),
            shard,
            state,
            words: words.to_owned(),
        };
        let said = "12|1|PENDING|Resources|\n12|2|RUNNING|None|n1\n12|3|NODE_FAIL|NodeDown|n2\n\
                    12|4|CANCELLED|None|\n12|5|COMPLETED|None|n1\n12|6|FAILED|NonZeroExitCode|n1\n";
        assert_eq!(
            read_all("squeue", said, of_squeue).unwrap(),
            [
                task(1, TaskState::Pending, "PENDING (Resources)"),
                task(2, TaskState::Running, "RUNNING on n1"),
                task(3, TaskState::Lost, "NODE_FAIL (NodeDown) on n2"),
                task(4, TaskState::Cancelled, "CANCELLED"),
                task(5, TaskState::Ended { is_success: true }, "COMPLETED on n1"),
                task(6, TaskState::Ended { is_success: false }, "FAILED (NonZeroExitCode) on n1"),
            ]
        );
        let said = "12_[7-9]|PENDING|0:0|None assigned\n12_1|CANCELLED by 1000|0:0|n1\n\
                    12_2|TIMEOUT|0:0|n1\n12_3|FAILED|2:0|n1\n";
        assert_eq!(
            read_all("sacct", said, of_sacct).unwrap(),
            [
                task(1, TaskState::Cancelled, "CANCELLED by 1000 on n1"),
                task(2, TaskState::Lost, "TIMEOUT on n1"),
                task(3, TaskState::Ended { is_success: false }, "FAILED (exit code 2:0) on n1"),
            ]
        );
        for said in ["12|1|RUNNING|None", "slurm_load_jobs error", "12|N/A|RUNNING|None|n1"] {
            assert!(read_all("squeue", said, of_squeue).is_err(), "{said}");
        }
    }

    #[test]
    fn values_of_options_are_quoted() {
        assert_eq!(quoted_value("a&b"), "\"a&b\"");
        assert_eq!(quoted_value("a\"b\\ #"), "\"a\\\"b\\\\ #\"");
    }
}
