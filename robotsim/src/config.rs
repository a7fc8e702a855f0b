//! The `[robotsim]` section: its description, and what no description can check.

use crate::absence::{self, Absence};
use crate::controller::{self, Team};
use crate::dynamics;
use crate::dynamics::contacts::{self, Contacts};
use crate::dynamics::fleet::Fleet;
use crate::exploration;
use crate::group;
use crate::knowledge::{Memory, Source};
use crate::obstacles::{self, Course};
use crate::scenario::{self, Scenario};
use bytes::Bytes;
use proto::config::{
    self, Choice, Default, Field, FileReference, Kind, Node, Problem, Range, TableSpec, join,
};
use proto::side::Setup;
use proto::site::Site;
use std::collections::BTreeMap;

/// Description of the section.
pub const SPEC: TableSpec = TableSpec {
    doc: "The robots: who they are, where they begin, and what they want.",
    fields: &[
        field(
            "knowledge",
            "What a robot knows of the others.",
            Kind::Choice(&[
                Choice {
                    name: "heard",
                    doc: "What was delivered to it in the period that just ended.",
                },
                Choice {
                    name: "truth",
                    doc: "Everything, at once: the ideal baseline, no radio involved.",
                },
            ]),
            Default::Text("heard"),
        ),
        field(
            "memory",
            "What robots remember of those they have heard. Absent: nothing longer than a period.",
            Kind::Table(&MEMORY),
            Default::Absent,
        ),
        field(
            "diameter_m",
            "Robots that come closer than this have collided (m): what is counted, and, where contacts are resolved, prevented.",
            Kind::Number(Range::closed(0.0, 1e3)),
            Default::Number(0.3),
        ),
        field(
            "contacts",
            "What happens where robots meet each other, walls and obstacles. Absent: collisions are counted.",
            Kind::Table(&contacts::SPEC),
            Default::Absent,
        ),
        field(
            "obstacle",
            "Obstacles of `[site]` that move. Robots and radio see them where they are.",
            Kind::Tables(&obstacles::SPEC),
            Default::Absent,
        ),
        field(
            "absence",
            "Robots that come late, are lost, or are away for a time.",
            Kind::Tables(&absence::SPEC),
            Default::Absent,
        ),
        field(
            "dynamics",
            "How robots move whose group says nothing of it.",
            Kind::Table(&dynamics::SPEC),
            Default::Table,
        ),
        field(
            "localization",
            "How well robots know where they are.",
            Kind::Table(&dynamics::LOCALIZATION),
            Default::Absent,
        ),
        field("scenario", "Where they begin.", Kind::Table(&scenario::SPEC), Default::Table),
        field(
            "controller",
            "What robots want whose group says nothing of it.",
            Kind::Table(&controller::SPEC),
            Default::Absent,
        ),
        field(
            "group",
            "Groups of different robots. Absent: all are alike.",
            Kind::Tables(&group::SPEC),
            Default::Absent,
        ),
    ],
    tag: None,
};

const MEMORY: TableSpec = TableSpec {
    doc: "What robots remember of those they have heard.",
    fields: &[
        field(
            "keep_s",
            "How long a robot that is not heard any more is still counted on (s).",
            Kind::Number(Range::above(0.0, 1e6)),
            Default::Required,
        ),
        field(
            "extrapolate",
            "It is taken to have moved on with the velocity that it told; else to have stayed.",
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
    /// Where they begin.
    pub scenario: Box<dyn Scenario>,
}

/// How robots behave.
#[derive(Debug)]
pub struct Behaviour {
    /// What they know of each other.
    pub knowledge: Source,
    /// What they remember of each other; `None`: nothing.
    pub memory: Option<Memory>,
    /// How they move.
    pub fleet: Fleet,
    /// What they want.
    pub team: Team,
    /// How obstacles of the place move.
    pub courses: Vec<Course>,
    /// Who is not there when.
    pub absences: Vec<Absence>,
    /// How robots explore; `None`: nobody does.
    pub exploration: Option<exploration::Settings>,
}

/// What a part of a configuration is checked against.
#[derive(Clone, Debug)]
pub struct Context<'a> {
    /// Path of the part.
    pub path: String,
    /// How many agents there are.
    pub n_agents: usize,
    /// The greatest speed (m/s).
    pub speed_cap_mps: f64,
    /// The files that the configuration names.
    pub files: &'a BTreeMap<String, Bytes>,
}

impl Context<'_> {
    /// A problem with a key of the part.
    #[must_use]
    pub fn problem(&self, key: &str, message: impl Into<String>) -> Problem {
        Problem::new(join(&self.path, key), message)
    }
}

/// Checks what can be checked of the section, which stands at `path`, without knowing how many robots there are, and returns
/// its table with defaults.
pub fn keys(config: &Node, path: &str, problems: &mut Vec<Problem>) -> toml::Table {
    let table = config::check(config, path, &SPEC, problems).table;
    group::require_controllers(&table, path, problems);
    table
}

/// Reads and checks the section, and returns it with its effective table.
///
/// # Errors
///
/// Every problem, all at once.
pub fn read(setup: &Setup) -> Result<(Config, toml::Table), Vec<Problem>> {
    let n_agents = setup.experiment.agent_count;
    let mut problems = Vec::new();
    let mut table = keys(&setup.config, &setup.path, &mut problems);
    let behaviour = build_behaviour(&mut table, &setup.path, n_agents, &setup.site, &mut problems);
    let context = Context {
        path: join(&setup.path, "scenario"),
        n_agents,
        speed_cap_mps: f64::INFINITY,
        files: &setup.files,
    };
    let scenario = scenario::build(part(&mut table, "scenario"), &context, &mut problems);
    match (behaviour, scenario) {
        (Some(behaviour), Some(scenario)) if problems.is_empty() => {
            // Keys that were filled in late stand last: a second walk puts all into the order of their description, so
            // that an effective configuration is its own effective configuration, to the letter.
            let node = Node { value: (&toml::Value::Table(table)).into(), span: None };
            let table = config::check(&node, &setup.path, &SPEC, &mut problems).table;
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
) -> Result<Behaviour, Vec<Problem>> {
    let mut problems = Vec::new();
    let node = Node { value: (&toml::Value::Table(effective.clone())).into(), span: None };
    let mut table = keys(&node, "", &mut problems);
    build_behaviour(&mut table, "", n_agents, site, &mut problems)
        .filter(|_| problems.is_empty())
        .ok_or(problems)
}

/// The files that the section, which stands at `path`, names.
#[must_use]
pub fn files(config: &Node, path: &str) -> Vec<FileReference> {
    config::check(config, path, &SPEC, &mut Vec::new()).files
}

/// Describes a key.
pub(crate) const fn field(
    key: &'static str,
    doc: &'static str,
    kind: Kind,
    default: Default,
) -> Field {
    Field { key, doc, kind, default }
}

fn build_behaviour(
    table: &mut toml::Table,
    path: &str,
    n_agents: usize,
    site: &Site,
    problems: &mut Vec<Problem>,
) -> Option<Behaviour> {
    let knowledge = table["knowledge"].clone().try_into().ok();
    let memory = table.get("memory").and_then(|memory| memory.clone().try_into().ok());
    let contacts = build_contacts(table, path, problems);
    let robots = group::build(table, path, n_agents, contacts, problems);
    let context = Context {
        path: String::new(),
        n_agents,
        speed_cap_mps: f64::INFINITY,
        files: &BTreeMap::new(),
    };
    let tables = |key: &str| table.get(key).and_then(toml::Value::as_array).map_or(&[][..], |t| t);
    let context = Context { path: join(path, "obstacle"), ..context };
    let courses = obstacles::build(tables("obstacle"), site, &context, problems);
    let context = Context { path: join(path, "absence"), ..context };
    let absences = absence::build(tables("absence"), &context, problems);
    let (fleet, team) = robots?;
    let exploration = build_exploration(table, path, &team, problems);
    Some(Behaviour { knowledge: knowledge?, memory, fleet, team, courses, absences, exploration })
}

/// How robots explore, if they do: all with one base.
fn build_exploration(
    table: &toml::Table,
    path: &str,
    team: &Team,
    problems: &mut Vec<Problem>,
) -> Option<exploration::Settings> {
    let mut all = team.explorations();
    let settings = *all.next()?;
    let n_groups = table.get("group").and_then(toml::Value::as_array).map_or(0, Vec::len);
    if n_groups != 0 {
        let message = "must be absent where robots explore: they are one swarm with one base";
        problems.push(Problem::new(join(path, "group"), message).value(n_groups));
    }
    let diameter_m = table.get("diameter_m").and_then(toml::Value::as_float).unwrap_or(0.0);
    let cell_m = settings.grid.cell_m();
    if table.contains_key("contacts") && cell_m < diameter_m {
        let key = join(&join(path, "controller"), "cell_m");
        let message = format!(
            "must be at least diameter_m = {diameter_m:?} where contacts are resolved: robots pass between walls that leave one \
             cell free"
        );
        problems.push(Problem::new(key, message).value(format!("{cell_m:?}")).nearest(diameter_m));
    }
    Some(settings)
}

/// Whether robots of an effective section send messages to single ones of them, which the network has to carry.
#[must_use]
pub fn sends_messages(effective: &toml::Table) -> bool {
    let kind = effective.get("controller").and_then(|controller| controller.get("kind"));
    let is_told = effective.get("knowledge").and_then(toml::Value::as_str) == Some("truth");
    kind.and_then(toml::Value::as_str) == Some(controller::EXPLORATION) && !is_told
}

/// How contacts are resolved, if they are.
fn build_contacts(
    table: &toml::Table,
    path: &str,
    problems: &mut Vec<Problem>,
) -> Option<Contacts> {
    let diameter_m = table["diameter_m"].as_float()?;
    let contacts = Contacts::build(table.get("contacts")?.as_table()?, diameter_m)?;
    if diameter_m <= 0.0 {
        problems.push(
            Problem::new(
                join(path, "diameter_m"),
                "must be greater than 0 where contacts are resolved",
            )
            .value(format!("{diameter_m:?}")),
        );
    }
    Some(contacts)
}

/// A table within the checked section.
fn part<'a>(table: &'a mut toml::Table, key: &str) -> &'a mut toml::Table {
    table
        .entry(key)
        .or_insert_with(|| toml::Table::new().into())
        .as_table_mut()
        .expect("the description says it is a table")
}
