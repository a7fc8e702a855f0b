//! One simulator as the orchestrator sees it, in values: [`Peer`].
//!
//! | module | what |
//! |---|---|
//! | here | [`Remote`]: a connection with deadlines, whose every failure names the side; its messages become values here, and nowhere else |
//! | `in_process` | [`InProcess`]: a simulator of this process, called directly |
//! | `predict` | recorded motion, predicted by a robot simulator |
//! | `side` | what both are to whoever drives them |
//! | `process` | a simulator that runs as a child process of this one |
//! | `command` | a simulator that a command of the experiment file starts |
//! | `channel` | how a connection is opened, and with which certificates |
//! | `service` | the generated clients behind one face, and the border between their messages and values |

mod busy_wait;
mod channel;
mod command;
mod error;
mod in_process;
mod predict;
mod process;
mod service;
mod side;

pub use command::become_command;
pub use error::SideError;
pub use in_process::{InProcess, ready};
pub use predict::PredictionConfig;
pub use process::{Launch, LineSink, Orders};
pub use service::Service;
pub use side::{Described, NetworkSide, Peer, RobotSide, Side, Standing};

use busy_wait::BusyWait;
use bytes::Bytes;
use channel::channel;
use experiment::{Tls, Transport};
use process::ChildProcess;
use proto::config::Problem;
use proto::digest::Digest;
use proto::exchange::ConfigureRequest;
use proto_messages::convert::InvalidField;
use std::future::Future;
use std::time::{Duration, Instant};
use tokio::sync::mpsc;
use tokio_stream::wrappers::ReceiverStream;
use tonic::transport::Channel;
use tonic::{Code, Status, Streaming};
use tonic_health::pb::HealthCheckRequest;
use tonic_health::pb::health_client::HealthClient;
use tonic_types::StatusExt as _;

/// After how long without an answer a side is asked for a sign of life.
const PATIENCE: Duration = Duration::from_secs(2);
/// How long it may take to give one.
const SIGN_OF_LIFE: Duration = Duration::from_secs(3);
/// How long connecting, describing and configuring may take.
const SETUP: Duration = Duration::from_secs(10);

/// A simulator in another process, connected and described.
pub struct Remote<S: Service> {
    url: String,
    client: S::Client,
    /// Serves signs of life, until a side turns out to serve none.
    health: Option<HealthClient<Channel>>,
    child: Option<ChildProcess>,
    described: Described,
    session: Option<Session<S>>,
    streams: bool,
    step_deadline: Duration,
    busy_wait: BusyWait,
    n_agents: usize,
    /// See [`Peer::start_digest`].
    start: Option<Digest>,
    /// In a session: the digest that rode on the latest reply, which the next step confirms.
    digest: Bytes,
    /// The same until the barrier has asked for it.
    riding: Option<Bytes>,
}

struct Session<S: Service> {
    calls: mpsc::Sender<S::SessionRequest>,
    replies: Streaming<S::SessionResponse>,
}

/// How to reach a side and how long to wait for it.
#[derive(Clone, Debug)]
pub struct Reach {
    /// Where it runs already; `None`: it is started here.
    pub url: Option<String>,
    /// Certificates for `https`.
    pub tls: Option<Tls>,
    /// How steps cross.
    pub transport: Transport,
    /// Longest wait for a step that shows signs of life.
    pub step_deadline: Duration,
    /// Other work waits for the processor: an answer is waited for asleep.
    pub is_busy: bool,
    /// How to start it.
    pub launch: Launch,
}

/// Connects to a side and asks what it is.
///
/// # Errors
///
/// It cannot be reached, or is no simulator of this kind.
pub async fn connect<S: Service>(
    url: &str,
    tls: Option<&Tls>,
) -> Result<(S::Client, Described), SideError> {
    let (_, client, described) = open::<S>(url, tls).await?;
    Ok((client, described))
}

/// A connection, a client over it, and what the side says of itself.
type Connected<S> = (Channel, <S as Service>::Client, Described);

/// As [`connect`], with the channel.
async fn open<S: Service>(url: &str, tls: Option<&Tls>) -> Result<Connected<S>, SideError> {
    let channel = channel(S::SIDE, url, tls).await?;
    let client = S::client(channel.clone());
    let described = tokio::time::timeout(SETUP, S::describe(client.clone()))
        .await
        .map_err(|_| SideError::Unreachable {
            side: S::SIDE,
            url: url.to_owned(),
            reason: format!(
                "a server listens there, but does not reply within {} s",
                SETUP.as_secs()
            ),
        })?
        .map_err(|status| not_a_simulator(S::SIDE, url, tls, &status))?;
    Ok((channel, client, described))
}

impl<S: Service> Remote<S> {
    /// Starts the side if need be, connects, and asks what it is.
    ///
    /// # Errors
    ///
    /// It cannot be started or reached, is no simulator of this kind, speaks another version, or cannot do what is asked.
    pub async fn connect(reach: &Reach) -> Result<Self, SideError> {
        let (url, child, (channel, client, described)) = match (&reach.url, &reach.launch.command) {
            (Some(url), _) => (url.clone(), None, open::<S>(url, reach.tls.as_ref()).await?),
            (None, Some(command)) => {
                let (url, child, connected) = command::start::<S>(command, &reach.launch).await?;
                (url, Some(child), connected)
            }
            (None, None) => {
                let (url, mut child) = ChildProcess::start(S::SIDE, &reach.launch).await?;
                match open::<S>(&url, reach.tls.as_ref()).await {
                    Ok(connected) => (url, Some(child), connected),
                    Err(error) => return Err(child.explain(S::SIDE, "starting", error).await),
                }
            }
        };
        if described.contract_version != proto_messages::CONTRACT_VERSION {
            return Err(SideError::Cannot {
                side: S::SIDE,
                what: format!(
                    "{} implements version {} of the contract; this program requires version {}",
                    described.name,
                    described.contract_version,
                    proto_messages::CONTRACT_VERSION
                ),
            });
        }
        if reach.transport == Transport::Stream && !described.session {
            return Err(SideError::Cannot {
                side: S::SIDE,
                what: format!(
                    "{} does not support sessions, which experiment.transport = \"stream\" requires; use \"auto\"",
                    described.name
                ),
            });
        }
        let streams = described.session && reach.transport != Transport::Unary;
        let step_deadline = reach.step_deadline;
        let busy_wait = BusyWait::new(reach.is_busy);
        Ok(Self {
            url,
            client,
            health: Some(HealthClient::new(channel)),
            child,
            described,
            session: None,
            streams,
            step_deadline,
            busy_wait,
            n_agents: 0,
            start: None,
            digest: Bytes::new(),
            riding: None,
        })
    }

    /// Where it runs.
    #[must_use]
    pub fn url(&self) -> &str {
        &self.url
    }

    /// Whether it was started here.
    #[must_use]
    pub fn is_child(&self) -> bool {
        self.child.is_some()
    }

    /// Whether steps cross in one stream.
    #[must_use]
    pub fn streams(&self) -> bool {
        self.streams
    }

    /// Where and how other programs may give orders to it; `None`: it was not started here, or takes none.
    #[must_use]
    pub fn orders(&self) -> Option<&Orders> {
        self.child.as_ref().and_then(ChildProcess::orders)
    }

    /// Process number of the child.
    #[must_use]
    pub fn process_id(&self) -> Option<u32> {
        self.child.as_ref().and_then(ChildProcess::id)
    }

    /// Puts back a state that it gave as a snapshot after step `after`, which ended at `time_ns`, in place of configuring it.
    /// `request` and `start` are what configured the experiment. With a `seed`, later draws come from it.
    ///
    /// # Errors
    ///
    /// It fails, hangs or refuses, or then stands elsewhere than after that step.
    pub async fn restore(
        &mut self,
        state: Bytes,
        seed: Option<u64>,
        request: &ConfigureRequest,
        start: &S::Start,
        (after, time_ns): (u64, u64),
    ) -> Result<(), SideError> {
        const DOING: &str = "Restore";
        self.session = None;
        self.riding = None;
        // The first step confirms none: the record does not hold each side's own.
        self.digest = Bytes::new();
        self.n_agents = request.experiment.agent_count;
        self.start = request.full_digest.then(|| S::start_digest(request, start));
        let call = S::restore(self.client.clone(), state, seed);
        let (step, got_ns) = self.wait(DOING.to_owned(), call).await?;
        if step != after {
            return Err(SideError::WrongStep { side: S::SIDE, expected: after, got: step });
        }
        if got_ns != time_ns {
            let expected = time_ns;
            return Err(SideError::WrongTime { side: S::SIDE, step, expected, got: got_ns });
        }
        Ok(())
    }

    async fn exchange(
        &mut self,
        doing: String,
        call: S::SessionRequest,
    ) -> Result<S::SessionResponse, SideError> {
        let mut session = self.session.take();
        let client = self.client.clone();
        let exchange = async {
            let closed = || Status::unavailable("the stream is closed");
            if let Some(session) = &mut session {
                session.calls.send(call).await.map_err(|_| closed())?;
            } else {
                // The first call goes along, since a server may answer headers only with its first reply.
                let (calls, queued) = mpsc::channel(1);
                calls.send(call).await.map_err(|_| closed())?;
                let replies = S::session(client, ReceiverStream::new(queued)).await?;
                session = Some(Session { calls, replies });
            }
            let session = session.as_mut().ok_or_else(closed)?;
            session
                .replies
                .message()
                .await?
                .ok_or_else(|| Status::unavailable("it closed the stream"))
        };
        let reply = self.wait(doing, exchange).await?;
        self.session = session;
        Ok(reply)
    }

    /// Waits for a call. A side that gives no sign of life is given up within seconds, however long a step may take.
    async fn wait<T>(
        &mut self,
        doing: String,
        call: impl Future<Output = Result<T, Status>>,
    ) -> Result<T, SideError> {
        tokio::pin!(call);
        let asked = Instant::now();
        let early = tokio::select! {
            biased;
            result = &mut call => Some(result),
            () = self.busy_wait.stay() => None,
        };
        let soon = match early {
            Some(result) => Ok(result),
            None => tokio::time::timeout(PATIENCE, &mut call).await,
        };
        self.busy_wait.saw(asked.elapsed());
        if let Ok(result) = soon {
            return self.explain(doing, result).await;
        }
        let begun = Instant::now();
        loop {
            let alive = tokio::time::timeout(SIGN_OF_LIFE, self.sign_of_life());
            tokio::select! {
                biased;
                result = &mut call => return self.explain(doing, result).await,
                answer = alive => match answer {
                    Ok(Ok(())) => {}
                    Ok(Err(status)) => return self.explain(doing, Err(status)).await,
                    Err(_) => {
                        let waited = PATIENCE + begun.elapsed();
                        let hangs = SideError::Hangs { side: S::SIDE, doing: doing.clone(), waited };
                        return Err(match &mut self.child {
                            Some(child) => child.explain(S::SIDE, &doing, hangs).await,
                            None => hangs,
                        });
                    }
                },
            }
            let waited = PATIENCE + begun.elapsed();
            if self.step_deadline < waited {
                return Err(SideError::TooSlow { side: S::SIDE, doing, waited });
            }
            if let Ok(result) = tokio::time::timeout(PATIENCE, &mut call).await {
                return self.explain(doing, result).await;
            }
        }
    }

    /// Asks whether the side lives: its health service, or where it has none, what it is.
    async fn sign_of_life(&mut self) -> Result<(), Status> {
        if let Some(health) = &mut self.health {
            match health.check(HealthCheckRequest::default()).await {
                Err(status) if matches!(status.code(), Code::Unimplemented | Code::NotFound) => {
                    self.health = None;
                }
                answer => return answer.map(|_| ()),
            }
        }
        S::describe(self.client.clone()).await.map(|_| ())
    }

    async fn explain<T>(
        &mut self,
        doing: String,
        result: Result<T, Status>,
    ) -> Result<T, SideError> {
        let status = match result {
            Ok(value) => return Ok(value),
            Err(status) => status,
        };
        let error = match status.code() {
            // Transport failures, which tonic reports under these codes.
            Code::Unavailable | Code::Unknown | Code::Cancelled | Code::Internal
                if std::error::Error::source(&status).is_some()
                    || status.code() == Code::Unavailable =>
            {
                SideError::Lost {
                    side: S::SIDE,
                    url: self.url.clone(),
                    doing: doing.clone(),
                    reason: cause(&status),
                }
            }
            Code::Internal
                if status.message().contains("protobuf") || status.message().contains("decode") =>
            {
                SideError::Garbage {
                    side: S::SIDE,
                    doing: doing.clone(),
                    reason: status.message().to_owned(),
                }
            }
            _ => {
                SideError::Refused { side: S::SIDE, doing: doing.clone(), status: Box::new(status) }
            }
        };
        Err(match &mut self.child {
            Some(child) => child.explain(S::SIDE, &doing, error).await,
            None => error,
        })
    }
}

impl<S: Service> Peer<S> for Remote<S> {
    const SHARES_VALUES: bool = false;

    fn described(&self) -> &Described {
        &self.described
    }

    async fn configure(&mut self, request: &ConfigureRequest) -> Result<S::Start, SideError> {
        const DOING: &str = "Configure";
        self.session = None;
        self.digest = Bytes::new();
        self.riding = None;
        self.n_agents = request.experiment.agent_count;
        self.start = None;
        let call = S::configure(self.client.clone(), S::configuration(request));
        let reply = self.wait(DOING.to_owned(), call).await.map_err(unacceptable::<S>)?;
        let start = S::start(reply, self.n_agents)
            .map_err(|invalid| garbage::<S>(DOING.to_owned(), &invalid))?;
        self.start = request.full_digest.then(|| S::start_digest(request, &start));
        Ok(start)
    }

    fn start_digest(&self) -> Option<Digest> {
        self.start
    }

    async fn step(&mut self, input: &S::Input<'_>) -> Result<S::Reply, SideError> {
        let doing = format!("step {}", S::number(input));
        let reply = if self.streams {
            let request = S::request(input, self.digest.clone());
            let reply = self.exchange(doing.clone(), S::session_step(request)).await?;
            S::step_of(reply).ok_or_else(|| SideError::Garbage {
                side: S::SIDE,
                doing: doing.clone(),
                reason: "its reply to a step is of another kind".to_owned(),
            })?
        } else {
            let call = S::step(self.client.clone(), S::request(input, Bytes::new()));
            self.wait(doing.clone(), call).await?
        };
        let (reply, digest) =
            S::reply(reply, self.n_agents).map_err(|invalid| garbage::<S>(doing, &invalid))?;
        if self.streams {
            self.digest = digest.clone();
            self.riding = Some(digest);
        }
        Ok(reply)
    }

    /// In a session the digest has come with the step's reply: it is not asked for again, unless the barrier is.
    async fn barrier(&mut self, step: u64, time_ns: u64) -> Result<Standing, SideError> {
        if let Some(digest) = self.riding.take() {
            return Ok(Standing { step, time_ns, digest });
        }
        let doing = format!("the barrier of step {step}");
        if !self.streams {
            let call = S::barrier(self.client.clone(), step, time_ns);
            return self.wait(doing, call).await;
        }
        let reply = self.exchange(doing.clone(), S::session_barrier(step, time_ns)).await?;
        S::barrier_of(reply).ok_or_else(|| SideError::Garbage {
            side: S::SIDE,
            doing,
            reason: "its reply to a barrier is of another kind".to_owned(),
        })
    }

    async fn snapshot(&mut self) -> Result<Option<Bytes>, SideError> {
        if !self.described.snapshots {
            return Ok(None);
        }
        let call = S::snapshot(self.client.clone());
        self.wait("Snapshot".to_owned(), call).await.map(Some)
    }

    /// Ends the side if it was started here: what does not end is killed.
    async fn stop(mut self) {
        self.session = None;
        if let Some(child) = self.child.take() {
            child.stop().await;
        }
    }
}

fn garbage<S: Service>(doing: String, invalid: &InvalidField) -> SideError {
    SideError::Garbage { side: S::SIDE, doing, reason: invalid.to_string() }
}

/// A configuration that is refused for what is in it, problem by problem.
fn unacceptable<S: Service>(error: SideError) -> SideError {
    let SideError::Refused { status, .. } = &error else { return error };
    if status.code() != Code::InvalidArgument {
        return error;
    }
    let violations = status.get_details_bad_request().map(|bad| bad.field_violations);
    let problems: Vec<Problem> = match violations {
        Some(violations) if !violations.is_empty() => violations
            .into_iter()
            .map(|violation| Problem::new(violation.field, violation.description))
            .collect(),
        _ => vec![Problem::new(
            "",
            format!("the simulator refused its configuration: {}", status.message()),
        )],
    };
    SideError::Unacceptable { side: S::SIDE, problems }
}

fn not_a_simulator(side: &'static str, url: &str, tls: Option<&Tls>, status: &Status) -> SideError {
    if url.starts_with("https://") && status.code() != Code::Unimplemented {
        // A server that wants a certificate of ours says so after its own part of the handshake, or not at all.
        let hint = match tls.and_then(|tls| tls.identity.as_ref()) {
            Some(_) => "it may not accept the client certificate",
            None => {
                "it may require a client certificate; give --tls-cert and --tls-key, or [experiment.tls] cert and key"
            }
        };
        return SideError::Unreachable {
            side,
            url: url.to_owned(),
            reason: format!("{}; {hint}", cause(status)),
        };
    }
    let found = match status.code() {
        Code::Unimplemented => "it speaks gRPC, but does not have this service".to_owned(),
        Code::Unavailable => {
            return SideError::Unreachable { side, url: url.to_owned(), reason: cause(status) };
        }
        _ => {
            tracing::debug!(%status, "what it said");
            let hint = if url.starts_with("http://") {
                "; if it uses TLS, write https instead of http"
            } else {
                ""
            };
            format!("it does not speak gRPC{hint}")
        }
    };
    SideError::NotASimulator { side, url: url.to_owned(), found }
}

/// The innermost cause of a status: what the system said.
fn cause(status: &Status) -> String {
    let mut error: &dyn std::error::Error = status;
    while let Some(source) = error.source() {
        error = source;
    }
    match error.to_string() {
        text if std::ptr::addr_eq(error, status) => {
            let _ = text;
            status.message().to_owned()
        }
        text => text,
    }
}
