//! Putting a service on a socket.

use super::{
    CONNECTION_WINDOW_BYTES, FRAME_BYTES, MAX_MESSAGE_BYTES, NetHost, OrdersFromOutside, RobotHost,
    STREAM_WINDOW_BYTES,
};
use crate::services::net_sim_service_server::NetSimServiceServer;
use crate::services::robot_sim_service_server::RobotSimServiceServer;
use crate::use_threads;
use proto::side::{NetSimulator, RobotSimulator};
use proto_messages::FILE_DESCRIPTOR_SET;
use std::fmt;
use std::io::{IsTerminal as _, Read as _, Write as _};
use std::net::SocketAddr;
use std::os::unix::fs::PermissionsExt as _;
use std::path::{Path, PathBuf};
use std::str::FromStr;
use std::time::Duration;
use tokio::net::{TcpListener, UnixListener};
use tokio::signal::unix::{Signal, SignalKind, signal};
use tokio_stream::wrappers::UnixListenerStream;
use tonic::service::Routes;
use tonic::transport::server::TcpIncoming;
use tonic::transport::{Certificate, Identity, Server, ServerTlsConfig};
use tracing_subscriber::filter::Targets;
use tracing_subscriber::layer::SubscriberExt as _;
use tracing_subscriber::util::SubscriberInitExt as _;

/// Where a simulator listens.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Listen {
    /// An address and a port; with port 0 the system chooses one.
    Tcp(SocketAddr),
    /// A socket of this machine, at this path: whoever may open it reaches the simulator.
    Unix(PathBuf),
}

impl FromStr for Listen {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text.strip_prefix("unix:") {
            Some("") => Err("unix: must be followed by the path of a socket".to_owned()),
            Some(path) => Ok(Self::Unix(PathBuf::from(path))),
            None => text
                .parse()
                .map(Self::Tcp)
                .map_err(|_| "must be ADDRESS:PORT or unix:PATH".to_owned()),
        }
    }
}

/// Names where a simulator listens that a `command` of an experiment file has started.
pub const LISTEN_VARIABLE: &str = "MURMURATION_LISTEN";

impl Default for Listen {
    /// Where [`LISTEN_VARIABLE`] says; if it is absent, a free port of this machine. What cannot be read ends the program, as a
    /// wrong option does.
    fn default() -> Self {
        let text = std::env::var(LISTEN_VARIABLE).unwrap_or_else(|_| "127.0.0.1:0".to_owned());
        text.parse().unwrap_or_else(|reason| {
            let message = format!("{LISTEN_VARIABLE}: {reason}, got {text:?}\n");
            clap::Error::raw(clap::error::ErrorKind::ValueValidation, message).exit()
        })
    }
}

impl fmt::Display for Listen {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Tcp(address) => address.fmt(formatter),
            Self::Unix(path) => write!(formatter, "unix:{}", path.display()),
        }
    }
}

/// The command line of a simulator's own program. The same for both.
#[derive(Clone, Debug, clap::Args)]
pub struct ServeArgs {
    /// How the simulator is served.
    #[command(flatten)]
    pub options: ServeOptions,
    /// Set the log level: error, warn, info, debug, trace, or a filter such as netsim=debug
    #[arg(long, value_name = "FILTER", default_value = "warn")]
    pub log: String,
    /// Log as JSON, one object per line
    #[arg(long)]
    pub log_json: bool,
}

/// How a simulator is served, without logging, which a program may have options of its own for.
#[derive(Clone, Debug, clap::Args)]
pub struct ServeOptions {
    /// Address and port to listen on, or unix:PATH; with port 0 the system chooses a free port
    #[arg(long, value_name = "ADDR", default_value_t)]
    pub listen: Listen,
    /// Certificate chain of this server (PEM); required on other than loopback addresses
    #[arg(long, value_name = "FILE", requires = "tls_key")]
    pub tls_cert: Option<PathBuf>,
    /// Private key of this server (PEM)
    #[arg(long, value_name = "FILE", requires = "tls_cert")]
    pub tls_key: Option<PathBuf>,
    /// Accept only clients with a certificate signed by this authority (PEM)
    #[arg(long, value_name = "FILE", requires = "tls_cert")]
    pub tls_client_ca: Option<PathBuf>,
    /// Allow other than loopback addresses without TLS: anyone on the network can then read and control the experiment
    #[arg(long)]
    pub insecure_no_tls: bool,
    /// Take orders from other programs (the call Command) only with the token in this file
    #[arg(long, value_name = "FILE", conflicts_with = "refuse_orders")]
    pub require_token: Option<PathBuf>,
    /// Take no orders from other programs
    #[arg(long, hide = true)]
    pub refuse_orders: bool,
    /// Number of threads; results do not depend on it [default: one per core]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..))]
    pub threads: Option<u16>,
    /// Exit when standard input closes, that is, when the parent process ends
    #[arg(long, hide = true)]
    pub exit_with_parent: bool,
}

/// Why a simulator cannot be served.
#[derive(Debug, thiserror::Error)]
pub enum ServeError {
    /// The address is not usable: taken, or not of this machine.
    #[error("--listen {address}: {source}")]
    Listen {
        /// The address asked for.
        address: Listen,
        /// What the system says.
        source: std::io::Error,
    },
    /// Off loopback, traffic must be encrypted unless the user spells out otherwise.
    #[error(
        "--listen {0}: is not a loopback address, so TLS is required; give --tls-cert and --tls-key, or --insecure-no-tls \
         if everyone on that network may read and control the experiment"
    )]
    TlsRequired(Listen),
    /// A certificate or key file cannot be read.
    #[error("{option} {path}: {source}")]
    TlsFile {
        /// The option that names it.
        option: &'static str,
        /// The file.
        path: PathBuf,
        /// What the system says.
        source: std::io::Error,
    },
    /// A file that only its owner may read can be read by others.
    #[error(
        "{option} {}: other users can read it (its mode is {mode:03o}); run: chmod 600 {}",
        path.display(), path.display()
    )]
    Readable {
        /// The option that names it.
        option: &'static str,
        /// The file.
        path: PathBuf,
        /// Its permissions.
        mode: u32,
    },
    /// A token is not one.
    #[error("--require-token {}: must hold one line of 16 to 200 letters, digits, '-', '_' or '.'", .0.display())]
    Token(PathBuf),
    /// TLS is not for sockets of one machine.
    #[error("--listen {0}: a Unix socket takes no TLS; leave out --tls-cert and --tls-key")]
    TlsOnUnix(Listen),
    /// A certificate or key is not what it should be.
    #[error("--tls-cert, --tls-key or --tls-client-ca: {0}")]
    Tls(String),
    /// The log filter cannot be read.
    #[error("--log {filter}: {reason}")]
    Log {
        /// The filter.
        filter: String,
        /// What is wrong with it.
        reason: String,
    },
    /// Serving ended with an error.
    #[error("the server stopped: {0}")]
    Transport(String),
}

/// Serves a robot simulator until the process receives a request to end.
///
/// # Errors
///
/// See [`ServeError`].
pub fn serve_robots<S: RobotSimulator>(simulator: S, args: &ServeArgs) -> Result<(), ServeError> {
    let host = RobotHost::new(simulator).with_orders(orders(&args.options)?);
    let service = RobotSimServiceServer::new(host)
        .max_decoding_message_size(MAX_MESSAGE_BYTES)
        .max_encoding_message_size(MAX_MESSAGE_BYTES);
    let name = <RobotSimServiceServer<RobotHost<S>> as tonic::server::NamedService>::NAME;
    serve(S::NAME, name, args, Routes::new(service))
}

/// Serves a network simulator until the process receives a request to end.
///
/// # Errors
///
/// See [`ServeError`].
pub fn serve_network<S: NetSimulator>(simulator: S, args: &ServeArgs) -> Result<(), ServeError> {
    let host = NetHost::new(simulator).with_orders(orders(&args.options)?);
    let service = NetSimServiceServer::new(host)
        .max_decoding_message_size(MAX_MESSAGE_BYTES)
        .max_encoding_message_size(MAX_MESSAGE_BYTES);
    let name = <NetSimServiceServer<NetHost<S>> as tonic::server::NamedService>::NAME;
    serve(S::NAME, name, args, Routes::new(service))
}

/// Starts logging to standard error. Lines carry no wall-clock time, so that the logs of two runs can be compared.
///
/// # Errors
///
/// A filter that cannot be read.
pub fn init_logging(filter: &str, json: bool) -> Result<(), ServeError> {
    init_logging_to(filter, json, std::io::stderr)
}

/// As [`init_logging`], to writers that `writer` makes.
///
/// # Errors
///
/// A filter that cannot be read.
pub fn init_logging_to<W: std::io::Write + 'static>(
    filter: &str,
    json: bool,
    writer: impl Fn() -> W + Send + Sync + 'static,
) -> Result<(), ServeError> {
    let targets = filter.parse::<Targets>().map_err(|error| ServeError::Log {
        filter: filter.to_owned(),
        reason: error.to_string(),
    })?;
    let lines = tracing_subscriber::fmt::layer()
        .with_writer(writer)
        .with_ansi(std::io::stderr().is_terminal())
        .without_time();
    let registry = tracing_subscriber::registry().with(targets);
    // A second start within one process (tests) keeps the first.
    let _ =
        if json { registry.with(lines.json()).try_init() } else { registry.with(lines).try_init() };
    Ok(())
}

/// Not generic, so that HTTP/2 and TLS are compiled once, here.
fn serve(
    simulator: &'static str,
    service: &'static str,
    args: &ServeArgs,
    routes: Routes,
) -> Result<(), ServeError> {
    init_logging(&args.log, args.log_json)?;
    let args = &args.options;
    let tls = tls_config(args)?;
    match &args.listen {
        Listen::Tcp(address)
            if !address.ip().is_loopback() && tls.is_none() && !args.insecure_no_tls =>
        {
            return Err(ServeError::TlsRequired(args.listen.clone()));
        }
        Listen::Unix(_) if tls.is_some() => {
            return Err(ServeError::TlsOnUnix(args.listen.clone()));
        }
        _ => {}
    }
    use_threads(args.threads);
    let runtime = tokio::runtime::Builder::new_current_thread()
        .enable_all()
        .build()
        .map_err(|error| ServeError::Transport(error.to_string()))?;
    let result = runtime.block_on(async {
        let listener = Listener::bind(&args.listen)
            .await
            .map_err(|source| ServeError::Listen { address: args.listen.clone(), source })?;
        let (health, health_service) = tonic_health::server::health_reporter();
        health.set_service_status(service, tonic_health::ServingStatus::Serving).await;
        let reflection = || {
            tonic_reflection::server::Builder::configure()
                .register_encoded_file_descriptor_set(FILE_DESCRIPTOR_SET)
                .register_encoded_file_descriptor_set(tonic_health::pb::FILE_DESCRIPTOR_SET)
        };
        let unusable =
            |error: tonic_reflection::server::Error| ServeError::Transport(error.to_string());
        let routes = routes
            .add_service(health_service)
            .add_service(reflection().build_v1().map_err(unusable)?)
            // Some clients, grpcio-reflection among them, know only the older name of the same service.
            .add_service(reflection().build_v1alpha().map_err(unusable)?);
        let mut server = Server::builder()
            .initial_stream_window_size(STREAM_WINDOW_BYTES)
            .initial_connection_window_size(CONNECTION_WINDOW_BYTES)
            .max_frame_size(FRAME_BYTES)
            .http2_keepalive_interval(Some(Duration::from_secs(30)))
            .max_concurrent_streams(64);
        let scheme = if let Some(tls) = tls {
            server = server.tls_config(tls).map_err(|error| ServeError::Tls(chain(&error)))?;
            "https"
        } else {
            "http"
        };
        let router = server.add_routes(routes);
        // Before the address is known to anyone.
        let end = end(args.exit_with_parent);
        let serving = async {
            match listener {
                Listener::Tcp(listener, address) => {
                    announce(simulator, &format!("{scheme}://{address}"));
                    let incoming = TcpIncoming::from(listener).with_nodelay(Some(true));
                    router.serve_with_incoming(incoming).await
                }
                Listener::Unix(listener, path) => {
                    announce(simulator, &format!("unix:{}", path.display()));
                    let _left = Left { path, with_folder: args.exit_with_parent };
                    router.serve_with_incoming(UnixListenerStream::new(listener)).await
                }
            }
        };
        tokio::select! {
            result = serving => result.map_err(|error| ServeError::Transport(chain(&error))),
            () = end => Ok(()),
        }
    });
    // A step that still runs on a blocking thread is not waited for.
    runtime.shutdown_background();
    result
}

/// A socket that listens, and where.
enum Listener {
    Tcp(TcpListener, SocketAddr),
    Unix(UnixListener, PathBuf),
}

/// A socket's file, removed at the end; with the folder, if nothing else is in it, where the parent process made one and may have
/// ended without removing it.
struct Left {
    path: PathBuf,
    with_folder: bool,
}

impl Drop for Left {
    fn drop(&mut self) {
        let _ = std::fs::remove_file(&self.path);
        if let Some(folder) = self.path.parent().filter(|_| self.with_folder) {
            let _ = std::fs::remove_dir(folder);
        }
    }
}

impl Listener {
    async fn bind(listen: &Listen) -> std::io::Result<Self> {
        match listen {
            Listen::Tcp(address) => {
                let listener = TcpListener::bind(address).await?;
                let address = listener.local_addr()?;
                Ok(Self::Tcp(listener, address))
            }
            Listen::Unix(path) => Ok(Self::Unix(UnixListener::bind(path)?, path.clone())),
        }
    }
}

/// The one line on standard output that says where to connect.
fn announce(simulator: &str, url: &str) {
    let mut out = std::io::stdout().lock();
    // Nobody may be reading: that is no reason not to serve.
    let _ = writeln!(out, "{simulator} listening on {url}");
    let _ = out.flush();
    tracing::info!(url, "serving");
}

/// Who may give orders from outside.
fn orders(args: &ServeOptions) -> Result<OrdersFromOutside, ServeError> {
    const OPTION: &str = "--require-token";
    if args.refuse_orders {
        return Ok(OrdersFromOutside::Nobody);
    }
    let Some(path) = &args.require_token else { return Ok(OrdersFromOutside::Anyone) };
    let text = String::from_utf8(read_secret(OPTION, path)?).unwrap_or_default();
    let token = text.trim_end();
    let is_plain = |c: char| c.is_ascii_alphanumeric() || matches!(c, '-' | '_' | '.');
    if !(16..=200).contains(&token.len()) || !token.chars().all(is_plain) {
        return Err(ServeError::Token(path.clone()));
    }
    Ok(OrdersFromOutside::WithToken(token.to_owned()))
}

/// Completes when a signal or the parent ends the process. It listens as soon as it is called, so that no signal is lost that comes
/// before it is polled.
fn end(with_parent: bool) -> impl Future<Output = ()> {
    let (parent_lives, parent_ended) = tokio::sync::oneshot::channel::<()>();
    if with_parent {
        // Dropped, and so noticed, when standard input closes.
        std::thread::spawn(move || {
            let _parent_lives = parent_lives;
            let mut byte = [0];
            while !matches!(std::io::stdin().read(&mut byte), Ok(0) | Err(_)) {}
        });
    } else {
        std::mem::forget(parent_lives);
    }
    let hang_up = if ignores_hangup() { None } else { signal(SignalKind::hangup()).ok() };
    let terminate = signal(SignalKind::terminate()).ok();
    let interrupt = signal(SignalKind::interrupt()).ok();
    async move {
        tokio::select! {
            _ = parent_ended => {}
            () = received(hang_up) => {}
            () = received(terminate) => {}
            () = received(interrupt) => {}
        }
    }
}

/// Completes when a signal has come; never without one.
async fn received(signal: Option<Signal>) {
    match signal {
        Some(mut signal) => {
            signal.recv().await;
        }
        None => std::future::pending().await,
    }
}

/// Whether this process was started to ignore SIGHUP, as `nohup` starts it. To be asked before anyone listens for that signal.
/// Always false where the system has no `/proc`.
#[must_use]
pub fn ignores_hangup() -> bool {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let ignored = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    // A bit for each signal; SIGHUP is the first.
    ignored.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok()).is_some_and(|m| m & 1 == 1)
}

fn tls_config(args: &ServeOptions) -> Result<Option<ServerTlsConfig>, ServeError> {
    let (Some(cert), Some(key)) = (&args.tls_cert, &args.tls_key) else { return Ok(None) };
    let identity = Identity::from_pem(read("--tls-cert", cert)?, read_secret("--tls-key", key)?);
    let mut tls = ServerTlsConfig::new().identity(identity).timeout(Duration::from_secs(10));
    if let Some(ca) = &args.tls_client_ca {
        tls = tls.client_ca_root(Certificate::from_pem(read("--tls-client-ca", ca)?));
    }
    Ok(Some(tls))
}

fn read(option: &'static str, path: &Path) -> Result<Vec<u8>, ServeError> {
    std::fs::read(path).map_err(|source| ServeError::TlsFile {
        option,
        path: path.to_owned(),
        source,
    })
}

/// A file that nobody but its owner may read.
fn read_secret(option: &'static str, path: &Path) -> Result<Vec<u8>, ServeError> {
    let content = read(option, path)?;
    let mode = std::fs::metadata(path).map_or(0, |metadata| metadata.permissions().mode()) & 0o777;
    if mode & 0o077 == 0 {
        return Ok(content);
    }
    Err(ServeError::Readable { option, path: path.to_owned(), mode })
}

/// An error and its causes in one line.
fn chain(error: &dyn std::error::Error) -> String {
    let mut text = error.to_string();
    let mut cause = error.source();
    while let Some(error) = cause {
        text = format!("{text}: {error}");
        cause = error.source();
    }
    text
}
