//! Robots that come late or are lost, as robots, radio and results see them.

use serde_json::Value;
use std::path::Path;
use tests::{orchestrator, said};

/// Runs an experiment with robots on a line 2 m apart. What it comes to.
fn summary(folder: &Path, agents: usize, duration_s: f64, more: &str) -> Value {
    std::fs::create_dir_all(folder).unwrap();
    let path = folder.join("x.toml");
    let text = format!(
        "[experiment]\nname = \"x\"\nseed = 1\nduration_s = {duration_s:?}\nagents = {agents}\n\
         [robotsim]\nscenario = {{ kind = \"line\", jitter_m = 0.0 }}\ncontroller.kind = \"hold\"\n{more}"
    );
    std::fs::write(&path, text).unwrap();
    let output = orchestrator(&["run", path.to_str().unwrap()], folder);
    assert!(output.status.success(), "{}", said(&output));
    let text = std::fs::read_to_string(folder.join("runs/x/summary.json")).unwrap();
    serde_json::from_str(&text).unwrap()
}

const DISK: &str = "[netsim.phy]\npropagation = \"unit-disk\"\nradius_m = 3.0\n";

#[test]
fn a_lost_robot_is_left_out_of_figures_and_connects_nobody_any_more() {
    let folder = tests::folder();
    let figures = |name: &str, absence: &str| {
        let of_it = summary(&folder.path().join(name), 3, 6.0, &format!("{absence}{DISK}"));
        let task = &of_it["task"];
        let number = |key: &str| task[key].as_f64().unwrap();
        [
            number("fragments"),
            number("final_fragments"),
            number("cohesion_m"),
            number("final_spread_m"),
        ]
    };
    let near = |got: [f64; 4], expected: [f64; 4]| {
        // Sums of sixty steps.
        let close = |(got, expected): (f64, f64)| (got - expected).abs() < 1e-9;
        assert!(got.into_iter().zip(expected).all(close), "{got:?}, not {expected:?}");
    };
    // Robot 0 between 1 and 2: 0, 2 and 2 m from their centroid.
    let spread_m = (8.0f64 / 3.0).sqrt();
    near(figures("all", ""), [1.0, 1.0, 4.0 / 3.0, spread_m]);
    // Without the middle one, two that do not hear each other, each 2 m from their centroid.
    let middle = "[[robotsim.absence]]\nrobots = [0]\n";
    near(figures("two", middle), [2.0, 2.0, 2.0, 2.0]);
    // Without the last one, two that do, each 1 m from it.
    let last = "[[robotsim.absence]]\nrobots = [2]\n";
    near(figures("last", last), [1.0, 1.0, 1.0, 1.0]);
    // The middle one is lost half way: the means are between, the end is without it.
    let [fragments, final_fragments, cohesion_m, end_m] =
        figures("half", &middle.replace("[0]", "[0]\nfrom_s = 3.0"));
    assert!((1.45..1.55).contains(&fragments) && (1.6..1.74).contains(&cohesion_m));
    near([final_fragments, end_m, 0.0, 0.0], [2.0, 2.0, 0.0, 0.0]);
    // One that comes back connects them again.
    let away = middle.replace("[0]", "[0]\nuntil_s = 3.0");
    let [fragments, final_fragments, ..] = figures("back", &away);
    assert!((1.45..1.55).contains(&fragments), "{fragments}");
    near([final_fragments, 0.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0]);
}

#[test]
fn a_network_forms_without_those_that_come_late_and_takes_them_in() {
    let folder = tests::folder();
    let network = "[netsim]\nmode = \"6tisch\"\nmac.beacon_wait_s = 5.0\nsf.kind = \"rrsf\"\n\
                   [netsim.phy]\npropagation = \"full\"\n";
    let late = "[[robotsim.absence]]\nrobots = [3]\nuntil_s = 60.0\n";
    let of_it = summary(folder.path(), 4, 300.0, &format!("{late}{network}"));
    let started_s = of_it["robots_started_s"].as_f64().unwrap();
    let joined = &of_it["kpis"]["joining"]["joined"];
    // All but the root, the last of them when it has come.
    assert_eq!(joined["motes"], 3);
    let last_s = joined["last_s"].as_f64().unwrap();
    assert!(started_s + 60.0 < last_s, "{started_s} {last_s}");
}
