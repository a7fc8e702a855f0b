//! `netsim.profile = "auto"`: a swarm that moves has a network without another key.

use serde_json::Value;
use std::path::Path;

/// Fifty robots move between random waypoints in a square. Robot 0 is the root, and the others send it a packet every ten seconds. Of the
/// network, only the mode, the radio and the traffic are configured.
const WANDERING: &str = "[experiment]\nname = \"x\"\nseed = 1\nduration_s = 400.0\nagents = 50\ncontrol_period = { rate_hz = 1.0 }\n\
    [robotsim]\nscenario = { kind = \"square\", side_m = 45.0 }\n\
    controller = { kind = \"random-waypoint\", side_m = 45.0, slowest_mps = 1.0, fastest_mps = 1.0 }\n\
    [netsim]\nmode = \"6tisch\"\nphy = { propagation = \"unit-disk\", radius_m = 15.0 }\nswarm.transport = \"none\"\n\
    [[netsim.app]]\nkind = \"periodic\"\nperiod_s = 10.0\npayload_bytes = 72\n\
    [output]\nevery_steps = 60\nlinks = \"none\"\nmcap = false\nscene = false\nframes = false\nreport = false\n";

/// The folder of a run with some keys set, and its summary.
fn run(config: &Path, folder: &Path, more: &[&str]) -> (std::path::PathBuf, Value) {
    let dir = tests::run(config, folder, more);
    let summary = std::fs::read(dir.join("summary.json")).unwrap();
    (dir, serde_json::from_slice(&summary).unwrap())
}

fn since_start(summary: &Value) -> f64 {
    summary["kpis"]["since_start"]["delivery"]["ratio"].as_f64().unwrap()
}

#[test]
fn a_swarm_that_moves_is_served_without_a_word_and_its_settings_are_written_down() {
    let folder = tests::folder();
    let config = folder.path().join("x.toml");
    std::fs::write(&config, WANDERING).unwrap();
    let (dir, chosen) = run(&config, folder.path(), &[]);
    assert!(0.9 < since_start(&chosen), "{}", chosen["kpis"]["since_start"]);
    // What was chosen stands in the recorded configuration, which is the same experiment without a choice.
    let recorded = dir.join("config.toml");
    let text = std::fs::read_to_string(&recorded).unwrap();
    let written: toml::Table = text.parse().unwrap();
    assert_eq!(written["netsim"]["profile"].as_str(), Some("rfc"));
    assert_eq!(written["netsim"]["sf"]["kind"].as_str(), Some("sotdma"));
    let again = folder.path().join("again");
    std::fs::create_dir(&again).unwrap();
    let (_, repeated) = run(&recorded, &again, &[]);
    assert_eq!(repeated["final_digest"], chosen["final_digest"]);
    // The standards' defaults lose them.
    let (_, standard) = run(
        &config,
        folder.path(),
        &[
            "--set",
            "netsim.profile=rfc",
            "--set",
            "experiment.name=rfc",
            "--set",
            "experiment.duration_s=200",
        ],
    );
    assert!(since_start(&standard) < since_start(&chosen), "{}", standard["kpis"]["since_start"]);
}

#[test]
fn what_is_chosen_is_said_before_a_run_and_by_a_sweep() {
    let folder = tests::folder();
    let short = WANDERING.replace("duration_s = 400.0", "duration_s = 5.0");
    std::fs::write(folder.path().join("sweep.toml"), format!("{short}[sweep]\nseeds = 1\n"))
        .unwrap();
    std::fs::write(folder.path().join("run.toml"), short).unwrap();
    for words in [
        &["check", "run.toml"][..],
        &["run", "run.toml", "--dry-run"],
        &["sweep", "sweep.toml", "--dry-run"],
        &["sweep", "sweep.toml"],
    ] {
        let output = tests::orchestrator(words, folder.path());
        let said = tests::said(&output);
        assert!(output.status.success(), "{words:?}: {said}");
        let chosen =
            "netsim.profile = \"auto\": 50 of 50 robots move at up to 1 m/s, so sf.kind = ";
        assert!(said.contains(chosen), "{words:?}: {said}");
    }
}
