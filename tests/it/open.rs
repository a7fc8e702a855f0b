//! `murmuration open`: what its server answers, to whom, and what it lists.

use serde_json::{Value, json};
use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::path::Path;
use std::process::{Child, ChildStdout, Command};
use tests::{orchestrator, said, signal, wait_until, wait_until_recording};

const EXPERIMENT: &str = "[experiment]\nname = \"walk\"\nseed = 3\nduration_s = 2.0\nagents = 4\n\
    control_period = { rate_hz = 10.0 }\n[robotsim.scenario]\nkind = \"line\"\n[robotsim.controller]\nkind = \"flocking\"\n\
    flock_radius_m = 5.0\n[netsim.phy]\npropagation = \"unit-disk\"\nradius_m = 12.0\n";

/// The program that shows a folder. Killed when dropped.
struct Opened {
    child: Child,
    address: String,
    token: String,
    /// Kept open: the program writes there.
    _stdout: BufReader<ChildStdout>,
}

impl Drop for Opened {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// A status, the headers as one text, and the content.
struct Answer(u16, String, String);

impl Opened {
    fn start(folder: &Path, args: &[&str]) -> Self {
        let mut command = Command::new(tests::executable("murmuration"));
        let mut child = tests::spawn(command.args([&["open"], args].concat()), folder);
        let mut stdout = BufReader::new(child.stdout.take().unwrap());
        let mut line = String::new();
        stdout.read_line(&mut line).unwrap();
        let url = line.trim().strip_prefix("open http://").unwrap_or_else(|| panic!("{line:?}"));
        let (address, token) = url.split_once("/?token=").unwrap();
        Self { child, address: address.to_owned(), token: token.to_owned(), _stdout: stdout }
    }

    fn get_with(&self, path: &str, headers: &[(&str, &str)]) -> Answer {
        let mut stream = TcpStream::connect(&self.address).unwrap();
        let has_host = headers.iter().any(|(name, _)| *name == "Host");
        let host = if has_host { String::new() } else { format!("Host: {}\r\n", self.address) };
        let headers: String =
            headers.iter().map(|(name, value)| format!("{name}: {value}\r\n")).collect();
        let request = format!("GET {path} HTTP/1.1\r\n{host}{headers}Connection: close\r\n\r\n");
        stream.write_all(request.as_bytes()).unwrap();
        let mut answer = Vec::new();
        stream.read_to_end(&mut answer).unwrap();
        let answer = String::from_utf8_lossy(&answer).into_owned();
        let (head, content) = answer.split_once("\r\n\r\n").unwrap_or_else(|| panic!("{answer:?}"));
        let status = head.split(' ').nth(1).unwrap().parse().unwrap();
        Answer(status, head.to_lowercase(), content.to_owned())
    }

    fn get(&self, path: &str) -> Answer {
        self.get_with(path, &[("Authorization", &format!("Bearer {}", self.token))])
    }

    fn json(&self, path: &str) -> Value {
        let Answer(status, _, content) = self.get(path);
        assert_eq!(status, 200, "{path}: {content}");
        serde_json::from_str(&content).unwrap()
    }

    /// All rows, once everything is read.
    fn rows(&self) -> Vec<Value> {
        let mut rows = Vec::new();
        wait_until("the results are not read", || {
            let changes = self.json("/api/rows?since=0");
            rows = changes["rows"].as_array().unwrap().clone();
            changes["n_unread"] == 0
        });
        rows
    }

    fn row(&self, name: &str) -> Value {
        let rows = self.rows();
        let found = rows.iter().find(|row| row["name"] == name);
        found.unwrap_or_else(|| panic!("{name}: {rows:?}")).clone()
    }
}

fn succeeded(args: &[&str], folder: &Path) {
    let output = orchestrator(args, folder);
    assert!(output.status.success(), "{args:?}: {}", said(&output));
}

/// A folder with an experiment, and the results of two runs of it in `runs`.
fn two_runs() -> tempfile::TempDir {
    let folder = tests::folder();
    std::fs::write(folder.path().join("walk.toml"), EXPERIMENT).unwrap();
    succeeded(&["run", "walk.toml"], folder.path());
    let other = ["experiment.name=near", "netsim.phy.radius_m=3.0"];
    succeeded(&["run", "walk.toml", "--set", other[0], "--set", other[1]], folder.path());
    folder
}

/// A run that fails, since its robot simulator ends.
fn lost(folder: &Path) {
    let program = tests::executable("murmuration");
    let script = format!(
        "echo $$ > pid; exec '{}' robotsim --listen \"$MURMURATION_LISTEN\"",
        program.display()
    );
    let command =
        format!("[robotsim]\ncommand = [\"sh\", \"-c\", {script:?}]\n[robotsim.scenario]");
    let failing = EXPERIMENT.replace("walk", "lost").replace("[robotsim.scenario]", &command);
    std::fs::write(folder.join("lost.toml"), failing).unwrap();
    let more =
        ["--allow-command", "--set", "experiment.duration_s=1e7", "--set", "experiment.restarts=0"];
    let run = tests::spawn(Command::new(program).args(["run", "lost.toml"]).args(more), folder);
    wait_until_recording(&folder.join("runs"));
    let robots = std::fs::read_to_string(folder.join("pid")).unwrap();
    signal("-KILL", robots.trim().parse().unwrap());
    let output = tests::end_of(run);
    assert_eq!(output.status.code(), Some(1), "{}", said(&output));
}

#[test]
fn results_of_every_kind_are_listed_with_what_they_came_to() {
    let folder = two_runs();
    let runs = folder.path().join("runs");
    let sweep = format!(
        "{}[sweep]\nseeds = 2\nmetrics = [\"flock_speed\"]\n[sweep.vary]\n\"netsim.phy.radius_m\" = [3.0, 12.0]\n",
        EXPERIMENT.replace("walk", "swept")
    );
    std::fs::write(folder.path().join("sweep.toml"), sweep).unwrap();
    succeeded(&["sweep", "sweep.toml"], folder.path());
    lost(folder.path());
    let answer = json!({
        "schema": "diagnose/2", "kind": "link", "sentence": "The model lacks a wall.", "warnings": ["few rows"],
        "ladder": [{ "model": "as it is", "rmse": 6.5 }, { "model": "with wall", "rmse": 3.25 }],
    });
    std::fs::create_dir(runs.join("answers")).unwrap();
    std::fs::write(runs.join("answers/lab.json"), answer.to_string()).unwrap();
    std::fs::write(runs.join("answers/other.json"), "{\"schema\": \"import/1\"}").unwrap();
    std::fs::write(runs.join("answers/broken.json"), "{").unwrap();
    let scores = json!({ "schema": "compare/1", "kind": "link", "scores": { "bias_db": 1.0, "rmse_db": 2.5 }, "intervals": { "rmse_db": [2.25, 2.75] } });
    std::fs::write(runs.join("answers/compared.json"), scores.to_string()).unwrap();
    // A summary that was changed, one that is none, one that is gone; a table that was cut off, and a recording that is gone.
    for name in ["changed", "damaged", "headless", "cut", "unplayable"] {
        std::fs::create_dir(runs.join(name)).unwrap();
        for file in std::fs::read_dir(runs.join("walk")).unwrap() {
            let file = file.unwrap();
            std::fs::copy(file.path(), runs.join(name).join(file.file_name())).unwrap();
        }
    }
    let summary = runs.join("changed/summary.json");
    let text = std::fs::read_to_string(&summary).unwrap();
    std::fs::write(&summary, text.replace("\"seed\": 3", "\"seed\": 4")).unwrap();
    std::fs::write(runs.join("damaged/summary.json"), "{").unwrap();
    std::fs::remove_file(runs.join("damaged/provenance.json")).unwrap();
    std::fs::remove_file(runs.join("headless/summary.json")).unwrap();
    std::fs::remove_file(runs.join("unplayable/run.mcap")).unwrap();
    let table = std::fs::File::options().write(true).open(runs.join("cut/steps.parquet")).unwrap();
    table.set_len(1000).unwrap();

    let opened = Opened::start(folder.path(), &[]);
    let rows = opened.rows();
    let mut listed: Vec<[&str; 3]> = rows
        .iter()
        .map(|row| ["name", "kind", "status"].map(|key| row[key].as_str().unwrap()))
        .collect();
    listed.sort_unstable();
    let expected = [
        ["answers/compared.json", "compare", "complete"],
        ["answers/lab.json", "diagnose", "complete"],
        ["changed", "result", "changed"],
        ["cut", "run", "changed"],
        ["damaged", "result", "unverified"],
        ["headless", "run", "damaged"],
        ["lost", "run", "failed"],
        ["near", "run", "complete"],
        ["swept", "sweep", "complete"],
        ["unplayable", "run", "changed"],
        ["walk", "run", "complete"],
    ];
    assert_eq!(listed, expected);

    let summary: Value =
        serde_json::from_slice(&std::fs::read(runs.join("near/summary.json")).unwrap()).unwrap();
    let provenance: Value =
        serde_json::from_slice(&std::fs::read(runs.join("near/provenance.json")).unwrap()).unwrap();
    let near = opened.row("near");
    assert_eq!(near["seed"], 3);
    let first = summary["task"]["first_figure"].as_str().unwrap().strip_prefix("task.").unwrap();
    assert_eq!(near["first"]["value"], summary["task"][first]);
    assert_eq!(near["figures"]["broadcast_pdr"], summary["network"]["delivery_ratio"]);
    assert_eq!(near["figures"]["collisions"].as_f64(), summary["task"]["collisions"].as_f64());
    assert_eq!(near["n_warnings"], summary["warnings"].as_array().unwrap().len());
    let ended =
        provenance["started_unix_s"].as_f64().unwrap() + provenance["wall_s"].as_f64().unwrap();
    assert_eq!(near["when_unix_s"].as_f64().unwrap(), ended);
    // Only what differs between the runs, the failed one included.
    assert_eq!(near["settings"]["netsim.phy.radius_m"], 3.0);
    assert_eq!(opened.row("walk")["settings"]["netsim.phy.radius_m"], 12.0);
    assert!(near["settings"].get("robotsim.controller.kind").is_none(), "{near}");
    assert!(near["settings"].get("experiment.name").is_none(), "{near}");

    let sweep = opened.row("swept");
    let summary: Value =
        serde_json::from_slice(&std::fs::read(runs.join("swept/summary.json")).unwrap()).unwrap();
    let medians: Vec<&Value> = summary["settings"]
        .as_array()
        .unwrap()
        .iter()
        .map(|setting| &setting["metrics"]["flock_speed"]["median"])
        .collect();
    assert_eq!(sweep["spark"], json!(medians));
    assert_eq!(sweep["words"], "4 trials of 2 settings over netsim.phy.radius_m");
    assert_eq!(sweep["varied"], json!({ "netsim.phy.radius_m": [3.0, 12.0] }));
    let of_setting = |number: usize| medians[number].as_f64().unwrap();
    let best = if of_setting(0) < of_setting(1) { "12" } else { "3" };
    let words = sweep["first"]["words"].as_str().unwrap();
    assert!(words.ends_with(&format!(", best: radius_m {best}")), "{words}");

    let lost = opened.row("lost");
    assert!(lost["words"].as_str().unwrap().contains("robotsim"), "{lost}");
    let answer = opened.row("answers/lab.json");
    assert_eq!(
        (&answer["words"], &answer["n_warnings"]),
        (&json!("The model lacks a wall."), &json!(1))
    );
    assert_eq!(answer["spark"], json!([6.5, 3.25]));
    let compared = opened.row("answers/compared.json");
    assert_eq!(
        (&compared["first"]["value"], &compared["first"]["unit"]),
        (&json!(2.5), &json!("dB"))
    );
    assert_eq!(compared["details"], json!([["bias_db", "1"], ["rmse_db", "2.5 (2.25 to 2.75)"]]));
    // What is left of a result can still be read.
    let cut = opened.row("cut");
    assert!(cut["words"].as_str().unwrap().starts_with("steps.parquet has 1000 bytes"), "{cut}");
    assert_eq!((&cut["has_series"], &cut["has_recording"]), (&json!(false), &json!(true)));
    assert_eq!(cut["first"], opened.row("walk")["first"]);
    assert_eq!(opened.row("unplayable")["words"], "run.mcap is missing");
    assert_eq!(opened.row("headless")["words"], "summary.json is missing");
    // A sweep whose journal is cut off while the table is shown.
    let journal = runs.join("swept/trials.jsonl");
    let text = std::fs::read_to_string(&journal).unwrap();
    std::fs::write(&journal, text.split_inclusive('\n').take(3).collect::<String>()).unwrap();
    wait_until("the cut journal is not noticed", || opened.row("swept")["status"] == "changed");
    let words = opened.row("swept")["words"].clone();
    assert!(words.as_str().unwrap().contains("trials.jsonl holds 3 trials of 4"), "{words}");
    let changed = opened.row("changed");
    assert!(changed["words"].as_str().unwrap().contains("summary.json"), "{changed}");
    assert!(changed["first"].is_null(), "{changed}");

    // With --unverified the changed one is read as it is.
    drop(opened);
    let opened = Opened::start(folder.path(), &["--unverified"]);
    assert_eq!(opened.row("changed")["seed"], 4);
    assert_eq!(opened.row("damaged")["status"], "damaged");
}

#[test]
fn series_are_those_of_the_table_of_the_run() {
    let folder = two_runs();
    let opened = Opened::start(folder.path(), &["runs"]);
    let id = &opened.row("walk")["id"];
    let series = opened.json(&format!("/api/series?id={id}&points=600"));
    let times = series["time_s"].as_array().unwrap();
    assert_eq!(times.len(), 20);
    assert_eq!((times[0].as_f64(), times[19].as_f64()), (Some(0.1), Some(2.0)));
    // The figure of the run has the mean over the same steps.
    let summary = std::fs::read(folder.path().join("runs/walk/summary.json")).unwrap();
    let summary: Value = serde_json::from_slice(&summary).unwrap();
    let mean = |name: &str| {
        let values = series["values"][name].as_array().unwrap();
        values.iter().map(|value| value.as_f64().unwrap()).sum::<f64>() / values.len() as f64
    };
    for (name, figure) in [
        ("flock_speed", &summary["task"]["flock_speed_mps"]),
        ("speed", &summary["task"]["mean_speed_mps"]),
        ("neighbours", &summary["network"]["mean_neighbours_heard"]),
    ] {
        let figure = figure.as_f64().unwrap();
        assert!((mean(name) - figure).abs() < 1e-3 * figure, "{name}: {} {figure}", mean(name));
    }
    for name in ["flock_speed", "speed", "spread"] {
        let own = series["means"][name].as_f64().unwrap();
        assert!((own - mean(name)).abs() < 1e-4 * own, "{name}: {own} {}", mean(name));
    }
    assert_eq!(series["robots_started_s"], 0.0);
    let few = opened.json(&format!("/api/series?id={id}&points=5"));
    assert_eq!(few["means"], series["means"]);
    assert_eq!(few["time_s"].as_array().unwrap().len(), 5);
    // Of a run whose table was changed there are none, and it says why.
    let table = folder.path().join("runs/near/steps.parquet");
    let mut content = std::fs::read(&table).unwrap();
    let middle = content.len() / 2;
    content[middle] ^= 1;
    std::fs::write(&table, content).unwrap();
    let id = &opened.row("near")["id"];
    let Answer(status, _, text) = opened.get(&format!("/api/series?id={id}&points=60"));
    assert_eq!(status, 409);
    assert!(text.contains("steps.parquet"), "{text}");
    // From then on the table shows it.
    let near = opened.row("near");
    assert_eq!((&near["status"], &near["has_series"]), (&json!("changed"), &json!(false)));
}

#[test]
fn the_time_of_a_network_that_forms_is_known_and_not_averaged() {
    let folder = tests::folder();
    let forming = EXPERIMENT.replace("[netsim.phy]", "[netsim]\nmode = \"6tisch\"\n[netsim.phy]");
    std::fs::write(folder.path().join("walk.toml"), forming).unwrap();
    succeeded(&["run", "walk.toml"], folder.path());
    let opened = Opened::start(folder.path(), &[]);
    let id = &opened.row("walk")["id"];
    let series = opened.json(&format!("/api/series?id={id}&points=600"));
    let summary = std::fs::read(folder.path().join("runs/walk/summary.json")).unwrap();
    let summary: Value = serde_json::from_slice(&summary).unwrap();
    let started_s = summary["robots_started_s"].as_f64().unwrap();
    assert!(1.0 < started_s, "{started_s}");
    assert_eq!(series["robots_started_s"], started_s);
    // All steps of the robots are there, however long the network took.
    let times = series["time_s"].as_array().unwrap();
    assert_eq!(times.iter().filter(|time| started_s + 1e-6 < time.as_f64().unwrap()).count(), 20);
    let speed = summary["task"]["flock_speed_mps"].as_f64().unwrap();
    let mean = series["means"]["flock_speed"].as_f64().unwrap();
    assert!((mean - speed).abs() < 1e-3 * speed, "{mean} {speed}");
}

#[test]
fn who_has_no_token_or_comes_from_another_site_is_refused() {
    let folder = two_runs();
    let opened = Opened::start(folder.path(), &["runs"]);
    let id = opened.row("walk")["id"].clone();
    let calls = [
        "/api/about",
        "/api/rows?since=0",
        &format!("/api/series?id={id}&points=60"),
        &format!("/play/{id}/api/runs"),
    ];
    for call in calls {
        assert_eq!(opened.get(call).0, 200, "{call}");
        assert_eq!(opened.get_with(call, &[]).0, 401, "{call}");
        let wrong = format!("Bearer {}", "0".repeat(opened.token.len()));
        assert_eq!(opened.get_with(call, &[("Authorization", &wrong)]).0, 401, "{call}");
        let token = format!("Bearer {}", opened.token);
        let elsewhere = [("Authorization", &*token), ("Origin", "http://example.org")];
        assert_eq!(opened.get_with(call, &elsewhere).0, 403, "{call}");
        let host = [("Authorization", &*token), ("Host", "example.org")];
        assert_eq!(opened.get_with(call, &host).0, 403, "{call}");
    }
    // The page itself has nothing that is secret. A report has a key of its own.
    let Answer(status, head, page) = opened.get_with("/", &[]);
    assert_eq!(status, 200);
    assert!(head.contains("script-src 'self'") && page.contains("runs.js"), "{head}{page}");
    let report = format!("/{}", opened.row("walk")["report"].as_str().unwrap());
    let Answer(status, head, page) = opened.get_with(&report, &[]);
    assert_eq!(status, 200, "{page}");
    assert!(head.contains("content-security-policy: sandbox allow-scripts"), "{head}");
    let written = std::fs::read_to_string(folder.path().join("runs/walk/report.html")).unwrap();
    assert_eq!(page, written);
    let other = report.replace(&format!("/{id}/"), &format!("/{}/", opened.row("near")["id"]));
    assert_eq!(opened.get_with(&other, &[]).0, 401);
    assert!(!opened.json("/api/rows?since=0").to_string().contains(&opened.token));
}

#[test]
fn nothing_outside_of_the_folder_is_served() {
    let folder = two_runs();
    std::fs::write(folder.path().join("secret.html"), "secret").unwrap();
    let runs = folder.path().join("runs");
    let report = runs.join("near/report.html");
    std::fs::remove_file(&report).unwrap();
    std::os::unix::fs::symlink(folder.path().join("secret.html"), &report).unwrap();
    std::os::unix::fs::symlink(folder.path(), runs.join("up")).unwrap();
    let opened = Opened::start(folder.path(), &["runs", "--unverified"]);
    let rows = opened.rows();
    assert_eq!(rows.len(), 2, "{rows:?}");
    assert!(opened.row("near")["report"].is_null());
    // The key is that of another page.
    let path = opened.row("walk")["report"].as_str().unwrap().to_owned();
    let (_, key) = path.rsplit_once('/').unwrap();
    for escaping in [
        format!("/report/{}/{key}", opened.row("near")["id"]),
        format!("/{path}/../../../../secret.html"),
        "/../secret.html".to_owned(),
        "/report/..%2f..%2fsecret.html/x".to_owned(),
        "/play/1/..%2f..%2fsecret.html".to_owned(),
        "/play/1/api/runs/..%2f..%2fsecret.html/frames".to_owned(),
        "/secret.html".to_owned(),
    ] {
        let Answer(status, _, content) = opened.get(&escaping);
        assert!((400..500).contains(&status), "{escaping}: {status}");
        assert!(!content.contains("secret\n") && content != "secret", "{escaping}: {content}");
    }
    for (wrong, words) in [
        ("/api/series?id=x&points=60", "id: must be a whole number"),
        ("/api/series?id=99&points=60", "no result 99"),
        ("/api/series?id=1&points=601", "points: must be a whole number from 0 to 600"),
        ("/api/rows", "since: must be a whole number"),
        ("/api/none", "no such call"),
        ("/play/99/api/runs", "no result 99"),
    ] {
        let Answer(status, _, content) = opened.get(wrong);
        assert!(status == 400 || status == 404, "{wrong}: {status}");
        assert!(content.contains(words), "{wrong}: {content}");
    }
}

#[test]
fn a_run_that_is_being_recorded_appears_with_its_progress_and_becomes_complete() {
    let folder = two_runs();
    let opened = Opened::start(folder.path(), &["runs"]);
    let known = opened.json("/api/rows?since=0")["change"].as_u64().unwrap();
    let set = ["--set", "experiment.name=long", "--set", "experiment.duration_s=1e7"];
    let mut command = Command::new(tests::executable("murmuration"));
    let run = tests::spawn(command.args([&["run", "walk.toml"], &set[..]].concat()), folder.path());
    wait_until_recording(&folder.path().join("runs"));
    let mut row = Value::Null;
    wait_until("the run does not appear", || {
        let changes = opened.json(&format!("/api/rows?since={known}"));
        let rows = changes["rows"].as_array().unwrap().clone();
        row = rows.into_iter().find(|row| row["name"] == "long").unwrap_or_default();
        row["progress"]["of"] == 100_000_000
    });
    assert_eq!(
        (&row["kind"], &row["status"], &row["seed"]),
        (&json!("run"), &json!("running"), &json!(3))
    );
    // It has series before it ends, and keeps the time at which it began.
    let began = row["when_unix_s"].clone();
    let path = format!("/api/series?id={}&points=600", row["id"]);
    wait_until("the run has no series", || opened.get(&path).0 == 200);
    let series = opened.json(&path);
    assert_eq!(series["time_s"].as_array().unwrap()[0], 0.1);
    assert!(series["means"]["flock_speed"].as_f64().is_some(), "{series}");
    wait_until("the run does not go on", || {
        let row = opened.row("long");
        assert_eq!(row["when_unix_s"], began);
        10 < row["progress"]["done"].as_u64().unwrap()
    });
    signal("-INT", run.id());
    let _ = tests::end_of(run);
    let running = row["id"].clone();
    let mut changes = Value::Null;
    wait_until("the run does not end", || {
        changes = opened.json(&format!("/api/rows?since={known}"));
        let rows = changes["rows"].as_array().unwrap();
        rows.iter().any(|row| row["name"] == "long" && row["status"] == "interrupted")
    });
    assert!(changes["removed"].as_array().unwrap().contains(&running), "{changes}");

    // One that is killed stays, with what to do.
    let mut command = Command::new(tests::executable("murmuration"));
    let set = ["--set", "experiment.name=killed", "--set", "experiment.duration_s=1e7"];
    let mut run =
        tests::spawn(command.args([&["run", "walk.toml"], &set[..]].concat()), folder.path());
    wait_until_recording(&folder.path().join("runs"));
    wait_until("no step of the run is recorded", || {
        let rows = opened.rows();
        rows.iter().any(|row| {
            row["name"] == "killed" && row["progress"]["done"] != 0 && row["has_series"] == true
        })
    });
    run.kill().unwrap();
    run.wait().unwrap();
    let mut row = Value::Null;
    wait_until("the killed run is not listed as stopped", || {
        row = opened.rows().into_iter().find(|row| row["name"] == "killed").unwrap_or_default();
        row["status"] == "stopped"
    });
    // The command is for the folder in which `open` was started, and what was recorded is counted.
    let command = row["command"].as_str().unwrap();
    let words: Vec<&str> = command.split(' ').collect();
    assert!(words[2].starts_with("runs/.killed.partial-"), "{row}");
    let done = row["progress"]["done"].as_u64().unwrap();
    assert!(0 < done, "{row}");
    succeeded(&words[1..], folder.path());
    wait_until("what was recovered is not listed", || {
        row = opened.rows().into_iter().find(|row| row["name"] == "killed").unwrap_or_default();
        row["status"] == "interrupted"
    });
    let reason = row["words"].as_str().unwrap();
    assert!(reason.contains(&format!("up to step {done}")), "{reason} {done}");
    // The other runs have not changed, and are not sent again.
    let last = opened.json("/api/rows?since=0")["change"].clone();
    assert_eq!(opened.json(&format!("/api/rows?since={last}"))["rows"], json!([]));
}

#[test]
fn a_folder_without_results_is_refused_with_what_to_do() {
    let folder = tests::folder();
    std::fs::create_dir_all(folder.path().join("runs/empty")).unwrap();
    std::fs::write(folder.path().join("file"), "").unwrap();
    for (args, words) in [
        (&["open"][..], "runs: holds no run, sweep or answer; `murmuration run experiment.toml`"),
        (&["open", "rums"], "rums: does not exist (nearest: runs)"),
        (&["open", "file"], "file: is a file; give a folder of results, such as runs"),
    ] {
        let output = orchestrator(args, folder.path());
        assert_eq!(output.status.code(), Some(2), "{args:?}: {}", said(&output));
        assert!(said(&output).contains(words), "{args:?}: {}", said(&output));
    }
}
