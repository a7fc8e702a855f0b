//! The texts of refusals, and what a configuration becomes when defaults are filled in.

use crate::air::setup;
use proto::side::RobotSimulator as _;
use robotsim::catalogue::Catalogue;
use robotsim::config;
use robotsim::sim::Swarm;

/// What is wrong with a configuration of five agents, one problem per line.
fn refusal(toml: &str, csv: Option<&str>) -> String {
    let mut setup = setup(toml, 5, 1);
    if let Some(csv) = csv {
        setup.files.insert("places.csv".to_owned(), csv.as_bytes().to_vec().into());
    }
    let problems = config::read(&setup, Catalogue::built_in()).expect_err("it is wrong");
    problems.iter().map(ToString::to_string).collect::<Vec<_>>().join("\n")
}

#[test]
fn every_problem_is_found_at_once() {
    let refused = refusal(
        "knowledge = 'herd'
        [dynamics]
        speed_cap_mps = -30
        cap = 'axes'
        [scenario]
        kind = 'line'
        spacing_m = 2
        jitter_m = 1.5
        spaceing_m = 3
        [controller]
        kind = 'flocking'
        flock_radius = 10
        leader = 5
        leader_velocity_mps = [40, 0]
        leader_weight_on = 'velocity'
        [[dynamics.effect]]
        kind = 'slop'
        ",
        None,
    );
    let kinds = refused.split_once("effect[0].kind: must be one of ").expect("it is refused").1;
    let kinds = kinds.split_once(", got").expect("the value is named").0;
    assert!(kinds.contains("\"slip\", \"slope\""), "{kinds}");
    insta::assert_snapshot!(refused.replace(kinds, "the kinds of effects"), @r#"
robotsim.knowledge: must be one of "heard", "truth", got "herd" (nearest valid: "heard")
robotsim.dynamics.speed_cap_mps: must be greater than 0 and at most 10000, got -30 (nearest valid: 30)
robotsim.dynamics.cap: must be one of "norm", "axis", got "axes" (nearest valid: "axis")
robotsim.dynamics.effect[0].kind: must be one of the kinds of effects, got "slop" (nearest valid: "slope")
robotsim.scenario.spaceing_m: is not a known key (nearest valid: spacing_m)
robotsim.controller.flock_radius_m: is missing: must be a number, from 0.001 to 1000000
robotsim.controller.flock_radius: is not a known key (nearest valid: flock_radius_m)
robotsim.controller.leader: must be one of the agents, 0 to 4, got 5 (nearest valid: 4)
robotsim.controller.leader_velocity_mps: must not exceed dynamics.speed_cap_mps = 30 m/s, got 40 m/s
robotsim.controller.leader_weight_on: requires velocity_term = true, got "velocity" (nearest valid: "gradient")
robotsim.scenario.jitter_m: must be at most half of spacing_m = 2, got 1.5 (nearest valid: 1)
"#);
}

#[test]
fn what_is_missing_is_named_with_what_is_possible() {
    insta::assert_snapshot!(refusal("", None), @r#"
robotsim.scenario.kind: is missing: one of "line", "disc", "square", "circle", "grid", "spaced", "csv"
robotsim.controller.kind: is missing: one of "flocking", "boids", "olfati-saber", "line-formation", "circle-formation", "consensus", "coverage", "dispersion", "exploration", "random-waypoint", "random-jump", "constant-velocity", "hold"
"#);
    insta::assert_snapshot!(refusal("scenario.kind = 'ring'\ncontroller.kind = 'flock'", None), @r#"
robotsim.scenario.kind: must be one of "line", "disc", "square", "circle", "grid", "spaced", "csv", got "ring"
robotsim.controller.kind: must be one of "flocking", "boids", "olfati-saber", "line-formation", "circle-formation", "consensus", "coverage", "dispersion", "exploration", "random-waypoint", "random-jump", "constant-velocity", "hold", got "flock" (nearest valid: "flocking")
"#);
    insta::assert_snapshot!(
        refusal("scenario.kind = 'circle'\ncontroller = { kind = 'flocking', leader = 9 }", None), @r#"
robotsim.scenario.radius_m: is missing: must be a number, greater than 0 and at most 1000000
robotsim.controller.flock_radius_m: is missing: must be a number, from 0.001 to 1000000
robotsim.controller.leader: must be one of the agents, 0 to 4, got 9 (nearest valid: 4)
"#);
    // What is missing is missing once: nothing is said of what would stand in its place.
    insta::assert_snapshot!(refusal("scenario.kind = 'line'\ncontroller.kind = 'coverage'", None), @r#"
robotsim.controller.from_m: is missing: must be a list of 2, each a number, from -1000000 to 1000000
robotsim.controller.to_m: is missing: must be a list of 2, each a number, from -1000000 to 1000000
"#);
}

#[test]
fn keys_that_do_not_fit_together_are_refused() {
    let scenario = "scenario = { kind = 'circle', radius_m = 3 }\n";
    let refusal = |rest: &str| refusal(&format!("{scenario}{rest}"), None);
    insta::assert_snapshot!(
        refusal("controller = { kind = 'flocking', flock_radius_m = 10, leader = 5, leader_weight_on = 'velocity' }"), @r#"
robotsim.controller.leader: must be one of the agents, 0 to 4, got 5 (nearest valid: 4)
robotsim.controller.leader_weight_on: requires velocity_term = true, got "velocity" (nearest valid: "gradient")
"#);
    insta::assert_snapshot!(
        refusal("controller = { kind = 'line-formation', threshold_m = 0.2 }"), @r#"
robotsim.controller.threshold_m: must be less than step_cap_m = 0.1, got 0.2
"#);
    insta::assert_snapshot!(
        refusal("controller = { kind = 'random-jump', arena = 'disc', side_m = 10 }"), @r#"
robotsim.controller.side_m: does not apply with arena = "disc"
"#);
    insta::assert_snapshot!(
        refusal("dynamics.speed_cap_mps = 2\ncontroller = { kind = 'constant-velocity', velocity_mps = [3, 4] }"), @r#"
robotsim.controller.velocity_mps: must not exceed dynamics.speed_cap_mps = 2 m/s, got 5 m/s
"#);
    insta::assert_snapshot!(refusal("controller = { kind = 'hold', velocity_mps = [1, 1] }"), @r#"
robotsim.controller.velocity_mps: does not apply with kind = "hold", only with "constant-velocity"
"#);
}

#[test]
fn groups_are_refused_where_they_do_not_fit_the_swarm_or_their_bodies() {
    let shared = "scenario.kind = 'line'\n\
                  controller = { kind = 'constant-velocity', velocity_mps = [3, 4] }\n";
    insta::assert_snapshot!(refusal(&format!("{shared}[[group]]\ncount = 2\n[[group]]\ncount = 4\n"), None), @r#"
robotsim.group: counts must add up to experiment.agents = 5, got 6
"#);
    insta::assert_snapshot!(refusal(&format!("{shared}[[group]]\n[[group]]\ncount = 0\nkind = 'car'\n"), None), @r#"
robotsim.group[0].count: is missing: must be a whole number from 1 to 1000000000
robotsim.group[1].count: must be a whole number from 1 to 1000000000, got 0 (nearest valid: 1)
robotsim.group[1].kind: is not a known key; the keys are count, dynamics, controller, localization_sd_m
robotsim.group: counts must add up to experiment.agents = 5, got 2
"#);
    // What is shared is wrong once, and only where it is wrong.
    insta::assert_snapshot!(
        refusal(&format!("{shared}[[group]]\ncount = 2\ndynamics.speed_cap_mps = 2\n\
                          [[group]]\ncount = 2\ndynamics.speed_cap_mps = 2\n\
                          [[group]]\ncount = 1\ndynamics = {{ kind = 'unicycle', wheelbase_m = 1 }}\n"), None), @r#"
robotsim.group[2].dynamics.wheelbase_m: does not apply with kind = "unicycle", only with "car"
robotsim.controller.velocity_mps: must not exceed dynamics.speed_cap_mps = 2 m/s, got 5 m/s
"#);
    // A group without a controller needs the shared one; where each has its own there need be none.
    let without = "scenario.kind = 'line'\n[[group]]\ncount = 3\ncontroller.kind = 'hold'\n[[group]]\ncount = 2\n";
    insta::assert_snapshot!(refusal(without, None), @r#"
robotsim.controller.kind: is missing: one of "flocking", "boids", "olfati-saber", "line-formation", "circle-formation", "consensus", "coverage", "dispersion", "exploration", "random-waypoint", "random-jump", "constant-velocity", "hold"
"#);
    let with = format!("{without}controller = {{ kind = 'hold' }}\n");
    assert!(config::read(&setup(&with, 5, 1), Catalogue::built_in()).is_ok());
    insta::assert_snapshot!(
        refusal("scenario.kind = 'line'\ncontacts.kind = 'resolve'\ndiameter_m = 0\n[[group]]\ncount = 5\n\
                 controller = { kind = 'random-jump', arena = 'square', jump_m = -1 }\n", None), @r#"
robotsim.group[0].controller.jump_m: must be greater than 0 and at most 1000000, got -1 (nearest valid: 1)
robotsim.diameter_m: must be greater than 0 if contacts are resolved, got 0.0
robotsim.contacts.kind: must be "count" with random-jump, whose robots have no path between two places, got "resolve"
"#);
}

#[test]
fn what_rigid_bodies_cannot_be_or_meet_is_refused() {
    let shared = "scenario.kind = 'line'\ndynamics.kind = 'rigid-body'\n";
    insta::assert_snapshot!(
        refusal(&format!("{shared}contacts.kind = 'resolve'\ncontroller.kind = 'random-jump'\n"), None), @r#"
robotsim.contacts.kind: must be "count" with random-jump, whose robots have no path between two places, got "resolve"
robotsim.contacts.kind: must be "count" if all robots are rigid bodies, which resolve contacts themselves, got "resolve"
robotsim.controller.kind: must not be random-jump for rigid bodies, which need a path between two places
"#);
    insta::assert_snapshot!(
        refusal(&format!("{shared}diameter_m = 0\ncontroller.kind = 'hold'\n[[group]]\ncount = 2\n\
                          [[group]]\ncount = 3\ndynamics.kind = 'car'\ncontroller.kind = 'random-jump'\n"), None), @r#"
robotsim.diameter_m: must be greater than 0 if rigid bodies share the swarm with other robots, got 0.0
robotsim.group[1].controller.kind: must not be random-jump beside rigid bodies, because robots that push them need a path between two places
"#);
    let mixed = "controller.kind = 'hold'\n[[group]]\ncount = 2\n[[group]]\ncount = 3\ndynamics.kind = 'car'\n";
    for contacts in ["", "contacts.kind = 'resolve'\n"] {
        assert!(
            config::read(
                &setup(&format!("{shared}{contacts}{mixed}"), 5, 1),
                Catalogue::built_in()
            )
            .is_ok()
        );
    }
}

const FROM_FILE: &str =
    "scenario = { kind = 'csv', file = 'places.csv' }\ncontroller.kind = 'hold'";

#[test]
fn a_file_of_places_is_refused_with_the_lines_that_are_wrong() {
    insta::assert_snapshot!(refusal(FROM_FILE, None), @r#"
robotsim.scenario.file: was not provided, got "places.csv"
"#);
    insta::assert_snapshot!(refusal(FROM_FILE, Some("")), @r#"
robotsim.scenario.file: places.csv: line 1: column agent is missing
robotsim.scenario.file: places.csv: line 1: column x_m is missing
robotsim.scenario.file: places.csv: line 1: column y_m is missing
"#);
    insta::assert_snapshot!(refusal(FROM_FILE, Some("agent,x,y_m,y_m,speed\n")), @r#"
robotsim.scenario.file: places.csv: line 1: "x" is not a known column (nearest valid: x_m)
robotsim.scenario.file: places.csv: line 1: column y_m occurs twice
robotsim.scenario.file: places.csv: line 1: "speed" is not a known column
robotsim.scenario.file: places.csv: line 1: column x_m is missing
"#);
    insta::assert_snapshot!(refusal(FROM_FILE, Some(
        "agent,x_m,y_m\n0,0,0\n\n# a comment\r\n\r\n1,1,nan\n2,2\n0,3,3\n7,1,1\n3,-0.0,0\n"
    )), @r#"
robotsim.scenario.file: places.csv: line 6: y_m must be a number from -10000000 to 10000000, got nan
robotsim.scenario.file: places.csv: line 7: must have 3 entries, got 2
robotsim.scenario.file: places.csv: line 8: agent 0 already has a position, in line 2
robotsim.scenario.file: places.csv: line 9: agent must be a whole number from 0 to 4, got 7
robotsim.scenario.file: places.csv: must have a valid line for each of 5 agents; 3 have none: 1, 2, 4
robotsim.scenario.file: places.csv: line 10: agent 3 has the same position as agent 0 of line 2, [0.0, 0.0, 0.0] m
"#);
    insta::assert_snapshot!(refusal(FROM_FILE, Some("agent,x_m,y_m,heading_rad\n0,1e300,0,x\n")), @r#"
robotsim.scenario.file: places.csv: line 2: x_m must be a number from -10000000 to 10000000, got 1e300
robotsim.scenario.file: places.csv: line 2: heading_rad must be a number from -1000 to 1000, got x
robotsim.scenario.file: places.csv: must have a valid line for each of 5 agents; 5 have none: 0, 1, 2, 3, 4
"#);
}

#[test]
fn places_are_read_in_any_order_with_optional_columns() {
    let mut setup = setup(FROM_FILE, 3, 1);
    let csv = "heading_rad,agent,x_m,y_m,z_m\n1.5,2,1,2,3\n0,0,4,5,6\n-1,1,7,8,9\n";
    setup.files.insert("places.csv".to_owned(), csv.into());
    let states = Swarm::default().configure(&setup).unwrap().states;
    assert_eq!(states.x_m, [4.0, 7.0, 1.0]);
    assert_eq!(states.z_m, [6.0, 9.0, 3.0]);
    assert_eq!(states.heading_rad, [0.0, -1.0, 1.5]);
    assert_eq!(
        config::files(&setup.config, "robotsim", Catalogue::built_in())[0].key,
        "robotsim.scenario.file"
    );
}

#[test]
fn defaults_are_filled_in_and_read_back_as_the_same() {
    let written = "scenario.kind = 'line'\ncontroller = { kind = 'flocking', flock_radius_m = 10 }";
    let mut setup = setup(written, 25, 1);
    let (_, effective) = config::read(&setup, Catalogue::built_in()).unwrap();
    insta::assert_snapshot!(effective, @r#"
knowledge = "heard"
diameter_m = 0.3

[dynamics]
kind = "point-mass"
speed_cap_mps = 30.0
cap = "norm"

[scenario]
kind = "line"
spacing_m = 2.0
jitter_m = 0.25

[controller]
kind = "flocking"
law = "paper"
flock_radius_m = 10.0
collision_radius_m = 0.8
leader = 0
leaderless = false
input = "velocity"
leader_velocity_mps = [7.0, 0.0]
leader_path_closed = false
leader_weight = 2.5
leader_weight_on = "gradient"
velocity_term = false
"#);
    setup.config = proto::config::parse(&effective.to_string()).unwrap();
    assert_eq!(config::read(&setup, Catalogue::built_in()).unwrap().1, effective);
}

#[test]
fn every_default_of_every_kind_is_valid() {
    for controller in [
        "hold",
        "line-formation",
        "random-jump",
        "circle-formation",
        "consensus",
        "boids",
        "olfati-saber",
    ] {
        for scenario in ["line", "square", "grid"] {
            let toml = format!("scenario.kind = '{scenario}'\ncontroller.kind = '{controller}'");
            let (_, effective) = config::read(&setup(&toml, 1, 1), Catalogue::built_in()).unwrap();
            assert!(effective.contains_key("dynamics"), "{effective}");
        }
    }
    assert!(Swarm::default().config_schema_json().contains("\"flock_radius_m\""));
}
