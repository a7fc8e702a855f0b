//! Orders, saving, and what every swarm must keep.

use crate::air::{Air, setup};
use proto::side::{RobotInput, RobotSimulator};
use proto::types::{AgentCommand, AgentOrder, AgentStates, Payloads};
use robotsim::sim::Swarm;

const FLOCKING: &str =
    "scenario.kind = 'line'\ncontroller = { kind = 'flocking', flock_radius_m = 10 }";
const LINE: &str =
    "scenario = { kind = 'disc', density_per_m2 = 0.22 }\ncontroller.kind = 'line-formation'";
const JUMPS: &str = "scenario.kind = 'square'\ncontroller.kind = 'random-jump'";
const HOLD: &str = "scenario = { kind = 'circle', radius_m = 5 }\ncontroller.kind = 'hold'";

fn order(agent: u32, order: AgentOrder) -> AgentCommand {
    AgentCommand { agent, source: "test".to_owned(), order }
}

#[test]
fn an_order_overrides_the_controller_until_it_is_released() {
    let toml = "scenario.kind = 'line'\n\
                controller = { kind = 'constant-velocity', velocity_mps = [1, 0] }";
    let mut air = Air::new(&setup(toml, 2, 1), |_, _, _, _| true);
    let step = |air: &mut Air<_>, commands: &[AgentCommand]| {
        let states = air.step_with(commands).states;
        [0, 1].map(|agent| [states.vx_mps[agent], states.vy_mps[agent], states.vz_mps[agent]])
    };
    let free = [1.0, 0.0, 0.0];
    let up = [0.0, 0.0, 2.0];
    assert_eq!(step(&mut air, &[]), [free, free]);
    assert_eq!(step(&mut air, &[order(1, AgentOrder::Velocity(up))]), [free, up]);
    assert_eq!(step(&mut air, &[]), [free, up]);
    // Of two orders to one agent the last holds; the cap holds for orders too.
    let fast =
        [order(0, AgentOrder::Velocity(up)), order(0, AgentOrder::Velocity([-50.0, 0.0, 0.0]))];
    assert_eq!(step(&mut air, &fast), [[-30.0, 0.0, 0.0], up]);
    assert_eq!(step(&mut air, &[order(1, AgentOrder::Release)]), [[-30.0, 0.0, 0.0], free]);
}

#[test]
fn a_waypoint_is_reached_as_fast_as_the_cap_allows_and_kept() {
    let toml = format!("{HOLD}\ndynamics.speed_cap_mps = 10");
    let mut air = Air::new(&setup(&toml, 1, 1), |_, _, _, _| true);
    // From (5, 0, 0): 2.5 m at 1 m a step.
    air.step_with(&[order(0, AgentOrder::Waypoint([5.0, 1.5, 2.0]))]);
    let distance_m = |states: &AgentStates| {
        let [x, y, z] = states.position_m(0);
        ((x - 5.0).powi(2) + (y - 1.5).powi(2) + (z - 2.0).powi(2)).sqrt()
    };
    // Rounding of a few units in numbers below 8.
    assert!((distance_m(&air.states) - 1.5).abs() < 1e-14, "{:?}", air.states);
    air.step();
    assert!((distance_m(&air.states) - 0.5).abs() < 1e-14, "{:?}", air.states);
    for _ in 0..3 {
        air.step();
        assert!(distance_m(&air.states) < 1e-14, "{:?}", air.states);
    }
    assert!(air.states.vx_mps[0].abs() < 1e-13, "{:?}", air.states);
}

/// Positions and payloads of 20 steps.
fn trail(
    air: &mut Air<impl FnMut(u64, usize, usize, f64) -> bool>,
    n: usize,
) -> Vec<(AgentStates, Payloads)> {
    (0..n)
        .map(|_| {
            let output = air.step();
            (output.states, output.payloads)
        })
        .collect()
}

#[test]
fn a_restored_swarm_goes_on_as_if_it_had_never_stopped() {
    for toml in [FLOCKING, LINE, JUMPS] {
        let setup = setup(toml, 12, 3);
        let mut air = Air::new(&setup, |_, _, _, distance_m| distance_m < 6.0);
        air.step_with(&[order(4, AgentOrder::Velocity([0.1, 0.7, 0.0]))]);
        trail(&mut air, 4);
        let saved = air.swarm.snapshot();
        let (step, deliveries) = (air.step, air.deliveries.clone());
        let expected = trail(&mut air, 20);

        let mut other = Air::new(&setup, |_, _, _, distance_m| distance_m < 6.0);
        other.swarm = Swarm::default();
        other.swarm.restore(&saved).unwrap();
        assert_eq!(other.swarm.snapshot(), saved);
        (other.step, other.deliveries) = (step, deliveries);
        assert!(trail(&mut other, 20) == expected, "{toml}");
    }
}

#[test]
fn a_swarm_from_a_file_is_restored_without_the_file() {
    let mut setup =
        setup("scenario = { kind = 'csv', file = 'p' }\ncontroller.kind = 'hold'", 1, 0);
    setup.files.insert("p".to_owned(), "agent,x_m,y_m\n0,3,4\n".into());
    let mut swarm = Swarm::default();
    swarm.configure(&setup).unwrap();
    let mut other = Swarm::default();
    other.restore(&swarm.snapshot()).unwrap();
    assert_eq!(other.snapshot(), swarm.snapshot());
}

#[test]
fn what_is_no_snapshot_is_refused_and_changes_nothing() {
    let mut swarm = Swarm::default();
    swarm.configure(&setup(FLOCKING, 5, 1)).unwrap();
    let saved = swarm.snapshot();
    for wrong in [&b""[..], b"hello", &saved[..saved.len() - 1], &[&saved[..], b"x"].concat()] {
        let error = swarm.restore(wrong).unwrap_err().to_string();
        assert!(error.starts_with("state: is not a snapshot"), "{error}");
        assert_eq!(swarm.snapshot(), saved);
    }
    let error = swarm.restore(&postcard::to_stdvec(&("netsim 1", 3)).unwrap()).unwrap_err();
    assert!(error.to_string().contains("netsim 1"), "{error}");
}

#[test]
fn a_refused_configuration_leaves_the_swarm_as_it_was() {
    let mut swarm = Swarm::default();
    swarm.configure(&setup(FLOCKING, 5, 1)).unwrap();
    let saved = swarm.snapshot();
    assert!(swarm.configure(&setup("", 5, 1)).is_err());
    assert_eq!(swarm.snapshot(), saved);
}

#[test]
fn the_same_seed_gives_the_same_motion_for_any_number_of_threads() {
    // 200 robots that hear all others are enough for the work to be shared among threads.
    for toml in [FLOCKING, LINE] {
        let run = |n_threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(n_threads).build().unwrap();
            pool.install(|| trail(&mut Air::new(&setup(toml, 200, 5), |_, _, _, _| true), 5))
        };
        let alone = run(1);
        assert!(alone == run(3), "{toml}");
    }
}

#[test]
fn another_seed_gives_another_start() {
    let start = |seed| Swarm::default().configure(&setup(LINE, 5, seed)).unwrap().states.x_m;
    assert_eq!(start(1), start(1));
    assert_ne!(start(1), start(2));
}

#[test]
fn one_robot_more_leaves_the_draws_of_the_others_as_they_were() {
    let run = |n| {
        let mut air = Air::new(&setup(JUMPS, n, 5), |_, _, _, _| false);
        trail(&mut air, 10).pop().unwrap().0.x_m
    };
    assert_eq!(run(5), run(6)[..5]);
}

#[test]
fn jumping_robots_stay_in_their_arena_and_fill_it_evenly() {
    // 2000 robots after 20 jumps: the share in the inner half of the area has standard error 0.0112; 4.5 of them are
    // exceeded by one seed in 150,000.
    for (arena, scenario, half) in [
        ("'square', side_m = 40", "kind = 'square', side_m = 40", 20.0),
        (
            "'disc', density_per_m2 = 2",
            "kind = 'disc', density_per_m2 = 2",
            (2000.0 / (2.0 * std::f64::consts::PI)).sqrt(),
        ),
    ] {
        let toml = format!(
            "scenario = {{ {scenario} }}\ncontroller = {{ kind = 'random-jump', arena = {arena} }}"
        );
        let mut air = Air::new(&setup(&toml, 2000, 9), |_, _, _, _| false);
        for _ in 0..20 {
            air.step();
        }
        let size = |agent: usize| {
            let [x, y, _] = air.states.position_m(agent);
            if arena.starts_with("'disc") { x.hypot(y) } else { x.abs().max(y.abs()) }
        };
        assert!((0..2000).all(|agent| size(agent) <= half), "{arena}");
        let inner = (0..2000).filter(|&agent| size(agent) < half * 0.5f64.sqrt()).count();
        assert!((inner as f64 / 2000.0 - 0.5).abs() < 4.5 * 0.0112, "{arena}: {inner}");
    }
}

#[test]
fn the_disc_has_the_density_that_was_asked_for() {
    // Uniform in a disc: r² is uniform, its mean R²/2 has standard error R²/√(12 n); 4.5 of them.
    let toml = "scenario = { kind = 'disc', density_per_m2 = 0.22 }\ncontroller.kind = 'hold'";
    let n = 4000;
    let states = Swarm::default().configure(&setup(toml, n, 2)).unwrap().states;
    let largest = n as f64 / (0.22 * std::f64::consts::PI);
    let squares: Vec<f64> =
        states.x_m.iter().zip(&states.y_m).map(|(x, y)| (x * x + y * y) / largest).collect();
    assert!(squares.iter().all(|square| *square <= 1.0));
    let mean = squares.iter().sum::<f64>() / n as f64;
    assert!((mean - 0.5).abs() < 4.5 / (12.0 * n as f64).sqrt(), "{mean}");
}

#[test]
fn the_line_alternates_sides_two_metres_apart() {
    let toml = "scenario = { kind = 'line', jitter_m = 0 }\ncontroller.kind = 'hold'";
    let states = Swarm::default().configure(&setup(toml, 6, 2)).unwrap().states;
    assert_eq!(states.y_m, [0.0, 2.0, -2.0, 4.0, -4.0, 6.0]);
    assert_eq!(states.x_m, [0.0; 6]);
    let toml = "scenario.kind = 'line'\ncontroller.kind = 'hold'";
    let states = Swarm::default().configure(&setup(toml, 6, 2)).unwrap().states;
    for (jittered, exact) in states.y_m.iter().zip([0.0f64, 2.0, -2.0, 4.0, -4.0, 6.0]) {
        assert!((jittered - exact).abs() <= 0.25 && (*jittered != exact || exact == 0.0));
    }
}

#[test]
fn before_anything_was_on_the_air_followers_stay_and_no_line_is_done() {
    let mut air = Air::new(&setup(FLOCKING, 3, 1), |_, _, _, _| true);
    let states = air.step().states;
    assert_eq!(states.vx_mps, [7.0, 0.0, 0.0]);
    let mut air = Air::new(&setup(LINE, 3, 1), |_, _, _, _| false);
    assert!(!air.step().task_complete, "nobody was on the air yet");
    assert!(air.step().task_complete, "everyone was on the air, nobody was heard: all are content");
}

#[test]
fn knowledge_of_the_truth_needs_no_deliveries() {
    let toml = format!("knowledge = 'truth'\n{LINE}");
    let mut air = Air::new(&setup(&toml, 3, 1), |_, _, _, _| false);
    assert!(!air.step().task_complete);
    assert!(air.states.vx_mps.iter().any(|v| *v != 0.0));
}

#[test]
fn what_a_foreign_robot_says_is_counted_and_not_read() {
    let mut air = Air::new(&setup(FLOCKING, 3, 1), |_, _, _, _| true);
    air.step();
    let deliveries = air.deliveries.as_mut().unwrap();
    let mut data = vec![7; 5];
    data.extend_from_slice(&deliveries.transmissions.payloads.data()[48..]);
    deliveries.transmissions.payloads = Payloads::new(vec![5, 48, 48], data.into()).unwrap();
    let step = air.step;
    let output = air.swarm.step(&RobotInput {
        step: step + 1,
        from_ns: 100_000_000,
        until_ns: 200_000_000,
        deliveries: air.deliveries.as_ref(),
        motes: None,
        commands: &[],
        hold: false,
    });
    assert_eq!(air.swarm.n_foreign_payloads(), 1);
    assert!(output.states.vy_mps[1] != 0.0, "the other follower was heard");
}

#[test]
fn robots_with_headings_face_where_they_move() {
    let toml = "scenario = { kind = 'csv', file = 'p' }\ncontroller.kind = 'hold'";
    let mut setup = setup(toml, 2, 0);
    setup.files.insert("p".to_owned(), "agent,x_m,y_m,heading_rad\n0,3,4,1\n1,0,0,2\n".into());
    let mut air = Air::new(&setup, |_, _, _, _| true);
    air.step_with(&[order(0, AgentOrder::Velocity([0.0, -1.0, 0.0]))]);
    assert_eq!(air.states.heading_rad, [-std::f64::consts::FRAC_PI_2, 2.0]);
}

#[test]
fn a_swarm_that_is_told_to_hold_stands_still_and_then_does_what_it_would_have_done() {
    for toml in [FLOCKING, LINE, JUMPS] {
        let mut held = Air::new(&setup(toml, 9, 3), |_, _, _, _| true);
        let begin = held.states.clone();
        for _ in 0..4 {
            let output = held.step_held(&[], true);
            assert_eq!(output.states, begin, "{toml}");
            assert!(!output.task_complete && !output.payloads.data().is_empty(), "{toml}");
        }
        // Deliveries and the step's number as at that moment: a swarm that has never held does the same.
        let mut fresh = Air::new(&setup(toml, 9, 3), |_, _, _, _| true);
        (fresh.step, fresh.deliveries) = (held.step, held.deliveries.clone());
        assert_eq!(held.step().states, fresh.step().states, "{toml}");
    }
}

#[test]
fn an_order_that_comes_while_they_hold_is_obeyed_afterwards() {
    let mut air = Air::new(&setup(HOLD, 1, 1), |_, _, _, _| true);
    let up = order(0, AgentOrder::Velocity([0.0, 0.0, 2.0]));
    assert_eq!(air.step_held(&[up], true).states.vz_mps, [0.0]);
    assert_eq!(air.step().states.vz_mps, [2.0]);
}
