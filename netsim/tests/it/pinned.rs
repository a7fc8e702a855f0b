//! What a few networks hear, pinned: whoever makes the physics faster must not change it.

use super::harness::{STEP_NS, period, setup, started};
use proto::digest::{hex, of_step};
use proto::rng::{Draws, Purpose};
use proto::types::{AgentStates, DeliveryColumn};

/// `n` agents, uniform in a square; in period k each one has moved a little.
fn moving(n: usize, side_m: f64, k: u64) -> AgentStates {
    let draws = Draws::new(21, Purpose::Scenario);
    let mut states = AgentStates::at_origin(n);
    for i in 0..n {
        let at = |axis: u64| side_m * draws.uniform(i as u64, 0, axis);
        states.x_m[i] = at(0) + 0.3 * k as f64;
        states.y_m[i] = at(1) - 0.01 * (k * i as u64) as f64;
    }
    states
}

/// A digest of the deliveries of three periods, readings included.
fn digest(n: usize, side_m: f64, config: &str) -> String {
    let mut setup = setup(n, config);
    setup.columns = vec![DeliveryColumn::RssiDbm];
    let (mut network, _) = started(&setup);
    let mut read = AgentStates::default();
    for k in 0..3 {
        let states = moving(n, side_m, k);
        let deliveries = period(&mut network, &states, k).deliveries;
        // Disguised as positions, which the digest covers bit by bit.
        read.x_m.extend(deliveries.rssi_dbm.iter().map(|&dbm| f64::from(dbm)));
        let of_deliveries = of_step(k, k * STEP_NS, &states, Some(&deliveries));
        read.y_m.extend(of_deliveries.map(f64::from));
    }
    hex(&of_step(3, 3 * STEP_NS, &read, None))
}

/// Agents, side of the square (m), configuration, digest. Computed by the program of the day when judging links by bounds
/// was still simple, and compared then with the double loop over all links (`independence.rs`).
const CASES: &[(usize, f64, &str, &str)] = &[
    (
        50,
        10.0,
        "[phy]\npropagation = \"experimental-randomness\"",
        "e17766bb9ef20252d3d6b1bcd3ac09f8df9b4e1ff1499f6de1c2b0dbc354615e",
    ),
    (
        300,
        10.0,
        "[phy]\npropagation = \"experimental-randomness\"",
        "436d52db07b662ceacd9c11e6b8ce000e1ca0a760531d6efb0ee6ecaab34e684",
    ),
    (
        300,
        90.0,
        "[phy]\npropagation = \"experimental-randomness\"\ntx_power_dbm = -6\nredraw = \"frame\"",
        "b1f15ae13b6e9f7ca519a3b05553bafd64a381885b8318e23b3de5a214e2a7ca",
    ),
    (
        150,
        30.0,
        "[phy]\npropagation = \"experimental-randomness\"\nredraw = \"frozen\"",
        "adcc6eb71c60fc22ae3c85b22cd533bab76f864fc90d5ece736a59ff43e7f853",
    ),
    (
        150,
        30.0,
        "[phy]\npropagation = \"experimental-randomness\"\nredraw = \"coherence\"",
        "ec6a9dfffed1fef68e0474b49822aba8856201724adbf8d888f0a98b62c63cd3",
    ),
    (
        300,
        10.0,
        "hopping_sequence = [11, 26, 17]\n[phy]\npropagation = \"experimental-randomness\"",
        "2930b98b0f699928c24899cfaf9b0344a88e62326482057456f5620ddc576fb6",
    ),
    (
        300,
        200.0,
        "hopping_sequence = [11, 26, 17]\n[phy]\npropagation = \"friis\"\nnoise_sd_db = 1.5",
        "eeea969b5157430359e71584b83cf9cc85fc9e28301110741a4a3aa9fb05099e",
    ),
    (
        300,
        900.0,
        "[phy]\npropagation = \"friis\"",
        "6db72f4416bf2df061059f190837f778a3b122ad581bc19974ceee1b2eaa3450",
    ),
    (
        400,
        40.0,
        "[phy]\npropagation = \"probabilistic-disk\"",
        "c73198e92787b153e290a1ea25fb33889fdee42906d29c6ddd0313426ce173ea",
    ),
    (
        400,
        40.0,
        "[phy]\npropagation = \"probabilistic-disk\"\n[[phy.effect]]\nkind = \"shadowing\"\nsd_db = 2",
        "9a2fa12540fbab89893e80607343629b449dfdba9b98d3cd450548c63a4f12d8",
    ),
    (
        200,
        60.0,
        "[phy]\npropagation = \"log-distance\"\nexponent = 3\n[phy.reception]\nkind = \"o-qpsk\"\n\
                 [[phy.effect]]\nkind = \"shadowing\"\nsd_db = 4\n[[phy.effect]]\nkind = \"shadowing\"\nsd_db = 3\n\
                 decorrelation_m = 1",
        "3ef415f6b45dc0f15532e17ba4d4063449020899a845262d4e851b20aa850793",
    ),
    (
        200,
        30.0,
        "[phy]\npropagation = \"gaussian\"\nsigma_m = 6",
        "4cd2a82f683affa7696e7caefabe4197c2d108f9b8e642fa8541131897aa4b50",
    ),
];

#[test]
fn deliveries_and_readings_stay_as_they_are_bit_for_bit() {
    let mut wrong = Vec::new();
    for &(n, side_m, config, expected) in CASES {
        let got = digest(n, side_m, config);
        if got != expected {
            wrong.push(format!("{n} in {side_m} m, {config:?}: {got}"));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}
