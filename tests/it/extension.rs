//! Effects and controllers of a user's own, all in this file: what is added to the catalogues is listed, tried, found and measured by
//! name nowhere.

use diagnose::Request;
use diagnose::simulate::simulate;
use measure::config::{Catalogues, Compared};
use measure::table::DataTable;
use metrics::Task;
use netsim::mac::effect as mac;
use network::candidates;
use physics::effect as radio;
use physics::link::Link;
use proto::config::{Default, Field, Kind, Range, Registry, Variant, typed};
use proto::effect::{About, Fit, Level, Parameter, Role};
use robotsim::controller::{self, Controller, Demands, Goal, View};
use robotsim::dynamics::Command;
use robotsim::dynamics::effect::{self as robots, Situation};
use serde::Deserialize;
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

const ABOUT: About = About {
    mechanism: "It comes and goes.",
    equation: "",
    source: "",
    validity: "",
    trace: "",
    needs: &[],
    example: "",
};

const fn number(key: &'static str) -> Field {
    let kind = Kind::Number(Range::closed(-20.0, 20.0));
    Field { key, doc: "How much.", kind, default: Default::Required }
}

/// How strong it is, which is what a fit finds.
const fn amplitude(key: &'static str, unit: &'static str) -> Parameter {
    Parameter { key, unit, min: -20.0, max: 20.0, starts: &[0.0], step: 0.01 }
}

/// A radio whose links are stronger and weaker in turn.
static RADIO_TIDE: radio::Entry = radio::Entry {
    variant: Variant { name: "radio-tide", doc: "Tides.", fields: &[number("tide_db")] },
    about: ABOUT,
    fit: Fit { parameters: &[amplitude("tide_db", "dB")], in_runs: Some(&[]), ..Fit::PLAIN },
    check: radio::UNCHECKED,
    build: |table, _| Some(Box::new(typed::<RadioTide>(table))),
};

#[derive(Debug, Deserialize)]
struct RadioTide {
    tide_db: f64,
}

impl radio::Effect for RadioTide {
    fn name(&self) -> &'static str {
        RADIO_TIDE.variant.name
    }

    fn contribution_db(&self, link: &Link<'_>) -> f64 {
        self.tide_db * phase(link.time_ns as f64 / 1e9).sin()
    }

    fn max_gain_db(&self) -> f64 {
        self.tide_db.abs()
    }
}

/// A random level per node that is called otherwise than that of the catalogue.
static RADIO_LUCK: radio::Entry = radio::Entry {
    variant: Variant { name: "radio-luck", doc: "Luck.", fields: &[] },
    about: ABOUT,
    fit: Fit {
        parameters: &[amplitude("tx_sd_db", "dB"), amplitude("rx_sd_db", "dB")],
        level: Level::Random,
        role: Role::RandomPerNode,
        ..Fit::PLAIN
    },
    check: radio::UNCHECKED,
    build: |_, _| None,
};

/// Robots that are faster and slower in turn than they are told.
static ROBOT_TIDE: robots::Entry = robots::Entry {
    variant: Variant { name: "robot-tide", doc: "Tides.", fields: &[number("share")] },
    about: ABOUT,
    fit: Fit { parameters: &[amplitude("share", "")], ..Fit::PLAIN },
    check: robots::UNCHECKED,
    build: |table| Some(Box::new(typed::<RobotTide>(table))),
};

#[derive(Debug, Deserialize)]
struct RobotTide {
    share: f64,
}

impl robots::Effect for RobotTide {
    fn name(&self) -> &'static str {
        ROBOT_TIDE.variant.name
    }

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

/// Motes on which nothing weighs.
static LIGHT: mac::Entry = mac::Entry {
    variant: Variant { name: "light-motes", doc: "Nothing.", fields: &[number("weight")] },
    about: ABOUT,
    fit: Fit { parameters: &[amplitude("weight", "")], level: Level::Run, ..Fit::PLAIN },
    needs_kept_time: false,
    build: |_| None,
};

/// Robots that stand in a row.
static ROW: controller::Entry = controller::Entry {
    variant: Variant { name: "row", doc: "A row.", fields: &[] },
    demands: Demands { jumps: true, ..Demands::NONE },
    goal: Goal::Line,
    build: |_, _, _| Some(Box::new(Row)),
};

#[derive(Debug)]
struct Row;

impl Controller for Row {
    fn command(&self, _view: &View<'_>, _agent: usize) -> Command {
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
