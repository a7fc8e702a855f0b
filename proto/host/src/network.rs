//! The network's service.

use super::lifecycle::{
    self, Admission, ConfigureFields, Ledger, Shared, beside, malformed, not_configured, queue,
    refusal,
};
use super::orders::OrdersFromOutside;
use crate::services::net_sim_service_server::NetSimService;
use futures::stream::{BoxStream, StreamExt as _, try_unfold};
use proto::digest::full::{NetworkGiven, NetworkReply, of_network_start, of_network_step};
use proto::digest::of_step;
use proto::exchange::NetworkStart;
use proto::side::{MAX_AGENTS, NetInput, NetOutput, NetSimulator};
use proto::types::{AgentStates, Deliveries, MoteCommand, NetRecord};
use proto_messages::v1::net_sim_service_session_request::Request as SessionCall;
use proto_messages::v1::net_sim_service_session_response::Response as SessionReply;
use proto_messages::v1::{self, Limits};
use proto_messages::{CONTRACT_VERSION, convert};
use serde::{Deserialize, Serialize};
use std::sync::Arc;
use tonic::{Request, Response, Status, Streaming};

/// A network simulator as a service.
pub struct NetHost<S> {
    shared: Shared<S, Active>,
    /// Of the simulator, which may be busy when it is asked to describe itself.
    config_schema_json: Arc<str>,
    orders: Arc<OrdersFromOutside>,
}

impl<S> Clone for NetHost<S> {
    fn clone(&self) -> Self {
        Self {
            shared: self.shared.clone(),
            config_schema_json: Arc::clone(&self.config_schema_json),
            orders: Arc::clone(&self.orders),
        }
    }
}

impl<S: NetSimulator> NetHost<S> {
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

    fn describe(&self) -> v1::NetSimServiceDescribeResponse {
        v1::NetSimServiceDescribeResponse {
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
            commands: S::commands()
                .iter()
                .map(|&kind| v1::MoteCommandKind::from(kind).into())
                .collect(),
            parallel: true,
            stop_at_first_delivery: true,
            columns: S::columns()
                .iter()
                .map(|&column| v1::DeliveryColumn::from(column).into())
                .collect(),
            config_schema_json: self.config_schema_json.to_string(),
            records: numbers(S::records()),
            full_digest: true,
        }
    }
}

type Lifecycle<S> = lifecycle::Lifecycle<S, Active>;

#[derive(Serialize, Deserialize)]
struct Active {
    ledger: Ledger,
    pending: Vec<MoteCommand>,
    /// What was delivered in the latest step: the robots are given it in the next, whose digest covers it, unless that is a full
    /// one.
    delivered: Option<Deliveries>,
    /// What is kept for the record.
    records: Vec<NetRecord>,
    #[serde(with = "lifecycle::encoded")]
    last: v1::NetSimServiceStepResponse,
}

impl lifecycle::Active for Active {
    fn ledger(&self) -> &Ledger {
        &self.ledger
    }
}

impl<S: NetSimulator> Lifecycle<S> {
    fn configure(
        &mut self,
        request: v1::NetSimServiceConfigureRequest,
    ) -> Result<v1::NetSimServiceConfigureResponse, Status> {
        let full_digest = request.full_digest;
        let (setup, sent) = ConfigureFields {
            seed: request.seed,
            agent_count: request.agent_count,
            step_ns: request.step_ns,
            coupling: request.coupling,
            site_toml: request.site_toml,
            config_toml: request.config_toml,
            files: request.files,
            columns: request.columns,
            records: request.records,
        }
        .setup()?;
        if let Some(column) = setup.columns.iter().find(|column| !S::columns().contains(column)) {
            return Err(Status::invalid_argument(format!("columns: {column:?} is not announced")));
        }
        if let Some(record) = setup.records.iter().find(|record| !S::records().contains(record)) {
            return Err(Status::invalid_argument(format!("records: {record:?} is not announced")));
        }
        let start = self.simulator.configure(&setup).map_err(|problems| refusal(&problems))?;
        let start = NetworkStart {
            effective_toml: start.effective.to_string(),
            motes: Some(start.motes),
            warnings: start.warnings,
            formation: start.formation,
            records: start.records,
            statistics: start.statistics,
            capture_header: start.capture_header,
        };
        let digest = full_digest.then(|| of_network_start(&sent.request(&setup), &start));
        self.active = Some(Active {
            ledger: Ledger::new(setup.experiment, AgentStates::default(), digest),
            pending: Vec::new(),
            delivered: None,
            records: start.records.clone(),
            last: v1::NetSimServiceStepResponse::default(),
        });
        Ok((&start).into())
    }

    fn step(
        &mut self,
        request: v1::NetSimServiceStepRequest,
    ) -> Result<v1::NetSimServiceStepResponse, Status> {
        let active = self.active.as_mut().ok_or_else(not_configured)?;
        let ledger = &mut active.ledger;
        let admission = ledger.admit(request.step, request.until_ns, &request.confirmed_digest)?;
        let n = ledger.agent_count();
        let states = convert::states(request.states, n).map_err(malformed)?;
        let payloads = convert::payloads(request.payloads, n).map_err(malformed)?;
        let moved_obstacles =
            convert::moved_obstacles(request.moved_obstacles).map_err(malformed)?;
        let asked = obeyed(&self.simulator, request.commands, n)?;
        let mut commands = asked.clone();
        commands.extend_from_slice(&active.pending);
        commands.sort_by(|a, b| a.source.cmp(&b.source));
        let records = convert::records(&request.records).map_err(malformed)?;
        if let Some(record) =
            records.iter().find(|record| !record.is_state() || !active.records.contains(record))
        {
            return Err(Status::invalid_argument(format!(
                "records: {record:?} is not a state that is kept"
            )));
        }

        let input = NetInput {
            step: request.step,
            from_ns: ledger.time_ns,
            until_ns: request.until_ns,
            states: &states,
            payloads: &payloads,
            moved_obstacles: &moved_obstacles,
            commands: &commands,
            stop_at_first_delivery: request.stop_at_first_delivery,
            records: &records,
        };
        let given = || NetworkGiven::of_input(&input, &asked);
        if let Admission::Repeated = admission {
            ledger.repeat(&given().parts(), &NetworkGiven::PARTS)?;
            return Ok(active.last.clone());
        }
        // What the lesser digest covers is known before, but for where a step ends that may end early.
        let delivered = active.delivered.as_ref();
        let digest_at = |time_ns| of_step(request.step, time_ns, &states, delivered);
        let is_full = ledger.start.is_some();
        let early = (!is_full && !request.stop_at_first_delivery).then_some(request.until_ns);
        let simulator = &mut self.simulator;
        let (output, (given, early)) =
            beside(n, || simulator.step(&input), || (given(), early.map(digest_at)));
        let digest = match ledger.start {
            Some(start) => {
                let reply = NetworkReply::of_output(request.step, &output, &active.pending);
                of_network_step(&start, &given, &reply, &output.capture)
            }
            None => early
                .filter(|_| output.time_ns == request.until_ns)
                .unwrap_or_else(|| digest_at(output.time_ns)),
        };
        let NetOutput {
            time_ns,
            deliveries,
            motes,
            commands,
            formation,
            packets,
            capture,
            statistics,
            schedule,
            heard_links,
            frames,
        } = output;

        active.delivered = (!is_full).then(|| deliveries.clone());
        let digest =
            ledger.advance(request.step, request.until_ns, &given.parts(), time_ns, digest);
        active.last = v1::NetSimServiceStepResponse {
            step: request.step,
            time_ns,
            deliveries: Some(deliveries.into()),
            motes: Some(motes.into()),
            commands: commands.into_iter().map(Into::into).collect(),
            applied_commands: std::mem::take(&mut active.pending)
                .into_iter()
                .map(Into::into)
                .collect(),
            digest,
            formation: formation.map(Into::into),
            packets: packets.map(Into::into),
            capture,
            statistics: statistics.map(Into::into),
            schedule: schedule.map(Into::into),
            heard_links: heard_links.map(Into::into),
            frames: frames.map(Into::into),
        };
        Ok(active.last.clone())
    }

    fn barrier(
        &mut self,
        request: &v1::NetSimServiceBarrierRequest,
    ) -> Result<v1::NetSimServiceBarrierResponse, Status> {
        let ledger = &self.active()?.ledger;
        ledger.barrier(request.step)?;
        Ok(v1::NetSimServiceBarrierResponse {
            step: ledger.step,
            time_ns: ledger.time_ns,
            digest: ledger.digest(),
        })
    }

    fn command(
        &mut self,
        request: v1::NetSimServiceCommandRequest,
    ) -> Result<v1::NetSimServiceCommandResponse, Status> {
        let active = self.active.as_mut().ok_or_else(not_configured)?;
        let commands = obeyed(&self.simulator, request.commands, active.ledger.agent_count())?;
        queue(&mut active.pending, commands)?;
        active.pending.sort_by(|a, b| a.source.cmp(&b.source));
        Ok(v1::NetSimServiceCommandResponse { applies_at_step: active.ledger.step + 1 })
    }

    fn snapshot(&mut self) -> Result<v1::NetSimServiceSnapshotResponse, Status> {
        let state = self.frozen(version::<S>(), S::snapshot)?;
        Ok(v1::NetSimServiceSnapshotResponse { state })
    }

    fn restore(
        &mut self,
        request: &v1::NetSimServiceRestoreRequest,
    ) -> Result<v1::NetSimServiceRestoreResponse, Status> {
        let &Ledger { step, time_ns, .. } =
            self.restored(&request.state, &version::<S>(), request.seed, S::restore, S::reseed)?;
        Ok(v1::NetSimServiceRestoreResponse { step, time_ns })
    }
}

/// Orders that are well formed and mean something to the simulator as it is configured.
fn obeyed<S: NetSimulator>(
    simulator: &S,
    messages: Vec<v1::MoteCommand>,
    n: usize,
) -> Result<Vec<MoteCommand>, Status> {
    let commands = convert::mote_commands(messages, n).map_err(malformed)?;
    for command in &commands {
        let kind = command.order.kind();
        if !simulator.obeys(kind) {
            return Err(Status::unimplemented(format!(
                "commands: {}, as configured, does not support {}",
                S::NAME,
                v1::MoteCommandKind::from(kind).as_str_name()
            )));
        }
    }
    Ok(commands)
}

fn numbers(records: &[NetRecord]) -> Vec<i32> {
    records.iter().map(|&record| v1::NetRecord::from(record).into()).collect()
}

fn version<S: NetSimulator>() -> String {
    format!("{} {}", S::NAME, env!("CARGO_PKG_VERSION"))
}

#[tonic::async_trait]
impl<S: NetSimulator> NetSimService for NetHost<S> {
    async fn describe(
        &self,
        _: Request<v1::NetSimServiceDescribeRequest>,
    ) -> Result<Response<v1::NetSimServiceDescribeResponse>, Status> {
        Ok(Response::new(NetHost::describe(self)))
    }

    async fn configure(
        &self,
        request: Request<v1::NetSimServiceConfigureRequest>,
    ) -> Result<Response<v1::NetSimServiceConfigureResponse>, Status> {
        self.shared
            .call_blocking(|host| host.configure(request.into_inner()))
            .await
            .map(Response::new)
    }

    async fn step(
        &self,
        request: Request<v1::NetSimServiceStepRequest>,
    ) -> Result<Response<v1::NetSimServiceStepResponse>, Status> {
        self.shared.call(|host| host.step(request.into_inner())).await.map(Response::new)
    }

    async fn barrier(
        &self,
        request: Request<v1::NetSimServiceBarrierRequest>,
    ) -> Result<Response<v1::NetSimServiceBarrierResponse>, Status> {
        self.shared.call(move |host| host.barrier(request.get_ref())).await.map(Response::new)
    }

    type SessionStream = BoxStream<'static, Result<v1::NetSimServiceSessionResponse, Status>>;

    async fn session(
        &self,
        request: Request<Streaming<v1::NetSimServiceSessionRequest>>,
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
                let reply = v1::NetSimServiceSessionResponse { response: Some(reply) };
                Ok(Some((reply, (calls, shared))))
            });
        Ok(Response::new(replies.boxed()))
    }

    async fn snapshot(
        &self,
        _: Request<v1::NetSimServiceSnapshotRequest>,
    ) -> Result<Response<v1::NetSimServiceSnapshotResponse>, Status> {
        self.shared.call_blocking(Lifecycle::snapshot).await.map(Response::new)
    }

    async fn restore(
        &self,
        request: Request<v1::NetSimServiceRestoreRequest>,
    ) -> Result<Response<v1::NetSimServiceRestoreResponse>, Status> {
        self.shared
            .call_blocking(move |host| host.restore(request.get_ref()))
            .await
            .map(Response::new)
    }

    async fn command(
        &self,
        request: Request<v1::NetSimServiceCommandRequest>,
    ) -> Result<Response<v1::NetSimServiceCommandResponse>, Status> {
        self.orders.admit(&request)?;
        self.shared.call(|host| host.command(request.into_inner())).await.map(Response::new)
    }
}
