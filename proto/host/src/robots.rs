//! The robots' service.

use super::lifecycle::{
    self, Admission, Host, Ledger, Shared, admissible, beside, limits, malformed, not_configured,
    queue, refusal, sent,
};
use super::predict;
use super::service::service;
use crate::services::robot_sim_service_server::RobotSimService;
use futures::stream::{BoxStream, StreamExt as _, try_unfold};
use proto::digest::full::{
    RobotsGiven, RobotsReply, StartRequest, of_robots_start, of_robots_step,
};
use proto::digest::of_step;
use proto::exchange::{RobotsStart, RobotsStep};
use proto::side::{RobotInput, RobotSimulator};
use proto::types::{AgentCommand, Coupling};
use proto_messages::{CONTRACT_VERSION, convert, robot_sim};
use serde::{Deserialize, Serialize};
use tonic::{Request, Response, Status, Streaming};

/// A robot simulator as a service.
pub type RobotHost<S> = Host<S, Active>;

impl<S: RobotSimulator> RobotHost<S> {
    /// A service around `simulator`, not configured yet, which takes orders from anyone.
    pub fn new(simulator: S) -> Self {
        let schema = simulator.config_schema_json();
        Self::around(simulator, &schema)
    }

    fn describe(&self) -> robot_sim::DescribeResponse {
        robot_sim::DescribeResponse {
            name: S::NAME.to_owned(),
            version: env!("CARGO_PKG_VERSION").to_owned(),
            contract_version: CONTRACT_VERSION,
            limits: Some(limits()),
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

/// What is kept of an experiment.
#[derive(Serialize, Deserialize)]
pub struct Active {
    ledger: Ledger,
    pending: Vec<AgentCommand>,
    #[serde(with = "lifecycle::encoded")]
    last: robot_sim::StepResponse,
}

impl lifecycle::Active for Active {
    fn ledger(&self) -> &Ledger {
        &self.ledger
    }
}

impl<S: RobotSimulator> Lifecycle<S> {
    fn configure(
        &mut self,
        request: robot_sim::ConfigureRequest,
    ) -> Result<robot_sim::ConfigureResponse, Status> {
        admissible(request.agent_count, request.step_ns)?;
        let files = request.files.clone();
        let request = convert::robots_request(request).map_err(malformed)?;
        let setup = request.setup().map_err(refusal)?;
        let start = self.simulator.configure(&setup).map_err(refusal)?;
        let start = RobotsStart::from(start);
        let asked = StartRequest { files: sent(&files), ..(&request).into() };
        let digest = request.full_digest.then(|| of_robots_start(&asked, &start));
        self.active = Some(Active {
            ledger: Ledger::new(setup.experiment, start.states.clone(), digest),
            pending: Vec::new(),
            last: robot_sim::StepResponse::default(),
        });
        Ok((&start).into())
    }

    fn step(&mut self, request: robot_sim::StepRequest) -> Result<robot_sim::StepResponse, Status> {
        let active = self.active.as_mut().ok_or_else(not_configured)?;
        let ledger = &mut active.ledger;
        let admission = ledger.admit(request.step, request.until_ns, &request.confirmed_digest)?;
        let n = ledger.agent_count();
        let deliveries = convert::deliveries(request.deliveries, n).map_err(malformed)?;
        let motes = convert::reported_motes(request.motes, n).map_err(malformed)?;
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
        let mut reply = RobotsStep::of_output(request.step, until_ns, request.hold, output);
        reply.applied_commands = std::mem::take(&mut active.pending);
        let digest = match ledger.start {
            Some(start) => of_robots_step(&start, &given, &RobotsReply::of_step(&reply)),
            None => {
                let used = match ledger.experiment.coupling {
                    Coupling::Sequential => &reply.states,
                    Coupling::Parallel | Coupling::Event => &std::mem::take(&mut ledger.states),
                };
                of_step(request.step, until_ns, used, deliveries.as_ref())
            }
        };
        let digest = ledger.advance(request.step, until_ns, given.parts(), until_ns, digest);
        if ledger.experiment.coupling != Coupling::Sequential && ledger.start.is_none() {
            ledger.states = reply.states.clone();
        }
        active.last = robot_sim::StepResponse { digest, ..reply.into() };
        Ok(active.last.clone())
    }

    fn command(
        &mut self,
        request: robot_sim::CommandRequest,
    ) -> Result<robot_sim::CommandResponse, Status> {
        let active = self.active()?;
        let n = active.ledger.agent_count();
        let commands = convert::agent_commands(request.commands, n).map_err(malformed)?;
        queue(&mut active.pending, commands)?;
        convert::sort_agent_commands(&mut active.pending);
        Ok(robot_sim::CommandResponse { applies_at_step: active.ledger.step + 1 })
    }
}

service!(RobotSimService for RobotHost, RobotSimulator, robot_sim {
    async fn predict(
        &self,
        request: Request<robot_sim::PredictRequest>,
    ) -> Result<Response<robot_sim::PredictResponse>, Status> {
        let request = predict::checked(request.into_inner())?;
        self.shared
            .call_blocking(move |host| predict::reply(&host.simulator, &request))
            .await
            .map(Response::new)
    }
});
