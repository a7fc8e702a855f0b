//! `[sweep.slurm]` and `[sweep.hyperqueue]`: what a sweep asks of a batch system.
//!
//! Nothing here changes a result. Texts end up in a job script, so none may hold a control character.

use proto::config::{Default, Field, Kind, Problem, TableSpec, join};
use serde::Deserialize;

/// Description of `[sweep.slurm]`.
pub(super) const SLURM: TableSpec = TableSpec {
    doc: "What `murmuration sweep --engine slurm` asks of Slurm for each task of its job array. Absent keys are left to the \
          defaults of the cluster.",
    fields: &[
        Field {
            key: "partition",
            doc: "Partition, or several separated by commas (sbatch --partition).",
            kind: Kind::Text,
            default: Default::Absent,
        },
        Field {
            key: "account",
            doc: "Account that is charged (sbatch --account).",
            kind: Kind::Text,
            default: Default::Absent,
        },
        Field {
            key: "qos",
            doc: "Quality of service (sbatch --qos).",
            kind: Kind::Text,
            default: Default::Absent,
        },
        TIME_LIMIT,
        Field {
            key: "memory_mib",
            doc: "Memory of a task (MiB, sbatch --mem).",
            kind: Kind::Integer { min: 1, max: 1 << 30 },
            default: Default::Absent,
        },
        CPUS,
        Field {
            key: "max_running",
            doc: "Maximum number of tasks at the same time (sbatch --array=…%N). Absent: no limit.",
            kind: Kind::Integer { min: 1, max: 1_000_000 },
            default: Default::Absent,
        },
        Field {
            key: "max_resubmissions",
            doc: "How often a shard whose task was lost is submitted again: after a failed node, a time limit, or a killed \
                  process. The sweep ends with an error when a shard is lost once more.",
            kind: Kind::Integer { min: 0, max: 1000 },
            default: Default::Integer(5),
        },
        Field {
            key: "options",
            doc: "Further options of sbatch, each as \"--name\" or \"--name=value\", such as \"--constraint=avx2\".",
            kind: TEXTS,
            default: Default::Absent,
        },
        Field {
            key: "modules",
            doc: "Environment modules that each task loads first, in this order (module load).",
            kind: TEXTS,
            default: Default::Absent,
        },
        COMMANDS,
    ],
    tag: None,
};

/// Description of `[sweep.hyperqueue]`.
pub(super) const HYPERQUEUE: TableSpec = TableSpec {
    doc: "What `murmuration sweep --engine hyperqueue` asks of HyperQueue for each task of its task array.",
    fields: &[TIME_LIMIT, CPUS, COMMANDS],
    tag: None,
};

const TEXTS: Kind = Kind::List { of: &Kind::Text, min: 1, max: 100 };

const TIME_LIMIT: Field = Field {
    key: "time_limit_min",
    doc: "Time limit of a task (min). A shard that exceeds it is submitted again and resumes from its journal.",
    kind: Kind::Integer { min: 1, max: 527_040 },
    default: Default::Absent,
};

const CPUS: Field = Field {
    key: "cpus_per_task",
    doc: "CPUs of a task: so many trials of a shard run at the same time.",
    kind: Kind::Integer { min: 1, max: 65_536 },
    default: Default::Integer(1),
};

const COMMANDS: Field = Field {
    key: "commands",
    doc: "Lines of bash that each task runs before its shard, as they are.",
    kind: TEXTS,
    default: Default::Absent,
};

/// What a sweep asks of Slurm.
#[derive(Clone, Debug, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SlurmOptions {
    /// Partition, or several separated by commas.
    pub partition: Option<String>,
    /// Account that is charged.
    pub account: Option<String>,
    /// Quality of service.
    pub qos: Option<String>,
    /// Time limit of a task (min).
    pub time_limit_min: Option<u32>,
    /// Memory of a task (MiB).
    pub memory_mib: Option<u32>,
    /// CPUs of a task.
    pub cpus_per_task: u32,
    /// Maximum number of tasks at the same time.
    pub max_running: Option<u32>,
    /// How often a lost shard is submitted again.
    pub max_resubmissions: u32,
    /// Further options of sbatch, each `--name` or `--name=value`.
    #[serde(default)]
    pub options: Vec<String>,
    /// Environment modules to load.
    #[serde(default)]
    pub modules: Vec<String>,
    /// Lines of bash that a task runs first.
    #[serde(default)]
    pub commands: Vec<String>,
}

/// What a sweep asks of HyperQueue.
#[derive(Clone, Debug, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct HyperQueueOptions {
    /// Time limit of a task (min).
    pub time_limit_min: Option<u32>,
    /// CPUs of a task.
    pub cpus_per_task: u32,
    /// Lines of bash that a task runs first.
    #[serde(default)]
    pub commands: Vec<String>,
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

/// Checks texts of the section at `path`, which end up in a script.
pub(super) fn check_texts(table: &toml::Table, path: &str, problems: &mut Vec<Problem>) {
    for (key, value) in table {
        let path = join(path, key);
        match value {
            toml::Value::String(text) => check_text(text, &path, problems),
            toml::Value::Array(texts) => {
                for (index, text) in texts.iter().enumerate() {
                    let Some(text) = text.as_str() else { continue };
                    let path = format!("{path}[{index}]");
                    check_text(text, &path, problems);
                    if key == "options" {
                        check_option(text, &path, problems);
                    }
                }
            }
            _ => {}
        }
    }
}

fn check_text(text: &str, path: &str, problems: &mut Vec<Problem>) {
    if text.chars().any(|c| c.is_control() && c != '\t') {
        let message = "must be one line without control characters";
        problems.push(Problem::new(path, message).value(format!("{text:?}")));
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
