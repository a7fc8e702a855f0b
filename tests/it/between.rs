//! `diagnose --between A B`: what changed between two campaigns of one site, or of the same robots.
//!
//! The measurements are made here, by equations that share nothing with the product's effects.

use proto::rng::{Draws, Purpose};
use serde_json::Value;
use std::f64::consts::TAU;
use std::fmt::Write as _;
use std::path::Path;
use tests::{folder, orchestrator, said};

const N_NODES: usize = 11;
/// These stand still, the others drive circles.
const N_FIXED: usize = 7;
const N_FRAMES: usize = 200;
/// Recordings of a campaign, one after the other.
const N_RECORDINGS: usize = 5;
const NOISE_DB: f64 = 1.5;
const TX_POWER_DBM: f64 = -10.0;

/// What a campaign has beyond free space (dB): by sender, receiver, distance (m) and temperature (degC).
type More<'a> = &'a dyn Fn(usize, usize, f64, f64) -> f64;

/// A uniform number from 0 to 1.
fn uniform(seed: u64, what: u64, a: u64, b: u64) -> f64 {
    Draws::new(seed, Purpose::FrameNoise).words(what, a, b)[0] as f64 / 2.0_f64.powi(64)
}

/// Noise with a standard deviation of about 1: normal, or with heavy tails (Student's t of four degrees of freedom).
fn noise(seed: u64, a: u64, b: u64, is_heavy: bool) -> f64 {
    let normal = |k: u64| Draws::new(seed, Purpose::FrameNoise).normal(10 + k, a, b);
    if !is_heavy {
        return normal(0);
    }
    let squares: f64 = (1..=4).map(|k| normal(k) * normal(k)).sum();
    normal(0) / (squares / 4.0).sqrt()
}

/// Where a node is at a time.
fn place_m(site: u64, node: usize, time_s: f64) -> [f64; 2] {
    let n = node as u64;
    if node < N_FIXED {
        return [60.0 * uniform(site, 1, n, 0), 40.0 * uniform(site, 1, n, 1)];
    }
    let angle = n as f64 + (0.02 + 0.003 * n as f64) * time_s;
    [30.0 + 10.0 * angle.cos(), 20.0 + 10.0 * angle.sin()]
}

/// The recording of a frame.
const fn recording(frame: usize) -> usize {
    frame * N_RECORDINGS / N_FRAMES
}

/// The same campaign as one recording.
fn as_one_recording(csv: &str) -> String {
    csv.lines().map(|line| format!("{}\n", line.rsplit_once(',').unwrap().0)).collect()
}

/// The same campaign with so much more on all readings of each recording (dB).
fn with_levels(csv: &str, level_db: &dyn Fn(usize) -> f64) -> String {
    let line = |line: &str| {
        let mut fields: Vec<String> = line.split(',').map(str::to_owned).collect();
        let n = fields.len();
        if let (Ok(run), Ok(dbm)) = (fields[n - 1].parse(), fields[n - 3].parse::<f64>()) {
            fields[n - 3] = format!("{:.0}", dbm + level_db(run));
        }
        fields.join(",") + "\n"
    };
    csv.lines().map(line).collect()
}

/// A campaign of links at a site. `start_s`: added to all times.
fn links(seed: u64, more_db: More<'_>, is_heavy: bool, start_s: f64) -> String {
    let mut csv =
        "time_s,tx,rx,channel,tx_x_m,tx_y_m,tx_z_m,rx_x_m,rx_y_m,rx_z_m,temperature_c,rssi_dbm,received,run\n".to_owned();
    for frame in 0..N_FRAMES {
        let k = frame as u64;
        let time_s = (100.0 * (8.0 * frame as f64 + 7.0 * uniform(seed, 2, k, 0))).round() / 100.0;
        let tx = frame % N_NODES;
        let channel = 11 + (16.0 * uniform(seed, 2, k, 1)) as usize;
        let temperature_c = 15.0 + 8.0 * (time_s / 300.0).sin() + uniform(seed, 2, k, 2);
        for rx in (0..N_NODES).filter(|&rx| rx != tx) {
            let [[x0, y0], [x1, y1]] = [tx, rx].map(|node| place_m(7, node, time_s));
            let distance_m = (x1 - x0).hypot(y1 - y0).max(1.0);
            let wavelength_m = 299_792_458.0 / (2.405e9 + 5e6 * (channel as f64 - 11.0));
            let free_db = 20.0 * (wavelength_m / (2.0 * TAU * distance_m)).log10();
            let random_db = NOISE_DB * noise(seed, k, rx as u64, is_heavy);
            let dbm =
                TX_POWER_DBM + free_db + random_db + more_db(tx, rx, distance_m, temperature_c);
            let _ = writeln!(
                csv,
                "{:.2},{tx},{rx},{channel},{x0:.3},{y0:.3},1,{x1:.3},{y1:.3},1,{temperature_c:.2},{:.0},1,{}",
                start_s + time_s,
                dbm,
                recording(frame)
            );
        }
    }
    csv
}

/// A campaign of five robots that move as commanded, but for a share of the speed of each, and a wind (m/s, east).
fn robots(seed: u64, share: &dyn Fn(usize) -> f64, wind_mps: f64) -> String {
    let step_s = 0.1;
    let mut csv = "time_s,agent,x_m,y_m,cmd_vx_mps,cmd_vy_mps,run\n".to_owned();
    for agent in 0..5 {
        let a = agent as u64;
        let mut at_m = [10.0 * uniform(seed, 1, a, 0), 10.0 * uniform(seed, 1, a, 1)];
        let mut command_mps = [0.0, 0.0];
        for step in 0..500_u64 {
            if step % 15 == 0 {
                let angle = TAU * uniform(seed, 2, a, step);
                let speed_mps = 0.3 + 0.9 * uniform(seed, 3, a, step);
                command_mps = [speed_mps * angle.cos(), speed_mps * angle.sin()];
            }
            let draw = |what: u64| Draws::new(seed, Purpose::FrameNoise).normal(what, a, step);
            let [x_m, y_m] = [at_m[0] + 0.01 * draw(4), at_m[1] + 0.01 * draw(5)];
            let [vx, vy] = command_mps;
            let time_s = step_s * step as f64;
            let run = step / 100;
            let _ = writeln!(csv, "{time_s:.1},{agent},{x_m:.4},{y_m:.4},{vx:.4},{vy:.4},{run}");
            let wind_mps = [wind_mps, 0.0];
            for axis in 0..2 {
                let mps = share(agent) * command_mps[axis] + wind_mps[axis];
                at_m[axis] += step_s * mps + 0.004 * draw(6 + axis as u64);
            }
        }
    }
    csv
}

const RADIO: &str = "[netsim.phy]\npropagation = \"friis\"\ntx_power_dbm = -10.0\n";
const POINTS: &str = "[robotsim.dynamics]\nkind = \"point-mass\"\n";

/// The answer about two campaigns, and what was printed.
fn between(model: &str, a: &str, b: &str) -> (Value, String) {
    let dir = folder();
    put(dir.path(), model, a, b);
    let args = ["diagnose", "model.toml", "--between", "a.csv", "b.csv", "--json", "answer.json"];
    let output = orchestrator(&args, dir.path());
    assert!(output.status.success(), "{}", said(&output));
    let json = std::fs::read_to_string(dir.path().join("answer.json")).unwrap();
    (serde_json::from_str(&json).unwrap(), said(&output))
}

fn put(dir: &Path, model: &str, a: &str, b: &str) {
    for (name, text) in [("model.toml", model), ("a.csv", a), ("b.csv", b)] {
        std::fs::write(dir.join(name), text).unwrap();
    }
}

/// The effects of a list of the answer.
fn effects(answer: &Value, list: &str) -> Vec<String> {
    let all = answer[list].as_array().unwrap().iter();
    all.map(|one| one["effect"].as_str().unwrap().to_owned()).collect()
}

/// A parameter of the first change.
fn parameter<'a>(answer: &'a Value, key: &str) -> &'a Value {
    &answer["changed"][0]["parameters"][key]
}

fn number(value: &Value, key: &str) -> f64 {
    value[key].as_f64().unwrap()
}

const NOTHING: More<'_> = &|_, _, _, _| 0.0;

#[test]
fn a_level_that_changes_by_6_db_is_the_only_change() {
    let lower: More<'_> = &|_, _, _, _| -6.0;
    let a = links(1, NOTHING, false, 0.0);
    let (answer, said) = between(RADIO, &a, &links(2, lower, false, 0.0));
    assert_eq!(answer["verdict"], "changed", "{said}");
    assert_eq!(effects(&answer, "changed"), ["system-gain"], "{said}");
    assert_eq!(answer["changed"][0].get("only"), None, "{said}");
    let gain = parameter(&answer, "gain_db");
    assert!(gain["a"].is_null());
    // 2000 readings with a noise of 1.5 dB: four standard errors of a difference are 0.2 dB.
    assert!((number(&gain["b"], "value") + 6.0).abs() < 0.2, "{said}");
    assert_eq!(answer["unexplained"], serde_json::json!([]), "{said}");
    let sentence = answer["sentence"].as_str().unwrap();
    assert!(sentence.starts_with("changed: system-gain: gain_db -"), "{sentence}");
    // What is gone in B is as much a change.
    let (answer, said) = between(RADIO, &links(3, lower, false, 0.0), &a);
    assert_eq!(effects(&answer, "changed"), ["system-gain"], "{said}");
    assert_eq!(effects(&answer, "common"), [""; 0], "{said}");
    let gain = parameter(&answer, "gain_db");
    assert!((number(&gain["a"], "value") + 6.0).abs() < 0.2, "{said}");
    assert!(number(&gain["b"], "value").abs() < 0.2, "{said}");
    let difference = &gain["difference"];
    assert!(number(difference, "low") < 6.0 + 0.2 && 6.0 - 0.2 < number(difference, "high"));
    assert!((number(difference, "value") - 6.0).abs() < 0.2, "{said}");
}

#[test]
fn of_one_recording_a_side_no_change_is_certain() {
    let lower: More<'_> = &|_, _, _, _| -6.0;
    let [a, b] = [(1, NOTHING), (2, lower)]
        .map(|(seed, more_db)| as_one_recording(&links(seed, more_db, false, 0.0)));
    let (answer, said) = between(RADIO, &a, &b);
    assert_eq!(answer["verdict"], "cannot-tell", "{said}");
    assert_eq!(effects(&answer, "possible"), ["system-gain"], "{said}");
    let sentence = answer["sentence"].as_str().unwrap();
    assert!(sentence.starts_with("these recordings differ: system-gain: gain_db -"), "{sentence}");
    assert!(sentence.contains("from 4 recordings of each campaign on"), "{sentence}");
    assert!(answer["caution"].as_str().unwrap().contains("regression to the mean"), "{said}");
}

/// Recordings of both campaigns differ by 3 dB (standard deviation), and nothing else does. The family of tests has a level of 0.5 %.
#[test]
fn what_recordings_of_one_condition_differ_by_is_no_change() {
    for seed in 0..4 {
        let campaign = |number: u64| {
            let level_db = |run: usize| {
                3.0 * Draws::new(300 + seed, Purpose::FrameNoise).normal(20, number, run as u64)
            };
            with_levels(&links(400 + 2 * seed + number, NOTHING, false, 0.0), &level_db)
        };
        let (answer, said) = between(RADIO, &campaign(0), &campaign(1));
        assert_eq!(effects(&answer, "changed"), [""; 0], "{seed}: {said}");
    }
}

#[test]
fn of_conditions_that_the_campaigns_do_not_share_no_change_is_certain() {
    // 15 to 24 degC in A, 30 degC more in B, and no effect of it is known: it may be what lowers the readings.
    let warmer = |csv: &str| -> String {
        let line = |(number, line): (usize, &str)| {
            let mut fields: Vec<String> = line.split(',').map(str::to_owned).collect();
            if 0 < number {
                fields[10] = format!("{:.2}", fields[10].parse::<f64>().unwrap() + 30.0);
            }
            fields.join(",") + "\n"
        };
        csv.lines().enumerate().map(line).collect()
    };
    let lower: More<'_> = &|_, _, _, _| -6.0;
    let (a, b) = (links(1, NOTHING, false, 0.0), warmer(&links(2, lower, false, 0.0)));
    let (answer, said) = between(RADIO, &a, &b);
    assert_eq!(answer["verdict"], "cannot-tell", "{said}");
    assert_eq!(answer["confounded"][0]["covariate"], "temperature_c", "{said}");
}

#[test]
fn the_node_whose_gain_drops_is_named() {
    let drop: More<'_> = &|tx, rx, _, _| if tx == 3 || rx == 3 { -6.0 } else { 0.0 };
    let a = links(4, NOTHING, false, 0.0);
    let (answer, said) = between(RADIO, &a, &links(5, drop, false, 0.0));
    assert_eq!(effects(&answer, "changed"), ["system-gain"], "{said}");
    assert_eq!(answer["changed"][0]["only"], serde_json::json!({"nodes": [3]}), "{said}");
    let gain = &parameter(&answer, "gain_db")["b"];
    // 360 rows of the node.
    assert!((number(gain, "value") + 6.0).abs() < 0.4, "{said}");
    // Settings for a configuration of B: limited to the node, and to no campaign.
    let settings = &answer["changed"][0]["settings"];
    assert_eq!(settings["only"], serde_json::json!({"nodes": [3]}), "{said}");
}

/// A false alarm is a change, a possible one, or something that changed. Each of the tests has a level of 0.5 %: one in 25 correct
/// programs would fail at one of these eight seeds.
#[test]
fn where_nothing_changed_none_is_found_with_normal_noise_and_with_heavy_tails() {
    for seed in 0..4 {
        for is_heavy in [false, true] {
            let [a, b] =
                [2 * seed, 2 * seed + 1].map(|seed| links(100 + seed, NOTHING, is_heavy, 0.0));
            let (answer, said) = between(RADIO, &a, &b);
            let verdict = answer["verdict"].as_str().unwrap();
            assert!(["nothing-changed", "nothing-found"].contains(&verdict), "{seed}: {said}");
            if verdict == "nothing-changed" {
                // What could hide is said, and is small: a tenth of the noise and more is seen in 2000 rows.
                let could_hide_db = number(&answer, "could_hide");
                assert!((0.0..0.5).contains(&could_hide_db), "{seed}: {said}");
            }
        }
    }
}

#[test]
fn what_acts_in_both_campaigns_is_common_and_no_change() {
    let cold: More<'_> = &|_, _, _, c| -0.4 * (c - 15.0);
    let (answer, said) = between(RADIO, &links(6, cold, false, 0.0), &links(7, cold, false, 0.0));
    assert_eq!(effects(&answer, "changed"), [""; 0], "{said}");
    assert_eq!(effects(&answer, "possible"), [""; 0], "{said}");
    assert_eq!(effects(&answer, "common"), ["temperature"], "{said}");
    let slope = number(&answer["common"][0]["parameters"]["db_per_c"], "value");
    assert!((slope + 0.4).abs() < 0.03, "{said}");
    let same = answer["same"].as_array().unwrap().iter();
    let slope = same.filter(|one| one["what"] == "temperature: db_per_c");
    assert!(slope.map(|one| number(one, "within")).all(|within| within < 0.1), "{said}");
    // The same in both, and a level that changed beside it.
    let lower: More<'_> = &|_, _, _, c| -0.4 * (c - 15.0) - 6.0;
    let (answer, said) = between(RADIO, &links(6, cold, false, 0.0), &links(7, lower, false, 0.0));
    assert_eq!(effects(&answer, "common"), ["temperature"], "{said}");
    assert_eq!(effects(&answer, "changed"), ["system-gain"], "{said}");
    assert!((number(&parameter(&answer, "gain_db")["b"], "value") + 6.0).abs() < 0.4, "{said}");
}

#[test]
fn links_that_change_each_by_itself_are_not_said_to_be_the_same() {
    let furniture: More<'_> = &|tx, rx, _, _| {
        let (low, high) = (tx.min(rx) as u64, tx.max(rx) as u64);
        8.0 * (uniform(3, 9, low, high) - 0.5)
    };
    let a = links(8, NOTHING, false, 0.0);
    let (answer, said) = between(RADIO, &a, &links(9, furniture, false, 0.0));
    assert_ne!(answer["verdict"], "nothing-changed", "{said}");
    assert_ne!(answer["verdict"], "nothing-found", "{said}");
    let error = &answer["error"];
    assert!(1.2 * number(error, "rmse_a") < number(error, "rmse_b"), "{said}");
}

/// In A the robot was mostly where no robot was in B, so that shared conditions leave too few recordings for a certain answer.
#[test]
fn the_robot_that_begins_to_slip_is_named() {
    let a = robots(1, &|_| 1.0, 0.0);
    let b = robots(2, &|agent| if agent == 3 { 0.85 } else { 1.0 }, 0.0);
    let (answer, said) = between(POINTS, &a, &b);
    assert_eq!(answer["verdict"], "cannot-tell", "{said}");
    assert_eq!(effects(&answer, "possible"), ["slip"], "{said}");
    let slip = &answer["possible"][0];
    assert_eq!(slip["only"], serde_json::json!({"agents": [3]}), "{said}");
    let scale = number(&slip["parameters"]["scale"]["b"], "value");
    assert!((scale - 0.85).abs() < 0.02, "{said}");
}

#[test]
fn a_wind_on_all_robots_is_one_change_and_a_wind_in_both_campaigns_is_none() {
    let [calm, windy, again] =
        [(3, 0.0), (4, 0.1), (5, 0.1)].map(|(seed, mps)| robots(seed, &|_| 1.0, mps));
    let (answer, said) = between(POINTS, &calm, &windy);
    assert_eq!(effects(&answer, "changed"), ["wind"], "{said}");
    assert_eq!(answer["changed"][0].get("only"), None, "{said}");
    let (answer, said) = between(POINTS, &windy, &again);
    assert_eq!(effects(&answer, "changed"), [""; 0], "{said}");
    assert_eq!(effects(&answer, "common"), ["wind"], "{said}");
}

#[test]
fn robots_that_move_as_before_have_not_changed() {
    for seed in 0..3 {
        let [a, b] = [2 * seed, 2 * seed + 1].map(|seed| robots(200 + seed, &|_| 1.0, 0.0));
        let (answer, said) = between(POINTS, &a, &b);
        let verdict = answer["verdict"].as_str().unwrap();
        assert!(["nothing-changed", "nothing-found"].contains(&verdict), "{seed}: {said}");
    }
}

#[test]
fn times_of_day_that_have_nothing_in_common_are_said() {
    // 2026-01-01T08:00:00Z and T20:00:00Z.
    let [morning_s, evening_s] = [1_767_254_400.0, 1_767_297_600.0];
    let lower: More<'_> = &|_, _, _, _| -6.0;
    let a = links(1, NOTHING, false, morning_s);
    let (answer, said) = between(RADIO, &a, &links(2, lower, false, evening_s));
    let sentence = answer["sentence"].as_str().unwrap();
    assert!(sentence.contains("A was measured 08:0"), "{said}");
    assert!(sentence.contains("UTC, B 20:0"), "{said}");
    let spans = &answer["time_of_day_h"];
    assert!((8.0..8.5).contains(&spans["a"][1].as_f64().unwrap()), "{said}");
    let (answer, said) = between(RADIO, &links(1, NOTHING, false, 0.0), &a);
    assert_eq!(answer.get("time_of_day_h"), None);
    assert!(said.contains("time of day: unknown"), "{said}");
}

/// A log of a campaign as others write it: dates in place of seconds, from this hour of 2026-01-02 on.
fn dated(csv: &str, hour: u32) -> String {
    let line = |(number, line): (usize, &str)| match line.split_once(',') {
        Some((time_s, rest)) if 0 < number => {
            let time_s: f64 = time_s.parse().unwrap();
            let (minute, second) = ((time_s / 60.0) as u32, time_s % 60.0);
            format!("2026-01-02T{hour:02}:{minute:02}:{second:05.2},{rest}\n")
        }
        _ => format!("{line}\n"),
    };
    csv.lines().enumerate().map(line).collect()
}

/// Converts logs with dates to a table.
fn convert(dir: &Path, files: &str, out: &str) {
    let columns =
        ["tx", "rx", "channel", "tx_x_m", "tx_y_m", "tx_z_m", "rx_x_m", "rx_y_m", "rx_z_m"];
    let columns = columns.map(|name| format!("{name} = \"{name}\"")).join(", ");
    let mapping = format!(
        "table = \"links\"\n[[input]]\nfiles = \"{files}\"\ncolumns = {{ time_s = \"time_s\", {columns}, rssi_dbm = \"rssi_dbm\", \
         received = \"received\" }}\n"
    );
    std::fs::write(dir.join("map.toml"), mapping).unwrap();
    let output = orchestrator(&["convert", "map.toml", "--out", out], dir);
    assert!(output.status.success(), "{}", said(&output));
}

#[test]
fn logs_with_dates_give_the_time_of_day_without_another_word() {
    let dir = folder();
    // 27 minutes each, so that the hour does not change.
    for (name, seed, hour) in [("morning", 1, 8), ("evening", 2, 20)] {
        let log = dated(&links(seed, NOTHING, false, 0.0), hour);
        std::fs::write(dir.path().join(format!("log_{name}.csv")), log).unwrap();
        convert(dir.path(), &format!("log_{name}.csv"), &format!("{name}.csv"));
    }
    std::fs::write(dir.path().join("model.toml"), RADIO).unwrap();
    let command =
        "diagnose model.toml --between morning.csv evening.csv --json - --report what.html";
    let output = orchestrator(&command.split(' ').collect::<Vec<_>>(), dir.path());
    assert!(output.status.success(), "{}", said(&output));
    let answer: Value = serde_json::from_slice(&output.stdout).unwrap();
    let spans = &answer["time_of_day_h"];
    assert!((8.0..8.5).contains(&spans["a"][0].as_f64().unwrap()), "{spans}");
    assert!((20.0..20.5).contains(&spans["b"][1].as_f64().unwrap()), "{spans}");
    // It has a place of its own in the answer, and is not listed among the covariates.
    assert!(!answer["confounded"].to_string().contains("time_of_day"), "{answer:#}");
    // The page says the sentence, and when the campaigns were measured.
    let page = std::fs::read_to_string(dir.path().join("what.html")).unwrap();
    assert!(page.contains("A was measured 08:0"), "{page}");
    assert!(page.contains("--between morning.csv evening.csv --report what.html"), "{page}");
    // Both logs as two campaigns of one table: of 27 minutes each, the time of day would only say which of them a row is of.
    convert(dir.path(), "log_*.csv", "both.csv");
    let command = "diagnose model.toml --data both.csv --json both.json";
    let output = orchestrator(&command.split(' ').collect::<Vec<_>>(), dir.path());
    assert!(output.status.success(), "{}", said(&output));
    let both = std::fs::read_to_string(dir.path().join("both.json")).unwrap();
    assert!(!both.contains("time_of_day_h"), "{both}");
}

#[test]
fn a_recording_of_few_rows_tells_nothing() {
    let few = |seed: u64| -> String {
        let all = links(seed, NOTHING, false, 0.0);
        all.lines().take(31).map(|line| format!("{line}\n")).collect()
    };
    let (answer, said) = between(RADIO, &few(1), &few(2));
    assert_eq!(answer["verdict"], "nothing-found", "{said}");
    let sentence = answer["sentence"].as_str().unwrap();
    assert!(sentence.starts_with("no change was found, but"), "{said}");
}

#[test]
fn what_cannot_be_compared_is_refused_with_the_reason() {
    let dir = folder();
    let (a, b) = (links(1, NOTHING, false, 0.0), robots(1, &|_| 1.0, 0.0));
    put(dir.path(), RADIO, &a, &b);
    let packets = "time_s,source,destination,received_s\n1.0,1,0,1.5\n2.0,2,0,\n";
    std::fs::write(dir.path().join("packets.csv"), packets).unwrap();
    let refused = |args: &[&str], expected: &str| {
        let args = [&["diagnose", "model.toml"], args].concat();
        let output = orchestrator(&args, dir.path());
        assert_eq!(output.status.code(), Some(2), "{args:?}: {}", said(&output));
        assert!(said(&output).contains(expected), "{args:?}: {}", said(&output));
    };
    refused(&["--between", "a.csv", "b.csv"], "give two files of the same kind");
    refused(&["--between", "a.csv", "a.csv", "--data", "a.csv"], "give either --data FILE");
    refused(&["--between", "a.csv", "a.csv", "--fit-runs", "1"], "cannot be used with");
    refused(&["--between", "a.csv"], "2 values required");
    refused(&[], "--data <FILE>");
    refused(&["--between", "a.csv", "none.csv"], "none.csv");
    refused(&["--between", "packets.csv", "a.csv"], "does not apply to packets");
}
