//! Bodies that keep their velocity, in a running swarm.

use crate::air::{Air, setup};
use proto::side::RobotSimulator as _;
use proto::types::{AgentCommand, AgentOrder, AgentStates};
use robotsim::sim::Swarm;

/// Length of a step (s), as in `air`.
const DT_S: f64 = 0.1;
const STEADY: &str = "scenario = { kind = 'circle', radius_m = 50 }\n\
                      controller = { kind = 'constant-velocity', velocity_mps = [4, 0] }";

fn swarm(toml: &str, n_agents: usize) -> Air<impl FnMut(u64, usize, usize, f64) -> bool> {
    Air::new(&setup(toml, n_agents, 3), |_, _, _, _| true)
}

fn after(toml: &str, n_agents: usize, n_steps: usize) -> AgentStates {
    let mut air = swarm(toml, n_agents);
    (0..n_steps).for_each(|_| drop(air.step()));
    air.states
}

/// An order to fly with a velocity in space.
fn fly(velocity_mps: [f64; 3]) -> AgentCommand {
    let order = AgentOrder::Velocity(velocity_mps);
    AgentCommand { agent: 0, source: "test".to_owned(), order }
}

#[test]
fn a_double_integrator_comes_to_its_velocity_as_its_acceleration_allows() {
    // 10 m/s² until 4 m/s are reached, after 0.4 s and 0.8 m; then 4 m/s for the rest of 2 s.
    let body = format!(
        "{STEADY}\ndynamics = {{ kind = 'double-integrator', acceleration_cap_mps2 = 10 }}"
    );
    let begin = after(&body, 2, 0);
    let end = after(&body, 2, 20);
    for agent in 0..2 {
        let way_m = end.x_m[agent] - begin.x_m[agent];
        assert!((way_m - (0.8 + 4.0 * 1.6)).abs() < 1e-12, "{way_m}");
    }
    // The velocity is that over the step: half of it after the first one, in which it came to 1 m/s.
    assert!((after(&body, 2, 1).vx_mps[0] - 0.5).abs() < 1e-12);
}

#[test]
fn an_acceleration_takes_a_double_integrator_half_as_far_in_its_first_period_as_a_point_mass() {
    // x = a t² / 2; a point mass has the velocity a t at once.
    let flocking = "scenario.kind = 'line'\n\
                    controller = { kind = 'flocking', flock_radius_m = 10, input = 'acceleration', leader_velocity_mps = [0, 0] }\n";
    let double = format!(
        "{flocking}dynamics = {{ kind = 'double-integrator', acceleration_cap_mps2 = 10000 }}"
    );
    let (begin, point) = (after(flocking, 2, 0), after(flocking, 2, 2));
    let double = after(&double, 2, 2);
    // In the first step nobody has heard of anybody.
    let way_m =
        |states: &AgentStates| (states.x_m[1] - begin.x_m[1]).hypot(states.y_m[1] - begin.y_m[1]);
    let (point_m, double_m) = (way_m(&point), way_m(&double));
    assert!(0.001 < point_m);
    assert!((double_m / point_m - 0.5).abs() < 1e-9, "{double_m} {point_m}");
}

/// A quadrotor that is ordered to a velocity every 0.1 s, by Euler steps of 10 µs: place after `t_s`.
fn plain_quadrotor(order_mps: [f64; 3], t_s: f64) -> [f64; 3] {
    let (gain, lag_s, tilt, most, g) = (2.0, 0.15, 0.5_f64, 2.0 * 9.80665, 9.80665);
    let h = 1e-5;
    let (mut x, mut v, mut thrust) = ([0.0; 3], [0.0; 3], [0.0, 0.0, g]);
    let mut wanted = thrust;
    for step in 0..(t_s / h).round() as usize {
        if step % (DT_S / h).round() as usize == 0 {
            let mut asked: [f64; 3] = std::array::from_fn(|i| gain * (order_mps[i] - v[i]));
            asked[2] = (asked[2] + g).clamp(0.0, most);
            let sideways = (asked[0] * asked[0] + asked[1] * asked[1]).sqrt();
            let allowed =
                (asked[2] * tilt.tan()).min((most * most - asked[2] * asked[2]).max(0.0).sqrt());
            if allowed < sideways {
                asked[0] *= allowed / sideways;
                asked[1] *= allowed / sideways;
            }
            wanted = asked;
        }
        for i in 0..3 {
            let weight = if i == 2 { g } else { 0.0 };
            x[i] += h * v[i];
            v[i] += h * (thrust[i] - weight);
            thrust[i] += h * (wanted[i] - thrust[i]) / lag_s;
        }
    }
    x
}

#[test]
fn a_quadrotor_flies_as_small_steps_of_its_equations_do() {
    let toml = "scenario = { kind = 'circle', radius_m = 5 }\ncontroller.kind = 'hold'\n\
                dynamics.kind = 'quadrotor'";
    // Sideways; steeply upwards, where thrust is short; down.
    for order_mps in [[8.0, -3.0, 0.0], [5.0, 0.0, 12.0], [0.0, 6.0, -9.0]] {
        let mut air = swarm(toml, 1);
        let begin_m = air.states.position_m(0);
        air.step_with(&[fly(order_mps)]);
        (1..30).for_each(|_| drop(air.step()));
        let end_m = air.states.position_m(0);
        let expected_m = plain_quadrotor(order_mps, 3.0);
        for i in 0..3 {
            // Euler steps of 10 µs err by about 10 µs times the velocity, up to 12 m/s.
            let got_m = end_m[i] - begin_m[i];
            assert!((got_m - expected_m[i]).abs() < 3e-4, "{order_mps:?}: {got_m} {expected_m:?}");
        }
    }
}

#[test]
fn a_quadrotor_in_a_plane_stays_at_its_height_and_comes_to_its_velocity() {
    let toml = format!("{STEADY}\ndynamics.kind = 'quadrotor'");
    let states = after(&toml, 3, 200);
    assert_eq!(states.z_m, [0.0; 3]);
    assert!(states.vx_mps.iter().all(|vx| (vx - 4.0).abs() < 1e-6), "{:?}", states.vx_mps);
}

#[test]
fn a_point_mass_flies_in_space_too() {
    let mut air =
        swarm("scenario = { kind = 'circle', radius_m = 5 }\ncontroller.kind = 'hold'", 1);
    air.step_with(&[fly([1.0, 2.0, 3.0])]);
    air.step();
    assert!((air.states.z_m[0] - 0.6).abs() < 1e-12);
    assert_eq!(air.states.vz_mps, [3.0]);
}

#[test]
fn robots_that_keep_their_velocity_are_restored_with_it() {
    let effects = "[[dynamics.effect]]\nkind = 'dead-time'\ndelay_s = 0.17\n\
                   [[dynamics.effect]]\nkind = 'wind'\nvelocity_mps = [0.3, -0.2, 0.0]\nsd_mps = 0.5\n";
    for kind in ["double-integrator", "quadrotor"] {
        let toml = format!(
            "scenario.kind = 'line'\ncontroller = {{ kind = 'flocking', flock_radius_m = 10 }}\ndynamics.kind = '{kind}'\n{effects}"
        );
        let setup = setup(&toml, 4, 3);
        let mut air = Air::new(&setup, |_, _, _, _| true);
        (0..7).for_each(|_| drop(air.step()));
        let saved = air.swarm.snapshot();
        let (step, deliveries) = (air.step, air.deliveries.clone());
        let expected: Vec<AgentStates> = (0..9).map(|_| air.step().states).collect();
        let mut other = Air::new(&setup, |_, _, _, _| true);
        other.swarm = Swarm::default();
        other.swarm.restore(&saved).unwrap();
        (other.step, other.deliveries) = (step, deliveries);
        let restored: Vec<AgentStates> = (0..9).map(|_| other.step().states).collect();
        assert!(restored == expected, "{kind}");
    }
}
