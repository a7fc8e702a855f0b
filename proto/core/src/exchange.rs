//! The calls of the contract and their replies, as valid values.
//!
//! [`crate::side`] is the same exchange as a simulator sees it. This is the view of the program that drives two simulators. It has
//! what the service around a simulator adds: the number of the step, orders from outside, the texts of a configuration.

use crate::config::{self, Node, Problem};
use crate::side::{NetOutput, NetStart, RobotOutput, RobotStart, Setup};
use crate::site::{self, Site};
use crate::types::{
    AgentCommand, AgentMessage, AgentStates, Deliveries, DeliveryColumn, Experiment, Formation,
    Frames, HeardLinks, MoteCommand, MoteStates, MoteStatistics, MovedObstacle, NetRecord, Packets,
    Payloads, Schedule, TaskFigure,
};
use bytes::Bytes;
use std::collections::BTreeMap;

/// What a side is asked to begin. Configuration travels as text: each side reads and judges its own section.
#[derive(Clone, Debug, PartialEq)]
pub struct ConfigureRequest {
    /// Seed, capacity, period, coupling.
    pub experiment: Experiment,
    /// `[site]` as TOML, its keys at top level.
    pub site_toml: String,
    /// The side's own section as TOML, its keys at top level.
    pub config_toml: String,
    /// The files that the section names, by the path written there.
    pub files: BTreeMap<String, Bytes>,
    /// Optional delivery columns that are wanted, ascending. Empty for robots.
    pub columns: Vec<DeliveryColumn>,
    /// Records that are wanted. Empty for robots.
    pub records: Vec<NetRecord>,
    /// The side computes the digest of the whole exchange, [`crate::digest::full`].
    pub full_digest: bool,
}

impl ConfigureRequest {
    /// The request as a simulator takes it.
    ///
    /// # Errors
    ///
    /// Text that is no TOML, a site that is none.
    pub fn setup(&self) -> Result<Setup, Vec<Problem>> {
        let (site, config) = sections(&self.site_toml, &self.config_toml)?;
        Ok(Setup {
            experiment: self.experiment.clone(),
            site,
            config,
            path: String::new(),
            files: self.files.clone(),
            columns: self.columns.clone(),
            records: self.records.clone(),
        })
    }
}

/// The site and a side's own section, from the texts of a request.
///
/// # Errors
///
/// Every problem with the texts: no TOML, no site.
pub fn sections(site_toml: &str, config_toml: &str) -> Result<(Site, Node), Vec<Problem>> {
    let mut problems = Vec::new();
    let site = parsed("site_toml", site_toml, &mut problems)
        .map_or_else(Site::default, |node| site::read(&node, "site", &mut problems).0);
    let config = parsed("config_toml", config_toml, &mut problems);
    config.filter(|_| problems.is_empty()).map(|config| (site, config)).ok_or(problems)
}

fn parsed(field: &str, text: &str, problems: &mut Vec<Problem>) -> Option<Node> {
    let parsed = config::parse(text);
    parsed
        .map_err(|errors| problems.extend(errors.into_iter().map(|error| error.within(field))))
        .ok()
}

/// The robots' reply to [`ConfigureRequest`].
#[derive(Clone, Debug, PartialEq)]
pub struct RobotsStart {
    /// The configuration in force as TOML. Empty: as it was sent.
    pub effective_toml: String,
    /// States at time 0.
    pub states: AgentStates,
    /// What each has to say at time 0; `None`: nobody says anything.
    pub payloads: Option<Payloads>,
    /// What they want to know of each delivery.
    pub columns: Vec<DeliveryColumn>,
    /// Steps may bring [`RobotsStep::messages`].
    pub messages: bool,
}

impl From<RobotStart> for RobotsStart {
    fn from(start: RobotStart) -> Self {
        let RobotStart { effective, states, payloads, columns, messages } = start;
        let (effective_toml, payloads) = (effective.to_string(), Some(payloads));
        Self { effective_toml, states, payloads, columns, messages }
    }
}

/// The network's reply to [`ConfigureRequest`].
#[derive(Clone, Debug, Default, PartialEq)]
pub struct NetworkStart {
    /// The configuration in force as TOML. Empty: as it was sent.
    pub effective_toml: String,
    /// The motes at time 0, if it reports them.
    pub motes: Option<MoteStates>,
    /// What should be checked before the results are trusted.
    pub warnings: Vec<String>,
    /// Formation at time 0; `None`: there is nothing to form.
    pub formation: Option<Formation>,
    /// Records that will be kept: those asked for which a network of this configuration has.
    pub records: Vec<NetRecord>,
    /// The statistics at time 0, if they will be kept. All that follow have the same columns.
    pub statistics: Option<MoteStatistics>,
    /// What a capture file begins with, if the radio's traffic will be kept.
    pub capture_header: Bytes,
    /// The longest payload that an agent may broadcast (bytes); `None`: any length.
    pub max_payload_bytes: Option<u32>,
}

impl From<NetStart> for NetworkStart {
    fn from(start: NetStart) -> Self {
        Self {
            effective_toml: start.effective.to_string(),
            motes: Some(start.motes),
            warnings: start.warnings,
            formation: start.formation,
            records: start.records,
            statistics: start.statistics,
            capture_header: start.capture_header,
            max_payload_bytes: start.max_payload_bytes,
        }
    }
}

/// How both sides were configured.
#[derive(Clone, Debug, PartialEq)]
pub struct Configured {
    /// What the robots were asked.
    pub robots_request: ConfigureRequest,
    /// Their reply.
    pub robots_start: RobotsStart,
    /// What the network was asked.
    pub network_request: ConfigureRequest,
    /// Its reply.
    pub network_start: NetworkStart,
}

/// The robots' reply to a step.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RobotsStep {
    /// Number of the step, from 1.
    pub step: u64,
    /// Where it ended (ns).
    pub time_ns: u64,
    /// States at that time.
    pub states: AgentStates,
    /// What each says from now on.
    pub payloads: Payloads,
    /// Obstacles that moved.
    pub moved_obstacles: Vec<MovedObstacle>,
    /// Orders to agents that take effect with the next step, in the order given.
    pub commands: Vec<AgentCommand>,
    /// Orders from outside that took effect in this step.
    pub applied_commands: Vec<AgentCommand>,
    /// The robots regard their task as done.
    pub task_complete: bool,
    /// They stood still, as they were asked to.
    pub held: bool,
    /// For single agents.
    pub messages: Vec<AgentMessage>,
    /// How far the task is. Names are unique.
    pub figures: Vec<TaskFigure>,
}

impl RobotsStep {
    /// What a simulator of this process put out.
    #[must_use]
    pub fn of_output(step: u64, time_ns: u64, held: bool, output: RobotOutput) -> Self {
        Self {
            step,
            time_ns,
            states: output.states,
            payloads: output.payloads,
            moved_obstacles: output.moved_obstacles,
            commands: output.commands,
            applied_commands: Vec::new(),
            task_complete: output.task_complete,
            held,
            messages: output.messages,
            figures: output.figures,
        }
    }
}

/// The network's reply to a step.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct NetworkStep {
    /// Number of the step, from 1.
    pub step: u64,
    /// Where it ended (ns).
    pub time_ns: u64,
    /// What was delivered.
    pub deliveries: Deliveries,
    /// The motes at that time, if the network reports them.
    pub motes: Option<MoteStates>,
    /// Orders to agents that take effect with the next step, in the order given.
    pub commands: Vec<AgentCommand>,
    /// Orders from outside that took effect in this step.
    pub applied_commands: Vec<MoteCommand>,
    /// Formation at that time; `None` where [`NetworkStart::formation`] was.
    pub formation: Option<Formation>,
    /// Packets whose way ended, if they are kept.
    pub packets: Option<Packets>,
    /// The radio's traffic as records of a capture file, if it is kept.
    pub capture: Bytes,
    /// The motes' statistics, if they were asked for.
    pub statistics: Option<MoteStatistics>,
    /// The motes' schedules, if they were asked for.
    pub schedule: Option<Schedule>,
    /// Who has heard whom, if that was asked for.
    pub heard_links: Option<HeardLinks>,
    /// Frames that were sent, if they are kept.
    pub frames: Option<Frames>,
}

impl NetworkStep {
    /// What a simulator of this process put out.
    #[must_use]
    pub fn of_output(step: u64, output: NetOutput) -> Self {
        Self {
            step,
            time_ns: output.time_ns,
            deliveries: output.deliveries,
            motes: Some(output.motes),
            commands: output.commands,
            applied_commands: Vec::new(),
            formation: output.formation,
            packets: output.packets,
            capture: output.capture,
            statistics: output.statistics,
            schedule: output.schedule,
            heard_links: output.heard_links,
            frames: output.frames,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::types::Coupling;

    #[test]
    fn what_is_no_toml_is_said_of_the_text_that_it_is_in() {
        let request = ConfigureRequest {
            experiment: Experiment {
                seed: 1,
                agent_count: 1,
                step_ns: 1,
                coupling: Coupling::Sequential,
            },
            site_toml: "a =".to_owned(),
            config_toml: "b =".to_owned(),
            files: BTreeMap::new(),
            columns: Vec::new(),
            records: Vec::new(),
            full_digest: false,
        };
        let problems = request.setup().unwrap_err();
        let found: Vec<&str> =
            problems.iter().map(|problem| problem.path.split('.').next().unwrap_or("")).collect();
        assert_eq!(found, ["site_toml", "config_toml"], "{problems:?}");
    }
}
