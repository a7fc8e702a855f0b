//! The full digest: everything that a side was asked and replied. `cosim/v1/common.proto` defines the byte strings.
//!
//! A part is hashed once and counts in the digests of both sides: what one side replies, the other is given.

use super::Digest;
use super::parts::{self, Fields, optional};
use crate::exchange::{ConfigureRequest, NetworkStart, NetworkStep, RobotsStart, RobotsStep};
use crate::side::{NetInput, RobotInput};
use crate::types::{
    AgentCommand, AgentStates, DeliveryColumn, Experiment, MoteCommand, MovedObstacle, NetRecord,
    Payloads,
};

/// What a side is asked to begin, as it crosses.
#[derive(Clone, Debug)]
pub struct StartRequest<'a> {
    /// Seed, capacity, period, coupling.
    pub experiment: &'a Experiment,
    /// `[site]` as it was sent.
    pub site_toml: &'a str,
    /// The side's own section as it was sent.
    pub config_toml: &'a str,
    /// Path and content of each file, in the order in which they were sent.
    pub files: Vec<(&'a str, &'a [u8])>,
    /// Optional delivery columns that are wanted. Of the network alone.
    pub columns: &'a [DeliveryColumn],
    /// Records that are wanted. Of the network alone.
    pub records: &'a [NetRecord],
}

impl<'a> From<&'a ConfigureRequest> for StartRequest<'a> {
    fn from(request: &'a ConfigureRequest) -> Self {
        let files = request.files.iter();
        Self {
            experiment: &request.experiment,
            site_toml: &request.site_toml,
            config_toml: &request.config_toml,
            files: files.map(|(path, content)| (path.as_str(), &content[..])).collect(),
            columns: &request.columns,
            records: &request.records,
        }
    }
}

impl StartRequest<'_> {
    fn write(&self, fields: &mut Fields) {
        let Experiment { seed, agent_count, step_ns, coupling } = self.experiment;
        fields.u64(*seed).u32(*agent_count as u32).u64(*step_ns).u8(*coupling as u8);
        fields.text(self.site_toml).text(self.config_toml).length(self.files.len());
        for (path, content) in &self.files {
            fields.text(path).bytes(content);
        }
    }
}

fn columns(fields: &mut Fields, columns: &[DeliveryColumn]) {
    fields.length(columns.len());
    for column in columns {
        fields.u32(*column as u32);
    }
}

/// The robots' start: what they were asked to begin, and their reply.
#[must_use]
pub fn of_robots_start(request: &StartRequest<'_>, reply: &RobotsStart) -> Digest {
    let mut fields = Fields::default();
    request.write(&mut fields);
    fields
        .text(&reply.effective_toml)
        .parts(&[parts::states(&reply.states), optional(reply.payloads.as_ref(), parts::payloads)]);
    columns(&mut fields, &reply.columns);
    fields.flag(reply.messages);
    fields.end()
}

/// The network's start: what it was asked to begin, and its reply.
#[must_use]
pub fn of_network_start(request: &StartRequest<'_>, reply: &NetworkStart) -> Digest {
    let mut fields = Fields::default();
    request.write(&mut fields);
    columns(&mut fields, request.columns);
    fields.records(request.records).text(&reply.effective_toml);
    fields.parts(&[optional(reply.motes.as_ref(), parts::motes)]).length(reply.warnings.len());
    for warning in &reply.warnings {
        fields.text(warning);
    }
    fields.parts(&[optional(reply.formation.as_ref(), parts::formation)]).records(&reply.records);
    fields.parts(&[optional(reply.statistics.as_ref(), parts::statistics)]);
    fields.bytes(&reply.capture_header);
    fields.end()
}

/// What the robots are given for a step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RobotsGiven([Digest; 5]);

impl RobotsGiven {
    /// The name of each part in the request.
    pub const PARTS: [&'static str; 5] =
        ["deliveries.transmissions", "deliveries", "deliveries", "motes", "commands"];

    /// What a simulator is given, with the orders that the request itself brought.
    #[must_use]
    pub fn of_input(input: &RobotInput<'_>, commands: &[AgentCommand]) -> Self {
        let [sent, heard, links] = parts::deliveries(input.deliveries);
        let motes = optional(input.motes, parts::motes);
        Self([sent, heard, links, motes, parts::agent_commands(commands)])
    }

    /// What the driver gives: the network's latest reply, if there was one, and orders.
    #[must_use]
    pub fn of_reply(network: Option<&NetworkReply>, commands: &[AgentCommand]) -> Self {
        let [sent, heard, links, motes] = network.map_or([parts::ABSENT; 4], |reply| reply.shared);
        Self([sent, heard, links, motes, parts::agent_commands(commands)])
    }

    /// The parts' digests, in the order of [`Self::PARTS`].
    #[must_use]
    pub fn parts(&self) -> &[Digest] {
        &self.0
    }
}

/// What the network is given for a step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct NetworkGiven {
    parts: [Digest; 4],
    /// The time to run to, whether to stop before, and the records of a state that are wanted.
    rest: Digest,
}

impl NetworkGiven {
    /// The name of each part in the request.
    pub const PARTS: [&'static str; 5] =
        ["states", "payloads", "moved_obstacles", "commands", "stop_at_first_delivery or records"];

    /// What a simulator is given, with the orders that the request itself brought.
    #[must_use]
    pub fn of_input(input: &NetInput<'_>, commands: &[MoteCommand]) -> Self {
        let shared = of_robots(input.states, input.payloads, input.moved_obstacles);
        Self::new(shared, input, commands)
    }

    /// What the driver gives: the robots' reply that is on the air, with what `input` has besides; `is_silent`: the payloads of
    /// `input` stand for those of the reply.
    #[must_use]
    pub fn of_reply(robots: &RobotsReply, input: &NetInput<'_>, is_silent: bool) -> Self {
        let mut shared = robots.shared;
        if is_silent {
            shared[1] = parts::payloads(input.payloads);
        }
        Self::new(shared, input, input.commands)
    }

    fn new(shared: [Digest; 3], input: &NetInput<'_>, commands: &[MoteCommand]) -> Self {
        let [states, payloads, moved] = shared;
        let mut rest = Fields::default();
        rest.u64(input.until_ns).flag(input.stop_at_first_delivery).records(input.records);
        Self { parts: [states, payloads, moved, parts::mote_commands(commands)], rest: rest.end() }
    }

    /// The parts' digests, in the order of [`Self::PARTS`].
    #[must_use]
    pub fn parts(&self) -> [Digest; 5] {
        let [states, payloads, moved, commands] = self.parts;
        [states, payloads, moved, commands, self.rest]
    }
}

fn of_robots(
    states: &AgentStates,
    payloads: &Payloads,
    moved_obstacles: &[MovedObstacle],
) -> [Digest; 3] {
    [parts::states(states), parts::payloads(payloads), parts::moved_obstacles(moved_obstacles)]
}

/// What the robots replied to a step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RobotsReply {
    /// States, payloads, moved obstacles: the network is given them.
    shared: [Digest; 3],
    digest: Digest,
}

impl RobotsReply {
    /// Of a reply.
    #[must_use]
    pub fn of_step(reply: &RobotsStep) -> Self {
        let shared = of_robots(&reply.states, &reply.payloads, &reply.moved_obstacles);
        let mut fields = Fields::default();
        fields.u64(reply.step).u64(reply.time_ns).flag(reply.held).flag(reply.task_complete);
        fields.parts(&shared).parts(&[
            parts::agent_commands(&reply.commands),
            parts::agent_commands(&reply.applied_commands),
            parts::messages(&reply.messages),
            parts::figures(&reply.figures),
        ]);
        Self { shared, digest: fields.end() }
    }
}

/// What the network replied to a step, but for what it captured.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct NetworkReply {
    /// Transmissions, who heard them, what is known of each reception, motes: the robots are given them.
    shared: [Digest; 4],
    digest: Digest,
}

impl NetworkReply {
    /// Of a reply.
    #[must_use]
    pub fn of_step(reply: &NetworkStep) -> Self {
        let [sent, heard, links] = parts::deliveries(Some(&reply.deliveries));
        let shared = [sent, heard, links, optional(reply.motes.as_ref(), parts::motes)];
        let mut fields = Fields::default();
        fields.u64(reply.step).u64(reply.time_ns).parts(&shared).parts(&[
            parts::agent_commands(&reply.commands),
            parts::mote_commands(&reply.applied_commands),
            optional(reply.formation.as_ref(), parts::formation),
            optional(reply.packets.as_ref(), parts::packets),
            optional(reply.statistics.as_ref(), parts::statistics),
            optional(reply.schedule.as_ref(), parts::schedule),
            optional(reply.heard_links.as_ref(), parts::heard_links),
        ]);
        // A record that came later than the rule: where it is not kept, digests are what they were.
        if let Some(frames) = &reply.frames {
            fields.parts(&[parts::frames(frames)]);
        }
        Self { shared, digest: fields.end() }
    }
}

/// The robots' digest of a step.
#[must_use]
pub fn of_robots_step(start: &Digest, given: &RobotsGiven, reply: &RobotsReply) -> Digest {
    let mut fields = Fields::default();
    fields.parts(&[*start]).parts(&given.0).parts(&[reply.digest]);
    fields.end()
}

/// The network's digest of a step, with what it captured.
#[must_use]
pub fn of_network_step(
    start: &Digest,
    given: &NetworkGiven,
    reply: &NetworkReply,
    capture: &[u8],
) -> Digest {
    let mut fields = Fields::default();
    fields.parts(&[*start, given.rest]).parts(&given.parts);
    fields.parts(&[reply.digest, parts::capture(capture)]);
    fields.end()
}

/// The digest that a recording holds of a step; `commands`: the orders of the experiment to the network.
#[must_use]
pub fn of_exchange(
    robots: &RobotsReply,
    network: &NetworkReply,
    commands: &[MoteCommand],
) -> Digest {
    let mut fields = Fields::default();
    fields.parts(&[robots.digest, network.digest, parts::mote_commands(commands)]);
    fields.end()
}

#[cfg(test)]
mod tests;
