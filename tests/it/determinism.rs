//! The same configuration and seed give the same recording, byte for byte, however it is run.

use std::path::{Path, PathBuf};
use tests::campaign::{Campaign, Hidden, Layout, Size};
use tests::recording::{assert_same, read_recording};
use tests::{Server, run};

/// Configurations that differ in model, effects, coupling and size. Each runs in a second or two.
const CONFIGS: [(&str, &[&str]); 8] = [
    ("flocking", &["experiment.duration_s=3.0"]),
    ("formation", &["experiment.duration_s=2.0"]),
    ("walls", &["experiment.duration_s=2.0"]),
    ("rooms", &["experiment.duration_s=4.0"]),
    ("shadowing", &["experiment.duration_s=2.0"]),
    ("packet-control", &["experiment.duration_s=1.0"]),
    // Enough agents for every parallel loop and for the bitmap form.
    ("flocking", &["experiment.duration_s=6.0", "experiment.agents=300"]),
    // Enough for digests to be computed beside other work.
    (
        "flocking",
        &[
            "experiment.duration_s=0.5",
            "experiment.agents=1100",
            "experiment.control_period={ rate_hz = 10.0 }",
            "netsim.phy={ propagation = \"unit-disk\", radius_m = 10.0 }",
        ],
    ),
];

fn config(name: &str) -> PathBuf {
    tests::repository().join(format!("configs/{name}.toml"))
}

fn args<'a>(settings: &[&'a str], more: &[&'a str]) -> Vec<&'a str> {
    settings.iter().flat_map(|setting| ["--set", setting]).chain(more.iter().copied()).collect()
}

fn variants(check: impl Fn(&str, &[&str], &Path, &Path)) {
    let folder = tests::folder();
    for (index, (name, settings)) in CONFIGS.iter().enumerate() {
        let home = folder.path().join(index.to_string());
        let reference =
            run(&config(name), &home.join("reference"), &args(settings, &["--threads", "1"]));
        check(name, settings, &home, &reference);
    }
}

#[test]
fn threads_do_not_matter() {
    variants(|name, settings, home, reference| {
        let other = run(&config(name), &home.join("threads"), &args(settings, &["--threads", "2"]));
        assert_same(reference, &other);
    });
}

#[test]
fn threads_of_a_search_do_not_matter() {
    let folder = tests::folder();
    let hidden = [(Hidden::WallAttenuation, Size::Clear)];
    let campaign = Campaign::link(0, &Layout::standard(), &hidden, 600);
    std::fs::write(folder.path().join("model.toml"), &campaign.config_toml).unwrap();
    std::fs::write(folder.path().join("data.csv"), &campaign.csv).unwrap();
    let found = |threads: &str| {
        let args =
            ["diagnose", "model.toml", "--data", "data.csv", "--json", "-", "--threads", threads];
        let output = tests::orchestrator(&args, folder.path());
        assert!(output.status.success(), "{}", tests::said(&output));
        output.stdout
    };
    assert!(found("1") == found("3"));
    let refused = tests::orchestrator(
        &["diagnose", "model.toml", "--data", "data.csv", "--threads", "0"],
        folder.path(),
    );
    assert_eq!(refused.status.code(), Some(2), "{}", tests::said(&refused));
}

#[test]
fn streaming_or_single_calls_do_not_matter() {
    variants(|name, settings, home, reference| {
        for transport in ["experiment.transport=unary", "experiment.transport=stream"] {
            let other =
                run(&config(name), &home.join(transport), &args(settings, &["--set", transport]));
            assert_same(reference, &other);
        }
    });
}

#[test]
fn children_or_separate_programs_do_not_matter() {
    // One pair of programs serves all experiments: configuring again begins afresh.
    let netsim = Server::start("netsim", &[]).unwrap();
    let robotsim = Server::start("robotsim", &["--threads", "2"]).unwrap();
    variants(|name, settings, home, reference| {
        let urls = ["--netsim", netsim.url.as_str(), "--robotsim", robotsim.url.as_str()];
        let other = run(&config(name), &home.join("separate"), &args(settings, &urls));
        assert_same(reference, &other);
    });
}

#[test]
fn another_seed_gives_another_recording() {
    variants(|name, settings, home, reference| {
        let other = run(&config(name), &home.join("seed"), &args(settings, &["--seed", "99"]));
        let (a, b) = (read_recording(reference), read_recording(&other));
        for part in ["run.mcap", "steps.parquet"] {
            assert_ne!(a[part], b[part], "{name}: {part} does not depend on the seed");
        }
    });
}
