//! Rooms explored over the full network: maps go up, waypoints come down, and nothing goes where it cannot.

use serde_json::Value;
use std::path::Path;

/// The summary of `configs/exploration.toml` with some keys set.
fn explored(folder: &Path, more: &[&str]) -> Value {
    let config = tests::repository().join("configs/exploration.toml");
    let always = ["--set", "netsim.mac.beacon_wait_s=5.0", "--set", "output.links=none"];
    let dir = tests::run(&config, folder, &[&always[..], more].concat());
    serde_json::from_slice(&std::fs::read(dir.join("summary.json")).unwrap()).unwrap()
}

fn figure(summary: &Value, name: &str) -> f64 {
    summary["task"][name].as_f64().unwrap_or_else(|| panic!("{name}: {}", summary["task"]))
}

#[test]
fn the_whole_area_comes_to_the_base_over_the_network() {
    let folder = tests::folder();
    let summary = explored(folder.path(), &[]);
    assert_eq!(summary["task"]["complete"], true, "{}", summary["task"]);
    assert_eq!(figure(&summary, "mapped_ratio"), 1.0);
    assert_eq!(figure(&summary, "seen_ratio"), 1.0);
    assert!(figure(&summary, "mapped_90_s") < summary["simulated_s"].as_f64().unwrap());
    assert!(0.0 < figure(&summary, "map_delay_s") && 0.0 < figure(&summary, "map_age_s"));
    // Nobody broadcasts, and each order came from the base: what was sent are messages of either way.
    let n_sent = summary["network"]["transmissions"].as_f64().unwrap();
    let n_said = figure(&summary, "map_reports") + figure(&summary, "waypoint_orders");
    assert!(0.5 * n_said < n_sent && n_sent <= n_said, "{n_sent} of {n_said} arrived");
}

#[test]
fn what_the_network_costs_shows_against_the_truth() {
    let folder = tests::folder();
    let quick = ["--set", "experiment.duration_s=60.0"];
    let heard = explored(folder.path(), &quick);
    let told =
        [&quick[..], &["--set", "robotsim.knowledge=truth", "--set", "experiment.name=told"]];
    let told = explored(folder.path(), &told.concat());
    assert_eq!(told["baseline"], "truth baseline");
    assert_eq!(figure(&told, "map_delay_s"), 0.0);
    assert_eq!(told["network"]["transmissions"], 0);
    assert!(figure(&heard, "mapped_ratio") < figure(&told, "mapped_ratio"));
}

#[test]
fn with_the_bases_radio_dead_nothing_arrives_and_the_robots_stay() {
    let folder = tests::folder();
    let config = std::fs::read_to_string(tests::repository().join("configs/exploration.toml"));
    let places = tests::repository().join("configs/exploration.csv");
    std::fs::copy(places, folder.path().join("exploration.csv")).unwrap();
    let order = "[[timeline]]\nat_s = 0.0\norder = \"kill\"\nmotes = [0]\n";
    let dead = folder.path().join("dead.toml");
    std::fs::write(&dead, format!("{}\n{order}", config.unwrap())).unwrap();
    let args = ["--set", "netsim.mac.beacon_wait_s=5.0", "--set", "experiment.duration_s=60.0"];
    let dir = tests::run(&dead, folder.path(), &args);
    let summary: Value =
        serde_json::from_slice(&std::fs::read(dir.join("summary.json")).unwrap()).unwrap();
    assert_eq!(summary["network"]["deliveries"], 0);
    assert_eq!(figure(&summary, "mean_speed_mps"), 0.0);
    assert_eq!(figure(&summary, "map_delay_s"), 0.0, "on the map is what the base sees itself");
    assert!(figure(&summary, "mapped_ratio") <= figure(&summary, "seen_ratio"));
    assert!(0.0 < figure(&summary, "map_reports_repeated"));
}

#[test]
fn a_network_that_does_not_route_both_ways_is_refused() {
    let folder = tests::folder();
    let config = tests::repository().join("configs/exploration.toml");
    let said = |key: &str| {
        let args = ["run", config.to_str().unwrap(), "--set", key];
        let output = tests::orchestrator(&args, folder.path());
        assert_eq!(output.status.code(), Some(2), "{}", tests::said(&output));
        String::from_utf8_lossy(&output.stderr).into_owned()
    };
    let broadcast = said("netsim={ phy = { propagation = \"full\" } }");
    assert!(
        broadcast.contains(
            "robotsim.controller.kind: requires a network that routes messages, which netsim.mode = \
             \"propagation-only\" does not, or knowledge = \"truth\""
        ),
        "{broadcast}"
    );
    let up_alone = said("netsim.rpl.routes_down=false");
    assert!(
        up_alone.contains("netsim.rpl.routes_down: must be true with the controller"),
        "{up_alone}"
    );
}
