//! Measured robots compared with a robot simulator that runs elsewhere: `--robotsim` of compare, diagnose and extend.

use serde_json::Value;
use std::path::Path;
use std::process::Output;
use tests::Server;
use tests::campaign::{Campaign, Drive, Fleet, Layout, RobotHidden, Size};
use tests::fake::{Fault, Faulty};

/// A campaign of robots that slip, in a folder: `model.toml`, `robots.csv`.
fn slipping(folder: &Path, drive: Drive, more: &str) {
    let hidden = [(RobotHidden::Slip, Size::Clear)];
    let campaign = Campaign::robots(1, &Fleet::standard(drive), &hidden, 2500);
    std::fs::write(folder.join("model.toml"), campaign.config_toml + more).unwrap();
    std::fs::write(folder.join("robots.csv"), campaign.csv).unwrap();
}

fn ask(folder: &Path, verb: &str, more: &[&str]) -> Output {
    let args = [verb, "model.toml", "--data", "robots.csv", "--json", "found.json"];
    tests::orchestrator(&[&args[..], more].concat(), folder)
}

fn answer(folder: &Path, verb: &str, more: &[&str]) -> Value {
    let output = ask(folder, verb, more);
    assert_eq!(output.status.code(), Some(0), "{}", tests::said(&output));
    serde_json::from_slice(&std::fs::read(folder.join("found.json")).unwrap()).unwrap()
}

/// Every number of two answers, beside its place.
fn numbers(place: String, one: &Value, other: &Value, into: &mut Vec<(String, f64, f64)>) {
    match (one, other) {
        (Value::Number(a), Value::Number(b)) => {
            into.push((place, a.as_f64().unwrap(), b.as_f64().unwrap()));
        }
        (Value::Array(a), Value::Array(b)) => {
            assert_eq!(a.len(), b.len(), "{place}");
            for (index, (a, b)) in a.iter().zip(b).enumerate() {
                numbers(format!("{place}[{index}]"), a, b, into);
            }
        }
        (Value::Object(a), Value::Object(b)) => {
            for (key, a) in a.iter().filter(|(key, _)| *key != "predicted_by") {
                numbers(format!("{place}.{key}"), a, &b[key], into);
            }
        }
        (a, b) => assert_eq!(a, b, "{place}"),
    }
}

#[test]
fn our_own_simulator_elsewhere_gives_the_answers_of_our_own_dynamics() {
    let server = Server::start("robotsim", &[]).unwrap();
    let lag = "\n[[robotsim.dynamics.effect]]\nkind = \"actuator-lag\"\ntau_s = 0.2\n";
    for (drive, more, scale) in [
        // Sums of steps instead of one path, and durations in whole nanoseconds.
        (Drive::Velocity, "", 1e-6),
        (Drive::Unicycle, "", 1e-6),
        // After 2 s actuators still remember exp(-10) of a change.
        (Drive::Velocity, lag, 1e-3),
    ] {
        let folder = tests::folder();
        slipping(folder.path(), drive, more);
        let own = answer(folder.path(), "compare", &[]);
        let other = answer(folder.path(), "compare", &["--robotsim", &server.url]);
        assert_eq!(other["predicted_by"], "robotsim 0.2.0");
        let mut found = Vec::new();
        numbers(String::new(), &own, &other, &mut found);
        assert!(30 < found.len(), "{found:?}");
        // Digits of p-values count by their logarithms.
        found.retain(|(place, ..)| !place.ends_with("p_value"));
        for (place, one, other) in found {
            let close = (one - other).abs() <= scale * one.abs().max(0.1);
            assert!(close, "{drive:?} {more} {place}: {one} {other}");
        }
    }
}

#[test]
fn a_slip_is_named_on_top_of_predictions_and_added_where_the_simulator_executes_it() {
    let folder = tests::folder();
    slipping(folder.path(), Drive::Velocity, "");
    let server = Server::start("robotsim", &[]).unwrap();
    let found = answer(folder.path(), "diagnose", &["--robotsim", &server.url]);
    assert_eq!(found["missing"][0], "slip", "{}", found["sentence"]);
    let more = ["--robotsim", &server.url, "--effect", "slip", "--output", "better.toml"];
    let before_m = found["ladder"][0]["rmse"].as_f64().unwrap();
    let added = answer(folder.path(), "extend", &more);
    assert_eq!(added["added"][0], "slip");
    std::fs::rename(folder.path().join("better.toml"), folder.path().join("model.toml")).unwrap();
    let better = answer(folder.path(), "compare", &["--robotsim", &server.url]);
    let after_m = better["scores"]["rmse_m"].as_f64().unwrap();
    // What is left is the noise of a measured position, 1.5 cm on each axis, within 10 %.
    assert!((after_m / (0.015 * 2f64.sqrt()) - 1.0).abs() < 0.1, "{after_m}");
    assert!(1.5 * after_m < before_m, "{before_m} {after_m}");
    let promised_m = added["rmse"][1].as_f64().unwrap();
    assert!((after_m / promised_m - 1.0).abs() < 0.02, "{promised_m} {after_m}");
}

#[test]
fn an_extension_that_the_simulator_would_not_execute_is_not_written() {
    let folder = tests::folder();
    slipping(folder.path(), Drive::Velocity, "");
    let url = Faulty::robots(Fault::PredictsUnconfigured).url;
    let more = ["--robotsim", &url, "--effect", "slip", "--output", "better.toml"];
    let output = ask(folder.path(), "extend", &more);
    let said = tests::said(&output);
    assert_eq!(output.status.code(), Some(1), "{said}");
    assert!(
        said.contains("does not move accordingly") && said.contains("nothing was written"),
        "{said}"
    );
    assert!(!folder.path().join("better.toml").exists());
}

#[test]
fn what_cannot_be_compared_with_a_simulator_elsewhere_is_refused_with_what_is_lacking() {
    let folder = tests::folder();
    slipping(folder.path(), Drive::Velocity, "");
    let refused = |more: &[&str], status: i32, texts: &[&str]| {
        let output = ask(folder.path(), "compare", more);
        let said = tests::said(&output);
        assert_eq!(output.status.code(), Some(status), "{said}");
        for text in texts {
            assert!(said.contains(text), "{text}: {said}");
        }
    };
    let url = Faulty::robots(Fault::CannotPredict).url;
    let lacking = ["robotsim: robotsim at", "does not announce predictions", "serve Predict"];
    refused(&["--robotsim", &url], 2, &lacking);
    refused(&["--robotsim", "127.0.0.1:1"], 2, &["must be http://HOST:PORT"]);
    refused(
        &["--robotsim", "http://127.0.0.1:1"],
        2,
        &["robotsim: cannot reach http://127.0.0.1:1"],
    );
    let server = Server::start("robotsim", &[]).unwrap();
    let https = server.url.replace("http://", "https://");
    refused(&["--robotsim", &https], 2, &["give --tls-ca"]);
    // What the simulator refuses of its configuration stands on its line of the file.
    let wrong = ["--robotsim", &server.url, "--set", "robotsim.dynamics.speed_cap_mps=-1.0"];
    refused(&wrong, 2, &["robotsim.dynamics.speed_cap_mps"]);
    let wrong = ["--robotsim", &server.url, "--set", "robotsim.dynamics.kind=quadrotor"];
    refused(&wrong, 2, &["robotsim.dynamics.kind", "\"point-mass\""]);
    let links = Campaign::link(1, &Layout::standard(), &[], 100).csv;
    std::fs::write(folder.path().join("robots.csv"), links).unwrap();
    refused(&["--robotsim", &server.url], 2, &["applies to robot samples only"]);
}

#[test]
fn a_simulator_that_predicts_nonsense_or_hangs_is_named() {
    let folder = tests::folder();
    slipping(folder.path(), Drive::Velocity, "");
    for (fault, text) in [
        (Fault::PredictsNotANumber, "windows[0].y_m[0]: must be finite"),
        (Fault::PredictsTooFew, "one per window of the request"),
        (Fault::PredictsAnother, "windows[0].agent: must be"),
        (Fault::Silent, "robotsim: does not respond: no reply to Predict of windows 0 to"),
    ] {
        let url = Faulty::robots(fault).url;
        let output = ask(folder.path(), "compare", &["--robotsim", &url]);
        let said = tests::said(&output);
        assert_eq!(output.status.code(), Some(1), "{fault:?}: {said}");
        assert!(said.contains(text) && said.contains("robotsim: "), "{fault:?}: {said}");
        assert!(!folder.path().join("found.json").exists(), "{fault:?}");
    }
}
