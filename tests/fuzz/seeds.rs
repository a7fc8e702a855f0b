//! Corpora that the program makes itself: snapshots, calls of both services, Parquet and gzip.

use super::corpus;
use super::services::{Call, frame};
use crate::campaign::{Campaign, Layout};
use bytes::Bytes;
use drive::coupling::{Coupled, StepPlan};
use drive::peer::{InProcess, NetworkSide, Peer, RobotSide, ready};
use drive::{ConfigureRequests, Wanted, configure};
use experiment::Overrides;
use proto::config;
use proto::side::{NetInput, NetSimulator as _, RobotSimulator as _, Setup};
use proto::site::Site;
use proto::types::{AgentStates, Coupling, Experiment, Payloads};
use proto_messages::v1;
use record::StepRecord;
use record::formed::{FormedNetwork, SimulatorVersion};
use std::collections::BTreeMap;
use std::io::Write as _;
use std::path::Path;

/// Agents of the experiments in the corpora.
const AGENTS: u32 = 3;
/// Their control period (ns).
const STEP_NS: u64 = 100_000_000;

const NETWORKS: [(&str, &str); 2] = [
    ("broadcast", "[phy]\npropagation = \"friis\"\ntx_power_dbm = 0.0\n"),
    (
        "mesh",
        "mode = \"6tisch\"\n[phy]\npropagation = \"friis\"\ntx_power_dbm = 0.0\n[[app]]\nkind = \"periodic\"\nperiod_s = 1.0\npayload_bytes = 40\n",
    ),
];

const ROBOTS: &str = "[scenario]\nkind = \"line\"\nspacing_m = 2.0\n[controller]\nkind = \"flocking\"\nflock_radius_m = 10.0\n";

/// Writes the corpora.
///
/// # Errors
///
/// They cannot be written, or the experiments are refused.
pub fn write() -> anyhow::Result<()> {
    for (name, toml) in NETWORKS {
        put("network_service", name, &network_calls(toml))?;
        match network_snapshot(toml) {
            Ok(state) => put("network_restore", name, &state)?,
            Err(problems) => anyhow::bail!("{name}: {problems:?}"),
        }
    }
    put("robots_service", "flocking", &robot_calls())?;
    match robots_snapshot() {
        Ok(state) => put("robots_restore", "flocking", &state)?,
        Err(problems) => anyhow::bail!("robots: {problems:?}"),
    }
    put("formed", "two-motes", &formed_network()?)?;
    let csv = Campaign::link(3, &Layout::standard(), &[], 60).csv;
    put("csv", "links", csv.as_bytes())?;
    let gzip = |text: &[u8]| -> std::io::Result<Vec<u8>> {
        let mut encoder = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
        encoder.write_all(text)?;
        encoder.finish()
    };
    put("gzip", "links", &gzip(csv.as_bytes())?)?;
    let k7 = std::fs::read(corpus("k7").join("trace"))?;
    put("gzip", "trace", &gzip(&k7)?)?;
    Ok(())
}

fn put(target: &str, name: &str, bytes: &[u8]) -> std::io::Result<()> {
    let folder = corpus(target);
    std::fs::create_dir_all(&folder)?;
    std::fs::write(folder.join(name), bytes)
}

fn setup(toml: &str) -> Setup {
    Setup {
        experiment: Experiment {
            seed: 1,
            agent_count: AGENTS as usize,
            step_ns: STEP_NS,
            coupling: Coupling::Sequential,
        },
        site: Site::default(),
        config: config::parse(toml).expect("the corpus has no slips"),
        path: String::new(),
        files: BTreeMap::new(),
        columns: Vec::new(),
        records: Vec::new(),
    }
}

type Problems = Vec<config::Problem>;

fn network_snapshot(toml: &str) -> Result<Vec<u8>, Problems> {
    let mut network = netsim::sim::Network::default();
    network.configure(&setup(toml))?;
    let states = AgentStates::at_origin(AGENTS as usize);
    let payloads = Payloads::silence(AGENTS as usize);
    for step in 1..4 {
        network.step(&NetInput {
            step,
            from_ns: (step - 1) * STEP_NS,
            until_ns: step * STEP_NS,
            states: &states,
            payloads: &payloads,
            moved_obstacles: &[],
            commands: &[],
            stop_at_first_delivery: false,
            records: &[],
        });
    }
    Ok(network.snapshot())
}

fn robots_snapshot() -> Result<Vec<u8>, Problems> {
    let mut swarm = robotsim::sim::Swarm::default();
    swarm.configure(&setup(ROBOTS))?;
    Ok(swarm.snapshot())
}

/// The content of a formed network after its checksum: two motes, two steps, and states that no simulator made.
fn formed_network() -> anyhow::Result<Vec<u8>> {
    const TEXT: &str = "[experiment]\nname = \"f\"\nseed = 1\nduration_s = 1.0\nagents = 2\n\
        [robotsim]\nscenario.kind = \"line\"\ncontroller.kind = \"hold\"\n\
        [netsim]\nmode = \"6tisch\"\nphy.propagation = \"full\"\n";
    let path = Path::new("experiment.toml");
    let plan = experiment::read(path, TEXT.to_owned(), &Overrides::default())?;
    let mut robots = InProcess::robots(robotsim::sim::Swarm::default());
    let mut network = InProcess::network(netsim::sim::Network::default());
    let asked = ConfigureRequests::from_plan(
        &plan,
        Peer::<RobotSide>::described(&robots),
        Peer::<NetworkSide>::described(&network),
        Wanted::Measures,
    );
    let configured = ready(configure(asked, &mut robots, &mut network))?;
    let step_ns = plan.experiment.step_ns;
    let (start, network_start) = (&configured.robots_start, &configured.network_start);
    let mut coupled = Coupled::new(robots, network, plan.experiment, start, network_start);
    let mut steps = Vec::new();
    for step in 1..3 {
        let plan = StepPlan { until_ns: step * step_ns, hold: true, ..StepPlan::default() };
        let outcome = ready(coupled.advance(plan))?;
        let digest = outcome.digest();
        let (robots, network) = (outcome.robots, outcome.network);
        let time_ns = outcome.time_ns;
        steps.push(StepRecord { step, time_ns, robots, network, commands: Vec::new(), digest });
    }
    let named = |name: &str| SimulatorVersion { name: name.to_owned(), version: "1".to_owned() };
    let formed = FormedNetwork {
        version: env!("CARGO_PKG_VERSION").to_owned(),
        robots: named("robots"),
        network: named("network"),
        configured,
        steps,
        robots_state: Bytes::from_static(b"robots"),
        network_state: Bytes::from_static(b"network"),
    };
    Ok(formed.to_bytes().split_off(FormedNetwork::HEADER_BYTES))
}

fn network_calls(toml: &str) -> Vec<u8> {
    let configure = v1::NetSimServiceConfigureRequest {
        seed: 1,
        agent_count: AGENTS,
        step_ns: STEP_NS,
        coupling: v1::Coupling::Sequential.into(),
        config_toml: toml.to_owned(),
        ..Default::default()
    };
    let states = AgentStates::at_origin(AGENTS as usize);
    let step = |step: u64| v1::NetSimServiceStepRequest {
        step,
        until_ns: step * STEP_NS,
        states: Some(states.clone().into()),
        payloads: Some(Payloads::silence(AGENTS as usize).into()),
        ..Default::default()
    };
    let barrier = v1::NetSimServiceBarrierRequest { step: 1, time_ns: STEP_NS };
    [
        frame(Call::Configure, &configure),
        frame(Call::Step, &step(1)),
        frame(Call::Barrier, &barrier),
        frame(Call::Step, &step(2)),
        frame(Call::Command, &v1::NetSimServiceCommandRequest::default()),
        frame(Call::Step, &step(3)),
    ]
    .concat()
}

fn robot_calls() -> Vec<u8> {
    let configure = v1::RobotSimServiceConfigureRequest {
        seed: 1,
        agent_count: AGENTS,
        step_ns: STEP_NS,
        coupling: v1::Coupling::Sequential.into(),
        config_toml: ROBOTS.to_owned(),
        ..Default::default()
    };
    let step = |step: u64| v1::RobotSimServiceStepRequest {
        step,
        until_ns: step * STEP_NS,
        ..Default::default()
    };
    let barrier = v1::RobotSimServiceBarrierRequest { step: 1, time_ns: STEP_NS };
    [
        frame(Call::Configure, &configure),
        frame(Call::Step, &step(1)),
        frame(Call::Barrier, &barrier),
        frame(Call::Command, &v1::RobotSimServiceCommandRequest::default()),
        frame(Call::Predict, &prediction()),
    ]
    .concat()
}

/// A robot that drives for a while, then stands.
fn prediction() -> v1::RobotSimServicePredictRequest {
    v1::RobotSimServicePredictRequest {
        config_toml: ROBOTS.to_owned(),
        command_kind: v1::MotionCommandKind::Velocity.into(),
        windows: vec![v1::PredictionWindow {
            duration_ns: vec![STEP_NS, STEP_NS],
            command_first: vec![1.0, 0.0],
            command_second: vec![0.5, 0.0],
            command_third: vec![0.0, 0.0],
            ..Default::default()
        }],
        ..Default::default()
    }
}
