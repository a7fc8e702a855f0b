//! `demo`: a hidden effect is named from the measurements alone, and the page tells how.

use serde_json::Value;
use std::path::Path;
use std::process::{Command, Output, Stdio};
use tests::{end_of, signal, wait_until};

/// Runs a demo in this folder, and returns what it printed and its answer. It shows its progress.
fn demo(args: &[&str], folder: &Path) -> (String, Value) {
    let output = tests::orchestrator(&[&["demo", "--json", "answer.json"], args].concat(), folder);
    assert!(output.status.success(), "{}", tests::said(&output));
    let progress = String::from_utf8(output.stderr).unwrap();
    let begun = |step: &str| progress.lines().position(|line| line.starts_with(step));
    let steps = [1, 2, 3, 4, 5].map(|step| begun(&format!("step {step} of 5: ")).unwrap());
    assert!(steps.is_sorted(), "{progress}");
    let answer = std::fs::read_to_string(folder.join("answer.json")).unwrap();
    (String::from_utf8(output.stdout).unwrap(), serde_json::from_str(&answer).unwrap())
}

fn read(path: &Path) -> String {
    std::fs::read_to_string(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

/// Names of what lies in a folder.
fn entries(folder: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(folder).unwrap();
    let mut names: Vec<String> =
        entries.map(|entry| entry.unwrap().file_name().to_string_lossy().into_owned()).collect();
    names.sort();
    names
}

#[test]
fn a_demo_names_the_hidden_effect_and_shows_what_it_does_to_the_swarm() {
    let dir = tests::folder();
    for (effect, data) in [("wall-attenuation", "links.csv"), ("slip", "tracks.csv")] {
        let (printed, answer) = demo(&["--effect", effect, "--out", effect], dir.path());
        assert_eq!(answer["outcome"], "named", "{printed}");
        assert_eq!(answer["hidden"], effect);
        let estimate = &answer["estimates"][0];
        let number = |key: &str| estimate[key].as_f64().unwrap();
        let off = (number("value") - number("hidden")).abs();
        assert!(off <= 3.0 * (number("high") - number("low")), "{estimate}");
        assert!(answer["error_extended"].as_f64() < answer["error"].as_f64(), "{answer}");
        let speed =
            |swarm: usize| answer["swarms"][swarm]["speed_along_leader_mps"].as_f64().unwrap();
        let [model, better, truth] = [0, 1, 2].map(speed);
        assert!((better - truth).abs() < (model - truth).abs(), "{answer}");
        // The hidden effect is printed after all else.
        let lines: Vec<&str> = printed.lines().collect();
        let verdict = lines.iter().position(|line| line.starts_with("3. ")).unwrap();
        assert!(!lines[..verdict].iter().any(|line| line.contains(effect)), "{printed}");
        assert!(printed.contains(&format!("the hidden effect was {effect}")), "{printed}");

        let folder = dir.path().join(effect);
        let page = read(&folder.join("story.html"));
        for text in ["<svg", "data:image/svg+xml;base64,", effect, data, "What was hidden"] {
            assert!(page.contains(text), "{text}");
        }
        for file in [
            "better.toml",
            "truth.toml",
            "comparison.html",
            "diagnosis.html",
            "runs/truth/report.html",
        ] {
            assert!(folder.join(file).is_file(), "{file}");
        }
    }
}

#[test]
fn the_diagnosis_of_a_demo_depends_on_the_model_and_the_measurements_alone() {
    let dir = tests::folder();
    demo(&["--effect", "system-gain", "--out", "made"], dir.path());
    let alone = dir.path().join("alone");
    std::fs::create_dir(&alone).unwrap();
    for file in ["model.toml", "links.csv"] {
        std::fs::copy(dir.path().join("made").join(file), alone.join(file)).unwrap();
    }
    let args = ["diagnose", "model.toml", "--data", "links.csv", "--json", "diagnosis.json"];
    let output = tests::orchestrator(&args, &alone);
    assert!(output.status.success(), "{}", tests::said(&output));
    let answers =
        ["made", "alone"].map(|folder| read(&dir.path().join(folder).join("diagnosis.json")));
    assert_eq!(answers[0], answers[1]);
    let model = read(&alone.join("model.toml"));
    assert!(!model.contains("effect]]"), "{model}");
}

#[test]
fn a_demo_without_an_effect_finds_none() {
    let dir = tests::folder();
    let (printed, answer) = demo(&["--effect", "none", "--robots", "4"], dir.path());
    assert_eq!(answer["outcome"], "nothing-hidden", "{printed}");
    assert_eq!(answer["hidden"], Value::Null);
    assert_eq!(answer["swarms"].as_array().unwrap().len(), 1);
    assert!(!dir.path().join("demo/better.toml").exists());
    let summary: Value =
        serde_json::from_str(&read(&dir.path().join("demo/runs/model/summary.json"))).unwrap();
    assert_eq!(summary["agent_count"], 4);
}

#[test]
fn the_same_seed_makes_the_same_demo_in_a_folder_of_its_own() {
    let dir = tests::folder();
    let (_, first) = demo(&["--seed", "7"], dir.path());
    let (_, second) = demo(&["--seed", "7"], dir.path());
    assert_eq!([&first["folder"], &second["folder"]], ["demo", "demo-2"]);
    for file in ["model.toml", "truth.toml", "diagnosis.json", "story.html", "runs/truth/run.mcap"]
    {
        let [a, b] = ["demo", "demo-2"]
            .map(|folder| std::fs::read(dir.path().join(folder).join(file)).unwrap());
        assert!(a == b, "{file}");
    }
}

#[test]
fn a_refused_demo_leaves_nothing() {
    let dir = tests::folder();
    std::fs::write(dir.path().join("taken"), "mine").unwrap();
    let refused = |args: &[&str], expected: &[&str]| {
        let output: Output = tests::orchestrator(&[&["demo"], args].concat(), dir.path());
        let said = tests::said(&output);
        assert_eq!(output.status.code(), Some(2), "{said}");
        for text in expected {
            assert!(said.contains(text), "{text}: {said}");
        }
    };
    refused(&["--out", "taken"], &["taken: exists already", "--out"]);
    refused(&["--out", "nowhere/demo"], &["the folder nowhere does not exist"]);
    refused(&["--effect", "gremlins"], &["--effect", "gremlins", "wall-attenuation", "none"]);
    refused(&["--robots", "1"], &["--robots", "2..=100"]);
    refused(&["--json", "nowhere/answer.json"], &["--json nowhere/answer.json"]);
    assert_eq!(entries(dir.path()), ["taken"]);
}

#[test]
fn an_interrupted_demo_leaves_nothing() {
    let dir = tests::folder();
    let child = Command::new(tests::executable("murmuration"))
        .args(["demo", "--effect", "dead-time"])
        .current_dir(dir.path())
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    // Once the folder is there, signals are listened for, and the work has begun.
    wait_until("the demo did not begin", || {
        let made = std::fs::read_dir(dir.path()).unwrap().next();
        made.is_some_and(|made| made.unwrap().path().join("model.toml").exists())
    });
    signal("-INT", child.id());
    assert_eq!(end_of(child).status.code(), Some(1));
    assert_eq!(entries(dir.path()), [""; 0]);
}
