//! What was recorded, as the values that it was recorded from.

use super::StepRecord;
use super::read::{RecordedConfiguration, RecordedStep};
use proto::exchange::Configured;
use proto_messages::convert::{self, InvalidField};
use std::sync::Arc;

/// How both sides were configured.
///
/// # Errors
///
/// A field that no run records.
pub fn configured(recorded: RecordedConfiguration) -> Result<Configured, InvalidField> {
    let RecordedConfiguration { robot_request, robot_response, net_request, net_response } =
        recorded;
    let n_agents = robot_request.agent_count as usize;
    Ok(Configured {
        robots_request: convert::robots_request(robot_request)?,
        robots_start: convert::robots_start(robot_response, n_agents)?,
        network_request: convert::network_request(net_request)?,
        network_start: convert::network_start(net_response, n_agents)?,
    })
}

/// A step of so many agents. The radio's traffic, which is recorded in a file of its own, is not in it.
///
/// # Errors
///
/// A field that no run records.
pub fn step(recorded: RecordedStep, n_agents: usize) -> Result<StepRecord, InvalidField> {
    let RecordedStep { commands, robots, net, barrier } = recorded;
    let digest = barrier.digest[..].try_into().map_err(|_| {
        InvalidField::new("digest", format!("must have 32 bytes, got {}", barrier.digest.len()))
    })?;
    Ok(StepRecord {
        step: barrier.step,
        time_ns: barrier.time_ns,
        robots: Arc::new(convert::robots_step(robots, n_agents)?.0),
        network: Arc::new(convert::network_step(net, n_agents)?.0),
        commands: convert::mote_commands(commands, n_agents)?,
        digest,
    })
}
