//! Commands that show a run, or write it for other programs: what they refuse, and that they leave nothing half-done.

use std::path::Path;
use std::process::Output;
use tests::{orchestrator, said};

/// A folder with the results of a short run in `runs/e`.
fn recorded() -> tempfile::TempDir {
    let folder = tests::folder();
    let experiment = "[experiment]\nname = \"e\"\nseed = 3\nduration_s = 2.0\nagents = 4\n\
        [robotsim.scenario]\nkind = \"line\"\n[robotsim.controller]\nkind = \"random-jump\"\n\
        [netsim.phy]\npropagation = \"full\"\n";
    std::fs::write(folder.path().join("e.toml"), experiment).unwrap();
    let output = orchestrator(&["run", "e.toml"], folder.path());
    assert!(output.status.success(), "{}", said(&output));
    folder
}

fn refused(args: &[&str], folder: &Path, words: &[&str]) {
    let output: Output = orchestrator(args, folder);
    assert_eq!(output.status.code(), Some(2), "{args:?}: {}", said(&output));
    for word in words {
        assert!(said(&output).contains(word), "{args:?}: {word}: {}", said(&output));
    }
}

#[test]
fn what_is_no_recorded_run_is_refused_with_what_to_give() {
    let folder = recorded();
    let here = folder.path();
    std::fs::write(here.join("answer.json"), "{\"verdict\": 1}").unwrap();
    std::fs::write(here.join("no.json"), "not JSON").unwrap();
    refused(&["replay", "nowhere"], here, &["nowhere", "recorded run"]);
    refused(&["replay", "runs/e", "--with", "nowhere"], here, &["nowhere"]);
    refused(&["replay", "runs/e", "--output", "missing/page.html"], here, &["missing/page.html"]);
    refused(
        &["replay", "runs/e", "--diagnosis", "answer.json", "--output", "page.html"],
        here,
        &["answer.json", "schema", "diagnose/2"],
    );
    refused(
        &["replay", "runs/e", "--diagnosis", "no.json", "--output", "page.html"],
        here,
        &["no.json", "JSON"],
    );
    refused(&["export", "nowhere", "--format", "csv"], here, &["nowhere", "recorded run"]);
    refused(&["export", "nowhere", "--format", "rosbag2"], here, &["nowhere"]);
    refused(&["export", "runs/e", "--format", "pdf"], here, &["csv", "rosbag2"]);
    let left: Vec<_> = std::fs::read_dir(here)
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .filter(|name| !["e.toml", "runs", "answer.json", "no.json"].contains(&&**name))
        .collect();
    assert_eq!(left, Vec::<String>::new());
}

#[test]
fn a_recording_that_was_cut_off_is_refused_and_said_to_be() {
    let folder = recorded();
    let path = folder.path().join("runs/e/run.mcap");
    let content = std::fs::read(&path).unwrap();
    std::fs::write(&path, &content[..content.len() / 2]).unwrap();
    let output = orchestrator(&["replay", "runs/e", "--output", "page.html"], folder.path());
    assert_eq!(output.status.code(), Some(1), "{}", said(&output));
    let wrote = format!("run.mcap: has {} bytes, but the run wrote", content.len() / 2);
    assert!(said(&output).contains(&wrote), "{}", said(&output));
    assert!(!folder.path().join("page.html").exists());
}

#[test]
fn an_export_goes_next_to_the_run_and_replaces_nothing() {
    let folder = recorded();
    let here = folder.path();
    for format in ["csv", "rosbag2"] {
        let output = orchestrator(&["export", "runs/e", "--format", format], here);
        assert!(output.status.success(), "{}", said(&output));
        assert!(here.join(format!("runs/e-{format}")).is_dir());
        refused(&["export", "runs/e", "--format", format], here, &["exists", "--out"]);
    }
    let steps = std::fs::read_to_string(here.join("runs/e-csv/steps.csv")).unwrap();
    let n_steps = record::verify(&here.join("runs/e")).unwrap().steps as usize;
    assert_eq!(steps.lines().count(), 1 + 4 * (n_steps + 1));
    assert!(steps.starts_with("step,time_ns,agent,alive,x_m,y_m,z_m,"), "{steps:.80}");
}

#[test]
fn options_of_the_live_page_need_one() {
    let folder = recorded();
    refused(&["run", "e.toml", "--live-speed", "2"], folder.path(), &["--live"]);
    refused(&["run", "e.toml", "--live-control"], folder.path(), &["--live"]);
    refused(&["run", "e.toml", "--live", "--live-speed", "0"], folder.path(), &["0.001"]);
}
