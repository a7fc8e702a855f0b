//! HyperQueue: one task array, one task per shard. <https://it4innovations.github.io/hyperqueue/>
//!
//! Shards are submitted and not followed: HyperQueue itself starts the tasks of a lost worker again.

use super::command::{CommandError, job_number, output};
use super::script::ShardScript;
use super::{Engine, Queue};
use crate::plan::SweepPlan;
use std::fmt::Write as _;
use std::path::Path;

/// Runs shards as tasks of HyperQueue.
pub(super) struct HyperQueue;

impl Engine for HyperQueue {
    fn name(&self) -> &'static str {
        "hyperqueue"
    }

    fn title(&self) -> &'static str {
        "HyperQueue"
    }

    fn script(&self, job: &ShardScript<'_>) -> String {
        let options = &job.plan.sweep.hyperqueue;
        let mut text = format!(
            "#!/bin/bash\n#HQ --name={}\n#HQ --array={}\n#HQ --cpus={}\n",
            job.job_name(),
            job.ranges(),
            options.cpus_per_task
        );
        if let Some(minutes) = options.time_limit_min {
            let _ = writeln!(text, "#HQ --time-limit={minutes}m");
        }
        text.push_str("#HQ --stdout=none\n#HQ --stderr=none\n");
        // HyperQueue keeps no process to the cores of its task unless asked to.
        let jobs = job.jobs.unwrap_or(options.cpus_per_task as usize);
        let job = ShardScript { jobs: Some(jobs), ..*job };
        text + &job.body("HQ_JOB_ID", "HQ_TASK_ID", &options.commands)
    }

    fn submit(&self, script: &Path) -> Result<String, CommandError> {
        let script = script.to_string_lossy();
        let said = output("hq", &["--output-mode=quiet", "submit", &script], None)?;
        job_number("hq", &said, &said)
    }

    fn cancel_command(&self, jobs: &[String]) -> String {
        format!("hq job cancel {}", jobs.join(","))
    }

    fn wait_command(&self, job: &str) -> String {
        format!("hq job wait {job}")
    }

    fn queue(&self) -> Option<&dyn Queue> {
        None
    }

    fn max_resubmissions(&self, _: &SweepPlan) -> u32 {
        0
    }
}
