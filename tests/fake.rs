//! A robot or network simulator that breaks the contract in one chosen way.
//!
//! It serves the real simulator behind a wrapper that spoils replies, so that everything but the fault is right.

use proto_host::services::net_sim_service_server::{NetSimService, NetSimServiceServer};
use proto_host::services::robot_sim_service_server::{RobotSimService, RobotSimServiceServer};
use proto_host::{NetHost, RobotHost};
use proto_messages::v1;
use std::net::SocketAddr;
use std::time::Duration;
use tokio::net::TcpListener;
use tonic::transport::server::TcpIncoming;
use tonic::{Request, Response, Status, Streaming};

/// What is wrong with the simulator.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fault {
    /// From step 3 on it answers for the step before.
    WrongStep,
    /// From step 3 on its digest is of something else.
    WrongDigest,
    /// In step 3 it claims to stand a nanosecond off.
    WrongTime,
    /// In step 3 a column is too short.
    ShortColumn,
    /// In step 3 a position or signal strength is not a number.
    NotANumber,
    /// In step 3 it never answers, and neither does `Describe` from then on.
    Silent,
    /// In step 3 it never answers, but it lives.
    Slow,
    /// In step 3 it never answers, and neither does `Describe`, but its health service does.
    Healthy,
    /// From step 3 on it sends another velocity or signal strength than the one it has hashed.
    OtherNumber,
    /// From step 3 on it delivers payloads that nobody sent, or robot 0 says 100 bytes more.
    OtherPayload,
    /// Its digests are of positions and deliveries alone.
    LesserDigest,
    /// It announces the full digest, but its digests are of positions and deliveries alone.
    FalseDigest,
    /// It speaks another version of the contract.
    OtherVersion,
    /// It keeps no snapshots, which is no fault.
    NoSnapshots,
    /// It announces that it can be restored with another seed, and keeps the one that it had.
    IgnoresSeed,
    /// Robots that do not announce that they can stand still.
    CannotHold,
    /// Robots that in step 3 move although they were told to stand still.
    Restless,
    /// Robots that do not announce predictions.
    CannotPredict,
    /// They predict a position that is not a number.
    PredictsNotANumber,
    /// They predict one window less than was asked for.
    PredictsTooFew,
    /// They predict another robot than was asked for.
    PredictsAnother,
    /// They predict as if nothing were configured.
    PredictsUnconfigured,
    /// They predict from where the latest prediction led.
    PredictsWithMemory,
}

/// A simulator with a fault, on a thread of its own. It ends with the test's process.
pub struct Faulty {
    /// Where it listens.
    pub url: String,
}

impl Faulty {
    /// Serves faulty robots.
    ///
    /// # Panics
    ///
    /// If no port is free.
    #[must_use]
    pub fn robots(fault: Fault) -> Self {
        let host = FaultyRobots {
            inner: RobotHost::new(robotsim::sim::Swarm::default()),
            fault,
            silent: Silence::default(),
            predicted: std::sync::atomic::AtomicU32::default(),
        };
        Self::serve(move |server| server.add_service(RobotSimServiceServer::new(host)))
    }

    /// Serves a faulty network.
    ///
    /// # Panics
    ///
    /// If no port is free.
    #[must_use]
    pub fn network(fault: Fault) -> Self {
        let host = FaultyNetwork {
            inner: NetHost::new(netsim::sim::Network::default()),
            fault,
            silent: Silence::default(),
        };
        Self::serve(move |server| {
            let router = server.add_service(NetSimServiceServer::new(host));
            if fault == Fault::Healthy {
                router.add_service(tonic_health::server::health_reporter().1)
            } else {
                router
            }
        })
    }

    pub(crate) fn serve(
        add: impl FnOnce(&mut tonic::transport::Server) -> tonic::transport::server::Router
        + Send
        + 'static,
    ) -> Self {
        let (tell, told) = std::sync::mpsc::channel::<SocketAddr>();
        std::thread::spawn(move || {
            let runtime = tokio::runtime::Builder::new_current_thread()
                .enable_all()
                .build()
                .expect("a runtime");
            runtime.block_on(async {
                let listener = TcpListener::bind("127.0.0.1:0").await.expect("a free port");
                tell.send(listener.local_addr().expect("an address")).expect("the test waits");
                add(&mut tonic::transport::Server::builder())
                    .serve_with_incoming(TcpIncoming::from(listener).with_nodelay(Some(true)))
                    .await
                    .expect("serving");
            });
        });
        let address = told.recv().expect("the server says where it listens");
        Self { url: format!("http://{address}") }
    }
}

/// Whether the simulator has fallen silent.
#[derive(Clone, Default)]
struct Silence(std::sync::Arc<std::sync::atomic::AtomicBool>);

impl Silence {
    fn fall(&self) {
        self.0.store(true, std::sync::atomic::Ordering::SeqCst);
    }

    async fn keep(&self) {
        if self.0.load(std::sync::atomic::Ordering::SeqCst) {
            tokio::time::sleep(FOREVER).await;
        }
    }
}

/// Longer than any test.
const FOREVER: Duration = Duration::from_secs(3600);

/// The step in which things go wrong.
const STEP: u64 = 3;

struct FaultyRobots {
    inner: RobotHost<robotsim::sim::Swarm>,
    fault: Fault,
    silent: Silence,
    /// How many predictions were asked for.
    predicted: std::sync::atomic::AtomicU32,
}

struct FaultyNetwork {
    inner: NetHost<netsim::sim::Network>,
    fault: Fault,
    silent: Silence,
}

/// Both wrappers differ in the generated names and in which column is spoilt.
macro_rules! faulty {
    (
        $host:ident, $service:ident, $describe:ident, $described:ident, $configure:ident, $configured:ident,
        $step:ident, $stepped:ident, $barrier:ident, $barriered:ident, $session:ident, $sessioned:ident,
        $snapshot:ident, $snapped:ident, $restore:ident, $restored:ident, $command:ident, $commanded:ident,
        short: |$short:ident| $shorten:expr, nan: |$nan:ident| $poison:expr,
        number: |$number:ident| $other_number:expr, payload: |$payload:ident| $other_payload:expr,
        hold: |$describe_hold:ident| $no_hold:expr, restless: |$restless:ident| $move:expr,
        asked: |$asked:ident| $is_held:expr,
        predictions: |$describe_predictions:ident| $no_predictions:expr,
        more: { $($more:tt)* }
    ) => {
        #[tonic::async_trait]
        impl $service for $host {
            async fn describe(
                &self,
                request: Request<v1::$describe>,
            ) -> Result<Response<v1::$described>, Status> {
                self.silent.keep().await;
                let mut reply = self.inner.describe(request).await?;
                // Single calls only: the barrier is then a call of its own.
                reply.get_mut().session = false;
                if self.fault == Fault::LesserDigest {
                    reply.get_mut().full_digest = false;
                }
                if self.fault == Fault::OtherVersion {
                    reply.get_mut().contract_version = 7;
                }
                if self.fault == Fault::NoSnapshots {
                    reply.get_mut().snapshots = false;
                    reply.get_mut().reseed = false;
                }
                if self.fault == Fault::CannotHold {
                    let $describe_hold = reply.get_mut();
                    $no_hold;
                }
                if self.fault == Fault::CannotPredict {
                    let $describe_predictions = reply.get_mut();
                    $no_predictions;
                }
                Ok(reply)
            }

            async fn configure(
                &self,
                request: Request<v1::$configure>,
            ) -> Result<Response<v1::$configured>, Status> {
                let mut request = request;
                if self.fault == Fault::FalseDigest {
                    request.get_mut().full_digest = false;
                }
                self.inner.configure(request).await
            }

            async fn step(
                &self,
                request: Request<v1::$step>,
            ) -> Result<Response<v1::$stepped>, Status> {
                let step = request.get_ref().step;
                let $asked = request.get_ref();
                let is_held: bool = $is_held;
                let mut response = self.inner.step(request).await?;
                if step < STEP {
                    return Ok(response);
                }
                let reply = response.get_mut();
                match self.fault {
                    Fault::WrongStep => reply.step -= 1,
                    Fault::WrongTime => reply.time_ns += 1,
                    Fault::ShortColumn => {
                        let $short = reply;
                        $shorten;
                    }
                    Fault::NotANumber => {
                        let $nan = reply;
                        $poison;
                    }
                    Fault::OtherNumber => {
                        let $number = reply;
                        $other_number;
                    }
                    Fault::OtherPayload => {
                        let $payload = reply;
                        $other_payload;
                    }
                    Fault::Silent | Fault::Healthy => {
                        self.silent.fall();
                        self.silent.keep().await;
                    }
                    Fault::Slow => tokio::time::sleep(FOREVER).await,
                    Fault::Restless if is_held => {
                        let $restless = reply;
                        $move;
                    }
                    Fault::WrongDigest
                    | Fault::OtherVersion
                    | Fault::NoSnapshots
                    | Fault::IgnoresSeed
                    | Fault::LesserDigest
                    | Fault::FalseDigest
                    | Fault::CannotHold
                    | Fault::Restless
                    | Fault::CannotPredict
                    | Fault::PredictsNotANumber
                    | Fault::PredictsTooFew
                    | Fault::PredictsAnother
                    | Fault::PredictsUnconfigured
                    | Fault::PredictsWithMemory => {}
                }
                Ok(response)
            }

            async fn barrier(
                &self,
                request: Request<v1::$barrier>,
            ) -> Result<Response<v1::$barriered>, Status> {
                let mut reply = self.inner.barrier(request).await?;
                if self.fault == Fault::WrongDigest && STEP <= reply.get_ref().step {
                    reply.get_mut().digest = vec![0xab; 32].into();
                }
                Ok(reply)
            }

            type SessionStream =
                futures::stream::BoxStream<'static, Result<v1::$sessioned, Status>>;

            async fn session(
                &self,
                _: Request<Streaming<v1::$session>>,
            ) -> Result<Response<Self::SessionStream>, Status> {
                Err(Status::unimplemented("not announced"))
            }

            async fn snapshot(
                &self,
                request: Request<v1::$snapshot>,
            ) -> Result<Response<v1::$snapped>, Status> {
                self.inner.snapshot(request).await
            }

            async fn restore(
                &self,
                mut request: Request<v1::$restore>,
            ) -> Result<Response<v1::$restored>, Status> {
                if self.fault == Fault::IgnoresSeed {
                    request.get_mut().seed = None;
                }
                self.inner.restore(request).await
            }

            async fn command(
                &self,
                request: Request<v1::$command>,
            ) -> Result<Response<v1::$commanded>, Status> {
                self.inner.command(request).await
            }

            $($more)*
        }
    };
}

faulty!(
    FaultyRobots, RobotSimService, RobotSimServiceDescribeRequest, RobotSimServiceDescribeResponse,
    RobotSimServiceConfigureRequest, RobotSimServiceConfigureResponse, RobotSimServiceStepRequest,
    RobotSimServiceStepResponse, RobotSimServiceBarrierRequest, RobotSimServiceBarrierResponse,
    RobotSimServiceSessionRequest, RobotSimServiceSessionResponse, RobotSimServiceSnapshotRequest,
    RobotSimServiceSnapshotResponse, RobotSimServiceRestoreRequest, RobotSimServiceRestoreResponse,
    RobotSimServiceCommandRequest, RobotSimServiceCommandResponse,
    short: |reply| reply.states.as_mut().expect("states").x_m.truncate(1),
    nan: |reply| reply.states.as_mut().expect("states").y_m[0] = f64::NAN,
    number: |reply| reply.states.as_mut().expect("states").vx_mps[0] += 1.0,
    // Whatever robots say is theirs.
    payload: |reply| {
        let payloads = reply.payloads.as_mut().expect("payloads");
        payloads.length_bytes[0] += 100;
        payloads.data = [&[7; 100], &payloads.data[..]].concat().into();
    },
    hold: |reply| reply.hold = false,
    restless: |reply| reply.states.as_mut().expect("states").x_m[0] += 1.0,
    asked: |request| request.hold,
    predictions: |reply| reply.predictions = false,
    more: {
        async fn predict(
            &self,
            request: Request<v1::RobotSimServicePredictRequest>,
        ) -> Result<Response<v1::RobotSimServicePredictResponse>, Status> {
            let mut request = request;
            if self.fault == Fault::PredictsUnconfigured {
                request.get_mut().config_toml.clear();
            }
            let mut response = self.inner.predict(request).await?;
            let reply = response.get_mut();
            match self.fault {
                Fault::PredictsNotANumber => reply.windows[0].y_m[0] = f64::NAN,
                Fault::PredictsTooFew => reply.windows.truncate(reply.windows.len() - 1),
                Fault::PredictsAnother => reply.windows[0].agent += 1,
                Fault::PredictsWithMemory => {
                    let n = self.predicted.fetch_add(1, std::sync::atomic::Ordering::SeqCst);
                    reply.windows[0].x_m[0] += f64::from(n);
                }
                Fault::Silent => {
                    self.silent.fall();
                    self.silent.keep().await;
                }
                _ => {}
            }
            Ok(response)
        }
    }
);

faulty!(
    FaultyNetwork, NetSimService, NetSimServiceDescribeRequest, NetSimServiceDescribeResponse,
    NetSimServiceConfigureRequest, NetSimServiceConfigureResponse, NetSimServiceStepRequest,
    NetSimServiceStepResponse, NetSimServiceBarrierRequest, NetSimServiceBarrierResponse,
    NetSimServiceSessionRequest, NetSimServiceSessionResponse, NetSimServiceSnapshotRequest,
    NetSimServiceSnapshotResponse, NetSimServiceRestoreRequest, NetSimServiceRestoreResponse,
    NetSimServiceCommandRequest, NetSimServiceCommandResponse,
    short: |reply| reply
        .deliveries.as_mut().expect("deliveries")
        .transmissions.as_mut().expect("transmissions")
        .sent_ns.truncate(1),
    // In a step without deliveries there is nothing to spoil.
    nan: |reply| {
        let rssi_dbm = &mut reply.deliveries.as_mut().expect("deliveries").rssi_dbm;
        rssi_dbm.iter_mut().take(1).for_each(|value| *value = f32::NAN);
    },
    number: |reply| {
        let rssi_dbm = &mut reply.deliveries.as_mut().expect("deliveries").rssi_dbm;
        rssi_dbm.iter_mut().take(1).for_each(|value| *value += 1.0);
    },
    payload: |reply| {
        let sent = reply.deliveries.as_mut().expect("deliveries").transmissions.as_mut();
        let payloads = sent.expect("transmissions").payloads.as_mut().expect("payloads");
        let mut data = payloads.data.to_vec();
        data.iter_mut().take(1).for_each(|byte| *byte ^= 1);
        payloads.data = data.into();
    },
    // Networks have nothing of the kind.
    hold: |_reply| {},
    restless: |_reply| {},
    asked: |_request| false,
    predictions: |_reply| {},
    more: {}
);
