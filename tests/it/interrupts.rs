//! Ctrl-C and SIGTERM end a run cleanly, with what was recorded kept.

use std::io::{BufRead, BufReader, Read};
use std::path::Path;
use std::process::{Child, Command};
use tests::campaign::{Campaign, Hidden, Layout, Size};
use tests::{end_of, signal, wait_until_recording};

/// The orchestrator with these arguments, whatever it says kept.
fn started(args: &[&str], folder: &Path) -> Child {
    tests::spawn(Command::new(tests::executable("murmuration")).args(args), folder)
}

/// A run of the flocking example.
fn started_run(more: &[&str], folder: &Path) -> Child {
    let config = tests::repository().join("configs/flocking.toml");
    started(&[&["run", config.to_str().unwrap()], more].concat(), folder)
}

fn interrupted(by: &str, name: &str) {
    let folder = tests::folder();
    let run = started_run(&["--set", "experiment.duration_s=1e7"], folder.path());
    wait_until_recording(&folder.path().join("runs"));
    signal(by, run.id());
    let output = end_of(run);
    assert_eq!(output.status.code(), Some(1), "{}", tests::said(&output));
    assert!(tests::said(&output).contains("interrupted after step"), "{}", tests::said(&output));

    let dir = folder.path().join("runs/flocking");
    let summary: serde_json::Value =
        serde_json::from_slice(&std::fs::read(dir.join("summary.json")).unwrap()).unwrap();
    assert_eq!(summary["status"], "interrupted");
    assert!(summary["reason"].as_str().unwrap().contains(name), "{summary}");
    assert!(0 < summary["steps"].as_u64().unwrap());
    let verified = tests::orchestrator(&["verify", dir.to_str().unwrap()], folder.path());
    assert!(verified.status.success(), "{}", tests::said(&verified));
    let left: Vec<_> = std::fs::read_dir(folder.path().join("runs")).unwrap().collect();
    assert_eq!(left.len(), 1, "temporary files were left: {left:?}");
}

#[test]
fn ctrl_c_keeps_what_was_recorded() {
    interrupted("-INT", "SIGINT");
}

#[test]
fn a_request_to_terminate_keeps_what_was_recorded() {
    interrupted("-TERM", "SIGTERM");
}

#[test]
fn a_run_that_has_not_begun_can_be_stopped() {
    // Somebody listens there, but never says a word.
    let silent = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let url = format!("http://{}", silent.local_addr().unwrap());
    let folder = tests::folder();
    let run = started_run(&["--netsim", &url], folder.path());
    // It has come to the point of connecting.
    let (connection, _) = silent.accept().unwrap();
    signal("-INT", run.id());
    let output = end_of(run);
    drop(connection);
    assert_eq!(output.status.code(), Some(1), "{}", tests::said(&output));
    assert!(
        tests::said(&output).contains("stopped by SIGINT before the first step"),
        "{}",
        tests::said(&output)
    );
    assert!(!folder.path().join("runs").exists(), "something was written");
}

/// Measurements whose search takes seconds in each round, so that it can be stopped in one.
const MANY_ROWS: usize = 4000;

/// A folder with a model that lacks two effects, and measurements of them.
fn two_effects(n_rows: usize) -> tempfile::TempDir {
    let folder = tests::folder();
    let hidden = [(Hidden::Temperature, Size::Clear), (Hidden::WallAttenuation, Size::Clear)];
    let campaign = Campaign::link(0, &Layout::standard(), &hidden, n_rows);
    std::fs::write(folder.path().join("model.toml"), &campaign.config_toml).unwrap();
    std::fs::write(folder.path().join("data.csv"), &campaign.csv).unwrap();
    folder
}

const ASKED: [&str; 5] = ["model.toml", "--data", "data.csv", "--json", "found.json"];

fn found(folder: &Path) -> serde_json::Value {
    serde_json::from_slice(&std::fs::read(folder.join("found.json")).unwrap()).unwrap()
}

/// Interrupts a command when its log has this text; its status, and everything that it printed.
fn interrupted_at(text: &str, args: &[&str], folder: &Path) -> (Option<i32>, String) {
    let mut search = started(&[args, &["--log", "info"]].concat(), folder);
    let mut said = BufReader::new(search.stderr.take().unwrap());
    let mut line = String::new();
    while !line.contains(text) {
        line.clear();
        assert!(0 < said.read_line(&mut line).unwrap(), "it has ended by itself");
    }
    signal("-INT", search.id());
    let mut rest = String::new();
    said.read_to_string(&mut rest).unwrap();
    let output = end_of(search);
    (output.status.code(), format!("{rest}{}", tests::said(&output)))
}

#[test]
fn a_search_that_is_stopped_tells_what_it_has_found() {
    let folder = two_effects(MANY_ROWS);
    let args = [&["diagnose"][..], &ASKED].concat();
    let (status, said) = interrupted_at("round 2", &args, folder.path());
    assert_eq!(status, Some(1), "{said}");
    let expected = "stopped in round 2; partial result, which may still change: missing: ";
    assert!(said.contains(expected), "{said}");
    assert!(said.contains("interrupted: the search did not finish"), "{said}");
    let found = found(folder.path());
    assert_eq!(found["stopped_in_round"], 2, "{found}");
    assert_eq!(found["complete"], false, "{found}");
    assert_eq!(found["missing"].as_array().unwrap().len(), 1, "{found}");
    let accepted = found["candidates"].as_array().unwrap().iter().find(|it| it["accepted"] == true);
    let parameters = accepted.unwrap()["parameters"].as_object().unwrap();
    assert!(!parameters.is_empty(), "{found}");
    for parameter in parameters.values() {
        let [low, value, high] =
            ["low", "value", "high"].map(|key| parameter[key].as_f64().unwrap());
        assert!(low < value && value < high, "{parameter}");
    }
}

#[test]
fn a_search_whose_budget_is_over_tells_what_it_has_found() {
    let folder = two_effects(MANY_ROWS);
    let args = [&["diagnose", "--budget", "0.5"][..], &ASKED].concat();
    let output = tests::orchestrator(&args, folder.path());
    let said = tests::said(&output);
    assert!(output.status.success(), "{said}");
    assert!(said.contains("the time budget of 0.5 s is over"), "{said}");
    let partial = found(folder.path());
    assert_eq!(partial["complete"], false, "{partial}");
    assert_eq!(partial["residuals_searched"], false, "{partial}");
    // With time enough the answer is that without a budget. Fewer rows show these effects, too.
    let folder = two_effects(2500);
    for budget in [&["--budget", "1000"][..], &[]] {
        let args = [&["diagnose"][..], budget, &ASKED].concat();
        assert!(tests::orchestrator(&args, folder.path()).status.success());
        let whole = found(folder.path());
        assert_eq!(whole["complete"], true, "{whole}");
        assert_eq!(whole["missing"], serde_json::json!(["temperature", "wall-attenuation"]));
    }
    let refused = tests::orchestrator(&["diagnose", "--budget", "0"], folder.path());
    assert_eq!(refused.status.code(), Some(2), "{}", tests::said(&refused));
}

#[test]
fn extend_writes_a_partial_answer_only_where_it_is_asked_to() {
    let folder = two_effects(MANY_ROWS);
    let extend = [&["extend"][..], &ASKED, &["--all", "--output", "better.toml"]].concat();
    let (status, said) = interrupted_at("round 2", &extend, folder.path());
    assert_eq!(status, Some(1), "{said}");
    assert!(said.contains("nothing was written") && said.contains("--partial"), "{said}");
    assert!(!folder.path().join("better.toml").exists());
    let partial = [&extend[..], &["--partial"]].concat();
    let (_, said) = interrupted_at("round 2", &partial, folder.path());
    assert!(said.contains("(partial: further effects may be missing)"), "{said}");
    let found = found(folder.path());
    assert_eq!(found["complete"], false, "{found}");
    assert_eq!(found["added"].as_array().unwrap().len(), 1, "{found}");
    let text = std::fs::read_to_string(folder.path().join("better.toml")).unwrap();
    assert!(text.contains("# The search was stopped before its end"), "{text}");
    // A fit that has not converged is never written.
    let effect = ["--effect", "wall-attenuation", "--output", "one.toml", "--budget", "0.001"];
    let refused = tests::orchestrator(&[&["extend"][..], &ASKED, &effect].concat(), folder.path());
    assert_eq!(refused.status.code(), Some(1), "{}", tests::said(&refused));
    assert!(!folder.path().join("one.toml").exists());
}

#[test]
fn power_answers_when_its_budget_is_over() {
    let folder = two_effects(MANY_ROWS);
    let asked = ["power", "model.toml", "--like", "data.csv", "--effect", "body-blocking"];
    let args = [&asked[..], &["--budget", "1", "--json", "found.json"]].concat();
    let output = tests::orchestrator(&args, folder.path());
    let said = tests::said(&output);
    assert!(output.status.success(), "{said}");
    assert!(said.contains("the time budget of 1 s is over"), "{said}");
    assert_eq!(found(folder.path())["complete"], false);
}
