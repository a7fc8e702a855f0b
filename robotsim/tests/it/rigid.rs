//! Rigid bodies in a running swarm.

use crate::air::{Air, setup};
use proto::side::{RobotSimulator as _, Setup};
use proto::site::{Obstacle, Wall};
use proto::types::AgentStates;
use robotsim::sim::Swarm;

/// Forty robots of two sizes that all want to the middle of a room, where a pillar moves through them.
fn crowd() -> Setup {
    let toml = "scenario = { kind = 'square', side_m = 7 }\n\
                controller = { kind = 'consensus', gain_per_s = 1.0 }\n\
                [[group]]\ncount = 30\ndynamics.kind = 'rigid-body'\n\
                [[group]]\ncount = 10\n\
                dynamics = { kind = 'rigid-body', body_diameter_m = 0.6, mass_kg = 4.0, ground_friction = 0.1, restitution = 0.5 }\n\
                [[obstacle]]\nname = 'cart'\npath_m = [[3.0, 0.0]]\nspeed_mps = 1.0\n";
    let corners = [[4.0, -4.0], [4.0, 4.0], [-4.0, 4.0], [-4.0, -4.0], [4.0, -4.0]];
    let wall =
        |ends: &[[f64; 2]]| Wall { from_m: ends[0], to_m: ends[1], height_m: None, material: None };
    let mut setup = setup(toml, 40, 5);
    setup.site.wall = corners.windows(2).map(wall).collect();
    setup.site.obstacle = vec![Obstacle {
        name: Some("cart".to_owned()),
        centre_m: [-3.0, 0.0],
        radius_m: 0.5,
        height_m: None,
        material: None,
    }];
    setup
}

fn distance_m(states: &AgentStates, a: usize, b: usize) -> f64 {
    let (a, b) = (states.position_m(a), states.position_m(b));
    (a[0] - b[0]).hypot(a[1] - b[1])
}

#[test]
fn a_crowd_is_pushed_about_and_nobody_is_in_anybody() {
    let mut air = Air::new(&crowd(), |_, _, _, _| true);
    for step in 1..=60 {
        air.step();
        let cart_m = [(0.1 * step as f64) - 3.0, 0.0];
        for agent in 0..40 {
            let at_m = air.states.position_m(agent);
            let radius_m = if agent < 30 { 0.15 } else { 0.3 };
            // Bodies that are pressed together overlap by less than a fifth of the smaller radius.
            let most_m = 4.0 - radius_m + 0.03;
            assert!(at_m[0].abs() < most_m && at_m[1].abs() < most_m, "step {step}: {at_m:?}");
            let from_cart_m = (at_m[0] - cart_m[0]).hypot(at_m[1] - cart_m[1]);
            assert!(0.5 + radius_m - 0.03 < from_cart_m, "step {step}, {agent}: {from_cart_m}");
            for other in 0..agent {
                let other_radius_m = if other < 30 { 0.15 } else { 0.3 };
                let least_m = radius_m + other_radius_m - 0.03;
                assert!(least_m < distance_m(&air.states, agent, other), "step {step}");
            }
        }
    }
    // They did crowd together.
    let near = (0..40).filter(|&agent| {
        (0..40).any(|other| other != agent && distance_m(&air.states, agent, other) < 0.61)
    });
    assert!(30 < near.count());
    assert!(air.states.heading_rad.iter().any(|heading_rad| *heading_rad != 0.0), "some turned");
}

#[test]
fn a_restored_crowd_goes_on_as_if_it_had_never_stopped_and_runs_agree_to_the_last_bit() {
    let run = |n: usize| {
        let mut air = Air::new(&crowd(), |_, _, _, _| true);
        (0..n).for_each(|_| drop(air.step()));
        air
    };
    let mut whole = run(20);
    let mut again = run(20);
    let saved = again.swarm.snapshot();
    assert_eq!(saved, whole.swarm.snapshot());
    again.swarm = Swarm::default();
    again.swarm.restore(&saved).unwrap();
    for step in 0..20 {
        assert_eq!(whole.step().states, again.step().states, "step {step}");
    }
    assert_eq!(whole.swarm.snapshot(), again.swarm.snapshot());
}

#[test]
fn a_drive_brings_a_rigid_body_to_its_velocity_and_no_further() {
    let toml = "scenario = { kind = 'circle', radius_m = 50 }\n\
                controller = { kind = 'constant-velocity', velocity_mps = [4, 0] }\n\
                dynamics = { kind = 'rigid-body', mass_kg = 2.0, force_cap_n = 10.0, ground_friction = 0.1 }";
    let mut air = Air::new(&setup(toml, 1, 1), |_, _, _, _| true);
    let begin_m = air.states.x_m[0];
    for _ in 0..5 {
        air.step();
    }
    // 5 m/s², less what the ground takes.
    let left_mps2 = 5.0 - 0.1 * 9.80665;
    let way_m = air.states.x_m[0] - begin_m;
    assert!((way_m - 0.5 * left_mps2 * 0.25).abs() < 1e-9, "{way_m}");
    for _ in 0..15 {
        air.step();
    }
    assert!((air.states.vx_mps[0] - 4.0).abs() < 1e-9, "{:?}", air.states.vx_mps);
}

/// Boxes in a room, and robots of two other kinds among them that the walls hold up.
fn mixed(more: &str) -> Setup {
    let toml = format!(
        "scenario = {{ kind = 'grid', spacing_m = 0.8 }}\ncontacts.kind = 'resolve'\n\
         controller = {{ kind = 'random-waypoint', side_m = 12 }}\n\
         [[group]]\ncount = 12\ncontroller.kind = 'hold'\n\
         dynamics = {{ kind = 'rigid-body', force_cap_n = 0.0, restitution = 0.5 }}\n\
         [[group]]\ncount = 6\n\
         [[group]]\ncount = 6\ndynamics = {{ kind = 'double-integrator', speed_cap_mps = 3.0 }}\n{more}"
    );
    let mut setup = setup(&toml, 24, 5);
    setup.site.wall = crowd().site.wall;
    setup
}

#[test]
fn robots_of_other_kinds_push_boxes_about_and_go_as_if_there_were_none() {
    let mut air = Air::new(&mixed(""), |_, _, _, _| true);
    let gone = "[[absence]]\nrobots = [0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11]\n";
    let mut alone = Air::new(&mixed(gone), |_, _, _, _| true);
    let begin = air.states.clone();
    for step in 1..=40 {
        air.step();
        alone.step();
        for agent in 12..24 {
            let [with, without] = [&air.states, &alone.states].map(|it| it.position_m(agent));
            assert_eq!(with, without, "step {step}: {agent}");
            assert!(with[0].abs() < 3.86 && with[1].abs() < 3.86, "step {step}: {with:?}");
        }
    }
    let moved = (0..12).filter(|&agent| air.states.position_m(agent) != begin.position_m(agent));
    assert!(6 < moved.count());
}

#[test]
fn a_restored_mixed_swarm_goes_on_as_if_it_had_never_stopped() {
    let mut whole = Air::new(&mixed(""), |_, _, _, _| true);
    (0..10).for_each(|_| drop(whole.step()));
    let mut again = Air::new(&mixed(""), |_, _, _, _| true);
    (0..10).for_each(|_| drop(again.step()));
    let saved = again.swarm.snapshot();
    again.swarm = Swarm::default();
    again.swarm.restore(&saved).unwrap();
    for step in 0..20 {
        assert_eq!(whole.step().states, again.step().states, "step {step}");
    }
}
