//! Wall time of one control step of the swarm, without network and RPC.

use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};
use proto::side::{RobotInput, RobotSimulator, Setup};
use proto::types::{Coupling, Deliveries, Experiment, Heard, Transmissions};
use robotsim::sim::Swarm;
use std::hint::black_box;

const STEP_NS: u64 = 100_000_000;

const JUMPS: &str = "scenario.kind = 'disc'\nscenario.density_per_m2 = 0.22\n\
                     controller.kind = 'random-jump'\ncontroller.arena = 'disc'\n";
const FLOCKING: &str = "scenario.kind = 'disc'\nscenario.density_per_m2 = 0.22\n\
                        controller.kind = 'flocking'\ncontroller.flock_radius_m = 10\n";
const LINE: &str = "scenario.kind = 'disc'\nscenario.density_per_m2 = 0.22\n\
                    controller.kind = 'line-formation'\n";

/// A swarm that has taken one step, and deliveries of its payloads in which each hears the `n_heard` after it.
fn swarm(config: &str, n: usize, n_heard: usize) -> (Swarm, Deliveries) {
    let setup = Setup {
        experiment: Experiment {
            seed: 1,
            agent_count: n,
            step_ns: STEP_NS,
            coupling: Coupling::Sequential,
        },
        site: proto::site::Site::default(),
        config: proto::config::parse(config).expect("the text is TOML"),
        path: String::new(),
        files: std::collections::BTreeMap::new(),
        columns: Vec::new(),
        records: Vec::new(),
    };
    let mut swarm = Swarm::default();
    let start = swarm.configure(&setup).expect("the configuration is valid");
    let indices = (0..n).flat_map(|receiver| {
        let mut heard: Vec<u32> = (1..=n_heard).map(|k| ((receiver + k) % n) as u32).collect();
        heard.sort_unstable();
        heard
    });
    let deliveries = Deliveries {
        transmissions: Transmissions {
            sender: (0..n as u32).collect(),
            sent_ns: vec![0; n],
            end_ns: vec![1; n],
            payloads: start.payloads,
            ..Transmissions::default()
        },
        heard: Heard::Lists {
            ends: (1..=n).map(|receiver| (receiver * n_heard) as u32).collect(),
            indices: indices.collect(),
        },
        ..Deliveries::default()
    };
    (swarm, deliveries)
}

fn step(swarm: &mut Swarm, step: u64, deliveries: &Deliveries) {
    black_box(swarm.step(&RobotInput {
        step,
        from_ns: (step - 1) * STEP_NS,
        until_ns: step * STEP_NS,
        deliveries: Some(deliveries),
        motes: None,
        commands: &[],
        hold: false,
    }));
}

fn robots(criterion: &mut Criterion) {
    for (name, config, sizes) in [
        ("random jumps", JUMPS, [(10, 6), (1000, 6), (10_000, 6)]),
        ("flocking", FLOCKING, [(10, 9), (1000, 999), (10_000, 6)]),
        ("line formation", LINE, [(10, 9), (1000, 999), (10_000, 6)]),
    ] {
        let mut group = criterion.benchmark_group(name);
        for (n, n_heard) in sizes {
            let (mut swarm, deliveries) = swarm(config, n, n_heard);
            let mut k = 0;
            let id = BenchmarkId::from_parameter(format!("{n} robots, {n_heard} heard"));
            group.bench_function(id, |bencher| {
                bencher.iter(|| {
                    k += 1;
                    step(&mut swarm, k, &deliveries);
                });
            });
        }
    }
}

criterion_group!(benches, robots);
criterion_main!(benches);
