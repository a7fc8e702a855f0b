//! Delivery frequencies and readings of every model.

use super::harness::{
    count_heard, network, pairs_of, period, reading_dbm, setup, site, standing_at, started,
};
use netsim::catalogue::Catalogue;
use physics::propagation::{Reception, friis::friis_dbm};
use physics::reception::{Curve as _, table::Table};
use physics::{End, Scene};
use proto::ids::MoteId;
use proto::types::AgentStates;

/// 4.5 standard errors of a frequency over n draws, plus half a draw: a correct program exceeds it once in 150,000
/// comparisons. All seeds are fixed.
fn tolerance(p: f64, n: f64) -> f64 {
    4.5 * (p * (1.0 - p) / n).sqrt() + 0.5 / n
}

/// Frequency with which frames cross `distance_m`, over many pairs and periods. Pairs stand 100 km apart, so that only the
/// two of a pair can hear each other.
fn frequency(config: &str, distance_m: f64) -> (f64, f64) {
    let n_pairs = 500;
    let n_periods = 40;
    let places: Vec<(f64, f64)> = (0..n_pairs)
        .flat_map(|pair| {
            let x_m = 1e5 * f64::from(pair);
            [(x_m, 0.0), (x_m, distance_m)]
        })
        .collect();
    let states = standing_at(&places);
    let mut network = network(places.len(), config);
    let n_heard: usize =
        (0..n_periods).map(|k| period(&mut network, &states, k).deliveries.n_deliveries()).sum();
    let n_sent = f64::from(2 * n_pairs) * n_periods as f64;
    (n_heard as f64 / n_sent, n_sent)
}

fn assert_frequency(config: &str, distance_m: f64, expected: f64, rounding: f64) {
    let (got, n) = frequency(config, distance_m);
    let tolerance = tolerance(expected, n) + rounding;
    assert!(
        (got - expected).abs() < tolerance,
        "{config} at {distance_m} m: {got}, not {expected}"
    );
}

const AT_2_4_GHZ: &str = "carrier_hz = 2.4e9\n";

#[test]
fn val_6tisch_simulator_probability_40_db_below_friis() {
    for (distance_m, expected) in
        [(1.0, 0.9900), (2.0, 0.9552), (3.0, 0.8643), (5.0, 0.4017), (7.0, 0.0069), (7.04, 0.0)]
    {
        let config = format!("[phy]\npropagation = \"probabilistic-disk\"\n{AT_2_4_GHZ}");
        assert_frequency(&config, distance_m, expected, 0.000_05);
    }
}

#[test]
fn val_6tisch_simulator_probability_20_db_below_friis() {
    // Its mean model without the wrong clamp: Friis with a system gain of -20 dB.
    for (distance_m, expected) in
        [(10.0, 0.9900), (20.0, 0.9552), (50.0, 0.4017), (70.0, 0.0069), (100.0, 0.0)]
    {
        let config = format!(
            "[phy]\npropagation = \"friis\"\n{AT_2_4_GHZ}[[phy.effect]]\nkind = \"system-gain\"\ngain_db = -20.0\n"
        );
        assert_frequency(&config, distance_m, expected, 0.000_05);
    }
}

#[test]
fn val_expected_probability_of_experimental_randomness() {
    // Uniform over 40 dB, through the table. Levels are drawn per pair and period: both directions share one, so that
    // 40,000 frames are worth at least 20,000 independent ones.
    for (distance_m, expected) in [
        (1.0, 0.9999),
        (2.0, 0.9961),
        (5.0, 0.9547),
        (7.0, 0.8959),
        (10.0, 0.8185),
        (20.0, 0.6680),
        (30.0, 0.5799),
        (50.0, 0.4690),
        (70.0, 0.3960),
        (100.0, 0.3186),
        (200.0, 0.1719),
        (300.0, 0.0910),
        (500.0, 0.0144),
        (703.7, 0.0),
    ] {
        for redraw in ["period", "frame"] {
            let config = format!(
                "[phy]\npropagation = \"experimental-randomness\"\nredraw = {redraw:?}\n{AT_2_4_GHZ}"
            );
            let (got, n) = frequency(&config, distance_m);
            let tolerance = tolerance(expected, n / 2.0) + 0.000_05;
            assert!((got - expected).abs() < tolerance, "{distance_m} m, {redraw}: {got}");
        }
    }
}

#[test]
fn frozen_and_coherent_levels_have_the_same_mean_over_many_links() {
    for redraw in ["frozen", "coherence"] {
        let config = format!(
            "[phy]\npropagation = \"experimental-randomness\"\nredraw = {redraw:?}\n{AT_2_4_GHZ}"
        );
        // Nobody moves: one level per link for good, 500 independent ones. A level decides almost all of a link's frames.
        let (got, _) = frequency(&config, 20.0);
        let tolerance = tolerance(0.6680, 500.0);
        assert!((got - 0.6680).abs() < tolerance, "{redraw}: {got}");
    }
}

#[test]
fn levels_are_redrawn_when_they_should_be() {
    // At 20 m two thirds of the levels let nearly everything pass, one third nearly nothing.
    let states = standing_at(&[(0.0, 0.0), (20.0, 0.0)]);
    let moving = standing_at(&[(0.0, 5.0), (20.0, 5.0)]);
    let heard = |redraw: &str, moves: bool| -> Vec<[bool; 2]> {
        let config =
            format!("[phy]\npropagation = \"experimental-randomness\"\nredraw = {redraw:?}\n");
        let mut network = network(2, &config);
        (0..200)
            .map(|k| {
                let states = if moves && k % 2 == 1 { &moving } else { &states };
                let pairs = pairs_of(&period(&mut network, states, k).deliveries, 2);
                [pairs.contains(&(1, 0)), pairs.contains(&(0, 1))]
            })
            .collect()
    };
    let agreement = |list: &[[bool; 2]]| list.iter().filter(|[a, b]| a == b).count();
    let changes = |list: &[[bool; 2]]| list.windows(2).filter(|w| w[0][0] != w[1][0]).count();
    // Per period: both directions share the level, so they agree but where the curve is between (9 % of levels); the next
    // period is independent: it differs with probability 2 · 0.67 · 0.33 = 0.44, 88 ± 7 of 199.
    let period = heard("period", false);
    assert!(170 < agreement(&period), "{}", agreement(&period));
    assert!((57..120).contains(&changes(&period)), "{}", changes(&period));
    // Per frame: directions are independent, agreement 0.56: 111 ± 7 of 200.
    let frame = heard("frame", false);
    assert!((80..143).contains(&agreement(&frame)), "{}", agreement(&frame));
    // Frozen, and coherent at rest: the level stays; only a level where the curve is between lets the outcome change.
    for redraw in ["frozen", "coherence"] {
        let list = heard(redraw, false);
        assert!(changes(&list) < 57, "{redraw}: {}", changes(&list));
    }
    // Moving both ends by 5 m, a hundred and sixty half wavelengths: independent again.
    let moved = heard("coherence", true);
    assert!((57..120).contains(&changes(&moved)), "{}", changes(&moved));
}

#[test]
fn frames_arrive_with_the_frequency_that_each_model_states() {
    let sigma = |d: f64| (-d * d / 8.0).exp();
    for (config, distance_m, expected) in [
        ("[phy]\npropagation = \"unit-disk\"\nradius_m = 3", 3.0, 1.0),
        ("[phy]\npropagation = \"unit-disk\"\nradius_m = 3", 3.0001, 0.0),
        ("[phy]\npropagation = \"gaussian\"\nsigma_m = 2", 1.0, sigma(1.0)),
        ("[phy]\npropagation = \"gaussian\"\nsigma_m = 2", 3.0, sigma(3.0)),
        ("[phy]\npropagation = \"gaussian\"\nsigma_m = 2", 7.0, sigma(7.0)),
        ("[phy]\npropagation = \"line-of-sight\"\nradius_m = 5", 5.0, 1.0),
        ("[phy]\npropagation = \"line-of-sight\"\nradius_m = 5", 5.1, 0.0),
        ("[phy]\npropagation = \"nearest-k\"\nk = 1", 77.0, 1.0),
    ] {
        assert_frequency(config, distance_m, expected, 0.0);
    }
    let friis = |d: f64| friis_dbm(0.0, d, 2.44e9);
    let pdr = |rssi_dbm: f64| Table::dust().reception_probability(rssi_dbm);
    assert_frequency("[phy]\npropagation = \"friis\"", 450.0, pdr(friis(450.0)), 0.0);
    let log_distance = friis(2.0) - 35.0 * (20.0f64 / 2.0).log10();
    assert_frequency(
        "[phy]\npropagation = \"log-distance\"\nexponent = 3.5\nreference_distance_m = 2\ntx_power_dbm = -12",
        20.0,
        pdr(log_distance - 12.0),
        0.0,
    );
    // O-QPSK at 0.5 dB: a bit error rate of 5.9e-5 over 160 bits leaves 99.1 %; at -1 dB 0.00114 leaves 83.3 %.
    let noise_dbm = friis(100.0) + 1.0;
    assert_frequency(
        &format!(
            "[phy]\npropagation = \"friis\"\n[phy.reception]\nkind = \"o-qpsk\"\nframe_bytes = 20\nnoise_floor_dbm = {noise_dbm}"
        ),
        100.0,
        (1.0f64 - 0.00114).powi(160),
        0.0015, // the bit error rate has three digits
    );
}

#[test]
fn noise_and_shadowing_change_reception_as_their_distribution_says() {
    // Mean -94 dBm; with a normal deviation the expected probability is the mean over it, by the trapezoidal rule.
    let distance_m = 5.0;
    let offset_db = -94.0 - friis_dbm(0.0, distance_m, 2.44e9);
    let expected = |sd_db: f64| -> f64 {
        let table = Table::dust();
        let steps = 4000;
        (0..=steps)
            .map(|i| {
                let z = 10.0 * f64::from(i) / f64::from(steps) - 5.0;
                let density = (-0.5 * z * z).exp() / (2.0 * std::f64::consts::PI).sqrt();
                table.reception_probability(-94.0 + sd_db * z) * density * 10.0 / f64::from(steps)
            })
            .sum()
    };
    assert_frequency(
        &format!("[phy]\ntx_power_dbm = {offset_db}\nnoise_sd_db = 3.0"),
        distance_m,
        expected(3.0),
        1e-5,
    );
    let (got, _) = frequency(
        &format!(
            "[phy]\ntx_power_dbm = {offset_db}\n[[phy.effect]]\nkind = \"shadowing\"\nsd_db = 6.0"
        ),
        distance_m,
    );
    // Nobody moves: 500 independent values.
    assert!((got - expected(6.0)).abs() < tolerance(0.5, 500.0), "{got}");
}

#[test]
fn readings_are_what_the_physics_says() {
    let close = |got: Option<f32>, expected: f64| {
        // f32 at -60: 4e-6.
        assert!(
            got.is_some_and(|got| (f64::from(got) - expected).abs() < 1e-5),
            "{got:?}, {expected}"
        );
    };
    // The catalogue's example: Friis at 10 m, 0 dBm, 2.4 GHz.
    let got = reading_dbm(&format!("[phy]\n{AT_2_4_GHZ}"), 10.0).unwrap();
    assert!((got - -60.05).abs() < 0.005, "{got}");
    let friis = |d: f64| friis_dbm(0.0, d, 2.44e9);
    close(reading_dbm("[phy]", 7.0), friis(7.0));
    close(
        reading_dbm(
            "[phy]\ntx_power_dbm = 3\ntx_antenna_gain_dbi = 2\nrx_antenna_gain_dbi = -1",
            7.0,
        ),
        friis(7.0) + 4.0,
    );
    close(reading_dbm("[phy]\npropagation = \"full\"", 7.0), friis(7.0));
    close(reading_dbm("[phy]\npropagation = \"full\"\nrssi_dbm = -10", 7.0), -10.0);
    close(reading_dbm("[phy]\npropagation = \"full\"", 0.01), friis(0.1));
    let gain = |register_only: bool| {
        format!(
            "[phy]\n[[phy.effect]]\nkind = \"system-gain\"\ngain_db = 30\nregister_only = {register_only}"
        )
    };
    close(reading_dbm(&gain(false), 7.0), friis(7.0) + 30.0);
    close(reading_dbm(&gain(true), 7.0), friis(7.0) + 30.0);
    // At 1000 m nothing arrives, unless the gain is real.
    close(reading_dbm(&gain(false), 1000.0), friis(1000.0) + 30.0);
    assert_eq!(reading_dbm(&gain(true), 1000.0), None);
    // Channel 26 alone.
    let got = reading_dbm("hopping_sequence = [26]", 10.0);
    close(got, friis_dbm(0.0, 10.0, 2.48e9));
}

#[test]
fn antenna_height_is_added_where_positions_are_planar() {
    let model = "propagation = \"line-of-sight\"\nantenna_height_m = 2.0";
    let mut setup = setup(2, &format!("[phy]\n{model}"));
    setup.site = site("[[wall]]\nfrom_m = [1, -1]\nto_m = [1, 1]\nheight_m = 1.5");
    let mut states = standing_at(&[(0.0, 0.0), (2.0, 0.0)]);
    let (mut network, _) = started(&setup);
    assert_eq!(period(&mut network, &states, 0).deliveries.n_deliveries(), 2);
    states.z_m[1] = 0.5;
    assert_eq!(period(&mut network, &states, 1).deliveries.n_deliveries(), 0);
}

#[test]
fn walls_obstacles_and_robots_block_the_line_of_sight() {
    let mut setup = setup(
        4,
        "[phy]\npropagation = \"line-of-sight\"\nrobots_block = true\nbody_radius_m = 0.2",
    );
    setup.site = site(
        "[[wall]]\nfrom_m = [-1, 1]\nto_m = [1, 1]\n[[obstacle]]\nname = \"box\"\ncentre_m = [2, 0]\nradius_m = 0.3",
    );
    // 0 at the origin, 1 behind the wall, 2 behind the box, 3 to the west.
    let mut states = standing_at(&[(0.0, 0.0), (0.0, 2.0), (4.0, 0.0), (-2.0, 0.0)]);
    let (mut network, _) = started(&setup);
    let both = |list: &[(u32, u32)]| -> Vec<(u32, u32)> {
        let mut all: Vec<_> = list.iter().flat_map(|&(a, b)| [(a, b), (b, a)]).collect();
        all.sort_unstable();
        all
    };
    let heard = pairs_of(&period(&mut network, &states, 0).deliveries, 4);
    // 1 and 3 see each other past the wall's end at x = -1, y = 1 exactly: touching is cutting. 2 and 3: the box.
    assert_eq!(heard, both(&[(0, 3), (1, 2)]));
    // 0 steps out of the way... and now stands between nobody; 3 moves so that 0's body is between it and 2's ray.
    states.y_m[3] = -0.5;
    states.x_m[3] = -4.0;
    let heard = pairs_of(&period(&mut network, &states, 1).deliveries, 4);
    assert_eq!(heard, both(&[(0, 3), (1, 2), (1, 3)]));
}

#[test]
fn a_field_of_view_follows_the_heading_or_else_the_motion() {
    let mut network = network(3, "[phy]\npropagation = \"line-of-sight\"\nfield_of_view_rad = 1.6");
    let mut states = standing_at(&[(0.0, 0.0), (5.0, 0.0), (0.0, 5.0)]);
    let heard_of_0 = |network: &mut netsim::sim::Network, states: &AgentStates| -> Vec<u32> {
        let deliveries = period(network, states, 0).deliveries;
        pairs_of(&deliveries, 3).into_iter().filter(|p| p.1 == 0).map(|p| p.0).collect()
    };
    assert_eq!(heard_of_0(&mut network, &states), [1, 2], "at rest, no heading: all round");
    states.vx_mps[0] = 1.0;
    assert_eq!(heard_of_0(&mut network, &states), [1]);
    states.heading_rad = vec![std::f64::consts::FRAC_PI_2; 3];
    assert_eq!(heard_of_0(&mut network, &states), [2], "the heading counts, not the motion");
}

#[test]
fn everyone_hears_its_k_nearest() {
    let mut network = network(4, "[phy]\npropagation = \"nearest-k\"\nk = 2");
    let states = standing_at(&[(0.0, 0.0), (1.0, 0.0), (3.0, 0.0), (7.0, 0.0)]);
    let heard = pairs_of(&period(&mut network, &states, 0).deliveries, 4);
    assert_eq!(heard, [(0, 1), (0, 2), (1, 0), (1, 2), (2, 0), (2, 1), (3, 1), (3, 2)]);
}

#[test]
fn the_model_that_is_evaluated_against_rows_is_the_one_that_runs() {
    let setup = setup(2, "[phy]\npropagation = \"gaussian\"\nsigma_m = 2");
    let (config, ..) = netsim::config::read(&setup, Catalogue::built_in()).unwrap();
    let scene = Scene::default();
    let [a, b] = [End::new(MoteId(0), [0.0; 3]), End::new(MoteId(1), [3.0, 0.0, 0.0])];
    let budget = config.model.evaluate(&config.model.link(&scene, a, b, None, 0));
    let mut network = network(2, "[phy]\npropagation = \"gaussian\"\nsigma_m = 2");
    let n = 2000;
    let got = count_heard(&mut network, &standing_at(&[(0.0, 0.0), (3.0, 0.0)]), 0, 1, n) as f64
        / n as f64;
    let p = budget.reception_probability;
    assert!((got - p).abs() < tolerance(p, n as f64), "{got}, {p}");
    let prediction = config.model.propagation.predict(&config.model.link(&scene, a, b, None, 0));
    assert_eq!(prediction.reception, Reception::Stated(p));
}
