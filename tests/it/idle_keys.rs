//! Keys that are written and have no influence, because of what other keys say: `check`, `run` and `sweep` warn of them.

use std::path::{Path, PathBuf};
use tests::{folder, orchestrator, said};

/// What a command says of an experiment, which must be valid.
fn told(verb: &str, text: &str, folder: &Path) -> String {
    std::fs::write(folder.join("x.toml"), text).unwrap();
    let output = orchestrator(&[verb, "x.toml"], folder);
    assert!(output.status.success(), "{}", said(&output));
    said(&output)
}

const EXPERIMENT: &str = "[experiment]\nname = \"x\"\nseed = 1\nduration_s = 1.0\nagents = 3\n\
    control_period = { rate_hz = 10.0 }\n\
    [robotsim.controller]\nkind = \"hold\"\n";
const LINE: &str = "[robotsim.scenario]\nkind = \"line\"\nspacing_m = 2.0\n";
const SECOND: &str = "[netsim.phy]\ntx_power_dbm = 0.0\n\
    [netsim.second_medium]\nkind = \"wifi-broadcast\"\npayloads = \"second\"\n";
const POWER: &str = "warning: netsim.phy.tx_power_dbm has no influence: with netsim.second_medium.payloads = \"second\"";

#[test]
fn a_power_that_carries_no_payloads_is_warned_of() {
    let dir = folder();
    let text = format!("{EXPERIMENT}{LINE}{SECOND}");
    for verb in ["check", "run"] {
        let said = told(verb, &text, dir.path());
        assert!(said.contains(POWER), "{said}");
        assert!(said.contains("set netsim.second_medium.payloads = \"both\""), "{said}");
    }
    // The run's own configuration has all defaults, which nobody asked for.
    let own = std::fs::read_to_string(dir.path().join("runs/x/config.toml")).unwrap();
    let said = told("check", &own, dir.path());
    assert!(!said.contains("has no influence"), "{said}");
}

#[test]
fn a_varied_key_without_influence_is_warned_of_unless_it_has_some_in_other_settings() {
    let dir = folder();
    let sweep = "[sweep]\nseeds = 1\n[sweep.vary]\nnetsim.phy.tx_power_dbm = [0.0, 20.0]\n";
    let text = format!("{EXPERIMENT}{LINE}{SECOND}{sweep}");
    let said = told("check", &text, dir.path());
    assert_eq!(said.matches(POWER).count(), 1, "{said}");
    let said = told("sweep", &text, dir.path());
    assert!(said.contains(POWER), "{said}");
    let both = "netsim.second_medium.payloads = [\"second\", \"both\"]\n";
    let said = told("check", &format!("{text}{both}"), dir.path());
    assert!(!said.contains("has no influence"), "{said}");
}

#[test]
fn a_ray_that_the_ground_reflects_needs_antennas_above_it() {
    let dir = folder();
    let effect = "[netsim.phy]\n%\n[[netsim.phy.effect]]\nkind = \"two-ray-ground\"\nrelative_permittivity = 15.0\n";
    let at = |height: &str| effect.replace('%', height);
    let said = told("check", &format!("{EXPERIMENT}{LINE}{}", at("")), dir.path());
    let expected = "netsim.phy.effect[0] (two-ray-ground) has no influence: all antennas are at z = 0; set \
                    netsim.phy.antenna_height_m";
    assert!(said.contains(expected), "{said}");
    let said =
        told("check", &format!("{EXPERIMENT}{LINE}{}", at("antenna_height_m = 0.5")), dir.path());
    assert!(!said.contains("has no influence"), "{said}");
    // Robots that fly need no height of antennas, and a height that is written does not apply.
    std::fs::write(dir.path().join("p.csv"), "agent,x_m,y_m,z_m\n0,0,0,2\n1,3,0,2\n2,6,0,2\n")
        .unwrap();
    let places = "[robotsim.scenario]\nkind = \"csv\"\nfile = \"p.csv\"\n";
    let said = told("check", &format!("{EXPERIMENT}{places}{}", at("")), dir.path());
    assert!(!said.contains("has no influence"), "{said}");
    let said =
        told("check", &format!("{EXPERIMENT}{places}{}", at("antenna_height_m = 0.5")), dir.path());
    assert!(said.contains("netsim.phy.antenna_height_m has no influence"), "{said}");
}

#[test]
fn noise_and_bands_beside_the_channels_in_use_are_warned_of() {
    let dir = folder();
    let network = "[netsim]\nmode = \"6tisch\"\nhopping_sequence = [15, 20]\n\
        [[timeline]]\nat_s = 0.5\norder = \"jam\"\nuntil_s = 0.8\nchannels = %\n";
    let of = |channels: &str| {
        let text = format!("{EXPERIMENT}{LINE}{}", network.replace('%', channels));
        told("check", &text, dir.path())
    };
    let said = of("[11, 26]");
    let expected = "timeline[0].channels has no influence: the network sends on none of these channels; choose some of \
                    netsim.hopping_sequence: 15, 20";
    assert!(said.contains(expected), "{said}");
    assert!(!of("[11, 20]").contains("has no influence"));
}

#[test]
fn keys_of_robots_without_influence_are_warned_of() {
    let dir = folder();
    let flock = |keys: &str| {
        let text =
            EXPERIMENT.replace("kind = \"hold\"\n", "kind = \"flocking\"\nflock_radius_m = 5.0\n%");
        let said = told("check", &format!("{}{LINE}", text.replace('%', keys)), dir.path());
        said.lines().filter(|line| line.contains("has no influence")).count()
    };
    assert_eq!(flock("leader_weight = 3.0\n"), 0);
    assert_eq!(flock("leaderless = true\n"), 0);
    assert_eq!(flock("leaderless = true\nleader_weight = 3.0\nleader_velocity_mps = [1, 0]\n"), 2);
    assert_eq!(flock("leader_path_closed = true\n"), 1);
    let effect = "[[robotsim.dynamics.effect]]\nkind = \"downwash\"\ngain = 0.3\nrange_m = 0.5\n";
    let alone = EXPERIMENT.replace("agents = 3", "agents = 1");
    let said = told("check", &format!("{alone}{LINE}{effect}"), dir.path());
    assert!(said.contains("robotsim.dynamics.effect[0] (downwash) has no influence"), "{said}");
}

/// Configurations in a folder and those below it.
fn configs(folder: PathBuf, found: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            configs(path, found);
        } else if path.extension().is_some_and(|ending| ending == "toml") {
            found.push(path);
        }
    }
}

#[test]
fn every_key_of_the_ready_experiments_has_influence() {
    let dir = folder();
    let mut paths = Vec::new();
    configs(tests::repository().join("configs"), &mut paths);
    assert!(80 < paths.len(), "{}", paths.len());
    for path in paths {
        let output = orchestrator(&["check", path.to_str().unwrap()], dir.path());
        let said = said(&output);
        assert!(output.status.success(), "{said}");
        assert!(!said.contains("has no influence"), "{}: {said}", path.display());
    }
}

#[test]
fn a_run_is_measured_without_alarms_about_its_positions() {
    let dir = folder();
    let config = tests::repository().join("configs/flocking.toml");
    let config = config.to_str().unwrap();
    let output = orchestrator(&["run", config], dir.path());
    assert!(output.status.success(), "{}", said(&output));
    // Robots go several metres in a step, and frames of two steps are 10 ms apart.
    let checked = said(&orchestrator(&["check", config, "--data", "runs/flocking"], dir.path()));
    assert!(checked.contains("10 mobile"), "{checked}");
    assert!(!checked.contains("position jumps"), "{checked}");
}
