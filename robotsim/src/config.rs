//! The `[robotsim]` section: its description, and what no description can check.

use crate::absence::{self, Absence};
use crate::catalogue::Catalogue;
use crate::context::Context;
use crate::controller::{self, Team};
use crate::dynamics;
use crate::dynamics::contacts::{self, Contacts};
use crate::dynamics::fleet::Fleet;
use crate::exploration;
use crate::group;
use crate::knowledge::{Memory, Source};
use crate::obstacles::{self, Course};
use crate::scenario::{self, Scenario};
use proto::config::{self, FileReference, Node, Problem, Section, TableSpec, join};
use proto::side::Setup;
use proto::site::Site;
use std::collections::BTreeMap;

/// Description of the section.
pub const SPEC: TableSpec = Keys::SPEC;

/// A valid configuration. The only way to get one is [`read`].
#[derive(Debug)]
pub struct Config {
    /// How robots behave once they stand where they begin.
    pub behaviour: Behaviour,
    /// The scenario: where robots begin.
    pub scenario: Box<dyn Scenario>,
}

/// How robots behave.
#[derive(Debug)]
pub struct Behaviour {
    /// What they know of each other.
    pub knowledge: Source,
    /// What they remember of each other; `None`: nothing.
    pub memory: Option<Memory>,
    /// The bodies of the robots: how they follow commands.
    pub fleet: Fleet,
    /// The controllers of the groups.
    pub team: Team,
    /// How obstacles of the place move.
    pub courses: Vec<Course>,
    /// Who is not there when.
    pub absences: Vec<Absence>,
    /// How robots explore; `None`: nobody does.
    pub exploration: Option<exploration::Settings>,
}

/// Checks what can be checked of the section, which stands at `path`, without knowing how many robots there are, and returns
/// its table with defaults.
pub fn keys(
    config: &Node,
    path: &str,
    catalogue: &Catalogue,
    problems: &mut Vec<Problem>,
) -> toml::Table {
    let lists = catalogue.lists();
    let table = config::check(config, path, &SPEC, &lists, problems).table;
    group::require_controllers(&table, path, &lists, problems);
    table
}

/// Reads and checks the section, and returns it with its effective table.
///
/// # Errors
///
/// Every problem, all at once.
pub fn read(setup: &Setup, catalogue: &Catalogue) -> Result<(Config, toml::Table), Vec<Problem>> {
    let n_agents = setup.experiment.agent_count;
    let mut problems = Vec::new();
    let mut table = keys(&setup.config, &setup.path, catalogue, &mut problems);
    let (path, site) = (&setup.path, &setup.site);
    let behaviour = build_behaviour(&mut table, path, n_agents, site, catalogue, &mut problems);
    let context = Context {
        path: join(&setup.path, "scenario"),
        n_agents,
        speed_cap_mps: f64::INFINITY,
        files: &setup.files,
    };
    let own = subtable(&mut table, "scenario");
    let kind = catalogue.scenarios.selected(own, &scenario::TAG);
    let scenario = kind.and_then(|kind| (kind.build)(own, &context, &mut problems));
    match (behaviour, scenario) {
        (Some(behaviour), Some(scenario)) if problems.is_empty() => {
            // Keys that were filled in late stand last: a second walk puts all into the order of their description, so
            // that an effective configuration is its own effective configuration, to the letter.
            let node = Node { value: (&toml::Value::Table(table)).into(), span: None };
            let lists = catalogue.lists();
            let table = config::check(&node, path, &SPEC, &lists, &mut problems).table;
            Ok((Config { behaviour, scenario }, table))
        }
        (..) => Err(problems),
    }
}

/// The behaviour alone, from an effective table: what a saved state needs, whose robots have left where they began.
pub(crate) fn read_behaviour(
    effective: &toml::Table,
    n_agents: usize,
    site: &Site,
    catalogue: &Catalogue,
) -> Result<Behaviour, Vec<Problem>> {
    let mut problems = Vec::new();
    let node = Node { value: (&toml::Value::Table(effective.clone())).into(), span: None };
    let mut table = keys(&node, "", catalogue, &mut problems);
    build_behaviour(&mut table, "", n_agents, site, catalogue, &mut problems)
        .filter(|_| problems.is_empty())
        .ok_or(problems)
}

/// The files that the section, which stands at `path`, names.
#[must_use]
pub fn files(config: &Node, path: &str, catalogue: &Catalogue) -> Vec<FileReference> {
    config::check(config, path, &SPEC, &catalogue.lists(), &mut Vec::new()).files()
}

/// The robots: their dynamics, initial positions and controllers.
#[derive(Section)]
pub(crate) struct Keys {
    /// What a robot knows about the other robots.
    #[key(default = Source::Heard)]
    pub(crate) knowledge: Source,
    /// How long robots remember the states they have received. Absent: one control period.
    memory: Option<Memory>,
    /// Diameter of a robot (m): robots closer than this have collided. Collisions are counted and, if contacts are resolved,
    /// prevented.
    #[key(range = 0.0..=1e3, default = 0.3)]
    pub(crate) diameter_m: f64,
    /// What happens when robots touch each other, walls and obstacles. Absent: collisions are only counted.
    contacts: Option<contacts::Keys>,
    /// Moving obstacles of `[site]`. Robots and radio use their current positions.
    obstacle: Vec<obstacles::Keys>,
    /// Robots that are absent for a time: late, lost or temporarily away.
    absence: Vec<absence::Keys>,
    /// Dynamics of robots whose group does not set its own.
    #[key(table = dynamics::SPEC, default)]
    pub(crate) dynamics: toml::Table,
    /// Accuracy of the robots' measured positions.
    pub(crate) localization: Option<dynamics::Measured>,
    /// Initial positions of the robots.
    #[key(table = scenario::SPEC, default)]
    #[expect(dead_code, reason = "scenarios fill in defaults where it stands")]
    scenario: toml::Table,
    /// Controller of robots whose group does not set its own.
    #[key(table = controller::SPEC)]
    pub(crate) controller: Option<toml::Table>,
    /// Groups of different robots. Absent: all robots are identical.
    pub(crate) group: Vec<group::GroupKeys>,
}

fn build_behaviour(
    table: &mut toml::Table,
    path: &str,
    n_agents: usize,
    site: &Site,
    catalogue: &Catalogue,
    problems: &mut Vec<Problem>,
) -> Option<Behaviour> {
    let keys = Keys::read(table);
    let contacts = build_contacts(&keys, path, problems);
    let robots = group::build(table, &keys, path, n_agents, contacts, catalogue, problems);
    let context = Context {
        path: String::new(),
        n_agents,
        speed_cap_mps: f64::INFINITY,
        files: &BTreeMap::new(),
    };
    let context = Context { path: join(path, "obstacle"), ..context };
    let courses = obstacles::build(&keys.obstacle, site, &context, problems);
    let context = Context { path: join(path, "absence"), ..context };
    let absences = absence::build(&keys.absence, &context, problems);
    let (fleet, team) = robots?;
    let exploration = build_exploration(&keys, path, &team, problems);
    let Keys { knowledge, memory, .. } = keys;
    Some(Behaviour { knowledge, memory, fleet, team, courses, absences, exploration })
}

/// How robots explore, if they do: all with one base.
fn build_exploration(
    keys: &Keys,
    path: &str,
    team: &Team,
    problems: &mut Vec<Problem>,
) -> Option<exploration::Settings> {
    let mut all = team.explorations();
    let settings = *all.next()?;
    if !keys.group.is_empty() {
        let message =
            "must be absent if robots explore, because exploration needs one swarm with one base";
        problems.push(Problem::new(join(path, "group"), message).value(keys.group.len()));
    }
    let diameter_m = keys.diameter_m;
    let cell_m = settings.grid.cell_m();
    if keys.contacts.is_some() && cell_m < diameter_m {
        let key = join(&join(path, "controller"), "cell_m");
        let message = format!(
            "must be at least diameter_m = {diameter_m:?} if contacts are resolved, because robots drive through gaps of \
             one cell"
        );
        problems.push(Problem::new(key, message).value(format!("{cell_m:?}")).nearest(diameter_m));
    }
    Some(settings)
}

/// The controller of an effective section whose robots send messages to single ones of them, which the network has to carry;
/// `None`: they send none, or know everything without a network.
#[must_use]
pub fn messaging_controller(
    effective: &toml::Table,
    catalogue: &Catalogue,
) -> Option<&'static str> {
    let keys = Keys::read(effective);
    let kind = catalogue.controllers.selected(&keys.controller?, &controller::TAG)?;
    (kind.demands.sends_messages && keys.knowledge == Source::Heard).then_some(kind.variant.name)
}

/// How contacts are resolved, if they are.
fn build_contacts(keys: &Keys, path: &str, problems: &mut Vec<Problem>) -> Option<Contacts> {
    let diameter_m = keys.diameter_m;
    let contacts = Contacts::build(keys.contacts.as_ref()?, diameter_m)?;
    if diameter_m <= 0.0 {
        problems.push(
            Problem::new(
                join(path, "diameter_m"),
                "must be greater than 0 if contacts are resolved",
            )
            .value(format!("{diameter_m:?}")),
        );
    }
    Some(contacts)
}

/// A table within the checked section.
fn subtable<'a>(table: &'a mut toml::Table, key: &str) -> &'a mut toml::Table {
    table
        .entry(key)
        .or_insert_with(|| toml::Table::new().into())
        .as_table_mut()
        .expect("the description says it is a table")
}
