//! Ctrl-C and SIGTERM end a run cleanly, with what was recorded kept.

use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

fn interrupted(signal: &str, name: &str) {
    let folder = tests::folder();
    let config = tests::repository().join("configs/flocking.toml");
    let run = Command::new(tests::executable("orchestrator"))
        .arg("run")
        .arg(config)
        .args(["--set", "experiment.duration_s=1e7"])
        .current_dir(folder.path())
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
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
    assert!(Command::new("kill").args([signal, &run.id().to_string()]).status().unwrap().success());
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
    let run = Command::new(tests::executable("orchestrator"))
        .arg("run")
        .arg(tests::repository().join("configs/flocking.toml"))
        .args(["--netsim", &url])
        .current_dir(folder.path())
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    // It has come to the point of connecting.
    let (connection, _) = silent.accept().unwrap();
    let begun = Instant::now();
    assert!(Command::new("kill").args(["-INT", &run.id().to_string()]).status().unwrap().success());
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
