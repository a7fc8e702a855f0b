//! The cases: one line each.

use super::campaigns::Campaign::{self, DrawnLinks, Links, Robots};
use super::{Case, Input, Maker, packets};
use crate::campaign::Size::{Clear, Medium};
use crate::campaign::{Hidden, RobotHidden};

/// Experiments of `configs/`: the file's name, and options of `run`.
const RUNS: &[(&str, &str)] = &[
    ("dispersion", ""),
    ("dispersion", "--set experiment.coupling=parallel"),
    ("exploration", "--set output.pcap=true"),
    ("exploration", "--set experiment.coupling=parallel --set netsim.sf.kind=orchestra"),
    ("faults", "--set output.pcap=true"),
    ("faults", "--set experiment.coupling=parallel --set netsim.sf.kind=msf"),
    ("flocking", ""),
    ("flocking", "--seed 7"),
    ("flocking", "--set experiment.coupling=parallel"),
    ("flocking", "--set experiment.agents=300 --set experiment.duration_s=6.0"),
    (
        "flocking",
        "--set netsim.phy.propagation=friis --set robotsim.dynamics.kind=double-integrator",
    ),
    ("flocking-500", "--set experiment.agents=60 --set experiment.duration_s=20.0"),
    ("flocking-msf", "--set output.pcap=true"),
    ("flocking-msf", "--set experiment.coupling=parallel"),
    ("flocking-rrsf", ""),
    ("flocking-rrsf", "--set experiment.coupling=parallel"),
    ("flocking-sotdma", ""),
    ("flocking-sotdma", "--set experiment.coupling=parallel"),
    ("formation", ""),
    ("formation", "--set experiment.coupling=parallel --set robotsim.controller.law=botnet"),
    ("k7-replay", ""),
    ("mixed-swarm", ""),
    ("mixed-swarm", "--set experiment.coupling=parallel"),
    ("packet-control", ""),
    ("push", ""),
    ("rooms", ""),
    ("rooms", "--set experiment.coupling=parallel"),
    ("sensors-minimal", "--set output.pcap=true"),
    ("sensors-msf", ""),
    ("sensors-msf", "--set netsim.sf.kind=sotdma --set experiment.duration_s=600.0"),
    ("sensors-orchestra", ""),
    ("sensors-rrsf", ""),
    ("sensors-static", ""),
    ("shadowing", ""),
    ("shadowing", "--set experiment.coupling=sequential --set netsim.phy.reception.kind=table"),
    ("truth-baseline", ""),
    ("walls", ""),
];

/// Sweeps of `configs/`: the file's name, and options.
const SWEEPS: &[(&str, &str)] = &[
    ("sweep-radius", "--set sweep.seeds=3"),
    ("paper/central-mote", "--set sweep.seeds=1"),
    ("paper/crucial-robot", "--set sweep.seeds=1"),
    ("paper/delivery-distance", "--set sweep.seeds=1"),
    ("paper/emergent-flocking", "--set sweep.seeds=1"),
    ("paper/flocking-msf", "--set sweep.seeds=1 --set experiment.duration_s=5.0"),
    ("paper/forming", "--set sweep.seeds=1"),
    ("paper/general-law", "--set sweep.seeds=1"),
    ("paper/links", "--set sweep.seeds=1"),
    ("paper/lopsided", "--set sweep.seeds=1"),
    ("paper/original-potential", "--set sweep.seeds=1"),
    ("paper/potentials", "--set sweep.seeds=1"),
    ("paper/radio-physics", "--set sweep.seeds=1"),
];

const COMPARE: &str =
    "compare config.toml --data data.csv --json compare.json --report compare.html";
const DIAGNOSE: &str =
    "diagnose config.toml --data data.csv --json diagnose.json --report diagnose.html";
const EXTEND: &str =
    "extend config.toml --data data.csv --all --output better.toml --json extend.json";
const CHECK: &str = "check config.toml --data data.csv --json check.json";
const SIMULATE: &str =
    "simulate config.toml --like data.csv --output simulated.csv --seed 7 --json simulate.json";
const ALL: &[&str] = &[CHECK, COMPARE, DIAGNOSE, EXTEND, SIMULATE];
const FOUND: &[&str] = &[COMPARE, DIAGNOSE];
/// Where nothing is missing, nothing can be added.
const NOTHING: &[&str] = &[CHECK, COMPARE, DIAGNOSE, SIMULATE];

/// Campaigns with something hidden, and what is asked about each.
const CAMPAIGNS: &[(&str, Campaign, &[&str])] = &[
    ("links: nothing", Links(1, 2000, &[]), NOTHING),
    ("links: temperature", Links(2, 2000, &[(Hidden::Temperature, Clear)]), ALL),
    ("links: walls", Links(3, 2000, &[(Hidden::WallAttenuation, Clear)]), FOUND),
    ("links: nodes", Links(4, 2000, &[(Hidden::NodeOffset, Medium)]), FOUND),
    ("links: shadowing", Links(5, 2000, &[(Hidden::Shadowing, Clear)]), FOUND),
    ("links: screen", Links(6, 2000, &[(Hidden::HiddenScreen, Clear)]), FOUND),
    ("links: interference", Links(7, 2000, &[(Hidden::Interference, Clear)]), FOUND),
    ("links: antennas", Links(8, 2000, &[(Hidden::AntennaPattern, Clear)]), FOUND),
    (
        "links: two, exponent and interference",
        Links(9, 2500, &[(Hidden::PathLossExponent, Clear), (Hidden::Interference, Clear)]),
        ALL,
    ),
    ("links: drawn, two-ray", DrawnLinks(10, 2000, &[(Hidden::TwoRayGround, Clear)]), ALL),
    ("links: drawn, nothing", DrawnLinks(11, 2000, &[]), FOUND),
    ("links: unknown dust", Links(12, 2500, &[(Hidden::Dust, Clear)]), FOUND),
    ("links: unknown step", Links(13, 2500, &[(Hidden::Step, Clear)]), FOUND),
    ("links: unknown loss", Links(14, 2500, &[(Hidden::HumidityLoss, Clear)]), FOUND),
    (
        "links: formula",
        Links(15, 2000, &[(Hidden::HumiditySquared, Clear)]),
        &[
            "extend config.toml --data data.csv --formula '-a * (humidity_pct - best_pct)^2' --parameter a=0.01:0:1 \
           --parameter best_pct=50:0:100 --output better.toml --json extend.json",
        ],
    ),
    (
        "links: named effects",
        Links(16, 2000, &[(Hidden::SystemGain, Clear)]),
        &[
            "extend config.toml --data data.csv --effect system-gain --effect node-offset --output better.toml --json extend.json",
        ],
    ),
    (
        "links: choices",
        Links(17, 3000, &[(Hidden::Temperature, Clear)]),
        &[
            "compare config.toml --data data.csv --where 'received == 1 and distance_m < 40' --split pair --json c.json --report c.html",
            "check config.toml --data data.csv --where 'tx < 9' --json check.json",
        ],
    ),
    (
        "links: power",
        Links(18, 1000, &[]),
        &["power config.toml --like data.csv --effect temperature --campaigns 4 --json power.json"],
    ),
    ("robots: nothing", Robots(1, 3000, &[]), NOTHING),
    ("robots: slip", Robots(2, 3000, &[(RobotHidden::Slip, Clear)]), ALL),
    ("robots: wind", Robots(3, 3000, &[(RobotHidden::Wind, Clear)]), FOUND),
    ("robots: lag", Robots(4, 3000, &[(RobotHidden::ActuatorLag, Clear)]), FOUND),
    ("robots: steering", Robots(5, 3000, &[(RobotHidden::SteeringBias, Clear)]), FOUND),
    ("robots: turns", Robots(6, 3000, &[(RobotHidden::YawCoupling, Clear)]), FOUND),
    (
        "robots: two, heading and drag",
        Robots(7, 4000, &[(RobotHidden::HeadingBias, Clear), (RobotHidden::QuadraticDrag, Clear)]),
        ALL,
    ),
    ("robots: unknown tide", Robots(8, 4000, &[(RobotHidden::Tide, Clear)]), FOUND),
    (
        "robots: formula",
        Robots(9, 3000, &[(RobotHidden::Payload, Clear)]),
        &[
            "extend config.toml --data data.csv --formula '-k * payload_kg * speed_mps' --parameter k=0.01:0:1 --output \
           better.toml --json extend.json",
        ],
    ),
    (
        "robots: choices",
        Robots(10, 3000, &[(RobotHidden::Slope, Clear)]),
        &[
            "compare config.toml --data data.csv --where 'agent < 4' --split node --window 2 --json c.json --report c.html",
        ],
    ),
    (
        "robots: power",
        Robots(11, 2000, &[]),
        &["power config.toml --like data.csv --effect slip --campaigns 4 --json power.json"],
    ),
];

const COMPARE_PACKETS: &str = "compare model.toml --data measured/sensors/packets.parquet --seeds 39 --json c.json --report c.html";
const DIAGNOSE_PACKETS: &str = "diagnose model.toml --data measured/sensors/packets.parquet --seeds 99 --json d.json --report d.html";
const LINKS_MEANWHILE: &str = "simulate truth.toml --like like.csv --output links.csv --seed 5";
const SPLIT: &str = "compare model.toml --data measured/rendezvous/packets.parquet --positions measured/rendezvous \
                     --links links.csv --seeds 19 --json s.json --report s.html";
const SPLIT_TASK: &str = "compare model.toml --data measured/flock --heard measured/flock --seeds 99 --json s.json --report s.html";

/// What a run of `truth.toml` measured, held against `model.toml`: inputs and commands.
const MEASURED: &[(&str, Maker, &[&str])] = &[
    (
        "packets: nothing",
        packets::sensors,
        &[
            "run truth.toml --out measured",
            COMPARE_PACKETS,
            DIAGNOSE_PACKETS,
            "compare model.toml --data measured/sensors/packets.parquet --seed 2 --from 300 --json e.json",
        ],
    ),
    (
        "packets: a slow processor",
        packets::sensors_slow,
        &[
            "run truth.toml --out measured",
            COMPARE_PACKETS,
            DIAGNOSE_PACKETS,
            "extend model.toml --data measured/sensors/packets.parquet --effect processing-delay --seeds 99 --output better.toml --json x.json",
        ],
    ),
    (
        "packets: lost acknowledgments",
        packets::sensors_unacknowledged,
        &[
            "run truth.toml --seed 1000 --out measured",
            "compare model.toml --data measured/sensors/packets.parquet --positions measured/sensors --seeds 39 --json c.json --report c.html",
        ],
    ),
    (
        "packets: split, nothing",
        packets::rendezvous,
        &["run truth.toml --out measured", LINKS_MEANWHILE, SPLIT],
    ),
    (
        "packets: split, radio",
        packets::rendezvous_weak,
        &["run truth.toml --out measured", LINKS_MEANWHILE, SPLIT],
    ),
    (
        "packets: split, protocol",
        packets::rendezvous_slow,
        &["run truth.toml --out measured", LINKS_MEANWHILE, SPLIT],
    ),
    ("task: nothing", packets::flock, &["run truth.toml --seed 5 --out measured", SPLIT_TASK]),
    (
        "task: robots slip",
        packets::flock_slipping,
        &["run truth.toml --seed 5 --out measured", SPLIT_TASK],
    ),
    (
        "task: a weak radio",
        packets::flock_weak,
        &["run truth.toml --seed 5 --out measured", SPLIT_TASK],
    ),
    (
        "links: given the reading",
        packets::summed_up,
        &[
            "simulate truth.toml --like like.csv --output data.csv --seed 3",
            "check model.toml --data data.csv --json check.json",
            "compare model.toml --data data.csv --json c.json --report c.html",
            "compare model.toml --data data.csv --given-rssi --json g.json",
            "diagnose model.toml --data data.csv --given-rssi --json d.json",
        ],
    ),
];

/// Files of the repository, and everything that is asked of them and of what they leave.
const REPOSITORY: &[(&str, &[&str])] = &[
    (
        "a run as measured links",
        &[
            "run configs/shadowing.toml",
            "check configs/shadowing.toml --data runs/shadowing --json check.json",
            "compare configs/shadowing.toml --data runs/shadowing --json c.json --report c.html",
            "compare configs/shadowing.toml --data runs/shadowing --set netsim.phy.exponent=2.0 --json d.json",
        ],
    ),
    (
        "compare-runs of two runs",
        &[
            "run configs/flocking.toml --out a",
            "run configs/flocking.toml --out b --set netsim.phy.propagation=full --set robotsim.controller.flock_radius_m=20.0",
            "compare-runs a/flocking b/flocking --json changes.json",
        ],
    ),
    (
        "compare-runs of two sweeps",
        &[
            "sweep configs/sweep-radius.toml --out a --jobs 1 --set sweep.seeds=4 --set experiment.duration_s=5.0",
            "sweep configs/sweep-radius.toml --out b --jobs 1 --set sweep.seeds=4 --set experiment.duration_s=5.0 --set robotsim.dynamics.speed_cap_mps=10.0",
            "compare-runs a/sweep-radius b/sweep-radius --json changes.json",
        ],
    ),
    (
        "effects",
        &[
            "effects",
            "effects --json effects.json",
            "effects two-ray-ground --svg two-ray.svg",
            "effects node-offset --svg nodes.svg",
            "effects temperature --json temperature.json",
            "effects slip",
            "effects ack-loss",
        ],
    ),
    ("schema", &["schema"]),
    (
        "check of an experiment",
        &[
            "check configs/flocking.toml --json flocking.json",
            "check configs/k7-replay.toml --json k7.json",
            "check configs/sweep-radius.toml --json sweep.json",
        ],
    ),
];

/// All cases.
#[must_use]
pub fn cases() -> Vec<Case> {
    let owned = |commands: &[&str]| commands.iter().map(|&command| command.to_owned()).collect();
    let named = |verb: &str, config: &str, options: &str| {
        let options = options.replace("--set ", "").replace("experiment.", "");
        format!("{verb} {config} {options}").trim_end().to_owned()
    };
    let runs = RUNS.iter().map(|&(config, options)| Case {
        name: named("run", config, options),
        input: Input::Configs,
        commands: vec![
            format!("run configs/{config}.toml {options}"),
            format!("verify runs/{config} --json verify.json"),
        ],
    });
    let sweeps = SWEEPS.iter().map(|&(config, options)| Case {
        name: named("sweep", config, options),
        input: Input::Configs,
        commands: vec![format!("sweep configs/{config}.toml --jobs 1 {options} --json sweep.json")],
    });
    let campaigns = CAMPAIGNS.iter().map(|&(name, campaign, commands)| Case {
        name: name.to_owned(),
        input: Input::Campaign(campaign),
        commands: owned(commands),
    });
    let measured = MEASURED.iter().map(|&(name, files, commands)| Case {
        name: name.to_owned(),
        input: Input::Files(files),
        commands: owned(commands),
    });
    let repository = REPOSITORY.iter().map(|&(name, commands)| Case {
        name: name.to_owned(),
        input: Input::Configs,
        commands: owned(commands),
    });
    runs.chain(sweeps).chain(campaigns).chain(measured).chain(repository).collect()
}
