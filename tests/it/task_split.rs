//! Where the error of a swarm's task comes from: the network or the robots. What is measured is left by a run of the real
//! processes, of a model with a fault in one of the two: places, and who heard whom.

use diagnose::{Observer, Unobserved};
use experiment::Consent;
use measure::memory::MemoryBudget;
use network::resimulate::ResimulationError;
use network::task::comparison::TaskComparison;
use network::{ComparisonOptions, TaskFiles, TaskRequest, Worded};
use serde_json::Value;
use std::fmt::Write as _;
use study::StopFlag;
use tests::{folder, orchestrator, run, said};

/// Eight robots follow a leader over a radio that loses one frame in three or so.
const MODEL: &str = r#"
[experiment]
name = "flock"
seed = 4
duration_s = 20.0
agents = 8

[output]
report = false

[robotsim.scenario]
kind = "line"
spacing_m = 4.0

[robotsim.controller]
kind = "flocking"
flock_radius_m = 20.0

[netsim.phy]
propagation = "log-distance"
exponent = 3.6
tx_power_dbm = -5.0

# here
"#;

/// What a swarm with a fault left, split by the model without it; under another seed, if so.
fn parts(fault: &str, seed: u64) -> Worded<TaskComparison> {
    let dir = folder();
    let truth = dir.path().join("truth.toml");
    std::fs::write(&truth, MODEL.replace("# here", fault)).unwrap();
    let out = run(&truth, dir.path(), &["--seed", &seed.to_string()]);
    let model = dir.path().join("model.toml");
    std::fs::write(&model, MODEL).unwrap();
    let files = TaskFiles {
        config: &model,
        set: &[],
        consent: &Consent::default(),
        data: &out,
        heard: &out,
        reading: MemoryBudget::default().into(),
    };
    let options = ComparisonOptions { seeds: 99, ..ComparisonOptions::default() };
    network::task(&TaskRequest::open(&files, options).unwrap(), &Unobserved).unwrap()
}

/// Stops the work before it begins.
#[derive(Default)]
struct Stopping(StopFlag);

impl Observer for Stopping {
    fn stop_flag(&self) -> Option<&StopFlag> {
        Some(&self.0)
    }
}

#[test]
fn each_fault_goes_with_its_part_and_none_with_none() {
    for (fault, expected) in [
        ("", [false, false]),
        ("[[robotsim.dynamics.effect]]\nkind = \"slip\"\nscale = 0.8", [false, true]),
        ("[[netsim.phy.effect]]\nkind = \"system-gain\"\ngain_db = -12.0", [true, false]),
    ] {
        let Worded { answer, text } = parts(fault, 5);
        let split = answer.error_split;
        let found = split.parts.map(|part| part.is_distinguishable);
        assert_eq!(found, expected, "{fault}\n{text}");
        // Robots that are right do with what was heard what was measured, to what the tables round.
        let off_m = split.places_off_m.with_what_was_heard;
        assert_eq!(off_m < 1e-6, !expected[1], "{fault}\n{text}");
        // The parts add up to the error.
        assert!(!split.figures.is_empty());
        for figure in split.figures {
            let parts = figure.parts.values().map(|part| part.map_or(f64::NAN, |part| part.value));
            let error = figure.measured - figure.whole;
            let sum: f64 = parts.sum();
            let name = figure.name;
            assert!(error.is_nan() || (sum - error).abs() < 1e-9 * (1.0 + error.abs()), "{name}");
        }
    }
}

#[test]
fn the_command_splits_what_csv_files_say_and_refuses_what_cannot_be_split() {
    let dir = folder();
    let write = |name: &str, text: &str| std::fs::write(dir.path().join(name), text).unwrap();
    write("model.toml", MODEL);
    let slip = "[[robotsim.dynamics.effect]]\nkind = \"slip\"\nscale = 0.8";
    write("truth.toml", &MODEL.replace("# here", slip));
    let out = run(&dir.path().join("truth.toml"), dir.path(), &[]);
    let table = |name: &str| {
        measure::table::DataTable::read(&out.join(name), MemoryBudget::default()).unwrap()
    };
    // As robots would log it: clocks began 100 s before the task.
    let (steps, links) = (table("steps.parquet"), table("links.parquet"));
    let mut robots = "time_s,agent,x_m,y_m\n".to_owned();
    let cell = |name: &str, row: usize| steps.column(name).unwrap()[row];
    for row in 0..steps.n_rows() {
        let time_s = 100.0 + cell("time_ns", row) * 1e-9;
        writeln!(
            robots,
            "{time_s},{},{},{}",
            cell("agent", row),
            cell("x_m", row),
            cell("y_m", row)
        )
        .unwrap();
    }
    write("robots.csv", &robots);
    let mut heard = "time_s,source,destination,received_s\n".to_owned();
    let cell = |name: &str, row: usize| links.column(name).unwrap()[row];
    for row in 0..links.n_rows() {
        let [sent_s, received_s] =
            ["sent_ns", "received_ns"].map(|name| 100.0 + cell(name, row) * 1e-9);
        writeln!(heard, "{sent_s},{},{},{received_s}", cell("sender", row), cell("receiver", row))
            .unwrap();
    }
    write("heard.csv", &heard);
    let path = |name: &str| dir.path().join(name);
    let [config, data, received] = ["model.toml", "robots.csv", "heard.csv"].map(path);
    let files = TaskFiles {
        config: &config,
        set: &[],
        consent: &Consent::default(),
        data: &data,
        heard: &received,
        reading: MemoryBudget::default().into(),
    };
    let request = TaskRequest::open(&files, ComparisonOptions { seeds: 99, from_s: 100.0 });
    let stopping = Stopping::default();
    stopping.0.set();
    let stopped = network::task(&request.unwrap(), &stopping);
    assert!(matches!(stopped, Err(ResimulationError::Stopped)), "{stopped:?}");
    let asked = |more: &[&str]| {
        let args = [
            "compare",
            "model.toml",
            "--data",
            "robots.csv",
            "--heard",
            "heard.csv",
            "--from",
            "100",
        ];
        orchestrator(&[&args[..], more].concat(), dir.path())
    };
    let output = asked(&["--seeds", "99", "--json", "s.json", "--report", "s.html"]);
    assert!(output.status.success(), "{}", said(&output));
    let terminal = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(terminal.contains("The robots cause the error"), "{terminal}");
    let read = |name: &str| std::fs::read_to_string(dir.path().join(name)).unwrap();
    let json: Value = serde_json::from_str(&read("s.json")).unwrap();
    assert_eq!((&json["schema"], &json["kind"]), (&"compare/1".into(), &"task".into()));
    assert_eq!(json["verdict"], "robot", "{}", json["sentence"]);
    let split = &json["error_split"];
    assert_eq!(split["order"].as_array().unwrap(), &["network", "robot"]);
    let speed = &split["figures"].as_array().unwrap()[0];
    assert_eq!(speed["name"], "mean_speed_mps");
    // Wheels that slip by a fifth cost at least about that much of the speed, and it is the robots'.
    let number = |value: &Value| value.as_f64().unwrap();
    let share = number(&speed["parts"]["robot"]["value"]) / number(&speed["with_what_was_heard"]);
    assert!((-0.5..-0.15).contains(&share), "{share}");
    let page = read("s.html");
    assert!(page.contains("Network or robot?") && !tests::without_scripts(&page).contains("NaN"));
    write("far.csv", &heard.replace(",7,", ",17,"));
    for (args, part) in [
        (&["--seeds", "50"][..], "at least 99"),
        (&["--split", "time"], "--split time"),
        (&["--from", "500"], "no position after"),
        (&["--heard", "far.csv"], "agent 17"),
    ] {
        let mut all = vec!["compare", "model.toml", "--data", "robots.csv"];
        if !args.contains(&"--heard") {
            all.extend(["--heard", "heard.csv"]);
        }
        all.extend(args);
        let output = orchestrator(&all, dir.path());
        assert_eq!(output.status.code(), Some(2), "{args:?}: {}", said(&output));
        assert!(said(&output).contains(part), "{args:?}: {}", said(&output));
    }
}
