//! Effects between command and motion, in a running swarm.

use crate::air::{Air, setup};
use proto::side::{RobotInput, RobotSimulator};
use proto::types::{AgentCommand, AgentOrder, AgentStates};
use robotsim::sim::Swarm;

const FLOCKING: &str =
    "scenario.kind = 'line'\ncontroller = { kind = 'flocking', flock_radius_m = 10 }";
const STEADY: &str = "scenario = { kind = 'circle', radius_m = 50 }\n\
                      controller = { kind = 'constant-velocity', velocity_mps = [4, 0] }";
/// One of each kind, but for those that need a site.
const ALL: &str = "
    [[dynamics.effect]]
    kind = 'dead-time'
    delay_s = 0.17
    [[dynamics.effect]]
    kind = 'slip'
    scale = 0.9
    [[dynamics.effect]]
    kind = 'actuator-lag'
    tau_s = 0.3
    [[dynamics.effect]]
    kind = 'acceleration-limit'
    limit_mps2 = 20.0
    [[dynamics.effect]]
    kind = 'wind'
    velocity_mps = [0.3, -0.2, 0.0]
    sd_mps = 0.5
    [[dynamics.effect]]
    kind = 'downwash'
    gain = 0.5
    range_m = 1.0
    [[dynamics.effect]]
    kind = 'rough-ground'
    centre_m = [3.0, 0.0]
    radius_m = 2.0
    scale = 0.5
    [[dynamics.effect]]
    kind = 'localization'
    sd_m = 0.1
    delay_s = 0.25
    scale = 1.01
";

fn after(toml: &str, n_agents: usize, n_steps: usize) -> AgentStates {
    let mut air = Air::new(&setup(toml, n_agents, 3), |_, _, _, _| true);
    for _ in 0..n_steps {
        air.step();
    }
    air.states
}

#[test]
fn effects_change_the_motion_as_their_equations_say() {
    // τ = 0.5 s, 20 steps of 0.1 s: x = v (t − τ (1 − e^(−t/τ))), whatever the steps.
    let lag = format!("{STEADY}\n[[dynamics.effect]]\nkind = 'actuator-lag'\ntau_s = 0.5");
    let (free, lagging) = (after(STEADY, 3, 20), after(&lag, 3, 20));
    let behind_m = 4.0 * 0.5 * (1.0 - (-4.0f64).exp());
    for agent in 0..3 {
        let measured = free.x_m[agent] - lagging.x_m[agent];
        assert!((measured - behind_m).abs() < 1e-12, "{measured} {behind_m}");
    }
    // 0.25 s late, across steps of 0.1 s.
    let late = format!("{STEADY}\n[[dynamics.effect]]\nkind = 'dead-time'\ndelay_s = 0.25");
    let measured = free.x_m[1] - after(&late, 3, 20).x_m[1];
    assert!((measured - 1.0).abs() < 1e-12, "{measured}");
}

#[test]
fn effects_without_strength_change_nothing_but_rounding() {
    let neutral = format!(
        "{FLOCKING}
        [[dynamics.effect]]
        kind = 'slip'
        scale = 1.0
        [[dynamics.effect]]
        kind = 'dead-time'
        delay_s = 0.0
        [[dynamics.effect]]
        kind = 'actuator-lag'
        tau_s = 0.0"
    );
    let (bare, neutral) = (after(FLOCKING, 5, 10), after(&neutral, 5, 10));
    for (a, b) in bare.x_m.iter().chain(&bare.y_m).zip(neutral.x_m.iter().chain(&neutral.y_m)) {
        assert!((a - b).abs() < 1e-9, "{a} {b}");
    }
}

#[test]
fn a_swarm_with_effects_is_restored_with_all_that_is_under_way() {
    let toml = format!("{FLOCKING}\n{ALL}");
    let setup = setup(&toml, 6, 3);
    let mut air = Air::new(&setup, |_, _, _, _| true);
    for _ in 0..7 {
        air.step();
    }
    let saved = air.swarm.snapshot();
    let (step, deliveries) = (air.step, air.deliveries.clone());
    let expected: Vec<AgentStates> = (0..12).map(|_| air.step().states).collect();
    let mut other = Air::new(&setup, |_, _, _, _| true);
    other.swarm = Swarm::default();
    other.swarm.restore(&saved).unwrap();
    (other.step, other.deliveries) = (step, deliveries);
    let restored: Vec<AgentStates> = (0..12).map(|_| other.step().states).collect();
    assert!(restored == expected);
}

#[test]
fn a_swarm_with_effects_moves_alike_with_one_thread_and_with_three() {
    let toml = format!("{FLOCKING}\n{ALL}");
    let run = |n_threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(n_threads).build().unwrap();
        pool.install(|| after(&toml, 40, 10))
    };
    assert!(run(1) == run(3));
}

#[test]
fn noise_of_positions_is_on_the_air_and_not_in_the_motion() {
    let noisy = format!("{STEADY}\n[[dynamics.effect]]\nkind = 'localization'\nsd_m = 0.5");
    let mut swarm = Swarm::default();
    let n = 400;
    swarm.configure(&setup(&noisy, n, 3)).unwrap();
    let input = RobotInput {
        step: 1,
        from_ns: 0,
        until_ns: 100_000_000,
        deliveries: None,
        motes: None,
        commands: &[],
        hold: false,
    };
    let output = swarm.step(&input);
    let mut sum = 0.0;
    for (agent, payload) in output.payloads.iter().enumerate() {
        let said = robotsim::payload::decode(payload).unwrap().position_m;
        let [x, y, _] = output.states.position_m(agent);
        sum += (said[0] - x).powi(2) + (said[1] - y).powi(2);
    }
    let variance = sum / (2 * n) as f64;
    // Standard error 0.25 √(2 / 800); 4.5 of it.
    assert!((variance - 0.25).abs() < 4.5 * 0.25 * (2.0 / 800.0f64).sqrt(), "{variance}");
    assert_eq!(output.states.x_m, after(STEADY, n, 1).x_m);
}

#[test]
fn a_unicycle_turns_to_where_it_is_told_to_go_and_goes_there() {
    for kind in ["unicycle", "car"] {
        let toml = format!(
            "scenario = {{ kind = 'circle', radius_m = 5 }}\ncontroller.kind = 'hold'\ndynamics.kind = '{kind}'"
        );
        let mut air = Air::new(&setup(&toml, 1, 1), |_, _, _, _| true);
        let north = AgentCommand {
            agent: 0,
            source: "test".to_owned(),
            order: AgentOrder::Velocity([0.0, 2.0, 0.0]),
        };
        air.step_with(&[north]);
        for _ in 0..40 {
            air.step();
        }
        let quarter = std::f64::consts::FRAC_PI_2;
        assert!((air.states.heading_rad[0] - quarter).abs() < 1e-3, "{kind}: {:?}", air.states);
        assert!((air.states.vy_mps[0] - 2.0).abs() < 1e-3, "{kind}: {:?}", air.states);
    }
}

#[test]
fn two_lags_of_one_actuator_are_refused() {
    let toml = format!(
        "{STEADY}
        [[dynamics.effect]]
        kind = 'actuator-lag'
        tau_s = 0.5
        [[dynamics.effect]]
        kind = 'actuator-lag'
        tau_s = 0.2"
    );
    let problems = Swarm::default().configure(&setup(&toml, 2, 1)).unwrap_err();
    assert_eq!(
        problems[0].to_string(),
        "robotsim.dynamics.effect[1]: must occur only once per actuator; change the time constant of the first one"
    );
}

#[test]
fn an_effect_that_is_limited_to_some_robots_and_times_acts_on_them_alone() {
    let limited =
        |kind: &str, only: &str| format!("{STEADY}\n[[dynamics.effect]]\n{kind}\nonly = {only}");
    let slip =
        limited("kind = 'slip'\nscale = 0.5", "{ agents = [1], from_s = 0.5, until_s = 1.5 }");
    let (free, slipping) = (after(STEADY, 3, 20), after(&slip, 3, 20));
    let behind_m = |agent: usize| free.x_m[agent] - slipping.x_m[agent];
    assert!((behind_m(1) - 2.0).abs() < 1e-12, "{}", behind_m(1));
    for agent in [0, 2] {
        assert!(behind_m(agent).abs() < 1e-12, "{}", behind_m(agent));
    }
    // Positions are measured wrongly by robot 2 alone: it broadcasts them, and moves as the others.
    let payloads = |only: &str| {
        let toml = limited("kind = 'localization'\nscale = 2.0", only);
        Air::new(&setup(&toml, 3, 3), |_, _, _, _| true).step().payloads
    };
    let (payloads, plain) = (payloads("{ agents = [2] }"), payloads("{ agents = [9] }"));
    let differ: Vec<bool> = payloads.iter().zip(plain.iter()).map(|(a, b)| a != b).collect();
    assert_eq!(differ, [false, false, true]);
}

#[test]
fn a_simulation_refuses_limits_that_only_measurements_have() {
    for (only, expected) in [
        (
            "{ runs = [2] }",
            "robotsim.dynamics.effect[0].only.runs: applies to comparisons with measurements only",
        ),
        (
            "{ where = 'load_kg > 1' }",
            "robotsim.dynamics.effect[0].only.where: must not use load_kg in a simulation",
        ),
    ] {
        let toml =
            format!("{STEADY}\n[[dynamics.effect]]\nkind = 'slip'\nscale = 0.5\nonly = {only}");
        let problems = Swarm::default().configure(&setup(&toml, 3, 3)).unwrap_err();
        assert_eq!(problems.len(), 1);
        assert!(problems[0].to_string().starts_with(expected), "{}", problems[0]);
    }
}
