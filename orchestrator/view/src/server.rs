//! The server of the page: on the loopback address, for those who know its token.
//!
//! Another page in the same browser can send requests here, too. It cannot read or drive a run: it does not know the token, which
//! travels in a header that browsers do not add; and requests with another host or origin are refused.
//!
//! Another user of this machine can connect, too. Connections are limited in number, and in time until the token comes over them.

mod access;
mod connections;
mod player;

pub use access::{Access, is_same};
pub use player::{player, player_file, within};

use crate::live::LiveRun;
use crate::recorded::RecordedRun;
use crate::view;
use axum::Router;
use axum::extract::DefaultBodyLimit;
use axum::http::{StatusCode, header};
use axum::middleware;
use axum::response::{IntoResponse, Response};
use connections::{Connection, Connections, HEADERS};
use hyper::server::conn::http1;
use hyper_util::rt::{TokioIo, TokioTimer};
use hyper_util::service::TowerToHyperService;
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
    /// Listens on a port of the loopback address (0: any that is free) with the page that shows runs.
    ///
    /// # Errors
    ///
    /// The port is in use, or the system has no random numbers for the token.
    pub async fn bind(port: u16, shown: Shown) -> std::io::Result<Self> {
        Self::with(port, |access| player(access, shown)).await
    }

    /// The same with a site, whose calls [`Access::guard`] guards.
    ///
    /// # Errors
    ///
    /// As [`Self::bind`].
    pub async fn with(
        port: u16,
        site: impl FnOnce(&Access) -> Router + Send,
    ) -> std::io::Result<Self> {
        let listener = TcpListener::bind(SocketAddr::from((Ipv4Addr::LOCALHOST, port))).await?;
        let port = listener.local_addr()?.port();
        let access = Access::new(port)?;
        let url = format!("http://127.0.0.1:{port}/?token={}", access.token());
        let router = site(&access)
            .layer(DefaultBodyLimit::max(MOST_REQUEST_BYTES))
            .layer(middleware::from_fn_with_state(access, access::from_here));
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

/// A request that cannot be answered, and why.
#[derive(Debug)]
pub struct Refused(pub StatusCode, pub String);

impl IntoResponse for Refused {
    fn into_response(self) -> Response {
        (self.0, [(header::CONTENT_TYPE, "text/plain; charset=utf-8")], self.1).into_response()
    }
}

/// A file of a page.
#[must_use]
pub fn file(kind: &'static str, content: &'static str) -> Response {
    ([(header::CONTENT_TYPE, kind)], content).into_response()
}
