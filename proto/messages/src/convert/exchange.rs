//! Whole requests and replies, from messages to values and back.

use super::{
    InvalidField, Numbered as _, Result, agent_commands, agent_messages, columns, coupling,
    deliveries, formation, frames, heard_links, known, mote_commands, motes, moved_obstacles,
    numbers, packets, payloads, records, schedule, states, statistics, task_figures,
};
use crate::v1;
use bytes::Bytes;
use proto::exchange::{ConfigureRequest, NetworkStart, NetworkStep, RobotsStart, RobotsStep};
use proto::side::{NetInput, RobotInput};
use proto::types::{Experiment, MoteStates};

/// A request to configure the robots from its message.
///
/// # Errors
///
/// A coupling that does not exist.
pub fn robots_request(message: v1::RobotSimServiceConfigureRequest) -> Result<ConfigureRequest> {
    let files = message.files.into_iter();
    Ok(ConfigureRequest {
        experiment: Experiment {
            seed: message.seed,
            agent_count: message.agent_count as usize,
            step_ns: message.step_ns,
            coupling: coupling(message.coupling)?,
        },
        site_toml: message.site_toml,
        config_toml: message.config_toml,
        files: files.map(|file| (file.path, file.content)).collect(),
        columns: Vec::new(),
        records: Vec::new(),
        full_digest: message.full_digest,
    })
}

/// A request to configure the network from its message.
///
/// # Errors
///
/// A coupling, a column or a record that does not exist.
pub fn network_request(message: v1::NetSimServiceConfigureRequest) -> Result<ConfigureRequest> {
    let shared = robots_request(v1::RobotSimServiceConfigureRequest {
        seed: message.seed,
        agent_count: message.agent_count,
        step_ns: message.step_ns,
        coupling: message.coupling,
        site_toml: message.site_toml,
        config_toml: message.config_toml,
        files: message.files,
        full_digest: message.full_digest,
    })?;
    let (columns, records) = (columns(&message.columns)?, records(&message.records)?);
    Ok(ConfigureRequest { columns, records, ..shared })
}

/// The robots' reply to `Configure` from its message. Columns that this version of the contract does not know are left out: no
/// network could be asked for them.
///
/// # Errors
///
/// States or payloads that are malformed.
pub fn robots_start(
    message: v1::RobotSimServiceConfigureResponse,
    n_agents: usize,
) -> Result<RobotsStart> {
    Ok(RobotsStart {
        effective_toml: message.effective_config_toml,
        states: states(message.states, n_agents)?,
        payloads: message.payloads.map(|it| payloads(Some(it), n_agents)).transpose()?,
        columns: known(&message.columns),
        messages: message.messages,
    })
}

/// The network's reply to `Configure` from its message.
///
/// # Errors
///
/// Motes, formation, statistics or records that are malformed.
pub fn network_start(
    message: v1::NetSimServiceConfigureResponse,
    n_agents: usize,
) -> Result<NetworkStart> {
    Ok(NetworkStart {
        effective_toml: message.effective_config_toml,
        motes: reported_motes(message.motes, n_agents)?,
        warnings: message.warnings,
        formation: formation(message.formation, n_agents)?,
        records: records(&message.records)?,
        statistics: statistics(message.statistics, n_agents)?,
        capture_header: message.capture_header,
        max_payload_bytes: (message.max_payload_bytes != 0).then_some(message.max_payload_bytes),
    })
}

/// The robots' reply to a step from its message, and the digest that rides on it in a session.
///
/// # Errors
///
/// Anything malformed in it.
pub fn robots_step(
    message: v1::RobotSimServiceStepResponse,
    n_agents: usize,
) -> Result<(RobotsStep, Bytes)> {
    let reply = RobotsStep {
        step: message.step,
        time_ns: message.time_ns,
        states: states(message.states, n_agents)?,
        payloads: payloads(message.payloads, n_agents)?,
        moved_obstacles: moved_obstacles(message.moved_obstacles)?,
        commands: agent_commands(message.commands, n_agents)?,
        applied_commands: agent_commands(message.applied_commands, n_agents).map_err(applied)?,
        task_complete: message.task_complete,
        held: message.held,
        messages: agent_messages(message.messages, n_agents)?,
        figures: task_figures(message.figures)?,
    };
    Ok((reply, message.digest))
}

/// The network's reply to a step from its message, and the digest that rides on it in a session.
///
/// # Errors
///
/// Anything malformed in it.
pub fn network_step(
    message: v1::NetSimServiceStepResponse,
    n_agents: usize,
) -> Result<(NetworkStep, Bytes)> {
    let reply = NetworkStep {
        step: message.step,
        time_ns: message.time_ns,
        deliveries: deliveries(message.deliveries, n_agents)?.unwrap_or_default(),
        motes: reported_motes(message.motes, n_agents)?,
        commands: agent_commands(message.commands, n_agents)?,
        applied_commands: mote_commands(message.applied_commands, n_agents).map_err(applied)?,
        formation: formation(message.formation, n_agents)?,
        packets: packets(message.packets, n_agents)?,
        capture: message.capture,
        statistics: statistics(message.statistics, n_agents)?,
        schedule: schedule(message.schedule, n_agents)?,
        heard_links: heard_links(message.heard_links, n_agents)?,
        frames: frames(message.frames, n_agents)?,
    };
    Ok((reply, message.digest))
}

/// A complaint about orders that were applied, whose field bears that in its name.
fn applied(invalid: InvalidField) -> InvalidField {
    InvalidField::new(format!("applied_{}", invalid.field), invalid.reason)
}

/// Motes that are not reported are not made up.
///
/// # Errors
///
/// A column of the wrong length.
pub fn reported_motes(
    message: Option<v1::MoteStates>,
    n_agents: usize,
) -> Result<Option<MoteStates>> {
    message.map(|it| motes(Some(it), n_agents)).transpose()
}

/// Values as the messages that they become.
fn each<T: Into<M>, M>(values: impl IntoIterator<Item = T>) -> Vec<M> {
    values.into_iter().map(Into::into).collect()
}

impl From<&ConfigureRequest> for v1::RobotSimServiceConfigureRequest {
    fn from(request: &ConfigureRequest) -> Self {
        let files = request.files.clone().into_iter();
        Self {
            seed: request.experiment.seed,
            agent_count: request.experiment.agent_count as u32,
            step_ns: request.experiment.step_ns,
            coupling: request.experiment.coupling.number(),
            site_toml: request.site_toml.clone(),
            config_toml: request.config_toml.clone(),
            files: files.map(|(path, content)| v1::File { path, content }).collect(),
            full_digest: request.full_digest,
        }
    }
}

impl From<&ConfigureRequest> for v1::NetSimServiceConfigureRequest {
    fn from(request: &ConfigureRequest) -> Self {
        let shared = v1::RobotSimServiceConfigureRequest::from(request);
        Self {
            seed: shared.seed,
            agent_count: shared.agent_count,
            step_ns: shared.step_ns,
            coupling: shared.coupling,
            site_toml: shared.site_toml,
            config_toml: shared.config_toml,
            columns: numbers(&request.columns),
            files: shared.files,
            records: numbers(&request.records),
            full_digest: shared.full_digest,
        }
    }
}

impl From<&RobotsStart> for v1::RobotSimServiceConfigureResponse {
    fn from(start: &RobotsStart) -> Self {
        Self {
            effective_config_toml: start.effective_toml.clone(),
            states: Some(start.states.clone().into()),
            payloads: start.payloads.clone().map(Into::into),
            columns: numbers(&start.columns),
            messages: start.messages,
        }
    }
}

impl From<&NetworkStart> for v1::NetSimServiceConfigureResponse {
    fn from(start: &NetworkStart) -> Self {
        Self {
            effective_config_toml: start.effective_toml.clone(),
            motes: start.motes.clone().map(Into::into),
            warnings: start.warnings.clone(),
            formation: start.formation.clone().map(Into::into),
            records: numbers(&start.records),
            statistics: start.statistics.clone().map(Into::into),
            capture_header: start.capture_header.clone(),
            max_payload_bytes: start.max_payload_bytes.unwrap_or(0),
        }
    }
}

/// Without a digest to confirm, which a session adds.
impl From<&RobotInput<'_>> for v1::RobotSimServiceStepRequest {
    fn from(input: &RobotInput<'_>) -> Self {
        Self {
            step: input.step,
            until_ns: input.until_ns,
            deliveries: input.deliveries.cloned().map(Into::into),
            motes: input.motes.cloned().map(Into::into),
            commands: each(input.commands.to_vec()),
            confirmed_digest: Bytes::new(),
            hold: input.hold,
        }
    }
}

/// Without a digest to confirm, which a session adds.
impl From<&NetInput<'_>> for v1::NetSimServiceStepRequest {
    fn from(input: &NetInput<'_>) -> Self {
        Self {
            step: input.step,
            until_ns: input.until_ns,
            states: Some(input.states.clone().into()),
            payloads: Some(input.payloads.clone().into()),
            moved_obstacles: each(input.moved_obstacles.to_vec()),
            commands: each(input.commands.to_vec()),
            stop_at_first_delivery: input.stop_at_first_delivery,
            confirmed_digest: Bytes::new(),
            records: numbers(input.records),
        }
    }
}

/// Without the digest, which only a service adds.
impl From<RobotsStep> for v1::RobotSimServiceStepResponse {
    fn from(reply: RobotsStep) -> Self {
        Self {
            step: reply.step,
            time_ns: reply.time_ns,
            states: Some(reply.states.into()),
            payloads: Some(reply.payloads.into()),
            moved_obstacles: each(reply.moved_obstacles),
            commands: each(reply.commands),
            applied_commands: each(reply.applied_commands),
            task_complete: reply.task_complete,
            digest: Bytes::new(),
            held: reply.held,
            messages: (!reply.messages.is_empty()).then(|| reply.messages.into()),
            figures: each(reply.figures),
        }
    }
}

/// Without the digest, which only a service adds.
impl From<NetworkStep> for v1::NetSimServiceStepResponse {
    fn from(reply: NetworkStep) -> Self {
        Self {
            step: reply.step,
            time_ns: reply.time_ns,
            deliveries: Some(reply.deliveries.into()),
            motes: reply.motes.map(Into::into),
            commands: each(reply.commands),
            applied_commands: each(reply.applied_commands),
            digest: Bytes::new(),
            formation: reply.formation.map(Into::into),
            packets: reply.packets.map(Into::into),
            capture: reply.capture,
            statistics: reply.statistics.map(Into::into),
            schedule: reply.schedule.map(Into::into),
            heard_links: reply.heard_links.map(Into::into),
            frames: reply.frames.map(Into::into),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proto::types::{
        AgentCommand, AgentMessage, AgentOrder, AgentStates, Formation, MoteCommand, MoteOrder,
        MovedObstacle, Payloads, TaskFigure,
    };

    fn command(agent: u32, source: &str) -> AgentCommand {
        AgentCommand { agent, source: source.to_owned(), order: AgentOrder::Release }
    }

    #[test]
    fn replies_to_a_step_come_back_as_they_were_given_in_the_order_that_they_had() {
        let robots = RobotsStep {
            step: 3,
            time_ns: 300,
            states: AgentStates::at_rest(&[[1.0, 2.0], [3.0, 4.0]]),
            payloads: Payloads::new(vec![2, 1], Bytes::from_static(b"abc")).unwrap(),
            moved_obstacles: vec![MovedObstacle { name: "door".to_owned(), centre_m: [1.0, 1.0] }],
            // Not sorted: whoever takes orders sorts them, and the record has them as they came.
            commands: vec![command(1, "b"), command(0, "a")],
            applied_commands: vec![command(1, "z"), command(0, "y")],
            task_complete: true,
            held: false,
            messages: vec![AgentMessage {
                sender: 0,
                destination: 1,
                payload: Bytes::from_static(b"m"),
            }],
            figures: vec![TaskFigure { name: "mapped_ratio".to_owned(), value: 0.5 }],
        };
        let (back, digest) = robots_step(robots.clone().into(), 2).unwrap();
        assert_eq!((back, digest), (robots, Bytes::new()));
        let network = NetworkStep {
            step: 3,
            time_ns: 300,
            commands: vec![command(1, "b"), command(0, "a")],
            applied_commands: [("b", 0), ("a", 1)]
                .map(|(source, mote)| MoteCommand {
                    source: source.to_owned(),
                    order: MoteOrder::Kill(mote),
                })
                .to_vec(),
            formation: Some(Formation { formed_ns: Some(7), ..Formation::default() }),
            capture: Bytes::from_static(b"frames"),
            ..NetworkStep::default()
        };
        let (back, _) = network_step(network.clone().into(), 2).unwrap();
        assert_eq!(back, network);
    }

    #[test]
    fn an_order_that_was_applied_is_checked_as_any_other() {
        let mut message = v1::NetSimServiceStepResponse::from(NetworkStep::default());
        let order = v1::mote_command::Order::Kill(v1::mote_command::Kill { mote: 9 });
        message.applied_commands =
            vec![v1::MoteCommand { source: String::new(), order: Some(order) }];
        let invalid = network_step(message, 2).unwrap_err();
        assert_eq!(invalid.to_string(), "applied_commands[0].mote: motes are 0 to 1, got 9");
    }
}
