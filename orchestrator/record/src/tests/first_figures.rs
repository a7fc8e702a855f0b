//! The figures that a run leads with, and the warnings of runs that they flatter.

use super::made_up::{STEP_NS, configured, header};
use super::{complete, json};
use crate::measurer::Measurer;
use crate::run_summary::RunSummary;
use crate::{RunHeader, StepRecord};
use metrics::headline::HEADLINES;
use metrics::task::{Catalogue, Goal};
use proto::exchange::{Configured, NetworkStep, RobotsStart, RobotsStep};
use proto::types::{AgentStates, Payloads, TaskFigure};
use std::collections::BTreeSet;
use std::sync::Arc;

/// Keys that some controllers have, of a leader that goes east at 2 m/s.
const KEYS: &str = "leader_velocity_mps = [2.0, 0.0]\ndistance_m = 1.0\nfrom_m = [-3.0, -3.0]\nto_m = [3.0, 3.0]\n";

/// A run of robots with this controller, where they are after each step, from step 0 on.
fn run(controller: &str, places: &[AgentStates], figures: &[TaskFigure]) -> RunSummary {
    run_with(controller, places, figures, false)
}

/// A run of robots that regard their task as done after a step in which they stay.
fn run_until_done(controller: &str, places: &AgentStates) -> RunSummary {
    run_with(controller, &[places.clone(), places.clone()], &[], true)
}

fn run_with(
    controller: &str,
    places: &[AgentStates],
    figures: &[TaskFigure],
    task_complete: bool,
) -> RunSummary {
    let n = places[0].len();
    let header = RunHeader { agent_count: n as u32, ..header("run") };
    let Configured { robots_start, network_request, network_start, mut robots_request } =
        configured(&header);
    robots_request.experiment.agent_count = n;
    let robots_start = RobotsStart {
        effective_toml: format!("diameter_m = 0.3\n[controller]\nkind = \"{controller}\"\n{KEYS}"),
        states: places[0].clone(),
        ..robots_start
    };
    let configured = Configured { robots_request, robots_start, network_request, network_start };
    let mut measurer = Measurer::new(header, configured).unwrap();
    for (step, states) in (1..).zip(&places[1..]) {
        let time_ns = step * STEP_NS;
        let robots = RobotsStep {
            step,
            time_ns,
            states: states.clone(),
            payloads: Payloads::silence(n),
            figures: figures.to_vec(),
            task_complete,
            ..RobotsStep::default()
        };
        let network = NetworkStep { step, time_ns, ..NetworkStep::default() };
        let (robots, network) = (Arc::new(robots), Arc::new(network));
        let (commands, digest) = (Vec::new(), [0; 32]);
        measurer.step(StepRecord { step, time_ns, robots, network, commands, digest }).unwrap();
    }
    measurer.finish(&complete()).unwrap()
}

/// Six robots on a circle of 2 m.
fn hexagon() -> AgentStates {
    let places: Vec<[f64; 2]> = (0..6)
        .map(|robot| {
            let angle = f64::from(robot) * std::f64::consts::FRAC_PI_3;
            [2.0 * angle.cos(), 2.0 * angle.sin()]
        })
        .collect();
    AgentStates::at_rest(&places)
}

fn warns(summary: &RunSummary, word: &str) -> bool {
    summary.warnings.iter().any(|warning| warning.contains(word))
}

#[test]
fn each_controller_has_a_first_figure_that_its_runs_lead_with() {
    let mapped = [TaskFigure { name: "mapped_ratio".to_owned(), value: 0.5 }];
    for entry in Catalogue::built_in().controllers.iter() {
        let name = entry.variant.name;
        assert_ne!(entry.goal, Goal::Other, "{name}");
        let mut moved = hexagon();
        moved.vx_mps = vec![1.0; 6];
        let summary = run(name, &[hexagon(), moved.clone(), moved], &mapped);
        let task = summary.task.as_ref().unwrap();
        let first = task.first_figure.as_deref().unwrap();
        if entry.goal == Goal::Carry {
            // Nobody sent anything here, so that a network has no figure.
            assert_eq!(first, "network.delivery_ratio", "{name}");
            continue;
        }
        let (headline, shown, value) = summary.first_figure().unwrap();
        assert!(headline.goals.contains(&entry.goal) && value.is_finite(), "{name}: {value}");
        assert_eq!(task.figures.keys().next().map(String::as_str), shown.of_task(), "{name}");
        for beside in headline.beside {
            assert!(
                task.figures.contains_key(beside.of_task().unwrap()),
                "{name}: {}",
                beside.path
            );
        }
        let floor = headline.floor.map(|path| (path, summary.number(path)));
        assert!(floor.is_none_or(|(_, value)| value.is_some()), "{name}: {floor:?}");
    }
}

#[test]
fn each_goal_has_one_headline() {
    let goals = || HEADLINES.iter().flat_map(|headline| headline.goals);
    let distinct: BTreeSet<String> = goals().map(|goal| format!("{goal:?}")).collect();
    assert_eq!(distinct.len(), goals().count());
    let paths = || HEADLINES.iter().flat_map(|headline| headline.first);
    let distinct: BTreeSet<&str> = paths().map(|shown| shown.path).collect();
    assert_eq!(distinct.len(), paths().count(), "a first figure does not say of which goal");
}

/// Ten steps of a leader that goes east at 2 m/s, and of followers with these velocities (m/s) in even and odd steps.
fn flock(followers_mps: [[f64; 2]; 2]) -> RunSummary {
    let at = |step: usize| {
        let mut states = AgentStates::at_rest(&[[0.0, 0.0], [5.0, 0.0], [10.0, 0.0], [15.0, 0.0]]);
        let [vx, vy] = followers_mps[step % 2];
        states.vx_mps = vec![2.0, vx, vx, vx];
        states.vy_mps = vec![0.0, vy, vy, vy];
        states
    };
    run("flocking", &(0..=10).map(at).collect::<Vec<_>>(), &[])
}

#[test]
fn robots_that_thrash_have_a_high_flock_speed_and_get_nowhere() {
    // All swing together at 20 m/s, north and south in turn.
    let summary = flock([[0.0, 20.0], [0.0, -20.0]]);
    let task = summary.task.as_ref().unwrap();
    let number = |name: &str| task.number(name).unwrap();
    assert!(7.0 * number("leader_speed_mps") < number("flock_speed_mps"), "{}", json!(task));
    assert!((number("speed_along_leader_mps") - 0.5).abs() < 1e-12);
    assert!((number("leader_speed_ratio") - 0.25).abs() < 1e-12);
    assert!((number("thrash_factor") - 31.0).abs() < 1e-9);
    assert_eq!(task.first_figure.as_deref(), Some("task.leader_speed_ratio"));
    assert!(task.is_set("thrashing") && warns(&summary, "the robots thrash"));
    assert!(warns(&summary, "task.leader_speed_ratio = 25 % is at its floor: 25 % is"));
    assert!(!warns(&summary, "collision"), "{:?}", summary.warnings);
}

#[test]
fn robots_that_follow_are_not_doubted() {
    // A quarter of their speed across the leader's direction, in turn.
    let summary = flock([[2.0, 0.5], [2.0, -0.5]]);
    let task = summary.task.as_ref().unwrap();
    assert!((task.number("leader_speed_ratio").unwrap() - 1.0).abs() < 1e-12);
    assert!(task.figures.contains_key("thrashing") && !task.is_set("thrashing"));
    for word in ["thrash", "floor", "collision"] {
        assert!(!warns(&summary, word), "{:?}", summary.warnings);
    }
}

#[test]
fn robots_that_hold_are_at_the_floor_and_robots_that_meet_do_not_collide() {
    let stays = |controller: &str| run(controller, &[hexagon(), hexagon()], &[]);
    for controller in ["line-formation", "consensus", "coverage", "dispersion"] {
        assert!(warns(&stays(controller), "is at its floor"), "{controller}");
    }
    // On a circle they stand from the beginning: there is nothing to improve.
    assert!(!warns(&stays("circle-formation"), "is at its floor"));
    let met = AgentStates::at_origin(6);
    let meet = |controller: &str| run(controller, &[hexagon(), met.clone()], &[]);
    assert!(!warns(&meet("consensus"), "collision"));
    assert!(warns(&meet("line-formation"), "15 collisions between robots"));
}

#[test]
fn robots_that_are_done_on_a_line_have_not_formed_a_circle() {
    let row = AgentStates::at_rest(&[[0.0, 0.0], [1.0, 0.0], [2.0, 0.0]]);
    let summary = run_until_done("circle-formation", &row);
    let task = summary.task.as_ref().unwrap();
    assert_eq!((task.number("circle_rms_m"), task.is_set("false_completion")), (None, true));
    assert!(warns(&summary, "do not stand in one shape"));
    assert!(
        !run_until_done("circle-formation", &hexagon()).task.unwrap().is_set("false_completion")
    );
}
