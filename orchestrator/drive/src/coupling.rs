//! Keeping the two simulators in step: who is given what, when, and the check that they agree.
//!
//! `proto/cosim/v1/common.proto` defines the order of things; this is its other half, and the only place that asks for steps
//! and barriers, whether the simulators are other processes or objects of this one. Every reply is checked before it is passed
//! on, so that a side that answers nonsense is named and the other never sees it.

mod call;
mod payloads;

use crate::peer::{NetworkSide, Peer, RobotSide, Side as _, SideError, Standing};
use bytes::Bytes;
use call::NetworkCall;
use payloads::SentPayloads;
use proto::digest::full::{self, NetworkReply, RobotsGiven, RobotsReply};
use proto::digest::{self, Digest};
use proto::exchange::{NetworkStart, NetworkStep, RobotsStart, RobotsStep};
use proto::side::RobotInput;
use proto::types::{
    AgentCommand, AgentMessage, AgentStates, Coupling, Deliveries, Experiment, Formation,
    MoteCommand, MoteOrder, NetRecord, Payloads,
};
use proto_messages::convert::sort_agent_commands;
use std::sync::Arc;

/// Both simulators, configured, and what was exchanged last.
pub struct Coupled<R, N> {
    robots: R,
    network: N,
    experiment: Experiment,
    step: u64,
    time_ns: u64,
    /// Digests of the latest step, which the robots and the network hold. `None` before the first, and of a side that holds no
    /// values of its own.
    agreed: [Option<Digest>; 2],
    /// Of the latest replies, where digests of the whole exchange are computed.
    hashed: Hashed,
    /// What was delivered is what was sent.
    payloads: SentPayloads,
    /// The robots' latest reply; before the first step, where they begin.
    moved: Arc<RobotsStep>,
    /// The network's latest reply; `None` before the first step.
    carried: Option<Arc<NetworkStep>>,
    commands: Vec<AgentCommand>,
    /// What the robots have to say to single ones of them, as orders to the network, which has not been given it yet.
    messages: Vec<MoteCommand>,
    /// The robots said that there would be such.
    sends_messages: bool,
    /// Formation before the first step; `None`: there is nothing to form.
    formation_at_start: Option<Formation>,
    /// The longest payload that the network broadcasts (bytes); `None`: any length.
    max_payload_bytes: Option<u32>,
}

/// Where two sides stand after a step, as it was recorded.
#[derive(Clone, Debug)]
pub struct Position {
    /// The step, from 1.
    pub step: u64,
    /// The time reached (ns).
    pub time_ns: u64,
    /// The robots' reply.
    pub robots: Arc<RobotsStep>,
    /// The network's reply.
    pub network: Arc<NetworkStep>,
}

/// What a step is to be.
#[derive(Clone, Debug, Default)]
pub struct StepPlan {
    /// How far (ns). Under event coupling: to the first delivery before, at the latest to here.
    pub until_ns: u64,
    /// The robots stand still, and the network is given nothing that they say. Only if they announce it. Under event coupling the step then goes to `until_ns`.
    pub hold: bool,
    /// Orders to the network.
    pub commands: Vec<MoteCommand>,
    /// Records of a state that the network's reply is to hold.
    pub records: Vec<NetRecord>,
    /// Those it is to hold if the robots regard their task as done, where that is known before the network is asked:
    /// under sequential coupling.
    pub records_if_complete: Vec<NetRecord>,
}

/// What a step brought. Both replies are shared with the driver, not copied.
#[derive(Clone, Debug)]
pub struct StepOutcome {
    /// Its number, from 1.
    pub step: u64,
    /// The time reached (ns).
    pub time_ns: u64,
    /// The robots' reply.
    pub robots: Arc<RobotsStep>,
    /// The network's reply.
    pub network: Arc<NetworkStep>,
    /// The orders of the plan.
    commands: Vec<MoteCommand>,
    checked: Option<Digest>,
}

impl StepOutcome {
    /// The digest of what was exchanged, for the record. A side that holds values of its own has been found to hold the same.
    #[must_use]
    pub fn digest(&self) -> Digest {
        self.checked.unwrap_or_else(|| {
            let robots = RobotsReply::of_step(&self.robots);
            full::of_exchange(&robots, &NetworkReply::of_step(&self.network), &self.commands)
        })
    }

    /// The robots regard their task as done.
    #[must_use]
    pub fn task_complete(&self) -> bool {
        self.robots.task_complete
    }
}

impl<R: Peer<RobotSide>, N: Peer<NetworkSide>> Coupled<R, N> {
    /// Some side holds values of its own, so that digests are worth computing.
    const COMPARES: bool = !(R::SHARES_VALUES && N::SHARES_VALUES);

    /// Takes over two peers that have been configured with `experiment`; `start` and `network_start` are their replies.
    pub fn new(
        robots: R,
        network: N,
        experiment: Experiment,
        start: &RobotsStart,
        network_start: &NetworkStart,
    ) -> Self {
        let payloads = start.payloads.clone();
        let moved = RobotsStep {
            states: start.states.clone(),
            payloads: payloads.unwrap_or_else(|| Payloads::silence(experiment.agent_count)),
            ..RobotsStep::default()
        };
        Self {
            robots,
            network,
            experiment,
            step: 0,
            time_ns: 0,
            agreed: [None; 2],
            hashed: Hashed::default(),
            payloads: SentPayloads::default(),
            moved: Arc::new(moved),
            carried: None,
            commands: Vec::new(),
            messages: Vec::new(),
            sends_messages: start.messages,
            formation_at_start: network_start.formation.clone(),
            max_payload_bytes: network_start.max_payload_bytes,
        }
    }

    /// Takes over two peers that stand where they stood after a recorded step: as [`Self::new`], and then all steps up to it.
    #[must_use]
    pub fn after(mut self, last: &Position) -> Self {
        let Position { step, time_ns, robots, network } = last;
        (self.step, self.time_ns) = (*step, *time_ns);
        self.moved = Arc::clone(robots);
        self.carried = Some(Arc::clone(network));
        self.commands = [&robots.commands[..], &network.commands].concat();
        sort_agent_commands(&mut self.commands);
        self.messages = messages_of(robots);
        self.payloads.forget();
        self
    }

    /// Both sides' states, if both keep snapshots. Called between two steps.
    ///
    /// # Errors
    ///
    /// A side fails, hangs or refuses.
    pub async fn snapshots(&mut self) -> Result<[Option<Bytes>; 2], SideError> {
        Ok([self.robots.snapshot().await?, self.network.snapshot().await?])
    }

    /// The network's formation after the latest step; `None`: it has nothing to form.
    #[must_use]
    pub fn formation(&self) -> Option<&Formation> {
        match &self.carried {
            Some(reply) => reply.formation.as_ref(),
            None => self.formation_at_start.as_ref(),
        }
    }

    /// Where the robots are after the latest step.
    #[must_use]
    pub fn states(&self) -> &AgentStates {
        &self.moved.states
    }

    /// The latest step.
    #[must_use]
    pub fn step_number(&self) -> u64 {
        self.step
    }

    /// The time reached (ns).
    #[must_use]
    pub fn time_ns(&self) -> u64 {
        self.time_ns
    }

    /// Takes the next step.
    ///
    /// # Errors
    ///
    /// A side fails, refuses, or does not stand where it should. The experiment cannot go on.
    pub async fn advance(&mut self, mut plan: StepPlan) -> Result<StepOutcome, SideError> {
        let StepPlan { until_ns, hold, .. } = plan;
        let (step, from_ns) = (self.step + 1, self.time_ns);
        let given = self.carried.take();
        let before = Arc::clone(&self.moved);
        let orders = self.orders_to_agents();
        let to_robots = |until_ns: u64| RobotInput {
            step,
            from_ns,
            until_ns,
            deliveries: given.as_deref().map(|reply| &reply.deliveries),
            motes: given.as_deref().and_then(|reply| reply.motes.as_ref()),
            commands: &orders,
            hold,
        };
        let ordered = plan.commands.clone();
        if step == 1 {
            self.check_payloads(0, &before)?;
        }
        let n = self.experiment.agent_count;
        // Of what was replied before: it is given now.
        let robots_before = Self::COMPARES
            .then(|| self.hashed.robots.take().unwrap_or_else(|| RobotsReply::of_step(&before)));
        let carried = self.hashed.network.take();
        let carried = given
            .as_deref()
            .filter(|_| Self::COMPARES)
            .map(|reply| carried.unwrap_or_else(|| NetworkReply::of_step(reply)));
        let mut moved = None;
        let (robots, network, asked) = match self.experiment.coupling {
            Coupling::Sequential => {
                let robots = self.robots.step(&to_robots(until_ns)).await?;
                let robots = self.take_robots_reply(step, until_ns, robots, &plan)?;
                if robots.task_complete {
                    plan.records = std::mem::take(&mut plan.records_if_complete);
                }
                let call = NetworkCall::new(self, &robots, plan, false);
                let input = call.input();
                let network = if Self::COMPARES {
                    let hashing = async {
                        for _ in 0..TURNS_TO_SEND {
                            tokio::task::yield_now().await;
                        }
                        hashed(Arc::clone(&robots), n, RobotsReply::of_step).await
                    };
                    let (network, hash) = tokio::join!(self.network.step(&input), hashing);
                    moved = Some(hash);
                    network?
                } else {
                    self.network.step(&input).await?
                };
                let asked = moved.map(|hash| call.given(&hash));
                self.sent(&robots, &call);
                (robots, network, asked)
            }
            Coupling::Parallel => {
                let call = NetworkCall::new(self, &before, plan.clone(), false);
                let (input, network_input) = (to_robots(until_ns), call.input());
                let (robots, network) =
                    tokio::join!(self.robots.step(&input), self.network.step(&network_input));
                let (robots, network) = match (robots, network) {
                    (Ok(robots), Ok(network)) => (robots, network),
                    (Err(robots), Err(network)) => {
                        return Err(SideError::Both(Box::new(robots), Box::new(network)));
                    }
                    (Err(error), Ok(_)) | (Ok(_), Err(error)) => return Err(error),
                };
                let asked = robots_before.map(|hash| call.given(&hash));
                self.sent(&before, &call);
                (self.take_robots_reply(step, until_ns, robots, &plan)?, network, asked)
            }
            Coupling::Event => {
                let call = NetworkCall::new(self, &before, plan.clone(), !hold);
                let network = self.network.step(&call.input()).await?;
                let reached_ns = network.time_ns;
                let stopped_early = reached_ns < until_ns;
                if reached_ns <= from_ns || until_ns < reached_ns || hold && stopped_early {
                    return Err(SideError::WrongTime {
                        side: NetworkSide::SIDE,
                        step,
                        expected: until_ns,
                        got: reached_ns,
                    });
                }
                let robots = self.robots.step(&to_robots(reached_ns)).await?;
                let asked = robots_before.map(|hash| call.given(&hash));
                self.sent(&before, &call);
                (self.take_robots_reply(step, reached_ns, robots, &plan)?, network, asked)
            }
        };
        let reached_ns = match self.experiment.coupling {
            Coupling::Event => network.time_ns,
            Coupling::Sequential | Coupling::Parallel => until_ns,
        };
        let network = self.take_network_reply(step, reached_ns, network)?;

        let mut checked = None;
        if let Some(asked) = asked {
            let moved = match moved {
                Some(moved) => moved,
                None => hashed(Arc::clone(&robots), n, RobotsReply::of_step).await,
            };
            let replied = hashed(Arc::clone(&network), n, NetworkReply::of_step).await;
            let told = RobotsGiven::of_reply(carried.as_ref(), &orders);
            checked = Some(full::of_exchange(&moved, &replied, &ordered));
            // Of a side that announces no digest of the whole.
            let lesser = || {
                let on_air = match self.experiment.coupling {
                    Coupling::Sequential => &robots,
                    Coupling::Parallel | Coupling::Event => &before,
                };
                digest_of(step, reached_ns, on_air, given.as_deref())
            };
            let expected_of_robots = || match self.robots.start_digest() {
                Some(start) => full::of_robots_step(&start, &told, &moved),
                None => lesser(),
            };
            let expected_of_network = || match self.network.start_digest() {
                Some(start) => full::of_network_step(&start, &asked, &replied, &network.capture),
                None => lesser(),
            };
            self.agreed = [
                (!R::SHARES_VALUES).then(expected_of_robots),
                (!N::SHARES_VALUES).then(expected_of_network),
            ];
            self.hashed = Hashed { robots: Some(moved), network: Some(replied) };
        }
        self.compare(step, reached_ns).await?;
        self.step = step;
        self.time_ns = reached_ns;
        Ok(StepOutcome { step, time_ns: reached_ns, robots, network, commands: ordered, checked })
    }

    /// A last barrier, so that a session's last step is confirmed like all others, and then the end of both sides.
    ///
    /// # Errors
    ///
    /// A side does not stand where it should.
    pub async fn close(mut self) -> Result<(), SideError> {
        let result = self.confirm().await;
        self.stop().await;
        result
    }

    /// A last barrier, so that a session's last step is confirmed like all others.
    ///
    /// # Errors
    ///
    /// A side does not stand where it should.
    pub async fn confirm(&mut self) -> Result<(), SideError> {
        if self.step == 0 { Ok(()) } else { self.compare(self.step, self.time_ns).await }
    }

    /// Ends both sides as they are.
    pub async fn stop(self) {
        tokio::join!(self.robots.stop(), self.network.stop());
    }

    /// Gives both peers back, to configure another experiment on them.
    #[must_use]
    pub fn into_peers(self) -> (R, N) {
        (self.robots, self.network)
    }

    /// Asks both sides where they stand, and whether they hold what was exchanged.
    async fn compare(&mut self, step: u64, time_ns: u64) -> Result<(), SideError> {
        let robots = self.robots.barrier(step, time_ns).await?;
        check(RobotSide::SIDE, &robots, step, time_ns, self.agreed[0].as_ref())?;
        let network = self.network.barrier(step, time_ns).await?;
        check(NetworkSide::SIDE, &network, step, time_ns, self.agreed[1].as_ref())
    }

    /// Notes what the network was given to carry, where what it delivers is compared with it.
    fn sent(&mut self, on_air: &Arc<RobotsStep>, call: &NetworkCall<'_>) {
        if !N::SHARES_VALUES {
            if call.silence.is_none() {
                self.payloads.broadcast(on_air);
            }
            self.payloads.ordered(&call.commands);
        }
    }

    /// The orders to agents that wait. They are lost on robots that obey none.
    fn orders_to_agents(&mut self) -> Vec<AgentCommand> {
        let commands = std::mem::take(&mut self.commands);
        if commands.is_empty() || self.robots.described().commands {
            return commands;
        }
        tracing::warn!(
            n = commands.len(),
            "commands to robots are lost: the robot simulator does not announce support for commands"
        );
        Vec::new()
    }

    fn take_robots_reply(
        &mut self,
        step: u64,
        until_ns: u64,
        reply: RobotsStep,
        plan: &StepPlan,
    ) -> Result<Arc<RobotsStep>, SideError> {
        let hold = plan.hold;
        stands_at(RobotSide::SIDE, step, until_ns, reply.step, reply.time_ns)?;
        let garbage = |reason: String| Err(garbage(RobotSide::SIDE, step, reason));
        if reply.held != hold {
            return garbage(format!(
                "held: must equal hold of the request, {hold}, got {}",
                reply.held
            ));
        }
        if hold && !R::SHARES_VALUES && !are_in_the_same_places(&reply.states, &self.moved.states) {
            return garbage(
                "states: must be those of the step before, because the request set hold".to_owned(),
            );
        }
        if !reply.messages.is_empty() && !self.sends_messages {
            return garbage(
                "messages: must be absent, because the reply to Configure announced none"
                    .to_owned(),
            );
        }
        self.check_payloads(step, &reply)?;
        self.commands.extend_from_slice(&reply.commands);
        self.messages = messages_of(&reply);
        self.moved = Arc::new(reply);
        Ok(Arc::clone(&self.moved))
    }

    /// No robot says more than the network can broadcast. In step 0: what they say where they begin.
    fn check_payloads(&self, step: u64, robots: &RobotsStep) -> Result<(), SideError> {
        let checked = robots.payloads.check_lengths(self.max_payload_bytes);
        checked.map_err(|reason| garbage(RobotSide::SIDE, step, reason))
    }

    fn take_network_reply(
        &mut self,
        step: u64,
        reached_ns: u64,
        reply: NetworkStep,
    ) -> Result<Arc<NetworkStep>, SideError> {
        stands_at(NetworkSide::SIDE, step, reached_ns, reply.step, reply.time_ns)?;
        if reply.formation.is_some() != self.formation_at_start.is_some() {
            let reason = "formation: must be present in every step, or absent in every step, as announced in the reply to \
                          Configure";
            return Err(garbage(NetworkSide::SIDE, step, reason.to_owned()));
        }
        if !N::SHARES_VALUES {
            let checked = self.payloads.check(&reply);
            checked.map_err(|reason| garbage(NetworkSide::SIDE, step, reason))?;
        }
        self.commands.extend_from_slice(&reply.commands);
        sort_agent_commands(&mut self.commands);
        let reply = Arc::new(reply);
        self.carried = Some(Arc::clone(&reply));
        Ok(reply)
    }
}

/// Digests of the latest replies, where they are known already.
#[derive(Debug, Default)]
struct Hashed {
    robots: Option<RobotsReply>,
    network: Option<NetworkReply>,
}

/// Agents from which on a digest is computed on another thread, while the network takes its step.
const HASHED_BESIDES: usize = 1000;

/// Turns of the runtime until a request is on its way, so that what is hashed meanwhile does not delay it.
const TURNS_TO_SEND: usize = 4;

/// The digest of a reply.
async fn hashed<T: Send + Sync + 'static, D: Send + 'static>(
    reply: Arc<T>,
    n_agents: usize,
    digest: fn(&T) -> D,
) -> D {
    if n_agents < HASHED_BESIDES {
        return digest(&reply);
    }
    let hashing = tokio::task::spawn_blocking(move || digest(&reply));
    hashing.await.expect("hashing numbers does not panic")
}

fn digest_of(step: u64, time_ns: u64, on_air: &RobotsStep, given: Option<&NetworkStep>) -> Digest {
    let deliveries: Option<&Deliveries> = given.map(|reply| &reply.deliveries);
    digest::of_step(step, time_ns, &on_air.states, deliveries)
}

fn are_in_the_same_places(a: &AgentStates, b: &AgentStates) -> bool {
    a.x_m == b.x_m && a.y_m == b.y_m && a.z_m == b.z_m
}

fn garbage(side: &'static str, step: u64, reason: String) -> SideError {
    SideError::Garbage { side, doing: format!("step {step}"), reason }
}

/// What robots say to single ones of them, as orders to the network. Robots that stand still say nothing.
fn messages_of(reply: &RobotsStep) -> Vec<MoteCommand> {
    if reply.held { Vec::new() } else { reply.messages.iter().cloned().map(sent).collect() }
}

/// A message of the robots as the network is given it.
fn sent(message: AgentMessage) -> MoteCommand {
    let AgentMessage { sender: mote, destination, payload } = message;
    let order = MoteOrder::Send { mote, destination, payload };
    MoteCommand { source: MESSAGES.to_owned(), order }
}

/// Who orders the network to send what robots say to single ones of them.
const MESSAGES: &str = "robots";

fn stands_at(
    side: &'static str,
    step: u64,
    time_ns: u64,
    got_step: u64,
    got_ns: u64,
) -> Result<(), SideError> {
    if got_step != step {
        return Err(SideError::WrongStep { side, expected: step, got: got_step });
    }
    if got_ns != time_ns {
        return Err(SideError::WrongTime { side, step, expected: time_ns, got: got_ns });
    }
    Ok(())
}

/// Compares where a side stands, and the digest that it holds with the one expected; `None`: there is none to compare.
fn check(
    side: &'static str,
    standing: &Standing,
    step: u64,
    time_ns: u64,
    expected: Option<&Digest>,
) -> Result<(), SideError> {
    stands_at(side, step, time_ns, standing.step, standing.time_ns)?;
    match expected {
        Some(digest) if standing.digest[..] != digest[..] => Err(SideError::WrongDigest {
            side,
            step,
            expected: digest::hex(digest),
            got: if standing.digest.is_empty() {
                "missing".to_owned()
            } else {
                digest::hex(&standing.digest)
            },
        }),
        _ => Ok(()),
    }
}
