//! What must not disturb what: effects, robots, threads, steps.

use super::harness::{STEP_NS, interval, network, pairs_of, period, setup, standing_at, started};
use netsim::catalogue::Catalogue;
use proptest::prelude::*;
use proto::ids::MoteId;
use proto::rng::{Draws, Purpose};
use proto::side::NetSimulator as _;
use proto::types::{AgentStates, Deliveries, DeliveryColumn};

/// `n` agents, uniform in a square.
fn scattered(n: usize, side_m: f64, seed: u64) -> AgentStates {
    let draws = Draws::new(seed, Purpose::Scenario);
    let places: Vec<(f64, f64)> = (0..n as u64)
        .map(|i| (side_m * draws.uniform(i, 0, 0), side_m * draws.uniform(i, 0, 1)))
        .collect();
    standing_at(&places)
}

const MODELS: [&str; 10] = [
    "propagation = \"nearest-k\"\nk = 5",
    "propagation = \"full\"",
    "propagation = \"friis\"\ntx_power_dbm = -40",
    "propagation = \"unit-disk\"\nradius_m = 6",
    "propagation = \"line-of-sight\"\nradius_m = 9\nrobots_block = true",
    "propagation = \"gaussian\"\nsigma_m = 4",
    "propagation = \"probabilistic-disk\"",
    "propagation = \"log-distance\"\nexponent = 4\ntx_power_dbm = -20",
    "propagation = \"experimental-randomness\"\ntx_power_dbm = -10",
    "propagation = \"experimental-randomness\"\ntx_power_dbm = -10\nredraw = \"coherence\"",
];

#[test]
fn a_robot_far_out_of_range_changes_no_draw() {
    for model in MODELS {
        let mut few = network(40, &format!("[phy]\n{model}"));
        let mut more = network(41, &format!("[phy]\n{model}"));
        let states = scattered(40, 20.0, 3);
        let mut places: Vec<(f64, f64)> =
            states.x_m.iter().copied().zip(states.y_m.iter().copied()).collect();
        places.push((1e7, -1e7));
        let with_far = standing_at(&places);
        for k in 0..5 {
            let expected = pairs_of(&period(&mut few, &states, k).deliveries, 40);
            let mut got = pairs_of(&period(&mut more, &with_far, k).deliveries, 41);
            got.retain(|&(receiver, sender)| receiver < 40 && sender < 40);
            assert!(!expected.is_empty() && expected == got, "{model}, period {k}");
        }
    }
}

#[test]
fn an_unrelated_effect_changes_no_draw() {
    // What an effect must not do is to disturb other draws. These leave every level as it is: most are without any
    // strength, some only change readings, one is undone by another.
    let unrelated = [
        "[[phy.effect]]\nkind = \"multipath\"\nsd_db = 0.0",
        "[[phy.effect]]\nkind = \"node-offset\"\ntx_db = [0.0, 0.0]",
        "[[phy.effect]]\nkind = \"path-loss-exponent\"\nexponent = 2",
        "[[phy.effect]]\nkind = \"noise-floor\"\nshift_db = 0",
        "[[phy.effect]]\nkind = \"wall-attenuation\"\nloss_db = 9",
        "[[phy.effect]]\nkind = \"body-blocking\"\nloss_db = 0",
        "[[phy.effect]]\nkind = \"vegetation\"\n[[phy.effect]]\nkind = \"diffraction\"",
        "[[phy.effect]]\nkind = \"interference\"\ncentre_mhz = 2437\nduty = 0.5",
        "[[phy.effect]]\nkind = \"motion-fading\"\nrician_k_db = 60",
        "[[phy.effect]]\nkind = \"temperature\"\ndb_per_c = -1",
        "[[phy.effect]]\nkind = \"receiver-nonlinearity\"\nsaturation_dbm = -60\nslope = 0.1",
        "[[phy.effect]]\nkind = \"formula\"\nexpression = \"0 * distance_m\"",
        "[[phy.effect]]\nkind = \"shadowing\"\nsd_db = 0.0",
        "[[phy.effect]]\nkind = \"system-gain\"\ngain_db = 0.0",
        "[[phy.effect]]\nkind = \"system-gain\"\ngain_db = 9.0\nregister_only = true",
        "[[phy.effect]]\nkind = \"system-gain\"\ngain_db = 8.0\n[[phy.effect]]\nkind = \"system-gain\"\ngain_db = -8.0",
    ];
    for model in MODELS {
        let states = scattered(100, 30.0, 4);
        let run = |effect: &str| -> Vec<Vec<(u32, u32)>> {
            let mut network = network(100, &format!("[phy]\n{model}\n{effect}"));
            (0..4).map(|k| pairs_of(&period(&mut network, &states, k).deliveries, 100)).collect()
        };
        let alone = run("");
        for effect in unrelated {
            assert_eq!(run(effect), alone, "{model} with {effect}");
        }
    }
}

#[test]
fn a_stronger_signal_loses_no_frame_that_a_weaker_one_brought() {
    // Each link is judged by the same draw with and without the gain, though the grid and the bounds differ.
    for model in MODELS {
        let states = scattered(100, 60.0, 5);
        let run = |gain_db: f64| -> Vec<(u32, u32)> {
            let effect = format!("[[phy.effect]]\nkind = \"system-gain\"\ngain_db = {gain_db}");
            let mut network = network(100, &format!("[phy]\n{model}\n{effect}"));
            pairs_of(&period(&mut network, &states, 0).deliveries, 100)
        };
        let (weaker, stronger) = (run(0.0), run(3.0));
        assert!(weaker.iter().all(|pair| stronger.contains(pair)), "{model}");
    }
}

#[test]
fn shadowing_of_one_kind_does_not_disturb_another() {
    // Readings with two shadowing effects are the sum of each alone: their draws are independent of each other's presence.
    let states = standing_at(&[(0.0, 0.0), (3.0, 0.0), (0.0, 4.0)]);
    let read = |effects: &[&str]| -> Vec<f32> {
        let effects: String = effects
            .iter()
            .map(|keys| format!("[[phy.effect]]\nkind = \"shadowing\"\n{keys}\n"))
            .collect();
        let mut setup = setup(3, &format!("[phy]\npropagation = \"full\"\n{effects}"));
        setup.columns = vec![DeliveryColumn::RssiDbm];
        period(&mut started(&setup).0, &states, 0).deliveries.rssi_dbm
    };
    let none = read(&[]);
    let one = read(&["sd_db = 3"]);
    // As the second of two, with another strength: the first one's contribution stays.
    let with_silent_second = read(&["sd_db = 3", "sd_db = 0"]);
    assert_eq!(one, with_silent_second);
    let silent_first = read(&["sd_db = 0", "sd_db = 3"]);
    assert_ne!(one, silent_first);
    let both = read(&["sd_db = 3", "sd_db = 3"]);
    for i in 0..none.len() {
        let sum = one[i] + silent_first[i] - none[i];
        assert!((both[i] - sum).abs() < 1e-4, "{} and {sum}", both[i]); // f32
    }
}

#[test]
fn the_number_of_threads_changes_nothing() {
    for model in MODELS {
        let states = scattered(700, 50.0, 6);
        let run = |n_threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(n_threads).build().unwrap();
            pool.install(|| {
                let mut setup = setup(700, &format!("[phy]\n{model}\nnoise_sd_db = 2.0"));
                setup.columns = vec![DeliveryColumn::RssiDbm];
                let (mut network, _) = started(&setup);
                (0..2).map(|k| period(&mut network, &states, k).deliveries).collect::<Vec<_>>()
            })
        };
        assert!(run(1) == run(3), "{model}");
    }
}

#[test]
fn steps_of_any_length_bring_the_same_frames() {
    for model in MODELS {
        // More than two tiles of 64: radios that are silent in a step lie in several.
        let states = scattered(150, 40.0, 8);
        let config = format!("[phy]\n{model}");
        let whole: Vec<_> = {
            let mut network = network(150, &config);
            let deliveries = interval(&mut network, &states, 0, 3 * STEP_NS).deliveries;
            frames_heard(&deliveries, 150)
        };
        for cuts in [vec![STEP_NS, 2 * STEP_NS], vec![7, 30_000_000, 30_000_001, 215_000_000]] {
            let mut network = network(150, &config);
            let mut from_ns = 0;
            let mut parts = Vec::new();
            for until_ns in cuts.into_iter().chain([3 * STEP_NS]) {
                let output = interval(&mut network, &states, from_ns, until_ns);
                assert_eq!(output.time_ns, until_ns);
                parts.extend(frames_heard(&output.deliveries, 150));
                from_ns = until_ns;
            }
            parts.sort_unstable();
            assert_eq!(parts, whole, "{model}");
        }
    }
}

/// (sent, sender, receiver), sorted.
fn frames_heard(deliveries: &proto::types::Deliveries, n: usize) -> Vec<(u64, u32, u32)> {
    let sent = &deliveries.transmissions;
    let mut frames: Vec<(u64, u32, u32)> = (0..n)
        .flat_map(|receiver| {
            let key = move |f: usize| (sent.sent_ns[f], sent.sender[f], receiver as u32);
            deliveries.heard_by(receiver).map(key)
        })
        .collect();
    frames.sort_unstable();
    frames
}

#[test]
fn another_seed_gives_other_deliveries() {
    let states = scattered(60, 20.0, 9);
    let run = |seed: u64| {
        let mut setup = setup(60, "[phy]\npropagation = \"probabilistic-disk\"");
        setup.experiment.seed = seed;
        let mut network = netsim::sim::Network::default();
        network.configure(&setup).unwrap();
        pairs_of(&period(&mut network, &states, 0).deliveries, 60)
    };
    assert_eq!(run(5), run(5));
    assert_ne!(run(5), run(6));
}

/// What the plain double loop over the physics says: receiver, sender and bits of the reading.
fn plainly(
    setup: &proto::side::Setup,
    states: &AgentStates,
    period_ns: u64,
) -> Vec<(u32, u32, u32)> {
    use physics::medium::{Air, Filters, Frame, Radios};
    use physics::{End, Scene};
    let (config, ..) =
        netsim::config::read(setup, Catalogue::built_in()).expect("a valid configuration");
    let n = states.len();
    let mut radios = Radios::default();
    for i in 0..n {
        radios.push(End::new(MoteId(i as u32), states.position_m(i)), 0.0);
        let sent_ns = period_ns + (i as u64 % config.n_slots) * config.slot.ns();
        let channel = config.hopping_sequence.first().map(|_| {
            let slot = (sent_ns / config.slot.ns()) as usize;
            config.hopping_sequence[slot % config.hopping_sequence.len()]
        });
        radios.frames.push(Frame { sent_ns, channel });
    }
    let mut scene = Scene { site: Some(&setup.site), agents: &radios.ends, ..Scene::default() };
    config.model.prepare(&mut scene);
    let air = Air {
        model: &config.model,
        filters: &Filters::default(),
        seeds: setup.experiment.seed.into(),
        period_ns,
        radios: &radios,
        scene: &scene,
    };
    let mut heard = Vec::new();
    for receiver in 0..n {
        for frame in (0..n).filter(|&frame| frame != receiver) {
            let mut pair = air.pair(receiver, frame);
            if air.hears(receiver, frame, &mut pair) {
                let read_dbm = air.budget(receiver, frame, &mut pair).register_rssi_dbm as f32;
                heard.push((receiver as u32, frame as u32, read_dbm.to_bits()));
            }
        }
    }
    heard
}

/// Receiver, sender and bits of the reading of every delivery, sorted.
fn readings_of(deliveries: &Deliveries, n: usize) -> Vec<(u32, u32, u32)> {
    let heard = (0..n).flat_map(|receiver| {
        deliveries.heard_by(receiver).map(move |frame| (receiver as u32, frame))
    });
    let mut readings: Vec<(u32, u32, u32)> = heard
        .zip(&deliveries.rssi_dbm)
        .map(|((receiver, frame), read_dbm)| {
            (receiver, deliveries.transmissions.sender[frame], read_dbm.to_bits())
        })
        .collect();
    assert_eq!(readings.len(), deliveries.rssi_dbm.len());
    readings.sort_unstable();
    readings
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(96))]

    #[test]
    fn shortcuts_agree_with_the_plain_double_loop(
        model in prop::sample::select(&MODELS[..]),
        extra in prop::sample::select(&[
            "",
            "noise_sd_db = 1.5",
            "[phy.reception]\nkind = \"o-qpsk\"",
            "[phy.reception]\nkind = \"table\"\npoints = [[-92, 0.0], [-91.999, 0.6], [-80, 0.9]]",
            "[[phy.effect]]\nkind = \"shadowing\"\nsd_db = 4",
            "[[phy.effect]]\nkind = \"system-gain\"\ngain_db = -6",
            "[[phy.effect]]\nkind = \"fast-fading\"\nk_factor_db = -60",
            "[[phy.effect]]\nkind = \"fast-fading\"\nk_factor_db = 18",
            "[[phy.effect]]\nkind = \"multipath\"\nsd_db = 4",
            "[[phy.effect]]\nkind = \"node-offset\"\ntx_sd_db = 2\nrx_sd_db = 1",
            "[[phy.effect]]\nkind = \"path-loss-exponent\"\nexponent = 3.3",
            "[[phy.effect]]\nkind = \"path-loss-exponent\"\nexponent = 1.7",
            "[[phy.effect]]\nkind = \"reception-curve\"\np50_dbm = -91\nwidth_db = 0.8",
            "[[phy.effect]]\nkind = \"noise-floor\"\nshift_db = 3\n[[phy.effect]]\nkind = \"multipath\"\nsd_db = 2",
            "[[phy.effect]]\nkind = \"interference\"\ncentre_mhz = 2437\nwidth_mhz = 90\nduty = 0.4\npower_dbm = -80\n\
             sir_threshold_db = 3",
            "[[phy.effect]]\nkind = \"hidden-obstacle\"\nloss_db = 9\ncentre_m = [9, 9]\nradius_m = 4",
            "[[phy.effect]]\nkind = \"body-blocking\"\nloss_db = 5",
            "[[phy.effect]]\nkind = \"formula\"\nexpression = \"3 * sin(distance_m)\"\nlimit_db = 3",
        ][..]),
        hopping in prop::sample::select(&["", "hopping_sequence = [11, 26, 17]\n"][..]),
        n in 2usize..180,
        side_m in 1.0..120.0f64,
        seed in 0u64..1000,
        k in 0u64..1_000_000,
    ) {
        let mut states = scattered(n, side_m, seed);
        // Some coincide, one is far away.
        states.x_m[n / 2] = states.x_m[0];
        states.y_m[n / 2] = states.y_m[0];
        states.x_m[n - 1] = 1e6;
        let mut setup = setup(n, &format!("{hopping}[phy]\n{model}\n{extra}"));
        setup.experiment.seed = seed;
        setup.columns = vec![DeliveryColumn::RssiDbm];
        let (mut network, _) = started(&setup);
        let got = readings_of(&period(&mut network, &states, k).deliveries, n);
        prop_assert_eq!(got, plainly(&setup, &states, k * STEP_NS));
    }
}
