//! The network's service.

use super::lifecycle::{
    self, Admission, Host, Ledger, Shared, admissible, beside, limits, malformed, not_configured,
    queue, refusal, sent,
};
use super::service::service;
use crate::services::net_sim_service_server::NetSimService;
use futures::stream::{BoxStream, StreamExt as _, try_unfold};
use proto::digest::full::{
    NetworkGiven, NetworkReply, StartRequest, of_network_start, of_network_step,
};
use proto::digest::of_step;
use proto::exchange::{NetworkStart, NetworkStep};
use proto::side::{NetInput, NetSimulator};
use proto::types::{AgentStates, Deliveries, MoteCommand, NetRecord};
use proto_messages::{CONTRACT_VERSION, convert, net_sim, v1};
use serde::{Deserialize, Serialize};
use tonic::{Request, Response, Status, Streaming};

/// A network simulator as a service.
pub type NetHost<S> = Host<S, Active>;

impl<S: NetSimulator> NetHost<S> {
    /// A service around `simulator`, not configured yet, which takes orders from anyone.
    pub fn new(simulator: S) -> Self {
        let schema = simulator.config_schema_json();
        Self::around(simulator, &schema)
    }

    fn describe(&self) -> net_sim::DescribeResponse {
        net_sim::DescribeResponse {
            name: S::NAME.to_owned(),
            version: env!("CARGO_PKG_VERSION").to_owned(),
            contract_version: CONTRACT_VERSION,
            limits: Some(limits()),
            session: true,
            snapshots: true,
            reseed: true,
            commands: convert::numbers(S::commands()),
            parallel: true,
            stop_at_first_delivery: true,
            columns: convert::numbers(S::columns()),
            config_schema_json: self.config_schema_json.to_string(),
            records: convert::numbers(S::records()),
            full_digest: true,
        }
    }
}

type Lifecycle<S> = lifecycle::Lifecycle<S, Active>;

/// What is kept of an experiment.
#[derive(Serialize, Deserialize)]
pub struct Active {
    ledger: Ledger,
    pending: Vec<MoteCommand>,
    /// What was delivered in the latest step: the robots are given it in the next, whose digest covers it, unless that is a full
    /// one.
    delivered: Option<Deliveries>,
    /// What is kept for the record.
    records: Vec<NetRecord>,
    max_payload_bytes: Option<u32>,
    #[serde(with = "lifecycle::encoded")]
    last: net_sim::StepResponse,
}

impl lifecycle::Active for Active {
    fn ledger(&self) -> &Ledger {
        &self.ledger
    }
}

impl<S: NetSimulator> Lifecycle<S> {
    fn configure(
        &mut self,
        request: net_sim::ConfigureRequest,
    ) -> Result<net_sim::ConfigureResponse, Status> {
        admissible(request.agent_count, request.step_ns)?;
        let files = request.files.clone();
        let request = convert::network_request(request).map_err(malformed)?;
        let setup = request.setup().map_err(refusal)?;
        if let Some(column) = setup.columns.iter().find(|column| !S::columns().contains(column)) {
            return Err(Status::invalid_argument(format!("columns: {column:?} is not announced")));
        }
        if let Some(record) = setup.records.iter().find(|record| !S::records().contains(record)) {
            return Err(Status::invalid_argument(format!("records: {record:?} is not announced")));
        }
        let start = self.simulator.configure(&setup).map_err(refusal)?;
        let start = NetworkStart::from(start);
        let asked = StartRequest { files: sent(&files), ..(&request).into() };
        let digest = request.full_digest.then(|| of_network_start(&asked, &start));
        self.active = Some(Active {
            ledger: Ledger::new(setup.experiment, AgentStates::default(), digest),
            pending: Vec::new(),
            delivered: None,
            records: start.records.clone(),
            max_payload_bytes: start.max_payload_bytes,
            last: net_sim::StepResponse::default(),
        });
        Ok((&start).into())
    }

    fn step(&mut self, request: net_sim::StepRequest) -> Result<net_sim::StepResponse, Status> {
        let active = self.active.as_mut().ok_or_else(not_configured)?;
        let ledger = &mut active.ledger;
        let admission = ledger.admit(request.step, request.until_ns, &request.confirmed_digest)?;
        let n = ledger.agent_count();
        let states = convert::states(request.states, n).map_err(malformed)?;
        let payloads = convert::payloads(request.payloads, n).map_err(malformed)?;
        payloads.check_lengths(active.max_payload_bytes).map_err(Status::invalid_argument)?;
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
        let mut reply = NetworkStep::of_output(request.step, output);
        reply.applied_commands = std::mem::take(&mut active.pending);
        let digest = match ledger.start {
            Some(start) => {
                of_network_step(&start, &given, &NetworkReply::of_step(&reply), &reply.capture)
            }
            None => early
                .filter(|_| reply.time_ns == request.until_ns)
                .unwrap_or_else(|| digest_at(reply.time_ns)),
        };
        active.delivered = (!is_full).then(|| reply.deliveries.clone());
        let digest =
            ledger.advance(request.step, request.until_ns, &given.parts(), reply.time_ns, digest);
        active.last = net_sim::StepResponse { digest, ..reply.into() };
        Ok(active.last.clone())
    }

    fn command(
        &mut self,
        request: net_sim::CommandRequest,
    ) -> Result<net_sim::CommandResponse, Status> {
        let active = self.active.as_mut().ok_or_else(not_configured)?;
        let commands = obeyed(&self.simulator, request.commands, active.ledger.agent_count())?;
        queue(&mut active.pending, commands)?;
        active.pending.sort_by(|a, b| a.source.cmp(&b.source));
        Ok(net_sim::CommandResponse { applies_at_step: active.ledger.step + 1 })
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

service!(NetSimService for NetHost, NetSimulator, net_sim {});
