//! The full protocols: a control period of a swarm of 100 with round-robin cells, all of whom hear each other, after
//! formation; and an hour of 50 standing motes with MSF, from the moment they are switched on.
//!
//! `cargo bench -p netsim --bench mesh`

use criterion::{Criterion, criterion_group, criterion_main};
use netsim::sim::Network;
use proto::side::{NetInput, NetOutput, NetSimulator, Setup};
use proto::site::Site;
use proto::types::{AgentStates, Coupling, Experiment, NetRecord, Payloads};
use std::collections::BTreeMap;
use std::hint::black_box;

struct Run {
    network: Network,
    states: AgentStates,
    step: u64,
    step_ns: u64,
}

impl Run {
    /// Motes on a square grid.
    fn new(n: usize, step_ns: u64, spacing_m: f64, config: &str) -> Self {
        let mut network = Network::default();
        network
            .configure(&Setup {
                experiment: Experiment {
                    seed: 1,
                    agent_count: n,
                    step_ns,
                    coupling: Coupling::Sequential,
                },
                site: Site::default(),
                config: proto::config::parse(config).expect("valid TOML"),
                path: "netsim".to_owned(),
                files: BTreeMap::new(),
                columns: Vec::new(),
                records: vec![NetRecord::Packets, NetRecord::Statistics],
            })
            .expect("a valid configuration");
        let side = (n as f64).sqrt().ceil() as usize;
        let mut states = AgentStates::at_origin(n);
        for mote in 0..n {
            states.x_m[mote] = (mote % side) as f64 * spacing_m;
            states.y_m[mote] = (mote / side) as f64 * spacing_m;
        }
        Self { network, states, step: 0, step_ns }
    }

    fn step(&mut self, payloads: &Payloads) -> NetOutput {
        self.step += 1;
        self.network.step(&NetInput {
            step: self.step,
            from_ns: (self.step - 1) * self.step_ns,
            until_ns: self.step * self.step_ns,
            states: &self.states,
            payloads,
            moved_obstacles: &[],
            commands: &[],
            stop_at_first_delivery: false,
            records: &[],
        })
    }
}

fn payloads(n: usize, bytes: usize) -> Payloads {
    Payloads::new(vec![bytes as u32; n], vec![0; n * bytes].into()).expect("lengths and data agree")
}

fn round_robin(criterion: &mut Criterion) {
    const N: usize = 100;
    let config = "mode = \"6tisch\"\nphy.propagation = \"full\"\nsf.kind = \"rrsf\"";
    let mut run = Run::new(N, N as u64 * 10_000_000, 0.5, config);
    let (silent, all) = (payloads(N, 0), payloads(N, 48));
    while run.step(&silent).formation.is_none_or(|formation| formation.formed_ns.is_none()) {}
    criterion.bench_function("rrsf/100", |bencher| bencher.iter(|| black_box(run.step(&all))));
}

fn standing(criterion: &mut Criterion) {
    let config = "mode = \"6tisch\"\nphy = { propagation = \"unit-disk\", radius_m = 25.0 }\nsf.kind = \"msf\"\n\
                  swarm.transport = \"none\"\n[[app]]\nperiod_s = 60\npayload_bytes = 60";
    let silent = payloads(50, 0);
    let mut group = criterion.benchmark_group("msf");
    group.sample_size(10).bench_function("50, an hour", |bencher| {
        bencher.iter(|| {
            let mut run = Run::new(50, 60_000_000_000, 10.0, config);
            for _ in 0..60 {
                black_box(run.step(&silent));
            }
        });
    });
}

criterion_group!(benches, round_robin, standing);
criterion_main!(benches);
