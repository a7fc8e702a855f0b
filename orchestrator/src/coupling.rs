//! Keeping the two simulators in step: who is given what, when, and the check that they agree.
//!
//! `proto/cosim/v1/common.proto` defines the order of things; this is its other half. Every reply is checked before it
//! is passed on, so that a side that answers nonsense is named and the other never sees it.

use crate::peer::{Network, Peer, Robots, Service as _, SideError, Standing};
use bytes::Bytes;
use proto::digest::{self, Digest};
use proto::types::{
    AgentCommand, AgentMessage, AgentStates, Coupling, Deliveries, Experiment, Formation,
    MoteCommand, MoteOrder, MovedObstacle, NetRecord, Payloads,
};
use proto_messages::convert::{self, InvalidField};
use proto_messages::v1;

/// Both simulators, configured, and what was exchanged last.
pub struct Coupled {
    robots: Peer<Robots>,
    network: Peer<Network>,
    experiment: Experiment,
    step: u64,
    time_ns: u64,
    /// Digest of the latest step, which both sides hold. Empty before the first.
    agreed: Bytes,
    states: AgentStates,
    payloads: Payloads,
    deliveries: Option<Deliveries>,
    motes: Option<v1::MoteStates>,
    moved: Vec<MovedObstacle>,
    commands: Vec<AgentCommand>,
    /// What the robots have to say to single ones of them, as orders to the network, which has not been given it yet.
    messages: Vec<MoteCommand>,
    /// The robots said that there would be such.
    sends_messages: bool,
    formation: Option<Formation>,
}

/// What a step is to be.
#[derive(Clone, Debug, Default)]
pub struct StepPlan {
    /// How far (ns). Under event coupling: to the first delivery before, at the latest to here.
    pub until_ns: u64,
    /// The replies are wanted.
    pub keep: bool,
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

/// What a step brought, for records. The replies are as received, without their digests.
#[derive(Debug)]
pub struct StepOutcome {
    /// Its number, from 1.
    pub step: u64,
    /// The time reached (ns).
    pub time_ns: u64,
    /// The robots' reply, if asked for.
    pub robots: Option<v1::RobotSimServiceStepResponse>,
    /// The network's reply, if asked for.
    pub network: Option<v1::NetSimServiceStepResponse>,
    /// The digest that everyone holds.
    pub digest: Digest,
    /// The robots regard their task as done.
    pub task_complete: bool,
}

impl Coupled {
    /// Takes over two peers that have been configured with `experiment`; `start` and `network_start` are their replies.
    ///
    /// # Errors
    ///
    /// A malformed reply.
    pub fn new(
        robots: Peer<Robots>,
        network: Peer<Network>,
        experiment: Experiment,
        start: v1::RobotSimServiceConfigureResponse,
        network_start: v1::NetSimServiceConfigureResponse,
    ) -> Result<Self, SideError> {
        let n = experiment.agent_count;
        let of_robots = |invalid: InvalidField| garbage(Robots::SIDE, "Configure", invalid);
        let of_network = |invalid: InvalidField| garbage(Network::SIDE, "Configure", invalid);
        let states = convert::states(start.states, n).map_err(of_robots)?;
        let payloads = convert::payloads(start.payloads, n).map_err(of_robots)?;
        let formation = convert::formation(network_start.formation, n).map_err(of_network)?;
        convert::statistics(network_start.statistics, n).map_err(of_network)?;
        Ok(Self {
            robots,
            network,
            experiment,
            step: 0,
            time_ns: 0,
            agreed: Bytes::new(),
            states,
            payloads,
            deliveries: None,
            motes: None,
            moved: Vec::new(),
            commands: Vec::new(),
            messages: Vec::new(),
            sends_messages: start.messages,
            formation,
        })
    }

    /// The network's formation after the latest step; `None`: it has nothing to form.
    #[must_use]
    pub fn formation(&self) -> Option<&Formation> {
        self.formation.as_ref()
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
        let StepPlan { until_ns, keep, hold, .. } = plan;
        let n = self.experiment.agent_count;
        let step = self.step + 1;
        let mut given = self.deliveries.take();
        let mut used = None;
        let mut digest = None;
        let (mut robots_reply, mut network_reply) = match self.experiment.coupling {
            Coupling::Sequential => {
                let request = self.robots_request(step, until_ns, given.as_ref(), hold);
                let mut robots_reply = self.robots.step(step, request).await?;
                self.take_robots_reply(step, until_ns, &mut robots_reply, hold)?;
                if robots_reply.task_complete {
                    plan.records = std::mem::take(&mut plan.records_if_complete);
                }
                let request = self.network_request(step, &plan, false);
                if n < HASHED_BESIDES {
                    (robots_reply, self.network.step(step, request).await?)
                } else {
                    let states = std::mem::take(&mut self.states);
                    let hashing = tokio::task::spawn_blocking(move || {
                        let digest = digest::of_step(step, until_ns, &states, given.as_ref());
                        (digest, states, given)
                    });
                    let network_reply = self.network.step(step, request).await;
                    let hashed = hashing.await.expect("hashing numbers does not panic");
                    (digest, self.states, given) = (Some(hashed.0), hashed.1, hashed.2);
                    (robots_reply, network_reply?)
                }
            }
            Coupling::Parallel => {
                let to_robots = self.robots_request(step, until_ns, given.as_ref(), hold);
                let to_network = self.network_request(step, &plan, false);
                let (robots_reply, network_reply) = tokio::join!(
                    self.robots.step(step, to_robots),
                    self.network.step(step, to_network)
                );
                let (mut robots_reply, network_reply) = match (robots_reply, network_reply) {
                    (Ok(robots), Ok(network)) => (robots, network),
                    (Err(robots), Err(network)) => {
                        return Err(SideError::Both(Box::new(robots), Box::new(network)));
                    }
                    (Err(error), Ok(_)) | (Ok(_), Err(error)) => return Err(error),
                };
                used = Some(self.states.clone());
                self.take_robots_reply(step, until_ns, &mut robots_reply, hold)?;
                (robots_reply, network_reply)
            }
            Coupling::Event => {
                let request = self.network_request(step, &plan, !hold);
                let network_reply = self.network.step(step, request).await?;
                let reached_ns = network_reply.time_ns;
                let stopped_early = reached_ns < until_ns;
                if reached_ns <= self.time_ns || until_ns < reached_ns || hold && stopped_early {
                    return Err(SideError::WrongTime {
                        side: Network::SIDE,
                        step,
                        expected: until_ns,
                        got: reached_ns,
                    });
                }
                let request = self.robots_request(step, reached_ns, given.as_ref(), hold);
                let mut robots_reply = self.robots.step(step, request).await?;
                used = Some(self.states.clone());
                self.take_robots_reply(step, reached_ns, &mut robots_reply, hold)?;
                (robots_reply, network_reply)
            }
        };
        let reached_ns = match self.experiment.coupling {
            Coupling::Event => network_reply.time_ns,
            Coupling::Sequential | Coupling::Parallel => until_ns,
        };
        self.take_network_reply(step, reached_ns, &mut network_reply, n)?;

        let used = used.as_ref().unwrap_or(&self.states);
        let digest =
            digest.unwrap_or_else(|| digest::of_step(step, reached_ns, used, given.as_ref()));
        let standings = (
            standing(self.robots.streams(), step, reached_ns, &mut robots_reply.digest),
            standing(self.network.streams(), step, reached_ns, &mut network_reply.digest),
        );
        let robots_stand = match standings.0 {
            Some(standing) => standing,
            None => self.robots.barrier(step, reached_ns).await?,
        };
        check(Robots::SIDE, &robots_stand, step, reached_ns, &digest)?;
        let network_stands = match standings.1 {
            Some(standing) => standing,
            None => self.network.barrier(step, reached_ns).await?,
        };
        check(Network::SIDE, &network_stands, step, reached_ns, &digest)?;

        self.step = step;
        self.time_ns = reached_ns;
        self.agreed = Bytes::copy_from_slice(&digest);
        let task_complete = robots_reply.task_complete;
        let kept = keep.then(|| {
            robots_reply.states = Some(self.states.clone().into());
            robots_reply.payloads = Some(self.payloads.clone().into());
            network_reply.deliveries = self.deliveries.clone().map(Into::into);
            (robots_reply, network_reply)
        });
        let (robots, network) = kept.unzip();
        Ok(StepOutcome { step, time_ns: reached_ns, robots, network, digest, task_complete })
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
        if self.step == 0 {
            return Ok(());
        }
        let (step, time_ns) = (self.step, self.time_ns);
        let digest: Digest = self.agreed[..].try_into().unwrap_or_default();
        let robots = self.robots.barrier(step, time_ns).await?;
        check(Robots::SIDE, &robots, step, time_ns, &digest)?;
        let network = self.network.barrier(step, time_ns).await?;
        check(Network::SIDE, &network, step, time_ns, &digest)
    }

    /// Ends both sides as they are.
    pub async fn stop(self) {
        tokio::join!(self.robots.stop(), self.network.stop());
    }

    /// Gives both peers back, to configure another experiment on them.
    #[must_use]
    pub fn into_peers(self) -> (Peer<Robots>, Peer<Network>) {
        (self.robots, self.network)
    }

    fn confirmed(&self, streams: bool) -> Bytes {
        if streams { self.agreed.clone() } else { Bytes::new() }
    }

    fn robots_request(
        &mut self,
        step: u64,
        until_ns: u64,
        deliveries: Option<&Deliveries>,
        hold: bool,
    ) -> v1::RobotSimServiceStepRequest {
        let commands = std::mem::take(&mut self.commands);
        if !commands.is_empty() && !self.robots.described().commands {
            tracing::warn!(
                n = commands.len(),
                "orders to agents are lost: the robot simulator does not announce commands"
            );
        }
        v1::RobotSimServiceStepRequest {
            step,
            until_ns,
            deliveries: deliveries.cloned().map(Into::into),
            motes: self.motes.clone(),
            commands: if self.robots.described().commands {
                commands.into_iter().map(Into::into).collect()
            } else {
                Vec::new()
            },
            confirmed_digest: self.confirmed(self.robots.streams()),
            hold,
        }
    }

    fn network_request(
        &mut self,
        step: u64,
        plan: &StepPlan,
        stop_at_first_delivery: bool,
    ) -> v1::NetSimServiceStepRequest {
        // A network that forms has nothing of the robots' to carry.
        let payloads = if plan.hold {
            Payloads::silence(self.experiment.agent_count)
        } else {
            self.payloads.clone()
        };
        // Sorted by source, as all orders.
        let mut commands = plan.commands.clone();
        commands.append(&mut self.messages);
        commands.sort_by(|a, b| a.source.cmp(&b.source));
        v1::NetSimServiceStepRequest {
            step,
            until_ns: plan.until_ns,
            states: Some(self.states.clone().into()),
            payloads: Some(payloads.into()),
            moved_obstacles: std::mem::take(&mut self.moved).into_iter().map(Into::into).collect(),
            commands: commands.into_iter().map(Into::into).collect(),
            stop_at_first_delivery,
            confirmed_digest: self.confirmed(self.network.streams()),
            records: plan
                .records
                .iter()
                .map(|&record| v1::NetRecord::from(record).into())
                .collect(),
        }
    }

    fn take_robots_reply(
        &mut self,
        step: u64,
        until_ns: u64,
        reply: &mut v1::RobotSimServiceStepResponse,
        hold: bool,
    ) -> Result<(), SideError> {
        stands_at(Robots::SIDE, step, until_ns, reply.step, reply.time_ns)?;
        let n = self.experiment.agent_count;
        let garbage = |invalid| garbage(Robots::SIDE, &format!("step {step}"), invalid);
        let states = convert::states(reply.states.take(), n).map_err(garbage)?;
        if reply.held != hold {
            let reason = format!("must be {hold}, as hold of the request, got {}", reply.held);
            return Err(garbage(InvalidField::new("held", reason)));
        }
        let places =
            |states: &AgentStates| (states.x_m.clone(), states.y_m.clone(), states.z_m.clone());
        if hold && places(&states) != places(&self.states) {
            let reason = "must be those of the step before: the request said hold";
            return Err(garbage(InvalidField::new("states", reason)));
        }
        self.states = states;
        self.payloads = convert::payloads(reply.payloads.take(), n).map_err(garbage)?;
        self.moved = convert::moved_obstacles(reply.moved_obstacles.clone()).map_err(garbage)?;
        self.commands.extend(convert::agent_commands(reply.commands.clone(), n).map_err(garbage)?);
        convert::sort_agent_commands(&mut self.commands);
        convert::task_figures(reply.figures.clone()).map_err(garbage)?;
        let messages = convert::agent_messages(reply.messages.clone(), n).map_err(garbage)?;
        if !messages.is_empty() && !self.sends_messages {
            let reason = "must be absent: Configure did not say that there would be any";
            return Err(garbage(InvalidField::new("messages", reason)));
        }
        self.messages = if hold { Vec::new() } else { messages.into_iter().map(sent).collect() };
        Ok(())
    }

    fn take_network_reply(
        &mut self,
        step: u64,
        reached_ns: u64,
        reply: &mut v1::NetSimServiceStepResponse,
        n: usize,
    ) -> Result<(), SideError> {
        stands_at(Network::SIDE, step, reached_ns, reply.step, reply.time_ns)?;
        let garbage = |invalid| garbage(Network::SIDE, &format!("step {step}"), invalid);
        let deliveries = convert::deliveries(reply.deliveries.take(), n).map_err(garbage)?;
        self.deliveries = Some(deliveries.unwrap_or_default());
        if let Some(motes) = &reply.motes {
            convert::motes(Some(motes.clone()), n).map_err(garbage)?;
        }
        let formation = convert::formation(reply.formation.clone(), n).map_err(garbage)?;
        if formation.is_some() != self.formation.is_some() {
            let reason = "must be present in every step, or absent as in Configure";
            return Err(garbage(InvalidField::new("formation", reason)));
        }
        self.formation = formation;
        convert::packets(reply.packets.clone(), n).map_err(garbage)?;
        convert::statistics(reply.statistics.clone(), n).map_err(garbage)?;
        convert::schedule(reply.schedule.clone(), n).map_err(garbage)?;
        convert::heard_links(reply.heard_links.clone(), n).map_err(garbage)?;
        self.motes = reply.motes.clone();
        self.commands.extend(convert::agent_commands(reply.commands.clone(), n).map_err(garbage)?);
        convert::sort_agent_commands(&mut self.commands);
        Ok(())
    }
}

/// Agents from which on the digest is computed on another thread while the network takes its step.
const HASHED_BESIDES: usize = 1000;

fn garbage(side: &'static str, doing: &str, invalid: InvalidField) -> SideError {
    SideError::Garbage { side, doing: doing.to_owned(), reason: invalid.to_string() }
}

/// A message of the robots as the network is given it.
fn sent(message: AgentMessage) -> MoteCommand {
    let AgentMessage { sender: mote, destination, payload } = message;
    let order = MoteOrder::Send { mote, destination, payload };
    MoteCommand { source: MESSAGES.to_owned(), order }
}

/// Who orders the network to send what robots say to single ones of them.
const MESSAGES: &str = "robots";

/// In a session the digest rides on the step's reply; otherwise the barrier asks for it.
fn standing(streams: bool, step: u64, time_ns: u64, digest: &mut Bytes) -> Option<Standing> {
    let digest = std::mem::take(digest);
    streams.then_some(Standing { step, time_ns, digest })
}

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

fn check(
    side: &'static str,
    standing: &Standing,
    step: u64,
    time_ns: u64,
    digest: &Digest,
) -> Result<(), SideError> {
    stands_at(side, step, time_ns, standing.step, standing.time_ns)?;
    if standing.digest[..] != digest[..] {
        return Err(SideError::WrongDigest {
            side,
            step,
            expected: digest::hex(digest),
            got: if standing.digest.is_empty() {
                "missing".to_owned()
            } else {
                digest::hex(&standing.digest)
            },
        });
    }
    Ok(())
}
