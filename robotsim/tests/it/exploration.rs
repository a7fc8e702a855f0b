//! Rooms that are explored: whole swarms, and a network that carries messages or does not.

use crate::air::setup;
use proto::side::{RobotInput, RobotOutput, RobotSimulator, Setup};
use proto::site::{Site, Wall};
use proto::types::{AgentMessage, AgentStates, Deliveries, Heard, Payloads, Transmissions};
use robotsim::sim::Swarm;

const PERIOD_NS: u64 = 500_000_000;

/// Two rooms of 6 m by 6 m with a door of 2 m, a third that is walled up, and five robots in the first.
fn rooms(more: &str) -> Setup {
    rooms_with(more, "")
}

/// As [`rooms`], with another key of the controller.
fn rooms_with(more: &str, key: &str) -> Setup {
    let wall = |from_m, to_m| Wall { from_m, to_m, height_m: None, material: None };
    let toml = format!(
        "scenario = {{ kind = 'square', side_m = 2 }}\n{more}\n[controller]\nkind = 'exploration'\nfrom_m = [-3.0, -3.0]\n\
         to_m = [15.0, 3.0]\nrange_m = 3.0\nspeed_mps = 1.0\nretry_s = 3.0\n{key}\n"
    );
    let mut setup = setup(&toml, 5, 1);
    setup.experiment.step_ns = PERIOD_NS;
    setup.site = Site {
        wall: vec![
            wall([3.0, -3.0], [3.0, -1.0]),
            wall([3.0, 1.0], [3.0, 3.0]),
            wall([9.0, -3.0], [9.0, 3.0]),
        ],
        ..Site::default()
    };
    setup
}

/// A swarm and a network that carries the messages that `carries` lets through, each in the period in which it is sent.
struct Rooms<F> {
    swarm: Swarm,
    states: AgentStates,
    step: u64,
    deliveries: Option<Deliveries>,
    carries: F,
}

impl<F: FnMut(u64, &AgentMessage) -> bool> Rooms<F> {
    fn new(setup: &Setup, carries: F) -> Self {
        let mut swarm = Swarm::default();
        let start = swarm.configure(setup).expect("the configuration is valid");
        Self { swarm, states: start.states, step: 0, deliveries: None, carries }
    }

    fn step(&mut self) -> RobotOutput {
        self.step += 1;
        let output = self.swarm.step(&RobotInput {
            step: self.step,
            from_ns: (self.step - 1) * PERIOD_NS,
            until_ns: self.step * PERIOD_NS,
            deliveries: self.deliveries.as_ref(),
            motes: None,
            commands: &[],
            hold: false,
        });
        self.states = output.states.clone();
        let step = self.step;
        let sent: Vec<AgentMessage> = output
            .messages
            .iter()
            .filter(|message| (self.carries)(step, message))
            .cloned()
            .collect();
        self.deliveries = Some(delivered(&sent, self.states.len(), step));
        output
    }

    /// Steps until the robots are done, at most so often.
    fn run(&mut self, n_max: u64) -> RobotOutput {
        loop {
            let output = self.step();
            if output.task_complete || self.step == n_max {
                return output;
            }
        }
    }
}

/// Messages as deliveries: each a transmission that its destination alone heard.
fn delivered(sent: &[AgentMessage], n: usize, step: u64) -> Deliveries {
    let begins_ns = (step - 1) * PERIOD_NS;
    let mut sent: Vec<&AgentMessage> = sent.iter().collect();
    sent.sort_by_key(|message| message.sender);
    let (mut ends, mut indices) = (Vec::new(), Vec::new());
    for receiver in 0..n as u32 {
        let heard = (0..).zip(&sent).filter(|(_, message)| message.destination == receiver);
        indices.extend(heard.map(|(index, _): (u32, _)| index));
        ends.push(indices.len() as u32);
    }
    let data: Vec<u8> = sent.iter().flat_map(|message| message.payload.to_vec()).collect();
    let lengths = sent.iter().map(|message| message.payload.len() as u32).collect();
    Deliveries {
        transmissions: Transmissions {
            sender: sent.iter().map(|message| message.sender).collect(),
            sent_ns: vec![begins_ns; sent.len()],
            end_ns: vec![begins_ns + 1; sent.len()],
            payloads: Payloads::new(lengths, data.into())
                .expect("as much data as the lengths add up to"),
            ..Transmissions::default()
        },
        heard: Heard::Lists { ends, indices },
        ..Deliveries::default()
    }
}

fn figure(output: &RobotOutput, name: &str) -> Option<f64> {
    output.figures.iter().find(|figure| figure.name == name).map(|figure| figure.value)
}

#[test]
fn with_perfect_communication_all_that_robots_can_get_to_is_mapped() {
    let mut rooms = Rooms::new(&rooms(""), |_, _| true);
    let output = rooms.run(400);
    assert!(output.task_complete, "after {} steps", rooms.step);
    assert_eq!(figure(&output, "mapped_ratio"), Some(1.0));
    assert_eq!(figure(&output, "seen_ratio"), Some(1.0));
    let mapped_90_s = figure(&output, "mapped_90_s").unwrap();
    assert!(0.0 < mapped_90_s && mapped_90_s < rooms.step as f64 * 0.5);
    // From the door, at x = 3, the far wall of the second room is 6 m away, and robots see 3 m far.
    assert!(rooms.states.x_m.iter().any(|&x_m| 5.0 < x_m), "{:?}", rooms.states.x_m);
    assert!(rooms.states.x_m.iter().all(|&x_m| x_m < 9.0), "nobody went through the wall");
    assert_eq!(figure(&output, "map_reports_repeated"), Some(0.0));
    // A report takes a period, and waits for its turn for a second at most but in a burst.
    let delay_s = figure(&output, "map_delay_s").unwrap();
    assert!((0.25..3.0).contains(&delay_s), "{delay_s}");
}

#[test]
fn without_a_network_nothing_arrives_and_the_robots_stay() {
    let mut rooms = Rooms::new(&rooms(""), |_, _| false);
    let (begin, base) = (rooms.states.clone(), 0);
    let output = rooms.run(100);
    assert!(!output.task_complete);
    assert_eq!((&rooms.states.x_m, &rooms.states.y_m), (&begin.x_m, &begin.y_m));
    // On the map is what the base sees, and nothing else.
    assert!(figure(&output, "mapped_ratio") <= figure(&output, "seen_ratio"));
    assert_eq!(figure(&output, "map_delay_s"), Some(0.0));
    assert_eq!(figure(&output, "waypoint_orders"), Some(0.0), "robot {base} has heard of nobody");
    let repeated = figure(&output, "map_reports_repeated").unwrap();
    assert!(10.0 < repeated, "{repeated} reports were sent again");
}

#[test]
fn orders_alone_that_are_lost_keep_robots_where_they_are() {
    let setup = rooms("");
    let mut rooms = Rooms::new(&setup, |_, message| message.destination == 0);
    let begin = rooms.states.clone();
    let output = rooms.run(100);
    assert_eq!(rooms.states.x_m, begin.x_m);
    assert!(0.0 < figure(&output, "waypoint_orders").unwrap());
    assert!(!output.task_complete);
}

#[test]
fn lost_messages_are_sent_again_until_all_is_mapped() {
    // Half of the messages are lost, as a generator says (xorshift, Marsaglia 2003) that keeps no rhythm with the robots.
    let mut dice = 1_u32;
    let mut rooms = Rooms::new(&rooms(""), |_, _| {
        dice ^= dice << 13;
        dice ^= dice >> 17;
        dice ^= dice << 5;
        dice >> 31 == 0
    });
    let output = rooms.run(2000);
    assert!(output.task_complete, "{:?}", output.figures);
    assert_eq!(figure(&output, "mapped_ratio"), Some(1.0));
    assert!(0.0 < figure(&output, "map_reports_repeated").unwrap());
}

#[test]
fn the_truth_needs_no_network_and_is_faster() {
    let mut told = Rooms::new(&rooms("knowledge = 'truth'"), |_, _| panic!("nothing is sent"));
    let output = told.run(400);
    assert!(output.task_complete);
    assert_eq!(figure(&output, "mapped_ratio"), Some(1.0));
    assert_eq!(figure(&output, "map_delay_s"), Some(0.0));
    let mut heard = Rooms::new(&rooms(""), |_, _| true);
    heard.run(400);
    assert!(told.step < heard.step, "{} steps against {}", told.step, heard.step);
}

#[test]
fn robots_stay_in_cells_that_are_free() {
    let mut rooms = Rooms::new(&rooms("[contacts]\nkind = 'resolve'\n"), |_, _| true);
    for _ in 0..200 {
        rooms.step();
        for agent in 0..5 {
            let [x_m, y_m, _] = rooms.states.position_m(agent);
            // The wall beside the door fills the cells from x = 3 to 3.5.
            assert!(!(3.0..3.5).contains(&x_m) || y_m.abs() < 1.0, "robot {agent} at {x_m}, {y_m}");
        }
    }
}

#[test]
fn a_saved_exploration_goes_on_as_if_it_had_never_stopped() {
    let setup = rooms("");
    let mut whole = Rooms::new(&setup, |step, _| step % 4 != 0);
    let mut first = Rooms::new(&setup, |step, _| step % 4 != 0);
    for _ in 0..40 {
        whole.step();
        first.step();
    }
    let mut second = Rooms::new(&setup, |step, _| step % 4 != 0);
    second.swarm.restore(&first.swarm.snapshot()).unwrap();
    (second.step, second.deliveries) = (first.step, first.deliveries.clone());
    for _ in 0..40 {
        let (expected, output) = (whole.step(), second.step());
        assert_eq!(output.states, expected.states);
        assert_eq!(output.messages, expected.messages);
        assert_eq!(output.figures, expected.figures);
    }
    let mut other = Swarm::default();
    other
        .configure(&crate::air::setup("scenario.kind = 'line'\ncontroller.kind = 'hold'", 5, 1))
        .unwrap();
    assert!(other.restore(&first.swarm.snapshot()).is_ok(), "a state brings its configuration");
}

#[test]
fn what_cannot_be_explored_is_refused() {
    let problems = |toml: &str, n: usize| {
        let mut swarm = Swarm::default();
        let problems = swarm.configure(&setup(toml, n, 1)).unwrap_err();
        problems.iter().map(ToString::to_string).collect::<Vec<_>>().join("\n")
    };
    let config_with = |more: &str| {
        let area = "kind = 'exploration'\nfrom_m = [-3.0, -3.0]\nto_m = [15.0, 3.0]";
        format!("scenario = {{ kind = 'square', side_m = 2 }}\n[controller]\n{area}\n{more}\n")
    };
    insta::assert_snapshot!(
        [
            problems(&config_with("cell_m = 0.02\nrange_m = 3.0"), 5),
            problems(&config_with("range_m = 0.6\nretry_s = 0.5\nbase = 5\nspeed_mps = 40.0"), 5),
            problems(&config_with(""), 1),
            problems(&config_with("").replace("15.0, 3.0", "15.0, -3.0"), 5),
            problems(&config_with("").replace("15.0, 3.0", "0.0, 3.0"), 5),
            problems(&format!("{}[contacts]\nkind = 'resolve'\n", config_with("cell_m = 0.2")), 5),
            problems(&format!("{}[[group]]\ncount = 5\n", config_with("")), 5),
        ]
        .join("\n"),
        @r#"
    robotsim.controller.cell_m: must be larger: it divides this area into more than 65535 cells, got 0.02 (nearest valid: 0.05)
    robotsim.controller.speed_mps: must not exceed dynamics.speed_cap_mps = 30 m/s, got 40 m/s
    robotsim.controller.range_m: must be at least 1.5 cells of cell_m = 0.5, got 0.6 (nearest valid: 0.75)
    robotsim.controller.retry_s: must be at least report_s = 1.0, got 0.5 (nearest valid: 1.0)
    robotsim.controller.base: must be the number of a robot, 0 to 4, got 5 (nearest valid: 4)
    robotsim.controller.base: requires experiment.agents of at least 2: a base and robots that explore
    robotsim.controller.to_m: must lie north-east of from_m = [-3.0, -3.0], as a corner of an area, got [15.0, -3.0]
    robotsim.scenario: must place all robots inside the area from controller.from_m to controller.to_m; 5 start outside, the first is robot 0, got [0.4090511656637279, 0.4159747270463243]
    robotsim.controller.cell_m: must be at least diameter_m = 0.3 if contacts are resolved, because robots drive through gaps of one cell, got 0.2 (nearest valid: 0.3)
    robotsim.group: must be absent if robots explore, because exploration needs one swarm with one base, got 1
    "#
    );
}

#[test]
fn robots_beyond_reach_come_back_with_what_they_have_seen_if_they_are_told_to() {
    // The network ends at the door: who is in the second room says nothing and hears nothing.
    let explored = |more: &str| {
        let x_m = std::cell::RefCell::new(vec![0.0; 5]);
        let within = |agent: u32| x_m.borrow()[agent as usize] < 3.0;
        let carries =
            |_: u64, message: &AgentMessage| within(message.sender) && within(message.destination);
        let setup = rooms_with("", more);
        let mut rooms = Rooms::new(&setup, carries);
        for _ in 0..1000 {
            let output = rooms.step();
            x_m.borrow_mut().clone_from(&rooms.states.x_m);
            if output.task_complete {
                return (true, figure(&output, "mapped_ratio"));
            }
        }
        (false, rooms.states.x_m.iter().copied().reduce(f64::max))
    };
    assert_eq!(explored("return_after_s = 5.0"), (true, Some(1.0)));
    assert!(!explored("").0, "nobody comes back, and yet all is mapped");
}
