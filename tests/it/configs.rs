//! Every configuration in configs/ says what it is for, is valid, and runs.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

fn configs() -> Vec<PathBuf> {
    configs_in("configs")
}

fn configs_in(folder: &str) -> Vec<PathBuf> {
    let mut paths: Vec<PathBuf> = std::fs::read_dir(tests::repository().join(folder))
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .filter(|path| path.extension().is_some_and(|extension| extension == "toml"))
        .collect();
    paths.sort();
    assert!(!paths.is_empty());
    paths
}

/// Whether it is of the full network, which has to form first.
fn is_network(path: &Path) -> bool {
    std::fs::read_to_string(path).unwrap().contains("mode = \"6tisch\"")
}

fn is_sweep(path: &Path) -> bool {
    std::fs::read_to_string(path).unwrap().contains("[sweep]")
}

/// Runs a sweep with one seed of its many, shortened.
fn swept(path: &Path, folder: &Path) {
    let (config, out) = (path.to_str().unwrap(), folder.to_str().unwrap());
    let always = ["sweep", config, "--out", out, "--set", "sweep.seeds=1"];
    let output = tests::orchestrator(&[&always[..], &shortened(path)].concat(), folder);
    assert!(output.status.success(), "{}", tests::said(&output));
    let dir = folder.join(path.file_stem().unwrap());
    for file in ["sweep.toml", "trials.parquet", "summary.json", "report.html", "provenance.json"] {
        assert!(dir.join(file).exists(), "{} left no {file}", path.display());
    }
}

/// What makes a run of it short: less time, fewer robots, and where the network has to form, less of RFC 8180's wait for beacons. A
/// timeline takes the time it takes.
fn shortened(path: &Path) -> Vec<&'static str> {
    let text = std::fs::read_to_string(path).unwrap();
    let mut args = Vec::new();
    if is_network(path) {
        args.extend(["--set", "netsim.mac.beacon_wait_s=5.0"]);
    }
    if text.contains("agents = 500") {
        args.extend(["--set", "experiment.agents=15"]);
    }
    if text.contains("\nafter_s =") {
        args.extend(["--set", "netsim.app[0].after_s=0.0"]);
    }
    match (text.contains("[[timeline]]"), is_network(path)) {
        (true, _) => {}
        // Sensors send once a minute.
        (false, true) => args.extend(["--set", "experiment.duration_s=70.0"]),
        (false, false) => args.extend(["--set", "experiment.duration_s=2.0"]),
    }
    args
}

#[test]
fn each_opens_with_a_line_that_says_what_it_is_for() {
    for path in configs().into_iter().chain(configs_in("configs/paper")) {
        let text = std::fs::read_to_string(&path).unwrap();
        let first = text.lines().next().unwrap_or_default();
        assert!(first.starts_with("# ") && 20 < first.len(), "{}: {first:?}", path.display());
    }
}

#[test]
fn every_setting_of_the_papers_sweeps_is_good() {
    let folder = tests::folder();
    for path in configs_in("configs/paper") {
        let checked = tests::orchestrator(&["check", path.to_str().unwrap()], folder.path());
        assert!(checked.status.success(), "{}", tests::said(&checked));
        let name = format!("name = {:?}", path.file_stem().unwrap());
        assert!(std::fs::read_to_string(&path).unwrap().contains(&name), "{}", path.display());
    }
}

/// What a run leaves is there, and verifies.
fn assert_is_complete(dir: &Path, folder: &Path) {
    for file in [
        "config.toml",
        "run.mcap",
        "scene.mcap",
        "steps.parquet",
        "summary.json",
        "report.html",
        "provenance.json",
    ] {
        assert!(dir.join(file).exists(), "{} has no {file}", dir.display());
    }
    let verified = tests::orchestrator(&["verify", dir.to_str().unwrap()], folder);
    assert!(verified.status.success(), "{}", tests::said(&verified));
}

/// Whether one side is a program in another language.
fn has_program_of_its_own(path: &Path) -> bool {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    ["external-", "python-"].iter().any(|kind| name.starts_with(kind))
}

/// Two kinds are checked here and run elsewhere: networks by the next test, and those with a program in another language by
/// tests/external.
#[test]
fn each_is_good_and_leaves_a_record_that_verifies() {
    let folder = tests::folder();
    for path in configs() {
        let config = path.to_str().unwrap();
        let checked = tests::orchestrator(&["check", config], folder.path());
        assert!(checked.status.success(), "{}", tests::said(&checked));
        if is_sweep(&path) {
            swept(&path, folder.path());
        } else if !is_network(&path) && !has_program_of_its_own(&path) {
            let dir = tests::run(&path, folder.path(), &shortened(&path));
            assert_is_complete(&dir, folder.path());
        }
    }
}

/// Every network runs, and of each scheduling function one twice.
#[test]
fn networks_leave_the_same_recording_on_any_number_of_threads_and_any_transport() {
    let folder = tests::folder();
    let mut functions = BTreeSet::new();
    for path in configs().into_iter().filter(|path| is_network(path) && !is_sweep(path)) {
        let name = path.file_stem().unwrap().to_str().unwrap();
        let dir = |variant: &str| folder.path().join(name).join(variant);
        let run = |variant: &str, more: &[&str]| {
            let always = ["--set", "output.pcap=true"];
            tests::run(&path, &dir(variant), &[&shortened(&path)[..], &always, more].concat())
        };
        let one = run("one", &["--threads", "1", "--set", "experiment.transport=unary"]);
        let config = std::fs::read_to_string(one.join("config.toml")).unwrap();
        let config: toml::Table = config.parse().unwrap();
        if functions.insert(config["netsim"]["sf"]["kind"].as_str().unwrap().to_owned()) {
            let two = run("two", &["--threads", "2", "--set", "experiment.transport=stream"]);
            tests::recording::assert_same(&one, &two);
        }
        assert_is_complete(&one, folder.path());
        let summary = std::fs::read(one.join("summary.json")).unwrap();
        let summary: serde_json::Value = serde_json::from_slice(&summary).unwrap();
        assert_eq!(summary["kpis"]["formation"]["formed"], true, "{name}");
        let arrived = [
            &summary["network"]["deliveries"],
            &summary["network"]["unicast_deliveries"],
            &summary["kpis"]["packets"]["app"]["delivered"],
        ];
        let n = arrived.iter().filter_map(|n| n.as_u64()).max();
        assert!(n > Some(0), "{name}: nothing arrived in the network");
    }
    assert!(3 < functions.len(), "{functions:?}");
}

#[test]
fn an_effective_configuration_runs_again_with_the_same_recording() {
    let folder = tests::folder();
    let flocking = tests::repository().join("configs/flocking.toml");
    let first =
        tests::run(&flocking, &folder.path().join("a"), &["--set", "experiment.duration_s=1.0"]);
    let second = tests::run(&first.join("config.toml"), &folder.path().join("b"), &[]);
    tests::recording::assert_same(&first, &second);
}

#[test]
fn a_record_whose_configuration_names_a_file_runs_again_with_the_same_recording() {
    let folder = tests::folder();
    std::fs::create_dir(folder.path().join("places")).unwrap();
    std::fs::write(folder.path().join("places/p.csv"), "agent,x_m,y_m\n0,0,0\n1,3,0\n2,0,4\n")
        .unwrap();
    let config = folder.path().join("x.toml");
    let text = "[experiment]\nname = \"x\"\nseed = 1\nduration_s = 0.3\nagents = 3\n\
                [robotsim.scenario]\nkind = \"csv\"\nfile = \"places/p.csv\"\n\
                [robotsim.controller]\nkind = \"hold\"\n";
    std::fs::write(&config, text).unwrap();
    let first = tests::run(&config, &folder.path().join("a"), &[]);
    // The file lies outside of the record.
    let places = folder.path().join("places");
    let allowed = ["--allow-file", places.to_str().unwrap()];
    let second = tests::run(&first.join("config.toml"), &folder.path().join("b"), &allowed);
    tests::recording::assert_same(&first, &second);
}
