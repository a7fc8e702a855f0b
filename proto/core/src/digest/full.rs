//! The full digest: everything that a side was asked and replied. `cosim/v1/common.proto` defines the byte strings.
//!
//! A part is hashed once and counts in the digests of both sides: what one side replies, the other is given.

use super::Digest;
use super::parts::{self, Fields, optional};
use crate::exchange::{ConfigureRequest, NetworkStart, NetworkStep, RobotsStart, RobotsStep};
use crate::side::{NetInput, NetOutput, RobotInput, RobotOutput};
use crate::types::{
    AgentCommand, AgentStates, Coupling, Deliveries, DeliveryColumn, Experiment, Frames,
    MoteCommand, MoteStates, MovedObstacle, NetRecord, Payloads,
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
        let coupling = match coupling {
            Coupling::Sequential => 1,
            Coupling::Parallel => 2,
            Coupling::Event => 3,
        };
        fields.u64(*seed).u32(*agent_count as u32).u64(*step_ns).u8(coupling);
        fields.text(self.site_toml).text(self.config_toml).length(self.files.len());
        for (path, content) in &self.files {
            fields.text(path).bytes(content);
        }
    }
}

fn columns(fields: &mut Fields, columns: &[DeliveryColumn]) {
    fields.length(columns.len());
    for column in columns {
        fields.u32(match column {
            DeliveryColumn::ReceivedNs => 1,
            DeliveryColumn::RssiDbm => 2,
            DeliveryColumn::Hops => 3,
            DeliveryColumn::Medium => 4,
        });
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

fn of_network(deliveries: Option<&Deliveries>, motes: Option<&MoteStates>) -> [Digest; 4] {
    let [sent, heard, links] = parts::deliveries(deliveries);
    [sent, heard, links, optional(motes, parts::motes)]
}

/// What the robots replied to a step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RobotsReply {
    /// States, payloads, moved obstacles: the network is given them.
    shared: [Digest; 3],
    digest: Digest,
}

impl RobotsReply {
    /// Of a reply that the driver took.
    #[must_use]
    pub fn of_step(reply: &RobotsStep) -> Self {
        let shared = of_robots(&reply.states, &reply.payloads, &reply.moved_obstacles);
        let rest = [
            parts::agent_commands(&reply.commands),
            parts::agent_commands(&reply.applied_commands),
            parts::messages(&reply.messages),
            parts::figures(&reply.figures),
        ];
        Self::new(reply.step, reply.time_ns, reply.held, reply.task_complete, shared, rest)
    }

    /// Of what a simulator put out for `input`, and the orders from outside that took effect.
    #[must_use]
    pub fn of_output(
        input: &RobotInput<'_>,
        output: &RobotOutput,
        applied: &[AgentCommand],
    ) -> Self {
        let shared = of_robots(&output.states, &output.payloads, &output.moved_obstacles);
        let rest = [
            parts::agent_commands(&output.commands),
            parts::agent_commands(applied),
            parts::messages(&output.messages),
            parts::figures(&output.figures),
        ];
        Self::new(input.step, input.until_ns, input.hold, output.task_complete, shared, rest)
    }

    fn new(
        step: u64,
        time_ns: u64,
        held: bool,
        task_complete: bool,
        shared: [Digest; 3],
        rest: [Digest; 4],
    ) -> Self {
        let mut fields = Fields::default();
        fields.u64(step).u64(time_ns).flag(held).flag(task_complete).parts(&shared).parts(&rest);
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
    /// Of a reply that the driver took.
    #[must_use]
    pub fn of_step(reply: &NetworkStep) -> Self {
        let shared = of_network(Some(&reply.deliveries), reply.motes.as_ref());
        let rest = [
            parts::agent_commands(&reply.commands),
            parts::mote_commands(&reply.applied_commands),
            optional(reply.formation.as_ref(), parts::formation),
            optional(reply.packets.as_ref(), parts::packets),
            optional(reply.statistics.as_ref(), parts::statistics),
            optional(reply.schedule.as_ref(), parts::schedule),
            optional(reply.heard_links.as_ref(), parts::heard_links),
        ];
        Self::new(reply.step, reply.time_ns, shared, rest, reply.frames.as_ref())
    }

    /// Of what a simulator put out for step `step`, and the orders from outside that took effect.
    #[must_use]
    pub fn of_output(step: u64, output: &NetOutput, applied: &[MoteCommand]) -> Self {
        let shared = of_network(Some(&output.deliveries), Some(&output.motes));
        let rest = [
            parts::agent_commands(&output.commands),
            parts::mote_commands(applied),
            optional(output.formation.as_ref(), parts::formation),
            optional(output.packets.as_ref(), parts::packets),
            optional(output.statistics.as_ref(), parts::statistics),
            optional(output.schedule.as_ref(), parts::schedule),
            optional(output.heard_links.as_ref(), parts::heard_links),
        ];
        Self::new(step, output.time_ns, shared, rest, output.frames.as_ref())
    }

    fn new(
        step: u64,
        time_ns: u64,
        shared: [Digest; 4],
        rest: [Digest; 7],
        frames: Option<&Frames>,
    ) -> Self {
        let mut fields = Fields::default();
        fields.u64(step).u64(time_ns).parts(&shared).parts(&rest);
        // A record that came later than the rule: where it is not kept, digests are what they were.
        if let Some(frames) = frames {
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
