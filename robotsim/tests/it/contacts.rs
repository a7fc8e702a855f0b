//! Walls, obstacles and other robots in the way, in a running swarm.

use crate::air::{Air, setup};
use proto::config;
use proto::side::{RobotSimulator as _, Setup};
use proto::types::AgentStates;
use robotsim::sim::Swarm;

const BODIES: [&str; 5] = ["point-mass", "double-integrator", "quadrotor", "unicycle", "car"];
/// A room of 10 m by 10 m around the origin.
const ROOM: &str = "[[wall]]\nfrom_m = [-5, -5]\nto_m = [5, -5]\n\
                    [[wall]]\nfrom_m = [5, -5]\nto_m = [5, 5]\n\
                    [[wall]]\nfrom_m = [5, 5]\nto_m = [-5, 5]\n\
                    [[wall]]\nfrom_m = [-5, 5]\nto_m = [-5, -5]\n";
const RESOLVE: &str = "contacts.kind = 'resolve'\n";

fn setup_at(site: &str, toml: &str, n_agents: usize) -> Setup {
    let mut problems = Vec::new();
    let (site, _) =
        proto::site::read(&config::parse(site).expect("the text is TOML"), "site", &mut problems);
    assert!(problems.is_empty(), "{problems:?}");
    Setup { site, ..setup(toml, n_agents, 3) }
}

fn swarm(
    site: &str,
    toml: &str,
    n: usize,
) -> Air<impl FnMut(u64, usize, usize, f64) -> bool + use<>> {
    Air::new(&setup_at(site, toml, n), |_, _, _, _| true)
}

fn farthest_m(states: &AgentStates) -> f64 {
    let columns = states.x_m.iter().chain(&states.y_m);
    columns.fold(0.0, |most, part| most.max(part.abs()))
}

fn least_distance_m(states: &AgentStates) -> f64 {
    let mut least_m = f64::INFINITY;
    for a in 0..states.len() {
        for b in 0..a {
            let (a, b) = (states.position_m(a), states.position_m(b));
            least_m = least_m.min((a[0] - b[0]).hypot(a[1] - b[1]));
        }
    }
    least_m
}

#[test]
fn robots_that_are_driven_against_walls_stay_in_their_room_whatever_their_body() {
    for body in BODIES {
        // Straight into a corner, 3 m in a period: twenty times a robot's radius.
        let toml = format!(
            "scenario = {{ kind = 'circle', radius_m = 2 }}\ndynamics.kind = '{body}'\n\
             controller = {{ kind = 'constant-velocity', velocity_mps = [25, 16] }}\n"
        );
        let mut free = swarm(ROOM, &toml, 6);
        let mut held = swarm(ROOM, &format!("{RESOLVE}{toml}"), 6);
        for _ in 0..60 {
            free.step();
            held.step();
            assert!(farthest_m(&held.states) <= 4.85 + 1e-6, "{body}: {:?}", held.states);
            assert!(0.2 < least_distance_m(&held.states), "{body}: {:?}", held.states);
        }
        assert!(20.0 < farthest_m(&free.states), "{body}: without contacts walls are no matter");
    }
}

#[test]
fn a_robot_slides_along_a_wall_and_around_an_obstacle() {
    let site = "[[wall]]\nfrom_m = [3, -100]\nto_m = [3, 100]\n";
    let toml = format!(
        "{RESOLVE}scenario = {{ kind = 'line' }}\n\
         controller = {{ kind = 'constant-velocity', velocity_mps = [4, 3] }}\n"
    );
    let mut air = swarm(site, &toml, 1);
    let begin_m = air.states.position_m(0);
    (0..50).for_each(|_| drop(air.step()));
    let end_m = air.states.position_m(0);
    assert!((end_m[0] - 2.85).abs() < 1e-6, "{end_m:?}");
    // All of the speed along the wall is left.
    assert!((end_m[1] - begin_m[1] - 15.0).abs() < 1e-9, "{end_m:?}");
    assert!((air.states.vy_mps[0] - 3.0).abs() < 1e-9 && air.states.vx_mps[0].abs() < 1e-6);

    let site = "[[obstacle]]\ncentre_m = [6, 0.4]\nradius_m = 1\n";
    let mut air = swarm(site, &toml.replace("[4, 3]", "[4, 0]"), 1);
    let begin_m = air.states.position_m(0);
    let mut nearest_m = f64::INFINITY;
    for _ in 0..50 {
        air.step();
        let [x, y, _] = air.states.position_m(0);
        nearest_m = nearest_m.min((x - 6.0).hypot(y - 0.4));
    }
    assert!((1.15 - 1e-9..1.5).contains(&nearest_m), "{nearest_m}");
    assert!(7.5 < air.states.x_m[0] && 0.5 < (air.states.y_m[0] - begin_m[1]).abs());
}

#[test]
fn robots_that_meet_do_not_pass_through_each_other() {
    let toml = "scenario = { kind = 'circle', radius_m = 1.5 }\ncontroller.kind = 'consensus'\n\
                dynamics.speed_cap_mps = 30\n";
    let mut free = swarm("", toml, 20);
    let mut held = swarm("", &format!("{RESOLVE}{toml}"), 20);
    for _ in 0..100 {
        free.step();
        held.step();
    }
    assert!(least_distance_m(&free.states) < 0.05);
    // Twenty that all want to be in one place: what is left after eight rounds is a small part of the diameter.
    assert!(0.27 < least_distance_m(&held.states), "{}", least_distance_m(&held.states));
    // Twenty discs of 0.3 m have the area of one of 1.34 m; no packing of round ones is that close.
    let spread_m = farthest_m(&held.states);
    assert!((0.5..1.5).contains(&spread_m), "{spread_m}");
}

#[test]
fn an_obstacle_that_moves_pushes_robots_and_is_told_to_the_radio() {
    let site = "[[obstacle]]\nname = 'cart'\ncentre_m = [-10, 0]\nradius_m = 1\n";
    let toml = format!(
        "{RESOLVE}scenario.kind = 'line'\ncontroller.kind = 'hold'\n\
         [[obstacle]]\nname = 'cart'\npath_m = [[20, 0]]\nspeed_mps = 5\n"
    );
    let mut air = swarm(site, &toml, 1);
    assert!(air.states.x_m[0].abs() < 5.0);
    for step in 1..=60 {
        let moved = air.step().moved_obstacles;
        assert_eq!(moved.len(), 1);
        assert_eq!(moved[0].name, "cart");
        let [x_m, y_m] = moved[0].centre_m;
        assert!((x_m - (-10.0 + 0.5 * f64::from(step))).abs() < 1e-9 && y_m == 0.0);
        let [x, y, _] = air.states.position_m(0);
        assert!(1.15 - 1e-9 < (x - x_m).hypot(y - y_m), "step {step}");
    }
    assert_ne!(air.states.x_m[0], 0.0);
    // It has arrived.
    assert!(air.step().moved_obstacles.is_empty());
    // Robots that stand still for the network do not stop it.
    let mut air = swarm(site, &toml, 1);
    assert_eq!(air.step_held(&[], true).moved_obstacles.len(), 1);
}

#[test]
fn robots_that_begin_within_something_begin_beside_it() {
    let site = "[[obstacle]]\ncentre_m = [0, 0]\nradius_m = 3\n";
    let toml = format!(
        "{RESOLVE}scenario = {{ kind = 'circle', radius_m = 2 }}\ncontroller.kind = 'hold'"
    );
    let air = swarm(site, &toml, 8);
    for agent in 0..8 {
        let [x, y, _] = air.states.position_m(agent);
        assert!((x.hypot(y) - 3.15).abs() < 1e-8, "{x} {y}");
    }
}

#[test]
fn a_restored_swarm_in_contact_goes_on_as_if_it_had_never_stopped() {
    let site = format!("{ROOM}[[obstacle]]\nname = 'cart'\ncentre_m = [4, 0]\nradius_m = 0.5\n");
    for body in BODIES {
        let toml = format!(
            "contacts = {{ kind = 'resolve', restitution = 0.7 }}\n\
             scenario = {{ kind = 'circle', radius_m = 2 }}\ncontroller = {{ kind = 'random-waypoint', side_m = 12 }}\n\
             dynamics.kind = '{body}'\n\
             [[obstacle]]\nname = 'cart'\npath_m = [[-4, 1]]\nspeed_mps = 3\nclosed = true\n"
        );
        let mut whole = swarm(&site, &toml, 9);
        (0..15).for_each(|_| drop(whole.step()));
        let saved = whole.swarm.snapshot();
        let mut parts = swarm(&site, &toml, 9);
        parts.swarm = Swarm::default();
        parts.swarm.restore(&saved).unwrap();
        (parts.step, parts.states) = (whole.step, whole.states.clone());
        parts.deliveries = whole.deliveries.clone();
        for _ in 0..15 {
            let (a, b) = (whole.step(), parts.step());
            assert_eq!((a.states, a.moved_obstacles), (b.states, b.moved_obstacles), "{body}");
        }
        assert_eq!(whole.swarm.snapshot(), parts.swarm.snapshot());
    }
}

fn problems_of(toml: &str) -> String {
    let site = "[[obstacle]]\nname = 'cart'\ncentre_m = [4, 0]\nradius_m = 0.5\n";
    let problems =
        Swarm::default().configure(&setup_at(site, toml, 2)).expect_err("it makes no sense");
    problems.iter().map(ToString::to_string).collect::<Vec<_>>().join("\n")
}

#[test]
fn contacts_that_make_no_sense_are_refused() {
    insta::assert_snapshot!(problems_of(
        "contacts.kind = 'resolve'\ndiameter_m = 0\nscenario.kind = 'square'\ncontroller.kind = 'random-jump'\n\
         [[obstacle]]\nname = 'bus'\npath_m = [[1, 1]]\nspeed_mps = 1\n\
         [[obstacle]]\nname = 'cart'\npath_m = [[1, 1]]\nspeed_mps = 1\n\
         [[obstacle]]\nname = 'cart'\npath_m = [[2, 1]]\nspeed_mps = 1\n"
    ), @r#"
    robotsim.diameter_m: must be greater than 0 if contacts are resolved, got 0.0
    robotsim.contacts.kind: must be "count" with random-jump, whose robots have no path between two places, got "resolve"
    robotsim.obstacle[0].name: must be the name of an obstacle of [site], got "bus"
    robotsim.obstacle[2].name: must be unique, because an obstacle has only one motion, got "cart"
    "#);
}
