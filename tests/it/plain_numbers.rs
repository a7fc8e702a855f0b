//! What `compare`, `diagnose` and `extend` report in plain numbers: the exponent of the site, the plain error of received frames, the
//! split, and a constant that all readings are off by.

use measure::config::Compared;
use physics::Model;
use proto::effect::FromModel;
use serde_json::Value;
use std::path::Path;
use tempfile::TempDir;
use tests::campaign::unforeseen::answer::Judgement;
use tests::campaign::unforeseen::{Case, Kind, Question};

/// A campaign of a row of the table of unforeseen ones, written to a folder.
fn campaign(row: u8, seed: u64) -> (Case, TempDir) {
    let case = Question { kind: Kind::Row(row), seed }.case();
    let folder = tests::folder();
    std::fs::write(folder.path().join("model.toml"), &case.config_toml).unwrap();
    std::fs::write(folder.path().join("data.csv"), &case.csv).unwrap();
    (case, folder)
}

/// What a command printed, and the JSON that it wrote.
fn answer(command: &str, more: &[&str], folder: &Path) -> (String, Value) {
    let args = [command, "model.toml", "--data", "data.csv", "--json", "found.json"];
    let output = tests::orchestrator(&[&args[..], more].concat(), folder);
    let said = tests::said(&output);
    assert!(output.status.success(), "{said}");
    (said, serde_json::from_slice(&std::fs::read(folder.join("found.json")).unwrap()).unwrap())
}

fn radio(config: &Path) -> Model {
    let text = std::fs::read_to_string(config).unwrap();
    Compared::of_text(config, text, &[]).unwrap().radio(30).unwrap().0
}

#[test]
fn the_exponent_on_a_log_distance_base_is_that_of_the_site() {
    let (case, folder) = campaign(11, 3);
    let (_, found) = answer("diagnose", &[], folder.path());
    let judged = case.judged(&found);
    assert_eq!(judged.judgement, Judgement::Honest, "{judged:?}: {found}");
    let candidates = found["candidates"].as_array().unwrap();
    let accepted = candidates.iter().find(|it| it["effect"] == "path-loss-exponent").unwrap();
    let exponent = accepted["parameters"]["exponent"]["value"].as_f64().unwrap();
    let base = radio(&folder.path().join("model.toml"));
    let base = base.property(FromModel::PathLossExponent).unwrap();
    assert_eq!(accepted["settings"]["base_exponent"].as_f64(), Some(base));
    assert!(2.8 < base, "{base}");

    // A run of the extended configuration has the exponent of the site.
    answer("extend", &["--effect", "path-loss-exponent", "--output", "better.toml"], folder.path());
    let better = radio(&folder.path().join("better.toml"));
    let of_run = better.property(FromModel::PathLossExponent).unwrap();
    assert!((of_run - exponent).abs() < 1e-3, "{of_run} {exponent}");
    // And what it lacks then starts from there.
    let again = ["diagnose", "better.toml", "--data", "data.csv", "--json", "again.json"];
    assert!(tests::orchestrator(&again, folder.path()).status.success());
    let again = std::fs::read(folder.path().join("again.json")).unwrap();
    let again: Value = serde_json::from_slice(&again).unwrap();
    assert!(!again["missing"].to_string().contains("path-loss-exponent"), "{again}");
}

#[test]
fn a_constant_bias_is_reported_first_and_blames_no_covariate() {
    for seed in [3, 8] {
        let (case, folder) = campaign(12, seed);
        let (said, found) = answer("compare", &[], folder.path());
        let judged = case.judged(&found);
        assert_eq!(judged.judgement, Judgement::Honest, "{judged:?}: {said}");
        let value = found["offset_db"]["value"].as_f64().unwrap();
        let side = if value < 0.0 { "below" } else { "above" };
        let expected = format!("readings are {:.1} dB {side} the model everywhere", value.abs());
        let first = said.find(&expected).unwrap_or_else(|| panic!("{expected}: {said}"));
        assert!(first < said.find("error by covariate").unwrap(), "{said}");
        // The noise is bounded by the plain error.
        let score = |name: &str| found["scores"][name].as_f64().unwrap();
        assert!(score("rmse_db") < 1.5 * score("rmse_received_db"), "{said}");
    }
}

#[test]
fn parameters_of_a_single_sender_are_not_reported_as_estimates() {
    // In half of these campaigns one moving node is the only sender, or the only receiver.
    for seed in 0..2 {
        let (case, folder) = campaign(13, 16 * seed + 4);
        let (said, found) = answer("diagnose", &[], folder.path());
        let judged = case.judged(&found);
        assert_ne!(judged.judgement, Judgement::FalseCertain, "{judged:?}: {said}");
    }
}

#[test]
fn too_few_pairs_of_nodes_fall_back_to_places() {
    let (_, folder) = campaign(3, 2);
    // Without times, rows are held out by pairs of nodes, of which there are at most 12.
    let csv = std::fs::read_to_string(folder.path().join("data.csv")).unwrap();
    let without_times: String = csv
        .lines()
        .map(|line| {
            let (time, rest) = line.split_once(',').unwrap();
            let time = if time == "time_s" { time } else { "0" };
            format!("{time},{rest}\n")
        })
        .collect();
    std::fs::write(folder.path().join("data.csv"), without_times).unwrap();
    let (said, found) = answer("diagnose", &[], folder.path());
    assert_eq!(found["split"], "places", "{said}");
    assert!(said.contains("places are held out instead, as with --split place"), "{said}");
    assert!(said.contains("model (places held out)"), "{said}");
    assert_eq!(found["verdict"], "missing-effects", "{said}");
    // What the user chooses stands.
    let (said, found) = answer("diagnose", &["--split", "pair"], folder.path());
    assert_eq!(found["split"], "pairs of nodes", "{said}");
    assert!(said.contains("too few independent blocks"), "{said}");
}
