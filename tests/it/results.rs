//! Results are never replaced by worse ones, and never lost.

use serde_json::Value;
use std::collections::BTreeSet;
use std::os::unix::fs::PermissionsExt as _;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use tests::fake::{Fault, Faulty};
use tests::{end_of, orchestrator, said, signal, spawn, wait_until, wait_until_recording};

const EXPERIMENT: &str = "[experiment]\nname = \"e\"\nseed = 3\nduration_s = 2.0\nagents = 4\n\
    [robotsim.scenario]\nkind = \"line\"\n[robotsim.controller]\nkind = \"random-jump\"\n\
    [netsim.phy]\npropagation = \"full\"\n";
const ENDLESS: &str = "experiment.duration_s=1e8";

/// A folder with the experiment and what is put behind it.
fn folder(more: &str) -> tempfile::TempDir {
    let folder = tests::folder();
    std::fs::write(folder.path().join("e.toml"), format!("{EXPERIMENT}{more}")).unwrap();
    folder
}

fn run(folder: &Path, args: &[&str]) -> Output {
    orchestrator(&[&["run", "e.toml"], args].concat(), folder)
}

/// Runs to the end, complete; returns what it said.
fn complete(folder: &Path, args: &[&str]) -> String {
    let output = run(folder, args);
    assert!(output.status.success(), "{}", said(&output));
    said(&output)
}

/// A run that lasts until it is stopped, once it records.
fn endless(folder: &Path) -> Child {
    let mut command = tests::hearing_hang_ups("murmuration");
    let run = spawn(command.args(["run", "e.toml", "--set", ENDLESS]), folder);
    until_it_records(folder, &run);
    run
}

fn until_it_records(folder: &Path, run: &Child) {
    let ends = format!(".partial-{}", run.id());
    let records = || {
        names(&folder.join("runs")).iter().any(|name| {
            name.ends_with(&ends) && folder.join("runs").join(name).join("run.log").exists()
        })
    };
    wait_until("nothing is recorded", records);
    wait_until_recording(&folder.join("runs"));
}

fn names(dir: &Path) -> BTreeSet<String> {
    let entries = std::fs::read_dir(dir).into_iter().flatten();
    entries.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect()
}

fn json(path: PathBuf) -> Value {
    serde_json::from_slice(&std::fs::read(&path).unwrap()).unwrap()
}

#[test]
fn an_interrupted_rerun_does_not_replace_a_complete_result() {
    let folder = folder("");
    complete(folder.path(), &[]);
    let before = std::fs::read(folder.path().join("runs/e/run.mcap")).unwrap();
    let rerun = endless(folder.path());
    signal("-TERM", rerun.id());
    let output = end_of(rerun);
    assert_eq!(output.status.code(), Some(1), "{}", said(&output));
    let warning = "warning: runs/e was not replaced: this run is not complete. The result of this run is in runs/e-2";
    assert!(said(&output).contains(warning), "{}", said(&output));
    assert_eq!(std::fs::read(folder.path().join("runs/e/run.mcap")).unwrap(), before);
    assert_eq!(json(folder.path().join("runs/e-2/summary.json"))["status"], "interrupted");
    assert_eq!(names(&folder.path().join("runs")), ["e", "e-2"].map(str::to_owned).into());
}

#[test]
fn a_failed_rerun_does_not_replace_a_complete_result() {
    let folder = folder("");
    complete(folder.path(), &[]);
    let network = Faulty::network(Fault::WrongStep);
    let output = run(folder.path(), &["--netsim", &network.url]);
    assert_eq!(output.status.code(), Some(1), "{}", said(&output));
    assert!(said(&output).contains("runs/e was not replaced"), "{}", said(&output));
    assert_eq!(json(folder.path().join("runs/e/summary.json"))["status"], "complete");
    assert_eq!(json(folder.path().join("runs/e-2/summary.json"))["status"], "failed");
}

#[test]
fn another_seed_does_not_replace_a_result_without_being_asked() {
    let folder = folder("");
    complete(folder.path(), &[]);
    let text = complete(folder.path(), &["--seed", "4", "--json", "a.json"]);
    assert!(text.contains("warning: runs/e was not replaced: it is the result of seed 3. "));
    assert!(text.contains("runs/e-2; to replace runs/e instead, give --replace"), "{text}");
    let answer = json(folder.path().join("a.json"));
    assert_eq!(answer["folder"], "runs/e-2");
    assert_eq!(answer["kept_folder"], "runs/e");
    assert_eq!(answer["seed"], 4);
    // The same experiment takes its own place again, silently.
    let text = complete(folder.path(), &["--json", "a.json"]);
    assert!(!text.contains("warning"), "{text}");
    assert_eq!(json(folder.path().join("a.json"))["kept_folder"], Value::Null);
    complete(folder.path(), &["--seed", "5", "--replace"]);
    assert_eq!(json(folder.path().join("runs/e/summary.json"))["seed"], 5);
    assert_eq!(json(folder.path().join("runs/e-2/summary.json"))["seed"], 4);
}

#[test]
fn of_six_runs_into_one_folder_one_writes() {
    let folder = folder("");
    let holder = endless(folder.path());
    let command = || {
        let mut command = tests::hearing_hang_ups("murmuration");
        command.args(["run", "e.toml"]);
        command
    };
    let others: Vec<Child> = (0..5).map(|_| spawn(&mut command(), folder.path())).collect();
    for other in others {
        let output = end_of(other);
        assert_eq!(output.status.code(), Some(2), "{}", said(&output));
        let error = format!("error: runs/e is being written by process {} on host ", holder.id());
        assert!(said(&output).contains(&error), "{}", said(&output));
    }
    // One that is killed leaves a lock that the next run takes over.
    signal("-KILL", holder.id());
    let _ = end_of(holder);
    let six: Vec<Child> = (0..6).map(|_| spawn(&mut command(), folder.path())).collect();
    let six: Vec<Output> = six.into_iter().map(end_of).collect();
    let codes: Vec<_> = six.iter().map(|output| output.status.code()).collect();
    // A run may begin after another one has ended.
    assert!(codes.contains(&Some(0)), "{codes:?}");
    assert!(codes.iter().all(|code| [Some(0), Some(2)].contains(code)), "{codes:?}");
    let verified = orchestrator(&["verify", "runs/e"], folder.path());
    assert!(verified.status.success(), "{}", said(&verified));
    let locks: Vec<String> = names(&folder.path().join("runs")).into_iter().collect();
    assert!(locks.iter().all(|name| !name.contains("lock")), "{locks:?}");
}

#[test]
fn notes_in_the_folder_of_a_result_stay() {
    let folder = folder("");
    complete(folder.path(), &[]);
    let notes = folder.path().join("runs/e/notes.txt");
    std::fs::write(&notes, "mine").unwrap();
    complete(folder.path(), &[]);
    assert_eq!(std::fs::read_to_string(&notes).unwrap(), "mine");
    complete(folder.path(), &["--seed", "9", "--replace"]);
    assert_eq!(std::fs::read_to_string(&notes).unwrap(), "mine");
    let verified = orchestrator(&["verify", "runs/e"], folder.path());
    assert!(verified.status.success(), "{}", said(&verified));
}

#[test]
fn results_have_the_mode_that_the_umask_leaves() {
    let folder = folder("");
    let executable = tests::executable("murmuration");
    let script = format!("umask 027; exec {} run e.toml --json a.json", executable.display());
    let output = spawn(Command::new("sh").args(["-c", &script]), folder.path());
    let output = end_of(output);
    assert!(output.status.success(), "{}", said(&output));
    let dir = folder.path().join("runs/e");
    let files = names(&dir).into_iter().map(|name| dir.join(name));
    for file in files.chain([folder.path().join("a.json")]) {
        let mode = std::fs::metadata(&file).unwrap().permissions().mode() & 0o777;
        assert_eq!(mode, 0o640, "{}", file.display());
    }
}

#[test]
fn a_hang_up_keeps_what_was_recorded() {
    let folder = folder("");
    let run = endless(folder.path());
    signal("-HUP", run.id());
    let output = end_of(run);
    assert_eq!(output.status.code(), Some(1), "{}", said(&output));
    let summary = json(folder.path().join("runs/e/summary.json"));
    assert_eq!(summary["status"], "interrupted");
    assert!(summary["reason"].as_str().unwrap().contains("SIGHUP"), "{summary}");
}

#[test]
fn a_run_under_nohup_outlives_its_session() {
    let folder = folder("");
    let executable = tests::executable("murmuration");
    let script = format!("trap '' HUP; exec {} run e.toml --set {ENDLESS}", executable.display());
    let mut run = spawn(Command::new("sh").args(["-c", &script]), folder.path());
    until_it_records(folder.path(), &run);
    signal("-HUP", run.id());
    wait_until_recording(&folder.path().join("runs"));
    assert!(run.try_wait().unwrap().is_none(), "it has ended");
    signal("-TERM", run.id());
    let output = end_of(run);
    let reason = json(folder.path().join("runs/e/summary.json"))["reason"].clone();
    assert!(reason.as_str().unwrap().contains("SIGTERM"), "{reason} {}", said(&output));
}

#[test]
fn a_simulator_that_is_served_ends_with_a_hang_up() {
    for name in ["netsim", "robotsim"] {
        let mut child = tests::hearing_hang_ups(name)
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let mut line = String::new();
        let stdout = child.stdout.take().unwrap();
        std::io::BufRead::read_line(&mut std::io::BufReader::new(stdout), &mut line).unwrap();
        signal("-HUP", child.id());
        assert_eq!(end_of(child).status.code(), Some(0), "{name}");
    }
}

#[test]
fn what_a_killed_run_has_left_is_named_by_the_next() {
    let folder = folder("");
    let killed = endless(folder.path());
    signal("-KILL", killed.id());
    let id = killed.id();
    let _ = end_of(killed);
    let text = complete(folder.path(), &[]);
    let partial = format!("runs/.e.partial-{id}");
    assert!(text.contains(&format!("warning: {partial} is left by an earlier run")), "{text}");
    assert!(text.contains(&format!("murmuration recover {partial}")), "{text}");
    assert!(folder.path().join(&partial).join("run.mcap").exists());
}

#[test]
fn a_result_has_a_log_of_its_run() {
    let folder = folder("");
    complete(folder.path(), &["--log", "info"]);
    let log = std::fs::read_to_string(folder.path().join("runs/e/run.log")).unwrap();
    for part in [
        "orchestrator: orchestrator 0.2.0 runs e with seed 3",
        "netsim: ",
        "step 10 of ",
        "complete after step ",
    ] {
        assert!(log.contains(part), "{part:?} is not in {log}");
    }
    let provenance = json(folder.path().join("runs/e/provenance.json"));
    assert!(provenance["files"].get("run.log").is_none(), "the log has a fingerprint");
    let verified = orchestrator(&["verify", "runs/e"], folder.path());
    assert!(verified.status.success(), "{}", said(&verified));
}

#[test]
fn an_edited_number_of_a_journal_does_not_come_into_the_table() {
    let folder = folder("[sweep]\nseeds = 3\n");
    let sweep = || orchestrator(&["sweep", "e.toml"], folder.path());
    assert!(sweep().status.success());
    let table = || std::fs::read(folder.path().join("runs/e/trials.parquet")).unwrap();
    let before = table();
    let journal = folder.path().join("runs/e/trials.jsonl");
    let text = std::fs::read_to_string(&journal).unwrap();
    let mut lines: Vec<String> = text.lines().map(str::to_owned).collect();
    lines[1] = lines[1].replacen("\"simulated_s\":2.0", "\"simulated_s\":3.0", 1);
    assert!(!text.contains(&lines[1]), "{}", lines[1]);
    lines[2].truncate(40);
    std::fs::write(&journal, lines.join("\n") + "\n").unwrap();
    let output = sweep();
    assert!(output.status.success(), "{}", said(&output));
    for line in [2, 3] {
        let warning = format!("warning: runs/e/trials.jsonl:{line}: is damaged");
        assert!(said(&output).contains(&warning), "{}", said(&output));
    }
    assert!(said(&output).contains("3 trials, 1 of them finished earlier"), "{}", said(&output));
    assert_eq!(table(), before);
    assert!(!said(&sweep()).contains("warning"));
}

#[test]
fn a_trial_that_fails_twice_does_not_cost_the_table_of_the_others() {
    // The network breaks the contract in step 3: shorter trials succeed.
    let network = Faulty::network(Fault::WrongStep);
    let folder = folder("[sweep]\nseeds = 2\n[sweep.vary]\nexperiment.duration_s = [0.05, 2.0]\n");
    let sweep = |more: &[&str]| {
        let args = ["sweep", "e.toml", "--json", "a.json", "--netsim"];
        orchestrator(&[&args[..], more].concat(), folder.path())
    };
    let output = sweep(&[&network.url]);
    assert_eq!(output.status.code(), Some(1), "{}", said(&output));
    assert!(said(&output).contains("error: 2 of 4 trials failed"), "{}", said(&output));
    let table = folder.path().join("runs/e/trials.parquet");
    let rows = super::sweeps::rows(&table);
    let text_of = |row: usize, column: &str| rows[row][column].to_string();
    let statuses: Vec<String> = (0..4).map(|row| text_of(row, "status")).collect();
    assert_eq!(statuses, ["\"complete\"", "\"complete\"", "\"failed\"", "\"failed\""]);
    assert!(text_of(2, "error").contains("instead of step 3"), "{}", text_of(2, "error"));
    assert_eq!(text_of(0, "error"), "null");
    let summary = json(folder.path().join("a.json"));
    assert_eq!(summary["settings"][1]["failed"], 2, "{summary}");
    // The same command runs what failed again, and nothing else.
    let again = sweep(&[&network.url]);
    assert!(said(&again).contains("4 trials, 2 of them finished earlier"), "{}", said(&again));
}

#[test]
fn a_dry_run_estimates_and_leaves_nothing() {
    let folder = folder("");
    let text = complete(folder.path(), &["--dry-run", "--json", "a.json"]);
    assert!(text.contains("e: 1 trial of 4 agents, ") && text.contains("estimated from: "));
    let dry = json(folder.path().join("a.json"));
    assert_eq!((&dry["schema"], &dry["agents"]), (&"dry-run/1".into(), &4.into()));
    for figure in ["wall_s", "memory_bytes", "disk_bytes", "free_bytes"] {
        assert!(0.0 < dry[figure].as_f64().unwrap(), "{figure}: {dry}");
    }
    assert!(!folder.path().join("runs").exists(), "something was written");
    let sweep = tests::folder();
    std::fs::write(sweep.path().join("e.toml"), format!("{EXPERIMENT}[sweep]\nseeds = 7\n"))
        .unwrap();
    let output = orchestrator(&["sweep", "e.toml", "--dry-run"], sweep.path());
    assert!(said(&output).contains("e: 7 trials of 4 agents, "), "{}", said(&output));
    assert!(!sweep.path().join("runs").exists(), "something was written");
}

#[test]
fn a_run_whose_results_do_not_fit_is_not_started() {
    let folder = folder("");
    let huge = [
        "--set=experiment.duration_s=1e9",
        "--set=experiment.agents=5000",
        // Otherwise the robots might be done at once.
        "--set=experiment.stop_when_complete=false",
    ];
    let output = run(folder.path(), &huge);
    assert_eq!(output.status.code(), Some(2), "{}", said(&output));
    assert!(said(&output).contains("--out runs: results take at least "), "{}", said(&output));
    assert!(!folder.path().join("runs").exists(), "something was written");
}
