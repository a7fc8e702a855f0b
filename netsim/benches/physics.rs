//! One control period of radio without protocols, at several sizes. `full` and `experimental-randomness` in a square of
//! 10 m, the others in a disc of 0.22 agents per square metre; every agent broadcasts 48 bytes in one of ten slots.
//!
//! `cargo bench -p netsim`

use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};
use netsim::sim::Network;
use proto::rng::{Draws, Purpose};
use proto::side::{NetInput, NetSimulator, Setup};
use proto::site::Site;
use proto::types::{AgentStates, Coupling, DeliveryColumn, Experiment, Payloads};
use std::collections::BTreeMap;
use std::hint::black_box;

const STEP_NS: u64 = 100_000_000;

fn network(n: usize, case: &Case) -> Network {
    let Case { hopping, phy, columns, .. } = case;
    let config = proto::config::parse(&format!("{hopping}[phy]\n{phy}")).expect("valid TOML");
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
            columns: columns.to_vec(),
            records: Vec::new(),
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
                let (sin, cos) = libm::sincos(std::f64::consts::TAU * v);
                (radius_m * u.sqrt() * cos, radius_m * u.sqrt() * sin)
            }
        };
    }
    states
}

/// A radio in a place.
struct Case {
    name: &'static str,
    hopping: &'static str,
    phy: &'static str,
    /// Side of the square (m); a disc for `None`.
    square_m: Option<f64>,
    columns: &'static [DeliveryColumn],
    sizes: &'static [usize],
}

const DISC: Case =
    Case { name: "", hopping: "", phy: "", square_m: None, columns: &[], sizes: &[100, 2500] };
const SQUARE: Case = Case { square_m: Some(10.0), ..DISC };
const RANDOMNESS: Case =
    Case { phy: "propagation = \"experimental-randomness\"", sizes: &[2500], ..SQUARE };

const CASES: &[Case] = &[
    Case { name: "full", phy: "propagation = \"full\"", sizes: &[10, 100, 2500], ..SQUARE },
    Case { name: "experimental-randomness", sizes: &[10, 50, 100, 1000, 2500], ..RANDOMNESS },
    Case {
        name: "experimental-randomness by frame",
        phy: "propagation = \"experimental-randomness\"\nredraw = \"frame\"",
        ..RANDOMNESS
    },
    Case {
        name: "experimental-randomness by coherence",
        phy: "propagation = \"experimental-randomness\"\nredraw = \"coherence\"",
        ..RANDOMNESS
    },
    Case {
        name: "experimental-randomness with readings",
        columns: &[DeliveryColumn::RssiDbm],
        ..RANDOMNESS
    },
    Case {
        name: "experimental-randomness with hopping",
        hopping: "hopping_sequence = [11, 15, 20, 25, 26]\n",
        ..RANDOMNESS
    },
    Case {
        name: "unit-disk 3 m",
        phy: "propagation = \"unit-disk\"\nradius_m = 3.0",
        sizes: &[10, 100, 2500, 10_000],
        ..DISC
    },
    Case { name: "friis", phy: "propagation = \"friis\"", ..DISC },
    Case {
        name: "friis with readings",
        phy: "propagation = \"friis\"",
        columns: &[DeliveryColumn::RssiDbm],
        sizes: &[2500],
        ..DISC
    },
    Case {
        name: "probabilistic-disk",
        phy: "propagation = \"probabilistic-disk\"",
        sizes: &[100, 2500, 10_000],
        ..DISC
    },
    Case {
        name: "probabilistic-disk with shadowing",
        phy: "propagation = \"probabilistic-disk\"\n[[phy.effect]]\nkind = \"shadowing\"\nsd_db = 2.0",
        ..DISC
    },
    Case {
        name: "nearest-k",
        phy: "propagation = \"nearest-k\"\nk = 6",
        sizes: &[100, 2500, 10_000],
        ..DISC
    },
];

fn physics(criterion: &mut Criterion) {
    for case in CASES {
        let mut group = criterion.benchmark_group(case.name);
        group.sample_size(20);
        for &n in case.sizes {
            let mut network = network(n, case);
            let states = states(n, case.square_m);
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
                        records: &[],
                    }))
                });
            });
        }
    }
}

criterion_group!(benches, physics);
criterion_main!(benches);
