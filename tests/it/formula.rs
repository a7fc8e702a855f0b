//! `extend --formula`: an expression of the user's, fitted to links and to robots, whose error then falls as promised.

use std::fmt::Write as _;
use std::path::Path;
use tests::{folder, orchestrator, said};

const FRIIS: &str =
    "[netsim.phy]\npropagation = \"friis\"\ntx_power_dbm = 0.0\nnoise_sd_db = 2.0\n";
const POINTS: &str = "[robotsim.dynamics]\nkind = \"point-mass\"\n";

/// Noise with a mean of 0 that repeats itself: ± 1.
fn noise(row: u32) -> f64 {
    if (row / 3).is_multiple_of(2) { 1.0 } else { -1.0 }
}

/// Eight motes that stand while it grows warm and cool again; beyond 25 °C each degree costs 0.4 dB.
fn links() -> String {
    let mut csv =
        "time_s,tx,rx,channel,tx_x_m,tx_y_m,tx_z_m,rx_x_m,rx_y_m,rx_z_m,rssi_dbm,received,air_c\n"
            .to_owned();
    for row in 0..1200u32 {
        let (tx, step) = (row % 8, 1 + row / 8 % 7);
        let rx = (tx + step) % 8;
        let place = |mote: u32| (f64::from(mote * mote % 11), f64::from(mote * 3 % 7));
        let ((x0, y0), (x1, y1)) = (place(tx), place(rx));
        let distance_m = (x1 - x0).hypot(y1 - y0);
        let air_c = 25.0 + 15.0 * (f64::from(row) / 90.0).sin();
        let lost_db = 0.4 * (air_c - 25.0).max(0.0);
        let rssi_dbm = -40.05 - 20.0 * distance_m.log10() - lost_db + 2.0 * noise(row);
        writeln!(csv, "{row},{tx},{rx},15,{x0},{y0},1,{x1},{y1},1,{rssi_dbm:.3},1,{air_c:.4}")
            .unwrap();
    }
    csv
}

/// A robot that goes to and fro along x and loses 0.05 of its speed for each kilogramme of its load.
fn robots() -> String {
    let mut csv = "time_s,agent,x_m,y_m,cmd_vx_mps,cmd_vy_mps,load_kg\n".to_owned();
    let mut x_m = 0.0;
    for step in 0..1200u32 {
        let speed_mps = if step / 40 % 2 == 0 { 1.0 } else { -1.0 };
        let load_kg = f64::from(step / 100 % 4);
        let measured_m = x_m + 0.002 * noise(step);
        writeln!(csv, "{:.1},0,{measured_m:.5},0,{speed_mps},0,{load_kg}", f64::from(step) * 0.1)
            .unwrap();
        x_m += 0.1 * speed_mps * (1.0 - 0.05 * load_kg);
    }
    csv
}

/// What `extend` and then `compare` on the new model say as JSON, and the new model.
fn extended(
    folder: &Path,
    (model, csv): (&str, &str),
    formula: &[&str],
) -> (serde_json::Value, serde_json::Value, toml::Table) {
    std::fs::write(folder.join("model.toml"), model).unwrap();
    std::fs::write(folder.join("data.csv"), csv).unwrap();
    let run = |arguments: &[&str]| {
        let output = orchestrator(arguments, folder);
        assert!(output.status.success(), "{arguments:?}: {}", said(&output));
        let json = std::fs::read_to_string(folder.join("found.json")).unwrap();
        serde_json::from_str::<serde_json::Value>(&json).unwrap()
    };
    let data = ["--data", "data.csv", "--json", "found.json"];
    let extend =
        [&["extend", "model.toml", "--output", "better.toml"], &data[..], formula].concat();
    let added = run(&extend);
    let better = std::fs::read_to_string(folder.join("better.toml")).unwrap();
    let compared = run(&[&["compare", "better.toml"], &data[..]].concat());
    (added, compared, better.parse().unwrap())
}

#[test]
fn a_formula_over_a_column_is_fitted_and_the_error_falls_as_promised() {
    let folder = folder();
    let (added, compared, better) = extended(
        folder.path(),
        (FRIIS, &links()),
        &[
            "--formula",
            "-a * max(air_c - onset_c, 0)",
            "--parameter",
            "a=0.1:0:2",
            "--parameter",
            "onset_c=20:10:40",
        ],
    );
    let parameters = &better["netsim"]["phy"]["effect"][0]["parameters"];
    let value = |name: &str| parameters[name]["value"].as_float().unwrap();
    // Standard errors, by hand: 2 dB over the root of the 600 warm rows over the spread of their warmth, 4.6 °C; some 0.4 °C.
    assert!((value("a") - 0.4).abs() < 4.0 * 0.02, "{parameters}");
    assert!((value("onset_c") - 25.0).abs() < 4.0 * 0.5, "{parameters}");
    let [before, after] = [0, 1].map(|k| added["rmse"][k].as_f64().unwrap());
    assert!(3.0 < before && (1.95..2.05).contains(&after), "{added}");
    let rmse = compared["scores"]["rmse_db"].as_f64().unwrap();
    assert!((rmse - after).abs() < 0.02, "{rmse} dB, promised {after}");
}

#[test]
fn a_formula_is_added_to_what_robots_do() {
    let folder = folder();
    let formula = ["--formula", "-k * load_kg * speed_mps", "--parameter", "k=0.01:0:1"];
    let (added, compared, better) = extended(folder.path(), (POINTS, &robots()), &formula);
    let effect = &better["robotsim"]["dynamics"]["effect"][0];
    let k = effect["parameters"]["k"]["value"].as_float().unwrap();
    assert!((k - 0.05).abs() < 0.002, "{effect}");
    let [before, after] = [0, 1].map(|k| added["rmse"][k].as_f64().unwrap());
    assert!(0.05 < before && after < 0.005, "{added}");
    let rmse = compared["scores"]["rmse_m"].as_f64().unwrap();
    assert!((rmse - after).abs() < 0.001, "{rmse} m, promised {after}");
}

#[test]
fn what_is_wrong_with_a_formula_is_said_and_nothing_written() {
    let folder = folder();
    std::fs::write(folder.path().join("model.toml"), FRIIS).unwrap();
    std::fs::write(folder.path().join("data.csv"), links()).unwrap();
    std::fs::write(folder.path().join("robots.toml"), POINTS).unwrap();
    std::fs::write(folder.path().join("robots.csv"), robots()).unwrap();
    let links = ["model.toml", "--data", "data.csv"];
    let robots = ["robots.toml", "--data", "robots.csv"];
    for (data, formula, parts) in [
        (
            links,
            &["--formula", "-a * max(air_f, 0) + distanc_m", "--parameter", "a=1"][..],
            &["air_f", "did you mean air_c?", "did you mean distance_m?"][..],
        ),
        (
            links,
            &["--formula", "-a * air_c"],
            &[
                "a is neither a covariate of these data nor a parameter; declare a parameter with --parameter a=START:MIN:MAX",
            ],
        ),
        (
            links,
            &["--formula", "air_c", "--parameter", "b=1", "--target", "left"],
            &["formula.parameters.b: must be used by the expression", "formula.target", "\"left\""],
        ),
        (links, &["--formula", "2 * (air_c"], &["( is not closed"]),
        (links, &["--effect", "system-gain", "--parameter", "b=1"], &["--formula"]),
        (links, &["--formula", "a", "--parameter", "a=3:0:1"], &["nearest valid: 1"]),
        (robots, &["--formula", "load_g", "--target", "mean"], &["load_g", "\"mean\""]),
        (robots, &["--formula", "load_g"], &["did you mean load_kg?"]),
    ] {
        let arguments = [&["extend"], &data[..], &["--output", "better.toml"], formula].concat();
        let output = orchestrator(&arguments, folder.path());
        let said = said(&output);
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {said}");
        for part in parts {
            assert!(said.contains(part), "{part:?} is not in\n{said}");
        }
        assert!(!folder.path().join("better.toml").exists());
    }
}
