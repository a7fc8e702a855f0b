//! Names of metrics: what the program lists, what a sweep takes, and what its table has.

use crate::sweeps::{number, rows};
use record::metric::{Robots, SHORT_NAMES, find, metrics};
use serde_json::Value;
use std::collections::BTreeSet;
use std::path::Path;
use std::process::Output;

const EXPERIMENT: &str = "\
[experiment]
name = \"tiny\"
seed = 1
duration_s = 2.0
agents = 4
[robotsim.scenario]
kind = \"line\"
[robotsim.controller]
kind = \"flocking\"
flock_radius_m = 10.0
[netsim.phy]
propagation = \"unit-disk\"
radius_m = 10.0
[sweep]
seeds = 2
";

fn asked(folder: &Path, args: &str, metrics: &str, more: &str) -> Output {
    let text = format!("{EXPERIMENT}metrics = {metrics}\n[sweep.vary]\n{more}");
    std::fs::write(folder.join("tiny.toml"), text).unwrap();
    tests::orchestrator(&args.split(' ').collect::<Vec<_>>(), folder)
}

const RADIUS: &str = "netsim.phy.radius_m = [3.0, 10.0]\n";

#[test]
fn a_misspelt_metric_is_refused_before_anything_runs() {
    let folder = tests::folder();
    for command in [
        "check tiny.toml",
        "sweep tiny.toml",
        "sweep tiny.toml --dry-run",
        "sweep tiny.toml --shard 1/2",
        "sweep tiny.toml --merge",
    ] {
        let metrics =
            "[\"network.pdr\", \"flock_speed\", \"task.flok_speed_mps\", \"task.flock_speed_mps\"]";
        let output = asked(folder.path(), command, metrics, "netsim.phy.radius_m = [-3.0]\n");
        assert_eq!(output.status.code(), Some(2), "{command}");
        let said = tests::said(&output);
        let lists =
            "must be a short name or a path of summary.json; `murmuration metrics` lists them";
        for expected in [
            format!(
                "tiny.toml:16: sweep.metrics[0]: {lists}, got \"network.pdr\" (nearest valid: \"pdr\")"
            ),
            format!(
                "sweep.metrics[2]: {lists}, got \"task.flok_speed_mps\" (nearest valid: \"task.flock_speed_mps\")"
            ),
            "sweep.metrics[3]: must list each metric only once; \"flock_speed\" is the same"
                .to_owned(),
            "    16 | metrics = [\"network.pdr\",".to_owned(),
            // All problems at once.
            "netsim.phy.radius_m: must be ".to_owned(),
        ] {
            assert!(said.contains(&expected), "{command}: no {expected} in\n{said}");
        }
        assert!(!folder.path().join("runs").exists(), "{command} has written something");
    }
}

#[test]
fn figures_of_ones_own_robots_are_accepted_and_only_of_these() {
    let folder = tests::folder();
    let metrics = "[\"task.wing_beat_hz\"]";
    let check = |more: &str, args: &str| {
        asked(folder.path(), &format!("check tiny.toml{args}"), metrics, more)
    };
    let said = tests::said(&check(RADIUS, ""));
    assert!(said.contains("got \"task.wing_beat_hz\""), "{said}");
    for (more, args) in [
        (RADIUS, " --robotsim http://127.0.0.1:1"),
        (RADIUS, " --set robotsim.url=http://127.0.0.1:1"),
        ("robotsim.url = [\"http://127.0.0.1:1\"]\n", ""),
    ] {
        let output = check(more, args);
        assert!(output.status.success(), "{more}{args}: {}", tests::said(&output));
    }
}

#[test]
fn columns_have_the_names_that_the_sweep_gives() {
    let folder = tests::folder();
    let metrics = "[\"flock_speed\", \"network.delivery_ratio\", \"pdr\", \"completion_time\"]";
    let output = asked(folder.path(), "sweep tiny.toml", metrics, RADIUS);
    let printed = tests::said(&output);
    assert!(output.status.success(), "{printed}");
    assert!(
        printed.lines().any(|line| line.starts_with("setting") && line.ends_with(" flock_speed"))
    );
    let dir = folder.path().join("runs/tiny");
    let table = rows(&dir.join("trials.parquet"));
    for row in &table {
        assert!(0.0 < number(row, "flock_speed") && 0.0 < number(row, "network.delivery_ratio"));
        // Each figure once; those that the sweep does not name have their paths.
        assert!(!row.contains_key("task.flock_speed_mps") && !row.contains_key("broadcast_pdr"));
        assert!(row.contains_key("task.mean_speed_mps"));
    }
    let read = |name: &str| std::fs::read_to_string(dir.join(name)).unwrap();
    let summary: Value = serde_json::from_str(&read("summary.json")).unwrap();
    let of_setting = summary["settings"][0]["metrics"].as_object().unwrap();
    assert_eq!(of_setting.keys().collect::<Vec<_>>(), ["flock_speed", "network.delivery_ratio"]);
    // What no trial has says when that is so: before anything runs, if that is known.
    let warnings: Vec<&str> =
        summary["warnings"].as_array().unwrap().iter().filter_map(Value::as_str).collect();
    let [before, after] = warnings[..] else { panic!("{warnings:?}") };
    assert!(before.starts_with("sweep.metrics: null in all trials: pdr. "), "{before}");
    let checked = asked(folder.path(), "check tiny.toml", metrics, RADIUS);
    assert!(tests::said(&checked).contains(before), "{}", tests::said(&checked));
    assert!(
        after.starts_with("sweep.metrics: no trial has a figure completion_time; it is null if ")
            && after.ends_with("or if it was never done"),
        "{after}"
    );
    let page = read("report.html");
    for words in ["flock speed (m/s)", "Speed of the mean velocity: time mean.", "delivery ratio"] {
        assert!(page.contains(words), "{words}");
    }

    // The same sweep with paths: the same figures, which compare-runs finds in both.
    let paths = "[\"task.flock_speed_mps\"]";
    let output = asked(folder.path(), "sweep tiny.toml --out paths", paths, RADIUS);
    assert!(output.status.success(), "{}", tests::said(&output));
    let args = ["compare-runs", "runs/tiny", "paths/tiny", "--json", "-"];
    let output = tests::orchestrator(&args, folder.path());
    let compared: Value = serde_json::from_slice(&output.stdout).unwrap();
    let figures = compared["settings"][0]["figures"].as_object().unwrap();
    assert_eq!(figures["task.flock_speed_mps"]["median_difference"], 0.0, "{compared:#}");
    assert!(!figures.contains_key("flock_speed"));
}

/// Runs of many kinds leave a sweep no figure without a known name, and every short name is of a figure that some run has.
#[test]
fn every_column_of_a_sweep_is_a_known_metric() {
    let folder = tests::folder();
    let mut seen = BTreeSet::new();
    for (config, set) in [
        ("flocking", "experiment.duration_s=2.0"),
        ("exploration", "experiment.duration_s=5.0"),
        ("traffic-coap", "experiment.duration_s=1200.0"),
        ("traffic-download", "experiment.duration_s=1200.0"),
        ("paper/full-stack", "sweep.seeds=1"),
        ("circle", "experiment.duration_s=2.0"),
    ] {
        let file = tests::repository().join(format!("configs/{config}.toml"));
        let file = if config == "circle" { folder.path().join("circle.toml") } else { file };
        if config == "circle" {
            let text = EXPERIMENT
                .replace("\"flocking\"\nflock_radius_m = 10.0", "\"circle-formation\"")
                .replace("\"line\"", "\"disc\"\ndensity_per_m2 = 0.1");
            std::fs::write(&file, text).unwrap();
        }
        let file = file.to_str().unwrap();
        let args = ["sweep", file, "--out", config, "--set", "sweep.seeds=1", "--set", set];
        let output = tests::orchestrator(&args, folder.path());
        assert!(output.status.success(), "{config}: {}", tests::said(&output));
        let dir = std::fs::read_dir(folder.path().join(config)).unwrap();
        let dir = dir.map(|entry| entry.unwrap().path()).find(|path| path.is_dir()).unwrap();
        let row = rows(&dir.join("trials.parquet")).remove(0);
        for column in row.keys() {
            let is_key = ["setting", "case", "status", "experiment.seed"].contains(&&**column)
                || ["robotsim.", "netsim.", "experiment."]
                    .iter()
                    .any(|key| column.starts_with(key));
            if !is_key {
                let known = find(column, Robots::BuiltIn);
                assert!(known.is_some(), "{config}: {column} is not listed");
                seen.insert(column.clone());
            }
        }
    }
    assert!(150 < seen.len(), "{}: {seen:?}", seen.len());
    for short in SHORT_NAMES {
        assert!(seen.contains(short.path), "no run has {}", short.name);
    }
}

#[test]
fn the_program_lists_and_explains_metrics() {
    let folder = tests::folder();
    let run = |args: &[&str]| {
        let output = tests::orchestrator(&[&["metrics"], args].concat(), folder.path());
        let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
        (output.status.code(), text(&output.stdout), text(&output.stderr))
    };
    let (code, list, _) = run(&[]);
    assert_eq!(code, Some(0));
    assert!(list.lines().all(|line| line.chars().count() <= 80), "{list}");
    let row = list.lines().find(|line| line.starts_with("latency ")).unwrap();
    assert!(row.ends_with("  s        lower"), "{row}");
    let (code, pdr, _) = run(&["pdr"]);
    assert_eq!(code, Some(0));
    assert!(pdr.contains("kpis.since_start.delivered_of_expected.ratio") && pdr.contains("higher"));
    assert_eq!(run(&["kpis.since_start.delivered_of_expected.ratio"]).1, pdr);
    let (_, all, _) = run(&["--all"]);
    for metric in metrics() {
        assert!(all.contains(&format!("\n{} ", metric.path)), "{}", metric.path);
    }
    let (code, _, error) = run(&["flok_speed"]);
    assert_eq!(code, Some(2));
    assert!(error.contains("unknown metric \"flok_speed\"; did you mean flock_speed?"), "{error}");
    assert_eq!(run(&["pdr", "--all"]).0, Some(2));
    let (_, json, _) = run(&["--all", "--json", "-"]);
    let json: Value = serde_json::from_str(&json).unwrap();
    assert_eq!(json["metrics"].as_array().unwrap().len(), metrics().len());
}
