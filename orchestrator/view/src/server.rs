//! The server of the page: on the loopback address, for those who know its token.
//!
//! Another page in the same browser can send requests here, too. It cannot read or drive a run: it does not know the token, which
//! travels in a header that browsers do not add; and requests with another host or origin are refused.
//!
//! Another user of this machine can connect, too. Connections are limited in number, and in time until the token comes over them.

mod access;
mod connections;

use crate::live::{LiveRun, Viewer};
use crate::page::{INDEX, SCRIPT, STYLE};
use crate::recorded::{MOST_FRAMES, RecordedRun};
use crate::view;
use access::Access;
use axum::Router;
use axum::body::{Body, Bytes};
use axum::extract::{DefaultBodyLimit, Path, Query, Request, State};
use axum::http::{StatusCode, header};
use axum::middleware::{self, Next};
use axum::response::{IntoResponse, Response};
use axum::routing::{get, post};
use connections::{BODY, Connection, Connections, HEADERS};
use futures::StreamExt as _;
use hyper::server::conn::http1;
use hyper_util::rt::{TokioIo, TokioTimer};
use hyper_util::service::TowerToHyperService;
use prost::Message as _;
use std::collections::BTreeMap;
use std::net::{Ipv4Addr, SocketAddr};
use std::sync::{Arc, PoisonError, RwLock};
use std::time::Duration;
use tokio::net::{TcpListener, TcpStream};
use tokio::task::JoinSet;

/// A request may have so many bytes.
const MOST_REQUEST_BYTES: usize = 1024;

/// Where the frames of a run come from.
#[derive(Clone)]
pub enum RunSource {
    /// A recording.
    Recorded(Arc<RecordedRun>),
    /// A run that lasts.
    Live(Arc<LiveRun>),
}

/// The runs that a server shows, one or two to compare, and measurements that the model was compared with.
#[derive(Clone)]
pub struct Shown {
    runs: Arc<RwLock<Vec<RunSource>>>,
    measurements: Option<Arc<view::Measurements>>,
}

impl Shown {
    /// Shows these runs.
    #[must_use]
    pub fn new(runs: Vec<RunSource>) -> Self {
        Self { runs: Arc::new(RwLock::new(runs)), measurements: None }
    }

    /// Shows measurements beside the runs.
    #[must_use]
    pub fn with_measurements(mut self, measurements: Option<view::Measurements>) -> Self {
        self.measurements = measurements.map(Arc::new);
        self
    }

    /// Shows another run in place of the first.
    pub fn replace(&self, run: RunSource) {
        let mut runs = self.runs.write().unwrap_or_else(PoisonError::into_inner);
        runs.truncate(0);
        runs.push(run);
    }

    fn all(&self) -> Vec<RunSource> {
        self.runs.read().unwrap_or_else(PoisonError::into_inner).clone()
    }

    fn run(&self, number: usize) -> Result<RunSource, Refused> {
        let runs = self.all();
        let n_runs = runs.len();
        runs.into_iter().nth(number).ok_or_else(|| {
            let last = n_runs.saturating_sub(1);
            Refused(StatusCode::NOT_FOUND, format!("no run {number}: there are runs 0 to {last}"))
        })
    }
}

/// A server that listens.
pub struct Server {
    listener: TcpListener,
    router: Router,
    url: String,
}

impl Server {
    /// Listens on a port of the loopback address; 0: any that is free.
    ///
    /// # Errors
    ///
    /// The port is in use, or the system has no random numbers for the token.
    pub async fn bind(port: u16, shown: Shown) -> std::io::Result<Self> {
        let listener = TcpListener::bind(SocketAddr::from((Ipv4Addr::LOCALHOST, port))).await?;
        let port = listener.local_addr()?.port();
        let access = Access::new(port)?;
        let url = format!("http://127.0.0.1:{port}/?token={}", access.token());
        let api = Router::new()
            .route("/runs", get(runs))
            .route("/runs/{run}/overview", get(overview))
            .route("/runs/{run}/frames", get(frames))
            .route("/live", get(live))
            .route("/control", post(control).layer(middleware::from_fn(in_time)))
            .fallback(async || Refused(StatusCode::NOT_FOUND, "no such call".to_owned()))
            .layer(middleware::from_fn_with_state(access.clone(), access::with_token));
        let router = Router::new()
            .nest("/api", api)
            .route("/", get(|| async { file("text/html; charset=utf-8", INDEX) }))
            .route("/page.js", get(|| async { file("text/javascript; charset=utf-8", SCRIPT) }))
            .route("/page.css", get(|| async { file("text/css; charset=utf-8", STYLE) }))
            .layer(DefaultBodyLimit::max(MOST_REQUEST_BYTES))
            .layer(middleware::from_fn_with_state(access, access::from_here))
            .with_state(shown);
        Ok(Self { listener, router, url })
    }

    /// The address of the page, with its token.
    #[must_use]
    pub fn url(&self) -> &str {
        &self.url
    }

    /// Serves until the future that it returns is dropped.
    pub async fn serve(self) {
        let connections = Connections::new();
        let mut served = JoinSet::new();
        loop {
            let accepted = tokio::select! {
                accepted = self.listener.accept() => accepted,
                Some(_) = served.join_next() => continue,
            };
            match accepted {
                Ok((stream, peer)) => {
                    if let Some(connection) = connections.add(peer.ip()) {
                        served.spawn(connected(stream, connection, self.router.clone()));
                    }
                }
                // Such as too many open files: others may be closed soon.
                Err(_) => tokio::time::sleep(RETRY).await,
            }
        }
    }
}

/// How long the server waits after a connection that could not be accepted.
const RETRY: Duration = Duration::from_millis(100);

/// Serves a connection until it is closed, by whom ever.
async fn connected(stream: TcpStream, connection: Connection, router: Router) {
    let router = router.layer(axum::Extension(connection.trust()));
    let mut server = http1::Builder::new();
    server.timer(TokioTimer::new()).header_read_timeout(HEADERS);
    let serving = server.serve_connection(TokioIo::new(stream), TowerToHyperService::new(router));
    tokio::select! {
        _ = serving => {}
        () = connection.must_close() => {}
    }
}

/// Refuses a request whose body does not arrive in time.
async fn in_time(request: Request, next: Next) -> Response {
    let late = |_| Refused(StatusCode::REQUEST_TIMEOUT, "the request did not arrive".to_owned());
    let answered = tokio::time::timeout(BODY, next.run(request)).await;
    answered.map_err(late).into_response()
}

/// A request that cannot be answered, and why.
struct Refused(StatusCode, String);

impl IntoResponse for Refused {
    fn into_response(self) -> Response {
        (self.0, [(header::CONTENT_TYPE, "text/plain; charset=utf-8")], self.1).into_response()
    }
}

fn file(kind: &'static str, content: &'static str) -> Response {
    ([(header::CONTENT_TYPE, kind)], content).into_response()
}

fn message(bytes: impl Into<Body>) -> Response {
    ([(header::CONTENT_TYPE, "application/octet-stream")], bytes.into()).into_response()
}

async fn runs(State(shown): State<Shown>) -> Response {
    let runs = shown.all().into_iter().map(|run| match run {
        RunSource::Recorded(run) => run.run().clone(),
        RunSource::Live(run) => run.run(),
    });
    let measurements = shown.measurements.as_deref().cloned();
    message(view::Runs { runs: runs.collect(), measurements }.encode_to_vec())
}

async fn overview(
    State(shown): State<Shown>,
    Path(number): Path<usize>,
) -> Result<Response, Refused> {
    match shown.run(number)? {
        RunSource::Recorded(run) => run
            .overview()
            .map(message)
            .map_err(|failure| Refused(StatusCode::INTERNAL_SERVER_ERROR, failure)),
        RunSource::Live(run) => Ok(message(run.overview().encode_to_vec())),
    }
}

async fn frames(
    State(shown): State<Shown>,
    Path(number): Path<usize>,
    Query(query): Query<BTreeMap<String, String>>,
) -> Result<Response, Refused> {
    let number_of = |key: &str| -> Result<u64, Refused> {
        let value = query.get(key).ok_or_else(|| {
            Refused(StatusCode::BAD_REQUEST, format!("{key} is missing: must be a whole number"))
        })?;
        value.parse().map_err(|_| {
            let text = format!("{key}: must be a whole number from 0, got {value:?}");
            Refused(StatusCode::BAD_REQUEST, text)
        })
    };
    let (from_ns, until_ns) = (number_of("from_ns")?, number_of("until_ns")?);
    let most = number_of("most")?;
    if MOST_FRAMES as u64 <= most.saturating_sub(1) {
        let text = format!("most: must be from 0 to {MOST_FRAMES}, got {most}");
        return Err(Refused(StatusCode::BAD_REQUEST, text));
    }
    let most = most as usize;
    let run = shown.run(number)?;
    let frames = tokio::task::spawn_blocking(move || match run {
        RunSource::Recorded(run) => run.frames(from_ns, until_ns, most),
        RunSource::Live(run) => Ok(run.frames(from_ns, until_ns, most)),
    });
    let failed = |text: String| Refused(StatusCode::INTERNAL_SERVER_ERROR, text);
    let frames = frames.await.map_err(|error| failed(error.to_string()))?;
    let frames = frames.map_err(|error| failed(error.to_string()))?;
    Ok(message(view::Frames { frames }.encode_to_vec()))
}

async fn live(State(shown): State<Shown>) -> Result<Response, Refused> {
    let RunSource::Live(run) = shown.run(0)? else {
        return Err(Refused(StatusCode::CONFLICT, "this run has ended: replay it".to_owned()));
    };
    let messages = futures::stream::unfold(run.viewer(), async |mut viewer: Viewer| {
        let next = viewer.next().await?;
        Some((Ok::<Bytes, std::convert::Infallible>(next), viewer))
    });
    Ok(message(Body::from_stream(messages.boxed())))
}

async fn control(State(shown): State<Shown>, body: Bytes) -> Result<Response, Refused> {
    let RunSource::Live(run) = shown.run(0)? else {
        return Err(Refused(StatusCode::CONFLICT, "this run has ended".to_owned()));
    };
    if !run.run().controllable {
        let text = "this run is shown only: start it with --live-control to pause and step it here";
        return Err(Refused(StatusCode::FORBIDDEN, text.to_owned()));
    }
    let asked = view::Control::decode(body)
        .map_err(|error| Refused(StatusCode::BAD_REQUEST, format!("not a Control: {error}")))?;
    run.pace().control(asked.kind());
    Ok(StatusCode::NO_CONTENT.into_response())
}
