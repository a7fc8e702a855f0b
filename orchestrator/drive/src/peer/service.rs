//! The two services behind one face, and the border between their messages and values.

use super::{Described, NetworkSide, RobotSide, Side, Standing};
use bytes::Bytes;
use proto::digest::{Digest, full};
use proto::exchange::ConfigureRequest;
use proto_host::MAX_MESSAGE_BYTES;
use proto_host::services::net_sim_service_client::NetSimServiceClient;
use proto_host::services::robot_sim_service_client::RobotSimServiceClient;
use proto_messages::convert::{self, InvalidField};
use proto_messages::{net_sim, robot_sim};
use std::future::Future;
use tokio_stream::wrappers::ReceiverStream;
use tonic::transport::Channel;
use tonic::{Status, Streaming};

type Reply<T> = Result<T, Status>;

/// One of the two services of the contract.
pub trait Service: Side {
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
    /// `Snapshot`.
    fn snapshot(client: Self::Client) -> impl Future<Output = Reply<Bytes>> + Send;
    /// `Restore`, with another seed if one is given. Returns the step and the time (ns) that it says to stand at.
    fn restore(
        client: Self::Client,
        state: Bytes,
        seed: Option<u64>,
    ) -> impl Future<Output = Reply<(u64, u64)>> + Send;
    /// A step as a call within a session.
    fn session_step(request: Self::StepRequest) -> Self::SessionRequest;
    /// A barrier as a call within a session.
    fn session_barrier(step: u64, time_ns: u64) -> Self::SessionRequest;
    /// The step's reply within a session's.
    fn step_of(response: Self::SessionResponse) -> Option<Self::StepResponse>;
    /// The barrier's reply within a session's.
    fn barrier_of(response: Self::SessionResponse) -> Option<Standing>;

    /// A configuration as its message.
    fn configuration(request: &ConfigureRequest) -> Self::ConfigureRequest;
    /// The reply to a configuration from its message.
    ///
    /// # Errors
    ///
    /// The first thing that is malformed in it.
    fn start(reply: Self::ConfigureResponse, n_agents: usize) -> Result<Self::Start, InvalidField>;
    /// Digest of how an experiment begins.
    fn start_digest(request: &ConfigureRequest, start: &Self::Start) -> Digest;
    /// Number of the step that an input asks for.
    fn number(input: &Self::Input<'_>) -> u64;
    /// An input as its message, with the digest that it confirms.
    fn request(input: &Self::Input<'_>, confirmed_digest: Bytes) -> Self::StepRequest;
    /// The reply to a step from its message, and the digest that came with it.
    ///
    /// # Errors
    ///
    /// The first thing that is malformed in it.
    fn reply(
        reply: Self::StepResponse,
        n_agents: usize,
    ) -> Result<(Self::Reply, Bytes), InvalidField>;
}

/// Both implementations differ in the names of the generated types alone.
macro_rules! service {
    (
        $side:ty, $client:ident, $messages:ident, $start_of:path, $step_of:path, $digest_of:path,
        |$d:ident| $described:expr
    ) => {
        impl Service for $side {
            type Client = $client<Channel>;
            type ConfigureRequest = $messages::ConfigureRequest;
            type ConfigureResponse = $messages::ConfigureResponse;
            type StepRequest = $messages::StepRequest;
            type StepResponse = $messages::StepResponse;
            type SessionRequest = $messages::SessionRequest;
            type SessionResponse = $messages::SessionResponse;

            fn client(channel: Channel) -> Self::Client {
                $client::new(channel)
                    .max_decoding_message_size(MAX_MESSAGE_BYTES)
                    .max_encoding_message_size(MAX_MESSAGE_BYTES)
            }

            async fn describe(mut client: Self::Client) -> Reply<Described> {
                let $d = client.describe($messages::DescribeRequest {}).await?.into_inner();
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
                let reply =
                    client.barrier($messages::BarrierRequest { step, time_ns }).await?.into_inner();
                Ok(Standing { step: reply.step, time_ns: reply.time_ns, digest: reply.digest })
            }

            async fn session(
                mut client: Self::Client,
                calls: ReceiverStream<Self::SessionRequest>,
            ) -> Reply<Streaming<Self::SessionResponse>> {
                Ok(client.session(calls).await?.into_inner())
            }

            async fn snapshot(mut client: Self::Client) -> Reply<Bytes> {
                Ok(client.snapshot($messages::SnapshotRequest {}).await?.into_inner().state)
            }

            async fn restore(
                mut client: Self::Client,
                state: Bytes,
                seed: Option<u64>,
            ) -> Reply<(u64, u64)> {
                let reply =
                    client.restore($messages::RestoreRequest { state, seed }).await?.into_inner();
                Ok((reply.step, reply.time_ns))
            }

            fn session_step(request: Self::StepRequest) -> Self::SessionRequest {
                use $messages::SessionCall as Call;
                $messages::SessionRequest { request: Some(Call::Step(request)) }
            }

            fn session_barrier(step: u64, time_ns: u64) -> Self::SessionRequest {
                use $messages::SessionCall as Call;
                $messages::SessionRequest {
                    request: Some(Call::Barrier($messages::BarrierRequest { step, time_ns })),
                }
            }

            fn step_of(response: Self::SessionResponse) -> Option<Self::StepResponse> {
                use $messages::SessionReply as Reply;
                match response.response {
                    Some(Reply::Step(step)) => Some(step),
                    Some(Reply::Barrier(_)) | None => None,
                }
            }

            fn barrier_of(response: Self::SessionResponse) -> Option<Standing> {
                use $messages::SessionReply as Reply;
                match response.response {
                    Some(Reply::Barrier(reply)) => Some(Standing {
                        step: reply.step,
                        time_ns: reply.time_ns,
                        digest: reply.digest,
                    }),
                    Some(Reply::Step(_)) | None => None,
                }
            }

            fn configuration(request: &ConfigureRequest) -> Self::ConfigureRequest {
                request.into()
            }

            fn start(
                reply: Self::ConfigureResponse,
                n_agents: usize,
            ) -> Result<Self::Start, InvalidField> {
                $start_of(reply, n_agents)
            }

            fn start_digest(request: &ConfigureRequest, start: &Self::Start) -> Digest {
                $digest_of(&request.into(), start)
            }

            fn number(input: &Self::Input<'_>) -> u64 {
                input.step
            }

            fn request(input: &Self::Input<'_>, confirmed_digest: Bytes) -> Self::StepRequest {
                $messages::StepRequest { confirmed_digest, ..input.into() }
            }

            fn reply(
                reply: Self::StepResponse,
                n_agents: usize,
            ) -> Result<(Self::Reply, Bytes), InvalidField> {
                $step_of(reply, n_agents)
            }
        }
    };
}

service!(
    RobotSide,
    RobotSimServiceClient,
    robot_sim,
    convert::robots_start,
    convert::robots_step,
    full::of_robots_start,
    |d| Described {
        name: d.name,
        version: d.version,
        contract_version: d.contract_version,
        session: d.session,
        snapshots: d.snapshots,
        reseed: d.reseed,
        parallel: d.parallel,
        commands: d.commands,
        hold: d.hold,
        full_digest: d.full_digest,
        predictions: d.predictions,
        max_agents: d.limits.unwrap_or_default().max_agents,
        ..Described::default()
    }
);

service!(
    NetworkSide,
    NetSimServiceClient,
    net_sim,
    convert::network_start,
    convert::network_step,
    full::of_network_start,
    |d| Described {
        name: d.name,
        version: d.version,
        contract_version: d.contract_version,
        session: d.session,
        snapshots: d.snapshots,
        reseed: d.reseed,
        parallel: d.parallel,
        stop_at_first_delivery: d.stop_at_first_delivery,
        mote_commands: convert::known(&d.commands),
        columns: convert::known(&d.columns),
        records: convert::known(&d.records),
        full_digest: d.full_digest,
        max_agents: d.limits.unwrap_or_default().max_agents,
        ..Described::default()
    }
);
