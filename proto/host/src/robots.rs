//! The robots' service.

use super::lifecycle::{
    self, Admission, ConfigureFields, Ledger, Shared, beside, malformed, not_configured, queue,
    refusal,
};
use super::orders::OrdersFromOutside;
use super::predict;
use crate::services::robot_sim_service_server::RobotSimService;
use futures::stream::{BoxStream, StreamExt as _, try_unfold};
use proto::digest::full::{RobotsGiven, RobotsReply, of_robots_start, of_robots_step};
use proto::digest::of_step;
use proto::exchange::RobotsStart;
use proto::side::{MAX_AGENTS, RobotInput, RobotOutput, RobotSimulator};
use proto::types::{AgentCommand, Coupling};
use proto_messages::v1::robot_sim_service_session_request::Request as SessionCall;
use proto_messages::v1::robot_sim_service_session_response::Response as SessionReply;
use proto_messages::v1::{self, Limits};
use proto_messages::{CONTRACT_VERSION, convert};
use serde::{Deserialize, Serialize};
use std::sync::Arc;
use tonic::{Request, Response, Status, Streaming};

/// A robot simulator as a service.
pub struct RobotHost<S> {
    shared: Shared<S, Active>,
    /// Of the simulator, which may be busy when it is asked to describe itself.
    config_schema_json: Arc<str>,
    orders: Arc<OrdersFromOutside>,
}

impl<S> Clone for RobotHost<S> {
    fn clone(&self) -> Self {
        Self {
            shared: self.shared.clone(),
            config_schema_json: Arc::clone(&self.config_schema_json),
            orders: Arc::clone(&self.orders),
        }
    }
}

impl<S: RobotSimulator> RobotHost<S> {
    /// A service around `simulator`, not configured yet, which takes orders from anyone.
    pub fn new(simulator: S) -> Self {
        let config_schema_json = simulator.config_schema_json().into();
        let shared = Shared::new(simulator);
        Self { shared, config_schema_json, orders: Arc::default() }
    }

    /// The same service, which takes orders from those alone.
    #[must_use]
    pub fn with_orders(self, orders: OrdersFromOutside) -> Self {
        Self { orders: Arc::new(orders), ..self }
    }

    fn describe(&self) -> v1::RobotSimServiceDescribeResponse {
        v1::RobotSimServiceDescribeResponse {
            name: S::NAME.to_owned(),
            version: env!("CARGO_PKG_VERSION").to_owned(),
            contract_version: CONTRACT_VERSION,
            limits: Some(Limits {
                max_message_bytes: super::MAX_MESSAGE_BYTES as u64,
                max_agents: MAX_AGENTS,
            }),
            session: true,
            snapshots: true,
            reseed: true,
            commands: true,
            parallel: true,
            config_schema_json: self.config_schema_json.to_string(),
            hold: true,
            full_digest: true,
            predictions: true,
        }
    }
}

type Lifecycle<S> = lifecycle::Lifecycle<S, Active>;

#[derive(Serialize, Deserialize)]
struct Active {
    ledger: Ledger,
    pending: Vec<AgentCommand>,
    #[serde(with = "lifecycle::encoded")]
    last: v1::RobotSimServiceStepResponse,
}

impl lifecycle::Active for Active {
    fn ledger(&self) -> &Ledger {
        &self.ledger
    }
}

impl<S: RobotSimulator> Lifecycle<S> {
    fn configure(
        &mut self,
        request: v1::RobotSimServiceConfigureRequest,
    ) -> Result<v1::RobotSimServiceConfigureResponse, Status> {
        let full_digest = request.full_digest;
        let (setup, sent) = ConfigureFields {
            seed: request.seed,
            agent_count: request.agent_count,
            step_ns: request.step_ns,
            coupling: request.coupling,
            site_toml: request.site_toml,
            config_toml: request.config_toml,
            files: request.files,
            columns: Vec::new(),
            records: Vec::new(),
        }
        .setup()?;
        let start = self.simulator.configure(&setup).map_err(|problems| refusal(&problems))?;
        let start = RobotsStart {
            effective_toml: start.effective.to_string(),
            states: start.states,
            payloads: Some(start.payloads),
            columns: start.columns,
            messages: start.messages,
        };
        let digest = full_digest.then(|| of_robots_start(&sent.request(&setup), &start));
        self.active = Some(Active {
            ledger: Ledger::new(setup.experiment, start.states.clone(), digest),
            pending: Vec::new(),
            last: v1::RobotSimServiceStepResponse::default(),
        });
        Ok((&start).into())
    }

    fn step(
        &mut self,
        request: v1::RobotSimServiceStepRequest,
    ) -> Result<v1::RobotSimServiceStepResponse, Status> {
        let active = self.active.as_mut().ok_or_else(not_configured)?;
        let ledger = &mut active.ledger;
        let admission = ledger.admit(request.step, request.until_ns, &request.confirmed_digest)?;
        let n = ledger.agent_count();
        let deliveries = convert::deliveries(request.deliveries, n).map_err(malformed)?;
        let motes = request
            .motes
            .map(|motes| convert::motes(Some(motes), n))
            .transpose()
            .map_err(malformed)?;
        let asked = convert::agent_commands(request.commands, n).map_err(malformed)?;
        let mut commands = asked.clone();
        commands.extend_from_slice(&active.pending);
        convert::sort_agent_commands(&mut commands);

        let input = RobotInput {
            step: request.step,
            from_ns: ledger.time_ns,
            until_ns: request.until_ns,
            deliveries: deliveries.as_ref(),
            motes: motes.as_ref(),
            commands: &commands,
            hold: request.hold,
        };
        let given = || RobotsGiven::of_input(&input, &asked);
        if let Admission::Repeated = admission {
            if request.hold != active.last.held {
                return Err(Status::failed_precondition(format!(
                    "hold: step {} was taken with {}, but its repetition has {}",
                    request.step, active.last.held, request.hold
                )));
            }
            ledger.repeat(given().parts(), &RobotsGiven::PARTS)?;
            return Ok(active.last.clone());
        }
        let simulator = &mut self.simulator;
        let (output, given) = beside(n, || simulator.step(&input), given);
        let until_ns = request.until_ns;
        let digest = match ledger.start {
            Some(start) => {
                let reply = RobotsReply::of_output(&input, &output, &active.pending);
                of_robots_step(&start, &given, &reply)
            }
            None => {
                let used = match ledger.experiment.coupling {
                    Coupling::Sequential => &output.states,
                    Coupling::Parallel | Coupling::Event => &std::mem::take(&mut ledger.states),
                };
                of_step(request.step, until_ns, used, deliveries.as_ref())
            }
        };
        let digest = ledger.advance(request.step, until_ns, given.parts(), until_ns, digest);
        let RobotOutput {
            states,
            payloads,
            moved_obstacles,
            commands,
            task_complete,
            messages,
            figures,
        } = output;
        if ledger.experiment.coupling != Coupling::Sequential && ledger.start.is_none() {
            ledger.states = states.clone();
        }
        active.last = v1::RobotSimServiceStepResponse {
            step: request.step,
            time_ns: until_ns,
            states: Some(states.into()),
            payloads: Some(payloads.into()),
            moved_obstacles: moved_obstacles.into_iter().map(Into::into).collect(),
            commands: commands.into_iter().map(Into::into).collect(),
            applied_commands: std::mem::take(&mut active.pending)
                .into_iter()
                .map(Into::into)
                .collect(),
            task_complete,
            digest,
            held: request.hold,
            messages: (!messages.is_empty()).then(|| messages.into()),
            figures: figures.into_iter().map(Into::into).collect(),
        };
        Ok(active.last.clone())
    }

    fn barrier(
        &mut self,
        request: &v1::RobotSimServiceBarrierRequest,
    ) -> Result<v1::RobotSimServiceBarrierResponse, Status> {
        let ledger = &self.active()?.ledger;
        ledger.barrier(request.step)?;
        Ok(v1::RobotSimServiceBarrierResponse {
            step: ledger.step,
            time_ns: ledger.time_ns,
            digest: ledger.digest(),
        })
    }

    fn command(
        &mut self,
        request: v1::RobotSimServiceCommandRequest,
    ) -> Result<v1::RobotSimServiceCommandResponse, Status> {
        let active = self.active()?;
        let n = active.ledger.agent_count();
        let commands = convert::agent_commands(request.commands, n).map_err(malformed)?;
        queue(&mut active.pending, commands)?;
        convert::sort_agent_commands(&mut active.pending);
        Ok(v1::RobotSimServiceCommandResponse { applies_at_step: active.ledger.step + 1 })
    }

    fn snapshot(&mut self) -> Result<v1::RobotSimServiceSnapshotResponse, Status> {
        let state = self.frozen(version::<S>(), S::snapshot)?;
        Ok(v1::RobotSimServiceSnapshotResponse { state })
    }

    fn restore(
        &mut self,
        request: &v1::RobotSimServiceRestoreRequest,
    ) -> Result<v1::RobotSimServiceRestoreResponse, Status> {
        let &Ledger { step, time_ns, .. } =
            self.restored(&request.state, &version::<S>(), request.seed, S::restore, S::reseed)?;
        Ok(v1::RobotSimServiceRestoreResponse { step, time_ns })
    }
}

fn version<S: RobotSimulator>() -> String {
    format!("{} {}", S::NAME, env!("CARGO_PKG_VERSION"))
}

#[tonic::async_trait]
impl<S: RobotSimulator> RobotSimService for RobotHost<S> {
    async fn describe(
        &self,
        _: Request<v1::RobotSimServiceDescribeRequest>,
    ) -> Result<Response<v1::RobotSimServiceDescribeResponse>, Status> {
        Ok(Response::new(RobotHost::describe(self)))
    }

    async fn configure(
        &self,
        request: Request<v1::RobotSimServiceConfigureRequest>,
    ) -> Result<Response<v1::RobotSimServiceConfigureResponse>, Status> {
        self.shared
            .call_blocking(|host| host.configure(request.into_inner()))
            .await
            .map(Response::new)
    }

    async fn step(
        &self,
        request: Request<v1::RobotSimServiceStepRequest>,
    ) -> Result<Response<v1::RobotSimServiceStepResponse>, Status> {
        self.shared.call(|host| host.step(request.into_inner())).await.map(Response::new)
    }

    async fn barrier(
        &self,
        request: Request<v1::RobotSimServiceBarrierRequest>,
    ) -> Result<Response<v1::RobotSimServiceBarrierResponse>, Status> {
        self.shared.call(move |host| host.barrier(request.get_ref())).await.map(Response::new)
    }

    type SessionStream = BoxStream<'static, Result<v1::RobotSimServiceSessionResponse, Status>>;

    async fn session(
        &self,
        request: Request<Streaming<v1::RobotSimServiceSessionRequest>>,
    ) -> Result<Response<Self::SessionStream>, Status> {
        let shared = self.shared.clone();
        let replies =
            try_unfold((request.into_inner(), shared), |(mut calls, shared)| async move {
                let Some(call) = calls.message().await? else { return Ok(None) };
                let reply = match call.request {
                    Some(SessionCall::Step(step)) => {
                        SessionReply::Step(shared.call(|host| host.step(step)).await?)
                    }
                    Some(SessionCall::Barrier(barrier)) => SessionReply::Barrier(
                        shared.call(move |host| host.barrier(&barrier)).await?,
                    ),
                    None => return Err(Status::invalid_argument("request: is missing")),
                };
                let reply = v1::RobotSimServiceSessionResponse { response: Some(reply) };
                Ok(Some((reply, (calls, shared))))
            });
        Ok(Response::new(replies.boxed()))
    }

    async fn snapshot(
        &self,
        _: Request<v1::RobotSimServiceSnapshotRequest>,
    ) -> Result<Response<v1::RobotSimServiceSnapshotResponse>, Status> {
        self.shared.call_blocking(Lifecycle::snapshot).await.map(Response::new)
    }

    async fn restore(
        &self,
        request: Request<v1::RobotSimServiceRestoreRequest>,
    ) -> Result<Response<v1::RobotSimServiceRestoreResponse>, Status> {
        self.shared
            .call_blocking(move |host| host.restore(request.get_ref()))
            .await
            .map(Response::new)
    }

    async fn command(
        &self,
        request: Request<v1::RobotSimServiceCommandRequest>,
    ) -> Result<Response<v1::RobotSimServiceCommandResponse>, Status> {
        self.orders.admit(&request)?;
        self.shared.call(|host| host.command(request.into_inner())).await.map(Response::new)
    }
    async fn predict(
        &self,
        request: Request<v1::RobotSimServicePredictRequest>,
    ) -> Result<Response<v1::RobotSimServicePredictResponse>, Status> {
        let request = predict::checked(request.into_inner())?;
        self.shared
            .call_blocking(move |host| predict::reply(&host.simulator, &request))
            .await
            .map(Response::new)
    }
}
