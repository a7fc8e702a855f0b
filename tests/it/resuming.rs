//! Runs that are killed, or lose a simulator, end with the recording of a run to which nothing happened.

use std::path::{Path, PathBuf};
use std::process::{Child, Command};
use std::time::Duration;
use tests::fake::{Fault, Faulty};
use tests::fault_campaign::children;
use tests::recording::assert_same;
use tests::{Server, end_of, signal, wait_until};

/// A propagation-only run and one with all protocols and a capture, each of some thousand steps.
const EXPERIMENTS: [(&str, &[&str]); 2] = [
    ("flocking", &["experiment.duration_s=150"]),
    (
        "sensors-msf",
        &[
            "experiment.control_period={ rate_hz = 1.0 }",
            "experiment.duration_s=900",
            "output.pcap=true",
        ],
    ),
];

/// The command line of a run with frequent checkpoints.
fn arguments(name: &str, sets: &[&str], out: &str, more: &[&str]) -> Vec<String> {
    let config = tests::repository().join(format!("configs/{name}.toml"));
    let mut arguments = vec!["run".to_owned(), config.to_str().unwrap().to_owned()];
    for set in sets.iter().chain(&["experiment.checkpoint_every_s=0.05"]) {
        arguments.extend(["--set".to_owned(), (*set).to_owned()]);
    }
    arguments.extend(["--out".to_owned(), out.to_owned()]);
    arguments.extend(more.iter().map(|&argument| argument.to_owned()));
    arguments
}

fn finished(arguments: &[String], folder: &Path) -> String {
    let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
    let output = tests::orchestrator(&arguments, folder);
    assert!(output.status.success(), "{}", tests::said(&output));
    tests::said(&output)
}

fn started(arguments: &[String], folder: &Path) -> Child {
    tests::spawn(Command::new(tests::executable("murmuration")).args(arguments), folder)
}

/// Folders of unfinished runs.
pub(super) fn unfinished(out: &Path) -> Vec<PathBuf> {
    let Ok(entries) = std::fs::read_dir(out) else { return Vec::new() };
    let paths = entries.map(|entry| entry.unwrap().path());
    paths.filter(|path| path.to_str().unwrap().contains(".partial-")).collect()
}

/// Waits until a run has stored a checkpoint. Returns its folder, or nothing if the run has ended.
fn checkpoint_of(run: &mut Child, out: &Path) -> Option<PathBuf> {
    let mut stored = None;
    wait_until("no checkpoint was stored", || {
        stored = unfinished(out).into_iter().find(|path| path.join("checkpoint").exists());
        stored.is_some() || run.try_wait().unwrap().is_some()
    });
    stored
}

/// A run killed with SIGKILL after its first checkpoint. Returns the folder that it left.
pub(super) fn killed(arguments: &[String], folder: &Path, out: &str) -> PathBuf {
    // On a busy machine a run may be over before this process sees its checkpoint.
    for _ in 0..10 {
        let mut run = started(arguments, folder);
        let left = checkpoint_of(&mut run, &folder.join(out));
        run.kill().unwrap();
        run.wait().unwrap();
        if let Some(left) = left.filter(|left| left.exists()) {
            return left;
        }
        std::fs::remove_dir_all(folder.join(out)).unwrap();
    }
    panic!("each of ten runs was complete before it was killed");
}

#[test]
fn a_run_killed_hard_is_resumed_to_the_same_bytes() {
    for (name, sets) in EXPERIMENTS {
        let folder = tests::folder();
        finished(&arguments(name, sets, "whole", &[]), folder.path());
        let left = killed(&arguments(name, sets, "killed", &[]), folder.path(), "killed");
        let resume = ["run", "--resume", left.to_str().unwrap()].map(str::to_owned);
        finished(&resume, folder.path());
        let [whole, resumed] = ["whole", "killed"].map(|out| folder.path().join(out).join(name));
        assert_same(&whole, &resumed);
        assert_eq!(
            std::fs::read(whole.join("config.toml")).unwrap(),
            std::fs::read(resumed.join("config.toml")).unwrap()
        );
        assert_eq!(unfinished(&folder.path().join("killed")), Vec::<PathBuf>::new());
        let verified = tests::orchestrator(&["verify", resumed.to_str().unwrap()], folder.path());
        assert!(verified.status.success(), "{}", tests::said(&verified));
    }
}

#[test]
fn a_run_killed_after_its_last_step_is_resumed_to_the_same_bytes() {
    let (name, sets) = EXPERIMENTS[0];
    let folder = tests::folder();
    finished(&arguments(name, sets, "whole", &[]), folder.path());
    let out = folder.path().join("killed");
    // Killed once its summary is written: after the last step, before the folder has its name.
    let mut left = None;
    for _ in 0..20 {
        let mut run = started(&arguments(name, sets, "killed", &[]), folder.path());
        while run.try_wait().unwrap().is_none() {
            left = unfinished(&out).into_iter().find(|path| path.join("summary.json").exists());
            if left.is_some() {
                break;
            }
        }
        run.kill().unwrap();
        run.wait().unwrap();
        left = left.filter(|left| left.exists());
        if left.is_some() {
            break;
        }
        std::fs::remove_dir_all(&out).unwrap();
    }
    let left = left.expect("each of twenty runs had its name before it was killed");
    finished(&["run", "--resume", left.to_str().unwrap()].map(str::to_owned), folder.path());
    let [whole, resumed] = ["whole", "killed"].map(|out| folder.path().join(out).join(name));
    assert_same(&whole, &resumed);
    assert_eq!(unfinished(&out), Vec::<PathBuf>::new());
    assert!(!resumed.join("checkpoint").exists());
}

#[test]
fn a_run_whose_place_is_taken_meanwhile_can_go_on_once_it_is_free() {
    let (name, sets) = EXPERIMENTS[0];
    let folder = tests::folder();
    finished(&arguments(name, sets, "whole", &[]), folder.path());
    let out = folder.path().join("taken");
    let mut run = started(&arguments(name, sets, "taken", &[]), folder.path());
    checkpoint_of(&mut run, &out).expect("a checkpoint is stored before the run ends");
    std::fs::create_dir(out.join(name)).unwrap();
    std::fs::write(out.join(name).join("thesis.tex"), "").unwrap();
    let ended = end_of(run);
    assert_eq!(ended.status.code(), Some(1), "{}", tests::said(&ended));
    assert!(
        tests::said(&ended).contains("is not the result of an earlier run"),
        "{}",
        tests::said(&ended)
    );
    std::fs::remove_dir_all(out.join(name)).unwrap();
    let [left] = &unfinished(&out)[..] else { panic!("one folder was to be left") };
    finished(&["run", "--resume", left.to_str().unwrap()].map(str::to_owned), folder.path());
    assert_same(&folder.path().join("whole").join(name), &out.join(name));
}

#[test]
fn a_simulator_that_dies_is_restarted_from_the_last_checkpoint() {
    for ((name, sets), side) in EXPERIMENTS.into_iter().zip(["robotsim", "netsim"]) {
        let folder = tests::folder();
        finished(&arguments(name, sets, "whole", &[]), folder.path());
        let mut run = started(&arguments(name, sets, "killed", &[]), folder.path());
        checkpoint_of(&mut run, &folder.path().join("killed")).unwrap();
        let children = children(run.id());
        let (pid, _) = children.iter().find(|(_, args)| args == side).unwrap();
        signal("-KILL", *pid);
        let output = end_of(run);
        let said = tests::said(&output);
        assert!(output.status.success(), "{said}");
        assert!(said.contains("goes on from its checkpoint after step"), "{said}");
        assert_same(
            &folder.path().join("whole").join(name),
            &folder.path().join("killed").join(name),
        );
        assert_eq!(unfinished(&folder.path().join("killed")), Vec::<PathBuf>::new());
    }
}

#[test]
fn a_simulator_elsewhere_that_is_lost_is_waited_for_and_restored() {
    let (name, sets) = EXPERIMENTS[1];
    let folder = tests::folder();
    finished(&arguments(name, sets, "whole", &[]), folder.path());
    let server = Server::start("netsim", &[]).unwrap();
    let url = server.url.clone();
    let arguments = arguments(name, sets, "killed", &["--netsim", &url]);
    let mut run = started(&arguments, folder.path());
    checkpoint_of(&mut run, &folder.path().join("killed")).unwrap();
    drop(server);
    std::thread::park_timeout(Duration::from_millis(500));
    let address = url.trim_start_matches("http://");
    let _server = Server::start("netsim", &["--listen", address]).unwrap();
    let output = end_of(run);
    assert!(output.status.success(), "{}", tests::said(&output));
    assert_same(&folder.path().join("whole").join(name), &folder.path().join("killed").join(name));
}

#[test]
fn restarts_0_ends_a_run_that_loses_a_simulator() {
    let (name, sets) = EXPERIMENTS[0];
    let sets = [sets, &["experiment.restarts=0", "experiment.duration_s=1e6"]].concat();
    let folder = tests::folder();
    let mut run = started(&arguments(name, &sets, "killed", &[]), folder.path());
    checkpoint_of(&mut run, &folder.path().join("killed")).unwrap();
    // Both at once: the run ends the other by itself as soon as it has lost one.
    let pids: Vec<String> = children(run.id()).iter().map(|(pid, _)| pid.to_string()).collect();
    assert_eq!(pids.len(), 2);
    assert!(Command::new("kill").arg("-KILL").args(&pids).status().unwrap().success());
    let output = end_of(run);
    assert_eq!(output.status.code(), Some(1), "{}", tests::said(&output));
    assert!(tests::said(&output).contains("killed by SIGKILL"), "{}", tests::said(&output));
}

#[test]
fn a_simulator_without_snapshots_begins_anew_and_is_compared_with_the_record() {
    let (name, sets) = EXPERIMENTS[0];
    let folder = tests::folder();
    let network = Faulty::network(Fault::NoSnapshots);
    let more = ["--netsim", network.url.as_str()];
    finished(&arguments(name, sets, "whole", &more), folder.path());
    let left = killed(&arguments(name, sets, "killed", &more), folder.path(), "killed");
    finished(&["run", "--resume", left.to_str().unwrap()].map(str::to_owned), folder.path());
    assert_same(&folder.path().join("whole").join(name), &folder.path().join("killed").join(name));
}

#[test]
fn a_run_killed_hard_is_recovered_up_to_its_last_whole_step() {
    for (name, sets) in EXPERIMENTS {
        let folder = tests::folder();
        let left = killed(&arguments(name, sets, "killed", &[]), folder.path(), "killed");
        finished(&["recover", left.to_str().unwrap()].map(str::to_owned), folder.path());
        let recovered = folder.path().join("killed").join(name);
        let verified = tests::orchestrator(&["verify", recovered.to_str().unwrap()], folder.path());
        assert!(verified.status.success(), "{}", tests::said(&verified));
        let summary: serde_json::Value =
            serde_json::from_slice(&std::fs::read(recovered.join("summary.json")).unwrap())
                .unwrap();
        assert_eq!(summary["status"], "interrupted");
        assert!(summary["reason"].as_str().unwrap().contains("was killed"), "{summary}");
        assert!(0 < summary["steps"].as_u64().unwrap());
        assert!(recovered.join("report.html").exists());
        assert_eq!(unfinished(&folder.path().join("killed")), Vec::<PathBuf>::new());
    }
}

#[test]
fn a_folder_without_a_usable_checkpoint_is_refused_and_stays() {
    let (name, sets) = EXPERIMENTS[0];
    let folder = tests::folder();
    let left = killed(&arguments(name, sets, "killed", &[]), folder.path(), "killed");
    let resume = ["run", "--resume", left.to_str().unwrap()];
    let file = left.join("checkpoint");
    let mut bytes = std::fs::read(&file).unwrap();
    let middle = bytes.len() / 2;
    bytes[middle] ^= 1;
    std::fs::write(&file, bytes).unwrap();
    let refused = tests::orchestrator(&resume, folder.path());
    assert_eq!(refused.status.code(), Some(2), "{}", tests::said(&refused));
    assert!(tests::said(&refused).contains("its checksum is wrong"), "{}", tests::said(&refused));
    std::fs::remove_file(&file).unwrap();
    let refused = tests::orchestrator(&resume, folder.path());
    assert_eq!(refused.status.code(), Some(2), "{}", tests::said(&refused));
    assert!(tests::said(&refused).contains("murmuration recover"), "{}", tests::said(&refused));
    assert!(left.join("run.mcap").exists());
}

#[test]
fn a_recorded_run_is_reproduced_from_its_own_folder() {
    let folder = tests::folder();
    // The record holds the trace, which is gone afterwards.
    let configs = tests::repository().join("configs");
    let config = folder.path().join("k7-replay.toml");
    std::fs::copy(configs.join("k7-replay.toml"), &config).unwrap();
    let traces = folder.path().join("traces");
    std::fs::create_dir(&traces).unwrap();
    for entry in std::fs::read_dir(configs.join("traces")).unwrap() {
        let path = entry.unwrap().path();
        std::fs::copy(&path, traces.join(path.file_name().unwrap())).unwrap();
    }
    let run = tests::run(&config, folder.path(), &["--set", "experiment.duration_s=20"]);
    std::fs::remove_dir_all(&traces).unwrap();
    let moved = folder.path().join("elsewhere");
    std::fs::rename(&run, &moved).unwrap();
    let run = moved.to_str().unwrap();
    let again = tests::orchestrator(&["reproduce", run, "--json", "answer.json"], folder.path());
    assert!(again.status.success(), "{}", tests::said(&again));
    let answer: serde_json::Value =
        serde_json::from_slice(&std::fs::read(folder.path().join("answer.json")).unwrap()).unwrap();
    assert_eq!(answer["different"], serde_json::json!([]));
    assert!(5 <= answer["equal"].as_array().unwrap().len(), "{answer}");
    // A record that does not say what was run.
    let config = moved.join("config.toml");
    let text = std::fs::read_to_string(&config).unwrap();
    assert!(text.contains("duration_s = 20.0"), "{text}");
    std::fs::write(&config, text.replace("duration_s = 20.0", "duration_s = 10.0")).unwrap();
    let refused = tests::orchestrator(&["reproduce", run], folder.path());
    assert_eq!(refused.status.code(), Some(1), "{}", tests::said(&refused));
    assert!(tests::said(&refused).contains("config.toml: bytes 0 to"));
    let other = tests::orchestrator(&["reproduce", run, "--unverified"], folder.path());
    assert_eq!(other.status.code(), Some(1), "{}", tests::said(&other));
    assert!(tests::said(&other).contains("run.mcap"), "{}", tests::said(&other));
    assert!(tests::said(&other).contains("the first difference is in step"));
}

#[test]
fn a_result_is_not_recovered_and_stays() {
    let folder = tests::folder();
    let (name, sets) = EXPERIMENTS[0];
    finished(&arguments(name, sets, "whole", &[]), folder.path());
    let result = folder.path().join("whole").join(name);
    let before = std::fs::read(result.join("run.mcap")).unwrap();
    for command in [&["recover"][..], &["run", "--resume"]] {
        let arguments = [command, &[result.to_str().unwrap()]].concat();
        let output = tests::orchestrator(&arguments, folder.path());
        assert_eq!(output.status.code(), Some(2), "{}", tests::said(&output));
        assert!(tests::said(&output).contains("it is the result of a run that ended"));
    }
    assert_eq!(std::fs::read(result.join("run.mcap")).unwrap(), before);
}

#[test]
fn a_seed_that_was_changed_after_the_run_is_named() {
    let folder = tests::folder();
    let (name, sets) = EXPERIMENTS[0];
    let left = killed(&arguments(name, sets, "killed", &[]), folder.path(), "killed");
    let config = std::fs::read_to_string(left.join("config.toml")).unwrap();
    let other = config.replace("\nseed = 1\n", "\nseed = 5\n");
    assert_ne!(other, config);
    std::fs::write(left.join("config.toml"), &other).unwrap();
    let output = tests::orchestrator(&["recover", left.to_str().unwrap()], folder.path());
    let said = tests::said(&output);
    assert_eq!(output.status.code(), Some(2), "{said}");
    assert!(said.contains("seed 5") && said.contains("recorded are seed 1"), "{said}");
    // Put back, it is recovered, with the log of the run.
    std::fs::write(left.join("config.toml"), &config).unwrap();
    let output = tests::orchestrator(&["recover", left.to_str().unwrap()], folder.path());
    assert!(output.status.success(), "{}", tests::said(&output));
    let result = folder.path().join("killed").join(name);
    let log = std::fs::read_to_string(result.join("run.log")).unwrap();
    assert!(log.contains("seed"), "{log}");
    std::fs::write(result.join("config.toml"), &other).unwrap();
    let output = tests::orchestrator(&["verify", result.to_str().unwrap()], folder.path());
    let said = tests::said(&output);
    assert!(said.contains("config.toml: experiment.seed is 5"), "{said}");
}

#[test]
fn the_log_of_a_resumed_run_tells_of_both_parts() {
    let folder = tests::folder();
    let (name, sets) = EXPERIMENTS[0];
    let left = killed(&arguments(name, sets, "killed", &[]), folder.path(), "killed");
    let before = std::fs::read_to_string(left.join("run.log")).unwrap();
    finished(&["run", "--resume", left.to_str().unwrap()].map(str::to_owned), folder.path());
    let result = folder.path().join("killed").join(name);
    let log = std::fs::read_to_string(result.join("run.log")).unwrap();
    assert!(log.starts_with(&before) && before.len() < log.len(), "{log}");
}

#[test]
fn another_interval_of_checkpoints_is_the_same_experiment() {
    let folder = tests::folder();
    let (name, sets) = EXPERIMENTS[0];
    finished(&arguments(name, sets, "out", &[]), folder.path());
    let more = ["--set", "experiment.restarts=7"];
    let said = finished(&arguments(name, sets, "out", &more), folder.path());
    assert!(!folder.path().join("out").join(format!("{name}-2")).exists(), "{said}");
}
