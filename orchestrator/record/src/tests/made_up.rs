//! A run made up of values. Included by the tests of more than one crate.

use super::{Recorder, RunHeader, StepRecord};
use bytes::Bytes;
use experiment::{OutputConfig, Start};
use proto::digest::full::{NetworkReply, RobotsReply, of_exchange};
use proto::exchange::{
    ConfigureRequest, Configured, NetworkStart, NetworkStep, RobotsStart, RobotsStep,
};
use proto::types::{
    AgentStates, Bitmap, Coupling, Deliveries, Experiment, Heard, Payloads, Transmissions,
};
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

pub(super) const N: usize = 7;
pub(super) const STEPS: u64 = 12;
pub(super) const STEP_NS: u64 = 100_000_000;

pub(super) fn header(name: &str) -> RunHeader {
    RunHeader {
        name: name.to_owned(),
        seed: 42,
        agent_count: N as u32,
        step_ns: STEP_NS,
        coupling: Coupling::Sequential,
        config_toml: "[experiment]\nname = \"made-up\"\n".to_owned(),
        labels: BTreeMap::new(),
        output: OutputConfig::default(),
        start: Start::AtOnce,
        records: Vec::new(),
        statistics: Vec::new(),
        warnings: Vec::new(),
        keeps_checkpoints: false,
    }
}

/// Seven agents on a line, 1 m apart, drifting east at 2 m/s; agent 6 does not exist.
pub(super) fn states(step: u64) -> AgentStates {
    let mut alive = Bitmap::filled(N, true);
    alive.set(6, false);
    AgentStates {
        alive,
        x_m: (0..N).map(|i| i as f64 + 0.2 * step as f64).collect(),
        y_m: vec![0.5; N],
        z_m: vec![0.0; N],
        ..Default::default()
    }
}

/// Everyone alive sends; those at most 2 m away hear it.
pub(super) fn deliveries(step: u64) -> Deliveries {
    let begin_ns = (step - 1) * STEP_NS;
    let (mut ends, mut indices) = (Vec::new(), Vec::new());
    for receiver in 0..N {
        let range = receiver.saturating_sub(2)..=(receiver + 2).min(5);
        indices.extend(range.filter(|&i| i != receiver && receiver != 6).map(|i| i as u32));
        ends.push(indices.len() as u32);
    }
    let n_deliveries = indices.len();
    Deliveries {
        transmissions: Transmissions {
            sender: (0..6).collect(),
            sent_ns: (0..6).map(|i| begin_ns + i * 10_000_000).collect(),
            end_ns: (0..6).map(|i| begin_ns + i * 10_000_000 + 2_000_000).collect(),
            payloads: Payloads::new(vec![3; 6], Bytes::from(vec![step as u8; 18])).unwrap(),
            ..Transmissions::default()
        },
        heard: Heard::Lists { ends, indices },
        rssi_dbm: (0..n_deliveries).map(|i| -60.0 - i as f32).collect(),
        ..Default::default()
    }
}

pub(super) fn configured(header: &RunHeader) -> Configured {
    let request = |site_toml: &str| ConfigureRequest {
        experiment: Experiment {
            seed: header.seed,
            agent_count: N,
            step_ns: header.step_ns,
            coupling: header.coupling,
        },
        site_toml: site_toml.to_owned(),
        config_toml: String::new(),
        files: BTreeMap::new(),
        columns: Vec::new(),
        records: Vec::new(),
        full_digest: true,
    };
    Configured {
        robots_request: request(""),
        robots_start: RobotsStart {
            effective_toml: String::new(),
            states: states(0),
            payloads: None,
            columns: Vec::new(),
            messages: false,
        },
        network_request: request("[[wall]]\nfrom_m = [1.0, 1.0]\nto_m = [4.0, 1.0]\n"),
        network_start: NetworkStart {
            warnings: vec!["made up".to_owned()],
            ..NetworkStart::default()
        },
    }
}

/// Both replies, as made up, and the digest.
pub(super) fn taken(step: u64) -> StepRecord {
    let time_ns = step * STEP_NS;
    let robots = RobotsStep {
        step,
        time_ns,
        states: states(step),
        payloads: Payloads::silence(N),
        ..RobotsStep::default()
    };
    let network = NetworkStep {
        step,
        time_ns,
        deliveries: deliveries(step),
        capture: Bytes::from_static(b"in a file of its own"),
        ..NetworkStep::default()
    };
    let digest = of_exchange(&RobotsReply::of_step(&robots), &NetworkReply::of_step(&network), &[]);
    let (robots, network) = (Arc::new(robots), Arc::new(network));
    StepRecord { step, time_ns, robots, network, commands: Vec::new(), digest }
}

pub(super) fn record(out: &Path, header: RunHeader, steps: u64) -> Recorder {
    let configured = configured(&header);
    let mut recorder = Recorder::create(out, header).unwrap();
    recorder.configured(configured).unwrap();
    for step in 1..=steps {
        recorder.step(taken(step)).unwrap();
    }
    recorder
}
