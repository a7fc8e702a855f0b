//! Reception predicted from readings that are given. The rows are made here: by a waterfall and losses of their own, by counting
//! frame by frame, at levels that follow from nothing.

use diagnose::Request;
use diagnose::compare::comparison::Comparison;
use measure::table::DataTable;
use serde_json::Value;
use std::fmt::Write as _;
use study::Study as _;
use study::choices::{ChoiceError, Choices};
use study::links::LinkStudy;
use study::links::rows::ModelledLinks;
use study::open::{self, OpenError};
use tests::answers::{self, measurements as table, model as config};
use tests::{folder, orchestrator, said};

/// Nothing of this is near what was measured: levels are given.
const FRIIS: &str = "[netsim.phy]\npropagation = \"friis\"\ntx_power_dbm = -60.0\n";
const MOTES: u32 = 12;
const FRAMES: u32 = 100;
/// The receivers' waterfall.
const P50_DBM: f64 = -87.5;
const WIDTH_DB: f64 = 0.8;

/// Uniform numbers between 0 and 1, one after the other (Lehmer's generator).
struct Draws(u64);

impl Draws {
    fn draw(&mut self) -> f64 {
        self.0 = self.0 * 48_271 % 2_147_483_647;
        self.0 as f64 / 2_147_483_647.0
    }
}

/// The share of frames that should pass.
fn share(rssi_dbm: f64, channel: u32, duty: f64) -> f64 {
    let is_hit = (11..=14).contains(&channel);
    let survival = if is_hit { 1.0 - duty } else { 1.0 };
    survival / (1.0 + (-(rssi_dbm - P50_DBM) / WIDTH_DB).exp())
}

/// Every link and channel once, at any level from -95 to -75 dBm; `duty` of the frames on the channels of WiFi 1 are lost. And the
/// variance of the share received about what it should be, over rows of which anything was received.
fn measured(duty: f64, seed: u64) -> (DataTable, f64) {
    let mut csv =
        "time_s,tx,rx,channel,tx_x_m,tx_y_m,tx_z_m,rx_x_m,rx_y_m,rx_z_m,frames,pdr,rssi_dbm\n"
            .to_owned();
    let mut draws = Draws(seed);
    let (mut squares, mut n, mut time_s) = (0.0, 0.0, 0);
    for tx in 0..MOTES {
        for rx in (0..MOTES).filter(|rx| *rx != tx) {
            for channel in 11..=26 {
                let rssi_dbm = (-950.0 + 200.0 * draws.draw()).round() / 10.0;
                let expected = share(rssi_dbm, channel, duty);
                let received = (0..FRAMES).filter(|_| draws.draw() < expected).count();
                let pdr = received as f64 / f64::from(FRAMES);
                let reading = if received == 0 { String::new() } else { rssi_dbm.to_string() };
                let (x0, x1) = (5 * (tx % 4), 5 * (rx % 4));
                let (y0, y1) = (6 * (tx / 4), 6 * (rx / 4));
                writeln!(
                    csv,
                    "{time_s},{tx},{rx},{channel},{x0},{y0},1,{x1},{y1},1,{FRAMES},{pdr},{reading}"
                )
                .unwrap();
                time_s += 10;
                if received != 0 {
                    squares += (pdr - expected).powi(2);
                    n += 1.0;
                }
            }
        }
    }
    (table(&csv), squares / n)
}

/// Readings are given.
fn given() -> Choices {
    Choices { given_rssi: true, ..Choices::default() }
}

fn study(text: &str, table: &DataTable) -> LinkStudy {
    open::links(&config(text), table, &given()).unwrap().0
}

fn diagnosed(text: &str, table: &DataTable) -> Value {
    let found = answers::diagnosed(&Request::new(&config(text), table).with_choices(given()));
    serde_json::to_value(found).unwrap()
}

fn compared(text: &str, table: &DataTable) -> Comparison {
    answers::compared(&Request::new(&config(text), table).with_choices(given()))
}

fn entry<'a>(json: &'a Value, effect: &str) -> &'a Value {
    json["candidates"].as_array().unwrap().iter().find(|entry| entry["effect"] == effect).unwrap()
}

/// An estimate lies within four standard errors of the truth; a 90 % interval is 3.29 wide.
fn is_near(json: &Value, effect: &str, key: &str, truth: f64) {
    let number = |end: &str| entry(json, effect)["parameters"][key][end].as_f64().unwrap();
    let four = 4.0 * (number("high") - number("low")) / 3.29;
    assert!((number("value") - truth).abs() <= four && 0.0 < four, "{effect}: {json:#}");
}

#[test]
fn a_waterfall_and_losses_on_a_band_are_found_from_readings_that_are_given() {
    let (table, chance) = measured(0.2, 5);
    let found = diagnosed(FRIIS, &table);
    let missing: Vec<&str> =
        found["missing"].as_array().unwrap().iter().filter_map(Value::as_str).collect();
    assert_eq!(missing, ["reception-curve", "interference"], "{}", found["sentence"]);
    assert_eq!(found["verdict"], "missing-effects", "{}", found["sentence"]);
    is_near(&found, "reception-curve", "p50_dbm", P50_DBM);
    is_near(&found, "reception-curve", "width_db", WIDTH_DB);
    is_near(&found, "interference", "duty", 0.2);
    assert_eq!(entry(&found, "interference")["settings"]["centre_mhz"], 2412.0);
    // What is left is the chance of counting, to 5 %.
    let ladder = found["ladder"].as_array().unwrap();
    let rmse = |rung: usize| ladder[rung]["rmse"].as_f64().unwrap();
    assert!(rmse(2) < 1.05 * chance.sqrt(), "{} against {}", rmse(2), chance.sqrt());
    assert!(2.0 * rmse(2) < rmse(1) && rmse(1) < rmse(0), "{ladder:#?}");
}

#[test]
fn nothing_is_found_where_the_model_has_the_waterfall() {
    let curve = format!(
        "{FRIIS}[[netsim.phy.effect]]\nkind = \"reception-curve\"\np50_dbm = {P50_DBM}\nwidth_db = {WIDTH_DB}\n"
    );
    for seed in 1..=4 {
        let (table, chance) = measured(0.0, seed);
        let found = diagnosed(&curve, &table);
        assert_eq!(found["verdict"], "nothing-missing", "{seed}: {}", found["sentence"]);
        let scores = compared(&curve, &table).scores;
        let rmse = scores["rmse_pdr"];
        // The curve is sampled at steps of 0.1 dB, a frame in a thousand goes against it.
        assert!((rmse / chance.sqrt() - 1.0).abs() < 0.02, "{rmse} {}", chance.sqrt());
        assert!(scores["bias_pdr"].abs() < 0.005, "{scores:?}");
        assert!(!scores.contains_key("rmse_db"), "{scores:?}");
    }
}

#[test]
fn what_changes_readings_is_told_to_be_untestable_and_moves_nothing() {
    let (table, _) = measured(0.2, 7);
    let other =
        "[netsim.phy]\npropagation = \"log-distance\"\nexponent = 4.0\ntx_power_dbm = 20.0\n";
    assert_eq!(compared(FRIIS, &table).scores, compared(other, &table).scores);
    let one = study(FRIIS, &table);
    for candidate in one.candidates().iter() {
        let why = candidate.untestable.as_deref().unwrap_or_default();
        let decides = ["interference", "noise-floor", "reception-curve"];
        if decides.contains(&candidate.name.as_str()) || candidate.is_of_losses() {
            assert_eq!(candidate.untestable, None, "{}", candidate.name);
        } else if candidate.name == "motion-fading" {
            assert!(why.starts_with("needs"), "{why}");
        } else {
            assert!(why.contains("--given-rssi"), "{}: {why}", candidate.name);
        }
    }
    let silent = |rows: &ModelledLinks| rows.links.rejected.iter().map(|it| it.rows).sum::<usize>();
    let n_all = (MOTES * (MOTES - 1) * 16) as usize;
    assert!(0 < silent(&one.rows) && one.n_rows() + silent(&one.rows) == n_all);
    assert!(one.rows.links.rejected[0].reason.contains("no RSSI reading"));
}

#[test]
fn readings_cannot_be_given_where_nothing_follows_from_them() {
    let (table, _) = measured(0.2, 9);
    let refused = |text: &str, table: &DataTable, choices: &Choices| match open::links(
        &config(text),
        table,
        choices,
    ) {
        Err(OpenError::Choice(error)) => error,
        other => panic!("{other:?}"),
    };
    let asking = |condition: &str| Choices { condition: Some(condition.to_owned()), ..given() };
    let error = refused(FRIIS, &table, &asking("pdr > 0.5"));
    assert_eq!(error, ChoiceError::ChosenByReception { columns: "pdr".to_owned() });
    // What is given may choose.
    let above = open::links(&config(FRIIS), &table, &asking("rssi_dbm > -90")).unwrap().0;
    assert!(above.rows.links.rows.iter().all(|row| -90.0 < row.rssi_dbm));
    let disk = "[netsim.phy]\npropagation = \"unit-disk\"\nradius_m = 10.0\n";
    assert_eq!(refused(disk, &table, &given()), ChoiceError::Stated);
    let header = "time_s,tx,rx,rssi_dbm,received,channel,tx_x_m,tx_y_m,rx_x_m,rx_y_m\n";
    let single = self::table(&format!("{header}0,1,2,-80,1,11,0,0,5,0\n1,1,2,,0,11,0,0,5,0\n"));
    assert_eq!(refused(FRIIS, &single, &given()), ChoiceError::SingleFrames);
    let whole = "time_s,tx,rx,rssi_dbm,frames,pdr,channel,tx_x_m,tx_y_m,rx_x_m,rx_y_m\n";
    let whole = self::table(&format!("{whole}0,1,2,-80,9,1,11,0,0,5,0\n1,1,2,,9,0,11,0,0,5,0\n"));
    assert_eq!(refused(FRIIS, &whole, &given()), ChoiceError::NothingLost { rows: 1 });
    let robots = self::table("time_s,agent,x_m,y_m,cmd_vx_mps,cmd_vy_mps\n0,1,0,0,1,0\n");
    let points = config("[robotsim.dynamics]\nkind = \"point-mass\"\n");
    assert!(matches!(
        open::robots(&points, &robots, &given()),
        Err(OpenError::Choice(ChoiceError::NoReadings))
    ));
}

#[test]
fn the_commands_say_what_they_predict_and_extend_adds_what_decides_reception() {
    let (table, _) = measured(0.2, 11);
    let dir = folder();
    let mut csv = format!("{}\n", table.names().join(","));
    for row in 0..table.n_rows() {
        let cells = table.names().iter().map(|name| {
            let value = table.column(name).unwrap()[row];
            if value.is_nan() { String::new() } else { value.to_string() }
        });
        writeln!(csv, "{}", cells.collect::<Vec<_>>().join(",")).unwrap();
    }
    std::fs::write(dir.path().join("links.csv"), csv).unwrap();
    std::fs::write(dir.path().join("model.toml"), FRIIS).unwrap();
    let told = |code: i32, words: &[&str]| {
        let asked = ["--data", "links.csv", "--given-rssi"];
        let output = orchestrator(&[&words[..2], &asked, &words[2..]].concat(), dir.path());
        assert_eq!(output.status.code(), Some(code), "{words:?}: {}", said(&output));
        said(&output)
    };
    let text = told(0, &["compare", "model.toml"]);
    assert!(text.contains("rmse_pdr") && !text.contains("rmse_db"), "{text}");
    let effects = ["--effect", "reception-curve", "--effect", "interference"];
    told(
        0,
        &[
            &["extend", "model.toml"],
            &effects[..],
            &["--output", "better.toml", "--json", "e.json"],
        ]
        .concat(),
    );
    told(0, &["compare", "better.toml", "--json", "c.json"]);
    let json = |name: &str| -> Value {
        serde_json::from_str(&std::fs::read_to_string(dir.path().join(name)).unwrap()).unwrap()
    };
    let promised = json("e.json")["rmse"][1].as_f64().unwrap();
    let kept = json("c.json")["scores"]["rmse_pdr"].as_f64().unwrap();
    // One is held out, the other of numbers that were fitted to all rows.
    assert!((kept / promised - 1.0).abs() < 0.02, "{promised} {kept}");
    // A loss of its own, by an expression; a level is refused, and so is a page of readings.
    let formula = [
        "extend",
        "model.toml",
        "--formula",
        "duty",
        "--parameter",
        "duty=0.1:0:1",
        "--output",
        "x.toml",
        "--replace",
    ];
    told(0, &[&formula[..], &["--target", "loss"]].concat());
    let text = told(2, &formula);
    assert!(text.contains("formula cannot be fitted") && text.contains("--given-rssi"), "{text}");
    let text = told(2, &["extend", "model.toml", "--effect", "system-gain", "--output", "y.toml"]);
    assert!(text.contains("system-gain") && text.contains("--given-rssi"), "{text}");
    let text = told(2, &["diagnose", "model.toml", "--report", "r.html"]);
    assert!(text.contains("--json"), "{text}");
}
