//! What the robots want: one file per controller, one list, `BUILT_IN`.
//!
//! A controller is the same program on every robot. It sees the robot's own state, what that robot knows of others and how
//! its mote stands in the network, and gives a command for the period that begins. It keeps nothing between steps. To add one: write its file, and add
//! its entry to the list.

pub(crate) mod active_connectivity;
mod boids;
mod circle_formation;
mod consensus;
mod constant_velocity;
mod coverage;
mod dispersion;
mod exploration;
mod flocking;
mod hold;
mod line_formation;
mod olfati_saber;
mod random_jump;
mod random_waypoint;

use crate::context::Context;
use crate::dynamics::{Command, norm};
use crate::exploration::{Settings as ExplorationSettings, State as Exploration};
use crate::knowledge::{Knowledge, Seen};
use proto::config::{Problem, Registered, Section, TableSpec, Tag, Variant, Variants};
use proto::ids::AgentId;
use proto::rng::Draws;
use proto::types::{AgentStates, MoteStates};
use rayon::prelude::*;

/// What descriptions call the list of controllers.
pub(crate) const LIST: &str = "robotsim.controller";

/// The controllers that are built in.
pub(crate) const BUILT_IN: &[Entry] = &[
    flocking::ENTRY,
    boids::ENTRY,
    olfati_saber::ENTRY,
    line_formation::ENTRY,
    circle_formation::ENTRY,
    consensus::ENTRY,
    coverage::ENTRY,
    dispersion::ENTRY,
    exploration::ENTRY,
    random_waypoint::ENTRY,
    random_jump::ENTRY,
    constant_velocity::ENTRY,
    hold::ENTRY,
];

/// Description of `[robotsim.controller]`.
pub(crate) const SPEC: TableSpec = Keys::SPEC;

/// The control law of the robots.
#[derive(Section)]
#[section(tag = TAG)]
pub(crate) struct Keys {
    /// Motion that keeps the link to the routing parent.
    pub(crate) active_connectivity: Option<active_connectivity::Keys>,
}

/// The key that selects a controller.
pub(crate) const TAG: Tag =
    Tag { key: "kind", doc: "The controller.", default: None, variants: Variants::List(LIST) };

/// A controller that can be configured.
#[derive(Debug)]
pub struct Entry {
    /// Its name and keys.
    pub variant: Variant,
    /// What it asks of the rest of an experiment.
    pub demands: Demands,
    /// What its robots are to come to: which figures of a run tell how well they did.
    pub goal: Goal,
    /// Makes it of its checked table. Fills in defaults that depend on other values, and adds what is wrong across keys.
    /// `None`: something is wrong that leaves nothing to build.
    pub build: Build,
}

impl Registered for Entry {
    fn variant(&self) -> &Variant {
        &self.variant
    }
}

/// What a controller asks of the rest of an experiment.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Demands {
    /// Its robots jump: they are nowhere between two places, so that nothing can stand in their way.
    pub jumps: bool,
    /// Its robots send messages to single others, which the network has to route.
    pub sends_messages: bool,
}

impl Demands {
    /// It asks for nothing.
    pub const NONE: Self = Self { jumps: false, sends_messages: false };
}

/// What robots are to come to, as far as figures of a run measure it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Goal {
    /// They follow one of them: `leader`, the first where that is not given, which moves with `leader_velocity_mps`, along
    /// `leader_path_m` if there is one. With `leaderless = true` there is none.
    FollowLeader,
    /// They move together in one direction, without a leader.
    Align,
    /// They keep the distance `distance_m` to their neighbours.
    Lattice,
    /// They stand on a straight line.
    Line,
    /// They stand on a circle.
    Circle,
    /// They meet in one place.
    Meet,
    /// They cover the rectangle from `from_m` to `to_m`.
    Cover,
    /// They spread as far as the network holds.
    Disperse,
    /// They map rooms.
    Explore,
    /// They only carry their motes: the task is that of the network.
    Carry,
    /// A goal that no figure measures.
    #[default]
    Other,
}

/// Makes a controller of its checked table, or adds problems.
pub type Build =
    fn(&mut toml::Table, &Context<'_>, &mut Vec<Problem>) -> Option<Box<dyn Controller>>;

/// What a controller decides on.
#[derive(Clone, Copy, Debug)]
pub struct View<'a> {
    /// Number of the step, from 1.
    pub step: u64,
    /// For how long the robots have been free to move (s).
    pub time_s: f64,
    /// Length of the period that begins (s).
    pub dt_s: f64,
    /// The robots' own states. A controller looks only at the entry of the robot it decides for.
    pub states: &'a AgentStates,
    /// What they know of each other.
    pub knowledge: &'a Knowledge<'a>,
    /// Their motes: how each stands in the network.
    pub links: Links<'a>,
    /// What robots that explore and their base know; `None`: nobody explores.
    pub exploration: Option<&'a Exploration>,
    /// Draws for the controller, whose entity is the agent.
    pub draws: Draws,
}

/// How motes stand in the network, after the period that just ended. `None`: the network does not report it.
#[derive(Clone, Copy, Debug, Default)]
pub struct Links<'a> {
    motes: Option<&'a MoteStates>,
}

impl<'a> Links<'a> {
    /// What the network reports, if it does.
    #[must_use]
    pub fn new(motes: Option<&'a MoteStates>) -> Self {
        Self { motes }
    }

    /// Whether a robot's radio works.
    #[must_use]
    pub fn is_alive(&self, agent: AgentId) -> Option<bool> {
        self.motes.map(|motes| motes.alive.get(agent.index()))
    }

    /// Whether it keeps the network's time.
    #[must_use]
    pub fn is_synced(&self, agent: AgentId) -> Option<bool> {
        self.motes?.synced.as_ref().map(|synced| synced.get(agent.index()))
    }

    /// Whether it has been admitted.
    #[must_use]
    pub fn has_joined(&self, agent: AgentId) -> Option<bool> {
        self.motes?.joined.as_ref().map(|joined| joined.get(agent.index()))
    }

    /// Rank of the mote in routing (RPL); `None` without a network.
    #[must_use]
    pub fn rank(&self, agent: AgentId) -> Option<u32> {
        self.motes?.rank.get(agent.index()).copied()
    }

    /// Its preferred parent in routing; `Some(None)`: it has none.
    #[must_use]
    pub fn parent(&self, agent: AgentId) -> Option<Option<AgentId>> {
        let parent = self.motes?.parent.get(agent.index()).copied()?;
        Some((parent != u32::MAX).then_some(AgentId(parent)))
    }

    /// Packets that wait in its queue.
    #[must_use]
    pub fn queue_length(&self, agent: AgentId) -> Option<u32> {
        self.motes?.queue_length.get(agent.index()).copied()
    }
}

/// How a robot has heard the mote through which it routes.
#[derive(Clone, Copy, Debug)]
enum ParentLink {
    /// It is a root: it has no parent.
    Root,
    /// It has heard its parent; where the network has no routing, its strongest neighbour.
    Heard {
        /// Received signal strength (dBm).
        rssi_dbm: f64,
        /// The parent.
        to: Seen,
    },
    /// It has not joined, or has not heard its parent: its strongest neighbour, if it has heard any.
    Lost(Option<Seen>),
}

impl View<'_> {
    /// A robot's link to its preferred parent in routing.
    fn parent_link(&self, agent: AgentId) -> ParentLink {
        let has_joined = self.links.has_joined(agent).unwrap_or(true);
        let parent = self.links.parent(agent);
        if has_joined && parent == Some(None) {
            return ParentLink::Root;
        }
        let (mut best, mut heard_parent): (Option<(f32, Seen)>, _) = (None, None);
        self.knowledge.for_each_known_to(agent, |seen| {
            let Some(rssi_dbm) = seen.rssi_dbm else { return };
            if best.is_none_or(|(most_dbm, _)| most_dbm < rssi_dbm) {
                best = Some((rssi_dbm, *seen));
            }
            if parent == Some(Some(seen.agent)) {
                heard_parent = Some((rssi_dbm, *seen));
            }
        });
        match if parent.is_some() { heard_parent } else { best } {
            Some((rssi_dbm, to)) if has_joined => {
                ParentLink::Heard { rssi_dbm: f64::from(rssi_dbm), to }
            }
            _ => ParentLink::Lost(best.map(|(_, seen)| seen)),
        }
    }

    /// Where a robot is (m).
    fn position_m(&self, agent: AgentId) -> [f64; 3] {
        self.states.position_m(agent.index())
    }

    /// How a robot moved in the step before (m/s).
    fn velocity_mps(&self, agent: AgentId) -> [f64; 3] {
        let (states, agent) = (self.states, agent.index());
        [states.vx_mps[agent], states.vy_mps[agent], states.vz_mps[agent]]
    }
}

/// The program that every robot of a group runs: it computes one command per robot and control period from what the robot
/// sees, and keeps no state between steps.
pub trait Controller: std::fmt::Debug + Send + Sync {
    /// The command for one robot, for the period that begins.
    fn command(&self, view: &View<'_>, agent: AgentId) -> Command;

    /// Whether its robots move at all.
    fn moves(&self) -> bool {
        true
    }

    /// How fast robots of it may move apart from each other (m/s), where its keys say so: those of a flock move together.
    fn scatter_mps(&self) -> Option<f64> {
        None
    }

    /// Whether it uses the received signal strength of frames.
    fn wants_rssi(&self) -> bool {
        false
    }

    /// Whether its robots, seen together, regard their task as done, given their commands. Most tasks have no end.
    fn is_done(&self, _view: &View<'_>, _commands: &[Command]) -> bool {
        false
    }

    /// How its robots explore, if they do: then they and their base keep what they know in [`View::exploration`].
    fn exploration(&self) -> Option<&ExplorationSettings> {
        None
    }
}

/// The controllers of a swarm: those of its groups, one after the other.
#[derive(Debug)]
pub struct Team {
    /// For each group, the number of its last robot plus 1, and its controller.
    groups: Vec<(usize, Box<dyn Controller>)>,
}

impl Team {
    /// Groups of these numbers of robots, numbered group after group.
    #[must_use]
    pub fn new(groups: impl IntoIterator<Item = (usize, Box<dyn Controller>)>) -> Self {
        let mut end = 0;
        let numbered = groups.into_iter().map(|(count, controller)| {
            end += count;
            (end, controller)
        });
        Self { groups: numbered.collect() }
    }

    /// The commands for all robots; those that are not alive hold still.
    #[must_use]
    pub fn commands(&self, view: &View<'_>) -> Vec<Command> {
        let n = view.states.len();
        let command = |place| {
            if view.states.alive.get(place) {
                let group = self.groups.partition_point(|(end, _)| *end <= place);
                self.groups[group].1.command(view, AgentId::from_index(place))
            } else {
                Command::Velocity([0.0; 3])
            }
        };
        // Each command depends on its own robot alone, so threads cannot change it. Below this much work they cost more
        // than they save.
        if 20_000 <= view.knowledge.n_visits_max() {
            (0..n).into_par_iter().with_min_len(32).map(command).collect()
        } else {
            (0..n).map(command).collect()
        }
    }

    /// Which of so many robots move.
    #[must_use]
    pub fn moving(&self, n_agents: usize) -> Vec<bool> {
        let group = |agent: usize| self.groups.partition_point(|(end, _)| *end <= agent);
        (0..n_agents).map(|agent| self.groups[group(agent)].1.moves()).collect()
    }

    /// How fast robots may move apart from each other (m/s), as far as controllers say so.
    #[must_use]
    pub fn scatter_mps(&self) -> Option<f64> {
        self.groups.iter().filter_map(|(_, controller)| controller.scatter_mps()).reduce(f64::max)
    }

    /// Whether any of them asks how strong frames were.
    #[must_use]
    pub fn wants_rssi(&self) -> bool {
        self.groups.iter().any(|(_, controller)| controller.wants_rssi())
    }

    /// How robots explore, for each group that does.
    pub fn explorations(&self) -> impl Iterator<Item = &ExplorationSettings> {
        self.groups.iter().filter_map(|(_, controller)| controller.exploration())
    }

    /// Whether each group regards its task as done, given the commands for all robots.
    #[must_use]
    pub fn is_done(&self, view: &View<'_>, commands: &[Command]) -> bool {
        let mut begin = 0;
        self.groups.iter().all(|(end, controller)| {
            let own = &commands[begin..*end];
            begin = *end;
            controller.is_done(view, own)
        })
    }
}

/// Whether no robot wants to move farther than this within the period (m).
fn all_within(view: &View<'_>, commands: &[Command], distance_m: f64) -> bool {
    commands.iter().all(|command| match command {
        Command::Velocity(velocity_mps) => norm(*velocity_mps) * view.dt_s <= distance_m,
        Command::Acceleration(acceleration_mps2) => {
            norm(*acceleration_mps2) * view.dt_s * view.dt_s <= distance_m
        }
        Command::Jump(way_m) => norm(*way_m) <= distance_m,
    })
}

fn add(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|axis| a[axis] + b[axis])
}

fn sub(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|axis| a[axis] - b[axis])
}

fn scaled(a: [f64; 3], factor: f64) -> [f64; 3] {
    a.map(|component| factor * component)
}

/// Refuses a speed that no robot can have.
fn check_speed(key: &str, speed_mps: f64, context: &Context<'_>, problems: &mut Vec<Problem>) {
    if context.speed_cap_mps < speed_mps {
        problems.push(
            context
                .problem(
                    key,
                    format!(
                        "must not exceed dynamics.speed_cap_mps = {} m/s",
                        context.speed_cap_mps
                    ),
                )
                .value(format!("{speed_mps} m/s")),
        );
    }
}
