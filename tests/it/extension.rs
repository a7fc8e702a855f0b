//! Effects and controllers of a user's own, all in this file: what is added to the catalogues is listed, tried, found and measured by
//! name nowhere.

use diagnose::Request;
use diagnose::simulate::simulate;
use measure::config::{Catalogues, Compared};
use measure::table::DataTable;
use metrics::Task;
use netsim::mac::effect::{self as mac, Burden, Node};
use network::candidates;
use physics::effect as radio;
use physics::link::Link;
use proto::config::{Registry, Section, variant};
use proto::effect::{Catalogued, Level, Parameter, Role};
use proto::ids::AgentId;
use robotsim::controller::{self, Controller, Demands, Goal, View};
use robotsim::dynamics::Command;
use robotsim::dynamics::effect::{self as robots, Situation};
use std::f64::consts::TAU;
use study::choices::Choices;
use study::{Candidate, Study as _, open};
use tests::answers::{accepted_candidate, diagnosed, measurements as table, model, standard_error};
use tests::campaign::{Campaign, Drive, Fleet, Layout};

/// No curve over time has knots so near each other that it could follow this.
const PERIOD_S: f64 = 3.1;

fn phase(time_s: f64) -> f64 {
    TAU * time_s / PERIOD_S
}

/// How strong it is, which is what a fit finds.
const fn amplitude(key: &'static str, unit: &'static str) -> Parameter {
    Parameter {
        key,
        unit,
        min: -20.0,
        max: 20.0,
        starts: &[0.0],
        step: 0.01,
        null: None,
        plausible: None,
    }
}

/// `kind = "radio-tide"`.
static RADIO_TIDE: radio::Entry = radio::Entry::of::<RadioTide>();

/// A radio whose links are stronger and weaker in turn.
///
/// # Mechanism
///
/// It comes and goes.
///
/// # Equation
///
/// RSSI' = RSSI + tide_db sin(2 pi t / 3.1 s)
///
/// # Source
///
/// None.
///
/// # Validity
///
/// Of tests only.
///
/// # Trace
///
/// Errors that repeat.
#[derive(Debug, Catalogued, Section)]
#[effect(name = "radio-tide", in_runs = Some(&[]))]
struct RadioTide {
    /// How much (dB).
    #[key(range = -20.0..=20.0)]
    #[fit(unit = "dB", starts = [0.0], step = 0.01)]
    tide_db: f64,
}

impl radio::Effect for RadioTide {
    fn contribution_db(&self, link: &Link<'_>) -> f64 {
        self.tide_db * phase(link.time_ns as f64 / 1e9).sin()
    }

    fn max_gain_db(&self) -> f64 {
        self.tide_db.abs()
    }
}

/// `kind = "radio-luck"`.
static RADIO_LUCK: radio::Entry = radio::Entry::new::<RadioLuck>(radio::UNCHECKED, |_, _| None);

/// A random level per node that is called otherwise than that of the catalogue.
///
/// # Mechanism
///
/// It comes and goes.
///
/// # Equation
///
/// RSSI' = RSSI + level
///
/// # Source
///
/// None.
///
/// # Validity
///
/// Of tests only.
///
/// # Trace
///
/// Errors of a node.
#[derive(Catalogued, Section)]
#[effect(
    name = "radio-luck",
    parameters = &[amplitude("tx_sd_db", "dB"), amplitude("rx_sd_db", "dB")],
    level = Level::Random,
    role = Role::RandomPerNode,
)]
struct RadioLuck;

/// `kind = "robot-tide"`.
static ROBOT_TIDE: robots::Entry = robots::Entry::of::<RobotTide>();

/// Robots whose speed alternates between more and less than the commanded one.
///
/// # Mechanism
///
/// It comes and goes.
///
/// # Equation
///
/// v = u (1 + share sin(2 pi t / 3.1 s))
///
/// # Source
///
/// None.
///
/// # Validity
///
/// Of tests only.
///
/// # Trace
///
/// Errors that repeat.
#[derive(Debug, Catalogued, Section)]
#[effect(name = "robot-tide")]
struct RobotTide {
    /// How much.
    #[key(range = -20.0..=20.0)]
    #[fit(starts = [0.0], step = 0.01)]
    share: f64,
}

impl robots::Effect for RobotTide {
    fn drift_mps(&self, at: &Situation<'_>) -> [f64; 3] {
        at.velocity_mps.map(|speed| self.share * phase(at.time_s).sin() * speed)
    }

    fn drifts(&self) -> bool {
        true
    }

    fn varies_on_the_way(&self) -> bool {
        true
    }
}

/// `kind = "light-motes"`.
static LIGHT: mac::Entry = mac::Entry::of::<LightMotes>();

/// Motes on which nothing weighs.
///
/// # Mechanism
///
/// It comes and goes.
///
/// # Equation
///
/// nothing
///
/// # Source
///
/// None.
///
/// # Validity
///
/// Of tests only.
///
/// # Trace
///
/// None.
#[derive(Debug, Catalogued, Section)]
#[effect(name = "light-motes", level = Level::Run)]
struct LightMotes {
    /// How much.
    #[key(range = -20.0..=20.0)]
    #[fit(starts = [0.0], step = 0.01)]
    weight: f64,
}

impl mac::Effect for LightMotes {
    fn weigh(&self, _node: Node, burden: &mut Burden) {
        burden.ack_loss += 0.0 * self.weight;
    }
}

/// `kind = "row"`.
static ROW: controller::Entry = controller::Entry {
    variant: variant::<Row>("row"),
    demands: Demands { jumps: true, ..Demands::NONE },
    goal: Goal::Line,
    build: |_, _, _| Some(Box::new(Row)),
};

/// Robots that stand in a row.
#[derive(Debug, Section)]
struct Row;

impl Controller for Row {
    fn command(&self, _view: &View<'_>, _agent: AgentId) -> Command {
        Command::Velocity([0.0; 3])
    }
}

fn network() -> netsim::catalogue::Catalogue {
    let physics = catalogues().radio;
    let mut network = netsim::catalogue::Catalogue { physics, ..Default::default() };
    network.mac_effects.add(&LIGHT);
    network
}

fn catalogues() -> Catalogues {
    let mut catalogues = Catalogues::default();
    catalogues.radio.effects.add(&RADIO_TIDE);
    catalogues.radio.effects.add(&RADIO_LUCK);
    catalogues.robots.effects.add(&ROBOT_TIDE);
    catalogues.robots.controllers.add(&ROW);
    catalogues
}

fn config(text: &str) -> Compared {
    model(text).with_catalogues(catalogues())
}

/// A campaign that a model would have measured.
fn measured(truth: &str, like: &Campaign) -> DataTable {
    table(&simulate(&config(truth), &table(&like.csv), 7, None).unwrap().to_csv())
}

fn named<'a>(candidates: &'a [Candidate], name: &str) -> &'a Candidate {
    candidates.iter().find(|candidate| candidate.name == name).unwrap()
}

/// A diagnosis finds one effect, and its first number lies within four standard errors of the truth.
fn assert_found(plain: &str, made: &DataTable, effect: &str, truth: f64) {
    let found = diagnosed(&Request::new(&config(plain), made));
    assert_eq!(found.missing, [effect], "{}", found.sentence);
    let (_, number) = accepted_candidate(&found, 0).parameters.first().unwrap();
    assert!((number.value - truth).abs() < 4.0 * standard_error(number), "{number:?}");
}

#[test]
fn a_radio_effect_of_a_users_own_is_a_candidate_and_found() {
    let campaign = Campaign::link(2, &Layout::standard(), &[], 3000);
    let plain = campaign.config_toml.clone();
    let truth = plain.replacen("[netsim.phy]", "[netsim.phy]\nnoise_sd_db = 2.0", 1)
        + "\n[[netsim.phy.effect]]\nkind = \"radio-tide\"\ntide_db = 3.0\n";
    let made = measured(&truth, &campaign);
    let (study, _) = open::links(&config(&plain), &made, &Choices::default()).unwrap();
    assert_eq!(named(study.candidates(), "radio-tide").untestable, None);
    assert!(named(study.candidates(), "radio-luck").about.is_some());
    assert_found(&plain, &made, "radio-tide", 3.0);
}

#[test]
fn a_robot_effect_of_a_users_own_is_a_candidate_and_found() {
    let campaign = Campaign::robots(3, &Fleet::standard(Drive::Velocity), &[], 6000);
    let plain = campaign.config_toml.clone();
    let truth = format!(
        "{plain}\n[[robotsim.dynamics.effect]]\nkind = \"robot-tide\"\nshare = 0.3\n\n\
         [robotsim.localization]\nsd_m = 0.02\n"
    );
    let made = measured(&truth, &campaign);
    let (study, _) = open::robots(&config(&plain), &made, &Choices::default()).unwrap();
    assert_eq!(named(study.candidates(), "robot-tide").untestable, None);
    assert_found(&plain, &made, "robot-tide", 0.3);
}

#[test]
fn effects_of_a_users_own_are_tried_on_whole_networks() {
    let tried = candidates::all(&network());
    let layer = |name: &str| tried.iter().find(|tried| tried.name == name).map(|tried| tried.layer);
    assert_eq!(layer("light-motes"), Some("mac"));
    assert_eq!(layer("radio-tide"), Some("phy"));
    assert_eq!(layer("radio-luck"), None);
}

#[test]
fn what_a_controller_of_a_users_own_is_for_is_measured() {
    let catalogues = catalogues();
    let known: &Registry<controller::Entry> = &catalogues.robots.controllers;
    let task = Task::with_controllers("controller.kind = \"row\"", known);
    assert_eq!((task.goal, task.passage(0)), (Goal::Line, metrics::Passage::Jumping));
    assert_eq!(Task::from_config("controller.kind = \"row\"").goal, Goal::Other);
}
