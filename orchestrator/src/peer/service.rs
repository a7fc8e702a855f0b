//! The two services behind one face.

use super::Standing;
use proto_host::MAX_MESSAGE_BYTES;
use proto_host::services::net_sim_service_client::NetSimServiceClient;
use proto_host::services::robot_sim_service_client::RobotSimServiceClient;
use proto_messages::v1;
use std::future::Future;
use tokio_stream::wrappers::ReceiverStream;
use tonic::transport::Channel;
use tonic::{Status, Streaming};

/// What a side says of itself.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Described {
    /// Its name.
    pub name: String,
    /// Its version.
    pub version: String,
    /// The contract's version.
    pub contract_version: u32,
    /// Sessions are served.
    pub session: bool,
    /// Parallel and event coupling are understood.
    pub parallel: bool,
    /// Steps can end at the first delivery. Network only.
    pub stop_at_first_delivery: bool,
    /// Orders to agents are obeyed. Robots only.
    pub commands: bool,
    /// They can stand still while time passes. Robots only.
    pub hold: bool,
    /// Kinds of order to motes that are obeyed. Network only.
    pub mote_commands: Vec<i32>,
    /// Delivery columns that can be asked for. Network only.
    pub columns: Vec<i32>,
    /// Records that can be asked for. Network only.
    pub records: Vec<i32>,
    /// The largest capacity; 0: no limit.
    pub max_agents: u32,
}

type Reply<T> = Result<T, Status>;

/// One of the two services of the contract.
pub trait Service: Send + Sync + 'static {
    /// Name of the side in messages.
    const SIDE: &'static str;
    /// Name that the simulator which comes with this program gives itself.
    const BUILT_IN: &'static str;
    /// The generated client.
    type Client: Clone + Send + Sync;
    /// Request of `Configure`.
    type ConfigureRequest: Send;
    /// Reply of `Configure`.
    type ConfigureResponse: Send;
    /// Request of `Step`.
    type StepRequest: Send;
    /// Reply of `Step`.
    type StepResponse: Send;
    /// Request within `Session`.
    type SessionRequest: Send + 'static;
    /// Reply within `Session`.
    type SessionResponse: Send + 'static;

    /// A client on a channel.
    fn client(channel: Channel) -> Self::Client;
    /// `Describe`.
    fn describe(client: Self::Client) -> impl Future<Output = Reply<Described>> + Send;
    /// `Configure`.
    fn configure(
        client: Self::Client,
        request: Self::ConfigureRequest,
    ) -> impl Future<Output = Reply<Self::ConfigureResponse>> + Send;
    /// `Step`.
    fn step(
        client: Self::Client,
        request: Self::StepRequest,
    ) -> impl Future<Output = Reply<Self::StepResponse>> + Send;
    /// `Barrier`.
    fn barrier(
        client: Self::Client,
        step: u64,
        time_ns: u64,
    ) -> impl Future<Output = Reply<Standing>> + Send;
    /// `Session`.
    fn session(
        client: Self::Client,
        calls: ReceiverStream<Self::SessionRequest>,
    ) -> impl Future<Output = Reply<Streaming<Self::SessionResponse>>> + Send;
    /// A step as a call within a session.
    fn session_step(request: Self::StepRequest) -> Self::SessionRequest;
    /// A barrier as a call within a session.
    fn session_barrier(step: u64, time_ns: u64) -> Self::SessionRequest;
    /// The step's reply within a session's.
    fn step_of(response: Self::SessionResponse) -> Option<Self::StepResponse>;
    /// The barrier's reply within a session's.
    fn barrier_of(response: Self::SessionResponse) -> Option<Standing>;
}

/// The robots' service.
pub enum Robots {}

/// The network's service.
pub enum Network {}

/// Both implementations differ in the names of the generated types alone.
macro_rules! service {
    (
        $side:ty, $name:literal, $built_in:expr, $client:ident, $call:path, $reply:path,
        $describe:ident, $configure:ident, $configured:ident, $step:ident, $stepped:ident,
        $barrier:ident, $session:ident, $sessioned:ident, |$d:ident| $described:expr
    ) => {
        impl Service for $side {
            const SIDE: &'static str = $name;
            const BUILT_IN: &'static str = $built_in;
            type Client = $client<Channel>;
            type ConfigureRequest = v1::$configure;
            type ConfigureResponse = v1::$configured;
            type StepRequest = v1::$step;
            type StepResponse = v1::$stepped;
            type SessionRequest = v1::$session;
            type SessionResponse = v1::$sessioned;

            fn client(channel: Channel) -> Self::Client {
                $client::new(channel)
                    .max_decoding_message_size(MAX_MESSAGE_BYTES)
                    .max_encoding_message_size(MAX_MESSAGE_BYTES)
            }

            async fn describe(mut client: Self::Client) -> Reply<Described> {
                let $d = client.describe(v1::$describe {}).await?.into_inner();
                Ok($described)
            }

            async fn configure(
                mut client: Self::Client,
                request: Self::ConfigureRequest,
            ) -> Reply<Self::ConfigureResponse> {
                Ok(client.configure(request).await?.into_inner())
            }

            async fn step(
                mut client: Self::Client,
                request: Self::StepRequest,
            ) -> Reply<Self::StepResponse> {
                Ok(client.step(request).await?.into_inner())
            }

            async fn barrier(mut client: Self::Client, step: u64, time_ns: u64) -> Reply<Standing> {
                let reply = client.barrier(v1::$barrier { step, time_ns }).await?.into_inner();
                Ok(Standing { step: reply.step, time_ns: reply.time_ns, digest: reply.digest })
            }

            async fn session(
                mut client: Self::Client,
                calls: ReceiverStream<Self::SessionRequest>,
            ) -> Reply<Streaming<Self::SessionResponse>> {
                Ok(client.session(calls).await?.into_inner())
            }

            fn session_step(request: Self::StepRequest) -> Self::SessionRequest {
                use $call as Call;
                v1::$session { request: Some(Call::Step(request)) }
            }

            fn session_barrier(step: u64, time_ns: u64) -> Self::SessionRequest {
                use $call as Call;
                v1::$session { request: Some(Call::Barrier(v1::$barrier { step, time_ns })) }
            }

            fn step_of(response: Self::SessionResponse) -> Option<Self::StepResponse> {
                use $reply as Reply;
                match response.response {
                    Some(Reply::Step(step)) => Some(step),
                    Some(Reply::Barrier(_)) | None => None,
                }
            }

            fn barrier_of(response: Self::SessionResponse) -> Option<Standing> {
                use $reply as Reply;
                match response.response {
                    Some(Reply::Barrier(reply)) => Some(Standing {
                        step: reply.step,
                        time_ns: reply.time_ns,
                        digest: reply.digest,
                    }),
                    Some(Reply::Step(_)) | None => None,
                }
            }
        }
    };
}

service!(
    Robots,
    "robotsim",
    <robotsim::sim::Swarm as proto::side::RobotSimulator>::NAME,
    RobotSimServiceClient,
    v1::robot_sim_service_session_request::Request,
    v1::robot_sim_service_session_response::Response,
    RobotSimServiceDescribeRequest,
    RobotSimServiceConfigureRequest,
    RobotSimServiceConfigureResponse,
    RobotSimServiceStepRequest,
    RobotSimServiceStepResponse,
    RobotSimServiceBarrierRequest,
    RobotSimServiceSessionRequest,
    RobotSimServiceSessionResponse,
    |d| Described {
        name: d.name,
        version: d.version,
        contract_version: d.contract_version,
        session: d.session,
        parallel: d.parallel,
        stop_at_first_delivery: false,
        commands: d.commands,
        hold: d.hold,
        mote_commands: Vec::new(),
        columns: Vec::new(),
        records: Vec::new(),
        max_agents: d.limits.unwrap_or_default().max_agents,
    }
);

service!(
    Network,
    "netsim",
    <netsim::sim::Network as proto::side::NetSimulator>::NAME,
    NetSimServiceClient,
    v1::net_sim_service_session_request::Request,
    v1::net_sim_service_session_response::Response,
    NetSimServiceDescribeRequest,
    NetSimServiceConfigureRequest,
    NetSimServiceConfigureResponse,
    NetSimServiceStepRequest,
    NetSimServiceStepResponse,
    NetSimServiceBarrierRequest,
    NetSimServiceSessionRequest,
    NetSimServiceSessionResponse,
    |d| Described {
        name: d.name,
        version: d.version,
        contract_version: d.contract_version,
        session: d.session,
        parallel: d.parallel,
        stop_at_first_delivery: d.stop_at_first_delivery,
        commands: false,
        hold: false,
        mote_commands: d.commands,
        columns: d.columns,
        records: d.records,
        max_agents: d.limits.unwrap_or_default().max_agents,
    }
);
