//! What a few networks hear, pinned: whoever makes the physics faster must not change it.
//!
//! The snapshot has, for each network, its configuration, a table of what is heard, and a digest of every bit of it. A digest that
//! changes alone is a difference below the digits of the table.

use super::harness::{STEP_NS, period, setup, started};
use proto::digest::{hex, of_step};
use proto::rng::{Draws, Purpose};
use proto::types::{AgentStates, Deliveries, DeliveryColumn};

/// `n` agents, uniform in a square; in period k each one has moved a little.
fn moving(n: usize, side_m: f64, k: u64) -> AgentStates {
    let draws = Draws::new(21, Purpose::Scenario);
    let mut states = AgentStates::at_origin(n);
    for i in 0..n {
        let coordinate_m = |axis: u64| side_m * draws.uniform(i as u64, 0, axis);
        states.x_m[i] = coordinate_m(0) + 0.3 * k as f64;
        states.y_m[i] = coordinate_m(1) - 0.01 * (k * i as u64) as f64;
    }
    states
}

/// What a network hears in three periods: a line for each, to see what has changed, and a digest of all deliveries, readings
/// included.
fn pinned(n: usize, side_m: f64, config: &str) -> String {
    let mut setup = setup(n, config);
    setup.columns = vec![DeliveryColumn::RssiDbm];
    let (mut network, _) = started(&setup);
    let mut read = AgentStates::default();
    let mut lines = String::new();
    for k in 0..3 {
        let states = moving(n, side_m, k);
        let deliveries = period(&mut network, &states, k).deliveries;
        // Disguised as positions, which the digest covers bit by bit.
        read.x_m.extend(deliveries.rssi_dbm.iter().map(|&dbm| f64::from(dbm)));
        let of_deliveries = of_step(k, k * STEP_NS, &states, Some(&deliveries));
        read.y_m.extend(of_deliveries.map(f64::from));
        lines += &line(n, k, &states, &deliveries);
    }
    let digest = hex(&of_step(3, 3 * STEP_NS, &read, None));
    format!("{n} agents in {side_m} m\n{config}\n{HEADING}{lines}{digest}\n")
}

/// The columns of [`line`].
const HEADING: &str = "  period | frames | deliveries | RSSI (dBm): mean, least, greatest | agent 1 at (m) | hears | first: from, RSSI (dBm)\n";

/// One period in a line: all agents in short, and agent 1 as an example.
fn line(n: usize, k: u64, states: &AgentStates, deliveries: &Deliveries) -> String {
    let rssi_dbm: Vec<f64> = deliveries.rssi_dbm.iter().map(|&dbm| f64::from(dbm)).collect();
    let total: usize = (0..n).map(|agent| deliveries.heard_by(agent).count()).sum();
    assert_eq!(total, rssi_dbm.len(), "a reading for each delivery");
    let mean_dbm = rssi_dbm.iter().sum::<f64>() / total as f64;
    let least_dbm = rssi_dbm.iter().copied().fold(f64::INFINITY, f64::min);
    let greatest_dbm = rssi_dbm.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    // Readings are in the order of the receivers, so those of agent 0 come first.
    let before = deliveries.heard_by(0).count();
    let first = deliveries.heard_by(1).next().map_or("-".to_owned(), |frame| {
        format!("{}, {:.2}", deliveries.transmissions.sender[frame], rssi_dbm[before])
    });
    format!(
        "  {k:6} | {:6} | {total:10} | {mean_dbm:10.2}, {least_dbm:9.2}, {greatest_dbm:10.2} | {:6.2}, {:5.2} | {:5} | {first}\n",
        deliveries.transmissions.sender.len(),
        states.x_m[1],
        states.y_m[1],
        deliveries.heard_by(1).count(),
    )
}

/// Agents, side of the square (m), configuration. Their digests were computed by the program of the day when judging links by
/// bounds was still simple, and compared then with the double loop over all links (`independence.rs`).
const CASES: &[(usize, f64, &str)] = &[
    (50, 10.0, "[phy]\npropagation = \"experimental-randomness\""),
    (300, 10.0, "[phy]\npropagation = \"experimental-randomness\""),
    (
        300,
        90.0,
        "[phy]\npropagation = \"experimental-randomness\"\ntx_power_dbm = -6\nredraw = \"frame\"",
    ),
    (150, 30.0, "[phy]\npropagation = \"experimental-randomness\"\nredraw = \"frozen\""),
    (150, 30.0, "[phy]\npropagation = \"experimental-randomness\"\nredraw = \"coherence\""),
    (
        300,
        10.0,
        "hopping_sequence = [11, 26, 17]\n[phy]\npropagation = \"experimental-randomness\"",
    ),
    (
        300,
        200.0,
        "hopping_sequence = [11, 26, 17]\n[phy]\npropagation = \"friis\"\nnoise_sd_db = 1.5",
    ),
    (300, 900.0, "[phy]\npropagation = \"friis\""),
    (400, 40.0, "[phy]\npropagation = \"probabilistic-disk\""),
    (
        400,
        40.0,
        "[phy]\npropagation = \"probabilistic-disk\"\n[[phy.effect]]\nkind = \"shadowing\"\nsd_db = 2",
    ),
    (
        200,
        60.0,
        "[phy]\npropagation = \"log-distance\"\nexponent = 3\n[phy.reception]\nkind = \"o-qpsk\"\n\
                 [[phy.effect]]\nkind = \"shadowing\"\nsd_db = 4\n[[phy.effect]]\nkind = \"shadowing\"\nsd_db = 3\n\
                 decorrelation_m = 1",
    ),
    (200, 30.0, "[phy]\npropagation = \"gaussian\"\nsigma_m = 6"),
];

#[test]
fn deliveries_and_readings_stay_as_they_are_bit_for_bit() {
    let all: Vec<String> =
        CASES.iter().map(|&(n, side_m, config)| pinned(n, side_m, config)).collect();
    insta::assert_snapshot!(all.join("\n"));
}
