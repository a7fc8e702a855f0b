//! What a simulator is to the shell around it: a plain object, without sockets, threads, clocks or messages.
//!
//! The crate `proto-host` serves an object of this kind over gRPC. It keeps count of steps and time, checks every request,
//! remembers the latest reply and computes the digest; the simulator only simulates.

use crate::config::{Node, Problem};
use crate::prediction::{PredictedWindow, PredictionRequest};
use crate::site::Site;
use crate::types::{
    AgentCommand, AgentMessage, AgentStates, Deliveries, DeliveryColumn, Experiment, Formation,
    Frames, HeardLinks, MoteCommand, MoteCommandKind, MoteStates, MoteStatistics, MovedObstacle,
    NetRecord, Packets, Payloads, Schedule, TaskFigure,
};
use bytes::Bytes;
use std::collections::BTreeMap;

/// The largest capacity (agents) that the built-in simulators take.
pub const MAX_AGENTS: u32 = 100_000;

/// Everything a simulator receives when an experiment begins.
#[derive(Clone, Debug)]
pub struct Setup {
    /// Seed, capacity, period, coupling.
    pub experiment: Experiment,
    /// The place.
    pub site: Site,
    /// The simulator's own section, its keys at top level, as written.
    pub config: Node,
    /// Path of `config` in messages: `netsim` where the whole experiment is checked, empty over the contract.
    pub path: String,
    /// The files that `config` names, by the path written there.
    pub files: BTreeMap<String, Bytes>,
    /// Delivery columns that are wanted. Empty for robots.
    pub columns: Vec<DeliveryColumn>,
    /// Records that are wanted. Empty for robots.
    pub records: Vec<NetRecord>,
}

/// What `Restore` found wrong.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("state: is not a snapshot of this simulator and version: {0}")]
pub struct NotASnapshot(pub String);

/// Where the robots begin.
#[derive(Clone, Debug)]
pub struct RobotStart {
    /// The configuration in force.
    pub effective: toml::Table,
    /// States at time 0.
    pub states: AgentStates,
    /// What each has to say at time 0.
    pub payloads: Payloads,
    /// What they want to know of each delivery.
    pub columns: Vec<DeliveryColumn>,
    /// Steps may bring [`RobotOutput::messages`].
    pub messages: bool,
}

/// What the robots are given for a step.
#[derive(Clone, Copy, Debug)]
pub struct RobotInput<'a> {
    /// Number of the step, from 1.
    pub step: u64,
    /// Where the step begins (ns).
    pub from_ns: u64,
    /// Where it ends (ns), later than `from_ns`.
    pub until_ns: u64,
    /// What was delivered in the period before. `None` in step 1.
    pub deliveries: Option<&'a Deliveries>,
    /// The motes after the period before, if the network reports them.
    pub motes: Option<&'a MoteStates>,
    /// Orders that take effect now, sorted; with `hold`, with the first step without it.
    pub commands: &'a [AgentCommand],
    /// Stand still: time passes, nobody moves, no controller acts.
    pub hold: bool,
}

/// What the robots reply.
#[derive(Clone, Debug, Default)]
pub struct RobotOutput {
    /// States at `until_ns`.
    pub states: AgentStates,
    /// What each says from now on.
    pub payloads: Payloads,
    /// Obstacles that moved.
    pub moved_obstacles: Vec<MovedObstacle>,
    /// Orders that take effect with the next step.
    pub commands: Vec<AgentCommand>,
    /// The robots regard their task as done.
    pub task_complete: bool,
    /// For single agents; only if [`RobotStart::messages`] said so.
    pub messages: Vec<AgentMessage>,
    /// How far the task is. Names are unique.
    pub figures: Vec<TaskFigure>,
}

/// A robot simulator.
pub trait RobotSimulator: Send + 'static {
    /// Its name.
    const NAME: &'static str;

    /// JSON Schema of its configuration.
    fn config_schema_json(&self) -> String;

    /// Begins an experiment, discarding any before it.
    ///
    /// # Errors
    ///
    /// Every problem with the configuration; the simulator is then as it was.
    fn configure(&mut self, setup: &Setup) -> Result<RobotStart, Vec<Problem>>;

    /// Moves to `input.until_ns`. Called only after `configure`, in order, with checked input.
    fn step(&mut self, input: &RobotInput<'_>) -> RobotOutput;

    /// Predicts windows of motion, whatever is configured: one result for each window, with a state for each of its steps.
    ///
    /// # Errors
    ///
    /// Every problem with the configuration, or with the commands under it. Paths begin with the field of the request.
    fn predict(&self, request: &PredictionRequest) -> Result<Vec<PredictedWindow>, Vec<Problem>>;

    /// The whole state.
    fn snapshot(&self) -> Vec<u8>;

    /// Puts a state back.
    ///
    /// # Errors
    ///
    /// Bytes that are no such state; the simulator is then as it was.
    fn restore(&mut self, state: &[u8]) -> Result<(), NotASnapshot>;

    /// Draws by another seed from here on. What was drawn once for the whole experiment stays. Called only after `configure` or
    /// `restore`.
    fn reseed(&mut self, seed: u64);
}

/// Where the network begins.
#[derive(Clone, Debug, Default)]
pub struct NetStart {
    /// The configuration in force.
    pub effective: toml::Table,
    /// The motes at time 0.
    pub motes: MoteStates,
    /// What should be checked before the results are trusted.
    pub warnings: Vec<String>,
    /// Formation at time 0; `None`: there is nothing to form.
    pub formation: Option<Formation>,
    /// Records that will be kept: those wanted which a network of this configuration has.
    pub records: Vec<NetRecord>,
    /// The statistics at time 0, if they will be kept. All that follow have the same columns.
    pub statistics: Option<MoteStatistics>,
    /// What a capture file begins with, if the radio's traffic will be kept.
    pub capture_header: Bytes,
    /// The longest payload that an agent may broadcast (bytes); `None`: any length.
    pub max_payload_bytes: Option<u32>,
}

/// What the network is given for a step.
#[derive(Clone, Copy, Debug)]
pub struct NetInput<'a> {
    /// Number of the step, from 1.
    pub step: u64,
    /// Where the step begins (ns).
    pub from_ns: u64,
    /// How far to run (ns), later than `from_ns`.
    pub until_ns: u64,
    /// Where the agents are.
    pub states: &'a AgentStates,
    /// What each broadcasts. One per agent.
    pub payloads: &'a Payloads,
    /// Obstacles that moved.
    pub moved_obstacles: &'a [MovedObstacle],
    /// Orders that take effect now, sorted. Only of kinds that [`NetSimulator::commands`] lists.
    pub commands: &'a [MoteCommand],
    /// Stop where the first delivery is complete.
    pub stop_at_first_delivery: bool,
    /// Records of a state that are wanted at the end of the step. Only of those that are kept.
    pub records: &'a [NetRecord],
}

/// What the network replies.
#[derive(Clone, Debug, Default)]
pub struct NetOutput {
    /// The time reached (ns).
    pub time_ns: u64,
    /// What was delivered.
    pub deliveries: Deliveries,
    /// The motes at that time.
    pub motes: MoteStates,
    /// Orders to agents.
    pub commands: Vec<AgentCommand>,
    /// Formation at that time; `None` where [`NetStart::formation`] was.
    pub formation: Option<Formation>,
    /// Packets whose way ended, if they are kept.
    pub packets: Option<Packets>,
    /// The radio's traffic as records of a capture file, if it is kept.
    pub capture: Bytes,
    /// The motes' statistics, if wanted now.
    pub statistics: Option<MoteStatistics>,
    /// The motes' schedules, if wanted now.
    pub schedule: Option<Schedule>,
    /// Who has heard whom, if wanted now.
    pub heard_links: Option<HeardLinks>,
    /// Frames that were sent, if they are kept.
    pub frames: Option<Frames>,
}

/// A network simulator.
pub trait NetSimulator: Send + 'static {
    /// Its name.
    const NAME: &'static str;

    /// JSON Schema of its configuration.
    fn config_schema_json(&self) -> String;

    /// Orders it obeys in some configuration.
    fn commands() -> &'static [MoteCommandKind];

    /// Whether it obeys such orders as it is configured.
    fn obeys(&self, kind: MoteCommandKind) -> bool {
        Self::commands().contains(&kind)
    }

    /// Delivery columns it can fill in.
    fn columns() -> &'static [DeliveryColumn];

    /// Records it can keep in some configuration.
    fn records() -> &'static [NetRecord] {
        &[]
    }

    /// Begins an experiment, discarding any before it.
    ///
    /// # Errors
    ///
    /// Every problem with the configuration; the simulator is then as it was.
    fn configure(&mut self, setup: &Setup) -> Result<NetStart, Vec<Problem>>;

    /// Runs to `input.until_ns`, or to the first delivery. Called only after `configure`, in order, with checked input.
    fn step(&mut self, input: &NetInput<'_>) -> NetOutput;

    /// The whole state.
    fn snapshot(&self) -> Vec<u8>;

    /// Puts a state back.
    ///
    /// # Errors
    ///
    /// Bytes that are no such state; the simulator is then as it was.
    fn restore(&mut self, state: &[u8]) -> Result<(), NotASnapshot>;

    /// Draws by another seed from here on. What was drawn once for the whole experiment stays. Called only after `configure` or
    /// `restore`.
    fn reseed(&mut self, seed: u64);
}
