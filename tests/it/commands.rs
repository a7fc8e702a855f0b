//! Simulators that a command of the experiment file starts.

use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output};
use tests::recording::assert_same;
use tests::{Server, end_of, signal, wait_until, wait_until_recording};

const EXPERIMENT: &str = "[experiment]\nname = \"c\"\nseed = 3\nduration_s = 2.0\nagents = 8\n\
    [robotsim.scenario]\nkind = \"disc\"\ndensity_per_m2 = 0.1\n\
    [robotsim.controller]\nkind = \"flocking\"\nflock_radius_m = 10.0\n\
    [netsim.phy]\npropagation = \"full\"\n";

const SWEEP: &str =
    "[sweep]\nseeds = 3\n[sweep.vary]\nrobotsim.controller.flock_radius_m = [5.0, 20.0]\n";

/// What a simulator of one's own says when it dies.
const LAST_WORDS: &str = "Traceback: a wheel came off";

/// The script of a side: the built-in simulator, as a program that knows nothing but the variable.
fn serve(side: &str) -> String {
    let program = tests::executable("murmuration");
    format!("'{}' {side} --listen \"$MURMURATION_LISTEN\"", program.display())
}

/// Options that give a side a script as its command.
fn set(side: &str, script: &str) -> [String; 2] {
    ["--set".to_owned(), format!("{side}.command={}", list(&["sh", "-c", script]))]
}

fn list(words: &[&str]) -> String {
    format!("[{}]", words.iter().map(|word| format!("{word:?}")).collect::<Vec<_>>().join(", "))
}

fn written(folder: &Path, more: &str) -> PathBuf {
    let path = folder.join("c.toml");
    std::fs::write(&path, format!("{EXPERIMENT}{more}")).unwrap();
    path
}

fn asked(folder: &Path, args: &[&str], more: &[String]) -> Output {
    let args: Vec<&str> = args.iter().copied().chain(more.iter().map(String::as_str)).collect();
    tests::orchestrator(&args, folder)
}

fn started(folder: &Path, more: &[String]) -> Child {
    let mut command = Command::new(tests::executable("murmuration"));
    command
        .args(["run", "c.toml", "--allow-command", "--set", "experiment.duration_s=1e7"])
        .args(more);
    tests::spawn(&mut command, folder)
}

/// Numbers that scripts have written to a file, one a line.
fn pids(path: &Path) -> Vec<u32> {
    let text = std::fs::read_to_string(path).unwrap();
    text.lines().map(|line| line.parse().unwrap()).collect()
}

/// Whether a process has ended, even if nobody has asked for its status yet.
fn is_gone(pid: u32) -> bool {
    let status = std::fs::read_to_string(format!("/proc/{pid}/status"));
    status.map_or(true, |status| status.contains("State:\tZ"))
}

#[test]
fn a_command_gives_the_recording_of_the_built_in_simulator() {
    let folder = tests::folder();
    let config = written(folder.path(), "");
    let built_in = tests::run(&config, &folder.path().join("built-in"), &[]);
    let both =
        [set("robotsim", &format!("exec {}", serve("robotsim"))), set("netsim", &serve("netsim"))];
    let more: Vec<&str> = both.iter().flatten().map(String::as_str).collect();
    let more = [&["--allow-command"], &more[..]].concat();
    let own = tests::run(&config, &folder.path().join("own"), &more);
    assert_same(&built_in, &own);
    let provenance = std::fs::read_to_string(own.join("provenance.json")).unwrap();
    let provenance: serde_json::Value = serde_json::from_str(&provenance).unwrap();
    assert_eq!(provenance["robotsim"]["started_here"], true);
    assert_eq!(provenance["robotsim"]["command"][0], "sh");
    // The record's own configuration has the command, and where it ran.
    let kept = own.join("config.toml");
    let again = tests::run(&kept, &folder.path().join("again"), &["--allow-command"]);
    assert_same(&own, &again);
    let own = own.to_str().unwrap();
    let refused = asked(folder.path(), &["reproduce", own], &[]);
    assert_eq!(refused.status.code(), Some(2), "{}", tests::said(&refused));
    assert!(tests::said(&refused).contains("--allow-command"), "{}", tests::said(&refused));
    let reproduced = asked(folder.path(), &["reproduce", own, "--allow-command"], &[]);
    assert!(reproduced.status.success(), "{}", tests::said(&reproduced));
}

#[test]
fn a_file_runs_no_program_unless_it_is_allowed_to() {
    let folder = tests::folder();
    written(folder.path(), "");
    let mark = folder.path().join("ran");
    let command = set("robotsim", &format!("touch {}", mark.display()));
    for args in [&["run", "c.toml"][..], &["run", "c.toml", "--dry-run"]] {
        let refused = asked(folder.path(), args, &command);
        let said = tests::said(&refused);
        assert_eq!(refused.status.code(), Some(2), "{said}");
        assert!(said.contains(&format!("sh -c 'touch {}'", mark.display())), "{said}");
        assert!(said.contains("robotsim.command") && said.contains("--allow-command"), "{said}");
    }
    let checked = asked(folder.path(), &["check", "c.toml"], &command);
    assert!(checked.status.success(), "{}", tests::said(&checked));
    assert!(
        tests::said(&checked).contains("[robotsim] is not checked"),
        "{}",
        tests::said(&checked)
    );
    written(folder.path(), SWEEP);
    for args in [
        &["sweep", "c.toml"][..],
        &["sweep", "c.toml", "--dry-run"],
        &["sweep", "c.toml", "--shard", "1/2"],
    ] {
        let refused = asked(folder.path(), args, &command);
        assert_eq!(refused.status.code(), Some(2), "{}", tests::said(&refused));
        assert!(tests::said(&refused).contains("--allow-command"), "{}", tests::said(&refused));
    }
    assert!(asked(folder.path(), &["check", "c.toml"], &command).status.success());
    assert!(!mark.exists(), "the command ran");
    assert!(!folder.path().join("runs").exists(), "something was written");
    // What is refused is what would run.
    let failed = asked(folder.path(), &["sweep", "c.toml", "--allow-command"], &command);
    assert_eq!(failed.status.code(), Some(1), "{}", tests::said(&failed));
    assert!(mark.exists(), "the command did not run");
}

#[test]
fn a_url_of_the_command_line_replaces_the_command() {
    let folder = tests::folder();
    let config = written(folder.path(), "");
    let server = Server::start("robotsim", &[]).unwrap();
    let [option, command] = set("robotsim", "exit 1");
    let more = [option.as_str(), command.as_str(), "--robotsim", server.url.as_str()];
    let run = tests::run(&config, &folder.path().join("runs"), &more);
    let kept = std::fs::read_to_string(run.join("config.toml")).unwrap();
    assert!(kept.contains("command = [\"sh\""), "{kept}");
    let both = [option, command, "--set".to_owned(), format!("robotsim.url={:?}", server.url)];
    let refused = asked(folder.path(), &["check", "c.toml"], &both);
    assert_eq!(refused.status.code(), Some(2), "{}", tests::said(&refused));
    let expected = "robotsim.command: cannot be given together with robotsim.url";
    assert!(tests::said(&refused).contains(expected), "{}", tests::said(&refused));
}

#[test]
fn a_command_that_cannot_serve_is_named_before_the_first_step() {
    let folder = tests::folder();
    written(folder.path(), "");
    let words = |words: &[&str]| ["--set".to_owned(), format!("robotsim.command={}", list(words))];
    let failed = |status: i32, more: &[String], expected: &[&str]| {
        let output = asked(folder.path(), &["run", "c.toml", "--allow-command"], more);
        let said = tests::said(&output);
        assert_eq!(output.status.code(), Some(status), "{said}");
        for text in expected {
            assert!(said.contains(text), "{text}: {said}");
        }
        assert!(!folder.path().join("runs/c").exists(), "something was recorded");
    };
    let missing = ["error: robotsim.command: the program \"no-such-program\" is in no folder of"];
    failed(2, &words(&["no-such-program"]), &missing);
    failed(2, &words(&["./no-such-program"]), &["no-such-program does not exist"]);
    failed(2, &words(&["./c.toml"]), &["is not executable"]);
    let elsewhere = ["--set".to_owned(), "robotsim.working_directory=nowhere".to_owned()];
    failed(2, &[&words(&["sh"])[..], &elsewhere].concat(), &["/nowhere, which does not exist"]);
    let dies = set("robotsim", &format!("echo '{LAST_WORDS}' >&2; exit 3"));
    failed(1, &dies, &["ended before it served", "exit status 3", &format!("\n  {LAST_WORDS}")]);
    let network = set("robotsim", &format!("exec {}", serve("netsim")));
    failed(2, &network, &["is not a robotsim: it speaks gRPC, but does not have this service"]);
}

#[test]
fn a_relative_program_and_its_folder_are_found_from_the_file() {
    let folder = tests::folder();
    let inner = folder.path().join("inner/sims");
    std::fs::create_dir_all(&inner).unwrap();
    std::fs::write(inner.join("start.sh"), format!("exec {}\n", serve("robotsim"))).unwrap();
    let keys = "[robotsim]\ncommand = [\"sh\", \"start.sh\"]\nworking_directory = \"sims\"\n[robotsim.scenario]";
    let config = folder.path().join("inner/c.toml");
    std::fs::write(&config, EXPERIMENT.replace("[robotsim.scenario]", keys)).unwrap();
    // From another folder.
    let run = tests::run(&config, &folder.path().join("out"), &["--allow-command"]);
    let kept = std::fs::read_to_string(run.join("config.toml")).unwrap();
    assert!(kept.contains(&format!("working_directory = {inner:?}")), "{kept}");
}

#[test]
fn a_sweep_starts_a_command_for_each_job_and_gives_the_table_of_the_built_in_simulator() {
    let folder = tests::folder();
    written(folder.path(), SWEEP);
    let swept = |out: &str, more: &[String]| -> Vec<u8> {
        let output = asked(folder.path(), &["sweep", "c.toml", "--out", out], more);
        assert!(output.status.success(), "{}", tests::said(&output));
        std::fs::read(folder.path().join(out).join("c/trials.parquet")).unwrap()
    };
    let jobs = |n: &str| {
        let script = format!("echo $$ >> started-{n}; exec {}", serve("robotsim"));
        let more = ["--allow-command", "--jobs", n].map(str::to_owned);
        [&more[..], &set("robotsim", &script)].concat()
    };
    let built_in = swept("built-in", &[]);
    assert!(built_in == swept("one", &jobs("1")), "another table than the built-in simulator's");
    assert!(built_in == swept("two", &jobs("2")), "another table with two jobs");
    assert_eq!(pids(&folder.path().join("started-1")).len(), 1);
    let of_two = pids(&folder.path().join("started-2"));
    assert_eq!(of_two.len(), 2);
    for pid in of_two {
        wait_until("a command outlived the sweep", || is_gone(pid));
    }
}

#[test]
fn trials_of_a_script_that_was_edited_run_again() {
    let folder = tests::folder();
    let keys = "[robotsim]\ncommand = [\"sh\", \"start.sh\"]\n[robotsim.scenario]";
    let config = EXPERIMENT.replace("[robotsim.scenario]", keys);
    std::fs::write(folder.path().join("c.toml"), config + SWEEP).unwrap();
    let write = |comment: &str| {
        let script = format!("# {comment}\nexec {}\n", serve("robotsim"));
        std::fs::write(folder.path().join("start.sh"), script).unwrap();
    };
    let swept = || {
        let output = asked(folder.path(), &["sweep", "c.toml", "--allow-command"], &[]);
        assert!(output.status.success(), "{}", tests::said(&output));
        tests::said(&output)
    };
    write("first");
    assert!(!swept().contains("finished earlier"));
    assert!(swept().contains("finished earlier"));
    write("second");
    assert!(!swept().contains("finished earlier"));
    write("first");
    assert!(swept().contains("finished earlier"));
}

/// A script whose simulator runs beside another process, which nobody ends but the orchestrator.
fn with_a_companion() -> String {
    format!("sleep 1000 & echo $! >> pids; echo $$ >> pids; exec {}", serve("robotsim"))
}

#[test]
fn all_that_a_command_has_started_ends_with_the_run() {
    let folder = tests::folder();
    written(folder.path(), "");
    let more = set("robotsim", &with_a_companion());
    let complete = ["run", "c.toml", "--allow-command", "--out", "complete"];
    let output = asked(folder.path(), &complete, &more);
    assert!(output.status.success(), "{}", tests::said(&output));
    let run = started(folder.path(), &more);
    wait_until_recording(&folder.path().join("runs"));
    signal("-INT", run.id());
    let output = end_of(run);
    assert_eq!(output.status.code(), Some(1), "{}", tests::said(&output));
    assert!(tests::said(&output).contains("interrupted after step"), "{}", tests::said(&output));
    let pids = pids(&folder.path().join("pids"));
    assert_eq!(pids.len(), 4);
    for pid in pids {
        wait_until("a process of the command is left", || is_gone(pid));
    }
}

#[test]
fn a_command_does_not_outlive_a_killed_orchestrator() {
    let folder = tests::folder();
    written(folder.path(), "");
    // It does not look at its standard input.
    let script = format!("echo $$ >> pids; exec {} < /dev/null", serve("robotsim"));
    let mut run = started(folder.path(), &set("robotsim", &script));
    wait_until_recording(&folder.path().join("runs"));
    let pids = pids(&folder.path().join("pids"));
    assert!(!is_gone(pids[0]));
    run.kill().unwrap();
    run.wait().unwrap();
    wait_until("the command outlived the orchestrator", || is_gone(pids[0]));
}

#[test]
fn a_command_that_dies_shows_its_status_and_its_last_lines() {
    let folder = tests::folder();
    written(folder.path(), "");
    let script =
        format!("{} & echo $! > pids; wait $!; echo '{LAST_WORDS}' >&2; exit 7", serve("robotsim"));
    let run = started(folder.path(), &set("robotsim", &script));
    wait_until_recording(&folder.path().join("runs"));
    signal("-KILL", pids(&folder.path().join("pids"))[0]);
    let output = end_of(run);
    let said = tests::said(&output);
    assert_eq!(output.status.code(), Some(1), "{said}");
    assert!(said.contains("robotsim: the process ended during step"), "{said}");
    assert!(said.contains("exit status 7\nits last lines on standard error:\n"), "{said}");
    assert!(said.contains(&format!("\n  {LAST_WORDS}")), "{said}");
    let log = std::fs::read_to_string(folder.path().join("runs/c/run.log")).unwrap();
    assert!(log.contains(LAST_WORDS), "{log}");
}
