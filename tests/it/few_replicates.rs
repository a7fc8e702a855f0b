//! Campaigns of few nodes and few flights, written out here by equations of their own: one anchor and a node that turns, two nodes, a
//! handful of flights.

use diagnose::Request;
use proto::rng::{Draws, Purpose};
use serde_json::Value;
use std::f64::consts::TAU;
use std::fmt::Write as _;
use tests::answers::{self, measurements};

const RADIO: &str = "[netsim.phy]\npropagation = \"friis\"\ntx_power_dbm = 0.0\n";
pub(super) const ROBOT: &str = "[robotsim.dynamics]\nkind = \"double-integrator\"\n";
/// Level in free space at a metre, on the channel that is the default (dBm).
const AT_A_METRE_DBM: f64 = -40.2;

fn diagnosed(config: &str, csv: &str) -> Value {
    let found = answers::diagnosed(&Request::new(&answers::model(config), &measurements(csv)));
    serde_json::to_value(&found).unwrap()
}

/// What is missing for certain, each set of tied effects as one.
fn missing(found: &Value) -> Vec<&str> {
    found["missing"].as_array().unwrap().iter().map(|name| name.as_str().unwrap()).collect()
}

/// The parameter of an accepted effect: value, and both ends of its interval.
fn parameter(found: &Value, effect: &str, key: &str) -> [f64; 3] {
    let candidates = found["candidates"].as_array().unwrap();
    let accepted = |it: &&Value| it["effect"] == effect && it["accepted"] == true;
    let parameter = &candidates.iter().find(accepted).unwrap()["parameters"][key];
    ["value", "low", "high"].map(|key| parameter[key].as_f64().unwrap())
}

/// A node that turns on the spot, 4.5 m from an anchor that knows no heading: turns of 80 frames with noise of 2 dB, and of every turn another
/// level (sd 1 dB). Its antenna is weaker by `front_to_back_db` away from `boresight_rad`, seen from the node.
fn turntable(seed: u64, n_turns: u32, front_to_back_db: f64, boresight_rad: f64) -> String {
    let draws = Draws::new(seed, Purpose::Resample);
    let (x_m, y_m) = (4.0_f64, 2.0_f64);
    let mut csv =
        "time_s,tx,rx,tx_x_m,tx_y_m,rx_x_m,rx_y_m,tx_heading_rad,received,rssi_dbm\n".to_owned();
    for frame in 0..80 * n_turns {
        let time_s = 0.5 * f64::from(frame);
        let heading_rad = TAU * f64::from(frame) / 80.0;
        let towards_rad = (-y_m).atan2(-x_m) - heading_rad;
        let level_dbm = AT_A_METRE_DBM
            - 20.0 * x_m.hypot(y_m).log10()
            - 0.5 * front_to_back_db * (1.0 - (towards_rad - boresight_rad).cos())
            + draws.normal(u64::from(frame / 80), 1, 0)
            + 2.0 * draws.normal(u64::from(frame), 0, 0);
        let heading_rad = heading_rad.rem_euclid(TAU);
        writeln!(csv, "{time_s},1,0,{x_m},{y_m},0,0,{heading_rad:.4},1,{}", level_dbm.round())
            .unwrap();
    }
    csv
}

#[test]
fn a_node_that_turns_before_one_anchor_shows_its_antenna() {
    for (seed, n_turns, boresight_rad) in [(1, 4, 0.7), (2, 5, -2.0), (3, 6, 2.9)] {
        let found = diagnosed(RADIO, &turntable(seed, n_turns, 4.0, boresight_rad));
        let is_named = missing(&found).iter().any(|one_of| one_of.starts_with("antenna-pattern"));
        assert!(is_named, "{seed}: {}", found["sentence"]);
        let [size_db, low_db, high_db] = parameter(&found, "antenna-pattern", "front_to_back_db");
        // Half of it has a standard error of 2 √(2 / 320) = 0.16 dB in four turns.
        assert!((size_db - 4.0).abs() < 1.0, "{seed}: {size_db}");
        assert!(low_db < size_db && size_db < high_db && 0.0 < low_db, "{seed}");
        let [towards_rad, ..] = parameter(&found, "antenna-pattern", "boresight_rad");
        let off_rad =
            (towards_rad - boresight_rad).sin().atan2((towards_rad - boresight_rad).cos());
        assert!(off_rad.abs() < 0.3, "{seed}: {towards_rad}");
    }
}

#[test]
fn a_node_that_turns_without_a_pattern_shows_none_and_three_turns_do_not_tell() {
    for seed in 11..15 {
        let found = diagnosed(RADIO, &turntable(seed, 5, 0.0, 0.0));
        let sentence = found["sentence"].as_str().unwrap();
        assert!(!sentence.contains("antenna-pattern"), "{seed}: {sentence}");
    }
    let found = diagnosed(RADIO, &turntable(15, 3, 4.0, 0.7));
    let is_certain = missing(&found).contains(&"antenna-pattern");
    assert!(!is_certain, "{}", found["sentence"]);
}

/// Recordings of nodes that stand before an anchor, one after the other and an hour apart: 60 frames with noise of 2 dB, and of every recording
/// another level (sd 6 dB), as of a body that is put up anew. Each node is weaker by 10 dB than the one before.
fn recordings_that_differ(seed: u64, n_nodes: u32) -> String {
    let draws = Draws::new(seed, Purpose::Resample);
    let mut csv = "run,time_s,tx,rx,tx_x_m,tx_y_m,rx_x_m,rx_y_m,tx_heading_rad,received,rssi_dbm\n"
        .to_owned();
    for run in 0..13 * n_nodes {
        let node = run % n_nodes;
        let heading_rad = f64::from(run / n_nodes % 8) * TAU / 8.0;
        for frame in 0..60 {
            let time_s = 3600.0 * f64::from(run) + 0.5 * f64::from(frame);
            let level_dbm =
                AT_A_METRE_DBM - 20.0 * 4.0_f64.hypot(2.0).log10() - 10.0 * f64::from(node)
                    + 6.0 * draws.normal(u64::from(run), 1, 0)
                    + 2.0 * draws.normal(u64::from(60 * run + frame), 0, 0);
            let (tx, rssi_dbm) = (node + 1, level_dbm.round());
            writeln!(csv, "{run},{time_s},{tx},0,4,2,0,0,{heading_rad:.4},1,{rssi_dbm}").unwrap();
        }
    }
    csv
}

#[test]
fn what_recordings_differ_by_is_no_drift_and_no_onset() {
    for (seed, n_nodes) in [(21, 1), (22, 3), (23, 2), (24, 1)] {
        let found = diagnosed(RADIO, &recordings_that_differ(seed, n_nodes));
        let sentence = found["sentence"].as_str().unwrap();
        assert_ne!(found["verdict"], "unexplained-structure", "{seed}: {sentence}");
        let certain = missing(&found);
        let follows_time = |one_of: &&str| {
            ["drift", "battery-sag", "hidden-obstacle", "from_s"]
                .iter()
                .any(|it| one_of.contains(it))
        };
        assert!(!certain.iter().any(follows_time), "{seed}: {sentence}");
    }
}

/// Eight nodes that hear each other in turn, 60 frames a link with noise of 2 dB. A frame is lost as by the table of [`LOSSY`], and one that
/// node 6 receives as if it were weaker by so much.
fn eight_nodes(seed: u64, deaf_by_db: f64) -> String {
    let draws = Draws::new(seed, Purpose::Resample);
    let uniform = |row: u32| draws.uniform(u64::from(row), 2, 0);
    let place = |node: u32| {
        let [x, y] = [3, 4].map(|purpose| draws.uniform(u64::from(node), purpose, 0));
        [24.0 * x, 14.0 * y]
    };
    let mut csv = "time_s,tx,rx,tx_x_m,tx_y_m,rx_x_m,rx_y_m,received,rssi_dbm\n".to_owned();
    for row in 0..60 * 56u32 {
        let (tx, step) = (row % 8, row / 8 % 7);
        let rx = (tx + 1 + step) % 8;
        let ([tx_x_m, tx_y_m], [rx_x_m, rx_y_m]) = (place(tx), place(rx));
        let distance_m = (tx_x_m - rx_x_m).hypot(tx_y_m - rx_y_m).max(1.0);
        let level_dbm = AT_A_METRE_DBM - 16.0 - 23.0 * distance_m.log10()
            + 2.0 * draws.normal(u64::from(row), 0, 0);
        let heard_dbm = level_dbm - if rx == 6 { deaf_by_db } else { 0.0 };
        let is_received = uniform(row) < ((heard_dbm + 90.0) / 10.0).clamp(0.0, 1.0);
        let rssi = if is_received { level_dbm.round().to_string() } else { String::new() };
        let (time_s, received) = (0.2 * f64::from(row), u8::from(is_received));
        writeln!(
            csv,
            "{time_s:.1},{tx},{rx},{tx_x_m},{tx_y_m},{rx_x_m},{rx_y_m},{received},{rssi}"
        )
        .unwrap();
    }
    csv
}

const LOSSY: &str = "[netsim.phy]\npropagation = \"log-distance\"\nexponent = 2.3\ntx_power_dbm = -16.0\n[netsim.phy.reception]\nkind = \
                     \"table\"\npoints = [[-90.0, 0.0], [-80.0, 1.0]]\n";

#[test]
fn a_model_under_which_one_node_is_deaf_is_not_said_to_be_complete() {
    for seed in 31..34 {
        let found = diagnosed(LOSSY, &eight_nodes(seed, 0.0));
        let said = &found["sentence"];
        assert!(!said.as_str().unwrap().contains("are lost"), "{seed}: {said}");
        assert_eq!(found["verdict"], "nothing-missing", "{seed}: {said}");
        for deaf_by_db in [6.0, 20.0] {
            let found = diagnosed(LOSSY, &eight_nodes(seed, deaf_by_db));
            let said = &found["sentence"];
            assert_ne!(found["verdict"], "nothing-missing", "{seed}: {said}");
            // Neither is what one receiver loses a property of all.
            let of_all =
                |one_of: &&str| ["reception-curve", "noise-floor"].iter().any(|it| one_of == it);
            assert!(!missing(&found).iter().any(of_all), "{seed}: {said}");
        }
    }
}

/// Two nodes at places along a line, 20 frames each way at each, with noise of 2 dB; frames that node 2 sends arrive weaker by this (dB).
fn two_nodes(seed: u64, weaker_db: f64) -> String {
    let draws = Draws::new(seed, Purpose::Resample);
    let mut csv = "time_s,tx,rx,tx_x_m,tx_y_m,rx_x_m,rx_y_m,received,rssi_dbm\n".to_owned();
    for frame in 0..480u32 {
        let (place, turn) = (frame / 40, frame % 2);
        let time_s = 0.5 * f64::from(frame) + 60.0 * f64::from(place);
        let x_m = 1.0 + 0.8 * f64::from(place);
        let level_dbm = AT_A_METRE_DBM - 20.0 * x_m.log10() - weaker_db * f64::from(turn)
            + 2.0 * draws.normal(u64::from(frame), 0, 0);
        let ends = if turn == 0 { format!("1,2,0,0,{x_m},0") } else { format!("2,1,{x_m},0,0,0") };
        writeln!(csv, "{time_s},{ends},1,{}", level_dbm.round()).unwrap();
    }
    csv
}

#[test]
fn of_two_nodes_the_weaker_direction_is_named_with_its_size() {
    let found = diagnosed(RADIO, &two_nodes(1, 8.0));
    assert_eq!(missing(&found), ["node-offset"], "{}", found["sentence"]);
    let sentence = found["sentence"].as_str().unwrap();
    let said = "frames from node 2 to node 1 arrive";
    assert!(sentence.to_lowercase().contains(said), "{sentence}");
    assert!(sentence.contains("weaker transmitter of 2 from a less sensitive receiver of 1"));
    let candidates = found["candidates"].as_array().unwrap();
    let levels = candidates.iter().find(|it| it["effect"] == "node-offset").unwrap();
    let size_db = levels["directions"]["weaker_by"]["value"].as_f64().unwrap();
    // 240 frames each way: a standard error of 2 √(2 / 240) = 0.18 dB.
    assert!((size_db - 8.0).abs() < 0.8, "{size_db}");
    assert_eq!([&levels["directions"]["from"], &levels["directions"]["to"]], [2, 1]);
    let alike = diagnosed(RADIO, &two_nodes(2, 0.0));
    assert!(missing(&alike).is_empty(), "{}", alike["sentence"]);
}

/// Flights of some seconds with commands of acceleration and, in all of them, drag by speed (1/s). Each has a push (m/s²) and a gain of its
/// own, with this standard deviation.
pub(super) fn flights(
    seed: u64,
    (n_flights, length_s): (u32, f64),
    [drag_per_s, own]: [f64; 2],
) -> String {
    const SAMPLE_S: f64 = 0.05;
    const STEPS: u32 = 10;
    let draws = Draws::new(seed, Purpose::Resample);
    let mut csv = "run,time_s,agent,x_m,y_m,z_m,cmd_ax_mps2,cmd_ay_mps2,cmd_az_mps2\n".to_owned();
    for flight in 0..n_flights {
        let normal = |what: u64| draws.normal(u64::from(flight), what, 1);
        let uniform = |what: u64, [low, high]: [f64; 2]| {
            low + (high - low) * draws.uniform(u64::from(flight), what, 3)
        };
        let gain = 1.0 + own * normal(0);
        let (mut at_m, mut velocity_mps) = ([0.0, 0.0, 1.0], [0.0; 3]);
        for sample in 0..(length_s / SAMPLE_S) as u32 {
            let time_s = SAMPLE_S * f64::from(sample);
            let command: [f64; 3] = std::array::from_fn(|axis| {
                let number = 10 * (axis as u64 + 1);
                let phase = uniform(number, [0.0, TAU]) + uniform(number + 1, [1.0, 2.2]) * time_s;
                uniform(number + 2, [0.8, 2.0]) * if axis == 2 { 0.5 } else { 1.0 } * phase.cos()
            });
            let row = u64::from(flight) * 1000 + u64::from(sample);
            let measured: Vec<String> = (0..3)
                .map(|axis| {
                    format!("{:.4}", at_m[axis] + 0.004 * draws.normal(row, axis as u64, 2))
                })
                .collect();
            let commanded = command.map(|value| format!("{value:.4}")).join(",");
            writeln!(csv, "{},{time_s:.2},0,{},{commanded}", flight + 1, measured.join(","))
                .unwrap();
            let step_s = SAMPLE_S / f64::from(STEPS);
            for _ in 0..STEPS {
                for axis in 0..3 {
                    let push_mps2 = own * normal(axis as u64 + 1);
                    let acceleration_mps2 =
                        gain * command[axis] + push_mps2 - drag_per_s * velocity_mps[axis];
                    at_m[axis] += step_s * (velocity_mps[axis] + 0.5 * step_s * acceleration_mps2);
                    velocity_mps[axis] += step_s * acceleration_mps2;
                }
            }
        }
    }
    csv
}

#[test]
fn four_flights_show_a_clear_effect_and_flights_without_one_show_none() {
    for n_flights in [4, 6] {
        let found = diagnosed(ROBOT, &flights(u64::from(n_flights), (n_flights, 5.5), [0.5, 0.03]));
        let named = missing(&found);
        let is_drag = |one_of: &&str| one_of.split(" or ").any(|name| name == "linear-drag");
        assert_eq!(named.len(), 1, "{}", found["sentence"]);
        assert!(named.iter().all(is_drag), "{}", found["sentence"]);
        assert_eq!(found["split"], "runs");
    }
    for (seed, n_flights) in [(21, 4), (22, 5), (23, 6)] {
        let found = diagnosed(ROBOT, &flights(seed, (n_flights, 5.5), [0.0, 0.03]));
        assert!(missing(&found).is_empty(), "{}", found["sentence"]);
        assert_ne!(found["verdict"], "nothing-missing", "few flights do not tell that nothing is");
    }
}

#[test]
fn parts_of_too_few_flights_show_what_is_possible_and_nothing_for_certain() {
    for n_flights in [2, 3] {
        let found = diagnosed(ROBOT, &flights(31, (n_flights, 5.5), [0.5, 0.03]));
        assert!(missing(&found).is_empty(), "{}", found["sentence"]);
        let sentence = found["sentence"].as_str().unwrap();
        assert!(sentence.contains("linear-drag"), "{sentence}");
        assert!(sentence.contains("or 4 runs, are required"), "{sentence}");
    }
}

#[test]
fn what_flights_differ_by_is_not_named_of_all_of_them() {
    for seed in 41..44 {
        let found = diagnosed(ROBOT, &flights(seed, (4, 10.0), [0.0, 0.09]));
        let is_of_some = |name: &&str| name.contains("(only");
        assert!(missing(&found).iter().all(is_of_some), "{}", found["sentence"]);
    }
}
