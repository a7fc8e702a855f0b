//! `murmuration sweep` through the real processes.

use parquet::file::reader::{FileReader as _, SerializedFileReader};
use parquet::record::Field;
use serde_json::Value;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Instant;
use tests::{end_of, signal, wait_until};

const EXPERIMENT: &str = "[experiment]\nname = \"s\"\nseed = 3\nduration_s = 2.0\nagents = 8\n\
    [robotsim.scenario]\nkind = \"disc\"\ndensity_per_m2 = 0.1\n\
    [robotsim.controller]\nkind = \"flocking\"\nflock_radius_m = 10.0\n\
    [netsim.phy]\npropagation = \"full\"\n";

fn experiment(folder: &Path, sweep: &str) -> PathBuf {
    let path = folder.join("s.toml");
    std::fs::write(&path, format!("{EXPERIMENT}{sweep}")).unwrap();
    path
}

fn sweep(folder: &Path, args: &[&str]) -> String {
    let output = tests::orchestrator(&[&["sweep", "s.toml"], args].concat(), folder);
    assert!(output.status.success(), "{}", tests::said(&output));
    String::from_utf8(output.stdout).unwrap()
}

/// What must not depend on when, where and how a sweep was run.
fn left_by(dir: &Path) -> BTreeMap<&'static str, Vec<u8>> {
    ["sweep.toml", "trials.parquet", "summary.json", "report.html"]
        .map(|name| (name, std::fs::read(dir.join(name)).unwrap()))
        .into()
}

/// The rows of a table, each by name of the column.
pub(super) fn rows(table: &Path) -> Vec<BTreeMap<String, Field>> {
    let file = std::fs::File::open(table).unwrap();
    let reader = SerializedFileReader::new(file).unwrap();
    let rows = reader.get_row_iter(None).unwrap();
    rows.map(|row| row.unwrap().get_column_iter().map(|(k, v)| (k.clone(), v.clone())).collect())
        .collect()
}

pub(super) fn number(row: &BTreeMap<String, Field>, column: &str) -> f64 {
    match &row[column] {
        Field::Double(number) => *number,
        Field::ULong(number) => *number as f64,
        other => panic!("{column}: {other:?}"),
    }
}

fn text(row: &BTreeMap<String, Field>, column: &str) -> String {
    match &row[column] {
        Field::Str(text) => text.clone(),
        other => panic!("{column}: {other:?}"),
    }
}

const TWO_BY_TWO: &str = "[sweep]\nseeds = 5\n[sweep.vary]\n\
    \"netsim.phy.propagation\" = [\"full\", \"experimental-randomness\"]\n\
    robotsim.controller.flock_radius_m = [5.0, 20.0]\n";

#[test]
fn a_sweep_killed_again_and_again_leaves_the_same_as_one_never_interrupted() {
    let folder = tests::folder();
    experiment(folder.path(), TWO_BY_TWO);
    let begun = Instant::now();
    sweep(folder.path(), &["--out", "whole", "--set", "sweep.seeds=15"]);
    let took = begun.elapsed();
    let mut n_done = Vec::new();
    // Other moments each time, from before the first trial to well within, by how fast this machine is now.
    for attempt in 0..40_u32 {
        let mut running = Command::new(tests::executable("murmuration"))
            .args(["sweep", "s.toml", "--out", "killed", "--set", "sweep.seeds=15"])
            .current_dir(folder.path())
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        std::thread::park_timeout(took.mul_f64(0.1 + 0.8 * f64::from(attempt * 67 % 410) / 410.0));
        running.kill().unwrap();
        running.wait().unwrap();
        let journal = std::fs::read_to_string(folder.path().join("killed/s/trials.jsonl"));
        n_done.push(journal.map_or(0, |text| text.matches('\n').count()));
        if n_done.last() == Some(&60) {
            break;
        }
    }
    // Each trial once, whatever was in flight: nothing that was done is done again.
    assert!(n_done.is_sorted(), "{n_done:?}");
    assert!(n_done.iter().any(|&n| 0 < n && n < 60), "it was never killed in between: {n_done:?}");
    sweep(folder.path(), &["--out", "killed", "--set", "sweep.seeds=15"]);
    let journal = std::fs::read_to_string(folder.path().join("killed/s/trials.jsonl")).unwrap();
    assert_eq!(journal.lines().count(), 60);
    assert_eq!(left_by(&folder.path().join("whole/s")), left_by(&folder.path().join("killed/s")));
}

#[test]
fn a_trial_is_the_run_of_its_setting_and_seed_kept_or_not() {
    let folder = tests::folder();
    let config = experiment(folder.path(), TWO_BY_TWO);
    sweep(folder.path(), &["--out", "a", "--jobs", "1"]);
    sweep(folder.path(), &["--out", "b", "--jobs", "3", "--set", "sweep.keep=all"]);
    let table = |out: &str| folder.path().join(out).join("s/trials.parquet");
    assert_eq!(std::fs::read(table("a")).unwrap(), std::fs::read(table("b")).unwrap());
    let rows = rows(&table("a"));
    assert_eq!(rows.len(), 20);
    let row = &rows[17];
    assert_eq!(text(row, "netsim.phy.propagation"), "experimental-randomness");
    let of_row = ["setting", "robotsim.controller.flock_radius_m", "experiment.seed"];
    assert_eq!(of_row.map(|column| number(row, column)), [3.0, 20.0, 5.0]);
    // The same experiment as a run of its own.
    let single = folder.path().join("single.toml");
    let text = std::fs::read_to_string(&config).unwrap();
    std::fs::write(&single, text.split("[sweep]").next().unwrap()).unwrap();
    let set = [
        "--seed=5",
        "--set=netsim.phy.propagation=experimental-randomness",
        "--set=robotsim.controller.flock_radius_m=20.0",
    ];
    let run = tests::run(&single, &folder.path().join("runs"), &set);
    let summary: Value =
        serde_json::from_slice(&std::fs::read(run.join("summary.json")).unwrap()).unwrap();
    for (column, value) in [
        ("task.flock_speed_mps", &summary["task"]["flock_speed_mps"]),
        ("network.delivery_ratio", &summary["network"]["delivery_ratio"]),
        ("network.mean_delay_s", &summary["network"]["mean_delay_s"]),
    ] {
        assert_eq!(number(row, column).to_bits(), value.as_f64().unwrap().to_bits(), "{column}");
    }
    let kept = folder.path().join("b/s/runs/setting-3-seed-5");
    let verified = tests::orchestrator(&["verify", kept.to_str().unwrap()], folder.path());
    assert!(verified.status.success(), "{}", tests::said(&verified));
    let kept: Value =
        serde_json::from_slice(&std::fs::read(kept.join("summary.json")).unwrap()).unwrap();
    assert_eq!(kept["final_digest"], summary["final_digest"]);
}

#[test]
fn seeds_are_paired_across_settings() {
    let folder = tests::folder();
    let pairs = "[sweep]\nseeds = [4, 9]\nkeep = \"all\"\n[sweep.vary]\n\
        \"netsim.phy.propagation\" = [\"full\", \"friis\"]\n";
    experiment(folder.path(), pairs);
    sweep(folder.path(), &[]);
    let places = |setting: u32, seed: u64| -> Vec<[f64; 2]> {
        let run = format!("runs/s/runs/setting-{setting}-seed-{seed}/steps.parquet");
        let rows = rows(&folder.path().join(run));
        let first = rows.iter().filter(|row| number(row, "step") == 0.0);
        first.map(|row| ["x_m", "y_m"].map(|column| number(row, column))).collect()
    };
    assert_eq!(places(0, 4).len(), 8);
    assert_eq!(places(0, 4), places(1, 4));
    assert_eq!(places(0, 9), places(1, 9));
    assert_ne!(places(0, 4), places(0, 9));
}

#[test]
fn a_hundred_trials_cost_no_more_starts_than_there_are_jobs() {
    let folder = tests::folder();
    experiment(folder.path(), "[sweep]\nseeds = 100\n");
    let said = sweep(folder.path(), &["--jobs", "2", "--set", "experiment.duration_s=0.2"]);
    assert!(said.contains("100 trials in "), "{said}");
    assert!(said.contains(" 2 pairs of simulators started"), "{said}");
    let again = sweep(folder.path(), &["--set", "experiment.duration_s=0.2"]);
    assert!(again.contains("100 trials, 100 of them finished earlier"), "{again}");
    assert!(again.contains(" 0 pairs of simulators started"), "{again}");
    // More seeds: only those are run.
    let more = ["--set", "experiment.duration_s=0.2", "--set", "sweep.seeds=103"];
    let more = sweep(folder.path(), &more);
    assert!(more.contains("103 trials, 100 of them finished earlier"), "{more}");
}

#[test]
fn ranges_are_sampled_alike_for_every_seed() {
    let folder = tests::folder();
    let ranges = "[sweep]\nseeds = 2\nsamples = 8\nsampling = \"latin-hypercube\"\n[sweep.vary]\n\
        experiment.agents = { min = 3, max = 10, whole = true }\n\
        \"robotsim.controller.flock_radius_m\" = { min = 1.0, max = 100.0, scale = \"log\" }\n";
    experiment(folder.path(), ranges);
    sweep(folder.path(), &["--set", "experiment.duration_s=0.3"]);
    let rows = rows(&folder.path().join("runs/s/trials.parquet"));
    assert_eq!(rows.len(), 16);
    let mut agents: Vec<f64> = Vec::new();
    let mut decades = [0, 0];
    for pair in rows.chunks(2) {
        for column in ["experiment.agents", "robotsim.controller.flock_radius_m"] {
            assert_eq!(number(&pair[0], column).to_bits(), number(&pair[1], column).to_bits());
        }
        agents.push(number(&pair[0], "experiment.agents"));
        let radius_m = number(&pair[0], "robotsim.controller.flock_radius_m");
        decades[usize::from(10.0 <= radius_m)] += 1;
    }
    // Eight numbers in eight slices, four slices of the logarithm on either side of its middle.
    agents.sort_by(f64::total_cmp);
    assert_eq!(agents, [3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0, 10.0]);
    assert_eq!(decades, [4, 4]);
}

#[test]
fn a_network_that_does_not_form_is_a_row_and_full_networks_are_measured_alike_kept_or_not() {
    let folder = tests::folder();
    let text = "[experiment]\nname = \"s\"\nseed = 1\nduration_s = 20.0\nagents = 4\nformation_limit_s = 600.0\ncontrol_period = { rate_hz = 1.0 }\n\
        [robotsim.scenario]\nkind = \"line\"\n[robotsim.controller]\nkind = \"hold\"\n\
        [netsim]\nmode = \"6tisch\"\n[netsim.mac]\nbeacon_wait_s = 5.0\n\
        [netsim.phy]\npropagation = \"unit-disk\"\nradius_m = 10.0\n[netsim.sf]\nkind = \"rrsf\"\n\
        [sweep]\n[sweep.vary]\nnetsim.phy.radius_m = [10.0, 0.5]\n";
    std::fs::write(folder.path().join("s.toml"), text).unwrap();
    let told = sweep(folder.path(), &["--out", "a"]);
    sweep(folder.path(), &["--out", "b", "--set", "sweep.keep=all"]);
    let warning = "in 1 of 2 trials the network did not form in time";
    assert!(told.contains(warning), "{told}");
    let read = |name: &str| std::fs::read_to_string(folder.path().join("a/s").join(name)).unwrap();
    assert!(read("report.html").contains(warning));
    let summary: Value = serde_json::from_str(&read("summary.json")).unwrap();
    assert!(summary["warnings"][0].as_str().unwrap().starts_with(warning), "{summary:#}");
    // What was measured of robots that never started says nothing of the setting.
    for (_, spread) in summary["settings"][1]["metrics"].as_object().unwrap() {
        assert_eq!(spread["n"], 0, "{summary:#}");
    }
    let table = |out: &str| folder.path().join(out).join("s/trials.parquet");
    let rows = rows(&table("a"));
    assert_eq!([text_of(&rows[0]), text_of(&rows[1])], ["complete", "not-formed"]);
    assert!(0.0 < number(&rows[0], "kpis.formation.formed_s"));
    assert_eq!(rows[1]["kpis.formation.formed_s"], Field::Null);
    // The paper's: 0 if never formed. Nothing else is known of how robots moved that did not.
    assert_eq!(number(&rows[1], "task.flock_speed_mps"), 0.0);
    assert_eq!(rows[1]["task.mean_speed_mps"], Field::Null);
    assert_eq!(std::fs::read(table("a")).unwrap(), std::fs::read(table("b")).unwrap());
}

#[test]
fn settings_whose_robots_thrash_are_named() {
    let folder = tests::folder();
    // All hear all, far beyond the flocking radius for which the gains are meant.
    let text = "[experiment]\nname = \"s\"\nseed = 1\nduration_s = 4.0\nagents = 2\ncontrol_period = { rate_hz = 10.0 }\n\
        [robotsim.scenario]\nkind = \"disc\"\ndensity_per_m2 = 0.1\n\
        [robotsim.controller]\nkind = \"flocking\"\nflock_radius_m = 10.0\n\
        [netsim.phy]\npropagation = \"unit-disk\"\nradius_m = 70.0\n\
        [sweep]\nmetrics = [\"network.delivery_ratio\"]\n[sweep.vary]\nexperiment.agents = [2, 20]\n";
    std::fs::write(folder.path().join("s.toml"), text).unwrap();
    let told = sweep(folder.path(), &[]);
    let warning = "in 1 of 2 trials the robots thrash, each much faster than the flock gets on: 1 of 1 of agents 20";
    assert!(told.contains(warning), "{told}");
    let read =
        |name: &str| std::fs::read_to_string(folder.path().join("runs/s").join(name)).unwrap();
    assert!(read("report.html").contains("the robots thrash"));
    let summary: Value = serde_json::from_str(&read("summary.json")).unwrap();
    assert!(summary["warnings"][0].as_str().unwrap().starts_with(warning), "{summary:#}");
}

fn text_of(row: &BTreeMap<String, Field>) -> String {
    text(row, "status")
}

fn refused(command: &str, sweep: &str) -> String {
    let folder = tests::folder();
    experiment(folder.path(), sweep);
    let output = tests::orchestrator(&[command, "s.toml"], folder.path());
    assert_eq!(output.status.code(), Some(2), "{}", tests::said(&output));
    assert!(!folder.path().join("runs").exists(), "something was written");
    String::from_utf8(output.stderr).unwrap()
}

#[test]
fn everything_wrong_with_a_sweep_is_said_at_once_with_its_place() {
    let text = "\
[sweep]
seeds = [1, 2, 1]
samples = 0
sampling = \"sobel\"
keeep = \"all\"

[sweep.vary]
\"experiment.seed\" = [1, 2]
netsim.phy.radius_m = 3.0
\"robotsim.controller.law\" = [\"paper\", \"paper\"]
experiment.agents = { min = 9, max = 3, step = 1 }
robotsim.controller.flock_radius_m = { min = 0.0, max = 3.0, scale = \"log\" }

[[sweep.case]]
netsim.phy.propagation = \"friis\"
";
    insta::assert_snapshot!(refused("sweep", text));
}

#[test]
fn what_a_setting_cannot_be_is_said_where_the_sweep_says_it() {
    let text = "\
[sweep]
[sweep.vary]
\"netsim.phy.propagation\" = [\"full\", \"fris\"]
\"robotsim.controller.flock_radus_m\" = [5.0, 10.0]
robotsim.controller.flock_radius_m = [5.0, -1.0]
";
    insta::assert_snapshot!(refused("sweep", text));
    assert_eq!(refused("check", text), refused("sweep", text));
}

#[test]
fn what_a_sample_of_a_range_cannot_be_is_said_where_the_range_stands() {
    let said =
        refused("check", "[sweep]\nsamples = 2\nvary.experiment.agents = { min = 5, max = 9 }\n");
    assert!(said.contains("must be a whole number"), "{said}");
    assert!(said.contains("| vary.experiment.agents = { min = 5, max = 9 }"), "{said}");
    assert!(!said.contains("command line"), "{said}");
}

#[test]
fn a_number_of_samples_that_cannot_be_is_not_missing() {
    let range = "robotsim.controller.flock_radius_m = { min = 1.0, max = 3.0 }";
    let said = refused("check", &format!("[sweep]\nsamples = 0\n[sweep.vary]\n{range}\n"));
    assert!(said.contains("sweep.samples: must be a whole number from 1"), "{said}");
    assert_eq!(said.matches("sweep.samples: ").count(), 1, "{said}");
}

#[test]
fn one_experiment_is_no_sweep_and_a_sweep_is_not_one_experiment() {
    insta::assert_snapshot!(format!(
        "{}---\n{}---\n{}",
        refused("sweep", ""),
        refused("run", "[sweep]\nseeds = 2\n"),
        refused("sweep", "[sweep]\n[sweep.vary]\nexperiment.agents = []\n"),
    ));
}

#[test]
fn a_key_that_the_sweep_varies_cannot_be_set_besides() {
    let folder = tests::folder();
    experiment(
        folder.path(),
        "[sweep]\n[sweep.vary]\nexperiment.agents = [4, 8]\nnetsim.phy.radius_m = { min = 3.0, max = 4.0 }\n",
    );
    for command in ["check", "sweep"] {
        let sets = ["--set", "experiment.agents=5", "--set", "netsim.phy.radius_m=3.5"];
        let output =
            tests::orchestrator(&[&[command, "s.toml"][..], &sets].concat(), folder.path());
        assert_eq!(output.status.code(), Some(2));
        let said = tests::said(&output);
        for problem in [
            "experiment.agents: is varied by [sweep.vary], so --set cannot set it (in --set experiment.agents=5)",
            "netsim.phy.radius_m: is varied by [sweep.vary], so --set cannot set it (in --set netsim.phy.radius_m=3.5)",
        ] {
            assert!(said.contains(problem), "{said}");
        }
    }
}

fn changes(folder: &Path, args: &[&str]) -> String {
    let output = tests::orchestrator(&[&["compare-runs"], args].concat(), folder);
    assert!(output.status.success(), "{}", tests::said(&output));
    format!(
        "{}---\n{}",
        String::from_utf8(output.stderr).unwrap(),
        String::from_utf8(output.stdout).unwrap()
    )
}

#[test]
fn a_change_is_told_seed_by_seed_with_an_interval() {
    let folder = tests::folder();
    experiment(folder.path(), "[sweep]\nseeds = 8\n[sweep.vary]\nexperiment.agents = [4, 8]\n");
    sweep(folder.path(), &["--out", "a"]);
    let longer = ["--out", "b", "--set", "robotsim.controller.flock_radius_m=40.0"];
    sweep(folder.path(), &longer);
    insta::assert_snapshot!(changes(folder.path(), &["a/s", "b/s", "--json", "found.json"]));
    let found: Value =
        serde_json::from_slice(&std::fs::read(folder.path().join("found.json")).unwrap()).unwrap();
    // The median of the differences, by another way: from the two tables.
    let speeds = |out: &str| -> Vec<f64> {
        let rows = rows(&folder.path().join(out).join("s/trials.parquet"));
        rows[8..].iter().map(|row| number(row, "task.flock_speed_mps")).collect()
    };
    let mut differences: Vec<f64> =
        speeds("b").iter().zip(speeds("a")).map(|(b, a)| b - a).collect();
    differences.sort_by(f64::total_cmp);
    let median = 0.5 * (differences[3] + differences[4]);
    let change = &found["settings"][1]["figures"]["task.flock_speed_mps"];
    assert_eq!(change["pairs"], 8);
    assert!((change["median_difference"].as_f64().unwrap() - median).abs() < 1e-12);
    let [low, high] =
        [0, 1].map(|end| change["median_difference_interval_95"][end].as_f64().unwrap());
    assert!(differences[0] <= low && low <= median && median <= high && high <= differences[7]);
    // The other way round, everything has the other sign.
    changes(folder.path(), &["b/s", "a/s", "--json", "back.json"]);
    let back: Value =
        serde_json::from_slice(&std::fs::read(folder.path().join("back.json")).unwrap()).unwrap();
    let back = back["settings"][1]["figures"]["task.flock_speed_mps"]["median_difference"].as_f64();
    assert!((back.unwrap() + median).abs() < 1e-12);
}

#[test]
fn what_cannot_be_paired_is_said() {
    let folder = tests::folder();
    experiment(
        folder.path(),
        "[sweep]\nseeds = [1, 2]\n[sweep.vary]\nexperiment.agents = [4, 8]\n",
    );
    let short = ["--set", "experiment.duration_s=0.3"];
    sweep(folder.path(), &[&short[..], &["--out", "a"]].concat());
    sweep(folder.path(), &[&short[..], &["--out", "b", "--set", "sweep.seeds=[2, 3]"]].concat());
    sweep(folder.path(), &[&short[..], &["--out", "c", "--set", "sweep.seeds=[7, 8]"]].concat());
    assert!(
        changes(folder.path(), &["a/s", "b/s"])
            .contains("2 of 4 trials of a/s, which have no partner")
    );
    let refused = |a: &str, b: &str| {
        let output = tests::orchestrator(&["compare-runs", a, b], folder.path());
        assert_eq!(output.status.code(), Some(2), "{}", tests::said(&output));
        String::from_utf8(output.stderr).unwrap()
    };
    experiment(folder.path(), "[sweep]\nseeds = [1, 2]\n");
    sweep(folder.path(), &[&short[..], &["--out", "d"]].concat());
    insta::assert_snapshot!(format!(
        "{}---\n{}---\n{}",
        refused("a/s", "c/s"),
        refused("a/s", "d/s"),
        refused("a/s", "a")
    ));
}

#[test]
fn a_sweep_that_is_asked_to_stop_says_how_far_it_came_and_goes_on() {
    let folder = tests::folder();
    experiment(folder.path(), TWO_BY_TWO);
    let journal = folder.path().join("runs/s/trials.jsonl");
    let n_done = || std::fs::read_to_string(&journal).map_or(0, |journal| journal.lines().count());
    for signals in [1, 2] {
        let running = Command::new(tests::executable("murmuration"))
            .args(["sweep", "s.toml", "--set", "sweep.seeds=2000"])
            .current_dir(folder.path())
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        let before = n_done();
        wait_until("no trial was done", || n_done() != before);
        for _ in 0..signals {
            signal("-TERM", running.id());
        }
        let output = end_of(running);
        assert_eq!(output.status.code(), Some(1), "{}", tests::said(&output));
        let said = String::from_utf8(output.stderr).unwrap();
        assert!(said.contains("stopped by SIGTERM after "), "{said}");
        assert!(said.contains(" of 8000 trials; run the same command again to resume"), "{said}");
    }
    let n = n_done();
    assert!(0 < n && n < 8000, "{n}");
    // Fewer seeds than it began with: of those that are done, the ones that still count.
    let said = sweep(folder.path(), &["--set", "sweep.seeds=2"]);
    assert!(said.contains("8 trials, "), "{said}");
}
