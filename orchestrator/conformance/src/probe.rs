//! What differs between asking robots and asking a network.

use super::{Finding, Questions, STEP_NS, predictions, status_text, within};
use bytes::Bytes;
use drive::peer::{Described, NetworkSide, RobotSide, Service};
use prost::Message as _;
use proto::digest::full::{
    NetworkGiven, NetworkReply, RobotsGiven, RobotsReply, of_network_step, of_robots_step,
};
use proto::digest::{self, Digest};
use proto::side::{NetInput, RobotInput};
use proto::types::{AgentStates, Deliveries, Heard, NetRecord, Payloads, Transmissions};
use proto_messages::{convert, v1};
use tokio_stream::StreamExt as _;
use tonic::Status;

/// A side that can be asked.
pub(super) trait Probe: Service {
    /// What must be remembered between steps to compute the digest.
    type Exchange: Default + Send;
    /// What the full digest knows of what the side was given.
    type Given: Send;
    /// The promise to stand still while `hold` is set. `None`: this side has no such field.
    const HOLD: Option<&'static str> = None;

    fn configure_request(seed: u64, n: u32, step_ns: u64, toml: &str) -> Self::ConfigureRequest;
    fn step_request(step: u64, until_ns: u64, n: usize) -> Self::StepRequest;
    /// Checks a reply by itself.
    fn check(reply: &Self::StepResponse, step: u64, until_ns: u64, n: usize) -> Result<(), String>;
    /// The digest of a step that was answered with `reply`.
    fn expected_digest(
        reply: &Self::StepResponse,
        step: u64,
        until_ns: u64,
        n: usize,
        exchange: &mut Self::Exchange,
    ) -> Result<Digest, String>;
    /// The records that a step may ask for, of those that `Configure` asked for.
    fn kept(start: &Self::Start) -> Vec<NetRecord>;
    /// A step that asks for `records`, and what the side is given by it.
    fn given(
        step: u64,
        until_ns: u64,
        n: usize,
        records: &[NetRecord],
    ) -> (Self::StepRequest, Self::Given);
    /// The full digest of a step that was answered with `reply`.
    fn full_digest(start: &Digest, given: &Self::Given, reply: &Self::Reply) -> Digest;
    /// A reply for comparison: its digest, which single calls may leave out, does not count.
    fn bytes(reply: Self::StepResponse) -> Vec<u8>;
    /// Requests that break the contract, with the promise that each tests.
    fn malformed(step: u64, until_ns: u64, n: usize) -> Vec<(&'static str, Self::StepRequest)>;

    /// Whether it stands still while `hold` is set, as [`Probe::HOLD`] promises.
    fn holds(_: &Questions<'_, Self>) -> impl Future<Output = Result<(), String>> + Send
    where
        Self: Sized,
    {
        async { Ok(()) }
    }

    /// Promises about predictions of recorded motion, and whether it keeps them. Robots only.
    fn predictions(
        _: &Questions<'_, Self>,
        _: &Described,
    ) -> impl Future<Output = Vec<Finding>> + Send
    where
        Self: Sized,
    {
        async { Vec::new() }
    }

    /// All replies of a session with these calls.
    fn stream(
        client: Self::Client,
        calls: Vec<Self::SessionRequest>,
    ) -> impl Future<Output = Result<Vec<Self::SessionResponse>, Status>> + Send {
        async move {
            let (sender, receiver) = tokio::sync::mpsc::channel(calls.len().max(1));
            for call in calls {
                // There is room for all.
                let _ = sender.send(call).await;
            }
            drop(sender);
            let replies =
                Self::session(client, tokio_stream::wrappers::ReceiverStream::new(receiver))
                    .await?;
            replies.collect::<Result<Vec<_>, _>>().await
        }
    }
}

/// Robots in a row, each saying three numbers.
fn states(n: usize) -> AgentStates {
    let mut states = AgentStates::at_origin(n);
    for agent in 0..n {
        states.x_m[agent] = agent as f64;
    }
    states
}

fn payloads(n: usize) -> Payloads {
    Payloads::new(vec![24; n], vec![0; 24 * n].into()).unwrap_or_default()
}

/// Everyone heard agent 0, none else.
fn deliveries(n: usize) -> Deliveries {
    let ends = (0..n as u32).collect();
    Deliveries {
        transmissions: Transmissions {
            sender: (0..n as u32).collect(),
            sent_ns: vec![0; n],
            end_ns: vec![1_000_000; n],
            payloads: payloads(n),
            ..Transmissions::default()
        },
        heard: Heard::Lists { ends, indices: vec![0; n.saturating_sub(1)] },
        ..Deliveries::default()
    }
}

/// What the robots are given in a step: nothing in the first.
fn deliveries_for_step(step: u64, n: usize) -> Option<Deliveries> {
    (step != 1).then(|| deliveries(n))
}

fn stands(step: u64, until_ns: u64, got: (u64, u64)) -> Result<(), String> {
    if got == (step, until_ns) {
        Ok(())
    } else {
        Err(format!(
            "the reply to step {step} until {until_ns} ns reports step {}, {} ns",
            got.0, got.1
        ))
    }
}

impl Probe for RobotSide {
    type Exchange = ();
    type Given = RobotsGiven;
    const HOLD: Option<&'static str> = Some(
        "with hold, robots stand still while time advances; without it, they are stepped as usual",
    );

    fn configure_request(seed: u64, n: u32, step_ns: u64, toml: &str) -> Self::ConfigureRequest {
        v1::RobotSimServiceConfigureRequest {
            seed,
            agent_count: n,
            step_ns,
            coupling: v1::Coupling::Sequential.into(),
            config_toml: toml.to_owned(),
            ..Default::default()
        }
    }

    fn step_request(step: u64, until_ns: u64, n: usize) -> Self::StepRequest {
        v1::RobotSimServiceStepRequest {
            step,
            until_ns,
            deliveries: deliveries_for_step(step, n).map(Into::into),
            ..Default::default()
        }
    }

    fn check(reply: &Self::StepResponse, step: u64, until_ns: u64, n: usize) -> Result<(), String> {
        stands(step, until_ns, (reply.step, reply.time_ns))?;
        convert::states(reply.states.clone(), n).map_err(|invalid| invalid.to_string())?;
        convert::payloads(reply.payloads.clone(), n).map_err(|invalid| invalid.to_string())?;
        Ok(())
    }

    fn expected_digest(
        reply: &Self::StepResponse,
        step: u64,
        until_ns: u64,
        n: usize,
        (): &mut (),
    ) -> Result<Digest, String> {
        let states =
            convert::states(reply.states.clone(), n).map_err(|invalid| invalid.to_string())?;
        Ok(digest::of_step(step, until_ns, &states, deliveries_for_step(step, n).as_ref()))
    }

    fn kept(_: &Self::Start) -> Vec<NetRecord> {
        Vec::new()
    }

    fn given(
        step: u64,
        until_ns: u64,
        n: usize,
        _: &[NetRecord],
    ) -> (Self::StepRequest, Self::Given) {
        let deliveries = deliveries_for_step(step, n);
        let input = RobotInput {
            step,
            from_ns: until_ns - STEP_NS,
            until_ns,
            deliveries: deliveries.as_ref(),
            motes: None,
            commands: &[],
            hold: false,
        };
        (Self::request(&input, Bytes::new()), RobotsGiven::of_input(&input, &[]))
    }

    fn full_digest(start: &Digest, given: &Self::Given, reply: &Self::Reply) -> Digest {
        of_robots_step(start, given, &RobotsReply::of_step(reply))
    }

    fn bytes(mut reply: Self::StepResponse) -> Vec<u8> {
        reply.digest.clear();
        reply.encode_to_vec()
    }

    async fn holds(questions: &Questions<'_, Self>) -> Result<(), String> {
        questions.hold_and_let_go().await
    }

    async fn predictions(questions: &Questions<'_, Self>, described: &Described) -> Vec<Finding> {
        predictions::judged(questions, described).await
    }

    fn malformed(step: u64, until_ns: u64, n: usize) -> Vec<(&'static str, Self::StepRequest)> {
        let spoilt = |spoil: fn(&mut v1::Deliveries)| {
            let mut message: v1::Deliveries = deliveries(n).into();
            spoil(&mut message);
            v1::RobotSimServiceStepRequest {
                deliveries: Some(message),
                ..Self::step_request(step, until_ns, n)
            }
        };
        vec![
            (
                "a transmission that does not exist is INVALID_ARGUMENT",
                spoilt(|d| d.heard = vec![u32::MAX; d.heard.len()]),
            ),
            (
                "lists with inconsistent ends are INVALID_ARGUMENT",
                spoilt(|d| d.heard_end = vec![1]),
            ),
        ]
    }
}

/// Steps at the beginning of an experiment that are spent standing still, and steps afterwards.
const HELD: u64 = 3;

impl Questions<'_, RobotSide> {
    /// As while a network forms: held from the first step on, with nothing delivered, then let go.
    async fn hold_and_let_go(&self) -> Result<(), String> {
        let n = self.n as usize;
        let configured = self.configure(1).await?;
        let first = convert::states(configured.states, n).map_err(|invalid| invalid.to_string())?;
        for step in 1..=2 * HELD {
            let (until_ns, hold) = (step * STEP_NS, step <= HELD);
            let given = (step != 1).then(Deliveries::default);
            let request = v1::RobotSimServiceStepRequest {
                step,
                until_ns,
                deliveries: given.clone().map(Into::into),
                hold,
                ..Default::default()
            };
            let reply =
                within(RobotSide::step(self.client.clone(), request)).await.map_err(status_text)?;
            RobotSide::check(&reply, step, until_ns, n)?;
            if reply.held != hold {
                return Err(format!(
                    "step {step} requested hold = {hold}, but held is {}",
                    reply.held
                ));
            }
            let states =
                convert::states(reply.states.clone(), n).map_err(|invalid| invalid.to_string())?;
            if hold {
                stands_still(&first, &states).map_err(|reason| format!("step {step}: {reason}"))?;
                if reply.task_complete {
                    return Err(format!(
                        "step {step}: the task is reported complete while all robots are held"
                    ));
                }
            }
            let expected = digest::of_step(step, until_ns, &states, given.as_ref());
            let standing = self.barrier(step).await?;
            if standing.time_ns != until_ns || standing.digest[..] != expected[..] {
                return Err(format!(
                    "Barrier of step {step} reports another time or digest than expected"
                ));
            }
        }
        Ok(())
    }
}

/// Whether everybody is where they were, without velocity.
fn stands_still(before: &AgentStates, after: &AgentStates) -> Result<(), String> {
    let axes = [
        ("x_m", &before.x_m, &after.x_m),
        ("y_m", &before.y_m, &after.y_m),
        ("z_m", &before.z_m, &after.z_m),
    ];
    for (name, before, after) in axes {
        if let Some(agent) = before.iter().zip(after).position(|(one, other)| one != other) {
            let (one, other) = (before[agent], after[agent]);
            return Err(format!(
                "{name} of agent {agent} changes from {one} to {other} during hold"
            ));
        }
    }
    for (name, velocities) in
        [("vx_mps", &after.vx_mps), ("vy_mps", &after.vy_mps), ("vz_mps", &after.vz_mps)]
    {
        if let Some(agent) = velocities.iter().position(|&velocity| velocity != 0.0) {
            return Err(format!("{name} of agent {agent} is {}", velocities[agent]));
        }
    }
    Ok(())
}

impl Probe for NetworkSide {
    /// What was delivered in the step before.
    type Exchange = Option<Deliveries>;
    type Given = NetworkGiven;

    fn configure_request(seed: u64, n: u32, step_ns: u64, toml: &str) -> Self::ConfigureRequest {
        v1::NetSimServiceConfigureRequest {
            seed,
            agent_count: n,
            step_ns,
            coupling: v1::Coupling::Sequential.into(),
            config_toml: toml.to_owned(),
            ..Default::default()
        }
    }

    fn step_request(step: u64, until_ns: u64, n: usize) -> Self::StepRequest {
        v1::NetSimServiceStepRequest {
            step,
            until_ns,
            states: Some(states(n).into()),
            payloads: Some(payloads(n).into()),
            ..Default::default()
        }
    }

    fn check(reply: &Self::StepResponse, step: u64, until_ns: u64, n: usize) -> Result<(), String> {
        stands(step, until_ns, (reply.step, reply.time_ns))?;
        convert::deliveries(reply.deliveries.clone(), n).map_err(|invalid| invalid.to_string())?;
        Ok(())
    }

    fn expected_digest(
        reply: &Self::StepResponse,
        step: u64,
        until_ns: u64,
        n: usize,
        before: &mut Option<Deliveries>,
    ) -> Result<Digest, String> {
        let delivered = convert::deliveries(reply.deliveries.clone(), n)
            .map_err(|invalid| invalid.to_string())?;
        let digest = digest::of_step(step, until_ns, &states(n), before.as_ref());
        *before = Some(delivered.unwrap_or_default());
        Ok(digest)
    }

    fn kept(start: &Self::Start) -> Vec<NetRecord> {
        start.records.iter().copied().filter(|record| record.is_state()).collect()
    }

    fn given(
        step: u64,
        until_ns: u64,
        n: usize,
        records: &[NetRecord],
    ) -> (Self::StepRequest, Self::Given) {
        let input = NetInput {
            step,
            from_ns: until_ns - STEP_NS,
            until_ns,
            states: &states(n),
            payloads: &payloads(n),
            moved_obstacles: &[],
            commands: &[],
            stop_at_first_delivery: false,
            records,
        };
        (Self::request(&input, Bytes::new()), NetworkGiven::of_input(&input, &[]))
    }

    fn full_digest(start: &Digest, given: &Self::Given, reply: &Self::Reply) -> Digest {
        of_network_step(start, given, &NetworkReply::of_step(reply), &reply.capture)
    }

    fn bytes(mut reply: Self::StepResponse) -> Vec<u8> {
        reply.digest.clear();
        reply.encode_to_vec()
    }

    fn malformed(step: u64, until_ns: u64, n: usize) -> Vec<(&'static str, Self::StepRequest)> {
        let spoilt = |spoil: fn(&mut v1::AgentStates)| {
            let mut message: v1::AgentStates = states(n).into();
            spoil(&mut message);
            v1::NetSimServiceStepRequest {
                states: Some(message),
                ..Self::step_request(step, until_ns, n)
            }
        };
        vec![
            (
                "a position that is not a number is INVALID_ARGUMENT",
                spoilt(|s| s.x_m[0] = f64::NAN),
            ),
            ("a column that is too short is INVALID_ARGUMENT", spoilt(|s| s.y_m.clear())),
        ]
    }
}
