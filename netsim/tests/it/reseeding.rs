//! Restoring with another seed: draws to come are those of that seed, and nothing else changes.

use crate::harness::{STEP_NS, period, setup, standing_at, started};
use crate::model::scenario::{FUNCTIONS, RADIOS, Scenario, Spice};
use netsim::sim::Network;
use proto::side::NetSimulator as _;
use proto::types::DeliveryColumn;

/// A network in the state of a snapshot, with another seed if one is given.
fn restored(saved: &[u8], seed: Option<u64>) -> Network {
    let mut network = Network::default();
    network.restore(saved).expect("the snapshot is of this network");
    if let Some(seed) = seed {
        network.reseed(seed);
    }
    network
}

/// What is on the air and heard over some control periods.
fn traffic(scenario: &Scenario, network: &mut Network, periods: std::ops::Range<u64>) -> Vec<u8> {
    let mut traffic = Vec::new();
    for period in periods {
        let (from_ns, until_ns) = (period * STEP_NS, (period + 1) * STEP_NS);
        let output = scenario.step_network(network, from_ns, until_ns);
        traffic.extend_from_slice(&output.capture);
        traffic.extend(output.deliveries.n_deliveries().to_le_bytes());
    }
    traffic
}

#[test]
fn the_full_network_goes_on_with_its_own_seed_and_differs_with_another() {
    for (i, function) in FUNCTIONS.iter().enumerate() {
        for (k, radio) in RADIOS.iter().enumerate() {
            let seed = 4000 + 10 * i as u64 + k as u64;
            let scenario = Scenario::draw(function, radio, Spice::ALL, seed, 16);
            let end = scenario.end_ns / STEP_NS;
            let mut network = scenario.network();
            traffic(&scenario, &mut network, 0..end / 2);
            let saved = network.snapshot();
            let went_on = traffic(&scenario, &mut network, end / 2..end);
            let with = |seed| {
                let mut twin = restored(&saved, seed);
                let traffic = traffic(&scenario, &mut twin, end / 2..end);
                (traffic, twin.snapshot())
            };
            let what = &scenario.config;
            assert!(with(None) == (went_on.clone(), network.snapshot()), "{what}");
            assert!(with(Some(scenario.seed)) == (went_on.clone(), network.snapshot()), "{what}");
            let other = with(Some(77));
            assert!(other == with(Some(77)), "{what}");
            assert!(other.0 != went_on, "{what}");
            assert!(other.0 != with(Some(78)).0, "{what}");
            // Saved once more on the way, it keeps the later seed.
            let mut twin = restored(&saved, Some(77));
            let middle = end / 2 + end / 4;
            let mut parts = traffic(&scenario, &mut twin, end / 2..middle);
            let mut again = restored(&twin.snapshot(), None);
            parts.extend(traffic(&scenario, &mut again, middle..end));
            assert!((parts, again.snapshot()) == other, "{what}");
        }
    }
}

/// Pairs of robots 100 km apart, the two of each at a distance at which 0.40 of frames arrive.
fn pairs(n_pairs: u32) -> Vec<(f64, f64)> {
    (0..n_pairs)
        .flat_map(|pair| {
            let x_m = 1e5 * f64::from(pair);
            [(x_m, 0.0), (x_m, 5.0)]
        })
        .collect()
}

#[test]
fn receptions_after_another_seed_have_the_same_probability_and_are_independent() {
    const N_PERIODS: u64 = 40;
    let states = standing_at(&pairs(500));
    let setup = setup(1000, "[phy]\npropagation = \"probabilistic-disk\"\ncarrier_hz = 2.4e9\n");
    let (mut network, _) = started(&setup);
    for k in 0..3 {
        period(&mut network, &states, k);
    }
    let saved = network.snapshot();
    let heard = |seed: Option<u64>| -> Vec<bool> {
        let mut network = restored(&saved, seed);
        let mut heard = Vec::new();
        for k in 3..3 + N_PERIODS {
            let deliveries = period(&mut network, &states, k).deliveries;
            let mut column = vec![false; 1000];
            for (sender, _) in crate::harness::pairs(&deliveries) {
                column[sender as usize] = true;
            }
            heard.extend(column);
        }
        heard
    };
    let (own, other) = (heard(None), heard(Some(99)));
    let n = own.len() as f64;
    let share = |heard: &[bool]| heard.iter().filter(|&&heard| heard).count() as f64 / n;
    // The probability of val_6tisch_simulator_probability_40_db_below_friis at 5 m. n = 40,000: the standard error of a
    // frequency is 0.0025; 4.5 of them are exceeded once in 150,000.
    let p = 0.4017;
    for frequency in [share(&own), share(&other)] {
        assert!((frequency - p).abs() < 4.5 * (p * (1.0 - p) / n).sqrt(), "{frequency}");
    }
    let alike: Vec<bool> = own.iter().zip(&other).map(|(a, b)| a == b).collect();
    let expected = p * p + (1.0 - p) * (1.0 - p);
    let bound = 4.5 * (expected * (1.0 - expected) / n).sqrt();
    assert!((share(&alike) - expected).abs() < bound, "{}", share(&alike));
}

#[test]
fn what_lasts_keeps_its_seed_and_noise_gets_the_other() {
    let readings = |noise: &str, seed: Option<u64>| -> Vec<f32> {
        let config = format!(
            "[phy]\npropagation = \"friis\"\n{noise}[[phy.effect]]\nkind = \"shadowing\"\nsd_db = 4\n\
             [[phy.effect]]\nkind = \"node-offset\"\ntx_sd_db = 2\nrx_sd_db = 2\n"
        );
        let mut setup = setup(6, &config);
        setup.columns = vec![DeliveryColumn::RssiDbm];
        let (mut network, _) = started(&setup);
        let states = standing_at(&[0.0, 1.0, 2.0, 3.0, 4.0, 5.0].map(|x_m| (x_m, 0.0)));
        period(&mut network, &states, 0);
        let mut network = restored(&network.snapshot(), seed);
        let readings = period(&mut network, &states, 1).deliveries.rssi_dbm;
        assert_eq!(readings.len(), 30, "everyone hears everyone");
        readings
    };
    assert_eq!(readings("", None), readings("", Some(9)));
    assert_ne!(readings("noise_sd_db = 2\n", None), readings("noise_sd_db = 2\n", Some(9)));
}
