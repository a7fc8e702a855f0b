//! Robots that come late and robots that are lost.

use crate::air::{Air, setup};
use proto::side::RobotSimulator as _;
use robotsim::sim::Swarm;

/// Robot 1 comes after 1 s, robot 2 is lost after 0.5 s, robot 3 is away from 0.5 s to 1.2 s.
const TOML: &str = "scenario.kind = 'line'\n\
                    controller = { kind = 'constant-velocity', velocity_mps = [2, 0] }\n\
                    dynamics = { kind = 'double-integrator', acceleration_cap_mps2 = 5 }\n\
                    memory.keep_s = 9\n\
                    [[absence]]\nrobots = [1]\nuntil_s = 1\n\
                    [[absence]]\nrobots = [2, 3]\nfrom_s = 0.5\nuntil_s = 1.2\n\
                    [[absence]]\nrobots = [2]\nfrom_s = 1.2\n";

#[test]
fn robots_come_and_go_at_their_times_and_stand_where_they_were() {
    let mut air = Air::new(&setup(TOML, 4, 1), |_, _, _, _| true);
    let alive = |air: &Air<_>| (0..4).map(|robot| air.states.alive.get(robot)).collect::<Vec<_>>();
    assert_eq!(alive(&air), [true, false, true, true]);
    let begin = air.states.clone();
    let mut lost_m = [0.0; 3];
    for step in 1..=30 {
        air.step();
        let expected = [true, 10 <= step, step < 5, !(5..12).contains(&step)];
        assert_eq!(alive(&air), expected, "step {step}");
        if step == 5 {
            lost_m = air.states.position_m(2);
            // Until then it went: 5 m/s² for 0.4 s, then 2 m/s.
            assert!((lost_m[0] - begin.x_m[2] - 0.6).abs() < 1e-12, "{lost_m:?}");
        }
        if 5 <= step {
            assert_eq!(air.states.position_m(2), lost_m);
            assert!(air.states.vx_mps[2].abs() < 1e-300);
        }
        if step <= 10 {
            assert_eq!(air.states.position_m(1), begin.position_m(1));
        }
    }
    // They set out from rest: 0.4 m, then 2 m/s for what is left of 3 s, robot 3 for the second time.
    let way_m = |robot: usize| air.states.x_m[robot] - begin.x_m[robot];
    assert!((way_m(1) - (0.4 + 2.0 * 1.6)).abs() < 1e-12, "{}", way_m(1));
    assert!((way_m(3) - (0.6 + 0.4 + 2.0 * 1.4)).abs() < 1e-12, "{}", way_m(3));
}

#[test]
fn times_are_counted_from_when_robots_start() {
    let mut air = Air::new(&setup(TOML, 4, 1), |_, _, _, _| true);
    for _ in 0..40 {
        air.step_held(&[], true);
    }
    assert!(!air.states.alive.get(1) && air.states.alive.get(2));
    for _ in 0..10 {
        air.step();
    }
    assert!(air.states.alive.get(1) && !air.states.alive.get(2));
}

#[test]
fn nothing_meets_a_robot_that_is_not_there() {
    // Robot 0 drives along the line where robot 1 stands.
    let way_m = |absence: &str| {
        let toml = format!(
            "contacts.kind = 'resolve'\nscenario = {{ kind = 'line', jitter_m = 0 }}\n\
             controller = {{ kind = 'constant-velocity', velocity_mps = [0, 0] }}\n{absence}"
        );
        let mut air = Air::new(&setup(&toml, 2, 1), |_, _, _, _| true);
        let (begin, other) = (air.states.position_m(0), air.states.position_m(1));
        let towards: [f64; 3] = std::array::from_fn(|i| (other[i] - begin[i]) / 2.0);
        let order = proto::types::AgentOrder::Velocity(towards);
        air.step_with(&[proto::types::AgentCommand { agent: 0, source: "test".into(), order }]);
        (0..30).for_each(|_| drop(air.step()));
        air.states.position_m(1) == other
    };
    assert!(!way_m(""), "it is pushed");
    assert!(way_m("[[absence]]\nrobots = [1]\n"));
}

#[test]
fn a_restored_swarm_knows_who_is_there() {
    let mut whole = Air::new(&setup(TOML, 4, 1), |_, _, _, _| true);
    (0..7).for_each(|_| drop(whole.step()));
    let mut parts = Air::new(&setup(TOML, 4, 1), |_, _, _, _| true);
    parts.swarm = Swarm::default();
    parts.swarm.restore(&whole.swarm.snapshot()).unwrap();
    (parts.step, parts.states) = (whole.step, whole.states.clone());
    parts.deliveries = whole.deliveries.clone();
    for _ in 0..10 {
        assert_eq!(whole.step().states, parts.step().states);
    }
    assert_eq!(whole.swarm.snapshot(), parts.swarm.snapshot());
}

#[test]
fn absences_of_nobody_and_of_no_time_are_refused() {
    let toml = "scenario.kind = 'line'\ncontroller.kind = 'hold'\n\
                [[absence]]\nrobots = [1, 2]\n\
                [[absence]]\nrobots = [0]\nfrom_s = 3\nuntil_s = 3\n";
    let problems = Swarm::default().configure(&setup(toml, 2, 1)).unwrap_err();
    insta::assert_snapshot!(
        problems.iter().map(ToString::to_string).collect::<Vec<_>>().join("\n"),
        @r"
    robotsim.absence[0].robots: must be less than the number of robots, 2, got 2
    robotsim.absence[1].until_s: must be later than from_s, 3.0, got 3.0
    "
    );
}
