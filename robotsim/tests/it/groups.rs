//! Different robots in one swarm.

use crate::air::{Air, setup};
use proto::side::RobotSimulator as _;
use proto::types::AgentStates;
use robotsim::sim::Swarm;

const PLACES: &str = "scenario = { kind = 'line' }\n";
/// Everyone goes north, as far as its body lets it.
const NORTH: &str = "controller = { kind = 'constant-velocity', velocity_mps = [0.3, 2] }\n";
const SLOW_TO_START: &str = "kind = 'unicycle'\nspeed_cap_mps = 4.0\nyaw_rate_cap_radps = 1.0\n\
                             [[EFFECT]]\nkind = 'actuator-lag'\ntau_s = 0.3\n";

/// A table with its inner list of effects named for the place where it stands.
fn table_at(place: &str, table: &str) -> String {
    format!("[{place}]\n{}", table.replace("[[EFFECT]]", &format!("[[{place}.effect]]")))
}

/// States before the first and after each of 30 steps, everyone hearing everyone.
fn trail(toml: &str, n_agents: usize) -> Vec<AgentStates> {
    let mut air = Air::new(&setup(toml, n_agents, 3), |_, _, _, _| true);
    let begin = air.states.clone();
    std::iter::once(begin).chain((0..30).map(|_| air.step().states)).collect()
}

fn place_and_velocity(states: &AgentStates, agent: usize) -> ([f64; 3], [f64; 3]) {
    let velocity_mps = [states.vx_mps[agent], states.vy_mps[agent], states.vz_mps[agent]];
    (states.position_m(agent), velocity_mps)
}

#[test]
fn each_group_moves_as_a_swarm_of_its_kind_does() {
    let point = "kind = 'point-mass'\n[[EFFECT]]\nkind = 'slip'\nscale = 0.8\n";
    let mixed = format!(
        "{PLACES}{NORTH}[[group]]\ncount = 3\n{}[[group]]\ncount = 2\nlocalization_sd_m = 0.5\n{}",
        table_at("group.dynamics", SLOW_TO_START),
        table_at("group.dynamics", point),
    );
    let mixed = trail(&mixed, 5);
    let alone = |table: &str| trail(&format!("{PLACES}{NORTH}{}", table_at("dynamics", table)), 5);
    let (unicycles, points) = (alone(SLOW_TO_START), alone(point));
    for (step, mixed) in mixed.iter().enumerate() {
        for agent in 0..5 {
            let alone = if agent < 3 { &unicycles[step] } else { &points[step] };
            assert_eq!(
                place_and_velocity(mixed, agent),
                place_and_velocity(alone, agent),
                "robot {agent} in step {step}"
            );
        }
        assert_eq!(mixed.heading_rad[..3], unicycles[step].heading_rad[..3]);
    }
    assert!(mixed[30] != mixed[0] && unicycles[30].y_m[4] != points[30].y_m[4], "they differ");
}

#[test]
fn robots_are_numbered_group_after_group_and_those_that_say_nothing_share() {
    let toml = format!(
        "{PLACES}{NORTH}dynamics.speed_cap_mps = 5\n[[group]]\ncount = 1\n\
         [[group]]\ncount = 2\ncontroller = {{ kind = 'hold' }}\n[[group]]\ncount = 2\n\
         controller = {{ kind = 'constant-velocity', velocity_mps = [-3, 0] }}\n"
    );
    let end = trail(&toml, 5).pop().unwrap();
    let velocities: Vec<_> = (0..5).map(|agent| place_and_velocity(&end, agent).1).collect();
    let (north, still, west) = ([0.3, 2.0, 0.0], [0.0; 3], [-3.0, 0.0, 0.0]);
    assert_eq!(velocities, [north, still, still, west, west]);
}

#[test]
fn a_task_is_done_when_every_group_has_done_its_own() {
    let done_after = |shared_m: &str, own_m: &str| {
        let toml = format!(
            "scenario.kind = 'line'\n\
             controller = {{ kind = 'consensus', gain_per_s = 1.0, threshold_m = {shared_m} }}\n\
             [[group]]\ncount = 2\n[[group]]\ncount = 2\n\
             controller = {{ kind = 'consensus', gain_per_s = 1.0, threshold_m = {own_m} }}\n"
        );
        let mut air = Air::new(&setup(&toml, 4, 3), |_, _, _, _| true);
        (1..500).find(|_| air.step().task_complete).expect("they meet")
    };
    // The stricter group decides, whichever it is.
    let both_lax = done_after("0.1", "0.1");
    assert!(both_lax < done_after("0.1", "0.0001"));
    assert!(both_lax < done_after("0.0001", "0.1"));
}

#[test]
fn a_body_that_keeps_its_velocity_bounces_off_one_that_is_driven() {
    // A double integrator that nobody drives any more meets a point mass that goes on at 1 m/s.
    let toml = "scenario = { kind = 'csv', file = 'places.csv' }\n\
                contacts = { kind = 'resolve', restitution = 0.5 }\n\
                [[group]]\ncount = 1\ndynamics.kind = 'double-integrator'\n\
                controller.kind = 'hold'\n\
                [[group]]\ncount = 1\n\
                controller = { kind = 'constant-velocity', velocity_mps = [1, 0] }\n\
                dynamics.kind = 'point-mass'\n";
    let mut setup = setup(toml, 2, 1);
    let places = "agent,x_m,y_m\n0,0,0\n1,-0.75,0\n";
    setup.files.insert("places.csv".to_owned(), places.as_bytes().to_vec().into());
    let mut air = Air::new(&setup, |_, _, _, _| true);
    for _ in 0..4 {
        air.step();
        assert_eq!(air.states.position_m(0), [0.0; 3], "{:?}", air.states);
    }
    // They meet at 0.45 s; it is pushed to (1 + e) times 1 m/s, and brakes as it wants to stand: it is free at once and has
    // gone less than that.
    air.step();
    let pushed_m = air.states.x_m[0];
    assert!((0.02..0.075 + 1e-9).contains(&pushed_m), "{pushed_m}");
    assert!((air.states.x_m[1] + 0.25).abs() < 0.08, "{:?}", air.states);
}

#[test]
fn a_restored_swarm_of_groups_goes_on_as_if_it_had_never_stopped() {
    let toml = format!(
        "{PLACES}controller = {{ kind = 'flocking', flock_radius_m = 5, leader_velocity_mps = [2, 0] }}\n\
         [[group]]\ncount = 2\n{}[[group]]\ncount = 3\ndynamics.kind = 'quadrotor'\n",
        table_at("group.dynamics", SLOW_TO_START)
    );
    let mut air = Air::new(&setup(&toml, 5, 3), |_, _, _, _| true);
    (0..10).for_each(|_| drop(air.step()));
    let saved = air.swarm.snapshot();
    let on: Vec<_> = (0..5).map(|_| air.step().states).collect();
    let mut again = Air::new(&setup(&toml, 5, 3), |_, _, _, _| true);
    (0..10).for_each(|_| drop(again.step()));
    again.swarm = Swarm::default();
    again.swarm.restore(&saved).unwrap();
    let restored: Vec<_> = (0..5).map(|_| again.step().states).collect();
    assert_eq!(on, restored);
}
