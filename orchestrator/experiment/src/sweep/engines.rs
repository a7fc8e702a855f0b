//! `[sweep.slurm]` and `[sweep.hyperqueue]`: what a sweep asks of a batch system.
//!
//! Nothing here changes a result. Texts end up in a job script, so none may hold a control character.

use proto::config::{ClusterLine, Problem, Section, Touch, TouchTarget};

/// What `murmuration sweep --engine slurm` asks of Slurm for each task of its job array. Absent keys are left to the defaults of the
/// cluster.
#[derive(Clone, Debug, PartialEq, Eq, Section)]
pub struct SlurmOptions {
    /// Partition, or several separated by commas (sbatch --partition).
    pub partition: Option<String>,
    /// Account that is charged (sbatch --account).
    pub account: Option<String>,
    /// Quality of service (sbatch --qos).
    pub qos: Option<String>,
    /// Time limit of a task (min). A shard that exceeds it is submitted again and resumes from its journal.
    #[key(range = 1..=527_040)]
    pub time_limit_min: Option<u32>,
    /// Memory of a task (MiB, sbatch --mem).
    #[key(range = 1..=1 << 30)]
    pub memory_mib: Option<u32>,
    /// CPUs of a task: so many trials of a shard run at the same time.
    #[key(range = 1..=65_536, default = 1)]
    pub cpus_per_task: u32,
    /// Maximum number of tasks at the same time (sbatch --array=…%N). Absent: no limit.
    #[key(range = 1..=1_000_000)]
    pub max_running: Option<u32>,
    /// How often a shard whose task was lost is submitted again: after a failed node, a time limit, or a killed process. The sweep ends
    /// with an error when a shard is lost once more.
    #[key(range = 0..=1000, default = 5)]
    pub max_resubmissions: u32,
    /// Further options of sbatch, each as "--name" or "--name=value", such as "--constraint=avx2".
    #[key(length = 1..=100)]
    pub options: Vec<ClusterLine>,
    /// Environment modules that each task loads first, in this order (module load).
    #[key(length = 1..=100)]
    pub modules: Vec<ClusterLine>,
    /// Lines of bash that each task runs before its shard, as they are.
    #[key(length = 1..=100)]
    pub commands: Vec<ClusterLine>,
}

/// What `murmuration sweep --engine hyperqueue` asks of HyperQueue for each task of its task array.
#[derive(Clone, Debug, PartialEq, Eq, Section)]
pub struct HyperQueueOptions {
    /// As for Slurm.
    #[key(field = SlurmOptions::SPEC.field("time_limit_min"))]
    pub time_limit_min: Option<u32>,
    /// As for Slurm.
    #[key(field = SlurmOptions::SPEC.field("cpus_per_task"))]
    pub cpus_per_task: u32,
    /// As for Slurm.
    #[key(field = SlurmOptions::SPEC.field("commands"))]
    pub commands: Vec<ClusterLine>,
}

/// Options of sbatch that the program sets, and what to use instead.
const RESERVED: [(&str, &str); 17] = [
    ("--account", "the key account"),
    ("--array", "the option --shards, and the key max_running"),
    ("--chdir", "the folder in which you run this command"),
    ("--cpus-per-task", "the key cpus_per_task"),
    ("--error", "the log of each task in cluster/, beside the journals"),
    ("--job-name", "experiment.name"),
    ("--mem", "the key memory_mib"),
    ("--nodes", "one task per shard, on one node"),
    ("--no-requeue", "the key max_resubmissions"),
    ("--ntasks", "one task per shard"),
    ("--output", "the log of each task in cluster/, beside the journals"),
    ("--parsable", "nothing: the program reads the number of the job"),
    ("--partition", "the key partition"),
    ("--qos", "the key qos"),
    ("--requeue", "the key max_resubmissions"),
    ("--time", "the key time_limit_min"),
    ("--wrap", "the key commands"),
];

/// Checks that whatever ends up in a script is one line of it.
pub(super) fn check_lines(touches: &[Touch], slurm: &SlurmOptions, problems: &mut Vec<Problem>) {
    let names = [("partition", &slurm.partition), ("account", &slurm.account), ("qos", &slurm.qos)];
    let names = names
        .into_iter()
        .filter_map(|(key, name)| Some((format!("sweep.slurm.{key}"), name.as_ref()?)));
    let lines = touches.iter().filter_map(|touch| match &touch.target {
        TouchTarget::ClusterLine(ClusterLine(line)) => Some((touch.key.clone(), line)),
        _ => None,
    });
    for (key, line) in names.chain(lines) {
        if line.chars().any(|c| c.is_control() && c != '\t') {
            let message = "must be one line without control characters";
            problems.push(Problem::new(key, message).value(format!("{line:?}")));
        }
    }
}

/// Checks `sweep.slurm.options`.
pub(super) fn check_options(options: &[ClusterLine], problems: &mut Vec<Problem>) {
    for (index, ClusterLine(option)) in options.iter().enumerate() {
        check_option(option, &format!("sweep.slurm.options[{index}]"), problems);
    }
}

fn check_option(text: &str, path: &str, problems: &mut Vec<Problem>) {
    let name = text.split('=').next().unwrap_or_default();
    let is_name = name.strip_prefix("--").is_some_and(|word| {
        word.starts_with(|c: char| c.is_ascii_alphabetic())
            && word.chars().all(|c| c.is_ascii_alphanumeric() || c == '-')
    });
    if !is_name {
        let message = "must be an option of sbatch, as \"--name\" or \"--name=value\"";
        problems.push(Problem::new(path, message).value(format!("{text:?}")));
    } else if let Some((_, instead)) = RESERVED.iter().find(|(reserved, _)| *reserved == name) {
        let message = format!("is set by {} sweep; use {instead}", crate::program_name());
        problems.push(Problem::new(path, message).value(format!("{text:?}")));
    }
}
