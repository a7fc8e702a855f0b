//! The `[robotsim]` section: its description, and what no description can check.

use crate::absence::{self, Absence};
use crate::catalogue::Catalogue;
use crate::context::{Context, field};
use crate::controller::{self, Team};
use crate::dynamics;
use crate::dynamics::contacts::{self, Contacts};
use crate::dynamics::fleet::Fleet;
use crate::exploration;
use crate::group;
use crate::knowledge::{Memory, Source};
use crate::obstacles::{self, Course};
use crate::scenario::{self, Scenario};
use proto::config::{
    self, Choice, Default, FileReference, Kind, Node, Problem, Range, TableSpec, join, typed,
};
use proto::side::Setup;
use proto::site::Site;
use serde::Deserialize;
use std::collections::BTreeMap;

/// Description of the section.
pub const SPEC: TableSpec = TableSpec {
    doc: "The robots: their dynamics, initial positions and controllers.",
    fields: &[
        field(
            "knowledge",
            "What a robot knows about the other robots.",
            Kind::Choice(&[
                Choice {
                    name: "heard",
                    doc: "The messages delivered to it in the control period that just ended.",
                },
                Choice {
                    name: "truth",
                    doc: "The true state of all others at once: an ideal baseline without radio.",
                },
            ]),
            Default::Text("heard"),
        ),
        field(
            "memory",
            "How long robots remember the states they have received. Absent: one control period.",
            Kind::Table(&MEMORY),
            Default::Absent,
        ),
        field(
            "diameter_m",
            "Diameter of a robot (m): robots closer than this have collided. Collisions are counted and, if contacts are \
             resolved, prevented.",
            Kind::Number(Range::closed(0.0, 1e3)),
            Default::Number(0.3),
        ),
        field(
            "contacts",
            "What happens when robots touch each other, walls and obstacles. Absent: collisions are only counted.",
            Kind::Table(&contacts::SPEC),
            Default::Absent,
        ),
        field(
            "obstacle",
            "Moving obstacles of `[site]`. Robots and radio use their current positions.",
            Kind::Tables(&obstacles::SPEC),
            Default::Absent,
        ),
        field(
            "absence",
            "Robots that are absent for a time: late, lost or temporarily away.",
            Kind::Tables(&absence::SPEC),
            Default::Absent,
        ),
        field(
            "dynamics",
            "Dynamics of robots whose group does not set its own.",
            Kind::Table(&dynamics::SPEC),
            Default::Table,
        ),
        field(
            "localization",
            "Accuracy of the robots' measured positions.",
            Kind::Table(&dynamics::LOCALIZATION),
            Default::Absent,
        ),
        field(
            "scenario",
            "Initial positions of the robots.",
            Kind::Table(&scenario::SPEC),
            Default::Table,
        ),
        field(
            "controller",
            "Controller of robots whose group does not set its own.",
            Kind::Table(&controller::SPEC),
            Default::Absent,
        ),
        field(
            "group",
            "Groups of different robots. Absent: all robots are identical.",
            Kind::Tables(&group::SPEC),
            Default::Absent,
        ),
    ],
    tag: None,
};

const MEMORY: TableSpec = TableSpec {
    doc: "How long robots remember the states they have received.",
    fields: &[
        field(
            "keep_s",
            "Time for which a robot remembers another one after its last message (s).",
            Kind::Number(Range::above(0.0, 1e6)),
            Default::Required,
        ),
        field(
            "extrapolate",
            "Whether to extrapolate its position with its last known velocity; otherwise it is assumed to stay.",
            Kind::Bool,
            Default::Bool(true),
        ),
    ],
    tag: None,
};

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
    config::check(config, path, &SPEC, &catalogue.lists(), &mut Vec::new()).files
}

/// Keys of the section, those of groups apart.
#[derive(Deserialize)]
struct Keys {
    knowledge: Source,
    memory: Option<Memory>,
    diameter_m: f64,
    contacts: Option<toml::Table>,
    #[serde(default)]
    obstacle: Vec<toml::Table>,
    #[serde(default)]
    absence: Vec<toml::Table>,
    #[serde(default)]
    group: Vec<toml::Table>,
    controller: Option<toml::Table>,
}

fn build_behaviour(
    table: &mut toml::Table,
    path: &str,
    n_agents: usize,
    site: &Site,
    catalogue: &Catalogue,
    problems: &mut Vec<Problem>,
) -> Option<Behaviour> {
    let keys: Keys = typed(table);
    let contacts = build_contacts(&keys, path, problems);
    let robots = group::build(table, path, n_agents, contacts, catalogue, problems);
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
    let keys: Keys = typed(effective);
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
