//! Both services, called as gRPC calls them, by a sequence of frames: a byte for the call, four for the length of its message
//! (little endian), the message in protobuf.

use prost::Message;
use proto_host::services::net_sim_service_server::NetSimService;
use proto_host::services::robot_sim_service_server::RobotSimService;
use proto_host::{NetHost, RobotHost};
use proto_messages::v1;
use std::future::Future;
use tonic::{Code, Request, Response, Status};

/// A call of a service.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Call {
    /// `Configure`.
    Configure = 0,
    /// `Step`.
    Step = 1,
    /// `Barrier`.
    Barrier = 2,
    /// `Command`.
    Command = 3,
    /// `Restore`.
    Restore = 4,
    /// `Predict`, of robots.
    Predict = 5,
}

/// All calls.
const CALLS: [Call; 6] =
    [Call::Configure, Call::Step, Call::Barrier, Call::Command, Call::Restore, Call::Predict];

/// Most calls of one input.
const MOST_CALLS: usize = 32;
/// An experiment with more agents is a long computation that was asked for, and no finding.
const MOST_AGENTS: u32 = 64;
/// So is more simulated time (ns).
const MOST_NS: u64 = 2_000_000_000;

/// A frame of an input.
#[must_use]
pub fn frame(call: Call, message: &impl Message) -> Vec<u8> {
    let message = message.encode_to_vec();
    let length = u32::try_from(message.len()).expect("messages of a corpus are small");
    [&[call as u8][..], &length.to_le_bytes(), &message].concat()
}

fn frames(mut bytes: &[u8]) -> impl Iterator<Item = (Call, &[u8])> {
    std::iter::from_fn(move || {
        let (&[call, a, b, c, d], rest) = bytes.split_first_chunk::<5>()?;
        let length = (u32::from_le_bytes([a, b, c, d]) as usize).min(rest.len());
        let (message, rest) = rest.split_at(length);
        bytes = rest;
        Some((CALLS[usize::from(call) % CALLS.len()], message))
    })
    .take(MOST_CALLS)
}

fn runtime() -> tokio::runtime::Runtime {
    tokio::runtime::Builder::new_current_thread().build().expect("a runtime without sockets")
}

/// A refusal is an answer; an internal error is a panic that the shell caught.
async fn judged<M: Message + Default, R>(
    message: &[u8],
    call: impl AsyncFnOnce(Request<M>) -> Result<Response<R>, Status>,
) {
    if let Ok(message) = M::decode(message) {
        judge(call(Request::new(message)).await);
    }
}

fn judge<R>(answer: Result<Response<R>, Status>) {
    if let Err(status) = answer {
        assert_ne!(status.code(), Code::Internal, "{}", status.message());
    }
}

fn is_short(agents: u32, step_ns: u64) -> bool {
    agents <= MOST_AGENTS && step_ns <= MOST_NS
}

/// Runs a future of a service that never waits for anything else.
fn done<F: Future<Output = ()>>(calls: F) {
    runtime().block_on(calls);
}

/// The network simulator's service.
pub(super) fn network(bytes: &[u8]) {
    let host = NetHost::new(netsim::sim::Network::default());
    done(async {
        for (call, message) in frames(bytes) {
            match call {
                Call::Configure => {
                    judged(message, async |request: Request<v1::NetSimServiceConfigureRequest>| {
                        let asked = request.get_ref();
                        if !is_short(asked.agent_count, asked.step_ns) {
                            return Err(Status::cancelled("long"));
                        }
                        host.configure(request).await
                    })
                    .await;
                }
                Call::Step => {
                    judged(message, async |request: Request<v1::NetSimServiceStepRequest>| {
                        if MOST_NS < request.get_ref().until_ns {
                            return Err(Status::cancelled("long"));
                        }
                        host.step(request).await
                    })
                    .await;
                }
                Call::Barrier => judged(message, async |request| host.barrier(request).await).await,
                Call::Command => judged(message, async |request| host.command(request).await).await,
                Call::Restore => judged(message, async |request| host.restore(request).await).await,
                Call::Predict => {}
            }
        }
    });
}

/// The robot simulator's service.
pub(super) fn robots(bytes: &[u8]) {
    let host = RobotHost::new(robotsim::sim::Swarm::default());
    done(async {
        for (call, message) in frames(bytes) {
            match call {
                Call::Configure => {
                    judged(
                        message,
                        async |request: Request<v1::RobotSimServiceConfigureRequest>| {
                            let asked = request.get_ref();
                            if !is_short(asked.agent_count, asked.step_ns) {
                                return Err(Status::cancelled("long"));
                            }
                            host.configure(request).await
                        },
                    )
                    .await;
                }
                Call::Step => {
                    judged(message, async |request: Request<v1::RobotSimServiceStepRequest>| {
                        if MOST_NS < request.get_ref().until_ns {
                            return Err(Status::cancelled("long"));
                        }
                        host.step(request).await
                    })
                    .await;
                }
                Call::Barrier => judged(message, async |request| host.barrier(request).await).await,
                Call::Command => judged(message, async |request| host.command(request).await).await,
                Call::Restore => judged(message, async |request| host.restore(request).await).await,
                Call::Predict => {
                    judged(message, async |request: Request<v1::RobotSimServicePredictRequest>| {
                        let windows = request.get_ref().windows.iter();
                        let mut durations = windows.flat_map(|window| &window.duration_ns);
                        if durations.any(|&duration_ns| MOST_NS < duration_ns) {
                            return Err(Status::cancelled("long"));
                        }
                        host.predict(request).await
                    })
                    .await;
                }
            }
        }
    });
}
