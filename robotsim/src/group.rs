//! Groups of different robots in one swarm: how many of which kind, and what they want.

use crate::catalogue::Catalogue;
use crate::config::Keys;
use crate::context::Context;
use crate::controller::active_connectivity::ActiveConnectivity;
use crate::controller::{self, Controller, Team};
use crate::dynamics::contacts::Contacts;
use crate::dynamics::effect::only::refuse_measured;
use crate::dynamics::fleet::Fleet;
use crate::dynamics::{self, Dynamics};
use proto::config::{self, Lists, Node, Problem, Section, join};
use std::collections::BTreeSet;

/// A part of the swarm: where its tables stand.
struct Group {
    count: usize,
    dynamics: String,
    controller: String,
    sd_m: f64,
}

/// A group of identical robots in a heterogeneous swarm. Robots are numbered group by group, in the order of the file.
#[derive(Section)]
pub(crate) struct GroupKeys {
    /// Number of robots in the group. The counts of all groups must add up to `experiment.agents`.
    #[key(range = 1..=1_000_000_000)]
    count: usize,
    /// Dynamics of the group. Absent: those of `[robotsim.dynamics]`.
    #[key(table = dynamics::SPEC)]
    dynamics: Option<toml::Table>,
    /// Controller of the group. Absent: that of `[robotsim.controller]`.
    #[key(table = controller::SPEC)]
    controller: Option<toml::Table>,
    /// Standard deviation of the noise of their measured positions (m). Absent: that of `[robotsim.localization]`.
    #[key(range = 0.0..=1e4)]
    localization_sd_m: Option<f64>,
}

impl Keys {
    fn lack_controller(&self) -> bool {
        self.controller.is_none()
            && (self.group.is_empty() || self.group.iter().any(|group| group.controller.is_none()))
    }
}

/// Says what is missing where robots have no controller, neither of their own nor the one of all.
pub(crate) fn require_controllers(
    table: &toml::Table,
    path: &str,
    lists: &Lists,
    problems: &mut Vec<Problem>,
) {
    if Keys::read(table).lack_controller() {
        let (empty, path) = (Node::empty_table(), join(path, "controller"));
        config::check(&empty, &path, &controller::SPEC, lists, problems);
    }
}

/// Robots as the section's effective table says, which stands at `path`: in groups, or all alike; none where
/// some have no controller ([`require_controllers`]) or something is wrong. Fills in defaults of
/// controllers that depend on other values.
pub(crate) fn build(
    table: &mut toml::Table,
    keys: &Keys,
    path: &str,
    n_agents: usize,
    contacts: Option<Contacts>,
    catalogue: &Catalogue,
    problems: &mut Vec<Problem>,
) -> Option<(Fleet, Team)> {
    let diameter_m = keys.diameter_m;
    if keys.lack_controller() {
        return None;
    }
    // In place of a value that is missing or wrong by itself stands one that is allowed: what is wrong with that is nobody's.
    let unread: BTreeSet<String> = problems.iter().map(|problem| problem.path.clone()).collect();
    let groups = groups(keys, path, n_agents, problems);
    let mut kinds = Vec::new();
    let mut controllers: Vec<(usize, Box<dyn Controller>)> = Vec::new();
    let is_rigid = |(index, group): (usize, &Group)| {
        dynamics::is_rigid(subtable(table, index, "dynamics", &group.dynamics))
    };
    let are_rigid: Vec<bool> = groups.iter().enumerate().map(is_rigid).collect();
    let any_rigid = are_rigid.contains(&true);
    let all_rigid = !are_rigid.contains(&false);
    if any_rigid && !all_rigid && contacts.is_none() && diameter_m <= 0.0 {
        let message = "must be greater than 0 if rigid bodies share the swarm with other robots";
        let at = join(path, "diameter_m");
        problems.push(Problem::new(at, message).value(format!("{diameter_m:?}")));
    }
    let mut is_whole = true;
    for (index, group) in groups.into_iter().enumerate() {
        let mut own = Vec::new();
        let key_path = |key: &str, place: &str| join(path, &join(place, key));
        let dynamics_path = key_path("dynamics", &group.dynamics);
        let dynamics_table = subtable(table, index, "dynamics", &group.dynamics);
        let effects = dynamics_table.get("effect").and_then(toml::Value::as_array);
        let effects: Vec<&toml::Table> =
            effects.into_iter().flatten().filter_map(toml::Value::as_table).collect();
        refuse_measured(&effects, &join(&dynamics_path, "effect"), &mut own);
        let dynamics =
            Dynamics::build(dynamics_table, &dynamics_path, &catalogue.effects, &mut own);
        let dynamics = dynamics.map(|dynamics| dynamics.with_noise(group.sd_m));
        let context = Context {
            path: key_path("controller", &group.controller),
            n_agents,
            speed_cap_mps: dynamics.as_ref().map_or(f64::INFINITY, Dynamics::speed_cap_mps),
            files: &std::collections::BTreeMap::new(),
        };
        let table = subtable(table, index, "controller", &group.controller);
        let kind = catalogue.controllers.selected(table, &controller::TAG);
        let controller = kind.and_then(|kind| (kind.build)(table, &context, &mut own));
        let controller = controller.map(|controller| ActiveConnectivity::around(controller, table));
        let keeps_links = controller::Keys::read(table).active_connectivity.is_some();
        let jumping = kind.filter(|kind| kind.demands.jumps).map(|kind| kind.variant.name);
        if let (Some(name), true) = (jumping, contacts.is_some()) {
            let message = format!(
                "must be \"count\" with {name}, whose robots have no path between two places"
            );
            let at = join(&join(path, "contacts"), "kind");
            own.push(Problem::new(at, message).value("\"resolve\""));
        }
        if all_rigid && contacts.is_some() {
            let message = "must be \"count\" if all robots are rigid bodies, which resolve contacts themselves";
            let at = join(&join(path, "contacts"), "kind");
            own.push(Problem::new(at, message).value("\"resolve\""));
        }
        if let (Some(name), true) = (jumping, any_rigid) {
            let message = if are_rigid[index] {
                format!("must not be {name} for rigid bodies, which need a path between two places")
            } else {
                format!(
                    "must not be {name} beside rigid bodies, because robots that push them need a path between two places"
                )
            };
            own.push(Problem::new(join(&context.path, "kind"), message));
        }
        if let (Some(name), true) = (jumping, keeps_links) {
            let message = format!("does not apply to {name}, whose robots do not move but jump");
            own.push(Problem::new(join(&context.path, "active_connectivity"), message));
        }
        // What groups share is wrong once.
        own.retain(|problem| !unread.contains(&problem.path) && !problems.contains(problem));
        problems.append(&mut own);
        match (dynamics, controller) {
            (Some(dynamics), Some(controller)) => {
                kinds.push((group.count, dynamics));
                controllers.push((group.count, controller));
            }
            (..) => is_whole = false,
        }
    }
    is_whole.then(|| (Fleet::new(kinds, contacts, diameter_m), Team::new(controllers)))
}

/// The groups, or the whole swarm as one.
fn groups(keys: &Keys, path: &str, n_agents: usize, problems: &mut Vec<Problem>) -> Vec<Group> {
    let noise = keys.localization.as_ref().and_then(|localization| localization.sd_m);
    let sd_m = noise.unwrap_or(0.0);
    if keys.group.is_empty() {
        let everyone =
            Group { count: n_agents, dynamics: String::new(), controller: String::new(), sd_m };
        return vec![everyone];
    }
    let one = |(index, group): (usize, &GroupKeys)| {
        let here = format!("group[{index}]");
        let place =
            |own: &Option<toml::Table>| own.as_ref().map_or(String::new(), |_| here.clone());
        Group {
            count: group.count,
            dynamics: place(&group.dynamics),
            controller: place(&group.controller),
            sd_m: group.localization_sd_m.unwrap_or(sd_m),
        }
    };
    let groups: Vec<Group> = keys.group.iter().enumerate().map(one).collect();
    let sum = groups.iter().fold(0usize, |sum, group| sum.saturating_add(group.count));
    if sum != n_agents {
        let message = format!("counts must add up to experiment.agents = {n_agents}");
        problems.push(Problem::new(join(path, "group"), message).value(sum));
    }
    groups
}

/// The table of a group, or the one that all share where `place` is empty.
fn subtable<'a>(
    table: &'a mut toml::Table,
    index: usize,
    key: &str,
    place: &str,
) -> &'a mut toml::Table {
    let within = if place.is_empty() {
        table
    } else {
        table["group"][index].as_table_mut().expect("the description says it is a table")
    };
    within
        .get_mut(key)
        .and_then(toml::Value::as_table_mut)
        .expect("the description says it is a table")
}
