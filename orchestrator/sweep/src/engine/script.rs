//! The job script of a task array: each task runs one shard.

use crate::plan::SweepPlan;
use proto::config::ClusterLine;
use std::fmt::Write as _;
use std::path::Path;

/// What a script runs.
pub(crate) struct ShardScript<'a> {
    /// Name of the engine.
    pub(super) engine: &'static str,
    /// The sweep.
    pub(super) plan: &'a SweepPlan,
    /// The shards, in order, at least one.
    pub(super) shards: &'a [u32],
    /// Number of shards of the sweep.
    pub(super) n_shards: u32,
    /// Where the command was given, and where paths begin.
    pub(super) working_folder: &'a Path,
    /// Where each task writes its log; absolute, or from the working folder.
    pub(super) log_folder: &'a Path,
    /// The program.
    pub(super) executable: &'a Path,
    /// Its arguments without those that choose what to run, quoted for a shell.
    pub(super) arguments: &'a [String],
    /// Trials at the same time; `None`: one per core of the task.
    pub(super) jobs: Option<usize>,
    /// Threads per simulator.
    pub(super) threads: u16,
}

/// How long a shard waits for its journal (s), if another process holds it: the lock of a machine that failed is stale after two
/// minutes.
const LOCK_WAIT_S: u32 = 300;

impl ShardScript<'_> {
    /// Name of the job.
    pub(super) fn job_name(&self) -> String {
        format!("murmuration-{}", self.plan.name)
    }

    /// The shards as Slurm and HyperQueue take them: `1-3,7`.
    pub(super) fn ranges(&self) -> String {
        let mut ranges: Vec<(u32, u32)> = Vec::new();
        for &shard in self.shards {
            match ranges.last_mut() {
                Some((_, end)) if *end + 1 == shard => *end = shard,
                _ => ranges.push((shard, shard)),
            }
        }
        let words = ranges.iter().map(|(first, last)| {
            if first == last { first.to_string() } else { format!("{first}-{last}") }
        });
        words.collect::<Vec<_>>().join(",")
    }

    /// What follows the directives. `job` and `task`: variables that hold the number of the job and of the shard. `setup`: lines
    /// that are run first.
    pub(super) fn body(&self, job: &str, task: &str, setup: &[ClusterLine]) -> String {
        let folder = quoted_path(self.working_folder);
        let logs = quoted_path(self.log_folder);
        let mut text = format!(
            "\ncd -- {folder} || exit\n\
             mkdir -p -- {logs} || exit\n\
             exec >>{logs}/{}-\"${job}-${task}.log\" 2>&1 </dev/null\n",
            self.engine
        );
        for ClusterLine(line) in setup {
            let _ = writeln!(text, "{line}");
        }
        let jobs = self.jobs.map(|jobs| format!(" --jobs {jobs}")).unwrap_or_default();
        let _ = writeln!(
            text,
            "exec {} {} --threads {}{jobs} --wait-for-lock {LOCK_WAIT_S} --shard \"${task}/{}\"",
            quoted_path(self.executable),
            self.arguments.join(" "),
            self.threads,
            self.n_shards
        );
        text
    }
}

/// A path for a shell, so that no command takes it for an option.
fn quoted_path(path: &Path) -> String {
    let text = path.to_string_lossy();
    if text.starts_with('-') { quoted(&format!("./{text}")) } else { quoted(&text) }
}

/// A word for a shell, in quotation marks where it needs them.
pub fn quoted(word: &str) -> String {
    let is_plain = |c: char| c.is_ascii_alphanumeric() || "-_./=:,+@%".contains(c);
    if !word.is_empty() && word.chars().all(is_plain) {
        word.to_owned()
    } else {
        format!("'{}'", word.replace('\'', "'\\''"))
    }
}
