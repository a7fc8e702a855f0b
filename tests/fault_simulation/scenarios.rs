//! What the simulated faults meet: small experiments and conversions, each a list of commands.

use crate::campaign::{Campaign, Layout};
use crate::repository;
use std::path::Path;

/// Commands that end with the same files whenever they are run.
pub(super) struct Scenario {
    /// Its name.
    pub(super) name: &'static str,
    /// Makes the files that the commands read, in the folder in which they run.
    pub(super) prepare: fn(&Path) -> std::io::Result<()>,
    /// The commands, one after the other.
    pub(super) commands: &'static [Command],
    /// What a user does after a command that failed.
    pub(super) repair: Repair,
    /// A command that makes all of it again.
    pub(super) again: &'static str,
}

/// A command, and whether a fault may happen to it.
pub(super) enum Command {
    /// A fault may happen to it.
    Meets(&'static str),
    /// It is carried out with this schedule, always: it prepares what follows.
    Prepares(&'static str, &'static str),
}

impl Command {
    /// Its arguments.
    pub(super) fn text(&self) -> &'static str {
        match self {
            Self::Meets(text) | Self::Prepares(_, text) => text,
        }
    }
}

/// What a user does after a command that failed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Repair {
    /// The same command again.
    Again,
    /// Resumes the run from the folder that it left, recovers it, or runs it again.
    Resume,
}

/// Arguments of all runs: a checkpoint after each step, and little patience.
pub(super) const RUN: &str = "--threads 1 --out runs --set experiment.checkpoint_every_s=1e-9 \
    --set experiment.reconnect_limit_s=0.2 --set experiment.step_deadline_s=2";

/// Four robots, for a moment.
const FLOCK: &str =
    "run CONFIGS/flocking.toml RUN --set experiment.agents=4 --set experiment.duration_s=0.4";
/// Three motes that negotiate cells.
const SENSORS: &str = "run CONFIGS/sensors-msf.toml RUN --set experiment.agents=3 --set experiment.duration_s=20 \
    --set experiment.control_period={rate_hz=0.5} --set experiment.start=at-once --set output.pcap=true";
/// Three motes, of which one asks the others.
const COAP: &str = "run CONFIGS/traffic-coap.toml RUN --set experiment.agents=3 --set experiment.duration_s=30 \
    --set experiment.start=at-once";
/// Seven robots that explore.
const EXPLORATION: &str =
    "run CONFIGS/exploration.toml RUN --set experiment.duration_s=3 --set experiment.start=at-once";
/// Robots that wait until the network has formed, which is saved.
const FORMED: &str = "run CONFIGS/sensors-msf.toml RUN --set experiment.agents=2 --set experiment.duration_s=4 \
    --set experiment.control_period={rate_hz=0.5} --set experiment.start=when-formed --save-formed formed.bin";
/// Two settings, two seeds.
const SWEEP: &str = "sweep s.toml --jobs 1 --out runs";
const MERGE: &str = "sweep s.toml --out runs --merge";
const CONVERT: &str = "convert links.toml --output table.csv --replace --json converted.json";
const CONVERT_PARQUET: &str = "convert links.toml --output table.parquet --replace";
const EXTEND: &str = "extend model.toml --data links.csv --effect system-gain --output better.toml --replace --json extended.json";
const EXPORT_CSV: &str = "export runs/flocking --format csv --out exported";
const EXPORT_ROSBAG: &str = "export runs/flocking --format rosbag2 --out exported";

/// All of them. Those before `save-formed` may have simulators that lie.
pub(super) const SCENARIOS: [Scenario; 14] = [
    Scenario {
        name: "broadcasts",
        prepare: nothing,
        commands: &[Command::Meets(FLOCK)],
        repair: Repair::Resume,
        again: FLOCK,
    },
    Scenario {
        name: "6tisch",
        prepare: nothing,
        commands: &[Command::Meets(SENSORS)],
        repair: Repair::Resume,
        again: SENSORS,
    },
    Scenario {
        name: "coap",
        prepare: nothing,
        commands: &[Command::Meets(COAP)],
        repair: Repair::Resume,
        again: COAP,
    },
    Scenario {
        name: "exploration",
        prepare: nothing,
        commands: &[Command::Meets(EXPLORATION)],
        repair: Repair::Resume,
        again: EXPLORATION,
    },
    Scenario {
        name: "save-formed",
        prepare: nothing,
        commands: &[Command::Meets(FORMED)],
        repair: Repair::Resume,
        again: FORMED,
    },
    Scenario {
        name: "replace",
        prepare: nothing,
        commands: &[
            Command::Prepares("", FLOCK),
            Command::Prepares("", "check CONFIGS/flocking.toml --json runs/flocking/notes.json"),
            Command::Meets(FLOCK),
        ],
        repair: Repair::Resume,
        again: FLOCK,
    },
    Scenario {
        name: "resume",
        prepare: nothing,
        commands: &[
            Command::Prepares("kill rename 9 .flocking.partial-#/checkpoint", FLOCK),
            Command::Meets("run --resume LEFT"),
        ],
        repair: Repair::Resume,
        again: FLOCK,
    },
    Scenario {
        name: "recover",
        prepare: nothing,
        commands: &[
            Command::Prepares("kill point 1 before the rename", FLOCK),
            Command::Meets("recover LEFT"),
        ],
        repair: Repair::Resume,
        again: FLOCK,
    },
    Scenario {
        name: "sweep",
        prepare: sweep_file,
        commands: &[Command::Meets(SWEEP)],
        repair: Repair::Again,
        again: SWEEP,
    },
    Scenario {
        name: "shards",
        prepare: sweep_file,
        commands: &[
            Command::Meets("sweep s.toml --jobs 1 --out runs --shard 1/2"),
            Command::Meets("sweep s.toml --jobs 1 --out runs --shard 2/2"),
            Command::Meets(MERGE),
        ],
        repair: Repair::Again,
        again: MERGE,
    },
    Scenario {
        name: "convert",
        prepare: log_and_mapping,
        commands: &[Command::Meets(CONVERT), Command::Meets(CONVERT_PARQUET)],
        repair: Repair::Again,
        again: CONVERT,
    },
    Scenario {
        name: "extend",
        prepare: model_and_links,
        commands: &[Command::Meets(EXTEND)],
        repair: Repair::Again,
        again: EXTEND,
    },
    Scenario {
        name: "export-csv",
        prepare: nothing,
        commands: &[Command::Prepares("", FLOCK), Command::Meets(EXPORT_CSV)],
        repair: Repair::Again,
        again: EXPORT_CSV,
    },
    Scenario {
        name: "export-rosbag2",
        prepare: nothing,
        commands: &[Command::Prepares("", FLOCK), Command::Meets(EXPORT_ROSBAG)],
        repair: Repair::Again,
        again: EXPORT_ROSBAG,
    },
];

/// The arguments of a command. `left`: the folder of an unfinished run.
pub(super) fn arguments(command: &str, left: Option<&Path>) -> Vec<String> {
    let configs = repository().join("configs");
    let words = command.split_whitespace().flat_map(|word| match word {
        "RUN" => RUN.split_whitespace().map(str::to_owned).collect(),
        "LEFT" => left.iter().map(|path| path.display().to_string()).collect::<Vec<_>>(),
        word => vec![word.replace("CONFIGS", &configs.display().to_string())],
    });
    words.collect()
}

fn nothing(_: &Path) -> std::io::Result<()> {
    Ok(())
}

fn sweep_file(folder: &Path) -> std::io::Result<()> {
    let text = "[experiment]\nname = \"s\"\nseed = 3\nduration_s = 0.3\nagents = 3\n\
        [robotsim.scenario]\nkind = \"disc\"\ndensity_per_m2 = 0.1\n\
        [robotsim.controller]\nkind = \"flocking\"\nflock_radius_m = 10.0\n\
        [sweep]\nseeds = 2\nkeep = \"all\"\n[sweep.vary]\n\
        \"netsim.phy.propagation\" = [\"full\", \"friis\"]\n";
    std::fs::write(folder.join("s.toml"), text)
}

fn log_and_mapping(folder: &Path) -> std::io::Result<()> {
    let rows =
        (0..400).map(|row| format!("{row},{},{},{},1\n", row % 3, row % 3 + 1, -60 - row % 9));
    let log = format!("t,a,b,rssi,ok\n{}", rows.collect::<String>());
    std::fs::write(folder.join("log.csv"), log)?;
    let mapping = "table = \"links\"\n\n[[input]]\nfiles = \"log.csv\"\n\
        columns = { time_s = \"t\", tx = \"a\", rx = \"b\", rssi_dbm = \"rssi\", received = \"ok\" }\n";
    std::fs::write(folder.join("links.toml"), mapping)
}

fn model_and_links(folder: &Path) -> std::io::Result<()> {
    let model = "[netsim.phy]\npropagation = \"friis\"\ntx_power_dbm = 0.0\n";
    std::fs::write(folder.join("model.toml"), model)?;
    let links = Campaign::link(3, &Layout::standard(), &[], 200).csv;
    std::fs::write(folder.join("links.csv"), links)
}
