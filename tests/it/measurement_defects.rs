//! Defects of measured links: found by `check` and `diagnose`, corrected by `extend`.

use proto::rng::{Draws, Purpose};
use serde_json::Value;
use std::f64::consts::{FRAC_PI_2, TAU};
use std::fmt::Write as _;
use std::path::Path;
use tests::{folder, orchestrator, said};

const N_FIXED: usize = 7;
const N_NODES: usize = 11;
const N_FRAMES: usize = 200;
/// Noise of a reading (dB).
const NOISE_DB: f64 = 1.5;
const TX_POWER_DBM: f64 = -12.0;

/// A row: who sends to whom, where and when, and what is read.
#[derive(Clone, Debug)]
struct Row {
    time_s: f64,
    run: usize,
    tx: usize,
    rx: usize,
    channel: usize,
    tx_m: [f64; 2],
    rx_m: [f64; 2],
    headings_rad: [f64; 2],
    rssi_dbm: Option<f64>,
}

#[test]
fn two_nodes_that_stand_elsewhere_are_named() {
    let dir = folder();
    let mut surveyed = rows(9, &|_| 0.0);
    for row in &mut surveyed {
        for (node, by_m) in [(1, [9.0, 2.0]), (4, [-3.0, 8.0])] {
            let ends = [(row.tx, &mut row.tx_m), (row.rx, &mut row.rx_m)];
            for (_, place_m) in ends.into_iter().filter(|(end, _)| *end == node) {
                *place_m = [place_m[0] + by_m[0], place_m[1] + by_m[1]];
            }
        }
    }
    put(dir.path(), &model(""), &surveyed);
    let answer = answer(dir.path(), "diagnose");
    let place = "measurement:node-place";
    assert_eq!(answer["missing"], serde_json::json!([place, place]), "{}", answer["sentence"]);
    let defects = answer["measurement_defects"].as_array().unwrap();
    let mut nodes: Vec<u64> = defects.iter().map(|it| it["nodes"][0].as_u64().unwrap()).collect();
    nodes.sort_unstable();
    assert_eq!(nodes, [1, 4]);
}

/// A uniform number from 0 to 1 that depends on all four.
fn uniform(seed: u64, what: u64, a: u64, b: u64) -> f64 {
    Draws::new(seed, Purpose::FrameNoise).words(what, a, b)[0] as f64 / 2.0_f64.powi(64)
}

/// Where a node is: the first stand still, the others drive circles, facing where they drive.
fn place(seed: u64, node: usize, time_s: f64) -> ([f64; 2], f64) {
    let n = node as u64;
    let [x_m, y_m] = [60.0 * uniform(seed, 1, n, 0), 40.0 * uniform(seed, 1, n, 1)];
    if node < N_FIXED {
        return ([x_m, y_m], 0.4 * node as f64);
    }
    let (radius_m, rate) =
        (8.0 + 4.0 * uniform(seed, 1, n, 2), 0.03 + 0.02 * uniform(seed, 1, n, 3));
    let angle = TAU * uniform(seed, 1, n, 4) + rate * time_s;
    let at = [30.0 + radius_m * angle.cos(), 20.0 + radius_m * angle.sin()];
    (at, (angle + FRAC_PI_2) % TAU - if FRAC_PI_2 < (angle % TAU) { TAU } else { 0.0 })
}

/// Free space at 2.4 GHz.
fn gain_db(row: &Row) -> f64 {
    let distance_m = (row.tx_m[0] - row.rx_m[0]).hypot(row.tx_m[1] - row.rx_m[1]).max(1.0);
    let wavelength_m = 299_792_458.0 / (2.405e9 + 5e6 * (row.channel as f64 - 11.0));
    20.0 * (wavelength_m / (2.0 * TAU * distance_m)).log10()
}

/// What is not in the model of free space, per row (dB).
type More<'a> = &'a dyn Fn(&Row) -> f64;

/// The share of frames that pass at a power (dBm): the table of the 6TiSCH simulator from -97 dBm, linear between whole dBm.
fn passes(power_dbm: f64) -> f64 {
    const DELIVERED: [f64; 19] = [
        0.0000, 0.1494, 0.2340, 0.4071, 0.6359, 0.6866, 0.7476, 0.8603, 0.8702, 0.9324, 0.9427,
        0.9562, 0.9611, 0.9739, 0.9745, 0.9844, 0.9854, 0.9903, 1.0000,
    ];
    let place = (power_dbm + 97.0).clamp(0.0, 18.0);
    let (below, above) = (place.floor() as usize, place.ceil() as usize);
    DELIVERED[below] + (place - place.floor()) * (DELIVERED[above] - DELIVERED[below])
}

/// A campaign in which the model is right but for `more_db`.
fn rows(seed: u64, more_db: More<'_>) -> Vec<Row> {
    let mut rows = Vec::new();
    for frame in 0..N_FRAMES {
        let k = frame as u64;
        let time_s = (100.0 * (10.0 * frame as f64 + 9.0 * uniform(seed, 2, k, 0))).round() / 100.0;
        let tx = frame % N_NODES;
        let channel = 11 + (16.0 * uniform(seed, 2, k, 1)) as usize;
        for rx in (0..N_NODES).filter(|&rx| rx != tx) {
            let [(tx_m, from_rad), (rx_m, to_rad)] = [tx, rx].map(|node| place(seed, node, time_s));
            let headings_rad = [from_rad, to_rad];
            let run = 1 + 4 * frame / N_FRAMES;
            let mut row =
                Row { time_s, run, tx, rx, channel, tx_m, rx_m, headings_rad, rssi_dbm: None };
            let noise = Draws::new(seed, Purpose::FrameNoise).normal(3, k, rx as u64);
            let power_dbm = TX_POWER_DBM + gain_db(&row) + more_db(&row) + NOISE_DB * noise;
            row.rssi_dbm =
                (uniform(seed, 4, k, rx as u64) < passes(power_dbm)).then(|| power_dbm.round());
            rows.push(row);
        }
    }
    rows
}

fn csv(rows: &[Row]) -> String {
    let mut text = "time_s,run,tx,rx,channel,tx_x_m,tx_y_m,rx_x_m,rx_y_m,tx_heading_rad,rx_heading_rad,rssi_dbm,received\n"
        .to_owned();
    for row in rows {
        let Row { time_s, run, tx, rx, channel, tx_m, rx_m, headings_rad, rssi_dbm } = row;
        let reading = rssi_dbm.map_or(String::new(), |dbm| dbm.to_string());
        let _ = writeln!(
            text,
            "{time_s},{run},{tx},{rx},{channel},{:.3},{:.3},{:.3},{:.3},{:.4},{:.4},{reading},{}",
            tx_m[0],
            tx_m[1],
            rx_m[0],
            rx_m[1],
            headings_rad[0],
            headings_rad[1],
            u8::from(rssi_dbm.is_some())
        );
    }
    text
}

fn model(more: &str) -> String {
    format!("[netsim.phy]\npropagation = \"friis\"\ntx_power_dbm = {TX_POWER_DBM:?}\n{more}")
}

fn put(dir: &Path, model: &str, rows: &[Row]) {
    std::fs::write(dir.join("model.toml"), model).unwrap();
    std::fs::write(dir.join("links.csv"), csv(rows)).unwrap();
}

/// The answer of a command about `links.csv`.
fn answer(dir: &Path, command: &str) -> Value {
    let args = [command, "model.toml", "--data", "links.csv", "--json", "answer.json"];
    let output = orchestrator(&args, dir);
    assert!(output.status.success(), "{}", said(&output));
    serde_json::from_str(&std::fs::read_to_string(dir.join("answer.json")).unwrap()).unwrap()
}

fn names(answer: &Value) -> Vec<String> {
    let defects = answer["measurement_defects"].as_array().into_iter().flatten();
    defects.map(|defect| defect["name"].as_str().unwrap().to_owned()).collect()
}

/// The only defect that `check` finds.
fn only_defect(model: &str, rows: &[Row]) -> Value {
    let dir = folder();
    put(dir.path(), model, rows);
    let answer = answer(dir.path(), "check");
    assert_eq!(names(&answer).len(), 1, "{:?}", names(&answer));
    answer["measurement_defects"][0].clone()
}

fn value(defect: &Value, key: &str) -> f64 {
    defect["parameters"][key]["value"].as_f64().unwrap()
}

/// Offsets of nodes as sender and as receiver (dB).
const OFFSETS_DB: [[f64; N_NODES]; 2] = [
    [4.0, -3.0, 5.0, -4.0, 2.0, -6.0, 3.0, -2.0, 5.0, -5.0, 1.0],
    [-4.0, 3.0, -3.0, 6.0, -2.0, 4.0, -5.0, 5.0, -3.0, 2.0, -3.0],
];

#[test]
fn clean_measurements_show_no_defect() {
    let offsets = |row: &Row| OFFSETS_DB[0][row.tx] + OFFSETS_DB[1][row.rx];
    let drift = |row: &Row| 2.0 * (row.time_s / 150.0).sin();
    let heavy = |row: &Row| {
        // A ratio of normal numbers has heavy tails; so far out they are cut.
        let [a, b] = [5, 6].map(|what| uniform(9, what, row.time_s.to_bits(), row.rx as u64) - 0.5);
        (0.5 * a / b).clamp(-8.0, 8.0)
    };
    let all: [More<'_>; 4] = [&|_| 0.0, &offsets, &drift, &heavy];
    for (kind, more_db) in all.into_iter().enumerate() {
        for seed in 0..2 {
            let dir = folder();
            put(dir.path(), &model(""), &rows(10 * kind as u64 + seed, more_db));
            let answer = answer(dir.path(), "check");
            assert_eq!(names(&answer), Vec::<String>::new(), "{kind} {seed}");
            assert_eq!(answer["measurement_defects"], serde_json::json!([]));
        }
    }
}

#[test]
fn registers_that_end_are_found_with_their_end() {
    for (key, name, limit) in [
        ("floor_dbm", "measurement:register-floor", -80.0),
        ("ceiling_dbm", "measurement:register-ceiling", -66.0),
    ] {
        let mut rows = rows(3, &|_| 0.0);
        for dbm in rows.iter_mut().filter_map(|row| row.rssi_dbm.as_mut()) {
            *dbm = if key == "floor_dbm" { dbm.max(limit) } else { dbm.min(limit) };
        }
        let defect = only_defect(&model(""), &rows);
        assert_eq!(defect["name"], name);
        assert!((value(&defect, key) - limit).abs() < 1e-9, "{defect}");
    }
}

#[test]
fn a_stuck_receiver_duplicates_and_outliers_are_found() {
    // Two searches, for which half of a campaign will do.
    let mut stuck = rows(4, &|_| 0.0);
    stuck.truncate(stuck.len() / 2);
    let of_node = stuck.iter_mut().filter(|row| row.rx == 5);
    of_node.filter_map(|row| row.rssi_dbm.as_mut()).for_each(|dbm| *dbm = -70.0);
    let defect = only_defect(&model(""), &stuck);
    assert_eq!(defect["name"], "measurement:stuck-node");
    assert_eq!(defect["nodes"], serde_json::json!([5]));

    let clean = rows(5, &|_| 0.0);
    let twice = clean
        .iter()
        .enumerate()
        .flat_map(|(k, row)| vec![row.clone(); 1 + usize::from(k % 10 == 3)]);
    let defect = only_defect(&model(""), &twice.collect::<Vec<Row>>());
    assert_eq!(defect["name"], "measurement:duplicates");
    assert_eq!(defect["rows"], 200);

    let mut off = rows(6, &|_| 0.0);
    for (k, dbm) in off.iter_mut().filter_map(|row| row.rssi_dbm.as_mut()).enumerate() {
        // 97 is prime to the number of receivers.
        if k % 97 == 0 {
            *dbm += if k % 194 == 0 { 25.0 } else { -25.0 };
        }
    }
    let defect = only_defect(&model(""), &off);
    assert_eq!(defect["name"], "measurement:outliers");
    assert!((value(&defect, "share") - 1.0 / 97.0).abs() < 0.002, "{defect}");
}

#[test]
fn a_late_clock_is_found_with_its_error() {
    let mut late = rows(7, &|_| 0.0);
    for row in late.iter_mut().filter(|row| row.rx == 8) {
        row.time_s += 6.0;
        row.tx_m = place(7, row.tx, row.time_s).0;
        row.rx_m = place(7, row.rx, row.time_s).0;
    }
    let defect = only_defect(&model(""), &late);
    assert_eq!(defect["name"], "measurement:clock-skew");
    assert_eq!(defect["nodes"], serde_json::json!([8]));
    assert!((value(&defect, "shift_s") - 6.0).abs() < 0.02, "{defect}");
}

#[test]
fn swapped_ends_of_a_run_are_corrected_in_a_file() {
    let more_db = |row: &Row| OFFSETS_DB[0][row.tx] + OFFSETS_DB[1][row.rx];
    let mut swapped = rows(8, &more_db);
    for row in swapped.iter_mut().filter(|row| row.run == 3) {
        (row.tx, row.rx) = (row.rx, row.tx);
        (row.tx_m, row.rx_m) = (row.rx_m, row.tx_m);
        row.headings_rad.swap(0, 1);
    }
    let offsets = format!(
        "[[netsim.phy.effect]]\nkind = \"node-offset\"\ntx_db = {:?}\nrx_db = {:?}\n",
        OFFSETS_DB[0], OFFSETS_DB[1]
    );
    let dir = folder();
    put(dir.path(), &model(&offsets), &swapped);
    let defect = only_defect(&model(&offsets), &swapped);
    assert_eq!(defect["name"], "measurement:swapped-ends");
    assert_eq!(defect["runs"], serde_json::json!([3]));
    let args = ["extend", "model.toml", "--data", "links.csv", "--effect", "system-gain"];
    let more = ["--output", "extended.toml", "--corrected-data", "corrected.csv"];
    let output = orchestrator(&[&args[..], &more].concat(), dir.path());
    assert!(output.status.success(), "{}", said(&output));
    // All but the order of the fields of exchanged rows is as measured.
    let corrected = std::fs::read_to_string(dir.path().join("corrected.csv")).unwrap();
    let parsed = |text: &str| -> Vec<Vec<Option<f64>>> {
        let lines = text.lines().skip(1);
        lines.map(|line| line.split(',').map(|field| field.parse().ok()).collect()).collect()
    };
    assert_eq!(parsed(&corrected), parsed(&csv(&rows(8, &more_db))));
}

#[test]
fn a_floor_is_refused_for_a_corrected_file() {
    let dir = folder();
    let mut rows = rows(3, &|_| 0.0);
    rows.iter_mut().filter_map(|row| row.rssi_dbm.as_mut()).for_each(|dbm| *dbm = dbm.max(-80.0));
    put(dir.path(), &model(""), &rows);
    let args = ["extend", "model.toml", "--data", "links.csv", "--effect", "system-gain"];
    let more = ["--output", "extended.toml", "--corrected-data", "corrected.csv"];
    let output = orchestrator(&[&args[..], &more].concat(), dir.path());
    assert_eq!(output.status.code(), Some(2));
    assert!(said(&output).contains("measurement:register-floor cannot be corrected in a file"));
    assert!(!dir.path().join("corrected.csv").exists());
}

#[test]
fn a_diagnosis_names_the_defect_and_blames_no_effect() {
    let dir = folder();
    // Two searches, for which half of a campaign will do.
    let mut stuck = rows(4, &|_| 0.0);
    stuck.truncate(stuck.len() / 2);
    let of_node = stuck.iter_mut().filter(|row| row.rx == 5);
    of_node.filter_map(|row| row.rssi_dbm.as_mut()).for_each(|dbm| *dbm = -60.0);
    put(dir.path(), &model(""), &stuck);
    let answer = answer(dir.path(), "diagnose");
    assert_eq!(answer["missing"], serde_json::json!(["measurement:stuck-node"]));
    assert_eq!(answer["measurement_defects"][0]["nodes"], serde_json::json!([5]));
    assert_eq!(answer["candidates"][0]["effect"], "measurement:stuck-node");
    let sentence = answer["sentence"].as_str().unwrap();
    assert!(sentence.starts_with("the measurement is wrong: the readings of node 5"), "{sentence}");
    let rejected = answer["rejected"].as_array().unwrap();
    let left_out = rejected.iter().find(|one| one["reason"] == "measurement:stuck-node").unwrap();
    assert_eq!(left_out["rows"], answer["measurement_defects"][0]["left_out"]);
    // The corrected measurements are what was asked for: that no effect is missing in them is no failure.
    let args = ["extend", "model.toml", "--data", "links.csv", "--all"];
    let more = ["--output", "extended.toml", "--corrected-data", "corrected.csv"];
    let output = orchestrator(&[&args[..], &more].concat(), dir.path());
    assert!(output.status.success(), "{}", said(&output));
    assert!(said(&output).contains("--output is not written"), "{}", said(&output));
    let exists = |name: &str| dir.path().join(name).exists();
    assert!(exists("corrected.csv") && !exists("extended.toml"));
}
