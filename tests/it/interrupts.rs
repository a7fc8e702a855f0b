//! Ctrl-C and SIGTERM end a run cleanly, with what was recorded kept.

use std::io::{BufRead, BufReader, Read};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};
use tests::campaign::{Campaign, Hidden, Layout, Size};

/// The orchestrator with these arguments, whatever it says kept.
fn started(args: &[&str], folder: &Path) -> Child {
    Command::new(tests::executable("orchestrator"))
        .args(args)
        .current_dir(folder)
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap()
}

/// A run of the flocking example.
fn started_run(more: &[&str], folder: &Path) -> Child {
    let config = tests::repository().join("configs/flocking.toml");
    started(&[&["run", config.to_str().unwrap()], more].concat(), folder)
}

fn send(signal: &str, to: &Child) {
    assert!(Command::new("kill").args([signal, &to.id().to_string()]).status().unwrap().success());
}

fn interrupted(signal: &str, name: &str) {
    let folder = tests::folder();
    let run = started_run(&["--set", "experiment.duration_s=1e7"], folder.path());
    // Until it records.
    let begun = Instant::now();
    let recording = || {
        std::fs::read_dir(folder.path().join("runs")).is_ok_and(|mut entries| {
            entries.any(|entry| entry.unwrap().path().join("run.mcap").exists())
        })
    };
    while !recording() {
        assert!(begun.elapsed() < Duration::from_secs(10), "nothing is recorded");
        std::thread::park_timeout(Duration::from_millis(10));
    }
    std::thread::park_timeout(Duration::from_millis(300));
    send(signal, &run);
    let begun = Instant::now();
    let output = run.wait_with_output().unwrap();
    assert!(begun.elapsed() < Duration::from_secs(8), "{:?}", begun.elapsed());
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
    let begun = Instant::now();
    send("-INT", &run);
    let output = run.wait_with_output().unwrap();
    drop(connection);
    assert!(begun.elapsed() < Duration::from_secs(3), "{:?}", begun.elapsed());
    assert_eq!(output.status.code(), Some(1), "{}", tests::said(&output));
    assert!(
        tests::said(&output).contains("stopped by SIGINT before the first step"),
        "{}",
        tests::said(&output)
    );
    assert!(!folder.path().join("runs").exists(), "something was written");
}

#[test]
fn a_search_that_is_stopped_tells_what_it_has_found() {
    let folder = tests::folder();
    let hidden = [(Hidden::Temperature, Size::Clear), (Hidden::WallAttenuation, Size::Clear)];
    let campaign = Campaign::link(0, &Layout::standard(), &hidden, 8000);
    std::fs::write(folder.path().join("model.toml"), &campaign.config_toml).unwrap();
    std::fs::write(folder.path().join("data.csv"), &campaign.csv).unwrap();
    let asked = ["diagnose", "model.toml", "--data", "data.csv", "--json", "found.json"];
    let mut search = started(&[&asked[..], &["--log", "info"]].concat(), folder.path());
    let mut said = BufReader::new(search.stderr.take().unwrap());
    let mut line = String::new();
    while !line.contains("round 2") {
        line.clear();
        assert!(0 < said.read_line(&mut line).unwrap(), "it has ended by itself");
    }
    send("-INT", &search);
    let mut rest = String::new();
    said.read_to_string(&mut rest).unwrap();
    let output = search.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(1), "{rest}");
    assert!(rest.contains("interrupted in round 2"), "{rest}");
    let found: serde_json::Value =
        serde_json::from_slice(&std::fs::read(folder.path().join("found.json")).unwrap()).unwrap();
    assert_eq!(found["stopped_in_round"], 2, "{found}");
    assert_eq!(found["missing"].as_array().unwrap().len(), 1, "{found}");
    assert!(tests::said(&output).contains("interrupted in round 2; partial result: missing: "));
}
