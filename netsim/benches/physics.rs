//! One control period of radio without protocols, at several sizes. `full` and `experimental-randomness` in a square of
//! 10 m, the others in a disc of 0.22 agents per square metre; every agent broadcasts 48 bytes in one of ten slots.
//!
//! `cargo bench -p netsim`

use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};
use netsim::sim::Network;
use proto::rng::{Draws, Purpose};
use proto::side::{NetInput, NetSimulator, Setup};
use proto::site::Site;
use proto::types::{AgentStates, Coupling, Experiment, Payloads};
use std::collections::BTreeMap;
use std::hint::black_box;

const STEP_NS: u64 = 100_000_000;

fn network(n: usize, phy: &str) -> Network {
    let config = proto::config::parse(&format!("[phy]\n{phy}")).expect("valid TOML");
    let mut network = Network::default();
    network
        .configure(&Setup {
            experiment: Experiment {
                seed: 1,
                agent_count: n,
                step_ns: STEP_NS,
                coupling: Coupling::Sequential,
            },
            site: Site::default(),
            config,
            path: "netsim".to_owned(),
            files: BTreeMap::new(),
            columns: Vec::new(),
        })
        .expect("a valid configuration");
    network
}

/// Uniform in a square, or in a disc of 0.22 per square metre.
fn states(n: usize, square_m: Option<f64>) -> AgentStates {
    let draws = Draws::new(7, Purpose::Scenario);
    let radius_m = (n as f64 / (0.22 * std::f64::consts::PI)).sqrt();
    let mut states = AgentStates::at_origin(n);
    for i in 0..n {
        let (u, v) = (draws.uniform(i as u64, 0, 0), draws.uniform(i as u64, 0, 1));
        (states.x_m[i], states.y_m[i]) = match square_m {
            Some(side_m) => (side_m * u, side_m * v),
            None => {
                let angle_rad = std::f64::consts::TAU * v;
                (radius_m * u.sqrt() * angle_rad.cos(), radius_m * u.sqrt() * angle_rad.sin())
            }
        };
    }
    states
}

fn physics(criterion: &mut Criterion) {
    let square = Some(10.0);
    let cases: [(&str, &str, Option<f64>, &[usize]); 7] = [
        ("full", "propagation = \"full\"", square, &[10, 100, 2500]),
        (
            "experimental-randomness",
            "propagation = \"experimental-randomness\"",
            square,
            &[10, 100, 2500],
        ),
        (
            "unit-disk 3 m",
            "propagation = \"unit-disk\"\nradius_m = 3.0",
            None,
            &[10, 100, 2500, 10_000],
        ),
        ("friis", "propagation = \"friis\"", None, &[100, 2500]),
        ("probabilistic-disk", "propagation = \"probabilistic-disk\"", None, &[100, 2500, 10_000]),
        (
            "probabilistic-disk with shadowing",
            "propagation = \"probabilistic-disk\"\n[[phy.effect]]\nkind = \"shadowing\"\nsd_db = 2.0",
            None,
            &[100, 2500],
        ),
        ("nearest-k", "propagation = \"nearest-k\"\nk = 6", None, &[100, 2500, 10_000]),
    ];
    for (name, phy, square_m, sizes) in cases {
        let mut group = criterion.benchmark_group(name);
        group.sample_size(20);
        for &n in sizes {
            let mut network = network(n, phy);
            let states = states(n, square_m);
            let payloads =
                Payloads::new(vec![48; n], vec![0; 48 * n].into()).expect("48 bytes each");
            let mut step = 0;
            group.bench_function(BenchmarkId::from_parameter(n), |bencher| {
                bencher.iter(|| {
                    step += 1;
                    black_box(network.step(&NetInput {
                        step,
                        from_ns: (step - 1) * STEP_NS,
                        until_ns: step * STEP_NS,
                        states: &states,
                        payloads: &payloads,
                        moved_obstacles: &[],
                        commands: &[],
                        stop_at_first_delivery: false,
                    }))
                });
            });
        }
    }
}

criterion_group!(benches, physics);
criterion_main!(benches);
