//! What the robots were asked to do, as far as their effective configuration states it.

use proto::config::Registry;
use robotsim::controller::Entry;

pub use robotsim::catalogue::Catalogue;
pub use robotsim::controller::Goal;

/// The robots' task. A simulator of a stranger has other keys: then nothing is known.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Task {
    /// Name of the controller, if there is but one.
    pub controller: Option<String>,
    /// What that controller is for.
    pub goal: Goal,
    /// The agent that leads.
    pub leader: Option<usize>,
    /// Speed at which the leader moves (m/s).
    pub leader_speed_mps: Option<f64>,
    /// Its velocity: x, y (m/s).
    pub leader_velocity_mps: Option<[f64; 2]>,
    /// South-western and north-eastern corner of the area that robots cover (m).
    pub area_m: Option<[[f64; 2]; 2]>,
    /// Distance between neighbours in the lattice that robots form (m).
    pub lattice_m: Option<f64>,
    /// Robots that come closer than this collide (m).
    pub diameter_m: Option<f64>,
    /// Of each kind of robot the number of its last one plus 1, and what happens where a wall or an obstacle stands in its way.
    /// Empty: all go through.
    pub passages: Vec<(usize, Passage)>,
    /// Of each group the number of its last robot plus 1; empty where all are alike.
    pub groups: Vec<usize>,
    /// The robots know the true state of all others: a baseline that no radio can reach.
    pub is_truth_baseline: bool,
}

/// What happens where a wall or an obstacle stands in a robot's way.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Passage {
    /// It goes through, straight from where it is before a step to where it is after it.
    Through,
    /// It is held up, or goes around: contacts are resolved.
    HeldUp,
    /// It is not anywhere between two places.
    Jumping,
}

impl Task {
    /// What happens where a wall or an obstacle stands in a robot's way.
    pub fn passage(&self, agent: usize) -> Passage {
        let kind = self.passages.partition_point(|(end, _)| *end <= agent);
        self.passages.get(kind).map_or(Passage::Through, |(_, passage)| *passage)
    }

    /// The group of a robot, from 0; 0 where all are alike.
    #[must_use]
    pub fn group(&self, agent: usize) -> usize {
        let group = self.groups.partition_point(|&end| end <= agent);
        group.min(self.groups.len().saturating_sub(1))
    }

    /// Reads the robots' effective configuration, whose controllers are those that are built in.
    pub fn from_config(robotsim_toml: &str) -> Self {
        Self::with_controllers(robotsim_toml, &Catalogue::built_in().controllers)
    }

    /// Reads the robots' effective configuration, with these controllers to choose from.
    pub fn with_controllers(robotsim_toml: &str, known: &Registry<Entry>) -> Self {
        let Ok(config) = robotsim_toml.parse::<toml::Table>() else { return Self::default() };
        let shared = config.get("controller").and_then(toml::Value::as_table);
        let groups = config.get("group").and_then(toml::Value::as_array).map_or(&[][..], |all| all);
        let of_group = |group| toml::Value::get(group, "controller")?.as_table();
        let mut controllers: Vec<&toml::Table> =
            groups.iter().filter_map(|group| of_group(group).or(shared)).collect();
        if groups.is_empty() {
            controllers.extend(shared);
        }
        let kind_of = |controller: &toml::Table| {
            controller.get("kind").and_then(toml::Value::as_str).map(str::to_owned)
        };
        let goal_of = |kind: Option<&str>| {
            kind.and_then(|kind| known.find(kind)).map_or(Goal::Other, |entry| entry.goal)
        };
        let leads = |controller: &toml::Table| {
            let is_leaderless =
                controller.get("leaderless").and_then(toml::Value::as_bool) == Some(true);
            goal_of(kind_of(controller).as_deref()) == Goal::FollowLeader && !is_leaderless
        };
        // Of groups that want different things, those that follow somebody have a leader to be measured by.
        let kinds: Vec<Option<String>> = controllers.iter().copied().map(kind_of).collect();
        let kind = kinds.first().filter(|first| kinds.iter().all(|kind| kind == *first));
        let controller = controllers.iter().copied().find(|controller| leads(controller));
        let of_controller = |key: &str| controller.and_then(|controller| controller.get(key));
        let leads = controller.is_some();
        let velocity = of_controller("leader_velocity_mps").and_then(toml::Value::as_array);
        let number = |value: &toml::Value| {
            value.as_float().or_else(|| value.as_integer().map(|value| value as f64))
        };
        let goal = goal_of(kind.and_then(Option::as_deref));
        // Groups of one kind may differ in other keys: then they have no common area and no common lattice.
        let of_all = |key: &str| {
            let mut values = controllers.iter().map(|controller| controller.get(key));
            let first = values.next().flatten()?;
            values.all(|value| value == Some(first)).then_some(first)
        };
        let corner = |key: &str| {
            let [x, y] = of_all(key)?.as_array()?.as_slice() else { return None };
            Some([number(x)?, number(y)?])
        };
        let area_m = corner("from_m").zip(corner("to_m")).map(|(from, to)| [from, to]);
        Self {
            controller: kind.cloned().flatten(),
            goal,
            leader: of_controller("leader")
                .and_then(toml::Value::as_integer)
                .and_then(|leader| usize::try_from(leader).ok())
                .or(leads.then_some(0))
                .filter(|_| leads),
            leader_speed_mps: velocity.filter(|_| leads).map(|components| {
                libm::sqrt(components.iter().filter_map(number).map(|v| v * v).sum())
            }),
            leader_velocity_mps: velocity
                .filter(|_| leads && of_controller("leader_path_m").is_none())
                .and_then(|components| {
                    let [vx, vy] = components.as_slice() else { return None };
                    Some([number(vx)?, number(vy)?])
                }),
            area_m: area_m.filter(|_| goal == Goal::Cover),
            lattice_m: of_all("distance_m").and_then(number).filter(|_| goal == Goal::Lattice),
            diameter_m: config.get("diameter_m").and_then(number),
            passages: passages(&config, groups, known),
            groups: ends_of(groups),
            is_truth_baseline: config.get("knowledge").and_then(toml::Value::as_str)
                == Some("truth"),
        }
    }
}

/// Where each group ends: groups are numbered one after the other.
fn ends_of(groups: &[toml::Value]) -> Vec<usize> {
    let count = |group: &toml::Value| group.get("count").and_then(toml::Value::as_integer);
    let mut end = 0;
    let mut ends = Vec::new();
    for group in groups {
        end += count(group).and_then(|count| usize::try_from(count).ok()).unwrap_or(0);
        ends.push(end);
    }
    ends
}

/// Kind after kind, as groups are numbered; one where there are none.
fn passages(
    config: &toml::Table,
    groups: &[toml::Value],
    known: &Registry<Entry>,
) -> Vec<(usize, Passage)> {
    let kind_of = |table: Option<&toml::Value>| table?.get("kind")?.as_str().map(str::to_owned);
    let is_resolved = kind_of(config.get("contacts")).as_deref() == Some("resolve");
    let passage = |group: Option<&toml::Value>| {
        let of =
            |key: &str| kind_of(group.and_then(|group| group.get(key)).or_else(|| config.get(key)));
        let controller = of("controller").and_then(|kind| known.find(&kind));
        if controller.is_some_and(|entry| entry.demands.jumps) {
            Passage::Jumping
        } else if is_resolved || of("dynamics").as_deref() == Some("rigid-body") {
            Passage::HeldUp
        } else {
            Passage::Through
        }
    };
    let mut end = 0usize;
    let numbered = groups.iter().map(|group| {
        let count = group.get("count").and_then(toml::Value::as_integer).unwrap_or(1);
        end = end.saturating_add(usize::try_from(count).unwrap_or(usize::MAX));
        (end, passage(Some(group)))
    });
    let mut passages: Vec<_> = numbered.collect();
    if groups.is_empty() {
        passages.push((usize::MAX, passage(None)));
    }
    let all_through = passages.iter().all(|(_, passage)| *passage == Passage::Through);
    if all_through { Vec::new() } else { passages }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_flock_has_a_leader_with_a_speed() {
        let task = Task::from_config(
            "knowledge = \"truth\"\n[controller]\nkind = \"flocking\"\nleader_velocity_mps = [3, -4.0]",
        );
        assert_eq!((task.leader, task.leader_speed_mps), (Some(0), Some(5.0)));
        assert!(task.is_truth_baseline);
    }

    #[test]
    fn of_groups_the_one_that_follows_has_the_leader() {
        let shared =
            "[controller]\nkind = \"flocking\"\nleader = 2\nleader_velocity_mps = [2, 0]\n";
        let alone =
            Task::from_config(&format!("{shared}[[group]]\ncount = 3\n[[group]]\ncount = 2\n"));
        assert_eq!((alone.controller.as_deref(), alone.leader), (Some("flocking"), Some(2)));
        let mixed = Task::from_config(&format!(
            "{shared}[[group]]\ncount = 3\n[group.controller]\nkind = \"hold\"\n[[group]]\ncount = 2\n"
        ));
        assert_eq!((mixed.controller, mixed.leader), (None, Some(2)));
        assert_eq!(mixed.leader_speed_mps, Some(2.0));
        // Whom no group follows leads nobody.
        let unled = Task::from_config(&format!(
            "{shared}[[group]]\ncount = 3\n[group.controller]\nkind = \"hold\"\n"
        ));
        assert_eq!((unled.controller.as_deref(), unled.leader), (Some("hold"), None));
    }

    #[test]
    fn robots_are_held_up_where_contacts_are_resolved() {
        let passages = |toml: &str| {
            let task = Task::from_config(toml);
            [0, 3, 4].map(|agent| task.passage(agent))
        };
        assert_eq!(passages("contacts.kind = \"count\""), [Passage::Through; 3]);
        assert_eq!(passages("contacts.kind = \"resolve\""), [Passage::HeldUp; 3]);
        assert_eq!(passages("dynamics.kind = \"rigid-body\""), [Passage::HeldUp; 3]);
        assert_eq!(passages("controller.kind = \"random-jump\""), [Passage::Jumping; 3]);
        let groups = "dynamics.kind = \"rigid-body\"\n\
                      [[group]]\ncount = 3\ndynamics.kind = \"car\"\n\
                      [[group]]\ncount = 1\ncontroller.kind = \"random-jump\"\n[[group]]\ncount = 1\n";
        assert_eq!(passages(groups), [Passage::Through, Passage::Jumping, Passage::HeldUp]);
    }

    #[test]
    fn of_a_stranger_nothing_is_known() {
        assert_eq!(Task::from_config("swarm = 3"), Task::default());
        assert_eq!(Task::from_config("not toml ="), Task::default());
    }
}
