//! A user's own kinds, all in this file: each is added to the catalogue by one call, and then is configured, refused, described
//! and simulated as those that are built in.

use crate::air::setup;
use proto::config::{Section, variant};
use proto::effect::Catalogued;
use proto::ids::AgentId;
use proto::rng::Draws;
use proto::side::{RobotInput, RobotSimulator as _};
use robotsim::catalogue::Catalogue;
use robotsim::controller::{self, Controller, Demands, Goal, View};
use robotsim::dynamics::Command;
use robotsim::dynamics::effect::{self, Effect, Situation};
use robotsim::scenario::{self, Place, Scenario};
use robotsim::sim::Swarm;

static DRIFT: effect::Entry = effect::Entry::of::<EastDrift>();
/// A drift to the east.
///
/// # Mechanism
///
/// Something carries the robots.
///
/// # Equation
///
/// v = u + east_mps
///
/// # Source
///
/// An example: not taken from the literature.
///
/// # Validity
///
/// The same at all times and places.
///
/// # Trace
///
/// An error to the east.
#[derive(Debug, Catalogued, Section)]
#[effect(name = "east-drift")]
struct EastDrift {
    /// Velocity of the drift (m/s).
    #[key(range = 0.0..=9.0, default = 1.0)]
    east_mps: f64,
}

impl Effect for EastDrift {
    fn drift_mps(&self, _at: &Situation<'_>) -> [f64; 3] {
        [self.east_mps, 0.0, 0.0]
    }

    fn drifts(&self) -> bool {
        true
    }
}

/// `kind = "rise"`.
static RISE: controller::Entry = controller::Entry {
    variant: variant::<Rise>("rise"),
    demands: Demands::NONE,
    goal: Goal::Other,
    build: |table, context, problems| {
        let rise = Rise::read(table);
        if context.speed_cap_mps < rise.up_mps {
            problems.push(context.problem("up_mps", "is beyond the cap").value(rise.up_mps));
        }
        Some(Box::new(rise))
    },
};

/// Robots that rise.
#[derive(Debug, Section)]
struct Rise {
    /// How fast (m/s).
    #[key(range = 0.0..=9.0, default = 1.0)]
    up_mps: f64,
}

impl Controller for Rise {
    fn command(&self, _view: &View<'_>, _agent: AgentId) -> Command {
        Command::Velocity([0.0, 0.0, self.up_mps])
    }
}

/// `kind = "leap"`.
static LEAP: controller::Entry = controller::Entry {
    variant: variant::<Leap>("leap"),
    demands: Demands { jumps: true, sends_messages: true },
    goal: Goal::Other,
    build: |_, _, _| Some(Box::new(Leap)),
};

/// Robots that jump up, and ask a network to carry messages.
#[derive(Debug, Section)]
struct Leap;

impl Controller for Leap {
    fn command(&self, _view: &View<'_>, _agent: AgentId) -> Command {
        Command::Jump([0.0, 0.0, 1.0])
    }
}

/// `kind = "tower"`.
static TOWER: scenario::Entry = scenario::Entry {
    variant: variant::<Tower>("tower"),
    build: |table, _, _| Some(Box::new(Tower::read(table))),
};

/// One robot above the other.
#[derive(Debug, Section)]
struct Tower {
    /// Height of a floor (m).
    #[key(range = 0.0..=9.0, default = 1.0)]
    floor_m: f64,
}

impl Scenario for Tower {
    fn place(&self, agent: AgentId, _n_agents: usize, _draws: Draws) -> Place {
        Place { position_m: [0.0, 0.0, f64::from(agent.0) * self.floor_m], heading_rad: None }
    }
}

fn catalogue() -> Catalogue {
    let mut catalogue = Catalogue::default();
    catalogue.effects.add(&DRIFT);
    catalogue.controllers.add(&RISE);
    catalogue.controllers.add(&LEAP);
    catalogue.scenarios.add(&TOWER);
    catalogue
}

const ALL: &str = "scenario = { kind = 'tower', floor_m = 3 }\n\
    controller = { kind = 'rise', up_mps = 2 }\n\
    [[dynamics.effect]]\nkind = 'east-drift'\neast_mps = 4";

#[test]
fn robots_begin_want_and_drift_as_they_say_and_a_saved_swarm_goes_on() {
    let mut swarm = Swarm::with_catalogue(catalogue());
    let start = swarm.configure(&setup(ALL, 2, 1)).expect("a valid configuration");
    assert_eq!([0, 1].map(|agent| start.states.position_m(agent)), [[0.0; 3], [0.0, 0.0, 3.0]]);
    let input = |step: u64| RobotInput {
        step,
        from_ns: (step - 1) * 500_000_000,
        until_ns: step * 500_000_000,
        deliveries: None,
        motes: None,
        commands: &[],
        hold: false,
    };
    let states = swarm.step(&input(1)).states;
    assert_eq!(states.position_m(1), [2.0, 0.0, 4.0]);
    let mut other = Swarm::with_catalogue(catalogue());
    other.restore(&swarm.snapshot()).unwrap();
    assert_eq!(other.step(&input(2)).states, swarm.step(&input(2)).states);
    assert!(Swarm::default().restore(&swarm.snapshot()).is_err());
}

#[test]
fn each_is_refused_by_its_own_range_and_unknown_where_it_was_not_added() {
    let refusal = |toml: &str, catalogue: &Catalogue| {
        let problems = robotsim::config::read(&setup(toml, 2, 1), catalogue).expect_err("wrong");
        problems.iter().map(ToString::to_string).collect::<Vec<_>>().join("\n")
    };
    let wrong = ALL.replace("= 3", "= 10").replace("= 2", "= 11").replace("= 4", "= 12");
    insta::assert_snapshot!(refusal(&wrong, &catalogue()), @"
    robotsim.dynamics.effect[0].east_mps: must be from 0 to 9, got 12 (nearest valid: 9)
    robotsim.scenario.floor_m: must be from 0 to 9, got 10 (nearest valid: 9)
    robotsim.controller.up_mps: must be from 0 to 9, got 11 (nearest valid: 9)
    ");
    let slow = format!("dynamics.speed_cap_mps = 1\n{ALL}");
    insta::assert_snapshot!(refusal(&slow, &catalogue()), @"robotsim.controller.up_mps: is beyond the cap, got 2");
    let solid = "diameter_m = 1\ncontacts.kind = 'resolve'\nscenario.kind = 'tower'\n\
                 controller.kind = 'leap'";
    insta::assert_snapshot!(refusal(solid, &catalogue()), @r#"robotsim.contacts.kind: must be "count" with leap, whose robots have no path between two places, got "resolve""#);
    let unknown = refusal(ALL, Catalogue::built_in());
    assert_eq!(unknown.lines().filter(|line| line.contains("must be one of")).count(), 3);
}

#[test]
fn each_is_in_the_schema_with_its_keys() {
    let schema = Swarm::with_catalogue(catalogue()).config_schema_json();
    let built_in = Swarm::default().config_schema_json();
    for (name, key) in [("east-drift", "east_mps"), ("rise", "up_mps"), ("tower", "floor_m")] {
        assert!(schema.contains(&format!("{{\"const\":{name:?}}}")), "{name}");
        assert!(schema.contains(&format!("{key:?}:{{")), "{key}");
        assert!(!built_in.contains(&format!("{{\"const\":{name:?}}}")), "{name}");
    }
}

#[test]
fn a_controller_says_whether_its_robots_send_messages_through_the_network() {
    let messaging = |toml: &str| {
        let (_, effective) = robotsim::config::read(&setup(toml, 2, 1), &catalogue())
            .expect("a valid configuration");
        robotsim::config::messaging_controller(&effective, &catalogue())
    };
    let leap = "scenario.kind = 'tower'\ncontroller.kind = 'leap'";
    assert_eq!(messaging(leap), Some("leap"));
    assert_eq!(messaging(&format!("knowledge = 'truth'\n{leap}")), None);
    assert_eq!(messaging(ALL), None);
}
