//! Robots that act on their links.

use serde_json::Value;

/// The summary of `configs/dispersion.toml` with another floor of the links' strength.
fn dispersed(rssi_floor_dbm: &str) -> Value {
    let folder = tests::folder();
    let config = tests::repository().join("configs/dispersion.toml");
    let floor = format!("robotsim.controller.rssi_floor_dbm={rssi_floor_dbm}");
    let args =
        ["--set", &floor, "--set", "netsim.mac.beacon_wait_s=5.0", "--set", "output.links=none"];
    let dir = tests::run(&config, folder.path(), &args);
    serde_json::from_slice(&std::fs::read(dir.join("summary.json")).unwrap()).unwrap()
}

#[test]
fn robots_that_heed_their_links_spread_and_stay_together_and_those_that_do_not_lose_each_other() {
    let (heeding, heedless) = (dispersed("-88.0"), dispersed("-300.0"));
    let spread_m = |summary: &Value| summary["task"]["final_spread_m"].as_f64().unwrap();
    let fragments = |summary: &Value| summary["task"]["final_fragments"].as_u64().unwrap();
    // Twenty robots on a grid of 2 m begin with 3.5 m.
    assert!(7.0 < spread_m(&heeding), "{}", spread_m(&heeding));
    assert!(spread_m(&heeding) < spread_m(&heedless));
    assert!(
        fragments(&heeding) < fragments(&heedless),
        "{} {}",
        fragments(&heeding),
        fragments(&heedless)
    );
}
